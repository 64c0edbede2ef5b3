"""Offsets of a logged pass between the targets of the planned program."""

from __future__ import annotations

import numpy as np

from compensator.correction.sent_offsets import SentOffsets, places_of

# Targets at 0, 10, 110 and 120 mm; none of them has an offset, and two were added to the long move that have one.
LENGTH = np.array([0.0, 0.010, 0.110, 0.120])
SENT = SentOffsets(np.array([0.0, 1.0, 1.05, 1.95, 2.0, 3.0]),
                   1e-3 * np.array([[0, 0, 0], [0, 0, 0], [0, 1.2, 0], [0, 1.0, 0], [0, 0, 0], [0, 0, 0]]))


def test_a_mean_force_is_that_of_the_offsets_over_its_half_ways() -> None:
    """By the rectangle rule over the path; a target without an added one in reach has its own."""
    found = SENT.at_targets(LENGTH)
    way = np.linspace(0, 0.120, 240_001)
    place = np.interp(way, LENGTH, np.arange(4.0))
    dense = np.column_stack([np.interp(place, SENT.place, axis) for axis in SENT.offset.T])
    for target, (start, end) in {1: (0.005, 0.060), 2: (0.060, 0.115)}.items():
        inside = (way > start) & (way < end)
        assert np.abs(found[target] - dense[inside].mean(axis=0)).max() < 1e-7
    assert found[1, 1] > 0.9e-3
    assert not found[[0, 3]].any()


def test_between_the_targets_they_are_those_of_the_added_ones() -> None:
    kept, length = np.array([0, 1, 5, 6]), np.array([0.0, 0.010, 0.015, 0.060, 0.105, 0.110, 0.120])
    place = places_of(kept, length)
    assert np.allclose(place, [0, 1, 1.05, 1.5, 1.95, 2, 3])
    assert np.allclose(SENT.at(place)[:, 1], 1e-3 * np.array([0, 0, 1.2, 1.1, 1.0, 0, 0]))
    # Of a part of the program the same; a target whose move is not of it brings none.
    part = SENT.of(np.array([1, 2]))
    assert np.allclose(part.place, [0, 0.05, 0.95, 1])
    assert np.allclose(SENT.of(np.array([0, 2])).place, [0, 1])
    assert np.allclose(SENT.without_added().place, np.arange(4))
