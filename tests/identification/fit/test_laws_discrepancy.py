"""How far a named effect's real law may be off the dictionary's: by shares of its own size."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.fit.discrepancy import discrepancies, other_ways
from identification.fit.fitted_model import Term
from identification.model.effects import effects
from identification.model.law_of import known, stiffening_ways
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame
from tests.support import random_poses, robot

# The prior of a parameter is this many of its scale wide.
WIDE = 5.0


@pytest.fixture(scope="module")
def rows() -> LoadState:
    arm, rng = robot("irb6700-200-2.60"), np.random.default_rng(3)
    wrench = np.concatenate([rng.uniform(-300, 300, (6, 3)), np.zeros((6, 3))], axis=1)
    return load_state(arm, Frame(np.eye(3), np.array([0.1, 0.0, 0.25])), random_poses(arm, 6, rng, 0.6), wrench,
                      1 / arm.prior.stiffness)


def term(name: str, joint: int | None, rows: LoadState, share: float) -> Term:
    """So large a share of its typical size."""
    law = known(name)
    assert law is not None
    typical, neutral = law.typical(rows, joint), law.neutral(rows)
    start = np.array([value if parameter.shape else nothing + share * (value - nothing) for value, nothing, parameter in zip(
        typical, neutral, law.parameters, strict=True)])
    return Term(law, joint, start, typical, neutral)


def test_a_gear_s_law_may_have_each_shape_by_three_tenths_of_its_size(rows: LoadState) -> None:
    """A softer zone of 40 % of its usual size: 12 % of that of each shape, none beforehand."""
    (free,) = discrepancies(rows, (term("soft_zone", 2, rows, 0.4),))
    assert (free.effect.name, free.joint) == ("law_of_soft_zone", 2)
    assert_allclose(free.scale, 0.12 / WIDE)
    assert not free.start.any()
    assert not free.neutral.any()
    assert len(free.scale) == len(free.effect.parameters) == 6
    nothing = discrepancies(rows, (term("soft_zone", 2, rows, 0.0),))
    assert_allclose(nothing[0].scale, 0.3e-6 / WIDE)


def test_a_structure_may_stiffen_by_fifteen_hundredths_in_each_way(rows: LoadState) -> None:
    bent = term("link_bending", 2, rows, 2.0)
    (free,) = discrepancies(rows, (bent,))
    assert_allclose(free.scale, 2.0 * 0.15 / WIDE)
    assert len(free.scale) == 18
    tilted = term("base_rocking.lifting", None, rows, 1.0)
    (free,) = discrepancies(rows, (tilted,))
    shapes = len(free.scale) - 18
    assert_allclose(free.scale, np.repeat([0.3, 0.15], [shapes, 18]) / WIDE)
    assert shapes > 1
    # In the noise, where they are not fitted, they are as large as the structure is.
    sight: Any = type("Sight", (), {"whitened": staticmethod(lambda moved: 1e6 * moved)})
    moved = bent.contribution(rows, bent.start)[:, :3]
    assert_allclose(other_ways(rows, sight, (term("soft_zone", 2, rows, 1.0), bent)), 1e6 * 0.15 * stiffening_ways(rows, moved))


def test_a_sensor_s_struts_have_their_ways_whole(rows: LoadState) -> None:
    """Three of its own, each 1 sigma as they stand, then those of a structure."""
    whole = term("force_sensor_compliance", None, rows, 1.0)
    (free,) = discrepancies(rows, (whole,))
    size = free.scale * WIDE
    shapes = len(size) - 3 - 18
    assert_allclose(size, np.repeat([0.3, 1.0, 0.15], [shapes, 3, 18]))
    sight: Any = type("Sight", (), {"whitened": staticmethod(lambda moved: moved)})
    ways = other_ways(rows, sight, (whole,))
    assert ways.shape == (6, 3, 18 + 3)
    assert_allclose(ways[:, :, 18:], whole.effect.further_ways(rows, None, whole.start)[:, :3])
    assert other_ways(rows, sight, ()).shape == (6, 3, 0)


def test_axes_that_are_off_each_by_itself_may_be_off_together(rows: LoadState) -> None:
    """Gains of 3 and 4 % against the third axis: 3 % of all of them in common, which no row shows. A law that is certain
    leaves nothing else."""
    law = effects()["force_axis_gain"]
    gains = Term(law, None, np.array([0.03, 0.04]), law.typical(rows, None), law.neutral(rows))
    (common,) = discrepancies(rows, (gains,))
    assert (common.effect.name, common.joint) == ("force_gain", None)
    assert_allclose(common.scale, 0.6 * 0.05 / WIDE)
    assert_allclose(common.start, common.neutral)
    assert discrepancies(rows, (term("force_gain", None, rows, 1.0),)) == ()


def test_a_weight_that_was_searched_is_carried_with_the_law(rows: LoadState) -> None:
    wrist = term("backlash.wrist", 5, rows, 1.0)
    wrist = Term(wrist.effect, 5, np.append(wrist.start[:-1], 333.0), wrist.scale, wrist.neutral)
    (free,) = discrepancies(rows, (wrist,))
    assert free.start[-1] == 333.0
    assert not free.start[:-1].any()
