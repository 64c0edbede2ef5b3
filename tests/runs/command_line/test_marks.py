"""From the marks of a program to the forces at its targets: a robot that starts, brakes in corners and switches its output some
milliseconds off, and a logger that knows the time alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from pyarrow import csv

from compensator.forces.marks import has_marks, placed_by_marks
from compensator.forces.placement import read_force_log
from compensator.path.robot_path import robot_path
from compensator.rapid import marks_of, read_rapid, with_marks
from identification.model.cell import read_cell
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import F0, Path3
from tests.runs.command_line.user_files import IRB6660, TOOL, Job, K

# An L of 60 mm and 60 mm in steps of 2 mm.
PATH = Path3(np.array([[2 * min(i, 30), 2 * max(i - 30, 0), 0] for i in range(61)], dtype=float))
LENGTH = 2.0 * np.arange(61)
RATE, FEED = 500.0, 50.0


def force(s: np.ndarray) -> np.ndarray:
    """A force that turns along the path (n, 3) [N], by some 2 N/mm."""
    return F0 + 40 * np.stack([np.sin(s / 20), np.cos(s / 15), np.sin(s / 25)], axis=1)


def driven(seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] at which the tool passes path lengths [mm]: slow at both ends and in the corner."""
    s = np.linspace(0, LENGTH[-1], 20_000)
    near = np.min(np.abs(s[:, None] - [0, 60, 120]), axis=1)
    speed = FEED * np.clip(0.2 + near / 4, 0.2, 1.0)
    return 1.0 + np.concatenate([[0], np.cumsum(np.diff(s) / speed[1:])]), s


def log(targets: np.ndarray, jitter: float = 2e-3, seed: int = 3, lost: int = 0) -> str:
    """time_s, forces and the output's level in volts, with noise; jitter [s] of its edges."""
    rng = np.random.default_rng(seed)
    passed, s = driven()
    t = np.arange(0, passed[-1] + 1.0, 1 / RATE)
    edges = np.interp(LENGTH[targets], s, passed) + rng.normal(0, jitter, len(targets))
    edges = np.delete(edges, [5] * bool(lost))
    level = 24.0 * (np.searchsorted(edges, t) % 2) + rng.normal(0, 0.3, len(t))
    place = np.interp(t, passed, s)
    cutting = (t >= passed[0]) & (t <= passed[-1])
    f = force(place) * cutting[:, None] + rng.normal(0, 2, (len(t), 3))
    return "time_s,fx_n,fy_n,fz_n,mark\n" + "".join(
        f"{a:.4f},{x:.3f},{y:.3f},{z:.3f},{m:.2f}\n" for a, (x, y, z), m in zip(t, f, level, strict=True))


@pytest.fixture
def job(tmp_path: Path) -> Job:
    """The program as `correct --mark` writes it, from a first correction that is not looked at."""
    first = Job(tmp_path, program=PATH.program(), forces="target,fx_n,fy_n,fz_n\n1,60,90,-120\n")
    result = first.correct("--mark", "doMark", "--keep-targets")
    assert result.code == 0, result
    text = first.out.read_text()
    plain = first.program.splitlines()
    assert [a.replace("MoveLDO", "MoveL").split(",doMark")[0] for a in text.splitlines() if "doMark" in a]
    # Its targets are put back: the marks alone are left of that correction.
    lines = [old if "doMark" not in new else old.replace("MoveL", "MoveLDO").replace(";", ",doMark" + new.split(",doMark")[1])
             for old, new in zip(plain, text.splitlines(), strict=True)]
    folder = tmp_path / "second"
    folder.mkdir()
    return Job(folder, program="\n".join(lines) + "\n")


def marked_targets(job: Job) -> np.ndarray:
    marks = marks_of(read_rapid(str(job.program).encode(), "part.mod"), "doMark")
    assert marks is not None
    return marks.target


def test_forces_come_to_their_targets(job: Job) -> None:
    """An edge off by 2 ms is 0.1 mm here: the deviation at each target, some 100 um, is met within 3 um. Within 10 mm of where
    the robot starts, stops or brakes between two marks, its place is off by up to 2 mm, and the deviation by up to 10 um."""
    job.forces = log(marked_targets(job))
    result = job.correct("--json", "--max-slope", "1e6", "--keep-targets")
    assert result.code == 0, result
    assert "CS3090" in kit.codes(result)
    rows = job.offsets()
    seen = kit.column(rows, "dx_um", "dy_um", "dz_um")
    wanted = np.array([1e6 * kit.deviation(IRB6660, q, TOOL.p, np.r_[f, 0, 0, 0], K)
                       for q, f in zip(PATH.q, force(LENGTH), strict=True)])
    assert np.linalg.norm(wanted, axis=1).min() > 30
    off = np.abs(seen - wanted).max(axis=1)
    steady = np.min(np.abs(LENGTH[:, None] - [0, 60, 120]), axis=1) > 10
    assert off[steady].max() < 3.0
    assert off[2:-2].max() < 10.0       # the first and the last samples reach into the air
    # and the corrected program is marked as the planned one was
    assert job.out.read_text().count("doMark") == len(marked_targets(job))


def test_a_lost_edge_is_refused(job: Job) -> None:
    job.forces = log(marked_targets(job), lost=1)
    result = job.correct("--json")
    assert result.code == 1, result
    assert result.json["findings"][0]["code"] == "CS3088"
    count = len(marked_targets(job))
    assert f"{count - 1} edges" in result.json["findings"][0]["message"]


def test_a_wire_that_is_active_low_is_named(job: Job) -> None:
    """High while the output is off: the first switch is a fall. Of another program's marks it is not said."""
    count = len(marked_targets(job))
    for targets, named in ((marked_targets(job), True), (marked_targets(job)[:-2], False)):
        header, *rows = log(targets).splitlines()
        turned = [f"{row.rsplit(',', 1)[0]},{24 - float(row.rsplit(',', 1)[1]):.2f}" for row in rows]
        job.forces = "\n".join([header, *turned]) + "\n"
        result = job.correct("--json")
        [finding] = [finding for finding in result.json["findings"] if finding["level"] == "error"]
        assert finding["code"] == "CS3088"
        assert f"at {count} targets" in finding["message"]
        assert ("active low" in finding["message"], "turn the column mark over" in finding["hint"]) == (named, named)


def test_a_log_with_marks_needs_the_program_with_marks(job: Job) -> None:
    job.forces, job.program = log(marked_targets(job)), PATH.program()
    result = job.correct("--json")
    assert (result.code, result.json["findings"][0]["code"]) == (1, "CS3088"), result


def test_another_program_with_as_many_marks_is_refused(job: Job) -> None:
    """The same edges in a fifth of the time: nothing drives so fast."""
    text = log(marked_targets(job))
    header, *rows = text.splitlines()
    job.forces = "\n".join([header, *(f"{float(row.split(',')[0]) / 5:.5f},{row.split(',', 1)[1]}" for row in rows)]) + "\n"
    result = job.correct("--json")
    assert (result.code, result.json["findings"][0]["code"]) == (1, "CS3089"), result


@pytest.mark.parametrize(("faster", "unknown", "refused"), [
    (1.46, False, False), (1.54, False, True), (4.0, False, True), (4.0, True, False)])
def test_a_stretch_that_is_driven_faster_than_programmed_is_refused(
    job: Job, faster: float, unknown: bool, refused: bool
) -> None:
    """Between two marks of a straight line at 50 mm/s, by more than 1.5 times. Where the file does not say the speed of a move
    between them nothing is too fast."""
    targets, (passed, s) = marked_targets(job), driven()
    text = str(job.program).splitlines()
    moves = [k for k, row in enumerate(text) if row.strip().startswith("MoveL")]
    first = next(k for k, target in enumerate(targets) if 15 < LENGTH[target] < 30)
    if unknown:
        row = moves[targets[first] + 1]
        assert "v50" in text[row]
        text[row] = text[row].replace("v50", "vElsewhere")
        job.program = "\n".join(text) + "\n"
    begin, end = np.interp(LENGTH[targets[first:first + 2]], s, passed)
    header, *rows = log(targets, jitter=0.0).splitlines()
    time = np.array([float(row.split(",")[0]) for row in rows])
    time -= (1 - 1 / faster) * (np.clip(time, begin, end) - begin)
    job.forces = "\n".join([header, *(f"{t:.5f},{row.split(',', 1)[1]}" for t, row in zip(time, rows, strict=True))]) + "\n"
    result = job.correct("--json", "--max-slope", "1e6")
    found = [one for one in result.json["findings"] if one["code"] == "CS3089"]
    assert (result.code, len(found)) == ((1, 1) if refused else (0, 0)), result
    for one in found:
        said = re.fullmatch(r"between the marks at targets (\d+) and (\d+) the log drives ([\d.]+) times as fast as programmed "
                            r"\(50 mm/s\)", one["message"])
        assert said is not None
        assert [int(said[1]), int(said[2])] == targets[first:first + 2].tolist()
        assert float(said[3]) == pytest.approx(faster, rel=0.05)
        assert one["target"] == targets[first]


def test_an_output_left_high_by_an_earlier_run(job: Job) -> None:
    text = log(marked_targets(job))
    header, *rows = text.splitlines()
    changed = [row.rsplit(",", 1)[0] + ",24.0" if i < 100 else row for i, row in enumerate(rows)]
    job.forces = "\n".join([header, *changed]) + "\n"
    assert job.correct("--max-slope", "1e6").code == 0


HALF = 31


def reordered(head: str = "", call: str = "rA;\nrB;") -> str:
    """The L by two routines that stand in the text the other way round."""
    halves = [f"PROC {name}()\n" + "\n".join(kit.move(text) for text in part) + "\nENDPROC\n"
              for name, part in (("rB", PATH.text[HALF:]), ("rA", PATH.text[:HALF]))]
    data = kit.module([]).split("PROC")[0].rstrip()
    return f"{data}\n{head}{''.join(halves)}PROC main()\n{call}\nENDPROC\nENDMODULE\n"


def switched(marked: str) -> np.ndarray:
    """The points of the L at which the output changes as the robot drives it, low before."""
    moves = [row for row in marked.splitlines() if row.strip().startswith("MoveL")]
    level, found = "0", []
    for point, row in enumerate([*moves[len(PATH.text) - HALF:], *moves[:len(PATH.text) - HALF]]):
        value = row.split(",doMark,")[1][0] if ",doMark," in row else level
        found += [point] * (value != level)
        level = value
    return np.array(found)


@pytest.mark.parametrize(("head", "call"), [
    ("", "rA;\nrB;"), ("CONST bool bCheck:=FALSE;\n", "rA;\nIF bCheck rA;\nrB;"), ("", "rA;\nIF DInput(diCheck)=1 rA;\nrB;")])
def test_edges_come_in_the_order_in_which_routines_are_driven(tmp_path: Path, head: str, call: str) -> None:
    """Samples of the log go to the moves that were driven, though others stand before them in the text."""
    marked = with_marks(read_rapid(reordered(head, call).encode(), "part.mod"), "doMark")[0].decode()
    job = Job(tmp_path, program=marked, forces=log(switched(marked)))
    result = job.correct("--json", "--max-slope", "1e6", "--keep-targets")
    assert result.code == 0, result
    assert {"CS3090", "CS3122"} <= kit.codes(result)
    rows = kit.column(kit.table(tmp_path / "offsets.csv"), "dx_um", "dy_um", "dz_um")
    seen = np.concatenate([rows[len(PATH.text) - HALF:], rows[:len(PATH.text) - HALF]])
    wanted = np.array([1e6 * kit.deviation(IRB6660, q, TOOL.p, np.r_[f, 0, 0, 0], K)
                       for q, f in zip(PATH.q, force(LENGTH), strict=True)])
    steady = np.min(np.abs(LENGTH[:, None] - [0, 60, 120]), axis=1) > 10
    assert np.abs(seen - wanted).max(axis=1)[steady].max() < 4.0


def test_marks_alternate_as_they_are_driven() -> None:
    """No mark is lost where one routine ends with the level with which the next one begins."""
    marked = with_marks(read_rapid(reordered().encode(), "part.mod"), "doMark")[0].decode()
    assert len(switched(marked)) == marked.count("doMark")


def test_a_mark_that_never_changes_is_said_to_be_one(tmp_path: Path) -> None:
    """Not a log of another program: the wire."""
    marked = with_marks(read_rapid(PATH.program().encode(), "part.mod"), "doMark")[0].decode()
    head, *rows = log(np.arange(0, 61, 5)).splitlines()
    same = "\n".join([head, *(row.rsplit(",", 1)[0] + ",24.0" for row in rows)]) + "\n"
    result = Job(tmp_path, program=marked, forces=same).correct("--json")
    assert result.code == 1, result
    [said] = [finding for finding in result.json["findings"] if finding["code"] == "CS3088"]
    assert said["message"] == ("the column mark has one value from its first row to its last, the program switches its output "
                               f"at {marked.count('doMark')} targets")
    assert "wired" in said["hint"]


def test_a_branch_between_two_marks_is_told_not_to_be_known(tmp_path: Path) -> None:
    """The marks are the same with and without it; a branch that the text settles is none."""
    marked = with_marks(read_rapid(PATH.program().encode(), "part.mod"), "doMark")[0].decode()
    row = [row for row in marked.splitlines() if row.strip().startswith("MoveL")][12]
    assert ",doMark," not in row
    edges = np.arange(0, 61, 5)
    for condition, levels in (("DInput(diSide)=1", ["warning"]), ("TRUE", [])):
        text = marked.replace(row, f"IF {condition} THEN\n{row}\nENDIF")
        folder = tmp_path / condition[:4]
        folder.mkdir()
        result = Job(folder, program=text, forces=log(edges)).correct("--json", "--keep-targets")
        assert result.code == 0, result
        said = [finding for finding in result.json["findings"] if finding["code"] == "CS3123"]
        assert [finding["level"] for finding in said] == levels
        assert all(finding["message"].endswith("as if the first of these ways was driven") for finding in said)


@pytest.mark.parametrize("clock", ["time_ms", "rate"])
def test_marks_of_a_parquet_log_are_those_of_the_text(tmp_path: Path, clock: str) -> None:
    """In milliseconds, or with the rate alone, in two batches of rows."""
    marked = with_marks(read_rapid(PATH.program().encode(), "part.mod"), "doMark")[0].decode()
    (tmp_path / "cell.yaml").write_text(
        "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\nforce_log: {rate_hz: 500}\n")
    cell = read_cell(tmp_path / "cell.yaml")
    path = robot_path(read_rapid(marked.encode(), "part.mod").toolpath, cell)
    (tmp_path / "log.csv").write_text(log(np.arange(0, 61, 5)))
    table = csv.read_csv(tmp_path / "log.csv")
    time = {"time_ms": pc.multiply(table["time_s"], 1000.0)} if clock == "time_ms" else {}
    other = pa.table(time | {name: table[name].cast(pa.float64()) for name in table.column_names if name != "time_s"})
    pq.write_table(other, tmp_path / "log.parquet", row_group_size=700)
    form, at = cell.force_log.form, np.arange(0, 61, 5)
    places = []
    for file in (tmp_path / "log.csv", tmp_path / "log.parquet"):
        read = read_force_log(file, form)
        assert has_marks(read, form)
        places.append(placed_by_marks(read, form, path, [(None, at)]).place)
    assert np.isfinite(places[0]).sum() > 1000
    np.testing.assert_allclose(places[1], places[0], atol=1e-6)


def test_edges_that_fit_several_ways_are_refused(tmp_path: Path) -> None:
    """Either routine has as many marks: which of them was driven is not to be known."""
    marked = with_marks(read_rapid(PATH.program().encode(), "part.mod"), "doMark")[0].decode()
    moves = [row for row in marked.splitlines() if row.strip().startswith("MoveL")]
    data = kit.module([]).split("PROC")[0].rstrip()
    halves = "\n".join(moves[:20]) + "\nELSE\n" + "\n".join(moves[20:40])
    text = f"{data}\nPROC main()\nIF DInput(diSide)=1 THEN\n{halves}\nENDIF\nENDPROC\nENDMODULE\n"
    edges = np.flatnonzero([",doMark," in row for row in moves[:20]])
    result = Job(tmp_path, program=text, forces=log(edges)).correct("--json")
    assert result.code == 1, result
    assert "CS3123" in kit.codes(result)
