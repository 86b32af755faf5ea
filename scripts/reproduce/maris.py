# SPDX-License-Identifier: BSD-3-Clause
"""The page of [MARIS]: a vehicle with an arm grasps a pipe in a pool."""
import os
import re
import sys

from page import NOT_REPRODUCED, Page, Report, arguments, off

runs, folder = arguments()


def of(program, file="report.txt"):
    """A file that a program wrote."""
    return os.path.join(runs, program, file)


grasp, navigation, loop, feedback, eyes, calibration, hand = (
    Report(of(program)) for program in ["01_grasp", "10_navigation", "11_vehicle_loop",
                                        "12_velocity_feedback", "14_perception", "15_calibration",
                                        "17_hand"])
campaign = Report(of("16_maris_campaign", "table.txt"))
COUNT = r" +(\d+) of +(\d+) +([\d.]+) % +([\d.]+) \.\.\. +([\d.]+)"
attempts = campaign.find("^April without DVL" + COUNT)[1]

page = Page(
    "[MARIS]: the paper and our results compared",
    "E. Simetti and others, *Autonomous Underwater Intervention: Experimental Results of the MARIS "
    "Project*, IEEE Journal of Oceanic Engineering 43(3), 2018.",
    f"./scripts/reproduce.sh maris {attempts:.0f}    # attempts of each campaign; without a number 300",
    "from the output of the examples that the tables name. The column *paper* has published values, "
    "*here* the values of this run. The paper reports trials in a pool; our results are simulated. The "
    "paper does not print the parameters of vehicle, thrusters, sensors, water and hand: the linked "
    "pages list ours, and [The campaign](campaign.md) says which of them were tuned.")

PHOTO, PHOTOS = "a photograph", "photographs"
DRAWING = "a drawing of a device"
HARDWARE = "hardware: it cannot be computed"

# --- figures -------------------------------------------------------------------------------------

kinds = sorted({row.split()[2] for row in hand.part(r"^pipe .*\n", r"^largest").text.split("\n")
                if " mm " in row})
joints, motors = hand.find(r"^(\d+) joints on (\d+) motors")
wrist_force, wrist_torque, share_force, share_torque = hand.find(
    r"worst axis: ([\d.]+) N, ([\d.]+) N m; of its range ([\d.]+) %, ([\d.]+) %")
mount, mount_angle = calibration.find(
    r"^in-water parameters +[\d.]+ mm +[\d.]+ mrad +([\d.]+) mm +([\d.]+) mrad")
corners = calibration.value(r"^the board on the wrist: (\d+) corners found")
pipe = calibration.part(r"^the axis of a pipe")
air, water = pipe.find(r"^ *2\.0 m +([\d.]+) +([\d.]+)")


def condition(name):
    """Found, of how many, worst error across the axis (mm) where there is one."""
    found, of_all = eyes.find(rf"^{name} +(\d+) of (\d+)")
    seen = f"found in {found:.0f} of {of_all:.0f} pairs of pictures"
    if found:
        seen += f", at most {eyes.value(rf'^{name} +[0-9]+ of [0-9]+ +([0-9.]+) mm'):.1f} mm off"
    return f"picture below; {seen}"


past_arm, pictures, off_axis = eyes.find(
    r"with the arm in view, at night: (\d+) of (\d+) images give the axis, within ([\d.]+) mm")
overshoot, settled = loop.find(r"^PI with feed-forward +overshoot +([\d.]+) %, 2 % after +([\d.]+) s")
bare = loop.value(r"^PI alone +overshoot +([\d.]+) %")
ROW = r" +([\d.]+) +([\d.]+) +([\d.]+) +([\d.]+)"  # joints, acceleration, rates, tool in mm
open_loop, fifty = feedback.find("^no filter" + ROW), feedback.find("^filter 50 rad/s" + ROW)
gain = feedback.value(r"The loop's gain is ([\d.]+)")
lifted = grasp.part(r"^plain: ", r"^underactuated: ").value(r"tool error at grasp +([\d.]+) mm")

page.text("## Figures")
page.figures([
    ["Fig. 1a, 1b", f"{DRAWING}, {PHOTO}: cameras and their canisters", NOT_REPRODUCED, HARDWARE],
    ["Fig. 2", f"{PHOTO}: two grippers", NOT_REPRODUCED, HARDWARE],
    ["Fig. 3", "a drawing: the kinematics of the gripper",
     f"picture below, by `examples/17_hand`; {joints:.0f} joints on {motors:.0f} motors",
     "lengths and angles are not printed, ours are [the hand](hand.md)'s"],
    ["Fig. 4", "drawings of postures of the gripper", f"picture below, {', '.join(kinds)}; open and closed",
     "as Fig. 3"],
    ["Fig. 5a, 5b", f"{PHOTOS}: a motor in its tube", NOT_REPRODUCED, HARDWARE],
    ["Fig. 6", f"{PHOTO}: the gripper on the bench of its wrist sensor", NOT_REPRODUCED, HARDWARE],
    ["Fig. 7a, 7b", f"{DRAWING}, {PHOTO}: inside of the wrist sensor", NOT_REPRODUCED, HARDWARE],
    ["Fig. 8a", "force by the wrist sensor beside a reference",
     f"picture below, by `examples/17_hand`; {wrist_force:.2f} N rms of the worst axis, "
     f"{share_force:.2f} % of the range", "sensor and loads are simulated; axes are not in the text"],
    ["Fig. 8b", "torque, likewise", f"picture below; {wrist_torque:.3f} N m, {share_torque:.2f} %",
     "as Fig. 8a"],
    ["Fig. 9", f"{PHOTO}: the vehicle", NOT_REPRODUCED, HARDWARE],
    ["Fig. 10", "a diagram: processes and how they are connected", NOT_REPRODUCED,
     "a diagram of that software, on RTAI and ROS; [the vehicle](vehicle.md) has the parts that stand "
     "for its blocks"],
    ["Fig. 11a", f"{PHOTO}: a checkerboard on the wrist",
     f"picture below, by `examples/15_calibration`, {corners:.0f} corners found", "rendered"],
    ["Fig. 11b", "a drawing: the frames of the extrinsic calibration",
     f"the calibration in numbers: cameras on the arm off by {mount:.1f} mm, {mount_angle:.1f} mrad",
     "the paper prints no error; of the mm most is [where the pinhole is](images_and_calibration.md)"],
    ["Fig. 12a to 12c", "a picture as it is, rectified with parameters from the air and from the water",
     f"picture below; the axis of a pipe at 2 m off by {air:.0f} mm and {water:.1f} mm",
     "rendered through a port of ours; the paper prints no error"],
    ["Fig. 13a", "day, clear: detected", condition("day, clear"), "rendered"],
    ["Fig. 13b", "night, clear, headlights: detected", condition("night, clear, headlights"),
     "rendered, the same parameters as by day"],
    ["Fig. 13c", "slightly turbid: intermittent", condition("slightly turbid"),
     "turbidity is not printed; ours is at the border by choice"],
    ["Fig. 13d", "very turbid: unable to operate", condition("very turbid"), "rendered"],
    ["Fig. 14", "response of the surge controller, its feedback corrected for the current",
     f"picture below, by `examples/11_vehicle_loop`; overshoot {overshoot:.1f} %, within 2 % after "
     f"{settled:.1f} s; PI alone {bare:.1f} %", "axes and gains are not in the text"],
    ["Fig. 15", f"{PHOTOS}: a grasp out of the water", NOT_REPRODUCED,
     "hardware, of the arm alone in air; Fig. 19 has a grasp in the water"],
    ["Fig. 16", "left and right pictures: arm's mask, measured and tracked contours, at night",
     f"picture below, by `examples/14_perception`; {past_arm:.0f} of {pictures:.0f} pictures give the "
     f"axis, at most {off_axis:.1f} mm off", "rendered"],
    ["Fig. 17a", "noisy feedback of the vehicle's velocity", "picture below, first column, above; rates "
     f"of roll and pitch {open_loop[2]:.4f} rad/s rms in truth", "noise is not printed, ours is"
     " [typical](vehicle.md#noise-of-the-measured-velocity)"],
    ["Fig. 17b", "joint references oscillate",
     f"picture below, first column, below; {open_loop[0]:.3f} rad/s rms",
     f"here they are noisy but do not oscillate: the loop gain through the vehicle is {gain:.2f}"],
    ["Fig. 18a", "the feedback, filtered at 50 rad/s",
     f"picture below, second column, above; rates {fifty[2]:.4f} rad/s rms in truth", "as Fig. 17a"],
    ["Fig. 18b", "joint references are much smoother",
     f"picture below, second column, below; {fifty[0]:.3f} rad/s rms, a factor of "
     f"{open_loop[0] / fifty[0]:.1f} less", "no amplitude is in the text"],
    ["Fig. 19", f"{PHOTOS}: a grasp from the pool's floor",
     f"picture below, by `examples/01_grasp`; the tool {lifted:.3f} mm off at the grasp",
     "drawn of a kinematic simulation; the grasps of the campaign have dynamics and are in Table I"],
])
for name, program, picture, caption in [
        ("hand_postures", "17_hand", "postures", "Fig. 3 and 4. Dashed: open. T is the thumb."),
        ("hand_wrist", "17_hand", "wrist", "Fig. 8. Dashed: the reference."),
        ("calibration_board", "15_calibration", "board", "Fig. 11a"),
        ("calibration_rectified", "15_calibration", "rectified", "Fig. 12"),
        ("eyes_conditions", "14_perception", "conditions", "Fig. 13, from 2 m"),
        ("vehicle_loop", "11_vehicle_loop", "step", "Fig. 14, and the loop without its parts"),
        ("eyes_tracked", "14_perception", "tracked", "Fig. 16"),
        ("velocity_feedback", "12_velocity_feedback", "feedback",
         "Fig. 17 on the left, Fig. 18 in the middle, other cut-offs on the right"),
        ("scene", "01_grasp", "plain/scene", "Fig. 19")]:
    page.picture(name, of(program, picture + ".png"), caption)

# --- Table I -------------------------------------------------------------------------------------

SETS = {"October 2015": ("25%", "NO", "turbidity was tuned on this campaign"),
        "December 2015": ("30.7%", "NO", "the umbilical's pull was tuned on this campaign"),
        "April 2016": ("70.5%", "YES", "a prediction, not tuned; [why it is too high](campaign.md)")}


def points(rate, other):
    """The difference of two rates in per cent."""
    return f"{rate - other:+.0f} points" if abs(rate - other) >= 0.5 else "0 points"


rows = []
rates = {}
for name, (printed, dvl, why) in SETS.items():
    (there, tried, paper, low, high, here, of_all, rate, lower, upper) = campaign.find(
        "^" + name + COUNT + COUNT)
    rates[name] = rate
    inside = "inside its interval" if low <= rate <= high else "outside its interval"
    rows.append([name, dvl, f"{there:.0f} of {tried:.0f}: {printed} ({low:.1f} to {high:.1f})",
                 f"{here:.0f} of {of_all:.0f}: {rate:.1f} % ({lower:.1f} to {upper:.1f})",
                 f"{points(rate, paper)}, {inside}", why])
for name, dvl, why in [
        ("April without compensation", "YES", "worse than December: the DVL alone is no cure"),
        ("April without filter", "YES", "the filter makes the joints smoother; the success rate here does not depend on it"),
        ("April without DVL", "NO", "without DVL no velocity is measured that the arm could compensate")]:
    here, of_all, rate, lower, upper = campaign.find("^" + name + COUNT)
    rows.append([name, dvl, "–", f"{here:.0f} of {of_all:.0f}: {rate:.1f} % ({lower:.1f} to "
                 f"{upper:.1f})", f"{points(rate, rates['April 2016'])} to April", why])
page.text(f"## Table I: success of grasps\n\n{attempts:.0f} attempts of each campaign, by "
          "`examples/16_maris_campaign`; in brackets the interval of 95 % by Wilson. The paper prints "
          "rates without intervals. With few attempts the rates here are as unsure as their intervals "
          "say. [The campaign](campaign.md) explains "
          "why attempts fail and what the ablations mean; the reasons below come from it.")
page.table(["campaign", "DVL", "paper", "here", "off", "why"], rows)
page.picture("campaign", of("16_maris_campaign", "attempts.png"),
             "One attempt of each; the paper prints no such figure.")

# --- numbers -------------------------------------------------------------------------------------

pairs = eyes.value(r"([\d.]+) pairs a second")
held, left = ([float(d) for d in re.findall(rf"^ +(\d+) mm .* {end} ", hand.text, re.M)]
              for end in ("held", "left"))
if not held or not left:
    sys.exit(f"error: no pipes in {hand.path}")
force = hand.value(r"largest force of a finger: ([\d.]+) N")
december, april = campaign.find(r"December or April +p = ([\d.]+) in the paper, ([\d.e+-]+) here")
tools = [feedback.find(rf"^{name}" + ROW)[3] for name in
         [f"filter {cutoff} rad/s" for cutoff in (2, 5, 10, 20, 50, 100, 200)] + ["no filter"]]
current, outage, worst = navigation.find(
    r"current known to ([\d.]+) cm/s; without DVL for ([\d.]+) s the velocity was off by ([\d.]+) cm/s")
compensated = grasp.value(r"the compensation makes the tool error (\d+) times smaller")
before, after = rates["December 2015"], rates["April 2016"]
page.text("## Claims and numbers")
page.numbers([
    ["II-B", "pictures of 1292 × 964 worked through", "about 10 Hz", f"{pairs:.0f} Hz", off(pairs, 10),
     "another processor, one core of the machine at hand; without undistortion"],
    ["II-C", "diameters that the gripper holds", "5 to 200 mm", f"{min(held):.0f} to {max(held):.0f} mm",
     "equal" if [min(held), max(held)] == [5, 200] else "differs",
     f"our fingers are made to; {' and '.join(f'{d:.0f}' for d in left)} mm are not held"],
    ["II-C", "largest force of a finger", "about 150 N", f"{force:.0f} N", off(force, 150),
     "the current's limit is chosen to stay below"],
    ["III-B9", "the arm makes up for the vehicle's velocity: tool error in a current", "less",
     f"{compensated:.0f} times less", "–", "kinematic vehicle with a sinusoidal current, `examples/01_grasp`"],
    ["V", "estimators of yaw rate, velocity, attitude and position", "no number",
     f"current known to {current:.1f} cm/s; velocity off by {worst:.1f} cm/s at most in {outage:.1f} s "
     "without DVL", "–",
     "`examples/10_navigation`; states and noise are [ours](navigation.md)"],
    ["VI-D", "cut-off of the filter", "50 rad/s",
     f"the tool's error at 50 rad/s is {fifty[3] / min(tools):.2f} times the least of all tried", "–",
     "among 2 to 200 rad/s and none; from 20 rad/s on it hardly matters"],
    ["VI-D", "success from December to April", "basically doubling",
     f"from {before:.0f} to {after:.0f} %", f"× {after / before:.2g}" if before else "–",
     "April is too good here, see Table I"],
    ["Table I", "December and April differ with p, by Fisher's test", f"{december:.3f} (not printed)",
     f"{april:.2g}", "–", "from the counts"],
])
page.text("Taken from the paper as they are: the mission's three steps, the seven levels of the grasp, "
          "TPIK 1 and 2, torque before force, the vehicle's size and a weight between the published "
          "ones, the pipe of 1 m and 5 cm, the region of colour, the gripper's structure and its 4.5 and "
          "1 daN, 3 to 4 m of water. Its contradictions are [listed]"
          "(mathematics.md#slips-of-the-papers).\n\n"
          "Not simulated: the CAN line and the processes of Fig. 10 ([CANopen drives](canopen.md) have "
          "their own tests), the palm camera, the pool.")
page.write("reproduce_maris", folder)
