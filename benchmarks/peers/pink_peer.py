# SPDX-License-Identifier: BSD-3-Clause
"""pink, with the solver of its README."""
from importlib.metadata import version

import numpy as np
import pink
import pinocchio as pin
import qpsolvers
from pink.tasks import ComTask, FrameTask, PostureTask

import problems


class Peer:
    def __init__(self, p):
        root = pin.JointModelFreeFlyer() if p.free else None
        self.model_ = model = (
            pin.buildModelFromUrdf(p.file, root) if root else pin.buildModelFromUrdf(p.file))
        self.free = p.free
        ids = [model.getJointId(j) for j in p.joints]
        self.q = [model.joints[i].idx_q for i in ids]
        self.v = [model.joints[i].idx_v for i in ids]
        self.configuration = pink.Configuration(model, model.createData(), pin.neutral(model))
        self.frame_names = p.frames
        self.frames = [
            FrameTask(f, position_cost=1.0, orientation_cost=1.0, lm_damping=1.0)
            for f in p.frames]
        self.posture = PostureTask(cost=1e-3)
        self.com = ComTask(cost=1.0) if p.com else None
        self.tasks = self.frames + ([self.com] if p.com else []) + [self.posture]

    def state(self, base, q, v):
        state = pin.neutral(self.model_)
        if self.free:
            state[:3] = base
        state[self.q] = q
        return state

    def model(self, state):
        self.configuration.update(state)

    def goal(self, state):
        at = self.configuration.get_transform_frame_to_world
        com = pin.centerOfMass(self.model_, self.model_.createData(), state)
        return [at(f).copy() for f in self.frame_names], com, state

    def move(self, goal, i, by):
        goal[0][i].translation += np.array(by)

    def position(self, i):
        return self.configuration.get_transform_frame_to_world(
            self.frame_names[i]).translation.copy()

    def target(self, goal):
        poses, com, posture = goal
        for task, pose in zip(self.frames, poses):
            task.set_target(pose)
        if self.com:
            self.com.set_target(com)
        self.posture.set_target(posture)

    def solve(self):
        return pink.solve_ik(self.configuration, self.tasks, problems.DT, solver="quadprog")

    def build(self):
        self.problem = pink.build_ik(self.configuration, self.tasks, problems.DT)

    def solve_built(self):
        qpsolvers.solve_problem(self.problem, solver="quadprog")

    def joints(self, answer, state):
        return answer[self.v]


problems.main(
    "pink", Peer,
    f"{version('pin-pink')}, pin {version('pin')}, qpsolvers {version('qpsolvers')}, "
    f"quadprog {version('quadprog')}, numpy {version('numpy')}",
    "weighted least squares under hard limits (QP). Frames and centre of mass cost 1, the posture "
    "1e-3; `lm_damping=1` on frames.")
