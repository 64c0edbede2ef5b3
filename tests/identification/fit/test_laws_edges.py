"""Each side of the limits from which on readings, loads and angles may have been written otherwise, and of those by which a
mistake is named, a joint graded, a part of the noise too large: worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy import stats

from identification.fit import misfit
from identification.fit.discrepancy import discrepancies
from identification.fit.fitted_model import Term, with_terms
from identification.fit.identifiability import JointGrade, grade_joints
from identification.fit.load_test import LoadTest
from identification.fit.misfit import ModelCheck, beyond_stated, model_check
from identification.fit.mistakes import judge, look, search
from identification.fit.mistakes.joints import joint_mistakes
from identification.fit.mistakes.look import Guess
from identification.fit.mistakes.mistake import Mistake
from identification.fit.mistakes.readings import reading_mistakes
from identification.fit.mistakes.slipped import slipped_mistakes
from identification.fit.noise_degrees import NoiseDegrees, beside_the_springs
from identification.fit.noise_parts import MEMORY, OFFSET, PARTS, SETUP, VarianceComponents
from identification.fit.posterior import posterior
from identification.fit.profile import profiles
from identification.fit.slips import slips_of
from identification.fit.subsets import Conflict
from identification.fit.variance_prior import log_prior
from identification.fit.visit_findings import kinds_apart
from identification.fit.visits import tails
from identification.model.effects import effects
from tests.identification.fit.exact_rows import beside, by_compliance
from tests.identification.fit.test_laws_posterior import TRUE, simulate
from tests.support import random_poses

Array = NDArray[np.float64]
PER_VISIT = 4


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    """Eight visits of four rows, the first without a load and with a reference of its own; the readings are the springs'. The
    cell states 2 um of a reading and 4 um of re-seating."""
    cell, rows = simulate(tmp_path_factory.mktemp("edges"), np.random.default_rng(5), poses=8, loads=PER_VISIT, quiet=True)
    wrench = rows.wrench.copy()
    wrench[::PER_VISIT] = 0.0
    moved = by_compliance(rows.theta, cell.flange_from_tcp.position, wrench[:, :3]) @ (1 / TRUE)
    return LoadTest.of(cell, replace(rows, wrench=wrench, deflection=moved, reference=rows.visit))


def keys(data: LoadTest, **columns: Any) -> set[str]:
    return {one.key for one in reading_mistakes(data.with_rows(replace(data.rows, **columns)))}


@pytest.mark.parametrize(("stated", "zero_um", "raw"), [(True, 38.0, False), (True, 42.0, True), (False, 28.5, False),
                                                       (False, 31.5, True)])
def test_zeros_ten_times_as_far_off_as_re_seating_takes_them_were_not_taken_off(
        data: LoadTest, stated: bool, zero_um: float, raw: bool) -> None:
    """4 um where they are stated, else the usual 3 um."""
    deflection = data.rows.deflection.copy()
    deflection[::PER_VISIT] = 1e-6 * zero_um * np.array([1, -1, 1])
    other = replace(data, cell=replace(data.cell, noise=replace(data.cell.noise, offset_stated=stated)))
    assert ("readings_raw" in keys(other, deflection=deflection)) is raw


def all_apart(data: LoadTest) -> Array:
    """Readings along y and z of which no two lie within 12 um of each other, none along x."""
    return 1e-6 * np.arange(len(data.rows))[:, None] * [0.0, 14.0, 15.0]


@pytest.mark.parametrize(("visits", "short_um", "clipped"), [
    (3, 0.0, True), (2, 0.0, False), (3, 11.0, True), (3, 13.0, False)])
def test_a_gauge_ends_where_three_visits_read_its_largest_to_six_sigmas(
        data: LoadTest, visits: int, short_um: float, clipped: bool) -> None:
    """Of 2 um. The last of the visits reads so much less."""
    deflection = all_apart(data)
    last = [PER_VISIT * visit + 1 for visit in range(visits)]
    deflection[last, 0] = 3e-4
    deflection[last[-1], 0] -= 1e-6 * short_um
    assert ("readings_clipped" in keys(data, deflection=deflection)) is clipped


@pytest.mark.parametrize(("at_end", "clipped"), [(15, True), (17, False)])
def test_a_gauge_that_reads_the_same_in_half_of_the_rows_is_stuck(data: LoadTest, at_end: int, clipped: bool) -> None:
    """Of 32."""
    deflection = all_apart(data)
    deflection[:at_end, 0] = 3e-4
    assert ("readings_clipped" in keys(data, deflection=deflection)) is clipped


@pytest.mark.parametrize("turn_um", [100, 200, 500, 1000])
def test_a_dial_s_turns_are_put_back(data: LoadTest, turn_um: int) -> None:
    """Readings of up to four turns of which the large hand alone was written, towards either side."""
    largest = np.abs(data.rows.deflection).max()
    times = 4e-6 * turn_um / largest
    moved, wrench = times * data.rows.deflection, times * data.rows.wrench
    spoiled = data.with_rows(replace(data.rows, wrench=wrench, deflection=np.fmod(moved, 1e-6 * turn_um)))
    mended = {one.sentence: one.mended(spoiled).rows.deflection for one in reading_mistakes(spoiled) if "turns" in one.key}
    assert list(mended) == [f"the readings seem to lack whole turns of {turn_um} um (the small hand of the gauges) in {{rows}}"]
    assert_allclose(next(iter(mended.values())), moved, atol=1e-12)


@pytest.mark.parametrize(("turned", "unsigned"), [(2, False), (3, True)])
def test_signs_were_lost_where_a_tenth_of_the_loads_have_another(data: LoadTest, turned: int, unsigned: bool) -> None:
    """Of 24 rows with a load, all written as positive, so many moved against it."""
    wrench = np.abs(data.rows.wrench)
    loaded = np.flatnonzero(wrench.any(axis=1))
    deflection = 1e-6 * wrench[:, :3]
    deflection[loaded[:turned]] *= -1
    assert ("forces_unsigned" in keys(data, wrench=wrench, deflection=deflection)) is unsigned
    wrench[loaded[-1], 2] *= -1         # one that has a sign: they were written
    assert "forces_unsigned" not in keys(data, wrench=wrench, deflection=deflection)


@pytest.mark.parametrize(("per_cent", "alike"), [(1.8, True), (2.2, False)])
def test_loads_that_differ_by_two_per_cent_are_not_the_same(data: LoadTest, per_cent: float, alike: bool) -> None:
    """Each visit begins with the same load, or so nearly: then nobody knows whether the forces or the readings slipped."""
    wrench = np.random.default_rng(3).uniform(100, 300, data.rows.wrench.shape)
    wrench[::PER_VISIT] = 100.0
    wrench[PER_VISIT, 0] += per_cent
    told = {one.key: one.sentence for one in slipped_mistakes(data.with_rows(replace(data.rows, wrench=wrench)))}
    assert (", or the forces a row too high" in told["readings_slipped[+1]"]) is alike
    assert ("forces_slipped[+1]" in told) is not alike


@pytest.mark.parametrize(("beyond", "possible"), [(4.5, True), (5.5, False)])
def test_mended_angles_may_lie_five_degrees_beyond_a_limit(data: LoadTest, beyond: float, possible: bool) -> None:
    """Axis 1 so far beyond the limit of axis 5, with which it may have been swapped."""
    theta = np.zeros((len(data.rows), 6))
    theta[:, 0] = data.cell.robot.limits[4, 1] + np.radians(beyond)
    assert data.cell.robot.limits[0, 1] > theta[0, 0]
    swapped = {one.key for one in joint_mistakes(data.with_rows(replace(data.rows, theta=theta)))}
    assert ("joints_swapped[15]" in swapped) is possible


def judged(monkeypatch: pytest.MonkeyPatch, *candidates: dict[str, Any], chi2: float = 20.0) -> judge.Mistakes:
    """What is made of these candidates beside rows as they are of ln evidence 0, with 100 readings."""
    plain: Any = SimpleNamespace(chi2=100 * chi2, readings=100, data=SimpleNamespace(rows=None))
    each = []
    for number, told in enumerate(candidates):
        size = SimpleNamespace(moved=2.0, sigmas=told["sigmas"]) if "sigmas" in told else None
        each.append(SimpleNamespace(
            log_posterior=told["support"], found=size, models=(told.get("explained", 1.0),), left=np.zeros(3),
            mistake=Mistake(f"mistake {number}", "", "", "table", lambda data: data)))
    found = SimpleNamespace(plain=plain, log_evidence=0.0, candidates=tuple(each), tried=9)
    found.with_those_apart = lambda: found
    monkeypatch.setattr(judge, "search", lambda _: found)
    monkeypatch.setattr(judge, "left_out", lambda *_: np.ones(3))
    monkeypatch.setattr(judge, "poses", lambda _: None)
    monkeypatch.setattr(judge, "_explained", lambda _, candidate: candidate.models[0])
    return judge.mistakes_in(plain)


@pytest.mark.parametrize(("candidates", "chi2", "sure", "possible", "slight"), [
    # Nine times the stated noise's chi-squared is gross: then one may be sure.
    ([{"support": 40.0}], 9.3, 1, 1, 0), ([{"support": 40.0}], 8.7, 0, 1, 0),
    # e^30 for one that is sure, e^10 for one that is possible, e^3 beside a name.
    ([{"support": 31.0}], 20.0, 1, 1, 0), ([{"support": 29.0}], 20.0, 0, 1, 0), ([{"support": 10.5}], 20.0, 0, 1, 0),
    ([{"support": 9.5}], 20.0, 0, 0, 1), ([{"support": 3.2}], 20.0, 0, 0, 1), ([{"support": 2.8}], 20.0, 0, 0, 0),
    # All but a twentieth of what is beyond the noise, and all but a tenth.
    ([{"support": 40.0, "explained": 0.955}], 20.0, 1, 1, 0), ([{"support": 40.0, "explained": 0.945}], 20.0, 0, 1, 0),
    ([{"support": 40.0, "explained": 0.91}], 20.0, 0, 1, 0), ([{"support": 40.0, "explained": 0.89}], 20.0, 0, 0, 0),
    # Another that is less than e^3 less likely stands beside it.
    ([{"support": 40.0}, {"support": 36.8}], 20.0, 1, 1, 0), ([{"support": 40.0}, {"support": 37.2}], 20.0, 0, 2, 0),
    # One that explains too little is a rival where it is e^3 likelier.
    ([{"support": 42.8, "explained": 0.5}, {"support": 40.0}], 20.0, 1, 1, 0),
    ([{"support": 43.2, "explained": 0.5}, {"support": 40.0}], 20.0, 0, 0, 0),
    # A size is known to four sigmas, and is nothing that is sure without a look at physics.
    ([{"support": 40.0, "sigmas": 4.2}], 20.0, 0, 1, 0), ([{"support": 40.0, "sigmas": 3.8}], 20.0, 0, 0, 0)])
def test_a_mistake_is_named_by_what_speaks_for_it(
        monkeypatch: pytest.MonkeyPatch, candidates: list[dict[str, Any]], chi2: float, sure: int, possible: int,
        slight: int) -> None:
    found = judged(monkeypatch, *candidates, chi2=chi2)
    assert (int(found.sure is not None), len(found.possible), len(found.slight)) == (sure, possible, slight)


def graded(signal: float = 50.0, correlation: float = 0.0, turned: float = 1.0) -> JointGrade:
    """The grade of joint 2, which is known well, trades off with joint 3, moves a reading by so many sigmas and is turned
    by a load with so long a lever [m]; all loads hang."""
    covariance = 0.01 * np.eye(6)
    covariance[1, 2] = covariance[2, 1] = 0.01 * correlation
    design = np.full((4, 3, 6), 100.0)
    design[..., 1] = -signal
    wrench = np.tile([0.0, 0, -300, 0, 0, 0], (4, 1))
    torque = np.full((4, 6), 300.0)
    torque[:, 1] = 300 * turned
    state = SimpleNamespace(torque=torque, wrench=wrench, fall=np.array([0.0, 0, -9.81]))
    posterior: Any = SimpleNamespace(
        covariance=covariance, components=VarianceComponents(sensor=2.0), at_map=SimpleNamespace(design=2 * design),
        load_state=state, prior=SimpleNamespace(log_std=np.full(6, 0.8)))
    return grade_joints(posterior, ModelCheck(1.0, False, ""))[1]


def test_a_joint_is_told_as_never_loaded_under_one_sigma_and_as_unturned_under_a_millimetre() -> None:
    assert graded(signal=1.1).reason == "it moves a reading by up to 1.1 times the sensor's sigma"
    never = "joint 2 was never loaded: it moves no reading by more than 0.9 of the sensor's sigma"
    assert graded(signal=0.9, turned=1.1e-3).reason == never
    assert graded(signal=0.9, turned=0.9e-3).reason == never + ", and no load turns it: all point straight down"


@pytest.mark.parametrize(("correlation", "trades"), [(0.72, True), (-0.72, True), (0.68, False), (-0.68, False)])
def test_joints_trade_off_from_a_correlation_of_seven_tenths(correlation: float, trades: bool) -> None:
    grade = graded(correlation=correlation)
    assert grade.reason == (f"k2 and k3 trade off (correlation {correlation:+.2f})" if trades else
                            "it moves a reading by up to 50 times the sensor's sigma")
    assert grade.partner == (3 if trades else 0)


ALLOWED = [("sensor", True, 4.0), ("force", True, 4.0), ("absolute", True, 4.0), ("offset", True, 4.0), ("offset", False, 10.0),
           ("force", False, 10.0), ("setup", False, 25.0), ("memory", False, 60.0)]


@pytest.mark.parametrize("log_std", [0.05, 0.6])
@pytest.mark.parametrize(("part", "stated", "most"), ALLOWED)
def test_a_part_of_the_noise_is_too_large_where_that_is_95_per_cent_sure(
        part: str, stated: bool, most: float, log_std: float) -> None:
    """Granted four times of what is stated, of what is not as much as a rig may have."""
    bound = most * np.exp(stats.norm.isf(0.05) * log_std)
    for times in (0.96, 1.04):
        assert bool(beyond(part, times * bound, log_std, stated)) is (times > 1), times


def beyond(part: str, multiple: float, log_std: float, stated: bool, relative: float | None = None,
           sensor: float = 1.0) -> list[float]:
    """The multiples that are too large of a fit with this part so many times as large as stated, or usual."""
    noise = SimpleNamespace(stated=tuple(stated and one == part for one in PARTS), active=(True,) * 6)
    components = VarianceComponents(sensor=sensor).with_values(
        np.array([multiple if one == part else sensor if one == "sensor" else 1.0 for one in PARTS]))
    cell = SimpleNamespace(noise=SimpleNamespace(force_relative_stated=relative is not None, force_relative=relative or 0.0))
    data = SimpleNamespace(rows=SimpleNamespace(machined_pass=np.array([""])), cell=cell)
    fitted: Any = SimpleNamespace(data=data, at_map=SimpleNamespace(noise=noise), components=components,
                                  components_log_std=np.full(6, log_std))
    return list(beyond_stated(fitted, 4.0).values())


@pytest.mark.parametrize(("relative", "most"), [(0.002, 10.0), (0.004, 16.0), (0.02, 25.0)])
def test_set_ups_are_held_to_the_force_error_that_is_stated_but_for_half_a_degree(relative: float, most: float) -> None:
    """Four times that, in thousandths; of 10 thousandths at least and 25 at most."""
    for times in (0.96, 1.04):
        assert bool(beyond("setup", times * most, 1e-3, False, relative)) is (times > 1)


def test_what_a_sensor_remembers_matters_where_it_scatters_by_a_tenth_of_what_is_stated() -> None:
    assert beyond("memory", 100.0, 1e-3, False, sensor=0.11) == [100.0]
    assert beyond("memory", 100.0, 1e-3, False, sensor=0.09) == []


@pytest.mark.parametrize(("off", "apart"), [(0.018, True), (0.022, False)])
def test_a_load_hangs_that_is_two_per_cent_off_plumb(data: LoadTest, off: float, apart: bool) -> None:
    """Two poses that do not fit are loaded by what hangs, or nearly; all others sideways."""
    rows, wrench = data.rows, np.zeros_like(data.rows.wrench)
    wrench[:, 1] = 100.0
    wrench[rows.visit < 2, :3] = 100 * off, 0.0, -100 * np.sqrt(1 - off**2)
    bad: Any = [SimpleNamespace(score=SimpleNamespace(rows=rows.row[rows.visit == visit], line=9)) for visit in (0, 1)]
    found = kinds_apart(bad, data.with_rows(replace(rows, wrench=wrench)))
    assert [one.message[:58] for one in found] == ["all 2 poses that do not fit are loaded by what hangs, and n"[:58]] * apart


def visit_of(count: int) -> list[Any]:
    """The slips that are tried at a visit of so many loads, each another one."""
    force = np.random.default_rng(1).uniform(50, 100, (count, 3))
    rows: Any = SimpleNamespace(
        theta=np.zeros((count, 6)), wrench=np.hstack([force, np.zeros((count, 3))]), deflection=np.zeros((count, 3)),
        visit=np.zeros(count, dtype=int), pose=np.full(count, "P", dtype=object), line=np.arange(2, 2 + count),
        row=np.arange(1, 1 + count))
    return [(slip, force) for slip in slips_of(rows, np.ones(count, dtype=bool), frozenset(), np.zeros((count, 3)))]


@pytest.mark.parametrize(("count", "each"), [(6, True), (7, False)])
def test_each_load_s_sign_is_tried_of_six_loads(count: int, each: bool) -> None:
    said = {slip.what for slip, _ in visit_of(count)}
    assert ("the load in line 3 with the other sign would fit" in said) is each


@pytest.mark.parametrize(("count", "any_two"), [(40, True), (41, False)])
def test_any_two_of_forty_readings_may_have_been_exchanged(count: int, any_two: bool) -> None:
    said = {slip.what for slip, _ in visit_of(count)}
    assert ("the readings of lines 2 and 4 exchanged: put back they would fit" in said) is any_two
    assert "the readings of lines 2 and 3 exchanged: put back they would fit" in said


def test_a_visit_s_loads_are_tried_in_the_size_that_the_sentence_says() -> None:
    tried = {slip.what: np.mean(slip.force / force) for slip, force in visit_of(3) if slip.kind == "size of the loads"}
    assert tried == pytest.approx({f"its loads {words} would fit": factor for words, factor in (
        ("twice as large", 2.0), ("half as large", 0.5), ("ten times as large", 10.0), ("a tenth as large", 0.1),
        ("9.81 times as large (kilograms, not newtons)", 9.80665))})


def test_the_sizes_of_the_noise_s_parts_are_believed_by_these_densities() -> None:
    """By SciPy's densities: a stated part normal below 1 and Student of 4 degrees above, 0.3 wide in the logarithm (a sensor
    that is not stated 0.7); re-seating and force error that are not stated exponential about twice the usual; set-ups and
    memory half-Cauchy of twice the usual."""
    logs = np.array([-0.9, -0.2, 0.3, 1.1, 2.5])

    def believed(part: int, stated: bool) -> Array:
        only = tuple(k == part for k in range(6))
        model: Any = SimpleNamespace(stated=only if stated else (False,) * 6, active=only)
        every = np.zeros((len(logs), 6))
        every[:, part] = logs
        return log_prior(model, every)

    for part, stated, scale in ((0, True, 0.3), (1, True, 0.3), (OFFSET, True, 0.3), (0, False, 0.7)):
        wanted = np.where(logs < 0, stats.norm(scale=scale).logpdf(logs) - stats.norm(scale=scale).logpdf(0),
                          stats.t(4, scale=scale).logpdf(logs) - stats.t(4, scale=scale).logpdf(0))
        assert_allclose(believed(part, stated), wanted, atol=1e-12)
    for part in (1, 2, OFFSET):
        wanted = stats.expon(scale=2.0).logpdf(np.exp(logs)) + logs
        assert_allclose(believed(part, False) - wanted, np.log(2.0), atol=1e-12)
    for part in (SETUP, MEMORY):
        assert_allclose(believed(part, False), stats.halfcauchy(scale=2.0).logpdf(np.exp(logs)) + logs, atol=1e-12)


@pytest.mark.parametrize(("chance", "rejected"), [(1.1e-3, False), (0.9e-3, True)])
def test_springs_are_rejected_by_a_misfit_that_chance_makes_in_one_of_a_thousand(
        data: LoadTest, chance: float, rejected: bool) -> None:
    """Of six kinds that are looked at, the last of them parts of the rows that want other springs."""
    noise = 2e-6 * np.random.default_rng(8).standard_normal(data.rows.deflection.shape)
    fitted = posterior(data.with_rows(replace(data.rows, deflection=data.rows.deflection + noise)))
    conflict = Conflict("positive loads", "negative loads", (9, 9), 5.0, 2, chance / 60, chance / 6, np.zeros(6))
    check = model_check(fitted, (conflict,))
    assert check.p_value == pytest.approx(chance)
    assert check.rejected is rejected
    assert check.seen == "positive loads and negative loads want different stiffnesses"


@pytest.mark.parametrize(("degrees", "rows", "judged"), [
    (np.inf, 100, 20.0), (np.inf, 99, 6.0), (10.0, 100, 10.0), (10.0, 99, 6.0), (4.0, 99, 4.0)])
def test_tails_are_as_heavy_as_so_many_rows_leave_open(degrees: float, rows: int, judged: float) -> None:
    assert tails(degrees, rows) == judged


def test_a_law_may_be_off_by_thirty_per_cent_of_its_size_and_a_structure_stiffen_by_fifteen(data: LoadTest) -> None:
    """In each of its shapes, 1 sigma, as docs/effects.md says; of an effect of twice its typical size."""
    state, seen = data.load_state(1 / TRUE), set()
    for name, share in (("soft_zone", 0.3), ("base_rocking", 0.15)):
        effect = effects()[name]
        joint = effect.joints[0] if effect.joints else None
        typical, neutral = effect.typical(state, joint), effect.neutral(state)
        (free,) = discrepancies(state, (Term(effect, joint, neutral + 2 * (typical - neutral), typical, neutral),))
        width = 5.0 * free.scale
        assert np.any(np.isclose(width, share * 2))
        seen |= {round(float(one), 9) for one in width}
    assert seen <= {0.6, 0.3, 2.0}


def test_what_three_axes_have_in_common_is_as_open_as_they_are_unlike(data: LoadTest) -> None:
    """No deflection shows it: of one axis of three that is off by g the mean is g / 3, and what is told of x and y 0.45 to 0.75
    g; 0.6 of that, 1 sigma."""
    effect, state = effects()["force_axis_gain"], data.load_state(1 / TRUE)
    for start, neutral in (([0.02, -0.01], 0.0), ([-0.01, -0.01], 0.0), ([0.02, -0.01], 0.5)):
        term = Term(effect, None, np.array(start) + neutral, np.full(2, 0.015), np.full(2, neutral))
        free = [one for one in discrepancies(state, (term,)) if one.effect.name == "force_gain"]
        assert [one.joint for one in free] == [None]
        width = with_terms(data.prior, free).term_std
        assert width == pytest.approx([0.6 * np.hypot(*start)])
        assert 0.8 < width[0] / 0.01 < 1.4          # of x, or of z, off by 0.03


@pytest.mark.parametrize(("rows", "told"), [(16, False), (17, True)])
def test_nine_columns_are_looked_at_where_four_readings_each_are_left(data: LoadTest, rows: int, told: bool) -> None:
    """Beside six springs and the nine themselves, one a row and axis: a tool that yields to each force in each direction."""
    rng = np.random.default_rng(5)
    few = data.rows.select(np.arange(len(data.rows)) < rows)
    wrench = np.concatenate([rng.normal(0, 200, (rows, 3)), np.zeros((rows, 3))], axis=1)
    few = replace(few, theta=random_poses(data.cell.robot, rows, rng, share=0.6), wrench=wrench, visit=np.arange(rows))
    columns = np.stack([wrench[:, j, None] * np.eye(3)[i] for i in range(3) for j in range(3)], axis=2)
    springs = by_compliance(few.theta, data.cell.flange_from_tcp.position, wrench[:, :3]) @ (1 / TRUE)
    fitted = posterior(data.with_rows(replace(few, deflection=springs + 2e-6 * rng.standard_normal((rows, 3)))))
    assert fitted.readings == 3 * rows
    assert (misfit._p_value(NoiseDegrees(fitted, *beside_the_springs(fitted)), columns) < 1.0) is told


def test_a_profile_s_interval_is_that_of_the_likelihood(data: LoadTest) -> None:
    """Least squares of the compliances, all others free: 1.96 of their standard deviations either way, of a linear model under
    small loads and a prior that says nothing."""
    noise = replace(data.cell.noise, deflection=np.full(3, 2e-8), pose_offset=np.zeros(3), force=np.zeros(3),
                    force_relative=0.0)
    cell = replace(data.cell, noise=noise, prior=replace(data.cell.prior, stiffness=TRUE, relative_std=np.full(6, 30.0)))
    wrench = 0.02 * data.rows.wrench
    each = by_compliance(data.rows.theta, cell.flange_from_tcp.position, wrench[:, :3]) / TRUE
    rows = replace(data.rows, wrench=wrench, deflection=each.sum(axis=2) + 2e-8 * beside(each))
    fitted = posterior(LoadTest.of(cell, rows))
    columns = each.reshape(-1, 6) / (2e-8 * fitted.components.sensor)
    std = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
    for joint, profile in enumerate(profiles(fitted)):
        low, high = (1.0 / (1 + sign * stats.norm.isf(0.025) * std[joint]) for sign in (1, -1))
        within = np.array(profile.interval, dtype=float) / TRUE[joint]
        assert within == pytest.approx([low, high], rel=0.002 + 0.03 * std[joint])


def guessed(key: str, score: float, size: Any = None) -> Guess:
    return Guess(Mistake(key, "", "", "table", lambda data: data), None, score, 0.0, size=size)


@pytest.mark.parametrize(("scores", "sizes", "kept"), [
    # e^4 likelier than none (ln likelihood 7), but e^8 less with a size.
    ([11.2], [-0.8], 2), ([10.8], [-1.2], 0),
    # No more than e^30 behind the best; five at most, of those with a size any number.
    ([90.0, 60.2], [], 2), ([90.0, 59.8], [], 1), ([90.0] * 6, [9.0] * 7, 12),
    ([61.0, 90.0, 70.0, 85.0, 66.0, 75.0], [], 5)])
def test_a_mistake_is_worth_a_fit_that_a_quick_look_finds_so_likely(
        monkeypatch: pytest.MonkeyPatch, scores: list[float], sizes: list[float], kept: int) -> None:
    found = [guessed(f"column {k}", score) for k, score in enumerate(scores)]
    sized = [guessed(f"size {k}", score, "any") for k, score in enumerate(sizes)]
    monkeypatch.setattr(look, "sums", lambda linear: SimpleNamespace(total=lambda: None))
    monkeypatch.setattr(look, "log_scores", lambda total, log_std: (np.array([7.0]), np.zeros((1, 6))))
    itself: Any = SimpleNamespace(
        data=None, _log_std=None, _linear=lambda data: None, _of_columns=lambda plain: found, _from_their_rows=lambda found: [],
        _unlike=lambda guesses: guesses, _of_sizes=lambda springs: sized)
    told = look.Look.guesses(itself)
    assert len(told) == kept
    assert sum(one.size is not None for one in told) == sum(score > -1 for score in sizes)
    of_columns = [one.score for one in told if one.size is None]
    assert of_columns == sorted(scores, reverse=True)[: len(of_columns)]


@pytest.mark.parametrize(("second", "clear"), [(5.8, True), (6.2, False)])
def test_rows_without_a_fit_have_a_mistake_that_is_e_4_likelier_than_any_other(
        monkeypatch: pytest.MonkeyPatch, data: LoadTest, second: float, clear: bool) -> None:
    guesses = [guessed("one", 10.0), guessed("two", second)]
    monkeypatch.setattr(search, "Look", lambda data: SimpleNamespace(guesses=lambda: guesses))
    mistake = search.likeliest_at_a_glance(data)
    assert (mistake.key if mistake else "") == ("one" if clear else "")


@pytest.mark.parametrize(("support", "fitted"), [
    ([-2.9], ["0"]), ([-3.1], []), ([5.0, 9.0, 7.0, 6.0], ["1", "2", "3"])])
def test_of_mistakes_with_a_size_the_three_likeliest_are_fitted_from_e_3_under_none(
        monkeypatch: pytest.MonkeyPatch, support: list[float], fitted: list[str]) -> None:
    sized = tuple(guessed(str(k), value, "any") for k, value in enumerate(support))
    monkeypatch.setattr(search, "BesideWeight", lambda *of: None)
    monkeypatch.setattr(search, "ordinary", lambda plain: None)
    monkeypatch.setattr(search, "_support_near_none", lambda plain, weights, guess: guess.score)
    noise = SimpleNamespace(active=(False,) * 6, weights=lambda *of: None)
    plain: Any = SimpleNamespace(at_map=SimpleNamespace(noise=noise, row_weight=None), beside=None)
    assert [guess.mistake.key for guess in search._hopeful(plain, sized)] == fitted


@pytest.mark.parametrize(("first", "second", "again"), [
    ([0.9, -0.9], None, False), ([2.5, -0.5], [0.3, 0.1], True), ([0.2, -1.1], [-0.1, 0.0], True)])
def test_a_large_size_is_fitted_again_from_the_mended_rows(
        monkeypatch: pytest.MonkeyPatch, first: list[float], second: list[float] | None, again: bool) -> None:
    """One beyond its scale of 1. Its prior is about none all the same: a normal one of 5, of which the second fit has counted
    what is left alone."""
    calls: list[tuple[Any, list[float]]] = []
    fits = iter([first, second])

    def fit(data: Any, terms: Any, near: Any) -> Any:
        calls.append((data, terms[0].tolist()))
        found = next(fits)
        assert found is not None
        values = np.concatenate([np.full(6, 99.0), found])
        return SimpleNamespace(map=values, likeliest=values + 0.01, prior=SimpleNamespace(term_std=np.full(2, 5.0)), data=data)

    class Start(np.ndarray[Any, Any]):
        scale = np.ones(2)

    size = SimpleNamespace(
        term=lambda joint, start: np.array(start).view(Start),
        mistake=lambda data, joint, values, std: SimpleNamespace(mended=lambda data: ("mended", values.tolist())))
    monkeypatch.setattr(search, "posterior", fit)
    monkeypatch.setattr(search, "log_evidence", lambda model: 40.0)
    monkeypatch.setattr(search, "left_out", lambda model, of: of)
    monkeypatch.setattr(search, "poses", lambda rows: "poses of the table")
    plain: Any = SimpleNamespace(data=SimpleNamespace(rows=None))
    guess = replace(guessed("size", 0.0, size), log_prior=-3.0, joint=2, start=np.array([0.4, 0.4]))
    found = search._with_size(plain, guess)
    assert calls == [(plain.data, [0.4, 0.4]), (("mended", first), [0.0, 0.0])][: 1 + again]
    moved, off = (np.array(first), np.array(second)) if again else (np.zeros(2), np.array(first))
    counted = -0.5 * np.sum((off / 5) ** 2)
    assert found.log_posterior - 40.0 + counted == pytest.approx(-3.0 - 0.5 * np.sum(((moved + off) / 5) ** 2))
    assert found.found is not None
    assert found.found.values == pytest.approx(moved + off + 0.01)
    assert (found.found.joint, found.rows, found.left) == (2, None, "poses of the table")


class Long:
    """So many rows of one visit."""

    def __init__(self, visit: NDArray[np.intp]) -> None:
        self.visit = visit

    def __len__(self) -> int:
        return len(self.visit)

    def select(self, kept: NDArray[np.bool_]) -> Long:
        return Long(self.visit[kept])


@pytest.mark.parametrize(("rows", "looked_at"), [(1500, 1500), (1501, 751)])
def test_mistakes_are_looked_for_in_fifteen_hundred_rows(data: LoadTest, rows: int, looked_at: int) -> None:
    """Of more in every second."""
    table: Any = Long(np.zeros(rows, dtype=np.intp))
    assert len(search._thinned(data.with_rows(table)).rows) == looked_at


@pytest.mark.parametrize(("loose", "machined", "off"), [
    ((), False, np.sqrt((4 + 9 + 1) / 5)), ((1,), False, np.sqrt((4 + 1) / 4)), ((0, 1, 2), False, np.sqrt((4 + 9 + 1) / 5)),
    ((), True, 1.0)])
def test_rows_are_as_far_off_as_their_noise_allows_but_where_a_cause_may_rest_anywhere(
        monkeypatch: pytest.MonkeyPatch, loose: tuple[int, ...], machined: bool, off: float) -> None:
    """RMS over what was read, each in its own noise; where every row may rest anywhere all of them count, and of a machined
    pass nobody knows what a reading at rest allows."""
    allowed = np.array([[1.0, 2.0, 1.0], [3.0, 1.0, 1.0], [1.0, 1.0, 5.0]])
    residual = np.array([[2.0, 0.0, np.nan], [9.0, np.nan, np.nan], [np.nan, 1.0, 0.0]])
    asked: list[Any] = []

    def residual_std(*of: Any) -> Array:
        asked.append(of)
        return allowed

    monkeypatch.setattr(misfit, "residual_std", residual_std)
    terms = [SimpleNamespace(joint=k, effect=SimpleNamespace(loose=lambda state, joint, values: np.arange(3) == joint))
             for k in loose]
    rows = SimpleNamespace(machined_pass=np.array(["", "A" if machined else "", ""]))
    fitted: Any = SimpleNamespace(
        data=SimpleNamespace(rows=rows), components="sizes", compliance="springs",
        at_map=SimpleNamespace(noise=SimpleNamespace(further="more")), terms=terms,
        term_values=[np.zeros(1)] * len(terms), load_state=None, residual=residual)
    assert misfit.far_off(fitted) == pytest.approx(off)
    assert asked == ([] if machined else [(fitted.data, "sizes", "springs", "more")])
