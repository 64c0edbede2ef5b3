"""A program of long moves has few targets; its log, by whatever tells the places, has what lies between them. And a tool that
yields has cut below its level when it comes by again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import compstiff
from compensator.cutting.removal import mill_through
from compensator.cutting.stock import MOST_LAYERS, more_layers
from identification.model.stiffness import IdentifiedModel
from tests.compensator.cutting.milled import FLAT, block, force_of, track_along
from tests.support import long
from tests.virtual_cell.endmill import EndMill

CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
force_log: {frame: base, sign: on_tool, spindle_rpm: 9000}
cutting: {tool_diameter_mm: 16, teeth: 3, material: aluminium}
"""
STOCK = "box: {from_mm: [1000, -100, 580], to_mm: [1120, 100, 600]}\nposition_std_mm: 0.01\n"
LEFT, RIGHT, DEEP, RATE = 985.0, 1135.0, 3.0, 200.0
# Where each pass is [mm], and its feed [mm/s]; between slots there is stock.
PASSES = {-70.0: 18.0, -35.0: 36.0, 0.0: 54.0, 35.0: 36.0, 70.0: 18.0}


def job(folder: Path, by: str, passes: dict[float, float] | None = None, right: float = RIGHT) -> tuple[Path, Path]:
    """Slots to and fro by one MoveL each, and their log: the mean force of the end mill where its axis is over the block."""
    rng, moves, rows = np.random.default_rng(3), [], []
    place, count, time = np.array([LEFT, -70.0, 630.0]), 0, 0.0

    def go(x: float, y: float, z: float, feed: float, force: np.ndarray | None = None) -> None:
        nonlocal place, count, time
        end = np.array([x, y, z])
        moves.append(f"MoveL [[{x},{y},{z}],[0,0,1,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[{feed:g},500,5000,1000],fine,"
                     "tSpindle\\WObj:=wobj0;")
        for share in np.arange(0, 1, feed / RATE / max(np.linalg.norm(end - place), 1e-9)):
            at = place + share * (end - place)
            cuts = force is not None and 1000 < at[0] < 1120
            shown = (force if cuts else np.zeros(3)) + rng.normal(0, 2, 3)
            target = count if share > 0.5 else max(count - 1, 0)
            where = ",".join(f"{x:.3f}" for x in at) if by == "position" else str(target)
            rows.append(f"{time:.4f},{where}," + ",".join(f"{x:.3f}" for x in shown))
            time += 1 / RATE
        place, count = end, count + 1

    go(*place, 200.0)
    go(LEFT, -70.0, 625.0, 200.0)
    for number, (y, feed) in enumerate((passes or PASSES).items()):
        mill = EndMill(runout_mm=(0.0, 0.0, 0.0), feed_mm_s=feed)
        along, left, up = mill.mean_force(mill.coverage(np.full(len(mill.rim_mm), 10.0)), DEEP)
        way = 1 if number % 2 == 0 else -1
        go(place[0], y, 620.0, 200.0)
        go(place[0], y, 600 - DEEP, 200.0)
        go(right if way > 0 else LEFT, y, 600 - DEEP, feed, np.array([way * along, way * left, up]))
        go(place[0], y, 620.0, 200.0)
    head = ('PERS tooldata tSpindle:=[TRUE,[[120,0,250],[1,0,0,0]],[80,[0,0,120],[1,0,0,0],0,0,0]];\nPROC main()\n')
    program, log = folder / "slots.mod", folder / "forces.csv"
    program.write_text(f"MODULE Slots\n{head}" + "\n".join(moves) + "\nENDPROC\nENDMODULE\n")
    log.write_text(f"time_s,{'x_mm,y_mm,z_mm' if by == 'position' else 'target'},fx_n,fy_n,fz_n\n" + "\n".join(rows) + "\n")
    return program, log


def coefficients(folder: Path, program: Path, log: Path, stiffness: float) -> compstiff.FittedCoefficients:
    """On an arm of these springs [N m/rad]."""
    (folder / "cell.yaml").write_text(CELL)
    (folder / "stock.yaml").write_text(STOCK)
    cell = compstiff.read_cell(folder / "cell.yaml")
    springs = IdentifiedModel(cell.robot, cell.flange_from_tcp, -np.log(np.full(6, stiffness)), np.eye(6) * 1e-4)
    return compstiff.cutting_coefficients(cell, compstiff.read_toolpath(program, cell), folder / "stock.yaml", springs, log,
                                          compstiff.Settings.of(tare=((0, 1),)))


@pytest.mark.parametrize("by", ["position", long("target")])
def test_five_slots_by_ten_targets_tell_the_coefficients(tmp_path: Path, by: str) -> None:
    """At three feeds, on an arm that hardly yields: the force of a slot within 2 %, and what is said holds."""
    found = coefficients(tmp_path, *job(tmp_path, by), 1e9)
    assert found.posterior is not None
    assert len(found.posterior.residual) > 60
    mill = EndMill()
    truth = np.array([*(1e6 * np.array(mill.shear_n_mm2)), *(1e3 * np.array(mill.edge_n_mm))])
    own, chips = found.coefficients.mean, np.array([0.04, 0.08, 0.12]) * 1e-3
    for k in range(2):          # the tangential and the radial force of a chip
        assert own[k] * chips + own[3 + k] == pytest.approx(truth[k] * chips + truth[3 + k], rel=0.02)
    off = own - truth
    assert np.all(np.abs(off) < 3 * found.coefficients.std)


def test_a_tool_that_is_lifted_out_of_a_slot_is_no_fast_move(tmp_path: Path) -> None:
    """It springs back by 0.1 mm while it is lifted, so that it scrapes along the wall."""
    found = coefficients(tmp_path, *job(tmp_path, "position", passes={-70.0: 18.0}, right=1080.0), 2e6)
    assert "CS4749" not in {finding.code for finding in found.findings}
    assert found.coefficients.chip == pytest.approx((0.04e-3, 0.04e-3), rel=0.02)


def over(level: float) -> np.ndarray:
    """Rows one way, each over two fifths of the one before, at a level [mm]."""
    legs: list[list[float]] = []
    for y in (-20.0, -10.0, 0.0, 10.0):
        legs += [[-80, y, 20], [-80, y, level], [80, y, level], [80, y, 20]]
    return np.array(legs)


@pytest.mark.parametrize("yields", [-0.3, long(-0.12), long(0.2)])
def test_what_was_cut_below_the_level_is_gone(yields: float) -> None:
    """A tool that stands off its level all the way cuts as one whose level that is."""
    low, high = (-60.0, -40.0, -20.0), (60.0, 40.0, 0.0)
    track = track_along(over(-4 + yields))
    planned, own = (block(low, high, (level,)) for level in (-4.0, -4 + yields))
    off = np.where(track.end[:, 2] < 0, 1e-3 * yields, 0.0)
    made = more_layers(planned, track.end[:, 2] - off, off, 0.05e-3)
    (told, left), (true, same), (before, thick) = (mill_through(stock, track, FLAT) for stock in (made, own, planned))
    truth = force_of(track, true)
    largest = np.linalg.norm(truth, axis=1).max()
    within = 0.03e-3 / 4e-3         # of the depth: half a step of the heights
    assert np.abs(force_of(track, told) - truth).max() < 1.5 * within * largest
    assert yields > 0 or np.abs(force_of(track, before) - truth).max() > 1.5 * within * largest
    assert left.volume == pytest.approx(same.volume, rel=2e-3)
    assert thick.volume != pytest.approx(same.volume, rel=2e-3)


def test_layers_stay_few_and_those_of_a_box_are_one() -> None:
    stock = block((-60.0, -40.0, -20.0), (60.0, 40.0, 0.0), (-4.0,))
    rng = np.random.default_rng(1)
    level = 1e-3 * rng.uniform(-19, -1, 200)
    more = more_layers(stock, level, 1e-3 * rng.uniform(-1, 1, 200), 0.05e-3)
    assert len(stock.inside) < len(more.inside) <= MOST_LAYERS
    assert more.inside.strides[0] == 0
    assert np.all(np.diff(more.height) > 0)
    assert more_layers(stock, 1e-3 * rng.uniform(-19, -1, 5000), np.full(5000, 1e-4), 0.05e-3) is stock
