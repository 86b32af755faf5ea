# SPDX-License-Identifier: BSD-3-Clause
"""tsid: inverse dynamics, so accelerations and forces under the equation of motion."""
from importlib.metadata import version

import numpy as np
import pinocchio as pin
import tsid.tsid_pywrap as tsid  # the wheel has its __init__.py one folder too deep

import problems

KP = 100.0  # 1/s², of every task, with critical damping


class Peer:
    def __init__(self, p):
        root = [pin.JointModelFreeFlyer()] if p.free else []
        self.robot = robot = tsid.RobotWrapper(p.file, [""], *root, False)
        model = robot.model()
        self.free, self.shift = p.free, 6 if p.free else 0
        ids = [model.getJointId(j) for j in p.joints]
        self.q = [model.joints[i].idx_q for i in ids]
        self.v = [model.joints[i].idx_v for i in ids]
        self.frame_ids = [model.getFrameId(f) for f in p.frames]
        self.formulation = formulation = tsid.InverseDynamicsFormulationAccForce(
            "tsid", robot, False)
        state = self.state([0, 0, 1], p.start, np.zeros(len(p.start)))
        formulation.computeProblemData(0.0, *state)

        def gains(task, n):
            task.setKp(KP * np.ones(n))
            task.setKd(2 * np.sqrt(KP) * np.ones(n))
            return task

        self.frames = []
        for name in p.frames:
            if "sole" in name:
                corners = np.array([[x, y, 0.0] for x in (-0.1, 0.1) for y in (-0.06, 0.06)]).T
                contact = gains(tsid.Contact6d(
                    name, robot, name, corners, np.array([0.0, 0, 1]), 0.6, 0.0, 1000.0), 6)
                contact.setReference(robot.framePosition(
                    formulation.data(), model.getFrameId(name)))
                formulation.addRigidContact(contact, 1e-5)
                self.frames.append(contact)
            else:
                task = gains(tsid.TaskSE3Equality(name, robot, name), 6)
                formulation.addMotionTask(task, 1.0, 1, 0.0)
                self.frames.append(task)
        self.com = None
        if p.com:
            self.com = gains(tsid.TaskComEquality("com", robot), 3)
            formulation.addMotionTask(self.com, 1.0, 1, 0.0)
        self.posture = gains(tsid.TaskJointPosture("posture", robot), robot.na)
        formulation.addMotionTask(self.posture, 1e-3, 1, 0.0)
        by_column = np.argsort(self.v)
        limits = tsid.TaskJointPosVelAccBounds("limits", robot, problems.DT, False)
        limits.setPositionBounds(np.array(p.lower)[by_column], np.array(p.upper)[by_column])
        limits.setVelocityBounds(np.array(p.speed)[by_column])
        limits.setAccelerationBounds(1000 * np.ones(robot.na))
        limits.setImposeBounds(True, True, True, False)
        formulation.addMotionTask(limits, 1.0, 0, 0.0)
        self.keep = limits
        self.solver = tsid.SolverHQuadProgFast("solver")
        self.solver.resize(formulation.nVar, formulation.nEq, formulation.nIn)

    def state(self, base, q, v):
        position, velocity = np.zeros(self.robot.nq), np.zeros(self.robot.nv)
        if self.free:
            position[:7] = [*base, 0, 0, 0, 1]
        position[self.q] = q
        velocity[self.v] = v
        return position, velocity

    def model(self, state):
        self.data = self.formulation.computeProblemData(0.0, *state)

    def sample(self, value, n=None):
        sample = tsid.TrajectorySample(12, 6) if n is None else tsid.TrajectorySample(n)
        sample.value(value)
        return sample

    def goal(self, state):
        data = self.formulation.data()
        poses = [self.robot.framePosition(data, f) for f in self.frame_ids]
        samples = [pose if isinstance(task, tsid.Contact6d) else self.sample(pose)
                   for pose, task in zip(poses, self.frames)]
        n = self.robot.na
        return samples, self.sample(self.robot.com(data), 3), self.sample(state[0][-n:], n)

    def move(self, goal, i, by):
        pose = self.robot.framePosition(self.formulation.data(), self.frame_ids[i])
        goal[0][i].value(pin.SE3(pose.rotation, pose.translation + np.array(by)))

    def position(self, i):
        return self.robot.framePosition(
            self.formulation.data(), self.frame_ids[i]).translation.copy()

    def target(self, goal):
        samples, com, posture = goal
        for task, sample in zip(self.frames, samples):
            task.setReference(sample)
        if self.com:
            self.com.setReference(com)
        self.posture.setReference(posture)

    def solve(self):
        answer = self.solver.solve(self.data)
        if answer.status != 0:
            raise RuntimeError(f"status {answer.status}")
        return self.formulation.getAccelerations(answer)

    def joints(self, answer, state):
        return (state[1] + problems.DT * answer)[self.v]


problems.main(
    "tsid", Peer, f"{version('tsid')}, pin {version('pin')}, eiquadprog {version('eiquadprog')}",
    f"another problem: accelerations and contact forces under the equation of motion, weighted, under "
    f"hard limits of position and velocity (QP). The feet of TALOS are contacts with friction cones. "
    f"*Model* includes its tasks. Gains are {KP:.0f} 1/s² with critical damping, and goals are at "
    f"rest, so its answer differs.")
