"""Asks the program about the fifth judge's cases: `python benchmarks/fifth_judge.py FOLDER [FIRST LAST]`.

One line a case: what was hidden, by how many sigmas it shows, what was answered, and how many of the six true stiffnesses lie
in the answer's 95 % intervals. RIGHT was written after the simulation, from the program's own words for its names.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

# A name is an effect or a mistake's key; `@` asks for the joint that was hidden, `!` for the pose.
RIGHT: dict[str, tuple[str, ...]] = {
    "backlash": ("backlash@",), "friction_loop": ("hysteresis@",), "soft_at_zero": ("soft_zone@",),
    "one_sided": ("one_sided@",), "tooth_ripple": ("uneven_gear@", "gravity_compensator"),
    "creep": ("gear_creep@",), "wrist_cross": ("wrist_coupling",),
    "gears_warm_up": ("softening",), "base_rocking": ("base_rocking",), "base_shift": ("base_shift",),
    "loose_bolt": ("base_rocking",), "lower_arm_bends": ("link_bending[2]",), "forearm_bends": ("link_bending[3]",),
    "bearing_tilts": ("bearing_tilt@",), "adapter_tilts": ("force_sensor_compliance", "bearing_tilt[6]"),
    "shank_bends": ("spindle_compliance",), "clamp_plays": ("tool_play",), "force_turned": ("force_misalignment",),
    "load_cell_zero": ("hook_weight",), "pulley_rubs": ("load_friction",), "hook_off": ("tool_point",),
    "wrong_weight": ("hook_weight", "force_curve"), "weight_swings": ("swinging_weight",),
    "bracket_turned": ("deflection_sensor_rotation",),
    "gauge_gain": ("deflection_sensor_gain",), "gauge_sticks": ("gauge_friction",), "round_target": ("target_curvature",),
    "reflector_off": ("reading_point",), "stand_drifts": ("drift",), "gauge_kicked": ("sensor_step!",),
    "read_too_early": ("creep",), "angle_mistyped": ("bad_visit!",), "mastering_off": ("encoder_zero@", "joint_zero@"),
    "tool_mismeasured": ("tcp",), "angle_sign": ("joint_sign@",), "table_turned": ("encoder_zero[1]", "joint_zero[1]")}
# Beside another joint's, or another gear law of the right joint: names that lead to the right place, or tell a part of it.
HALF: dict[str, tuple[str, ...]] = {
    "load_cell_zero": ("force_offset", "force_curve"), "hook_off": ("hook_offset",), "creep": ("creep",),
    "wrong_weight": ("force_offset",), "friction_loop": ("lost_motion",), "gears_warm_up": ("gear_softening",),
    "gauge_kicked": ("bad_visit!",),
    "adapter_tilts": ("spindle_compliance",), "shank_bends": ("force_sensor_compliance", "bearing_tilt[6]"),
    "base_rocking": ("bearing_tilt[1]", "base_shift"), "base_shift": ("base_rocking", "stand_compliance"),
    "loose_bolt": ("bearing_tilt[1]",), "read_too_early": ("gauge_friction", "drift", "gear_creep"),
    "tool_mismeasured": ("tool_point", "reading_point"), "table_turned": ("force_misalignment", "deflection_sensor_rotation"),
    "bracket_turned": ("deflection_sensor_crosstalk",), "gauge_gain": ("deflection_sensor_crosstalk",),
    "force_turned": ("force_crosstalk",)}
GEARS = ("backlash", "hysteresis", "soft_zone", "soft_beyond", "one_sided", "uneven_gear", "gear_creep", "gear_softening")


def name_of(cause: dict[str, Any]) -> str:
    """effect[joint], effect!pose or a mistake's key."""
    if "mistake" in cause:
        return str(cause["mistake"])
    pose = cause.get("pose") or cause.get("parameters", {}).get("pose")
    pose = pose.get("estimate") if isinstance(pose, dict) else pose
    return str(cause["effect"]) + (f"[{cause['joint']}]" if cause.get("joint") else f"!{pose}" if pose else "")


def meets(name: str, wanted: tuple[str, ...], truth: dict[str, Any]) -> bool:
    return any(name == (one.replace("@", f"[{truth.get('joint')}]") if "@" in one else
                        one.replace("!", f"!{truth.get('pose')}")) for one in wanted)


def close(name: str, truth: dict[str, Any]) -> bool:
    """A name that leads to the right place."""
    effect, joint = name.split("[")[0].split("!")[0], name.partition("[")[2].rstrip("]")
    right = RIGHT[truth["cause"]]
    return (meets(name, HALF.get(truth["cause"], ()), truth) or effect in [one.rstrip("@!").split("[")[0] for one in right]
            or (effect in GEARS and any(one.rstrip("@") in GEARS for one in right) and joint == str(truth.get("joint"))))


def names_left(result: dict[str, Any]) -> list[str]:
    """The names of a set, flat: an alternative may hold several that act together."""
    left: list[str] = []
    for one in [*result["alternatives"], *result["mistakes"]]:
        left += [name_of(part) for part in one.get("causes", [one])]
    return left


def judged(truth: dict[str, Any], result: dict[str, Any]) -> tuple[str, list[str]]:
    """How good an answer is, and the names in it."""
    verdict = result["verdict"]
    names = [name_of(cause) for cause in (result["mistakes"] if verdict == "mistake" else result["causes"])]
    if truth["cause"] == "nothing":
        return ("right" if verdict == "adequate" and not names else "alarm"), names or names_left(result)
    right = RIGHT[truth["cause"]]
    if names:
        hits = [meets(name, right, truth) for name in names]
        return ("right" if all(hits) else "half" if any(hits) or any(close(name, truth) for name in names) else "wrong"), names
    if verdict == "ambiguous":
        names = names_left(result)
        return ("set with the truth" if any(meets(name, right, truth) for name in names) else
                "half" if any(close(name, truth) for name in names) else "wrong"), names
    return ("missed" if verdict == "adequate" else "unknown"), names_left(result)


def held(folder: Path, truth: dict[str, Any]) -> str:
    """How many true stiffnesses lie in the stated intervals."""
    file = folder / "stiffness.json"
    if not file.exists():
        return "-"
    told = {one["name"]: one["interval_95"] for one in json.loads(file.read_text(encoding="utf-8"))["parameters"]}
    inside = [told[f"k{j}"][0] <= k <= told[f"k{j}"][1] for j, k in enumerate(truth["stiffness_nm_per_rad"], 1)]
    return f"{sum(inside)}/6" + ("" if all(inside) else " not " + " ".join(f"k{j}" for j, ok in enumerate(inside, 1) if not ok))


def asked(folder: Path) -> dict[str, Any]:
    (folder / "stiffness.json").unlink(missing_ok=True)
    call = [sys.executable, "-m", "compstiff", "diagnose", "cell.yaml", "measurements.csv", "-o", "diagnosis.json",
            "--extended", "stiffness.json", "--json", "--force", "-q"]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    (folder / "answer.json").write_text(done.stdout, encoding="utf-8")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def main(folder: Path, first: int, last: int) -> None:
    counts: Counter[str] = Counter()
    for case in sorted(one for one in folder.iterdir() if one.is_dir() and first <= int(one.name) <= last):
        truth = json.loads((case / "truth.json").read_text(encoding="utf-8"))
        answer = asked(case)
        result = answer.get("result") or {}
        if "verdict" in result:
            grade, names = judged(truth, result)
        else:
            grade, names = f"exit {answer['exit_code']}", [finding["code"] for finding in answer["findings"]]
        counts[grade] += 1
        names = [f"{len(names)} names: {names[0]}", *names[1:]] if len(names) > 3 else names
        joint = f"[{truth['joint']}]" if "joint" in truth else ""
        print(f"{case.name} {truth['cause'] + joint:19} {truth['sigmas']:5.1f} sigma  {grade:18} {result.get('verdict', ''):9} "
              f"{', '.join(names)[:90]}  k {held(case, truth)}", flush=True)
    print(", ".join(f"{grade} {count}" for grade, count in counts.most_common()))


if __name__ == "__main__":
    main(Path(sys.argv[1]), *(int(value) for value in (sys.argv[2:4] or (0, 10**6))))
