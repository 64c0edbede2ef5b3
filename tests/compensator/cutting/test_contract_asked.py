"""What forces from the stock need, and what is said where it is missing, assumed, or not what the log told: on either side."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import compstiff
from compensator.cutting import stock
from compensator.cutting.coefficients import Coefficients
from compensator.cutting.cut import cut_of
from compensator.cutting.materials import coefficients_of
from compensator.path.robot_path import robot_path
from identification.common.findings import CompstiffError, Finding, Refused
from identification.model.stiffness import IdentifiedModel
from tests.compensator.cutting.milled import FLAT

CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
force_log: {frame: base, sign: on_tool, spindle_rpm: 9000}
cutting: {tool_diameter_mm: 16, teeth: 3, material: aluminium}
"""
STOCK = "box: {from_mm: [1000, -20, 585], to_mm: [1150, 20, 600]}\nresolution_mm: 0.5\nposition_std_mm: 0.01\n"
# Two moves in the air, a slot 3 mm deep by targets 2 mm apart that end in the stock, and two moves in the air.
SLOT = np.arange(990.0, 1102.0, 2.0)
CUTS = np.flatnonzero(SLOT > 994) + 2


def job(folder: Path, feeds: tuple[float, ...] = (18.0,), objects: str = "", cell: str = CELL, stock: str = STOCK) -> Path:
    """Cell, stock and program; feeds [mm/s] of parts of the slot in turn, none: no speed is known; objects: the work object of
    its second half."""
    (folder / "cell.yaml").write_text(cell)
    (folder / "stock.yaml").write_text(stock)
    points = [(960.0, 640.0), (960.0, 597.0), *((x, 597.0) for x in SLOT), (1100.0, 640.0), (960.0, 640.0)]
    moves = []
    for k, (x, z) in enumerate(points):
        inside = 2 <= k < len(points) - 2
        speed = f"[{feeds[(k - 2) * len(feeds) // len(SLOT)] if inside else 200:g},500,5000,1000]" if feeds else "vOfAnother"
        wobj = "wSecond" if objects and k > len(points) // 2 else "wobj0"
        moves.append(f"MoveL [[{x},0,{z}],[0,0,1,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{speed},fine,"
                     f"tSpindle\\WObj:={wobj};")
    head = "PERS tooldata tSpindle:=[TRUE,[[120,0,250],[1,0,0,0]],[80,[0,0,120],[1,0,0,0],0,0,0]];\n" + (
        f"PERS wobjdata wSecond:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],{objects}];\n" if objects else "")
    (folder / "slot.mod").write_text(f"MODULE Slot\n{head}PROC main()\n" + "\n".join(moves) + "\nENDPROC\nENDMODULE\n")
    return folder / "slot.mod"


def log(folder: Path, forced: np.ndarray) -> Path:
    """By target: a force at these alone."""
    rng, count = np.random.default_rng(3), len(SLOT) + 4
    on = np.isin(np.arange(count), forced)
    rows = [",".join([str(k), *(f"{x:.3f}" for x in on[k] * np.array([-60.0, 150, 20]) + rng.normal(0, 0.3, 3))])
            for k in range(count) for _ in range(20)]
    (folder / "forces.csv").write_text("target,fx_n,fy_n,fz_n\n" + "\n".join(rows) + "\n")
    return folder / "forces.csv"


def stiff(cell: compstiff.Cell) -> IdentifiedModel:
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, -np.log(np.full(6, 1e9)), np.eye(6) * 1e-4)


def told(folder: Path, chip: tuple[float, float] | None = (5e-5, 1e-4)) -> Path:
    """cutting.json of the table's aluminium, as of a log with chips from and to so much [m]; None: as of no log."""
    mean, covariance = coefficients_of("aluminium", 1e-4)
    known = Coefficients(mean, covariance, 0.04, FLAT, "aluminium", chip, {"from": "log"})
    (folder / "cutting.json").write_text(json.dumps(known.as_dict()))
    return folder / "cutting.json"


def fitted(folder: Path, forces: Path) -> compstiff.FittedCoefficients:
    cell = compstiff.read_cell(folder / "cell.yaml")
    program = compstiff.read_toolpath(folder / "slot.mod", cell)
    return compstiff.cutting_coefficients(cell, program, folder / "stock.yaml", stiff(cell), forces,
                                          compstiff.Settings.of(tare=((0, 1),)))


def from_table(folder: Path) -> compstiff.FittedCoefficients:
    cell = compstiff.read_cell(folder / "cell.yaml")
    return compstiff.table_coefficients(cell, compstiff.read_toolpath(folder / "slot.mod", cell))


def predicted(folder: Path, forces: Path | None = None, **settings: object) -> tuple[Finding, ...]:
    cell = compstiff.read_cell(folder / "cell.yaml")
    return compstiff.predict(cell, compstiff.read_toolpath(folder / "slot.mod", cell), stiff(cell), forces,
                             compstiff.Settings.of(**settings)).findings


def of_code(findings: tuple[Finding, ...], code: str) -> list[Finding]:
    return [finding for finding in findings if finding.code == code]


def stopped_by(call: Callable[..., object], *arguments: object, **named: object) -> Finding:
    with pytest.raises(CompstiffError) as stopped:
        call(*arguments, **named)
    (found,) = stopped.value.findings
    return found


def stopped_by_all(call: Callable[..., object], *arguments: object) -> tuple[Finding, ...]:
    with pytest.raises(CompstiffError) as stopped:
        call(*arguments)
    return stopped.value.findings


@pytest.mark.parametrize("second", ["[[0,0,0],[1,0,0,0]]", "[[0,0,1],[1,0,0,0]]"])
def test_cuts_in_two_work_objects_are_refused(tmp_path: Path, second: str) -> None:
    """Also where the other one lies in the same place: its text may be another one's to change."""
    program = job(tmp_path, objects=second)
    found = stopped_by(predicted, tmp_path, predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
    assert (found.code, found.level, found.file) == ("CS4702", "error", str(program))
    assert found.message == "the stock stands in one work object, and this program cuts it in wobj0 and in wSecond"
    line = next(k for k, text in enumerate(program.read_text().splitlines(), 1) if "WObj:=wSecond" in text)
    assert (found.line, found.target) == (line, (len(SLOT) + 4) // 2 + 1)
    job(tmp_path)
    assert of_code(predicted(tmp_path, predict_force=told(tmp_path), stock=tmp_path / "stock.yaml"), "CS4706")


TURNED = Rotation.from_euler("z", 90, degrees=True)
ORIGIN = np.array([1000.0, -100.0, 500.0])
TABLE = "carries: workobject"
HOME = "MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tool0;"
FAR = "MoveL [[960,0,{z}],[0,0,1,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[18,500,5000,1000],fine,tSpindle;"


def written(values: np.ndarray) -> str:
    """As RAPID has them."""
    return f"[{','.join(f'{value:.10f}' for value in values)}]"


def in_own_object(folder: Path, air: str, unit: str = "") -> None:
    """The slot and its stock in a work object of their own that is turned by 90 degrees; the moves in the air, at the feed of
    the cut too, in wobj0. unit: what the
    first move to joint angles has elsewhere."""
    text = job(folder).read_text()
    (folder / "stock.yaml").write_text(STOCK)
    plain, moves = text.split("PROC main()\n")[0], text.split("PROC main()\n")[1].splitlines()[:-2]
    down = (TURNED.inv() * Rotation.from_quat([0, 1, 0, 0])).as_quat()[[3, 0, 1, 2]]
    cuts = []
    for k, move in enumerate(moves):
        x, y, z = (float(value) for value in move.partition("[[")[2].partition("]")[0].split(","))
        own = TURNED.inv().apply(np.array([x, y, z]) - ORIGIN)
        if 2 <= k < len(moves) - 2:
            rest = move.partition("[0,0,1,0]")[2].replace("wobj0", "wPart")
            cuts.append(f"MoveL [{written(own)},{written(down)}{rest}")
    low, high = (TURNED.inv().apply(np.array(corner) - ORIGIN) for corner in ((1000, -20, 585), (1150, 20, 600)))
    (folder / "stock.yaml").write_text(
        f"box: {{from_mm: {np.minimum(low, high).round(6).tolist()}, to_mm: {np.maximum(low, high).round(6).tolist()}}}\n"
        "resolution_mm: 0.5\nposition_std_mm: 0.01\n")
    carried = 'FALSE,"UNIT"' if unit == TABLE else 'TRUE,""'
    (folder / "slot.mod").write_text(
        f"{plain}PERS wobjdata wPart:=[FALSE,{carried},"
        f"[[0,0,0],[1,0,0,0]],[{written(ORIGIN)},{written(TURNED.as_quat()[[3, 0, 1, 2]])}]];\n"
        f"PROC main()\n{HOME}\n{air}\n{FAR.format(z=597)}\n" + "\n".join(cuts)
        + f"\n{FAR.format(z=640).replace('960', '1100')}\n{HOME}\nENDPROC\nENDMODULE\n")
    if unit:
        (folder / "cell.yaml").write_text(f"{CELL}mechanical_units:\n  - {{name: UNIT, {unit}, axes: [{{eax: a, kind: linear, "
                                          "direction: [0, 1, 0]}]}\n")
        homed, rest = (folder / "slot.mod").read_text().split("MoveL", 1)
        (folder / "slot.mod").write_text(f"{homed.replace('[9E9', '[10')}MoveL{rest.replace('[9E9', '[0')}")


@pytest.mark.parametrize(("air", "unit"), [
    (FAR.replace("MoveL", "MoveJ"), ""), (FAR, ""), (FAR, "carries: robot"),
    # More of them than there are cuts.
    ("\n".join([FAR.replace("MoveL", "MoveJ")] * 80), ""), ("\n".join([FAR.replace("[18,", "[200,")] * 80), ""),
    ("\n".join(["MoveL pElsewhere,[18,500,5000,1000],fine,tSpindle;"] * 80), "")])
def test_moves_in_the_air_may_have_another_work_object(tmp_path: Path, air: str, unit: str) -> None:
    """Most programs home in wobj0 before they cut in the object of the part, some of a robot on a track that
    moves meanwhile. The forces are, in the base, those of the same cut in wobj0."""
    def forces() -> np.ndarray:
        cell = compstiff.read_cell(tmp_path / "cell.yaml")
        settings = compstiff.Settings.of(predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
        found = compstiff.predict(cell, compstiff.read_toolpath(tmp_path / "slot.mod", cell), stiff(cell), None, settings)
        return np.asarray(found.forces.wrench[:, :3])
    job(tmp_path)
    plain = forces()[2:-2]
    in_own_object(tmp_path, air.format(z=640), unit)
    own = forces()
    assert np.abs(plain).max() > 100
    first = len(own) - len(plain) - 2
    assert not own[:first].any()
    assert not own[-1].any()
    np.testing.assert_allclose(own[first:-2], plain, atol=0.005 * np.abs(plain).max())


def test_a_routine_that_nobody_calls_does_not_say_where_the_stock_stands(tmp_path: Path) -> None:
    """It has more linear moves, in another work object: the forces are those of the program without it."""
    def forces() -> np.ndarray:
        cell = compstiff.read_cell(tmp_path / "cell.yaml")
        settings = compstiff.Settings.of(predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
        found = compstiff.predict(cell, compstiff.read_toolpath(tmp_path / "slot.mod", cell), stiff(cell), None, settings)
        return np.asarray(found.forces.wrench[:, :3])

    program = job(tmp_path)
    plain, (head, moves) = forces(), program.read_text().removesuffix("ENDPROC\nENDMODULE\n").split("PROC main()\n")
    old = 'PERS wobjdata wOld:=[FALSE,TRUE,"",[[0,0,9],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'
    uncalled = 2 * moves.replace("wobj0", "wOld")
    program.write_text(f"{head}{old}\nPROC main()\n{moves}ENDPROC\nPROC Old()\n{uncalled}ENDPROC\nENDMODULE\n")
    assert np.abs(plain).max() > 100
    np.testing.assert_allclose(forces()[:len(plain)], plain)


def test_a_program_of_one_target_cuts_nothing(tmp_path: Path) -> None:
    """It has no way, so its predicted log has no sample."""
    program = job(tmp_path)
    *_, last = (text for text in program.read_text().splitlines() if text.startswith("MoveL"))
    program.write_text("\n".join(text for text in program.read_text().splitlines() if text == last or "MoveL" not in text))
    found = predicted(tmp_path, predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
    assert [finding.code for finding in found if finding.level == "warning"] == ["CS4709", "CS3011"]


def test_a_table_that_moves_between_two_work_objects_is_refused(tmp_path: Path) -> None:
    """Its program is driven past the stock by both, and no path says how."""
    in_own_object(tmp_path, FAR.format(z=640), TABLE)
    found = stopped_by(predicted, tmp_path, predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
    assert (found.code, found.level, found.file, found.target) == ("CS4702", "error", str(tmp_path / "slot.mod"), 0)
    assert (tmp_path / "slot.mod").read_text().splitlines()[(found.line or 0) - 1].startswith("MoveAbsJ")
    assert found.message.startswith("an axis moves between wPart and wobj0 during the program")
    assert found.hint == "state wPart in all moves, those to joint angles (MoveAbsJ) too"


@pytest.mark.parametrize(("unit", "wobj", "turn_deg", "per_target"), [
    ("carries: workobject, axes: [{eax: a, kind: rotary, direction: [0, 0, 1], through_mm: [1050, 0, 0]}]",
     '[FALSE,FALSE,"UNIT",', 1.0, 0.5),
    ("carries: robot, axes: [{eax: a, kind: linear, direction: [0, 1, 0]}]", '[FALSE,TRUE,"",', 0.0, 2.0)])
def test_a_table_or_a_track_may_move_while_the_stock_is_cut(
    tmp_path: Path, unit: str, wobj: str, turn_deg: float, per_target: float
) -> None:
    """The stock moves with the part: the force is that of a table that is held, turned with it where it turns."""
    forces = []
    for step in (0.0, per_target):
        program = job(tmp_path, cell=CELL + f"mechanical_units:\n  - {{name: UNIT, {unit}}}\n")
        head, *moves = program.read_text().replace("WObj:=wobj0", "WObj:=wOwn").split("[9E9,")
        text = head + "".join(f"[{step * k:.3f},{move}" for k, move in enumerate(moves))
        data = f"PERS wobjdata wOwn:={wobj}[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];"
        program.write_text(text.replace("PROC main", f"{data}\nPROC main"))
        cell = compstiff.read_cell(tmp_path / "cell.yaml")
        settings = compstiff.Settings.of(predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
        found = compstiff.predict(cell, compstiff.read_toolpath(program, cell), stiff(cell), None, settings)
        forces.append(found.forces.wrench[:, :3])
    held, moved = forces
    angle = np.radians(turn_deg * per_target * np.arange(len(held)))
    turned = Rotation.from_rotvec(np.outer(angle, [0, 0, 1])).apply(held.copy())
    assert np.abs(held).max() > 100
    np.testing.assert_allclose(moved, turned, atol=0.005 * np.abs(held).max())


@pytest.mark.parametrize("call", ["fitted", "table", "predicted"])
def test_forces_from_the_stock_need_the_spindle_s_speed(tmp_path: Path, call: str) -> None:
    """From cell.yaml or from the option."""
    def ask(rpm: float | None) -> object:
        cell = compstiff.read_cell(tmp_path / "cell.yaml")
        program = compstiff.read_toolpath(tmp_path / "slot.mod", cell)
        if call == "table":
            return compstiff.table_coefficients(cell, program, compstiff.Settings.of(spindle_rpm=rpm))
        if call == "fitted":
            return compstiff.cutting_coefficients(cell, program, tmp_path / "stock.yaml", stiff(cell), log(tmp_path, CUTS),
                                                  compstiff.Settings.of(spindle_rpm=rpm, tare=((0, 1),)))
        return predicted(tmp_path, predict_force=told(tmp_path), stock=tmp_path / "stock.yaml", spindle_rpm=rpm)

    job(tmp_path, cell=CELL.replace(", spindle_rpm: 9000", ""))
    found = stopped_by(ask, None)
    assert (found.code, found.level, found.file) == ("CS4703", "error", str(tmp_path / "cell.yaml"))
    assert "--spindle-rpm" in found.hint
    assert "force_log.spindle_rpm" in found.hint
    if call != "fitted":        # below
        assert ask(9000.0)
        job(tmp_path)
        assert ask(None)


@pytest.mark.parametrize(("turns", "refused"), [("CLW", False), ("CCLW", True)])
def test_a_file_that_turns_the_spindle_counterclockwise_gets_no_forces_from_its_stock(
    tmp_path: Path, turns: str, refused: bool
) -> None:
    """The coefficients are those of a cutter that turns clockwise; the slot as APT, with the line that says how it turns."""
    job(tmp_path, cell=f"{CELL}workobject: {{position_mm: [0, 0, 0], quaternion: [1, 0, 0, 0]}}\n")
    points = "\n".join(f"GOTO/{x},0,597,0,0,1" for x in SLOT)
    (tmp_path / "slot.apt").write_text(f"UNITS/MM\nMULTAX/ON\nSPINDL/9000,RPM,{turns}\nRAPID\nGOTO/960,0,597,0,0,1\n"
                                       f"FEDRAT/1080,MMPM\n{points}\nRAPID\nGOTO/1100,0,640,0,0,1\nFINI\n")

    def ask() -> tuple[Finding, ...]:
        cell = compstiff.read_cell(tmp_path / "cell.yaml")
        settings = compstiff.Settings.of(predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
        program = compstiff.read_toolpath(tmp_path / "slot.apt", cell)
        return compstiff.predict(cell, program, stiff(cell), None, settings).findings

    if not refused:
        assert of_code(ask(), "CS4706")
        return
    with pytest.raises(Refused) as stopped:
        ask()
    (found,) = of_code(stopped.value.findings, "CS4744")
    assert (found.level, found.file, found.line) == ("error", str(tmp_path / "slot.apt"), 3)
    assert "--forces, without --stock" in found.hint


@pytest.mark.parametrize(("cell", "feeds", "file", "words"), [
    (CELL.replace(", material: aluminium", ""), (18.0,), "cell.yaml", "without a log the coefficients come from the table, and "
     "cutting.material is not stated"),
    (CELL, (), "slot.mod", "the program states no feed"), (CELL, (18.0,), "", "")])
def test_the_table_needs_a_material_and_a_feed(
    tmp_path: Path, cell: str, feeds: tuple[float, ...], file: str, words: str
) -> None:
    job(tmp_path, feeds, cell=cell)
    if not words:
        assert from_table(tmp_path).coefficients.material == "aluminium"
        return
    found = stopped_by(from_table, tmp_path)
    assert (found.code, found.level, found.file, found.message) == ("CS4731", "error", str(tmp_path / file), words)


@pytest.mark.parametrize(("corner", "words"), [
    (8.0, ""), (8.001, "cutting.corner_radius_mm is 8.001, expected at most half the diameter, 8")])
def test_a_rounding_beyond_a_ball_s_is_refused(tmp_path: Path, corner: float, words: str) -> None:
    job(tmp_path, cell=CELL.replace("teeth: 3", f"teeth: 3, corner_radius_mm: {corner}"))
    if not words:
        assert from_table(tmp_path).coefficients.cutter.ball
        return
    found = stopped_by(from_table, tmp_path)
    assert (found.code, found.level, found.file, found.message) == ("CS4701", "error", str(tmp_path / "cell.yaml"), words)
    assert found.hint == "a ball has just half the diameter"


@pytest.mark.parametrize(("top", "said"), [(597.0, True), (597.5, False)])
def test_a_stock_that_the_program_does_not_touch_is_told(tmp_path: Path, top: float, said: bool) -> None:
    """The slot is at 597 mm: under its top there is something to cut."""
    job(tmp_path, stock=STOCK.replace("600]", f"{top}]"))
    findings = predicted(tmp_path, predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
    assert [(one.level, one.message, one.file) for one in of_code(findings, "CS4709")] == (
        [("warning", "the program touches its stock nowhere", str(tmp_path / "stock.yaml"))] if said else [])
    (engaged,) = of_code(findings, "CS4706")
    assert engaged.message.endswith("engagement: the program touches its stock nowhere") == said
    assert not of_code(findings, "CS4748")
    assert not of_code(findings, "CS4749")


@pytest.mark.parametrize(("depths", "said"), [((597.0,), ""), ((597.0, 596.0), "layers of 306 x 85 points, expected at most")])
def test_a_stock_whose_layers_take_too_much_memory_is_refused_with_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, depths: tuple[float, ...], said: str
) -> None:
    """150 by 40 mm at 0.5 mm, in a memory that holds two layers of it: what lies below the slot's level and what above. A
    program that cuts at more levels needs more."""
    monkeypatch.setattr(stock, "MOST_BYTES", 2.5 * 4 * 305 * 85)
    program = job(tmp_path)
    if len(depths) > 1:
        program.write_text(program.read_text().replace("[[1080.0,0,597.0]", "[[1080.0,0,596.0]"))
    if not said:
        assert of_code(predicted(tmp_path, predict_force=told(tmp_path), stock=tmp_path / "stock.yaml"), "CS4706")
        return
    found = stopped_by(predicted, tmp_path, predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
    assert (found.code, found.file) == ("CS4704", str(tmp_path / "stock.yaml"))
    assert said in found.message


def test_a_program_that_cuts_nothing_of_its_stock_is_not_corrected(tmp_path: Path) -> None:
    """And the stock is named, not a log that nobody took."""
    job(tmp_path, stock=STOCK.replace("600]", "597]"))
    cell = compstiff.read_cell(tmp_path / "cell.yaml")
    settings = compstiff.Settings.of(predict_force=told(tmp_path), stock=tmp_path / "stock.yaml")
    found = compstiff.predict(cell, compstiff.read_toolpath(tmp_path / "slot.mod", cell), stiff(cell), None, settings)
    stopped = stopped_by_all(compstiff.correct, found)
    (refused,) = of_code(stopped, "CS3086")
    assert (refused.level, refused.file, refused.message) == (
        "error", str(tmp_path / "stock.yaml"), "nothing is corrected: by this stock no move has a force that is known")
    assert "where does the stock stand" in refused.hint
    assert of_code(stopped, "CS4709")


def test_feeds_that_the_table_does_not_know_are_told(tmp_path: Path) -> None:
    """Where only the air's 200 mm/s stand in the file the chip would be that: 0.444 mm of 9000 a minute and three teeth."""
    program = job(tmp_path)
    text = program.read_text()
    program.write_text(text.replace("[18,500,5000,1000]", "vOfAnother").replace("MoveL", "MoveJ", 1))
    (found,) = of_code(from_table(tmp_path).findings, "CS4753")
    assert (found.level, found.file) == ("warning", str(program))
    assert found.message == (f"the feed of {len(SLOT)} of {len(SLOT) + 3} moves that may cut is not known: the chip is that of "
                             "the others, 200 mm/s or 0.444 mm a tooth")
    program.write_text(text.replace("[200,500,5000,1000]", "vOfAnother"))
    (found,) = of_code(from_table(tmp_path).findings, "CS4753")
    assert found.message.startswith(f"the feed of 4 of {len(SLOT) + 4} moves ")
    assert found.message.endswith("18 mm/s or 0.04 mm a tooth")
    # Joint moves cut nothing.
    program.write_text(text.replace("[200,500,5000,1000]", "vOfAnother").replace("MoveL", "MoveJ", 1))
    assert "the feed of 3 of" in of_code(from_table(tmp_path).findings, "CS4753")[0].message
    job(tmp_path)
    assert not of_code(from_table(tmp_path).findings, "CS4753")


@pytest.mark.parametrize(("stated", "said"), [("", True), ("position_std_mm: 0.1\n", False)])
def test_that_nobody_stated_where_the_stock_stands_is_told(tmp_path: Path, stated: str, said: bool) -> None:
    """With what is taken, 0.1 mm (docs/cutting.md)."""
    job(tmp_path, stock=STOCK.replace("position_std_mm: 0.01\n", stated))
    found = of_code(predicted(tmp_path, predict_force=told(tmp_path), stock=tmp_path / "stock.yaml"), "CS4707")
    assert [(one.level, one.message, one.file, one.hint) for one in found] == ([
        ("note", "where the stock stands is taken to be known to 0.1 mm, 1 sigma, in x, y and z", str(tmp_path / "stock.yaml"),
         "state position_std_mm")] if said else [])


@pytest.mark.parametrize(("chip_um", "logged"), [
    ((40, 80), ""), ((51.9, 80), ""), ((52.1, 80), "0.0521 to 0.08"), ((30, 61.6), ""),
    ((30, 61.4), "0.03 to 0.0614"), (None, "")])
def test_a_feed_a_tooth_beyond_what_was_logged_is_told(
    tmp_path: Path, chip_um: tuple[float, float] | None, logged: str
) -> None:
    """18 and 36 mm/s at 9000 a minute and three teeth are 40 and 80 um; outside is over 1.3 times less or more than the log's.
    What no log told is of any."""
    job(tmp_path, (18.0, 36.0))
    known = told(tmp_path, None if chip_um is None else (1e-6 * chip_um[0], 1e-6 * chip_um[1]))
    found = of_code(predicted(tmp_path, predict_force=known, stock=tmp_path / "stock.yaml"), "CS4722")
    words = f"the feed a tooth is 0.04 to 0.08 mm, that of the log which told the coefficients {logged} mm"
    assert [(one.level, one.message, one.file) for one in found] == ([("warning", words, str(known))] if logged else [])


def test_what_tells_the_forces_is_named_where_it_is_missing(tmp_path: Path) -> None:
    """A log, or coefficients and stock; a log with one of these is no clearer; options about a log need one."""
    job(tmp_path)
    forces, known, stock = log(tmp_path, CUTS), told(tmp_path), tmp_path / "stock.yaml"
    coefficients, blank = "cutting coefficients (--predict-force)", "the stock (--stock)"
    for log_file, settings, missing in (
            (None, {}, f"{coefficients} and {blank}"), (None, {"predict_force": known}, blank),
            (None, {"stock": stock}, coefficients), (forces, {"predict_force": known}, blank),
            (forces, {"stock": stock}, coefficients)):
        found = stopped_by(predicted, tmp_path, log_file, **settings)
        assert (found.code, found.level) == ("CS4723", "error")
        assert found.message == f"the forces cannot be predicted without {missing}"
        assert "--forces" in found.hint
    (tmp_path / "offsets.csv").write_text("target,ox_mm,oy_mm,oz_mm\n")
    both = {"predict_force": known, "stock": stock}
    for more in ({"tare": ((0, 1),)}, {"other_forces": forces}, {"logged_with": tmp_path / "offsets.csv"}):
        found = stopped_by(predicted, tmp_path, None, **both, **more)
        assert (found.code, found.level) == ("CS4723", "error")
        assert found.message == "--tare, --other-forces and --logged-with are about a force log, and none is named"
    for log_file, settings in ((None, both), (forces, {"tare": ((0, 1),)}), (forces, {"tare": ((0, 1),), **both})):
        assert not of_code(predicted(tmp_path, log_file, **settings), "CS4723")


@pytest.mark.parametrize(("count", "refused"), [(11, True), (12, False)])
def test_a_log_of_a_dozen_places_tells_coefficients(tmp_path: Path, count: int, refused: bool) -> None:
    job(tmp_path)
    forces = log(tmp_path, CUTS[10:10 + count])
    if not refused:
        found = fitted(tmp_path, forces).posterior
        assert found is not None
        assert len(found.residual) == 12
        return
    said = stopped_by(fitted, tmp_path, forces)
    assert (said.code, said.level, said.file) == ("CS4730", "error", str(forces))
    assert said.message == "only 11 places with a force and engaged as the stock says, expected at least 12"
    assert "stock it started from" in said.hint


@pytest.mark.parametrize(("count", "spread", "level", "words"), [
    (29, 1.0, "warning", "only 29 targets with a force and engaged as the stock says: the log cannot be held against it"),
    (30, 1e-4, "warning", "no cause that is known explains that by itself (wear, speed, material, place of the stock)"),
    (30, 1.0, "", "")])
def test_a_log_that_cannot_be_held_against_its_stock_or_that_nothing_explains(
    tmp_path: Path, count: int, spread: float, level: str, words: str
) -> None:
    """Of thirty targets it can. The force is none of this cut: of coefficients that are known to so much of the table's
    variance nothing explains it, and the table itself knows little."""
    job(tmp_path)
    forces, known = log(tmp_path, CUTS[5:5 + count]), told(tmp_path)
    held = json.loads(known.read_text())
    known.write_text(json.dumps(held | {"covariance": [[spread * value for value in row] for row in held["covariance"]]}))
    said = predicted(tmp_path, forces, tare=((0, 1),), predict_force=known, stock=tmp_path / "stock.yaml")
    found = of_code(said, "CS4743")
    assert [(one.level, one.file) for one in found] == ([(level, str(forces))] if level else [])
    assert all(one.message.endswith(words) for one in found)
    assert bool(found) != bool(of_code(said, "CS4740"))


def said_of_the_cut(folder: Path, code: str) -> list[str]:
    """Of the program of `job`, milled through its stock."""
    cell = compstiff.read_cell(folder / "cell.yaml")
    path = robot_path(compstiff.read_toolpath(folder / "slot.mod", cell).toolpath, cell)
    return [one.message for one in of_code(tuple(cut_of(path, folder / "stock.yaml", None).findings()), code)]


@pytest.mark.parametrize(("rpm", "feed", "words"), [
    # Of 16 mm at 150 turns a second and three teeth: 0.0064 mm, and 0.4 mm.
    (9000, 3.2, ""), (9000, 2.6, "a tooth takes 0.00578 mm, 0.036 % of the diameter, at 452 m/min"),
    (9000, 162, ""), (9000, 198, "a tooth takes 0.44 mm, 2.8 % of the diameter, at 452 m/min"),
    # Of a tenth of a millimetre: pi x 16 mm x 59.7 a minute are 3 m/min, x 89525 4500.
    (66, 0.33, ""), (54, 0.27, "a tooth takes 0.1 mm, 0.62 % of the diameter, at 2.71 m/min"),
    (81_000, 405, ""), (98_000, 490, "a tooth takes 0.1 mm, 0.62 % of the diameter, at 4.93e+03 m/min")])
def test_a_chip_or_a_speed_that_no_end_mill_has_is_told(tmp_path: Path, rpm: float, feed: float, words: str) -> None:
    job(tmp_path, feeds=(feed,), cell=CELL.replace("9000", f"{rpm}"))
    assert said_of_the_cut(tmp_path, "CS4748") == (
        [f"{words}: end mills take 0.04 to 2.5 % at 3 to 4500 m/min"] if words else [])


@pytest.mark.parametrize(("feed", "told"), [(32.4, False), (36.0, True)])
def test_moves_through_the_stock_twice_as_fast_as_the_others_are_told(tmp_path: Path, feed: float, told: bool) -> None:
    """A fifth of the slot; 1.8 and 2 times the 18 mm/s of the rest."""
    job(tmp_path, feeds=(18.0, 18.0, 18.0, feed, 18.0))
    assert [words.partition(" at ")[2] for words in said_of_the_cut(tmp_path, "CS4749")] == (
        ["36 mm/s go through the stock, where the others cut at 18: moves of the air?"] if told else [])


@pytest.mark.parametrize(("aside", "told"), [(14.0, False), (26.0, True)])
def test_a_tool_that_is_lifted_out_of_its_cut_is_no_move_of_the_air_in_it(tmp_path: Path, aside: float, told: bool) -> None:
    """43 mm up and as many along the slot at 200 mm/s, with which it leaves the stock: 0.95 and 0.86 of its way are upwards."""
    program = job(tmp_path)
    text = program.read_text()
    assert text.count("[[1100.0,0,640.0]") == 1
    program.write_text(text.replace("[[1100.0,0,640.0]", f"[[{1100 + aside},0,640.0]"))
    assert [words.partition(", where")[0] for words in said_of_the_cut(tmp_path, "CS4749")] == (
        ["1 move at 200 mm/s goes through the stock"] if told else [])
