# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle behind pymavlink's messages that behaves as ArduSub's source says it does.

It listens at a UDP port of 127.0.0.1 and answers whoever spoke last. No hydrodynamics: velocity and
yaw rate follow the set-points with a lag of first order, roll and pitch are what --roll and --pitch
say. Of ArduSub (docs/mavlink.md has the files) it has: GUIDED alone obeys set-points, in the frames
LOCAL_NED and BODY_NED; after 3 s without one the velocity is zero and the yaw rate stays;
FS_PILOT_INPUT and FS_GCS_ENABLE disarm, as delivered. It prints `ready`, and a line for each change
of mode, arming or failsafe.
"""

import argparse
import math
import select
import socket
import sys
import time

from pymavlink.dialects.v20 import ardupilotmega as mavlink

GUIDED = 4
MODES = {0, 1, 2, 3, 4, 7, 9, 16, 19, 20, 21}
VELOCITY_TIMEOUT = 3.0  # GUIDED_VEL_TIMEOUT_MS
PILOT_TIMEOUT = 3.0  # FS_PILOT_TIMEOUT
GCS_TIMEOUT = 5.0  # FS_GCS_TIMEOUT_S
IGNORED = 0b0000_0101_1100_0111  # position, acceleration and yaw


def say(*what):
    print(*what, flush=True)


class Autopilot:
    def __init__(self, options):
        self.options = options
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", options.port))
        self.socket.setblocking(False)
        self.peer = None
        self.mav = mavlink.MAVLink(None, srcSystem=options.system, srcComponent=1)
        self.mav.robust_parsing = True
        self.start = time.monotonic()
        self.mode = 19
        self.armed = False
        self.failsafe = False
        self.period = {
            mavlink.MAVLINK_MSG_ID_ATTITUDE: 1 / options.rate,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 1 / options.rate,
        }
        self.next = {message: 0.0 for message in self.period}
        self.next_heartbeat = 0.0
        self.position = [0.0, 0.0, options.depth]
        self.velocity = [0.0, 0.0, 0.0]
        self.yaw = options.yaw
        self.yaw_rate = 0.0
        self.target = [0.0, 0.0, 0.0]
        self.target_rate = 0.0
        self.target_time = -math.inf
        self.pilot_time = -math.inf
        self.gcs_time = None
        self.set_points = 0

    def send(self, message):
        if self.peer:
            try:
                self.socket.sendto(message.pack(self.mav), self.peer)
            except OSError:
                pass  # nobody there
            self.mav.seq = (self.mav.seq + 1) % 256

    def boot_ms(self, now):
        return int((now - self.start) * 1000) + self.options.uptime

    def receive(self, now):
        while True:
            try:
                data, peer = self.socket.recvfrom(2048)
            except OSError:
                return
            self.peer = peer
            for message in self.mav.parse_buffer(data) or []:
                if message.get_type() != "BAD_DATA":
                    self.take(message, now)

    def take(self, message, now):
        kind = message.get_type()
        ours = message.get_srcSystem() == self.options.gcs
        if kind == "HEARTBEAT" and ours:
            self.gcs_time = now
        elif kind == "MANUAL_CONTROL" and ours and message.target == self.options.system:
            if (message.x, message.y, message.z, message.r) != (0, 0, 500, 0):
                say("sticks", message.x, message.y, message.z, message.r)
            self.gcs_time = self.pilot_time = now
        elif kind == "COMMAND_LONG" and message.target_system == self.options.system:
            self.obey(message)
        elif kind == "SET_POSITION_TARGET_LOCAL_NED":
            self.set_point(message, now)

    def obey(self, message):
        result = mavlink.MAV_RESULT_UNSUPPORTED
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            result = mavlink.MAV_RESULT_FAILED
            if not (message.param1 and self.options.refuse_arming):
                self.arm(message.param1 != 0)
                result = mavlink.MAV_RESULT_ACCEPTED
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            result = mavlink.MAV_RESULT_FAILED
            if int(message.param1) & 1 and int(message.param2) in MODES:
                self.mode = int(message.param2)
                self.target, self.target_rate = [0.0, 0.0, 0.0], 0.0
                say("mode", self.mode)
                result = mavlink.MAV_RESULT_ACCEPTED
        elif message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            result = mavlink.MAV_RESULT_FAILED
            if int(message.param1) in self.period and message.param2 > 0:
                self.period[int(message.param1)] = message.param2 * 1e-6
                result = mavlink.MAV_RESULT_ACCEPTED
        self.send(
            mavlink.MAVLink_command_ack_message(
                message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
            )
        )

    def arm(self, armed):
        if armed != self.armed:
            self.armed = armed
            say("armed" if armed else "disarmed")
        if armed:
            self.failsafe = False

    def set_point(self, message, now):
        if self.mode != GUIDED or message.target_system != self.options.system:
            return
        if message.type_mask != IGNORED:
            say("mask", message.type_mask)
            return
        x, y, z = message.vx, message.vy, message.vz
        if message.coordinate_frame == mavlink.MAV_FRAME_BODY_NED:
            c, s = math.cos(self.yaw), math.sin(self.yaw)
            x, y = c * x - s * y, s * x + c * y
        elif message.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
            return
        self.target = [x, y, z]
        self.target_rate = message.yaw_rate
        self.target_time = now
        self.set_points += 1

    def failsafes(self, now):
        if not self.armed:
            return
        pilot = now - self.pilot_time > PILOT_TIMEOUT
        gcs = self.gcs_time is not None and now - self.gcs_time > GCS_TIMEOUT
        if pilot or gcs:
            say("failsafe", "pilot" if pilot else "gcs")
            self.failsafe = True
            self.arm(False)

    def move(self, now, dt):
        self.failsafes(now)
        if now - self.target_time > VELOCITY_TIMEOUT and any(self.target):
            self.target = [0.0, 0.0, 0.0]
            say("no set-points")
        driven = self.armed and self.mode == GUIDED
        target = self.target if driven else [0.0, 0.0, 0.0]
        rate = self.target_rate if driven else 0.0
        lag = self.options.lag
        k = 1 - math.exp(-dt / lag) if lag > 0 else 1.0
        for i in range(3):
            self.velocity[i] += k * (target[i] - self.velocity[i])
            self.position[i] += dt * self.velocity[i]
        self.yaw_rate += k * (rate - self.yaw_rate)
        self.yaw = math.remainder(self.yaw + dt * self.yaw_rate, 2 * math.pi)

    def rates(self):
        """On the body, of a yaw that turns while roll and pitch stay."""
        roll, pitch = self.options.roll, self.options.pitch
        return (
            -math.sin(pitch) * self.yaw_rate,
            math.sin(roll) * math.cos(pitch) * self.yaw_rate,
            math.cos(roll) * math.cos(pitch) * self.yaw_rate,
        )

    def telemetry(self, now):
        stamp = self.boot_ms(now)
        if now >= self.next_heartbeat:
            self.next_heartbeat = now + 1
            mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            state = mavlink.MAV_STATE_STANDBY
            if self.armed:
                mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
                state = mavlink.MAV_STATE_ACTIVE
            if self.failsafe:
                state = mavlink.MAV_STATE_CRITICAL
            self.send(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_SUBMARINE,
                    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
                    mode,
                    self.mode,
                    state,
                    3,
                )
            )
        for message, period in self.period.items():
            if now < self.next[message]:
                continue
            self.next[message] = max(self.next[message] + period, now - period)
            if message == mavlink.MAVLINK_MSG_ID_ATTITUDE:
                angles = (self.options.roll, self.options.pitch, self.yaw)
                self.send(mavlink.MAVLink_attitude_message(stamp, *angles, *self.rates()))
            else:
                self.send(
                    mavlink.MAVLink_local_position_ned_message(
                        stamp, *self.position, *self.velocity
                    )
                )

    def run(self):
        say("ready")
        last = time.monotonic()
        while True:
            due = min([self.next_heartbeat, last + 0.02, *self.next.values()])
            select.select([self.socket], [], [], max(0.0, due - time.monotonic()))
            now = time.monotonic()
            self.receive(now)
            self.move(now, now - last)
            last = now
            self.telemetry(now)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, required=True, help="to listen at")
    parser.add_argument("--system", type=int, default=1)
    parser.add_argument("--gcs", type=int, default=255, help="MAV_GCS_SYSID")
    parser.add_argument("--rate", type=float, default=4, help="Hz of telemetry until one is asked")
    parser.add_argument("--lag", type=float, default=0.3, help="s, of velocity and yaw rate")
    parser.add_argument("--roll", type=float, default=0.0, help="rad")
    parser.add_argument("--pitch", type=float, default=0.0, help="rad")
    parser.add_argument("--yaw", type=float, default=0.0, help="rad, at first")
    parser.add_argument("--depth", type=float, default=0.0, help="m, at first")
    parser.add_argument("--uptime", type=int, default=20000, help="ms since it started, at first")
    parser.add_argument("--refuse-arming", action="store_true")
    Autopilot(parser.parse_args()).run()


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(0)
