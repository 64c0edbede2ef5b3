"""Which remedies a budget looks at: those of a cause that matters, each as long as it has not been used yet."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction import remedies as of_remedies
from compensator.correction.expected_left import CAUSES
from compensator.correction.settings import CorrectionSettings, Estimate


def asked(monkeypatch: pytest.MonkeyPatch, left: dict[str, float], *, depths: bool = False, **told: Any) -> list[str]:
    """What is tried for a budget of so many micrometres by cause, of 100 in all; told: of the job."""
    size = {cause: np.full(3, 1e-6 * left.get(cause, 0.0)) for cause in CAUSES}
    rest = SimpleNamespace(std=np.full(3, 100e-6), at_slot_depths=((1e-3, 1e-5),) if depths else (), **size)
    form = SimpleNamespace(gain_std=told.get("gain", 0.01), mounting_std_deg=told.get("seat", 1.0))
    log = SimpleNamespace(revolution=told.get("revolution"), time=told.get("time", np.zeros(3)))
    chosen = CorrectionSettings(**told.get("chosen", {}))
    job: Any = SimpleNamespace(
        left=rest, stiffness=told.get("stiffness"), logged=SimpleNamespace(slot=told.get("slot")),
        predicted=SimpleNamespace(settings=SimpleNamespace(correction=chosen), loaded=None, forces=SimpleNamespace(log=log),
                                  cell=SimpleNamespace(force_log=SimpleNamespace(form=form))))
    monkeypatch.setattr(of_remedies, "advise", lambda loaded: told.get("advice"))
    monkeypatch.setattr(of_remedies, "best_shift", lambda loaded: told.get("shift"))
    return [name for name, _, _ in of_remedies._tried(job)]


NEXT = "mill and log the corrected pass, then correct with --logged-with (and --first-forces)"
STATE = "state the cut in cell.yaml: material, tool_diameter_mm, contact_mm, and the spindle's speed"
DEPTH = "state the depth across the feed, --depth-of-cut (as if it were 0.75 mm)"
SLOTS = "state the depth of the slots along the axis, --slot-depth (as if it were 2 mm)"
SCALE = "measure a milled part and take --scale from verify"
GAIN = "check the force sensor with a known weight, force_log.gain_std 0.003"
SEAT = "read a known weight in two postures, force_log.mounting_std_deg 0.3"
LEARN = "measure this part, compstiff learn, then --learned --repeats setup (at most)"
TESTS = "as many load tests again"
SPEED = "state the spindle's speed, --spindle-rpm (at most)"


@pytest.mark.parametrize(("cause", "remedies"), [
    ("cut", [NEXT, STATE, DEPTH]), ("motion", [SCALE]), ("sensor", [GAIN]), ("mounting", [SEAT]), ("accuracy", [LEARN]),
    ("model", [TESTS]), ("scatter", [SPEED]), ("between", ["--tolerance 2.5 --tighten-zones"]), ("force", []), ("learned", [])])
def test_a_cause_is_looked_at_that_makes_up_a_fiftieth_of_the_mean_square(
    monkeypatch: pytest.MonkeyPatch, cause: str, remedies: list[str]
) -> None:
    """14.2 of 100 um do, 14.1 do not: two per cent is 14.14."""
    assert asked(monkeypatch, {cause: 14.2}) == remedies
    assert asked(monkeypatch, {cause: 14.1}) == []


@pytest.mark.parametrize(("told", "remedies"), [
    ({"depths": True}, [NEXT, STATE, DEPTH, SLOTS]), ({"depths": True, "slot": "known"}, [NEXT, STATE, DEPTH]),
    ({"chosen": {"depth_of_cut": 1e-3}}, [NEXT, STATE]), ({"stiffness": "known"}, [NEXT]),
    ({"stiffness": "known", "depths": True}, [NEXT, SLOTS])])
def test_of_the_cut_that_is_to_be_stated_which_is_not_known(
    monkeypatch: pytest.MonkeyPatch, told: dict[str, Any], remedies: list[str]
) -> None:
    assert asked(monkeypatch, {"cut": 60.0}, **told) == remedies


@pytest.mark.parametrize(("cause", "used", "free"), [
    ("motion", {"chosen": {"scale": Estimate(1.1, 0.05)}}, {"chosen": {}}), ("sensor", {"gain": 0.003}, {"gain": 0.0031}),
    ("mounting", {"seat": 0.3}, {"seat": 0.31}), ("mounting", {"seat": None}, {"seat": 2.0}),
    ("scatter", {"revolution": 0.01}, {"revolution": None}), ("scatter", {"time": None}, {"time": np.zeros(3)})])
def test_what_was_done_already_is_no_remedy(
    monkeypatch: pytest.MonkeyPatch, cause: str, used: dict[str, Any], free: dict[str, Any]
) -> None:
    """Nor is a speed for a log without time, which cannot be averaged by it."""
    assert asked(monkeypatch, {cause: 60.0}, **used) == []
    assert len(asked(monkeypatch, {cause: 60.0}, **free)) == 1


def test_another_stance_is_named_by_its_turn_and_its_shift(monkeypatch: pytest.MonkeyPatch) -> None:
    """The best turn, unless it is the planned one; a shift along its one axis."""
    turns = np.radians([-10.0, 0, 25])
    names = asked(monkeypatch, {}, advice=SimpleNamespace(best=0, planned=1, turn=turns), shift=np.array([0.0, 0.2, 0.0]))
    assert names == ["turn the robot by -10 deg about the tool's axis", "move the work object by +200 mm along base y"]
    assert asked(monkeypatch, {}, advice=SimpleNamespace(best=2, planned=1, turn=turns)) == [
        "turn the robot by +25 deg about the tool's axis"]
    assert asked(monkeypatch, {}, advice=SimpleNamespace(best=1, planned=1, turn=turns), shift=np.array([-0.3, 0, 0])) == [
        "move the work object by -300 mm along base x"]
