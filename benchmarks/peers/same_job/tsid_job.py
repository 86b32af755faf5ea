# SPDX-License-Identifier: BSD-3-Clause
"""The job with tsid."""
from importlib.metadata import version

import numpy as np
import pinocchio as pin
import tsid.tsid_pywrap as tsid  # the wheel has its __init__.py one folder too deep
from job import DT, STEPS, main


def reach(urdf, q, by, cost, path):
    #! [job]
    robot = tsid.RobotWrapper(urdf, [""], False)
    model, n, v = robot.model(), robot.na, np.zeros(robot.nv)
    problem = tsid.InverseDynamicsFormulationAccForce("reach", robot, False)
    problem.computeProblemData(0.0, q, v)
    hand = tsid.TaskSE3Equality("hand", robot, "panda_hand")
    posture = tsid.TaskJointPosture("posture", robot)
    for task, rows in (hand, 6), (posture, n):
        task.setKp(4 * np.ones(rows))  # 1/s²: critically damped with Kd
        task.setKd(4 * np.ones(rows))  # 1/s
    goal = robot.framePosition(problem.data(), model.getFrameId("panda_hand"))
    to_hand, to_posture = tsid.TrajectorySample(12, 6), tsid.TrajectorySample(n)
    to_hand.value(pin.SE3(goal.rotation, goal.translation + by))
    to_posture.value(q)
    hand.setReference(to_hand)
    posture.setReference(to_posture)
    limits = tsid.TaskJointPosVelAccBounds("limits", robot, DT, False)
    limits.setPositionBounds(model.lowerPositionLimit, model.upperPositionLimit)
    limits.setVelocityBounds(model.velocityLimit)
    limits.setAccelerationBounds(100 * np.ones(n))
    limits.setImposeBounds(True, True, True, True)  # position, velocity, viability, acceleration
    problem.addMotionTask(limits, 1.0, 0, 0.0)  # level 0: constraints
    problem.addMotionTask(hand, 1.0, 1, 0.0)  # level 1: the cost, by weights
    problem.addMotionTask(posture, cost**2, 1, 0.0)  # weighs the square
    solver = tsid.SolverHQuadProgFast("solver")
    solver.resize(problem.nVar, problem.nEq, problem.nIn)
    for k in range(STEPS):
        answer = solver.solve(problem.computeProblemData(k * DT, q, v))
        if answer.status != 0:
            raise RuntimeError(f"status {answer.status}")
        a = problem.getAccelerations(answer)
        q, v = pin.integrate(model, q, DT * v + DT * DT / 2 * a), v + DT * a
        path.append(q)
    #! [job]


main("tsid", f"{version('tsid')}, pin {version('pin')}, eiquadprog {version('eiquadprog')}", reach)
