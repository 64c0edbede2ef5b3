"""What `diagnose` says of the load tests that fourth_world.py wrote:

    python benchmarks/fourth_judge.py FOLDER [FIRST LAST]

Judged as the third judge's (third_world.py), by what the fourth judge said beforehand would be right, put into the
dictionary's names. {j} stands for the joint that the case's truth.json tells; "*" for any mistake that is named.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.third_world import diagnosed, intervals, judged

RIGHT: dict[str, str] = {
    "harmonic_three_slopes": "soft_zone[{j}]", "lost_motion": "soft_zone[{j}] backlash[{j}]", "free_play": "backlash[{j}]",
    "bouc_wen": "hysteresis[{j}]", "friction_iwan": "hysteresis[2]", "hysteresis_all": "hysteresis lost_motion",
    "stiffness_by_angle": "uneven_gear[{j}]", "worn_teeth": "uneven_gear[{j}]", "wrist_coupling": "wrist_coupling",
    "belt_creep": "gear_creep[{j}]", "belt_one_way": "one_sided[{j}]", "power_law": "", "brake_slip": "soft_beyond[{j}]",
    "servo_recovers": "gear_creep[{j}]", "warming": "softening", "crash": "gear_softening[{j}]", "rod_elastic": "parallelogram",
    "rocking_base": "base_rocking", "loose_bolt": "base_rocking", "soft_platform": "base_rocking base_shift",
    "carriage": "base_rocking", "column_bearing": "base_rocking bearing_tilt[1]", "elbow_bearing": "bearing_tilt[3]",
    "lower_arm_beam": "link_bending[2]", "forearm_beam": "link_bending[3]",
    "flange_bearing": "bearing_tilt[6] force_sensor_compliance", "force_sensor_soft": "bearing_tilt[6] force_sensor_compliance",
    "tool_beam": "spindle_compliance", "spindle_radial": "spindle_compliance", "changer_play": "tool_play",
    "changer_opens": "", "touches": "bad_visit", "bracket_turned": "deflection_sensor_rotation",
    "gauge_leans": "deflection_sensor_crosstalk", "gauge_gain": "deflection_sensor_gain", "round_target": "target_curvature",
    "reflector_beside": "reading_point", "stand_yields": "stand_compliance base_shift", "gauge_sticky": "gauge_friction",
    "gauge_range": "*", "stand_warms": "drift", "arm_grows": "drift", "tripod_turns": "drift", "hall_temperature": "drift",
    "stand_bumped": "sensor_step", "someone_stands": "bad_visit", "load_turned": "force_misalignment",
    "load_axis_gain": "force_axis_gain", "load_curved": "force_curve", "off_the_tcp": "tool_point", "pulley_friction":
    "load_friction", "cable_askew": "force_misalignment", "pan_forgotten": "hook_weight force_offset", "second_disc_wrong":
    "* bad_visit hook_weight",
    "cylinder_leaks": "load_leak", "sensor_crosstalk": "force_crosstalk", "base_not_level": "force_misalignment",
    "payload_compensation": "force_axis_gain", "load_cell_offset": "force_offset", "pose_typo": "* bad_visit",
    "digit_slip": "* bad_visit sensor_step", "millimetres": "* bad_visit", "copied_visit": "* bad_visit",
    "decanewton": "* bad_visit", "force_sign_some": "* bad_visit", "rows_swapped": "* bad_visit sensor_step",
    "sign_from_visit": "*", "columns_swapped": "*", "world_frame": "* deflection_sensor_rotation", "shifted_visits": "*",
    "angle_sign": "*", "serial_angles": "*", "moment_at_flange": "* tool_point", "wrong_tool": "* tool_point",
    "wrong_robot": "*", "mastering": "* encoder_zero[{j}]", "nothing": "adequate"}


def case(folder: Path) -> tuple[str, list[bool]]:
    """What the answer to a load test is worth, and which of its intervals hold."""
    truth = json.loads((folder / "truth.json").read_text())
    right = set(RIGHT[truth["name"]].format(j=truth["joint"]).split())
    answer, code, first = diagnosed(folder)
    mark, said = ((f"exit {code}" if code != 1 else "refused"), first) if answer is None else judged(
        [truth["name"]], [right], truth["visible"], answer)
    held = intervals(folder, truth["stiffness_nm_per_rad"], answer)
    print(f"{folder.name} {truth['name']} {truth['joint']} {truth['design']} {truth['robot']}, {truth['visible']:.0f} sigma | "
          f"{mark} | {said} | k in {sum(held)}/{len(held)}", flush=True)
    return mark, held


def main() -> None:
    root, *place = sys.argv[1:]
    folders = sorted(each for each in Path(root).iterdir() if (each / "truth.json").exists())
    first, last = map(int, place) if place else (0, len(folders))
    marks, held = Counter[str](), []
    for folder in folders[first:last]:
        mark, inside = case(folder)
        marks[mark] += 1
        held += inside
    print("\n".join(f"{count:5} {mark}" for mark, count in marks.most_common()))
    print(f"intervals: {sum(held)} of {len(held)}")


if __name__ == "__main__":
    main()
