"""Programs with external axes: how far the loaded tool is off the plan, and what of a corpus is corrected or refused, and why.

    OMP_NUM_THREADS=1 python benchmarks/external_axes.py [PLACES] [FIRST_SEED]

Off the plan: a robot on a slide, a part on a tilting and turning table (a positioner of two axes), and both; PLACES drawn ways
of the axes each, driven by the virtual cell's controller, arm and units, whose kinematics are its own. Largest over the places
[um]: at the targets, with the force of each and no target added (what the written numbers round); across lines and arcs every
half millimetre, at a tolerance of 5 um; the same not corrected.

Corpus: what public RAPID programs do with external axes, in programs of three moves of the benchmark's own, under cell files
that say enough and that do not.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.runs.command_line import test_external_axes as case
from tests.runs.command_line import user_files as kit
from tests.runs.milling.carried_job import SLIDE_ZERO, CarriedJob, table_yaml
from tests.runs.milling.line_job import ARCS, LINES, SHORT
from tests.runs.milling.test_contract_carried import at_targets_um

LEAST, MOST = np.array([600.0, -10.0, -30.0]), np.array([1000.0, 15.0, 30.0])        # slide [mm], tilt, turn [deg]
HERE, AWAY = f"{SLIDE_ZERO}", f"{SLIDE_ZERO + 80}"
JOINTS = ",".join(f"{value:.5f}" for value in np.degrees(case.line(3, 10).q[0]))
HOME = f"    MoveAbsJ [[{JOINTS}],[{AWAY},9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v100,fine,tMill;"
OF_UNIT = [kit.tooldata(), kit.wobjdata(user=case.NONE, fixed="FALSE", unit="STN1")]
# Values of eax_a in the three moves, units of cell.yaml, what stands before a move, data.
CORPUS: dict[str, tuple[tuple[str, str, str], str, dict[int, str], list[str] | None]] = {
    "9E9 throughout, no unit in the cell": (("9E9",) * 3, "", {}, None),
    "a constant 0, the cell says there is none": (("0",) * 3, "mechanical_units: []\n", {}, None),
    "a constant 0, the cell says nothing": (("0",) * 3, "", {}, None),
    "one value, the cell says nothing": (("100",) * 3, "", {}, None),
    "one value, the cell says there is none": (("100",) * 3, "mechanical_units: []\n", {}, None),
    "a part's axis at one value": (("100",) * 3, case.PART, {}, None),
    "a part's axis that moves in the air": (("20", "100", "9E9"), case.PART, {}, None),
    "a part's axis driven, no direction in the cell": (("100", "100", "120"), case.PART, {}, None),
    "a gripper's or spindle's axis driven": (("5", "70", "100"), case.IDLE, {}, None),
    "a track held": ((AWAY,) * 3, case.TRACK, {}, None),
    "a track driven under force": ((HERE, AWAY, HERE), case.TRACK, {}, None),
    "a track held, its direction not in the cell": (("100",) * 3, case.IDLE.replace("nothing", "robot"), {}, None),
    "a track at 9E9 from the start": (("9E9",) * 3, case.TRACK, {}, None),
    "a track left by the move before": ((AWAY, "9E9", "9E9"), case.TRACK, {}, None),
    "a track placed by MoveAbsJ": (("9E9",) * 3, case.TRACK, {0: HOME}, None),
    "a track switched off by DeactUnit": ((AWAY, "3000", "3000"), case.TRACK, {1: "    DeactUnit TRACK_1;"}, None),
    "EOffsSet before a move with force": (
        (HERE,) * 3, case.TRACK, {1: "    EOffsSet [30,0,0,0,0,0];", 2: "    EOffsOff;"}, None),
    "a letter that the cell does not have": (("100",) * 3, case.PART.replace("eax: a", "eax: b"), {}, None),
    "a work object on a unit, not in the cell": (("9E9",) * 3, "", {}, OF_UNIT),
    "a work object on a unit that carries nothing": (("9E9",) * 3, case.IDLE, {}, OF_UNIT),
    "a slide and a table described, the slide driven": ((AWAY,) * 3, case.TRACK + table_yaml(), {}, None),
}


def off_plan(places: int, first: int) -> None:
    print("| unit | at the targets | lines | arcs | not corrected |\n|---|---|---|---|---|")
    for on in ("slide", "table", "both"):
        largest = np.zeros(4)
        for seed in range(first, first + places):
            ends = np.random.default_rng(seed).uniform(LEAST, MOST, (2, 3))
            with TemporaryDirectory() as name:
                short = CarriedJob(Path(name), SHORT, zone="z0", on=on, ends=ends)
                found = [at_targets_um(short, short.correct("target", "--confidence", 0.5, "--keep-targets")[2]).max()]
                for path in (LINES, ARCS):
                    job = CarriedJob(Path(name), path, zone="z0", on=on, ends=ends)
                    found.append(job.correct("path_mm", "--tolerance", 5)[0].max())
                found.append(short.off_um(short.program).max())
            largest = np.maximum(largest, found)
        print(f"| {on} | {largest[0]:.1e} | {largest[1]:.1f} | {largest[2]:.1f} | {largest[3]:.0f} |", flush=True)


def corpus() -> None:
    print("\n| program | outcome |\n|---|---|")
    done = 0
    for name, (values, units, before, data) in CORPUS.items():
        with TemporaryDirectory() as folder:
            first = 1 + (HOME in before.values())
            forces = f"target,fx_n,fy_n,fz_n\n{first},60,90,-120\n{first + 1},60,90,-120\n"
            program = case.program(values, before, data)
            job = kit.Job(Path(folder), cell=kit.cell_text(extra=units), program=program, forces=forces)
            run = job.correct("--json")
            moved = 0 if run.code else int((np.abs(np.nan_to_num(case.offsets(job))).max(axis=1) > 0).sum())
            said = [f", {finding['code']}: {finding['message']}" for finding in run.json["findings"]
                    if finding["level"] == "error" or finding["code"][:4] in ("CS45", "CS41")]
        done += moved > 0
        print(f"| {name} | {f'{moved} of 2 corrected' if moved else 'refused'}{said[0] if said else ''} |")
    print(f"\n{done} of {len(CORPUS)} corrected, {len(CORPUS) - done} refused")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="?", type=int, default=6)
    parser.add_argument("first", nargs="?", type=int, default=45_000)
    options = parser.parse_args()
    off_plan(options.places, options.first)
    corpus()


if __name__ == "__main__":
    main()
