"""What the jury hides (jury_world.py): causes in the gears, the structure and the test, and slips of the table."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jury_arm import (
    Arm,
    Array,
    Creep,
    Element,
    Gear,
    HeldPlay,
    Robot,
    Row,
    Rubbing,
    Shaped,
    Slip,
    beam,
    cross,
    diagonal,
    linear,
    rotation,
)

G = 9.80665
Rng = np.random.Generator
Law = Callable[[Array, Row], Array]


@dataclass
class Load:
    """A row of the plan: where, what is written as the force [N], when [s]."""

    pose: str
    q: Array
    force: Array
    time: float
    since: float
    dwell: float


@dataclass
class Trial:
    """A robot of a kind, its tool [m], plan and instruments: sigma of a reading, of re-seating [m], of a force (share)."""

    robot: Robot
    stiffness: Array
    tool: Array
    design: str
    most: float
    reading: float
    seating: float
    share: float
    stated: bool
    worse: float
    rounded: bool
    weighed: bool
    loads: list[Load] = field(default_factory=list)


@dataclass
class Hidden:
    """What is hidden, by its size s in `span`: in the arm, the true or the written force, the readings, the table, the cell."""

    name: str
    place: str
    names: tuple[str, ...]  # what would be right, as effect or effect[joint]
    arm: Callable[[Arm, float], None] | None = None
    force: Callable[[Array, float, Load, Array], Array] | None = None  # written, size, load, written before -> true
    record: Callable[[Array, float, Load], Array] | None = None
    read: Callable[[Array, float, list[Load]], Array] | None = None
    point: Callable[[float], Array] | None = None  # (3, 3): where each sensor reads beside the TCP, in tool axes [m]
    table: Callable[[list[dict[str, str]]], None] | None = None
    cell: Array | None = None
    span: tuple[float, float] = (0.005, 1.0)


def levers(trial: Trial, q: Array) -> Array:
    """How the TCP moves with each spring, (6, 3) [m/rad], at rest."""
    arm = Arm(trial.robot, [Gear(0)] * 6, trial.tool)
    frames, _, tcp = arm.chain(Row(q, trial.robot.axes(q), np.zeros(3), 0, 0, 0, 1), np.zeros(6), [])
    out = np.array([cross(f[:3, 2], tcp[:3, 3] - f[:3, 3]) for f in frames])
    if trial.robot.rod:
        out = out * np.array(trial.robot.sense)[:, None]
        out[1] -= out[2]
    return out


def gear(j: int, make: Callable[[float, float], Gear]) -> Callable[[Arm, float], None]:
    """Change the gear of joint j: of its compliance and the size."""

    def change(arm: Arm, s: float) -> None:
        arm.gears[j] = make(arm.gears[j].compliance, s)

    return change


def structure(place: int, law: Callable[[float], Law], ahead: bool = False) -> Callable[[Arm, float], None]:
    """Let a place of the chain give way."""
    return lambda arm, s: arm.elements.append(Element(place, law(s), ahead))


def of_gear(kind: str, rng: Rng, trial: Trial) -> Hidden:
    """What a gear does that no spring does; of a joint that the loads turn."""
    most = np.array([[abs(levers(trial, x.q) @ x.force)] for x in trial.loads]).max((0, 1))
    felt = most**2 / trial.stiffness
    j = int(rng.choice(np.flatnonzero(felt > 0.05 * felt.max())))
    if kind == "strain wave":
        j = int(rng.integers(3, 6))
    t, b, sign, phase = most[j], rng.uniform(0, 1), float(rng.choice([-1, 1])), rng.uniform(0, 2 * np.pi)
    half, n = t / trial.stiffness[j], int(rng.integers(1, 4))

    def shaped(f: Callable[[float, float, Row], float]) -> Callable[[float, float], Gear]:
        return lambda c, s: Shaped(c, lambda x, row: f(s, x, row))

    def clip(x: float, most: float) -> float:
        return max(-most, min(most, x))

    makes: dict[str, tuple[Callable[[float, float], Gear], tuple[str, ...], tuple[float, float]]] = {
        "play": (shaped(lambda s, x, r: x + s * t * np.tanh(x / (t * (0.005 + 0.025 * b)))), ("backlash",), (0.003, 1)),
        "play held": (lambda c, s: HeldPlay(c, s * half, t * (0.03 + 0.12 * b)), ("backlash",), (0.003, 1)),
        "soft below": (shaped(lambda s, x, r: x + s * clip(x, t * (0.1 + 0.3 * b))), ("soft_zone",), (0.05, 3)),
        "strain wave": (shaped(lambda s, x, r: x + s * (clip(x, 0.14 * t) + clip(x, 0.48 * t) / 2)), ("soft_zone",), (0.05, 3)),
        "soft beyond": (shaped(lambda s, x, r: x + s * (x - clip(x, t * (0.3 + 0.4 * b)))), ("soft_beyond",), (0.05, 3)),
        "dry friction": (lambda c, s: Rubbing(c, 2 + 4 * b, s * t), ("hysteresis",), (0.01, 0.6)),
        "Dahl friction": (lambda c, s: Rubbing(c, 2 + 4 * b, s * t, smooth=True), ("hysteresis",), (0.01, 0.6)),
        "creep of a gear": (lambda c, s: Creep(c, s, 10 ** (1 + 1.2 * b)), ("gear_creep",), (0.02, 1)),
        "soft at angles": (shaped(lambda s, x, r: x * (1 + s * np.sin(n * r.theta[j] + phase))), ("uneven_gear",), (0.02, 0.6)),
        "one sign softer": (shaped(lambda s, x, r: x + s * max(x, 0)), ("one_sided",), (0.02, 1.5)),
        "slip": (lambda c, s: Slip(c, t * (0.4 + 0.4 * b), s), ("hysteresis",), (0.02, 3)),
        "softer with time": (shaped(lambda s, x, r: x * (1 + sign * s * r.time / r.span)), ("softening",), (0.02, 0.6)),
    }
    make, names, span = makes[kind]
    # The dictionary's family of gears that are softer near zero, and its name for a gear 2 that is uneven.
    names += tuple({"backlash": "soft_zone", "soft_zone": "backlash"}.get(x, "gravity_compensator") for x in names
                   if x in ("backlash", "soft_zone") or (x, j) == ("uneven_gear", 1))
    marks = tuple(x if x == "softening" else f"{x}[{j + 1}]" for x in names)
    return Hidden(kind, f"joint {j + 1}", marks, arm=gear(j, make), span=span)


def of_structure(kind: str, rng: Rng, trial: Trial) -> Hidden:
    """What gives way beside the gears."""
    f, r = trial.most, trial.robot
    tilt, slide = 2.5e-4 / f, 5e-4 / f
    j, angle = int(rng.choice([2, 3])), rng.uniform(0, 2 * np.pi)
    n = np.array([np.cos(angle), np.sin(angle), 0])
    about = np.zeros((6, 6))
    about[3:, 3:] = np.outer(n, n)
    wrist, a3, d4 = int(rng.choice([4, 5, 6])), r.a3 / 1000, r.d4 / 1000
    pair = [(4, 5), (3, 4), (3, 5)][int(rng.integers(3))]

    def lower(s: float) -> Callable[[Array, Row], Array]:
        tip, at = beam(0, a3, a3 / (s * tilt)), np.array([a3, 0, 0])

        def law(wrench: Array, row: Row) -> Array:
            u = tip(np.concatenate([wrench[:3], wrench[3:] - cross(at, wrench[:3])]), row)
            return np.concatenate([u[:3] - cross(u[3:], at), u[3:]])

        return law

    def couple(arm: Arm, s: float) -> None:
        arm.coupling = (*pair, s * float(np.sqrt(arm.gears[pair[0]].compliance * arm.gears[pair[1]].compliance)))

    def play(s: float) -> Callable[[Array, Row], Array]:
        return lambda w, row: np.append(s * 2e-4 * np.tanh(w[:3] / (0.1 * f)) * [1, 1, 0], np.zeros(3))

    def lifts(s: float) -> Callable[[Array, Row], Array]:
        return lambda w, row: np.append(np.zeros(3), n * s * tilt * max(float(n @ w[3:]), 0.0))

    def rod(arm: Arm, s: float) -> None:
        c = arm.gears[2].compliance
        arm.gears[2] = Shaped(c, lambda x, row: x * (1 + s / max(np.cos(np.radians(row.q[2] - row.q[1])) ** 2, 0.1)))

    spring = gear(1, lambda c, s: Shaped(c, lambda x, row: x / (1 + s * (np.cos(row.theta[1] + np.pi / 2 - angle / 9) - 0.8))))
    flange = ("force_sensor_compliance", "bearing_tilt[6]")
    kinds: dict[str, tuple[Callable[[Arm, float], None], tuple[str, ...]]] = {
        "gas spring": (spring, ("gravity_compensator", "uneven_gear[2]")),
        "wrist coupled": (couple, ("wrist_coupling",)),
        "rod": (rod, ("parallelogram", "uneven_gear[3]")),
        "bearing of axis 1": (structure(1, lambda s: diagonal(0, 0, 0, s * tilt, s * tilt, 0)), ("bearing_tilt[1]",)),
        "bearing": (structure(j, lambda s: diagonal(0, 0, 0, s * tilt, s * tilt, 0)), (f"bearing_tilt[{j}]",)),
        "lower arm": (structure(2, lower), ("link_bending[2]",)),
        "forearm": (structure(4, lambda s: beam(2, d4, d4 / (s * tilt)), True), ("link_bending[3]",)),
        "bearing in the wrist": (structure(wrist, lambda s: diagonal(0, 0, 0, s * 4 * tilt, s * 4 * tilt, 0)),
                                 flange if wrist == 6 else (f"bearing_tilt[{wrist}]",)),
        "pedestal": (structure(0, lambda s: diagonal(0, 0, 0, s * tilt, s * tilt, 0)), ("base_rocking",)),
        "pedestal, one way": (structure(0, lambda s: linear(s * tilt * about)), ("base_rocking",)),
        "base lifts": (structure(0, lifts), ("base_rocking",)),
        "base slides": (structure(0, lambda s: diagonal(s * slide, s * slide, 0, 0, 0, 0)), ("base_shift",)),
        "base has play": (structure(0, play), ("base_shift",)),
        "spindle sideways": (structure(7, lambda s: diagonal(s * slide, s * slide, 0, 0, 0, 0)), ("spindle_compliance",)),
        "spindle along": (structure(7, lambda s: diagonal(0, 0, s * slide, 0, 0, 0)), ("spindle_compliance",)),
        "flange": (structure(6, lambda s: diagonal(0, 0, 0, s * 8 * tilt, s * 8 * tilt, 0)), flange),
        "force sensor": (structure(6, lambda s: diagonal(*(s * 0.4 * slide,) * 3, *(s * 6 * tilt,) * 3)), flange),
    }  # fmt: skip
    change, names = kinds[kind]
    place = f"joint {j}" if kind == "bearing" else kind
    return Hidden(kind, place, names, arm=change, span=(0.005, 3 if kind in ("gas spring", "rod") else 1))


def of_test(kind: str, rng: Rng, trial: Trial) -> Hidden:
    """What the load test itself brings in."""
    a, sign = int(rng.integers(3)), float(rng.choice([-1, 1]))
    b, unit = (a + 1 + int(rng.integers(2))) % 3, np.eye(3)
    v = rng.normal(size=3)
    v /= np.linalg.norm(v)
    mix = np.zeros((3, 3))
    mix[b, a] = sign
    late, sine, begin = rng.uniform(0.15, 0.4), rng.uniform(900, 2400), int(rng.uniform(0.2, 0.8) * len(trial.loads))
    contact, apart = rng.normal(size=(3, 3)) * 0.25 * (1 - unit), rng.normal(size=(3, 3))

    def clock(f: Callable[[Array, float], Array]) -> Callable[[Array, float, list[Load]], Array]:
        def read(d: Array, s: float, loads: list[Load]) -> Array:
            t, zero, end = np.array([x.time for x in loads]), np.array([x.since for x in loads]), loads[-1].time
            return d + np.outer(f(t, end) - f(zero, end), v) * s * 1e-3

        return read

    def stick(d: Array, s: float, loads: list[Load]) -> Array:
        out, at, pose = d.copy(), 0.0, ""
        for n, load in enumerate(loads):
            at, pose = (0.0 if load.pose != pose else at), load.pose
            at = float(np.clip(at, d[n, a] - s * 1e-4, d[n, a] + s * 1e-4))
            out[n, a] = at
        return out

    def bump(d: Array, s: float, loads: list[Load]) -> Array:
        hit = np.array([n >= begin and x.pose == loads[begin].pose for n, x in enumerate(loads)])
        return d + np.outer(hit, v) * s * 1e-3

    def longer(f: Array, by: float) -> Array:
        norm = float(np.linalg.norm(f))
        return f * (1 + by / norm) if norm > 1e-9 else f

    def beside(attribute: str) -> Callable[[Arm, float], None]:
        return lambda arm, s: setattr(arm, attribute, v * s * 0.1)

    H = Hidden
    point = ("tool_point", "hook_offset")
    kinds: dict[str, Callable[[], Hidden]] = {
        "force gain": lambda: H(kind, "xyz"[a], ("force_axis_gain",), force=lambda f, s, x, o: f / (1 + sign * s * unit[a])),
        "force cross-talk": lambda: H(kind, "xyz"[a], ("force_crosstalk", "force_misalignment"),
                                      force=lambda f, s, x, o: f - s * mix @ f),
        "force turned": lambda: H(kind, "xyz"[a], ("force_misalignment",), force=lambda f, s, x, o: rotation(s * unit[a]) @ f),
        "force zero": lambda: H(kind, "", ("force_offset",), record=lambda f, s, x: f + v * s * trial.most),
        "load beside the TCP": lambda: H(kind, "tool", point, arm=beside("beside_tool"), span=(0.02, 1.5)),
        "load on a hook": lambda: H(kind, "base", point, arm=beside("beside_base"), span=(0.02, 1.5)),
        "pulley": lambda: H(kind, "", ("load_friction",), force=lambda f, s, x, o: f * (1 - s if f @ f >= o @ o else 1 + s)),
        "hook's weight": lambda: H(kind, "", ("hook_weight",), force=lambda f, s, x, o: longer(f, s * 0.3 * trial.most)),
        "reading turned": lambda: H(kind, "xyz"[a], ("deflection_sensor_rotation",),
                                    read=lambda d, s, x: d @ rotation(s * unit[a]).T),
        "reading gain": lambda: H(kind, "xyz"[a], ("deflection_sensor_gain",),
                                  read=lambda d, s, x: d * (1 + sign * s * unit[a])),
        "gauge sticks": lambda: H(kind, "xyz"[a], ("gauge_friction",), read=stick),
        "stand": lambda: H(kind, "", ("stand_compliance", "base_shift"),
                           read=lambda d, s, x: d + s * 3e-4 / trial.most * np.array([y.force for y in x])),
        "drift": lambda: H(kind, "", ("drift",), read=clock(lambda t, end: t / end)),
        "warming up": lambda: H(kind, "", ("drift",), read=clock(lambda t, end: 1 - np.exp(-t / (late * end)))),
        "day and night": lambda: H(kind, "", ("drift",), read=clock(lambda t, end: 0.5 * np.sin(2 * np.pi * t / sine + a))),
        "bump": lambda: H(kind, f"row {begin + 1}", ("sensor_step",), read=bump),
        "reflector beside the TCP": lambda: H(kind, "", ("reading_point",), point=lambda s: np.tile(v * s * 0.15, (3, 1)),
                                              span=(0.02, 1)),
        "gauges beside the TCP": lambda: H(kind, "", ("reading_point",), point=lambda s: apart * s * 0.1, span=(0.02, 1)),
        "round target": lambda: H(kind, "", ("target_curvature", "deflection_sensor_crosstalk"),
                                  read=lambda d, s, x: d + s * (d @ contact.T + (d**2) @ (1 - unit) / 0.024), span=(0.02, 1)),
    }  # fmt: skip
    return kinds[kind]()


def of_table(kind: str, rng: Rng, trial: Trial) -> Hidden:
    """A slip of whoever wrote the table or the cell file; `names` are the mistakes that would be right."""
    a, j, sign = int(rng.integers(3)), int(rng.integers(6)), float(rng.choice([-1, 1]))
    poses = list(dict.fromkeys(x.pose for x in trial.loads))
    one, two = (str(x) for x in rng.choice(poses, 2, replace=False))
    late, axis, step = set(poses[len(poses) // 2 :]), "xyz"[a], float(rng.choice([10, 20, 40]))

    def angles(change: Callable[[dict[str, str]], None]) -> Callable[[list[dict[str, str]]], None]:
        def write(table: list[dict[str, str]]) -> None:
            for row in table:
                change(row)

        return write

    def add(row: dict[str, str], joint: int, by: float, factor: float = 1.0) -> None:
        row[f"q{joint + 1}_deg"] = f"{factor * float(row[f'q{joint + 1}_deg']) + by:.3f}"

    def exchange(table: list[dict[str, str]]) -> None:
        for row, other in zip([x for x in table if x["pose"] == one], [x for x in table if x["pose"] == two], strict=False):
            for c in (f"q{i}_deg" for i in range(1, 7)):
                row[c], other[c] = other[c], row[c]

    H, unit = Hidden, np.eye(3)
    kinds: dict[str, Callable[[], Hidden]] = {
        "sign of a force": lambda: H(kind, axis, (f"force_sign[{axis}]",), record=lambda f, s, x: f * (1 - 2 * unit[a])),
        "columns exchanged": lambda: H(kind, "yz", ("deflection_swapped",), read=lambda d, s, x: d[:, [0, 2, 1]]),
        "TCP": lambda: H(kind, axis, ("tcp",), cell=unit[a] * sign * rng.uniform(0.06, 0.2)),
        "zero of a joint": lambda: H(kind, f"{j + 1}", (f"joint_zero[{j + 1}]",),
                                     table=angles(lambda r: add(r, j, sign * step / 5))),
        "sense of a joint": lambda: H(kind, f"{j + 1}", (f"joint_sign[{j + 1}]",), table=angles(lambda r: add(r, j, 0, -1))),
        "angle of one pose": lambda: H(kind, one, ("bad_visit",),
                                       table=angles(lambda r: add(r, j, step if r["pose"] == one else 0))),
        "poses exchanged": lambda: H(kind, f"{one} {two}", ("bad_visit", "poses"), table=exchange),
        "kilograms in the second half": lambda: H(kind, "", ("force_unit",),
                                                  record=lambda f, s, x: f / G if x.pose in late else f),
    }
    return kinds[kind]()


EFFECTS = {
    of_gear: ("play", "play held", "soft below", "strain wave", "soft beyond", "dry friction", "Dahl friction",
              "creep of a gear", "soft at angles", "one sign softer", "slip", "softer with time"),
    of_structure: ("gas spring", "wrist coupled", "rod", "bearing of axis 1", "bearing", "lower arm", "forearm",
                   "bearing in the wrist", "pedestal", "pedestal, one way", "base lifts", "base slides", "base has play",
                   "spindle sideways", "spindle along", "flange", "force sensor"),
    of_test: ("force gain", "force cross-talk", "force turned", "force zero", "load beside the TCP", "load on a hook", "pulley",
              "hook's weight", "reading turned", "reading gain", "gauge sticks", "stand", "drift", "warming up",
              "day and night", "bump", "reflector beside the TCP", "gauges beside the TCP", "round target"),
}  # fmt: skip
MISTAKES = ("sign of a force", "columns exchanged", "TCP", "zero of a joint", "sense of a joint", "angle of one pose",
            "poses exchanged", "kilograms in the second half")  # fmt: skip
REMEMBERS = {"play", "play held", "dry friction", "Dahl friction", "creep of a gear", "slip", "pulley", "gauge sticks",
             "soft below"}  # fmt: skip
