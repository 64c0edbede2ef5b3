"""Causes of fourth_world that people make: in tables, in cell files, in zeros of the robot.

Used by: python benchmarks/fourth_world.py CASES SEED FOLDER
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from fourth_arm import turn
from fourth_bench import Bench, Random
from fourth_hidden import Hidden

ANGLES, READINGS, FORCES = [f"q{i}_deg" for i in range(1, 7)], ["dx_um", "dy_um", "dz_um"], ["fx_n", "fy_n", "fz_n"]
SIBLINGS = {"irb6700-200-2.60": "irb6700-155-2.85", "irb6640-235-2.55": "irb6640-185-2.80"}
Edit = Callable[[pd.DataFrame], pd.DataFrame]


def mistake(words: str, joint: str, edit: Edit, **extra: Any) -> Hidden:
    """A slip of the pen: it has no size to choose."""
    return Hidden(words, joint, "", 1, 1, table=lambda size, table: edit(table.copy()), scaled=False, extra=extra)


def visits_of(bench: Bench) -> np.ndarray:
    return np.array([r.visit for r in bench.rows])


def loaded_rows(bench: Bench) -> np.ndarray:
    return np.flatnonzero([float(np.linalg.norm(r.force)) > 0.45 * bench.strength for r in bench.rows])


def pose_typo(rng: Random, bench: Bench) -> Hidden:
    v, j = int(rng.integers(bench.rows[-1].visit + 1)), int(rng.integers(1, 5))
    by = float(rng.choice([-30, -20, 20, 30]))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        t.loc[visits_of(bench) == v, ANGLES[j]] += by
        return t

    return mistake(f"angle q{j + 1} of visit {v + 1} is written wrong by {by:.0f} deg", str(j + 1), edit, visit=v + 1)


def sign_from_visit(rng: Random, bench: Bench) -> Hidden:
    v, i = int(rng.integers(bench.rows[-1].visit // 2, bench.rows[-1].visit - 1)), int(rng.integers(3))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        t.loc[visits_of(bench) >= v, READINGS[i]] *= -1
        return t

    return mistake(
        f"{READINGS[i]} has the wrong sign from visit {v + 1} on (gauge set up from the other side)", READINGS[i], edit
    )


def digit_slip(rng: Random, bench: Bench) -> Hidden:
    n, i = int(rng.choice(loaded_rows(bench))), int(rng.integers(3))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        readings = t[READINGS].to_numpy(float)
        small = abs(readings[n, i]) < 50
        best = int(np.argmax(np.abs(readings[n]))) if small else i
        t.loc[n, READINGS[best]] = round(float(readings[n, best]) * 10, 1)
        return t

    return mistake(f"one reading of row {n + 1} is ten times too large (decimal point)", "", edit, wrong_row=n + 1)


def rows_swapped(rng: Random, bench: Bench) -> Hidden:
    visits = visits_of(bench)
    a = int(rng.choice(loaded_rows(bench)))
    b = int(rng.choice([n for n in loaded_rows(bench) if visits[n] != visits[a]]))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        one, two = t.loc[a, READINGS].to_numpy(copy=True), t.loc[b, READINGS].to_numpy(copy=True)
        t.loc[a, READINGS], t.loc[b, READINGS] = two, one
        return t

    return mistake(f"readings of rows {a + 1} and {b + 1} are exchanged", "", edit, wrong_rows=[a + 1, b + 1])


def columns_swapped(rng: Random, bench: Bench) -> Hidden:
    i, j = sorted(int(n) for n in rng.permutation(3)[:2])

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        t[[READINGS[i], READINGS[j]]] = t[[READINGS[j], READINGS[i]]].to_numpy()
        return t

    return mistake(f"columns {READINGS[i]} and {READINGS[j]} are exchanged in the whole table", "gauges", edit)


def millimetres(rng: Random, bench: Bench) -> Hidden:
    v = int(rng.integers(bench.rows[-1].visit + 1))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        t.loc[visits_of(bench) == v, READINGS] = (t.loc[visits_of(bench) == v, READINGS] / 1000).round(4)
        return t

    return mistake(f"readings of visit {v + 1} are in millimetres", "", edit, visit=v + 1)


def world_frame(rng: Random, bench: Bench) -> Hidden:
    yaw = float(rng.choice([-1, 1]) * rng.uniform(15, 90))
    matrix = turn(np.array([0, 0, np.radians(yaw)]))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        t[READINGS] = (t[READINGS].to_numpy(float) @ matrix.T).round(1)
        return t

    return mistake(f"readings are in the hall's axes, turned by {yaw:.0f} deg about z against the robot's base", "gauges", edit)


def shifted_visits(rng: Random, bench: Bench) -> Hidden:
    visits = visits_of(bench)
    v = int(rng.integers(visits[-1] // 2, visits[-1] - 2))
    angles = {w: np.degrees(next(r.q for r in bench.rows if r.visit == w)).round(3) for w in range(visits[-1] + 1)}

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        for w in range(v, visits[-1] + 1):
            t.loc[visits == w, ANGLES] = angles[w - 1] if w > v else angles[visits[-1]]
        return t

    return mistake(f"joint angles from visit {v + 1} on have slipped by one pose (last one first)", "", edit, visit=v + 1)


def copied_visit(rng: Random, bench: Bench) -> Hidden:
    visits = visits_of(bench)
    v = int(rng.integers(1, visits[-1] + 1))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        here, before = np.flatnonzero(visits == v), np.flatnonzero(visits == v - 1)
        t.loc[here, READINGS] = t.loc[before[: len(here)], READINGS].to_numpy()
        return t

    return mistake(f"readings of visit {v + 1} are a copy of those of visit {v}", "", edit, visit=v + 1)


def angle_sign(rng: Random, bench: Bench) -> Hidden:
    j = int(rng.choice([0, 3, 5]))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        t[ANGLES[j]] = -t[ANGLES[j]]
        return t

    return mistake(f"q{j + 1} has the other sign in the whole table", str(j + 1), edit)


def decanewton(rng: Random, bench: Bench) -> Hidden:
    v = int(rng.integers(bench.rows[-1].visit + 1))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        t.loc[visits_of(bench) == v, FORCES] = (t.loc[visits_of(bench) == v, FORCES] / 10).round(2)
        return t

    return mistake(f"forces of visit {v + 1} are in daN", "load", edit, visit=v + 1)


def force_sign_some(rng: Random, bench: Bench) -> Hidden:
    v = int(rng.integers(bench.rows[-1].visit + 1))

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        t.loc[visits_of(bench) == v, FORCES] *= -1
        return t

    return mistake(f"forces of visit {v + 1} have the wrong sign (pull for push)", "load", edit, visit=v + 1)


def load_cell_offset(rng: Random, bench: Bench) -> Hidden:
    bias = rng.normal(size=3)
    bias /= np.linalg.norm(bias)

    def table(size: float, t: pd.DataFrame) -> pd.DataFrame:
        t = t.copy()
        t[FORCES] = (t[FORCES] + size * bias).round(1)
        return t

    return Hidden(
        "the load cell was not set to zero: every force, the unloaded ones too, has the same offset",
        "load",
        "N",
        3,
        300,
        table=table,
    )


def moment_at_flange(rng: Random, bench: Bench) -> Hidden:
    arm = bench.arm
    lever = np.array(
        [(links[6] @ arm.tool)[:3, 3] - links[6][:3, 3] for links in (arm.chain(arm.theta(r.q), [], [])[0] for r in bench.rows)]
    )

    def edit(t: pd.DataFrame) -> pd.DataFrame:
        names = ["mx_nm", "my_nm", "mz_nm"]
        t[names] = (t[names] + np.cross(lever, t[FORCES].to_numpy(float))).round(2)
        return t

    return mistake("moments in the table are about the flange, not about the TCP", "load", edit)


def serial_angles(rng: Random, bench: Bench) -> Hidden:
    def edit(t: pd.DataFrame) -> pd.DataFrame:
        t["q3_deg"] = (t["q3_deg"] - t["q2_deg"]).round(3)
        return t

    return mistake(
        "axis 3 is given as the serial angle (between the arms), not as the pendant of a parallel-rod robot shows it", "3", edit
    )


def wrong_tool(rng: Random, bench: Bench) -> Hidden:
    i, sign = int(rng.choice([0, 2])), float(rng.choice([-1, 1]))

    def cell(size: float, c: dict[str, Any]) -> dict[str, Any]:
        place = list(c["tool"]["position_mm"])
        place[i] = round(place[i] + sign * size, 1)
        return {**c, "tool": {**c["tool"], "position_mm": place}}

    return Hidden(f"tool.position_mm {'xyz'[i]} in cell.yaml is that of another tool", "tool", "mm", 10, 200, cell=cell)


def wrong_robot(rng: Random, bench: Bench) -> Hidden:
    other = SIBLINGS[bench.robot]
    return Hidden(
        f"cell.yaml names {other}; the robot is {bench.robot}",
        "robot",
        "",
        1,
        1,
        scaled=False,
        cell=lambda size, c: {**c, "robot": other},
    )


def mastering(rng: Random, bench: Bench) -> Hidden:
    j, sign = int(rng.choice([1, 2, 3, 4])), float(rng.choice([-1, 1]))
    return Hidden(
        f"zero of axis {j + 1} is lost: the robot stands otherwise than the pendant says",
        str(j + 1),
        "rad",
        0.01,
        0.35,
        angles=lambda a, row: row.q + sign * a * (np.arange(6) == j),
    )


PEOPLE = {
    f.__name__: f
    for f in (
        pose_typo,
        sign_from_visit,
        digit_slip,
        rows_swapped,
        columns_swapped,
        millimetres,
        world_frame,
        shifted_visits,
        copied_visit,
        angle_sign,
        decanewton,
        force_sign_some,
        load_cell_offset,
        moment_at_flange,
        serial_angles,
        wrong_tool,
        wrong_robot,
        mastering,
    )
}
