"""The dictionary of effects: its columns are what the effects in force do, whichever way they are asked for."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis.dictionary import Dictionary, dictionary_of
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel, noise_model
from identification.model.effects import effects
from identification.model.load_state import LoadState
from tests.identification.fit.test_laws_posterior import simulate


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[LoadState, NoiseModel, Dictionary]:
    """All effects, in six poses with five loads each, a quarter of a minute apart."""
    cell, rows = simulate(tmp_path_factory.mktemp("dictionary"), np.random.default_rng(3), poses=6, loads=5)
    count = len(rows)
    data = LoadTest.of(cell, replace(rows, time=15.0 * np.arange(count), dwell=np.full(count, 10.0)))
    state, noise = data.load_state(1 / cell.prior.stiffness), noise_model(data, 1 / cell.prior.stiffness)
    return state, noise, dictionary_of(state, noise, effects())


def test_columns_are_what_a_term_with_their_coefficients_does(made: tuple[LoadState, NoiseModel, Dictionary]) -> None:
    """As the rows see it, in typical sizes; of a hundredth of these all that an effect does is in proportion to them."""
    state, noise, dictionary = made
    rng, off = np.random.default_rng(5), {}
    for s in range(len(dictionary.signatures)):
        width = int(dictionary.widths[s])
        coefficients = 0.01 * rng.uniform(0.5, 1.5, width)
        term = dictionary.term(state, s, np.append(coefficients, np.zeros(6 - width)))
        entry = dictionary.entries[dictionary.entry_of[s]]
        assert (term.joint, term.effect.name) == (entry.joint, entry.effect.name)
        assert s in entry.signatures
        columns = dictionary.of(s)
        assert columns.shape == (len(state), 3, width)
        does = noise.whitened(term.contribution(state, term.start)[:, :3, None])
        told = columns @ coefficients
        off[s] = np.linalg.norm(does[:, :, 0] - told) / max(float(np.linalg.norm(told)), 1e-12)
    # A rod that carries less is told by a chord as well; what no load of these tells from springs has no columns.
    for s, value in off.items():
        effect = dictionary.signatures[s].effect
        assert value < 0.05 or effect.stored == "parallelogram" or (
            effect.name == "hysteresis" and not dictionary.of(s).any()), effect.stored


def test_it_holds_each_effect_at_each_of_its_places_or_says_why_not(made: tuple[LoadState, NoiseModel, Dictionary]) -> None:
    state, _, dictionary = made
    offered = [(effect.name, joint) for effect in effects().values() if not effect.missing(state) for joint in effect.places]
    assert [(entry.effect.name, entry.joint) for entry in dictionary.entries] == offered
    assert dictionary.left_out == {name: effect.missing(state) for name, effect in effects().items() if effect.missing(state)}
    assert dictionary.left_out
    place = 0
    for entry in dictionary.entries:
        assert entry.signatures == range(place, place + len(entry.signatures))
        place = entry.signatures.stop
    assert place == len(dictionary.signatures) == len(dictionary.widths)


def test_laws_are_alike_beforehand_and_the_shapes_of_each(made: tuple[LoadState, NoiseModel, Dictionary]) -> None:
    _, _, dictionary = made
    several = 0
    for entry in filter(lambda entry: entry.signatures, dictionary.entries):
        share: dict[str, list[float]] = {}
        for s in entry.signatures:
            share.setdefault(dictionary.signatures[s].effect.stored, []).append(float(np.exp(dictionary.log_share[s])))
        several += len(share) > 1
        for each in share.values():
            assert sum(each) == pytest.approx(1 / len(share))
            assert each == pytest.approx([each[0]] * len(each))
    assert several


def test_a_part_of_it_is_the_same_signatures_by_other_numbers(made: tuple[LoadState, NoiseModel, Dictionary]) -> None:
    _, _, dictionary = made
    chosen = [k for k, entry in enumerate(dictionary.entries) if entry.label in ("bearing_tilt[2]", "tool_play", "backlash[3]")]
    part = dictionary.part(chosen[::-1])
    assert [entry.label for entry in part.entries] == [dictionary.entries[k].label for k in chosen[::-1]]
    for k, entry in zip(chosen[::-1], part.entries, strict=True):
        for mine, s in zip(entry.signatures, dictionary.entries[k].signatures, strict=True):
            np.testing.assert_array_equal(part.of(mine), dictionary.of(s))
            assert part.positive[mine] == dictionary.positive[s]
            assert part.amplitude(mine) == dictionary.amplitude(s) == dictionary.signatures[
                dictionary.entries[k].signatures.start].scale[0]
    places = np.concatenate([columns.ravel() for _, columns in dictionary.alike])
    assert sorted(places.tolist()) == list(range(dictionary.columns.shape[2]))
    for some, columns in dictionary.alike:
        for s, own in zip(some, columns, strict=True):
            np.testing.assert_array_equal(dictionary.columns[:, :, own], dictionary.of(s))


def test_the_nearest_signature_of_a_term_is_its_own(made: tuple[LoadState, NoiseModel, Dictionary]) -> None:
    """Of effects that are bound to a row or a pose that which is bound there; of others under a weight the nearest weight."""
    state, _, dictionary = made
    bound = 0
    for k, entry in enumerate(dictionary.entries):
        for s in list(entry.signatures)[::7]:
            term = dictionary.term(state, s, np.ones(6))
            found = dictionary.nearest(k, term.effect, term.start)
            assert dictionary.signatures[found].effect.where == term.effect.where
            assert dictionary.signatures[found].weight == dictionary.signatures[s].weight
            bound += bool(term.effect.where)
            if term.effect.where:
                np.testing.assert_array_equal(dictionary.shapes(k, s), dictionary.of(s))
    assert bound


@pytest.mark.parametrize(("weight", "members"), [(0.0, [0, 1]), (100.0, [0, 1, 2, 3]), (119.0, [0, 1, 3, 4])])
def test_shapes_beside_a_named_one_are_those_without_weight_or_under_nearly_its_own(weight: float, members: list[int]) -> None:
    """Weights that differ by less than a factor of 1.2 are one: of its own signatures and of the laws near it, at its joint."""
    weights = [0.0, 0.0, 90.0, 115.0, 130.0, 0.0, 100.0]
    play: Any = SimpleNamespace(effect=SimpleNamespace(name="play", near_laws=("soft",)), joint=1, signatures=range(3))
    soft: Any = SimpleNamespace(effect=SimpleNamespace(name="soft"), joint=1, signatures=range(3, 5))
    other: Any = SimpleNamespace(effect=SimpleNamespace(name="soft"), joint=2, signatures=range(5, 6))
    further: Any = SimpleNamespace(effect=SimpleNamespace(name="tilt"), joint=1, signatures=range(6, 7))
    signatures: Any = tuple(SimpleNamespace(weight=each, effect=SimpleNamespace(where={})) for each in [*weights, weight])
    columns = np.arange(8.0)[None, None, :] * np.ones((2, 3, 1))
    ones = np.ones(8, dtype=np.intp)
    dictionary = Dictionary((play, soft, other, further), signatures, columns, ones, ones > 0, {})
    assert dictionary.shapes(0, 7)[0, 0].tolist() == members
    assert dictionary.unweighed(play) == [0, 1]
    laws: Any = tuple(SimpleNamespace(joint=joint, effect=SimpleNamespace(gear_law=law)) for joint, law in (
        (1, True), (2, True), (1, False)))
    assert replace(dictionary, entries=laws).gear_laws(1) == [0]


def test_it_is_made_once_for_a_state_and_who_sees_it(made: tuple[LoadState, NoiseModel, Dictionary]) -> None:
    state, noise, _ = made
    catalogue = {name: effects()[name] for name in ("drift", "base_rocking")}
    first = dictionary_of(state, noise, catalogue)
    assert dictionary_of(state, noise, catalogue) is first
    assert dictionary_of(state, noise, dict(catalogue)) is not first
    assert dictionary_of(state, replace(noise), catalogue) is not first
