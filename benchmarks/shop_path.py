"""The true world of a shop's job: the arm in its frames, the path as it is driven, the force that belongs to each place.

Places are millimetres in the work object, `s` lengths along the planned path; nothing of the program is imported.
"""

import numpy as np
from shop_arm import Arm, matrix
from shop_posts import between, pose


class World:
    """The truth of a job: arm, frames, force by place; made from truth.json."""

    def __init__(self, truth: dict) -> None:
        self.t = truth
        tool = (np.array(truth["tool"]["place"]), matrix(np.array(truth["tool"]["quat"])))
        self.arm = Arm(truth["robot"], np.array(truth["stiffness"]), tool, truth["soft"], truth["tilt"])
        def frame(f: dict) -> tuple[np.ndarray, np.ndarray]:
            return np.array(f["place"], float), matrix(np.array(f["quat"], float))
        (ub, ur), (ob, orr), (bb, br) = frame(truth["uframe"]), frame(truth["oframe"]), frame(truth["base"])
        self.turn = br.T @ ur @ orr                     # work object in the base
        self.shift = br.T @ (ub + ur @ ob - bb)
        self.down = br.T @ np.array([0, 0, -1.0])
        self.start = np.deg2rad(truth["start_deg"])

    def angles(self, place: np.ndarray, r: np.ndarray) -> np.ndarray:
        return self.arm.angles(place @ self.turn.T + self.shift, self.turn @ r, self.start)

    def tcp(self, q: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Loaded TCP in the work object (n, 3) under forces (n, 3) in the work object."""
        return (self.arm.loaded(q, force @ self.turn.T) - self.shift) @ self.turn

    def under_cut(self, q: np.ndarray, near: "Along") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Loaded TCP, force and place along the plan of commands that stand near `near.s`; force and depth agree."""
        s = near.s.copy()
        force = np.zeros((len(q), 3))
        for _ in range(5):
            tcp = self.tcp(q, force)
            s, foot = near.closest(tcp)
            plan_force, stock = near.plan.at(s)
            deeper = np.einsum("ni,ni->n", tcp - foot, stock)
            force = plan_force * np.clip(1 + self.t["follows"] * deeper / self.t["depth_mm"], 0, 2)[:, None]
        return self.tcp(q, force), force, s


class Path:
    """Dense points of a driven program: place (n, 3), rotation, move of each, length `s`, feed."""

    def __init__(self, driven: list[dict], step: float = 0.5) -> None:
        place, rot, move, feed = [], [], [], []
        at, r_at = pose(driven[0]["to"])
        ends: list[tuple[int, int]] = []
        for i, m in enumerate(driven[1:], 1):
            to, r_to = pose(m["to"])
            via = pose(m["via"])[0] if m["via"] is not None else None
            length = np.linalg.norm(to - at) if via is None else np.linalg.norm(via - at) + np.linalg.norm(to - via)
            n = max(2, int(np.ceil(length / (step if length < 400 else 5))))
            share = np.arange(n) / n
            begin = sum(len(p) for p in place)
            place.append(at + share[:, None] * (to - at) if via is None else arc(at, via, to, share))
            rot.append(between(r_at, r_to, share))
            move.append(np.full(n, i))
            feed.append(np.full(n, m["feed"]))
            ends.append((begin, begin + n))
            at, r_at = to, r_to
        self.place, self.rot = np.vstack([*place, at[None]]), np.concatenate([*rot, r_at[None]])
        self.move, self.feed = np.concatenate([*move, [len(driven) - 1]]), np.concatenate([*feed, feed[-1][:1]])
        sharp = self.place.copy()
        raw = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(sharp, axis=0), axis=1))])
        for (a, b), (_, d), m, then in zip(ends, ends[1:], driven[1:], driven[2:], strict=False):
            radius = min(m["zone"], (raw[b] - raw[a]) / 2, (raw[d] - raw[b]) / 2)
            if radius <= 0 or "J" in (m["kind"], then["kind"]):
                continue
            near = np.flatnonzero(np.abs(raw - raw[b]) < radius)
            u = ((raw[near] - raw[b]) / radius + 1)[:, None] / 2
            one, two = (np.array([np.interp(raw[b] + e, raw, sharp[:, k]) for k in range(3)]) for e in (-radius, radius))
            self.place[near] = (1 - u) ** 2 * one + 2 * u * (1 - u) * sharp[b] + u ** 2 * two
        self.ends = [0, *(b for _, b in ends)]
        self.raw, self.sharp = raw, sharp
        self.s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(self.place, axis=0), axis=1))])
        self.time = np.concatenate([[0], np.cumsum(np.diff(self.s) / self.feed[:-1])])


class Plan:
    """The planned path with the force on the tool at each place and the direction to the stock, in the work object."""

    def __init__(self, path: Path, driven: list[dict], truth: dict) -> None:
        self.path = path
        n = len(path.s)
        along = np.gradient(path.place, axis=0)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        axis = path.rot[:, :, 2]                                       # out of the tool's tip
        side = np.cross(along, -axis)                                  # to the right as seen from the spindle
        self.stock = side * truth["side"]
        self.force, size = np.zeros((n, 3)), np.zeros(n)
        push = np.array(truth["push"])                                 # along the feed, to the right, out of the tip
        cut = np.array(truth["cut"])[path.move] & (np.arange(n) < path.ends[-1])
        run = np.flatnonzero(np.diff(np.concatenate([[0], cut.astype(int), [0]])))
        for a, b in zip(run[::2], run[1::2], strict=True):
            far = np.minimum(path.s[a:b] - path.s[a], path.s[b - 1] - path.s[a:b])
            size[a:b] = np.clip(far / truth["ramp_mm"], 0, 1)
        wave = 1 + truth["wave"] * np.sin(path.s / truth["wave_mm"]) * (1 + 0.5 * np.sin(path.s / 170 + 1))
        size *= truth["newton"] * wave
        self.cut = cut
        self.force = size[:, None] * (push[0] * along + push[1] * side + push[2] * axis)

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        def mean(v: np.ndarray) -> np.ndarray:
            return np.stack([np.interp(s, self.path.s, v[:, k]) for k in range(3)], 1)
        return mean(self.force), mean(self.stock)


class Along:
    """Points whose places along the plan lie within a window about `s` [mm]; `closest` finds them on the plan's chords."""

    def __init__(self, plan: Plan, s: np.ndarray, window: float = 3.0) -> None:
        self.plan, self.s, self.window = plan, s, window

    def closest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        p, s = self.plan.path.place, self.plan.path.s
        out, foot = np.empty(len(points)), np.empty((len(points), 3))
        for i, x in enumerate(points):
            a, b = np.searchsorted(s, self.s[i] - self.window), np.searchsorted(s, self.s[i] + self.window)
            a, b = max(a - 1, 0), min(b + 1, len(s) - 1)
            chord = p[a + 1:b + 1] - p[a:b]
            square = np.maximum((chord ** 2).sum(1), 1e-18)
            share = np.clip(((x - p[a:b]) * chord).sum(1) / square, 0, 1)
            feet = p[a:b] + share[:, None] * chord
            k = np.argmin(((x - feet) ** 2).sum(1))
            out[i], foot[i] = s[a + k] + share[k] * np.sqrt(square[k]), feet[k]
        return out, foot


def arc(a: np.ndarray, via: np.ndarray, b: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Points of the circle through three points, from a over via to b."""
    x = (via - a) / np.linalg.norm(via - a)
    z = np.cross(x, b - a)
    z /= np.linalg.norm(z)
    y = np.cross(z, x)
    u, v = np.linalg.norm(via - a), np.array([(b - a) @ x, (b - a) @ y])
    centre = np.array([u / 2, (v @ v - u * v[0]) / (2 * v[1])])
    first = np.arctan2(-centre[1], -centre[0])
    last = np.arctan2(v[1] - centre[1], v[0] - centre[0])
    mid = np.arctan2(-centre[1], u - centre[0])
    total, half = (last - first) % (2 * np.pi), (mid - first) % (2 * np.pi)
    if half > total:
        total -= 2 * np.pi
    angle = first + share * total
    radius = np.hypot(*centre)
    return a + np.outer(centre[0] + radius * np.cos(angle), x) + np.outer(centre[1] + radius * np.sin(angle), y)


def target_numbers(driven: list[dict], path: Path, s: np.ndarray, form: str) -> np.ndarray:
    """The number in the text of the target that is nearest, or ahead, at each length along the path."""
    marks, names = [], []
    for i, m in enumerate(driven):
        end = path.raw[path.ends[i]]
        if m["via"] is not None:
            at = np.argmin(np.linalg.norm(path.sharp[path.ends[i - 1]:path.ends[i]] - m["via"][0], axis=1))
            marks.append(path.raw[path.ends[i - 1] + at])
            names.append(m["index"])
        marks.append(end)
        names.append(m["index"] + (m["via"] is not None))
    mark, name = np.array(marks), np.array(names)
    if form == "ahead":
        return name[np.searchsorted(mark, s - 1e-9).clip(0, len(mark) - 1)]
    return name[np.searchsorted((mark[1:] + mark[:-1]) / 2, s)]
