# SPDX-License-Identifier: BSD-3-Clause
"""mink, on the URDF as MuJoCo imports it."""
from importlib.metadata import version

import mink
import mujoco
import numpy as np
import qpsolvers

import problems


class Peer:
    def __init__(self, p):
        spec = mujoco.MjSpec.from_file(p.file)
        if p.free:
            spec.worldbody.first_body().add_freejoint()
        self.model_ = model = spec.compile()
        self.free = p.free
        self.q = [model.joint(j).qposadr[0] for j in p.joints]
        self.v = [model.joint(j).dofadr[0] for j in p.joints]
        self.configuration = mink.Configuration(model)
        self.frame_names = p.frames
        self.frames = [
            mink.FrameTask(f, "body", position_cost=1.0, orientation_cost=1.0, lm_damping=1.0)
            for f in p.frames]
        self.posture = mink.PostureTask(model, cost=1e-3)
        self.com = mink.ComTask(cost=1.0) if p.com else None
        self.tasks = self.frames + ([self.com] if p.com else []) + [self.posture]
        self.limits = [
            mink.ConfigurationLimit(model), mink.VelocityLimit(model, dict(zip(p.joints, p.speed)))]

    def state(self, base, q, v):
        state = self.model_.qpos0.copy()
        if self.free:
            state[:7] = [*base, 1, 0, 0, 0]
        state[self.q] = q
        return state

    def model(self, state):
        self.configuration.update(state)

    def goal(self, state):
        at = self.configuration.get_transform_frame_to_world
        com = self.configuration.data.subtree_com[1].copy()
        return [at(f, "body").copy() for f in self.frame_names], com, state

    def move(self, goal, i, by):
        pose = goal[0][i]
        goal[0][i] = mink.SE3.from_rotation_and_translation(
            pose.rotation(), pose.translation() + np.array(by))

    def position(self, i):
        return self.configuration.get_transform_frame_to_world(
            self.frame_names[i], "body").translation().copy()

    def target(self, goal):
        poses, com, posture = goal
        for task, pose in zip(self.frames, poses):
            task.set_target(pose)
        if self.com:
            self.com.set_target(com)
        self.posture.set_target(posture)

    def solve(self):
        return mink.solve_ik(
            self.configuration, self.tasks, problems.DT, solver="daqp", limits=self.limits)

    def build(self):
        self.problem = mink.build_ik(
            self.configuration, self.tasks, problems.DT, limits=self.limits)

    def solve_built(self):
        qpsolvers.solve_problem(self.problem, solver="daqp")

    def joints(self, answer, state):
        return answer[self.v]


problems.main(
    "mink", Peer,
    f"{version('mink')}, mujoco {version('mujoco')}, qpsolvers {version('qpsolvers')}, "
    f"daqp {version('daqp')}, numpy {version('numpy')}",
    "weighted least squares under hard limits (QP). Frames and centre of mass cost 1, the posture "
    "1e-3; `lm_damping=1` on frames.")
