"""The arithmetic of learning against formulas written here: the remainder's process, its orthogonality, posterior, evidence,
chance. No robot: rows with made-up slopes."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import sparse, special, stats
from scipy.spatial.transform import Rotation

from compensator.correction.settings import Estimate
from compensator.learned.learned import CHUNK, DRIFT, NO_REMAINDER, SETUP, JobFrame, Learned, Rest
from compensator.learned.remainder import POSTURE, Remainder, spread_out
from compensator.learning import fitted_part
from compensator.learning import sizes as of_sizes
from compensator.learning.causes import Asked, said_of_causes
from compensator.learning.chance import FALSE_RATE, _ratio, chance_of_remainder
from compensator.learning.fitted_part import _seen_of_the_job
from compensator.learning.held_out import HeldOut, held_out
from compensator.learning.learn import _before, _motion, _parts
from compensator.learning.other_pass import refuse_other_pass
from compensator.learning.pages import _along, _verdict
from compensator.learning.path_places import _nearest
from compensator.learning.posterior import Posterior, posterior
from compensator.learning.refusals import _missing
from compensator.learning.rows import Rows, slope_along, steep_at
from compensator.learning.shifted import said_of_shift
from compensator.learning.sizes import (
    SHARED_LENGTH,
    Sizes,
    log_evidence,
    noise_covariance,
    of_neighbours,
    with_remainder,
    without_remainder,
)
from compensator.learning.terms import DRIFT_STD, SHIFT_STD, TURN_STD, Terms
from compensator.learning.unshown import unshown
from compensator.learning.wrong_factor import refuse_wrong_factor
from identification.common.arrays import rms
from identification.common.findings import Refused
from identification.model.rotations import Frame

SIGMA = 4e-6
NOISE = Sizes(1.0, 2e-6, 0.0)


def matern(first: np.ndarray, second: np.ndarray, nu: float = 2.5) -> np.ndarray:
    """The Matern kernel by its Bessel function, at distances of places (n, d) and (m, d)."""
    distance = np.sqrt(2 * nu) * np.linalg.norm(first[:, None] - second[None], axis=2)
    safe = np.maximum(distance, 1e-12)
    return np.where(distance < 1e-9, 1.0, 2 ** (1 - nu) / special.gamma(nu) * safe**nu * special.kv(nu, safe))


def stretched(position: np.ndarray, theta: np.ndarray, length: float) -> np.ndarray:
    return np.hstack([position / length, np.cos(theta) / POSTURE, np.sin(theta) / POSTURE])


def path(places: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions round a pocket, joint angles that go with them, and path lengths."""
    angle = np.linspace(0, 1.9 * np.pi, places)
    position = np.column_stack([1.3 + 0.05 * np.cos(angle), 0.04 * np.sin(angle), np.full(places, 0.7)])
    theta = 0.3 * np.column_stack([position[:, 0], position[:, 1], position[:, 0] * position[:, 1], *(0 * angle,) * 3])
    return position, theta, 0.045 * angle


def terms(rng: np.random.Generator, residual: np.ndarray | None = None, places: int = 40, springs: int = 6) -> Terms:
    """Rows at these places along three axes, with slopes that go with the place as a force does."""
    position, theta, length = path(places)
    number = 3 * places
    place, axis = np.arange(number) // 3, np.arange(number) % 3
    along = length[place] / length[-1]
    by_x = 60e-6 * np.column_stack([np.sin(2 * np.pi * (k + 1) * along + k + axis) for k in range(springs)])
    rows = Rows(np.zeros(number), np.full(number, SIGMA), np.eye(3)[axis], place, position, theta, length, length / 0.03,
                np.zeros(number), sparse.csr_array((number, 3)))
    frame = JobFrame(Frame.identity(), position.mean(axis=0), 0.05, float(length[-1] / 0.03))
    values = rng.standard_normal(number) * SIGMA if residual is None else residual
    of_job = rows.along(frame.columns(position, rows.time))
    return Terms(rows, frame, values, by_x, of_job, 0.02**2 * np.eye(springs), np.eye(9))


def drawn(given: Terms, sizes: Sizes, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n, count) of the model with these sizes, and the physical parameters behind them."""
    root = np.linalg.cholesky(given.physical_prior)
    z = root @ rng.standard_normal((len(root), count))
    noise = np.linalg.cholesky(noise_covariance(given, sizes)) @ rng.standard_normal((len(given.rows), count))
    return given.physical @ z + noise, z


def test_the_carried_process_is_the_process_where_it_is_carried() -> None:
    """Its covariance between new places is what the places carry of the process; with what is unseen it is the prior's own."""
    position, theta, _ = path(30)
    chosen = spread_out(position, theta, 0.1, 12)
    remainder = Remainder(position[chosen], theta[chosen], 0.1, 20e-6)
    new = position[:-1] + 0.4 * np.diff(position, axis=0)
    new_theta = theta[:-1] + 0.4 * np.diff(theta, axis=0)
    known, fresh = (stretched(p, q, 0.1) for p, q in ((position[chosen], theta[chosen]), (new, new_theta)))
    k, across = matern(known, known) + 1e-6 * np.eye(12), matern(fresh, known)
    carried = across @ np.linalg.solve(k, across.T)
    basis = remainder.basis(new, new_theta)
    assert np.allclose(basis @ basis.T, carried, atol=1e-7)
    assert np.allclose(remainder.unseen(basis) / 20e-6**2, 1 - np.diag(carried), atol=1e-7)
    assert 1e-4 < np.max(1 - np.diag(carried)) < 0.5


def test_it_ends_where_nothing_was_measured() -> None:
    position, theta, _ = path(20)
    remainder = Remainder(position, theta, 0.1, 20e-6)
    for far, posture in ((position + np.array([1.5, 0.0, 0.0]), theta), (position, theta + 1.5)):
        basis = remainder.basis(far, posture)
        assert np.abs(basis).max() < 1e-2
        assert np.allclose(remainder.unseen(basis), 20e-6**2, rtol=1e-2)
    assert remainder.unseen(remainder.basis(position, theta)).max() < 1e-4 * 20e-6**2
    assert not remainder.basis(np.full((1, 3), np.nan), theta[:1]).any()


def test_the_set_up_sees_nothing_of_the_remainder() -> None:
    given = terms(np.random.default_rng(2))
    _, slopes = given.remainder(0.1)
    free = given.free(slopes)
    setup = given.of_job[:, :6]
    seen = setup.T @ (slopes @ free) / SIGMA**2
    assert free.shape[1] == slopes.shape[1] - 6
    assert np.abs(seen).max() < 1e-9 * np.abs(setup.T @ slopes / SIGMA**2).max()


def smooth_errors(given: Terms, rng: np.random.Generator, count: int) -> np.ndarray:
    """What the rows (n, count) see of errors that are as smooth as robots' are: sums of plane waves of 0.3 to 1.5 m, some 50 um
    over the path. Not the remainder's own process."""
    position = given.rows.position[given.rows.place] - given.frame.centre
    axis = np.argmax(given.rows.direction, axis=1)
    errors = np.zeros((len(axis), count))
    for column in errors.T:
        direction = rng.standard_normal((12, 3))
        number = 2 * np.pi / np.exp(rng.uniform(np.log(0.3), np.log(1.5), 12))
        waves = direction / np.linalg.norm(direction, axis=1)[:, None] * number[:, None]
        sizes = 50e-6 * rng.standard_normal((12, 3))
        column += np.einsum("nw,wn->n", np.sin(position @ waves.T + rng.uniform(0, 2 * np.pi, 12)), sizes[:, axis])
    return errors


def test_set_up_and_remainder_together_are_every_smooth_error() -> None:
    """Also one that goes with the time, as every error does along a path that goes somewhere: what the remainder may not be
    is taken for what acts with the force."""
    rng = np.random.default_rng(12)
    given = terms(rng)
    _, slopes = given.remainder(0.2)
    together = np.hstack([given.of_job[:, :6], slopes @ given.free(slopes)])
    errors = smooth_errors(given, rng, 20)
    left = errors - together @ np.linalg.lstsq(together, errors, rcond=1e-12)[0]
    assert np.sqrt(np.mean(left**2)) < 1e-3 * np.sqrt(np.mean(errors**2))


def test_along_upright_walls_the_remainder_may_differ_between_two_heights() -> None:
    """Points along level normals, half of the path 2.5 mm lower: the set-up's turn about a level axis moves the lower half
    against the upper one by 5 um, an error of the kinematics by as much as anywhere; together they are as wide as the error's
    own process is, rigid displacements aside."""
    whole = terms(np.random.default_rng(3), places=40)
    position = whole.rows.position - [0, 0, 2.5e-3] * (np.arange(40) >= 20)[:, None]
    level = replace(whole.rows, position=position).select(whole.rows.direction[:, 2] == 0)
    frame = replace(whole.frame, centre=position.mean(axis=0))
    given = replace(whole.select(whole.rows.direction[:, 2] == 0), rows=level, frame=frame,
                    of_job=level.along(frame.columns(position, level.time)))
    lower, along_y = np.where(level.place >= 20, 1.0, -1.0), level.direction[:, 1] > 0
    contrast = lower * along_y
    rigid = np.hstack([level.along(frame.columns(position, level.time))[:, [0, 1, 5]]])
    contrast = contrast - rigid @ np.linalg.lstsq(rigid, contrast, rcond=None)[0]
    _, slopes = given.remainder(0.1, 1.0)
    setup = given.of_job[:, :6] * given.of_job_std[:6]
    own = 40e-6 * slopes @ given.free(slopes)
    found = np.sqrt(np.sum((contrast @ own) ** 2) + np.sum((contrast @ setup) ** 2))
    assert found > 0.95 * 40e-6 * np.linalg.norm(contrast @ slopes)


def test_warming_is_not_told_more_surely_than_a_smooth_error_lets_it() -> None:
    """Truth: a smooth error of plane waves and a drift, the sizes found from each part: the drift's error in the metric of its
    own covariance. Of 24 parts 24 * 3 degrees of freedom are expected; noise alone stays under 110 in 99.7 % of such sets."""
    rng = np.random.default_rng(13)
    given = terms(rng)
    drift = 20e-6 * rng.standard_normal((3, 24))
    residuals = (smooth_errors(given, rng, 24) + given.of_job[:, 6:] @ drift
                 + SIGMA * rng.standard_normal((len(given.rows), 24)))
    square, size = 0.0, given.by_x.shape[1]
    for residual, truth in zip(residuals.T, drift.T, strict=True):
        one = replace(given, residual=residual)
        sizes = (with_remainder(one, Sizes(1.0, 2e-6, 1e-4), length) for length in (0.1, 0.2, 0.4))
        found = posterior(one, max(sizes, key=lambda tried: tried.evidence))
        where = slice(size + 6, size + 9)
        error = found.mean[where] - truth
        square += float(error @ np.linalg.solve(found.covariance[where, where], error))
    assert square < 110


def by_level_normals(given: Terms) -> Terms:
    """The rows across level walls alone: shifts along x and y and the turn about z are seen."""
    return given.select(given.rows.direction[:, 2] == 0)


@pytest.mark.parametrize("size", [0.05, 0.3])
def test_a_height_that_no_point_shows_is_as_uncertain_as_the_rest_is_off(size: float) -> None:
    """Set-ups drawn at one size in all six ways, in shares of what they are beforehand: the height is within two of the stated
    sigma as a Student t of three degrees of freedom is within twice its own, 96 %."""
    rng = np.random.default_rng(17)
    given = by_level_normals(terms(rng, springs=1))
    height, stated = np.empty((2, 300))
    for number in range(300):
        truth = size * given.of_job_std[:SETUP] * rng.standard_normal(SETUP)
        one = replace(given, residual=given.of_job[:, :SETUP] @ truth + SIGMA * rng.standard_normal(len(given.rows)))
        covariance = unshown(one, NOISE)
        height[number], stated[number] = truth[2], np.sqrt(covariance[2, 2])
        assert np.abs(covariance[[0, 1, 5]]).max() < 1e-18
    assert 0.92 < np.mean(np.abs(height) < 2 * stated) < 0.99
    assert np.median(stated) < 3 * size * SHIFT_STD


def test_of_points_in_space_nothing_is_unshown_and_without_any_all_is() -> None:
    given = terms(np.random.default_rng(19), springs=1)
    assert not unshown(given, NOISE).any()
    blind = replace(given, of_job=0 * given.of_job)
    np.testing.assert_allclose(unshown(blind, NOISE), np.diag(given.of_job_std**2), rtol=1e-6)


def test_a_height_that_no_point_shows_is_stated_and_holds_nothing_back() -> None:
    """It is all of what is added, and all of that nobody measured; it belongs to the set-up, and goes with no other."""
    position, theta, _ = path(5)
    frame = JobFrame(Frame(np.eye(3), np.zeros(3)), position.mean(axis=0), 0.05, 1.0)
    height = np.zeros((SETUP + DRIFT, SETUP + DRIFT))
    height[2, 2] = 80e-6**2
    learned = Learned(np.zeros(6), np.zeros(15), np.zeros((15, 15)), frame, unshown=height)
    rest = replace(resting(learned.remainder.basis(position, theta)), columns=frame.columns(position, np.zeros(5)))
    for repeats, left in (("job", 1.0), ("setup", 1.0), ("nothing", 0.0)):
        for part in learned.carried(repeats).covariance_beside(np.zeros((5, 3, 6)), rest):
            np.testing.assert_allclose(part, np.tile(left * np.diag([0, 0, 80e-6**2]), (5, 1, 1)), atol=1e-18)
    assert not learned.exactly().covariance_beside(np.zeros((5, 3, 6)), rest)[0].any()


def test_another_job_drifts_as_far_as_this_one_did_nobody_knows_when() -> None:
    """Its width is what was found of the drift, by the time of the job; it is in the mean of the same job alone."""
    position, theta, _ = path(3)
    frame, drift = JobFrame(Frame(np.eye(3), np.zeros(3)), position.mean(axis=0), 0.05, 10.0), np.array([6e-6, 0, -17e-6])
    mean, covariance = np.append(np.zeros(12), drift), np.zeros((15, 15))
    covariance[14, 14] = 3e-6**2
    learned = Learned(np.zeros(6), mean, covariance, frame)
    at = frame.columns(position, np.array([0.0, 5.0, 20.0]))
    rest = replace(resting(learned.remainder.basis(position, theta)), columns=at)
    for repeats in ("setup", "nothing"):
        taken = learned.carried(repeats)
        for part in taken.covariance_beside(np.zeros((3, 3, 6)), rest):
            for share, one in zip((0.0, 0.5, 1.0), part, strict=True):
                np.testing.assert_allclose(one, share**2 * (np.outer(drift, drift) + np.diag([0, 0, 3e-6**2])), atol=1e-20)
        assert not taken.mean.any()
    added, unseen = learned.carried("job").covariance_beside(np.zeros((3, 3, 6)), rest)
    assert added[2, 2, 2] == pytest.approx(3e-6**2)
    assert not unseen.any()


def test_a_rigid_displacement_is_set_up() -> None:
    """Columns are those of a small motion: points turned by a real rotation."""
    frame = JobFrame(Frame.identity(), np.array([1.0, 2.0, 3.0]), 0.05, 10.0)
    rng = np.random.default_rng(3)
    position, turn = frame.centre + 0.1 * rng.standard_normal((50, 3)), 1e-6 * rng.standard_normal(3)
    angle = np.linalg.norm(turn)
    axis = np.cross(np.eye(3), turn / angle) * -1
    rotation = np.eye(3) + np.sin(angle) * axis.T + (1 - np.cos(angle)) * axis.T @ axis.T
    moved = (position - frame.centre) @ rotation.T + frame.centre - position
    parameters = np.concatenate([np.zeros(3), 0.05 * turn, np.zeros(3)])
    assert np.allclose(frame.columns(position, np.zeros(50)) @ parameters, moved, atol=1e-12)
    drift = frame.columns(position, np.linspace(0, 20, 50)) @ np.array([0, 0, 0, 0, 0, 0, 0, 0, 1.0])
    assert np.allclose(drift[:, 2], np.minimum(np.linspace(0, 2, 50), 1))


@pytest.mark.parametrize("places", [40, 60])
def test_the_posterior_is_that_of_the_normal_equations(places: int) -> None:
    """Carried by all of 40 places, and by 48 of 60."""
    rng = np.random.default_rng(4)
    given = terms(rng, places=places)
    sizes = Sizes(1.3, 5e-6, 0.0, 15e-6, 0.1)
    given = replace(given, residual=drawn(given, sizes, rng, 1)[0][:, 0])
    found = posterior(given, sizes)
    remainder, slopes = given.remainder(0.1, 15e-6)
    free = given.free(slopes)
    alike = np.exp(-np.abs(given.rows.length[given.rows.place][:, None] - given.rows.length[given.rows.place]) / SHARED_LENGTH)
    same = given.rows.direction @ given.rows.direction.T
    noise = (1.3 * SIGMA) ** 2 * np.eye(len(given.rows)) + 5e-6**2 * alike * same
    columns = np.hstack([given.by_x, given.of_job, slopes @ free])
    prior = np.repeat([0.02**2, SHIFT_STD**2, (0.05 * TURN_STD) ** 2, DRIFT_STD**2, 15e-6**2], [6, 3, 3, 3, free.shape[1]])
    information = columns.T @ np.linalg.solve(noise, columns) + np.diag(1 / prior)
    mean = np.linalg.solve(information, columns.T @ np.linalg.solve(noise, given.residual))
    covariance = np.linalg.inv(information)
    assert np.allclose(found.mean[:15], mean[:15], rtol=1e-5, atol=1e-9)
    assert np.allclose(found.mean[15:], free @ mean[15:], rtol=1e-4, atol=1e-9)
    assert np.allclose(found.covariance[:6, :6], covariance[:6, :6], rtol=1e-4, atol=1e-12)
    assert np.allclose(found.covariance[:6, 15:], covariance[:6, 15:] @ free.T, rtol=1e-3, atol=1e-10)
    assert len(remainder.places) == min(places, 48)


@pytest.mark.parametrize("amplitude", [0.0, 20e-6])
def test_the_evidence_is_the_normal_density_and_its_slope_that_of_it(amplitude: float) -> None:
    """Against SciPy's density, and differences of it by the logarithm of each size."""
    given = terms(np.random.default_rng(5))
    given = replace(given, rows=replace(given.rows, steep=np.linspace(0.0, 8e-3, len(given.rows))))
    known = given.physical @ given.physical_prior @ given.physical.T
    _, slopes = given.remainder(0.1)
    of_remainder = slopes @ slopes.T if amplitude else None
    chosen = np.array([1.2, 2e-6, 0.3e-3, *([amplitude] if amplitude else [])])

    def wanted(values: np.ndarray) -> float:
        sizes = Sizes(*map(float, values[:3]))
        covariance = known + noise_covariance(given, sizes) + (0.0 if of_remainder is None else values[3] ** 2 * of_remainder)
        return float(stats.multivariate_normal(np.zeros(len(given.rows)), covariance).logpdf(given.residual))

    value, slope = log_evidence(given, known, Sizes(*map(float, chosen)), of_neighbours(given), of_remainder)
    assert np.isclose(value, wanted(chosen))
    factors = np.exp(1e-3 * np.eye(len(chosen)))
    differences = [(wanted(chosen * factor) - wanted(chosen / factor)) / 2e-3 for factor in factors]
    assert np.abs(slope).min() > 0.1
    assert slope == pytest.approx(differences, rel=1e-4)


@pytest.mark.parametrize("length", [None, 0.1])
def test_the_likeliest_sizes_are_where_likelihood_and_prior_together_are_largest(length: float | None) -> None:
    """By SciPy's density and log-normal priors about the usual sizes; lengths are compared by its value."""
    rng = np.random.default_rng(15)
    given = terms(rng, places=14)
    given = replace(given, rows=replace(given.rows, steep=np.linspace(0.0, 8e-3, len(given.rows))))
    given = replace(given, residual=drawn(given, Sizes(2.5, 6e-6, 1e-3), rng, 1)[0][:, 0] + 20e-6 * np.sin(
        given.rows.length[given.rows.place] / 0.03))
    known = given.physical @ given.physical_prior @ given.physical.T
    priors = [of_sizes.NOISE, of_sizes.SHARED, of_sizes.SMEAR]
    alone = without_remainder(given)
    found = alone if length is None else with_remainder(given, alone, length)
    at = [found.noise, found.shared, found.smear]
    of_length = 0.0
    if length is not None:
        _, slopes = given.remainder(length)
        free = slopes @ given.free(slopes)
        priors, at = [*priors, of_sizes.AMPLITUDE], [*at, found.amplitude]
        of_length = -0.5 * (np.log(length / of_sizes.LENGTH[0]) / of_sizes.LENGTH[1]) ** 2

    def wanted(values: list[float]) -> float:
        covariance = known + noise_covariance(given, Sizes(*values[:3]))
        if length is not None:
            covariance = covariance + values[3] ** 2 * free @ free.T
        value = stats.multivariate_normal(np.zeros(len(given.rows)), covariance).logpdf(given.residual) + of_length
        return float(value - sum(0.5 * (np.log(one / median) / width) ** 2
                                 for one, (median, width) in zip(values, priors, strict=True)))

    assert found.evidence == pytest.approx(wanted(at), abs=1e-5)
    for k in range(len(at)):
        for factor in (0.97, 1.03):
            assert wanted([one * factor if k == j else one for j, one in enumerate(at)]) < found.evidence


def test_what_is_stated_of_the_springs_holds() -> None:
    """Over parts of the model itself, the error of all springs in the metric of their covariance is chi-square."""
    rng = np.random.default_rng(6)
    given = terms(rng)
    residuals, truth = drawn(given, NOISE, rng, 200)
    square = []
    for residual, z in zip(residuals.T, truth.T, strict=True):
        found = posterior(replace(given, residual=residual), NOISE)
        error = found.mean[:6] - z[:6]
        square.append(error @ np.linalg.solve(found.covariance[:6, :6], error))
    assert stats.kstest(square, stats.chi2(6).cdf).pvalue > 1e-3


def test_sizes_are_found_and_a_remainder_is_told_from_chance() -> None:
    rng = np.random.default_rng(7)
    given = terms(rng)
    residual, _ = drawn(given, Sizes(2.0, 1e-7, 0.0), rng, 1)
    plain = replace(given, residual=residual[:, 0])
    alone = without_remainder(plain)
    assert 1.6 < alone.noise < 2.4
    assert chance_of_remainder(plain, alone)[0] > FALSE_RATE
    position = given.rows.position[given.rows.place] - given.frame.centre
    axis = np.argmax(given.rows.direction, axis=1)
    smooth = 25e-6 * np.sin(position[:, 0] / 0.025 + axis) * np.cos(position[:, 1] / 0.03)
    bent = replace(given, residual=residual[:, 0] + smooth)
    alone = without_remainder(bent)
    chance, length = chance_of_remainder(bent, alone)
    assert chance <= FALSE_RATE
    sizes = with_remainder(bent, alone, length)
    tried = held_out(bent, sizes)
    assert tried is not None
    assert tried.gain > 0.5
    assert tried.learned < 0.7 * tried.physical


def test_chance_is_met_as_often_as_stated() -> None:
    """Rows without a remainder, sizes estimated from each: one in a hundred is taken for one; of 60, at most four."""
    rng = np.random.default_rng(8)
    given = terms(rng, places=30)
    residuals, _ = drawn(given, NOISE, rng, 60)
    found = 0
    for residual in residuals.T:
        one = replace(given, residual=residual)
        found += chance_of_remainder(one, without_remainder(one))[0] <= FALSE_RATE
    assert found <= 4


@pytest.mark.parametrize("wrong", [1.0, -1.0])
def test_a_remainder_of_the_wrong_sign_is_seen_on_what_was_left_out(wrong: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """If the code took the remainder off the wrong way, the stretches left out would be worse."""
    rng = np.random.default_rng(9)
    given = terms(rng)
    axis = np.argmax(given.rows.direction, axis=1)
    position = given.rows.position[given.rows.place] - given.frame.centre
    smooth = 25e-6 * np.sin(position[:, 0] / 0.025 + axis)
    bent = replace(given, residual=smooth + SIGMA * rng.standard_normal(len(axis)))
    from compensator.learning import held_out as tried

    right = tried.expected
    monkeypatch.setattr(tried, "expected", lambda *a, **k: wrong * right(*a, **k))
    found = tried.held_out(bent, Sizes(1.0, 1e-6, 1e-4, 30e-6, 0.1))
    assert found is not None
    assert found.gain > 0.2 if wrong > 0 else found.gain < -0.5
    assert (found.better < -2) == (wrong < 0)


def test_stretches_are_left_out_one_after_the_other_and_told_by_the_rest() -> None:
    """Eight of five places each, by normal equations of the others; what is gained in standard errors of the stretches'
    means of squares. A remainder is none here, and fifteen places are too few."""
    rng, about = np.random.default_rng(14), Sizes(1.0, 2e-6, 1e-4)
    given = terms(rng)
    given = replace(given, residual=drawn(given, NOISE, rng, 1)[0][:, 0])
    found = held_out(given, about)
    assert found is not None
    left = np.empty(120)
    for first in range(0, 40, 5):
        out = (given.rows.place >= first) & (given.rows.place < first + 5)
        rest = given.select(~out)
        noise = noise_covariance(rest, without_remainder(rest, about, 4))
        prior = np.diag(1 / np.diag(given.physical_prior))
        solved = np.linalg.solve(noise, np.column_stack([rest.physical, rest.residual]))
        mean = np.linalg.solve(rest.physical.T @ solved[:, :-1] + prior, rest.physical.T @ solved[:, -1])
        left[out] = given.residual[out] - given.physical[out] @ mean
    won = (given.residual**2 - left**2).reshape(8, 15).mean(axis=1)
    assert (found.known, found.physical, found.learned) == pytest.approx((rms(given.residual), rms(left), rms(left)), rel=1e-6)
    assert found.better == pytest.approx(won.mean() / (won.std(ddof=1) / np.sqrt(8)), rel=1e-5)
    assert found.stretches == 8
    for places in (15, 16):
        few = terms(rng, places=places)
        assert (held_out(few, about) is None) == (places < 16)


def test_where_nothing_was_learned_of_the_remainder_nothing_is_added() -> None:
    """Neither a displacement nor an uncertainty, wherever a program goes."""
    position, theta, _ = path(5)
    frame = JobFrame(Frame(np.eye(3), np.zeros(3)), np.zeros(3), 1.0, 1.0)
    learned = Learned(np.zeros(6), np.zeros(15), 1e-12 * np.eye(15), frame)
    basis = learned.remainder.basis(position, theta)
    assert basis.shape == (5, 0)
    assert not any(each.any() for each in learned.covariance_beside(np.zeros((5, 3, 6)), resting(basis)))


def resting(basis: np.ndarray) -> Rest:
    """What a program takes at places of this basis (n, m), neither set-up nor drift among it."""
    return Rest(np.zeros((len(basis), 3)), np.zeros((len(basis), 3, SETUP + DRIFT)), basis, np.ones(len(basis), dtype=bool))


@pytest.mark.parametrize(("number", "told", "untold"), [(1, 0.01, 1.0), (CHUNK + 2, 0.01, 1.0), (3, 0.2, 0.3)])
def test_of_a_direction_that_nobody_measured_all_is_unseen_at_every_target(number: int, told: float, untold: float) -> None:
    """The places were measured along x and y, and never along z: there the process is as wide as before anything was
    measured, at the first target as at the last, and along x and y as wide as what the places leave of it. A direction is
    measured where a quarter of the variance is left at most."""
    amplitude, (position, theta, _) = 20e-6, path(40)
    chosen = spread_out(position, theta, 0.03, 8)
    remainder = Remainder(position[chosen], theta[chosen], 0.03, amplitude)
    weights = np.tile([told, told, untold], len(chosen)) * amplitude**2
    covariance = np.diag([*np.full(6 + SETUP + DRIFT, 1e-12), *weights])
    learned = Learned(np.zeros(6), np.zeros(len(covariance)), covariance,
                      JobFrame(Frame(np.eye(3), np.zeros(3)), np.zeros(3), 1.0, 1.0), remainder)
    at = np.arange(number) % len(position)
    basis = remainder.basis(position[at] + [0, 0, 5e-3], theta[at])
    left = 1 - np.sum(matern(stretched(position[at] + [0, 0, 5e-3], theta[at], 0.03),
                             stretched(position[chosen], theta[chosen], 0.03)) @ np.linalg.inv(matern(
        *(stretched(position[chosen], theta[chosen], 0.03),) * 2)) * matern(
        stretched(position[at] + [0, 0, 5e-3], theta[at], 0.03), stretched(position[chosen], theta[chosen], 0.03)), axis=1)
    expected = amplitude**2 * (left[:, None, None] * np.eye(3) + untold * (1 - left)[:, None, None] * np.diag([0, 0, 1.0]))
    _, unseen = learned.covariance_beside(np.zeros((number, 3, 6)), resting(basis))
    assert np.allclose(unseen, expected, atol=1e-4 * amplitude**2)


def test_what_springs_and_an_untold_direction_share_is_not_taken_away_twice() -> None:
    """What springs and a direction that nobody measured could both be, of which the sum is known better than either: without
    what is unseen of it a covariance is left, that of the sum where the untold part is known (Schur's complement)."""
    amplitude, (position, theta, _) = 20e-6, path(40)
    chosen = spread_out(position, theta, 0.03, 2)
    remainder = Remainder(position[chosen], theta[chosen], 0.03, amplitude)
    along, basis = np.array([0.0, 0.0, 30e-6]), remainder.basis(position[:1], theta[:1])
    by_spring = np.zeros((1, 3, 6))
    by_spring[0, :, 0] = along
    sure = np.diag([*np.full(6, 1e-12), *np.full(SETUP + DRIFT, 1e-12), *np.tile([0.01, 0.01, 0.01], 2) * amplitude**2])
    shared = np.zeros(len(sure))        # a spring that is softer by one sigma, and the remainder that much less
    shared[0], shared[-4] = 0.9, -0.9 * amplitude
    covariance = sure + np.outer(shared, shared)
    learned = Learned(np.zeros(6), np.zeros(len(covariance)), covariance,
                      JobFrame(Frame(np.eye(3), np.zeros(3)), np.zeros(3), 1.0, 1.0), remainder)
    added, unseen = learned.covariance_beside(by_spring, resting(basis))
    slopes = np.concatenate([by_spring[0], np.zeros((3, SETUP + DRIFT)), np.kron(basis[0], np.eye(3))], axis=1)
    whole = by_spring[0] @ covariance[:6, :6] @ by_spring[0].T + added[0]
    left = (1 - np.sum(basis**2)) * amplitude**2 * np.eye(3)
    assert np.allclose(whole, slopes @ covariance @ slopes.T + left, rtol=0, atol=1e-6 * amplitude**2)
    kept = np.delete(np.arange(len(sure)), len(sure) - 4)
    known = covariance[np.ix_(kept, kept)] - np.outer(covariance[kept, -4], covariance[-4, kept]) / covariance[-4, -4]
    assert np.allclose(whole - unseen[0], slopes[:, kept] @ known @ slopes[:, kept].T, rtol=0, atol=1e-6 * amplitude**2)
    assert np.linalg.eigvalsh(whole - unseen[0]).min() > 0


def test_the_ratio_of_chance_is_that_of_two_normal_densities() -> None:
    """Rows of unit noise, with slopes of normal weights or without: the best amplitude that is tried, none is as good."""
    rng = np.random.default_rng(17)
    slopes, rows = 3e4 * rng.standard_normal((12, 4)), 1.5 * rng.standard_normal((12, 5))
    plain = stats.multivariate_normal(np.zeros(12), np.eye(12)).logpdf(rows.T)
    with_slopes = [stats.multivariate_normal(np.zeros(12), np.eye(12) + (size * slopes) @ (size * slopes).T).logpdf(rows.T)
                   for size in np.geomspace(1e-6, 5e-4, 28)]
    assert _ratio(slopes, rows) == pytest.approx(np.maximum(2 * (np.max(with_slopes, axis=0) - plain), 0.0), abs=1e-9)


def test_what_chance_never_shows_is_less_likely_than_one_draw_of_a_thousand() -> None:
    """The least that 999 draws can tell."""
    rng = np.random.default_rng(18)
    given = terms(rng, places=20)
    bent = 3e-3 * np.sin(given.rows.length[given.rows.place] / 0.02 + np.argmax(given.rows.direction, axis=1))
    assert chance_of_remainder(replace(given, residual=given.residual + bent), NOISE)[0] == 1 / 1000


@pytest.mark.parametrize(("shift", "warms"), [(0.0, 0.0), (60e-6, 0.0), (0.0, 90e-6)])
def test_set_up_and_drift_are_there_where_chance_shows_no_as_much(shift: float, warms: float) -> None:
    """A shift of 60 um along x, a drift of 90 um along y, over points that show both to some um; else neither is learned."""
    rng = np.random.default_rng(19)
    given = terms(rng, springs=1)
    truth = np.zeros(SETUP + DRIFT)
    truth[0], truth[SETUP + 1] = shift, warms
    given = replace(given, residual=given.residual + given.of_job @ truth)
    job = _seen_of_the_job(given, NOISE).job
    assert np.any(job[:SETUP, :SETUP]) == (shift > 0)
    assert np.any(job[SETUP:, SETUP:]) == (warms > 0)


def test_the_factor_in_motion_is_what_all_springs_have_in_common() -> None:
    """Six springs and two effects: ln of the compliances is the load tests' and a factor's, which the sensor's gain acts like.
    What a part tells of their sums is conditioned by the joint distribution of factor and parameters."""
    rng = np.random.default_rng(31)
    root = 0.05 * rng.normal(size=(8, 8))
    model: Any = SimpleNamespace(mean=rng.normal(size=8), covariance=root @ root.T)
    cell: Any = SimpleNamespace(force_log=SimpleNamespace(form=SimpleNamespace(gain_std=0.04)))
    motion = Estimate(1.3, 0.2)
    springs = (np.arange(8) < 6).astype(float)
    variance = (0.2 / 1.3) ** 2 + 0.04**2
    mean, before = _before(model, motion, cell)
    np.testing.assert_allclose(mean, model.mean + np.log(1.3) * springs)
    np.testing.assert_allclose(before, root @ root.T + variance * np.outer(springs, springs))
    seen, noise, told = rng.normal(size=(5, 8)), 0.02**2 * np.eye(5), 0.2 * rng.normal(size=5)
    # Parameters less their mean before, and the ln of the factor behind them.
    joint = np.block([[before, variance * springs[:, None]], [variance * springs[None], np.full((1, 1), variance)]])
    rows = np.column_stack([seen, np.zeros(5)])
    gain = joint @ rows.T @ np.linalg.inv(rows @ joint @ rows.T + noise)
    found, left = gain @ told, joint - gain @ rows @ joint
    known = np.concatenate([found[:8], rng.normal(size=9)])
    covariance = np.eye(17)
    covariance[:8, :8] = left[:8, :8]
    factor = _motion(before, Posterior(known, covariance, NO_REMAINDER), motion, cell)
    assert factor.value == pytest.approx(1.3 * np.exp(found[8]), rel=1e-6)
    assert factor.std == pytest.approx(factor.value * np.sqrt(left[8, 8]), rel=1e-6)


def test_each_part_of_what_was_learned_is_its_own_columns() -> None:
    """Set-up, drift and remainder by their own parameters; springs and what is left are the rest of what was measured."""
    rng = np.random.default_rng(20)
    given = terms(rng)
    found = posterior(given, Sizes(1.0, 2e-6, 0.0, 15e-6, 0.1))
    found = replace(found, mean=rng.standard_normal(len(found.mean)) * 1e-5)
    measured, predicted = 1e-4 * rng.standard_normal((2, len(given.rows)))
    parts = _parts(given, found, measured, predicted)
    springs, job = found.mean[:6], found.mean[6:15]
    assert np.allclose(parts["setup"], given.of_job[:, :SETUP] @ job[:SETUP])
    assert np.allclose(parts["drift"], given.of_job[:, SETUP:] @ job[SETUP:])
    basis = found.remainder.basis(given.rows.position, given.rows.posture)[given.rows.place]
    weights = found.mean[15:].reshape(-1, 3)[:, np.argmax(given.rows.direction, axis=1)].T
    assert np.allclose(parts["remainder"], np.sum(basis * weights, axis=1))
    explained = given.by_x @ springs + parts["setup"] + parts["drift"] + parts["remainder"]
    assert np.allclose(parts["left"], given.residual - explained)
    assert np.allclose(sum(parts.values()), measured)


@pytest.mark.parametrize("shift", [-4.0, 0.0, 1.0, 6.5])
def test_points_that_belong_farther_along_are_told_by_how_far(shift: float) -> None:
    """A wave of 90 mm with 3 um of noise, rows that were shifted by so many millimetres; under 1.5 mm nothing is said."""
    rng = np.random.default_rng(21)
    length = np.linspace(0.0, 0.3, 151)
    wave = 80e-6 * np.sin(2 * np.pi * length / 0.09)
    job = SimpleNamespace(path=SimpleNamespace(length=length), targets=np.arange(151),
                          prediction=SimpleNamespace(position=np.column_stack([wave, 0 * wave, 0 * wave])))
    rows = SimpleNamespace(sigma=np.full(151, 3e-6), seen=lambda field: field[:, :1])
    measured = 1.3 * 80e-6 * np.sin(2 * np.pi * (length + 1e-3 * shift) / 0.09) + rng.normal(0, 3e-6, 151)
    told = said_of_shift(rows, measured, job, "points.csv")
    assert len(told) == (abs(shift) > 1.5)
    if told:
        way, by = ("farther" if shift > 0 else "less far"), float(re.search(r"predicted ([\d.]+) mm", told[0].message)[1])
        assert f"mm {way} along the path" in told[0].message
        assert abs(by - abs(shift)) <= 0.5


def bump(length: np.ndarray) -> np.ndarray:
    """40 um in the middle of 0.2 m, nothing from 30 mm before its ends on."""
    return np.asarray(40e-6 * np.sin(np.pi * np.clip((length - 0.03) / 0.14, 0, 1)) ** 2)


@pytest.mark.parametrize(("by_mm", "left", "sigmas", "said"), [
    (1.0, 0.0, 9.0, ""), (1.5, 0.0, 9.0, "1.5 mm farther"), (-1.5, 0.0, 9.0, "1.5 mm less far"),
    (10.0, 0.0, 9.0, "10.0 mm farther"), (-10.0, 0.0, 9.0, "10.0 mm less far"), (5.0, 0.59, 9.0, "5.0 mm farther"),
    (5.0, 0.61, 9.0, ""),
    (5.0, 0.59, 3.05, "5.0 mm farther"), (5.0, 0.59, 2.95, "")])
def test_a_shift_is_said_that_is_long_leaves_little_and_is_seen(by_mm: float, left: float, sigmas: float, said: str) -> None:
    """From 1.5 to 10 mm; where under 0.6 of what its own place leaves would be left, by something that no shift tells; where
    that is three sigmas of the points."""
    length = np.arange(401) * 0.5e-3
    job = SimpleNamespace(path=SimpleNamespace(length=length), targets=np.arange(401),
                          prediction=SimpleNamespace(position=np.column_stack([0 * length, bump(length), 0 * length])))
    shown, own = bump(length + 1e-3 * by_mm), bump(length)
    shifted = np.column_stack([bump(length + 0.5e-3 * k) for k in range(-20, 21)])
    other = np.random.default_rng(3).normal(size=401)
    other -= shifted @ np.linalg.lstsq(shifted, other, rcond=None)[0]
    off = np.sum((shown - own * (shown @ own) / (own @ own)) ** 2)
    measured = 1.2 * (shown + other * np.sqrt(left**2 / (1 - left**2) * off / (other @ other)))
    as_is = 1.2 * np.sqrt(off / (1 - left**2) / 401)
    rows: Any = SimpleNamespace(sigma=np.full(401, as_is / sigmas), seen=lambda field: field[:, 1:2])
    assert [(one.code, one.level, one.file, one.message) for one in said_of_shift(rows, measured, job, "points.csv")] == ([(
        "CS5329", "warning", "points.csv", f"the points are off as is predicted {said} along the path, not at their own "
        f"places: {1e6 * left * as_is:.1f} um would be left in place of {1e6 * as_is:.1f}")] if said else [])


@pytest.mark.parametrize(("factor", "sigmas", "size_um", "refused"), [
    (0.5, -3.1, 20.0, True), (0.5, -2.9, 20.0, False), (2.0, 3.1, 20.0, True), (2.0, 2.9, 20.0, False), (1.0, 0.0, 20.0, False),
    (-1.0, 0.0, 3.1, True), (-1.0, 0.0, 2.9, False)])
@pytest.mark.parametrize("set_up", [False, True])
def test_a_measured_deviation_that_is_no_multiple_of_the_predicted_is_refused(
    factor: float, sigmas: float, size_um: float, refused: bool, set_up: bool
) -> None:
    """By three standard errors under a half or over two; of a predicted deviation of 3 um and more. Factor and error by least
    squares over all that is free, each sigma as a row of its own, beside a set-up that is 0.4 mm off."""
    given = terms(np.random.default_rng(5))
    given = replace(given, job=np.eye(9) if set_up else np.zeros((9, 9)))
    predicted = given.by_x[:, 0] * 1e-6 * size_um / rms(given.by_x[:, 0])
    noise = Sizes(1.5, 0.0, 0.0)
    columns = np.column_stack([predicted, given.of_job @ given.job])
    weighted = np.vstack([columns / (1.5 * SIGMA), np.diag(np.concatenate([[0.0], 1 / given.of_job_std]))])
    error = np.sqrt(np.linalg.pinv(weighted.T @ weighted)[0, 0])
    value = factor + sigmas * error
    residual = (value - 1) * predicted + (4e-4 * given.of_job[:, 0] if set_up else 0.0)
    told = np.linalg.lstsq(weighted, np.concatenate([residual / (1.5 * SIGMA), np.zeros(10)]), rcond=None)[0][0] + 1
    assert told == pytest.approx(value, abs=0.05 * error)
    if not refused:
        refuse_wrong_factor(replace(given, residual=residual), noise, predicted, "points.csv")
        return
    with pytest.raises(Refused) as stopped:
        refuse_wrong_factor(replace(given, residual=residual), noise, predicted, "points.csv")
    [said] = stopped.value.findings
    assert (said.code, said.level, said.file) == ("CS5310", "error", "points.csv")
    assert said.message == (f"the measured deviation is {told:.3g} +- {2 * error:.2g} times the predicted (2 sigma), expected "
                            "0.5 to 2: nothing is learned")


def test_no_point_is_shifted_on_one_target_or_none() -> None:
    for count in (0, 1):
        job = SimpleNamespace(path=SimpleNamespace(length=np.zeros(count)), targets=np.arange(count),
                              prediction=SimpleNamespace(position=np.full((count, 3), 1e-4)))
        rows = SimpleNamespace(sigma=np.full(3, 3e-6), seen=lambda field: np.repeat(field[:1, :1], 3, axis=0))
        assert said_of_shift(rows, np.array([1e-4, -1e-4, 3e-4]), job, "points.csv") == []


def test_where_nothing_is_predicted_no_point_is_shifted() -> None:
    """As along normals that stand across the deviation."""
    length = np.linspace(0.0, 0.3, 31)
    job = SimpleNamespace(path=SimpleNamespace(length=length), targets=np.arange(31),
                          prediction=SimpleNamespace(position=np.zeros((31, 3))))
    rows = SimpleNamespace(sigma=np.full(31, 3e-6), seen=lambda field: field[:, :1])
    assert said_of_shift(rows, 50e-6 * np.sin(length / 0.01), job, "points.csv") == []


def test_a_deviation_has_a_slope_on_either_side_of_a_target() -> None:
    """Per metre of path, by component; targets nearer than 0.1 mm count as that far apart."""
    job = SimpleNamespace(path=SimpleNamespace(length=np.array([0.0, 9.0, 9.01, 9.03, 9.03001])), targets=np.arange(1, 5))
    moved = 1e-6 * np.array([[10, 0, 5], [40, 0, -15], [20, 8, -15], [20, 8, -14]])
    between = 1e-6 * np.array([[3000, 0, -2000], [-1000, 400, 0], [0, 0, 1e4]])
    before, behind = slope_along(job, moved)
    assert before == pytest.approx(np.vstack([np.zeros(3), between]))
    assert behind == pytest.approx(np.vstack([between, np.zeros(3)]))
    for count in (0, 1):
        alone = slope_along(SimpleNamespace(path=job.path, targets=np.arange(2, 2 + count)), moved[:count])
        assert alone.tolist() == np.zeros((2, count, 3)).tolist()


@pytest.mark.parametrize("turn", [np.eye(3), Rotation.from_rotvec([0.3, -1.1, 0.6]).as_matrix()], ids=["base", "turned"])
def test_a_number_sees_how_steep_it_is_along_its_own_direction(turn: np.ndarray) -> None:
    """Halfway between two targets, the steeper side of each; in whatever axes direction and slopes are told."""
    slopes = 1e-3 * np.array([[[0, 0, 0], [4, 0, 0], [0, 2, 0]], [[4, 0, 0], [0, 2, 0], [0, 0, 0]]])
    for direction, seen in (([1, 0, 0], 4e-3), ([0, 1, 0], 1e-3), ([0, 0, 1], 0.0), ([0.6, 0.8, 0], 2.4e-3),
                            ([0.6, -0.8, 0], 2.4e-3)):
        weights = np.zeros((1, 3, 3))
        weights[0, :2] = 0.5 * turn @ direction
        rows = sparse.csr_array(weights.reshape(1, 9))
        assert steep_at(rows, slopes @ turn.T) == pytest.approx([seen], abs=1e-12)
        assert np.array_equal(rows.toarray(), weights.reshape(1, 9))        # nothing of it is changed
    # Of a program of a million targets it takes what its rows take.
    long = sparse.csr_array(([0.6, 0.8], ([0, 0], [3, 5])), shape=(1, 3_000_000))
    assert steep_at(long, np.broadcast_to([2e-3, 0, 1e-3], (2, 1_000_000, 3))) == pytest.approx([2e-3])


def test_a_point_between_two_walls_is_as_near_to_either() -> None:
    """Two walls 6 mm apart and 200 mm of path from one to the other: what stands halfway could be of both, first or last."""
    along = np.concatenate([np.arange(0, 0.1, 1e-3), 0.2 + np.arange(0, 0.1, 1e-3)])
    position = np.column_stack([along % 0.2, np.where(along < 0.15, 0.0, 6e-3), 0 * along])
    sought = np.array([[0.05, 3e-3, 0.0], [0.05, 1e-3, 0.0], [0.02, 5.5e-3, 0.0], [0.03, 3e-3, 0.0]])
    distance, where, ambiguous = _nearest(sought, position, along)
    assert distance == pytest.approx([3e-3, 1e-3, 0.5e-3, 3e-3])
    assert where[1:3] == pytest.approx([0.05, 0.22])
    assert ambiguous.tolist() == [True, False, False, True]


def test_the_verdict_on_causes_says_what_was_asked() -> None:
    rows: Any = None
    named: Any = SimpleNamespace(verdict="named")
    assert Asked(None, rows).verdict == "not asked"
    assert Asked(named, rows).verdict == "named"
    assert Asked(named, rows, withdrawn="it made stretches left out worse").verdict == "unknown"


@pytest.mark.parametrize(("verdict", "code", "level", "words"), [
    ("named", "CS4610", "warning", "the part shows play (backlash[2]), 97 %"),
    ("ambiguous", "CS4611", "warning", "and not which: none is carried"),
    ("unknown", "CS4613", "note", "in 20.0 % of parts"), ("adequate", "", "", "")])
def test_what_is_said_of_the_causes_is_their_verdict(verdict: str, code: str, level: str, words: str) -> None:
    cause = SimpleNamespace(label="backlash[2]", sentence="play", probability=0.97, effect=SimpleNamespace(of_robot=True))
    found: Any = SimpleNamespace(verdict=verdict, causes=(cause,), clear=False)
    rows: Any = None
    said = said_of_causes(Asked(found, rows, p_value=0.2), "points.csv")
    assert [(one.code, one.level) for one in said] == ([(code, level)] if code else [])
    assert not said or words in said[0].message


@pytest.mark.parametrize(("asked", "code", "level", "words"), [
    ({"found": None, "why_not": "too few places"}, "CS4615", "note", "were not asked: too few places"),
    ({"withdrawn": "within two standard deviations of nothing"}, "CS4614", "warning", "is taken back: within two"),
    ({"of_robot": False}, "CS4612", "warning", "play: not carried"),
    ({"gained": (HeldOut(40e-6, 40e-6, 31e-6, 3.0, 8), HeldOut(40e-6, 40e-6, 12e-6, 3.0, 8))}, "CS4610", "warning",
     "on stretches left out 31.0 um without it, 12.0 um with it: carried")])
def test_what_is_said_of_a_cause_that_is_not_just_named(asked: dict[str, Any], code: str, level: str, words: str) -> None:
    """Not asked, taken back, the sensor's own, and what it gains where it was not learned."""
    cause = SimpleNamespace(label="backlash[2]", sentence="play", probability=0.97,
                            effect=SimpleNamespace(of_robot=asked.pop("of_robot", True)))
    named: Any = SimpleNamespace(verdict="named", causes=(cause,), clear=False)
    rows: Any = None
    given = Asked(asked.pop("found", named), rows, **asked)
    assert [(one.code, one.level, one.file, words in one.message) for one in said_of_causes(given, "points.csv")] == [
        (code, level, "points.csv", True)]


def test_a_part_is_drawn_along_the_path_with_gaps_where_nothing_was_measured() -> None:
    """Sizes of two numbers a place in micrometres, in the order of the path; no line over 40 mm among steps of 4 mm."""
    length = np.array([0.0, 4e-3, 60e-3, 8e-3, 64e-3])
    rows = SimpleNamespace(length=length, place=np.repeat(np.arange(5), 2))
    size = 1e-6 * np.array([10.0, 20, 30, 40, 50])
    values = np.column_stack([0.6 * size, 0.8 * size]).ravel()
    names = ("predicted", "springs", "setup", "drift", "remainder", "left")
    learning = SimpleNamespace(terms=SimpleNamespace(rows=rows), measured=values, parts=dict.fromkeys(names, 0.5 * values))
    lines = _along(learning).panels[0].series
    assert lines[0].x == pytest.approx([0, 4, 8, np.nan, 60, 64], nan_ok=True)
    assert lines[0].y == pytest.approx([10, 20, 40, np.nan, 30, 50], nan_ok=True)
    assert lines[1].y == pytest.approx([5, 10, 20, np.nan, 15, 25], nan_ok=True)


@pytest.mark.parametrize(("known", "learned", "words"), [
    (40.0, 20.0, "LEARNED"), (40.0, 33.0, "LEARNED LITTLE"), (40.0, 40.0, "NOTHING GAINED"),
    (None, None, "LEARNED, NOT TESTED")])
def test_the_page_says_what_was_gained_where_it_was_left_out(known: float | None, learned: float | None, words: str) -> None:
    tried = None if known is None else {"known_um": known, "learned_um": learned}
    learning = SimpleNamespace(findings=(), as_dict=lambda: {"measured_um": 50.0, "gone": {"springs": 0.3, "setup": 0.7},
                                                             "held_out": tried})
    assert _verdict(learning).word == words


def test_the_measured_is_compared_with_the_predicted_of_the_moving_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that gives way 1.25 times as much as at rest is expected to leave 1.25 times as much."""
    asked: list[np.ndarray] = []

    def refuse(terms: object, noise: object, expected: np.ndarray, source: str) -> None:
        asked.append(expected)
        raise StopIteration

    monkeypatch.setattr(fitted_part, "frame_of", lambda *of: None)
    monkeypatch.setattr(fitted_part, "_linearised", lambda *of: lambda x, job: None)
    monkeypatch.setattr(fitted_part, "without_remainder", lambda *of: None)
    monkeypatch.setattr(fitted_part, "refuse_wrong_factor", refuse)
    rows: Any = SimpleNamespace(seen=lambda moved: moved @ np.array([[1.0], [0.0], [2.0]]), along_normals=False)
    moved = 1e-6 * np.array([[40.0, 7.0, -5.0], [10.0, 0.0, 15.0]])
    predicted: Any = SimpleNamespace(prediction=SimpleNamespace(position=moved))
    believed: Any = SimpleNamespace(mean=np.zeros(6), start=None)
    with pytest.raises(StopIteration):
        fitted_part.fitted_part(rows, predicted, believed, Estimate(1.25, 0.1), "points.csv")
    assert asked[0] == pytest.approx(1.25e-6 * np.array([30.0, 40.0]))


@pytest.mark.parametrize("motion", [0.9, 1.0, 1.3])
def test_points_of_the_pass_without_the_offsets_are_told_from_those_with_them(motion: float) -> None:
    """Offsets undo what was predicted, up to what was held back; the robot gives way more, or less, in either pass."""
    for seed in range(20):
        rng = np.random.default_rng([5335, seed])
        rows = terms(rng).rows
        told = 60e-6 * np.sin(np.arange(len(rows)) / 7 + rng.uniform(0, 6))
        offsets = -rng.uniform(0.7, 1.1) * told
        noise = SIGMA * rng.standard_normal(len(rows))
        first, second = motion * told + noise, motion * told + offsets + noise
        refuse_other_pass(replace(rows, value=second - offsets), told, offsets, "points.csv")
        with pytest.raises(Refused) as stopped:
            refuse_other_pass(replace(rows, value=first - offsets), told, offsets, "points.csv")
        assert stopped.value.findings[0].code == "CS5335"


@pytest.mark.parametrize(("left", "sigma", "told"), [(0.49, 0.1, True), (0.51, 0.1, False), (0.0, 0.32, True),
                                                     (0.0, 0.34, False)])
def test_a_pass_is_another_one_where_it_leaves_half_and_the_points_see_it(left: float, sigma: float, told: bool) -> None:
    """left: as a share of what the named pass leaves, which is 20 um; sigma of the points, as a share of the same."""
    one = np.tile([20e-6, -20e-6], 10)
    rows: Any = SimpleNamespace(value=one, sigma=np.full(20, 20e-6 * sigma))
    if not told:
        refuse_other_pass(rows, 0 * one, (left - 1) * one, "points.csv")
        return
    with pytest.raises(Refused) as stopped:
        refuse_other_pass(rows, 0 * one, (left - 1) * one, "points.csv")
    [said] = stopped.value.findings
    assert (said.code, said.level, said.file) == ("CS5335", "error", "points.csv")
    assert f"but for {20 * left:.1f} um, of the pass with those of --logged-with but for 20.0 um" in said.message


@pytest.mark.parametrize(("bent", "words"), [
    (0.0, "100 % of it grow with the distance"), (0.4, "of it grow with the distance"), (1.5, "it is bent within the part")])
def test_a_remainder_that_grows_with_the_distance_is_a_scale_and_all_else_is_bent(bent: float, words: str) -> None:
    """At places whose coordinates are independent and have all moments of a square: what is of the second order has nothing of
    the first, and each has the share that Pythagoras says."""
    places = np.array([(x, y, z) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) for z in (-1.0, 1.0)])
    count = len(places)
    centre, radius = np.array([1.3, 0.0, 0.7]), 0.05
    rows = SimpleNamespace(position=centre + radius * places, direction=np.tile(np.eye(3)[0], (count, 1)),
                           place=np.arange(count))
    rows = type("Rows", (SimpleNamespace,), {"__len__": lambda self: count})(**vars(rows))
    scale, second = places @ [1.0, 0.5, -0.3], places[:, 0] * places[:, 1]
    second *= bent * rms(scale) / rms(second)
    learning: Any = SimpleNamespace(
        terms=SimpleNamespace(rows=rows), parts={"remainder": 30e-6 * (scale + second)},
        learned=SimpleNamespace(frame=JobFrame(Frame.identity(), centre, radius, 1.0)))
    told = _missing(learning)
    assert words in told
    if "grow" in words:
        assert told.startswith(f"{100 / (1 + bent**2):.0f} %")
