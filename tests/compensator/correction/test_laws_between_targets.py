"""What is across the planned curve between targets: on an arc its tangent is along it, and none of the rest is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from compensator.correction.between_targets import _across
from tests.runs.command_line.user_files import Rotation


def test_along_an_arc_nothing_is_across_and_all_else_is() -> None:
    """An arc far from the origin, in a part that stands otherwise at each target: its tangent by the derivative."""
    rng = np.random.default_rng(41)
    angle, turn = np.linspace(0.0, 1.2, 25), Rotation.random(25, random_state=rng)
    plane = Rotation.random(random_state=rng).as_matrix()
    arc = [1.0, -2.0, 0.5] + 0.1 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]) @ plane.T
    tangent = np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle]) @ plane.T
    points = np.array([1, 2, 7, 11, 23])
    path: Any = SimpleNamespace(rest_from_tcp=SimpleNamespace(position=arc), axes=SimpleNamespace(
        turned_to_base=lambda vectors, rows: turn[rows].apply(vectors)))
    along, off = turn[points].apply(tangent[points]), rng.normal(size=(5, 3))
    np.testing.assert_allclose(_across(along, path, points), 0.0, atol=1e-12)
    across = np.cross(along, np.cross(off, along))
    np.testing.assert_allclose(_across(off, path, points), across, atol=1e-12)
