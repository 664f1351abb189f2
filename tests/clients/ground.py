"""A ground station: pymavlink from PyPI listens on a free port of this machine.

    ground.py SECONDS NAME COUNT    prints the port, then COUNT messages of this name as JSON and a heartbeat, or what came in that time
"""

import json
import sys
import time

import os

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "common"
from pymavlink import mavutil  # noqa: E402


def main(seconds, name, count):
    link = mavutil.mavlink_connection("udpin:127.0.0.1:0", dialect="common")
    print(link.port.getsockname()[1], flush=True)
    until, found, heart = time.time() + float(seconds), [], None
    while time.time() < until and (len(found) < int(count) or heart is None):
        message = link.recv_match(blocking=True, timeout=0.2)
        if message is None:
            continue
        told = dict(
            message.to_dict(),
            system=message.get_srcSystem(),
            component=message.get_srcComponent(),
            sequence=message.get_seq(),
            magic=message.get_msgbuf()[0],
        )
        if message.get_type() == "HEARTBEAT":
            heart = told
        elif message.get_type() == name:
            found.append(told)
    print(json.dumps({"heartbeat": heart, "found": found[: int(count)]}).replace("NaN", "null"))


if __name__ == "__main__":
    main(*sys.argv[1:])
