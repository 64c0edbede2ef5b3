"""What can be hidden: every effect as this cell's own mechanics, at a multiple of the size that docs/effects.md calls typical.

Joints, names and sizes are the dictionary's, so that an answer can be judged; laws are not. `known_as` gives the dictionary's
name where a law is a variant; the effects of OUTSIDE are in no dictionary.
"""

from __future__ import annotations

import numpy as np

from tests.second_cell.chain import hinge, slide
from tests.second_cell.hidden import EFFECTS, World, direction, effect, turn
from tests.second_cell.laws import BoucWen, Cubic, KelvinVoigt, Play, SmoothZone, Softening, Strut
from tests.second_cell.robots import HOME_FLANGE, X, Y, Z

SMALLER = (1.0, 1.0, 1.0, 0.6, 0.6, 0.4)        # torques in small gears, against large ones
ALL = range(1, 7)


@effect("backlash", ALL)
def backlash(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """A gap in series with the gear; friction holds the teeth where they were last, anywhere in the middle half of it."""
    gap = factor * 4.6e-5
    at = world.arm.in_series(joint)
    world.arm.laws += [Play(at, gap, 100 * world.arm.stiffness[joint - 1], rng.uniform(-0.5, 0.5, 99)),
                       BoucWen(at, 3.0 * SMALLER[joint - 1], gap / 4)]


@effect("soft_zone", ALL)
def soft_zone(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Softer by 1 + 0.8 factor near zero, over some 50 to 200 N m."""
    softer, k = 0.8 * factor, world.arm.stiffness[joint - 1]
    width = rng.uniform(50, 200) * SMALLER[joint - 1] / k * (1 + softer)
    world.arm.laws.append(SmoothZone(joint - 1, k, width * softer / (1 + softer), width))


@effect("soft_gears")
def soft_gears(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """All six gears softer near zero by some 1 + 0.8 factor, up to where they are wound up by about the same angle."""
    wound = rng.uniform(1.5e-4, 5e-4)
    for at, k in enumerate(world.arm.stiffness):
        softer, width = 0.8 * factor * rng.uniform(0.6, 1.4), wound * rng.uniform(0.8, 1.25)
        world.arm.laws.append(SmoothZone(at, k, width * softer, width * (1 + softer)))


@effect("cubic_gear", ALL, known_as="soft_zone")
def cubic_gear(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """A gear that stiffens all the way, without a zone."""
    k = world.arm.stiffness[joint - 1]
    world.arm.laws.append(Cubic(joint - 1, k, (600 if joint < 4 else 80) / np.sqrt(factor) / k))


@effect("hysteresis", ALL)
def hysteresis(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Bouc-Wen friction beside the gear's spring."""
    k = world.arm.stiffness[joint - 1]
    world.arm.laws.append(BoucWen(joint - 1, factor * 4.4e-5 * k, rng.uniform(20, 100) * SMALLER[joint - 1] / k))


@effect("breakaway", ALL, known_as="hysteresis")
def breakaway(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Stick friction: the joint stands still until the torque breaks it loose, and sticks again at every turn."""
    world.arm.laws.append(BoucWen(joint - 1, factor * 4.4e-5 * world.arm.stiffness[joint - 1], factor * 3e-6))


@effect("gravity_compensator", (2,))
def gravity_compensator(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """A strut of true geometry between column and lower arm."""
    swing = min(0.27 * factor, 0.6)
    stiffer = 2 * swing / (1 - swing) * world.arm.stiffness[1]
    world.arm.laws.append(Strut(1, stiffer / 0.25**2, 0.25, 0.6, rng.uniform(0.6, 2.4)))


@effect("wrist_coupling")
def wrist_coupling(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """The bevel gears of axis 6 run round axis 5: a twist of gear 5 turns axis 6 too."""
    world.arm.hinge_of(6).gives[4] = rng.choice([-1, 1]) * factor * 1e-6 * world.arm.stiffness[4]


@effect("parallelogram", rod=True)
def parallelogram(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Gear 3 sits at the elbow (wholly from factor 1 on): a twist of gear 2 takes the forearm with it."""
    world.arm.hinge_of(3).gives[1] = min(factor, 1.0) - 1.0


# Structure and base.

@effect("bearing_tilt", range(1, 6))
def bearing_tilt(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """A bearing that tilts about both axes across its own and stiffens by what it carries; where bearings really are, not at
    frames."""
    shoulder, elbow, wrist = world.arm.robot.joints
    pivot = {1: 0.5 * shoulder * Z, 2: shoulder, 3: elbow, 4: wrist - 0.15 * X, 5: wrist}[joint]
    axes = {1: (X, Y), 2: (X, Z), 3: (X, Z), 4: (Y, Z), 5: (X, Z)}[joint]
    yielding, moment = factor * 9.1e-8, (2e4, 1e4, 5e3, 1e3, 5e2)[joint - 1]
    for at in world.arm.yields(joint + 0.2, [hinge(axis, pivot) for axis in axes], np.eye(2) / yielding):
        world.arm.laws.append(Cubic(at, 1 / yielding, moment * yielding))


@effect("link_bending", (2, 3))
def link_bending(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Four rigid pieces with springs between them, both planes. A parallel rod holds the forearm while the lower arm bends."""
    shoulder, elbow, wrist = world.arm.robot.joints
    first, last, planes = (shoulder, elbow, (Y, X)) if joint == 2 else (elbow + (wrist - elbow) * Z, wrist, (Y, Z))
    stiffness = 4 / np.linalg.norm(last - first) / (factor * 7.9e-8)
    for axis in planes:
        pieces = [hinge(axis, first + (last - first) * share) for share in (0.125, 0.375, 0.625, 0.875)]
        new = world.arm.yields(joint + 0.3, pieces, stiffness * np.eye(4))
        if joint == 2 and world.arm.robot.rod and axis is Y:
            world.arm.hinge_of(3).gives.update(dict.fromkeys(new, -1.0))


@effect("creep")
def creep(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Every gear creeps: four Kelvin-Voigt elements, a factor 4 in time between them."""
    times = rng.uniform(1, 4) * 4.0 ** np.arange(4)
    for i, k in enumerate(world.arm.stiffness):
        world.arm.laws.append(KelvinVoigt(i, k, np.full(4, factor * 0.017 * np.log(4)), times))


FEET = 0.4 * np.array([[np.cos(a), np.sin(a), 0] for a in np.radians([30, 150, 270])])


@effect("base_rocking")
def base_rocking(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Three feet that yield upright."""
    each = 2e7 / factor / 1.5 / 0.4**2
    lift = np.array([[1, y, -x] for x, y, _ in FEET])       # of a foot, by z, rx, ry
    world.arm.yields(0.1, [slide(Z), hinge(X, np.zeros(3)), hinge(Y, np.zeros(3))], each * lift.T @ lift)


@effect("base_shift")
def base_shift(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Three feet that yield sideways."""
    ways = np.array([row for x, y, _ in FEET for row in ([1, 0, -y], [0, 1, x])])      # of a foot, by x, y, rz
    world.arm.yields(0.1, [slide(X), slide(Y), hinge(Z, np.zeros(3))], 2e7 / factor / 3 * ways.T @ ways)


# Tool and load path.

@effect("force_sensor_compliance")
def force_sensor_compliance(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Six struts between two plates behind the flange."""
    around = np.radians([0, 120, 120, 240, 240, 360])
    below = np.column_stack([np.zeros(6), 0.06 * np.cos(around), 0.06 * np.sin(around)])
    around = np.radians([60, 60, 180, 180, 300, 300])
    above = np.column_stack([np.full(6, 0.05), 0.05 * np.cos(around), 0.05 * np.sin(around)])
    along = (above - below) / np.linalg.norm(above - below, axis=1, keepdims=True)
    struts = np.concatenate([along, np.cross(above, along)], axis=1)        # lengthening by slides and turns x, y, z
    stiffness = struts.T @ struts
    scale = np.linalg.inv(stiffness)[4, 4] / (factor * 3e-6)
    flange = world.arm.robot.flange
    world.arm.yields(6.5, [*map(slide, (X, Y, Z)), *(hinge(axis, flange) for axis in (X, Y, Z))], scale * stiffness)


@effect("spindle_compliance")
def spindle_compliance(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """The spindle turns in its front bearing 140 mm behind the tip; the bearing stiffens."""
    tip, along = world.arm.robot.tcp_home(world.arm.tool), world.arm.spindle
    aside = np.cross(along, Z if abs(along @ Z) < 0.9 else Y)
    aside /= np.linalg.norm(aside)
    yielding = factor * 6.7e-8 / 0.14**2
    bearing = [hinge(axis, tip - 0.14 * along) for axis in (aside, np.cross(along, aside))]
    for at in world.arm.yields(6.8, bearing, np.eye(2) / yielding):
        world.arm.laws.append(Cubic(at, 1 / yielding, 80 * yielding))


@effect("tool_point")
def tool_point(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    world.arm.load_point = world.arm.load_point + HOME_FLANGE @ (factor * 0.008 * direction(rng))


@effect("side_load")
def side_load(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """The cylinder leans on its guide to the side it moves from; it changes sides over 40 N."""
    angle, plan = rng.uniform(-np.pi, np.pi), world.plan

    def lean(force: np.ndarray) -> np.ndarray:
        aside, side = np.zeros_like(force), 0.0
        for i, load in enumerate(plan.load):
            start = i == 0 or plan.visit[i] != plan.visit[i - 1]
            before, size = (np.zeros(3) if start else plan.load[i - 1]), float(np.linalg.norm(load))
            if size == 0:
                continue
            line = load / size * np.sign(load[np.argmax(np.abs(load))])
            side = float(np.clip((0.0 if start else side) + (load - before) @ line / 40, -1, 1))
            out = np.cross(line, Z if abs(line @ Z) < 0.99 else X)
            aside[i] = factor * 0.032 * size * side * turn(angle * line) @ (out / np.linalg.norm(out))
        return force + aside

    world.force.append(lean)


# Measurement.

@effect("force_gain")
def force_gain(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    world.force.append(lambda force: (1 + 0.05 * factor) * force)


@effect("force_misalignment")
def force_misalignment(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    frame = turn(0.021 * factor * direction(rng))
    world.force.append(lambda force: force @ frame.T)


def _sensor_frames(world: World, rng: np.random.Generator) -> np.ndarray:
    """The axes of the force sensor at each row, one for all or (n, 3, 3): it stands in the cell, or turns with the flange."""
    if rng.random() < 0.5:
        return np.eye(3)
    robot, q = world.arm.robot, world.plan.q
    return np.stack([robot.tcp(q, axis) - robot.tcp(q, np.zeros(3)) for axis in np.eye(3)], axis=2)


def _misread(world: World, error: np.ndarray, rng: np.random.Generator) -> None:
    """A sensor whose error matrix (3, 3) in its own axes grows by a tenth over 1000 N."""
    frames = _sensor_frames(world, rng)

    def real(force: np.ndarray) -> np.ndarray:
        own = np.einsum("...ji,...j->...i", frames, force)
        own = own + (1 + np.linalg.norm(force, axis=1, keepdims=True) / 1e4) * (own @ error.T)
        return np.einsum("...ij,...j->...i", frames, own)

    world.force.append(real)


@effect("force_axis_gain")
def force_axis_gain(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """What the three axes have in common nobody can see, so there is none of it."""
    gains = rng.standard_normal(3)
    gains -= gains.mean()
    _misread(world, np.diag(0.025 * factor * gains / np.linalg.norm(gains)), rng)


@effect("force_crosstalk")
def force_crosstalk(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    xy, xz, yz = 0.017 * factor * direction(rng)
    _misread(world, np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]]), rng)


@effect("force_offset")
def force_offset(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """A zero that was not taken off, in every reading under load."""
    zero = _sensor_frames(world, rng) @ (5.0 * factor * direction(rng))
    world.force.append(lambda force: force + zero * (force != 0).any(axis=1, keepdims=True))


@effect("deflection_sensor_gain")
def deflection_sensor_gain(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    gains = 1 + 0.014 * factor * rng.choice([-1, 1], 3) * rng.uniform(0.5, 1.5, 3)
    world.reading.append(lambda seen: seen * gains)


@effect("deflection_sensor_rotation")
def deflection_sensor_rotation(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    frame = turn(0.025 * factor * direction(rng))
    world.reading.append(lambda seen: seen @ frame.T)


@effect("deflection_sensor_crosstalk")
def deflection_sensor_crosstalk(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Gauges that lean in pairs, towards each other or away; what they turn together is another effect."""
    xy, xz, yz = 0.024 * factor * direction(rng)
    lines = np.array([[1, xy, xz], [xy, 1, yz], [xz, yz, 1]])
    lines /= np.linalg.norm(lines, axis=1, keepdims=True)
    world.reading.append(lambda seen: seen @ lines.T)


@effect("target_curvature")
def target_curvature(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Each sensor's line meets its own ball, 0.03 mm beside the pole that faces it."""
    radius, sides = 0.01 / factor, rng.choice([-1.0, 1.0], 3)
    off = 3e-5 * rng.standard_normal((3, 2))

    def met(seen: np.ndarray) -> np.ndarray:
        shown = seen.copy()
        for i, side in enumerate(sides):
            aside = np.delete(seen, i, axis=1)
            def depth(t: np.ndarray) -> np.ndarray:
                return radius - np.sqrt(radius**2 - np.sum(t**2, axis=1))
            shown[:, i] += side * (depth(aside + off[i]) - depth(off[i:i + 1]))
        return shown

    world.reading.append(met)


@effect("drift")
def drift(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """Settles within hours."""
    rate, settling = factor * 8.3e-9 * direction(rng), rng.uniform(1.5, 6) * 3600
    world.reading.append(lambda seen: seen + settling * -np.expm1(-world.plan.time / settling)[:, None] * rate)


@effect("stand_compliance")
def stand_compliance(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """The tripod stands on the loading frame, whose three rails give way unlike each other and stiffen as they are pressed."""
    gives, turned = factor * 5e-8 * rng.uniform(0.3, 2.0, 3), turn(rng.uniform(0.05, 0.2) * direction(rng))
    load = world.plan.load
    world.reading.append(lambda seen: seen + (gives * load / (1 + np.abs(load) / 2000)) @ turned.T)


@effect("sensor_step")
def sensor_step(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """From a row on, in one visit, or in a single row."""
    step, rows = factor * 1e-5 * direction(rng), np.arange(len(world.plan.load))
    row = int(rng.integers(len(rows) // 5, len(rows) * 4 // 5))
    on = (rows >= row, world.plan.visit == world.plan.visit[row], rows == row)[int(rng.integers(3))]
    world.reading.append(lambda seen: seen + on[:, None] * step)


@effect("transmission_error", ALL)
def transmission_error(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """The joint stands off by a wave of its own angle: a pose is not come back to as it was, which looks like re-seating."""
    wave = 1.5e-5 * factor * np.sin(rng.uniform(3, 40) * world.plan.q[:, joint - 1] + rng.uniform(0, 2 * np.pi))
    world.reading.append(lambda seen: seen + world.across_tcp(joint, wave))


@effect("encoder_zero", ALL)
def encoder_zero(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """A joint's zero moves once between two visits."""
    moved = world.plan.visit >= rng.uniform(0.25, 0.75) * world.plan.visits
    world.reading.append(lambda seen: seen + world.across_tcp(joint, 2e-5 * factor * moved))


# In no dictionary.

@effect("hose_drag", outside=True)
def hose_drag(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """A hose holds against the tool's motion along one direction, up to 20 N, wherever the load moves it."""
    along, plan = direction(rng), world.plan

    def dragged(force: np.ndarray) -> np.ndarray:
        held, z = force.copy(), 0.0
        for i, load in enumerate(plan.load):
            start = i == 0 or plan.visit[i] != plan.visit[i - 1]
            way = float((load - (0 if start else plan.load[i - 1])) @ along)
            z = float(np.clip((0.0 if start else z) + way / 60, -1, 1))
            held[i] -= 20 * factor * z * along
        return held

    world.force.append(dragged)


@effect("sticks_somewhere", (1, 2, 3), outside=True)
def sticks_somewhere(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """A joint sticks in one half of its range only."""
    axis = joint - 1
    low = float(np.median(world.plan.q[:, axis]))
    world.arm.laws.append(BoucWen(axis, 8e-5 * factor * world.arm.stiffness[axis], 5e-6 * factor, (axis, low, np.inf)))


@effect("softening", outside=True)
def softening(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """All gears soften while the cell warms up."""
    for i, k in enumerate(world.arm.stiffness):
        world.arm.laws.append(Softening(i, k, 0.1 * factor, 2400.0))


@effect("pose_typo", outside=True)
def pose_typo(world: World, joint: int, factor: float, rng: np.random.Generator) -> None:
    """One visit's pose is written down with one wrong digit of one angle, the tens or the ones."""
    visit, axis = int(rng.integers(world.plan.visits)), int(rng.integers(5))
    wrong = np.radians(rng.choice([-1, 1]) * rng.choice([10, 20, 30, 3, 5, 7]))
    world.table_q[world.plan.visit == visit, axis] += wrong


DICTIONARY = tuple(name for name, entry in EFFECTS.items() if not entry.outside)
OUTSIDE = tuple(name for name, entry in EFFECTS.items() if entry.outside)
