"""Receive what `faao-mission fly --radio` tells: the slots that are due, and their precoders."""

import json
import socket

import numpy as np


def slots(port):
    """Yield each slot that is due, with P_B and P_U (√W), from the UDP port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        radio.bind(("127.0.0.1", port))
        while True:
            told = json.loads(radio.recv(65_536))
            P_B, P_U = (np.array(told[name]) @ [1, 1j] for name in ("P_B", "P_U"))
            yield told["slot"], P_B, P_U
