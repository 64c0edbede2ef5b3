"""The milling of the virtual cell by the textbook and by laws: closed-form forces, balance, what the sensor sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.virtual_cell.cell import parse, simulate
from tests.virtual_cell.designs import Design
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import AIR, BLANK_X, PLACES, POCKET, SLOT, Part, slot_and_pocket, steps_of
from tests.virtual_cell.milling import (
    BASE_FROM_OBJECT,
    OBJECT_FROM_FLANGE,
    Commands,
    Pass,
    Sensor,
    angles,
    log_of,
    mill,
    planned,
    rapid,
    read_commands,
)
from tests.virtual_cell.plant import Plant

CUTTER = EndMill()
EVEN = EndMill(runout_mm=(0.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def plant() -> Plant:
    return simulate(3, "paper5", noise="none").plant


@pytest.fixture(scope="module")
def part() -> Part:
    return slot_and_pocket(spacing_mm=3.0)


@pytest.fixture(scope="module")
def milled(plant: Plant, part: Part) -> Pass:
    return mill(plant, part, planned(part), CUTTER, step_mm=1.0)


def test_a_full_slot_has_the_textbooks_mean_forces() -> None:
    """Altintas, Manufacturing Automation: N a / 4 of the cutting, N a / pi of the edge forces in the plane of the cut."""
    depth, chip = 2.0, EVEN.feed_mm_s / (EVEN.teeth * EVEN.turns_per_s)
    (ktc, krc, kac), (kte, kre, kae) = EVEN.shear_n_mm2, EVEN.edge_n_mm
    expected = EVEN.teeth * depth * np.array([-krc * chip / 4 - kre / np.pi, ktc * chip / 4 + kte / np.pi,
                                              -kac * chip / np.pi - kae / 2])
    everything = EVEN.coverage(np.ones(len(EVEN.edges)))
    assert EVEN.mean_force(everything, depth) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("cutter", [EVEN, CUTTER])
def test_the_mean_is_that_of_the_teeth_over_a_revolution(cutter: EndMill) -> None:
    coverage = cutter.coverage(5.0 - cutter.rim_mm[:, 1])
    turned = np.linspace(0, 2 * np.pi, 7200, endpoint=False)
    force = cutter.force(coverage, 4.0, turned)
    assert force.mean(axis=0) == pytest.approx(cutter.mean_force(coverage, 4.0), rel=1e-4)
    # The teeth are alike without run-out, and are not with it.
    a_tooth_later = np.roll(force, 2400, axis=0)
    assert np.allclose(a_tooth_later, force, atol=1e-6) is (cutter is EVEN)


def test_radial_engagement_is_the_circles_segment() -> None:
    for width in (0.1, 0.37, 1.5, 9.0):
        inside = -CUTTER.rim_mm[:, 1] - (CUTTER.radius_mm - width)       # stock to the right of the feed
        angle = CUTTER.coverage(inside).sum() * np.pi / (len(CUTTER.edges) - 1)
        assert angle == pytest.approx(np.arccos(1 - width / CUTTER.radius_mm), abs=2e-4)


def test_the_roughed_wall_stands_the_allowance_inside_the_planned_one(part: Part) -> None:
    """Where the cutter on its planned path generates the wall it finds the allowance, on straight stretches and on arcs."""
    steps = steps_of(part)
    wall = steps.between(part.target_mm)[:, :2] - 8.0 * steps.left[:, :2]
    depth = part.inside_mm(POCKET, wall)
    for place in ("straight wall", "arc"):
        rows = steps.place == PLACES.index(place)
        assert rows.sum() > 20
        # The path is chords of 3 mm on a radius of 12: a tenth of a millimetre inside.
        assert np.all(np.abs(depth[rows] - 1.5) < (0.11 if place == "arc" else 1e-9))


def test_more_targets_are_the_same_path(part: Part) -> None:
    middles = 0.5 * (part.target_mm[1:] + part.target_mm[:-1])
    more = np.insert(part.target_mm, np.arange(1, len(part.target_mm)), middles, axis=0)
    finer = part.with_targets(more)
    before, after = steps_of(part, 0.5, 0.5), steps_of(finer, 0.5, 0.5)
    for feature in (AIR, SLOT, POCKET):
        lengths = [steps.length_mm[steps.feature == feature].sum() for steps in (before, after)]
        assert lengths[0] == pytest.approx(lengths[1], rel=1e-9)
    with pytest.raises(ValueError, match="not on the planned path"):
        part.with_targets(more + np.array([0.0, 0.01, 0.0]))


def test_arm_and_cut_are_in_balance(plant: Plant, part: Part, milled: Pass) -> None:
    """Where the tool is said to stand is where the load tests' plant puts it under that force."""
    cut = np.flatnonzero(milled.cutting)[::25]
    turns = Rotation.concatenate([OBJECT_FROM_FLANGE] * len(cut))
    theta = angles(Commands(milled.commanded_mm[cut], turns), plant)
    force = BASE_FROM_OBJECT.apply(milled.force_n[cut])
    count = len(cut)
    moved, _ = plant.displacement(Design(theta, force, np.zeros(count), np.zeros(count), np.arange(count),
                                         np.zeros(count, dtype=bool)))
    assert count >= 15
    assert 1e6 * BASE_FROM_OBJECT.apply(moved, inverse=True) == pytest.approx(milled.off_um[cut], abs=1e-3)


def test_a_tool_that_yields_from_the_wall_cuts_less(part: Part, milled: Pass) -> None:
    stiff = mill(Plant(np.full(6, 1e12)), part, planned(part), CUTTER, step_mm=1.0)
    wall = milled.steps.place == PLACES.index("straight wall")
    away = np.einsum("si,si->s", milled.off_um, milled.steps.left)[wall]
    force = [np.linalg.norm(one.force_n[wall], axis=1) for one in (milled, stiff)]
    assert np.abs(stiff.off_um).max() < 0.01
    assert np.all(away > 10)
    assert np.all(force[0] < force[1])


def test_gears_remember_the_way(plant: Plant, part: Part) -> None:
    """Friction in gear 1: the same force does not give the same displacement on the way up and down. In air nothing shows."""
    rough = simulate(3, "paper5", parse("gear_friction:1"), noise="none").plant
    steps = len(steps_of(part, 1.0).segment)
    push = np.zeros((steps, 3))
    push[:, 1] = 300 * np.sin(np.linspace(0, np.pi, steps))
    loop = [mill(one, part, planned(part), CUTTER, given_n=push, step_mm=1.0).off_um[:, 1] for one in (plant, rough)]
    lag = np.abs(loop[1] - loop[0])
    assert lag[-1] > 5
    assert lag[:3].max() < 0.2 * lag.max()
    still = mill(rough, part, planned(part), CUTTER, given_n=0 * push, step_mm=1.0)
    assert np.abs(still.off_um).max() < 1e-4


def test_the_log_shows_the_pass(part: Part, milled: Pass) -> None:
    """Without its errors the sensor's mean over a stretch of many revolutions is the mean force there."""
    clean = replace(Sensor(), bias_n=(0, 0, 0), drift_n_min=(0, 0, 0), noise_n=0.0, gain=1.0, quantum_n=1e-9,
                    place_noise_mm=0.0)
    log = log_of(milled, part, planned(part), CUTTER, clean, np.random.default_rng(0))
    force = (OBJECT_FROM_FLANGE * clean.turn).apply(log.force_n)
    slot = np.abs(log.position_mm[:, 0]) < 30
    slot &= np.isclose(log.position_mm[:, 1], 50.0) & (log.position_mm[:, 2] < 0)
    rows = (milled.steps.place == PLACES.index("slot")) & (np.abs(milled.commanded_mm[:, 0]) < 30)
    assert slot.sum() > 3000
    assert force[slot].mean(axis=0) == pytest.approx(milled.force_n[rows].mean(axis=0), rel=0.01)
    # Over whole revolutions it is still: filtered over three of them the mean is left.
    still = (OBJECT_FROM_FLANGE * clean.turn).apply(log.averaged(40).force_n)[slot][100:-100]
    assert np.ptp(still, axis=0).max() < 0.05 * np.abs(force[slot]).max()
    # The ripple of single teeth is there, half as large as the mean at least.
    assert np.ptp(force[slot][:, 1]) > 0.5 * np.abs(force[slot][:, 1].mean())
    # A tooth passes 450 times a second: the log resolves that.
    spectrum = np.abs(np.fft.rfft(force[slot][:, 1] - force[slot][:, 1].mean()))
    peak = np.fft.rfftfreq(int(slot.sum()), 1 / clean.rate_hz)[np.argmax(spectrum)]
    assert peak == pytest.approx(450, abs=2) or peak == pytest.approx(150, abs=2)


def test_the_log_begins_where_the_tool_touches(plant: Plant, part: Part) -> None:
    """The cutter's rim reaches the blank a radius before its edge, wherever the steps of the pass stand."""
    quiet = Sensor(noise_n=0.0, bias_n=(0.0, 0.0, 0.0), drift_n_min=(0.0, 0.0, 0.0), quantum_n=1e-6, place_noise_mm=0.0)
    for step_mm in (0.55, 0.95):
        done = mill(plant, part, planned(part), CUTTER, step_mm=step_mm)
        log = log_of(done, part, planned(part), CUTTER, quiet, np.random.default_rng(1))
        cut = np.flatnonzero(np.linalg.norm(log.force_n, axis=1) > 1.0)
        assert log.position_mm[cut[0], 0] == pytest.approx(BLANK_X[0] - CUTTER.radius_mm, abs=0.125 * step_mm + 0.05)


def test_the_program_reads_back(plant: Plant, part: Part) -> None:
    text = rapid(part, angles(planned(part), plant), CUTTER, (120.0, 0.0, 250.0), plant.object_m)
    commands = read_commands(text)
    assert np.array_equal(commands.position_mm, part.target_mm)
    assert np.all((commands.turn * OBJECT_FROM_FLANGE.inv()).magnitude() < 1e-7)
