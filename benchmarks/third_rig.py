"""What the third judge hides in loads and gauges (third_world.py)."""

from __future__ import annotations

import numpy as np

from benchmarks.third_arm import DEGREE, length, rotation
from benchmarks.third_causes import largest_force, one_visit
from benchmarks.third_gears import Array
from benchmarks.third_trial import Hide, Row, Trial, into

CAUSES: dict[str, Hide] = {}
cause = into(CAUSES)


# ------------------------------------------------------------------ loads
def along(row: Row) -> Array:
    """The direction of a row's force; nothing where there is none."""
    return row.force / max(length(row.force), 1e-9)


def way(row: Row, before: Array) -> float:
    """1 where the load grows, -1 where it is taken off."""
    return float(np.sign(length(row.force) - length(before)))


@cause
def load_off(trial: Trial, size: float) -> tuple[str, set[str]]:
    trial.beside = np.array([trial.rng.choice([-1, 1]) * 0.06, 0.03, -0.05]) * size
    return f"loads act off the TCP by {np.round(trial.beside * 1e3)} mm (tool)", {"tool_point"}


@cause
def pulley(trial: Trial, size: float) -> tuple[str, set[str]]:
    share = 0.05 * size
    trial.pulls.append(lambda force, row, before: force * (1 - share * way(row, before)) if row.mass is None else force)
    return f"rope over a pulley: -+{share:.3f} of the load on the way up/down", {"load_friction"}


@cause
def seal(trial: Trial, size: float) -> tuple[str, set[str]]:
    held = 0.06 * size * largest_force(trial)
    trial.pulls.append(lambda force, row, before: force - held * way(row, before) * along(row))
    return (f"cylinder's seal: {held:.0f} N less on the way up, more on the way down (not at zero)",
            {"load_friction", "force_offset", "hook_weight"})


@cause
def seal_sticks(trial: Trial, size: float) -> tuple[str, set[str]]:
    held = 0.05 * size * largest_force(trial)

    def pull(force: Array, row: Row, before: Array) -> Array:
        if row.loaded:
            trial.seen["pushed"] = along(row)
        pushed: Array = trial.seen.get("pushed", np.zeros(3))
        return force - held * way(row, before) * pushed

    trial.pulls.append(pull)
    return (f"cylinder's seal: -+{held:.0f} N, and it keeps {held:.0f} N on the robot after unloading to 'zero'",
            {"load_friction", "force_offset"})


@cause
def rod_side(trial: Trial, size: float) -> tuple[str, set[str]]:
    share = 1 - 0.3 * size
    trial.pulls.append(lambda force, row, before: force * share if row.force.sum() < 0 else force)
    return f"hydraulic cylinder: pulls have the ring's area, force {share:.2f} of the written", {"force_curve"}


@cause
def manometer(trial: Trial, size: float) -> tuple[str, set[str]]:
    most, share = largest_force(trial), 0.15 * size
    trial.pulls.append(lambda force, row, before: force * (1 + share * (length(force) / most - 0.5)))
    return f"manometer not linear: F (1 + {share:.3f} (F/Fmax - 0.5))", {"force_curve"}


@cause
def pretension(trial: Trial, size: float) -> tuple[str, set[str]]:
    taut = 0.12 * size * largest_force(trial)
    trial.pulls.append(lambda force, row, before: force - taut * along(row))
    return f"a rope that was taut with {taut:.0f} N at the zero reading, scale shows the whole", {"hook_weight", "force_offset"}


@cause
def relaxes(trial: Trial, size: float) -> tuple[str, set[str]]:
    share = 0.06 * size
    trial.pulls.append(lambda force, row, before: force * (1 - share * (way(row, before) > 0)))
    return f"force written at once, gauges read when it had relaxed by {share:.3f} (way up only)", {"load_friction"}


@cause
def rope_askew(trial: Trial, size: float) -> tuple[str, set[str]]:
    turn = np.array([2.0, -1.5, 2.0]) * size * DEGREE
    trial.pulls.append(lambda force, row, before: rotation(turn) @ force)
    return (f"loads turned by {np.round(turn / DEGREE, 1)} deg about base axes",
            {"force_misalignment", "deflection_sensor_rotation"})


@cause
def plate_holds(trial: Trial, size: float) -> tuple[str, set[str]]:
    stiff = 0.3e6 * size

    def hold(tool: Array, start: Array, row: Row) -> Array:
        moved = tool[:3, 3] - start[:3, 3]
        return -stiff * (moved - along(row) * (along(row) @ moved)) if row.loaded else np.zeros(3)

    trial.holds.append(hold)
    return f"cylinder's foot holds the tool sideways: {stiff / 1e3:.0f} N/mm across the load", {"side_load"}


# ------------------------------------------------------------------ gauges, trackers
@cause
def abbe(trial: Trial, size: float) -> tuple[str, set[str]]:
    points = np.array([[0.05, 0.04, -0.06], [-0.05, 0.06, 0.05], [0.06, -0.05, 0.04]]) * size

    def see(read: Array, tool: Array, row: Row, force: Array) -> Array:
        turned = (tool[:3, :3] @ trial.start[:3, :3].T - np.eye(3)) * 1e6
        off: Array = (turned * points).sum(axis=1)
        return read + off

    trial.sights.append(see)
    return f"each gauge touches elsewhere: {np.round(points * 1e3).tolist()} mm off the TCP, base axes", {"reading_point"}


@cause
def reflector(trial: Trial, size: float) -> tuple[str, set[str]]:
    point = np.array([0.1, -0.06, -0.08]) * size
    trial.sights.append(lambda read, tool, row, force: read + (tool[:3, :3] - trial.start[:3, :3]) @ point * 1e6)
    return f"reflector sits {np.round(point * 1e3)} mm (tool) off the TCP", {"reading_point"}


@cause
def stand_gives(trial: Trial, size: float) -> tuple[str, set[str]]:
    give = np.array([3e-8, 3e-8, 1.5e-8]) * size
    trial.sights.append(lambda read, tool, row, force: read + 1e6 * give * force)
    return (f"gauges' stand on the plate that the cylinder reacts on: reads {np.round(give * 1e9, 1)} nm/N more",
            {"stand_compliance"})


@cause
def sticky_gauges(trial: Trial, size: float) -> tuple[str, set[str]]:
    play = 10 * size

    def see(read: Array, tool: Array, row: Row, force: Array) -> Array:
        stuck: Array = np.clip(trial.seen.get("stuck", np.zeros(3)), read - play, read + play)
        trial.seen["stuck"] = stuck
        return stuck

    trial.sights.append(see)
    return f"gauges stick by {play:.1f} um", {"gauge_friction"}


@cause
def gauge_gears(trial: Trial, size: float) -> tuple[str, set[str]]:
    error = 8 * size
    trial.sights.append(lambda read, tool, row, force: read + error * (np.sin(read / 100 * np.pi + 1) - np.sin(1)))
    return f"dial's pitch error {error:.1f} um, every 0.2 mm", set()


@cause
def end_of_travel(trial: Trial, size: float) -> tuple[str, set[str]]:
    end = np.max(np.abs(trial.readings(quiet=True))) * (1 - 0.5 * size)
    trial.sights.append(lambda read, tool, row, force: np.clip(read, -end, end))
    return f"gauges end at +-{end:.0f} um", {"*"}


@cause
def sun(trial: Trial, size: float) -> tuple[str, set[str]]:
    far, ends = np.array([40, 25, -30]) * size, trial.rng.random() < .5

    def see(read: Array, tool: Array, row: Row, force: Array) -> Array:
        since = row.time - trial.seen.setdefault("zeroed", row.time)
        return read + far * float(1 - np.exp(-since / 120) if ends else since / 300)

    trial.sights.append(see)
    return f"drift after each zero: {far} um {'(1-exp(-t/120 s))' if ends else 'in 300 s'}", {"drift"}


@cause
def knocked(trial: Trial, size: float) -> tuple[str, set[str]]:
    visit, gauge = one_visit(trial), int(trial.rng.integers(3))
    first = next(i for i, row in enumerate(trial.rows) if row.visit == visit) + 3
    since, step = trial.rows[first].time, 60 * size * np.eye(3)[gauge]
    trial.sights.append(lambda read, tool, row, force: read + step * (row.visit == visit and row.time >= since))
    return (f"gauge {'xyz'[gauge]} knocked by {60 * size:.0f} um from row {first + 1} to the end of visit {visit + 1}",
            {"sensor_step", "bad_visit", "*"})


@cause
def hook_plate(trial: Trial, size: float) -> tuple[str, set[str]]:
    slips = np.array([25.0, -20, 15]) * size

    def see(read: Array, tool: Array, row: Row, force: Array) -> Array:
        if row.loaded:
            trial.seen["slipped"] = slips
        slipped: Array = trial.seen.get("slipped", np.zeros(3))
        return read + slipped

    trial.sights.append(see)
    return f"target slips by {slips} um at the first load of each visit, and stays", {"sensor_step"}


@cause
def gauge_cosine(trial: Trial, size: float) -> tuple[str, set[str]]:
    lean = np.array([8.0, -6, 7]) * size * DEGREE
    trial.sights.append(lambda read, tool, row, force: read * np.cos(lean) + np.sin(lean) * np.roll(read, 1))
    return (f"gauges lean by {np.round(lean / DEGREE, 1)} deg: each reads sin of the next axis",
            {"deflection_sensor_crosstalk", "deflection_sensor_rotation", "deflection_sensor_gain"})
