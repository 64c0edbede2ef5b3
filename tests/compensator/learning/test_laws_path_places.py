"""Measured points stand where the program cut them, whatever it does before it cuts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Settings
from compensator.learning.long_moves import said_of_long_moves
from compensator.learning.measured_points import read_points
from compensator.learning.normals_alone import said_of_normals
from compensator.learning.path_places import PathPlaces, place_points
from compensator.learning.rows import rows_of
from compensator.learning.terms import frame_of, terms_of
from compensator.learning.unseen import said_of_unseen
from identification.common.findings import CompstiffError, Finding
from identification.model.cell import read_cell
from identification.model.stiffness import IdentifiedModel
from tests.compensator.learning.two_tracks import DEPTH, TwoTracks, predict, two_tracks, written

SPEED = "vAir,fine,tSpindle"
POSE = "[0,0,1,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
BEFORE = {
    "nothing": [],
    "home by joints": [f"MoveAbsJ [[0,0,0,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,{SPEED}\\WObj:=wInsert;"],
    "a pose in the world": [f"MoveJ [[1000,100,900],{POSE},{SPEED}\\WObj:=wobj0;"],
    "both": [f"MoveJ [[1000,100,900],{POSE},{SPEED};", f"MoveAbsJ [[0,0,0,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{SPEED};"],
}


@pytest.mark.parametrize("moves", BEFORE.values(), ids=BEFORE)
def test_points_between_targets_stand_half_way(sample_inputs: Inputs, tmp_path: Path, moves: list[str]) -> None:
    """A log of 100 N from the 10th target of the sample on; points half way between its targets, to half a piece of a
    quarter of a millimetre."""
    text = Path(sample_inputs.toolpath).read_text().replace("WaitTime 5;\n", "\n".join(["WaitTime 5;", *moves, ""]), 1)
    program, log, file = tmp_path / "insert.mod", tmp_path / "log.csv", tmp_path / "points.csv"
    program.write_text(text)
    first = 10 + len(moves)
    log.write_text("target,fx_n,fy_n,fz_n\n" + "".join(f"{k},{100 * (k >= first)},0,0\n" for k in range(first + 60)))
    predicted = predict_files(replace(sample_inputs, toolpath=program, forces=log), Settings())
    position = predicted.path.toolpath.position
    before = np.arange(first + 5, first + 45)
    middle = 1e3 * 0.5 * (position[before] + position[before + 1])
    file.write_text("x_mm,y_mm,z_mm,dx_um\n" + "".join(f"{x:.5f},{y:.5f},{z:.5f},5\n" for x, y, z in middle))
    placed = place_points(read_points(file, read_cell(sample_inputs.cell)), predicted, 0.0, 1e-3)
    assert placed.rows.tolist() == list(range(40))
    assert predicted.targets[placed.before].tolist() == before.tolist()
    step = np.linalg.norm(position[before + 1] - position[before], axis=1)
    assert np.abs((placed.share - 0.5) * step).max() <= 0.125e-3 + 1e-9


@pytest.fixture(scope="module")
def tracks(sample_inputs: Inputs, tmp_path_factory: pytest.TempPathFactory) -> TwoTracks:
    return two_tracks(sample_inputs, tmp_path_factory.mktemp("tracks"))


def placed_beside(tracks: TwoTracks, file: Path, odd: list[tuple[float, float]], named: float = np.nan) -> PathPlaces:
    """Ten points on the tracks, and these (x, y) [mm] at their depth; named: the target that each of these names."""
    rows = [[x, 0, DEPTH, 5, np.nan] for x in range(10, 20)] + [[x, y, DEPTH, 5, named] for x, y in odd]
    points = read_points(written(file, "x_mm,y_mm,z_mm,dx_um,target", np.array(rows)), read_cell(tracks.inputs.cell))
    return place_points(points, tracks.predicted, 0.0, 4e-3 if odd[0][1] > 0 else 1e-3)


def left_out(placed: PathPlaces, code: str) -> list[Finding]:
    return [finding for finding in placed.findings if finding.code == code]


def test_points_off_the_path_are_left_out(tracks: TwoTracks, tmp_path: Path) -> None:
    """The nearest two are within 1 mm of a track, of which the steps are a quarter of a millimetre long."""
    odd = [(20.0, -0.9), (30.0, -0.99), (40.0, -1.01), (50.0, -2.5)]
    placed = placed_beside(tracks, tmp_path / "p.csv", odd)
    assert sorted(placed.rows) == [*range(12)]
    [finding] = left_out(placed, "CS5305")
    assert (finding.level, finding.file, finding.line) == ("warning", str(tmp_path / "p.csv"), 14)
    assert finding.message == "2 points of 14 more than 1 mm from the cutting path (the farthest 2.5 mm): left out"
    assert not left_out(placed_beside(tracks, tmp_path / "p.csv", odd[:2]), "CS5305")


@pytest.mark.parametrize(("x", "y", "said"), [
    (30.0, 2.7, False), (30.0, 2.8, True), (30.0, 3.2, True), (30.0, 3.3, False),       # as near within 0.5 mm
    (54.6, 2.9, True), (56.0, 2.9, False)])
def test_points_that_two_places_may_have_cut_are_left_out(tracks: TwoTracks, tmp_path: Path, x: float, y: float, said: bool):
    """Where the way from one to the other is over four distances and 5 mm long: 16.6 mm at 2.9 mm, which is the way round the
    end from 4.7 mm before it, and a circle of 3.4 mm about the point reaches 1.4 mm farther."""
    placed = placed_beside(tracks, tmp_path / "p.csv", [(x, y)])
    found = left_out(placed, "CS5306")
    assert (10 in placed.rows) == (not said)
    assert [(finding.level, finding.line, finding.message) for finding in found] == ([(
        "warning", 12, "1 point of 11 near two places of the path alike, so that which one cut is not known: left out")]
        if said else [])
    # The target that it names says which.
    placed = placed_beside(tracks, tmp_path / "p.csv", [(x, y)], named=1 + np.round(x))
    assert 10 in placed.rows
    assert not left_out(placed, "CS5306")


@pytest.mark.parametrize(("target", "said"), [(0, True), (1, False), (2, False), (122, False), (123, True)])
def test_points_of_targets_to_which_nothing_was_cut_are_left_out(
    tracks: TwoTracks, tmp_path: Path, target: int, said: bool
) -> None:
    """The log has a force from target 1 to 122: the moves to 2 ... 122 cut, the first of them from target 1 on."""
    placed = placed_beside(tracks, tmp_path / "p.csv", [(0.0, 0.5)], named=target)
    if not said:
        row = int(np.flatnonzero(placed.rows == 10)[0])
        stands = placed.before[row] + placed.share[row] * (placed.after[row] - placed.before[row])
        assert stands == pytest.approx(target - 1)
    assert (10 in placed.rows) == (not said)
    assert [(finding.file, finding.line, finding.message) for finding in left_out(placed, "CS5307")] == ([(
        str(tmp_path / "p.csv"), 12, "1 point of 11 cut where the log shows no force: left out")] if said else [])


@pytest.mark.parametrize("lost", [4, 5])
def test_points_of_which_three_tenths_are_lost_are_those_of_another_part(
    tracks: TwoTracks, tmp_path: Path, lost: int
) -> None:
    """Ten on the path, and these 2.5 mm beside it: 4 of 14 are 29 %, 5 of 15 are 33 %."""
    odd = [(20.0 + k, -2.5) for k in range(lost)]
    if lost == 4:
        assert len(placed_beside(tracks, tmp_path / "p.csv", odd).rows) == 10
        return
    with pytest.raises(CompstiffError) as stopped:
        placed_beside(tracks, tmp_path / "p.csv", odd)
    found, beside = stopped.value.findings
    assert (found.code, found.level, found.file, beside.code) == ("CS5303", "error", str(tmp_path / "p.csv"), "CS5305")
    assert found.message == "only 10 points of 15 have a place of their own on the cutting path"


@pytest.mark.parametrize("target", [123, 124])
def test_a_target_that_the_program_does_not_have_is_told_with_its_line(
    tracks: TwoTracks, tmp_path: Path, target: int
) -> None:
    """It has 124: 0 to 123, the last of which is in the air."""
    if target < 124:
        assert left_out(placed_beside(tracks, tmp_path / "p.csv", [(0.0, 0.5)], named=target), "CS5307")
        return
    with pytest.raises(CompstiffError) as stopped:
        placed_beside(tracks, tmp_path / "p.csv", [(0.0, 0.5)], named=target)
    (finding,) = stopped.value.findings
    assert (finding.code, finding.file, finding.line) == ("CS3004", str(tmp_path / "p.csv"), 12)
    assert finding.message == "target 124, the program has 124"


def x_of(number: float, added_before: int = 1000) -> float:
    """Where [mm] a target of the first track is; two were added on the way to `added_before`, at 0.3 and 0.6 of it."""
    if number < added_before:
        return number - 1
    return number - 3 if number >= added_before + 2 else added_before - 2 + 0.3 * (number - added_before + 1)


@pytest.mark.parametrize(("numbers", "taken_from", "count", "said"), [
    (range(20, 45), 31, 124, True), (range(20, 45), 1000, 124, False), (range(10, 31), 31, 124, False),
    (range(31, 33), 31, 124, True), (range(20, 45), 1000, 123, False)])
def test_targets_that_points_name_may_be_those_of_the_corrected_program(
    tracks: TwoTracks, tmp_path: Path, numbers: range, taken_from: int, count: int, said: bool
) -> None:
    """Two were added before target 31: taken as those to which the points stand nearer; below 31 both are the same. Offsets
    of another number of targets say nothing."""
    offsets = tmp_path / "offsets.csv"
    offsets.write_text("target,added\n" + "".join(f"{k},{'0.3 0.6' if k == 31 else ''}\n" for k in range(count)))
    settings = replace(tracks.predicted.settings, correction=replace(tracks.predicted.settings.correction, logged_with=offsets))
    predicted = replace(tracks.predicted, settings=settings)
    rows = np.array([[x_of(k, taken_from), 0.3, DEPTH, 5, k] for k in numbers])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,dx_um,target", rows), read_cell(tracks.inputs.cell))
    placed = place_points(points, predicted, 0.0, 1e-3)
    assert placed.rows.tolist() == list(range(len(numbers)))
    at = [float(tracks.place[row, 0]) for row in placed.before]
    np.testing.assert_allclose(at + placed.share, rows[:, 0], atol=1e-6)
    assert [(one.level, one.message, one.file) for one in left_out(placed, "CS5326")] == ([(
        "note", "the points name targets of the corrected program, which has 2 more (column added of offsets.csv)",
        str(tmp_path / "p.csv"))] if said else [])


@pytest.mark.parametrize("target", [125, 126])
def test_a_target_beyond_both_programs_is_told_by_the_larger(tracks: TwoTracks, tmp_path: Path, target: int) -> None:
    """The corrected one has 126, the last of them in the air; a number that the planned one does not have is its own, whatever
    is nearer."""
    offsets = tmp_path / "offsets.csv"
    offsets.write_text("target,added\n" + "".join(f"{k},{'0.3 0.6' if k == 31 else ''}\n" for k in range(124)))
    settings = replace(tracks.predicted.settings, correction=replace(tracks.predicted.settings.correction, logged_with=offsets))
    rows = np.array([[k - 1, 0, DEPTH, 5, k] for k in range(40, 55)] + [[0, 5.5, DEPTH, 5, target]])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,dx_um,target", rows), read_cell(tracks.inputs.cell))
    if target == 125:
        placed = place_points(points, replace(tracks.predicted, settings=settings), 0.0, 1e-3)
        assert (len(left_out(placed, "CS5326")), len(left_out(placed, "CS5307")), len(placed.rows)) == (1, 1, 15)
        assert tracks.place[placed.before[0], 0] + placed.share[0] == pytest.approx(37)
        return
    with pytest.raises(CompstiffError) as stopped:
        place_points(points, replace(tracks.predicted, settings=settings), 0.0, 1e-3)
    assert [(one.code, one.message, one.line) for one in stopped.value.findings] == [
        ("CS3004", "target 126, the program has 126", 17)]


def test_the_terms_are_the_rows_less_the_deviation_and_its_slopes(tracks: TwoTracks, tmp_path: Path) -> None:
    """By predictions with springs that are a little stiffer and softer, about springs that are 5 to 30 % off those of before;
    set-up and drift by a small motion of the part about its middle, the drift with the time."""
    rng = np.random.default_rng(31)
    chosen = np.arange(3, 118, 8)
    table = np.column_stack([tracks.place[chosen], rng.normal(0, 50, (len(chosen), 3))])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um", table), read_cell(tracks.inputs.cell))
    rows = rows_of(points, place_points(points, tracks.predicted, 0.0, 1e-3), tracks.predicted)
    frame = frame_of(rows, tracks.predicted)
    place = rows.position
    assert frame.centre == pytest.approx(place.mean(axis=0), abs=1e-12)
    assert frame.radius == pytest.approx(np.sqrt(((place - place.mean(axis=0)) ** 2).sum() / len(place)), rel=1e-12)
    assert frame.duration == rows.time.max()
    mean = tracks.model.mean
    there = replace(tracks.model, mean=mean + np.linspace(0.05, 0.3, len(mean)))

    def seen(model: IdentifiedModel) -> np.ndarray:
        return rows.seen(predict(tracks.inputs, model).prediction.position)[:, 0]

    step = 1e-4 * np.eye(len(mean))
    slopes = np.column_stack([(seen(replace(there, mean=there.mean + one)) - seen(replace(there, mean=there.mean - one))) / 2e-4
                              for one in step])
    before = np.diag(rng.uniform(0.1, 0.2, len(mean)))
    found = terms_of(rows, tracks.predicted, there, mean, before, frame, np.eye(9))
    assert found.by_x == pytest.approx(slopes, abs=1e-3 * np.abs(slopes).max())
    assert found.residual == pytest.approx(rows.value - seen(there) + found.by_x @ (there.mean - mean), abs=1e-12)
    shift, turn, drift = 1e-4 * rng.normal(size=(3, 3))
    moved = (shift + np.cross(turn, place - place.mean(axis=0)) + np.outer(rows.time / rows.time.max(), drift))[rows.place]
    assert found.of_job @ np.concatenate([shift, turn * frame.radius, drift]) == pytest.approx(
        np.sum(rows.direction * moved, axis=1), abs=1e-12)
    assert found.before is before


def test_points_at_one_place_alone_have_a_middle_that_a_turn_does_not_move(tracks: TwoTracks, tmp_path: Path) -> None:
    table = np.column_stack([np.tile(tracks.place[30], (4, 1)), np.arange(4.0)])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,dx_um", table), read_cell(tracks.inputs.cell))
    rows = rows_of(points, place_points(points, tracks.predicted, 0.0, 1e-3), tracks.predicted)
    frame = frame_of(replace(rows, position=rows.position[[0, 0, 0, 0]]), tracks.predicted)
    assert frame.radius == 1.0
    assert not frame.columns(rows.position[:1], np.zeros(1))[:, :, 3:].any()


@pytest.mark.parametrize(("loaded", "cut"), [((30, 32), False), ((30, 31), True)])
def test_a_log_without_a_cut_says_so(
    sample_inputs: Inputs, tracks: TwoTracks, tmp_path: Path, loaded: tuple[int, int], cut: bool
) -> None:
    """Two targets with force: neighbours have a move between them, others have none."""
    log = tmp_path / "log.csv"
    log.write_text("target,fx_n,fy_n,fz_n\n" + "".join(f"{k},{100 * (k in loaded)},0,0\n" for k in range(124)))
    predicted = predict_files(replace(tracks.inputs, forces=log), Settings())
    between = np.array([[x, 0, DEPTH, 5] for x in (29.2, 29.5, 29.8)])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,dx_um", between), read_cell(tracks.inputs.cell))
    if cut:
        assert len(place_points(points, predicted, 0.0, 1e-3).rows) == 3
        return
    with pytest.raises(CompstiffError) as stopped:
        place_points(points, predicted, 0.0, 1e-3)
    assert [(one.code, one.file, "there is no cut" in one.message) for one in stopped.value.findings] == [
        ("CS5303", str(tmp_path / "p.csv"), True)]


@pytest.mark.parametrize("radius", [0.0, 8.0])
def test_a_radius_needs_to_know_the_side(tracks: TwoTracks, tmp_path: Path, radius: float) -> None:
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,dx_um", np.array([[x, 0, DEPTH, 5] for x in range(20)])),
                         read_cell(tracks.inputs.cell))
    if not radius:
        assert len(place_points(points, tracks.predicted, 0.0, 1e-3).rows) == 20
        # The surface is 8 mm beside the track, which is on the side to which its normal points.
        surface = np.array([[x, -8, DEPTH, 0, 1, 0, 5] for x in range(20)])
        points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,nx,ny,nz,dn_um", surface),
                             read_cell(tracks.inputs.cell))
        placed = place_points(points, tracks.predicted, 8e-3, 1e-3)
        np.testing.assert_allclose(tracks.place[placed.before][:, 0] + placed.share, np.arange(20), atol=0.13)
        return
    with pytest.raises(CompstiffError) as stopped:
        place_points(points, tracks.predicted, 1e-3 * radius, 1e-3)
    [finding] = stopped.value.findings
    assert (finding.code, finding.file) == ("CS5304", str(tmp_path / "p.csv"))
    assert "no normal on which side" in finding.message


def test_points_of_a_program_that_cuts_in_two_work_objects_are_not_placed(
    sample_inputs: Inputs, tracks: TwoTracks, tmp_path: Path
) -> None:
    """Though both stand in the same place: the points do not say which is theirs."""
    two = two_tracks(sample_inputs, tmp_path, second_object=True)
    np.testing.assert_allclose(two.place, tracks.place)
    file = two.measured(tmp_path / "p.csv", slice(None), two.off)
    points = read_points(file, read_cell(two.inputs.cell))
    assert len(place_points(points, tracks.predicted, 0.0, 1e-3).rows) == 122
    with pytest.raises(CompstiffError) as stopped:
        place_points(points, two.predicted, 0.0, 1e-3)
    [finding] = stopped.value.findings
    assert (finding.code, finding.file) == ("CS5304", str(two.inputs.toolpath))
    assert "several work objects" in finding.message


@pytest.mark.parametrize(("long_mm", "on_long", "said"), [(20.1, 5, True), (19.9, 20, False), (20.1, 4, False)])
def test_points_on_long_moves_are_told(tmp_path: Path, long_mm: float, on_long: int, said: bool) -> None:
    """Over 20 mm, and a quarter of the points on such: of twenty, five."""
    short = 20 - on_long
    length = 1e-3 * np.cumsum([0, 10, long_mm, 19.0])
    predicted: Any = SimpleNamespace(path=SimpleNamespace(length=length), targets=np.arange(4))
    placed: Any = SimpleNamespace(before=np.repeat([1, 0, 2], [on_long, short // 2, short - short // 2]),
                                  after=np.repeat([2, 1, 3], [on_long, short // 2, short - short // 2]))
    found = said_of_long_moves(placed, predicted, "points.csv")
    assert [(one.code, one.level, one.file) for one in found] == ([("CS5333", "warning", "points.csv")] if said else [])
    assert all(one.message.startswith("5 of 20 points lie on moves of over 20 mm, ") for one in found)
    placed.before = placed.after = np.array([], dtype=np.intp)
    assert said_of_long_moves(placed, predicted, "points.csv") == []


@pytest.mark.parametrize(("along", "across", "count", "std_um", "scale", "said"), [
    (0.0, 1.0, 12, 2.0, 1.0, True), (0.0, 1.0, 11, 2.0, 1.0, False), (0.09, 1.0, 60, 2.0, 1.0, True),
    (0.11, 1.0, 60, 2.0, 1.0, False), (0.15, 1.0, 60, 12.0, 1.0, True), (0.18, 1.0, 60, 12.0, 1.0, False),
    (0.0, 0.52, 60, 2.0, 1.0, True), (0.0, 0.48, 60, 2.0, 1.0, False), (0.0, 1.0, 60, 35.0, 1.0, True),
    (0.0, 1.0, 60, 37.5, 1.0, False), (0.0, 1.0, 60, 2.0, 0.19, True), (0.0, 1.0, 60, 2.0, 0.18, False)])
def test_points_that_show_nothing_along_the_feed_alone_are_told(
    tracks: TwoTracks, tmp_path: Path, along: float, across: float, count: int, std_um: float, scale: float, said: bool
) -> None:
    """Both tracks lie along x. What was read, as shares of what is predicted: under a tenth along the feed, or one and a half
    sigmas of the readings, over a half across it; at twelve places and more; where 20 um are predicted along it (108 in the
    middle times `scale`), and three sigmas."""
    off = scale * tracks.off[:count]
    table = np.column_stack([tracks.place[:count], off * [along, across, across], np.full(count, std_um)])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,std_um", table),
                         read_cell(tracks.inputs.cell))
    rows = rows_of(points, place_points(points, tracks.predicted, 0.0, 1e-3), tracks.predicted)
    expected = scale * rows.seen(tracks.predicted.prediction.position)[:, 0]
    found = said_of_normals(rows, rows.value, expected, tracks.predicted, "p.csv")
    assert [(one.code, one.level, one.file) for one in found] == ([("CS5332", "warning", "p.csv")] if said else [])
    size, wide = np.median(np.abs(off[:, 0])), np.median(np.linalg.norm(off[:, 1:], axis=1))
    assert all(one.message == f"along the feed the points are off by {along * size:.0f} um in the middle, where {size:.0f} are "
               f"predicted, and across it by {across * wide:.0f} of {wide:.0f}" for one in found)


@pytest.mark.parametrize(("off_mm", "scatter", "count", "said"), [
    (0.31, 0.0, 10, "short of"), (-0.31, 0.0, 10, "beyond"), (0.29, 0.0, 10, ""), (-0.29, 0.0, 10, ""), (0.31, 0.0, 9, ""),
    (1.0, 0.19, 10, "short of"), (-1.0, 0.19, 10, "beyond"), (1.0, 0.21, 10, ""), (-1.0, 0.21, 10, "")])
def test_points_beside_the_path_by_the_same_are_told_with_the_radius_that_would_fit(
    tracks: TwoTracks, tmp_path: Path, off_mm: float, scatter: float, count: int, said: str
) -> None:
    """A wall 8 mm beside the first track, to and fro by such a share of what the stated radius is short by; 0.3 mm in the
    middle, from ten points on. As the hint says it is right."""
    wall = np.array([[x, -8 + scatter * off_mm * (-1) ** x, DEPTH, 0, 1, 0, 5] for x in range(20, 20 + count)])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,nx,ny,nz,dn_um", wall), read_cell(tracks.inputs.cell))
    placed = place_points(points, tracks.predicted, 1e-3 * (8 - off_mm), 2e-3)
    found = left_out(placed, "CS5327")
    assert len(placed.rows) == count
    assert [(one.level, one.file, one.message) for one in found] == ([(
        "warning", str(tmp_path / "p.csv"), f"with a tool radius of {8 - off_mm:g} mm the points stand {abs(off_mm):.3g} mm "
        f"{said} where the tool went, along their normals, in the middle")] if said else [])
    assert all(one.hint.endswith(" 8 mm would fit") for one in found)
    assert not left_out(place_points(points, tracks.predicted, 8e-3, 2e-3), "CS5327")


@pytest.mark.parametrize("radius", [0.0, 5.0])
def test_normals_into_the_material_are_asked_about_and_no_radius_below_nothing_is_named(
    tracks: TwoTracks, tmp_path: Path, radius: float
) -> None:
    """A wall 8 mm beside the first track, whose normals point away from that."""
    wall = np.array([[x, -8, DEPTH, 0, -1, 0, 5] for x in range(20, 32)])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,nx,ny,nz,dn_um", wall), read_cell(tracks.inputs.cell))
    [found] = left_out(place_points(points, tracks.predicted, 1e-3 * radius, 20e-3), "CS5327")
    assert f"the points stand {8 + radius:g} mm beyond where the tool went" in found.message
    assert "would fit" not in found.hint
    assert found.hint.startswith("do nx ny nz point out of the material, towards the tool?")


@pytest.mark.parametrize(("tilt_deg", "said"), [(5.6, True), (5.9, False)])
def test_a_direction_is_not_seen_to_which_all_normals_stand_square_within_six_degrees(
    tracks: TwoTracks, tmp_path: Path, tilt_deg: float, said: bool
) -> None:
    """Walls along x and y that lean so much, to and fro: a hundredth of the mean square is one of 5.74 degrees."""
    lean, up = np.cos(np.radians(tilt_deg)), np.sin(np.radians(tilt_deg))
    table = np.array([[x, 0, DEPTH, (x % 2) * lean, (1 - x % 2) * lean, up * (-1) ** (x // 2), 5] for x in range(8, 48)])
    file = written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,nx,ny,nz,dn_um", table)
    points = read_points(file, read_cell(tracks.inputs.cell))
    rows = rows_of(points, place_points(points, tracks.predicted, 0.0, 1e-3), tracks.predicted)
    found = said_of_unseen(rows, tracks.predicted, "p.csv")
    assert [(one.code, one.level, one.file) for one in found] == ([("CS5331", "warning", "p.csv")] if said else [])
    assert all("off along (0.00, 0.00, 1.00) of its work object: " in one.message for one in found)


def test_along_one_normal_alone_two_directions_are_not_seen(tracks: TwoTracks, tmp_path: Path) -> None:
    """Each is told by itself, the larger of its components forwards."""
    table = np.array([[x, 0, DEPTH, 0.6, 0.8, 0, 5] for x in range(20)])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,nx,ny,nz,dn_um", table), read_cell(tracks.inputs.cell))
    rows = rows_of(points, place_points(points, tracks.predicted, 0.0, 1e-3), tracks.predicted)
    found = said_of_unseen(rows, tracks.predicted, "p.csv")
    along = np.array([np.fromstring(one.message.split("along (")[1].split(")")[0], sep=",") for one in found])
    assert along @ [0.6, 0.8, 0] == pytest.approx([0, 0], abs=0.01)
    assert along @ along.T == pytest.approx(np.eye(2), abs=0.02)
    assert (along[[0, 1], np.abs(along).argmax(axis=1)] > 0).all()


@pytest.mark.parametrize("count", [140, 141])
def test_more_points_than_the_work_is_done_with_are_averaged(tracks: TwoTracks, tmp_path: Path, count: int) -> None:
    """The readings of two points that stand together get one mean, whose noise is less by the root of two."""
    x = np.concatenate([np.linspace(1, 59, 70), np.linspace(1, 59, count - 70)])
    y = np.repeat([0.0, 6.0], [70, count - 70])
    table = np.column_stack([x, y, np.full(count, DEPTH), np.arange(count), np.full(count, 4.0)])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,dx_um,std_um", table), read_cell(tracks.inputs.cell))
    rows = rows_of(points, place_points(points, tracks.predicted, 0.0, 1e-3), tracks.predicted)
    assert (len(rows.position), rows.value.sum()) == (140, pytest.approx(1e-6 * np.arange(count).sum(), rel=0.02))
    assert [(one.code, one.level, one.message, one.file) for one in rows.findings] == ([] if count == 140 else [
        ("CS5308", "note", "141 points are averaged to 140 places along the path", str(tmp_path / "p.csv"))])
    assert sorted(1e6 * rows.sigma)[0] == pytest.approx(4 if count == 140 else 4 / np.sqrt(2))


def test_points_without_a_place_are_in_no_row(tracks: TwoTracks, tmp_path: Path) -> None:
    """One stands 9 mm beside both tracks."""
    x, y = np.linspace(5, 55, 12), np.zeros(12)
    y[0] = -9.0
    table = np.column_stack([x, y, np.full(12, DEPTH), np.arange(12) + 500.0, np.full(12, 4.0)])
    points = read_points(written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,dx_um,std_um", table), read_cell(tracks.inputs.cell))
    placed = place_points(points, tracks.predicted, 0.0, 1e-3)
    assert sorted(placed.rows.tolist()) == list(range(1, 12))
    rows = rows_of(points, placed, tracks.predicted)
    assert 1e6 * np.sort(rows.value) == pytest.approx(501.0 + np.arange(11))


@pytest.mark.parametrize("most", [1000, 25])
@pytest.mark.parametrize("shifted", [False, True])
def test_rows_are_the_means_of_neighbours_along_alike_directions(
    tracks: TwoTracks, tmp_path: Path, most: int, shifted: bool
) -> None:
    """Number by number, in a loop: neighbours of equal number along the path, none over a gap of 10 mm, walls that face each
    other apart; what was measured less the offsets there; of each mean its sigma, direction, place, and what of the deviation
    of which target stands in it."""
    rng = np.random.default_rng(11)
    x = np.concatenate([rng.uniform(1, 20, 25), rng.uniform(33, 59, 25), rng.uniform(1, 59, 20)])
    y = np.repeat([0.0, 6.0], [50, 20])
    side = np.where(rng.random(70) < 0.5, 1.0, -1.0)
    normal = np.column_stack([side * 0.28, side * 0.96, np.zeros(70)])
    normal[::9] = [0, 0, 1.0]
    table = np.column_stack([x, y, np.full(70, DEPTH), normal, rng.normal(0, 30, 70), rng.uniform(2, 6, 70)]).round(3)
    file = written(tmp_path / "p.csv", "x_mm,y_mm,z_mm,nx,ny,nz,dn_um,std_um", table)
    points = read_points(file, read_cell(tracks.inputs.cell))
    predicted = tracks.predicted
    placed = place_points(points, predicted, 0.0, 1e-3)
    assert len(placed.rows) == 70
    path, targets = predicted.path, predicted.targets
    off = 1e-6 * rng.normal(0, 20, (len(path.length), 3))
    offsets: Any = SimpleNamespace(over=lambda _: off) if shifted else None
    rows = rows_of(points, placed, predicted, offsets, most)
    # Groups of points in the order of the path.
    group, number = [], -1
    for k in range(70):
        new = k == 0 or most >= 70 or k * most // 70 != (k - 1) * most // 70 or placed.length[k] - placed.length[k - 1] > 10e-3
        number += new
        group.append(number)
    if most == 25:
        assert number + 1 > 25      # a gap within one
    moved = predicted.prediction.position
    steep: list[list[Any]] = []
    for a in range(len(targets)):
        steep.append([(moved[b] - moved[a]) / max(abs(path.length[targets[b]] - path.length[targets[a]]), 1e-4)
                      for b in (a - 1, a + 1) if 0 <= b < len(targets)])
    members: dict[tuple[int, int], list[int]] = {}
    for k, point in enumerate(placed.rows):
        main = int(np.argmax(np.abs(normal[point])))
        members.setdefault((group[k], main + 3 * (normal[point, main] < 0)), []).append(k)
    assert len(rows) == len(members)
    displacement = rng.normal(size=(len(targets), 3))
    two = rows.seen(np.stack([displacement, displacement**2], axis=2))
    assert two == pytest.approx(np.column_stack([rows.seen(displacement), rows.seen(displacement**2)]))
    for row, key in enumerate(sorted(members)):
        value, direction, variance, seen, steeper = 0.0, np.zeros(3), 0.0, np.zeros((len(targets), 3)), 0.0
        for k in members[key]:
            point, share = placed.rows[k], placed.share[k]
            near = placed.after[k] if share > 0.5 else placed.before[k]
            along = path.base_from_object.rotation[targets[near]] @ normal[point]
            seen[placed.before[k]] += (1 - share) * along
            seen[placed.after[k]] += share * along
            direction += along
            value += 1e-6 * table[point, 6]
            variance += (1e-6 * table[point, 7]) ** 2
        count = len(members[key])
        seen /= count
        steeper = sum(max(abs(float(along @ slope)) for slope in slopes) for along, slopes in zip(seen, steep, strict=True))
        value = value / count - (float(np.sum(seen * off[targets])) if shifted else 0.0)
        assert rows.value[row] == pytest.approx(value, abs=1e-12)
        assert rows.sigma[row] == pytest.approx(np.sqrt(variance) / count, rel=1e-9)
        assert rows.direction[row] == pytest.approx(direction / count, abs=1e-12)
        assert rows.steep[row] == pytest.approx(steeper, rel=1e-9, abs=1e-15)
        assert rows.place[row] == key[0]
        assert rows.seen(displacement)[row, 0] == pytest.approx(float(np.sum(seen * displacement)), abs=1e-12)
    for place in range(number + 1):
        own = [k for k in range(70) if group[k] == place]
        before, after, share = placed.before[own], placed.after[own], placed.share[own, None]
        for found, of in ((rows.position, path.base_from_tcp.position), (rows.posture, path.theta)):
            middle = ((1 - share) * of[targets[before]] + share * of[targets[after]]).mean(axis=0)
            assert found[place] == pytest.approx(middle, abs=1e-12)
        assert (rows.length[place], rows.time[place]) == pytest.approx((placed.length[own].mean(), placed.time[own].mean()))
    # In the time that the moves up to there take at the programmed feed, of 40 mm/s.
    assert np.diff(placed.time) == pytest.approx(np.diff(placed.length) / 40e-3, rel=1e-6)
