"""Still readings of one weight and one zero are left in peace, those of a touch, of hoses, of moments in another order not.

The weight's wrench is written out here; the sensor may err by its gain, axis by axis."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from compensator.forces.payload import estimate_payload
from compensator.forces.still_doubts import said_of_centre, said_of_pull
from identification.model.rotations import Frame

G = 9.81
SENSOR = Frame(np.eye(3), np.array([0.0, 0.0, 0.08]))
TCP = Frame(np.eye(3), np.array([0.1, 0.0, 0.3]))


def stills(rng: np.random.Generator, count: int = 6, mass: float = 40.0, gain: float = 0.005) -> tuple[np.ndarray, np.ndarray]:
    """Free fall (k, 3) and readings (k, 6) about the sensor, in its axes, of a weight whose centre is 60 mm before it."""
    fall = rng.normal(size=(count, 3))
    fall *= G / np.linalg.norm(fall, axis=1, keepdims=True)
    force = mass * fall
    wrench = np.concatenate([force, np.cross([0.01, -0.02, 0.06], force)], axis=1)
    true = 1 + np.concatenate([gain * rng.normal(size=3), 0.2 * gain * rng.normal(size=3)])
    zero, noise = rng.normal(size=6) * [20, 20, 20, 1, 1, 1], rng.normal(size=(count, 6)) * [0.1, 0.1, 0.1, 0.01, 0.01, 0.01]
    return fall, wrench * true + zero + noise


def pulled(fall: np.ndarray, load: np.ndarray) -> list[str]:
    payload = estimate_payload(fall, load, has_moment=True)
    assert payload is not None
    return [one.message for one in said_of_pull(payload, fall, np.zeros((len(fall), 6)), load, "still.csv")]


def test_a_weight_is_left_in_peace() -> None:
    """Of sensors that are true to half a per cent an axis, 4 to 12 orientations."""
    said = 0
    for seed in range(300):
        rng = np.random.default_rng([3050, seed])
        fall, load = stills(rng, int(rng.integers(4, 13)), rng.uniform(5, 120))
        said += bool(pulled(fall, load))
    assert said <= 3


@pytest.mark.parametrize("touch_n", [12.0, 60.0])
def test_a_touch_in_one_orientation_is_told_with_which(touch_n: float) -> None:
    for seed in range(30):
        rng = np.random.default_rng([3150, seed])
        fall, load = stills(rng, 8, gain=0.0005)
        at = int(rng.integers(8))
        load[at, :3] += touch_n * np.eye(3)[int(rng.integers(3))]
        [message] = pulled(fall, load)
        assert f"without orientation {at + 1} of 8" in message, seed


def test_a_hose_that_pulls_one_way_in_the_room_is_told() -> None:
    """In the sensor's axes it turns, about the weight's direction too."""
    for seed in range(30):
        rng = np.random.default_rng([3250, seed])
        fall, load = stills(rng, 8)
        level = np.cross(fall, rng.normal(size=(8, 3)))
        load[:, :3] += 25 * level / np.linalg.norm(level, axis=1, keepdims=True)
        assert pulled(fall, load), seed


def centred(fall: np.ndarray, load: np.ndarray, stated: tuple[float, ...] | None = None) -> list[str]:
    """What is said of the centre of mass, of a cell that states 40 kg with its centre there [m], or nothing."""
    payload = estimate_payload(fall, load, has_moment=True)
    assert payload is not None
    assert payload.centre is not None
    assert payload.centre_std is not None
    form = SimpleNamespace(kind="sensor", centre=None, mass=None)
    if stated is not None:
        form.centre, form.mass = np.array(stated), 40.0
    cell = SimpleNamespace(force_log=form, flange_from_tcp=TCP)
    said = said_of_centre(SENSOR.apply(payload.centre), payload.centre_std, payload, cell, SENSOR, "still.csv")
    return [one.code for one in said]


@pytest.mark.parametrize(("order", "signs", "said"), [
    ((3, 4, 5), 1, []), ((4, 3, 5), 1, ["CS3051"]), ((4, 5, 3), 1, ["CS3051"]), ((3, 4, 5), -1, ["CS3051"])])
def test_moments_in_another_order_or_with_another_sign(order: tuple[int, ...], signs: int, said: list[str]) -> None:
    for seed in range(40):
        fall, load = stills(np.random.default_rng([3051, seed]), 8)
        load[:, 3:] = signs * load[:, list(order)]
        assert centred(fall, load) == said, seed


@pytest.mark.parametrize(("z", "said"), [(0.14, []), (0.16, []), (0.23, ["CS3051"])])
def test_a_centre_far_from_the_stated_one_of_the_same_mass(z: float, said: list[str]) -> None:
    """As where the sensor's place is not that of cell.yaml: the true centre is 140 mm from the flange."""
    fall, load = stills(np.random.default_rng(7), 8)
    assert centred(fall, load, (0.01, -0.02, z)) == said
