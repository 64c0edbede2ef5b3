"""What a prediction says of where it does not hold, on a few targets whose numbers are put in here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction import prediction
from compensator.correction.predict import largest_and_rms
from compensator.correction.prediction import Prediction
from identification.common.findings import CompstiffError, Finding
from identification.model.rotations import Frame

HERE = Frame(np.eye(3), np.array([0.1, 0.0, 0.25]))
OTHER = Frame(np.eye(3), np.array([0.1, 0.0, 0.26]))


def path(**more: Any) -> Any:
    return SimpleNamespace(finding=lambda target, code, level, message, hint="": Finding(
        code, level, message, "p.mod", target + 5, target=target, hint=hint), **more)


def test_a_tool_that_draws_itself_in_is_not_followed_far() -> None:
    """(1 - C J)^-1, by its series; 1 where it would make more than twice of a deviation."""
    soft = 1e-6 * np.array([[2.0, 0.5, 0], [0.5, 1, 0.2], [0, 0.2, 3]])
    follows = 1e5 * np.array([[-0.5, 0, 0], [0.3, -1, 0], [0, 0.2, 0.1]])
    series = sum(np.linalg.matrix_power(soft @ follows, k) for k in range(200))
    most = np.diag([0.49e6, 0, 0])
    found = prediction._yields(np.array([soft, 1e-6 * np.eye(3), 1e-6 * np.eye(3)]), np.array([
        follows, most, most * 0.52 / 0.49]))
    np.testing.assert_allclose(found[0], series, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found[1], np.diag([1 / 0.51, 1, 1]))
    np.testing.assert_array_equal(found[2], np.eye(3))


@pytest.mark.parametrize(("inside", "words"), [
    ([True] * 4, ""),
    ([True, False, False, True], "2 of 4 targets with force (50 %) stand where no measured part was: the learned remainder "
     "shrinks to nothing there, and its width of 23 um stays")])
def test_targets_outside_of_what_was_measured_are_told_with_the_first_of_them(inside: list[bool], words: str) -> None:
    loaded: Any = SimpleNamespace(path=path(), targets=np.array([3, 8, 9, 12]), learned=SimpleNamespace(
        remainder=SimpleNamespace(amplitude=23.4e-6)))
    rest: Any = SimpleNamespace(inside=np.array(inside))
    found = prediction._outside(loaded, rest)
    assert [(one.code, one.level, one.message, one.line, one.target) for one in found] == (
        [("CS5323", "warning", words, 13, 8)] if words else [])


def effect(name: str, *, of_tool: bool = False, of_gravity: bool = False, weighed: bool = False, joint: int | None = 2) -> Any:
    return SimpleNamespace(label=name if joint is None else f"{name}[{joint}]", joint=joint, effect=SimpleNamespace(
        of_tool=of_tool, of_gravity=of_gravity, weighed=weighed, turning="crosses its gap"))


@pytest.mark.parametrize(("of_tool", "told"), [(True, [4, 9]), (False, [])])
def test_the_first_move_with_each_other_tool_is_named(of_tool: bool, told: list[int]) -> None:
    """Where an effect depends on the tool; the cell's own is none."""
    names = [SimpleNamespace(name=name) for name in ("tMill", "tOther", "tLong")]
    loaded: Any = SimpleNamespace(
        path=path(toolpath=SimpleNamespace(tools=names, tool=np.array([0, 0, 0, 0, 1, 1, 0, 0, 0, 2, 2]))),
        targets=np.array([2, 3, 4, 5, 9, 10]),
        model=SimpleNamespace(effects=(effect("spindle_compliance", of_tool=of_tool, joint=None), effect("backlash")),
                              flange_from_tcp=HERE),
        each_tool=lambda: [(HERE, np.array([0, 1])), (OTHER, np.array([2, 3])), (OTHER, np.array([4, 5]))])
    if not told:
        prediction._check_tools(loaded)
        return
    with pytest.raises(CompstiffError) as stopped:
        prediction._check_tools(loaded)
    assert [(one.code, one.target, one.line) for one in stopped.value.findings] == [("CS1202", k, k + 5) for k in told]
    assert [one.message for one in stopped.value.findings] == [
        f"spindle_compliance was identified with the cell's tool; this move with force uses {name}, whose TCP is another"
        for name in ("tOther", "tLong")]


def test_targets_at_which_an_effect_changes_its_state_have_a_note_each() -> None:
    """One a target, of all effects that change there; and one finding an effect, at its largest step."""
    changes: Any = [SimpleNamespace(of=effect("backlash"), places=np.array([0, 2]), step=np.array([3e-6, 7.25e-6])),
                    SimpleNamespace(of=effect("hysteresis", joint=3), places=np.array([2, 3]), step=np.array([9e-6, 1e-6]))]
    loaded: Any = SimpleNamespace(path=path(), targets=np.array([1, 4, 6, 7]))
    notes, findings = prediction._state_notes(loaded, changes)
    one, other = "backlash of joint 2 crosses its gap before", "hysteresis of joint 3 crosses its gap before"
    assert notes.tolist() == [f"{one} this target", "", f"{one} this target; {other} this target", f"{other} this target"]
    assert [(each.code, each.level, each.target, each.message) for each in findings] == [
        ("CS4111", "note", 6, f"{words} 2 of 4 targets with force: deviation and correction step there, by up to {step} um")
        for words, step in ((one, "7.2"), (other, "9.0"))]
    assert prediction._state_notes(loaded, [])[0].tolist() == [""] * 4


@pytest.mark.parametrize(("tilt", "effects", "asking"), [
    (0.0, [effect("backlash", of_gravity=True)], "backlash of joint 2"), (0.0, [effect("backlash")], ""),
    (0.0, [effect("backlash", of_gravity=True, weighed=True)], ""), (0.0, [effect("backlash", of_gravity=True, joint=1)], ""),
    (2e-6, [effect("backlash", of_gravity=True, joint=1)], "backlash of joint 1"),
    (0.0, [effect("backlash", of_gravity=True, joint=1), effect("hysteresis", of_gravity=True, joint=3)],
     "hysteresis of joint 3")])
@pytest.mark.parametrize("links", [True, False])
def test_gravity_that_is_not_known_is_told_where_it_counts(tilt: float, effects: list[Any], asking: str, links: bool) -> None:
    """About an upright axis it holds no gear; where the robot file has its links it is known."""
    model: Any = SimpleNamespace(effects=effects, fall=np.array([0.0, tilt, -1.0]),
                                 robot=SimpleNamespace(link_mass=np.ones(6) if links else None, source="robot.yaml"))
    found = prediction._unknown_gravity(model)
    assert [(one.code, one.file) for one in found] == [("CS1404", "robot.yaml")] * (bool(asking) and not links)
    assert all(one.message == f"the robot file has no links: gravity torques are taken as zero in {asking}" for one in found)


@pytest.mark.parametrize("learned", [True, False])
def test_what_nobody_measured_is_not_known(learned: bool) -> None:
    covariance, unseen = np.tile(np.diag([9.0, 4, 1]), (2, 1, 1)), np.tile(np.diag([5.0, 0, 1]), (2, 1, 1))
    nothing: Any = np.zeros(2)
    one = Prediction(nothing, np.zeros((2, 3)), covariance, nothing, (), nothing, nothing, nothing, unseen if learned else None,
                     nothing, np.zeros((2, 3)), 4 * covariance)
    np.testing.assert_allclose(one.known, covariance - learned * unseen)
    np.testing.assert_allclose(one.std, [[3, 2, 1]] * 2)
    np.testing.assert_allclose(one.at_rest_std, [[6, 4, 2]] * 2)


@pytest.mark.parametrize(("values", "largest", "mean"), [([], 0.0, 0.0), ([3.0, 4.0], 4.0, 12.5**0.5), ([2.0], 2.0, 2.0)])
def test_figures_of_no_target_are_nothing(values: list[float], largest: float, mean: float) -> None:
    assert largest_and_rms(np.array(values)) == pytest.approx({"largest": largest, "rms": mean})
