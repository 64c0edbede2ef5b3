"""A robot on a slide, a part on a tilting and turning table: the corrected program, driven by the virtual cell's controller
with kinematics of its own, keeps the loaded tool on the plan, at the targets and between them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

import compstiff
from compensator.path.legs import Poses
from compensator.path.robot_path import robot_path
from compensator.path.route import build_route
from tests.runs.command_line import user_files as kit
from tests.runs.milling.carried_job import SLIDE, SLIDE_ZERO, CarriedJob, slide_yaml
from tests.runs.milling.line_job import ARCS, LINES, SHORT, LineJob
from tests.runs.milling.test_contract_between import posted_source
from tests.virtual_cell import controller

ROUNDING_UM = 0.2
STILL = np.array([[1100.0, 7.0, -15.0], [1100.0, 7.0, -15.0]])
EXTERNAL = re.compile(r"\[([^\[\]]*)\]\](?=,)")


def at_targets_um(job: CarriedJob, rapid: str) -> np.ndarray:
    """How far the loaded tool is off each planned target (N,) [um], all coordinates."""
    planned, commanded = job.planned, controller.legs_of(rapid)
    assert len(planned) == len(commanded)
    points = np.array([planned[0].points[0], *(leg.points[-1] for leg in planned)])
    ways = np.array([commanded[0].points[0], *(leg.points[-1] for leg in commanded)])
    turns = Rotation.concatenate([commanded[0].turn[0], *(leg.turn[1] for leg in commanded)])
    external = np.array([commanded[0].external[0], *(leg.external[1] for leg in commanded)])
    origin, turned = job.stands(external)
    rest = controller.loaded(job.arm, job.angles(ways, turns, external), kit.TOOL.p, job.force(job.target_lengths), kit.K)
    return np.asarray(1e3 * np.linalg.norm(1e3 * turned.inv().apply(rest - origin) - points, axis=1))


def with_axes(rapid: str, written: str) -> str:
    """The program with other external axes in its moves."""
    return "\n".join(EXTERNAL.sub(written + "]", line) if line.lstrip().startswith("Move") else line
                     for line in rapid.splitlines()) + "\n"


@pytest.mark.parametrize("on", ["slide", "table", "both"])
def test_the_loaded_tool_stands_on_the_plan(tmp_path: Path, on: str) -> None:
    """At every target with its own force, to what the written numbers round."""
    job = CarriedJob(tmp_path, SHORT, zone="z0", on=on)
    _, result, text = job.correct("target", "--confidence", 0.5, "--keep-targets")
    assert at_targets_um(job, job.program).max() > 200
    assert at_targets_um(job, text).max() < 1.0
    assert result["result"]["corrected"] > 35
    # The units go where they went.
    assert [m[1] for m in EXTERNAL.finditer(text)] == [m[1] for m in EXTERNAL.finditer(job.program)]


@pytest.mark.parametrize(("on", "path", "by"), [
    ("slide", LINES, "position"), ("slide", ARCS, "path_mm"), ("table", ARCS, "position"), ("both", LINES, "path_mm"),
    ("both", ARCS, "path_mm"),
])
def test_the_tolerance_is_kept_between_targets(tmp_path: Path, on: str, path: str, by: str) -> None:
    """Further targets have external axes in proportion to the way, on lines and on arcs, whose circle points say nothing."""
    job = CarriedJob(tmp_path, path, zone="z0", on=on)
    assert job.off_um(job.program).max() > 200
    off, result, _ = job.correct(by, "--tolerance", 4)
    said = result["result"]
    assert off.max() < 4 + ROUNDING_UM
    assert off.max() - 1.4 < said["between_um"]["largest"] < 4 + ROUNDING_UM
    assert said["added_targets"] > 15
    kept, _, _ = job.correct(by, "--tolerance", 4, "--keep-targets")
    assert kept.max() > 4


def test_a_circle_point_that_says_otherwise_is_not_made_a_target(tmp_path: Path) -> None:
    """The controller does not use the axes of a circle point; as the end of a first half they would count."""
    job = CarriedJob(tmp_path, ARCS, zone="z0", on="slide")
    told, index = [], 0
    for line in job.program.splitlines():
        if "MoveC" in line:
            found = EXTERNAL.search(line)
            assert found is not None
            line = line[:found.start(1)] + "33.5" + line[found.start(1) + len(found[1].split(",")[0]):]
            index += 1
        told.append(line)
    assert index == 2
    odd = CarriedJob(tmp_path, ARCS, zone="z0", on="slide", text="\n".join(told) + "\n")
    off, result, text = odd.correct("path_mm", "--tolerance", 3)
    assert text.count("[33.5,9E9") == 2
    # The arcs stay whole and are said to be off; the lines are kept.
    assert {"CS4330", "CS3091"} <= {finding["code"] for finding in result["findings"]}
    assert off.max() == pytest.approx(result["result"]["between_um"]["largest"], rel=0.2)


@pytest.mark.parametrize("on", ["slide", "table"])
def test_an_axis_that_stands_still_is_another_place(tmp_path: Path, on: str) -> None:
    """The same correction as with the base, or the work object, declared there and no unit at all."""
    job = CarriedJob(tmp_path / "unit", SHORT, zone="z0", on=on, ends=STILL)
    _, _, text = job.correct("target", "--check-feed")
    origin, turned = job.stands(job.values[:2])
    base = kit.Frame(kit.BASE.p + 1e-3 * (STILL[0, 0] - SLIDE_ZERO) * SLIDE, kit.BASE.r) if on == "slide" else kit.BASE
    place = kit.wobjdata(user=base @ kit.Frame(origin[0], turned[0]), obj=kit.Frame(np.zeros(3), Rotation.identity()))
    program = with_axes(job.program, kit.E).replace(job.data[1], place)
    told = kit.Job(tmp_path / "plain", cell=kit.cell_text(base=base), program=program, forces=job.log("target"))
    (tmp_path / "plain").mkdir()
    assert told.correct("--check-feed").code == 0
    one, other = controller.legs_of(text), controller.legs_of(told.out.read_text())
    assert len(one) == len(other) == len(job.xy) - 1
    for here, there in zip(one, other, strict=True):
        assert np.abs(here.points - there.points).max() < 1.1e-4            # the last decimal written [mm]
    ours, theirs = (kit.column(kit.table(folder / "offsets.csv"), "ox_mm", "oy_mm", "oz_mm")
                    for folder in (job.folder, told.folder))
    assert np.abs(ours - theirs).max() < 1e-6                               # 1e-9 m
    assert np.abs(ours).max() > 0.1


def test_the_units_own_limits_hold_the_feed_back(tmp_path: Path) -> None:
    """A table that turns with the cut needs its own speed; without limits it is said not to be judged."""
    ends = np.array([[950.0, 12.0, -20.0], [950.0, 4.0, 5.0]])
    slow = CarriedJob(tmp_path / "slow", LINES, zone="fine", on="table", ends=ends,
                      limits=", speed_deg_s: 5, acceleration_deg_s2: 1000")
    _, result, _ = slow.correct("path_mm", "--check-feed", "--keep-targets")
    speed = np.array([np.abs(leg.external[1, 1:3] - leg.external[0, 1:3]) / (leg.length / 50) for leg in slow.planned])
    axis = "bc"[int(np.argmax(speed.max(axis=0)))]
    feed = result["result"]["feed_check"]["planned"]
    assert feed["lowest_feed_ratio"] == pytest.approx(5 / speed.max(), rel=1e-3)
    assert any(f"eax_{axis} at its speed limit (5 deg/s)" in finding["message"] for finding in result["findings"])
    assert "CS4508" not in {finding["code"] for finding in result["findings"]}
    free = CarriedJob(tmp_path / "free", LINES, zone="fine", on="table", ends=ends)
    _, result, _ = free.correct("path_mm", "--check-feed", "--keep-targets")
    assert result["result"]["feed_check"]["planned"]["lowest_feed_ratio"] == 1
    assert any(finding["code"] == "CS4508" and "eax_b, eax_c" in finding["message"] for finding in result["findings"])


@pytest.mark.parametrize("on", ["slide", "table", "both"])
def test_the_way_of_the_joints_is_that_of_an_arm_of_its_own(tmp_path: Path, on: str) -> None:
    """Angles along lines and arcs, and how they change with the path's length, which the feed check rests on."""
    job = CarriedJob(tmp_path, ARCS, zone="fine", on=on, limits=", speed_deg_s: 50, acceleration_deg_s2: 100")
    job.job(job.log("path_mm")).write()
    cell = compstiff.read_cell(tmp_path / "cell.yaml")
    path = robot_path(compstiff.read_toolpath(tmp_path / "part.mod", cell).toolpath, cell)
    route = build_route(path, Poses(path.base_from_tcp, path.theta))
    ends = np.append(0.0, np.cumsum([leg.length for leg in job.planned]))
    compared = 0
    for number, leg in enumerate(job.planned):
        fine = controller.drive([leg], 0.02, zones=False)
        q = job.angles(fine.position, fine.turn, fine.external)
        s = np.linspace(ends[number], ends[number + 1], len(q))
        # Grid points stand GAP apart at stops; inside a leg they count from its start.
        at = route.s * 1e3 - 1e-3 * number
        here = (at > ends[number] + 0.5) & (at < ends[number + 1] - 0.5)
        at = at[here]
        rate = np.gradient(q, s, axis=0) * 1e3
        for joint in range(6):
            np.testing.assert_allclose(route.theta[here, joint], np.interp(at, s, q[:, joint]), atol=1e-7)
            np.testing.assert_allclose(route.dtheta_ds[here, joint], np.interp(at, s, rate[:, joint]), atol=0.01, rtol=0.01)
        columns = {"slide": [0], "table": [1, 2], "both": [0, 1, 2]}[on]
        for place, column in enumerate(columns):
            factor = 1e-3 if column == 0 else np.radians(1)
            np.testing.assert_allclose(route.theta[here, 6 + place],
                                       factor * np.interp(at, s, fine.external[:, column]), atol=1e-7)
        compared += here.sum()
    assert compared > 20


def test_a_deviation_that_turns_with_the_part_gets_targets(tmp_path: Path) -> None:
    """A force that stays the same for the robot turns for the part: a straight line of offsets misses it."""
    def same(job: CarriedJob, s: np.ndarray) -> np.ndarray:
        return np.column_stack([150 + 0 * s, 250 + 0 * s, -80 + 0 * s])

    ends = np.array([[950.0, 8.0, -20.0], [950.0, 8.0, 5.0]])
    job = CarriedJob(tmp_path, "J 0,0 L 100,0", zone="fine", on="table", ends=ends, force_of=same)
    off, result, _ = job.correct("path_mm", "--tolerance", 3)
    assert off.max() < 3 + ROUNDING_UM
    # No more than needed: seen from the robot, whose frame turns against the part, it would look like more.
    assert result["result"]["added_targets"] <= 4
    kept, result, _ = job.correct("path_mm", "--tolerance", 3, "--keep-targets")
    assert kept.max() > 4
    assert result["result"]["between_um"]["largest"] == pytest.approx(kept.max(), rel=0.2)


@pytest.mark.parametrize("form", ["apt", "csv"])
def test_posted_programs_hold_the_axes_where_they_are_parked(tmp_path: Path, form: str) -> None:
    """As posted for a robot that stands there on the floor, but for the axes; and corrected alike. Without a place: refused."""
    path = LineJob(tmp_path, "J 0,0 L 60,0 V 90,30 L 60,60 L 0,60", zone="z0")
    away = kit.Frame(kit.BASE.p + 1e-3 * 80 * SLIDE, kit.BASE.r)
    (tmp_path / f"part.{form}").write_text(posted_source(path, form))
    (tmp_path / "stiffness.json").write_text(kit.stiffness_text())
    (tmp_path / "forces.csv").write_text("target,fx_n,fy_n,fz_n\n1,60,90,-120\n2,60,90,-120\n")
    place = f"workobject: {kit.yaml_frame(away @ kit.work_object())}\n"
    track = "mechanical_units:\n" + slide_yaml(limits=f", parked_mm: {SLIDE_ZERO + 80}")
    options = ["--tool-x", "0,1,0"] if form == "apt" else []
    out: list[tuple[str, np.ndarray]] = []
    for name, cell in (("floor", kit.cell_text(base=away, extra=place)), ("track", kit.cell_text(extra=place + track))):
        (tmp_path / f"{name}.yaml").write_text(cell)
        posted = kit.run("post", tmp_path / f"{name}.yaml", tmp_path / f"part.{form}", "-o", tmp_path / f"{name}.mod", *options)
        assert posted.code == 0, posted
        done = kit.run("correct", tmp_path / f"{name}.yaml", tmp_path / f"part.{form}",
                       "--stiffness", tmp_path / "stiffness.json", "--forces", tmp_path / "forces.csv",
                       "-o", tmp_path / f"{name}_out.mod", "--offsets", tmp_path / f"{name}.csv", *options)
        assert done.code == 0, done
        out.append(((tmp_path / f"{name}.mod").read_text(),
                    kit.column(kit.table(tmp_path / f"{name}.csv"), "ox_mm", "oy_mm", "oz_mm")))
    (floor, one), (track, other) = out
    assert "[880.0,9E9,9E9,9E9,9E9,9E9]" in track
    assert track.replace("880.0", "9E9") == floor
    assert np.abs(one).max() > 0.05
    np.testing.assert_allclose(one, other, atol=1e-6)
    (tmp_path / "nowhere.yaml").write_text(kit.cell_text(extra=place + "mechanical_units:\n" + slide_yaml()))
    lost = kit.run("post", tmp_path / "nowhere.yaml", tmp_path / f"part.{form}", "-o", tmp_path / "lost.mod", *options)
    assert lost.code == 1
    assert "nowhere.yaml: error CS4510: TRACK_1 carries the robot, and cell.yaml does not say where eax_a stands" in lost.err
    assert "state parked_mm of eax a" in lost.err


def test_a_soft_track_is_corrected_along_the_way(tmp_path: Path) -> None:
    """The carriage yields along its travel and rocks about it, wherever on the track it stands."""
    along, rocking = 4e-7, 3e-7
    job = CarriedJob(tmp_path, SHORT, zone="z0", on="slide")
    plain = json.loads(kit.stiffness_text())
    more = [{"name": f"soft_track.{name}", "unit": unit, "estimate": value, "std": 0.05 * value,
             "interval_95": [0.9 * value, 1.1 * value]}
            for name, unit, value in (("along_m_per_n", "m/N", along), ("rocking_rad_per_nm", "rad/(N*m)", rocking))]
    spread = np.array([0.05 * along, 0.05 * rocking])
    log = plain["log_compliance"]
    log["mean"] += [along, rocking]
    for part in (plain, log):
        part["covariance"] = block_diag(np.array(part["covariance"]), np.diag(spread**2)).tolist()
    plain |= {"parameters": plain["parameters"] + more, "effects": [{"effect": "soft_track", "joint": None}]}
    ready = job.job(job.log("target"))
    ready.stiffness = json.dumps(plain)
    done = ready.correct("--json", "--confidence", 0.5, "--keep-targets")
    assert done.code == 0, done

    def off_um(rapid: str) -> float:
        legs, force = controller.legs_of(rapid), job.force(job.target_lengths)
        ways = np.array([legs[0].points[0], *(leg.points[-1] for leg in legs)])
        turns = Rotation.concatenate([legs[0].turn[0], *(leg.turn[1] for leg in legs)])
        origin, turned = job.stands(job.values)
        rest = controller.loaded(job.arm, job.angles(ways, turns, job.values), kit.TOOL.p, force, kit.K)
        travel = kit.BASE.r.inv().apply(SLIDE)
        moment = np.cross(rest, force)
        moved = rest + along * np.outer(force @ travel, travel) + rocking * np.cross(np.outer(moment @ travel, travel), rest)
        points = np.array([job.planned[0].points[0], *(leg.points[-1] for leg in job.planned)])
        return float(1e3 * np.linalg.norm(1e3 * turned.inv().apply(moved - origin) - points, axis=1).max())

    assert off_um(job.program) > 400
    assert off_um(ready.out.read_text()) < 1.0
