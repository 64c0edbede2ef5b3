"""What the third judge hides in gears and structure (third_world.py)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from benchmarks.third_arm import Yielding, length
from benchmarks.third_gears import (
    Array,
    ByAngle,
    ByVisit,
    Creep,
    Friction,
    Law,
    Loop,
    OneSided,
    Play,
    Settle,
    Slip,
    Stages,
    Stiffening,
    Warming,
)
from benchmarks.third_sight import by_springs
from benchmarks.third_trial import Hide, Row, Trial, into

CAUSES: dict[str, Hide] = {}
cause = into(CAUSES)
ALL_JOINTS = range(6)
# A joint is worth hiding something in when it moves the tool by this share of what the strongest does.
SEEN = 0.2
STILL = np.zeros(3)


def joint_of(trial: Trial, among: Iterable[int] = ALL_JOINTS) -> int:
    """A joint, from 0, that moves the tool under these loads."""
    joints = list(among)
    moves = np.sqrt(((by_springs(trial.arm, trial.rows) / trial.stiffness)**2).mean((0, 1)))
    good = [joint for joint in joints if moves[joint] > SEEN * moves.max()]
    return int(trial.rng.choice(good or [max(joints, key=lambda joint: moves[joint])]))


def largest_torque(trial: Trial, joint: int) -> float:
    """[N m], of the loads as they are written."""
    return max(float(abs(trial.arm.jacobian(row.q).T @ row.force)[joint]) for row in trial.rows)


def largest_force(trial: Trial) -> float:
    """[N], as it is written."""
    return max(length(row.force) for row in trial.rows)


def gear(trial: Trial, joint: int, law: Law) -> None:
    trial.robot.laws.append((joint, law))


def one_visit(trial: Trial, before_last: int = 0) -> int:
    """One that is fitted, and not the first."""
    return int(trial.rng.integers(1, trial.visits - max(trial.kept, 1) - before_last))


# ------------------------------------------------------------------ gears and drives
@cause
def strain_wave(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint = joint_of(trial, (3, 4, 5) if trial.rng.random() < .5 else ALL_JOINTS)
    most = largest_torque(trial, joint)
    gear(trial, joint, Stages(0.6 * size, 0.25 * size, 0.3 * most, 0.7 * most, float(trial.rng.choice([0, 1]))))
    return (f"joint {joint + 1}: three stiffnesses, {0.6 * size:.2f} softer to 30 %, {0.25 * size:.2f} stiffer from 70 % of "
            f"{most:.0f} N m", {f"soft_zone[{joint + 1}]"})


@cause
def lost_motion(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint, half = joint_of(trial), 5e-5 * size
    gear(trial, joint, Play(half, 8))
    return (f"joint {joint + 1}: play of +-{half * 1e6:.0f} urad, pressed by the arm's weight",
            {f"backlash[{joint + 1}]", f"soft_zone[{joint + 1}]"})


@cause
def loop(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint = joint_of(trial)
    most = largest_torque(trial, joint)
    gear(trial, joint, Loop(0.5 * size, 0.5 * most))
    return (f"joint {joint + 1}: hysteresis, play operators of {0.5 * size:.2f} of the compliance up to {0.5 * most:.0f} N m",
            {f"hysteresis[{joint + 1}]"})


def rubbing(trial: Trial, joint: int, share: float) -> float:
    """Dry friction [N m] of this share of the largest torque, held over as much as the spring gives under it."""
    torque = share * largest_torque(trial, joint)
    gear(trial, joint, Friction(torque, torque * trial.robot.compliance[joint]))
    return torque


@cause
def balancer_seal(trial: Trial, size: float) -> tuple[str, set[str]]:
    torque = rubbing(trial, 1, 0.35 * size)
    return (f"axis 2: the balancer's piston seal holds +-{torque:.0f} N m of dry friction", {"hysteresis[2]", "soft_beyond[2]"})


@cause
def dress_pack(trial: Trial, size: float) -> tuple[str, set[str]]:
    for joint in (3, 4, 5):
        rubbing(trial, joint, 0.3 * size)
    return (f"axes 4-6: the hose pack's dry friction, {0.3 * size:.2f} of the largest torque",
            {f"{law}[{joint}]" for law in ("hysteresis", "soft_beyond") for joint in (4, 5, 6)})


@cause
def servo_recovers(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint = joint_of(trial)
    gear(trial, joint, Creep(-0.3 * size, 30))
    return (f"joint {joint + 1}: the servo's integrator takes back {0.3 * size:.2f} of the deflection in 30 s",
            {f"gear_creep[{joint + 1}]", "creep"})


@cause
def grease_creeps(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint = joint_of(trial)
    gear(trial, joint, Creep(0.3 * size, 60))
    return f"joint {joint + 1}: yields on by {0.3 * size:.2f}, 60 s", {f"gear_creep[{joint + 1}]", "creep"}


@cause
def brakes_at_some(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint, first = joint_of(trial), trial.visits // 2
    gear(trial, joint, ByVisit(0.4 * size, first))
    return (f"joint {joint + 1}: from visit {first + 1} on brakes in place of servo: {0.4 * size:.2f} softer",
            {"softening", f"gear_softening[{joint + 1}]"})


@cause
def brake_slips(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint = joint_of(trial, (1, 2, 0))
    limit = 0.6 * largest_torque(trial, joint)
    gear(trial, joint, Slip(limit, 0.8 * size))
    return (f"joint {joint + 1}: the brake slips above {limit:.0f} N m, by {0.8 * size:.2f} of what is over, and stays",
            {f"soft_beyond[{joint + 1}]", f"hysteresis[{joint + 1}]"})


@cause
def eccentric_gear(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint, waves = joint_of(trial), int(trial.rng.integers(1, 4))
    gear(trial, joint, ByAngle(0.3 * size, waves, trial.rng.uniform(0, 6)))
    balancer = {"gravity_compensator", "gravity_compensator[2]"} if joint == 1 else set()
    return f"joint {joint + 1}: softness +-{0.3 * size:.2f} cos({waves} q)", {f"uneven_gear[{joint + 1}]"} | balancer


@cause
def warms_up(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint, constant = joint_of(trial), trial.rows[-1].time / 3
    gear(trial, joint, Warming(0.3 * size, constant))
    return (f"joint {joint + 1}: {0.3 * size:.2f} softer with 1-exp(-t/{constant:.0f} s)",
            {"softening", f"gear_softening[{joint + 1}]"})


@cause
def rod_bearing(trial: Trial, size: float) -> tuple[str, set[str]]:
    half = 6e-5 * size
    gear(trial, 2, Play(half, 10))
    return (f"joint 3: bearing of the rod has +-{half * 1e6:.0f} urad of play, under weight",
            {"backlash[3]", "soft_zone[3]", "one_sided[3]", "parallelogram"})


@cause
def one_way(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint = joint_of(trial, (0, 1, 2))
    gear(trial, joint, OneSided(0.35 * size))
    return f"joint {joint + 1}: {0.35 * size:.2f} softer one way", {f"one_sided[{joint + 1}]"}


@cause
def settles_once(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint = joint_of(trial)
    gear(trial, joint, Settle(0.25 * size))
    return f"joint {joint + 1}: the first load leaves {0.25 * size:.2f} of its largest as a set", {f"hysteresis[{joint + 1}]"}


@cause
def wrist_gears(trial: Trial, size: float) -> tuple[str, set[str]]:
    compliance = trial.robot.compliance
    both = 0.5 * size * np.sqrt(compliance[4] * compliance[5])
    trial.robot.cross[4, 5] = trial.robot.cross[5, 4] = both
    return f"wrist: compliance 5-6 {both:.2e}", {"wrist_coupling"}


@cause
def stiffens(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint = joint_of(trial)
    gear(trial, joint, Stiffening(0.5 * size, largest_torque(trial, joint)))
    return (f"joint {joint + 1}: stiffens with torque (own weight too), {0.5 * size:.2f} at the largest",
            {f"soft_zone[{joint + 1}]"})


@cause
def bumper(trial: Trial, size: float) -> tuple[str, set[str]]:
    joint, visit = joint_of(trial, (1, 2)), one_visit(trial)
    gear(trial, joint, ByVisit(-0.5 * size, visit, visit))
    return f"joint {joint + 1} touches its damper at visit {visit + 1}: {0.5 * size:.2f} stiffer there", {"bad_visit"}


# ------------------------------------------------------------------ structure
BASE, LOWER_ARM, FLANGE = 0, 2, 6


def structure(trial: Trial, place: int, yielding: Yielding) -> None:
    trial.robot.structure.append((place, yielding))


@cause
def pedestal_bends(trial: Trial, size: float) -> tuple[str, set[str]]:
    """A cantilever: its tip turns by M L / EI + F L^2 / 2 EI and moves by F L^3 / 3 EI + M L^2 / 2 EI."""
    high, stiff = 1.2, 2.2e8 / size

    def bend(force: Array, moment: Array) -> tuple[Array, Array]:
        level = np.array([force[0], force[1], 0])
        over, across = np.array([moment[0], moment[1], 0]), np.array([-force[1], force[0], 0])
        moved = (level * high**3 / 3 + np.array([moment[1], -moment[0], 0]) * high**2 / 2) / stiff
        return moved, (over * high + across * high**2 / 2) / stiff

    structure(trial, BASE, bend)
    return f"pedestal 1.2 m bends as a cantilever, EI {stiff:.1e} N m2", {"base_rocking", "base_shift"}


@cause
def bolts_lift(trial: Trial, size: float) -> tuple[str, set[str]]:
    give = 6e-8 * size
    structure(trial, BASE, lambda force, moment: (STILL, np.array([0, give * max(0, moment[1]), 0])))
    return f"anchor bolts: base rocks about y one way only, {give:.1e} rad/N m", {"base_rocking"}


@cause
def rail(trial: Trial, size: float) -> tuple[str, set[str]]:
    trial.track = bool(trial.rng.random() < .7)
    drive, roll = 1.5e-7 * size, 4e-8 * size
    structure(trial, BASE, lambda force, moment: (np.array([0, drive * force[1], 0]), np.array([0, roll * moment[1], 0])))
    return (f"rail along y: drive {drive:.1e} m/N, roll {roll:.1e} rad/N m; track in the cell: {trial.track}",
            {"soft_track"} | (set() if trial.track else {"base_shift", "base_rocking"}))


@cause
def rail_pinion(trial: Trial, size: float) -> tuple[str, set[str]]:
    trial.track = True
    half = 4e-5 * size
    structure(trial, BASE, lambda force, moment: (np.array([0, half * np.tanh(force[1] / 30), 0]), STILL))
    return f"rail along y: pinion's play +-{half * 1e6:.0f} um", {"soft_track"}


@cause
def gantry(trial: Trial, size: float) -> tuple[str, set[str]]:
    down, turn = 2e-7 * size, 3e-8 * size
    shift, twist = np.array([0.3, 0.5, 1]) * down, np.array([1, 0.3, 0.5]) * turn
    structure(trial, BASE, lambda force, moment: (shift * force, twist * moment))
    return f"gantry gives way: {down:.1e} m/N down, torsion {turn:.1e}", {"base_shift", "base_rocking"}


@cause
def flange_bolts(trial: Trial, size: float) -> tuple[str, set[str]]:
    give = 3e-7 * size
    structure(trial, FLANGE, lambda force, moment: (STILL, give * np.array([moment[0], moment[1], 0])))
    return (f"tool changer at the flange tilts {give:.1e} rad/N m",
            {"force_sensor_compliance", "spindle_compliance", "bearing_tilt[6]"})


@cause
def changer_play(trial: Trial, size: float) -> tuple[str, set[str]]:
    half = 1.0e-4 * size
    about = np.array([1, 1, 0]) * half
    structure(trial, FLANGE, lambda force, moment: (STILL, about * np.tanh(moment / 5)))
    return f"tool changer has play of tilt +-{half * 1e6:.0f} urad", {"tool_play"}


@cause
def spindle_play(trial: Trial, size: float) -> tuple[str, set[str]]:
    half, axis = 2.5e-5 * size, trial.arm.tool[:3, 2]

    def radial(force: Array, moment: Array) -> tuple[Array, Array]:
        across = force - axis * (axis @ force)
        much = length(across)
        return half * across / max(much, 1e-9) * np.tanh(much / 20), STILL

    structure(trial, FLANGE, radial)
    return f"spindle's bearing has radial play of {half * 1e6:.0f} um", {"tool_play"}


@cause
def lower_arm_twists(trial: Trial, size: float) -> tuple[str, set[str]]:
    give = 4e-7 * size
    structure(trial, LOWER_ARM, lambda force, moment: (STILL, np.array([give * moment[0], 0, 0])))
    return (f"lower arm twists about its length, {give:.1e} rad/N m", {"link_bending[2]", "bearing_tilt[2]", "bearing_tilt[3]"})


@cause
def foot_slides(trial: Trial, size: float) -> tuple[str, set[str]]:
    slide = 6e-5 * size
    most = largest_force(trial)

    def beyond(force: Array, moment: Array) -> tuple[Array, Array]:
        level = np.hypot(force[0], force[1])
        return np.array([force[0], force[1], 0]) / max(level, 1e-9) * max(0, level / most - 0.4) * slide, STILL

    structure(trial, BASE, beyond)
    return f"the foot slides {slide * 1e6 * 0.6:.0f} um once 40 % of the load is passed (comes back)", {"base_shift"}


@cause
def slab(trial: Trial, size: float) -> tuple[str, set[str]]:
    give, stand = 4e-8 * size, 0.4

    def see(read: Array, tool: Array, row: Row, force: Array) -> Array:
        tcp = tool[:3, 3]
        moment = np.cross(tcp, force)
        return read - stand * give * 1e6 * np.cross([moment[0], moment[1], 0], tcp - np.array([0, 0, -0.3]))

    structure(trial, BASE, lambda force, moment: (STILL, give * np.array([moment[0], moment[1], 0])))
    trial.sights.append(see)
    return (f"floor slab tilts under robot ({give:.1e}) and, 40 % of it, under the gauges' stand",
            {"base_rocking", "base_shift", "stand_compliance"})


@cause
def hose(trial: Trial, size: float) -> tuple[str, set[str]]:
    stiff = 0.25 * size * 1e6
    trial.holds.append(lambda tool, start, row: -stiff * (tool[:3, 3] - start[:3, 3]))
    return f"a stiff hose from tool to hall: {stiff / 1e3:.0f} N/mm held back", set()
