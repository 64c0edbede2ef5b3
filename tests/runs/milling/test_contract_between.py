"""Between the targets: the written program, driven as a controller drives it (straight lines, arcs, even turning, zones as
parabolas), keeps the loaded tool within the tolerance of the planned curve, measured across it every half millimetre; for every
form of toolpath, and for every column that places a log. Arm, controller and force are the virtual cell's."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.runs.command_line import user_files as kit
from tests.runs.milling.line_job import ARCS, DENSE, LINES, SHORT, LineJob
from tests.support import long
from tests.virtual_cell import controller
from tests.virtual_cell.arm import ARMS

RODS, SERIAL, STIFF = "irb6660-205-1.90", "irb6700-200-2.60", "irb6640-235-2.55"
ROUNDING_UM = 0.2


@pytest.mark.parametrize("robot", [RODS, SERIAL])
def test_the_arm_is_that_of_the_drawing(robot: str) -> None:
    """Many poses at once, how they move with the drives, and the balance under force, against `Arm` pose by pose."""
    arm, rng, tcp, force = ARMS[robot], np.random.default_rng(5), np.array([0.1, -0.02, 0.26]), np.array([120.0, -250.0, 90.0])
    q = kit.START + rng.uniform(-0.3, 0.3, (3, 6))
    place, turn, columns = controller.stance(arm, q, tcp)
    rest = controller.loaded(arm, q, tcp, np.tile(force, (3, 1)), kit.K)
    for i, angles in enumerate(q):
        p, r = arm.pose(angles, tcp)
        np.testing.assert_allclose(place[i], p, atol=1e-12)
        np.testing.assert_allclose(turn[i], r.as_matrix(), atol=1e-12)
        for joint, step in enumerate(1e-6 * np.eye(6)):
            (ahead, one), (behind, other) = arm.pose(angles + step, tcp), arm.pose(angles - step, tcp)
            np.testing.assert_allclose(columns[i, :, joint], np.r_[ahead - behind, (one * other.inv()).as_rotvec()] / 2e-6,
                                       atol=1e-8)
        np.testing.assert_allclose(rest[i], arm.pose(arm.loaded(angles, tcp, np.r_[force, 0, 0, 0], kit.K), tcp)[0], atol=1e-9)


def codes(result: dict) -> set[str]:
    return {finding["code"] for finding in result["findings"]}


@pytest.mark.parametrize(("path", "tolerance"), [
    (LINES, 2.0), long(LINES, 20.0), (ARCS, 3.0), long(ARCS, 20.0), (SHORT, 5.0)])
def test_the_tolerance_is_kept_between_targets(tmp_path: Path, path: str, tolerance: float) -> None:
    job = LineJob(tmp_path, path, zone="z0")
    assert job.off_um(job.program).max() > 200
    off, result, _ = job.correct("path_mm", "--tolerance", tolerance)
    said = result["result"]["between_um"]
    assert off.max() < tolerance + ROUNDING_UM
    # What is printed is no less than what an arm of its own finds.
    assert off.max() - 0.35 * tolerance < said["largest"] < tolerance + ROUNDING_UM
    assert not codes(result) & {"CS3091"}
    kept, without, _ = job.correct("path_mm", "--tolerance", tolerance, "--keep-targets")
    assert kept.max() > tolerance
    assert without["result"]["between_um"]["largest"] == pytest.approx(kept.max(), rel=0.1)
    assert "CS3091" in codes(without)
    assert not without["result"]["added_targets"]


@pytest.mark.parametrize("by", ["position", "joints", "target"])
@pytest.mark.parametrize("robot", [RODS, long(SERIAL)])
def test_whatever_places_the_log(tmp_path: Path, robot: str, by: str) -> None:
    """A log that names targets says no more than its targets do: they stand every millimetre."""
    job = LineJob(tmp_path, DENSE if by == "target" else ARCS, robot, zone="z0")
    off, _, _ = job.correct(by, "--tolerance", 5)
    assert off.max() < 5 + ROUNDING_UM


def test_named_targets_keep_it_where_the_force_is_straight_between_them(tmp_path: Path) -> None:
    """Half a metre, the arm not equally soft along it."""
    def straight(job: LineJob, s: np.ndarray) -> np.ndarray:
        return np.column_stack([60 + 0.3 * s, 250 - 0.2 * s, -80 + 0 * s])

    job = LineJob(tmp_path, "J 0,0 L 300,60 V 320,80 L 300,100", STIFF, zone="z0", force_of=straight)
    off, _, _ = job.correct("target", "--tolerance", 2)
    assert off.max() < 2 + ROUNDING_UM


def test_a_log_by_time_is_as_good_as_its_place(tmp_path: Path) -> None:
    """Placed by the program's timing, between air moves, to about two millimetres; the deviation rises by 40 um in one."""
    path = "J 0,0 A 20,0 L 60,0 L 60,40 A 60,60 A 0,60 A 0,50 L 0,20 L 40,20 A 60,20 A 60,-20 L 0,-20 A -20,-20"

    def in_the_cuts(job: LineJob, s: np.ndarray) -> np.ndarray:
        from_air = np.min([np.maximum(np.maximum(first - s, s - last), 0.0) for first, last in job.air], axis=0)
        size = 0.5 - 0.5 * np.cos(np.pi * np.clip((from_air - 3) / 8, 0, 1))
        return np.asarray(size[:, None] * np.column_stack([50 + 0 * s, 150 + 60 * np.sin(s / 25), -80 + 0 * s]))

    job = LineJob(tmp_path, path, zone="fine", force_of=in_the_cuts, noise_n=2.0)
    before, (off, _, _) = job.off_um(job.program), job.correct("time")
    assert before.max() > 150
    assert off.max() < 100
    assert np.sqrt(np.mean(off**2)) < 0.2 * np.sqrt(np.mean(before**2))


@pytest.mark.parametrize("form", ["apt", "csv"])
def test_posted_toolpaths_keep_it(tmp_path: Path, form: str) -> None:
    """APT with lines and an arc, and a table of targets: posted first, and measured against what was posted."""
    job = LineJob(tmp_path, "J 0,0 L 60,0 V 90,30 L 60,60 L 0,60", zone="z0")
    cell = kit.cell_text(job.robot) + "workobject: " + kit.yaml_frame(kit.USER @ kit.OBJECT) + "\n"
    source = posted_source(job, form)
    (tmp_path / "cell.yaml").write_text(cell)
    (tmp_path / f"part.{form}").write_text(source)
    options = ["--tool-x", "0,1,0"] if form == "apt" else []
    done = kit.run("post", tmp_path / "cell.yaml", tmp_path / f"part.{form}", "-o", tmp_path / "planned.mod", *options)
    assert done.code == 0, done
    as_posted = (tmp_path / "planned.mod").read_text()
    posted = LineJob(tmp_path / "posted", job.path, zone="z0", text=as_posted)
    (tmp_path / "forces.csv").write_text(posted.log("position"))
    (tmp_path / "stiffness.json").write_text(kit.stiffness_text())
    out = tmp_path / "out.mod"
    done = kit.run("correct", tmp_path / "cell.yaml", tmp_path / f"part.{form}", "--stiffness", tmp_path / "stiffness.json",
                   "--forces", tmp_path / "forces.csv", "-o", out, "--json", "--tolerance", 5, *options)
    assert done.code == 0, done
    assert posted.off_um(as_posted).max() > 150
    assert posted.off_um(out.read_text()).max() < 5 + ROUNDING_UM


def posted_source(job: LineJob, form: str) -> str:
    """The path as APT, the axis as the tool of the poses has it at the start, or as a table."""
    mm = np.array([1e3 * pose.p for pose in job.poses])
    if form == "csv":
        turn = np.roll(Rotation.concatenate([pose.r for pose in job.poses]).as_quat(canonical=True), 1, axis=1)
        on = [0, 1, 3, 4]
        rows = np.column_stack([mm, turn, np.full(len(mm), 50.0)])[on]
        return "x_mm,y_mm,z_mm,q1,q2,q3,q4,feed_mm_s\n" + "".join(",".join(f"{v:.9f}" for v in row) + "\n" for row in rows)
    axis = -job.origin.r.as_matrix()[:, 2]
    centre, normal = 1e3 * job.origin.p + job.origin.r.apply([60.0, 30.0, 0.0]), -axis

    def words(*values: float) -> str:
        return ",".join(f"{value:.6f}" for value in values)

    lines = ["UNITS/MM", "MULTAX/ON", "RAPID", f"GOTO/{words(*mm[0], *axis)}", "FEDRAT/3000,MMPM",
             f"GOTO/{words(*mm[1], *axis)}",
             f"CIRCLE/{words(*centre, *normal, 30.0)}", f"GOTO/{words(*mm[3], *axis)}", f"GOTO/{words(*mm[4], *axis)}"]
    return "\n".join(lines) + "\n"


def test_a_ramp_is_no_noise(tmp_path: Path) -> None:
    """Samples scatter about a force that rises: what they tell of it does not count as noise."""
    job = LineJob(tmp_path, LINES, SERIAL, zone="z0")
    _, result, _ = job.correct("path_mm", "--tolerance", 5)
    assert result["result"]["between_um"]["scatter_rms"] < 0.05
    noisy = LineJob(tmp_path / "noisy", LINES, SERIAL, zone="z0", noise_n=2.0)
    off, result, _ = noisy.correct("path_mm", "--tolerance", 5)
    # Three samples a piece, 1.2 um/N in the softest direction.
    assert 1.0 < result["result"]["between_um"]["scatter_rms"] < 4.0
    assert off.max() < 5 + 3 * result["result"]["between_um"]["scatter_rms"]


def test_scatter_hides_nothing_of_what_is_expected_between_targets(tmp_path: Path) -> None:
    """What the driven program leaves is expected as much by a noisy log as by a clean one."""
    expected = {}
    for noise in (0.0, 2.0):
        job = LineJob(tmp_path / f"{noise:g}", SHORT, zone="z0", noise_n=noise)
        off, result, _ = job.correct("path_mm", "--keep-targets")
        expected[noise] = result["result"]["expected_left_um"]["between"]
        assert expected[noise] > 0.9 * np.sqrt(np.mean(off**2)) > 1.0
    assert expected[2.0] == pytest.approx(expected[0.0], rel=0.15)


def test_where_the_force_jumps_the_place_is_said(tmp_path: Path) -> None:
    """Beside the jump a target on either side, and what is left between them, half the step, told with its move."""
    def step(job: LineJob, s: np.ndarray) -> np.ndarray:
        return np.where((s > 33.3)[:, None] & (s < 130)[:, None], [40.0, 200.0, -60.0], 0.0)

    job = LineJob(tmp_path, LINES, zone="z0", force_of=step)
    off, result, text = job.correct("path_mm")
    found = [finding for finding in result["findings"] if finding["code"] == "CS3091"]
    assert len(found) == 1
    assert found[0]["level"] == "note"
    assert found[0]["target"] in (1, 3)
    assert result["result"]["between_um"]["largest"] == pytest.approx(0.5 * job.off_um(job.program).max(), rel=0.25)
    at = job.where(text)
    near = np.minimum(np.abs(at - 33.3), np.abs(at - 130)) < 1.0
    assert off[near].max() > 50
    assert off[~near].max() < 5 + ROUNDING_UM
    coarse, _, text = job.correct("path_mm", "--min-spacing", "4")
    assert length_over(coarse, job.where(text)) > 3 * length_over(off, at)


def length_over(off: np.ndarray, at: np.ndarray) -> float:
    """On how much of the path [mm] the tool is more than 50 um off: places (n,) [mm] stand closer where targets do."""
    return float(np.gradient(at)[off > 50].sum())


def test_targets_stand_no_closer_than_asked(tmp_path: Path) -> None:
    job = LineJob(tmp_path, LINES, zone="z0")
    for option, least in (("1.5", 1.5), ("0.25:100", 5.0)):       # 100 ms at 50 mm/s
        _, result, text = job.correct("path_mm", "--tolerance", 2, "--min-spacing", option)
        mm = np.array([1e3 * target.p for target in kit.targets_of(text)])
        apart = np.linalg.norm(np.diff(mm, axis=0), axis=1)
        assert result["result"]["added_targets"] == len(mm) - 4 > 8
        assert apart.min() > 0.98 * least


def test_a_force_that_is_straight_needs_no_targets(tmp_path: Path) -> None:
    def straight(job: LineJob, s: np.ndarray) -> np.ndarray:
        return np.column_stack([60 + 0.4 * s, 200 - 0.5 * s, -80 + 0 * s])

    for path in (SHORT, DENSE):
        job = LineJob(tmp_path / f"{len(path)}", path, zone="z0", force_of=straight)
        off, result, _ = job.correct("path_mm", "--tolerance", 5)
        assert result["result"]["added_targets"] == 0
        assert result["result"]["between_um"] is None
        assert off.max() < 5


def test_beside_a_zone_no_target_is_added_and_it_is_said(tmp_path: Path) -> None:
    """The force changes about a corner with z10: it is driven as planned, and the place named."""
    def about_the_corner(job: LineJob, s: np.ndarray) -> np.ndarray:
        return np.outer(np.exp(-((s - 120) / 6) ** 2), [50.0, 250.0, -90.0]) + np.array([5.0, 5.0, -5.0])

    job = LineJob(tmp_path, LINES, zone="z10", force_of=about_the_corner)
    off, result, text = job.correct("path_mm")
    (found,) = (one for one in result["findings"] if one["code"] == "CS3092")
    assert (found["level"], found["file"]) == ("warning", str(tmp_path / "part.mod"))
    told = re.search(r"up to ([\d.]+) um off the plan in 2 moves, more than the tolerance of 5 um", found["message"])
    assert told
    assert off.max() < float(told[1])           # that has what is along the path, too
    assert "--tighten-zones" in found["hint"]
    assert "CS3092" not in codes(job.correct("path_mm", "--tighten-zones")[1])
    mm = np.array([1e3 * target.p for target in kit.targets_of(text)])
    corner = 1e3 * job.poses[2].p
    from_corner = np.sort(np.linalg.norm(mm - corner, axis=1))
    assert from_corner[0] < 1.0 < 19.0 < from_corner[1]
    assert not re.search(r"z0", text)
