# SPDX-License-Identifier: BSD-3-Clause
"""placo, as its examples use it."""
from importlib.metadata import version

import numpy as np
import placo

import problems


class Peer:
    def __init__(self, p):
        self.robot = robot = placo.RobotWrapper(p.file, placo.Flags.ignore_collisions)
        self.solver = solver = placo.KinematicsSolver(robot)
        solver.dt = problems.DT
        solver.mask_fbase(not p.free)
        solver.enable_joint_limits(True)
        solver.enable_velocity_limits(True)
        self.names = p.joints
        self.q = [robot.get_joint_offset(j) for j in p.joints]
        self.v = [robot.get_joint_v_offset(j) for j in p.joints]
        self.frame_names = p.frames
        self.frames = [solver.add_frame_task(f, np.eye(4)) for f in p.frames]
        for name, task in zip(p.frames, self.frames):
            task.configure(name, "soft", 1.0, 1.0)
        self.com = solver.add_com_task(np.zeros(3)) if p.com else None
        if self.com:
            self.com.configure("com", "soft", 1.0)
        self.posture = solver.add_joints_task()
        self.posture.configure("posture", "soft", 1e-3)
        solver.add_regularization_task(1e-6)

    def state(self, base, q, v):
        state = self.robot.state.q.copy()
        state[:7] = [*base, 0, 0, 0, 1]
        state[self.q] = q
        return state

    def model(self, state):
        self.robot.state.q = state
        self.robot.update_kinematics()

    def goal(self, state):
        poses = [self.robot.get_T_world_frame(f).copy() for f in self.frame_names]
        posture = {name: state[i] for name, i in zip(self.names, self.q)}
        return poses, self.robot.com_world().copy(), posture

    def move(self, goal, i, by):
        goal[0][i][:3, 3] += by

    def position(self, i):
        return self.robot.get_T_world_frame(self.frame_names[i])[:3, 3].copy()

    def target(self, goal):
        poses, com, posture = goal
        for task, pose in zip(self.frames, poses):
            task.T_world_frame = pose
        if self.com:
            self.com.target_world = com
        self.posture.set_joints(posture)

    def solve(self):
        return self.solver.solve(False)

    def joints(self, answer, state):
        return answer[self.v] / problems.DT


problems.main(
    "placo", Peer, version("placo"),
    "weighted least squares under hard limits (QP). Frames and centre of mass weigh 1, the posture "
    "1e-3, the regularization 1e-6.")
