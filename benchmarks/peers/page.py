# SPDX-License-Identifier: BSD-3-Clause
"""The page: python page.py <results> <problems> <machine>. Of each time the fastest round counts."""
import sys

from problems import DT, MARGIN, NEAR, STATES, problem

ROBOTS = {"panda": "Panda, 7 columns", "tiago": "TIAGo, 13 columns", "talos": "TALOS, 38 columns"}
TASKS = {
    "panda": "joint limits; the hand's pose; posture.",
    "tiago": "joint limits; the tool's pose; posture. The base moves freely in the plane (three joints: x, y, yaw), "
    "because not every peer knows a differential drive.",
    "talos": "joint limits; the poses of both feet and of the right hand; the centre of mass; "
    "posture. The base is free.",
}
FEWER = ("KDL, tree", "KDL, chain")  # that lack some of the tasks

times, counts, errors, answers, regularized = {}, {}, {}, {}, {}
versions, notes, missing = {}, {}, {}
for line in open(sys.argv[1]):
    kind, name, *fields = line.rstrip("\n").split("\t")
    if kind == "time":
        robot, variant, part, *quantiles = fields
        key = name, robot, variant, part
        now = [float(q) for q in quantiles]
        times[key] = [min(pair) for pair in zip(now, times.get(key, now))]
    elif kind == "allocations":
        counts[name, fields[0], fields[1]] = float(fields[2])
    elif kind == "error":
        errors[name, fields[0], fields[1]] = float(fields[2])
    elif kind == "regularized":
        regularized[name, fields[0], fields[1]] = int(fields[2])
    elif kind == "answer":
        answers[name, fields[0]] = fields[1:]
    else:
        {"version": versions, "note": notes, "missing": missing}[kind][name] = fields[0]
names = [name for name in versions if name not in missing]
peers = [name for name in names if not name.startswith("icat")]


def number(value):
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:.0f}"


def cell(name, robot, variant, part, i=0):
    found = times.get((name, robot, variant, part))
    return number(found[i]) if found else "–"


def table(header, rows):
    print("|", " | ".join(header), "|")
    print("|" + "---|" * len(header))
    for row in rows:
        print("|", " | ".join(row), "|")
    print()


def total(name, robot, variant):
    return times.get((name, robot, variant, "total"), [float("inf")])[0]


def work(name, robot, variant):
    return sum(times[name, robot, variant, part][0] for part in ("model", "solve"))


def verdict(ratio, bound):
    return f"{ratio:.2f} ×: " + ("yes" if ratio <= bound else "**no**")


print(f"""# Beside the peers

This page compares icat with KDL, placo, pink, mink and tsid on the same problems, in one run on one machine. `./benchmarks/peers/run.sh` prints it; the robots come from example-robot-data and the peers from package registries, each Python peer in an environment of its own.

{sys.argv[3]}. C++ programs are compiled with -O3, without -march=native except for the row *icat, native*. Python peers run from Python, with the solver that their own documentation uses. Times are in µs, p50 unless p99 is stated; the fastest of three rounds counts.

## The problems

A motion of {STATES} states is given, and in each cycle the goals are where frames, centre of mass and joints are {1000 * DT:.0f} ms later. So all goals can be met, gains are 1/({1000 * DT:.0f} ms), and the answer is known: the velocity that leads to the next state. *Off by* is the median over the cycles of the largest difference of a joint's velocity (rad/s). *Limit*: one joint is kept {1000 * NEAR[0] * MARGIN:.0f} to {1000 * NEAR[1] * MARGIN:.0f} mrad before its upper limit. There icat's task of joint limits is in transition (one row with an activation between 0 and 1) and moves the joint away from the limit, so its velocity differs; the peers have a constraint, which is not reached. Every program loads the same URDF, without meshes, with fingers and wheels fixed.

*Target* sets the goals, *model* updates the model to the state, *solve* does the rest: in icat, placo, pink and mink tasks and their Jacobians, too. *Malloc* is the number of heap allocations in a cycle; small Python objects come from Python's own allocator and are not counted.

## Targets

On the Panda icat should not be slower than the fastest peer, on the larger robots it should need at most half of its time. The p50 of the total counts. Peers that lack some of the tasks are compared separately. In placo *target* is a few Python calls, so the comparison is also shown without *target*.
""")

rows = []
for robot, title in ROBOTS.items():
    for variant in ("clear", "limit"):
        mine, bound = total("icat", robot, variant), 1 if robot == "panda" else 0.5
        row = [title.split(",")[0], "in transition" if variant == "limit" else "none near",
               number(mine), f"≤ {bound} ×"]
        for among in ([p for p in peers if p not in FEWER], [p for p in peers if p in FEWER]):
            other = min(among, key=lambda name: total(name, robot, variant))
            row.append(f"{other}: {number(total(other, robot, variant))}")
            row.append(verdict(mine / total(other, robot, variant), bound))
            if other not in FEWER:
                row.append(verdict(work("icat", robot, variant) / work(other, robot, variant), bound))
        rows.append(row)
table(["robot", "limit", "icat", "bound", "fastest peer with all tasks", "met",
       "met without *target*", "with fewer", "met"], rows)

count = regularized["icat", "panda", "limit"]
with_limit, without = (cell("icat", "panda", "limit", part) for part in ("alone", "alone, no limits"))
clear = cell("icat", "panda", "clear", "alone")
print(f"Near the limit of the Panda's fourth joint the elbow is almost straight, so that the pose of the hand is near a singularity: icat regularizes a level in {count} of the {STATES} states (with no limit near: in {regularized['icat', 'panda', 'clear']}). The limit and the singularity both take time: the solver alone needs {with_limit} µs in these states, {without} µs in the same states with the task of joint limits switched off, and {clear} µs with no limit near.\n")

for robot, title in ROBOTS.items():
    print(f"## {title}\n\nTasks: {TASKS[robot]}\n")
    rows = []
    for name in names:
        if (name, robot, "clear", "total") not in times:
            continue
        row = [name] + [cell(name, robot, "clear", part) for part in ("target", "model", "solve")]
        for variant in ("clear", "limit"):
            if variant == "limit":
                row.append(cell(name, robot, variant, "solve"))
            row += [f"**{cell(name, robot, variant, 'total')}**",
                    cell(name, robot, variant, "total", 1)]
        row += [f"{counts[name, robot, 'clear']:.0f}", f"{errors[name, robot, 'clear']:.0e}"]
        rows.append(row)
    table(["", "target", "model", "solve", "total", "p99", "limit: solve", "total", "p99", "malloc",
           "off by"], rows)

print("""## The solver alone

Times of the numerical solver on prepared input: `Tpik` on the levels of the controller, the QP of pink and mink through qpsolvers, the QP of tsid. The other peers do not expose their solver.
""")
rows = []
for name in names:
    for part in ("alone", "alone, fixed size") if name.startswith("icat") else ("alone",):
        if name == "tsid":
            part = "solve"
        row = [cell(name, robot, variant, part) for robot in ROBOTS for variant in ("clear", "limit")]
        if row[0] != "–":
            rows.append([name + part.removeprefix("alone").removeprefix("solve")] + row)
table(["", *(f"{title.split(',')[0]}{tail}" for title in ROBOTS.values() for tail in ("", ", limit"))],
      rows)

speeds = sorted(set(problem("panda", "clear", sys.argv[2]).speed))
print(f"""## Goals and starts that cannot be met

On the Panda, with gains as above, in a loop of 10 s that integrates the commanded velocities. Its joints have velocity limits of {" and ".join(map(str, speeds))} rad/s. Speed and change (of a joint's velocity from one cycle to the next) are the largest in the last second.
""")


def ask(what, title, header, formats):
    print(f"**{title}**\n")
    rows = []
    for name in names:
        answer = answers.get((name, what))
        if name == "icat, native":
            continue
        if answer is None:
            rows.append([name, "not supported"] + [""] * (len(formats) - 1))
        elif answer[0] == "raises":
            rows.append([name, f"raises {answer[1]}"] + [""] * (len(formats) - 1))
        else:
            rows.append([name] + [f(float(x)) for f, x in zip(formats, answer)])
    table([""] + header, rows)


def mm(x):
    return f"{1000 * x:.1f} mm"


def speed(x):
    return "> 100 rad/s" if abs(x) > 100 else f"{x:.1g} rad/s" if abs(x) < 0.01 else f"{x:.2f} rad/s"


def past(x):
    return "no" if x < 1e-6 else f"by {x:.2g} rad" if x < 10 else "yes"


ask("out of reach", "The goal is 1 m in front of the hand, outside the workspace.",
    ["hand off its goal by", "speed", "change", "past a limit"], [mm, speed, speed, past])
ask("outside limits", "The fourth joint starts 0.05 rad beyond its upper limit.",
    ["its first velocity", "within limits after", "fastest joint"],
    [speed, lambda t: f"{t:.2f} s", speed])
ask("conflict", "Two frames of one rigid body have goals that contradict each other by 0.2 m; in icat the hand has the higher priority.",
    ["hand off by", "other frame off by", "speed", "change", "past a limit"],
    [mm, mm, speed, speed, past])

print("## What each library solves\n")
table(["", "version", "what it does"], [[name, versions[name], notes[name]] for name in names if name in notes])
for name, reason in missing.items():
    print(f"{name} could not be installed: {reason}\n")
print("""OpenSoT is neither on PyPI nor in Debian, and is not included. tsid 1.10.0, the newest, crashes with Pinocchio 4.0 and 4.1 of PyPI when it constructs its robot, so an older pair is used. placo, pink, mink and tsid weigh tasks against each other, icat gives them strict priorities: if all tasks can be met, the results agree; otherwise see the last tables. placo and tsid are C++ libraries called from Python; pink and mink are written in Python, which takes most of their time. [Coming from pink, mink, placo, tsid, OpenSoT, KDL](coming_from.md) compares their terms with those of icat and runs one job in all of them.""")
