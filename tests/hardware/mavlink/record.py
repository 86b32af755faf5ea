# SPDX-License-Identifier: BSD-3-Clause
"""Writes what an autopilot sends, packed by pymavlink: for each frame a line with its bytes in hex
and the values that are in them. The test damages the bytes, and knows from the lines what is left.

    <hex> HEARTBEAT <mode> <armed>
    <hex> ATTITUDE <boot_ms> <roll> <pitch> <yaw> <p> <q> <r>
    <hex> POSITION <boot_ms> <x> <y> <z> <vx> <vy> <vz>
    <hex> OTHER
"""

import random
import struct
import sys

from pymavlink.dialects.v20 import ardupilotmega as mavlink


def single(x):
    """As a float carries it."""
    return struct.unpack("<f", struct.pack("<f", x))[0]


def main():
    count, seed = int(sys.argv[1]), int(sys.argv[2])
    draw = random.Random(seed)
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)

    sender.signing.secret_key = bytes(32)

    def put(message, *words, old=False):
        sender.signing.sign_outgoing = not old and draw.random() < 0.1
        data = message.pack(sender, force_mavlink1=old)
        sender.seq = (sender.seq + 1) % 256
        print(data.hex(), *words)

    for k in range(count):
        stamp = 1000 + 10 * k
        old = k % 7 == 3  # MAVLink 1 among them
        kind = k % 5
        if kind in (0, 2):
            v = [single(draw.uniform(-3, 3)) for _ in range(6)]
            v[1] = single(v[1] / 2.5)
            put(mavlink.MAVLink_attitude_message(stamp, *v), "ATTITUDE", stamp, *v, old=old)
        elif kind in (1, 3):
            # Zeros at the end are cut off by MAVLink 2.
            v = [single(draw.uniform(-9, 9)) if k % 3 else 0.0 for _ in range(6)]
            v[0] = single(draw.uniform(-9, 9))
            put(mavlink.MAVLink_local_position_ned_message(stamp, *v), "POSITION", stamp, *v, old=old)
        elif k % 2:
            mode, armed = draw.choice([0, 2, 4, 19]), draw.choice([0, 1])
            put(
                mavlink.MAVLink_heartbeat_message(12, 3, 1 | 128 * armed, mode, 4, 3),
                "HEARTBEAT", mode, armed, old=old,
            )
        else:
            put(mavlink.MAVLink_statustext_message(6, b"a text with \xfd and \xfe in it"), "OTHER")


main()
