"""The arm of blind_world.py: a chain with flexes between its frames, under loads and its own weight, and its load tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

ROOT = Path(__file__).parents[1]
ROBOTS = ("irb6660-205-1.90", "irb4400-60", "irb6700-200-2.60", "irb6640-235-2.55", "irb4600-60-2.05", "kr210-r2700-extra",
          "kr60-ha", "r2000ic-210f", "m710ic-50")
X, Y, Z = UNIT = np.eye(3)
LADDER, CYCLE = (0, .25, .5, .75, 1, 0, -.25, -.5, -.75, -1, 0), (0, .33, .67, 1, .67, .33, 0, -.33, -.67, -1, -.67, -.33, 0)
PLANS = {"10x6": (10, lambda v, r: [s * a for a in UNIT for s in (1, -1)]),
         "6x4": (6, lambda v, r: [f * UNIT[v % 3] for f in LADDER]),
         "20x1": (20, lambda v, r: [(u := r.normal(size=3)) / np.linalg.norm(u)]),
         "paper": (8, lambda v, r: [f * a for a in (X, Y) for f in (.2, .4, .6, .8, 1)]),
         "cycle": (10, lambda v, r: [f * UNIT[v % 3] for f in CYCLE]),
         "cycle3": (8, lambda v, r: [f * a for a in UNIT for f in CYCLE])}


def turn(w):
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    angle = np.maximum(np.linalg.norm(w, axis=-1), 1e-300)[..., None, None]
    unit = np.cross(w[..., None, :], UNIT).swapaxes(-1, -2) / angle
    return np.eye(3) + np.sin(angle) * unit + (1 - np.cos(angle)) * unit @ unit


def by(matrix, vector):
    return np.einsum("...ij,...j->...i", matrix, vector)


def within(frame, matrix, vector):
    """A matrix that is given in frames (n, 3, 3), on vectors of the base (n, 3)."""
    return by(frame, by(frame.swapaxes(1, 2), vector) @ matrix.T)


def size(vectors):
    return np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


class Arm:
    """A robot file's chain with flexes 0 (floor), 1 to 6 (behind a joint), 7 (at the flange), and its weight."""

    def __init__(self, name, r):
        file = yaml.safe_load((ROOT / f"identification/model/robots/{name}.yaml").read_text())
        rows = [[joint.get(key, low) for joint in file["joints"]] for key, low in (("alpha_deg", 0), ("a_mm", 0), ("d_mm", 0),
                ("offset_deg", 0), ("sense", 1))]
        self.name, (self.alpha, self.a, self.d, self.offset, self.sense) = name, np.array(rows, float)
        self.alpha, self.a, self.d, self.offset = np.radians(self.alpha), self.a / 1e3, self.d / 1e3, np.radians(self.offset)
        self.limits = np.radians([joint["limits_deg"] for joint in file["joints"]])
        self.coupled = "coupling" in file
        self.rod, payload = self.coupled and file["coupling"].get("rod", True), file["data_sheet"]["payload_kg"]
        self.k = np.array([2.1, 4.5, 2.4, 0.55, 0.3, 0.12]) * 1e6 * (payload / 200) ** 0.9 * np.exp(r.normal(0, 0.3, 6))
        self.load = r.uniform(250, 450) if payload < 100 else r.uniform(300, 900)
        self.tool, self.floor = np.array([(.12, 0, .25), (0, .09, .32), (-.15, .05, .2)][r.integers(3)]), -0.7 * (not self.d[0])
        self.mass = payload * np.array([2.4, 1.6, 1.9, 0.5, 0.3, 0.06, 0.35])
        lower, fore = abs(self.a[2]), self.d[3]
        self.centre = np.array([[.1, 0, -.2], [.45 * lower, 0, .05], [.05, .2 * fore, 0], [0, 0, -.15 * fore], [0, -.03, 0],
                                [0, 0, -.03], [0, 0, self.tool[2] / 2]])
        self.pivot = np.array([[.05, 0, self.floor], [0, 0, -.6 * (self.d[0] or .7)], [lower, 0, 0],
                               [self.a[3], fore, 0], *np.zeros((3, 3)), [0, 0, .05]])

    def chain(self, q, twist, w, t):
        """Frames at controller angles q (n, 6), twists at the springs (n, 6) and flexes w, t (8, n, 3)."""
        serial = q * self.sense + self.offset + twist
        if self.coupled:
            serial[:, 2] -= q[:, 1] + self.rod * twist[:, 1]
        axes, places, at, turned, place = [], [], [], np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3))
        for i in range(8):
            if 0 < i < 7:
                c, s = np.cos(self.alpha[i - 1]), np.sin(self.alpha[i - 1])
                place = place + self.a[i - 1] * turned[:, :, 0]
                turned = turned @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ turn(np.outer(serial[:, i - 1], Z))
                place = place + self.d[i - 1] * turned[:, :, 2]
                axes.append(turned)
                places.append(place)
            at.append((turned, place + by(turned, self.pivot[i])))
            place = at[-1][1] + by(turned, t[i])
            turned = turned @ turn(w[i])
            place = place - by(turned, self.pivot[i])
        tcp = place + by(turned, self.tool)
        return {"axes": [*axes, turned], "places": [*places, place], "at": at, "tcp": tcp, "flange": turned}

    def still(self, q):
        return self.chain(q, np.zeros((len(q), 6)), *np.zeros((2, 8, len(q), 3)))

    def jacobian(self, q):
        flexes, steps = np.zeros((2, 8, len(q), 3)), [np.tile(1e-6 * e, (len(q), 1)) for e in np.eye(6)]
        return np.stack([(self.chain(q, s, *flexes)["tcp"] - self.chain(q, -s, *flexes)["tcp"]) / 2e-6 for s in steps], -1)

    def rest(self, q, force, lever, law, **state):
        """TCP (n, 3) at rest: rounds of torque, twist, motion. law(c) adds to c["twist"], c["w"], c["t"], c["extra"]."""
        n = len(q)
        twist, (w, t) = np.zeros((n, 6)), np.zeros((2, 8, n, 3))
        for _ in range(8):
            f = self.chain(q, twist, w, t)
            point, bodies = f["tcp"] + lever(f["flange"]), [f["places"][i] + by(f["axes"][i], self.centre[i]) for i in range(7)]

            def wrench(centre, first, load=1.0, point=point, bodies=bodies):
                pulls = [load * force, *(np.array([0, 0, -9.81 * m]) + 0 * force for m in self.mass[first:])]
                return sum(pulls), sum(np.cross(p - centre, g) for p, g in zip([point, *bodies[first:]], pulls, strict=True))

            def local(e, f=f, wrench=wrench):
                frame, centre = f["at"][e]
                return [by(frame.swapaxes(1, 2), v) for v in wrench(centre, min(e, 6))]

            torque, weight = (np.stack([np.sum(f["axes"][i][:, :, 2] * wrench(f["places"][i], i, load)[1], 1)
                                        for i in range(6)], 1) for load in (1.0, 0.0))
            for x in (torque, weight) if self.rod else ():
                x[:, 1] -= x[:, 2]
            c = {**state, "q": q, "force": force, "flange": f["flange"], "local": local, "torque": torque, "weight": weight,
                 "gear": torque - 0.6 * weight * np.eye(6)[1], "twist": torque / self.k, "w": 0 * w, "t": 0 * t,
                 "extra": 0 * force}
            law(c)
            twist, w, t = c["twist"], c["w"], c["t"]
        return self.chain(q, twist, w, t)["tcp"] + c["extra"]


def load_test(arm, kind, r):
    """Poses in front of the robot, over the floor, off the wrist's singularity; rows in the order they are taken."""
    count, loads = PLANS[kind]
    found, reach = [], abs(arm.a[2]) + arm.d[3]
    while len(found) < count:
        q = np.array([r.uniform(-1.1, 1.1), r.uniform(*arm.limits[1]), r.uniform(*arm.limits[2]), r.uniform(-2.2, 2.2),
                      r.choice([-1, 1]) * r.uniform(0.4, 1.6), r.uniform(-2.6, 2.6)]).round(4)
        x, y, z = arm.still(q[None])["tcp"][0]
        ahead = np.cos(np.arctan2(y, x) - q[0] * arm.sense[0]) > 0.8 and x > 0.2 and not (arm.rod and abs(q[2] - q[1]) > 1.2)
        if ahead and 0.45 < np.hypot(x, y) / reach < 1 and 0.15 < (z - arm.floor) / reach < 1.2:
            found.append(q)
    rows = [(v, q, f) for v, q in enumerate(found) for f in loads(v, r)]
    visit, q, force = (np.array(column) for column in zip(*rows, strict=True))
    time = np.cumsum(25 * r.uniform(0.8, 1.2, len(rows))) + 120.0 * (visit + 1)
    torque = np.einsum("nij,ni->nj", arm.jacobian(q), force * arm.load)
    shrink = min(1, 2e-3 / np.sqrt((by(arm.jacobian(q), torque / arm.k) ** 2).sum(1).mean()))
    force = np.round(force * arm.load * shrink, 1)
    return {"kind": kind, "visit": visit, "q": q, "force": force, "time": time, "torque": torque * shrink}


def readings(arm, rows, cause, s):
    """Deflections (n, 3) [m] without noise: loaded minus the unloaded reading that begins each visit."""
    visit, first = rows["visit"], np.flatnonzero(np.r_[True, np.diff(rows["visit"]) != 0])
    order, zero = np.insert(np.arange(len(visit)), first, first), np.insert(np.zeros(len(visit), bool), first, True)
    force = cause.get("force", lambda f, flange, s: f)(rows["force"], arm.still(rows["q"])["flange"], s)[order] * ~zero[:, None]
    q = (rows["q"] + cause.get("angles", lambda s: 0)(s))[order]
    lever, law, time = cause.get("lever", lambda to, s: 0), cause.get("law", lambda c, s: 0), rows["time"][order] - 30 * zero
    place = arm.rest(q, force, lambda to: lever(to, s), lambda c: law(c, s), visit=visit[order], time=time)
    return cause.get("read", lambda d, s: d)(place[~zero] - place[zero][visit], s)
