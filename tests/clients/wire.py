"""A wire between two hosts, of two TUN devices and nothing but Python: packets arrive later, and some never.

    wire.py DEVICE DEVICE DELAY_MS LOSS_PERCENT SEED    is there until it is killed; a line on standard input is a new share of loss
"""

import collections
import fcntl
import os
import random
import select
import struct
import sys
import time

TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
# As a queue of netem has it by itself.
ROOM = 1000


def opened(name):
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH", name.encode(), IFF_TUN | IFF_NO_PI))
    return device


def main(one, other, delay_ms, loss_percent, seed):
    ends = [opened(one), opened(other)]
    across = {ends[0]: ends[1], ends[1]: ends[0]}
    delay, loss, chance = float(delay_ms) / 1e3, float(loss_percent) / 100, random.Random(int(seed))
    waiting = collections.deque()
    print("ready", flush=True)
    while True:
        rest = max(0.0, waiting[0][0] - time.monotonic()) if waiting else None
        readable, _, _ = select.select([*ends, sys.stdin], [], [], rest)
        for source in readable:
            if source is sys.stdin:
                line = sys.stdin.readline()
                if not line:
                    return
                loss = float(line) / 100
                print("so", flush=True)
                continue
            try:
                packet = os.read(source, 65536)
            except OSError:
                # Not up yet, or down.
                time.sleep(0.001)
                continue
            if chance.random() >= loss and len(waiting) < ROOM:
                waiting.append((time.monotonic() + delay, across[source], packet))
        while waiting and waiting[0][0] <= time.monotonic():
            _, target, packet = waiting.popleft()
            try:
                os.write(target, packet)
            except OSError:
                # A host that is down hears nothing.
                pass


if __name__ == "__main__":
    main(*sys.argv[1:])
