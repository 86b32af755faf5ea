#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Acoustic modems of the EvoLogics kind on TCP ports, and the water between them.

Written from what is public of the command language; it shares nothing with the adapter but that:
EviNS (github.com/okebkal/evins, src/role_at.erl) and dmac (github.com/EvoLogics/dmac, src/parser.h,
msg/DMACPayload.msg) by the manufacturer, DUNE (github.com/LSTS/dune, src/Transports/Evologics).

The water: a signal takes distance / 1500 m/s, and lasts `overhead` + bits / `rate`. A modem that
transmits hears nothing; two signals that overlap where they arrive are both lost. What the texts
behind ERROR and BUSY are is not public in full; those used here are of the public drivers, or
stand for one.
"""

import argparse
import asyncio
import random
import re
import sys

SOUND = 1500.0
BROADCAST = 255
LONGEST = 64


class Modem:
    def __init__(self, water, address, port):
        self.water = water
        self.address = address
        self.port = port
        self.clients = []
        self.extended = False
        self.voice = [(0.0, 0.0)]  # when it transmitted: begin and end
        self.waiting = None  # of an acknowledgement: (destination, handle)
        self.arriving = []  # signals: [begin, end, spoilt]
        self.received = 0

    # --- the user's side -------------------------------------------------------------------------
    async def serve(self):
        server = await asyncio.start_server(self.client, "127.0.0.1", self.port)
        self.port = server.sockets[0].getsockname()[1]
        return server

    async def client(self, reader, writer):
        wrapped = [False]  # whether the last command came in data mode
        self.clients.append((writer, wrapped))
        buffer = b""
        try:
            while True:
                chunk = await reader.read(4096)
                if not chunk:
                    break
                buffer += chunk
                while True:
                    used = self.command(buffer, writer, wrapped)
                    if used == 0:
                        break
                    buffer = buffer[used:]
        except ConnectionError:
            pass
        finally:
            self.clients.remove((writer, wrapped))
            writer.close()

    def command(self, buffer, writer, wrapped):
        """Answers the first command of the buffer; how long it is, 0 where it is incomplete."""
        plus = buffer.startswith(b"+++AT")
        text = buffer[3:] if plus else buffer
        skip = 3 if plus else 0
        head = re.match(rb"AT\*SENDIM,(?:p\d+,)?(\d+),(\d+),(ack|noack|force),", text)
        if head:
            length = int(head.group(1))
            if len(text) < head.end() + length + 1:
                return 0
            end = head.end() + length
            wrapped[0] = plus
            if text[end : end + 1] not in (b"\n", b"\r"):
                self.answer(writer, wrapped, b"*SENDIM", b"ERROR WRONG FORMAT")
                return skip + end
            reply = self.send_im(int(head.group(2)), head.group(3), text[head.end() : end])
            self.answer(writer, wrapped, b"*SENDIM", reply)
            if reply == b"OK":
                self.transmit_im(int(head.group(2)), head.group(3), text[head.end() : end])
            return skip + end + 1
        line = re.match(rb"([^\r\n]*)[\r\n]", text)
        if not line:
            return 0
        wrapped[0] = plus
        name = line.group(1)
        if name == b"AT@CTRL":
            self.answer(writer, wrapped, b"@CTRL", b"OK")
        elif name in (b"AT@ZX1", b"AT@ZX0"):
            self.extended = name.endswith(b"1")
            self.answer(writer, wrapped, b"@ZX", b"OK")
        elif name == b"AT?AL":
            self.answer(writer, wrapped, b"?AL", str(self.address).encode())
        elif name.startswith(b"AT*SENDIM"):
            self.answer(writer, wrapped, b"*SENDIM", b"ERROR WRONG FORMAT")
        elif name:
            self.answer(writer, wrapped, name[2:], b"ERROR UNKNOWN COMMAND")
        return skip + line.end()

    @staticmethod
    def answer(writer, wrapped, request, text):
        if wrapped[0]:
            text = b"+++AT%s:%d:%s" % (request, len(text), text)
        writer.write(text + b"\r\n")

    def tell(self, text):
        """Something that nobody asked for."""
        for writer, wrapped in self.clients:
            self.answer(writer, wrapped, b"", text)

    # --- the water's side ------------------------------------------------------------------------
    def send_im(self, destination, flag, data):
        now = self.water.now()
        if not 0 < len(data) <= LONGEST or destination > BROADCAST:
            return b"ERROR OUT OF RANGE"
        if flag == b"ack" and destination == BROADCAST:
            return b"ERROR WRONG FORMAT"
        if self.voice[-1][1] > now or self.waiting:
            return b"BUSY DELIVERING INSTANT MESSAGE"
        if flag != b"force" and any(b <= now < e for b, e, _ in self.arriving):
            return b"BUSY BACKOFF STATE"
        return b"OK"

    def transmit_im(self, destination, flag, data):
        end = self.transmit(len(data), ("im", destination, flag, data))
        if flag == b"ack":
            self.waiting = (
                destination,
                self.water.at(end + self.water.longest_ack(), self.missed),
            )

    # What overlaps is judged by the times at which things happen in the water: the callbacks may
    # come later, as the machine has other things to do.
    def transmit(self, size, what):
        duration = self.water.duration(size)
        begin = self.water.now()
        end = begin + duration
        self.voice = self.voice[-3:] + [(begin, end)]
        if self.extended:
            address = what[1]
            self.tell(b"SENDSTART,%d,%s,%d,0" % (address, what[0].encode(), 1e6 * duration))
        self.water.at(end, self.sent, what, duration)
        for other in self.water.modems:
            if other is not self:
                signal = [begin + self.water.delay, end + self.water.delay, False]
                self.water.at(signal[0], other.begin, signal)
                self.water.at(signal[1], other.end, self, signal, what)
        return end

    def sent(self, what, duration):
        if self.extended:
            now = int(1e6 * self.water.now()) % 2**32
            self.tell(b"SENDEND,%d,%s,%d,%d" % (what[1], what[0].encode(), now, 1e6 * duration))

    def speaks_during(self, begin, end):
        return any(b < end and begin < e for b, e in self.voice)

    def begin(self, signal):
        for other in self.arriving:
            if other[1] > signal[0]:
                other[2] = signal[2] = True
        self.arriving.append(signal)
        if self.extended and not self.speaks_during(signal[0], signal[0]):
            self.tell(b"RECVSTART")

    def end(self, sender, signal, what):
        self.arriving.remove(signal)
        water = self.water
        duration = 1e6 * (signal[1] - signal[0])
        lost = signal[2] or self.speaks_during(signal[0], signal[1])
        chance = water.random.random()
        if not lost and chance < water.loss:
            lost = True
        integrity = 60 if not lost and water.random.random() < water.damage else 180
        if self.extended:
            if lost:
                self.tell(b"RECVFAILED,0.02,-75,20")
            else:
                now = int(1e6 * water.now()) % 2**32
                self.tell(b"RECVEND,%d,%d,-45,%d" % (now, duration, integrity))
        if lost:
            return
        kind, destination, flag, data = what
        if kind == "ack":
            if self.waiting and self.waiting[0] == sender.address and destination == self.address:
                self.waiting[1].cancel()
                self.waiting = None
                self.tell(b"DELIVEREDIM,%d" % sender.address)
            return
        if destination not in (self.address, BROADCAST):
            return
        if integrity < 100:  # some of it is wrong, and the modem has not noticed
            data = bytearray(data)
            data[water.random.randrange(len(data))] ^= 1 << water.random.randrange(8)
            if water.hide:
                integrity = 180
        self.received += 1
        text = b"RECVIM,%d,%d,%d,%s,%d,-45,%d,0.02," % (
            len(data), sender.address, destination, flag, duration, integrity)  # fmt: skip
        self.tell(text + bytes(data))
        if water.double and self.received % water.double == 0:
            self.tell(text + bytes(data))
        if flag == b"ack" and self.voice[-1][1] <= water.now():
            self.transmit(0, ("ack", sender.address, b"", b""))

    def missed(self):
        destination = self.waiting[0]
        self.waiting = None
        self.tell(b"FAILEDIM,%d" % destination)


class Water:
    def __init__(self, options):
        self.loop = asyncio.get_running_loop()
        self.random = random.Random(options.seed)
        self.delay = options.distance / SOUND
        self.rate = options.rate
        self.overhead = options.overhead
        self.loss = options.loss
        self.damage = options.damage
        self.hide = options.hide
        self.double = options.double
        self.modems = []

    def now(self):
        return self.loop.time()

    def at(self, time, function, *arguments):
        return self.loop.call_at(time, function, *arguments)

    def duration(self, size):
        return self.overhead + 8 * size / self.rate

    def longest_ack(self):
        return 2 * self.delay + self.duration(0) + 0.2


async def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--modems", default="1:0,2:0", help="address:port,…; port 0: any")
    parser.add_argument("--distance", type=float, default=15, help="m, of all modems")
    parser.add_argument("--rate", type=float, default=976, help="bit/s")
    parser.add_argument("--overhead", type=float, default=0.1, help="s, of a signal beside its bits")
    parser.add_argument("--loss", type=float, default=0, help="share of signals that are lost")
    parser.add_argument("--damage", type=float, default=0, help="share that arrive with a wrong bit")
    parser.add_argument("--hide", action="store_true", help="… and say that all is well")
    parser.add_argument("--double", type=int, default=0, help="each n-th message is told twice")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    water = Water(options)
    servers = []
    for item in options.modems.split(","):
        address, port = item.split(":")
        modem = Modem(water, int(address), int(port))
        water.modems.append(modem)
        servers.append(await modem.serve())
    print("ports", *(m.port for m in water.modems), "ready", flush=True)
    await asyncio.gather(*(s.serve_forever() for s in servers))


if __name__ == "__main__":
    try:
        asyncio.run(main())
    except KeyboardInterrupt:
        sys.exit(0)
