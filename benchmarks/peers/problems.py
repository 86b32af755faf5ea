# SPDX-License-Identifier: BSD-3-Clause
"""The problems that icat and its peers solve, and how they are run.

A problem is a robot, its tasks, and a motion of 1000 states. The goals of cycle k are where frames,
centre of mass and joints are at state k + 1. So every request can be met, and the velocity that
leads to state k + 1 is the right answer of every library; how far off an answer is, is measured.

    python problems.py <robot data> <folder>    writes the URDFs, and the problems for C++
"""
import ctypes
import math
import os
import sys
import time
import xml.etree.ElementTree as xml
from types import SimpleNamespace

DT = 0.01  # s
STATES = 1000
SECONDS = 0.4  # of measuring, for each problem and round
MARGIN = 0.1  # rad; of icat's joint limits
NEAR = 0.35, 0.65  # of the margin; where the joint near its limit is
VARIANTS = ["clear", "limit"]

ROBOTS = {
    "panda": {
        "file": "panda_description/urdf/panda.urdf",
        "locked": "panda_finger",
        "frames": ["panda_hand"],
        "start": [0.3, -0.4, 0.2, -1.9, 0.1, 1.7, 0.6],
        "limit": "panda_joint4",
    },
    "tiago": {
        "file": "tiago_description/robots/tiago_no_hand.urdf",
        "locked": "wheel",
        "planar": True,
        "frames": ["arm_tool_link"],
        "start": [0.1, 0.2, 0.3, 0.18, 0.2, -0.1, 1.0, -0.4, -1.0, 1.2, 0.4, 0.3, 0.2],
        "limit": "arm_4_joint",
    },
    "talos": {
        "file": "talos_data/robots/talos_reduced.urdf",
        "locked": "none",
        "free": True,
        "frames": ["left_sole_link", "right_sole_link", "gripper_right_base_link"],
        "com": True,
        "start": [0.1, 0.2, 0.2, 0.1]
        + [-0.3, 0.6, 0.2, -1.2, 0.3, 0.2, 0.1, 0.3, -0.6, -0.2, -1.2, -0.3, -0.2, -0.1]
        + [-0.5, -0.5]
        + [0.1, 0.05, -0.6, 1.1, -0.5, -0.05, -0.1, -0.05, -0.6, 1.1, -0.5, 0.05],
        "limit": "arm_right_4_joint",
    },
}


def urdf(robot, data):
    """The robot's URDF without meshes, without hands and wheels that move; on a planar base: x, y
    and yaw as three joints before the root. A line for MuJoCo says that every link is a body."""
    root = xml.parse(os.path.join(data, ROBOTS[robot]["file"])).getroot()
    for child in list(root):
        if child.tag not in ("link", "joint"):
            root.remove(child)
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for shape in link.findall(tag):
                link.remove(shape)
        for inertia in link.iter("inertia"):  # MuJoCo refuses some; no kinematics uses them
            inertia.attrib.update(ixy="0", ixz="0", iyz="0")
    for joint in root.findall("joint"):
        for tag in ("safety_controller", "dynamics", "calibration"):
            for part in joint.findall(tag):
                joint.remove(part)
        if joint.get("name").startswith(ROBOTS[robot]["locked"]):
            joint.set("type", "fixed")
            for tag in ("mimic", "limit", "axis"):
                for part in joint.findall(tag):
                    joint.remove(part)
    children = {joint.find("child").get("link") for joint in root.findall("joint")}
    link = next(l.get("name") for l in root.findall("link") if l.get("name") not in children)
    if ROBOTS[robot].get("planar"):
        axes = {"yaw": ("revolute", "0 0 1"), "y": ("prismatic", "0 1 0"), "x": ("prismatic", "1 0 0")}
        for axis, (kind, direction) in axes.items():
            parent = "ground" if axis == "x" else f"carrier_{axis}"
            xml.SubElement(root, "link", name=parent)
            joint = xml.SubElement(root, "joint", name=f"base_{axis}", type=kind)
            xml.SubElement(joint, "parent", link=parent)
            xml.SubElement(joint, "child", link=link)
            xml.SubElement(joint, "axis", xyz=direction)
            xml.SubElement(joint, "limit", lower="-10", upper="10", velocity="1", effort="100")
            link = parent
    mujoco = xml.SubElement(root, "mujoco")
    xml.SubElement(mujoco, "compiler", fusestatic="false", boundmass="1e-6", boundinertia="1e-9",
                   balanceinertia="true")
    return xml.tostring(root, encoding="unicode")


def problem(robot, variant, folder):
    """Names and limits of the joints in the order of ROBOTS, and the states: base, joints."""
    about = ROBOTS[robot]
    file = os.path.join(folder, robot + ".urdf")
    moving = [j for j in xml.parse(file).getroot().findall("joint") if j.get("type") != "fixed"]
    moving.sort(key=lambda j: ["base_x", "base_y", "base_yaw"].index(j.get("name"))
                if j.get("name").startswith("base_") else 3)
    joints = [j.get("name") for j in moving]
    lower, upper, speed = (
        [float(j.find("limit").get(what)) for j in moving] for what in ("lower", "upper", "velocity"))
    states = []
    for k in range(STATES + 1):
        turn = 2 * math.pi * k / STATES
        q = []
        for i, start in enumerate(about["start"]):
            # At most a tenth of the joint's speed, and 0.05 rad or 5 mm.
            amplitude = min(0.05, 0.005 if "torso_lift" in joints[i] else 1, 10 * DT * speed[i])
            shift = 1.0 * i
            if variant == "limit" and joints[i] == about["limit"]:
                start = upper[i] - MARGIN * sum(NEAR) / 2
                amplitude = MARGIN * (NEAR[1] - NEAR[0]) / 2
            q.append(start + amplitude * math.sin((1 + i % 3) * turn + shift))
        base = [0.05 * math.sin(turn), 0.05 * math.cos(turn), 1.0] if about.get("free") else [0, 0, 0]
        states.append((base, q))
    return SimpleNamespace(
        robot=robot, variant=variant, file=file, free=about.get("free", False), joints=joints,
        lower=lower, upper=upper, speed=speed, frames=about["frames"],
        com=about.get("com", False), states=states, start=states[0][1])


def write(data, folder):
    os.makedirs(folder, exist_ok=True)
    for robot in ROBOTS:
        with open(os.path.join(folder, robot + ".urdf"), "w") as out:
            out.write(urdf(robot, data))
        for variant in VARIANTS:
            p = problem(robot, variant, folder)
            with open(os.path.join(folder, f"{robot}.{variant}"), "w") as out:
                print(p.file, int(p.free), int(p.com), len(p.frames), *p.frames, file=out)
                print(len(p.joints), *p.joints, file=out)
                for values in (p.lower, p.upper, p.speed):
                    print(*values, file=out)
                for base, q in p.states:
                    print(*base, *q, file=out)


def say(*fields):
    print(*fields, sep="\t", flush=True)


def quantile(times, at):
    times = sorted(times)
    return times[min(len(times) - 1, int(at * len(times)))] / 1000  # µs


def goals_of(peer, states):
    """What a peer's own model says of the states."""
    goals = []
    for state in states:
        peer.model(state)
        goals.append(peer.goal(state))
    return goals


def measure(name, peer, p):
    """Times, or where malloc is counted, allocations."""
    joints = [q for _, q in p.states]
    speeds = [[(b - a) / DT for a, b in zip(*pair)] for pair in zip(joints, joints[1:])]
    states = [peer.state(base, q, v) for (base, q), v in zip(p.states, speeds + speeds[-1:])]
    goals = goals_of(peer, states)[1:]
    errors = []  # rad/s
    for k in range(0, STATES, 10):
        peer.model(states[k])
        peer.target(goals[k])
        answer = peer.joints(peer.solve(), states[k])
        errors.append(max(abs(a - b) for a, b in zip(answer, speeds[k])))
    fields = (name, p.robot, p.variant)
    count = getattr(ctypes.CDLL(None), "peers_allocations", None)
    if count:
        count.restype = ctypes.c_long
        before = count()
        for k in range(100):
            peer.target(goals[k])
            peer.model(states[k])
            peer.solve()
        say("allocations", *fields, (count() - before) / 100)
        say("error", *fields, sorted(errors)[len(errors) // 2])
        return
    clock = time.perf_counter_ns
    parts = {"target": [], "model": [], "solve": [], "total": [], "alone": []}
    k, end = 0, clock() + int(1e9 * SECONDS)
    while k < STATES or clock() < end:
        goal, state = goals[k % STATES], states[k % STATES]
        a = clock()
        peer.target(goal)
        b = clock()
        peer.model(state)
        c = clock()
        peer.solve()
        d = clock()
        if k >= 100:  # the first ones warm up
            for part, t in zip(parts, (b - a, c - b, d - c, d - a)):
                parts[part].append(t)
        k += 1
    if hasattr(peer, "build"):
        for k in range(STATES):
            peer.target(goals[k])
            peer.model(states[k])
            peer.build()
            a = clock()
            peer.solve_built()
            parts["alone"].append(clock() - a)
    for part, times in parts.items():
        if times:
            say("time", *fields, part, quantile(times, 0.5), quantile(times, 0.99))


def loop(peer, p, q, goal, seconds):
    """The peer's answers, integrated; the states and the answers."""
    v, path, answers = [0.0] * len(q), [list(q)], []
    for _ in range(int(seconds / DT)):
        state = peer.state([0, 0, 0], q, v)
        peer.model(state)
        peer.target(goal)
        v = peer.joints(peer.solve(), state)
        answers.append(v)
        q = [a + DT * b for a, b in zip(q, v)]
        path.append(q)
    peer.model(peer.state([0, 0, 0], q, v))
    return path, answers


def attempt(name, what, scenario):
    try:
        say("answer", name, what, *scenario())
    except Exception as error:  # whatever a user of the peer would meet
        text = (str(error).splitlines() or [""])[0]
        say("answer", name, what, "raises", f"{type(error).__name__}: {text}")


def answers(name, make, folder):
    """What a peer answers on the Panda; numbers as page.py names them."""
    p = problem("panda", "clear", folder)
    i = p.joints.index(ROBOTS["panda"]["limit"])

    def start(frames, posture=None):
        p.frames = frames
        peer = make(p)
        state = peer.state([0, 0, 0], p.start, [0.0] * len(p.start))
        peer.model(state)
        return peer, peer.goal(state)

    def outcome(path, answers):
        last = answers[-100:]
        jump = max(abs(a - b) for x, y in zip(last, last[1:]) for a, b in zip(x, y))
        past = max(max(a - u, l - a) for q in path for a, l, u in zip(q, p.lower, p.upper))
        return max(abs(a) for v in last for a in v), jump, past

    def out_of_reach():
        peer, goal = start(["panda_hand"])
        wanted = [a + b for a, b in zip(peer.position(0), (1.0, 0, 0))]
        peer.move(goal, 0, (1.0, 0, 0))
        path, v = loop(peer, p, p.start, goal, 10)
        return math.dist(peer.position(0), wanted), *outcome(path, v)

    def outside():
        peer, goal = start(["panda_hand"])
        q = list(p.start)
        q[i] = p.upper[i] + 0.05
        path, v = loop(peer, p, q, goal, 10)
        inside = [k for k, q in enumerate(path) if q[i] > p.upper[i] + 1e-6]
        return v[0][i], DT * (inside[-1] + 1), max(abs(a) for x in v for a in x)

    def conflict():
        peer, goal = start(["panda_hand", "panda_link8"])
        wanted = [list(peer.position(0)), [a + b for a, b in zip(peer.position(1), (0, 0.2, 0))]]
        peer.move(goal, 1, (0, 0.2, 0))
        path, v = loop(peer, p, p.start, goal, 10)
        return *(math.dist(peer.position(f), wanted[f]) for f in (0, 1)), *outcome(path, v)

    attempt(name, "out of reach", out_of_reach)
    attempt(name, "outside limits", outside)
    attempt(name, "conflict", conflict)


def main(name, make, version, note):
    """`make(problem)` builds the peer; argument: the folder of the problems."""
    folder = sys.argv[1]
    say("version", name, version)
    say("note", name, note)
    for robot in ROBOTS:
        for variant in VARIANTS:
            p = problem(robot, variant, folder)
            measure(name, make(p), p)
    if hasattr(ctypes.CDLL(None), "peers_allocations"):
        answers(name, make, folder)


if __name__ == "__main__":
    write(*sys.argv[1:])
