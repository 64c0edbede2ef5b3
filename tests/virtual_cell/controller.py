"""A controller and an arm under force, for the way between targets: straight lines, arcs, even turning, zones as parabolas;
external axes in proportion to the way.

The program is read by a reader of the virtual cell's own. The arm is that of `arm.py`, many poses at once: from the zero pose
of its drawing, with springs at the drives. Distances are measured across the curve that the planned program would drive.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from tests.virtual_cell.arm import Arm

NUMBER = r"[-+0-9.eE]+"
POSE = re.compile(rf"\[\[({NUMBER}),({NUMBER}),({NUMBER})\],\[({NUMBER}),({NUMBER}),({NUMBER}),({NUMBER})\]")
DECLARED = re.compile(r"robtarget\s+(\w+)\s*:=\s*(\[\[[^;]*)", re.IGNORECASE)
MOVE = re.compile(r"^\s*(Move[LJC])(?:DO)?\s+(.*)$", re.IGNORECASE)
EXTERNAL = re.compile(r"\[([^\[\]]*)\]\]$")
ZONE = re.compile(rf"zonedata\s+(\w+)\s*:=\s*\[\s*FALSE\s*,\s*({NUMBER})", re.IGNORECASE)
ZONES_MM = {"fine": 0.0, "z0": 0.3, "z1": 1.0, "z5": 5.0, "z10": 10.0}


@dataclass(frozen=True)
class Leg:
    """One way from target to target: points (2, 3) or, of an arc, (3, 3) [mm]; turn at its ends; zone [mm] at its end; external
    axes (2, 6) [mm or deg] at its ends, an unused one where it was."""

    points: np.ndarray
    turn: Rotation
    zone: float
    external: np.ndarray = field(default_factory=lambda: np.zeros((2, 6)))

    @property
    def circle(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Centre, axis and angle of the arc, by the perpendicular bisectors."""
        a, b, c = self.points
        u, v = b - a, c - a
        w = np.cross(u, v)
        centre = a + np.cross(w, u * (v @ v) - v * (u @ u)) / (2 * (w @ w))
        axis = w / np.linalg.norm(w)
        angle = np.mod(np.arctan2(axis @ np.cross(a - centre, c - centre), (a - centre) @ (c - centre)), 2 * np.pi)
        return centre, axis, float(angle)

    @property
    def length(self) -> float:
        if len(self.points) == 2:
            return float(np.linalg.norm(self.points[1] - self.points[0]))
        centre, _, angle = self.circle
        return angle * float(np.linalg.norm(self.points[0] - centre))

    def at(self, share: np.ndarray) -> np.ndarray:
        """Points (n, 3) [mm] at shares (n,) of the way."""
        if len(self.points) == 2:
            return np.asarray(self.points[0] + share[:, None] * (self.points[1] - self.points[0]))
        centre, axis, angle = self.circle
        return np.asarray(centre + Rotation.from_rotvec(angle * share[:, None] * axis).apply(self.points[0] - centre))


def legs_of(rapid: str) -> list[Leg]:
    """The moves of a program from its first target on; the first target is a place, no way."""
    named = dict(DECLARED.findall(rapid))
    zones = ZONES_MM | {name: float(radius) for name, radius in ZONE.findall(rapid)}
    legs: list[Leg] = []
    here: tuple[np.ndarray, Rotation] | None = None
    standing = np.zeros(6)
    for line in rapid.splitlines():
        move = MOVE.match(line.split("!")[0])
        if move is None:
            continue
        rest = move[2]
        targets = 2 if move[1].lower() == "movec" else 1
        poses = []
        for _ in range(targets):
            found = POSE.match(rest)
            if found is None:
                name = re.match(r"\w+", rest)
                assert name is not None, line
                value = named[name[0]].replace(" ", "")
                found = POSE.match(value)
                rest = rest[name.end():].lstrip(", ")
            else:
                value = rest[:_closing(rest)]
                rest = rest[_closing(rest):].lstrip(", ")
            assert found is not None, line
            axes = EXTERNAL.search(value)
            values = np.array([float(value) for value in found.groups()])
            poses.append((values[:3], Rotation.from_quat(np.roll(values[3:], -1))))
        before, standing = standing, standing.copy()
        if axes is not None:                # of a MoveC those of its end
            written = np.array([float(number) for number in axes[1].split(",")])
            standing[written < 1e9] = written[written < 1e9]
        zone = rest.split(",")[1].strip()
        own = re.search(r"\\Z:=([0-9.]+)", zone)
        radius = float(own[1]) if own else zones[zone.partition("\\")[0].strip()]
        if here is not None:
            points = np.array([here[0], *(point for point, _ in poses)])
            legs.append(Leg(points, Rotation.concatenate([here[1], poses[-1][1]]), radius,
                            np.array([before, standing])))
        here = poses[-1]
    return legs


def _closing(text: str) -> int:
    """Behind the bracket that closes the first one."""
    depth = np.cumsum([(letter == "[") - (letter == "]") for letter in text])
    return int(np.argmin(depth != 0)) + 1 if depth[0] else 0


@dataclass(frozen=True)
class Driven:
    """Where a program commands the tool: position (n, 3) [mm] in the work object, and turn; external axes (n, 6) [mm, deg]."""

    position: np.ndarray
    turn: Rotation
    external: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))


def drive(legs: list[Leg], step: float = 0.5, *, zones: bool = True) -> Driven:
    """The legs one behind the other, every `step` [mm] or closer; a fly-by zone takes at most half a leg on either side."""
    positions, turns, axes = [], [], []
    reach = [0.0]
    for leg, after in itertools.pairwise(legs):
        reach.append(min(leg.zone, leg.length / 2, after.length / 2) if zones else 0.0)
    reach.append(0.0)
    for number, leg in enumerate(legs):
        length = leg.length
        first, last = reach[number] / length, 1 - reach[number + 1] / length
        share = np.linspace(first, last, max(int(np.ceil(length * (last - first) / step)), 1) + 1)
        slerp = Slerp([0, 1], leg.turn)
        positions.append(leg.at(share))
        turns.append(slerp(np.clip(share, 0, 1)))
        axes.append(leg.external[0] + share[:, None] * (leg.external[1] - leg.external[0]))
        if reach[number + 1] > 0:
            after = legs[number + 1]
            size = reach[number + 1]
            u = np.linspace(0, 1, max(int(np.ceil(2 * size / step)), 4) + 1)[1:-1, None]
            entry, corner = positions[-1][-1], leg.at(np.ones(1))[0]
            leave = after.at(np.array([size / after.length]))[0]
            positions.append((1 - u) ** 2 * entry + 2 * u * (1 - u) * corner + u**2 * leave)
            turns.append(Rotation.concatenate([leg.turn[1]] * len(u)))
            further = after.external[0] + size / after.length * (after.external[1] - after.external[0])
            axes.append((1 - u) ** 2 * axes[-1][-1] + 2 * u * (1 - u) * leg.external[1] + u**2 * further)
    return Driven(np.concatenate(positions), Rotation.concatenate(turns), np.concatenate(axes))


def _about(axis: int, angle: np.ndarray) -> np.ndarray:
    c, s, zero, one = np.cos(angle), np.sin(angle), 0 * angle, 0 * angle + 1
    rows = [[one, zero, zero, zero, c, -s, zero, s, c], [c, zero, s, zero, one, zero, -s, zero, c],
            [c, -s, zero, s, c, zero, zero, zero, one]][axis]
    return np.stack(rows, axis=-1).reshape(-1, 3, 3)


def stance(arm: Arm, q: np.ndarray, tcp: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`Arm.pose` of many drive angles (n, 6) [rad]: TCP (n, 3) [m], flange's turn (n, 3, 3), and how both move with the drives
    (n, 6, 6): each turns what hangs on it about its axis; the lower arm of a parallel rod carries the forearm, and does not
    turn it."""
    column = _about(2, q[:, 0])
    lower = column @ _about(1, q[:, 1])
    forearm = column @ _about(1, q[:, 2] if arm.parallel_rod else q[:, 1] + q[:, 2])
    turned = forearm @ _about(0, q[:, 3])
    bent = turned @ _about(1, q[:, 4])
    hand = bent @ _about(0, q[:, 5])
    flange = hand @ np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    shoulder = column @ [arm.shoulder, 0, arm.height]
    elbow = shoulder + lower @ [0, 0, arm.lower_arm]
    wrist = elbow + forearm @ [arm.forearm, 0, arm.elbow]
    place = wrist + hand @ [arm.flange, 0, 0] + flange @ tcp
    columns = np.empty((len(q), 6, 6))
    for i, (axis, centre) in enumerate((
            (np.tile([0.0, 0, 1], (len(q), 1)), np.zeros(3)), (column[:, :, 1], shoulder), (column[:, :, 1], elbow),
            (forearm[:, :, 0], wrist), (turned[:, :, 1], wrist), (bent[:, :, 0], wrist))):
        carried = arm.parallel_rod and i == 1
        columns[:, :3, i] = np.cross(axis, (elbow if carried else place) - centre)
        columns[:, 3:, i] = 0.0 if carried else axis
    return place, flange, columns


def solve(arm: Arm, position: np.ndarray, turn: Rotation, start: np.ndarray) -> np.ndarray:
    """Drive angles (n, 6) [rad] that put the flange at positions (n, 3) [m] with that turn, by Newton's method."""
    q, aim = np.tile(start, (len(position), 1)), turn.as_matrix()
    for _ in range(15):
        p, r, columns = stance(arm, q, np.zeros(3))
        m = r @ np.swapaxes(aim, 1, 2)
        vee = np.stack([m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], axis=1) / 2
        miss = np.concatenate([p - position, vee], axis=1)
        if np.abs(miss).max() < 1e-12:
            return q
        q = q - np.linalg.solve(columns, miss[:, :, None])[:, :, 0]
    raise AssertionError(f"{np.abs(miss).max():g} off")


def loaded(arm: Arm, q: np.ndarray, tcp: np.ndarray, force: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """TCP (n, 3) [m] at rest under forces (n, 3) [N] at it, base frame: balance of virtual work, by repeated substitution."""
    at = q
    for _ in range(60):
        place, _, columns = stance(arm, at, tcp)
        last, at = at, q + np.einsum("nri,nr->ni", columns[:, :3], force) / stiffness
        if np.abs(at - last).max() < 1e-11:
            return place
    raise AssertionError("not at rest")


def nearest(points: np.ndarray, curve: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance (n,) of points (n, 3) from a polyline (m, 3), and the length along it (n,) at the nearest place."""
    from scipy.spatial import cKDTree

    lengths = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    kept = np.append(True, lengths > 0)
    curve, lengths = curve[kept], lengths[lengths > 0]
    s = np.append(0.0, np.cumsum(lengths))
    _, index = cKDTree(curve).query(points)
    best, place = np.full(len(points), np.inf), np.zeros(len(points))
    for shift in (-1, 0):
        segment = np.clip(index + shift, 0, len(lengths) - 1)
        along = (curve[segment + 1] - curve[segment]) / lengths[segment, None]
        offset = points - curve[segment]
        share = np.clip(np.einsum("ni,ni->n", offset, along), 0, lengths[segment])
        distance = np.linalg.norm(offset - share[:, None] * along, axis=1)
        closer = distance < best
        best[closer], place[closer] = distance[closer], (s[segment] + share)[closer]
    return best, place
