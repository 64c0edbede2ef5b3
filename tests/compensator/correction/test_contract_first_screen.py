"""The top of a report: which answer it gives on either side of each limit, its figures, and what to do next, of jobs whose
numbers are put in here."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.budget import Place
from compensator.correction.correct import Corrected
from compensator.correction.expected_left import CAUSES
from compensator.correction.first_screen import keys_of, micrometres, steps_of, verdict_of
from compensator.correction.predict import Predicted
from compensator.correction.settings import EXACTLY_ONE, Estimate, Settings
from identification.common.findings import Finding


def of_kind(kind: type, **told: Any) -> Any:
    """A job of that kind, of which so much is known."""
    return object.__new__(type("Job", (kind,), told))


def planned(std_um: float = 3.0, **told: Any) -> Any:
    """A program of 9 targets, 4 of them with force, pushed off by 20 um RMS and 64.7 at most."""
    figures = {"predicted": told.get("predicted", 4), "targets": 9, "with_force": 4,
               "deviation_um": {"largest": 64.7, "rms": 20.0}, "deviation_std_um": {"largest": 7.4, "rms": std_um}}
    targets = np.arange(2, 6)[:told.get("predicted", 4)]
    at_rest = np.zeros((len(targets), 3))
    if len(targets):
        at_rest[1] = [3e-5, 4e-5, 0]
    chosen = told.get("settings", Settings.of())
    robot = SimpleNamespace(manufacturer=told.get("maker", "ABB"), name="arm")
    return of_kind(
        Predicted, as_dict=lambda self: figures, targets=targets, another=told.get("another"), settings=chosen,
        path=SimpleNamespace(toolpath=SimpleNamespace(line=100 + np.arange(9), number=50 + np.arange(9)),
                             cell=SimpleNamespace(robot=robot)),
        prediction=SimpleNamespace(at_rest=at_rest), model=SimpleNamespace(source="k.json"),
        forces=SimpleNamespace(held=np.arange(told.get("held", 0)), log=SimpleNamespace(
            predicted=told.get("of_stock"), source="log.csv")),
        program=SimpleNamespace(source=told.get("source", Path("part.mod"))), cell=SimpleNamespace(source="cell.yaml"))


def corrected(rms_um: float = 4.0, cause: str = "cut", **told: Any) -> Any:
    """The same, corrected: so much is expected to be left, RMS, most of it by this cause."""
    figures = {"largest": 11.0, "rms": rms_um, **dict.fromkeys(CAUSES, 0.3), cause: told.get("of_cause", 0.9 * rms_um)}
    given = planned(**told)
    decides = {name: told.get(name, False) for name in ("wall_decides", "slots_decide")}
    left = SimpleNamespace(std=1e-6 * np.array([2.0, 1, 5.5, 3]), as_dict=lambda: figures,
                           mostly_unknown_cut=any(decides.values()), **decides)
    own = {"expected_left_um": figures, "offset_mm": {"largest": 0.0654}, "corrected": 4, "held_back": told.get("held_back", 0)}
    return of_kind(Corrected, as_dict=lambda self: given.as_dict() | own, planned=given, predicted=given, left=left,
                   feed=told.get("feed"), findings=told.get("findings", ()))


BEFORE = ("The tool was pushed off its path by 20 µm RMS, 65 µm at most. After this correction {} µm RMS are expected on the "
          "part, 22 µm at most (2 sigma).")


@pytest.mark.parametrize(("value", "words"), [(0.0, "0"), (0.42, "0.4"), (9.94, "9.9"), (9.96, "10"), (64.7, "65")])
def test_a_size_has_a_tenth_where_that_says_something(value: float, words: str) -> None:
    assert micrometres(value) == words


@pytest.mark.parametrize(("std_um", "level", "word"), [
    (9.9, "open", "NOT CORRECTED"), (10.1, "caution", "NOT CORRECTED, AND NOT KNOWN WELL")])
def test_a_prediction_is_not_known_well_that_is_uncertain_by_more_than_itself(std_um: float, level: str, word: str) -> None:
    """By two sigma."""
    found = verdict_of(planned(std_um), None)
    assert (found.level, found.word) == (level, word)
    assert found.sentence == "Without correction the tool is pushed off its path by up to 65 µm (20 µm RMS)." + (
        " That is uncertain by 20 µm RMS (2 sigma): a stiffness, or the force, is not known well." if std_um > 10 else "")
    assert verdict_of(planned(predicted=0), None).word == verdict_of(corrected(predicted=0), None).word == "NOTHING PREDICTED"


def slow(where: list[bool]) -> Any:
    """A feed that cannot be held at these of the targets, of which the first two cut."""
    return SimpleNamespace(last=SimpleNamespace(slow=np.array(where), cutting=np.array([True, True, False])))


UNCERTAIN, UNSTATED = "BUT MORE IS UNCERTAIN THAN WAS CORRECTED", "BUT THE CUT IS NOT STATED"
DOUBT = (Finding("CS4330", "note", ""), Finding("CS3091", "warning", ""), Finding("CS3092", "warning", ""))


@pytest.mark.parametrize(("told", "level", "word", "more"), [
    ({}, "good", "CORRECTED", ""), ({"findings": DOUBT[:1]}, "good", "CORRECTED", ""),
    ({"findings": DOUBT}, "caution", "CORRECTED, WITH 2 WARNINGS TO READ FIRST", ""),
    ({"rms_um": 9.9}, "good", "CORRECTED", ""),
    ({"rms_um": 10.1, "cause": "model"}, "caution", f"CORRECTED, {UNCERTAIN}", " Mostly: the model."),
    ({"rms_um": 10.1, "findings": DOUBT[1:2]}, "caution", f"CORRECTED, {UNCERTAIN}; 1 WARNING",
     " Mostly: force that follows the cut."),
    ({"wall_decides": True}, "caution", f"CORRECTED, {UNSTATED}", " The unknown cut makes most of that: see the next step."),
    ({"slots_decide": True, "rms_um": 10.1}, "caution", f"CORRECTED, {UNCERTAIN}", " Mostly: force that follows the cut."),
    ({"feed": slow([False, False, True])}, "good", "CORRECTED", ""),
    ({"feed": slow([False, True, False]), "rms_um": 10.1}, "caution", "CORRECTED, BUT THE FEED CANNOT BE HELD EVERYWHERE", ""),
    ({"held": 1, "feed": slow([True, True, True])}, "caution", "CORRECTED, BUT NOT ALL OF THE CUT",
     " 1 target is not among them: the log stood still there, left as planned."),
    ({"held": 3}, "caution", "CORRECTED, BUT NOT ALL OF THE CUT",
     " 3 targets are not among them: the log stood still there, left as planned.")])
def test_of_what_is_to_be_said_of_a_correction_the_gravest_stands_first(
    told: dict[str, Any], level: str, word: str, more: str
) -> None:
    found = verdict_of(corrected(**told), None)
    assert (found.level, found.word) == (level, word)
    assert found.sentence == BEFORE.format(micrometres(2 * told.get("rms_um", 4.0))) + more


def budget_of(over: int, remedies: list[dict[str, Any]] | None = None, job: Any = None) -> Any:
    figures = {"tolerance_um": 25.0, "over": over, "targets": 100, "uncorrected_over": 37, "remedies": remedies or []}
    places = (Place(4, 9, 3, 31e-6, "cut"), Place(20, 20, 1, 44e-6, "model"), Place(30, 31, 2, 27e-6, "cut"))
    job = job or corrected()
    return SimpleNamespace(as_dict=lambda: figures, places=places, corrected=job, tolerance=25e-6, two_sigma=2 * job.left.std)


@pytest.mark.parametrize(("over", "level"), [(0, "good"), (1, "caution"), (5, "caution"), (6, "bad")])
def test_a_tolerance_fails_where_more_than_a_twentieth_of_the_targets_does(over: int, level: str) -> None:
    found = verdict_of(planned(), budget_of(over))
    assert found.level == level
    if not over:
        assert (found.word, found.sentence) == (
            "WITHIN THE TOLERANCE ONCE CORRECTED", "Corrected, all 100 targets with force are expected within 25 µm by two "
            "sigma; uncorrected 37 would not be.")
        return
    assert (found.word, found.sentence) == (
        "THE TOLERANCE MAY FAIL EVEN CORRECTED", f"{over} of 100 targets {'is' if over == 1 else 'are'} expected over 25 µm by "
        f"two sigma, the worst at line 20: up to 44 µm, mostly {CAUSES['model']}.")


def shown(job: Any, budget: Any = None) -> list[tuple[str, str, str, str]]:
    return [(key.label, key.value, key.unit, key.note) for key in keys_of(job, budget)]


def test_the_figures_are_those_before_and_after_and_where_they_are_largest() -> None:
    """The worst of a prediction is where the tool stands off most, of a correction where most is left; of predicted forces what
    a stock that stands aside would mean."""
    first = ("pushed off, uncorrected", "65", "µm", "largest; RMS 20 µm")
    unsure = ("uncertainty of that", "15", "µm", "2 sigma, largest")
    aside = ("were the stock 1 mm aside", "18", "µm", "RMS, so much off: compare the cut in words below")
    assert shown(planned()) == [first, ("largest at", "line 103", "", "target 53"), unsure,
                                ("targets with force", "4", "", "of 9")]
    assert shown(planned(another=SimpleNamespace(aside=17.6)))[-1] == aside
    left = ("expected on the part, corrected", micrometres(2 * np.sqrt((4 + 1 + 5.5**2 + 9) / 4)), "µm",
            "2 sigma, RMS; 11 µm at the worst place")
    worst = ("most is left at", "line 104", "", "target 54")
    assert shown(corrected()) == [first, left, ("largest correction", "0.065", "mm", "4 targets"), worst]
    assert shown(corrected(held_back=2, another=SimpleNamespace(aside=17.6)))[2:] == [
        ("largest correction", "0.065", "mm", "4 targets, 2 held back"), worst, aside]
    assert shown(planned(), budget_of(1)) == [
        first, left, ("share of the tolerance", "44", "%", "of 25 µm, at the worst place"), worst]


def said(job: Any, budget: Any = None, offsets: Path | None = None) -> list[str]:
    """The beginning of each step."""
    return [" ".join(step.words.split()[:5]) for step in steps_of(job, budget, offsets)]


WRITE, TOLERANCE, DRIVE = "Write the corrected program:", "No tolerance was stated. Put", "Drive the corrected program in"


def test_the_next_step_of_a_prediction_is_its_correction_or_what_hinders_it() -> None:
    write, tolerance = steps_of(planned(), None, None)
    assert write.command == ("compstiff correct cell.yaml part.mod --stiffness k.json --forces log.csv -o part_corrected.mod "
                             "--offsets part.offsets.csv --report part.correct.html")
    assert tolerance.command == ("compstiff predict cell.yaml part.mod --stiffness k.json --forces log.csv -o "
                                 "part.deviation.csv --budget --tolerance-um 100 --report part.budget.html")
    of_stock = planned(of_stock="cut", settings=Settings.of(predict_force=Path("c.json"), stock=Path("s.yaml")))
    assert "k.json --predict-force c.json --stock s.yaml -o" in steps_of(of_stock, None, None)[0].command
    assert said(planned(source=None)) == []
    assert said(planned(predicted=0)) == said(planned(predicted=0, of_stock="cut")) == ["There is nothing to correct."]
    assert "newtons" in steps_of(planned(predicted=0), None, None)[0].words
    assert "stock" in steps_of(planned(predicted=0, of_stock="cut"), None, None)[0].words
    (other,) = steps_of(planned(maker="KUKA"), None, None)
    assert other.words.startswith("Programs of arm are not written here: its controller runs no RAPID.")


def test_the_next_step_of_a_budget_is_the_remedy_that_leaves_the_least() -> None:
    remedies = [{"do": "this", "effort": "an hour", "gain_um": 3.04, "over": 2, "two_sigma_um": {"largest": 40.0}},
                {"do": "that", "effort": "a day", "gain_um": 2.0, "over": 1, "two_sigma_um": {"largest": 50.0}}]
    (step,) = steps_of(planned(), budget_of(4, remedies), None)
    assert step.words == ("First what leaves the least over the tolerance: that (a day; gains 2.0 µm). Then correct; 1 target "
                          "would be left over the tolerance:")
    assert step.command.startswith("compstiff correct cell.yaml part.mod ")
    assert said(planned(), budget_of(0, remedies)) == said(planned(), budget_of(4)) == [WRITE]


@pytest.mark.parametrize(("told", "first"), [
    ({}, []), ({"wall_decides": True}, ["Most of what is left"]), ({"slots_decide": True}, ["Most of what is left"]),
    ({"wall_decides": True, "slots_decide": True}, ["Most of what is left"] * 2),
    # 0.7 of what is left, and that more than was to be corrected.
    ({"cause": "model", "rms_um": 10.1, "of_cause": 7.2, "wall_decides": True, "slots_decide": True}, ["Most of what is left"]),
    ({"cause": "model", "rms_um": 10.1, "of_cause": 7.0}, []), ({"cause": "model", "rms_um": 9.9, "of_cause": 9.0}, [])])
def test_before_a_corrected_program_is_driven_what_is_not_known_is_stated(told: dict[str, Any], first: list[str]) -> None:
    """A stiffness that is not known well before all."""
    job = corrected(**told)
    steps = steps_of(job, None, Path("o.csv"))
    assert said(job) == [*first, DRIVE, TOLERANCE]
    words = " ".join(step.words for step in steps)
    assert ("design --add" in words) == (told.get("cause") == "model" and bool(first))
    if told.get("cause") != "model":
        assert ("material: aluminium" in words) == told.get("wall_decides", False)
        assert ("--slot-depth MM" in words) == told.get("slots_decide", False)


def test_what_a_correction_was_worth_is_asked_of_its_offsets_and_of_a_scale_that_is_not_known() -> None:
    for scale, asks in ((EXACTLY_ONE, True), (Estimate(1.1, 0.02), False)):
        job = corrected(settings=Settings.of(scale=scale))
        named, unnamed = (steps_of(job, None, offsets)[-2] for offsets in (Path("o.csv"), None))
        assert (" and which --scale the moving robot needs" in named.words) == asks
        assert named.command == ("compstiff verify cell.yaml before.csv after.csv --predicted o.csv --tolerance-um 100 "
                                 "--report part.verify.html")
        assert "what --offsets writes" not in named.words
        assert "(part.offsets.csv: what --offsets writes):" in unnamed.words
        assert "--predicted part.offsets.csv" in unnamed.command


def test_of_a_program_without_a_corrected_target_nothing_is_left() -> None:
    """As where zones alone were made smaller."""
    job = corrected()
    job.left.std = np.empty(0)
    assert shown(job)[1] == ("expected on the part, corrected", "0", "µm", "2 sigma, RMS; 0 µm at the worst place")
    assert len(shown(job)) == 3
