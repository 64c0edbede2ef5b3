"""Nanoseconds a pose of the compliance kernel, beside a Python loop over PyPI `pin` and a loop in C doing the same.

    OMP_NUM_THREADS=1 python benchmarks/kernel.py [N]

All compute the deviation of the TCP of an IRB 6660 under a force: pose, joint torques, deflection, pose again. They are
compared for equality first. The practical limit is kernel.c, compiled here, where there is a compiler: with -O3 alone, where
each sine and arc tangent is a call, and with -march=native -ffast-math, where those run in vector registers too. Figures are
the least CPU time of runs in turn on this machine: trust the ratio.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.model.compliance import equilibrium
from identification.model.inverse import inverse, one_branch
from identification.model.kinematics import forward, jacobian, quarter_turns
from identification.model.rotations import Frame
from tests.support import random_poses, robot

TOOL = Frame.from_quaternion([0.12, 0, 0.25], [1, 0, 0, 0])
PIN_POSES = 5000
LANES = 64              # kernel.c: poses come in multiples of it
PLAIN, VECTOR = ("-O3",), ("-O3", "-march=native", "-ffast-math")
# So many evaluations of the torque bring 200 000 poses under 300 N to 1e-12 rad.
ROUNDS = 4
Jobs = dict[str, tuple[Callable[[], Any], int]]


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


class Limit:
    """kernel.c, compiled with some flags, on columns."""

    def __init__(self, folder: Path, flags: tuple[str, ...], theta: np.ndarray, force: np.ndarray, flange: Frame) -> None:
        library = folder / f"{len(flags)}.so"
        subprocess.run(["cc", *flags, "-shared", "-fPIC", "-o", library, Path(__file__).with_suffix(".c"), "-lm"], check=True)
        self.library, self.flags, arm = ctypes.CDLL(str(library)), " ".join(flags), robot()
        soft = arm.load_matrix @ (1 / arm.prior.stiffness[:, None] * arm.load_matrix.T)
        twists = np.array([quarter_turns(alpha) for alpha in arm.alpha]).T
        count = len(theta)
        self.arm = np.concatenate([*twists, arm.a, arm.d, TOOL.position, soft.ravel()])
        self.theta, self.force, self.rotation, self.position = (np.ascontiguousarray(values.T) for values in (
            arm.serial_angles(theta), force, flange.rotation.reshape(count, 9), flange.position))
        self.off, self.angles = np.empty((3, count)), np.empty((6, count))

    def deviation(self, rounds: int) -> np.ndarray:
        self._call("deviation", ctypes.c_int(rounds), self.arm, self.theta, self.force, self.off)
        return self.off.T

    def branch(self) -> np.ndarray:
        self._call("branch", self.arm, self.rotation, self.position, self.angles)
        return self.angles.T

    def _call(self, name: str, *given: Any) -> None:
        values = [one.ctypes.data_as(ctypes.c_void_p) if isinstance(one, np.ndarray) else one for one in given]
        getattr(self.library, name)(ctypes.c_long(self.theta.shape[1]), *values)

    def jobs(self) -> Jobs:
        count = self.theta.shape[1]
        return {f"C {self.flags}: deviation, one step": (lambda: self.deviation(1), count),
                f"C {self.flags}: deviation, at equilibrium": (lambda: self.deviation(ROUNDS), count),
                f"C {self.flags}: inverse, one branch": (self.branch, count)}


def least_seconds(jobs: Jobs, rounds: int = 7) -> dict[str, float]:
    """Seconds of CPU a pose of each job, the least of its runs, the jobs taking turns."""
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, (job, count) in jobs.items():
            start = time.process_time()
            job()
            times[name].append((time.process_time() - start) / count)
    return {name: min(values) for name, values in times.items()}


def compiled(theta: np.ndarray, force: np.ndarray, flange: Frame) -> list[Limit]:
    """The limits, one for each set of flags; none where there is no C compiler."""
    if shutil.which("cc") is None:
        print("no C compiler (cc): the limit is not measured")
        return []
    with tempfile.TemporaryDirectory() as folder:
        return [Limit(Path(folder), flags, theta, force, flange) for flags in (PLAIN, VECTOR)]


def main() -> None:
    count = LANES * -(-(int(sys.argv[1]) if len(sys.argv) > 1 else 200_000) // LANES)
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
    limits = compiled(theta, wrench[:, :3], flange)
    for limit in limits:
        off = limit.deviation(ROUNDS) - equilibrium(arm, theta, TOOL, wrench, compliance).position
        angles, reachable = one_branch(arm, flange, 0)
        apart = (limit.branch() - arm.serial_angles(angles))[reachable]
        apart -= 2 * np.pi * np.round(apart / (2 * np.pi))
        print(f"largest difference to C {limit.flags}: {np.max(np.abs(off)):.1e} m, {np.max(np.abs(apart)):.1e} rad")
    times = least_seconds({
        "pin, Python loop, one step": (lambda: pin_deviation(theta[few], wrench[few], compliance), PIN_POSES),
        "deviation, one step": (lambda: equilibrium(arm, theta, TOOL, wrench, compliance, rounds=1), count),
        "deviation, at equilibrium": (lambda: equilibrium(arm, theta, TOOL, wrench, compliance), count),
        "deviation, at equilibrium, with moment": (lambda: equilibrium(arm, theta, TOOL, moments, compliance), count),
        "pose (position and rotation)": (lambda: forward(arm, theta, TOOL), count),
        "Jacobian": (lambda: jacobian(arm, theta, TOOL), count),
        "inverse, one branch": (lambda: one_branch(arm, flange, 0), count),
        "inverse, one of eight branches": (lambda: inverse(arm, flange), 8 * count),
    } | {name: job for limit in limits for name, job in limit.jobs().items()})
    reference = times["pin, Python loop, one step"]
    print(f"{count} poses\n{'work':<60}{'ns a pose':>10}{'times faster than pin':>24}{'times the limit':>17}")
    for name, seconds in times.items():
        limit = times.get(f"C {' '.join(VECTOR)}: {name}")
        print(f"{name:<60}{1e9 * seconds:>10.0f}{reference / seconds:>24.1f}"
              + (f"{seconds / limit:>17.1f}" if limit else ""))
    for size in (count // 20, count):
        part = slice(0, size)
        seconds = least_seconds({"": (lambda part=part: equilibrium(arm, theta[part], TOOL, wrench[part], compliance), size)})
        print(f"growth: {size:>9} poses {1e9 * seconds['']:.0f} ns a pose")


if __name__ == "__main__":
    main()
