"""Cutting stiffness: its posterior from pairs of passes that were drawn here, and its prior against an independent cutter."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest
from scipy import stats

from compensator.correction.correct import Corrected
from compensator.correction.cutting_prior import (
    MATERIALS,
    WIDTH,
    depths,
    of_force,
    of_material,
    of_slot,
    of_slot_depth,
    slot_depths,
)
from compensator.correction.cutting_stiffness import ZERO, CuttingStiffness, PassPair, of_either_sign, posterior
from compensator.correction.known_slot import through_zero
from compensator.correction.logged_pass import known_before, of_passes
from compensator.correction.settings import CorrectionSettings, Estimate
from compensator.correction.slot_cut import in_full_slot
from compstiff.cli.options import ScaledEstimate
from identification.common.autocorrelation import autocorrelation_time
from identification.model.cell_file import CuttingFile
from tests.support import long
from tests.virtual_cell.endmill import EndMill

WIDE = Estimate(40e3, 60e3)


def drawn(rng: np.random.Generator, stiffness: float, spread: float = 0.0, *, targets: int = 400, noise: float = 0.6,
          memory: float = 0.0, zero: float = 1.0, stated: float = 1.0, turning: bool = True) -> PassPair:
    """A pair of passes round a square pocket, or along one wall at one depth: stiffness [N/m] at 20 places spread [N/m] apart,
    sensor zeros that moved, noise with that correlation of neighbours, of which the standard errors state so large a share."""
    angle = np.floor(np.linspace(0, 4 if turning else 0.999, targets, endpoint=False)) * np.pi / 2
    n = np.column_stack([np.cos(angle), np.sin(angle), np.full(targets, -0.1)])
    n /= np.linalg.norm(n, axis=1)[:, None]
    depth = 80e-6 * (1 + 0.3 * turning * np.sin(np.linspace(0, 9, targets)))
    place = np.repeat(stiffness + spread * rng.standard_normal(20), -(-targets // 20))[:targets]
    scatter = rng.standard_normal(targets)
    for i in range(1, targets):
        scatter[i] = memory * scatter[i - 1] + np.sqrt(1 - memory**2) * scatter[i]
    change = place * depth + n @ (zero * rng.standard_normal(3)) + noise * scatter
    return PassPair(depth, change, n, np.full(targets, stated * noise), np.ones(targets), np.zeros(targets))


# Long: one of the others has all of theirs at once.
@pytest.mark.parametrize("case", [
    long({}), long({"memory": 0.7}), long({"stated": 0.4}), long({"spread": 12e3}),
    {"spread": 12e3, "memory": 0.6, "stated": 0.5}, {"zero": 2.0}])
def test_its_standard_error_is_honest(case: dict[str, float]) -> None:
    """Whatever scatters - noise with a memory, standard errors that are too small, places that differ, zeros that moved - the
    mean over places lies within 1 and 2 standard errors as often as a normal's, and a place that was not milled within std."""
    rng = np.random.default_rng(7)
    missed, elsewhere, relative = [], [], []
    for _ in range(250):
        found = posterior(WIDE, [drawn(rng, 25e3, **case)])
        missed.append((found.value - 25e3) / found.mean_std)
        elsewhere.append((found.value - 25e3 - case.get("spread", 0.0) * rng.standard_normal()) / found.std)
        relative.append(found.std / 25e3)
    for off in (np.abs(missed), np.abs(elsewhere)):
        assert np.mean(off < 1) > 0.58
        assert np.mean(off < 2) > 0.91
    # The sensor's zeros are taken to move by 2 N, more than they mostly do here.
    assert np.mean(np.abs(missed) < 1) < 0.93
    # It is no blank cheque either.
    assert np.median(relative) < 0.18 + 1.5 * (case.get("spread", 0.0) / 25e3) + 0.2 * (case.get("zero", 1.0) > 1)


def test_scatter_beyond_the_standard_errors_is_not_taken_for_places_that_differ() -> None:
    """Ten times more noise than is stated, at one stiffness: it is followed all the same."""
    rng = np.random.default_rng(9)
    found = [posterior(WIDE, [drawn(rng, 25e3, noise=2.0, stated=0.1)]) for _ in range(20)]
    assert np.median([one.spread for one in found]) < 5e3
    assert np.median([one.followed for one in found])


def test_more_pairs_tell_more() -> None:
    rng = np.random.default_rng(3)
    pairs = [drawn(rng, 25e3, noise=2.0) for _ in range(6)]
    errors = [posterior(WIDE, pairs[:count]).mean_std for count in (1, 3, 6)]
    assert errors[0] > 1.2 * errors[1] > 1.4 * errors[2]
    assert posterior(WIDE, pairs).pairs == 6


def test_a_pair_that_tells_nothing_leaves_the_prior() -> None:
    rng = np.random.default_rng(4)
    pair = drawn(rng, 25e3, noise=1e4)
    found = posterior(Estimate(50e3, 10e3), [pair])
    assert found.value == pytest.approx(50e3, rel=0.02)
    assert found.mean_std == pytest.approx(10e3, rel=0.02)


def test_zeros_that_moved_are_told_from_the_cut_only_where_the_path_turns() -> None:
    """Along one straight wall a zero that moved by a newton looks like stiffness, and the error says so."""
    rng = np.random.default_rng(5)
    turning, straight = (posterior(WIDE, [drawn(rng, 25e3, noise=0.2, turning=turns)]) for turns in (True, False))
    assert straight.mean_std > 2 * turning.mean_std
    assert straight.mean_std > 5e3


def test_places_that_differ_are_no_one_stiffness() -> None:
    """Half of them a slot: it is not followed, although the mean is known well."""
    rng = np.random.default_rng(6)
    found = posterior(WIDE, [drawn(rng, 15e3, 15e3)])
    assert found.spread > 9e3
    assert not found.followed
    assert found.size > 15e3


def test_a_force_that_falls_with_the_depth_shows() -> None:
    rng = np.random.default_rng(8)
    pair = drawn(rng, -25e3)
    signed = of_either_sign(Estimate(0.0, 60e3), [pair])
    assert signed.value < -3 * signed.std
    assert posterior(WIDE, [pair]).value > 0


def test_what_is_followed() -> None:
    assert CuttingStiffness(25e3, 10e3, "stated").followed
    assert not CuttingStiffness(25e3, 15e3, "stated").followed
    assert CuttingStiffness(25e3, 0.0, "stated").words() == "25 N/mm, taken as exact"


# Linear-edge coefficients [N/mm^2, N/mm] of other materials than the virtual cell's own, from the usual tables of milling
# mechanics, rounded: a carbon steel and Ti6Al4V (Altintas, Manufacturing Automation, ch. 2).
CUTTERS = {
    "aluminium": EndMill(),
    "steel": EndMill(shear_n_mm2=(1800.0, 700.0, 300.0), edge_n_mm=(25.0, 40.0, 2.0)),
    "titanium": EndMill(shear_n_mm2=(1700.0, 600.0, 300.0), edge_n_mm=(24.0, 43.0, 3.0)),
}


@pytest.mark.parametrize("material", CUTTERS)
def test_the_prior_of_a_material_holds_its_cutter(material: str) -> None:
    """How the force across the feed of an independent end mill grows in climb milling, over depths and feeds: within two widths
    of the prior, and within one in most cases."""
    off = []
    for feed in (18.0, 36.0, 72.0):
        cutter = EndMill(feed_mm_s=feed, shear_n_mm2=CUTTERS[material].shear_n_mm2, edge_n_mm=CUTTERS[material].edge_n_mm)
        prior = of_material(CuttingFile(material=material, tool_diameter_mm=16, contact_mm=4), 1e-3 * feed,
                            1 / cutter.turns_per_s)
        assert prior is not None
        for depth in (0.3, 0.6, 1.2, 2.5, 5.0):
            left = [float(cutter.mean_force(cutter.coverage(-cutter.rim_mm[:, 1] - 8 + depth + step), 4.0)[1])
                    for step in (-0.05, 0.05)]
            off.append(np.log((left[1] - left[0]) / 0.1 / (1e-3 * prior.value)) / WIDTH)
    assert np.abs(off).max() < 2.5
    assert np.mean(np.abs(off) < 1) > 0.5


def test_what_a_prior_needs() -> None:
    cut = {"material": "steel", "tool_diameter_mm": 16.0, "contact_mm": 4.0}
    full = of_material(CuttingFile(**cut), 0.02, 0.01)
    assert full is not None
    assert of_material(CuttingFile(**cut | {"contact_mm": 8.0}), 0.02, 0.01).value == pytest.approx(2 * full.value)
    for missing in cut:
        assert of_material(CuttingFile(**{key: value for key, value in cut.items() if key != missing}), 0.02, 0.01) is None
    assert of_material(CuttingFile(**cut), None, 0.01) is None
    assert of_material(CuttingFile(**cut), 0.02, None) is None
    # By the source's table hard materials are stiffer to cut; the log-normal's mean is above its median.
    order = [of_material(CuttingFile(**cut | {"material": name}), 0.02, 0.01).value for name in (
        "aluminium", "cast_iron", "steel", "superalloy", "hardened_steel")]
    assert order == sorted(order)
    assert all(600 < material.specific < 5000 and 0.19 < material.exponent < 0.31 for material in MATERIALS.values())
    assert of_force(100.0, 1e-3).value == pytest.approx(75e3 * np.exp(0.32))


def test_a_stiffness_in_another_unit_is_told(sample: Corrected) -> None:
    """The ball of the sample is pushed across by some 200 N: any stiffness from 2 N/mm on is a cut, 0.009 N/mm is none."""
    def said(n_per_mm: float) -> list[str]:
        planned = sample.planned
        correction = replace(planned.settings.correction, cutting_stiffness=Estimate(1e3 * n_per_mm, 0.0))
        _, findings = known_before(replace(planned, settings=replace(planned.settings, correction=correction)))
        return [finding.code for finding in findings]

    for value in np.random.default_rng(4126).uniform(2, 500, 30):
        assert said(float(value)) == []
    assert said(0.009) == ["CS4126"]
    # As benchmarks/end_to_end.py states it: the force follows no cut.
    assert said(0.0) == []


@pytest.mark.parametrize(("value", "word"), [("115", "is over 10"), ("0.1", "is under 0.2"), ("0.9", ""), ("1.6:0.1", "")])
def test_a_scale_in_per_cent_is_refused(value: str, word: str) -> None:
    kind = ScaledEstimate(1.0, 0.2, 10.0)
    if not word:
        assert kind.convert(value, None, None).value == float(value.partition(":")[0])
        return
    with pytest.raises(click.UsageError, match=word):
        kind.convert(value, None, None)


def test_the_stiffness_of_a_slot_is_in_proportion() -> None:
    """Two passes in full slots: the slope through zero, and of its error the sensor's zero and the scatter about the slope;
    drawn anew 400 times, each with a zero of its own."""
    rng = np.random.default_rng(16)
    deeper, truth, noise = rng.uniform(40e-6, 90e-6, 60), 4e5, 6.0
    prior = Estimate(1e5, 1e12)
    values, widths = [], []
    for _ in range(400):
        zero = rng.normal(0, ZERO)
        found = through_zero(prior, deeper, truth * deeper + zero + rng.normal(0, noise, 60))
        values.append(found.value)
        widths.append(found.std)
    assert np.mean(values) == pytest.approx(truth, abs=4 * np.std(values) / 20)
    size = deeper @ deeper
    wanted = np.hypot(ZERO * deeper.sum() / size, noise / np.sqrt(size))
    assert np.std(values) == pytest.approx(wanted, rel=0.12)
    assert np.median(widths) == pytest.approx(wanted, rel=0.15)
    assert through_zero(prior, np.zeros(3), np.ones(3)) == prior


@pytest.mark.parametrize(("targets", "slots", "taken"), [(40, 0, True), (39, 0, False), (50, 10, True), (50, 11, False)])
def test_forty_targets_beside_slots_tell_how_stiff_a_cut_is(targets: int, slots: int, taken: bool) -> None:
    """Of fewer nothing is taken from the passes: what was known before stays."""
    pair = drawn(np.random.default_rng(14), 25e3, targets=targets)
    pair = replace(pair, slot=(np.arange(targets) < slots).astype(float))
    prior = CuttingStiffness(40e3, 60e3, "material", mean_std=60e3)
    forces = SimpleNamespace(log=SimpleNamespace(source="log.csv"), wrench=np.full((targets, 6), 100.0))
    predicted: Any = SimpleNamespace(forces=forces, targets=np.arange(targets))
    found, said = of_passes(prior, [pair], predicted)
    assert found is not None
    assert (found is prior) != taken
    assert bool(said) == taken
    if taken:
        assert abs(found.value - 25e3) < 3 * found.mean_std < 15e3
        assert said[0].code == "CS4124"


def by_definition(prior: Estimate, pairs: list[PassPair]) -> tuple[float, float, float]:
    """Mean of K, its standard error and the spread's root mean square: by the covariance of all changes, with what a stretch
    scatters more than is stated, the spread flat on a grid up to twice the stretches' own scatter."""
    grown, starts, slopes, weights = [], [], [], []
    for pair in pairs:
        parts = np.array_split(np.arange(len(pair.depth)), max(min(20, len(pair.depth) // 8), 1))
        starts.append(parts)
        error = np.maximum(pair.error, 0.05)
        for rows in parts:
            line = np.polyfit(pair.depth[rows], pair.change[rows], 1, w=1 / error[rows])
            left = (pair.change[rows] - np.polyval(line, pair.depth[rows])) / error[rows]
            error[rows] *= np.sqrt(max(left @ left / (len(rows) - 2) * autocorrelation_time(left).values, 1.0))
            weights.append(np.sum((pair.depth[rows] / error[rows]) ** 2))
            slopes.append(np.sum(pair.depth[rows] * pair.change[rows] / error[rows] ** 2) / weights[-1])
        grown.append(error)
    middle = np.average(slopes, weights=weights)
    widest = 2 * np.sqrt(np.average((slopes - middle) ** 2, weights=weights)) + 1e-6 * abs(middle)
    spreads, found = np.linspace(0, widest, 41), []
    for spread in spreads:
        information, right, likely = prior.std**-2, prior.value / prior.std**2, 0.0
        for pair, parts, error in zip(pairs, starts, grown, strict=True):
            covariance = np.diag(error**2) + 4.0 * pair.direction @ pair.direction.T
            for rows in parts:
                covariance[np.ix_(rows, rows)] += spread**2 * np.outer(pair.depth[rows], pair.depth[rows])
            inverse = np.linalg.inv(covariance)
            information += pair.depth @ inverse @ pair.depth
            right += pair.depth @ inverse @ pair.change
            likely -= 0.5 * (pair.change @ inverse @ pair.change + np.linalg.slogdet(covariance)[1])
        found.append((right / information, 1 / information, likely + 0.5 * right**2 / information - 0.5 * np.log(information)))
    values, variances, likely = np.array(found).T
    share = np.exp(likely - likely.max()) / np.exp(likely - likely.max()).sum()
    mean = share @ values
    return mean, np.sqrt(share @ (variances + (values - mean) ** 2)), np.sqrt(share @ spreads**2)


@pytest.mark.parametrize("case", [
    {"targets": 165, "stated": 3.0}, {"targets": 170, "spread": 9e3, "memory": 0.5, "stated": 0.4},
    {"targets": 30, "spread": 9e3},
    {"targets": 75, "noise": 0.02, "spread": 9e3}])
def test_the_posterior_is_that_of_its_definition(case: dict[str, Any]) -> None:
    rng = np.random.default_rng(17)
    pairs = [replace(pair, error=pair.error * rng.uniform(0.5, 1.5, len(pair.error))) for pair in (
        drawn(rng, 25e3, **case), drawn(rng, 25e3, **case))]
    prior = Estimate(30e3, 20e3)
    for some in (pairs[:1], pairs):
        mean, error, spread = by_definition(prior, some)
        signed = of_either_sign(prior, some)
        assert (signed.value, signed.std) == pytest.approx((mean, error), rel=1e-6)
        low = stats.truncnorm(-mean / error, np.inf, mean, error)
        found = posterior(prior, some)
        assert (found.value, found.mean_std, found.spread) == pytest.approx((low.mean(), low.std(), spread), rel=1e-6)
        assert found.std == pytest.approx(np.hypot(low.std(), spread), rel=1e-6)
        assert (found.origin, found.pairs) == ("passes", len(some))


@pytest.mark.parametrize("prior", [Estimate(-5e3, 3e3), Estimate(0.0, 3e3), Estimate(-3e4, 1e3)])
def test_a_stiffness_is_not_negative(prior: Estimate) -> None:
    """A pair that tells nothing leaves a normal prior cut off at zero."""
    found = posterior(prior, [drawn(np.random.default_rng(4), 25e3, noise=1e7)])
    low = stats.truncnorm(-prior.value / prior.std, np.inf, prior.value, prior.std)
    assert (found.value, found.mean_std) == pytest.approx((low.mean(), low.std()), rel=1e-2)


@pytest.mark.parametrize(("std", "followed"), [(12.4e3, True), (12.6e3, False)])
def test_a_stiffness_two_standard_errors_from_zero_is_followed(std: float, followed: bool) -> None:
    known = CuttingStiffness(25e3, std, "passes", 5e3, 11e3, 2, climb_only=True)
    assert known.followed == followed
    assert known.size == pytest.approx(np.sqrt(25e3**2 + std**2))
    assert known.as_dict() == {"n_per_mm": 25.0, "std_n_per_mm": pytest.approx(1e-3 * std), "spread_n_per_mm": 5.0,
                               "origin": "passes", "climb_only": True, "pairs": 2, "followed": followed}


@pytest.mark.parametrize(("spread", "words"), [
    (1.19e3, "25 +- 24 N/mm (2 sigma)"), (1.21e3, "25 +- 24 N/mm (2 sigma, of which 2.4 from place to place)")])
def test_how_much_places_differ_is_said_from_a_tenth_of_the_error_on(spread: float, words: str) -> None:
    assert CuttingStiffness(25e3, 12e3, "passes", spread).words() == words


def test_what_is_known_before_is_by_its_formulas() -> None:
    """docs/formats.md: K = 0.8 k_c b v_f / v_c with chips of three teeth, sqrt(0.1) of the feed a tooth; of a slot a quarter of
    k_c f at chips of 2 f_z / pi; by the force 0.75 of the push by its depth. Means and widths of log-normal numbers."""
    cut = CuttingFile(material="titanium", tool_diameter_mm=12.0, contact_mm=5.0)
    turn = 1e3 * 0.03 * 0.01
    wall = 0.8 * 1560 * (turn / 3 * np.sqrt(0.1)) ** -0.23 * 5 * turn / (np.pi * 12)
    slot = 0.25 * 1560 * (2 * turn / (3 * np.pi)) ** -0.23 * turn
    for found, median, width in (
            (of_material(cut, 0.03, 0.01), wall, 0.4), (of_slot(cut, 0.03, 0.01), slot, 0.4), (of_slot_depth(7e4), 70.0, 0.15),
            (of_slot_depth(7e4, 0.8), 70.0, 0.8), (of_force(200.0, 3e-3), 50.0, 0.8), (of_force(200.0, 3e-3, 0.3), 50.0, 0.3)):
        law = stats.lognorm(width, scale=1e3 * median)
        assert found is not None
        assert (found.value, found.std) == pytest.approx((law.mean(), law.std()), rel=1e-9)
    for of in (cut.model_copy(update={"material": None}), cut):
        assert of_slot(of, None, 0.01) is None
        assert of_slot(of, 0.03, None) is None
    assert of_slot(cut.model_copy(update={"material": None}), 0.03, 0.01) is None


@pytest.mark.parametrize(("settings", "middle", "width"), [
    (CorrectionSettings(), 0.75e-3, 0.8), (CorrectionSettings(depth_of_cut=2e-3), 2e-3, 0.3), (None, 2e-3, 0.8)])
def test_depths_are_drawn_log_normally(settings: CorrectionSettings | None, middle: float, width: float) -> None:
    """Stated or not, and of slots: means of powers of the depth."""
    depth, weight = slot_depths() if settings is None else depths(settings)
    assert weight.sum() == pytest.approx(1)
    for power in (-2, -1, 1, 2):
        assert weight @ depth**power == pytest.approx(middle**power * np.exp((power * width) ** 2 / 2), rel=1e-3)


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_two_passes_in_a_slot_weigh_against_what_was_known(memory: float) -> None:
    """By precisions: of the slope through zero by a zero of 2 N, which all targets share, and by the scatter about the slope,
    whose neighbours remember each other; of which at most all targets count as one. Never negative."""
    rng = np.random.default_rng(23)
    deeper, noise = rng.uniform(-20e-6, 90e-6, 50), rng.normal(0, 5, 50)
    for i in range(1, 50):
        noise[i] = memory * noise[i - 1] + np.sqrt(1 - memory**2) * noise[i]
    prior = Estimate(2e5, 1e5)
    for truth in (3e5, -9e5):
        change = truth * deeper + noise
        slope = np.linalg.lstsq(deeper[:, None], change, rcond=None)[0][0]
        rest = change - slope * deeper
        by_zero = 2 * np.abs(deeper).sum() / (deeper**2).sum()
        tau = min(autocorrelation_time(rest).values, 50)
        by_scatter = np.sqrt(np.mean(rest**2) * tau / (deeper**2).sum())
        weights = np.array([1 / (by_zero**2 + by_scatter**2), 1e-10])
        found = through_zero(prior, deeper, change)
        assert found.value == pytest.approx(max(weights @ [slope, 2e5], 0.0) / weights.sum(), rel=1e-9)
        assert found.std == pytest.approx(weights.sum() ** -0.5, rel=1e-9)
        assert (found.value == 0) == (truth < 0)


@pytest.mark.parametrize("count", [7, 8])
def test_the_push_of_a_full_slot_is_the_middle_of_its_stretch_or_what_is_there(count: int) -> None:
    """Stretches of their own, each with its own middle; beside a slot the push itself."""
    rng = np.random.default_rng(4)
    across = rng.uniform(50, 200, 40)
    share = np.zeros(40)
    share[3:3 + count], share[20:25], share[30:31] = 0.9, 0.51, 1.0
    share[15] = 0.49
    expected = across.copy()
    for part in (slice(3, 3 + count), slice(20, 25), slice(30, 31)):
        expected[part] = np.maximum(across[part], np.median(across[part]))
    np.testing.assert_allclose(in_full_slot(share, across), expected)
    np.testing.assert_array_equal(in_full_slot(0 * share, across), across)
