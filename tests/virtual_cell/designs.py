"""Measurement plans: which poses, which loads, in which order and at what time.

Every plan draws its poses from the case's random generator: reachable, in the inner 90 % of the joint limits, away from the
wrist's singularity, and spread over all joints by farthest-point choice among random candidates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from tests.virtual_cell.arm_model import Tool
from tests.virtual_cell.inverse import comfortable, inverse

LADDER_N = (0.0, 100.0, 200.0, 300.0, 0.0, -150.0, -300.0)
LOAD_N = 300.0
# Angles over which joints 1 ... 6 count as one unit of difference between poses [rad].
SPREAD = np.radians([60, 40, 40, 120, 80, 120])
POSE_PAUSE_S, ROW_PAUSE_S = 120.0, 3.0


@dataclass(frozen=True)
class Design:
    """Rows in the order they are taken.

    theta (N, 6) [rad]; load (N, 3) [N] in the base frame, as planned; time (N,) [s] of the reading since the reference;
    dwell (N,) [s] the load has been on; pose (N,) number of the pose, from 1; validate (N,) rows that are only predicted.
    """

    theta: np.ndarray
    load: np.ndarray
    time: np.ndarray
    dwell: np.ndarray
    pose: np.ndarray
    validate: np.ndarray


def _candidates(rng: np.random.Generator, tcp: np.ndarray, tool: Tool, orientation_window: bool) -> np.ndarray:
    """Feasible angles (n, 6) [rad] of random tool orientations at the points tcp (N, 3) [m]."""
    rotation = Rotation.random(len(tcp), rng=rng).as_matrix()
    theta = inverse(tcp, rotation, tool)
    fine = comfortable(theta)
    if orientation_window:      # the paper's |phi| <= 80 deg, in the x-y plane, from the TCP's to the effector's direction
        effector = (rotation @ np.array(tool.tcp))[:, :2]
        angle = np.arctan2(tcp[:, 0] * effector[:, 1] - tcp[:, 1] * effector[:, 0], (tcp[:, :2] * effector).sum(axis=1))
        fine &= (np.abs(angle) <= np.radians(80))[:, None]
    return theta[fine]


def _spread(candidates: np.ndarray, count: int, chosen: np.ndarray) -> np.ndarray:
    """count of the candidates (n, 6), each the farthest from those before it and from the chosen ones."""
    picked = list(chosen)
    for _ in range(count):
        if picked:
            apart = (candidates[:, None] - np.array(picked)[None] + np.pi) % (2 * np.pi) - np.pi    # the same pose: a full turn
            distance = np.linalg.norm(apart / SPREAD, axis=2).min(axis=1)
            picked.append(candidates[int(np.argmax(distance))])
        else:
            picked.append(candidates[0])
    return np.array(picked[len(chosen):])


def _point(rng: np.random.Generator, radius: tuple[float, float], azimuth_deg: tuple[float, float],
           height: tuple[float, float]) -> np.ndarray:
    r, phi, z = rng.uniform(*radius), np.radians(rng.uniform(*azimuth_deg)), rng.uniform(*height)
    return np.array([r * np.cos(phi), r * np.sin(phi), z])


def _oriented(rng: np.random.Generator, radius: tuple[float, float], azimuth_deg: tuple[float, float],
              height: tuple[float, float], count: int, tool: Tool, chosen: np.ndarray,
              orientation_window: bool = False) -> np.ndarray:
    """count poses (count, 6) [rad] that reach one TCP point of that region with different tool orientations."""
    while True:
        point = _point(rng, radius, azimuth_deg, height)
        found = _candidates(rng, np.repeat(point[None], 400, axis=0), tool, orientation_window)
        if len(found) >= 4 * count:
            return _spread(found, count, chosen)


def _anywhere(rng: np.random.Generator, count: int, tool: Tool) -> np.ndarray:
    """count spread poses (count, 6) [rad] over the workspace."""
    points = np.array([_point(rng, (1.0, 1.9), (-80, 80), (0.4, 1.9)) for _ in range(600)])
    found = _candidates(rng, points, tool, orientation_window=False)
    return _spread(found, count, np.empty((0, 6)))


def _assemble(rng: np.random.Generator, tool: Tool, theta: np.ndarray, loads: list[np.ndarray], dwell: tuple[float, ...],
              validation: int) -> Design:
    """Rows of poses (n, 6) with their loads (rows, 3) each, then `validation` new poses with three single loads each."""
    poses, plan = list(theta), list(loads)
    if validation:
        poses += list(_anywhere(rng, validation, tool))
        plan += [np.diag(LOAD_N * rng.choice([-1.0, 1.0], 3))[rng.permutation(3)] for _ in range(validation)]
    rows: list[tuple[np.ndarray, np.ndarray, float, float, int, bool]] = []
    clock = 0.0
    for number, (q, steps) in enumerate(zip(poses, plan, strict=True), 1):
        clock += POSE_PAUSE_S if number > 1 else ROW_PAUSE_S
        for force in steps:
            held = dwell[len(rows) % len(dwell)]
            clock += ROW_PAUSE_S + held
            rows.append((np.radians(np.round(np.degrees(q), 4)), force, clock, held, number, number > len(theta)))
    return Design(*(np.array(column) for column in zip(*rows, strict=True)))


def paper5(rng: np.random.Generator, tool: Tool, validation: int = 0) -> Design:
    """The paper's plan (section 5): one TCP, four tool orientations, five single loads of +-300 N, three in Y, two in X."""
    theta = _oriented(rng, (1.3, 1.7), (-20, 20), (0.7, 1.3), 4, tool, np.empty((0, 6)), orientation_window=True)
    a, b, c, d, e = LOAD_N * rng.choice([-1.0, 1.0], 5)
    loads = [np.array([[0, a, 0], [b, 0, 0]]), np.array([[0, c, 0]]), np.array([[d, 0, 0]]), np.array([[0, e, 0]])]
    return _assemble(rng, tool, theta, loads, (10.0,), validation)


def poses20(rng: np.random.Generator, tool: Tool, validation: int = 0) -> Design:
    """Twenty poses over the workspace with one load each, 300 N along x, y or z in turn, either sign."""
    theta = _anywhere(rng, 20, tool)
    loads = [np.roll([LOAD_N * sign, 0, 0], i)[None] for i, sign in enumerate(rng.choice([-1.0, 1.0], 20))]
    return _assemble(rng, tool, theta, loads, (10.0,), validation)


def ladder12(rng: np.random.Generator, tool: Tool, validation: int = 0) -> Design:
    """Twelve poses, four orientations at each of three points, each with the load cycle along x, then y, then z: 252 rows."""
    radii, heights = [(1.1, 1.35), (1.35, 1.6), (1.6, 1.85)], [(0.5, 0.9), (0.9, 1.3), (1.3, 1.7)]
    near, high = rng.permutation(3), rng.permutation(3)
    theta = np.empty((0, 6))
    for i, azimuth in enumerate([(-70, -30), (-20, 20), (30, 70)]):
        found = _oriented(rng, radii[int(near[i])], azimuth, heights[int(high[i])], 4, tool, theta)
        theta = np.concatenate([theta, found])
    steps = np.concatenate([np.outer(LADDER_N, axis) for axis in np.eye(3)])
    return _assemble(rng, tool, theta[rng.permutation(12)], [steps] * 12, (5.0, 30.0), validation)


def ladder6(rng: np.random.Generator, tool: Tool, validation: int = 0) -> Design:
    """Every other pose of ladder12, so two at each point in the mean: 126 rows, which are searched in a third of the time."""
    theta = ladder12(rng, tool).theta[::42]
    steps = np.concatenate([np.outer(LADDER_N, axis) for axis in np.eye(3)])
    return _assemble(rng, tool, theta, [steps] * 6, (5.0, 30.0), validation)


def hung12(rng: np.random.Generator, tool: Tool, validation: int = 0) -> Design:
    """Twelve poses as ladder12 has them, at each 0, 20, 40, 20 and 0 kg hung at the tool: 60 rows."""
    theta = ladder12(rng, tool).theta[::21]
    steps = np.outer([0.0, 20.0, 40.0, 20.0, 0.0], [0.0, 0.0, -9.80665])
    held = _assemble(rng, tool, theta, [steps] * 12, (20.0, 60.0), 0)
    if not validation:
        return held
    every = _assemble(rng, tool, np.concatenate([theta, _anywhere(rng, validation, tool)]), [steps] * (12 + validation),
                      (20.0, 60.0), 0)
    return replace(every, validate=every.pose > 12)


DESIGNS = {"paper5": paper5, "poses20": poses20, "ladder12": ladder12, "ladder6": ladder6, "hung12": hung12}
