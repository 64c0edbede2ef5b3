"""What a remedy gains is what a job says in which it was done: of small jobs on the independent arm's robot."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from compensator.correction import remedies as of_remedies
from compensator.correction.correct import Corrected, correct
from compensator.correction.cutting_prior import WIDTH
from compensator.correction.files import Inputs, predict_files
from compensator.correction.logged_pass import known_by_force
from compensator.correction.settings import Estimate, Settings
from identification.common.arrays import rms
from tests.compensator.correction.test_contract_told import sideways
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.user_files import Job

COUNT = 45
ALONG = 60.0 + np.arange(COUNT)


def forces(scatter: float, force: np.ndarray) -> str:
    """Nine samples a target whose mean is the force (n, 3) [N]."""
    off = np.random.default_rng(1).normal(0, 15, (COUNT, 9, 3))
    off -= off.mean(axis=1, keepdims=True)
    return "target,fx_n,fy_n,fz_n\n" + "".join(
        f"{k},{x:.12f},{y:.12f},{z:.12f}\n" for k in range(COUNT) for x, y, z in force[k] + scatter * off[k])


PUSH = np.column_stack([0.3 * ALONG, 2 * ALONG, -0.8 * ALONG])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Corrected]:
    """Corrects a job; of its springs `spread` times the covariance; cell: what else it states, settings: what is asked for."""

    def corrected(cell: str = "", scatter: float = 1.0, spread: float = 1.0, force: np.ndarray = PUSH, **settings: Any
                  ) -> Corrected:
        folder = tmp_path_factory.mktemp("job")
        Job(folder, cell=kit.cell_text(extra=cell), program=line(COUNT, 5).program(), forces=forces(scatter, force)).write()
        file = folder / "stiffness.json"
        held = json.loads(file.read_text())
        of_springs = held["log_compliance"]
        of_springs["covariance"] = (spread * np.array(of_springs["covariance"])).tolist()
        file.write_text(json.dumps(held))
        files = (folder / name for name in ("cell.yaml", "part.mod", "stiffness.json", "forces.csv"))
        return correct(predict_files(Inputs(*files), Settings.of(**settings)))

    return corrected


NO_CUT = {"cutting_stiffness": Estimate(0.0, 0.0)}
HALF = {"tolerance": 2.5e-6, "tighten_zones": True}


@pytest.mark.parametrize(("tried", "stated"), [
    (partial(of_remedies._known_sensor, gain_std=0.003), {"cell": "force_log: {gain_std: 0.003}\n"}),
    (of_remedies._scaled, {"scale": Estimate(1.0, 0.01)}), (of_remedies._more_tests, {"spread": 0.5}),
    (of_remedies._no_scatter, {"scatter": 0.0}), (partial(of_remedies._finer, tolerance=2.5e-6), HALF)],
    ids=["sensor", "scale", "tests", "scatter", "finer"])
def test_a_remedy_is_worth_what_a_job_says_in_which_it_was_done(
    made: Callable[..., Corrected], tried: Callable[[Corrected], np.ndarray], stated: dict[str, Any]
) -> None:
    """Beside a cut that is known exactly."""
    now, then = made(**NO_CUT), made(**NO_CUT, **stated)
    np.testing.assert_allclose(tried(now), then.left.std, rtol=1e-9)
    assert rms(then.left.std) < 0.99 * rms(now.left.std) or stated is HALF


FEED, LEFT, _ = sideways(line(COUNT, 5))
CLIMBS, SLOTS = np.outer(ALONG, 1.5 * FEED + 2 * LEFT), np.outer(ALONG, -FEED + 2 * LEFT)


@pytest.mark.parametrize(("tried", "stated", "force"), [
    (of_remedies._stated_depth, {"depth_of_cut": 0.75e-3}, CLIMBS), (of_remedies._stated_slots, {"slot_depth": 2e-3}, SLOTS)],
    ids=["a wall", "a slot"])
def test_a_depth_is_worth_what_a_job_says_in_which_it_was_stated(
    made: Callable[..., Corrected], tried: Callable[[Corrected], np.ndarray], stated: dict[str, Any], force: np.ndarray
) -> None:
    now, then = made(force=force), made(force=force, **stated)
    np.testing.assert_allclose(tried(now), then.left.std, rtol=1e-6)
    assert rms(then.left.std) < 0.9 * rms(now.left.std)


def test_the_next_pass_stands_off_by_what_this_one_leaves(made: Callable[..., Corrected]) -> None:
    """A force that stays along the path, and nothing known of its growth g but its size: |d| g / (1 + g) is left by it, with
    g in proportion to how far the tool of the logged pass stood off."""
    now = made(force=np.tile([30.0, 200.0, -80.0], (COUNT, 1)), scatter=0.0, cutting_stiffness=Estimate(0.0, 5e4))
    size, left = np.linalg.norm(now.predicted.prediction.position, axis=1), now.left
    grows = left.cut / (size - left.cut)
    then = grows * left.std / size
    others = left.std**2 - left.cut**2
    assert (grows > 0.05).all()
    np.testing.assert_allclose(of_remedies._next_pass(now), np.sqrt(others + (size * then / (1 + then)) ** 2), rtol=1e-6)


def test_a_known_cut_is_worth_what_a_stated_stiffness_is(made: Callable[..., Corrected]) -> None:
    """Of a cut that climbs everywhere: what the middle push tells at the depth that is taken, and a table's width of it."""
    now = made(force=CLIMBS, scatter=0.0)
    known = known_by_force(now.predicted)
    assert known is not None
    std = known.value * float(np.sqrt(np.exp(WIDTH**2) - 1))
    stated = made(force=CLIMBS, scatter=0.0, cutting_stiffness=Estimate(known.value, std))
    found = of_remedies._known_cut(now)
    assert found is not None
    np.testing.assert_allclose(found, stated.left.std, rtol=1e-6)
