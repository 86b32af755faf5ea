# SPDX-License-Identifier: BSD-3-Clause
"""The page: python page.py <results> <problems> <machine>. Of each time the fastest round counts."""
import sys

from problems import DT, MARGIN, NEAR, STATES, problem

ROBOTS = {"panda": "Panda, 7 columns", "tiago": "TIAGo, 13 columns", "talos": "TALOS, 38 columns"}
TASKS = {
    "panda": "joint limits; the hand's pose; posture.",
    "tiago": "joint limits; the tool's pose; posture. The base goes anywhere (three joints: x, y, yaw), "
    "because not every peer knows a differential drive.",
    "talos": "joint limits; the poses of both feet and of the right hand; the centre of mass; "
    "posture. The base is free.",
}
FEWER = ("KDL, tree", "KDL, chain")  # that lack some of the tasks

times, counts, errors, answers, versions, notes, missing = {}, {}, {}, {}, {}, {}, {}
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

Printed by `./benchmarks/peers/run.sh`: icat, KDL, placo, pink, mink and tsid on the same problems, in one run on one machine. It takes robots from example-robot-data and peers from package registries, each Python one into an environment of its own.

{sys.argv[3]}. C++ programs are compiled with -O3, without -march=native but for the row *icat, native*. Peers of Python run from Python, with the solver that their own pages show. Times are in µs, p50 unless p99 is said; of three rounds the fastest counts.

## The problems

A motion of {STATES} states is given, and in each cycle the goals are where frames, centre of mass and joints are {1000 * DT:.0f} ms later. So all goals can be met, gains are 1/({1000 * DT:.0f} ms), and the answer is known: the velocity that leads to the next state. *Off by* is the median over the cycles of the largest difference of a joint's velocity (rad/s). *Limit*: one joint is kept {1000 * NEAR[0] * MARGIN:.0f} to {1000 * NEAR[1] * MARGIN:.0f} mrad before its upper limit. There icat's task of joint limits is in transition (one row with an activation between 0 and 1) and pushes, so that its answer differs; the peers have a constraint, which is not reached. Every program loads the same URDF, without meshes, with fingers and wheels fixed.

*Target* sets the goals, *model* updates the model to the state, *solve* does the rest: in icat, placo, pink and mink tasks and their Jacobians, too. *Malloc* is heap allocations in a cycle; small objects of Python come from Python's own memory and are not counted.

## Targets

On the Panda icat is not to be slower than the fastest peer, on the larger robots it is to need at most half of its time. It is the total that counts, p50. A peer that lacks some of the tasks is compared apart. *Target* is a few calls of Python in placo, so the comparison is shown without it, too.
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

The numerical solver on what tasks and model have prepared: `Tpik` on the levels of the controller, the QP of pink and mink through qpsolvers, that of tsid. The others do not show theirs.
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
print(f"""## Awkward questions

On the Panda, with gains as above, in a loop of 10 s that integrates the answers. Its joints have limits of velocity of {" and ".join(map(str, speeds))} rad/s. Speed and change (of a joint's velocity from one cycle to the next) are the largest of the last second.
""")


def ask(what, title, header, formats):
    print(f"**{title}**\n")
    rows = []
    for name in names:
        answer = answers.get((name, what))
        if name == "icat, native":
            continue
        if answer is None:
            rows.append([name, "cannot be asked"] + [""] * (len(formats) - 1))
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


ask("out of reach", "The goal is 1 m ahead of the hand, out of the workspace.",
    ["hand off its goal by", "speed", "change", "past a limit"], [mm, speed, speed, past])
ask("outside limits", "The fourth joint starts 0.05 rad beyond its upper limit.",
    ["its velocity at first", "inside after", "fastest joint"],
    [speed, lambda t: f"{t:.2f} s", speed])
ask("conflict", "Two frames of one body are to come apart by 0.2 m; icat has the hand first.",
    ["hand off by", "other frame off by", "speed", "change", "past a limit"],
    [mm, mm, speed, speed, past])

print("## What each solves\n")
table(["", "version", "what it does"], [[name, versions[name], notes[name]] for name in names if name in notes])
for name, reason in missing.items():
    print(f"{name} could not be had here: {reason}\n")
print("""OpenSoT is neither on PyPI nor in Debian, and is not here. tsid 1.10.0, the newest, crashes with Pinocchio 4.0 and 4.1 of PyPI when it makes its robot, so an older pair runs. placo, pink, mink and tsid weigh tasks against each other, icat puts one strictly before the other: where all can be met, they agree; where not, see above. placo and tsid are C++ behind a few calls of Python; pink and mink are Python, and that is most of their time. Their words beside those of icat, and one job in all of them: [coming from pink, mink, placo, tsid, OpenSoT, KDL](coming_from.md).""")
