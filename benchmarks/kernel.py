"""Nanoseconds a pose of the compliance kernel, beside a Python loop over PyPI `pin` doing the same.

    python benchmarks/kernel.py [N]

Both compute the deviation of the TCP of an IRB 6660 under a force: pose, joint torques, deflection, pose again. The two are
compared for equality first. Figures are medians of alternating runs on this machine: trust the ratio.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.model.compliance import equilibrium
from identification.model.inverse import inverse
from identification.model.kinematics import forward, jacobian
from identification.model.rotations import Frame
from tests.support import random_poses, robot

TOOL = Frame.from_quaternion([0.12, 0, 0.25], [1, 0, 0, 0])
PIN_POSES = 5000


def pin_model() -> tuple[Any, Any, int]:
    """The serial arm in pinocchio, from the same Denavit-Hartenberg numbers."""
    arm, model, parent, before = robot(), pin.Model(), 0, pin.SE3.Identity()
    for i in range(6):
        c, s = np.cos(arm.alpha[i]), np.sin(arm.alpha[i])
        link = pin.SE3(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([arm.a[i], 0, 0]))
        parent = model.addJoint(parent, pin.JointModelRZ(), before * link, f"joint{i + 1}")
        before = pin.SE3(np.eye(3), np.array([0, 0, arm.d[i]]))
    tcp = before * pin.SE3(TOOL.rotation, TOOL.position)
    frame = model.addFrame(pin.Frame("tcp", parent, 0, tcp, pin.FrameType.OP_FRAME))
    return model, model.createData(), frame


def pin_deviation(theta: np.ndarray, wrench: np.ndarray, compliance: np.ndarray) -> np.ndarray:
    """One-step deviation (N, 3) [m], pose by pose."""
    model, data, frame = pin_model()
    arm = robot()
    serial, coupling = arm.serial_angles(theta), arm.coupling
    result = np.empty((len(theta), 3))
    for row in range(len(theta)):
        q = serial[row]
        columns = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        pin.framesForwardKinematics(model, data, q)
        before = data.oMf[frame].translation.copy()
        yielded = coupling @ (compliance * (coupling.T @ (columns.T @ wrench[row])))
        pin.framesForwardKinematics(model, data, q + yielded)
        result[row] = data.oMf[frame].translation - before
    return result


def median_seconds(jobs: dict[str, tuple[Callable[[], Any], int]], rounds: int = 7) -> dict[str, float]:
    """Seconds a pose of each job, the jobs taking turns."""
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, (job, count) in jobs.items():
            start = time.perf_counter()
            job()
            times[name].append((time.perf_counter() - start) / count)
    return {name: float(np.median(values)) for name, values in times.items()}


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200_000
    rng = np.random.default_rng(1)
    arm = robot()
    theta = random_poses(arm, count, rng)
    wrench = np.concatenate([rng.uniform(-300, 300, (count, 3)), np.zeros((count, 3))], axis=1)
    moments = wrench.copy()
    moments[:, 3:] = rng.uniform(-30, 30, (count, 3))
    compliance = 1 / arm.prior.stiffness
    few = slice(0, PIN_POSES)
    ours = equilibrium(arm, theta[few], TOOL, wrench[few], compliance, rounds=1).position
    difference = np.max(np.abs(ours - pin_deviation(theta[few], wrench[few], compliance)))
    print(f"largest difference to pin over {PIN_POSES} poses: {difference:.1e} m")
    flange = forward(arm, theta, Frame.identity())
    times = median_seconds({
        "pin, Python loop, one step": (lambda: pin_deviation(theta[few], wrench[few], compliance), PIN_POSES),
        "deviation, one step": (lambda: equilibrium(arm, theta, TOOL, wrench, compliance, rounds=1), count),
        "deviation, at equilibrium": (lambda: equilibrium(arm, theta, TOOL, wrench, compliance), count),
        "deviation, at equilibrium, with moment": (lambda: equilibrium(arm, theta, TOOL, moments, compliance), count),
        "pose (position and rotation)": (lambda: forward(arm, theta, TOOL), count),
        "Jacobian": (lambda: jacobian(arm, theta, TOOL), count),
        "inverse, one of eight branches": (lambda: inverse(arm, flange), 8 * count),
    })
    reference = times["pin, Python loop, one step"]
    print(f"{count} poses\n{'work':<42}{'ns a pose':>10}{'times faster than pin':>24}")
    for name, seconds in times.items():
        print(f"{name:<42}{1e9 * seconds:>10.0f}{reference / seconds:>24.1f}")
    for size in (count // 20, count):
        part = slice(0, size)
        seconds = median_seconds({"": (lambda part=part: equilibrium(arm, theta[part], TOOL, wrench[part], compliance), size)})
        print(f"growth: {size:>9} poses {1e9 * seconds['']:.0f} ns a pose")


if __name__ == "__main__":
    main()
