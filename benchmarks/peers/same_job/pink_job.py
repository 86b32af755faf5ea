# SPDX-License-Identifier: BSD-3-Clause
"""The job with pink."""
from importlib.metadata import version

import pink
import pinocchio as pin
from job import DT, STEPS, main
from pink.tasks import FrameTask, PostureTask


def reach(urdf, q, by, cost, path):
    #! [job]
    model = pin.buildModelFromUrdf(urdf)
    configuration = pink.Configuration(model, model.createData(), q)
    hand = FrameTask("panda_hand", position_cost=1.0, orientation_cost=1.0,
                     gain=2 * DT, lm_damping=100.0)  # a gain of 2 1/s
    posture = PostureTask(cost=cost, gain=2 * DT)
    goal = configuration.get_transform_frame_to_world("panda_hand").copy()
    goal.translation += by
    hand.set_target(goal)
    posture.set_target(q)
    for _ in range(STEPS):  # limits of position and velocity are on by default
        v = pink.solve_ik(configuration, [hand, posture], DT, solver="quadprog")
        configuration.integrate_inplace(v, DT)
        path.append(configuration.q)
    #! [job]


main("pink", f"{version('pin-pink')}, pin {version('pin')}, quadprog {version('quadprog')}", reach)
