"""What `diagnose` says beside its answer, on both sides of what makes it say so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.common.shipped import shipped
from identification.diagnosis.blocks import Thinning
from identification.diagnosis.diagnose import Diagnosis, diagnose
from identification.diagnosis.gross import BadRow
from identification.diagnosis.mended import MendedFile, mended_file
from identification.diagnosis.share import share_of
from identification.fit.load_test import LoadTest
from identification.fit.mending import BadVisit
from identification.fit.mistakes.judge import NamedMistake
from identification.fit.visits import VisitScore, VisitTest
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from identification.model.effects.kinds import NO_TRACK
from tests.virtual_cell.cell import simulate


@pytest.fixture(scope="module")
def adequate(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """Springs that explain all."""
    cell_path, rows_path = simulate(43, "ladder12").write(tmp_path_factory.mktemp("adequate"))
    cell = read_cell(cell_path)
    found = diagnose(cell, read_measurements(rows_path, cell.robot), replicates=39)
    assert found.verdict == "adequate"
    return found


def told(found: Diagnosis, code: str, **changed: Any) -> list[tuple[str, str, int | None]]:
    """Level, words and line of the findings of this code where the judgement is another; all name the file of the rows."""
    findings = [one for one in Diagnosis(found.cell, found.measurements, replace(found.judgement, **changed)).findings
                if one.code == code]
    assert {one.file for one in findings} <= {found.measurements.source}
    return [(one.level, one.message, one.line) for one in findings]


def test_what_no_cause_explains_is_a_warning_with_what_is_seen(adequate: Diagnosis) -> None:
    start = "something is wrong that no cause in the dictionary explains: "
    assert told(adequate, "CS1401") == []
    assert told(adequate, "CS1401", verdict="unknown", patterns=("one", "two", "three")) == [
        ("warning", start + "one; two", None)]
    assert told(adequate, "CS1401", verdict="unknown", scatter={"sensor": 3.0}) == [
        ("warning", start + "the readings scatter more than the stated noise", None)]
    assert told(adequate, "CS1401", verdict="unknown", withdrawn={"backlash[2]": "it would be huge"}) == [
        ("warning", "something is wrong, and what is not certain: backlash of joint 2 is withdrawn: it would be huge", None)]


@pytest.mark.parametrize(("count", "looked_at"), [(2000, None), (2001, 1001)])
def test_a_share_of_a_long_file_is_said_with_its_rows(adequate: Diagnosis, count: int, looked_at: int | None) -> None:
    """Visits of one row each; of 2001 every second one is taken. Validate rows stay, and are not counted."""
    rows = adequate.measurements.select(np.resize(np.arange(len(adequate.measurements)), count + 20))
    rows = replace(rows, visit=np.arange(len(rows)), validate=np.arange(len(rows)) >= count)
    kept, share = share_of(rows)
    assert len(kept) == (looked_at or count) + 20
    assert told(adequate, "CS1024", share=share) == [
        ("note", f"the diagnosis is made from {looked_at} of {count} rows, taken evenly over the file; so are the stiffnesses "
         "of --extended", None)][: bool(looked_at)]


def test_averaged_rows_are_said_with_what_they_are_worth(adequate: Diagnosis) -> None:
    """600 rows that share their noise over nine are worth 67."""
    assert told(adequate, "CS1408") == []
    assert told(adequate, "CS1408", thinning=Thinning(600, 80, 9.0)) == [
        ("note", "600 rows of machined passes were averaged over 80 blocks: neighbouring rows share their noise over 9.0 rows, "
         "so they are worth about 67 independent ones", None)]


def test_a_cause_that_was_not_looked_for_is_said_in_words_with_why(adequate: Diagnosis) -> None:
    """Not where that lies in the kind of the data or of the cell, nor a cause of another package that is gone."""
    assert adequate.cell.robot.rod is not None
    state = adequate.judgement.plain.load_state
    assert effects()["parallelogram"].missing(state) == ""
    why = effects()["parallelogram"].missing(replace(state, robot=replace(state.robot, rod=None)))
    assert why == "the robot has no parallel rod"
    assert told(adequate, "CS1405", left_out={"force_curve": "no axis is loaded both ways", "parallelogram": why,
                                              "soft_track": NO_TRACK, "gone": "no such thing"}) == [
        ("note", "force curve was not looked for: no axis is loaded both ways", None),
        ("note", "parallelogram was not looked for: the robot has no parallel rod", None)]


def test_poses_that_stand_out_and_are_kept_are_said(adequate: Diagnosis) -> None:
    """The worst one's line; where they are left out, that is said of each instead (CS1730), and of rows (CS1407)."""
    nothing = np.zeros(3)
    scores = tuple(VisitScore(name, np.array([line - 1]), line, 0, 5.0, p, 0.5, nothing, nothing + 1)
                   for name, line, p in (("P7", 44, 0.002), ("P2", 9, 0.01)))
    test = VisitTest(scores, 0.002, 0.001, scores)
    said = [("warning", "the readings at P7, P2 stand out from the other poses (p = 0.002), but without them the others have "
             "no name: all were kept", 44)]
    assert told(adequate, "CS1735", verdict="unknown", visits=test) == said
    assert told(adequate, "CS1735", verdict="unknown", visits=replace(test, bad=())) == []
    row = BadRow(3, 4, nothing + 5e-5, nothing + 1e-6, 0.001)
    assert told(adequate, "CS1735", verdict="named", visits=test, bad_rows=(row,)) == []
    left_out = tuple(BadVisit(score, (), "") for score in scores)
    assert told(adequate, "CS1735", verdict="named", visits=test, bad_visits=left_out) == []
    for rows in ((), (row,)):
        said = told(adequate, "CS1730", verdict="named", visits=test, bad_visits=left_out, bad_rows=rows)
        assert [line for *_, line in said] == [44, 9]


POSITION = "position_mm: [120, 0, 250]"


@pytest.mark.parametrize(("tool", "written"), [
    (f"tool: {{{POSITION}}}  # of the drawing", "tool: {position_mm: [121.5, 0, 250]}  # of the drawing"),
    (f"tool:\n  {POSITION}\n  quaternion: &turn [1, 0, 0, 0]", "tool:\n  position_mm: [121.5, 0, 250]\n  quaternion: &turn "),
    ("tool: {position_mm: &place [120, 0, 250], mass_kg: 3, centre_of_mass_mm: *place}", ""),
    ("workobject: {position_mm: &place [120, 0, 250]}\ntool: {position_mm: *place}", ""),
    ("workobject: &place {position_mm: [120, 0, 250]}\ntool: *place", "")])
def test_a_cell_file_that_cannot_be_mended_is_said(tmp_path: Path, tool: str, written: str) -> None:
    """Numbers that another key has too: what to write by hand is said. Anchors may stand elsewhere."""
    file = tmp_path / "cell.yaml"
    file.write_text(f"robot: irb6660-205-1.90\n{tool}\n")
    cell = read_cell(file)
    rows = read_measurements(shipped("samples") / "measurements.csv", cell.robot)
    frame = replace(cell.flange_from_tcp, position=np.array([0.1215, 0, 0.25]))
    mistake = SimpleNamespace(of="cell", mended=lambda data: SimpleNamespace(cell=replace(cell, flange_from_tcp=frame)))
    candidate = SimpleNamespace(mistake=mistake, rows=None, data=LoadTest.of(cell, rows), models=(None,))

    def mended() -> MendedFile:
        return mended_file(cell, rows, cast(NamedMistake, SimpleNamespace(candidate=candidate, sentence="made up")))

    if written:
        assert written in mended().content.decode()
        return
    with pytest.raises(CompstiffError) as stopped:
        mended()
    found, = stopped.value.findings
    assert (found.code, found.file) == ("CS1705", str(file))
    assert found.message == "tool.position_mm could not be changed in this file"
    assert found.hint == "write [121.5, 0, 250] there by hand"
