"""What `diagnose` says beside its answer, on both sides of what makes it say so."""

from __future__ import annotations

import html
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.common.shipped import shipped
from identification.diagnosis.blocks import Thinning
from identification.diagnosis.detect import Detection
from identification.diagnosis.diagnose import Diagnosis, diagnose
from identification.diagnosis.discrimination import NextLoad
from identification.diagnosis.gain import Gain
from identification.diagnosis.gross import BadRow
from identification.diagnosis.judgement import Cause
from identification.diagnosis.mended import MendedFile, mended_file
from identification.diagnosis.next_steps import steps_of
from identification.diagnosis.pages import _ordered, diagnosis_report
from identification.diagnosis.record import checks_of, next_words
from identification.diagnosis.share import share_of
from identification.diagnosis.swing import Swing
from identification.diagnosis.unsettled import Unsettled
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.mending import BadVisit, Mend
from identification.fit.mistakes.judge import NamedMistake
from identification.fit.mistakes.mistake import Mistake
from identification.fit.mistakes.search import Candidate
from identification.fit.noise import residual_std
from identification.fit.posterior import Posterior, posterior
from identification.fit.visits import VisitScore, VisitTest
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from identification.model.effects.kinds import NO_TRACK
from tests.support import compstiff
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


@pytest.mark.parametrize("times", [True, False])
@pytest.mark.parametrize("dwells", [True, False])
def test_what_was_taken_of_times_that_no_row_states_is_said(adequate: Diagnosis, times: bool, dwells: bool) -> None:
    """One time, or one dwell, is as good as a clock here: the sheet has one."""
    plain = adequate.judgement.plain
    rows, one = plain.data.rows, np.arange(len(plain.data.rows)) == 3
    blank = replace(rows, time=np.where(one & times, rows.time, np.nan), dwell=np.where(one & dwells, rows.dwell, np.nan))
    drift = "drift and softening were looked for in the order of the rows, 60 s each: time_s is not given"
    creep = "creep was looked for as if each load had been on {}: dwell_s is not given".format(
        "since the reading before" if times else "for 60 s")
    assert told(adequate, "CS1409") == []
    assert told(adequate, "CS1409", plain=replace(plain, data=plain.data.with_rows(blank))) == [
        *[("note", drift, None)] * (not times), *[("note", creep, None)] * (not dwells)]


def test_noise_that_was_stated_too_small_is_said_with_what_was_stated(adequate: Diagnosis) -> None:
    """Where nothing is stated the sentence says what is usual, and times of that."""
    assert told(adequate, "CS1403") == []
    assert told(adequate, "CS1403", scatter={"sensor noise": 2.54, "re-seating (3 um is usual)": 11.0}) == [
        ("warning", "the sensor noise would have to be 2.5 times the stated", None),
        ("warning", "the re-seating (3 um is usual) would have to be 11.0 times that", None)]


@pytest.mark.parametrize(("verdict", "stated", "said"), [
    ("adequate", 0.0, True), ("adequate", 0.01, False), ("unknown", 0.0, False)])
def test_what_no_deflection_tells_is_said_where_all_is_well(adequate: Diagnosis, verdict: str, stated: float, said: bool
                                                           ) -> None:
    """Not where cell.yaml has the scale's own uncertainty, which the intervals then take in."""
    plain, cell = adequate.judgement.plain, adequate.cell
    scale = replace(cell, noise=replace(cell.noise, force_gain=stated))
    judged_by = replace(plain, data=replace(plain.data, cell=scale))
    found = told(adequate, "CS1406", verdict=verdict, plain=judged_by, extended=judged_by)
    assert found == [("note", "a wrong scale of the force sensor (force_gain) can never be seen in deflections alone: it is "
                      "the same as all stiffnesses changed together", None)] * said


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


NOTHING = np.zeros(3)


def judged(found: Diagnosis, **changed: Any) -> Diagnosis:
    return Diagnosis(found.cell, found.measurements, replace(found.judgement, **changed))


def test_a_bad_reading_is_told_with_what_would_mend_it(adequate: Diagnosis) -> None:
    """Its largest component in the finding, each in the answer; what was not measured (dx) is no number anywhere."""
    off = np.array([np.nan, 2e-5, -5e-5])
    plain = BadRow(7, 8, off, NOTHING + 1e-6, 0.0021)
    hint = ("measure it again: what comes back is no slip, but a cause that shows there alone, such as a gear that crosses "
            "its play under that load")
    for bad, told_hint, told_line in (
        (plain, hint, ""), (replace(plain, mend=Mend("sign", "dz of the other sign would fit", 0.625)),
                            f"dz of the other sign would fit (62 % of what was tried); else {hint}",
                            "; dz of the other sign would fit (62 % of what was tried)")):
        said = judged(adequate, verdict="named", bad_rows=(bad,))
        (finding,) = [one for one in said.findings if one.code == "CS1407"]
        assert (finding.level, finding.message, finding.line, finding.hint) == (
            "warning", "row 7 is a bad reading, 50.0 um off; it was left out", 8, told_hint)
        assert said.lines()[0] == ("named: row 7 (line 8) is a bad reading, off by (-, 20.0, -50.0) um (p = 0.0021); it was "
                                   f"left out{told_line}")
        (cause,) = said.as_dict()["causes"]
        assert cause["parameters"] == {"y_m": {"estimate": 2e-5, "std": 1e-6, "unit": "m"},
                                       "z_m": {"estimate": -5e-5, "std": 1e-6, "unit": "m"},
                                       "single_row": {"estimate": 7, "std": 0.0}}
        assert (cause["sentence"], cause["of_robot"]) == ("row 7 (line 8) is a bad reading", False)
        assert [mend["kind"] for mend in cause["mends"]] == ["sign"] * bool(bad.mend)
        report = diagnosis_report(said)
        assert "READINGS LEFT OUT" in report
        assert "Left out, for they do not fit the others: row 7. Of the rest six springs leave" in report
        assert "Measure again: row 7. What comes back is no slip." in report


def test_a_bad_pose_is_a_cause_of_the_file_and_of_the_report(adequate: Diagnosis) -> None:
    score = VisitScore("P7", np.array([4, 5, 6]), 44, 0, 5.0, 0.002, 0.5, NOTHING, NOTHING + 1)
    said = judged(adequate, verdict="named", bad_visits=(BadVisit(score, (Mend("angle", "axis 4 off by 5 deg", 0.9),), ""),))
    (cause,) = said.as_dict()["causes"]
    assert (cause["effect"], cause["parameters"], cause["p_value"]) == (
        "bad_visit", {"pose": {"estimate": "P7", "std": 0.0}}, 0.002)
    assert cause["mends"] == [{"kind": "angle", "what": "axis 4 off by 5 deg", "probability": 0.9}]
    assert said.lines()[0].startswith("named: ")
    assert "they were left out" in said.lines()[0]
    assert "axis 4 off by 5 deg" in said.lines()[0]
    assert " of the other rows, the noise allows " in said.lines()[1]
    assert "Left out, for they do not fit the others: the 3 readings of P7." in diagnosis_report(said)
    # Where the other rows are adequate and yet nothing is named, the poses are what is seen.
    assert judged(adequate, verdict="unknown", bad_visits=said.judgement.bad_visits).lines()[0].startswith("seen: ")


@pytest.mark.parametrize(("rows", "said", "dropped"), [
    ([4], "it was left out. ", "the reading of P7"), ([4, 5], "they were left out. ", "the 2 readings of P7")])
def test_a_pose_of_one_reading_is_told_in_the_singular(adequate: Diagnosis, rows: list[int], said: str, dropped: str) -> None:
    score = VisitScore("P7", np.array(rows), 44, 0, 5.0, 0.002, 0.5, NOTHING, NOTHING + 1)
    found = judged(adequate, verdict="named", bad_visits=(BadVisit(score, (), ""),))
    assert said in found.lines()[0]
    assert found.judgement.dropped == (dropped, len(rows))
    assert steps_of(found, Path("x.json"))[0].words == f"Measure again: {dropped}. What comes back is no slip."


def test_of_many_readings_left_out_four_are_told_by_name(adequate: Diagnosis) -> None:
    scores = [VisitScore(f"P{k}", np.arange(2), 9, 0, 5.0, 0.002, 0.5, NOTHING, NOTHING + 1) for k in range(3)]
    visits, rows = tuple(BadVisit(score, (), "") for score in scores), tuple(
        BadRow(row, row + 1, NOTHING, NOTHING + 1, 0.001) for row in (7, 8, 9))
    every = "the 2 readings of P0, the 2 readings of P1, the 2 readings of P2, row 7"
    for some, told in ((rows[:1], (every, 7)), (rows, (f"{every} and 2 more", 9))):
        assert judged(adequate, verdict="named", bad_visits=visits, bad_rows=some).judgement.dropped == told


GAIN = Gain(9e-6, 3e-6, (2.0, 4.0), "validate", 10.0, np.ones((2, 1)), ("P01",))


def with_causes(found: Diagnosis, *names: tuple[str, int | None]) -> Posterior:
    """The rows fitted with these effects beside the springs."""
    plain, terms = found.judgement.plain, []
    for name, joint in names:
        effect, state = effects()[name], found.judgement.plain.load_state
        size, neutral = effect.typical(state, joint), effect.neutral(state)
        terms.append(Term(effect, joint, start=neutral + size, scale=size, neutral=neutral))
    return posterior(plain.data, terms, plain)


@pytest.fixture(scope="module")
def two(adequate: Diagnosis) -> Posterior:
    return with_causes(adequate, ("backlash", 2), ("creep", None))


def test_what_is_at_work_beside_a_cause_and_which_laws_are_open_is_said(adequate: Diagnosis, two: Posterior) -> None:
    """What is small is in the model; that more may be at work where what is left is more than nineteen of twenty show."""
    cause = Cause(effects()["backlash"], 2, 0.971, {"soft_zone": 0.3, "backlash": 0.65})
    small, further = Cause(effects()["creep"], None, 0.4), Cause(effects()["drift"], None, 0.123)
    named = {"verdict": "named", "extended": two, "causes": (cause,), "gain": GAIN, "showing": ()}
    lines = judged(adequate, **named, companions=(small,), robot_difference=3.31e-6).lines()
    assert lines[0].startswith("named: the gear of joint 2 is softer near zero torque. In these measurements it makes up to ")
    assert lines[0].endswith("2 sigma; probability 0.971); its law is open (soft zone 0.30, backlash 0.65 would do as well): "
                             "for a correction the choice makes 3.3 um RMS under the measured loads")
    term, values = two.terms[1], two.term_values[1]
    moved = 1e6 * np.linalg.norm(term.contribution(two.load_state, values)[:, :3], axis=1).max()
    (beside,) = [line for line in lines if line.startswith("  beside it something smaller is at work, ")]
    assert beside.startswith(f"  beside it something smaller is at work, up to {moved:.0f} um: creep (creep: ratio ")
    assert beside.endswith("2 sigma) is in the model; too small against its typical size to be a name")
    assert "its law is open" not in judged(adequate, **named).lines()[0]
    for p_value, alternatives, said in (
        (0.049, (), "95.1 % of data sets show without a further cause: something more may be at work"), (0.051, (), ""),
        (0.003, (further,), "99.7 % of data sets show without a further cause: something more may be at work (drift, "
                            "probability 0.12)")):
        left = judged(adequate, **named, adequacy=Detection(p_value, 0.001, {}, 3.0), alternatives=alternatives).lines()
        assert [line for line in left if "what is left then" in line] == [
            f"  what is left then is more than {said}"][: bool(said)]


@pytest.mark.parametrize(("name", "joint", "words", "of_robot"), [
    ("backlash", 2, "it carries what the robot does", True),
    ("force_offset", None, "the cause is in the measurement, and taken out of the data", False)])
def test_the_steps_after_a_name_say_what_the_file_carries(
    adequate: Diagnosis, name: str, joint: int | None, words: str, of_robot: bool,
) -> None:
    """With the file written, and without it."""
    found = judged(adequate, verdict="named", extended=with_causes(adequate, (name, joint)),
                   causes=(Cause(effects()[name], joint, 0.99),), gain=GAIN)
    (step,) = steps_of(found, Path("x.json"))
    assert step.words == f"Correct a program with x.json: {words}."
    assert "--stiffness x.json" in step.command
    write, use = steps_of(found)
    assert write.words == ("Write the stiffness file that carries what the robot does:" if of_robot else "It is the "
                           "measurement, not the robot: it is taken out of the data. Write the stiffness file without it:")
    assert write.command.endswith("-o diagnosis.json --extended stiffness_extended.json --force")
    assert use.words == "Then correct a program with it:"


def test_springs_that_changed_while_they_were_measured_are_not_corrected_with(adequate: Diagnosis) -> None:
    found = judged(adequate, verdict="named", extended=with_causes(adequate, ("gear_softening", 2)),
                   causes=(Cause(effects()["gear_softening"], 2, 0.99),), gain=GAIN)
    (step,) = steps_of(found, Path("x.json"))
    assert step.words == ("The springs changed while they were measured: correct refuses them. Warm the robot up and measure "
                          "again, the first pose once more at the end; then:")
    assert step.command == f"compstiff diagnose {found.cell.source} {found.measurements.source} -o diagnosis.json --force"


def test_a_mistake_in_the_files_is_the_report_s_headline(adequate: Diagnosis) -> None:
    """The name of a column stays as the table has it; any other word begins the sentence."""
    for sentence, headline in (
        ("fx_n seems to be in kgf +- 2 %, not in N, in {rows}", "fx_n seems to be in kgf ± 2 %, not in N"),
        ("forces seem to be in kgf, not in N, in {rows}", "Forces seem to be in kgf, not in N")):
        mistake = Mistake("force_unit[kgf]", sentence, "look at the sensor's data sheet", "table", lambda data: data)
        candidate = Candidate(mistake, adequate.judgement.plain.data, None, (), 0.0, np.zeros((1, 3)))
        named = NamedMistake(candidate, 0.99, 31.4, 0.9, 98.76e-6, 5.43e-6, 120)
        found = judged(adequate, verdict="mistake", mistakes=(named,))
        rows = f"all {len(adequate.judgement.rows)} rows"
        assert found.lines()[:2] == [
            f"mistake in the table: {sentence.format(rows=rows)}", "  every pose predicted from the others: 98.76 -> 5.43 um "
            "RMS with it mended; ln Bayes factor 31 against the files as they are, 120 mistakes tried"]
        page = html.unescape(re.sub(r"<[^>]+>", "", diagnosis_report(found))).replace("\xa0", " ")
        assert "A MISTAKE IN THE FILES" in page
        assert (f"{headline}, in {rows}. Each pose is predicted from the others to 98.8 µm RMS as it stands, to 5.4 µm with it "
                "mended.") in page
        first, second = steps_of(found)
        assert first.words == "Check: look at the sensor's data sheet (force unit kgf)."
        assert second.command.endswith("-o diagnosis.json --mend MENDED --force")


@pytest.mark.parametrize(("causes", "mistakes", "loads"), [(2, 0, True), (2, 1, True), (1, 1, False), (0, 2, False)])
def test_no_load_is_planned_to_tell_a_mistake_in_a_file_from_a_cause(
        adequate: Diagnosis, monkeypatch: pytest.MonkeyPatch, causes: int, mistakes: int, loads: bool) -> None:
    """Nor from another mistake: the checks come first, in the hint, in the report and behind the answer. `design` would have
    no rivals to plan loads for."""
    every = []
    for key in ("force_unit[kgf]", "reading_sign"):
        mistake = Mistake(key, f"{key} in {{rows}}", f"look at {key}", "table", lambda data: data)
        candidate = Candidate(mistake, adequate.judgement.plain.data, None, (), 0.0, np.zeros((1, 3)))
        every.append(NamedMistake(candidate, 0.5, 3.0, 0.9, 9e-6, 5e-6, 120))
    found = judged(adequate, verdict="ambiguous", mistakes=tuple(every[:mistakes]), showing=(), alternatives=tuple(
        Cause(effects()[name], joint, 0.5) for name, joint in (("backlash", 2), ("creep", None))[:causes]))
    (said,) = [one for one in found.findings if one.code == "CS1402"]
    assert ("design --add 3" in said.hint) is loads
    assert ("no load tells a mistake in a file from a cause" in said.hint) is not loads
    steps = steps_of(found)
    assert any(" design " in step.command for step in steps) is loads
    assert [step.words.startswith("Check: ") for step in steps] == (
        [False] + [True] * (causes + mistakes) if loads else [True] * (causes + mistakes) + [False])
    if not loads:
        assert " diagnose " in steps[-1].command
        assert steps[-1].words == "Mend the file, if it is one, then diagnose again:"
        names = [cause.sentence for cause in found.alternatives] + [one.sentence for one in found.judgement.mistakes]
        page = html.unescape(re.sub(r"<[^>]+>", "", diagnosis_report(found)))
        assert f"These measurements cannot tell apart: {'; or '.join(names)}. " in page
    monkeypatch.setattr("identification.diagnosis.diagnose.judge", lambda *of, **more: found.judgement)
    folder = Path(adequate.measurements.source).parent
    told = compstiff("diagnose", adequate.cell.source, adequate.measurements.source, "-o", folder / "found.json", "--force")
    following = told.stderr.split("next: ")[-1]
    assert (" design " in following) is loads
    assert following.startswith("do the checks above, mend the file if it is one, then compstiff diagnose ") is not loads


@pytest.mark.parametrize(("scatter", "code", "headline", "size", "rows"), [
    (Swing(0.02, 0.25, 1e-4, 3e-5), "CS1511", "WEIGHTS SWUNG", "side forces of 2 % of the load", "the rows"),
    (Unsettled(7e-6, 0.25, 1e-4, 3e-5), "CS1410", "ZERO READINGS LIE ASIDE", "by 7 um", "the zero readings")])
def test_scatter_is_told_with_its_size_and_is_no_displacement(
    adequate: Diagnosis, scatter: Swing | Unsettled, code: str, headline: str, size: str, rows: str
) -> None:
    said = judged(adequate, verdict="named", scatters=(scatter,))
    assert told(adequate, code) == []
    ((level, message, _),) = told(adequate, code, verdict="named", scatters=(scatter,))
    assert level == "warning"
    assert size in message
    assert message.endswith(f"; {rows} count for that much less")
    assert said.lines()[0].endswith("(up to 30 um, 1 sigma; it is scatter, and nothing is carried on)")
    (cause,) = said.as_dict()["causes"]
    (parameter,) = cause["parameters"].values()
    assert (parameter["estimate"], parameter["std"]) == (scatter.size, pytest.approx(0.25 * scatter.size))
    assert (cause["of_robot"], cause["largest_um"], cause["probability"]) == (False, pytest.approx(30), 1 - 1e-4)
    assert headline in diagnosis_report(said)


@pytest.mark.parametrize(("links", "lever", "joints"), [
    (True, 0.3, ""), (False, 0.051, "2, 3, 4, 5, 6"), (False, 0.049, "2, 3, 4, 5"), (False, -0.3, "2, 3, 4, 5, 6")])
def test_a_robot_without_links_is_said_with_what_was_tried(adequate: Diagnosis, links: bool, lever: float, joints: str) -> None:
    """The sentence is about the robot file. The last gear has a weight on it where the TCP is beside its axis: from a twentieth
    of the lever on."""
    plain = adequate.judgement.plain
    mass, centre = (np.ones(6), np.zeros((6, 3))) if links else (None, None)
    model = replace(adequate.cell.robot, link_mass=mass, link_centre=centre)
    known = replace(plain, data=replace(plain.data, cell=replace(plain.data.cell, robot=model)))
    vars(known.load_state)["hung_on_flange"] = known.load_state.hung_on_flange * [1, 1, 1, 1, 1, 0]
    known.load_state.hung_on_flange[3, 5] = lever
    found = [one for one in judged(adequate, plain=known, extended=known, showing=()).findings if one.code == "CS1404"]
    assert [(one.level, one.file, one.message) for one in found] == [
        ("note", str(model.source), "the robot file has no links: what gravity holds gears to is not known, so backlash and "
         f"soft zones of joints {joints} were tried without it and under many weights")][: not links]


def test_a_cause_whose_fit_was_lost_is_said(adequate: Diagnosis) -> None:
    assert told(adequate, "CS1020", lost=("soft_zone[2]", "creep")) == [
        ("note", f"{name} is no candidate: its fit did not converge", None) for name in ("soft zone of joint 2", "creep")]


def test_what_is_seen_of_an_unknown_cause_without_pattern_is_the_nearest(adequate: Diagnosis) -> None:
    """And its size may pass where its pattern does not."""
    nearest = Cause(effects()["backlash"], 3, 0.5)
    assert told(adequate, "CS1401", verdict="unknown", alternatives=(nearest,)) == [
        ("warning", "something is wrong that no cause in the dictionary explains: what is left looks most like backlash of "
         "joint 3, which does not explain it", None)]
    for p_value, words in ((0.001, "noise does not make such a pattern (p = 0.001)"), (0.5, "")):
        detection = replace(adequate.judgement.detection, p_value=p_value, resolution=1e-4)
        report = diagnosis_report(judged(adequate, verdict="unknown", detection=detection))
        assert ("its size would pass, but" in report) == bool(words)
        assert words in report


def test_poses_stand_in_the_report_as_people_count_them() -> None:
    """Whatever stands in a label: a superscript is no number, and had ended the report."""
    assert [names[k] for names in (["P10", "P2", "P10²", "²", "a", "P1 x"],) for k in _ordered(names)] == [
        "P1 x", "P2", "P10", "P10²", "a", "²"]


def test_a_load_is_told_as_what_to_do_and_what_it_tells() -> None:
    assert next_words({"kind": "load", "q_deg": [0, -10.04, 30, 0, 45, 0], "axis": "z", "forces_n": [-100, 0, 299.6],
                       "separates": ["backlash[2]", "creep"], "expected_sigmas": 3.14}) == (
        "joints (0.0, -10.0, 30.0, 0.0, 45.0, 0.0) deg: load along base z, -100, 0, 300 N",
        "backlash of joint 2 from creep, by 3.1 sigma")


@pytest.mark.parametrize(("axis", "forces", "said", "listed"), [
    (1, [0.0, 100.4, -299.6], ("load cycle along base y up to 300 N", "separates"), "load along base y, 0, 100, -300 N"),
    (None, [0.0, 98.0665, 245.16625, 98.0665, 0.0], ("weights up to 25 kg", "separate"), "hang 0, 10, 25, 10, 0 kg")])
def test_what_to_load_next_is_told_as_the_rig_can(
        adequate: Diagnosis, axis: int | None, forces: list[float], said: tuple[str, str], listed: str) -> None:
    """On the terminal, in the record and in the report: a rig that hangs weights has no base axis to load along."""
    load = NextLoad(np.radians([0, -10.04, 30, 0, 45, 0]), axis, np.array(forces), 3.14, ("backlash[2]", "creep"))
    names = Cause(effects()["backlash"], 2, 0.6), Cause(effects()["creep"], None, 0.4)
    found = judged(adequate, verdict="ambiguous", next_loads=(load,), alternatives=names, showing=())
    at = f"{said[0]} at joints (0.0, -10.0, 30.0, 0.0, 45.0, 0.0) deg {said[1]}"
    assert f"next: {at} backlash of joint 2 from creep by 3.1 sigma" in found.lines()
    (item,) = [each for each in found.as_dict()["next_measurements"] if each["kind"] == "load"]
    assert (item["axis"], item["forces_n"]) == ("y" if axis else "down", forces)
    assert next_words(item) == (f"joints (0.0, -10.0, 30.0, 0.0, 45.0, 0.0) deg: {listed}",
                                "backlash of joint 2 from creep, by 3.1 sigma")


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


def test_the_record_s_numbers_are_those_of_the_rows(adequate: Diagnosis, two: Posterior) -> None:
    """In the units that docs/formats.md names: by plain sums over what the models leave."""
    cause, small = Cause(effects()["backlash"], 2, 0.971, {"soft_zone": 0.3}), Cause(effects()["creep"], None, 0.4)
    other = Cause(effects()["drift"], None, 0.1)
    found = judged(adequate, verdict="named", extended=two, causes=(cause,), companions=(small,), alternatives=(other,),
                   gain=GAIN, showing=(), robot_difference=3.31e-6, log_odds=23.0, adequacy=Detection(0.4, 0.001, {}, 3.0),
                   law_differs=True, thinning=Thinning(600, 80, 9.0), patterns=("a pattern",), lost=("creep",),
                   scatter={"sensor noise": 2.5})
    content, plain = found.as_dict(), found.judgement.plain
    rows = plain.data.rows
    left = rows.deflection - plain.predicted(plain.data)
    assert content["misfit"] == {
        "rms_um": pytest.approx(1e6 * np.sqrt(np.mean(left**2))), "p_value": found.judgement.detection.p_value,
        "p_resolution": found.judgement.detection.resolution,
        "expected_rms_um": pytest.approx(1e6 * np.sqrt(np.mean(residual_std(plain.data, two.components, two.compliance) ** 2)))}
    (backlash,), (creep,) = content["causes"], content["companions"]
    spread = np.sqrt(np.diag(two.covariance))
    assert backlash["parameters"] == {"half_gap_rad": {
        "estimate": pytest.approx(two.mean[6]), "std": pytest.approx(spread[6]), "unit": "rad"}}
    assert [one["std"] for one in creep["parameters"].values()] == pytest.approx(spread[7:])
    for one, term, values in zip((backlash, creep), two.terms, two.term_values, strict=True):
        moved = term.contribution(two.load_state, values)[:, :3]
        assert one["largest_um"] == pytest.approx(1e6 * np.sqrt(np.max(np.sum(moved**2, axis=1))))
        assert (one["effect"], one["joint"], one["of_robot"]) == (term.effect.name, term.joint, term.effect.of_robot)
    assert (backlash["probability"], backlash["open_laws"]) == (0.971, {"soft_zone": 0.3})
    assert content["alternatives"] == [{"effect": "drift", "joint": None, "probability": 0.1}]
    assert content["gain"] == {"rms_before_um": pytest.approx(9.0), "rms_after_um": pytest.approx(3.0),
                               "ratio": pytest.approx(3.0), "interval": [2.0, 4.0], "held_out": "validate"}
    told = {"verdict": "named", "adequacy_p_value": 0.4, "effective_rows": pytest.approx(600 / 9.0), "law_differs": True,
            "correction_difference_um": pytest.approx(3.31), "log10_odds_against_nothing": pytest.approx(23.0 / np.log(10)),
            "rows_looked_at": len(rows), "patterns": ["a pattern"], "not_converged": ["creep"],
            "noise_beyond_stated": {"sensor noise": 2.5}}
    assert {name: content[name] for name in told} == told


@pytest.mark.parametrize("odds", [None, np.inf])
def test_odds_that_are_not_known_are_null(adequate: Diagnosis, odds: float | None) -> None:
    content = judged(adequate, log_odds=odds).as_dict()
    assert (content["log10_odds_against_nothing"], content["effective_rows"], content["correction_difference_um"]) == (
        None, None, None)


def test_the_visit_that_stands_out_most_is_recorded(adequate: Diagnosis) -> None:
    scores = tuple(VisitScore(f"P{k}", np.array([k + 1]), k + 2, 0, surprise, 0.1, 0.5, NOTHING, NOTHING + 1)
                   for k, surprise in enumerate((1.0, 4.0, 2.0)))
    visits = judged(adequate, visits=VisitTest(scores, 0.1, 0.001)).as_dict()["visits"]
    assert (visits["worst"]["pose"], visits["p_value"], visits["p_resolution"], visits["too_many"]) == ("P1", 0.1, 0.001, False)
    assert judged(adequate, visits=VisitTest((), 1.0, 1.0)).as_dict()["visits"] is None


@pytest.mark.parametrize(("probability", "listed"), [(0.021, True), (0.019, False)])
def test_checks_of_what_is_left_are_told_from_a_fiftieth_on(adequate: Diagnosis, probability: float, listed: bool) -> None:
    """Once each, with all that a check tells of."""
    causes = (Cause(effects()["backlash"], 2, 0.5), Cause(effects()["backlash"], 3, probability))
    items = judged(adequate, verdict="unknown", alternatives=causes).as_dict()["next_measurements"]
    assert [item["about"] for item in items] == ["backlash[2]", "backlash[3]"][: 1 + listed]
    assert checks_of(items) == [(effects()["backlash"].settles, "backlash of joint 2" + ", backlash of joint 3" * listed)]
