"""Load tests as one writes them at a desk: six springs by the Jacobian of the second cell's chain, one more term, even noise.

No time, no dwell, no visits in half of them, poses and loads as they come: what a user has who kept no more. Terms are of a
size that is drawn, on stiffnesses that are drawn about the published ones; nothing of it comes from the packages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.second_cell.robots import Robot, robot

ROBOTS = ("irb6660-205-1.90", "irb6700-200-2.60", "irb4600-60-2.05", "irb4400-60", "irb6640-235-2.55")
STEP = 1e-5


@dataclass(frozen=True)
class Rows:
    """One load test in base axes: q (n, 6) [rad], force (n, 3) [N], tcp (n, 3) [m], jacobian (n, 3, 6), tool (n, 3, 3), whose
    columns are the flange's axes, torque (n, 6) [N m], twist (n, 6) [rad] of the springs, tilt (n, 3) [rad] of the
    tool by it."""

    q: np.ndarray
    force: np.ndarray
    tcp: np.ndarray
    jacobian: np.ndarray
    tool: np.ndarray
    torque: np.ndarray
    twist: np.ndarray
    tilt: np.ndarray


@dataclass(frozen=True)
class Desk:
    """A load test and what was hidden: label (None: nothing), share of the deflection that it makes (RMS)."""

    robot: str
    tool_mm: np.ndarray
    rows: np.ndarray
    poses: np.ndarray | None
    noise_um: float
    stated: bool
    hidden: str | None
    share: float

    def write(self, folder: Path) -> tuple[Path, Path]:
        """cell.yaml and measurements.csv."""
        cell, table = folder / "cell.yaml", folder / "measurements.csv"
        noise = f"measurement: {{deflection_std_um: {[round(self.noise_um, 1)] * 3}}}\n" if self.stated else ""
        tool = f"tool: {{position_mm: {self.tool_mm.tolist()}, quaternion: [1, 0, 0, 0]}}\n"
        cell.write_text(f"robot: {self.robot}\n{tool}{noise}")
        names = [f"q{i}_deg" for i in range(1, 7)] + [f"{what}{axis}_{unit}" for what, unit in (("f", "n"), ("d", "um"))
                                                      for axis in "xyz"] + ["pose"] * (self.poses is not None)
        lines = [",".join(f"{value:.4f}" for value in row) for row in self.rows]
        if self.poses is not None:
            lines = [f"{line},P{pose}" for line, pose in zip(lines, self.poses, strict=True)]
        table.write_text("\n".join([",".join(names), *lines]) + "\n")
        return cell, table


@dataclass(frozen=True)
class Hidden:
    """What a term adds (n, 3), to be scaled, and the factor beyond which no real robot does it."""

    label: str
    added: np.ndarray
    most: float = np.inf


Term = Callable[[Rows, np.random.Generator], Hidden]


def _each(force: np.ndarray, frame: np.ndarray, compliance: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("nij,j,nkj,nk->ni", frame, compliance, frame, force))


def _base_slides(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("base_shift", rows.force * np.array([1.0, 1.0, 0.0]))


def _base_upright(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("base_shift", rows.force * np.array([1.0, 1.0, rng.uniform(0.2, 0.8)]))


def _base_tips(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("base_rocking", _tipped(rows, np.array([1.0, 1.0, 0.0])))


def _base_rocks(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("base_rocking", _tipped(rows, np.append(rng.permutation([1.0, rng.uniform(0.1, 0.6)]), 0.0)))


def _tipped(rows: Rows, about: np.ndarray) -> np.ndarray:
    return np.asarray(np.cross(np.cross(rows.tcp, rows.force) * about, rows.tcp))


def _tool_bends(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("spindle_compliance", _each(rows.force, rows.tool, np.array([1.0, 1.0, 0.0])))


def _tool_pressed_in(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("spindle_compliance", _each(rows.force, rows.tool, np.array([1.0, 1.0, rng.uniform(0.3, 0.8)])))


def _coupled(a: int, b: int) -> Term:
    def term(rows: Rows, rng: np.random.Generator) -> Hidden:
        """Up to nine tenths of where two coupled springs would push back with less than nothing."""
        one, other = (np.median(rows.twist[:, k] / rows.torque[:, k]) for k in (a, b))
        coupled = rows.jacobian[:, :, a] * rows.torque[:, [b]] + rows.jacobian[:, :, b] * rows.torque[:, [a]]
        return Hidden("wrist_coupling", np.sqrt(one * other) * coupled, 0.9)

    return term


def _uneven(rows: Rows, rng: np.random.Generator) -> Hidden:
    """Softer at some angles, by at most nine tenths."""
    joint, turns = int(rng.integers(1, 6)), int(rng.integers(1, 3))
    share = np.cos(turns * rows.q[:, joint] + rng.uniform(0, 2 * np.pi))
    name = "gravity_compensator" if joint == 1 else f"uneven_gear[{joint + 1}]"
    return Hidden(name, rows.jacobian[:, :, joint] * (rows.twist[:, joint] * share)[:, None], 0.9)


def _worn_stretch(rows: Rows, rng: np.random.Generator) -> Hidden:
    """Softer about one angle, by at most twice as much: no wave, and most at a few poses."""
    joint = int(rng.integers(1, 6))
    angle = rows.q[:, joint]
    share = np.exp(-0.5 * ((angle - rng.choice(angle)) / rng.uniform(0.3, 0.6)) ** 2)
    name = "gravity_compensator" if joint == 1 else f"uneven_gear[{joint + 1}]"
    return Hidden(name, rows.jacobian[:, :, joint] * (rows.twist[:, joint] * share)[:, None], 1.0)


def _free_play(rows: Rows, rng: np.random.Generator) -> Hidden:
    """A joint that jumps by its play when its torque changes sign; a tenth of a degree is a gear that is broken."""
    joint = int(rng.integers(6))
    return Hidden(f"backlash[{joint + 1}]", rows.jacobian[:, :, joint] * np.sign(rows.torque[:, [joint]]), 1e-3)


def _softer_near_zero(rows: Rows, rng: np.random.Generator) -> Hidden:
    """A gear that yields up to two and a half times as much under small torques."""
    joint = int(rng.integers(6))
    torque, twist = rows.torque[:, joint], rows.twist[:, joint]
    knee = np.abs(torque).max() * rng.uniform(0.1, 0.3)
    largest = int(np.argmax(np.abs(torque)))
    return Hidden(f"soft_zone[{joint + 1}]", rows.jacobian[:, :, joint] * np.tanh(torque / knee)[:, None],
                  1.5 * knee * twist[largest] / torque[largest])


def _unlike_signs(rows: Rows, rng: np.random.Generator) -> Hidden:
    """A joint that yields more to one sign of its torque, by at most eight tenths."""
    joint = int(rng.integers(6))
    return Hidden(f"one_sided[{joint + 1}]", rows.jacobian[:, :, joint] * np.abs(rows.twist[:, [joint]]), 0.8)


def _softer_when_loaded(rows: Rows, rng: np.random.Generator) -> Hidden:
    """A joint that yields the more the larger its torque, at its largest torque by at most as much again."""
    joint = int(rng.integers(6))
    share = (rows.torque[:, joint] / np.abs(rows.torque[:, joint]).max()) ** 2
    return Hidden(f"soft_beyond[{joint + 1}]", rows.jacobian[:, :, joint] * (rows.twist[:, joint] * share)[:, None], 1.0)


def _other_force(label: str, error: Callable[[Rows, np.random.Generator], np.ndarray]) -> Term:
    """The springs answer to another force than was written down: by `error` (n, 3)."""
    def term(rows: Rows, rng: np.random.Generator) -> Hidden:
        torque = np.einsum("nij,ni->nj", rows.jacobian, error(rows, rng))
        largest = np.argmax(np.abs(rows.torque), axis=0), np.arange(6)
        compliance = rows.twist[largest] / rows.torque[largest]
        return Hidden(label, np.einsum("nij,nj->ni", rows.jacobian, torque * compliance))

    return term


def _turned_force(rows: Rows, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(np.cross(rng.standard_normal(3), rows.force))


def _turned_in_its_seat(rows: Rows, rng: np.random.Generator) -> np.ndarray:
    """A sensor on the flange, by a small angle."""
    read = np.einsum("nji,nj->ni", rows.tool, rows.force)
    return np.asarray(np.einsum("nij,nj->ni", rows.tool, np.cross(rng.standard_normal(3), read)))


def _constant_force(rows: Rows, rng: np.random.Generator) -> np.ndarray:
    return np.tile(rng.standard_normal(3), (len(rows.q), 1))


def _one_axis_of_force(rows: Rows, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(rows.force * np.eye(3)[rng.integers(3)])


def _hook(rows: Rows, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(rows.force / np.linalg.norm(rows.force, axis=1, keepdims=True))


def _read_beside(rows: Rows, rng: np.random.Generator) -> Hidden:
    """A reflector up to 100 mm from the tip."""
    lever = rng.standard_normal(3)
    return Hidden("reading_point", np.cross(rows.tilt, rows.tool @ (lever / np.linalg.norm(lever))), 0.1)


def _gauge_leans(rows: Rows, rng: np.random.Generator) -> Hidden:
    """One gauge, by up to 11 degrees."""
    read, of = rng.permutation(3)[:2]
    return Hidden("deflection_sensor_crosstalk", np.outer(_moved(rows)[:, of], np.eye(3)[read]), 0.19)


def _gauge_scale(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("deflection_sensor_gain", _moved(rows) * np.eye(3)[rng.integers(3)], 0.29)


def _gauges_turned(rows: Rows, rng: np.random.Generator) -> Hidden:
    about = rng.standard_normal(3)
    return Hidden("deflection_sensor_rotation", np.cross(about, _moved(rows)), 0.19 / np.abs(about).max())


def _gauge_zero(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("sensor_step", np.tile(rng.standard_normal(3), (len(rows.q), 1)))


def _from_then_on(rows: Rows, rng: np.random.Generator) -> np.ndarray:
    return np.arange(len(rows.q))[:, None] >= rng.integers(len(rows.q) // 4, 3 * len(rows.q) // 4)


def _gauge_bumped(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("sensor_step", _from_then_on(rows, rng) * rng.standard_normal(3))


def _joint_off(rows: Rows, rng: np.random.Generator) -> Hidden:
    joint = int(rng.integers(6))
    return Hidden(f"encoder_zero[{joint + 1}]", rows.jacobian[:, :, joint])


def _joint_off_later(rows: Rows, rng: np.random.Generator) -> Hidden:
    joint = int(rng.integers(6))
    return Hidden(f"encoder_zero[{joint + 1}]", rows.jacobian[:, :, joint] * _from_then_on(rows, rng))


def _wave(rows: Rows, rng: np.random.Generator) -> Hidden:
    """Once to six times a turn, whole or not."""
    joint, turns = int(rng.integers(6)), float(rng.uniform(1, 6))
    turns = np.round(turns) if rng.random() < 0.5 else turns
    return Hidden(f"transmission_error[{joint + 1}]",
                  rows.jacobian[:, :, joint] * np.sin(turns * rows.q[:, [joint]] + rng.uniform(0, 2 * np.pi)))


def _drift(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("drift", np.arange(len(rows.q))[:, None] * rng.standard_normal(3))


def _softens(rows: Rows, rng: np.random.Generator) -> Hidden:
    return Hidden("softening", _moved(rows) * np.arange(len(rows.q))[:, None])


def _moved(rows: Rows) -> np.ndarray:
    return np.asarray(np.einsum("nij,nj->ni", rows.jacobian, rows.twist))


TERMS: dict[str, Term] = {
    "a base that gives way upright too": _base_upright, "a base that rocks more to one side": _base_rocks,
    "a tool pressed in": _tool_pressed_in, "axes 4 and 5 coupled": _coupled(3, 4), "axes 4 and 6 coupled": _coupled(3, 5),
    "an uneven gear": _uneven, "drift without a clock": _drift, "free play": _free_play,
    "a gear softer near zero": _softer_near_zero, "a base that slides": _base_slides, "a base that tips": _base_tips,
    "a tool that bends": _tool_bends, "axes 5 and 6 coupled": _coupled(4, 5),
    "a force frame turned": _other_force("force_misalignment", _turned_force),
    "a sensor turned in its seat": _other_force("force_misalignment", _turned_in_its_seat),
    "a force zero": _other_force("force_offset", _constant_force),
    "one axis of the force": _other_force("force_axis_gain", _one_axis_of_force), "one gauge's scale": _gauge_scale,
    "gauges turned": _gauges_turned, "a gauge zero": _gauge_zero, "a gauge bumped": _gauge_bumped, "a joint off": _joint_off,
    "a joint off later": _joint_off_later, "a wave over the angle": _wave, "a robot that softens": _softens,
    "a gear unlike to either sign": _unlike_signs, "a gear softer when loaded": _softer_when_loaded,
    "a gear worn about one angle": _worn_stretch, "a hook that nobody weighed": _other_force("hook_weight", _hook),
    "read beside the TCP": _read_beside, "a gauge that leans": _gauge_leans}


def desk(seed: int, term: str | None, shares: tuple[float, float] = (0.08, 0.25)) -> Desk:
    """A load test of 24 to 240 rows on one of five robots; the term makes a share of the deflection between these, or what a
    real robot does at most."""
    rng = np.random.default_rng(seed)
    name = ROBOTS[int(rng.integers(len(ROBOTS)))]
    arm = robot(name)
    tool = np.round(rng.uniform([0.1, 0.0, 0.15], [0.2, 0.05, 0.3]), 3)
    poses, loads = int(rng.integers(12, 41)), int(rng.choice([1, 3, 6]))
    loads = max(loads, 3) if poses * loads < 24 else loads
    q = np.repeat(arm.poses(poses, tool, rng), loads, axis=0)
    if loads == 6:
        direction = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (poses, 1))
    else:
        direction = rng.standard_normal((len(q), 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    force = np.round(rng.uniform(150, 400, (len(q), 1)) * direction, 1)
    rows = _rows(arm, q, tool, force, arm.stiffness * np.exp(0.4 * rng.standard_normal(6)))
    moved = _moved(rows)
    share, hidden, noise = float(rng.uniform(*shares)), None, float(rng.uniform(3e-6, 12e-6))
    if term is not None:
        told = TERMS[term](rows, rng)
        hidden, factor = told.label, min(share * np.sqrt(np.mean(moved**2) / np.mean(told.added**2)), told.most)
        share = float(factor * np.sqrt(np.mean(told.added**2) / np.mean(moved**2)))
        moved = moved + factor * told.added
    table = np.hstack([np.degrees(q), force, 1e6 * (moved + noise * rng.standard_normal(moved.shape))])
    stated, labelled = rng.random(2) < 0.5
    return Desk(name, 1e3 * tool, table, np.repeat(np.arange(poses), loads) if labelled else None, 1e6 * noise, bool(stated),
                hidden, share)


def _rows(arm: Robot, q: np.ndarray, tool: np.ndarray, force: np.ndarray, stiffness: np.ndarray) -> Rows:
    def slopes(along: np.ndarray, of: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        return np.stack([(of(step) - of(-step)) / (2 * STEP) for step in STEP * along], axis=2)

    jacobian = slopes(np.eye(6), lambda step: arm.tcp(q + step, tool))
    torque = np.einsum("nij,ni->nj", jacobian, force)
    twist = torque / stiffness
    # How the flange's axes turn with the springs: w = 1/2 sum a x da.
    turned = [slopes(np.eye(3), lambda step, sign=sign: arm.tcp(q + sign * STEP * twist, tool + step)) for sign in (-1, 1)]
    tool_axes = slopes(np.eye(3), lambda step: arm.tcp(q, tool + step))
    tilt = 0.5 * np.cross(tool_axes, (turned[1] - turned[0]) / (2 * STEP), axis=1).sum(axis=2)
    return Rows(q, force, arm.tcp(q, tool), jacobian, tool_axes, torque, twist, tilt)
