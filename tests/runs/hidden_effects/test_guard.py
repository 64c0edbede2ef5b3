"""Proof that a diagnosis which does not look at the data fails the suite; that it misses the benchmark's targets:
test_answers.py."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import pytest

from identification.diagnosis import explaining, procedure
from identification.diagnosis.naming import Named, converged
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.judge import Mistakes, mistakes_in
from identification.fit.posterior import posterior
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from identification.model.effects import effects
from tests.runs.hidden_effects.hide_and_diagnose import complaints, run_anew
from tests.runs.hidden_effects.judge import Answer, judge
from tests.runs.hidden_effects.places import GEARS, MEASUREMENT
from tests.virtual_cell.cell import simulate


def test_a_family_is_a_set_with_all_its_members_and_no_other() -> None:
    family = (frozenset({"backlash[6]", "soft_zone[6]"}),)
    given = Answer("named", frozenset({"backlash[6]"}), families=family)
    assert judge(frozenset({"backlash[6]"}), given) == "right"
    assert judge(frozenset({"soft_zone[6]"}), given) == "ambiguous in"
    assert judge(frozenset({"soft_zone[5]"}), given) == judge(frozenset({"drift"}), given) == "wrong"
    beside = Answer("named", frozenset({"backlash[6]", "drift"}), families=family)
    assert judge(frozenset({"soft_zone[6]", "drift"}), beside) == "ambiguous in"
    assert judge(frozenset({"soft_zone[6]"}), beside) == "wrong"
    assert judge(frozenset({"soft_zone[6]"}), Answer("named", frozenset({"backlash[6]"}))) == "wrong"
    assert judge(frozenset(), given) == "wrong"


# That the suite has nothing to say of it as it is: test_hidden_is_named, by the same `complaints`.
SHOWN = MEASUREMENT[4]


def mutated(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> list[str]:
    """What the suite says of SHOWN with parts of the procedure replaced; nothing is kept of this run."""
    for name, value in changes.items():
        for part in (explaining, procedure):
            monkeypatch.setattr(part, name, value, raising=part is procedure)
    return complaints(run_anew(SHOWN.seed, (SHOWN.hidden,)))


def test_the_suite_rejects_a_diagnosis_with_shuffled_names(monkeypatch: pytest.MonkeyPatch) -> None:
    names = list(effects())
    shuffled = {}
    for old, new in zip(names, names[1:] + names[:1], strict=True):
        shuffled[new] = copy(effects()[old])
        laws = tuple(copy(law) for law in effects()[old].other_laws)
        for one in (shuffled[new], *laws):
            monkeypatch.setattr(one, "name", new, raising=False)
        monkeypatch.setattr(shuffled[new], "other_laws", laws, raising=False)
    assert mutated(monkeypatch, effects=lambda: shuffled)


def test_the_suite_rejects_a_diagnosis_that_sees_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    real = procedure.goodness_of_fit

    def blind(*arguments: Any) -> Any:
        return replace(real(*arguments), p_value=1.0)

    assert mutated(monkeypatch, goodness_of_fit=blind, beyond_stated=lambda *_: {})


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> tuple[Cell, Measurements, Mistakes, Named]:
    """A clear effect, and what the searches for mistakes and for causes come to on it: no p-value changes that."""
    cell_file, table = simulate(GEARS[0].seed, "ladder12", [GEARS[0].hidden]).write(tmp_path_factory.mktemp("searched"))
    cell = read_cell(cell_file)
    rows = read_measurements(table, cell.robot)
    plain = posterior(LoadTest.of(cell, rows))
    return cell, rows, mistakes_in(plain), converged(posterior(plain.data, (), plain, usual_noise=True), effects(), 2)


# Long: the first is as it is without anything replaced; under a strained noise the same steps, with judgements put in their
# places, are those of test_what_is_looked_for_without_an_alarm_is_said_where_it_is_likely_or_needed
# (identification/diagnosis/test_laws_procedure.py).
@pytest.mark.parametrize(("p_value", "odds", "far", "strains", "verdict"), [
    pytest.param(0.02, None, 1.0, False, "named", marks=pytest.mark.long), (0.02, 6.0, 1.0, False, "unknown"),
    pytest.param(0.2, None, 1.0, False, "named", marks=pytest.mark.long),
    pytest.param(0.2, 6.0, 1.0, False, "adequate", marks=pytest.mark.long),
    pytest.param(0.4, None, 1.0, False, "adequate", marks=pytest.mark.long),
    pytest.param(0.4, None, 1.0, True, "named", marks=pytest.mark.long),
    pytest.param(0.4, 6.0, 1.0, True, "adequate", marks=pytest.mark.long),
    pytest.param(0.4, None, None, False, "named", marks=pytest.mark.long),
    pytest.param(0.4, 6.0, None, False, "unknown", marks=pytest.mark.long)])
def test_what_chance_does_now_and_then_gets_no_name(
    monkeypatch: pytest.MonkeyPatch, searched: tuple[Cell, Measurements, Mistakes, Named], p_value: float, odds: float | None,
    far: float | None, strains: bool, verdict: str,
) -> None:
    """An effect that is there, with a misfit that so many data sets of nothing would show: a name only where the odds against
    nothing (ln; None: as they are) are beyond doubt, and beyond 30 % only where the noise is unlike a sensor's. Where readings
    are far off (None: as they are) it is never `adequate`."""
    cell, rows, mistakes, named = searched
    real = procedure.goodness_of_fit

    def by_chance(fitted: Any, *arguments: Any) -> Any:
        found = real(fitted, *arguments)
        return found if fitted.terms else replace(found, p_value=p_value)

    monkeypatch.setattr(procedure, "mistakes_in", lambda plain: mistakes)
    monkeypatch.setattr(explaining, "converged", lambda *_: named)
    for part in (explaining, procedure):
        monkeypatch.setattr(part, "goodness_of_fit", by_chance)
        monkeypatch.setattr(part, "strained", lambda _: strains)
    monkeypatch.setattr(procedure, "louder", lambda _: False)
    if far is not None:
        monkeypatch.setattr(procedure, "far_off", lambda _: far)
    if odds is not None:
        monkeypatch.setattr(procedure, "log_odds", lambda judgement, entries: odds)
    found = procedure.judge(cell, rows)
    assert (found.verdict, bool(found.causes)) == (verdict, verdict == "named")
    if verdict == "unknown" and far is None:
        assert "however heavy its tails" in found.patterns[0]
