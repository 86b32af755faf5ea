#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A robot on rospy, ROS's other implementation: it moves as it is told and says so.

  robot.py echo <prefix> <joint>...     answers each command at once; tells its state at 50 Hz
  robot.py nagle <prefix> <joint>...    the same, without asking for TCP_NODELAY
  robot.py behind <prefix> <joint>...   the same as echo; its clock is an hour behind
  robot.py usurp                        takes the name of the node icat, whom the master then ends
  robot.py bad <prefix> <joint>...      a good message on each topic, then bad ones, then "sent"
"""
import random
import struct
import sys
import threading
import time
from io import BytesIO

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

mode = sys.argv[1]
if mode == "usurp":
    rospy.init_node("icat", disable_signals=True)
    print("ready", flush=True)
    rospy.sleep(60)
    sys.exit(0)
prefix, joints = sys.argv[2], sys.argv[3:]
rospy.init_node("robot", anonymous=True, disable_signals=True)
lock = threading.Lock()
velocity = [0.0] * len(joints)
position = [0.1 * i for i in range(len(joints))]
base = Twist()
last = {}


def publisher(topic, kind):
    return rospy.Publisher(prefix + topic, kind, queue_size=100, tcp_nodelay=mode != "nagle")


joint_states = publisher("/joint_states", JointState)
odometry = publisher("/odom", Odometry)


def stamp(topic):
    """Now, and newer than the last."""
    now = rospy.Time.now()
    if mode == "behind":
        now -= rospy.Duration(3600)
    now = max(now, last.get(topic, now) + rospy.Duration(0, 1))
    last[topic] = now
    return now


moved = time.monotonic()


def move():
    global moved
    now = time.monotonic()
    for i, v in enumerate(velocity):
        position[i] += v * (now - moved)
    moved = now


def tell_joints():
    move()
    message = JointState()
    message.header.stamp = stamp("joints")
    # From last to first, with a joint of somebody else's between.
    message.name = ["somebody_else"] + joints[::-1]
    message.position = [7.0] + position[::-1]
    message.velocity = [7.0] + velocity[::-1]
    joint_states.publish(message)


def tell_odometry():
    message = Odometry()
    message.header.stamp = stamp("base")
    message.header.frame_id = "odom"
    message.child_frame_id = "base_link"
    message.pose.pose.position.x = 1.0
    message.pose.pose.orientation.w = 1.0
    message.twist.twist = base
    odometry.publish(message)


def on_velocities(message):
    global velocity
    with lock:
        move()
        if len(message.data) == len(joints):
            velocity = list(message.data)
        tell_joints()


def on_twist(message):
    global base
    with lock:
        base = message
        tell_odometry()


def wait_for_listeners():
    while joint_states.get_num_connections() == 0 or odometry.get_num_connections() == 0:
        rospy.sleep(0.01)


def joint_lengths():
    """Where a JointState of the joints, with positions only, has its lengths."""
    at = [12, 16]
    end = 20
    for name in joints:
        at.append(end)
        end += 4 + len(name)
    at += [end, end + 4 + 8 * len(joints), end + 8 + 8 * len(joints)]
    return at


def send_bad():
    """Each is wrong in one way, and newer than the good one unless that is what is wrong."""
    def js(seconds, names=joints, positions=None, velocities=()):
        message = JointState()
        message.header.stamp = rospy.Time(seconds)
        message.name = list(names)
        message.position = [1.0] * len(names) if positions is None else positions
        message.velocity = list(velocities)
        return message

    def od(seconds, x=1.0, w=1.0):
        message = Odometry()
        message.header.stamp = rospy.Time(seconds)
        message.pose.pose.position.x = x
        message.pose.pose.orientation.w = w
        return message

    nan = float("nan")
    wait_for_listeners()
    joint_states.publish(js(1000, velocities=[0.5] * len(joints)))
    odometry.publish(od(1000))
    for message in [
        js(1000, positions=[2.0] * len(joints)),           # doubled
        js(999.5, positions=[2.0] * len(joints)),          # late
        js(0, positions=[2.0] * len(joints)),              # no stamp
        js(1001, positions=[nan] * len(joints)),
        js(1001, positions=[2.0]),                         # arrays that do not fit together
        js(1001, positions=[]),
        js(1001, positions=[2.0] * len(joints), velocities=[2.0]),
        js(1001, positions=[2.0] * len(joints), velocities=[float("inf")] * len(joints)),
        js(1001, names=["somebody_else"], positions=[2.0]),
    ]:
        joint_states.publish(message)
    for message in [od(1000, x=2), od(999.5, x=2), od(0, x=2), od(1001, x=nan), od(1001, w=0.9, x=2),
                    od(1001, w=0, x=2), od(1001, w=nan, x=2)]:
        odometry.publish(message)
    # What does not parse: frames of TCPROS (a length, then the message) that are cut short or noise.
    # Noise has no stamp, so that none of it may pass for a message, and no length above 65535: roscpp
    # reserves what a length says before it looks whether there is so much.
    random.seed(1)
    for topic, message, lengths in [
        (joint_states, js(1001, positions=[2.0] * len(joints)), joint_lengths()),
        (odometry, od(1001, x=2), [12, 16]),
    ]:
        buffer = BytesIO()
        message.serialize(buffer)
        good = buffer.getvalue()
        for k in range(1, len(good), 23):
            send_raw(topic, good[:k])
        spared = {at + i for at in lengths for i in (2, 3)}
        noisy = [i for i in range(12, len(good)) if i not in spared]
        for _ in range(20):
            noise = bytearray(good)
            noise[4:12] = bytes(8)
            for _ in range(20):
                noise[random.choice(noisy)] = random.randrange(256)
            send_raw(topic, bytes(noise))
    print("sent", flush=True)


def send_raw(topic, data):
    for connection in list(topic.impl.connections):
        connection.write_data(struct.pack("<I", len(data)) + data)


if mode == "bad":
    send_bad()
    rospy.sleep(60)
    sys.exit(0)

nodelay = mode != "nagle"
rospy.Subscriber(prefix + "/command", Float64MultiArray, on_velocities, tcp_nodelay=nodelay)
rospy.Subscriber(prefix + "/cmd_vel", Twist, on_twist, tcp_nodelay=nodelay)
print("ready", flush=True)
while True:
    with lock:
        tell_joints()
        tell_odometry()
    rospy.sleep(0.02)
