"""An Embedded Python Block of GNU Radio: two streams in, precoded by P_U for two antennas out.

Its message port `slot` takes what `faao-mission fly --radio` tells: from the port `pdus` of a
Socket PDU block (UDP Server, MTU 10000), or from the port `out` of a ZMQ SUB Message Source.
"""

import json

import numpy as np
import pmt
from gnuradio import gr


class blk(gr.sync_block):
    """Precode two streams by the precoder of the slot that was told last."""

    def __init__(self, name="P_U"):
        gr.sync_block.__init__(self, "precoder", [np.complex64] * 2, [np.complex64] * 2)
        self.name_of_precoder, self.P = name, np.eye(2)
        self.message_port_register_in(pmt.intern("slot"))
        self.set_msg_handler(pmt.intern("slot"), self.take)

    def take(self, message):
        """Take the precoder of a slot from its line of JSON."""
        told = json.loads(bytes(pmt.u8vector_elements(pmt.cdr(message))))
        self.P = np.array(told[self.name_of_precoder]) @ [1, 1j]

    def work(self, streams, antennas):
        """Write the precoded samples of each antenna."""
        for antenna, row in zip(antennas, self.P, strict=True):
            antenna[:] = row[0] * streams[0] + row[1] * streams[1]
        return len(antennas[0])
