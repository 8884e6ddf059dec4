"""Publish what `faao-mission fly --radio` tells over ZMQ, as a ZMQ SUB Message Source takes it."""

import socket

import pmt
import zmq


def publish(port, to="tcp://127.0.0.1:5555"):
    """Publish each datagram of the UDP port as a message of GNU Radio."""
    radios = zmq.Context().socket(zmq.PUB)
    radios.bind(to)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as told:
        told.bind(("127.0.0.1", port))
        while True:
            line = told.recv(65_536)
            slot = pmt.cons(pmt.PMT_NIL, pmt.init_u8vector(len(line), list(line)))
            radios.send(pmt.serialize_str(slot))
