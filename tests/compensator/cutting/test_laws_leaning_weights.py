"""A leaning ball's rings and shank by plain sums over its surface, and by the cylinder that a shank is in space."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.cutting.cutter import Cutter
from compensator.cutting.leaning import above_the_ball, across_shank, leaning_weights, leans, leans_too_far, shank_rim
from tests.virtual_cell.leaning_ball import tilted

RADIUS, TEETH = 6e-3, 4
BALL = Cutter(RADIUS, TEETH, RADIUS)


def summed(axis: np.ndarray, feed: np.ndarray, travel: np.ndarray, chip: float, phi: tuple[float, float],
           z: tuple[float, float], bits: int = 300) -> np.ndarray:
    """(3, 6): over bits of the ball's surface between heights z over its lowest point and angles phi to the left of the feed,
    each passed once a revolution by each tooth: its share of a tooth's way round is its area by 2 pi times its distance from
    the axis, and the edge that carries it is as wide as it."""
    kappa = np.linspace(*np.arccos(1 - np.array(z) / RADIUS), bits + 1)
    kappa, width = 0.5 * (kappa[1:] + kappa[:-1]), np.diff(kappa)[0]
    total = np.zeros((3, 6))
    for angle in phi[0] + (np.arange(bits) + 0.5) / bits * (phi[1] - phi[0]):
        out = np.cos(angle) * feed + np.sin(angle) * np.array([-feed[1], feed[0]])
        normal = np.column_stack([np.sin(kappa)[:, None] * out, -np.cos(kappa)])
        arm = np.linalg.norm(normal - (normal @ axis)[:, None] * axis, axis=1) * RADIUS
        area = RADIUS**2 * np.sin(kappa) * width * (phi[1] - phi[0]) / bits
        edge = TEETH * area / (2 * np.pi * arm)
        # A spindle that turns clockwise seen from above, once while the feed goes on by a chip a tooth.
        velocity = 2 * np.pi * RADIUS * np.cross(normal, axis) + TEETH * chip * travel
        against = -velocity / np.linalg.norm(velocity, axis=1)[:, None]
        upward = axis - (normal @ axis)[:, None] * normal
        upward /= np.linalg.norm(upward, axis=1)[:, None]
        vectors = np.stack([against, -normal, -upward], axis=2)
        total += np.concatenate([np.einsum("b,b,bic->ic", edge, normal @ travel, vectors),
                                 np.einsum("b,bic->ic", edge, vectors)], axis=1)
    return total


@pytest.mark.parametrize(("lead", "tilt", "slope", "z_mm"), [
    (0, 0, 0, (0.6, 0.9)), (20, 0, 0, (1.0, 1.5)), (-25, 10, 30, (2.0, 2.5)), (5, -40, -20, (0.1, 0.2)),
    (40, 0, 0, (0.2, 0.4))])
@pytest.mark.parametrize("turned", [0.3, -1.9])
def test_the_weights_of_a_ring_are_those_of_its_bits(
        lead: float, tilt: float, slope: float, z_mm: tuple[float, float], turned: float) -> None:
    """Away from the tip, to some thousandths."""
    axis, rise = np.array(tilted(lead, tilt)), np.radians(slope)
    feed = np.array([np.cos(turned), np.sin(turned)])
    travel = np.array([*(np.cos(rise) * feed), np.sin(rise)])
    phi, chip = np.array([[-0.9, -0.87], [0.2, 0.22], [0.5, 0.55]]), np.array([0.1e-3, 0.2e-3, 0.05e-3])
    low, high = 1e-3 * np.array(z_mm)
    found = leaning_weights(phi[:, 0], phi[:, 1], np.full(3, low), np.full(3, high - low), BALL, np.tile(feed, (3, 1)),
                            np.tile(travel, (3, 1)), np.tile(axis, (3, 1)), chip)
    for own, (begin, stop), each in zip(found, phi, chip, strict=True):
        truth = summed(axis, feed, travel, each, (begin, stop), (low, high), 60)
        assert own == pytest.approx(truth, abs=2e-3 * np.abs(truth).max())
        assert own[:, :3] == pytest.approx(truth[:, :3], abs=5e-3 * np.abs(truth[:, :3]).max())


@pytest.mark.parametrize(("z_deg", "bound"), [
    ((10.0, 14.0), 1e-3), ((15.9, 19.9), 1e-3), ((9.0, 12.1), 2e-4), ((17.9, 21.0), 2e-4)])
def test_rings_next_to_the_tip_are_finer(z_deg: tuple[float, float], bound: float) -> None:
    """The tip stands at 15 degrees: where 1 / s changes fast within a layer as thick as it is away from it."""
    lead, feed = 15.0, np.array([1.0, 0.0])
    axis = np.array(tilted(lead, 0.0))
    low, high = RADIUS * (1 - np.cos(np.radians(z_deg)))
    phi = np.pi + np.array([0.0, 0.004])        # a tool that leans forward has its tip behind the lowest place
    travel = np.array([1.0, 0.0, 0.0])
    found = leaning_weights(phi[:1], phi[1:], np.array([low]), np.array([high - low]), BALL, feed[None], travel[None],
                            axis[None], np.array([0.0]))[0]
    truth = summed(axis, feed, travel, 0.0, (phi[0], phi[1]), (low, high), 100)
    assert found == pytest.approx(truth, abs=bound * np.abs(truth).max())


def test_at_the_tip_itself_the_mean_is_that_of_a_disc() -> None:
    """Over a disc about the axis the mean of 1 / s is 2 by its radius: a ring whose middle is the tip weighs so much."""
    lead, rings = 15.0, 24
    axis, width = np.array(tilted(lead, 0.0)), np.radians(0.5)
    lower = np.radians(lead) - 0.5 * width         # the tip is the middle of the middle ring
    edges = lower + width * np.array([-12, 12])
    low, high = RADIUS * (1 - np.cos(edges))
    phi = np.pi + np.array([-0.5e-3, 0.5e-3])
    found = leaning_weights(phi[:1], phi[1:], np.array([low]), np.array([high - low]), BALL, np.array([[1.0, 0.0]]),
                            np.array([[1.0, 0, 0]]), axis[None], np.array([0.0]))[0]
    middles = edges[0] + (np.arange(rings) + 0.5) * (edges[1] - edges[0]) / rings
    off = np.abs(middles - np.radians(lead))
    sine = np.where(off < 1e-6, 0.25 * width, np.sin(off))
    heights = RADIUS * (np.cos(middles - 0.5 * width) - np.cos(middles + 0.5 * width))
    # Of the edge's radial part: along the normals, all ways about the same.
    weight = TEETH / (2 * np.pi) * heights * 1e-3 / sine
    normal = np.column_stack([-np.sin(middles), 0 * middles, -np.cos(middles)])
    assert found[:, 4] == pytest.approx(-(weight @ normal), rel=1e-4, abs=1e-4 * weight.sum())


def test_a_shank_is_a_cylinder_above_its_ball() -> None:
    """Points at a level of it stand a radius off the axis, on the side that the feed goes to; under the middle of the ball,
    along the axis, there are none."""
    rng, angle = np.random.default_rng(4), np.linspace(-np.pi / 2, np.pi / 2, 31)
    axis = np.array([tilted(*rng.uniform(-50, 50, 2)) for _ in range(40)])
    travel = rng.normal(size=(40, 3)) * [1, 1, 0.3]
    travel /= np.linalg.norm(travel, axis=1)[:, None]
    high = rng.uniform(-0.7, 2.0, 40) * RADIUS
    rim = shank_rim(angle, high, RADIUS, travel, axis)
    shown = 0
    for own, one, way, up in zip(rim, axis, travel, high, strict=True):
        forward = way - (way @ one) * one
        forward /= np.linalg.norm(forward)
        left = np.cross(one, forward)
        for point, at in zip(own, angle, strict=True):
            out = RADIUS * (np.cos(at) * forward + np.sin(at) * left)
            along = (up - out[2]) / one[2]           # so far along the axis from the ball's middle the line there is so high
            assert np.isnan(point).all() == (along <= 0)
            if along > 0:
                shown += 1
                assert point == pytest.approx((out + along * one)[:2], abs=1e-12)
    assert 300 < shown < 1100


def test_a_level_cut_of_a_shank_squeezes_to_a_circle() -> None:
    """And what is upright stays as it is."""
    axis = np.array(tilted(25.0, -30.0))
    around = np.linspace(0, 2 * np.pi, 50)
    first = np.cross(axis, [0.0, 0.0, 1.0])
    first /= np.linalg.norm(first)
    ring = RADIUS * (np.cos(around)[:, None] * first + np.sin(around)[:, None] * np.cross(axis, first))
    level = (ring - (ring[:, 2:] / axis[2]) * axis)[:, :2]
    assert np.ptp(np.linalg.norm(level, axis=1)) > 0.1 * RADIUS
    assert np.linalg.norm(across_shank(level, axis), axis=1) == pytest.approx(RADIUS, rel=1e-12)
    np.testing.assert_array_equal(across_shank(level, np.array([0.0, 0.0, 1.0])), level)


def test_where_a_ball_is_none() -> None:
    """A point of the rim is no ball's where it stands above the plane through its middle across the axis, or over that."""
    rng = np.random.default_rng(6)
    count = 60
    axis = np.array([tilted(*rng.uniform(-50, 50, 2)) for _ in range(count)])
    turn, at = rng.uniform(-3, 3, count), rng.uniform(0.05, 1.2, count) * RADIUS
    feed, angle = np.column_stack([np.cos(turn), np.sin(turn)]), rng.uniform(-1.5, 1.5, (count, 7))
    found = above_the_ball(angle, at, RADIUS, feed, axis)
    radius = np.sqrt(np.maximum(RADIUS**2 - (RADIUS - at) ** 2, 0.0))
    around = turn[:, None] + angle
    place = np.stack([radius[:, None] * np.cos(around), radius[:, None] * np.sin(around),
                      np.broadcast_to((at - RADIUS)[:, None], around.shape)], axis=2)
    truth = (np.einsum("kpi,ki->kp", place, axis) > 0) | (at > RADIUS)[:, None]
    assert 0.2 < truth.mean() < 0.8
    np.testing.assert_array_equal(found, truth)


@pytest.mark.parametrize(("degrees", "known"), [
    (0.99, (False, False)), (1.01, (True, False)), (59.9, (True, False)), (60.1, (True, True))])
def test_from_a_degree_on_a_tool_leans_and_from_sixty_too_far(degrees: float, known: tuple[bool, bool]) -> None:
    axis = np.array([tilted(degrees, 0.0)])
    assert (bool(leans(axis)[0]), bool(leans_too_far(axis)[0])) == known
