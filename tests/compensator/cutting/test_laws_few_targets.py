"""A program of long moves has few targets; its log, by whatever tells the places, has what lies between them. And a tool that
yields has cut below its level when it comes by again."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import compstiff
from compensator.cutting.materials import coefficients_of
from compensator.cutting.posterior import ForceRows, fit_coefficients
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


def job(
    folder: Path, by: str, passes: dict[float, float] | None = None, right: float = RIGHT, levels: int = 1,
) -> tuple[Path, Path]:
    """Slots to and fro by one MoveL each, and their log: the mean force of the end mill where its axis is over the block. On
    so many levels, each as deep."""
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
            rows.append(f"{where}," + ",".join(f"{x:.3f}" for x in shown))
            if by != "target alone":
                rows[-1] = f"{time:.4f},{rows[-1]}"
            time += 1 / RATE
        place, count = end, count + 1

    go(*place, 200.0)
    go(LEFT, -70.0, 625.0, 200.0)
    for number, (y, feed, level) in enumerate((y, feed, 1 + level) for y, feed in (passes or PASSES).items()
                                              for level in range(levels)):
        mill = EndMill(runout_mm=(0.0, 0.0, 0.0), feed_mm_s=feed)
        along, left, up = mill.mean_force(mill.coverage(np.full(len(mill.rim_mm), 10.0)), DEEP)
        way = 1 if number % 2 == 0 else -1
        go(place[0], y, 620.0, 200.0)
        go(place[0], y, 600 - level * DEEP, 200.0)
        go(right if way > 0 else LEFT, y, 600 - level * DEEP, feed, np.array([way * along, way * left, up]))
        go(place[0], y, 620.0, 200.0)
    head = ('PERS tooldata tSpindle:=[TRUE,[[120,0,250],[1,0,0,0]],[80,[0,0,120],[1,0,0,0],0,0,0]];\nPROC main()\n')
    program, log = folder / "slots.mod", folder / "forces.csv"
    program.write_text(f"MODULE Slots\n{head}" + "\n".join(moves) + "\nENDPROC\nENDMODULE\n")
    columns = {"position": "time_s,x_mm,y_mm,z_mm", "target": "time_s,target", "target alone": "target"}[by]
    log.write_text(f"{columns},fx_n,fy_n,fz_n\n" + "\n".join(rows) + "\n")
    return program, log


def coefficients(
    folder: Path, program: Path, log: Path, stiffness: float, top: float = 600.0
) -> compstiff.FittedCoefficients:
    """On an arm of these springs [N m/rad]; top [mm]: of the stock, as its file says."""
    (folder / "cell.yaml").write_text(CELL)
    (folder / "stock.yaml").write_text(STOCK.replace("600]", f"{top}]"))
    cell = compstiff.read_cell(folder / "cell.yaml")
    springs = IdentifiedModel(cell.robot, cell.flange_from_tcp, -np.log(np.full(6, stiffness)), np.eye(6) * 1e-4)
    return compstiff.cutting_coefficients(cell, compstiff.read_toolpath(program, cell), folder / "stock.yaml", springs, log,
                                          compstiff.Settings.of(tare=((0, 1),)))


@pytest.mark.parametrize("by", ["position", long("target"), long("target alone")])
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
    assert found.coefficients.told["spindle_rpm"] == pytest.approx(9000)


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


def test_a_stock_that_was_thinner_than_its_file_says(tmp_path: Path) -> None:
    """On two levels the log tells it; on one, where the same forces are those of a softer material, what it would mean is
    said, and is what comes out."""
    two = job(tmp_path, "position", levels=2)
    found = coefficients(tmp_path, *two, 1e9, top=601.0)
    (said,) = [finding for finding in found.findings if finding.code == "CS4751"]
    how_far = re.search(r"about ([\d.]+) mm (\w+)", said.message)
    assert how_far is not None
    assert 0.7 < float(how_far[1]) < 1.4
    assert how_far[2] == "lower"
    as_it_is = coefficients(tmp_path, *two, 1e9)
    assert "CS4751" not in {finding.code for finding in as_it_is.findings}
    assert as_it_is.higher is not None
    one = job(tmp_path, "position")
    thick, right = (coefficients(tmp_path, *one, 1e9, top=top) for top in (600.3, 600.0))
    assert "CS4751" not in {finding.code for finding in thick.findings}
    assert right.higher is not None
    # Of the two levels one reaches the top.
    assert 0.35 < as_it_is.higher / right.higher < 0.65
    assert 1 - thick.coefficients.mean[0] / right.coefficients.mean[0] == pytest.approx(0.3 * right.higher, rel=0.3)


def test_a_dozen_places_of_one_slot_say_how_much_they_tell() -> None:
    """Mean forces of a slot by Altintas' closed form, drawn with errors that neighbours share: the force that is predicted
    for this slot, and for chips half as thick, is off by no more than coefficients and model are said to be."""
    teeth, depth, chip, count = 3, 3e-3, 5e-5, 12
    mean, covariance = coefficients_of("steel", chip)
    rng, root = np.random.default_rng(8), 0.5 * np.linalg.cholesky(covariance)

    def slot(chip: float) -> np.ndarray:
        c, e = teeth * depth * chip, teeth * depth / np.pi
        return np.array([[0, -c / 4, 0, 0, -e, 0], [c / 4, 0, 0, e, 0, 0], [0, 0, c / np.pi, 0, 0, teeth * depth / 2]])

    far: dict[float, list[float]] = {chip: [], chip / 2: []}
    for _ in range(150):
        true = mean + root @ rng.standard_normal(6)
        errors = rng.standard_normal((count, 3))
        for i in range(1, count):
            errors[i] = 0.7 * errors[i - 1] + np.sqrt(1 - 0.7**2) * errors[i]
        force = slot(chip) @ true
        logged = force + (0.5 + 0.02 * np.linalg.norm(force)) * errors + rng.standard_normal(3)
        told = fit_coefficients(ForceRows(np.broadcast_to(slot(chip), (count, 3, 6)).copy(), logged, np.full((count, 3), 0.3),
                                          np.zeros((count, 3, 0)), 3e-3 * np.arange(count)), mean, covariance)
        for own, sizes in far.items():
            off, spread = slot(own) @ (told.mean - true), slot(own) @ told.covariance @ slot(own).T
            spread += (told.model_error * np.linalg.norm(slot(own) @ true)) ** 2 / 3 * np.eye(3)
            sizes.append(float(off @ np.linalg.solve(spread, off)) / 3)
    assert 0.3 < np.sqrt(np.mean(far[chip])) < 1
    assert 0.3 < np.sqrt(np.mean(far[chip / 2])) < 1
