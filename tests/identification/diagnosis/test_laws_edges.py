"""Each side of the limits by which scatter is named, a row is bad, a cause is doubted, looked for further or held for enough:
worked out by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from identification.diagnosis import detect, explaining, gross, procedure, swing
from identification.diagnosis.explained import explained
from identification.diagnosis.explaining import Explaining, Explanation, louder, strained
from identification.diagnosis.in_words import more_at_work
from identification.diagnosis.judgement import Judgement
from identification.diagnosis.odds import certain, doubt_of
from identification.diagnosis.procedure import Procedure, least_odds, nearly_all
from identification.diagnosis.projection import evidence, room
from identification.diagnosis.search import log_prior
from identification.diagnosis.share import share_of
from identification.diagnosis.swing import swing_of
from identification.diagnosis.unsettled import unsettled_zero_of
from identification.fit.mistakes.judge import Mistakes
from identification.fit.noise_parts import VarianceComponents
from identification.fit.student import probability_beyond

Array = NDArray[np.float64]
SIGMA = 2e-6
# Loads of a pose that cancel: their readings meet in the mean, with a degree of freedom left.
CANCELLING = np.array([0.0, 0.0, 100.0, -100.0, 200.0, -200.0])
# What is left of them, orthogonal to a constant and to the load, and its squared length.
BESIDE = np.array([0.0, 0.0, 1.0, 1.0, -1.0, -1.0])


def poses(aside: list[float], *, zeros: float = 1.0, off_balance: float = 0.0, single: int = 0) -> Any:
    """A fit of poses with two zero readings and four loaded ones along z, whose zeros lie so many sigmas aside, along each
    axis; of either the scatter in a pose is known: `zeros` and 0.5 sigma^2. off_balance: what the loads are off on average, in
    their own standard deviations. In the last `single` poses one zero reading is lost."""
    count, loads = len(aside), CANCELLING.copy()
    loads[2:] += off_balance * np.std(loads[2:])
    scatter = 0.5 * BESIDE + np.sqrt(zeros / 2) * np.array([1.0, -1.0, 0, 0, 0, 0])
    along = np.array([scatter + one * (CANCELLING == 0) for one in aside])
    along[count - single:, 0] = np.nan
    along[count - single:, 1] = np.array(aside)[count - single:]
    wrench = np.zeros((6 * count, 6))
    wrench[:, 2] = np.tile(loads, count)
    rows = SimpleNamespace(wrench=wrench, visit=np.repeat(np.arange(count), 6), sigma=np.full((6 * count, 3), np.nan))
    data = SimpleNamespace(rows=rows, cell=SimpleNamespace(noise=SimpleNamespace(deflection=np.full(3, SIGMA))))
    return SimpleNamespace(data=data, residual=SIGMA * np.repeat(along.reshape(-1, 1), 3, axis=1))


# Of the mean of two zeros that scatter by 1, less that of four loaded readings that scatter by 0.5.
VARIANCE = 1 / 2 + 0.5 / 4


def as_rare(chance: float, poses_of: int, of: int) -> float:
    """How far aside zeros lie that so many poses show by chance so often: of three axes each, against three times two degrees
    that each of all poses leaves of its loaded readings."""
    return float(np.sqrt(VARIANCE * stats.f.isf(chance, 3 * poses_of, 6 * of)))


@pytest.mark.parametrize(("chance", "seen"), [(1.1e-3, False), (0.9e-3, True)])
def test_zeros_that_lie_aside_are_rarer_by_chance_than_one_in_a_thousand(chance: float, seen: bool) -> None:
    aside = as_rare(chance, 6, 6)
    found = unsettled_zero_of(poses([aside] * 6))
    assert (found is not None) is seen
    if found is not None:
        assert found.p_value == pytest.approx(chance)
        assert found.size == pytest.approx(SIGMA * np.sqrt(aside**2 - VARIANCE))
        # A mean square of 18 numbers is known to a third, its root to a sixth; of that the scatter is a part.
        assert found.log_std == pytest.approx(1 / 6 / (1 - VARIANCE / aside**2))
        assert found.largest == found.size


@pytest.mark.parametrize(("chance", "seen"), [(0.011, False), (0.009, True)])
def test_zeros_lie_aside_without_the_pose_that_speaks_most_for_it(chance: float, seen: bool) -> None:
    """By less than one in a hundred at the other five; together by far less than one in a thousand."""
    assert (unsettled_zero_of(poses([*[as_rare(chance, 5, 6)] * 5, 9.0])) is not None) is seen


@pytest.mark.parametrize(("count", "seen"), [(3, False), (4, True)])
def test_zeros_lie_aside_at_four_poses(count: int, seen: bool) -> None:
    assert (unsettled_zero_of(poses([9.0] * count)) is not None) is seen


@pytest.mark.parametrize("place", [0, 5])
@pytest.mark.parametrize("lost", [(0, 1), (4, 5), (3, 4, 5), (2, 3, 4, 5), ()])
def test_a_pose_without_zeros_or_without_loads_to_hold_them_against_says_nothing_of_zeros(
        lost: tuple[int, ...], place: int) -> None:
    """No reading of two that lost them, or two loads or fewer are left of four, or all push one way: what the other five say
    stands, those behind it too."""
    whole, spoiled = unsettled_zero_of(poses([9.0] * 5)), poses([9.0] * 6)
    spoiled.residual[6 * place + np.array(lost, dtype=np.intp)] = np.nan
    if not lost:
        spoiled.data.rows.wrench[6 * place: 6 * place + 6, 2] = [0.0, 0.0, 200.0, 210.0, 220.0, 230.0]
    found = unsettled_zero_of(spoiled)
    assert whole is not None
    assert found is not None
    assert (found.size, found.p_value) == (pytest.approx(whole.size), pytest.approx(whole.p_value))


def test_three_loads_that_cancel_leave_a_degree_to_hold_zeros_against() -> None:
    """The pose speaks as the others do: so much of six is rarer than of five."""
    five, six = poses([9.0] * 5), poses([9.0] * 6)
    six.residual[5] = np.nan
    told = [found.p_value for found in map(unsettled_zero_of, (five, six)) if found is not None]
    assert len(told) == 2
    assert told[1] < 0.2 * told[0]


@pytest.mark.parametrize(("squared", "seen"), [(0.9, True), (1.1, False)])
def test_loads_cancel_that_are_off_by_less_than_they_scatter(squared: float, seen: bool) -> None:
    """Where the place at which their readings meet is known half as well as their mean."""
    assert (unsettled_zero_of(poses([9.0] * 6, off_balance=np.sqrt(squared))) is not None) is seen


@pytest.mark.parametrize(("single", "seen"), [(1, True), (0, False)])
def test_ten_repeated_zeros_tell_their_own_scatter(single: int, seen: bool) -> None:
    """Four poses of three axes: twelve degrees say that the zeros scatter by 30; of nine the loaded ones' 0.5 is believed."""
    assert (unsettled_zero_of(poses([3.0] * 4, zeros=30.0, single=single)) is not None) is seen


@pytest.mark.parametrize(("count", "chance", "without", "seen"), [
    (4, 0.9e-3, 0.009, True), (3, 0.9e-3, 0.009, False), (4, 1.1e-3, 0.009, False), (4, 0.9e-3, 0.011, False)])
def test_a_swing_is_seen_at_four_poses_and_without_the_loudest(
        monkeypatch: pytest.MonkeyPatch, count: int, chance: float, without: float, seen: bool) -> None:
    class Sizes:
        def __init__(self, groups: Any, start: Array) -> None:
            # Half a newton and half a per cent where nothing is stated, which they are not.
            assert np.exp(start[:3]) == pytest.approx([1.0, 0.5, 0.005])
            self.by_chance, self.best = chance, (start, 0.0)

        def without_loudest(self) -> Any:
            return SimpleNamespace(by_chance=without)

        def cost(self, logs: Array) -> float:
            return float(50 * (logs[3] - self.best[0][3]) ** 2)

    monkeypatch.setattr(swing, "nothing_hangs", lambda state: "")
    monkeypatch.setattr(swing, "_groups", lambda fitted: [SimpleNamespace(values=[0.0] * some) for some in (2, count - 2)])
    monkeypatch.setattr(swing, "_Sizes", Sizes)
    monkeypatch.setattr(swing, "_across", lambda *of: np.eye(3)[None])
    noise = SimpleNamespace(force=np.zeros(3), force_relative=0.0)
    fitted: Any = SimpleNamespace(load_state=SimpleNamespace(fall=None), compliance=None,
                                  data=SimpleNamespace(cell=SimpleNamespace(noise=noise)))
    found = swing_of(fitted)
    assert (found is not None) is seen
    if found is not None:
        assert found.log_std == pytest.approx(0.1)


def test_force_errors_are_known_to_a_factor_of_two_beside_a_swing() -> None:
    """ln 2: by one sigma either way half a unit of ln less likely, for what is the same along the load and across it. What the
    visits say of a size counts all of it."""
    group: Any = SimpleNamespace(values=np.zeros((2, 1)), log_likelihood=lambda squared: np.zeros(2))
    telling: Any = SimpleNamespace(values=np.zeros((2, 1)), log_likelihood=lambda squared: np.array([3.0, -1.5]))
    sizes = swing._Sizes((group,), np.zeros(4))
    assert swing._Sizes((group, telling), np.zeros(4)).cost(np.array([0.0, 0.7, 0.0, 0.0])) == pytest.approx(0.5 - 1.5)
    for off, cost in (([0.0, 0.7, 0.0, 0.0], 0.5), ([0.0, 0.0, -1.4, 0.0], 2.0), ([9.0, 0.0, 0.0, 9.0], 0.0)):
        assert sizes.cost(np.array(off)) == pytest.approx(cost)


@pytest.mark.parametrize(("p_value", "doubted"), [(0.0054, True), (0.0046, False)])
def test_a_name_needs_what_one_in_two_hundred_data_sets_shows(p_value: float, doubted: bool) -> None:
    detection: Any = SimpleNamespace(p_value=p_value, resolution=0.001)
    assert bool(doubt_of(detection, 6.8)) is doubted
    # Or a thousand to one against nothing (ln 6.9).
    assert not doubt_of(detection, 7.0)


@pytest.mark.parametrize(("together", "each", "expected"), [
    (0.96, 0.1, True), (0.94, 0.1, False), (0.94, 0.96, True), (0.94, 0.94, False), (0.51, 0.96, True), (0.49, 0.96, False)])
def test_certain_are_nineteen_in_twenty_or_each_while_the_set_is_likelier_than_not(
        together: float, each: float, expected: bool) -> None:
    cause: Any = SimpleNamespace(probability=each)
    assert certain(together, (cause, cause)) is expected


def fit(**components: Any) -> Any:
    """A fit with these sizes of the noise, each known to a tenth (ln); the sensor's is stated."""
    return SimpleNamespace(components=VarianceComponents(**components), components_log_std=np.full(6, 0.1),
                           at_map=SimpleNamespace(noise=SimpleNamespace(stated=(True,) * 6)))


def test_set_ups_that_differ_by_three_tenths_of_a_per_cent_ask_for_a_hundred_to_one() -> None:
    assert least_odds(fit(setup=2.9)) == pytest.approx(np.log(1000))
    assert least_odds(fit(setup=3.1)) == pytest.approx(np.log(100))


@pytest.mark.parametrize(("components", "odd"), [
    ({"setup": 2.9}, False), ({"setup": 3.1}, True), ({"memory": 9.7}, False), ({"memory": 10.3}, True),
    ({"degrees": 3.3}, False), ({"degrees": 3.0}, True)])
def test_a_noise_is_strained_by_these_sizes(components: dict[str, float], odd: bool) -> None:
    assert bool(strained(fit(**components))) is odd


@pytest.mark.parametrize(("times", "loud"), [(0.97, False), (1.03, True)])
def test_sensors_are_louder_that_scatter_by_half_as_much_again_with_95_per_cent(times: float, loud: bool) -> None:
    assert louder(fit(sensor=float(times * 1.5 * np.exp(0.1 * stats.norm.isf(0.05))))) == loud


def explanation(p_value: float, value: float = 0.0) -> Explanation:
    named: Any = SimpleNamespace(fitted=SimpleNamespace(terms=(), value=value))
    adequacy: Any = SimpleNamespace(p_value=p_value)
    return Explanation(named, adequacy, {})


@pytest.mark.parametrize(("p_value", "gained", "likelier"), [
    (0.0054, 9.8, False), (0.0054, 10.2, True), (0.0046, 2.8, False), (0.0046, 3.2, True)])
def test_other_causes_are_far_likelier_than_those_that_explain_the_rows(
        monkeypatch: pytest.MonkeyPatch, p_value: float, gained: float, likelier: bool) -> None:
    """By e^10; than those whose misfit chance makes in less than one of two hundred by e^3."""
    monkeypatch.setattr(explaining, "log_evidence", lambda fitted: fitted.value)
    assert explanation(p_value).enough is (p_value > 0.005)
    assert explanation(0.5, gained).likelier_than(explanation(p_value)) is likelier


@pytest.mark.parametrize(("excess", "share", "nearly"), [
    (2.1, 0.975, True), (1.9, 0.975, False), (2.1, 0.965, False), (30.0, 0.965, False)])
def test_a_misfit_of_twice_the_noise_has_its_cause_where_all_but_a_thirtieth_is_explained(
        monkeypatch: pytest.MonkeyPatch, excess: float, share: float, nearly: bool) -> None:
    monkeypatch.setattr(procedure, "explained", lambda *of: SimpleNamespace(excess=excess, share=share))
    nothing: Any = None
    assert nearly_all(nothing, nothing) is nearly


def test_a_misfit_is_held_against_noise_that_is_half_as_large_again_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of squares of 90 under the stated noise, 60 readings and re-seating that has grown threefold: as of 1.5 times."""
    def weights(components: VarianceComponents) -> Any:
        return SimpleNamespace(inner=lambda left, right: np.sum(left * right) / components.offset**2 * np.ones((1, 1)))

    noise = SimpleNamespace(whitening=np.tile(np.eye(3), (22, 1, 1)), weights=weights)
    monkeypatch.setattr("identification.diagnosis.explained.noise_model", lambda *of: noise)

    def model(squares: float) -> Any:
        return SimpleNamespace(residual=np.full((22, 3), np.sqrt(squares / 66)), readings=66, data=None, compliance=None,
                               components=VarianceComponents(offset=3.0))

    found = explained(model(60 * 9.0), model(60 * 3.6))
    assert found.excess == pytest.approx(9.0 / 1.5**2)
    assert found.share == pytest.approx(1 - (3.6 / 2.25 - 1) / (9.0 / 2.25 - 1))


@pytest.mark.parametrize(("reached", "again"), [(0, False), (1, True), (16, True), (17, False)])
def test_five_times_as_many_replicates_are_drawn_where_so_many_leave_it_open(
        monkeypatch: pytest.MonkeyPatch, reached: int, again: bool) -> None:
    """Of 199: one at least in two hundred, and under nine in a hundred."""
    drawn = np.append(5.0, np.where(np.arange(199) < reached, 6.0, 4.0))
    monkeypatch.setattr(detect, "surprise", lambda *of: (drawn, np.zeros((0, 200))))
    noise: Any = SimpleNamespace(readings=9, draw=lambda rng, count: None)
    nothing: Any = None
    found = detect.detect(nothing, nothing, (), [noise], np.random.default_rng(0))
    assert found.resolution == 1 / (996 if again else 200)
    assert found.p_value == pytest.approx((1 + reached * (5 if again else 1)) * found.resolution)


class Visits:
    """Rows in visits of thirty, as far as a share of them asks."""

    def __init__(self, visit: NDArray[np.intp]) -> None:
        self.visit, self.validate, self.wrench = visit, np.zeros(len(visit), dtype=bool), np.zeros((len(visit), 6))

    def __len__(self) -> int:
        return len(self.visit)

    def select(self, mask: NDArray[np.bool_]) -> Visits:
        return Visits(self.visit[mask])


@pytest.mark.parametrize(("visits", "kept"), [(79, 79), (80, 40)])
def test_forty_visits_are_left_of_a_long_file(visits: int, kept: int) -> None:
    """Of some 2400 rows every second visit would do; else fewer rows of each."""
    rows: Any = Visits(np.repeat(np.arange(visits), 30))
    few, share = share_of(rows)
    assert share is not None
    assert len(np.unique(few.visit)) == kept
    assert share.rows == len(few) < 1500


def test_causes_are_as_likely_beforehand_as_there_are_many() -> None:
    """One in nine of ten, two in nine of a hundred, three in one of a hundred; any of ten, of 45 pairs, of 120 threes."""
    assert np.exp([log_prior(size, 10) for size in (1, 2, 3)]) == pytest.approx([0.9 / 10, 0.09 / 45, 0.01 / 120])


@pytest.mark.parametrize(("poses_out", "likely", "verdict"), [(2, 0.1, "named"), (3, 0.1, "unknown"), (3, 0.51, "named"),
                                                             (3, 0.49, "unknown")])
def test_three_poses_that_no_likely_slip_explains_are_no_chance(
        monkeypatch: pytest.MonkeyPatch, poses_out: int, likely: float, verdict: str) -> None:
    bad = tuple(SimpleNamespace(score=SimpleNamespace(name=f"P{k}", wrong_angle=None),
                                mends=(SimpleNamespace(probability=likely),)) for k in range(poses_out))
    monkeypatch.setattr(procedure, "with_mends", lambda *of: bad)
    monkeypatch.setattr(procedure, "replace", lambda thing, **changed: SimpleNamespace(**{**vars(thing), **changed}))
    again = SimpleNamespace(verdict="adequate", patterns=())
    data = SimpleNamespace(rows=SimpleNamespace(row=np.arange(9), select=lambda mask: None), with_rows=lambda rows: None)
    itself: Any = SimpleNamespace(data=data, judged=lambda: None, without_bad_rows=lambda judgement: again)
    judgement: Any = SimpleNamespace(verdict="unknown", rows=None, mistakes=())
    test: Any = SimpleNamespace(rest=0, bad=[SimpleNamespace(rows=np.array([k])) for k in range(poses_out)])
    assert Procedure.without_bad_visits(itself, judgement, test).verdict == verdict


def test_what_would_not_show_at_ten_times_its_size_is_told_last() -> None:
    """Of causes that would not have been noticed at their typical size those first that move the tool most."""
    showing = tuple(SimpleNamespace(of_typical_size=size <= 1, size=size, typical_largest=moves) for size, moves in (
        (0.5, 9.0), (1.1, 1.0), (9.0, 2.0), (11.0, 8.0), (30.0, 7.0)))
    overlooked: Any = Judgement.overlooked
    assert [each.size for each in overlooked.fget(SimpleNamespace(showing=showing))] == [9.0, 1.1, 11.0, 30.0]


@pytest.mark.parametrize(("rows", "alone", "company", "bad"), [
    (19, 0, 5, False), (21, 0, 5, True), (24, 12, 5, False), (24, 11, 5, True), (24, 0, 2, False), (24, 0, 3, True)])
def test_a_row_is_bad_among_twenty_with_two_more_at_its_pose(
        monkeypatch: pytest.MonkeyPatch, rows: int, alone: int, company: int, bad: bool) -> None:
    """One far off of so many (one of twenty is a twentieth), of which so many are alone at their poses and the bad one has so
    many at its own. Ten others are left once it is out, and two more that it might have hidden behind."""
    visit = np.concatenate([np.zeros(company), np.ones(rows - company - alone), 2 + np.arange(alone)]).astype(np.intp)
    distance = np.random.default_rng(1).chisquare(3, rows)
    distance[1] = 40.0**2
    monkeypatch.setattr(gross, "distances", lambda *of: (distance, np.full(rows, 3)))
    monkeypatch.setattr(gross, "residual_std", lambda *of: np.ones((rows, 3)))
    monkeypatch.setattr(gross, "row_mend", lambda *of: None)
    table = Visits(visit)
    table.__dict__ |= {"row": np.arange(1, rows + 1), "line": np.arange(2, rows + 2)}
    noise = SimpleNamespace(visit=visit, further=None)
    fitted: Any = SimpleNamespace(
        data=SimpleNamespace(rows=table), at_map=SimpleNamespace(noise=noise, residual=None), terms=(), term_values=(),
        components=None, weights=None, compliance=None, residual=np.ones((rows, 3)))
    assert [one.row for one in gross.bad_rows(fitted)] == [2] * bad


@pytest.mark.parametrize(("chance", "bad"), [(5.5e-4, False), (4.5e-4, True)])
def test_a_row_is_bad_that_chance_makes_in_one_of_two_thousand(chance: float, bad: bool) -> None:
    """Over all of sixty rows, in the tails that the others leave open (test_laws_student.py)."""
    distance, count = np.random.default_rng(2).chisquare(3, 60), np.full(60, 3)
    low, high = 10.0, 1e4
    for _ in range(60):
        distance[7] = np.sqrt(low * high)
        others = np.arange(60) != 7
        rarer = 60 * probability_beyond(float(distance[7]), 3, distance[others], count[others]) < chance
        low, high = (low, distance[7]) if rarer else (distance[7], high)
    found = gross.rare(distance, count, np.ones(60, dtype=bool), 3.0)
    assert found == ({7: pytest.approx(chance, rel=1e-3)} if bad else {})


@pytest.mark.parametrize(("p_value", "more"), [(0.045, True), (0.055, False)])
def test_something_more_is_at_work_where_one_in_twenty_would_show_what_is_left(p_value: float, more: bool) -> None:
    judgement: Any = SimpleNamespace(verdict="named", causes=("a cause",), law_differs=False,
                                     adequacy=SimpleNamespace(p_value=p_value))
    assert more_at_work(judgement) is more


@dataclass(frozen=True)
class Told:
    """A judgement, or a cause, as far as names ask."""

    extended: Any = None
    plain: Any = None
    detection: Any = None
    verdict: str = ""
    causes: tuple[Any, ...] = ()
    companions: tuple[Any, ...] = ()
    alternatives: tuple[Any, ...] = ()
    gain: Any = None
    log_odds: float | None = None
    robot_difference: float | None = None
    carried: Any = None
    withdrawn: dict[str, str] | None = None
    patterns: tuple[str, ...] = ()
    law_differs: bool = False
    tried: Any = None
    adequacy: Any = None
    scatter: Any = None
    lost: tuple[str, ...] = ()
    mistakes: tuple[Any, ...] = ()
    expected_std: Array = field(default_factory=lambda: np.full((4, 3), 2e-6))


@pytest.mark.parametrize(("changed", "small"), [
    ({}, True), ({"robot_difference": 2.05e-7}, False), ({"verdict": "named"}, False), ({"carried": None}, False),
    ({"unsettled": True}, False), ({"mistakes": ("a mistake",)}, False), ({"robot_difference": None}, False)])
def test_a_choice_is_small_that_changes_a_correction_by_under_two_per_cent_of_what_was_measured(
        changed: dict[str, Any], small: bool) -> None:
    """Of 10 um, root mean square of all components, a reading that was not taken counted as nothing."""
    deflection = np.array([[2e-5, 0.0, np.nan], [0.0, 1e-5, -1e-5]])
    judgement = SimpleNamespace(**{"verdict": "ambiguous", "carried": "a model", "unsettled": False, "mistakes": (),
                                   "robot_difference": 1.95e-7, "rows": SimpleNamespace(deflection=deflection)} | changed)
    assert vars(Judgement)["choice_is_small"].fget(judgement) is small


@dataclass(frozen=True)
class One:
    """A cause."""

    label: str
    probability: float
    effect: Any = None
    joint: int | None = 1
    open_laws: dict[str, float] = field(default_factory=dict)


def named(monkeypatch: pytest.MonkeyPatch, *, difference_um: float = 0.0, far: float = 1.0, share: float = 1.0,
          others: Sequence[float] = (), p_value: float = 0.001, **answers: Any) -> Any:
    """What becomes of a set of one cause with this share of the probability, the rest of it with another law of the same gear;
    others: probabilities of causes beside; p_value: of the misfit by chance; answers: of other steps than usual."""
    play = One("play", share, SimpleNamespace(name="play"))
    names = (play, *(One(f"other {k}", value) for k, value in enumerate(others)))
    best: Any = SimpleNamespace(key=frozenset({0}), probability=share, log_evidence=9.0)
    soft = SimpleNamespace(key=frozenset({1}), probability=1 - share)
    entries = SimpleNamespace(entries=[One("play", share), One("soft", 0.5)])
    seen: Any = SimpleNamespace(hypotheses=(best, soft), dictionary=entries)
    extended = SimpleNamespace(terms=(SimpleNamespace(label="play", effect=play.effect),))
    for name, answer in (
            ("no_names", frozenset()), ("inclusion", names), ("kindred", (best, soft)), ("rivals_of", {"play": ("a", 0.6)}),
            ("with_open_laws", (replace(play, probability=0.99, open_laws={"soft": 0.4}),)), ("with_free_laws", "free"),
            ("robot_difference", 1e-6 * difference_um), ("far_off", far), ("of_nothing", set()), ("log_odds", 99.0),
            ("only_local", False), ("told_by_one_visit", False), ("gain", SimpleNamespace(support=99.0, held_out="poses"))):
        given = answers.get(name, answer)
        monkeypatch.setattr(procedure, name, lambda *of, answer=given: answer)
    monkeypatch.setattr(procedure, "replace", lambda thing, **changed: thing if thing is seen else replace(thing, **changed))
    monkeypatch.setattr(Procedure, "ambiguous", lambda *of: Told(verdict="ambiguous"))
    detection = SimpleNamespace(p_value=p_value, resolution=0.001, seen_patterns=("a pattern",))
    judgement: Any = Told(extended, SimpleNamespace(components=VarianceComponents(), data=None), detection)
    nothing: Any = None
    return Procedure(nothing, {}, 0.05, 10, 0).with_names(judgement, seen, best, frozenset())


UNHELPFUL = SimpleNamespace(support=-4.0, held_out="poses")


@pytest.mark.parametrize(("p_value", "answers", "why"), [
    (0.001, {"of_nothing": {"play"}}, "all its parameters lie within two of their standard deviations of nothing"),
    (0.001, {"log_odds": -1.0}, "a larger noise explains the readings as well as it does"),
    (0.02, {"log_odds": 5.0}, "2.0% of data sets without any cause show as much: too many for a name"),
    (0.02, {"log_odds": 7.0}, ""),
    (0.02, {"only_local": True}, "2.0% of data sets without any cause show as much: too many for a name"),
    (0.001, {"gain": UNHELPFUL}, "it makes readings that were not fitted (poses) less likely, by a factor 55"),
    (0.001, {"gain": UNHELPFUL, "only_local": True}, ""), (0.001, {"gain": UNHELPFUL, "told_by_one_visit": True}, "")])
def test_a_name_that_is_withdrawn_says_why(monkeypatch: pytest.MonkeyPatch, p_value: float, answers: dict[str, Any], why: str
                                           ) -> None:
    """What touches one pose alone needs an alarm, and no reading at another pose can speak for it or against it."""
    found = named(monkeypatch, p_value=p_value, **answers)
    assert found.verdict == ("unknown" if why else "named")
    if why:
        assert found.withdrawn == {"play": why}
        assert found.patterns == ("a pattern",)
        assert [cause.label for cause in found.alternatives] == ["play"]


@pytest.mark.parametrize(("sets", "verdict"), [
    ([((0, 1), 0.5), ((0,), 0.3), ((0, 2), 0.16), ((2,), 0.04)], "named"),
    ([((0, 1), 0.5), ((0,), 0.3), ((0, 2), 0.14), ((2,), 0.06)], "ambiguous"),
    ([((0, 1), 0.5), ((1,), 0.3), ((1, 2), 0.2)], "ambiguous"),
    ([((0,), 0.94), ((0, 2), 0.06)], "ambiguous"), ([((0,), 0.96), ((0, 2), 0.04)], "named")])
def test_beside_a_term_that_is_no_name_it_matters_not_which_it_was(
        monkeypatch: pytest.MonkeyPatch, sets: list[tuple[tuple[int, ...], float]], verdict: str) -> None:
    """Of two causes the second is slight: every set with the first counts for it, alone or with any other. Where none is, only
    the very set does."""
    play, small = (One(name, 0.5, SimpleNamespace(name=name)) for name in ("play", "small"))
    terms = tuple(SimpleNamespace(label=each.label, effect=each.effect) for each in (play, small)[: len(sets[0][0])])
    hypotheses = [SimpleNamespace(key=frozenset(of), probability=share, log_evidence=9.0) for of, share in sets]
    seen: Any = SimpleNamespace(hypotheses=hypotheses, dictionary=SimpleNamespace(entries=[play, small, One("other", 0.1)]))
    for name, answer in (
            ("no_names", frozenset({"small"})), ("inclusion", (play, small)), ("kindred", ()), ("with_open_laws", ()),
            ("with_free_laws", "free"), ("far_off", 1.0), ("of_nothing", set()), ("log_odds", 99.0), ("only_local", False),
            ("told_by_one_visit", False), ("gain", SimpleNamespace(support=99.0, held_out="poses"))):
        monkeypatch.setattr(procedure, name, lambda *of, answer=answer: answer)
    monkeypatch.setattr(Procedure, "ambiguous", lambda *of: Told(verdict="ambiguous"))
    judgement: Any = Told(SimpleNamespace(terms=terms), SimpleNamespace(components=VarianceComponents(), data=None),
                          SimpleNamespace(p_value=0.001, resolution=0.001, seen_patterns=()))
    nothing: Any = None
    best: Any = hypotheses[0]
    found = Procedure(nothing, {}, 0.05, 10, 0).with_names(judgement, seen, best, frozenset({"small"}))
    assert found.verdict == verdict
    if verdict == "named":
        assert [cause.label for cause in found.causes] == ["play"]
        assert (found.carried, found.log_odds, found.robot_difference) == ("free", 99.0, None)


@pytest.mark.parametrize(("difference_um", "verdict"), [(1.9, "named"), (2.1, "ambiguous")])
def test_laws_of_a_gear_stay_open_under_one_name_that_differ_by_less_than_the_noise(
        monkeypatch: pytest.MonkeyPatch, difference_um: float, verdict: str) -> None:
    """Of 2 um."""
    found = named(monkeypatch, difference_um=difference_um, share=0.6)
    assert found.verdict == verdict
    if verdict == "named":
        assert found.robot_difference == pytest.approx(1e-6 * difference_um)


@pytest.mark.parametrize(("far", "verdict"), [(1.25, "named"), (1.35, "unknown")])
def test_a_name_leaves_no_readings_that_are_a_third_further_off_than_noise(
        monkeypatch: pytest.MonkeyPatch, far: float, verdict: str) -> None:
    found = named(monkeypatch, far=far)
    assert found.verdict == verdict
    if verdict == "unknown":
        assert found.withdrawn["play"].startswith("the readings are off by 1.4 times what the noise allows")


def test_a_cause_beside_a_name_is_told_from_one_in_a_hundred_on(monkeypatch: pytest.MonkeyPatch) -> None:
    found = named(monkeypatch, others=[0.2, 0.011, 0.009])
    assert found.verdict == "named"
    assert [each.probability for each in found.alternatives] == [0.2, 0.011]


def test_five_of_the_nearest_causes_go_with_an_unknown_one(monkeypatch: pytest.MonkeyPatch) -> None:
    found = named(monkeypatch, far=2.0, others=[0.5, 0.4, 0.3, 0.2, 0.1, 0.05])
    assert [each.label for each in found.alternatives] == ["play", "other 0", "other 1", "other 2", "other 3"]


@pytest.mark.parametrize(("support", "mistake", "enough", "verdict"), [
    (1.1, -99.0, True, "names"), (0.9, -99.0, True, "unknown"), (9.0, 104.0, False, "mistake"), (9.0, 102.0, False, "unknown"),
    (9.0, 4.0, True, "mistake"), (9.0, 2.0, True, "names")])
def test_causes_explain_something_by_e_and_mistakes_are_clear_by_e_3_more_or_e_103_before_all_is_tried(
        monkeypatch: pytest.MonkeyPatch, support: float, mistake: float, enough: bool, verdict: str) -> None:
    """Causes of ln posterior 0, which explain the rows or do not; a mistake of another one."""
    assert of_causes(monkeypatch, 0.01, 0.5 if enough else 1e-4, support, mistake, enough) == verdict


@pytest.mark.parametrize(("before", "after", "verdict"), [
    (0.001, 0.004, "unknown"), (0.001, 0.006, "names"), (0.04, 0.035, "unknown"), (0.04, 0.045, "names"),
    (0.2, 0.1, "names"), (0.2, 0.004, "unknown")])
def test_causes_are_enough_that_leave_what_one_in_two_hundred_shows_and_less_of_an_alarm_than_before(
        monkeypatch: pytest.MonkeyPatch, before: float, after: float, verdict: str) -> None:
    """By the p-values of the misfit; where there was no alarm, at 0.05, less of one is not asked for."""
    assert of_causes(monkeypatch, before, after) == verdict


def of_causes(monkeypatch: pytest.MonkeyPatch, before: float, after: float, support: float = 9.0, mistake: float = -99.0,
              enough: bool = True) -> str:
    """The verdict where causes of this ln evidence take the misfit's p-value from one to another; enough: to the search."""
    seen = SimpleNamespace(dictionary=SimpleNamespace(entries=range(9)))
    fitted: Any = SimpleNamespace(components=VarianceComponents(), with_usual_noise=None)
    found: Any = SimpleNamespace(
        named=SimpleNamespace(seen=seen, lost=()), best=SimpleNamespace(log_evidence=support), fitted=fitted, scatter={},
        adequacy=SimpleNamespace(p_value=after), enough=enough)
    candidate: Any = SimpleNamespace(candidate=SimpleNamespace(log_posterior=mistake))
    mistakes = Mistakes(None, (candidate,), None)
    # What looking further comes to is less than the mistake is likelier by, unless that is e^100 and more.
    later = iter([0.0, 0.0 if enough else 200.0])
    for name, answer in (("mistakes_in", mistakes), ("beyond_the_fit", None), ("nearly_all", False), ("strained", False),
                         ("without_slight", (fitted, frozenset())), ("beside", None)):
        monkeypatch.setattr(procedure, name, lambda *of, answer=answer: answer)
    monkeypatch.setattr(procedure, "physics_of", lambda *of: next(later))
    monkeypatch.setattr(procedure, "beside", lambda judgement, *of: judgement)
    monkeypatch.setattr(Procedure, "search", SimpleNamespace(searched=lambda *of: found, likeliest=lambda *of: found))
    monkeypatch.setattr(Procedure, "unknown", lambda self, judgement, *of: replace(judgement, verdict="unknown"))
    monkeypatch.setattr(Procedure, "with_names", lambda self, judgement, *of: replace(judgement, verdict="names"))
    nothing: Any = None
    judgement: Any = Told(plain=fitted, detection=SimpleNamespace(p_value=before))
    return Procedure(nothing, {}, 0.05, 10, 0).named(judgement).verdict


@pytest.mark.parametrize("positive", [False, True])
@pytest.mark.parametrize(("information", "score"), [(2.0, 3.0), (0.05, -0.2), (4.0, 60.0), (9.0, -5.0)])
def test_an_effect_is_as_likely_as_the_average_over_its_sizes(information: float, score: float, positive: bool) -> None:
    """Within 1.5 typical sizes, 1 sigma, in nine cases of ten, within four times that in eight of a hundred, sixteen times in
    two; the integral done in small steps, of one that has its sign over the half of it."""
    size = np.linspace(0.0 if positive else -150.0, 150.0, 600_001)
    density = sum(share * stats.norm(scale=1.5 * times).pdf(size) for share, times in ((0.9, 1.0), (0.08, 4.0), (0.02, 16.0)))
    likely = np.exp(score * size - 0.5 * information * size**2 - max(0.0, 0.5 * score**2 / information))
    wanted = np.log(np.trapezoid(density * likely, size) * (2 if positive else 1)) + max(0.0, 0.5 * score**2 / information)
    found = evidence(np.array([[[information]]]), np.array([[score]]), np.array([positive]))
    assert found == pytest.approx([wanted], abs=1e-4)


def test_a_larger_effect_has_as_much_more_room() -> None:
    assert [room(size) for size in (0.5, 1.4, 3.0)] == pytest.approx([1.0, 1.0, 2.0])


@pytest.mark.parametrize(("times", "beyond"), [(0.96, False), (1.04, True)])
def test_what_is_left_beside_causes_is_noise_of_three_times_the_stated(
        monkeypatch: pytest.MonkeyPatch, times: float, beyond: bool) -> None:
    """With 95 % confidence, where its size is known to a tenth: the causes explain the rows no further."""
    monkeypatch.setattr(explaining, "goodness_of_fit", lambda *of: SimpleNamespace(p_value=0.5))
    fitted = fit(sensor=float(times * 3.0 * np.exp(0.1 * stats.norm.isf(0.05))), setup=1.0, memory=1.0)
    fitted.at_map.noise.active = (True,) * 6
    fitted.data = SimpleNamespace(rows=SimpleNamespace(machined_pass=np.array([""])), cell=SimpleNamespace(
        noise=SimpleNamespace(force_relative_stated=False)))
    named: Any = SimpleNamespace(fitted=fitted)
    found = Explaining({}, 0.05, 9, np.random.default_rng(0)).tested(named)
    assert list(found.scatter) == ["sensor noise"] * beyond
    assert found.enough is not beyond
