"""What is expected to be left, cause by cause, of numbers that are worked out here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.expected_left import (
    CAUSES,
    ExpectedLeft,
    Foreseen,
    _between,
    expected_left,
    foreseen,
    in_proportion,
)
from compensator.correction.settings import CorrectionSettings, Estimate, Spacing


def left(told: dict[str, list[float]], at_depths: Any = (), at_slots: Any = ()) -> ExpectedLeft:
    """Micrometres by cause, of two targets; nothing by the others."""
    return ExpectedLeft(**{cause: 1e-6 * np.array(told.get(cause, [0.0, 0.0])) for cause in CAUSES},
                        at_depths=at_depths, at_slot_depths=at_slots)


def test_causes_add_by_their_squares_and_are_told_at_two_sigma() -> None:
    found = left({"model": [3.0, 0.0], "cut": [4.0, 12.0], "between": [0.0, 5.0]})
    np.testing.assert_allclose(found.std, [5e-6, 13e-6])
    rms = np.sqrt((25 + 169) / 2)
    figures = {"largest": 13.0, "rms": rms, "model": 3 / np.sqrt(2), "cut": np.sqrt(80), "between": 5 / np.sqrt(2)}
    assert found.as_dict() == pytest.approx(dict.fromkeys(CAUSES, 0.0) | figures)
    assert found.line() == (f"expected to be left on the part, 2 sigma: {2 * rms:.1f} um RMS, 26.0 um at most (the model 4.2, "
                            "force that follows the cut 17.9, between targets 7.1)")
    assert found.sentence() == (f"On the part {2 * rms:.1f} um RMS are expected to be left, 26.0 um at most (2 sigma), by "
                                "these causes: the model, force that follows the cut, between targets.")
    nothing = ExpectedLeft(**{cause: np.zeros(0) for cause in CAUSES})
    assert nothing.as_dict() == {"largest": 0.0, "rms": 0.0} | dict.fromkeys(CAUSES, 0.0)
    assert nothing.sentence().startswith("On the part 0.0 um RMS")


@pytest.mark.parametrize(("cut", "at_depth", "decides"), [
    (8.6, 4.4, True), (8.6, 4.2, False), (5.9, 4.4, True), (5.7, 4.4, False)])
def test_a_depth_decides_that_makes_most_of_what_the_cut_leaves_and_that_most_of_all(
    cut: float, at_depth: float, decides: bool
) -> None:
    """Half and more of 10 um that are not the cut's: 5.77 um are half of what is left together; half of the cut by the worst
    depth that is told."""
    told = ((0.3e-3, 1e-6 * at_depth), (1e-3, 1e-6))
    sizes = {"model": [10.0, 10.0], "cut": [cut, cut]}
    for one, wall in ((left(sizes, told), True), (left(sizes, (), told), False)):
        assert one.mostly_unknown_cut == decides
        assert (one.wall_decides, one.slots_decide) == (decides and wall, decides and not wall)
        words = ("; how deep the cut is decides, and nobody stated it: the cut leaves " if wall else
                 "; how deep the slots are decides, and nobody stated it: they leave ")
        words += f"{at_depth:.1f} um at 0.3 mm, 1.0 um at 1 mm (--{'' if wall else 'slot-'}depth"
        assert (words in one.line()) == decides
        assert ("decides" in one.sentence()) == decides
    assert not left(sizes).mostly_unknown_cut
    assert not left({"cut": [1.0, 1.0]}).mostly_unknown_cut


@pytest.mark.parametrize(("learned", "scale", "expected"), [
    (None, Estimate(1.0), (0.03**2, 0.1**2)), (None, Estimate(1.1, 0.05), (0.03**2, 0.0)), (object(), Estimate(1.0), (0, 0))])
def test_a_share_of_every_deviation_is_not_known(learned: Any, scale: Estimate, expected: tuple[float, float]) -> None:
    """The sensor's gain, and the robot in motion until a scale is stated; where a part was learned they are in the springs."""
    cell = SimpleNamespace(motion=SimpleNamespace(compliance_std=0.1), force_log=SimpleNamespace(
        form=SimpleNamespace(gain_std=0.03)))
    job: Any = SimpleNamespace(path=SimpleNamespace(cell=cell), loaded=SimpleNamespace(learned=learned),
                               settings=SimpleNamespace(correction=CorrectionSettings(scale=scale)))
    assert in_proportion(job) == pytest.approx(expected)


def prediction(whole: float, **parts: float) -> Any:
    """Of two targets 50 um off along y and z, variances in um^2."""
    of = {name: np.full(2, 1e-12 * parts.get(name, 0.0)) for name in ("of_scatter", "of_force", "of_learned")}
    return SimpleNamespace(targets=np.array([0, 1]), position=np.tile([0, 30e-6, 40e-6], (2, 1)), wide=None, turned=None,
                           covariance=np.tile(1e-12 * whole * np.diag([0.5, 0.3, 0.2]), (2, 1, 1)), **of)


def path(count: int = 2) -> Any:
    position = np.column_stack([1e-3 * np.arange(count), np.zeros((count, 2))])
    return SimpleNamespace(toolpath=position, length=position[:, 0], rest_from_tcp=SimpleNamespace(position=position),
                           axes=SimpleNamespace(turned_to_rest=lambda vectors, rows: vectors))


@pytest.mark.parametrize(("parts", "split"), [
    ({}, (96, 0, 0, 0)), ({"of_scatter": 30, "of_force": 20, "of_learned": 10}, (36, 20, 30, 10)),
    ({"of_scatter": 200}, (0, 0, 96, 0)), ({"of_scatter": 60, "of_force": 60}, (0, 36, 60, 0)),
    ({"of_scatter": 60, "of_force": 30, "of_learned": 60}, (0, 30, 60, 6)),
    ({"of_scatter": -5, "of_force": -5, "of_learned": -5}, (96, 0, 0, 0))])
def test_the_variance_of_a_prediction_is_shared_out_among_its_causes(parts: dict[str, float], split: tuple[int, ...]) -> None:
    """100 um^2, of which 4 are the cut's; what a cause takes is not there for those behind it, and none is negative."""
    cut: Any = SimpleNamespace(in_covariance=np.full(2, 2e-6), left=np.array([3e-6, 7e-6]), at_depths=((1e-3, 1e-6),),
                               at_slot_depths=((2e-3, 2e-6),))
    job: Any = SimpleNamespace(path=path())
    found = foreseen(job, cut, prediction(100.0, **parts), None)
    for values, expected in zip((found.of_model, found.of_force, found.of_scatter, found.of_learned), split, strict=True):
        np.testing.assert_allclose(values, 1e-12 * expected, atol=1e-21)
    np.testing.assert_allclose(found.size, 50e-6)
    np.testing.assert_allclose(found.cut, [3e-6, 7e-6])
    assert (found.at_depths, found.at_slot_depths) == (cut.at_depths, cut.at_slot_depths)
    assert not found.of_mounting.any()
    assert not found.of_accuracy.any()


def test_what_stands_beside_the_covariance_is_added_to_it() -> None:
    """A seat, an accuracy, springs that are known to a factor."""
    cut: Any = SimpleNamespace(in_covariance=np.zeros(2), left=np.zeros(2), at_depths=(), at_slot_depths=())
    given = prediction(100.0)
    given.wide = SimpleNamespace(missing=np.array([7e-12, 9e-12]))
    given.turned = np.tile(np.diag([1e-12, 2e-12, 3e-12]), (2, 1, 1))
    job: Any = SimpleNamespace(path=path())
    found = foreseen(job, cut, given, np.tile(np.diag([4e-12, 4e-12, 1e-12]), (2, 1, 1)))
    np.testing.assert_allclose(found.of_model, [107e-12, 109e-12])
    np.testing.assert_allclose(found.of_mounting, 6e-12)
    np.testing.assert_allclose(found.of_accuracy, 9e-12)


def known(count: int, **told: Any) -> Foreseen:
    """Nothing of any cause but what is told, of so many targets."""
    names = ("size", "of_model", "of_force", "of_scatter", "of_learned", "of_mounting", "of_accuracy", "cut", "bent", "turned")
    return Foreseen(**{name: np.zeros(count) for name in names} | {"at_depths": (), "at_slot_depths": ()} | told)


def job_of(length_mm: list[float], targets: list[int], tolerance: float = 6e-6) -> Any:
    cell = SimpleNamespace(motion=SimpleNamespace(compliance_std=0.2), force_log=SimpleNamespace(
        form=SimpleNamespace(gain_std=0.04)))

    class Lines:
        feed = np.full(len(length_mm), 0.01)

        def __len__(self) -> int:
            return len(length_mm)

    chosen = CorrectionSettings(tolerance=tolerance, min_spacing=Spacing(1e-3, 0.0))
    return SimpleNamespace(path=SimpleNamespace(toolpath=Lines(), length=1e-3 * np.array(length_mm), cell=cell),
                           targets=np.array(targets), loaded=SimpleNamespace(learned=None),
                           settings=SimpleNamespace(correction=chosen))


def test_each_cause_is_the_root_of_its_variance_or_its_share_of_the_deviation() -> None:
    given = known(2, size=np.array([50e-6, 20e-6]), of_model=np.full(2, 9e-12), of_force=np.full(2, 4e-12),
                  of_scatter=np.full(2, 1e-12), of_learned=np.full(2, 25e-12), of_mounting=np.full(2, 49e-12),
                  of_accuracy=np.full(2, 36e-12), cut=np.array([8e-6, 1e-6]), at_depths=((1.0, 2.0),),
                  at_slot_depths=((3.0, 4.0),))
    found = expected_left(job_of([0, 1], [0, 1]), np.arange(2), given, np.array([4e-6, 0.0]), None)
    for cause, um in {"model": [5, 3], "force": [2, 2], "scatter": [1, 1], "sensor": [2, 0.8], "mounting": [7, 7],
                      "motion": [10, 4], "cut": [8, 1], "learned": [5, 5], "accuracy": [6, 6], "between": [0, 0]}.items():
        np.testing.assert_allclose(1e6 * getattr(found, cause), um, atol=1e-9, err_msg=cause)
    assert (found.at_depths, found.at_slot_depths) == (((1.0, 2.0),), ((3.0, 4.0),))


def test_a_target_leaves_what_the_worse_of_its_two_moves_does() -> None:
    """Of moves that asked for nothing how far the deviation bends, at most half the tolerance evenly distributed where the move
    as given has room for a target at every second of the closest places; of one that was looked at what was seen, if that is
    something; never less than the turn."""
    job = job_of([0, 1, 9, 10.9, 13, 26], [1, 2, 3, 4, 5])
    bent = 1e-6 * np.array([0, 5, 1, 5, 9, 5])
    turned = 1e-6 * np.array([0, 0, 2, 0, 0, 0])
    # Half of 6 um evenly distributed; moves of 2 mm and more may have targets, those of 1 and 1.9 mm not.
    most = 3.0 / np.sqrt(3)
    own = np.array([0, 5, 2, 5, most, most])
    found = _between(job, np.arange(6), known(6, bent=bent, turned=turned), None)
    np.testing.assert_allclose(1e6 * found, np.maximum(own, np.append(own[1:], 0)), atol=1e-9)
    looked: Any = SimpleNamespace(left=np.zeros(3), piece=np.array([3, 3, 5]), square=1e-12 * np.array([2.0, 6.0, -4.0]))
    own = np.array([0, 5, 2, 2, most, 0])
    found = _between(job, np.arange(6), known(6, bent=bent, turned=turned), looked)
    np.testing.assert_allclose(1e6 * found, np.maximum(own, np.append(own[1:], 0)), atol=1e-9)


def test_an_added_target_lies_in_the_move_as_given() -> None:
    """Two were added on a move of 8 mm: each piece of it counts as the whole."""
    job = job_of([0, 3, 6, 8, 9], [0, 1, 2, 3, 4])
    bent = np.full(5, 9e-6)
    found = _between(job, np.array([0, 3, 4]), known(5, bent=bent), None)
    most = 3.0 / np.sqrt(3)
    np.testing.assert_allclose(1e6 * found, [9, most, most, 9, 9], atol=1e-9)
