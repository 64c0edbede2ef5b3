"""The arm of the sixth world: rigid pieces, six gears and as many soft places as a cause wants, moved by finite motions.

Lengths are those of the drawings in docs/robots.md, the chain is written from the drawing (lower arm upright, forearm level at
zero), not by Denavit and Hartenberg. All readings are solved at once: the loads act where the yielding arm has them.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

GRAVITY = 9.80665


@dataclass
class Arm:
    """Lengths [m] d1 a2 a3 a4 d4 d6, how the controller counts, six stiffnesses [N m/rad], masses [kg]."""
    name: str
    lengths: tuple[float, ...]
    maker: str
    rod: bool
    stiffness: np.ndarray
    masses: tuple[float, float, float]                 # lower arm, forearm, wrist with tool
    tool: np.ndarray = field(default_factory=lambda: np.array([0.12, 0.0, 0.25]))


# lengths [mm], maker, rod, stiffnesses of the class [1e6 N m/rad], masses, usual load [N]
ROBOTS = {
    "irb6660-205-1.90": ((814.5, 300, 700, 280, 893, 200), "abb", True, (2.0, 4.0, 2.5, .45, .22, .08), (250, 350, 180), 500),
    "irb6700-200-2.60": ((780, 320, 1125, 200, 1142.5, 200), "abb", False, (2.6, 3.9, 2.6, .6, .3, .12), (280, 300, 160), 600),
    "irb4600-60-2.05": ((495, 175, 900, 175, 960, 135), "abb", False, (.8, 1.2, .7, .14, .11, .05), (90, 110, 60), 300),
    "kr210-r2700-extra": ((675, 350, 1150, -41, 1200, 215), "kuka", False, (2.8, 3.5, 2.3, .6, .35, .15), (270, 260, 150), 600),
    "r2000ic-210f": ((0, 312, 1075, 225, 1280, 215), "fanuc", False, (2.4, 3.1, 2.2, .5, .3, .12), (280, 260, 150), 500),
    "shop-170": ((650, 260, 980, 150, 1050, 180), "abb", False, (1.7, 2.4, 1.5, .35, .2, .09), (200, 200, 110), 400),
}


def controller_angles(arm: Arm, serial: np.ndarray) -> np.ndarray:
    """What the pendant shows [deg], (N, 6), for the angles between neighbouring pieces [deg]."""
    s1, s2, s3, s4, s5, s6 = serial.T
    if arm.maker == "kuka":
        q = [-s1, s2 - 90, s3 + 90, -s4, s5, -s6]
    elif arm.maker == "fanuc":
        q = [s1, s2, -(s3 + s2), -s4, -s5, -s6 - 180]
    else:
        q = [s1, s2, s3 + s2 if arm.rod else s3, s4, s5, s6]
    table = np.array(q).T
    table[:, 5] = (table[:, 5] + 180) % 360 - 180
    return table


def serial_angles(arm: Arm, q: np.ndarray) -> np.ndarray:
    """The inverse of controller_angles, [rad]."""
    q1, q2, q3, q4, q5, q6 = q.T
    if arm.maker == "kuka":
        s = [-q1, q2 + 90, q3 - 90, -q4, q5, -q6]
    elif arm.maker == "fanuc":
        s = [q1, q2, -q3 - q2, -q4, -q5, -q6 - 180]
    else:
        s = [q1, q2, q3 - q2 if arm.rod else q3, q4, q5, q6]
    return np.radians(np.array(s).T)


def turn(vector: np.ndarray) -> np.ndarray:
    """Rotation matrices (N, 3, 3) of rotation vectors (N, 3)."""
    angle = np.linalg.norm(vector, axis=1)
    axis = vector / np.where(angle > 1e-300, angle, 1)[:, None]
    x, y, z = axis.T
    o = np.zeros_like(x)
    skew = np.array([[o, -z, y], [z, o, -x], [-y, x, o]]).transpose(2, 0, 1)
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * skew + (1 - c) * skew @ skew


Law = Callable[[np.ndarray], np.ndarray]               # torque (N,) -> twist of a gear [rad]
Bend = Callable[[np.ndarray], np.ndarray]              # wrench (N, 6), own frame -> shift [m], turn [rad]
Load = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]   # TCP (N, 3), frame (N, 3, 3) -> point, force (N, 3)


@dataclass
class State:
    """Where everything stands: TCP (N, 3) and frame (N, 3, 3) of the tool."""
    tcp: np.ndarray
    frame: np.ndarray


def _chain(arm: Arm, s: np.ndarray, twist: np.ndarray, soft: dict) -> tuple[dict, list, np.ndarray, np.ndarray]:
    n = len(s)
    d1, a2, a3, a4, d4, d6 = arm.lengths
    rot, at = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
    places: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    axes = []
    angle = s + twist
    if arm.rod:
        angle = angle.copy()
        angle[:, 2] -= twist[:, 1]
    steps: list = ["base", 0, "axis1", (a2, 0, d1), 1, "axis2", (0, 0, a3), "elbow", 2, "axis3", (d4, 0, a4), "wrist",
                   3, "axis4", 4, "axis5", 5, "axis6", (d6, 0, 0), "flange"]
    about = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]
    for step in steps:
        if isinstance(step, str):
            places[step] = (rot, at)
            if step in soft:
                at = at + np.einsum("nij,nj->ni", rot, soft[step][:, :3])
                rot = rot @ turn(soft[step][:, 3:])
        elif isinstance(step, int):
            axis = np.array(about[step], float)
            axes.append((rot @ axis, at))
            rot = rot @ turn(angle[:, step, None] * axis)
        else:
            at = at + rot @ np.array(step, float)
    flange = rot @ np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])
    return places, axes, flange, at


def solve(arm: Arm, q: np.ndarray, load: Load, laws: dict[int, Law] | None = None, bends: dict[str, Bend] | None = None,
          compliance: np.ndarray | None = None, rounds: int = 7) -> State:
    """Equilibrium of all readings: q (N, 6) [deg] as the pendant shows them; compliance (6,) or (N, 6)."""
    laws, bends = laws or {}, bends or {}
    c = 1 / arm.stiffness if compliance is None else compliance
    s = serial_angles(arm, q)
    n = len(s)
    twist = np.zeros((n, 6))
    soft = {place: np.zeros((n, 6)) for place in bends}
    down = np.array([0, 0, -GRAVITY])
    for _ in range(rounds):
        places, axes, flange, end = _chain(arm, s, twist, soft)
        tcp = end + flange @ arm.tool
        point, force = load(tcp, flange)
        elbow, wrist = places["elbow"][1], places["wrist"][1]
        masses = [((places["axis2"][1] + elbow) / 2, 1, arm.masses[0]), (elbow * .65 + wrist * .35, 2, arm.masses[1]),
                  (end + flange @ (arm.tool * .4), 5, arm.masses[2])]
        torque = np.empty((n, 6))
        for j, (axis, at) in enumerate(axes):
            moment = np.cross(point - at, force)
            weight = sum((np.cross(x - at, m * down) for x, carried, m in masses if carried >= j), np.zeros((n, 3)))
            moment = moment + weight * (0.3 if j == 1 else 1.0)     # a balancer takes most of the arm's weight off axis 2
            torque[:, j] = np.einsum("ni,ni->n", axis, moment)
        if arm.rod:
            torque[:, 1] -= torque[:, 2]
        for j in range(6):
            twist[:, j] = laws[j](torque[:, j]) if j in laws else (c[j] if c.ndim == 1 else c[:, j]) * torque[:, j]
        for place, bend in bends.items():
            rot, at = places[place]
            f, m = np.einsum("nji,nj->ni", rot, force), np.einsum("nji,nj->ni", rot, np.cross(point - at, force))
            soft[place] = bend(np.hstack([f, m]))
    places, _, flange, end = _chain(arm, s, twist, soft)
    return State(end + flange @ arm.tool, flange)
