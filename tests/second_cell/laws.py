"""Laws over one elastic coordinate: energies, and friction that is carried along the path."""

from __future__ import annotations

import numpy as np

from tests.second_cell.arm import Law, Rows


class SmoothZone(Law):
    """A gear softer near zero: together with its spring `k (x - a tanh(x / d))`, a < d: past d it runs `a` behind."""

    def __init__(self, at: int, stiffness: float, extra: float, width: float) -> None:
        super().__init__(at)
        self.k, self.a, self.d = stiffness, extra, width

    def pull(self, x: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
        bend = np.tanh(x / self.d)
        return -self.k * self.a * bend, -self.k * self.a / self.d * (1 - bend**2)


class Cubic(Law):
    """A spring that stiffens: `k x (x / d)^2` beside its linear part."""

    def __init__(self, at: int, stiffness: float, width: float) -> None:
        super().__init__(at)
        self.k, self.d = stiffness, width

    def pull(self, x: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
        return self.k * x * (x / self.d) ** 2, 3 * self.k * (x / self.d) ** 2


class Play(Law):
    """Teeth that touch at both ends of a gap: a stiff wall, soft at the touch, and grease that holds a little in between.
    start (visits,): where in its gap the gear stands when a visit begins, as a share of half of it."""

    def __init__(self, at: int, half_gap: float, wall: float, start: np.ndarray) -> None:
        super().__init__(at)
        self.b, self.wall, self.start, self.touch = half_gap, wall, start, half_gap / 20

    def pull(self, x: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
        x = x + self.b * self.start[rows.visit]
        over, under = (x - self.b) / self.touch, (-x - self.b) / self.touch
        grease = 1.0 / self.b       # 1 N m at the end of the gap
        force = self.wall * self.touch * (np.logaddexp(0, over) - np.logaddexp(0, under))
        return force + grease * x, self.wall * (expit(over) + expit(under)) + grease


def expit(x: np.ndarray) -> np.ndarray:
    """The logistic function."""
    return np.asarray(0.5 * (1 + np.tanh(0.5 * x)))


class BoucWen(Law):
    """Friction `T z`, `dz/dx = (1 - z^2 [z dx > 0]) / d` (Bouc-Wen, n = 2, beta = gamma = 1/2), integrated exactly along a path
    that does not turn between two settled places. d small against T / k: it sticks first, then breaks away."""

    memory = True

    def __init__(self, at: int, torque: float, width: float, poses: tuple[int, float, float] | None = None) -> None:
        super().__init__(at)
        self.torque, self.width, self.poses = torque, width, poses
        self.z: np.ndarray | None = None
        self.x = np.zeros(0)

    def _share(self, rows: Rows) -> np.ndarray:
        """1 where it rubs; poses: (axis, low, high) [rad], between which alone it does."""
        if self.poses is None:
            return np.ones(len(rows.visit))
        axis, low, high = self.poses
        return ((rows.q[:, axis] > low) & (rows.q[:, axis] < high)).astype(float)

    def state(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """z and dz/dx at x, coming from where it settled."""
        assert self.z is not None
        way, run = np.where(x < self.x, -1.0, 1.0), np.abs(x - self.x) / self.width
        w = way * self.z
        back = np.clip(-w, 0, None)     # how far it runs back elastically before it is pushed the other way
        risen = np.tanh(np.arctanh(np.clip(w, 0, 1 - 1e-12)) + np.maximum(run - back, 0))
        z = np.where(run < back, w + run, risen)
        return way * z, (1 - np.where(run < back, 0.0, z**2)) / self.width

    def pull(self, x: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
        if self.z is None:
            return np.zeros(len(x)), np.zeros(len(x))
        z, slope = self.state(x)
        torque = self.torque * self._share(rows)
        return torque * z, torque * slope

    def reset(self) -> None:
        self.z = None

    def begin(self, x: np.ndarray, rows: Rows) -> None:
        self.z, self.x = np.zeros(len(x)), x.copy()

    def settle(self, x: np.ndarray, rows: Rows) -> None:
        self.z, self.x = self.state(x)[0], x.copy()


class KelvinVoigt(Law):
    """Creep of a gear: springs with dampers in series with it, compliances `shares / k`, times [s]; what crept under earlier
    loads of the visit is still there. The arm's weight has crept long before."""

    memory = True

    def __init__(self, at: int, stiffness: float, shares: np.ndarray, times: np.ndarray) -> None:
        super().__init__(at)
        self.k, self.shares, self.times = stiffness, shares, times
        self.crept: np.ndarray | None = None
        self.rest = np.zeros(0)

    def _after(self, rows: Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What is left of each part (n, parts), what it takes of the present torque, and their sums over the parts."""
        assert self.crept is not None
        decay = np.exp(-rows.dwell[:, None] / self.times)
        return self.crept * decay, (1 - decay) * self.shares, np.sum((1 - decay) * self.shares, axis=1)

    def pull(self, x: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
        if self.crept is None:
            return np.zeros(len(x)), np.zeros(len(x))
        left, _, soft = self._after(rows)
        torque = self.k * (x - left.sum(axis=1) + soft * self.rest) / (1 + soft)
        return torque - self.k * x, self.k / (1 + soft) - self.k

    def reset(self) -> None:
        self.crept = None

    def begin(self, x: np.ndarray, rows: Rows) -> None:
        self.crept, self.rest = np.zeros((len(x), len(self.times))), x.copy()

    def settle(self, x: np.ndarray, rows: Rows) -> None:
        left, gain, _ = self._after(rows)
        twist = self.pull(x, rows)[0] / self.k + x - self.rest
        self.crept = left + gain * twist[:, None]


class Softening(Law):
    """A gear that softens as the cell warms up: compliance times `1 + rise (1 - exp(-t / T))`."""

    def __init__(self, at: int, stiffness: float, rise: float, time: float) -> None:
        super().__init__(at)
        self.k, self.rise, self.time = stiffness, rise, time

    def pull(self, x: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
        less = self.k / (1 + self.rise * -np.expm1(-rows.time / self.time)) - self.k
        return less * x, less


class Strut(Law):
    """A locked strut beside drive 2, from a point at radius `foot` to one at radius `head` about the axis: it is relaxed in the
    unloaded pose, and its lever goes with the angle between both, `q2 + offset`."""

    def __init__(self, at: int, stiffness: float, foot: float, head: float, offset: float) -> None:
        super().__init__(at)
        self.k, self.foot, self.head, self.offset = stiffness, foot, head, offset

    def _length(self, angle: np.ndarray) -> np.ndarray:
        return np.asarray(np.sqrt(self.foot**2 + self.head**2 - 2 * self.foot * self.head * np.cos(angle)))

    def pull(self, x: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
        angle = rows.q[:, 1] + self.offset
        length, relaxed = self._length(angle + x), self._length(angle)
        lever = self.foot * self.head * np.sin(angle + x) / length
        turning = self.foot * self.head * np.cos(angle + x) / length - lever**2 / length
        return self.k * (length - relaxed) * lever, self.k * (lever**2 + (length - relaxed) * turning)
