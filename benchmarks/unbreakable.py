"""Adversarial input in every number and many bytes of a job's files: no defect (exit 70), no warning of NumPy on the terminal.

    python benchmarks/unbreakable.py [--seconds 600] [--seed 0] [--file NAME] [--command NAME]

Sound files of a small cell, one of them spoilt at a time: a number becomes huge, tiny, denormal, negative, zero, NaN or text,
or a byte is replaced, or a line is doubled, deleted or cut. Each is read by the commands that take it, in this process, every
warning as an error. Printed: runs by file and exit code, and each defect with the change that makes it. Exit 1 where there is
one.
"""

from __future__ import annotations

import argparse
import collections
import re
import sys
import tempfile
import time
import warnings
from functools import cache
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np
import pandas as pd

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import Frame
from tests.runs.command_line.workshop import workshop
from tests.virtual_cell.arm import ARMS

ROBOT = "irb6660-205-1.90"
VALUES = ("1e300", "-1e300", "1e308", "1e160", "1e30", "1e19", "1e12", "1e9", "1e6", "1e-6", "1e-9", "1e-12", "1e-30", "1e-160",
          "1e-320", "-1e-320", "0", "-0.0", "-1", "nan", "inf", "-inf", "9" * 30, "1e999", "x", "")
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")
BYTES = tuple(b'[](){},;:."!\\\n\r\t -+eE09naN#%&*\x00\xff|$/=')
CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [110, -20, 260], quaternion: [1, 0, 0, 0], mass_kg: 20, centre_of_mass_mm: [0, 0, 100]}
base_frame: {position_mm: [10, 20, 30], quaternion: [0.9238795325112867, 0, 0, 0.3826834323650898]}
workobject: {position_mm: [900, 50, 400], quaternion: [1, 0, 0, 0]}
measurement: {deflection_std_um: [2, 2, 2], force_std_n: [1, 1, 1], force_relative_std: 0.01, pose_offset_std_um: [3, 3, 3]}
prior: {stiffness_nm_per_rad: [2.03e6, 6.02e6, 1.91e6, 0.45e6, 0.22e6, 0.07e6], relative_std: 2.0}
force_log:
  frame: sensor
  sensor_quaternion: [1, 0, 0, 0]
  sensor_position_mm: [0, 0, 80]
  sign: on_tool
  rate_hz: 100
  saturation_n: 5000
  saturation_nm: 900
  spindle_rpm: 900
  weight: removed
  payload: {mass_kg: 12.4, centre_of_mass_mm: [12, -8, 143]}
  bias_n: [1, -3, 5]
  bias_nm: [0.1, 0.2, 0.3]
limits: {max_offset_mm: 2.0, max_tilt_deg: 0.5}
design: {joint_window_deg: {q1: [-90, 90]}, reach_mm: [600, 1700]}
"""
APT = """\
PARTNO SHELL
UNITS/MM
LOADTL/7
TRACUT/1,0,0,0,0,1,0,0,0,0,1,0
SPINDL/9000,RPM,CLW
RAPID
GOTO/600,20,50,0,0,1
FEDRAT/0.2,MMPR
GOTO/630,20,5
CIRCLE/620,20,5,0,0,1,10,0.1,0.1,1,0,TIMES,1
GOTO/620,10,5
MOVARC/620,20,5,0,0,1,10,ANGLE,90
GOTO/630,20,5
INDIRV/0,1,0
TLON,GOFWD/ (CIRCLE/620,20,5,10),ON,(LINE/620,20,5,620,30,5)
CYCLE/DEEP,DEPTH,5,STEP,2,CLEAR,2,MMPM,60,RETURN,50
GOTO/620,40,5
CYCLE/OFF
GODLTA/0,0,5
FINI
"""
TABLE = "x_mm,y_mm,z_mm,q1,q2,q3,q4,feed_mm_s,rapid\n" + "".join(
    f"{600 + 5 * k},20,{5 - 0.1 * k:.1f},0,1,0,0,20,{int(k == 0)}\n" for k in range(8))
VERIFIED = "target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um\n" + "".join(
    f"{k},{200 + 10 * (k % 3)},{-100 + 7 * (k % 5)},30,2,2,2\n" for k in range(40))
COMMANDS = {
    "identify": (("cell.yaml", "measurements.csv"), ("identify", "@cell.yaml", "@measurements.csv", "-o", "@k.json")),
    "correct": (("cell.yaml", "part.mod", "stiffness.json", "forces.csv"),
                ("correct", "@cell.yaml", "@part.mod", "--stiffness", "@stiffness.json", "--forces", "@forces.csv", "-o",
                 "@o.mod")),
    "predict": (("cell.yaml", "part.mod", "stiffness.json", "along.csv"),
                ("predict", "@cell.yaml", "@part.mod", "--stiffness", "@stiffness.json", "--forces", "@along.csv", "-o",
                 "@d.csv")),
    "post": (("cell.yaml", "part.apt"), ("post", "@cell.yaml", "@part.apt", "-o", "@p.mod")),
    "table": (("part.csv",), ("post", "@cell.yaml", "@part.csv", "-o", "@t.mod")),
    "verify": (("before.csv", "after.csv"), ("verify", "@cell.yaml", "@before.csv", "@after.csv")),
    "verify_places": (("before_places.csv", "predicted.csv"), (
        "verify", "@cell.yaml", "@before_places.csv", "@after_places.csv", "--predicted", "@predicted.csv", "--frame",
        "workobject", "--tolerance-um", "50")),
    "tare": (("still.csv",), ("tare", "@cell.yaml", "@still.csv", "-o", "@payload.yaml")),
    "learn": (("cell.yaml", "points.csv"), (
        "learn", "@cell.yaml", "@part.mod", "@points.csv", "--stiffness", "@stiffness.json", "--forces", "@forces.csv", "-o",
        "@learned.json")),
}


@cache
def _still() -> str:
    """Readings of a weight of 12.4 kg at eight orientations, four rows at each."""
    rows = []
    for q4, q5 in ((0, 0), (60, 90), (60, -90), (-60, 30), (-60, 115), (90, 45), (90, -60), (-90, 10)):
        flange = kit.tcp_pose(ARMS[ROBOT], np.radians([10.0, 10, 5, q4, q5, 0]), Frame.mm([0.0, 0, 0])).r
        force = flange.inv().apply([0, 0, -12.4 * 9.80665])
        load = np.hstack([force, np.cross([0.012, -0.008, 0.063], force)]) + np.array([1, -3, 5, 0.1, 0.2, 0.3])
        rows += [[10, 10, 5, q4, q5, 0, *(load + 0.1 * sign)] for sign in (1, -1, 1, -1)]
    return "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n" + "".join(
        ",".join(f"{x:.4f}" for x in row) + "\n" for row in rows)


@cache
def _points() -> str:
    """Points of a part that is off by what is predicted, and by a few micrometres more."""
    with tempfile.TemporaryDirectory() as folder:
        workshop(ROBOT).run(Path(folder), {"cell.yaml": CELL}, *(
            word.replace("along", "forces") for word in COMMANDS["predict"][1][:-1]), f"{folder}/d.csv")
        told = pd.read_csv(f"{folder}/d.csv")
    rows = told[["x_mm", "y_mm", "z_mm", "dx_um", "dy_um", "dz_um"]].dropna().to_numpy()
    rows[:, 3:] = kit.Rotation.from_euler("z", 45, degrees=True).apply(rows[:, 3:])     # of the base frame, to the work object
    rows[:, 3:] += 3 * np.sin(np.arange(3 * len(rows))).reshape(-1, 3)
    return "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,std_um\n" + "".join(",".join(f"{x:.3f}" for x in row) + ",2\n" for row in rows)


def sound_files() -> dict[str, str]:
    """The files of a job in which nothing is spoilt."""
    job = workshop(ROBOT).files
    places = list(dict.fromkeys(line.rsplit(",", 3)[0] for line in job["along.csv"].split("\n")[1:-1]))
    readings = {name: "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um\n" + "".join(
        f"{place},{size + 10 * (k % 3)},{-size // 2 + 7 * (k % 5)},30,2,2,2\n" for k, place in enumerate(places))
        for name, size in (("before_places.csv", 200), ("after_places.csv", 20))}
    return {**job, "cell.yaml": CELL, "part.apt": APT, "part.csv": TABLE, **readings,
            "still.csv": _still(), "points.csv": _points(),
            "predicted.csv": "target,x_mm,y_mm,z_mm,dx_um,dy_um,dz_um\n" + "".join(
                f"{k},{place},190,-80,25\n" for k, place in enumerate(places)),
            "before.csv": VERIFIED, "after.csv": VERIFIED.replace("200", "20")}


def spoilt(text: str, rng: np.random.Generator) -> tuple[str, bytes]:
    """What was changed, and the text with it: mostly a number, else a byte or a line."""
    kind = rng.random()
    places = [match.span() for match in NUMBER.finditer(text)]
    if kind < 0.7 and places:
        start, end = places[int(rng.integers(len(places)))]
        value = VALUES[int(rng.integers(len(VALUES)))]
        line = text.count("\n", 0, start) + 1
        return f"line {line}: {text[start:end]} -> {value}", (text[:start] + value + text[end:]).encode()
    data = text.encode()
    at = int(rng.integers(len(data)))
    if kind < 0.85:
        byte = bytes([BYTES[int(rng.integers(len(BYTES)))]])
        return f"byte {at} -> {byte!r}", data[:at] + byte + data[at + 1:]
    if kind < 0.9:
        return f"cut at byte {at}", data[:at]
    lines = text.split("\n")
    at = int(rng.integers(len(lines)))
    doubled = rng.random() < 0.5
    changed = [*lines[:at], *([lines[at]] * 2 if doubled else []), *lines[at + 1:]]
    return f"line {at + 1} {'doubled' if doubled else 'deleted'}", "\n".join(changed).encode()


def main() -> int:
    """Runs until the time is over."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--file", help="spoil this file alone")
    parser.add_argument("--command", choices=COMMANDS, help="run this command alone")
    chosen = parser.parse_args()
    from tests.runs.command_line import user_files as kit

    warnings.simplefilter("error")
    rng, files, until = np.random.default_rng(chosen.seed), sound_files(), time.monotonic() + chosen.seconds
    seen: collections.Counter[tuple[str, str, int]] = collections.Counter()
    defects: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text)
        while time.monotonic() < until:
            for command, (names, words) in COMMANDS.items():
                if chosen.command not in (None, command) or (chosen.file and chosen.file not in names):
                    continue
                name = chosen.file or names[int(rng.integers(len(names)))]
                what, content = spoilt(files[name], rng)
                (Path(folder) / name).write_bytes(content)
                result = kit.run(*(f"{folder}/{word[1:]}" if word.startswith("@") else word for word in words), "--json",
                                 "--force")
                (Path(folder) / name).write_text(files[name])
                seen[command, name, result.code] += 1
                if result.code not in (0, 1, 3) or "Warning" in result.err or "Traceback" in result.err:
                    defects.setdefault(cause(result.out + result.err), f"{command} with {name}, {what}: exit {result.code}")
    for (command, name, code), count in sorted(seen.items()):
        print(f"{command:9} {name:18} exit {code:3} {count:6}")
    for told, where in defects.items():
        print(f"\n{where}\n  {told}")
    print(f"\n{sum(seen.values())} runs, {len(defects)} kinds of defect")
    return int(bool(defects))


def cause(told: str) -> str:
    """The last lines of the traceback in the log that a defect names; else what was said."""
    log = re.search(r"[\w/.-]*compstiff-\w+\.log", told)
    if log is None or not Path(log[0]).exists():
        return told[-300:]
    lines = [line.strip() for line in Path(log[0]).read_text(encoding="utf-8").strip().split("\n")]
    Path(log[0]).unlink()
    own = [line for line in lines if line.startswith("File") and ("/compensator/" in line or "/identification/" in line)]
    return f"{lines[-1][:200]}  in {own[-1] if own else lines[-3]}"


if __name__ == "__main__":
    raise SystemExit(main())
