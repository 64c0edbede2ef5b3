"""The direction of the cutting force against the travel: what it tells of a wrong sign or frame, and what it does not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cut_direction import FRAMES, drawn, read_as
from compensator.correction.files import Inputs
from compensator.forces.cut_direction import NEVER, CutDirection, cut_direction, said_of_direction, travel
from compensator.forces.placement import place_forces, read_force_log
from compensator.path.robot_path import robot_path
from compensator.rapid import read_rapid
from identification.model.cell import read_cell
from tests.compensator.forces.test_contract_placement import plan
from tests.virtual_cell.endmill import EndMill


@pytest.mark.parametrize("climb", [True, False])
def test_no_engagement_pushes_forwards_and_to_the_right(climb: bool) -> None:
    """Every width of cut from a fiftieth of the diameter to a slot, with coefficients of sharp and worn edges. Turned over, the
    wide ones do; the thin ones of one kind look like those of the other."""
    rng = np.random.default_rng(0)
    turned = {}
    for width in (0.3, 1.0, 3.0, 8.0, 12.0, 16.0):
        angles = []
        for _ in range(20):
            mill = EndMill(runout_mm=(0.0, 0.0, 0.0), feed_mm_s=rng.uniform(10, 60),
                           shear_n_mm2=tuple(np.array(EndMill.shear_n_mm2) * [1, rng.uniform(0.5, 2), 1]),
                           edge_n_mm=tuple(np.array(EndMill.edge_n_mm) * rng.uniform(0.7, 1.4, 3)))
            side = mill.rim_mm[:, 1] if climb else -mill.rim_mm[:, 1]
            along, left, _ = mill.mean_force(mill.coverage(width - mill.radius_mm - side), 3.0)
            angles.append(np.arctan2(left, along))
        assert not any(NEVER[0] < angle < NEVER[1] for angle in angles)
        turned[width] = [NEVER[0] < angle % (2 * np.pi) - np.pi < NEVER[1] for angle in angles]
    assert all(turned[12.0] + turned[16.0])
    if climb:
        assert all(turned[8.0])
        assert not any(turned[0.3])


@pytest.mark.parametrize(("climb", "widths", "words"), [
    (True, (0.2, 0.5, 1.0), "climb milling of little engagement"), (True, (8.0,), "climb milling of half the diameter"),
    (True, (15.0, 16.0), "a slot"), (False, (16.0,), "a slot"),
    (False, (0.2, 1.0, 4.0), "conventional milling of little engagement"),
    (False, (8.0,), "conventional milling of half the diameter"),
])
def test_the_kind_of_cut_is_told_in_words(climb: bool, widths: tuple[float, ...], words: str) -> None:
    """Of a sharp cutter of 16 mm, by its mean force."""
    mill = EndMill(runout_mm=(0.0, 0.0, 0.0))
    for width in widths:
        side = mill.rim_mm[:, 1] if climb else -mill.rim_mm[:, 1]
        along, left, up = mill.mean_force(mill.coverage(width - mill.radius_mm - side), 3.0)
        assert CutDirection(along, left, -up, share=0.9, follows=0.8, turns=0.5, targets=100).looks == words
    assert CutDirection(along, left, -up, share=0.1, follows=0.1, turns=0.5, targets=100).looks == ""


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> list:
    return [drawn(np.random.default_rng((9, number)), tmp_path_factory.mktemp("job")) for number in range(6)]


def test_right_logs_are_left_in_peace_and_most_wrong_ones_are_told(jobs: list) -> None:
    """The virtual cell's part, cut either way round; the benchmark has the figures over many."""
    told = {"sign": [], "frame": []}
    for path, force, kind in jobs:
        cuts = travel(path, np.any(force != 0, axis=1))
        for true in FRAMES:
            right, turned = (read_as(path, force, true, sign) for sign in (1.0, -1.0))
            assert "warning" not in {finding.level for finding in said_of_direction(cuts, right, true, "log")}, kind
            told["sign"].append("CS3068" in warnings(said_of_direction(cuts, turned, true, "log")))
            told["frame"] += [bool(warnings(said_of_direction(cuts, right, stated, "log"))) for stated in FRAMES
                              if stated != true]
    assert np.mean(told["sign"]) > 0.5
    assert np.mean(told["frame"]) > 0.5


def test_the_frame_in_which_a_cutter_may_feel_it_is_named_with_both_figures(jobs: list) -> None:
    """Where the direction of push is none of a cutter in the stated frame, and is one in another."""
    named = []
    for path, force, _ in jobs:
        cuts = travel(path, np.any(force != 0, axis=1))
        for true in FRAMES:
            for stated in FRAMES:
                said = [one.message for one in said_of_direction(cuts, read_as(path, force, true, 1.0), stated, "log")
                        if one.code == "CS3068"]
                named += [f"read in the frame {true} it would be" in said[0]] if said else []
    assert len(named) >= 10
    assert np.mean(named) > 0.8


def warnings(findings: list) -> set[str]:
    return {finding.code for finding in findings if finding.level == "warning"}


def test_the_tools_z_may_point_either_way(jobs: list) -> None:
    """Up is where the flange is, which stands as it stood."""
    path, force, _ = jobs[0]
    forced = np.any(force != 0, axis=1)
    turned = np.array([1.0, -1, -1])
    frame, tool = path.base_from_tcp, path.flange_from_tcp
    other = replace(path, base_from_tcp=replace(frame, rotation=frame.rotation * turned),
                    flange_from_tcp=replace(tool, rotation=tool.rotation * turned))
    np.testing.assert_allclose(other.base_from_flange.position, path.base_from_flange.position, atol=1e-12)
    assert cut_direction(other, force, forced) == cut_direction(path, force, forced)


def test_the_samples_log_read_wrongly(sample_inputs: Inputs) -> None:
    """As it is, by the other sign, and as if it were in the base frame: passes to and fro, but the ball is not pulled down."""
    cell = read_cell(sample_inputs.cell)
    path = robot_path(read_rapid(sample_inputs.toolpath.read_bytes(), "insert.mod").toolpath, cell)
    log = read_force_log(sample_inputs.forces, cell.force_log.form)
    seen = {name: warnings(list(place_forces(log, path, replace(cell, force_log=replace(cell.force_log, **change)),
                                             tare=(0, 2)).findings)) & {"CS3068", "CS3069"}
            for name, change in {"right": {}, "sign": {"sign": -1.0}, "frame": {"kind": "base"}}.items()}
    assert seen["right"] == set()
    assert seen["sign"] == {"CS3068"}
    assert seen["frame"] == {"CS3068"}


def test_a_few_targets_say_nothing(jobs: list, tmp_path: Path) -> None:
    path, force, _ = jobs[0]
    few = np.zeros(len(force), dtype=bool)
    few[np.flatnonzero(np.any(force != 0, axis=1))[:9]] = True
    assert cut_direction(path, force, few) is None
    (untold,) = said_of_direction(travel(path, few), {"base": -force}, "base", "log")
    assert (untold.code, untold.level) == ("CS3071", "note")


@pytest.mark.parametrize(("width", "climb", "told"), [
    (0.3, True, False), (0.3, False, False), (12.0, True, True), (16.0, True, True)])
def test_a_straight_cut_tells_the_sign_or_says_that_it_does_not(tmp_path: Path, width: float, climb: bool, told: bool) -> None:
    """One straight cut along x, the forces of an end mill chip by chip: where the wrong sign is not warned of, both signs say
    that nothing tells; and where nobody stated the sign that is a warning."""
    mill = EndMill(runout_mm=(0.0, 0.0, 0.0))
    side = mill.rim_mm[:, 1] if climb else -mill.rim_mm[:, 1]
    force = np.array(mill.mean_force(mill.coverage(width - mill.radius_mm - side), 3.0))
    path = plan(tmp_path, count=40)
    ahead, up = np.array([1.0, 0, 0]), -path.base_from_tcp.rotation[0, :, 2] * np.sign(
        -path.base_from_tcp.rotation[0, :, 2] @ path.to_flange[0])
    on_tool = force[0] * ahead + force[1] * np.cross(up, ahead) + force[2] * up
    forces, forced = np.tile(on_tool, (40, 1)), np.ones(40, dtype=bool)
    said = {sign: {finding.code: finding.level for finding in said_of_direction(
        travel(path, forced), {"base": sign * forces}, "base", "log", sign_stated=stated)}
        for sign, stated in ((1.0, True), (-1.0, False))}
    assert said[1.0] == ({} if told else {"CS3071": "note"})
    assert said[-1.0] == ({"CS3068": "warning"} if told else {"CS3071": "warning"})
