"""Force follows the cut: a log taken with a yielding tool, a corrected pass in material that pushes back as it is cut."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

import compstiff as compstiff_api
from compensator.correction import slot_cut
from compensator.correction.correct import correct
from compensator.correction.cut_kind import cut_shares
from compensator.correction.engagement import _where_it_changes
from compensator.correction.files import Inputs, predict_files
from compensator.correction.predict import Predicted
from compensator.correction.settings import Estimate, Settings
from compensator.learned.learned import Repeats
from identification.common.findings import CompstiffError
from identification.model.rotations import rotation_matrix
from tests.compensator.learning.two_tracks import TwoTracks, two_tracks
from tests.compensator.path.test_laws_timing import program, target
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3, line
from tests.runs.command_line.user_files import IRB6660, TOOL, Job, K
from tests.runs.milling.milling_job import rms
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import PLACES, slot_and_pocket, steps_of
from tests.virtual_cell.milling import engagement

Passes = tuple[np.ndarray, np.ndarray]
CUTTING = 400.0         # N/mm of depth
COUNT = 60


def straight() -> Path3:
    return line(COUNT, 2)


def nominal() -> np.ndarray:
    """Force (COUNT, 3) [N] at the planned depth, base frame: varies along the path."""
    s = np.linspace(0, 1, COUNT)
    return np.column_stack([60 + 0 * s, 180 + 80 * np.sin(5 * s), -90 - 40 * s])


def milled(path: Path3, shift: np.ndarray, cutting: float = CUTTING, share: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """The pass in which the tool is commanded `shift` (COUNT, 3) [m] off the plan: force [N] and where the loaded tool stands
    off the plan [m], base frame; share: of the nominal force. The equilibrium of the independent arm and the material, at each
    target along a chord."""
    points = np.array([(kit.work_object() @ frame).p for frame in path.frames])
    feed = np.gradient(points, axis=0)
    feed /= np.linalg.norm(feed, axis=1)[:, None]
    base = share * nominal()
    across = base - np.einsum("ni,ni->n", base, feed)[:, None] * feed
    size = np.linalg.norm(across, axis=1)

    def cut(part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is asked for beyond this part (COUNT,) of the planned depth's force, and where the tool stands under it."""
        stood = shift + kit.deviation(IRB6660, np.array(path.q), TOOL.p, np.pad(base * part[:, None], ((0, 0), (0, 3))), K)
        away = np.einsum("ni,ni->n", stood, across / size[:, None])
        return 1 - 1e3 * cutting * away / size - part, stood

    part = np.ones(COUNT)
    falls = cut(0 * part)[0] - cut(part)[0]
    for _ in range(10):
        more, stood = cut(part)
        if np.abs(more[:, None] * base).max() < 1e-6:
            return base * part[:, None], stood
        part = part + more / falls
    raise AssertionError("arm and material find no rest")


def text(force: np.ndarray) -> str:
    rows = [",".join([str(i), *(f"{x:.9f}" for x in f)]) for i, f in enumerate(force)]
    return "\n".join(["target,fx_n,fy_n,fz_n", *rows]) + "\n"


def commanded(job: Job) -> np.ndarray:
    """Offsets (COUNT, 3) [m], base frame, from the written program."""
    plan, out = kit.targets_of(str(job.program)), kit.targets_of(job.out.read_text())
    return np.array([kit.work_object().r.apply(b.p - a.p) for a, b in zip(plan, out, strict=True)])


@pytest.fixture(scope="module")
def path() -> Path3:
    return straight()


@pytest.fixture(scope="module")
def uncorrected(path: Path3) -> tuple[np.ndarray, np.ndarray]:
    """The pass of the planned program."""
    return milled(path, np.zeros((COUNT, 3)))


def largest(values: np.ndarray) -> float:
    return float(np.linalg.norm(values, axis=1).max())


def test_with_the_cutting_stiffness_one_correction_lands(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    force, before = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(force))
    assert job.correct().code == 0
    _, as_logged = milled(path, commanded(job))
    result = job.correct("--force", "--json", "--cutting-stiffness", f"{CUTTING}")
    assert result.code == 0
    # On the plan the cut is the nominal one.
    grows = 100 * (np.linalg.norm(nominal(), axis=1) / np.linalg.norm(force, axis=1) - 1)
    (said,) = [one["message"] for one in result.json["findings"] if one["code"] == "CS4120"]
    told = re.match(r"force follows the cut: with a cutting stiffness of 400 N/mm the corrected pass meets forces that are "
                    r"(\S+) % \(median\), (\S+) % at most, off the logged$", said)
    assert told, said
    np.testing.assert_allclose([float(one) for one in told.groups()], [np.median(grows), grows.max()], atol=0.3)
    assert result.json["result"]["left_at_10_n_per_mm_um"] is None
    _, coupled = milled(path, commanded(job))
    assert largest(as_logged) > 0.05 * largest(before), "the case is one in which the force matters"
    assert largest(coupled) < 2e-3 * largest(before)


def test_what_an_unknown_cutting_stiffness_leaves_is_said(tmp_path: Path, path: Path3) -> None:
    force, _ = milled(path, np.zeros((COUNT, 3)), cutting=10)
    job = Job(tmp_path, program=path.program(), forces=text(force))
    result = job.correct("--json")
    stated = result.json["result"]["left_at_10_n_per_mm_um"]
    _, left = milled(path, commanded(job), cutting=10)
    assert stated["largest"] == pytest.approx(1e6 * largest(left), rel=0.02)
    assert stated["rms"] == pytest.approx(1e6 * np.sqrt((left**2).sum(axis=1).mean()), rel=0.02)


def test_where_no_depth_is_stated_two_sigma_hold_for_the_depths_that_there_are(tmp_path: Path, path: Path3) -> None:
    """Depths drawn evenly from 0.16 to 3.6 mm in the middle 95 % (log-normal about 0.75 mm), three quarters of the push across
    growing with them: what the growing force really leaves, against what is said of it."""
    share = 0.5
    across = share * float(np.linalg.norm(nominal()[:, 1:], axis=1).mean())
    depths = 0.75 * np.exp(0.8 * norm.ppf((np.arange(12) + 0.5) / 12))
    said, real = np.empty((2, len(depths)))
    job = Job(tmp_path, program=path.program())
    for number, depth in enumerate(depths):
        cutting = 0.75 * across / depth
        force, _ = milled(path, np.zeros((COUNT, 3)), cutting, share)
        job.forces = text(force)
        said[number] = job.correct("--force", "--json").json["result"]["expected_left_um"]["cut"]
        _, left = milled(path, commanded(job), cutting, share)
        real[number] = 1e6 * np.sqrt((left**2).sum(axis=1).mean())
    assert real.max() > 5 * real.min(), "the depth decides"
    assert np.mean(real < 2 * said) > 0.9
    assert 0.6 < np.mean(real < said) < 0.95


def test_where_the_depth_decides_it_is_said_by_how_much(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    """At a depth the output tells what is left there, as it does where that depth is stated; then it asks no more."""
    job = Job(tmp_path, program=path.program(), forces=text(uncorrected[0]))
    asked = job.correct("--report", tmp_path / "report.html").out
    assert "how deep the cut is decides, and nobody stated it" in (tmp_path / "report.html").read_text()
    told = {float(depth): float(left) for left, depth in re.findall(r"([\d.]+) um at ([\d.]+) mm[ ,]", asked)}
    assert list(told) == [0.3, 1.0, 3.0]
    for depth, left in told.items():
        answer = job.correct("--force", "--json", "--depth-of-cut", f"{depth}")
        assert answer.json["result"]["expected_left_um"]["cut"] == pytest.approx(left, rel=0.15)
    assert "nobody stated it" not in job.correct("--force", "--depth-of-cut", "0.3").out
    assert "nobody stated it" not in job.correct("--force", "--cutting-stiffness", "400").out


def test_the_stiffness_is_found_from_two_passes(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    first, before = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    assert job.correct().code == 0
    second, _ = milled(path, commanded(job))
    (tmp_path / "first.csv").write_text(text(first))
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    job.forces = text(second)
    result = job.correct("--force", "--json", "--logged-with", tmp_path / "applied.csv",
                         "--first-forces", tmp_path / "first.csv")
    assert result.code == 0
    said = next(f["message"] for f in result.json["findings"] if f["code"] == "CS4124")
    assert float(said.split(": ")[1].split(" ")[0]) == pytest.approx(CUTTING, rel=0.01)
    assert largest(milled(path, commanded(job))[1]) < 5e-3 * largest(before)


def test_a_log_of_the_corrected_pass_is_not_corrected_for_depth_twice(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    """The second log was taken nearly on the plan: next to nothing is added to it, unless --logged-with is forgotten."""
    first, before = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    assert job.correct("--cutting-stiffness", f"{CUTTING}").code == 0
    second, _ = milled(path, commanded(job))
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    job.forces = text(second)
    assert job.correct("--force", "--cutting-stiffness", f"{CUTTING}", "--logged-with", tmp_path / "applied.csv").code == 0
    assert largest(milled(path, commanded(job))[1]) < 2e-3 * largest(before)
    assert job.correct("--force", "--cutting-stiffness", f"{CUTTING}").code == 0
    assert largest(milled(path, commanded(job))[1]) > 0.05 * largest(before)


def test_where_the_corrected_pass_cut_nothing_nothing_is_followed(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    """Three targets at which the corrected tool found next to no stock, as where it turned or touched early: without force
    there is no deviation, and every other target is what it is with its force in the log."""
    job = Job(tmp_path, program=path.program(), forces=text(uncorrected[0]))
    assert job.correct().code == 0
    second, _ = milled(path, commanded(job))
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    offsets, faint = [], second.copy()
    faint[30:33] *= 1e-3
    for force in (second, faint):
        job.forces = text(force)
        run = job.correct("--force", "--logged-with", tmp_path / "applied.csv", "--cutting-stiffness", f"{CUTTING}")
        assert run.code == 0, run.err
        offsets.append(np.linalg.norm(commanded(job), axis=1))
    alike = np.delete(np.arange(COUNT), [29, 30, 31, 32, 33])
    np.testing.assert_allclose(offsets[1][alike], offsets[0][alike], atol=1e-6)
    assert offsets[1][30:33].max() < 3e-3 * offsets[0][30:33].min()


@pytest.mark.parametrize(("tare", "named"), [((), True), (((0, 2),), False)])
def test_a_cut_that_does_not_fit_a_log_without_its_zero_asks_for_that(
    sample_inputs: Inputs, tare: tuple[tuple[int, int], ...], named: bool
) -> None:
    planned = predict_files(sample_inputs, Settings.of(tare=tare, cutting_stiffness=Estimate(4e7, 0.0)))
    with pytest.raises(CompstiffError) as stopped:
        correct(planned)
    (finding,) = [each for each in stopped.value.findings if each.code == "CS4123"]
    assert ("--tare" in finding.hint) == named


def test_refusals(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    first, _ = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    result = job.correct("--cutting-stiffness", "400000")
    assert (result.code, "CS4123" in result.err) == (1, True)
    assert job.correct("--cutting-stiffness", "-3").code == 2
    assert job.correct("--first-forces", tmp_path / "forces.csv").code == 2
    (tmp_path / "other.csv").write_text("target,ox_mm,oy_mm,oz_mm\n0,0,0,0\n")
    result = job.correct("--cutting-stiffness", "40", "--logged-with", tmp_path / "other.csv")
    assert (result.code, "CS4121" in result.err, "1 row" in result.err) == (1, True, True)
    none = "target,ox_mm,oy_mm,oz_mm\n" + "".join(f"{i},0,0,0\n" for i in range(COUNT))
    (tmp_path / "none.csv").write_text(none)
    result = job.correct("--logged-with", tmp_path / "none.csv", "--first-forces", tmp_path / "forces.csv")
    assert (result.code, "CS3118" in result.err) == (1, True), "two equal passes tell nothing"


def test_the_scale_of_a_measured_pass(tmp_path: Path, path: Path3) -> None:
    force = nominal()
    job = Job(tmp_path, program=path.program(), forces=text(force))
    assert job.correct().code == 0
    plain = kit.column(job.offsets(), "dx_um", "dy_um", "dz_um", "sx_um", "sy_um", "sz_um")
    assert job.correct("--force", "--scale", "1.2:0.06").code == 0
    scaled = kit.column(job.offsets(), "dx_um", "dy_um", "dz_um", "sx_um", "sy_um", "sz_um")
    np.testing.assert_allclose(scaled[:, :3], 1.2 * plain[:, :3], rtol=5e-3, atol=0.5)
    expected = (1.2 * plain[:, 3:]) ** 2 + (0.05 * scaled[:, :3]) ** 2
    np.testing.assert_allclose(scaled[:, 3:] ** 2, expected, rtol=0.02, atol=0.01)
    assert job.correct("--force", "--scale", "0").code == 2


def test_a_wrong_sign_shows_in_the_second_pass(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    """cell.yaml says that the log has the force by the tool; it has that on the tool. The first correction then goes the wrong
    way, the corrected pass cuts less, and says so; the two logs agree with each other."""
    first, _ = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    job.cell += "force_log: {sign: by_tool}\n"
    assert job.correct().code == 0
    second, stood = milled(path, commanded(job))
    assert np.linalg.norm(second, axis=1).mean() < np.linalg.norm(first, axis=1).mean()
    assert largest(stood) > 0.2e-3
    (tmp_path / "first.csv").write_text(text(first))
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    job.forces = text(second)
    result = job.correct("--force", "--json", "--logged-with", tmp_path / "applied.csv",
                         "--first-forces", tmp_path / "first.csv")
    assert result.code == 3
    (said,) = (one for one in result.json["findings"] if one["code"] == "CS3117")
    deeper, change, stiffness = map(float, re.search(
        r"cut ([\d.]+) um deeper, shows less force \(([-+\d.]+) N\): ([-+\d.e]+) \+- ", said["message"]).groups())
    # By force_log.sign the tool stood off the other way, and off by less in the second pass, on top of what it was sent.
    sizes = [np.linalg.norm(push(path, force), axis=1) for force in (first, second)]
    off = [np.einsum("ni,ni->n", stands(path, force), push(path, first)) / sizes[0] for force in (first, second)]
    assert deeper == pytest.approx(1e6 * np.mean(2 * off[0] - off[1]), rel=0.02)
    assert change == pytest.approx(np.mean(sizes[1] - sizes[0]), rel=0.02)
    assert 1e3 * stiffness == pytest.approx(np.mean(sizes[1] - sizes[0]) / np.mean(2 * off[0] - off[1]), rel=0.1)


def push(path: Path3, force: np.ndarray) -> np.ndarray:
    """The part (COUNT, 3) [N] of a force across the feed."""
    feed = np.gradient(np.array([(kit.work_object() @ frame).p for frame in path.frames]), axis=0)
    feed /= np.linalg.norm(feed, axis=1)[:, None]
    return np.asarray(force - np.einsum("ni,ni->n", force, feed)[:, None] * feed)


def stands(path: Path3, force: np.ndarray) -> np.ndarray:
    """Where the independent arm's tool is (COUNT, 3) [m] under it, off where it was sent."""
    return kit.deviation(IRB6660, np.array(path.q), TOOL.p, np.pad(force, ((0, 0), (0, 3))), K)


@pytest.mark.parametrize(("times", "scatter", "refused"), [
    (0.9, 0.0, False), (1.1, 0.0, True), (1.6, 0.01, False), (3.0, 0.01, True)])
def test_a_force_falls_by_a_wrong_sign_from_a_twentieth_a_millimetre(
    tmp_path: Path, path: Path3, uncorrected: Passes, times: float, scatter: float, refused: bool
) -> None:
    """5 % of the force for each millimetre of depth: of a corrected pass whose force is less by the share x, and which
    therefore stood (1 + x) e deeper, e where the tool stood in the first. Not where the scatter makes as much of it."""
    first, _ = uncorrected
    across = push(path, first)
    size = np.linalg.norm(across, axis=1)
    off = np.einsum("ni,ni->n", stands(path, first), across) / size
    share = times * 50 * np.median(np.linalg.norm(first, axis=1)) * (off @ off) / (off @ size)
    job = Job(tmp_path, program=path.program(), forces=text(first))
    assert job.correct().code == 0
    (tmp_path / "first.csv").write_text(text(first))
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    to_and_fro = scatter * np.resize([1.0, -1.0], (COUNT, 1))
    job.forces = text((1 - share + np.random.default_rng(3117).permutation(to_and_fro)) * first)
    result = job.correct("--force", "--json", "--logged-with", tmp_path / "applied.csv", "--first-forces",
                         tmp_path / "first.csv")
    assert (result.code, "CS3117" in kit.codes(result)) == ((3, True) if refused else (0, False))


@pytest.mark.parametrize(("count", "known"), [(39, False), (40, True)])
def test_two_passes_tell_the_cutting_stiffness_from_forty_targets_on(
    tmp_path: Path, path: Path3, uncorrected: Passes, count: int, known: bool
) -> None:
    first, _ = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    assert job.correct().code == 0
    second, _ = milled(path, commanded(job))
    (tmp_path / "first.csv").write_text("\n".join(text(first).splitlines()[:count + 1]) + "\n")
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    job.forces = text(second)
    result = job.correct("--force", "--json", "--logged-with", tmp_path / "applied.csv", "--first-forces",
                         tmp_path / "first.csv")
    told = [one for one in result.json["findings"] if one["code"] == "CS4122"]
    assert (result.code, [(one["level"], one["file"]) for one in told]) == (
        (0, []) if known else (1, [("error", str(tmp_path / "part.mod"))]))
    assert all("only 39 targets with force in both, expected at least 40" in one["message"] for one in told)
    assert not known or result.json["result"]["cutting_stiffness"]["n_per_mm"] == pytest.approx(CUTTING, rel=0.02)


def test_a_force_that_hardly_falls_is_no_wrong_sign(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    """As in conventional milling, where the push across does not grow with the depth: the pair tells no cutting stiffness."""
    first, _ = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    assert job.correct().code == 0
    (tmp_path / "first.csv").write_text(text(first))
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    job.forces = text(0.998 * first)
    result = job.correct("--force", "--json", "--logged-with", tmp_path / "applied.csv", "--first-forces",
                         tmp_path / "first.csv")
    assert result.code == 0
    assert "CS4122" in kit.codes(result)
    found = result.json["result"]["cutting_stiffness"]
    assert (found["followed"], found["origin"]) == (False, "passes")
    assert found["n_per_mm"] < 0.05 * CUTTING


def test_another_log_of_the_program_is_held_against_the_first(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    first, _ = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    (tmp_path / "again.csv").write_text(text(1.04 * first))
    (tmp_path / "turned.csv").write_text(text(-first))
    agreed = job.correct("--json", "--other-forces", tmp_path / "again.csv")
    assert (agreed.code, "CS3115" in kit.codes(agreed)) == (0, True)
    assert any("again.csv" in str(document) for document in agreed.json["inputs"])
    refused = job.predict("--json", "--other-forces", tmp_path / "turned.csv")
    assert (refused.code, "CS3110" in kit.codes(refused)) == (3, True)
    both = kit.run("correct", tmp_path / "cell.yaml", tmp_path, "--stiffness", tmp_path / "stiffness.json", "-o",
                   tmp_path / "all/", "--other-forces", tmp_path / "again.csv")
    assert both.code == 2


def test_a_cut_that_is_stiffer_than_the_arm_is_refused(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    """Logged on the plan, so that the force itself hardly grows: the gain alone speaks."""
    first, _ = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    assert job.correct("--cutting-stiffness", f"{CUTTING}").code == 0
    second, _ = milled(path, commanded(job))
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    job.forces = text(second)
    applied = ("--force", "--json", "--logged-with", tmp_path / "applied.csv", "--cutting-stiffness")
    result = job.correct(*applied, f"{CUTTING}")
    gain = result.json["result"]["cutting_stiffness"]["gain"]
    assert 0 < gain < 1
    refused = job.correct(*applied, f"{1.1 * CUTTING / gain}")
    assert (refused.code, "CS3200" in kit.codes(refused)) == (3, True)
    said = re.match(r"the cut is stiffer than the arm: (\S+) N/mm of depth against (\S+) N/mm of the tool across the feed "
                    r"\(gain 1.1, expected under 1\)", next(
                        f["message"] for f in refused.json["findings"] if f["code"] == "CS3200"))
    assert said
    assert [float(one) for one in said.groups()] == pytest.approx([1.1 * CUTTING / gain, CUTTING / gain], rel=5e-3)
    assert job.correct(*applied, f"{0.9 * CUTTING / gain}").code == 0


@pytest.mark.parametrize("wanted", [-0.93, -0.97])
def test_a_step_beyond_what_the_logged_force_tells_is_said(
    tmp_path: Path, path: Path3, uncorrected: Passes, wanted: float
) -> None:
    """At one target the tool of the log stood aside so far that the force falls there by this share of itself, by the
    independent arm: no more than 95 % are taken."""
    force, _ = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(force))
    assert job.correct("--offsets", tmp_path / "applied.csv", "--keep-targets").code == 0
    points = np.array([(kit.work_object() @ frame).p for frame in path.frames])
    feed = (points[31] - points[29]) / np.linalg.norm(points[31] - points[29])
    across = force[30] - (force[30] @ feed) * feed
    n, size = across / np.linalg.norm(across), np.linalg.norm(across)
    yields = kit.deviation(IRB6660, path.q[30], TOOL.p, np.r_[force[30], 0, 0, 0], K) @ n
    aside = kit.work_object().r.inv().apply((1e-3 * wanted * size / CUTTING - yields) * n)
    header, *rows = (tmp_path / "applied.csv").read_text().splitlines()
    names = header.split(",")
    for row, line_ in enumerate(rows):
        cells = dict(zip(names, line_.split(","), strict=True))
        cells |= {f"o{axis}_mm": f"{1e3 * aside[k] if row == 30 else 0.0:.6f}" for k, axis in enumerate("xyz")}
        rows[row] = ",".join(cells.values())
    (tmp_path / "by-hand.csv").write_text("\n".join([header, *rows]) + "\n")
    run = job.correct("--force", "--json", "--logged-with", tmp_path / "by-hand.csv", "--cutting-stiffness", f"{CUTTING}")
    assert run.code == 0, run
    said = [one for one in run.json["findings"] if one["code"] == "CS4120"]
    assert [(one["target"], one["message"]) for one in said if one["target"] is not None] == [
        (30, "at 1 target next to no force was logged for the step that the corrected tool makes across: the force is taken to "
         "change by 95 % there, no more")] * (wanted < -0.95)
    most = re.search(r"(\S+) % at most", said[-1]["message"])
    assert most
    assert float(most[1]) == pytest.approx(max(100 * wanted, -95.0) * -1, abs=0.5)


def test_the_gain_is_the_arms_own(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    """By pushing the independent arm along n with one newton more."""
    first, _ = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    stated = job.correct("--json", "--cutting-stiffness", f"{CUTTING}").json["result"]["cutting_stiffness"]
    points = np.array([(kit.work_object() @ frame).p for frame in path.frames])
    feed = np.gradient(points, axis=0)
    feed /= np.linalg.norm(feed, axis=1)[:, None]
    across = first - np.einsum("ni,ni->n", first, feed)[:, None] * feed
    n = across / np.linalg.norm(across, axis=1)[:, None]
    gives = [kit.deviation(IRB6660, q, TOOL.p, np.r_[d, 0, 0, 0], K) @ d for q, d in zip(path.q, n, strict=True)]
    assert stated["gain"] == pytest.approx(1e3 * CUTTING * max(gives), rel=0.02)
    assert (stated["origin"], stated["n_per_mm"], stated["followed"]) == ("stated", pytest.approx(CUTTING), True)


def test_the_cell_states_the_cut(tmp_path: Path, path: Path3, uncorrected: Passes) -> None:
    """cell.yaml's stiffness is used as the option's is, with its error; a material alone does not tell it, and says so."""
    first, _ = uncorrected
    job = Job(tmp_path, program=path.program(), forces=text(first))
    plain = job.cell
    optional = job.correct("--json", "--cutting-stiffness", f"{CUTTING}:40").json["result"]["expected_left_um"]
    by_option = commanded(job)
    job.cell = plain + f"cutting: {{stiffness_n_per_mm: {CUTTING}, std_n_per_mm: 40}}\n"
    result = job.correct("--force", "--json")
    assert result.json["result"]["cutting_stiffness"]["origin"] == "cell.yaml"
    np.testing.assert_allclose(commanded(job), by_option, atol=1e-9)
    exact = job.correct("--force", "--json", "--cutting-stiffness", f"{CUTTING}").json["result"]["expected_left_um"]
    assert exact["cut"] == 0
    left = result.json["result"]["expected_left_um"]
    assert left["cut"] > 1
    assert left == pytest.approx(optional, rel=1e-6)
    assert left["model"] == pytest.approx(exact["model"], rel=1e-3)
    job.cell = plain + "cutting: {material: steel, tool_diameter_mm: 16}\n"
    result = job.correct("--force", "--json")
    assert result.code == 0
    said = next(f["message"] for f in result.json["findings"] if f["code"] == "CS3202")
    assert "cutting.contact_mm and the spindle's speed (--spindle-rpm)" in said
    for wrong in ("{std_n_per_mm: 4}", "{contact_mm: 4}", "{material: wood}", "{stiffness_n_per_mm: -1}"):
        job.cell = plain + f"cutting: {wrong}\n"
        assert job.correct("--force").code == 1


def test_where_the_force_changes_along_the_path_a_step_across_may_change_it_as_much() -> None:
    """Before a corner of the virtual cell's part: how much more or less a step across changes its end mill's force there than
    at the wall, against the share that is stated. A wall, and the step at a corner, ask for nothing."""
    part, mill = slot_and_pocket(spacing_mm=0.25, allowance_mm=0.4, wall_depth_mm=10.0), EndMill()
    steps = steps_of(part, 0.25)
    here = np.flatnonzero(steps.place == PLACES.index("sharp corner"))
    along = np.column_stack([steps.feed, np.zeros(len(steps.feed))])

    def force(i: int, aside_mm: float) -> np.ndarray:
        at = steps.between(part.target_mm)[i] + aside_mm * steps.left[i]
        coverage, depth = engagement(part, steps, mill, i, at)
        local = mill.mean_force(coverage, depth)
        return local[0] * along[i] + local[1] * steps.left[i]

    on_plan = np.array([force(i, 0.0) for i in here])
    grows = np.array([np.linalg.norm(force(i, -0.05) - force(i, 0.05)) / 0.1 for i in here])
    forces = SimpleNamespace(wrench=np.hstack([on_plan, 0 * on_plan]), forced=np.ones(len(here), dtype=bool))
    stated = _where_it_changes(SimpleNamespace(path=SimpleNamespace(length=0.25e-3 * np.arange(len(here))), forces=forces),
                               np.full(len(here), 1e-3))
    of_one_mm = stated * np.linalg.norm(on_plan, axis=1)
    corner = int(np.flatnonzero(np.abs(np.diff(steps.feed[here, 0])) > 0.5)[0])
    before, wall = np.arange(corner - 14, corner), np.r_[:10, corner + 10:len(here)]
    assert of_one_mm[wall].max() < 1.0
    assert of_one_mm[corner + 1:corner + 3].max() < 1.0
    off = grows[before] - np.median(grows[wall])
    assert np.abs(off).max() > 80
    assert 0.5 < rms(off) / rms(of_one_mm[before]) < 1.0, "of that order, and rather too wide than too narrow"


@pytest.mark.parametrize(("length", "inside"), [(7, [3]), (8, [3, 4]), (6, []), (20, list(range(3, 17)))])
def test_a_full_slot_is_one_for_three_targets_on_either_side(
        monkeypatch: pytest.MonkeyPatch, length: int, inside: list[int]) -> None:
    """A slot by its direction for so many targets amid a wall, pushed alike by 200 N and once by 190, which is as full."""
    share, across = np.zeros(40), np.full(40, 500.0)
    share[10:10 + length], across[10:10 + length] = 0.9, 200.0
    across[12] = 190.0
    monkeypatch.setattr(slot_cut, "cut_shares", lambda path, force: (0 * share, share))
    nothing: Any = None
    assert np.flatnonzero(slot_cut.full_slot(nothing, np.zeros((40, 3)), across)).tolist() == [10 + k for k in inside]
    across[12] = 170.0          # where the tool enters it
    assert np.flatnonzero(slot_cut.full_slot(nothing, np.zeros((40, 3)), across)).tolist() == [
        10 + k for k in inside if k > 5]


@pytest.fixture(scope="module")
def set_up(sample_inputs: Inputs, tmp_path_factory: pytest.TempPathFactory) -> tuple[TwoTracks, Path]:
    """A part that stood 0.23 mm beside its work object, across the feed, and what was learned of it."""
    folder = tmp_path_factory.mktemp("learned")
    tracks = two_tracks(sample_inputs, folder)
    learning = tracks.learn(tracks.measured(folder / "points.csv", slice(None, None, 4), tracks.off + np.array([0, 230, 0])))
    compstiff_api.write({folder / "learned.json": learning.content()}, overwrite=True)
    return tracks, folder / "learned.json"


def across_the_feed(planned: Predicted) -> np.ndarray:
    """The part (n, 3) [N] of the forces on the targets that stands across the feed."""
    feed = np.gradient(planned.path.base_from_tcp.position, axis=0)[planned.targets]
    feed /= np.linalg.norm(feed, axis=1)[:, None]
    force = planned.forces.wrench[planned.targets, :3]
    return np.asarray(force - np.einsum("ni,ni->n", force, feed)[:, None] * feed)


@pytest.mark.parametrize(("limited", "level"), [(0, ""), (1, "note"), (4, "note"), (9, "warning")])
def test_a_set_up_that_is_off_by_more_than_the_cut_is_told(set_up: tuple[TwoTracks, Path], limited: int, level: str) -> None:
    """A cutting stiffness by which so many targets would meet a force that is off by more than 95 % of the logged: by
    K (e . n) / F_n, n along the force's part across the feed. A warning where they carry over 5 % of all the push across."""
    tracks, learned = set_up

    def predicted(newton_per_metre: float) -> Predicted:
        cell = compstiff_api.read_cell(tracks.inputs.cell)
        return compstiff_api.predict(
            cell, compstiff_api.read_toolpath(tracks.inputs.toolpath, cell), tracks.model, tracks.inputs.forces, Settings.of(
                cutting_stiffness=Estimate(newton_per_metre, 0.0), learned=learned, repeats="setup"))

    planned = predicted(1.0)
    targets = planned.targets
    across = across_the_feed(planned)
    push = np.linalg.norm(across, axis=1)
    share = np.abs(np.einsum("ni,ni->n", planned.prediction.position, across)) / push**2
    order = np.argsort(-share)
    stiffness = 0.95 / np.sqrt(share[order[limited]] * share[order[max(limited - 1, 0)]]) if limited else 0.949 / share.max()
    beyond = order[:limited]
    assert (push[beyond].sum() > 0.05 * push.sum()) == (level == "warning")
    found = [finding for finding in correct(predicted(stiffness)).findings if finding.code == "CS5325"]
    first = int(targets[beyond].min()) if limited else -1
    assert [(one.level, one.target, one.file) for one in found] == (
        [(level, first, str(tracks.inputs.toolpath))] if limited else [])
    assert not found or found[0].message.startswith(
        f"at {limited} target{'s' * (limited > 1)} of 122 the learned displacement is deeper than the cut: ")
    assert not found or (found[0].line, "--repeats" in found[0].hint) == (25 + first, level == "warning")


@pytest.mark.parametrize("repeats", ["nothing", "setup"])
@pytest.mark.parametrize("fits", [True, False])
def test_with_a_part_learned_a_cutting_stiffness_fits_what_the_tool_yields(
    set_up: tuple[TwoTracks, Path], repeats: Repeats, fits: bool
) -> None:
    """The force grows by K (e . n) / F_n, e what the springs yield. A set-up, carried or not, says nothing of K: it is refused
    where more than 5 % of the push across would double for the springs alone, as it is without a part."""
    tracks, learned = set_up
    cell = compstiff_api.read_cell(tracks.inputs.cell)

    def predicted(newton_per_metre: float) -> Predicted:
        return compstiff_api.predict(
            cell, compstiff_api.read_toolpath(tracks.inputs.toolpath, cell), tracks.model, tracks.inputs.forces, Settings.of(
                cutting_stiffness=Estimate(newton_per_metre, 0.0), learned=learned, repeats=repeats))

    planned = predicted(1.0)
    targets = planned.targets
    across = across_the_feed(planned)
    push = np.linalg.norm(across, axis=1)
    turn = planned.path.base_from_object.rotation[targets]
    yielded = 1e-6 * np.einsum("nij,nj->ni", turn, tracks.off)
    share = np.abs(np.einsum("ni,ni->n", yielded, across)) / push**2
    order = np.argsort(-share)
    carried = np.cumsum(push[order]) / push.sum()
    last = order[int(np.argmax(carried > 0.05))]
    stiffness = (0.92 if fits else 1.03) / share[last]
    if fits:
        correct(predicted(stiffness))
        return
    with pytest.raises(CompstiffError) as stopped:
        correct(predicted(stiffness))
    assert [(one.code, one.file) for one in stopped.value.findings][:1] == [("CS4123", str(tracks.inputs.toolpath))]


@pytest.mark.parametrize(("degrees", "climbing", "slotting"), [
    (20, 1, 0), (78, 1, 0), (82, 0.9, 0.1), (90, 0.5, 0.5), (98, 0.1, 0.9), (102, 0, 1), (128, 0, 1), (132, 0, 0.9),
    (148, 0, 0.1), (152, 0, 0), (-60, 0, 0)])
def test_which_cut_it_is_goes_by_the_angle_of_the_force_to_the_left_of_the_feed(
        tmp_path: Path, degrees: float, climbing: float, slotting: float) -> None:
    """Climb up to 80 degrees, a slot from 100 to 130, neither from 150 on, ramps between; nothing of a slot where the tool is
    pushed into the spindle, which is above, by a fifth of that."""
    down = rotation_matrix(np.array([0, np.pi, 0]))
    path = program(tmp_path, [f"MoveL {target(np.array([x, 0, 700]), down)},v50,z1,tSpindle;" for x in (1000.0, 1010, 1030)])
    angle = np.radians(degrees)
    for pushed_in, slot in ((0.18, True), (0.22, False), (-1.0, True)):
        found = cut_shares(path, np.tile([100 * np.cos(angle), 100 * np.sin(angle), 100 * pushed_in], (3, 1)))
        np.testing.assert_allclose(found[0], climbing, atol=1e-6)
        np.testing.assert_allclose(found[1], slotting * slot, atol=1e-6)
