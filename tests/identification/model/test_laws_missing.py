"""Which rows can show a cause at all, on both sides of what it takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from identification.model.effects.kinds import (
    NO_LOAD_OFF,
    NOTHING_HANGS,
    ONE_SIZE,
    ONE_TIME,
    ONLY_IN_MOTION,
    WEIGHT_IS_KNOWN,
    hanging,
)
from identification.model.law_of import known
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame
from tests.support import random_poses, robot

DOWN, X, Y = (0.0, 0, -1), (1.0, 0, 0), (0.0, 1, 0)


def rows(*visits: Sequence[float], along: Sequence[Sequence[float]] = (DOWN,), dwell: float | None = None,
         reference: Sequence[int] | None = None) -> LoadState:
    """Loads [N] at one pose after the other, along directions that come in turns, one a row."""
    arm, visit = robot("irb6700-200-2.60"), np.repeat(np.arange(len(visits)), list(map(len, visits)))
    size = np.concatenate([np.array(sizes, dtype=float) for sizes in visits])
    way = np.array([along[k % len(along)] for k in range(len(size))])
    wrench = np.column_stack([size[:, None] * way / np.linalg.norm(way, axis=1, keepdims=True), np.zeros((len(size), 3))])
    theta = random_poses(arm, len(visits), np.random.default_rng(4), 0.6)[visit]
    state = load_state(arm, Frame.identity(), theta, wrench, 1 / arm.prior.stiffness)
    times = np.full(len(size), np.nan if dwell is None else dwell)
    return replace(state, visit=visit, dwell=times, reference=np.zeros(len(size), dtype=int) if reference is None
                   else np.array(reference)[visit])


def leaning(share: float) -> tuple[float, float, float]:
    return share, 0.0, -np.sqrt(1 - share**2)


SEATING, AXES = "there is one pose alone", "the loads are not along the axes of the base"
OTHERS, WEIGHTS = "no weights hang beside other loads", "hung loads hang plumb"
SIZES = "loads are not of three sizes and a few more, each at two poses"
LADDER, SET = (0, 100, 200, 300), ((0, 100, 200, 300), (0, 300, 200, 100))


@pytest.mark.parametrize(("name", "seen", "state"), [
    ("load_friction", NO_LOAD_OFF, rows(LADDER)), ("load_friction", NO_LOAD_OFF, rows((0, 100, 300, 0))),
    ("load_friction", "", rows((0, 100, 300, 200))), ("load_friction", NO_LOAD_OFF, rows((100, 98, 99, 97))),
    ("load_friction", "", rows((100, 96))), ("load_friction", NO_LOAD_OFF, rows((0, 300), (0, 200))),
    ("load_friction", NO_LOAD_OFF, rows((300, 200), along=(X, Y))),
    ("load_friction.seal", NO_LOAD_OFF, rows(LADDER)), ("load_friction.seal", NO_LOAD_OFF, rows((0, 0, 100, 200))),
    ("load_friction.seal", "", rows((0, 100, 0))), ("load_friction.seal", NO_LOAD_OFF, rows((0, 0, 0))),
    ("sensor_step.seating", SEATING, rows((0, 100, 0))), ("sensor_step.seating", "", rows((0, 100, 0), (0, 0))),
    ("sensor_step.seating", SEATING, rows((0, 0), (0, 0))),
    ("hook_offset", "", rows((100, 200, 300, 0, 100), along=(DOWN, DOWN, DOWN, DOWN, X))),
    ("hook_offset", NOTHING_HANGS, rows((100, 200, 0, 100), along=(DOWN, DOWN, DOWN, X))),
    ("hook_offset", NOTHING_HANGS, rows((0, 0))),
    ("hook_offset", "", rows((100, -100), along=(leaning(0.9e-3),))),
    ("hook_offset", NOTHING_HANGS, rows((100,), along=(leaning(1.1e-3),))),
    ("tool_point.base", "tool", rows(LADDER)), ("force_misalignment.pulley", WEIGHTS, rows(LADDER)),
    ("force_misalignment.pulley", "", rows(LADDER, along=(X,))),
    ("force_misalignment.hung", OTHERS, rows(LADDER)), ("force_misalignment.hung", OTHERS, rows(LADDER, along=(X,))),
    ("force_misalignment.hung", "", rows(LADDER, along=(X, DOWN))),
    ("force_curve", ONE_SIZE, rows((0, 100, 119))),
    ("force_curve", "", rows((0, 100, 120))),
    ("force_curve", ONE_SIZE, rows((0,))),
    ("force_curve.pull", "", rows((100, -100), along=(X,))),
    ("force_curve.pull", "no axis is loaded both ways", rows((100, 0))),
    ("force_curve.pull", AXES, rows((100, -100), along=((1, 0, 0.18),))),
    ("force_curve.pull", "", rows((100, -100), along=((1, 0, 0.17),))),
    ("load_leak", ONE_TIME, rows(LADDER)), ("load_leak", ONE_TIME, rows(LADDER, dwell=8.0)),
    ("hook_weight", ONE_SIZE, rows((0, 95.1, 100))),
    ("hook_weight", "", rows((0, 94.9, 100))),
    ("hook_weight", ONE_SIZE, rows((0,))),
    ("hook_weight.disc", NOTHING_HANGS, rows(LADDER, along=(X,))), ("hook_weight.disc", ONE_SIZE, rows((0, 100, 100))),
    ("hook_weight.disc", ONE_SIZE, rows((0, 4, 5, 100))), ("hook_weight.disc", "", rows((0, 100, 200))),
    ("hook_weight.one_size", "", rows(*SET)), ("hook_weight.one_size", SIZES, rows(LADDER)),
    ("hook_weight.one_size", SIZES, rows((0, 100, 200), (0, 200, 100))),
    ("hook_weight.one_size", "", rows((100, 200, 300), (101.9, 203, 305))),
    ("hook_weight.one_size", SIZES, rows((100, 200, 300, 101.5, 103), (100, 200, 300))),
    ("hook_weight.one_size", "", rows(tuple(range(100, 1300, 100)), (100,))),
    ("hook_weight.one_size", SIZES, rows(tuple(range(100, 1400, 100)), (100,))),
    ("hysteresis.seats", "", rows((0, 300, 200), (0, 300))),
    ("hysteresis.seats", "there are too few poses", rows((0, 300, 200))),
    ("hysteresis.seats", NO_LOAD_OFF, rows((0, 200, 300), (0, 300))),
    ("hysteresis.seats", NO_LOAD_OFF, rows((300, 241), (300,))),
    ("hysteresis.seats", "", rows((300, 239), (300,))),
    ("lost_motion", NO_LOAD_OFF, rows(LADDER)), ("lost_motion", "", rows((0, 900, 300, 0, -900, 0, 900, 0))),
    ("gear_softening.from", "there are no two poses behind the first", rows((0,), (1,))),
    ("gear_softening.from", "", rows((0,), (1,), (2,))),
    ("transmission_error", ONLY_IN_MOTION, rows(*7 * [(0, 1)], (0,), reference=(*7 * [0], 1))),
    ("transmission_error", "", rows(*8 * [(0, 1)], (0,), reference=(*8 * [0], 1))),
    ("encoder_zero", "the reference was taken anew at every pose", rows((0, 1), (0, 1), reference=(0, 1))),
    ("encoder_zero", "", rows((0, 1), (0, 1), reference=(0, 0)))])
def test_rows_show_a_cause_or_say_why_not(name: str, seen: str, state: LoadState) -> None:
    law = known(name)
    assert law is not None
    assert law.missing(state).startswith(seen) or seen == "tool"
    assert bool(law.missing(state)) == bool(seen)
    if not seen:
        assert any(law.signatures(state, joint) for joint in law.places)


@pytest.mark.parametrize(("longer", "seen"), [(1.29, ONE_TIME), (1.31, "")])
def test_a_load_leaks_that_was_on_for_times_unlike_each_other(longer: float, seen: str) -> None:
    law = known("load_leak")
    assert law is not None
    state = rows((0, 100, 200), dwell=8.0)
    assert law.missing(replace(state, dwell=np.array([900.0, 8.0, 8.0 * longer]))) == seen
    assert law.missing(replace(state, dwell=np.array([900.0, np.nan, 0.0]))) == ONE_TIME


def test_a_weight_is_unknown_where_the_file_has_no_links() -> None:
    state, law = rows(LADDER), known("backlash.wrist")
    assert law is not None
    assert law.missing(state) == ""
    heavy = replace(state.robot, link_mass=np.ones(6), link_centre=np.zeros((6, 3)))
    assert law.missing(replace(state, robot=heavy)) == WEIGHT_IS_KNOWN


def test_a_load_hangs_that_is_plumb_whichever_way_the_base_stands_and_none_does_without_a_load() -> None:
    state = rows((100, 100, 0, -100), along=(X, DOWN, X, X))
    assert hanging(replace(state, fall=np.array([-9.81, 0, 0]))).tolist() == [True, False, False, True]
    assert hanging(state).tolist() == [False, True, False, False]
