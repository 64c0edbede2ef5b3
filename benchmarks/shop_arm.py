"""The arm of the shop's jobs: five ABB arms by their drawings, which yield at their gears, and some a little elsewhere.

Built of plain turns and shifts along the arm as it stands at zero, not of a table of frames; angles are the controller's.
Nothing of the program is imported. Lengths are millimetres, angles radians, forces newton, torques newton metres.
"""

from dataclasses import dataclass, field

import numpy as np

# Drawings [mm]: shoulder height, shoulder forwards, lower arm, elbow up, forearm, wrist to flange; the rod of the forearm.
DRAWINGS = {
    "irb6660-205-1.90": ((814.5, 300, 700, 280, 893, 200), True),
    "irb6700-200-2.60": ((780, 320, 1125, 200, 1142.5, 200), False),
    "irb4600-60-2.05": ((495, 175, 900, 175, 960, 135), False),
    "irb6640-235-2.55": ((780, 320, 1075, 200, 1142.5, 200), False),
    "irb7600-150-3.50": ((780, 410, 1075, 165, 2012, 250), False),
}
STIFFNESS = {  # newton metres a radian, of which each arm of the shop differs by some tens of per cent
    "irb6660-205-1.90": (1.6e6, 4.2e6, 1.5e6, 3.8e5, 2.0e5, 1.0e5),
    "irb6700-200-2.60": (2.2e6, 4.6e6, 2.4e6, 5.0e5, 3.6e5, 2.0e5),
    "irb4600-60-2.05": (0.9e6, 1.5e6, 0.8e6, 1.4e5, 0.9e5, 0.6e5),
    "irb6640-235-2.55": (1.9e6, 3.9e6, 2.0e6, 4.6e5, 3.3e5, 1.7e5),
    "irb7600-150-3.50": (3.4e6, 6.8e6, 4.4e6, 8.0e5, 5.6e5, 3.0e5),
}
SIX = tuple[np.ndarray, np.ndarray]


def turn(axis: int, angle: np.ndarray | float) -> np.ndarray:
    """Rotation about x, y or z (0, 1, 2), (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    m = np.zeros((*np.shape(angle), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m[..., axis, axis] = 1
    m[..., i, i] = m[..., j, j] = c
    m[..., i, j], m[..., j, i] = -s, s
    return m


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation of quaternions w x y z, (..., 3, 3)."""
    w, x, y, z = np.moveaxis(np.asarray(q, float) / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def vector(r: np.ndarray) -> np.ndarray:
    """Rotation vector of matrices (..., 3, 3), good to angles under pi."""
    v = np.stack([r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], -1) / 2
    sine = np.linalg.norm(v, axis=-1, keepdims=True)
    angle = np.arctan2(sine, (np.trace(r, axis1=-2, axis2=-1)[..., None] - 1) / 2)
    return v * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)


def turned_by(v: np.ndarray) -> np.ndarray:
    """Rotation matrices of rotation vectors (..., 3)."""
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    share = np.where(angle > 1e-12, np.sin(angle / 2) / np.maximum(angle, 1e-12), 0.5)
    return matrix(np.concatenate([np.cos(angle / 2), v * share], -1))


def quaternion(r: np.ndarray) -> np.ndarray:
    """w x y z of one rotation matrix, w not negative."""
    values, vectors = np.linalg.eigh(np.array([
        [r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1]],
        [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1]]]))
    q = vectors[:, np.argmax(values)]
    return -q if q[0] < 0 else q


@dataclass
class Arm:
    """An arm with its tool; gears are softer by `soft` under small torques, the foot tilts by `tilt` [rad/Nm]."""

    name: str
    stiffness: np.ndarray
    tool: SIX
    soft: float = 0.0
    tilt: float = 0.0
    lengths: tuple[float, ...] = field(init=False)
    rod: bool = field(init=False)

    def __post_init__(self) -> None:
        self.lengths, self.rod = DRAWINGS[self.name]

    def chain(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """TCP (n, 3) [mm] and its rotation in the base, and the Jacobian by the controller's angles (n, 6, 6) [mm and rad]."""
        d1, a2, a3, a4, d4, d6 = self.lengths
        one = np.ones(len(q))
        r1 = turn(2, q[:, 0])
        up, out = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
        side = r1 @ np.array([0, 1.0, 0])
        shoulder = d1 * up + a2 * (r1 @ out)
        elbow = shoulder + a3 * (r1 @ turn(1, q[:, 1]) @ up)
        r3 = r1 @ turn(1, q[:, 2] if self.rod else q[:, 1] + q[:, 2])
        wrist = elbow + r3 @ np.array([d4, 0, a4])
        r4 = r3 @ turn(0, q[:, 3])
        r5 = r4 @ turn(1, q[:, 4])
        r6 = r5 @ turn(0, q[:, 5])
        flange = wrist + d6 * (r5 @ out)
        r = r6 @ turn(1, np.pi / 2)
        tcp = flange + r @ self.tool[0]
        axes = [one[:, None] * up, side, side, r3 @ out, r4 @ np.array([0, 1.0, 0]), r5 @ out]
        points = [0 * tcp, shoulder, elbow, wrist, wrist, wrist]
        jacobian = np.empty((len(q), 6, 6))
        for i, (a, p) in enumerate(zip(axes, points, strict=True)):
            jacobian[:, :3, i] = np.cross(a, tcp - p)
            jacobian[:, 3:, i] = a
        if self.rod:  # the lower arm turns under a forearm that keeps its direction
            jacobian[:, :3, 1] = np.cross(side, elbow - shoulder)
            jacobian[:, 3:, 1] = 0
        return tcp, r @ self.tool[1], jacobian

    def angles(self, place: np.ndarray, r: np.ndarray, start: np.ndarray) -> np.ndarray:
        """The angles (n, 6) that put the unloaded TCP there, on the branch of `start`; ValueError where there are none."""
        q = np.broadcast_to(start, (len(place), 6)).copy()
        for _ in range(60):
            tcp, now, jacobian = self.chain(q)
            miss = np.concatenate([place - tcp, vector(r @ np.swapaxes(now, 1, 2))], 1)
            if np.abs(miss).max() < 1e-8:
                return q
            step = np.linalg.solve(jacobian, miss[:, :, None])[:, :, 0]
            q += step * np.minimum(1, 0.5 / np.maximum(np.abs(step).max(1), 1e-12))[:, None]
        raise ValueError(f"{self.name}: out of reach by {np.abs(miss).max():.3g}")

    def loaded(self, q: np.ndarray, force: np.ndarray) -> np.ndarray:
        """TCP (n, 3) [mm] under the force (n, 3) [N] in the base; a finite motion, load and posture agree."""
        twist = np.zeros_like(q)
        for _ in range(8):
            tcp, _, jacobian = self.chain(q + twist)
            torque = np.einsum("nij,ni->nj", jacobian[:, :3], force) / 1000
            twist = torque / self.stiffness * (1 + self.soft / (1 + (torque / 150) ** 2))
        moment = np.cross(tcp, force) / 1000 * [1, 1, 0]
        return np.einsum("nij,nj->ni", turned_by(self.tilt * moment), tcp)
