"""Which answers contradict themselves, and what an answer says of itself. No fit: models are made up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import judgement as room
from identification.diagnosis.judgement import Cause, Judgement
from identification.diagnosis.power import Showing
from identification.fit.noise_parts import SetUp, VarianceComponents

# Causes that fit nothing, by their labels.
CREEP, PLAY, TILT = ([SimpleNamespace(label=label)] for label in ("creep", "backlash[2]", "bearing_tilt[4]"))
MISTAKE, ROW, VISIT, SCATTER, GAIN = ([SimpleNamespace(key=key)] for key in ("swapped axes", "row", "visit", "scatter", "gain"))


def model(*effects: Any) -> Any:
    """One fitted with these effects."""
    return SimpleNamespace(terms=tuple(SimpleNamespace(effect=effect) for effect in effects))


def answer(verdict: Any, *, fitted: Any = None, **more: Any) -> Judgement:
    """fitted: the extended model, where it is not the plain one."""
    plain, detection = model(), SimpleNamespace()
    lists = {name: value[0] if name == "gain" else tuple(value) for name, value in more.items() if isinstance(value, list)}
    return Judgement(verdict, plain, fitted or plain, **({"detection": detection} | more | lists))


@pytest.mark.parametrize(("verdict", "given"), [
    ("adequate", {}), ("named", {"causes": CREEP, "gain": GAIN}), ("named", {"causes": CREEP + PLAY, "gain": GAIN}),
    ("named", {"bad_rows": ROW}), ("named", {"bad_visits": VISIT}), ("named", {"scatters": SCATTER}),
    ("named", {"causes": CREEP, "gain": GAIN, "companions": PLAY, "alternatives": TILT}),
    ("named", {"causes": CREEP, "gain": GAIN, "bad_rows": ROW}), ("ambiguous", {"alternatives": CREEP + PLAY}),
    ("ambiguous", {"alternatives": CREEP, "mistakes": MISTAKE}), ("ambiguous", {"mistakes": MISTAKE * 2}),
    ("unknown", {}), ("unknown", {"alternatives": CREEP, "withdrawn": {"creep": "no use"}}), ("unknown", {"bad_rows": ROW}),
    ("mistake", {"mistakes": MISTAKE}), ("mistake", {"mistakes": MISTAKE * 3})])
def test_an_answer_may_be_this(verdict: str, given: dict[str, Any]) -> None:
    assert answer(verdict, **given).verdict == verdict


@pytest.mark.parametrize(("verdict", "given"), [
    *(("adequate", given) for given in (
        {"causes": CREEP}, {"alternatives": CREEP}, {"withdrawn": {"creep": "no"}}, {"gain": GAIN}, {"mistakes": MISTAKE},
        {"bad_rows": ROW}, {"bad_visits": VISIT}, {"scatters": SCATTER})),
    *(("named", given) for given in (
        {}, {"causes": CREEP}, {"causes": CREEP, "gain": GAIN, "withdrawn": {"backlash[2]": "no"}},
        {"causes": CREEP, "gain": GAIN, "mistakes": MISTAKE}, {"bad_rows": ROW, "mistakes": MISTAKE},
        {"causes": CREEP * 2, "gain": GAIN}, {"causes": CREEP, "gain": GAIN, "companions": CREEP},
        {"causes": CREEP, "gain": GAIN, "alternatives": CREEP}, {"bad_rows": ROW, "companions": PLAY},
        {"causes": CREEP, "gain": GAIN, "companions": PLAY, "alternatives": TILT + PLAY})),
    *(("ambiguous", given) for given in (
        {}, {"alternatives": CREEP}, {"alternatives": CREEP * 2}, {"mistakes": MISTAKE},
        {"alternatives": CREEP + PLAY, "causes": TILT}, {"alternatives": CREEP + PLAY, "withdrawn": {"creep": "no"}})),
    *(("unknown", given) for given in ({"causes": CREEP}, {"mistakes": MISTAKE}, {"fitted": model()})),
    *(("mistake", given) for given in (
        {}, {"mistakes": MISTAKE, "causes": CREEP}, {"mistakes": MISTAKE, "alternatives": CREEP},
        {"mistakes": MISTAKE, "withdrawn": {"creep": "no"}}))])
def test_an_answer_that_contradicts_itself_is_refused(verdict: str, given: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"^{verdict} with causes"):
        answer(verdict, **given)


def test_a_name_that_is_taken_back_is_the_nearest_one() -> None:
    """With all that came with it; the model that had it is the one that was tried."""
    found = answer("named", fitted=model(), causes=CREEP, gain=GAIN, companions=PLAY, alternatives=TILT, law_differs=True,
                   log_odds=7.0, robot_difference=1e-6, next_loads=(SimpleNamespace(),), carried=model(), patterns=("seen",))
    back = found.as_unknown(("far off",))
    assert [each.label for each in back.alternatives] == ["creep", "backlash[2]", "bearing_tilt[4]"]
    assert (back.verdict, back.extended, back.tried) == ("unknown", found.plain, found.extended)
    assert (back.causes, back.companions, back.gain, back.next_loads, back.rivals, back.mistakes) == ((), (), None, (), (), ())
    assert (back.robot_difference, back.log_odds, back.carried) == (None, None, None)
    assert (back.withdrawn, back.law_differs) == ({}, False)
    assert back.patterns == ("far off",)


@pytest.mark.parametrize(("visits", "rows", "said", "count"), [
    ((), (), "", 0), ((1,), (), "the reading of P0", 1), ((3, 1), (7,), "the 3 readings of P0, the reading of P1, row 7", 5),
    ((2,), (7, 8, 9), "the 2 readings of P0, row 7, row 8, row 9", 5),
    ((2, 2), (7, 8, 9), "the 2 readings of P0, the 2 readings of P1, row 7, row 8 and 1 more", 7)])
def test_what_was_left_out_is_told_by_name_the_first_four(
    visits: tuple[int, ...], rows: tuple[int, ...], said: str, count: int) -> None:
    found = answer("unknown", bad_visits=tuple(SimpleNamespace(score=SimpleNamespace(name=f"P{k}", rows=range(size)))
                                               for k, size in enumerate(visits)),
                   bad_rows=tuple(SimpleNamespace(row=row) for row in rows))
    assert found.dropped == (said, count)


def test_of_what_goes_unnoticed_that_comes_first_which_moves_the_tool_most() -> None:
    """What ten times its typical size would not show stands last; what would have shown is not among them."""
    entry: Any = None
    sizes = {"shown": (1.0, 9e-5), "small": (1.01, 2e-5), "far": (10.1, 8e-4), "large": (5.0, 3e-4), "just": (10.0, 5e-4),
             "farther": (900.0, 9e-2)}
    every = tuple(Showing(entry, size, 1.0, largest, np.full(6, k), False) for k, (size, largest) in enumerate(sizes.values()))
    found = answer("adequate", showing=every).overlooked
    # A typical one moves the tool by 20, 80, 60, 50 and 100 um.
    assert [list(sizes)[int(each.springs[0])] for each in found] == ["large", "just", "small", "farther", "far"]


def test_springs_that_changed_are_told_of_any_model_that_an_answer_has() -> None:
    still, warm = SimpleNamespace(unsettles=False), SimpleNamespace(unsettles=True)
    sets: Any = {"alternatives": CREEP + PLAY}
    assert not answer("ambiguous", fitted=model(still), **sets).unsettled
    assert answer("ambiguous", fitted=model(still, warm), **sets).unsettled
    assert answer("ambiguous", carried=model(warm), **sets).unsettled
    rivals = tuple(SimpleNamespace(fitted=model(effect)) for effect in (still, warm))
    assert answer("ambiguous", rivals=rivals, **sets).unsettled
    assert not answer("ambiguous", carried=model(still), rivals=rivals[:1], **sets).unsettled


@pytest.mark.parametrize(("verdict", "given", "settle"), [
    ("ambiguous", {"alternatives": CREEP + PLAY}, True), ("ambiguous", {"alternatives": CREEP, "mistakes": MISTAKE}, False),
    ("ambiguous", {"mistakes": MISTAKE * 2}, False), ("unknown", {"alternatives": CREEP + PLAY}, False)])
def test_loads_settle_which_of_several_causes_it_is_and_no_mistake(
    verdict: str, given: dict[str, Any], settle: bool) -> None:
    assert answer(verdict, **given).loads_settle is settle


@pytest.mark.parametrize(("given", "small"), [
    ({}, True), ({"robot_difference": 2.02e-6}, False), ({"robot_difference": None}, False), ({"carried": None}, False),
    ({"mistakes": MISTAKE}, False), ({"carried": model(SimpleNamespace(unsettles=True))}, False)])
def test_a_choice_is_small_beside_what_was_measured(given: dict[str, Any], small: bool) -> None:
    """Under a fiftieth of the 100 um (RMS) that these rows deflect, what was not measured counted as nothing."""
    found = answer("ambiguous", **({"alternatives": CREEP + PLAY, "carried": model(), "robot_difference": 1.98e-6} | given))
    plain: Any = found.plain
    plain.data = SimpleNamespace(rows=SimpleNamespace(
        deflection=1e-4 * np.array([[np.sqrt(3), 0, 0], [0, 0, -np.sqrt(3)], [np.nan, np.sqrt(3), 0]])))
    assert found.rows is plain.data.rows
    assert found.choice_is_small is small


@pytest.mark.parametrize(("verdict", "given", "sensor"), [
    ("named", {"causes": CREEP, "gain": GAIN}, None), ("adequate", {}, None),
    ("ambiguous", {"alternatives": CREEP + PLAY}, 2.5), ("unknown", {}, 1.0), ("mistake", {"mistakes": MISTAKE}, 1.0)])
def test_what_the_noise_allows_has_not_grown_for_want_of_a_cause(
    monkeypatch: pytest.MonkeyPatch, verdict: str, given: dict[str, Any], sensor: float | None) -> None:
    """Without a name as stated, or as is usual; the sensor's own where nobody stated it, no part beyond the usual otherwise."""
    monkeypatch.setattr(room, "residual_std", lambda data, components, compliance: components)
    found = answer(verdict, **given)
    plain: Any = found.plain
    plain.components = VarianceComponents(2.5, 3.0, 0.5, 4.0, 5.0, 6.0, 3.0, next(iter(SetUp)))
    plain.compliance = plain.data = None
    stated = (sensor == 1.0, False, False, True, False, False)
    plain.at_map = SimpleNamespace(noise=SimpleNamespace(stated=stated))
    told: Any = found.expected_std
    if sensor is None:
        assert told is plain.components
        return
    assert told.values.tolist() == [sensor, 1.0, 0.5, 1.0, 0.0, 0.0]
    assert told.degrees == np.inf


def test_parts_that_want_other_springs_are_those_that_do(monkeypatch: pytest.MonkeyPatch) -> None:
    every: list[Any] = [SimpleNamespace(is_conflict=k % 2 == 1) for k in range(4)]
    monkeypatch.setattr(room, "subset_conflicts", lambda fitted: every)
    assert answer("unknown").conflicts == (every[1], every[3])


@pytest.mark.parametrize("open_laws", [{}, {"soft_zone": 0.3}])
def test_a_cause_whose_law_is_open_is_told_by_what_its_laws_have_in_common(open_laws: dict[str, float]) -> None:
    effect: Any = SimpleNamespace(law_family="gear {joint} gives way about no load", told=lambda joint: f"play in gear {joint}")
    said = "gear 3 gives way about no load" if open_laws else "play in gear 3"
    assert Cause(effect, 3, 0.9, open_laws).sentence == said
