"""What the stiffness file of a diagnosis carries by its verdict: springs, effects of the robot, and whether it may be used."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis.detect import Detection
from identification.diagnosis.extended_model import extended_model
from identification.diagnosis.gain import Gain
from identification.diagnosis.judgement import Cause, Judgement
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from tests.virtual_cell.cell import simulate

GAIN = Gain(9e-6, 3e-6, (2.0, 4.0), "validate", 10.0, np.ones((2, 1)), ("P01",))
DETECTED, LEFT = Detection(0.011, 0.001, {}, 3.0), Detection(0.41, 0.001, {}, 3.0)
UNSETTLED = "the springs, or the gain of the force measurement, changed while they were measured: measure again, warmed up"


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Posterior:
    cell_path, rows_path = simulate(43, "ladder12").write(tmp_path_factory.mktemp("extended"))
    cell = read_cell(cell_path)
    rows = read_measurements(rows_path, cell.robot)
    return posterior(LoadTest.of(cell, rows.select(rows.visit < 8)))


def with_causes(plain: Posterior, *names: tuple[str, int | None]) -> Posterior:
    terms, state = [], plain.load_state
    for name, joint in names:
        effect = effects()[name]
        size, neutral = effect.typical(state, joint), effect.neutral(state)
        terms.append(Term(effect, joint, start=neutral + size, scale=size, neutral=neutral))
    return posterior(plain.data, terms, plain)


def judged(plain: Posterior, verdict: Any, extended: Posterior | None = None, *names: tuple[str, int | None],
           **more: Any) -> Judgement:
    causes = tuple(Cause(effects()[name], joint, 0.5) for name, joint in names)
    named: dict[str, Any] = {"named": {"causes": causes, "gain": GAIN, "adequacy": LEFT}}.get(verdict, {"alternatives": causes})
    return Judgement(verdict, plain, extended or plain, DETECTED, **(named | more))


def test_adequate_springs_are_those_of_the_fit(plain: Posterior) -> None:
    """With the figures of the fit; what the detection says is their check."""
    model = extended_model(judged(plain, "adequate"))
    np.testing.assert_array_equal(model.mean, plain.mean)
    np.testing.assert_array_equal(model.covariance, plain.covariance)
    assert model.effects == ()
    residual = plain.data.rows.deflection - plain.predicted(plain.data)
    assert model.fit["residual_rms_um"] == pytest.approx(1e6 * np.sqrt(np.mean(residual**2)))
    assert {name: model.fit[name] for name in ("rows", "dof", "diagnosis", "measurement_effects", "model_check")} == {
        "rows": len(residual), "dof": residual.size - 6, "diagnosis": "adequate", "measurement_effects": [],
        "model_check": {"p_value": 0.011, "rejected": False, "seen": ""}}
    assert (model.fit["chi2"], model.fit["noise_scale"]) == (plain.chi2, plain.components.sensor)
    assert "reliable" in model.grades


def test_a_named_cause_of_the_robot_is_carried_and_one_of_the_measurement_is_not(plain: Posterior) -> None:
    both = with_causes(plain, ("force_offset", None), ("backlash", 2))
    model = extended_model(judged(plain, "named", both, ("force_offset", None), ("backlash", 2), carried=both))
    assert [(one.effect.name, one.joint) for one in model.effects] == [("backlash", 2)]
    kept = [*range(6), 9]
    np.testing.assert_allclose(model.covariance, both.covariance[np.ix_(kept, kept)])
    # Where it has an effect the likeliest values are carried, and no mean, which may lie beside all that are likely.
    np.testing.assert_array_equal(model.mean, both.likeliest[kept])
    assert model.fit["dof"] == both.readings - 10
    assert model.fit["measurement_effects"] == ["force_offset"]
    assert model.fit["model_check"] == {"p_value": 0.41, "rejected": False, "seen": ""}


@pytest.mark.parametrize(("verdict", "carried", "seen"), [
    ("ambiguous", True, "backlash of joint 2 or creep: the data cannot tell which"),
    ("ambiguous", False, "backlash of joint 2 or creep: the data cannot tell which"), ("unknown", False, "one; two"),
    ("unknown, and nothing is seen", False, "a cause that the dictionary does not have")])
def test_what_has_no_name_is_rejected_unless_a_candidate_is_carried(
        plain: Posterior, verdict: str, carried: bool, seen: str) -> None:
    """Of candidates none of the stiffnesses is reliable, whichever it is."""
    play, names = with_causes(plain, ("backlash", 2)), (("backlash", 2), ("creep", None))
    if verdict == "ambiguous":
        judgement = judged(plain, verdict, play, *names, carried=play if carried else None)
    else:
        judgement = judged(plain, "unknown", None, *names, patterns=("one", "two", "three") if verdict == "unknown" else ())
    model = extended_model(judgement)
    assert model.fit["model_check"] == {"p_value": 0.011, "rejected": not carried, "seen": seen}
    assert "reliable" not in model.grades
    assert len(model.effects) == carried
    assert bool(model.rejected) is not carried


def test_what_cannot_be_told_apart_names_mistakes_in_the_table_and_says_how_many_more_there_are(plain: Posterior) -> None:
    """Also where there are mistakes alone: the forces may be in another unit, or the readings turned round."""
    unit, sign = (SimpleNamespace(key=key) for key in ("force_unit[kgf]", "reading_sign"))
    names = (("backlash", 2), *(("soft_zone", joint) for joint in range(1, 6)))
    causes = ["backlash of joint 2", *(f"soft zone of joint {joint}" for joint in (1, 2, 3))]
    cases: list[tuple[int, list[Any], list[str]]] = [(1, [unit], ["force unit kgf"]), (4, [unit], ["force unit kgf"]), (
        6, [], ["2 more"]), (6, [unit], ["force unit kgf", "2 more"]), (0, [unit, sign], ["force unit kgf", "reading sign"])]
    for count, mistakes, further in cases:
        model = extended_model(judged(plain, "ambiguous", None, *names[:count], mistakes=tuple(mistakes)))
        seen = " or ".join([*causes[:count], *further])
        assert model.fit["model_check"] == {"p_value": 0.011, "rejected": True, "seen": f"{seen}: the data cannot tell which"}


@pytest.mark.parametrize("verdict", ["named", "ambiguous"])
def test_springs_that_changed_while_they_were_measured_are_rejected(plain: Posterior, verdict: str) -> None:
    soft = with_causes(plain, ("gear_softening", 2))
    names = (("gear_softening", 2), ("creep", None))[: 1 if verdict == "named" else 2]
    model = extended_model(judged(plain, verdict, soft, *names, carried=soft))
    assert model.fit["model_check"]["rejected"] is True
    assert model.fit["model_check"]["seen"] == (
        UNSETTLED if verdict == "named" else "gear softening of joint 2 or creep: the data cannot tell which")
