"""Drives on a CAN line: NMT, SDO server, PDO and heartbeat of PyPI canopen, CiA 402 on top.

    drives.py --nodes 1,2,3 (--descriptor N | --interface vcan0)

A descriptor is one end of a SOCK_SEQPACKET pair that carries struct can_frame. Each drive turns a
joint that follows its target at the accelerations of the object dictionary. Prints "ready", and a
line for each change of state. Object 0x2000 makes a drive misbehave:
1 fault, 2 no process data, 3 no heartbeat, 4 restart, 5 out of operation, 0 all well again.
"""

import argparse
import os
import select
import struct
import threading
import time

import can
import canopen
from canopen import objectdictionary as od

U8, U16, U32, I8, I16, I32 = (od.UNSIGNED8, od.UNSIGNED16, od.UNSIGNED32, od.INTEGER8,
                              od.INTEGER16, od.INTEGER32)
FRAME = struct.Struct("=IB3x8s")
STATUS = {"not ready to switch on": 0x00, "switch on disabled": 0x40, "ready to switch on": 0x21,
          "switched on": 0x33, "operation enabled": 0x37, "quick stop active": 0x17,
          "fault reaction active": 0x0F, "fault": 0x08}


class PairBus(can.BusABC):
    """A descriptor that carries struct can_frame, one in each message."""

    def __init__(self, descriptor):
        super().__init__(channel=descriptor)
        self.channel_info = "descriptor %d" % descriptor
        self.descriptor = descriptor
        os.set_blocking(descriptor, False)
        try:  # a bus keeps nothing for a node that was not there
            while os.read(descriptor, FRAME.size):
                pass
        except BlockingIOError:
            pass

    def _recv_internal(self, timeout):
        if not select.select([self.descriptor], [], [], timeout)[0]:
            return None, False
        try:
            raw = os.read(self.descriptor, FRAME.size)
        except BlockingIOError:
            return None, False
        if len(raw) != FRAME.size:
            os._exit(0)  # the other end is gone
        can_id, size, data = FRAME.unpack(raw)
        return can.Message(timestamp=time.time(), arbitration_id=can_id & 0x7FF, dlc=size,
                           data=data[:size], is_extended_id=False,
                           is_remote_frame=bool(can_id & 0x40000000)), False

    def send(self, msg, timeout=None):
        try:
            os.write(self.descriptor, FRAME.pack(msg.arbitration_id, msg.dlc, bytes(msg.data)))
        except (BlockingIOError, BrokenPipeError):
            pass


def dictionary():
    objects = od.ObjectDictionary()

    def variable(index, subindex, data_type, default, access="rw"):
        v = od.ODVariable("object %04x %d" % (index, subindex), index, subindex)
        v.data_type, v.default, v.access_type = data_type, default, access
        return v

    def record(index, members):
        r = od.ODRecord("record %04x" % index, index)
        for subindex, data_type, default in members:
            r.add_member(variable(index, subindex, data_type, default))
        objects.add_object(r)

    for index, data_type, default, access in (
            (0x1000, U32, 0x00020192, "ro"), (0x1001, U8, 0, "ro"),
            (0x1008, od.VISIBLE_STRING, "a simulated drive of a joint", "ro"),
            (0x1017, U16, 0, "rw"), (0x2000, U16, 0, "rw"),
            (0x2001, od.OCTET_STRING, b"", "rw"),
            (0x6007, I16, 1, "rw"), (0x6040, U16, 0, "rw"), (0x6041, U16, 0, "ro"),
            (0x605A, I16, 2, "rw"), (0x6060, I8, 0, "rw"), (0x6064, I32, 0, "ro"),
            (0x606C, I32, 0, "ro"), (0x6078, I16, 0, "ro"), (0x607A, I32, 0, "rw"),
            (0x6081, U32, 1000000, "rw"), (0x6083, U32, 10000000, "rw"),
            (0x6084, U32, 10000000, "rw"), (0x6085, U32, 20000000, "rw"), (0x60FF, I32, 0, "rw")):
        objects.add_object(variable(index, 0, data_type, default, access))
    record(0x1016, ((0, U8, 1), (1, U32, 0)))
    for k in range(2):
        for first in (0x1400, 0x1800):
            record(first + k, ((0, U8, 5), (1, U32, 0x80000000), (2, U8, 255), (3, U16, 0),
                               (5, U16, 0)))
            record(first + k + 0x200, [(0, U8, 0)] + [(i, U32, 0) for i in range(1, 9)])
    return objects


class Drive:
    def __init__(self, network, node):
        self.network, self.id = network, node
        self.lock = threading.RLock()
        self.node = network.add_node(canopen.LocalNode(node, dictionary()))
        self.node.add_write_callback(self.on_write)
        network.subscribe(0, self.on_nmt)
        self.boot()

    def boot(self):
        with self.lock:
            self.node.data_store.clear()
            self.kept = {}
            self.node.nmt.stop_heartbeat()
            self.state, self.born = None, time.monotonic()
            self.control, self.acknowledged, self.muted = 0, False, False
            self.position, self.velocity, self.moved = 0.0, 0.0, time.monotonic()
            self.command_time = self.master_time = self.watched = None
            self.mapped = set()
            self.become("not ready to switch on")
        self.node.nmt.state = "INITIALISING"  # sends the boot-up
        self.node.nmt.state = "PRE-OPERATIONAL"

    def get(self, index, subindex=0):
        """Of the object dictionary, kept until it is written: the processor is shared."""
        value = self.kept.get((index, subindex))
        if value is None:
            value = int.from_bytes(self.node.get_data(index, subindex), "little",
                                   signed=index in (0x605A, 0x6007, 0x6060, 0x607A, 0x60FF))
            self.kept[index, subindex] = value
        return value

    def become(self, state):
        if state != self.state:
            self.state = state
            print("node %d: %s" % (self.id, state), flush=True)

    # What comes.

    def on_nmt(self, can_id, data, timestamp):
        if data[1] not in (0, self.id):
            return
        if data[0] in (129, 130):
            self.boot()
        elif data[0] == 1:
            with self.lock:
                self.node.rpdo.read()
                self.node.tpdo.read()
                for pdo in self.node.rpdo.values():
                    if pdo.enabled and pdo not in self.mapped:
                        self.mapped.add(pdo)
                        pdo.callbacks.clear()
                        pdo.add_callback(self.on_command)
                        pdo.subscribe()

    def on_write(self, index, subindex, od, data):
        self.kept.pop((index, subindex), None)
        if index == 0x1016:
            self.master_time = None
            self.watch(int.from_bytes(data, "little") >> 16 & 0x7F)
        elif index == 0x2000:
            what = int.from_bytes(data, "little")
            self.muted = what == 2
            if what == 1:
                self.fail(0x7305)
            elif what == 3:
                self.node.nmt.stop_heartbeat()
            elif what == 4:
                threading.Timer(0.01, self.boot).start()
            elif what == 5:
                self.become("switch on disabled")
        elif index == 0x6040:
            self.on_controlword(int.from_bytes(data, "little"))

    def watch(self, master):
        if self.watched is None and master:
            self.watched = master
            self.network.subscribe(0x700 + master, self.on_master)

    def on_master(self, can_id, data, timestamp):
        self.master_time = time.monotonic()

    def on_command(self, pdo):
        if self.node.nmt.state != "OPERATIONAL":
            return
        with self.lock:
            self.move()
            self.command_time = time.monotonic()
            for entry in reversed(pdo.map):  # the target before the controlword
                self.node.set_data(entry.index, entry.subindex, bytes(entry.get_data()))

    def on_controlword(self, control):
        with self.lock:
            before, self.control = self.control, control
            state, low = self.state, control & 0x0F
            if state == "fault":
                if control & 0x80 and not before & 0x80:
                    self.node.emcy.reset()
                    self.become("switch on disabled")
            elif state in ("not ready to switch on", "fault reaction active"):
                pass
            elif not low & 2:
                self.become("switch on disabled")
            elif not low & 4:
                if state == "operation enabled":
                    self.become("quick stop active")
                elif state != "quick stop active":
                    self.become("switch on disabled")
            elif state == "quick stop active":
                if low == 15 and self.get(0x605A) >= 5:
                    self.become("operation enabled")
            elif low & 7 == 6 and state != "quick stop active":
                self.become("ready to switch on")
            elif low == 7 and state in ("ready to switch on", "operation enabled"):
                self.become("switched on")
            elif low == 15 and state == "ready to switch on":
                self.become("switched on")
            elif low == 15 and state == "switched on":
                self.target = self.position
                self.become("operation enabled")
            if self.state == "operation enabled" and self.get(0x6060) == 1:
                if control & 0x10 and not before & 0x10:
                    self.target, self.acknowledged = self.get(0x607A), True
                elif not control & 0x10:
                    self.acknowledged = False

    def fail(self, code):
        with self.lock:
            if self.state not in ("fault", "fault reaction active"):
                self.node.emcy.send(code, 0x81)
                self.become("fault reaction active")

    # What moves.

    def move(self):
        now = time.monotonic()
        dt, self.moved = now - self.moved, now
        if dt <= 0:
            return
        if self.state == "not ready to switch on" and now - self.born > 0.05:
            self.become("switch on disabled")
        demand, most = 0.0, self.get(0x6085) * dt
        if self.state == "operation enabled":
            most = self.get(0x6083) * dt
            if self.get(0x6060) == 3:
                demand = self.get(0x60FF)
            else:
                demand = (self.target - self.position) / dt
                demand = max(-self.get(0x6081), min(self.get(0x6081), demand))
                most = abs(demand - self.velocity)
        self.velocity += max(-most, min(most, demand - self.velocity))
        self.position += self.velocity * dt
        if self.velocity == 0:
            if self.state == "quick stop active" and self.get(0x605A) < 5:
                self.become("switch on disabled")
            elif self.state == "fault reaction active":
                self.become("fault")

    def on_sync(self):
        with self.lock:
            self.move()
            if self.node.nmt.state != "OPERATIONAL" or self.muted:
                return
            status = STATUS[self.state] | 0x0200
            if self.acknowledged:
                status |= 0x1000
            if self.get(0x6060) == 1 and abs(self.target - self.position) < 1:
                status |= 0x0400
            measured = {0x6041: status, 0x6064: self.position, 0x606C: self.velocity, 0x6078: -25}
            for pdo in self.node.tpdo.values():
                if pdo.enabled and pdo.trans_type == 1:
                    for entry in pdo.map:
                        most = 1 << 31
                        value = max(-most, min(most - 1, round(measured[entry.index])))
                        entry.set_data((value & 0xFFFFFFFF).to_bytes(4, "little")
                                       [:entry.length // 8])
                    pdo.transmit()

    def watchdog(self):
        """Quick stop of the drive's own where the master or its commands are silent."""
        with self.lock:
            now = time.monotonic()
            self.move()
            if self.node.nmt.state != "OPERATIONAL":
                return
            consumer, limit = self.get(0x1016, 1) & 0xFFFF, self.get(0x1400, 5)
            if self.master_time and consumer and now - self.master_time > consumer / 1000:
                self.master_time = None
                self.alone(0x8130, "heartbeat of the master lost")
            elif self.command_time and limit and now - self.command_time > limit / 1000:
                self.command_time = None
                self.alone(0x8250, "no command in time")

    def alone(self, code, why):
        print("node %d: %s" % (self.id, why), flush=True)
        self.node.emcy.send(code, 0x11)
        if self.get(0x6007) == 3 and self.state == "operation enabled":
            self.become("quick stop active")

    target = 0.0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--nodes", required=True)
    parser.add_argument("--descriptor", type=int)
    parser.add_argument("--interface")
    arguments = parser.parse_args()
    network = canopen.Network()
    if arguments.descriptor is not None:
        network.bus = PairBus(arguments.descriptor)
        network.connect()
    else:
        network.connect(interface="socketcan", channel=arguments.interface)
    drives = [Drive(network, int(node)) for node in arguments.nodes.split(",")]

    def on_sync(can_id, data, timestamp):
        for drive in drives:
            drive.on_sync()

    network.subscribe(0x80, on_sync)
    print("ready", flush=True)
    while True:
        time.sleep(0.01)
        for drive in drives:
            drive.watchdog()


if __name__ == "__main__":
    main()
