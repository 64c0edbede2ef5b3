"""Which visits and validation rows are left out, and which single slips are told: each side of every limit, by tests whose
outcome is given."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from identification.common.findings import error
from identification.fit import bad_visits as of_visits
from identification.fit import held_out, mending, validation, wrong_angle
from identification.fit.bad_visits import bad_visits
from identification.fit.load_test import LoadTest
from identification.fit.mending import BadVisit, Mend
from identification.fit.noise_parts import SETUP
from identification.fit.posterior import posterior
from identification.fit.row_slips import row_mend
from identification.fit.slips import FROM_ANOTHER, Slip
from identification.fit.validation import judge_validation
from identification.fit.visit_findings import mending as mending_in_words
from identification.fit.visit_findings import validation_findings
from identification.fit.visits import VisitScore, VisitTest
from identification.fit.wrong_angle import likeliest_wrong_angle
from tests.identification.fit.exact_rows import by_compliance
from tests.identification.fit.test_laws_posterior import NOISY, TRUE, simulate

NAN = np.full(3, np.nan)


class Table:
    """Rows of visits, as far as the test of visits asks."""

    def __init__(self, row: NDArray[np.intp], visit: NDArray[np.intp], unloaded: Sequence[int] = ()) -> None:
        self.row, self.visit, self.line, self.unloaded = row, visit, row + 1, unloaded
        self.wrench = np.where(np.isin(row, unloaded), 0.0, 100.0)[:, None] * np.ones(6)

    def select(self, kept: NDArray[np.bool_]) -> Table:
        return Table(self.row[kept], self.visit[kept], self.unloaded)


def scored(number: int, rows: Sequence[int], p_value: float, sigmas: float = np.nan) -> VisitScore:
    return VisitScore(f"P{number}", np.array(rows), int(rows[0]) + 1, 0, -np.log10(p_value), p_value, 0.1,
                      NAN if np.isnan(sigmas) else np.array([0.0, sigmas, 0.0]), np.ones(3))


def left_out(monkeypatch: pytest.MonkeyPatch, chances: list[float], family: float, *, per_visit: int = 8,
             again: tuple[float, float] | None = None, unloaded: Sequence[int] = ()) -> VisitTest:
    """The test of visits that chance makes so often; family: at first, of the largest. again: of the first visit without one of
    its rows, and how many sigmas its zero is off then."""
    visit = np.repeat(np.arange(len(chances)), per_visit)
    table = Table(np.arange(1, len(visit) + 1), visit, unloaded)
    every = [scored(k, table.row[visit == k].tolist(), p) for k, p in enumerate(chances)]

    def score_visits(fitted: Any, data: Any, rng: Any, replicates: int) -> VisitTest:
        if not replicates:
            assert again is not None
            mine = data.rows.row[data.rows.visit == 0].tolist()
            return VisitTest((scored(0, mine, *again),), again[0], 0.0)
        return VisitTest(tuple(every), family, 0.001)

    def data_of(rows: Table) -> Any:
        return SimpleNamespace(rows=rows, with_rows=data_of)

    noise = SimpleNamespace(active=(False,) * 6)
    fitted: Any = SimpleNamespace(data=data_of(table), terms=(), at_map=SimpleNamespace(noise=noise))
    monkeypatch.setattr(of_visits, "score_visits", score_visits)
    monkeypatch.setattr(of_visits, "posterior", lambda data, *of, **more: SimpleNamespace(data=data))
    monkeypatch.setattr(of_visits, "_with_wrong_angles", lambda test, fitted, seed: test)
    return bad_visits(fitted)


@pytest.mark.parametrize(("visits", "family", "chance", "bad"), [
    (5, 0.004, 0.004, 0), (6, 0.004, 0.004, 1), (6, 0.11, 0.004, 0), (6, 0.09, 0.004, 1), (6, 0.004, 0.0055, 0),
    (6, 0.004, 0.0045, 1)])
def test_a_visit_of_six_is_left_out_that_chance_makes_in_one_of_two_hundred(
        monkeypatch: pytest.MonkeyPatch, visits: int, family: float, chance: float, bad: int) -> None:
    """None is looked at further where chance makes the worst misfit of the whole fit in one of ten."""
    test = left_out(monkeypatch, [chance, *[0.5] * (visits - 1)], family)
    assert [score.name for score in test.bad] == ["P0"] * bad


@pytest.mark.parametrize(("wrong", "too_many"), [(2, False), (3, True)])
def test_more_than_a_third_of_the_visits_are_none(monkeypatch: pytest.MonkeyPatch, wrong: int, too_many: bool) -> None:
    """Of seven."""
    test = left_out(monkeypatch, [*[1e-3] * wrong, *[0.5] * (7 - wrong)], 1e-3)
    assert test.too_many is too_many
    assert len(test.bad) == (0 if too_many else wrong)


@pytest.mark.parametrize(("rows", "again", "unloaded", "bad"), [
    (6, (0.055, np.nan), (), 0), (6, (0.045, np.nan), (), 1), (7, (0.055, np.nan), (), 1), (2, (0.055, np.nan), (), 1),
    (3, (0.055, np.nan), (), 0),
    (6, (0.055, 4.2), (3, 4), 1), (6, (0.055, 3.8), (3, 4), 0), (6, (0.055, 4.2), (), 0)])
def test_a_visit_of_a_few_readings_that_fits_without_one_has_one_bad_reading(
        monkeypatch: pytest.MonkeyPatch, rows: int, again: tuple[float, float], unloaded: tuple[int, ...], bad: int) -> None:
    """Three to six, whose others chance makes in one of twenty; but where another reading without a load says that the zero
    stayed they are not all off from it, by four sigmas."""
    test = left_out(monkeypatch, [1e-3, *[0.5] * 6], 1e-3, per_visit=rows, again=again, unloaded=unloaded)
    assert len(test.bad) == bad


@pytest.mark.parametrize(("support", "fits", "hope", "told"), [
    (5.2, 0.055, 4.1, True), (4.8, 0.055, 4.1, False), (5.2, 0.045, 4.1, False), (5.2, 0.055, 3.9, False)])
def test_an_angle_is_wrong_that_is_e_5_times_likelier_and_fits(
        monkeypatch: pytest.MonkeyPatch, support: float, fits: float, hope: float, told: bool) -> None:
    """One angle of six hundred is wrong beforehand. Looked at is one that is e^4 times likelier near none."""
    rows = SimpleNamespace(visit=np.array([3, 3, 8]), line=np.array([4, 5, 6]))
    fitted: Any = SimpleNamespace(data=SimpleNamespace(rows=rows), terms=(), value=0.0)
    model = SimpleNamespace(data=fitted.data, value=support + np.log(600.0), likeliest=np.array([0.02]),
                            laplace=np.array([[1e-6]]))
    angle = np.zeros((2, 6))
    angle[1, 4] = 0.9
    monkeypatch.setattr(wrong_angle, "_with_free_laws", lambda fitted: fitted)
    monkeypatch.setattr(wrong_angle, "_near_none", lambda fitted: (np.where(angle > 0, hope, 0.0), angle))
    monkeypatch.setattr(wrong_angle, "posterior", lambda data, terms, near: model)
    monkeypatch.setattr(wrong_angle, "averaged_evidence", lambda fit: fit.value)
    monkeypatch.setattr(wrong_angle, "score_visits",
                        lambda *of: SimpleNamespace(scores=(SimpleNamespace(line=6, p_value=fits),)))
    found = likeliest_wrong_angle(fitted, np.array([3, 8]))
    assert (found is not None) is told
    if found is not None:
        assert (found.visit, found.joint) == (8, 5)
        assert [found.missing, found.std, found.log_odds] == pytest.approx([0.02, 1e-3, support])


def test_three_visits_are_looked_at_from_a_third_of_a_radian_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """The likeliest of five, each for its likeliest angle."""
    rows = SimpleNamespace(visit=np.arange(5), line=np.arange(5))
    fitted: Any = SimpleNamespace(data=SimpleNamespace(rows=rows), terms=())
    support, angle = np.zeros((5, 6)), np.zeros((5, 6))
    support[:, 2], angle[:, 2] = [5.0, 9.0, 6.0, 8.0, 7.0], [0.1, 0.9, 0.1, -0.9, 0.29]
    tried: list[tuple[int, int | None, float]] = []

    def fit(data: Any, terms: Any, near: Any) -> Any:
        (term,) = terms
        tried.append((term.effect.visit, term.joint, float(term.start[0])))
        return SimpleNamespace()

    monkeypatch.setattr(wrong_angle, "_with_free_laws", lambda fitted: fitted)
    monkeypatch.setattr(wrong_angle, "_near_none", lambda fitted: (support, angle))
    monkeypatch.setattr(wrong_angle, "posterior", fit)
    monkeypatch.setattr(wrong_angle, "averaged_evidence", lambda fit: 0.0)
    assert likeliest_wrong_angle(fitted, np.arange(5)) is None
    assert tried == [(1, 3, 0.3), (3, 3, -0.3), (4, 3, 0.29)]


SIGMA = 2e-8


@pytest.fixture(scope="module")
def fit(tmp_path_factory: pytest.TempPathFactory) -> tuple[LoadTest, Any]:
    """Six poses of six loads each whose only noise is the sensor's, the last pose kept back, and the fit of the others; all
    readings are what the springs make."""
    text = NOISY.replace("0.01,", "0,").replace("[1, 1, 1]", "[0, 0, 0]").replace("[4, 4, 4]", "[0, 0, 0]").replace(
        "[2, 2, 2]", "[0.02, 0.02, 0.02]")
    cell, rows = simulate(tmp_path_factory.mktemp("back"), np.random.default_rng(5), poses=6, loads=6, text=text, quiet=True)
    wrench = 0.02 * rows.wrench
    moved = by_compliance(rows.theta, cell.flange_from_tcp.position, wrench[:, :3]) @ (1 / TRUE)
    noise = SIGMA * np.random.default_rng(6).standard_normal(moved.shape)
    data = LoadTest.of(cell, replace(rows, wrench=wrench, deflection=moved + noise, validate=rows.visit == 5))
    return data, posterior(data.with_rows(data.rows.select(~data.rows.validate)))


def kept_back(fit: tuple[LoadTest, Any], count: int, off: list[float]) -> LoadTest:
    """The rows with so many of those kept back, whose readings are off along x by so many standard deviations of what the fit's
    springs and the sensor's noise leave open."""
    data, fitted = fit
    mine = np.flatnonzero(data.rows.validate)[:count]
    rows = data.rows.select(~data.rows.validate | np.isin(np.arange(len(data.rows)), mine))
    mine = np.flatnonzero(rows.validate)
    each = by_compliance(rows.theta[mine], data.cell.flange_from_tcp.position, rows.wrench[mine, :3]) * np.exp(fitted.map)
    allowed = (fitted.components.sensor * SIGMA) ** 2 * np.eye(3) + each @ fitted.laplace @ np.swapaxes(each, 1, 2)
    moved = rows.deflection - fitted.residual_of(data.with_rows(rows))
    for row, one, covariance in zip(mine, off, allowed, strict=True):
        moved[row, 0] += one / np.sqrt(np.linalg.inv(covariance)[0, 0])
    return data.with_rows(replace(rows, deflection=np.where(rows.validate[:, None], moved, rows.deflection)))


@pytest.mark.parametrize(("count", "chance", "others", "told"), [
    (4, 0.0011, 0.0, False), (4, 0.0009, 0.0, True), (5, 0.0011, 0.0, False), (5, 0.0009, 0.0, True),
    (4, 0.0009, 2.5, True), (5, 0.0009, 2.5, False)])
def test_a_validation_row_is_an_outlier_that_chance_makes_in_one_of_a_thousand(
        monkeypatch: pytest.MonkeyPatch, fit: tuple[LoadTest, Any], count: int, chance: float, others: float, told: bool,
) -> None:
    """Over all rows, by an F of three readings and of six degrees, as few rows tell the tails. Five rows tell a scale of their
    own: others that are off by 2.5 sigmas make it no rarity."""
    monkeypatch.setattr(validation, "_visits", lambda *of: ())
    size = float(np.sqrt(3 * stats.f.isf(chance / count, 3, 6)))
    data = kept_back(fit, count, [size, *[others] * (count - 1)])
    judged = judge_validation(fit[1], data)
    assert judged is not None
    first = int(data.rows.row[data.rows.validate][0])
    assert [row.row for row in judged.rows] == [first] * told
    assert [row.sigmas for row in judged.rows] == pytest.approx([size] * told, rel=1e-3)


def test_an_outlier_is_as_many_times_off_as_the_others_leave_it(
        monkeypatch: pytest.MonkeyPatch, fit: tuple[LoadTest, Any]) -> None:
    """Five are off by 3 sigmas each: as far as half of all rows are by chance, times a scale that the sixth has, too."""
    monkeypatch.setattr(validation, "_visits", lambda *of: ())
    judged = judge_validation(fit[1], kept_back(fit, 6, [60.0, *[3.0] * 5]))
    assert judged is not None
    scale = 9.0 / (3 * stats.f.median(3, 6))
    assert scale > 2
    assert [row.sigmas for row in judged.rows] == pytest.approx([60.0 / np.sqrt(scale)], rel=1e-3)


def test_what_was_not_read_of_a_validation_row_expects_nothing(
        monkeypatch: pytest.MonkeyPatch, fit: tuple[LoadTest, Any]) -> None:
    """Of six rows one has no z and one x alone; what is expected of the others is the sensor's noise and what the fit leaves
    open of its springs. A row that is far off in what was read of it is an outlier all the same."""
    monkeypatch.setattr(validation, "_visits", lambda *of: ())
    data = kept_back(fit, 6, [0.0] * 6)
    mine, deflection = np.flatnonzero(data.rows.validate), data.rows.deflection.copy()
    deflection[mine[2], 2], deflection[mine[4], 1:] = np.nan, np.nan
    fitted = fit[1]
    each = by_compliance(data.rows.theta[mine], data.cell.flange_from_tcp.position, data.rows.wrench[mine, :3])
    each *= np.exp(fitted.map)
    variance = (fitted.components.sensor * SIGMA) ** 2 + np.einsum("nij,jk,nik->ni", each, fitted.laplace, each)
    read = ~np.isnan(deflection[mine])
    for off in (0.0, 1e-5):
        deflection[mine[4], 0] += off
        judged = judge_validation(fitted, data.with_rows(replace(data.rows, deflection=deflection)))
        assert judged is not None
        assert judged.expected == pytest.approx(np.sqrt(np.mean(variance[read])), rel=0.01)
        assert judged.rms == pytest.approx(off / np.sqrt(read.sum()), abs=1e-9)
        assert (judged.count, [row.row for row in judged.rows]) == (6, [int(data.rows.row[mine[4]])] * bool(off))


@pytest.mark.parametrize(("visits", "rows", "fails"), [((2,), 0, False), ((3,), 0, True), ((2,), 1, True), ((1, 2), 0, True)])
def test_visits_that_are_more_than_a_third_of_the_validation_rows_are_said_as_not_predicted(
        monkeypatch: pytest.MonkeyPatch, fit: tuple[LoadTest, Any], visits: tuple[int, ...], rows: int, fails: bool) -> None:
    """Of six rows, where each row by itself would pass, and with one beside them that would not: two visits among a few were
    found wrong and not a word was said."""
    data = kept_back(fit, 6, [*np.linspace(1.0, 0.3, 6 - rows), *[1e3] * rows])
    numbers, taken = data.rows.row[data.rows.validate], np.cumsum((0, *visits))
    bad = tuple(BadVisit(scored(k, numbers[start:start + size].tolist(), 1e-3), ())
                for k, (start, size) in enumerate(zip(taken, visits, strict=False)))
    monkeypatch.setattr(validation, "_visits", lambda *of: bad)
    judged = judge_validation(fit[1], data)
    assert judged is not None
    assert (judged.missed, judged.count, judged.fails) == (sum(visits) + rows, 6, fails)
    assert judged.visits == (() if fails else bad)
    assert (judged.rms == judged.rms_without) is fails
    assert [one.code for one in validation_findings(judged, "m.csv")] == (["CS1737"] if fails else ["CS1733"] * len(visits))


@pytest.mark.parametrize(("turns", "told"), [(3, "3 whole turns"), (-3, "3 whole turns"), (4, "")])
@pytest.mark.parametrize("turn_um", [100, 200, 500, 1000])
def test_three_whole_turns_of_a_dial_may_be_lost(turns: int, told: str, turn_um: int) -> None:
    """Along one axis of a reading of 60 um; four turns are another dial's one or two where there is such a dial."""
    off = np.zeros((3, 3))
    off[1, 0] = -1e-6 * turns * turn_um
    rows: Any = SimpleNamespace(deflection=np.full((3, 3), 6e-5) + off, visit=np.arange(3), row=np.arange(3), line=np.arange(3))
    mend = row_mend(rows, off, np.full((3, 3), 2e-6), 1)
    if told:
        assert mend is not None
        assert mend.what == f"dx with {told} of {turn_um} um {'more' if turns > 0 else 'less'} would fit"
    else:
        other = {100: "2 whole turns of 200 um", 200: "", 500: "2 whole turns of 1000 um", 1000: ""}[turn_um]
        assert (mend.what if mend else "") == (f"dx with {other} more would fit" if other else "")


@pytest.mark.parametrize(("factor", "words"), [
    (-1.0, "with the other sign"), (0.1, "ten times as large"), (10.0, "a tenth as large")])
def test_a_reading_that_was_written_otherwise_is_told(factor: float, words: str) -> None:
    """Of 123, 231 and 312 um, all of them written so: put back they fit."""
    right = 1e-6 * np.array([[123.0, 231.0, 312.0]] * 3)
    read = right.copy()
    read[1] *= factor
    rows: Any = SimpleNamespace(deflection=read, visit=np.arange(3), row=np.arange(3), line=np.arange(3))
    mend = row_mend(rows, read - right, np.full((3, 3), 2e-6), 1)
    assert mend is not None
    assert mend.what == f"the reading {words} would fit"


def mended(monkeypatch: pytest.MonkeyPatch, kinds: Sequence[str], off: Sequence[Slip] = ()) -> list[float]:
    """The probabilities of slips of these kinds, all of which explain a visit as well as "none of them" does and fit; off:
    angles that are off by any amount, likewise."""
    slips = [Slip(kind, f"slip {k}", np.zeros(6)) for k, kind in enumerate(kinds)]
    any_angle = [(one, 0.0, 1.0) for one in off]
    visit = SimpleNamespace(expected=None, anything=lambda: 0.0, directions=3, angles_off=lambda: any_angle,
                            judged=lambda slips: (np.zeros(len(slips)), np.ones(len(slips))))
    monkeypatch.setattr(mending, "slips_of", lambda *of: iter(slips))
    monkeypatch.setattr(mending, "_new", lambda *of: True)
    monkeypatch.setattr(mending, "_Visit", lambda *of: visit)
    rows: Any = SimpleNamespace(row=np.arange(4), theta=np.zeros((4, 6)), select=lambda mine: None)
    score: Any = SimpleNamespace(rows=np.array([1, 2]))
    nothing: Any = None
    return [mend.probability for mend in mending.mends(nothing, rows, score, 1.0, frozenset())]


def test_a_slip_is_as_likely_as_its_kind_is_often_and_three_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one kind each shares; another visit's angles are ten times rarer, an angle off by any amount three times."""
    assert mended(monkeypatch, ["sign", "digit", "digit"]) == pytest.approx([1 / 3, 1 / 6, 1 / 6])
    assert mended(monkeypatch, [FROM_ANOTHER]) == pytest.approx([0.1 / 1.1])
    assert mended(monkeypatch, [], [Slip("angle", "any", np.zeros(6))]) == pytest.approx([1 / 4])
    assert mended(monkeypatch, ["sign", "digit", "columns", "decimal point"]) == pytest.approx([1 / 5] * 3)


@pytest.mark.parametrize(("probability", "told"), [(0.24, False), (0.26, True)])
def test_a_slip_is_told_in_words_from_one_in_four(probability: float, told: bool) -> None:
    bad = BadVisit(scored(1, [1, 2], 1e-3), (Mend("sign", "its sign", probability),))
    words = mending_in_words(bad)
    assert words.startswith(f"its sign ({100 * probability:.0f} % of what was tried)" if told else "is its pose")


@pytest.mark.parametrize(("degrees", "new"), [(0.45, False), (0.55, True)])
def test_a_slip_moves_an_axis_by_half_a_degree(fit: tuple[LoadTest, Any], degrees: float, new: bool) -> None:
    theta = np.zeros(6)
    assert mending._new(fit[1], theta, Slip("digit", "", theta + np.radians(degrees) * np.eye(6)[3])) is new


def test_an_angle_off_by_any_amount_is_off_by_eight_degrees_beforehand() -> None:
    """A visit that says 10 +- 2 degrees: with 8, 1 sigma, these are 9.41, 1.94, told as two sigmas. Up to 20 are tried."""
    def angles(says: float, std: float) -> list[tuple[Slip, float, float]]:
        def against(theta: Any, *of: Any) -> Any:
            off = np.degrees(theta).sum(axis=1) - 60.0
            distance = ((off - says) / std) ** 2
            return -0.5 * distance, distance

        visit: Any = SimpleNamespace(_rows=SimpleNamespace(theta=np.full((3, 6), np.radians(10.0))), _loads=None, _own=None,
                                     _shared=0.0, _against=against)
        return mending._Visit.angles_off(visit)

    for axis, (slip, _, misfit) in enumerate(angles(10.0, 2.0), start=1):
        told = re.fullmatch(rf"axis {axis} is 10 in the table; (.*) \+- (.*) would fit", slip.what)
        assert told, slip.what
        assert [float(word) for word in told.groups()] == pytest.approx([19.41, 2 * 1.94], abs=0.01)
        assert misfit == pytest.approx(0.0, abs=1e-9)
        assert np.degrees(slip.theta[axis - 1]) == pytest.approx(19.41, abs=0.01)
    (_, _, misfit), *_ = angles(25.0, 1.0)
    assert misfit == pytest.approx(25.0)
    # Between two of the angles that are tried, a twentieth of a degree apart.
    for says, left in ((10.025, 1.0), (10.05, 0.0)):
        (_, _, misfit), *_ = angles(says, 0.025)
        assert misfit == pytest.approx(left, abs=1e-6)


class Model:
    """A fit of some rows, with the usual parts of the noise or with all."""

    def __init__(self, table: Table, usual: bool = False, set_up: bool = False) -> None:
        self.data: Any = SimpleNamespace(rows=table, with_rows=lambda rows: SimpleNamespace(rows=rows))
        self.terms, self.usual = (), usual
        self.at_map = SimpleNamespace(noise=SimpleNamespace(active=tuple(part == SETUP and set_up for part in range(6))))
        self.with_usual_noise = self


def in_turn(monkeypatch: pytest.MonkeyPatch, scores: list[list[float]], *, visits: int = 9, fails: bool = False,
            set_up: bool = False) -> tuple[VisitTest, list[tuple[list[int], bool]], Table]:
    """The test of visits whose chances (of the first of them, all others are usual) are these, fit by fit; and the visits of
    each fit that was made, with the usual noise or not."""
    table = Table(np.arange(1, 8 * visits + 1), np.repeat(np.arange(visits), 8))
    left, fits = iter(scores), []

    def score_visits(fitted: Any, data: Any, rng: Any, replicates: int) -> VisitTest:
        chances = next(left)
        every = [scored(k, table.row[table.visit == k].tolist(), [*chances, *[0.5] * visits][k]) for k in range(visits)]
        return VisitTest(tuple(every), min(chances), 0.001)

    def posterior(data: Any, terms: Any, near: Any, usual_noise: bool = False) -> Model:
        if fails:
            raise error("CS1011", "no")
        fits.append((np.unique(data.rows.visit).tolist(), usual_noise))
        return Model(data.rows, usual_noise)

    monkeypatch.setattr(of_visits, "score_visits", score_visits)
    monkeypatch.setattr(of_visits, "posterior", posterior)
    monkeypatch.setattr(of_visits, "_with_wrong_angles", lambda test, fitted, seed: test)
    fitted: Any = Model(table, set_up=set_up)
    return bad_visits(fitted), fits, table


def but(*visits: int) -> list[int]:
    return [number for number in range(9) if number not in visits]


def test_a_visit_that_the_last_fit_explains_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Taken out in turn, the worst first, and judged together at the end; the fit that is handed on has the others back."""
    found, fits, _ = in_turn(monkeypatch, [[0.004, 0.001, 0.04], [0.003, 0.002, 0.04], [0.02, 0.001, 0.006]])
    assert [one.name for one in found.bad] == ["P1"]
    assert fits == [(but(1), False), (but(0, 1), False), (but(1), False)]
    assert found.rest is not None
    assert np.unique(found.rest.data.rows.visit).tolist() == but(1)


def test_visits_without_which_there_is_no_fit_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    found, fits, _ = in_turn(monkeypatch, [[0.001]], fails=True)
    assert (found.bad, found.rest, found.too_many, fits) == ((), None, False, [])


@pytest.mark.parametrize(("second", "bad", "usual"), [([0.001, 0.002], ["P0", "P1"], True), ([0.001, 0.02], ["P0"], False)])
def test_set_ups_that_differ_hide_no_visits(
        monkeypatch: pytest.MonkeyPatch, second: list[float], bad: list[str], usual: bool) -> None:
    """Where they came in, visits are taken out as if there were none, and judged by a fit that may have them: what comes to
    more bad ones counts."""
    as_it_is = [[0.001, 0.05], [0.001, 0.05]]
    without = [[0.001, 0.002], [0.001, 0.002], [0.001, 0.002], second]
    found, fits, _ = in_turn(monkeypatch, as_it_is + without, set_up=True)
    assert sorted(one.name for one in found.bad) == bad
    assert fits[:4] == [(but(0), False), (but(0), True), (but(0, 1), True), (but(0, 1), False)]
    assert fits[4:] == ([] if usual else [(but(0), False)])


@pytest.mark.parametrize(("bad", "wrong", "told"), [
    ((), (), None), ((0,), (), {"P0": None}), ((0,), (3,), {"P0": None, "P3": "of 3"}),
    ((), (3, 4), {"P3": "of 3", "P4": "of 4"})])
def test_visits_with_a_wrong_angle_are_bad_ones_too(
        monkeypatch: pytest.MonkeyPatch, bad: tuple[int, ...], wrong: tuple[int, ...], told: dict[str, Any] | None) -> None:
    """Looked for in the fit of the others, as many as a third of all has left; the worst of all first."""
    table = Table(np.arange(1, 73), np.repeat(np.arange(9), 8))
    every = tuple(scored(k, table.row[table.visit == k].tolist(), 0.5 / (k + 1)) for k in range(9))
    fitted: Any = Model(table)
    rest: Any = Model(table.select(~np.isin(table.visit, bad))) if bad else None
    asked: list[Any] = []

    def wrong_angles(model: Any, visits: Any, most: int) -> tuple[list[Any], Any]:
        asked.append((model, visits, most))
        return [SimpleNamespace(visit=k, of=f"of {k}") for k in wrong], Model(model.data.rows) if wrong else model

    monkeypatch.setattr(of_visits, "wrong_angles", wrong_angles)
    monkeypatch.setattr(of_visits, "_under_load", lambda data: np.unique(data.rows.visit).tolist())
    monkeypatch.setattr(of_visits, "_angle_of", lambda score, fitted, rest: None)
    monkeypatch.setattr(of_visits, "score_visits", lambda rest, data, rng, count: VisitTest(every, 0.4, 1 / (count + 1)))
    test = VisitTest(every, 0.5, 0.01, tuple(every[k] for k in bad), rest=rest)
    found = of_visits._with_wrong_angles(test, fitted, 0)
    ((model, visits, most),) = asked
    assert model is (rest or fitted)
    assert (visits, most) == ([k for k in range(9) if k not in bad], 3 - len(bad))
    if told is None:
        assert found is test
        return
    assert {one.name: getattr(one.wrong_angle, "of", None) for one in found.bad} == told
    assert [one.surprise for one in found.bad] == sorted((one.surprise for one in found.bad), reverse=True)
    assert found.resolution == (1 / 400 if wrong else 0.01)
    assert found.rest is not None


def test_at_one_visit_the_robot_stood_elsewhere_and_nowhere_else(fit: tuple[LoadTest, Any]) -> None:
    """What its springs make of the loads there at the other angle, less what they make of them at the table's; nothing of what
    it turns. To first order by the independent arm."""
    data, fitted = fit
    state = data.load_state(fitted.compliance)
    turn = wrong_angle.AngleOfVisit(2)
    for joint, off in ((None, 0.1), (1, 0.1), (5, -0.4)):
        found = turn.contribution(state, joint, np.array([off]))
        theta = data.rows.theta.copy()
        theta[data.rows.visit == 2, 0 if joint is None else joint - 1] += off
        tcp, force = data.cell.flange_from_tcp.position, data.rows.wrench[:, :3]
        wanted = (by_compliance(theta, tcp, force) - by_compliance(data.rows.theta, tcp, force)) @ fitted.compliance
        np.testing.assert_allclose(found[:, :3], wanted, atol=2e-3 * np.abs(wanted).max())
        assert not found[data.rows.visit != 2].any()
        assert not found[:, 3:].any()
    term = turn.term(4, -0.25)
    assert (term.effect, term.joint, term.start.tolist(), term.scale.tolist(), term.neutral.tolist()) == (
        turn, 4, [-0.25], [0.03], [0.0])


@pytest.mark.parametrize(("likely", "most", "fails", "found"), [
    ([], 2, 9, []), ([3], 2, 9, [3]), ([3, 1], 2, 9, [3, 1]), ([3, 1, 5], 2, 9, None), ([3, 1], 2, 1, None)])
def test_wrong_angles_are_looked_for_one_after_the_other(
        monkeypatch: pytest.MonkeyPatch, likely: list[int], most: int, fails: int, found: list[int] | None) -> None:
    """Each in the fit without those before; none is told of more than single slips would be, nor where there is no fit without
    them (None)."""
    table = Table(np.arange(1, 73), np.repeat(np.arange(9), 8))
    fitted: Any = Model(table)
    left, asked = list(likely), []

    def likeliest(rest: Any, visits: Any) -> Any:
        asked.append(np.unique(rest.data.rows.visit).tolist())
        return SimpleNamespace(visit=left.pop(0)) if left else None

    def posterior(data: Any, terms: Any, near: Any) -> Model:
        if 9 - len(np.unique(data.rows.visit)) > fails:
            raise error("CS1011", "no")
        return Model(data.rows)

    monkeypatch.setattr(wrong_angle, "likeliest_wrong_angle", likeliest)
    monkeypatch.setattr(wrong_angle, "posterior", posterior)
    each, rest = wrong_angle.wrong_angles(fitted, np.arange(9), most)
    assert [one.visit for one in each] == (found or [])
    assert (rest is fitted) is (not found)
    assert asked[:2] == [but(), but(*likely[:1])][:len(asked)]
    if found:
        assert np.unique(rest.data.rows.visit).tolist() == but(*found)


@pytest.mark.parametrize(("outlying", "single"), [
    ([1], [1]), ([1, 2], []), ([4], []), ([4, 6, 1], [6, 1]), ([6, 7], []), ([6], [6]), ([10], [])])
def test_a_row_is_single_whose_visit_has_more_that_are_none(outlying: list[int], single: list[int]) -> None:
    """Rows 1 to 3 are a visit, 4 and 5, 6 to 9, and 10 alone: under half of them."""
    rows: Any = SimpleNamespace(row=np.arange(1, 11), visit=np.array([7, 7, 7, 2, 2, 4, 4, 4, 4, 9]))
    assert validation._single(rows, np.array(outlying)).tolist() == sorted(single)


def test_rows_are_held_out_by_the_label_of_their_pose_or_by_their_visit() -> None:
    """A label that returns is the same pose; without one a visit is named by the line of its first row."""
    rows: Any = SimpleNamespace(visit=np.array([3, 3, 1, 1, 5, 6, 6]), line=np.array([12, 13, 14, 15, 16, 17, 18]),
                                pose=np.array(["B", "B", "", "", "A", "B", "B"], dtype=object))
    assert held_out.pose_names(rows) == ("A", "B", "line 14")
    assert held_out.poses(rows).tolist() == [1, 1, 2, 2, 0, 1, 1]
