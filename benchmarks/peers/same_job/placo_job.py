# SPDX-License-Identifier: BSD-3-Clause
"""The job with placo."""
from importlib.metadata import version

import placo
from job import DT, JOINTS, STEPS, main


def reach(urdf, q, by, cost, path):
    #! [job]
    robot = placo.RobotWrapper(urdf, placo.Flags.ignore_collisions)
    solver = placo.KinematicsSolver(robot)
    solver.dt = DT
    solver.mask_fbase(True)  # the base stands
    solver.enable_velocity_limits(True)  # those of position are on by default
    for joint, position in zip(JOINTS, q):
        robot.set_joint(joint, position)
    robot.update_kinematics()
    goal = robot.get_T_world_frame("panda_hand")
    goal[:3, 3] += by
    hand = solver.add_frame_task("panda_hand", goal)
    hand.configure("hand", "soft", 1.0, 1.0)
    posture = solver.add_joints_task()
    posture.set_joints(dict(zip(JOINTS, q)))
    posture.configure("posture", "soft", cost**2)  # weighs the square
    solver.add_regularization_task(1e-6)
    for _ in range(STEPS):  # each step goes for the whole error, as fast as limits allow
        solver.solve(True)
        robot.update_kinematics()
        path.append([robot.get_joint(joint) for joint in JOINTS])
    #! [job]


main("placo", version("placo"), reach)
