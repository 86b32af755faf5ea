# SPDX-License-Identifier: BSD-3-Clause
"""The page of [NSB]: null-space-based guidance of a planar vehicle with two arms."""
import os

from page import NOT_REPRODUCED, Page, Report, arguments

runs, folder = arguments()
run = os.path.join(runs, "03_nsb_dual_arm")
report = Report(os.path.join(run, "report.txt"))

page = Page(
    "[NSB]: the paper and our results compared",
    "S. Moe, G. Antonelli, K. Y. Pettersen, *Null-Space-Based Behavior Guidance of Planar Dual-Arm "
    "UVMS*, 2014.",
    "./scripts/reproduce.sh nsb",
    "from the output of `examples/03_nsb_dual_arm`. The column *paper* has published values, *here* "
    "the values of this run. The paper prints its equations, gains and velocity limits; it prints "
    "neither the vehicle's dimensions nor the start, the line or its speed. So figures can be "
    "similar but not equal; [Null-space-based guidance](null_space_guidance.md) lists our choices and "
    "compares the method with iCAT.")

# The first column of numbers is NSB on the line; times first, then errors.
TASKS = ["tool pose", "vehicle orientation", "vertical distance", "field of view", "first joint"]
times = report.part(r"^error below", r"^largest error")
errors = report.part(r"^largest error", r"^peak velocity")
below = [times.value(rf"^  {task}[^0-9]*?([\d.]+)") for task in TASKS]
left = [errors.value(rf"^  {task}[^0-9]*?([\d.]+)") for task in TASKS]

page.text("## Figures")
page.figures([
    ["Fig. 1", "a drawing of vehicle and arms", NOT_REPRODUCED,
     "a drawing of the symbols; the robot is drawn in Fig. 4"],
    ["Fig. 2", "a drawing of the directions a and a_des", NOT_REPRODUCED,
     "a drawing of the symbols; the direction of arm 2 is drawn in Fig. 4"],
    ["Fig. 3", "a block diagram of (31) and (32)", NOT_REPRODUCED,
     "a diagram of the guidance; its code is shown on [the page on this method]"
     "(null_space_guidance.md)"],
    ["Fig. 4a to 4d", "four moments: the tool follows a line, the vehicle is level, arm 2 points at "
     "the tool", "picture below, with its times",
     "the times of the paper are not in its text; dimensions, start and line are ours"],
    ["Fig. 5a", "errors of the leader's tasks go to zero",
     f"picture below; below 0.001 from {max(below[:3]):.2f} s on", "start and dimensions are ours"],
    ["Fig. 5b", "errors of the follower's tasks go to zero",
     f"picture below; below 0.001 from {max(below[3:]):.2f} s on", "start and dimensions are ours"],
])
page.picture("nsb_snapshots", os.path.join(run, "snapshots.png"),
             "Fig. 4a to 4d. Green, dashed: the line. Red: the reference on it. Purple, dashed: where "
             "arm 2 points.")
page.picture("nsb_errors", os.path.join(run, "errors.png"),
             "Fig. 5a and 5b. On the right the whole run, logarithmic.")

page.text("## Tables\n\nThe paper has none.")

page.text("## Claims and numbers")
names = {"tool pose": "leader 1: pose of tool 1 (8)", "vehicle orientation": "leader 2: level (11)",
         "vertical distance": "leader 3: vertical distance (14)",
         "field of view": "follower 1: field of view (17)", "first joint": "follower 2: q21 (24)"}
rows = []
for k, task in enumerate(TASKS):
    why = ("a lower task of NSB lags while the tool moves, in proportion to its speed"
           if left[k] > 0 else "")
    rows.append(["V, Fig. 5", names[task] + ": its error goes to zero", "goes to zero",
                 f"below 0.001 from {below[k]:.2f} s on; at most {left[k]:.4f} on the second half of the line",
                 "–", why])
leader, follower = below[:3] == sorted(below[:3]), below[3:] == sorted(below[3:])
starts, done, leaders, followers = report.find(
    r"NSB from (\d+) random starts[^.]*\.[^.]*?from (\d+) of them, in the order\s+of priority for the "
    r"leader from (\d+), for the follower from (\d+)")
rows.append(["V", "higher tasks converge before lower ones", "yes",
             f"leader {'yes' if leader else 'no'}, follower {'yes' if follower else 'no'}; from "
             f"{starts:.0f} random starts: leader {leaders:.0f}, follower {followers:.0f}", "–",
             "it depends on the start: the gains of the lower tasks are the larger ones"])
rows.append(["V", "all tasks are fulfilled", "yes", f"from {done:.0f} of {starts:.0f} random starts",
             "–", ""])
peaks = report.part(r"^peak velocity", r"^largest change")
for label, equation, limit, unit, digits in [
        (r"u \(m/s", "surge", 3, "m/s", 2), (r"v \(m/s", "sway", 2, "m/s", 2),
        (r"r \(deg/s", "yaw rate", 3, "deg/s", 1), (r"arm 1 \(deg/s", "joints of arm 1", 10, "deg/s", 1),
        (r"arm 2 \(deg/s", "joints of arm 2", 10, "deg/s", 1)]:
    peak = peaks.value(rf"^  {label}, at most \d+\) +([\d.]+)")
    at_limit = peak > 0.99 * limit
    rows.append(["V, Eq. (36)", f"{equation}, at most", f"{limit} {unit}", f"{peak:.{digits}f} {unit}",
                 "at the limit" if at_limit else f"{100 * peak / limit:.0f} % of it",
                 "the start is off its goals, and velocities are cut off as in the paper"
                 if at_limit else "start, line and its speed are ours"])
page.numbers(rows)
page.text("Taken from the paper as they are: the kinematics (1) to (5), the five tasks, the gains "
          "(35) = 1, 3, 2 of the leader and 1, 3 of the follower, the distance H/2 + 2/3 of arm 1, the "
          "limits (36). Slips in its formulas are [listed](mathematics.md#null-space-based-guidance-nsb).\n\n"
          "The paper's further work (three dimensions, tasks of both arms together, collisions, trials) "
          "is no part of this page.")
page.write("reproduce_nsb", folder)
