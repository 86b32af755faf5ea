# SPDX-License-Identifier: BSD-3-Clause
"""The job with mink."""
from importlib.metadata import version

import mink
import mujoco
from job import DT, JOINTS, STEPS, main

SPEEDS = dict(zip(JOINTS, 4 * [2.175] + 3 * [2.61]))  # rad/s; MuJoCo does not read the URDF's


def reach(urdf, q, by, cost, path):
    #! [job]
    model = mujoco.MjModel.from_xml_path(urdf)
    configuration = mink.Configuration(model, q)
    hand = mink.FrameTask("panda_hand", "body", position_cost=1.0, orientation_cost=1.0,
                          gain=2 * DT, lm_damping=100.0)  # a gain of 2 1/s
    posture = mink.PostureTask(model, cost=cost, gain=2 * DT)
    limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, SPEEDS)]
    start = configuration.get_transform_frame_to_world("panda_hand", "body")
    hand.set_target(mink.SE3.from_translation(by) @ start)
    posture.set_target(q)
    for _ in range(STEPS):
        v = mink.solve_ik(configuration, [hand, posture], DT, solver="daqp", limits=limits)
        configuration.integrate_inplace(v, DT)
        path.append(configuration.q.copy())
    #! [job]


main("mink", f"{version('mink')}, mujoco {version('mujoco')}, daqp {version('daqp')}", reach)
