"""Intermediate targets: the tool stays on the plan between the targets too, and the text is that of the program given."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction import intermediate_targets
from compensator.correction.before_touch import air_beside
from compensator.correction.correct import Corrected, correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.fine_grid import _around, fine_grid
from compensator.correction.force_changes import noise_of_one
from compensator.correction.grid_path import asks_for_all, grid_path
from compensator.correction.needed_targets import Wanted, beyond_noise, needed_points, window_means, windows
from compensator.correction.settings import CLOSEST, Estimate, Settings
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import ORIGIN, Path3
from tests.runs.command_line.user_files import IRB6660, TOOL, Frame, Job, K, Rotation

# A straight path of 130 mm in pieces of a millimetre, with targets of the program at these.
OWN = [0, 100, 130]


@pytest.mark.parametrize("end", [104, 110, 120])
def test_behind_the_end_of_a_cut_no_target_stands_that_is_not_moved(end: int) -> None:
    """One where the force ends, and none on the way through the air to the next."""
    piece = np.arange(131)
    further, forced = ~np.isin(piece, OWN), piece < end
    deviation, own = np.zeros((131, 3)), np.zeros((131, 3))
    deviation[:end + 1, 1], own[OWN[:2], 1] = 3e-4, 3e-4
    place = 1e-3 * piece
    grid: Any = SimpleNamespace(further=further, may=further, divisible=further, arcs=np.empty((0, 2), dtype=np.intp))
    have, _ = needed_points(grid, Wanted(
        deviation, own, 5e-6, np.zeros(131), np.inf, np.full(131, True), forced, place, np.ones(131),
        np.outer(place, [1, 0, 0]), np.full(131, 1e-3), np.full(131, False)))
    assert np.flatnonzero(have).tolist() == [0, 100, end - 1, end, 130]


ENTRY, EXIT = 20.0, 135.0        # mm of path: where the cut begins and ends


def force(s: np.ndarray) -> np.ndarray:
    """Force (n, 3) [N] at path lengths [mm], base frame: none in air, varying in the cut."""
    s = np.asarray(s, dtype=float)
    cut = (s > ENTRY) & (s < EXIT)
    return np.where(cut[:, None], np.column_stack([50 + 0 * s, 150 + 100 * np.sin(s / 25), -80 + 0 * s]), 0.0)


def log(end: float, step: float = 0.1) -> str:
    s = np.arange(0, end, step)
    return "path_mm,fx_n,fy_n,fz_n\n" + "".join(f"{a:.3f},{f[0]:.5f},{f[1]:.5f},{f[2]:.5f}\n"
                                               for a, f in zip(s, force(s), strict=True))


def between(start: Frame, end: Frame, share: float) -> Frame:
    turn = (end.r * start.r.inv()).as_rotvec()
    return Frame(start.p + share * (end.p - start.p), Rotation.from_rotvec(share * turn) * start.r)


def off_plan(command: Frame, q: np.ndarray, wrench: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the loaded tool of a commanded pose stands, in the work object [m], and the joint angles."""
    q = kit.solve(IRB6660, kit.work_object() @ command @ TOOL.inv(), q)
    rest = kit.tcp_pose(IRB6660, kit.loaded(IRB6660, q, TOOL.p, wrench, K), TOOL)
    return (kit.work_object().inv() @ rest).p, q


def distance_from_line(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> tuple[float, float]:
    """Distance from a line, and how far along it [m]."""
    along = (end - start) / np.linalg.norm(end - start)
    offset = point - start
    return float(np.linalg.norm(offset - (offset @ along) * along)), float(offset @ along)


def test_a_mean_about_a_target_is_what_is_there_where_the_force_rises() -> None:
    """The windows are alike on both sides, on whatever pieces, also where half the way to a neighbour is a point itself."""
    rng = np.random.default_rng(2)
    for step in (0.3, 1 / 3, 2.5):
        place = step * np.arange(200) + 7.1
        at = np.unique(np.concatenate([[0, 199], rng.integers(0, 200, 40)]))
        values, weight = np.column_stack([3 * place - 5, -place]), np.ones(200)
        means = window_means(values, weight, *windows(place, at), at)
        np.testing.assert_allclose(means, values[at], atol=1e-9)


def test_scatter_is_told_from_a_force_that_rises_and_jumps() -> None:
    s, rng = np.linspace(0, 1, 600), np.random.default_rng(4)
    smooth = np.column_stack([800 * s, 300 * np.sin(9 * s) + 200 * (s > 0.37), 0 * s])
    weight = rng.integers(3, 30, 600).astype(float)
    for sigma in (0.0, 4.0):
        seen = smooth + sigma / np.sqrt(weight)[:, None] * rng.standard_normal((600, 3))
        np.testing.assert_allclose(noise_of_one(seen, weight, np.ones(600, dtype=bool)), sigma, rtol=0.15, atol=0.02)


def test_a_shape_is_seen_through_the_scatter_and_scatter_is_no_shape() -> None:
    rng, noise = np.random.default_rng(6), np.full(400, 4.0)
    scatter = 4.0 / np.sqrt(3) * rng.standard_normal((400, 3))
    assert beyond_noise(scatter, noise, 1.0).max() < 1.0
    bump = np.outer(6 * np.exp(-((np.arange(400) - 200) / 20.0) ** 2), [1.0, 0, 0])
    seen = beyond_noise(scatter + bump, noise, 1.0)
    assert 1.5 < seen.max() < 6
    assert 180 < np.argmax(seen) < 220
    # Where the scatter is small each point speaks for itself.
    np.testing.assert_allclose(beyond_noise(bump, 0 * noise, 1.0), bump[:, 0])


LINES = np.array([[0, 0, 0], [60, 0, 0], [120, 0, 0], [120, 40, 0]], dtype=float)


def worst_off_the_line(job: Job, path: Path3) -> float:
    """Over the straight run of LINES, away from entry and exit, driving the written program with the true forces [m]."""
    written = kit.targets_of(job.out.read_text())
    start, end = path.frames[0].p, path.frames[2].p
    worst, q = 0.0, path.q[0]
    for first, last in itertools.pairwise(written):
        for share in (0.0, 0.25, 0.5, 0.75):
            command = between(first, last, share)
            s = 1e3 * distance_from_line(command.p, start, end)[1]
            if ENTRY + 5 < s < 115:
                point, q = off_plan(command, q, np.r_[force(np.array([s]))[0], 0, 0, 0])
                worst = max(worst, distance_from_line(point, start, end)[0])
    return worst


def test_between_long_targets_the_tool_stays_on_the_plan(tmp_path: Path) -> None:
    path = Path3(LINES)
    job = Job(tmp_path, program=path.program(), forces=log(160))
    result = job.correct("--json")
    assert result.code == 0
    assert worst_off_the_line(job, path) < 10e-6
    added = result.json["result"]["added_targets"]
    (said,) = (one for one in result.json["findings"] if one["code"] == "CS4330")
    # The program's own are written to as many digits as they were given with.
    own = np.flatnonzero(["MoveL" in line and re.search(r"\.\d{8},", line.split("]")[0]) is not None
                          for line in job.out.read_text().splitlines()])
    longer = np.diff(own) - 1
    assert (said["level"], said["line"], said["target"], said["message"]) == (
        "note", 5 + 1 + np.flatnonzero(longer)[0], 1 + np.flatnonzero(longer)[0], f"{longer.sum()} intermediate targets in "
        f"{(longer > 0).sum()} MoveL: the correction varies along them by more than 5 um (--tolerance)")
    assert added == len(kit.targets_of(job.out.read_text())) - 4 > 5
    assert len(job.offsets()) == 4, "one row a target of the program given"
    coarse = job.correct("--json", "--force", "--tolerance", "40").json["result"]["added_targets"]
    assert coarse < 0.6 * added
    assert job.correct("--force", "--keep-targets").code == 0
    assert len(kit.targets_of(job.out.read_text())) == 4
    assert worst_off_the_line(job, path) > 60e-6


def test_the_numbers_of_terminal_report_and_json_are_the_same(tmp_path: Path) -> None:
    """Those of the prediction are of the program as given, as offsets.csv has it, whatever was added; of what was corrected it
    is told how much was added, and all of that is in the written program."""
    path = Path3(LINES)
    job = Job(tmp_path, program=path.program(), forces=log(160))
    result = job.correct("--json").json["result"]
    rows = job.offsets()
    size = np.linalg.norm(kit.column(rows, "dx_um", "dy_um", "dz_um"), axis=1)
    assert result["targets"] == len(rows) == 4
    assert result["with_force"] == (size > 0).sum() <= 4
    assert result["deviation_um"]["largest"] == pytest.approx(np.nanmax(size), abs=1e-3)
    moved = (np.abs(kit.column(rows, "ox_mm", "oy_mm", "oz_mm")) > 0).any(axis=1)
    assert result["corrected"] - result["corrected_added"] == moved.sum()
    assert result["added_targets"] == len(kit.targets_of(job.out.read_text())) - 4 >= result["corrected_added"] > 5
    told = job.correct("--force", "--report", tmp_path / "r.html")
    page = re.sub(r"<[^>]+>", "", (tmp_path / "r.html").read_text()).replace("\xa0", " ")
    words = (f"orrected: {result['corrected']} targets, {result['corrected_added']} of the {result['added_targets']} added "
             "among them")
    assert f"targets: 4, {result['with_force']} with force" in told.out
    assert f"{result['with_force']} of 4 targets of part.mod carry force" in page
    assert words in told.out
    assert words in page
    worse = f"{result['expected_worse']:.1f}"
    assert f"expected to end up farther off than uncorrected: {worse} of {result['corrected']} targets" in told.out
    assert f"Of {result['corrected']} targets {worse} are expected to end up farther off" in page


def test_a_target_between_two_samples_of_a_slow_log_is_corrected_with_its_neighbours(tmp_path: Path) -> None:
    """Samples 0.3 mm before and behind each target, so that none lies on the target's own short piece, and a force that
    asks for targets between them: the tool is on the plan at the program's own targets, too. (They had stayed as planned,
    half a millimetre beside their corrected neighbours, and nobody was told.)"""
    points = np.array([[3.0 * number, 0, 0] for number in range(41)])
    s = np.arange(0.3, 120, 0.6)
    ramp = np.interp(s, [20, 24, 100, 104], [0, 1, 1, 0])
    rows = "".join(f"{a:.3f},{50 * f:.5f},{250 * f:.5f},{-80 * f:.5f}\n" for a, f in zip(s, ramp, strict=True))
    path = Path3(points)
    job = Job(tmp_path, program=path.program(), forces="path_mm,fx_n,fy_n,fz_n\n" + rows)
    result = job.correct("--json")
    assert result.code == 0
    assert "CS4330" in kit.codes(result)
    written, q = kit.targets_of(job.out.read_text()), path.q[0]
    planned = [frame.p for frame in path.frames]
    cut = [place for place in planned if 21 < 1e3 * np.linalg.norm(place - planned[0]) < 103]
    assert len(cut) == 28
    for place in cut:
        command = min(written, key=lambda frame: float(np.linalg.norm(frame.p - place)))
        force = np.interp(1e3 * np.linalg.norm(place - planned[0]), s, ramp) * np.array([50.0, 250, -80])
        point, q = off_plan(command, q, np.r_[force, 0, 0, 0])
        assert distance_from_line(point, planned[0], planned[-1])[0] < 10e-6


def test_air_on_a_long_move_is_not_moved(tmp_path: Path) -> None:
    path = Path3(LINES)
    job = Job(tmp_path, program=path.program(), forces=log(160))
    assert job.correct().code == 0
    for frame in kit.targets_of(job.out.read_text()):
        off, along = distance_from_line(frame.p, path.frames[0].p, path.frames[2].p)
        if off < 1e-3 and 1e3 * along < ENTRY - 3:
            assert off < 1e-7


def test_the_correction_begins_where_the_tool_touches(tmp_path: Path) -> None:
    """A force that begins between two targets: one is added in the air beside the touch, nearer than two targets may stand to
    each other (0.3 mm at this feed), and none before it is moved; behind it the tool is soon on the plan."""
    touch, step = 22.15, 1.5
    path = Path3(np.column_stack([step * np.arange(30), np.zeros(30), np.zeros(30)]))
    s = np.arange(0, step * 29, 0.02)

    def push(s: np.ndarray) -> np.ndarray:
        return np.outer(np.clip((s - touch) / 0.5, 0.0, 1.0), [50.0, 200.0, -80.0])

    text = "path_mm,fx_n,fy_n,fz_n\n" + "".join(
        f"{a:.2f},{f[0]:.4f},{f[1]:.4f},{f[2]:.4f}\n" for a, f in zip(s, push(s), strict=True))
    job = Job(tmp_path, program=path.program(), forces=text)
    assert job.correct().code == 0
    written = kit.targets_of(job.out.read_text())
    start, end = path.frames[0].p, path.frames[-1].p
    off, along = 1e3 * np.array([distance_from_line(frame.p, start, end) for frame in written]).T
    still = along[off < 2e-4]
    assert touch - 0.1 < still[still < touch].max()
    assert np.all(off[along < touch] < 2e-4)
    first, second = (written[number] for number in np.flatnonzero(along > touch)[:2])
    q = path.q[15]
    for frame in (first, second):
        point = frame.p
        for _ in range(3):          # the force is that of the place to which the tool yields
            place = 1e3 * distance_from_line(point, start, end)[1]
            point, q = off_plan(frame, q, np.r_[push(np.array([place]))[0], 0, 0, 0])
        assert distance_from_line(point, start, end)[0] < 5e-6


@pytest.mark.parametrize("leaving", [False, True])
def test_a_touch_close_behind_a_target_in_the_air_is_not_cut_before(tmp_path: Path, leaving: bool) -> None:
    """Nearer to it than two targets may stand, so that none can be added in the air: up to the touch the tool stood on the
    plan, and on the line to the first corrected target it stays within two sigma of that. Two targets on it is there."""
    touch, end, step = 22.7, 43.5, 1.5
    path = Path3(np.column_stack([np.arange(0, end + 1, step), *np.zeros((2, 30))]))
    s = np.arange(0, end, 0.02)
    share = np.clip(((end - s if leaving else s) - touch) / 0.2, 0.0, 1.0)
    text = "path_mm,fx_n,fy_n,fz_n\n" + "".join(
        f"{a:.2f},{50 * f:.4f},{200 * f:.4f},{-80 * f:.4f}\n" for a, f in zip(s, share, strict=True))
    job = Job(tmp_path, program=path.program(), forces=text)
    said = {one["code"]: one["message"] for one in job.correct("--json").json["findings"]}
    off, along = np.array([distance_from_line(frame.p, path.frames[0].p, path.frames[-1].p)
                           for frame in kit.targets_of(job.out.read_text())]).T
    order = np.argsort(along)
    places = 1e-3 * np.arange(0, touch, 0.02)
    at_air = np.interp(1e-3 * end - places if leaving else places, along[order], off[order])
    rows = job.offsets()
    sigma = 1e-6 * np.linalg.norm(kit.column(rows, "sx_um", "sy_um", "sz_um"), axis=1).max()
    full = 1e-3 * np.linalg.norm(kit.column(rows, "ox_mm", "oy_mm", "oz_mm"), axis=1).max()
    assert at_air.max() < 2 * sigma < 0.25 * full
    many, held = re.search(r": (\d+) corrections? (?:is|are) held back beside it, by up to (\d+) um", said["CS4119"]).groups()
    cut = 1e3 * (1e-3 * end - along if leaving else along)
    first, second = np.sort(cut[cut > touch])[:2]
    assert off[cut == second] > 0.95 * full
    assert second < touch + 1.0
    assert first < second
    # What is asked for at the first is the mean of a force that rises there.
    assert int(many) == 1
    assert 0.7e6 * full < float(held) < 1e6 * full
    # As it advises: a target where the tool touches or leaves.
    own = np.sort(np.append(path.xyz[:, 0], end - touch - 0.1 if leaving else touch + 0.1))
    job.program = Path3(np.column_stack([own, *np.zeros((2, len(own)))])).program()
    assert "CS4119" not in kit.codes(job.correct("--json", "--force"))


@pytest.mark.parametrize(("scatter", "air", "near"), [(8e-6, 0.0, True), (1e-6, 1 / 18, True), (1e-6, 0.0, False)])
def test_a_force_that_fades_into_the_scatter_is_no_touch(scatter: float, air: float, near: bool) -> None:
    """At the end of a cut it falls under what the log shows in air before it is none: one piece of the eighteen to the last
    target with force, where the line is off by 20 um. (For these that target was held back by 0.3 mm.) Nor is
    it held back for them where no target can be added to the move."""
    share = np.append(np.linspace(1, 0, 18), [0.0, 0.0])
    forced, points = share > 0, np.arange(len(share))
    forces = SimpleNamespace(forced=forced, samples=np.ones(len(share), dtype=int))
    fine: Any = SimpleNamespace(forces=forces, path=SimpleNamespace(length=0.25e-3 * points), targets=points,
                                prediction=SimpleNamespace(position=np.outer(share, [0.0, 0.36e-3, 0.0])))
    grid = SimpleNamespace(crowded=np.full(len(share), near), divisible=np.zeros(len(share), dtype=bool))
    looked_at: Any = SimpleNamespace(grid=grid, at=np.array([0, 18, 19]), number=np.array([4, 5, 6]), fine=fine,
                                     noise=np.full(len(share), scatter))
    assert air_beside(looked_at, np.array([4])) == pytest.approx([air])


def beside_air(at: list[int], number: list[int], air: np.ndarray, place: np.ndarray, asks: np.ndarray, yields: np.ndarray,
               noise: np.ndarray, target: int, corrected: np.ndarray) -> float:
    """What `air_beside` says of one target of the program, walking from its neighbours in the air point by point."""
    k, shares = number.index(target), [0.0]
    for other in (k - 1, k + 1):
        if not 0 <= other < len(at) or abs(number[other] - target) != 1 or number[other] in corrected or not air[at[other]]:
            continue
        step = 1 if other < k else -1
        point = at[other]
        while point + step != at[k] and air[point + step]:
            point += step
        share = abs(place[point] - place[at[other]]) / abs(place[at[k]] - place[at[other]])
        may = any(asks[one] for one in range(at[other] + step, at[k], step))
        if (may or share > 0.5) and share * yields[at[k]] > 3 * noise[point]:
            shares.append(share)
    return max(shares)


def test_the_air_beside_a_target_is_what_a_walk_from_its_neighbour_finds() -> None:
    """On either side, where that neighbour is the program's next, stands in the air and is not corrected; 200 programs."""
    rng, found = np.random.default_rng(12), []
    for _ in range(200):
        points, at = 60, [0, *np.sort(rng.choice(np.arange(1, 59), 9, replace=False)).tolist(), 59]
        number = (3 + np.arange(11) + np.cumsum(rng.random(11) < 0.2)).tolist()
        air = np.repeat(rng.random(20) < 0.6, 3)
        samples = np.where(rng.random(points) < 0.1, 0, 4)
        place, noise, yields = np.cumsum(rng.uniform(0.2e-3, 1e-3, points)), rng.uniform(0, 6e-5, points), np.zeros(points)
        targets = np.sort(rng.choice(points, 50, replace=False))
        deviation = rng.normal(0, 1e-4, (50, 3))
        yields[targets] = np.linalg.norm(deviation, axis=1)
        crowded, divisible = np.repeat(rng.random((2, 6)) < 0.25, 10, axis=1)
        fine = SimpleNamespace(
            forces=SimpleNamespace(forced=~air, samples=samples), path=SimpleNamespace(length=place), targets=targets,
            prediction=SimpleNamespace(position=deviation))
        one: Any = SimpleNamespace(at=np.array(at), number=np.array(number), fine=fine, noise=noise,
                                   grid=SimpleNamespace(crowded=crowded, divisible=divisible))
        corrected = np.array([one for one in number if rng.random() < 0.5], dtype=int)
        expected = [beside_air(at, number, air & (samples > 0), place, crowded | divisible, yields, noise, target, corrected)
                    for target in corrected.tolist()]
        assert air_beside(one, corrected) == pytest.approx(expected, abs=1e-12)
        found += expected
    assert 0.05 < np.mean(np.array(found) > 0) < 0.6
    assert not air_beside(None, np.arange(4)).any()


def test_what_is_left_between_targets_is_how_far_the_driven_tool_is_off(tmp_path: Path) -> None:
    """Three targets with none between them, driven by the independent arm under a force that varies all the way: the largest
    of all places, as it is told, and the mean square of either move."""
    path, job_of = Path3(LINES[:3]), np.arange(0, 120.05, 0.1)
    push = np.column_stack([50 + 0 * job_of, 150 + 100 * np.sin(job_of / 25), -80 + 0 * job_of])
    job = Job(tmp_path, program=path.program(), forces="path_mm,fx_n,fy_n,fz_n\n" + "".join(
        f"{a:.3f},{f[0]:.5f},{f[1]:.5f},{f[2]:.5f}\n" for a, f in zip(job_of, push, strict=True)))
    job.write()
    files = (tmp_path / name for name in ("cell.yaml", "part.mod", "stiffness.json", "forces.csv"))
    made = correct(predict_files(Inputs(*files), Settings.of(keep_targets=True)))
    written, start, end, q = kit.targets_of(made.content.decode()), path.frames[0].p, path.frames[2].p, path.q[0]
    off: list[list[float]] = [[], []]
    for move, (first, last) in enumerate(itertools.pairwise(written)):
        for share in np.linspace(0.005, 0.995, 25):
            command = between(first, last, share)
            s = 1e3 * distance_from_line(command.p, start, end)[1]
            wrench = np.array([50, 150 + 100 * np.sin(s / 25), -80, 0, 0, 0])
            point, q = off_plan(command, q, wrench)
            off[move].append(distance_from_line(point, start, end)[0])
    found = made.between
    assert found is not None
    assert found.left.max() == pytest.approx(max(max(one) for one in off), rel=0.02)
    for move in (0, 1):
        seen = found.owner == move + 1
        assert np.sqrt(np.mean(found.left[seen] ** 2)) == pytest.approx(np.sqrt(np.mean(np.square(off[move]))), rel=0.03)
        assert np.sqrt(np.mean(found.square[seen])) == pytest.approx(np.sqrt(np.mean(np.square(off[move]))), rel=0.03)
    np.testing.assert_array_equal(found.piece, found.owner)
    (told,) = (one.message for one in made.findings if one.code == "CS3091")
    assert f"up to {1e6 * found.left.max():.1f} um off the plan in 2 moves" in told


def test_the_tare_names_targets_of_the_program_given(tmp_path: Path) -> None:
    """The sensor's bias is taken from the air behind a cut that begins at once, with intermediate targets in between."""
    path, written = Path3(LINES), []
    for bias in (0.0, 60.0):
        s = np.arange(0, 160, 0.1)
        values = force(s + ENTRY) + bias
        text = "path_mm,fx_n,fy_n,fz_n\n" + "".join(
            f"{a:.3f},{f[0]:.5f},{f[1]:.5f},{f[2]:.5f}\n" for a, f in zip(s, values, strict=True))
        (folder := tmp_path / f"{bias:g}").mkdir()
        job = Job(folder, program=path.program(), forces=text)
        result = job.correct("--json", *(["--tare", "3:3"] if bias else []))
        assert result.code == 0
        assert result.json["result"]["added_targets"] > 5
        written.append(np.array([frame.p for frame in kit.targets_of(job.out.read_text())]))
    assert written[0].shape == written[1].shape
    np.testing.assert_allclose(written[1], written[0], rtol=0, atol=2e-7)


def test_a_force_that_stays_needs_no_targets(tmp_path: Path) -> None:
    path = Path3(LINES)
    text = "path_mm,fx_n,fy_n,fz_n\n" + "".join(f"{s:.1f},20,90,-30\n" for s in np.arange(0, 160, 0.1))
    result = (job := Job(tmp_path, program=path.program(), forces=text)).correct("--json")
    assert result.code == 0
    assert result.json["result"]["added_targets"] == 0
    assert len(kit.targets_of(job.out.read_text())) == 4


def test_targets_named_in_the_log_posture_alone_asks_for_more(tmp_path: Path) -> None:
    """Half a metre under one force: the arm is not equally soft along it."""
    path = Path3(np.array([[0, 0, 0], [250, 100, -250]], dtype=float))
    job = Job(tmp_path, program=path.program(), forces="target,fx_n,fy_n,fz_n\n0,100,250,-100\n1,100,250,-100\n")
    wrench, worst = np.array([100, 250, -100, 0, 0, 0.0]), []
    for option in ("--tolerance=0.3", "--keep-targets"):
        assert job.correct("--force", option).code == 0
        written, q, largest = kit.targets_of(job.out.read_text()), path.q[0], 0.0
        for first, last in itertools.pairwise(written):
            for share in (0.0, 0.5):
                point, q = off_plan(between(first, last, share), q, wrench)
                largest = max(largest, distance_from_line(point, path.frames[0].p, path.frames[1].p)[0])
        worst.append(largest)
    assert worst[0] < 0.4e-6 < 0.7e-6 < worst[1]


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r\r\n"])
def test_the_text_given_stays_and_the_added_lines_look_like_it(tmp_path: Path, newline: str) -> None:
    path = Path3(LINES)
    moves = [kit.move(path.text[0]), "    ! into the cut", kit.move(path.text[1]).replace(",z1,", ",fine\\Inpos:=inpos50,"),
             "\tMoveL p3, v50 , z1 ,tMill\\WObj:=wPart; ! out", "    SetDO doDone,1;", kit.move(path.text[3])]
    data = [kit.tooldata(), kit.wobjdata(), f"CONST robtarget p3:={path.text[2]};"]
    program = kit.module(moves, data).replace("\n", newline)
    job = Job(tmp_path, program=program.encode(), forces=log(160))
    assert job.correct().code == 0
    lines = job.out.read_bytes().decode().split(newline)
    own = program.split(newline)

    def bare(line: str) -> str:
        return re.sub(r"-?\d+\.\d+", "#", line)

    kept = [bare(line) for line in lines if bare(line) in {bare(one) for one in own} or "p3" in line]
    assert [line for line in kept if "z0" not in line and "! into" not in line][:3] == [bare(line) for line in own[:3]]
    assert sum("! into the cut" in line for line in lines) == sum("! out" in line for line in lines) == 1
    into = [line for line in lines if ",z0," in line]
    assert into, "further targets of a move that stops are fly-by points"
    assert all(line.startswith("    MoveL [[") and "Inpos" not in line for line in into)
    assert sum("fine\\Inpos:=inpos50" in line for line in lines) == 1
    tabbed = [line for line in lines if line.startswith("\tMoveL [[")]
    assert tabbed
    assert all(line.endswith(", v50 , z1 ,tMill\\WObj:=wPart;") for line in tabbed)
    last = next(i for i, line in enumerate(lines) if "SetDO" in line)
    assert lines[last + 1].lstrip().startswith("MoveL"), "nothing comes between an instruction and the move behind it"
    assert "[9E9" in lines[last + 1]


@pytest.mark.parametrize("wrong", ["", "a place", "a turn", "one more", "one less"])
def test_a_text_with_more_targets_that_does_not_read_back_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: str
) -> None:
    """One of the program's own targets is another by a micrometre or a turn, or there is a move more or less than was meant."""
    path = Path3(LINES)
    job = Job(tmp_path, program=path.program(), forces=log(160))
    own = kit.move(path.text[2])
    place, turn = path.text[2].split(",", 1)[0].encode(), re.findall(r"\],(\[.+?\]),", path.text[2])[0].encode()
    said, instead = {"": (b"", b""), "a place": (place, place[:-3] + str((int(place[-3:]) + 500) % 1000).zfill(3).encode()),
                     "a turn": (turn, turn.replace(b"[", b"[-", 1).replace(b"--", b"")),
                     "one more": (own.encode(), f"{own}\n{own}".encode()), "one less": (own.encode(), b"    ! none")}[wrong]
    real = intermediate_targets.with_more_moves
    assert said in path.program().encode()
    monkeypatch.setattr(intermediate_targets, "with_more_moves", lambda program, more: real(program, more).replace(
        said if more else b"", instead if more else b"", 1))
    result = job.correct("--json")
    if not wrong:
        assert result.code == 0
        assert result.json["result"]["added_targets"] > 0
        return
    assert result.code == 1
    (found,) = (one for one in result.json["findings"] if one["level"] == "error")
    assert (found["code"], found["file"]) == ("CS4332", str(tmp_path / "part.mod"))
    assert found["message"] == "the program with intermediate targets does not read back as it was meant; nothing was written"
    assert "--keep-targets" in found["hint"]
    job.nothing_written()
    assert job.correct("--keep-targets").code == 0


@pytest.mark.parametrize("change", [
    ("    MoveL", "    IF go MoveL"), (",v50,z1", ",v50\\T:=2,z1"), ("    MoveL", "    Retract;\n    MoveL"),
    ("    MoveL", "    MoveL\\Conc,"),
], ids=["compact IF", "a time", "a call before", "Conc"])
def test_moves_that_do_not_stand_by_themselves_are_left_whole(tmp_path: Path, change: tuple[str, str]) -> None:
    path = Path3(LINES[:2])
    moves = [kit.move(path.text[0]), kit.move(path.text[1]).replace(*change)]
    result = (job := Job(tmp_path, program=kit.module(moves), forces=log(60))).correct("--json")
    if result.code == 0:
        assert result.json["result"]["added_targets"] == 0
        assert len(kit.targets_of(job.out.read_text())) == 2
    else:
        assert result.code == 1
        job.nothing_written()


RADIUS = 30.0
ARC = np.array([[0, 0, 0], [10, 0, 0], [10 + RADIUS, RADIUS, 0], [10, 2 * RADIUS, 0], [0, 2 * RADIUS, 0]])


def arc_force(s: np.ndarray, wave: float) -> np.ndarray:
    return np.column_stack([50 + 0 * s, 150 + 100 * np.sin(s / wave), -80 + 0 * s])


def on_arc(a: np.ndarray, b: np.ndarray, c: np.ndarray, share: float) -> np.ndarray:
    """The point at a share of the arc from a over b to c, by the perpendicular bisectors."""
    u, v = b - a, c - a
    w = np.cross(u, v)
    centre = a + np.cross(w, u * (v @ v) - v * (u @ u)) / (2 * (w @ w))
    axis = w / np.linalg.norm(w)
    sweep = np.mod(np.arctan2(axis @ np.cross(a - centre, c - centre), (a - centre) @ (c - centre)), 2 * np.pi)
    return centre + Rotation.from_rotvec(share * sweep * axis).apply(a - centre)


@pytest.mark.parametrize(("wave", "cut", "step"), [(25.0, True, 0.05), (25.0, True, 1.7), (1e9, False, 0.05)],
                         ids=["varies", "varies, slow log", "stays"])
def test_an_arc_is_kept_where_the_corrected_arc_is_one(tmp_path: Path, wave: float, cut: bool, step: float) -> None:
    """Of a slow log most points of an arc have no sample of their own: they get what lies between. (They had stayed as
    planned beside their corrected neighbours, the arc was cut finer and finer for that, and nobody was told.)"""
    path = Path3(ARC)
    moves = [kit.move(path.text[0]), kit.move(path.text[1]),
             f"    MoveC {path.text[2]},{path.text[3]},v50,z1,tMill\\WObj:=wPart;", kit.move(path.text[4])]
    s = np.arange(0, 20 + np.pi * RADIUS, step)
    text = "path_mm,fx_n,fy_n,fz_n\n" + "".join(
        f"{a:.2f},{f[0]:.4f},{f[1]:.4f},{f[2]:.4f}\n" for a, f in zip(s, arc_force(s, wave), strict=True))
    job = Job(tmp_path, program=kit.module(moves), forces=text)
    result = job.correct("--json")
    assert result.code == 0
    out = job.out.read_text()
    told = [(one["level"], one["file"], one["line"], one["message"].partition(":")[0]) for one in result.json["findings"]
            if one["code"] == "CS4331"]
    line = 1 + next(number for number, text in enumerate(str(job.program).splitlines()) if "MoveC" in text)
    assert told == [("note", str(tmp_path / "part.mod"), line, f"1 MoveC cut into {out.count('MoveC')} arcs")] * cut
    assert out.count("MoveC") == (4 if cut else 1) or (step > 1 and out.count("MoveC") < 8)
    written, centre = kit.targets_of(out), path.at(ARC[1] + [0, RADIUS, 0])[0] / 1e3
    normal = np.cross(path.frames[1].p - centre, path.frames[2].p - centre)
    normal /= np.linalg.norm(normal)
    worst, q = 0.0, path.q[1]
    lines = [line.split()[0] for line in out.splitlines() if line.strip().startswith("Move")]
    # A line before the arc may have got a target; each MoveC names two.
    start = lines.index("MoveC") - 1
    for i in range(start, start + 2 * lines.count("MoveC"), 2):
        a, b, c = written[i:i + 3]
        for share in (0.25, 0.5, 0.75):
            command = Frame(on_arc(a.p, b.p, c.p, share), a.r)
            radius = path.frames[1].p - centre
            here = command.p - centre
            turned = np.arctan2(normal @ np.cross(radius, here), radius @ here)
            wrench = np.r_[arc_force(np.array([10 + RADIUS * turned]), wave)[0], 0, 0, 0]
            point, q = off_plan(command, q, wrench)
            height = (point - centre) @ normal
            worst = max(worst, float(np.hypot(np.linalg.norm(point - centre - height * normal) - RADIUS / 1e3, height)))
    assert worst < 5e-6
    if cut:
        assert job.correct("--force", "--keep-targets").code == 0
        assert job.out.read_text().count("MoveC") == 1


def test_tooth_passing_is_no_force_to_follow(sample: Corrected, sample_inputs: Inputs) -> None:
    """Where the spindle's speed is ambiguous short means are tooth passing: no target is added for them. With the speed stated
    targets are, and along a cut their offsets do not go to and fro."""
    (coarse,) = (finding for finding in sample.findings if finding.code == "CS3093")
    told = re.match(r"between targets nothing is looked at that is shorter than (\d+) ms: ", coarse.message)
    assert told
    # What is left of the lines moves the tool by less than half the tolerance, in pieces that last longer the less that is.
    assert (coarse.level, coarse.file) == ("note", str(sample_inputs.forces))
    closest = 1e3 * CLOSEST.time
    for tolerance, said in ((5e-6 * int(told[1]) / (1.1 * closest), True), (5e-6 * int(told[1]) / (0.9 * closest), False)):
        looser = replace(sample.planned, settings=Settings.of(tare=((0, 2),), tolerance=tolerance))
        again, _, _ = intermediate_targets.with_intermediate_targets(looser)
        assert [f"{1.1 * closest:.0f} ms" in one.message for one in again.findings if one.code == "CS3093"] == [True] * said
    assert len(sample.predicted.path.toolpath) == len(sample.predicted.program.toolpath)
    settings = Settings.of(tare=((0, 2),), spindle_rpm=9000.0)
    known = correct(predict_files(sample_inputs, settings))
    assert "CS3093" not in {finding.code for finding in known.findings}
    assert len(known.correction.targets) > len(sample.correction.targets)
    turn = np.diff(known.correction.offset, n=2, axis=0)[np.all(np.diff(known.correction.targets)[:-1, None] == 1, axis=1)]
    assert np.median(np.linalg.norm(turn, axis=1)) < 5e-6


def test_a_few_moves_of_a_program_are_looked_at_like_all_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two long lines and an arc far from each other, among short moves: what is written and what is said does not depend on
    whether the rest of the program stands on the grid with them; nor on the offsets of the pass that was logged."""
    def short(x: float, y: float) -> list[list[float]]:
        return [[x + 2 * k, y, 0] for k in range(12)]

    points = [*short(0, 0), [180, 0, 0], *short(182, 0), [204 + RADIUS, RADIUS, 0], [204, 2 * RADIUS, 0],
              *reversed(short(180, 2 * RADIUS)), [20, 2 * RADIUS, 0], *reversed(short(-4, 2 * RADIUS))]
    path, count = Path3(np.array(points, dtype=float)), len(points)
    via = points.index([204 + RADIUS, RADIUS, 0])
    moves = [kit.move(text) for text in path.text]
    moves[via:via + 2] = [f"    MoveC {path.text[via]},{path.text[via + 1]},v50,z1,tMill\\WObj:=wPart;"]
    rows = [f"{k},100,{250 + 40 * np.sin(k):.3f},-100" for k in range(count) for _ in range(1 + k % 3)]
    job = Job(tmp_path, program=kit.module(moves), forces="\n".join(["target,fx_n,fy_n,fz_n", *rows, ""])).write()
    offsets = "\n".join(["target,x_mm,y_mm,z_mm,ox_mm,oy_mm,oz_mm", *(
        f"{k},{','.join(f'{x:.6f}' for x in 1e3 * frame.p)},{0.01 * np.sin(k):.6f},0.02,{0.001 * k:.6f}"
        for k, frame in enumerate(path.frames)), ""])
    (tmp_path / "logged.csv").write_text(offsets)
    inputs = Inputs(*(tmp_path / name for name in ("cell.yaml", job.name, "stiffness.json", "forces.csv")))
    settings = Settings.of(tolerance=0.2e-6, cutting_stiffness=Estimate(4e5, 1e5), logged_with=tmp_path / "logged.csv")
    part = correct(predict_files(inputs, settings))
    seen: list[int] = []
    monkeypatch.setattr(intermediate_targets, "asks_for_all", lambda *_: not seen.append(1))
    whole = correct(predict_files(inputs, settings))
    assert seen
    assert part.between is not None
    assert whole.between is not None
    assert len(part.kept) == count
    assert len(part.predicted.path.toolpath) > count + 4
    assert set(part.between.owner) == {12, via, via + 1, via + 14}
    assert part.content == whole.content
    np.testing.assert_array_equal(part.predicted.forces.samples, whole.predicted.forces.samples)
    np.testing.assert_array_equal(part.between.owner, whole.between.owner)
    np.testing.assert_allclose(part.between.left, whole.between.left, rtol=1e-6, atol=1e-13)
    np.testing.assert_allclose(part.left.std, whole.left.std, rtol=1e-9)
    assert [finding.message for finding in part.findings] == [finding.message for finding in whole.findings]


def test_points_of_a_grid_are_driven_like_the_moves_they_lie_on(tmp_path: Path) -> None:
    """Frames and angles against the independent arm; a point outside the joints' limits is not reached."""
    short = [[2.0 * k, 0, 0] for k in range(20)]
    path = Path3(np.array([*short, [238, 40, 0], *([x + 240, 40, 0] for x, _, _ in short)], dtype=float))
    forces = "".join(f"{k},100,250,-100\n" for k in range(41))
    Job(tmp_path, program=path.program(), forces="target,fx_n,fy_n,fz_n\n" + forces).write()
    inputs = Inputs(*(tmp_path / name for name in ("cell.yaml", "part.mod", "stiffness.json", "forces.csv")))
    planned = predict_files(inputs)
    pieces = np.where(np.arange(41) == 20, 0.02, np.inf)
    grid = fine_grid(planned.program.text, planned.path, pieces, pieces, 1e-5, keep=False, whole=asks_for_all(planned, pieces))
    assert grid is not None
    assert grid.targets.tolist() == list(range(16, 24))
    assert grid.further.sum() == 9
    assert not grid.crowded.any()
    apart = np.full(41, 0.05)
    close = fine_grid(planned.program.text, planned.path, apart, pieces, 1e-5, keep=False, whole=False)
    assert close is not None        # points nearer to the move's ends than targets may stand: no want of room on the move
    np.testing.assert_array_equal(close.crowded[close.further], ~close.may[close.further] & ~close.beside_zone[close.further])
    assert 0 < close.crowded.sum() < close.further.sum()
    fine = grid_path(planned.path, grid)
    assert fine.reached.all()
    for k, point in enumerate(np.flatnonzero(grid.further)):
        here = kit.work_object() @ between(path.frames[19], path.frames[20], (k + 1) / 10)
        rest = kit.tcp_pose(IRB6660, fine.theta[point], TOOL)
        pose = fine.base_from_tcp[int(point)]
        for frame in (Frame(pose.position, Rotation.from_matrix(pose.rotation)), rest):
            np.testing.assert_allclose(frame.p, here.p, atol=1e-7)
            assert (frame.r * here.r.inv()).magnitude() < 1e-7
    robot = planned.cell.robot
    narrow = replace(robot, limits=np.column_stack([robot.limits[:, 0], np.r_[robot.limits[:5, 1], robot.limits[5, 0] + 0.01]]))
    fine = grid_path(replace(planned.path, cell=replace(planned.cell, robot=narrow)), grid)
    np.testing.assert_array_equal(fine.reached, ~grid.further)


def test_what_stands_around_a_move_is_as_far_from_both_of_its_ends() -> None:
    """The move to target k begins at k - 1: from three targets before that to three behind k, and none beyond the program."""
    for moves, around in (([20], range(16, 24)), ([1], range(5)), ([29], range(25, 30)),
                          ([3, 28], [*range(7), *range(24, 30)])):
        assert _around(np.array(moves), 30).tolist() == list(around)


def off_at(job: Job, path: Path3, places: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far off the line the loaded tool is [m] at places (n,) [mm] along it, driven by the corrected and by the given
    program, under the true force (n, 3) [N] of each place."""
    start, end = path.frames[0].p, path.frames[-1].p
    off = np.empty((2, len(places)))
    for row, frames in enumerate((kit.targets_of(job.out.read_text()), path.frames)):
        along = 1e3 * np.array([distance_from_line(frame.p, start, end)[1] for frame in frames])
        q = path.q[0]
        for k, place in enumerate(places):
            last = int(np.clip(np.searchsorted(along, place), 1, len(frames) - 1))
            share = (place - along[last - 1]) / (along[last] - along[last - 1])
            point, q = off_plan(between(frames[last - 1], frames[last], share), q, np.r_[force[k], 0, 0, 0])
            off[row, k] = distance_from_line(point, start, end)[0]
    return off[0], off[1]


@pytest.mark.parametrize(("step", "air"), [
    (0.1, "v100"), (4.3, "v500"), pytest.param(7.1, "v500", marks=pytest.mark.long)])
@pytest.mark.parametrize("in_full", [False, pytest.param(True, marks=pytest.mark.long)])
def test_where_no_target_can_be_added_none_is_moved_off_the_plan_at_the_edge_of_a_cut(
    tmp_path: Path, step: float, air: str, in_full: bool
) -> None:
    """A force that begins at a target and grows over 5 mm, moves of 60 mm, `--keep-targets`: the mean over half of the moves on
    either side is half of the force, by which the target had been moved off the plan, on which it had stood. Nowhere the tool
    is farther off than it was; where no sample lies near enough to tell, by no more than what is stated."""
    places = np.array([0, 30, 60, 120, 180, 240, 300, 330, 360])
    path = Path3(np.column_stack([places, *np.zeros((2, len(places)))]))
    s = np.arange(0.7, 360, step)

    def push(s: np.ndarray) -> np.ndarray:
        begin, end = np.clip((s - 60) / 5, 0, 1), np.clip((300 - s) / 5, 0, 1)
        return np.outer(begin * (s <= 300 if in_full else end), [50.0, 200.0, -80.0])

    text = "path_mm,fx_n,fy_n,fz_n\n" + "".join(
        f"{a:.2f},{f[0]:.4f},{f[1]:.4f},{f[2]:.4f}\n" for a, f in zip(s, push(s), strict=True))
    feeds = [air] * 3 + ["v50"] * 4 + [air] * 2
    program = kit.module([kit.move(t).replace("v50", feed) for t, feed in zip(path.text, feeds, strict=True)])
    assert program.count("v50,") == 4
    job = Job(tmp_path, program=program, forces=text)
    assert job.correct("--keep-targets").code == 0
    rows = job.offsets()
    at = np.sort(np.concatenate([np.arange(60, 300.1, 1.5), [60.2, 299.8]]))
    now, before = off_at(job, path, at, push(at))
    stated = np.array([float(row["left_um"] or 0) for row in rows]) * 1e-6
    worst = int(np.argmax(now - before))
    nearest = int(np.argmin(np.abs(places - at[worst])))
    assert (now - before).max() < (8e-6 if step < 1 else max(8e-6, 2 * stated[nearest]))
    assert now[(at > 115) & (at < 245)].max() < 40e-6 < 200e-6 < before.max()
    if step < 1:
        assert 1e-3 * np.linalg.norm(kit.column(rows, "ox_mm", "oy_mm", "oz_mm"), axis=1)[2] < 5e-6


def test_a_log_that_names_targets_in_time_corrects_as_one_of_path_lengths_does(tmp_path: Path) -> None:
    """A force that begins, turns round and ends between targets 30 to 60 mm apart: the same targets are added, but for what the
    place of two samples makes, and nothing is left there that the targets alone would leave."""
    places = np.array([0, 30, 60, 120, 180, 240, 300, 330, 360])
    path = Path3(np.column_stack([places, *np.zeros((2, len(places)))]))
    s = np.arange(0, 360, 0.25)
    number = np.argmin(np.abs(s[:, None] - places), axis=1)
    push = np.outer(((s > 70) & (s < 290)) * np.where(s < 200, 1.0, -1.0), [50.0, 200.0, -80.0])
    push += np.random.default_rng(3).normal(0, 0.2, (len(s), 3))
    made = {}
    for column, values in (("target", number), ("path_mm", s)):
        text = f"time_s,{column},fx_n,fy_n,fz_n\n" + "".join(
            f"{t:.5f},{k:g},{f[0]:.4f},{f[1]:.4f},{f[2]:.4f}\n" for t, k, f in zip(s / 100, values, push, strict=True))
        (tmp_path / column).mkdir()
        job = Job(tmp_path / column, program=path.program(), forces=text)
        assert job.correct("--tare", "0:1").code == 0
        made[column] = np.array([1e3 * (ORIGIN.inv() @ frame).p for frame in kit.targets_of(job.out.read_text())])
    assert len(made["target"]) > len(places) + 6
    along = np.linspace(40, 320, 1121)
    offsets = [np.column_stack([np.interp(along, where[:, 0], where[:, axis]) for axis in (1, 2)]) for where in made.values()]
    off = 1e3 * np.linalg.norm(offsets[0] - offsets[1], axis=1)
    assert np.median(off) < 1
    assert np.mean(off > 5) < 0.02


def test_a_log_that_names_targets_says_that_the_edge_of_a_cut_is_not_known(tmp_path: Path) -> None:
    """Half of the stretch of a target in the air and half in the cut: its force is nothing or all of it, and what is stated as
    left there is as large as what is corrected. Without time, and with as many samples of each target, nothing says when they
    were taken."""
    places = 45 * np.arange(9)
    path = Path3(np.column_stack([places, *np.zeros((2, len(places)))]))
    s = np.arange(0, 360, 0.25)
    number = np.argmin(np.abs(s[:, None] - places), axis=1)
    drift = np.outer(s / 360, [0.0, 6.0, 0.0])                 # so that the air behind shows a force, too
    push = np.outer((s > 90) & (s < 270), [50.0, 200.0, -80.0]) + drift + np.random.default_rng(3).normal(0, 2, (len(s), 3))
    text = "target,fx_n,fy_n,fz_n\n" + "".join(
        f"{k},{f[0]:.4f},{f[1]:.4f},{f[2]:.4f}\n" for k, f in zip(number, push, strict=True))
    job = Job(tmp_path, program=path.program(), forces=text)
    assert job.correct("--tare", "0:1").code == 0
    rows = job.offsets()
    left, offset = kit.column(rows, "left_um")[:, 0], 1e3 * np.linalg.norm(kit.column(rows, "ox_mm", "oy_mm", "oz_mm"), axis=1)
    for edge, inside in ((2, 3), (6, 5)):
        # It may be off by what is made there, and by what is not made of the full force.
        wrong = max(offset[edge], abs(offset[inside] - offset[edge]))
        assert wrong > 100
        assert wrong < 2 * left[edge]
