"""Asks the program about the sixth world's cases: `python benchmarks/sixth_judge.py FOLDER [FIRST LAST]`.

One line a case: what was hidden, by how many sigmas it shows, how good the answer is, and how many of the six true stiffnesses
lie in its 95 % intervals. RIGHT and HALF were written after the world was frozen, from the program's own words for its names,
and before any answer was seen.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.fifth_judge import asked, name_of

# `@` asks for the place that was hidden; a name without brackets is right whatever stands in them; UNKNOWN: it has no name.
UNKNOWN = "unknown"
RIGHT: dict[str, tuple[str, ...]] = {
    "lash": ("backlash@",),
    "lost_motion": ("soft_zone@",),
    "gear_friction": ("hysteresis@",),
    "worn_sector": ("uneven_gear@", "gravity_compensator"),
    "brake_slips": (UNKNOWN, "bad_visit", "gear_softening@"),  # arguable: one visit, one gear, once
    "creep": ("gear_creep@",),
    "warming_gears": ("softening",),
    "comes_loose": ("gear_softening@",),
    "soft_servo": (UNKNOWN, "bad_visit"),
    "forearm_bends": ("link_bending[3]",),
    "lower_arm_twists": ("link_bending[2]",),
    "slew_bearing": ("bearing_tilt[1]", "base_rocking"),  # the same motion, for its pivot is in the foot
    "wrist_bearing": ("bearing_tilt[5]",),
    "pedestal": ("base_rocking",),
    "anchor_lifts": ("base_rocking",),
    "track_carriage": ("base_shift", "base_rocking"),  # it does both
    "spindle_bearings": ("spindle_compliance",),
    "sensor_behind_spindle": ("force_sensor_compliance",),
    "flange_screws": ("tool_play",),
    "hose_package": (UNKNOWN,),
    "tool_touches": (UNKNOWN, "bad_visit"),
    "sensors_turned": ("deflection_sensor_rotation",),
    "stand_yields": ("stand_compliance", "base_shift"),  # one to any load test, the manual says
    "gauge_scale": ("deflection_sensor_gain",),
    "gauge_sticks": ("gauge_friction",),
    "round_target": ("target_curvature",),
    "knocked": ("sensor_step",),
    "end_of_travel": ("readings_clipped",),
    "reflector_beside": ("reading_point",),
    "zero_once": ("drift",),
    "sun_on_the_arm": ("drift",),
    "stand_creeps": ("sensor_step", "drift"),  # arguable: it seats after each zero
    "noisy_hour": (UNKNOWN, "bad_visit"),
    "cell_zero": ("force_offset", "hook_weight", "force_curve"),  # arguable: newtons along the line, either way
    "hook_uncounted": ("hook_weight",),
    "out_of_plumb": ("force_misalignment", "force_crosstalk", "side_load"),
    "pulley": ("load_friction",),
    "seal_friction": ("load_friction",),
    "hook_beside": ("tool_point", "hook_offset"),
    "mislabelled_weight": ("hook_weight",),
    "one_load": ("sensor_step", "bad_visit"),
    "crosstalk": ("force_crosstalk", "force_misalignment", "side_load"),
    "gain_drifts": ("softening",),  # the manual: or a force measurement whose gain wanders
    "zero_forgotten": ("bad_visit", "readings_raw"),
    "kilograms": ("bad_visit", "force_unit"),
    "gauge_sign": ("deflection_sign@",),
    "gauges_swapped": ("deflection_swapped",),
    "decimal_slip": ("sensor_step", "bad_visit"),
    "rows_swapped": ("bad_visit", "sensor_step"),
    "angle_sign": ("bad_visit",),
    "poses_exchanged": ("bad_visit", "joints_slipped"),
    "tool_length": ("tcp",),
    "tool_turned": ("tcp",),
    "forces_in_the_work_object": ("force_misalignment", "force_frame"),
    "reaction": ("bad_visit", "force_sign"),
    "serial_angle": ("joint_coupling",),
    "copied_visit": ("bad_visit", "readings_slipped"),
    "tool_frame_readings": ("deflection_frame",),
    "increments": ("readings_stepwise",),
    "mastering": ("joint_zero@", "encoder_zero@"),
    "longer_arm": (UNKNOWN, "robot"),
}
# Names that lead to the right place, tell a part of it, or imitate it.
HALF: dict[str, tuple[str, ...]] = {
    "lash": ("soft_zone@",),
    "lost_motion": ("backlash@", "soft_gears"),
    "gear_friction": ("lost_motion",),
    "brake_slips": ("sensor_step", "hysteresis@"),
    "creep": ("creep",),
    "warming_gears": ("gear_softening",),
    "comes_loose": ("softening",),
    "soft_servo": ("softening",),
    "lower_arm_twists": ("link_bending",),
    "forearm_bends": ("link_bending",),
    "pedestal": ("bearing_tilt[1]",),
    "anchor_lifts": ("bearing_tilt[1]",),
    "wrist_bearing": ("bearing_tilt", "force_sensor_compliance"),
    "spindle_bearings": ("force_sensor_compliance",),
    "sensor_behind_spindle": ("spindle_compliance", "bearing_tilt[6]"),
    "sensors_turned": ("deflection_sensor_crosstalk", "force_misalignment"),
    "gauge_scale": ("deflection_sensor_crosstalk", "force_axis_gain"),
    "gauge_sticks": ("hysteresis", "lost_motion"),
    "knocked": ("bad_visit",),
    "reflector_beside": ("tool_point", "tcp"),
    "zero_once": ("encoder_zero",),
    "sun_on_the_arm": ("encoder_zero",),
    "stand_creeps": ("creep", "gear_creep"),
    "hook_uncounted": ("force_offset", "force_curve"),
    "out_of_plumb": ("deflection_sensor_rotation",),
    "crosstalk": ("deflection_sensor_rotation",),
    "hook_beside": ("tcp", "reading_point"),
    "mislabelled_weight": ("force_curve", "force_offset"),
    "gain_drifts": ("gear_softening",),
    "zero_forgotten": ("sensor_step",),
    "tool_length": ("tool_point", "reading_point"),
    "tool_turned": ("tool_point", "reading_point"),
    "forces_in_the_work_object": ("joint_zero[1", "deflection_sensor_rotation"),
    "longer_arm": ("tcp",),
    "serial_angle": ("joint_zero[3",),
    "hose_package": ("load_friction",),
    "tool_touches": ("sensor_step",),
}


def meets(name: str, wanted: tuple[str, ...], place: str) -> bool:
    """Whether a name is one of those wanted: at the place where one is asked for."""
    bare = name.partition("[")[0].partition("!")[0].partition(".")[0]
    for one in wanted:
        if one.endswith("@"):
            if bare == one[:-1] and f"[{place}" in name:
                return True
        elif name.startswith(one) if "[" in one else bare == one:
            return True
    return False


def judged(truth: dict[str, Any], result: dict[str, Any]) -> tuple[str, list[str]]:
    """How good an answer is, and the names in it."""
    verdict, hidden, place = result["verdict"], truth["cause"], truth["place"]
    names = [name_of(cause) for cause in (result["mistakes"] if verdict == "mistake" else result["causes"])]
    left = [name_of(part) for one in [*result["alternatives"], *result["mistakes"]] for part in one.get("causes", [one])]
    if hidden == "nothing":
        return ("quiet" if verdict == "adequate" and not names else "alarm"), names or left
    right, half = RIGHT[hidden], HALF.get(hidden, ())
    if names:
        hits = [meets(name, right, place) for name in names]
        near = any(hits) or any(meets(name, (*half, *(one.rstrip("@") for one in right)), place) for name in names)
        return ("right" if all(hits) else "half" if near else "wrong"), names
    if verdict == "ambiguous":
        near = any(meets(name, half, place) for name in left)
        return (
            "set with the truth"
            if any(meets(name, right, place) for name in left)
            else "set, half"
            if near
            else "set without"
        ), left
    if verdict == "adequate":
        return "missed", left
    return ("right (unknown)" if UNKNOWN in right else "unknown"), left


def held(folder: Path, truth: dict[str, Any]) -> str:
    """How many true stiffnesses lie in the stated intervals."""
    file = folder / "stiffness.json"
    if not file.exists():
        return "-"
    told = {one["name"]: one["interval_95"] for one in json.loads(file.read_text(encoding="utf-8"))["parameters"]}
    out = [f"k{j}" for j, k in enumerate(truth["stiffness"], 1) if not told[f"k{j}"][0] <= k <= told[f"k{j}"][1]]
    return f"{6 - len(out)}/6" + (" not " + " ".join(out) if out else "")


def main(folder: Path, first: int, last: int) -> None:
    counts: Counter[str] = Counter()
    for case in sorted(one for one in folder.iterdir() if one.is_dir() and first <= int(one.name) <= last):
        truth = json.loads((case / "truth.json").read_text(encoding="utf-8"))
        answer = asked(case)
        result = answer.get("result") or {}
        if "verdict" in result:
            grade, names = judged(truth, result)
        else:
            grade, names = (
                f"exit {answer['exit_code']}",
                [f"{one['code']} {one.get('message', '')[:40]}" for one in answer["findings"]],
            )
        counts[grade] += 1
        hidden = truth["cause"] + (f"[{truth['place']}]" if truth["place"] else "")
        print(
            f"{case.name} {hidden:26} {truth['sigma']:6.1f} sigma  {grade:18} {result.get('verdict', ''):9} "
            f"{', '.join(names[:4])[:100]}  k {held(case, truth)}",
            flush=True,
        )
    print(", ".join(f"{grade} {count}" for grade, count in counts.most_common()))


if __name__ == "__main__":
    main(Path(sys.argv[1]), *(int(value) for value in (sys.argv[2:4] or (0, 10**6))))
