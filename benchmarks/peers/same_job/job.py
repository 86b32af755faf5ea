# SPDX-License-Identifier: BSD-3-Clause
"""The scenarios for peers of Python: python <peer>.py <urdf> <scenarios.txt> <folder>."""
import os
import sys

import numpy as np

DT = 0.01  # s
STEPS = 1000
JOINTS = [f"panda_joint{i}" for i in range(1, 8)]


def main(name, version, reach):
    """`reach(urdf, q, by, cost, path)` does the job and appends each q to `path`."""
    urdf, scenarios, folder = sys.argv[1:]
    with open(os.path.join(folder, name + ".version"), "w") as out:
        print(version, file=out)
    for line in open(scenarios):
        if line.startswith("#"):
            continue
        scenario, *numbers = line.split()
        numbers = np.array([float(x) for x in numbers])
        path = []
        refusal = ""
        try:
            reach(urdf, numbers[4:], numbers[:3], float(numbers[3]), path)
        except Exception as error:  # what a peer raises is its answer
            refusal = f"{type(error).__name__}: {error}".splitlines()[0]
        with open(os.path.join(folder, f"{name}.{scenario}"), "w") as out:
            print(refusal, file=out)
            for q in path:
                print(*(repr(float(x)) for x in q), file=out)
