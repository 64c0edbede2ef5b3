"""What must be true of mistakes in the files: mending undoes planting, the quick look is the likelihood it says it is."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from benchmarks.shop_arm import Arm
from identification.fit.load_test import LoadTest
from identification.fit.mistakes import judge, readings, units
from identification.fit.mistakes.axes import axes_mistakes, signed_permutations
from identification.fit.mistakes.evidence import log_evidence
from identification.fit.mistakes.first_look import first_look
from identification.fit.mistakes.joints import joint_mistakes
from identification.fit.mistakes.judge import Mistakes, common_factor_findings, mistakes_in
from identification.fit.mistakes.look import Guess, Look, _two_robots, log_lost, of_alike
from identification.fit.mistakes.mistake import Mistake
from identification.fit.mistakes.odd_rows import where
from identification.fit.mistakes.readings import reading_mistakes
from identification.fit.mistakes.screen import Sums, linear, log_scores, sums
from identification.fit.mistakes.search import _support_near_none, search
from identification.fit.mistakes.sizes import SIZES, JointZero, ReferenceLoad, Size, ToolOffset
from identification.fit.mistakes.slipped import slipped_mistakes
from identification.fit.mistakes.units import time_mistake, unit_mistake
from identification.fit.noise import USUAL_FORCE_N
from identification.fit.noise_parts import VarianceComponents
from identification.fit.posterior import Posterior, posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.runs.mistakes.planted import MISTAKES, Files, right


def _read(files: Files, folder: Path) -> LoadTest:
    cell_file, table = files.write(folder)
    cell = read_cell(cell_file)
    return LoadTest.of(cell, read_measurements(table, cell.robot))


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    return _read(right(21, "irb6700-200-2.60"), tmp_path_factory.mktemp("right"))


def test_each_mix_up_of_the_axes_comes_round(data: LoadTest) -> None:
    """47 of forces, 46 of deflections, 23 of both, no two alike; each, done twelve times, is none, as the symmetries of a cube
    have the orders 2, 3, 4 and 6. A reading that was not taken stays so, and no other is lost."""
    rows = data.rows
    gaps = np.where(np.arange(len(rows))[:, None] % 7 == np.arange(3), np.nan, rows.deflection)
    spoiled = data.with_rows(replace(rows, deflection=gaps))
    kinds = ("sign", "swapped", "axes", "turned", "signs")
    mixed = [each for each in axes_mistakes(spoiled) if each.key.split("[")[0].rpartition("_")[2] in kinds]
    assert len(signed_permutations()) == 47
    seen = {(once.wrench.tobytes(), once.deflection.tobytes()) for each in mixed for once in [each.mended(spoiled).rows]}
    assert len(seen) == len(mixed) == len({each.key for each in mixed}) == 47 + 46 + 23
    for each in mixed:
        turned = spoiled
        for _ in range(12):
            turned = each.mended(turned)
            assert np.isnan(turned.rows.deflection).sum() == np.isnan(gaps).sum()
        assert_allclose(turned.rows.wrench, rows.wrench)
        assert_allclose(turned.rows.deflection, gaps)


def test_a_zero_of_axis_6_is_told_with_the_turned_tool_that_leaves_the_same_rows(data: LoadTest) -> None:
    """By another arm: with the tool of the sentence it stands at q where it would with the tool as given at the mended q."""
    told = {mistake.key: mistake.settles for mistake in joint_mistakes(data)}
    q = np.radians([[20.0, 10, -15, 40, 60, 30], [-50.0, 30, 10, -80, -40, 100]])

    def tcp(tool: NDArray[np.float64], turn: float) -> NDArray[np.float64]:
        arm = Arm("irb6700-200-2.60", np.ones(6), (tool, np.eye(3)))
        return arm.chain(q - np.radians([0, 0, 0, 0, 0, turn]))[0]

    for turn in (90.0, -90.0, 180.0):
        words = told[f"joint_zero[6 {turn:+.0f}]"].split("tool.position_mm should be [")[1].split("]")[0]
        given = 1e3 * data.cell.flange_from_tcp.position
        assert_allclose(tcp(np.array(words.split(","), float), 0.0), tcp(given, turn), atol=0.1)
    assert not any("tool" in settles for key, settles in told.items() if "[6" not in key)


@pytest.mark.parametrize(("rows", "words"), [
    ([5], "1 of 20 rows with a load (line 12)"),
    ([0, 1, 2, 8], "4 of 20 rows with a load (lines 2 to 6, 18)"),
    ([0, 2, 4, 6, 7, 9], "6 of 20 rows with a load (lines 2, 6, 10, 14 to 16 and 1 more place)"),
    ([0, 2, 4, 6, 8, 10], "6 of 20 rows with a load (lines 2, 6, 10, 14 and 2 more places)")])
def test_rows_are_named_by_the_lines_from_first_to_last(rows: list[int], words: str) -> None:
    """Every other line of the file has a load: lines 2, 4, 6 to 40."""
    found = np.isin(np.arange(20), rows)
    table: Any = SimpleNamespace(rows=SimpleNamespace(line=2 + 2 * np.arange(20)))
    assert where(table, found) == words


def test_a_part_of_the_rows_is_mended_alone(data: LoadTest) -> None:
    part = data.rows.visit >= 5
    for each in (*axes_mistakes(data)[:5], *joint_mistakes(data)[:5]):
        if each.of == "table":
            mended, whole = each.mended(data, part).rows, each.mended(data).rows
            for name in ("theta", "wrench", "deflection"):
                assert_allclose(getattr(mended, name)[part], getattr(whole, name)[part])
                assert_allclose(getattr(mended, name)[~part], getattr(data.rows, name)[~part])


@pytest.mark.parametrize("first", [0, 40])
@pytest.mark.parametrize(("column", "by"), [("deflection", 1), ("deflection", -1), ("wrench", 1), ("theta", 1), ("theta", -1)])
def test_what_slipped_is_put_back(data: LoadTest, column: str, by: int, first: int) -> None:
    """Cells that slipped by hand, from the first row or another on: each row has its own again, but for those whose cells fell
    off, which have no reading. Loads that begin otherwise at each visit tell forces and readings apart."""
    moved = np.random.default_rng(3).permutation(data.rows.wrench)
    rows = replace(data.rows, wrench=moved)
    values = getattr(rows, column)
    # 18 rows a visit; angles slip by whole visits.
    step = by * (18 if column == "theta" else 1)
    part = np.arange(len(rows)) >= (36 if first and column == "theta" else first)
    begin = int(np.argmax(part))
    source = np.arange(len(rows))
    source[part] = np.clip(source[part] - step, begin, len(rows) - 1)
    spoiled = data.with_rows(replace(rows, **{column: values[source]}))
    keys = {"deflection": "readings", "wrench": "forces", "theta": "joints"}
    (mistake,) = [each for each in slipped_mistakes(spoiled) if each.key == f"{keys[column]}_slipped[{by:+d}]"]
    mended = mistake.mended(spoiled, part if first else None).rows
    lost = np.isnan(mended.deflection).any(axis=1)
    assert lost.sum() == abs(step)
    assert_allclose(mended.theta[~lost], rows.theta[~lost])
    assert_allclose(mended.wrench[~lost], rows.wrench[~lost])
    assert_allclose(mended.deflection[~lost], rows.deflection[~lost])


def test_the_quick_look_is_generalised_least_squares(data: LoadTest) -> None:
    """Sums over visits against the full covariance of all readings, written down row by row."""
    few = data.with_rows(data.rows.select(data.rows.visit < 3))
    model = linear(few)
    columns, readings, variance = model.columns, model.readings, model.variance
    visit = np.repeat(few.rows.visit, 3)
    axis = np.tile(np.arange(3), len(few.rows))
    offset = data.cell.noise.pose_offset[axis]
    covariance = np.diag(np.repeat(variance, 3)) + np.outer(offset, offset) * (
        (visit[:, None] == visit) & (axis[:, None] == axis))
    a, z = columns.reshape(-1, 6), readings.reshape(-1)
    total = sums(model).total()
    assert_allclose(total.gram[0], a.T @ np.linalg.solve(covariance, a), rtol=1e-9)
    assert_allclose(total.pull[0], a.T @ np.linalg.solve(covariance, z), rtol=1e-8)
    assert_allclose(total.squares[0], z @ np.linalg.solve(covariance, z), rtol=1e-9)
    assert_allclose(total.log_determinant[0], np.linalg.slogdet(covariance)[1], rtol=1e-9)


def test_the_quick_look_finds_the_best_springs_of_each(data: LoadTest) -> None:
    """The likelihood of the sums, its noise's scale free, against a search by SciPy, for a table mixed up in many ways: each
    data set comes to its own springs within a twentieth, however long another takes to its own."""
    each = [sums(linear(mistake.mended(data))).total() for mistake in (*axes_mistakes(data)[::9], *joint_mistakes(data)[::5])]
    log_std = data.prior.prior.log_std

    def left(x: NDArray[np.float64], one: Sums) -> float:
        c = np.exp(x)
        return float(max(one.squares[0] - 2 * one.pull[0] @ c + c @ one.gram[0] @ c, 1e-3 * one.count[0]))

    def cost(x: NDArray[np.float64], one: Sums) -> float:
        return float(0.5 * one.count[0] * np.log(left(x, one) / one.count[0]) + 0.5 * np.sum((x / log_std) ** 2))

    scores, springs = log_scores(Sums.joined(each), log_std)
    for one, score, x in zip(each, scores, springs, strict=True):
        assert_allclose(score, -cost(x, one) - 0.5 * one.log_determinant[0], rtol=1e-12)
        # At the edge of the least noise that is believed, a thirtieth of what is stated, either may stay where it meets it.
        edge = left(x, one) <= 1.001e-3 * one.count[0]
        assert cost(x, one) < minimize(cost, x, (one,), method="BFGS").fun + (1.0 if edge else 0.05)
        assert_allclose(log_scores(one, log_std)[0], score, rtol=1e-12)


@pytest.mark.parametrize(("name", "column"), [
    ("readings raw", "deflection"), ("readings stepwise", "deflection"), ("forces stepwise", "wrench"),
    ("forces unsigned", "wrench"), ("deflections unsigned", "deflection"), ("turns not counted", "deflection")])
@pytest.mark.parametrize("robot", ["virtual", "irb6640-235-2.55"])
def test_what_was_written_otherwise_is_put_back(name: str, column: str, robot: str, tmp_path: Path) -> None:
    """Of the right table none is offered; of the wrong one its own, with which the table is the right one again: but for signs
    of what is nearly none, and for a zero that was read with noise."""
    files = right(31, robot)
    (tmp_path / "right").mkdir()
    as_it_was = _read(files, tmp_path / "right")
    spoiled, (key, *_) = MISTAKES[name](files, np.random.default_rng(8))
    data = _read(spoiled, tmp_path)
    always = ("readings_stepwise", "forces_stepwise")
    assert {each.key for each in reading_mistakes(as_it_was)} == set(always)
    (mistake,) = [each for each in reading_mistakes(data) if each.key == key and each.mended(data).rows is not data.rows]
    wanted, mended = getattr(as_it_was.rows, column), getattr(mistake.mended(data).rows, column)
    off = 1e-9 if key in always else 30e-6 if column == "deflection" else 1.0
    assert np.nanmax(np.abs(getattr(data.rows, column) - wanted)) > 3 * off
    assert_allclose(mended, wanted, rtol=1e-9, atol=off)
    assert np.mean(np.abs(np.nan_to_num(mended - wanted)) > off / 2) < 0.05


def test_gauges_at_their_end_read_nothing(tmp_path: Path) -> None:
    """What stopped them is left out, and no other reading."""
    files = right(31, "irb6640-235-2.55")
    spoiled, (key,) = MISTAKES["gauges at their end"](files, np.random.default_rng(8))
    data = _read(spoiled, tmp_path)
    (mistake,) = [each for each in reading_mistakes(data) if each.key == key]
    mended = 1e6 * mistake.mended(data).rows.deflection
    stopped = np.abs(files.moved) > np.abs(spoiled.moved)
    assert stopped.sum() >= 3
    assert np.isnan(mended[stopped]).all()
    assert_allclose(mended[~np.isnan(mended)], spoiled.moved[~np.isnan(mended)])
    # Of readings as large as that, but for the sensor's noise, nobody knows.
    assert np.isnan(mended).sum() <= stopped.sum() + 3


def test_readings_at_the_end_of_travel_scatter_as_all_do(data: LoadTest) -> None:
    """All that end there are left out, those of the other side of their scatter too, and hardly another one."""
    rows, sigma = data.rows, data.cell.noise.deflection[2]
    end = np.sort(np.abs(rows.deflection[:, 2]))[-25]
    stopped = np.abs(rows.deflection[:, 2]) > end
    read = np.clip(rows.deflection[:, 2], -end, end) + np.random.default_rng(8).normal(0, sigma, len(rows))
    spoiled = data.with_rows(replace(rows, deflection=np.column_stack([rows.deflection[:, :2], read])))
    (mistake,) = [each for each in reading_mistakes(spoiled) if each.key == "readings_clipped"]
    left_out = np.isnan(mistake.mended(spoiled).rows.deflection)
    assert left_out[stopped, 2].all()
    assert np.abs(rows.deflection[left_out[:, 2], 2]).min() > end - 9 * sigma
    assert not left_out[:, :2].any()


def test_a_zero_of_one_reference_is_not_taken_off(tmp_path: Path) -> None:
    """What the tool is off by at a pose, from a reference taken elsewhere, is no gauge's stand."""
    spoiled, _ = MISTAKES["readings raw"](right(31), np.random.default_rng(8))
    data = _read(replace(spoiled, anew=False), tmp_path)
    assert "readings_raw" not in {each.key for each in reading_mistakes(data)}


def test_two_robots_stand_beside_whatever_may_be_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A zero that is off, in a misfit that is not gross: the rows of two robots are no name there, but a rival. Were they
    likelier, nothing would be named."""
    off = _read(MISTAKES["joint zero 2 deg"](right(4, "irb4400-60"), np.random.default_rng([4, 3]))[0], tmp_path)
    plain = posterior(off)
    found = search(plain)
    guess = Guess(_two_robots(), np.arange(len(off.rows)) < len(off.rows) // 2, 0.0, 0.0, split=True)

    def possible(log_prior: float) -> list[str]:
        monkeypatch.setattr(judge, "search", lambda _: replace(found, apart=(replace(guess, log_prior=log_prior),)))
        return [named.key for named in mistakes_in(plain).possible]

    assert possible(-1e6) == ["joint_zero[2]"]
    assert possible(1e6) == []


@pytest.mark.parametrize("size", SIZES, ids=lambda size: size.name)
def test_a_size_shows_as_the_mended_model_says(data: LoadTest, size: Size) -> None:
    """The term beside the springs against the whole model with the TCP, the angles or the forces changed, to first order."""
    compliance = 1 / data.cell.prior.stiffness
    for joint in size.places:
        values = 0.5 * np.array([parameter.typical for parameter in size.parameters])
        mended = size.mistake(data, joint, values, values).mended(data)
        expected = mended.load_state(compliance).elastic[:, :3] - data.load_state(compliance).elastic[:, :3]
        said = size.contribution(data.load_state(compliance), joint, values)[:, :3]
        assert np.abs(said - expected).max() < 0.03 * np.abs(expected).max()


@pytest.mark.parametrize("size", SIZES, ids=lambda size: size.name)
def test_the_quick_look_finds_a_size_that_was_planted(data: LoadTest, size: Size) -> None:
    """Half more than usual, of either sign: to an eighth, but for a zero of joint 6, which hardly moves this tool."""
    for joint in size.places:
        typical = np.array([parameter.typical for parameter in size.parameters])
        planted = 1.5 * typical * np.where(np.arange(len(typical)) % 2, -1, 1)
        look = Look(size.mistake(data, joint, -planted, typical).mended(data))
        scores, springs = log_scores(sums(linear(look.data)).total(), look.data.prior.prior.log_std)
        found, score = look._sized(size, joint, springs[0])
        assert_allclose(found, planted, rtol=0.125)
        assert score > scores[0] + 20


def test_a_factor_is_a_unit_where_robots_do_not_differ_by_as_much(data: LoadTest) -> None:
    """Forces 4.448 times too small are pounds where the prior is that of the robot (within a half); beside the medians of
    another one (three times, as built-in files have) the robot may be so, which is said, and kilograms may not."""
    def of(times: float, relative_std: float) -> Posterior:
        cell = replace(data.cell, prior=replace(data.cell.prior, relative_std=np.full(6, relative_std)))
        return posterior(LoadTest.of(cell, replace(data.rows, wrench=data.rows.wrench / times)))

    assert unit_mistake(of(1.0, 3.0)) is None
    mistake, probability = unit_mistake(of(4.44822, 0.5))
    assert "in lbf" in mistake.sentence
    assert probability > 0.95
    wide = of(4.44822, 3.0)
    assert unit_mistake(wide) is None
    (finding,) = common_factor_findings(wide)
    assert "softer than the prior's medians, as they would with forces in lbf" in finding.message
    mistake, probability = unit_mistake(of(9.80665, 3.0))
    assert "in kgf" in mistake.sentence
    assert 0.5 < probability < 0.95


def test_times_of_another_unit(data: LoadTest) -> None:
    def said(time: float, dwell: float) -> str | None:
        rows = replace(data.rows, time=time * data.rows.time, dwell=dwell * data.rows.dwell)
        mistake = time_mistake(data.with_rows(rows))
        return None if mistake is None else mistake.key

    assert said(1.0, 1.0) is None
    assert said(2.0, 1.0) is None
    assert said(1.0, np.nan) is None
    assert said(1000.0, 1000.0) == "time_unit[ms]"
    assert said(1 / 60, 1.0) == "time_unit[minutes]"
    assert said(1.0, 1000.0) == "time_unit[dwell ms]"


def test_mistakes_of_a_size_are_told_from_where_the_documentation_says() -> None:
    text = " ".join((Path(__file__).parents[3] / "docs" / "effects.md").read_text(encoding="utf-8").split())
    said = [re.search(words, text) for words in (
        r"the TCP elsewhere \(from (\S+) mm\)", r"a joint's zero \(from (\S+) degrees\)", r"taken under load \(from (\S+) N\)")]
    sizes = [float(found.group(1)) for found in said if found]
    np.testing.assert_allclose([1e3 * ToolOffset.smallest, np.degrees(JointZero.smallest), ReferenceLoad.smallest], sizes)


@pytest.mark.parametrize(("rows", "said"), [(2, False), (3, True)])
def test_a_tool_that_moves_without_a_load_is_said_from_the_third_row_on(data: LoadTest, rows: int, said: bool) -> None:
    """One or two such rows may be a slip of their own."""
    loaded = data.rows.select(np.any(data.rows.wrench != 0, axis=1))
    wrench = loaded.wrench.copy()
    wrench[np.argsort(-np.linalg.norm(np.nan_to_num(loaded.deflection), axis=1))[:rows]] = 0.0
    found = first_look(data.with_rows(replace(loaded, wrench=wrench)))
    assert (found is not None and "in rows without a load, too" in found.message) is said


def test_a_mistake_stands_against_physics_by_its_odds() -> None:
    """Twenty to one (ln 3) for either, alone where it is the only one; one that is slight stands beside a name alone."""
    def named(log_posterior: float) -> Any:
        return SimpleNamespace(candidate=SimpleNamespace(log_posterior=log_posterior))

    nothing: Any = None
    one, two, slight = ([named(10.0)], [named(10.0), named(9.0)], [named(10.0)])
    alone, pair = (Mistakes(nothing, tuple(possible), None) for possible in (one, two))
    assert [alone.clearly(physics) for physics in (6.9, 7.1)] == [True, False]
    assert not pair.clearly(0.0)
    assert [alone.against(physics, False) for physics in (12.9, 13.1)] == [tuple(one), ()]
    assert pair.against(12.9, True) == tuple(two)
    beside = Mistakes(nothing, (), None, tuple(slight))
    assert [beside.against(0.0, name) for name in (True, False)] == [tuple(slight), ()]
    assert not beside.clearly(0.0)
    assert Mistakes(nothing, (), None).against(-np.inf, True) == ()


def test_what_may_be_the_same_is_said_of_the_same_rows_alone() -> None:
    """Of guesses that leave the same rows one is told, with the others of another quantity that stand in the same rows."""
    def guess(key: str, rows: Any) -> Any:
        return Guess(Mistake(key, f"{key} of {{rows}}", "look", "table", lambda data: data), rows, 0.0, 0.0)

    late, later = np.arange(6) > 2, np.arange(6) > 3
    for rows, others, said in ((None, None, True), (late, late.copy(), True), (late, later, False), (late, None, False),
                               (None, late, False)):
        told = of_alike([guess("force_sign", rows), guess("deflection_sign", others), guess("force_swapped", rows)])
        assert told.mistake.key == "force_sign"
        assert ("or, which is the same to these rows, deflection_sign of {rows}" in told.mistake.sentence) is said
        assert "force_swapped" not in told.mistake.sentence


def test_a_mistake_in_a_part_is_as_likely_as_the_table_mended_there(data: LoadTest) -> None:
    """Before each boundary and from each on, by sums over visits as by all rows of the mended table; each mistake that is tried
    counts once, in whatever part."""
    look, log_std = Look(data), data.prior.prior.log_std
    plain = sums(linear(data))
    guesses, sized = look._of_columns(plain), look._of_sizes(log_scores(plain.total(), log_std)[1][0])
    assert len({(guess.mistake.key, guess.mistake.sentence) for guess in guesses}) + len(sized) == look.tried
    parts = [guess for guess in guesses if guess.mistake.key == "force_sign[z]" and guess.rows is not None]
    assert len({guess.rows.tobytes() for guess in parts}) == len(parts) == 2 * len(look.boundaries)
    for guess in parts:
        assert guess.rows[0] != guess.rows[-1]
        (score,), _ = log_scores(sums(linear(guess.mistake.mended(data, guess.rows))).total(), log_std)
        assert guess.score - guess.log_prior == pytest.approx(score, rel=1e-9)


def test_a_column_that_one_row_alone_has_is_no_mistake_of_a_part(data: LoadTest) -> None:
    """A reading written a tenth as large, of the only row of the last visit that pushes along its axis, is that row's slip,
    and no force in another unit in all of them. Of two such rows it may be either."""
    axis = int(np.argmax(np.abs(data.rows.wrench[-1, :3])))
    last = data.rows.visit == data.rows.visit[-1]
    along = np.flatnonzero(last & (data.rows.wrench[:, axis] != 0))
    for count in (1, 2):
        kept = ~np.isin(np.arange(len(last)), along[:-count])
        rows = data.rows.select(kept)
        deflection = rows.deflection.copy()
        off = np.flatnonzero(rows.visit == rows.visit[-1])[rows.wrench[rows.visit == rows.visit[-1], axis] != 0]
        assert len(off) == count
        deflection[off] /= 10
        spoilt = data.with_rows(replace(rows, deflection=deflection))
        found = [guess for guess in Look(spoilt).guesses() if guess.rows is not None and not guess.split]
        assert any(guess.mistake.key == f"force_unit[{'xyz'[axis]}]" for guess in found) == (count == 2)
        for guess in found:
            mended = guess.mistake.mended(spoilt, guess.rows).rows
            assert np.count_nonzero([np.any(getattr(mended, name) != getattr(rows, name), axis=1)
                                     for name in ("wrench", "deflection", "theta")]) > 1


def test_a_moment_has_no_force_whose_sign_could_be_lost(data: LoadTest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tenth of the rows with a force have another sign: enough, however many rows there are with a moment alone."""
    wrench = np.abs(data.rows.wrench)
    alone = np.arange(len(wrench)) % 2 == 0
    wrench[alone], wrench[~alone, 3:] = [0, 0, 0, 9, 0, 0], 0.0
    wrench[~alone, 0] += 1.0
    signed, forced = wrench.copy(), np.flatnonzero(~alone)
    signed[forced[: -(-len(forced) // 10)], 0] *= -1
    monkeypatch.setattr(readings, "_with_signs", lambda data: {"wrench": signed})
    keys = {mistake.key for mistake in reading_mistakes(data.with_rows(replace(data.rows, wrench=wrench)))}
    assert "forces_unsigned" in keys


def test_readings_that_a_mended_table_leaves_out_are_as_likely_as_draws_from_all() -> None:
    """Each a normal one of its axis' root mean square, e^-1/2 on average; one that stands in another column than before is not
    lost, nor what was none before."""
    nan = np.nan
    before = 1e-6 * np.array([[3.0, 4.0, nan], [-3.0, nan, 8.0], [3.0, -4.0, 8.0], [nan, 4.0, -8.0]])

    def lost(after: list[list[float]], per_unit: Any = 1.0) -> float:
        data, mended = (SimpleNamespace(rows=SimpleNamespace(deflection=values)) for values in (before, 1e-6 * np.array(after)))
        table: Any = data
        other: Any = mended
        return log_lost(table, other, per_unit)

    same = (1e6 * before).tolist()
    assert lost(same) == 0.0
    assert lost([[nan, 3.0, 4.0], [8.0, -3.0, nan], *same[2:]]) == 0.0
    assert lost([same[0], [-3.0, 1.0, 8.0], *same[2:]]) == 0.0
    x, y, z = (-np.log(1e-6 * size) - 0.5 for size in (3.0, 4.0, 8.0))
    assert lost([[nan, nan, nan], *same[1:]]) == pytest.approx(x + y)
    assert lost([*same[:2], [3.0, -4.0, nan], [nan, nan, -8.0]]) == pytest.approx(z + y)
    # One lost, one in its place: that row has as many as it had.
    assert lost([[3.0, nan, 2.0], *same[1:3], [nan, nan, nan]]) == pytest.approx(y + z)
    assert lost([[nan, 4.0, nan], *same[1:]], np.array([1e3, 1.0, 1.0])) == pytest.approx(x - np.log(1e3))


def test_a_size_costs_what_its_readings_tell_it(data: LoadTest) -> None:
    """Half of ln of their number for each that is fitted: a TCP that is off along three axes thrice what it is along one."""
    look = Look(data)
    springs = log_scores(sums(linear(data)).total(), data.prior.prior.log_std)[1][0]
    for guess in look._of_sizes(springs):
        best, score = look._sized(guess.size, guess.joint, springs)
        cost = len(best) * np.log(np.sqrt(data.rows.deflection.size))
        assert guess.score - guess.log_prior == pytest.approx(score - cost)
        assert guess.log_prior < 0


def test_what_the_arm_s_unknown_weight_does_is_no_evidence(data: LoadTest) -> None:
    """It is integrated out: the rows are as likely as a normal distribution with the weight's columns in its covariance
    makes them."""
    fitted = posterior(data)
    at, columns = fitted.at_map, fitted.beside.reshape(-1, 11)
    design, residual = at.design.reshape(len(columns), -1), at.residual.ravel()
    precision = at.prior.precision(at.x)
    sigma = np.linalg.inv(fitted.weights.apply(np.eye(len(columns)).reshape(*at.residual.shape, -1)).reshape(len(columns), -1))
    springs = sigma + design @ np.linalg.solve(precision, design.T)
    expected = design @ -np.linalg.solve(precision, at.prior.gradient(at.x))
    with_weight, without = (multivariate_normal(expected, 0.5 * (every + every.T)).logpdf(residual)
                            for every in (springs + columns @ columns.T, springs))
    known = posterior(data)
    known.__dict__["beside"] = fitted.beside[:, :, :0]
    assert log_evidence(fitted) - log_evidence(known) == pytest.approx(with_weight - without, abs=1e-6)


@pytest.mark.parametrize("size", [ToolOffset(), JointZero(), ReferenceLoad()], ids=lambda size: size.name)
def test_what_speaks_for_a_size_near_none_is_its_share_of_the_likelihood(data: LoadTest, size: Size) -> None:
    """By normal distributions of the residual, written out: with what five typical sizes do in its covariance, and without."""
    joint = 2 if size.joints else None
    fitted = posterior(data)
    at = fitted.at_map
    count = at.residual.size
    design, residual = at.design.reshape(count, -1), at.residual.ravel()
    precision = at.prior.precision(at.x)
    without = np.linalg.inv(fitted.weights.apply(np.eye(count).reshape(*at.residual.shape, -1)).reshape(count, -1))
    without = without + design @ np.linalg.solve(precision, design.T)
    typical = np.array([parameter.typical for parameter in size.parameters])
    moves = [size.contribution(fitted.load_state, joint, small)[:, :3] / 1e-4 for small in 1e-4 * np.diag(typical)]
    columns = 5 * np.einsum("nij,njk->nik", at.noise.whitening, np.stack(moves, axis=2)).reshape(count, -1)
    expected = design @ -np.linalg.solve(precision, at.prior.gradient(at.x))
    both = [multivariate_normal(expected, 0.5 * (every + every.T)).logpdf(residual)
            for every in (without + columns @ columns.T, without)]
    weights: Any = fitted.weights
    guess = Guess(_two_robots(), None, 0.0, -2.5, size=size, joint=joint, start=typical)
    assert _support_near_none(fitted, weights, guess) == pytest.approx(both[0] - both[1] - 2.5, abs=0.02)


def test_a_relative_error_that_is_stated_alone_counts(data: LoadTest) -> None:
    """3 % of the force and the usual newtons, where the file has `force_relative_std` without `force_std_n`."""
    noise = replace(data.cell.noise, force_relative=0.03, force_relative_stated=True, force_stated=False, force=np.zeros(3))
    model = linear(replace(data, cell=replace(data.cell, noise=noise)))
    sensor = np.mean(np.where(np.isnan(data.rows.sigma), noise.deflection, data.rows.sigma) ** 2, axis=1)
    moved, force = (np.linalg.norm(vector, axis=1) for vector in (data.rows.deflection, data.rows.wrench[:, :3]))
    large = force > 100.0
    share = np.sqrt((model.variance - sensor)[large]) / moved[large]
    assert_allclose(share, np.hypot(0.03, USUAL_FORCE_N / force[large]), rtol=1e-9)


@pytest.mark.parametrize(("force", "share"), [(50.0, 1.0), (500.0, 0.01 + 0.01), (5000.0, 0.01 + 0.0001)])
def test_a_force_error_moves_the_reading_by_its_share_of_the_force(data: LoadTest, force: float, share: float) -> None:
    """10 % of the force, and 50 N of any; never more than the whole reading, and of readings that no robot, however soft, could
    have under such a force only of what it could."""
    wrench, moved = np.zeros_like(data.rows.wrench), data.rows.deflection * force / 5000.0
    wrench[:, 1] = force
    cell = replace(data.cell, noise=replace(data.cell.noise, force=np.full(3, 50.0), force_relative=0.1, force_stated=True))
    model = linear(replace(data.with_rows(replace(data.rows, wrench=wrench, deflection=moved)), cell=cell))
    sensor = np.mean(np.where(np.isnan(data.rows.sigma), cell.noise.deflection, data.rows.sigma) ** 2, axis=1)
    assert_allclose(model.variance, sensor + share * np.sum(np.nan_to_num(moved) ** 2, axis=1), rtol=1e-12)
    far = linear(replace(data.with_rows(replace(data.rows, wrench=wrench, deflection=1e4 * moved)), cell=cell))
    could = 10.0 * np.linalg.norm(model.columns.sum(axis=2), axis=1)
    large = np.linalg.norm(1e4 * np.nan_to_num(moved), axis=1) > could
    assert large.mean() > 0.5
    assert_allclose(far.variance[large], sensor[large] + share * could[large] ** 2, rtol=1e-12)


def test_what_a_mistake_explains_is_the_misfit_that_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two models of 30 and 20 readings: of 150 above the noise 60 are left; all is explained a tenth above the noise, as by
    readings with tails as heavy as these."""
    models = [SimpleNamespace(components=SimpleNamespace(degrees=np.inf), readings=count) for count in (30, 20)]
    plain: Any = SimpleNamespace()
    candidate: Any = SimpleNamespace(models=models)
    monkeypatch.setattr(judge, "ordinary", lambda model: None)

    def share(left: float) -> float:
        monkeypatch.setattr(judge, "_chi2", lambda fitted, mended, usual: mended.readings * (4.0 if fitted is plain else left))
        return judge._explained(plain, candidate)

    assert share(2.2) == pytest.approx(1 - 60 / 150)
    assert share(4.0) == pytest.approx(0.0)
    assert share(1.09) == 1.0
    for model in models:
        model.components.degrees = 8.0
    assert share(2.2) == pytest.approx(1 - (2.2 / (8 / 6) - 1) / (4.0 / (8 / 6) - 1))


def test_a_misfit_is_that_of_each_fit_in_the_readings_it_was_made_from(data: LoadTest) -> None:
    """In the rows and with the noise of the mended ones; of the sensor alone a sum over the readings. Where a mended reading
    stands in another column, the noise is that of the column that the fit has it in."""
    plain, alone = posterior(data), VarianceComponents(force=0.0, absolute=0.0, offset=0.0)
    (turned,) = [each for each in axes_mistakes(data) if each.key == "deflection_sign[z]"]
    part = np.arange(len(data.rows)) % 3 > 0
    mended = posterior(turned.mended(data.with_rows(data.rows.select(part))))
    sigma = np.where(np.isnan(data.rows.sigma), data.cell.noise.deflection, data.rows.sigma)

    def squares(fitted: Posterior, table: LoadTest, sigma: NDArray[np.float64]) -> float:
        return float(np.nansum(((table.rows.deflection - fitted.predicted(table)) / sigma) ** 2))

    rows = data.with_rows(data.rows.select(part))
    assert judge._chi2(plain, mended, alone) == pytest.approx(squares(plain, rows, sigma[part]))
    assert judge._chi2(mended, mended, alone) == pytest.approx(squares(mended, mended.data, sigma[part]))
    assert judge._chi2(plain, mended, replace(alone, sensor=2.0)) == pytest.approx(squares(plain, rows, 2 * sigma[part]))


def test_a_mistake_of_a_size_may_be_of_either_sign() -> None:
    for size in SIZES:
        assert all(one.low == -one.high < 0 < one.typical < one.high for one in size.parameters)


def test_a_unit_belongs_to_its_own_columns(data: LoadTest) -> None:
    """A force in kilograms leaves the readings as they are, and their sigma goes with the readings."""
    rows = replace(data.rows, sigma=np.full_like(data.rows.deflection, 2e-6))
    force, reading = (units._scaled(quantity, by)(data.with_rows(rows))
                      for quantity, by in (("force", 9.8), ("deflection", 1e-3)))
    assert list(force) == ["wrench"]
    assert np.array_equal(force["wrench"], 9.8 * rows.wrench)
    assert sorted(reading) == ["deflection", "sigma"]
    np.testing.assert_allclose(reading["deflection"], 1e-3 * rows.deflection)
    np.testing.assert_allclose(reading["sigma"], 2e-9)


@pytest.mark.parametrize("fault", ["one wild row", "joint 1 off", "positions"])
def test_a_first_look_names_no_unit_for_what_no_unit_explains(data: LoadTest, fault: str) -> None:
    """Directions that fit no springs do so in any unit; readings made a thousand times smaller only drown in the noise."""
    deflection, theta = data.rows.deflection.copy(), data.rows.theta.copy()
    if fault == "one wild row":
        deflection[20] *= 100
    elif fault == "joint 1 off":
        theta[:, 0] += np.radians(30)
    else:
        deflection += np.random.default_rng(5).normal(0, 3e-4, deflection.shape)
    said = first_look(data.with_rows(replace(data.rows, deflection=deflection, theta=theta)))
    assert said is None or "not in um" not in said.message
