# SPDX-License-Identifier: BSD-3-Clause
"""The page of [Coop]: two vehicles carry a pipe."""
import csv
import os
import sys

from page import NOT_REPRODUCED, Page, Report, arguments, compare, off

runs, folder = arguments()
mission = os.path.join(runs, "02_cooperative_mission")
loaded = os.path.join(runs, "04_table3")
report = Report(os.path.join(mission, "report.txt"))
forces = Report(os.path.join(loaded, "report.txt"))
plain = report.part(r"^plain: ", r"^current: ")

page = Page(
    "[Coop]: the paper and our results compared",
    "E. Simetti, G. Casalino, *Manipulation and Transportation with Cooperative Underwater Vehicle "
    "Manipulator Systems*, IEEE Journal of Oceanic Engineering, 2016.",
    "./scripts/reproduce.sh coop",
    "from the output of `examples/02_cooperative_mission` and `examples/04_table3`. The column *paper* "
    "has published values, *here* the values of this run, *off* the difference or factor between "
    "them. The paper does not print gains, limits and tolerances. [Cooperation](cooperation.md) lists "
    "those of the mission, [Under load](hydrodynamics.md) those of Table III.")

# --- what the mission did ------------------------------------------------------------------------

PHASES = ["navigate", "grasp", "join", "transport", "deploy", "part", "step back"]
IN_PAPER = ["navigation", "grasping", "transition", "transportation", "deployment", "transition",
            "step-back"]


def times(heading, column):
    """By phase. Columns: paper, still water, current, compensated, centralized, paper in current."""
    return {row[0]: float(row[column]) for row in report.table(heading) if row[column]}


PAPER, STILL, COMPENSATED, PAPER_CURRENT = 1, 2, 4, 6
ends, ends_current = (times("phase ends at (s)", k) for k in (STILL, COMPENSATED))
takes, takes_current = (times("phase takes (s)", k) for k in (STILL, COMPENSATED))


def samples(variant):
    """The run's rows, by the names of the columns."""
    with open(os.path.join(mission, variant, "mission.csv"), encoding="utf-8") as file:
        for row in csv.DictReader(file):
            yield {key: float(value) for key, value in row.items()}


# Of arm a, RMS over transport after its fade of 2 s; of both, the largest activations.
carrying, largest, centering = {}, {}, {}
for variant in ["plain", "compensated"]:
    squares = count = 0
    begin = (ends if variant == "plain" else ends_current)["join"] + 2
    for s in samples(variant):
        if s["phase"] == 3 and s["t"] > begin:
            squares += sum(s[f"qdot{i}_a"] ** 2 for i in range(1, 8))
            count += 1
        for key, value in s.items():
            if key.startswith("a_"):
                largest[variant, key] = max(largest.get((variant, key), 0), value)
        if s["phase"] == 1:
            centering[variant] = max(centering.get(variant, 0), s["a_camera_centering_a"])
    carrying[variant] = (squares / count) ** 0.5


def active(variant):
    """How many of a robot's tasks had something to do, of all; joint limits are one."""
    tasks = {}
    for (name, key), value in largest.items():
        if name == variant and key.endswith("_a"):
            task = "limits" if key.startswith("a_limit") else key
            tasks[task] = max(tasks.get(task, 0), value)
    return sum(value > 0.01 for value in tasks.values()), len(tasks)


step, at_grasp, chatter = (plain.value(pattern) for pattern in [
    r"change of the command in a cycle, at most \| ([\d.]+)",
    r"the same at grasp and release \| ([\d.]+)", r"alternating sign over three cycles \| ([\d.e+-]+)"])
fig2 = report.table("Fig. 2")[0][1:]

page.text("## Figures")
page.figures([
    ["Fig. 1", "a drawing of the robot and its frames", NOT_REPRODUCED,
     "a drawing of the symbols; [Robots](robots.md) has the frames"],
    ["Fig. 2", "an activation function, x at most 0.1, β = 0.05",
     f"picture below; {fig2[0]} at 0.05, {fig2[2]} at 0.075, {fig2[4]} at 0.1",
     "the paper allows any sigmoid"],
    ["Fig. 3", "a drawing of two robots, the pipe and its frames", NOT_REPRODUCED,
     "a drawing of the symbols; both robots are drawn in Fig. 4"],
    ["Fig. 4a to 4f", "screenshots of UWSim at 0, 13.71, 20, 39.3, 45 and 55 s",
     f"picture below, at 0, {ends['grasp']:.2f}, {(ends['join'] + ends['transport']) / 2:.1f}, "
     f"{ends['transport']:.2f}, {ends['deploy']:.2f} and {ends['step back']:.2f} s",
     "a line drawing instead of a rendered scene; the tables below compare the times"],
    ["Fig. 5a to 5d", "joint and vehicle velocities of both robots, no jumps, no chattering but where "
     "the grasp begins and ends",
     f"picture below; largest change in a cycle {step:.4f}, at grasp and release {at_grasp:.4f}, of "
     f"alternating sign {chatter:.1g} (m/s, rad/s)",
     "the axes of the paper are not in its text; here the agreed velocity has faded in before the "
     "grippers close, so the grasp is no jump"],
    ["Fig. 5e, 5f", "the same from 38 to 41 s", "the last row of the picture, 38 to 41 s",
     "the phase changes at another time here"],
    ["Fig. 6", "activations of all tasks", "picture below; {} of {} tasks of robot a were active, "
     "camera centering at most {:.2f} while grasping".format(*active("plain"), centering["plain"]),
     "the paper has camera centering below 1, too; start and thresholds are ours"],
    ["Fig. 7", "velocities in a current with compensation: the arm's are not zero while carrying",
     f"picture below; joints of arm a, RMS while carrying: {carrying['compensated']:.3f} rad/s, "
     f"{carrying['plain']:.3f} in still water",
     "the amplitude of the paper's current is not printed; here 0.05 m/s"],
    ["Fig. 8", "activations in the current",
     "picture below; {} of {} tasks of robot a were active".format(*active("compensated")),
     "as Fig. 6"],
])
page.picture("activation", os.path.join(mission, "activation.png"), "Fig. 2")
for name, variant, picture, caption in [
        ("cooperation_scene", "plain", "scene", "Fig. 4"),
        ("cooperation_velocities", "plain", "velocities", "Fig. 5"),
        ("cooperation_activations", "plain", "activations", "Fig. 6"),
        ("cooperation_velocities_current", "compensated", "velocities", "Fig. 7"),
        ("cooperation_activations_current", "compensated", "activations", "Fig. 8")]:
    page.picture(name, os.path.join(mission, variant, picture + ".png"), caption)

# --- Tables I and II -----------------------------------------------------------------------------

TABLE_1 = {
    "joint limits": "1 1 1 1 1 1 1", "vehicle distance": "1 1 1 1 1 1 1",
    "manipulability": "1 1 1 1 1 1 1", "camera centering": "0 0→1 1→0 0 0 0 0",
    "horizontal attitude": "1 1 1 1 1 1 1", "vehicle pose": "1 1→0 0 0 0 0 0",
    "tool pose": "0 0→1 1 1 1 1 1", "still arm": "1 1→0 0→1 1 1→0 0 0",
    "still vehicle": "0 0→1 1→0 0 0→1 1 1"}
ours = {row[0]: [cell.replace(" ", "") for cell in row[1:]]
        for row in report.table("activation, Table I")}
differ = 0
rows = []
for task, paper in TABLE_1.items():
    row = [task]
    for here, there in zip(ours[task], paper.split(), strict=True):
        differ += here != there
        row.append(here if here == there else f"{here} (paper {there})")
    rows.append(row)
page.text("## Table I: phase-dependent activations\n\nOf the actions as the example lists them. Of "
          f"{7 * len(rows)} entries {differ} differ from the paper's.")
page.table(["task"] + IN_PAPER, rows)

TABLE_2 = {"added mass": ("158.4 137.1 171.3", "15 20 20", "kg", "kg m²"),
           "linear drag": ("50 50 44", "20 20 24", "N s/m", "N m s/rad"),
           "quadratic drag": ("320 320 430", "40 40 31", "N s²/m²", "N m s²/rad²")}
vehicle = {row[0]: row[1:] for row in forces.table("vehicle, Table II")}
rows = []
for name, (along, about, unit, turn) in TABLE_2.items():
    same = vehicle[name] == [along, about]
    rows.append([f"vehicle's {name}", f"{along} {unit}; {about} {turn}",
                 f"{vehicle[name][0]} {unit}; {vehicle[name][1]} {turn}",
                 "equal" if same else "differs"])
page.text("## Table II: hydrodynamic parameters\n\nOf the vehicles that Table III is simulated with.")
page.table(["parameter", "paper", "here", "off"], rows)

# --- Table III -----------------------------------------------------------------------------------

WHY = {"T1": "it completes here: [why](hydrodynamics.md#the-difference-t1)",
       "T2": "different proposals and saturated arms charge the integrators",
       "T3": "different arm postures; the proposals agree",
       "T4": "after the filter the different arm postures remain",
       "T5": "as T4, in steps of a second",
       "T6": "the agents fuse velocities of different instants",
       "T7": "the gain of the force modification is not printed",
       "T8": "here the modification also uses the moment",
       "T9": "as T8", "T10": "as T8 and T6",
       "T11": "slow feedback costs less here: [why](hydrodynamics.md#why-the-rows-differ)"}
# Below each test stands the paper's row.
measured = forces.table("test")
rows = []
for k, (test, why) in enumerate(WHY.items()):
    here, there = measured[2 * k], measured[2 * k + 1]
    if [here[0], there[0]] != [test, "paper"]:
        sys.exit(f"error: {test} is not where it was in {forces.path}")
    row = [test]
    for value, paper in zip(here[6:13], there[6:13], strict=True):
        if paper and paper != "aborted":
            row.append(f"{value} ({paper}) {off(float(value), float(paper))}")
        else:
            row.append(f"{value} ({paper})" if paper else value)
    rows.append(row + [why])
page.text("## Table III: interaction of the robots through the pipe\n\nForces in N, moments in N m, "
          "final errors in m: here, (paper), off. The paper asks to compare the rows with each other, "
          "not the numbers with reference values. Final errors depend on how long one waits, which "
          "is not printed.")
page.table(["test", "final error", "F max", "F mean", "F std", "M max", "M mean", "M std", "why"], rows)
page.picture("table3_forces", os.path.join(loaded, "forces.png"),
             "Interaction of each row over time; the paper prints no such figure.")

relations = forces.table("the paper says")
missed = [row for row in relations if row[3] == "NO"]
page.text("What the paper says of this table in words, or where the table shows it clearly, as "
          "relations between rows.")
rows = [["V-B", "relations that hold", f"{len(relations)}", f"{len(relations) - len(missed)}",
         off(len(relations) - len(missed), len(relations)),
         "each is listed [under load](hydrodynamics.md)"]]
for text, there, here, _ in missed:
    rows.append(["V-B", text, there, here, "does not hold",
                 "what was tried: [T1](hydrodynamics.md#the-difference-t1)" if "T1 " in text else
                 "the largest forces come from the first seconds of half duplex, whatever the feedback"])
factor = forces.value(r"mean factor between here and there \| ([\d.]+)")
ranks = forces.find(r"F mean, F max, M mean \| ([\d.]+), ([\d.]+), ([\d.]+)")
rows.append(["Table III", "F mean, F max, M mean of T2 to T11, mean factor up or down", "–",
             f"{factor:.2f}", f"× {factor:.2g}", "one set of gains for all rows"])
rows.append(["Table III", "rank correlation of F mean, F max, M mean", "–",
             ", ".join(f"{r:.2f}" for r in ranks), "–", "1 is the same order of the rows"])
peak, mean = forces.find(r"peak, mean \(paper [^)]*\) \| ([\d.]+) N, ([\d.]+) N")


def beside(value, low, high):
    """Of a range that is printed."""
    return "inside" if low <= value <= high else off(value, high if value > high else low)


rows.append(["V-B", "largest force of a vehicle along an axis", "roughly 150 to 170 N", f"{peak:.0f} N",
             beside(peak, 150, 170), "the largest of all rows, also of those beyond the paper"])
rows.append(["V-B", "mean force of a vehicle", "around 30 to 50 N", f"{mean:.0f} N",
             beside(mean, 30, 50), "of the axis and the row where it is largest"])
page.numbers(rows)

# --- numbers -------------------------------------------------------------------------------------

page.text("## The mission's times\n\nIn seconds. The paper does not print the tolerances "
          "at which phases end.")
there, took = times("phase ends at (s)", PAPER), times("phase takes (s)", PAPER)
rows = []
for phase, name in zip(PHASES, IN_PAPER, strict=True):
    rows.append(compare("V-A", f"end of {name}", there[phase], ends[phase], "s"))
    rows.append(compare("V-A", f"{name} takes", took[phase], takes[phase], "s"))
REASONS = {"end of navigation": "start and gains are ours",
           "navigation takes": "start and gains are ours", "grasping takes": "gain of the tool is ours",
           "transition takes": "both transitions last 2.5 s by choice, after the paper's",
           "transportation takes": "limits of the tool's velocity are ours",
           "deployment takes": "the arms lose manipulability, the vehicles take over",
           "step-back takes": "as grasping"}
for row in rows:
    row[5] = REASONS.get(row[1], "all phases before it")
second = times("phase ends at (s)", PAPER_CURRENT)
rows += [
    compare("V-A, second run", "transportation begins", second["join"], ends_current["join"], "s",
            "grasping in the current is shorter here: its tolerance is not printed"),
    compare("V-A, second run", "transportation ends", second["transport"],
            ends_current["transport"], "s", "as its begin"),
    compare("V-A, second run", "transportation takes",
            times("phase takes (s)", PAPER_CURRENT)["transport"], takes_current["transport"], "s",
            "amplitude and period of the current are ours")]
page.numbers(rows)

bits = {row[0]: row[1:] for row in report.table("a message has")}
short, spans = float(bits["velocity"][1]), float(bits["velocity and spans"][1])
page.text("## Communication")
page.numbers([
    compare("I", "numbers in a message", 6, float(bits["velocity"][0]), digits=0),
    compare("I", "bits of a message", 192, short, digits=0),
    compare("I", "messages at 5 kbit/s", 25, 5000 / short, "Hz", "the paper rounds down", 1),
    compare("I", "messages at 10 kbit/s", 50, 10000 / short, "Hz", "the paper rounds down", 1),
    compare("I", "messages at 976 bit/s", 5, 976 / short, "Hz", "the paper rounds down", 1),
    compare("IV-B", "numbers more with spans", 36,
            float(bits["velocity and spans"][0]) - float(bits["velocity"][0]), digits=0),
    ["IV-B", "messages with spans at 976 bit/s", "future work", f"{976 / spans:.2f} Hz", "–",
     "spans are an option here"]])
page.text("The rates are the bandwidths that the paper cites, over the bits of a message as it is sent "
          "here. Real modems have headers and turns: [acoustic modems](acoustic_modem.md).\n\n"
          "Taken from the paper as they are: the pipe's place, the grasps 1.5 m from its centre, both "
          "pre-deployments, the depth of 3 m, the step back of 0.5 m, the tasks and their order, 100 Hz "
          "and 2 kHz, masses and lengths of the links, the loads of Table II, duplex, rate, latency "
          "and feedback of each row of Table III. Its slips are [listed]"
          "(mathematics.md#slips-of-the-papers).")
page.write("reproduce_coop", folder)
