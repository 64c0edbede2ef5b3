"""Corrections that are held back: what is promised of them, by chance experiments and by the definition."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compensator.correction.restraint import confident_share, fair_to_both, limited_steps
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3, line
from tests.runs.command_line.user_files import Job

DEVIATION = np.array([30.0, -10.0, 5.0])
SPREAD = np.array([[400.0, 90, 0], [90, 250, -30], [0, -30, 100]])


def farther(share: float, deviation: np.ndarray, spread: np.ndarray, draws: int = 200_000) -> float:
    """How often the true deviation, corrected by a share of the expected one, is farther from zero than uncorrected."""
    true = np.random.default_rng(3).multivariate_normal(deviation, spread, draws)
    return float(np.mean(np.linalg.norm(true - share * deviation, axis=1) > np.linalg.norm(true, axis=1)))


@pytest.mark.parametrize("confidence", [0.6, 0.69, 0.75, 0.8])
def test_the_share_is_the_largest_that_keeps_the_promise(confidence: float) -> None:
    deviation = 0.6 * DEVIATION
    share = float(confident_share(deviation[None], SPREAD[None], confidence)[0])
    assert 0 < share <= 1
    assert farther(share, deviation, SPREAD) <= 1 - confidence + 0.004
    if share < 1:
        assert farther(min(share + 0.05, 1.0), deviation, SPREAD) > 1 - confidence


def test_a_correction_of_its_own_sigma_is_made_in_full_and_of_half_of_it_left_out() -> None:
    """What the default of --confidence is said to mean."""
    one = np.array([[10.0, 0, 0]])
    sigma = np.array([8.0, 10.0, 15.0, 20.1])
    share = [float(confident_share(one, (s * np.eye(3))[None] ** 2, 0.69)[0]) for s in sigma]
    np.testing.assert_allclose(share, [1, 1, 2 - 1.5 * 0.99, 0], atol=0.02)


places = st.lists(st.floats(0.0, 50.0), min_size=2, max_size=12)


@given(places, st.integers(0, 2**32 - 1), st.floats(0.01, 2.0))
def test_steps_keep_the_limit_air_stays_and_what_kept_it_is_untouched(steps: list[float], seed: int, slope: float) -> None:
    rng = np.random.default_rng(seed)
    length = 1e-3 * np.cumsum(steps)
    offset = 1e-3 * rng.normal(size=(len(steps), 3))
    air = rng.random(len(steps)) < 0.3
    offset[air] = 0.0
    limited = limited_steps(offset, length, air, slope)
    apart = np.abs(length[:, None] - length)
    assert np.all(np.abs(limited[:, None] - limited) <= slope * apart[:, :, None] + 1e-8)
    assert np.all(limited[air] == 0)
    gentle = np.abs(offset[:, None] - offset) <= 0.5 * slope * apart[:, :, None]
    if gentle.all():
        np.testing.assert_allclose(limited, offset, atol=1e-12)


def test_the_limited_offset_is_the_largest_with_that_slope() -> None:
    """By the definition, all pairs, the places where a coordinate changes its sign among them; and nothing is moved farther."""
    rng = np.random.default_rng(1)
    length, offset = np.sort(rng.uniform(0, 1, 40)), 1e-3 * rng.normal(size=(40, 3))
    slope = 5e-3
    limited = limited_steps(offset, length, np.zeros(40, bool), slope)
    for values, found in zip(offset.T, limited.T, strict=True):
        zeros = [np.interp(0.0, *zip(*sorted([(values[i], length[i]), (values[i + 1], length[i + 1])]), strict=True))
                 for i in range(39) if values[i] * values[i + 1] < 0]
        places, sizes = np.r_[length, zeros], np.r_[np.abs(values), np.zeros(len(zeros))]
        expected = np.array([np.sign(value) * np.min(sizes + slope * np.abs(places - here))
                             for value, here in zip(values, length, strict=True)])
        np.testing.assert_allclose(found, expected, atol=2e-9)
    assert np.all(np.abs(limited) <= np.abs(offset))


def test_a_spike_does_not_move_its_neighbours() -> None:
    length, offset = 1e-3 * np.arange(9.0), np.zeros((9, 3))
    offset[:, 1] = 1e-5
    offset[4, 1] = 1e-3
    limited = limited_steps(offset, length, np.zeros(9, bool), 0.1)
    np.testing.assert_allclose(limited[:, 1], [1e-5] * 4 + [1.1e-4] + [1e-5] * 4, atol=1e-12)


@given(seed=st.integers(0, 10**6), first=st.floats(0.0, 3.0), second=st.floats(0.0, 3.0))
def test_neither_side_of_a_corner_is_left_farther_off_than_it_was(seed: int, first: float, second: float) -> None:
    """Offsets between none and what the sides ask for, of which one may be much larger and less well known; what harms neither
    side stays."""
    rng = np.random.default_rng(seed)
    before, behind = 10 ** rng.uniform(-2, 1, (2, 50, 1)) * rng.standard_normal((2, 50, 3))
    weight = rng.dirichlet([1, 1, 0.3], 50)
    offset = weight[:, :1] * before + weight[:, 1:2] * behind
    sides = ((before, first), (behind, second))
    fair = fair_to_both(offset, [(side, np.full(50, sigma)) for side, sigma in sides])
    harmed = np.zeros(50, dtype=bool)
    for side, sigma in sides:
        allowed = np.linalg.norm(side, axis=1) + sigma
        assert np.all(np.linalg.norm(side - fair, axis=1) <= allowed * (1 + 1e-9))
        harmed |= np.linalg.norm(side - offset, axis=1) > allowed
    assert np.array_equal(fair[~harmed], offset[~harmed])
    # No farther than it must: the side that was harmed is on its limit.
    limits = [np.linalg.norm(side - fair, axis=1) - np.linalg.norm(side, axis=1) - sigma for side, sigma in sides]
    assert np.all(np.max(limits, axis=0)[harmed] > -1e-9)


def turning(forces: list[float]) -> tuple[str, str]:
    """A program of an edge, a right angle and another edge, a target every 2 mm, and a log that names these forces along y."""
    half = len(forces) // 2
    points = [[2.0 * i, 0, 0] for i in range(half + 1)] + [[2.0 * half, 2.0 * (i + 1), 0] for i in range(half)]
    rows = "".join(f"{i},0,{force},0\n" for i, force in enumerate(forces))
    return Path3(np.array(points, dtype=float)).program(), "target,fx_n,fy_n,fz_n\n" + rows


def test_a_corner_that_serves_two_forces_harms_neither_and_is_said(tmp_path: Path) -> None:
    """300 N up to the corner, 20 N behind it, half of both at it. Where the force stays nothing is said or held back."""
    program, forces = turning([300.0] * 10 + [160.0] + [20.0] * 10)
    job = Job(tmp_path, program=program, forces=forces)
    result = job.correct("--json", "--keep-targets")
    offset = 1e3 * kit.column(job.offsets(), "ox_mm", "oy_mm", "oz_mm")
    sigma = np.linalg.norm(kit.column(job.offsets(), "sx_um", "sy_um", "sz_um")[10])
    before, behind = (np.linalg.norm(offset[10] - offset[number]) for number in (9, 11))
    assert behind <= np.linalg.norm(offset[11]) + sigma + 0.2
    assert behind > 0.9 * np.linalg.norm(offset[11]), "no more than that is given away"
    message = next(f["message"] for f in result.json["findings"] if f["code"] == "CS4114")
    asked, other, _, left = (float(number) for number in re.findall(r"([\d]+) um", message))
    assert asked == pytest.approx(np.linalg.norm(offset[9]), abs=1)
    assert other == pytest.approx(np.linalg.norm(offset[11]), abs=1)
    assert left == pytest.approx(before, abs=1)
    for tolerance, said in ((0.99 * before, True), (1.01 * before, False)):
        again = job.correct("--json", "--keep-targets", "--force", "--tolerance", f"{tolerance:.3f}")
        assert ("CS4114" in kit.codes(again)) == said, "told is what is left beyond the tolerance"
    job.program, job.forces = turning([160.0] * 21)
    assert "CS4114" not in kit.codes(job.correct("--force", "--json"))


def inner_corner() -> tuple[str, str]:
    """A program along a wall to an inner corner and on, a target every 0.2 mm, and its log: the wall pushes the tool back by
    600 N, that behind the corner, of as much, in its place as it comes near."""
    path = Path3(np.array([[0.2 * min(k, 20), 0.2 * max(k - 20, 0), 0] for k in range(41)]))
    ways = np.array([path.frames[b].p - path.frames[a].p for a, b in ((0, 1), (39, 40))])
    before, behind = kit.work_object().r.apply(ways / np.linalg.norm(ways, axis=1)[:, None])
    share = np.clip((np.arange(41) - 14) / 7, 0, 1)
    force = 600 * ((1 - share)[:, None] * behind - share[:, None] * before)
    return path.program(), "target,fx_n,fy_n,fz_n\n" + "".join(
        f"{k},{','.join(f'{x:.6f}' for x in one)}\n" for k, one in enumerate(force))


def test_what_is_held_back_at_an_inner_corner_is_told_beyond_the_tolerance(tmp_path: Path) -> None:
    """Against the same with a depth of cut that the tool of the log turned within, of which the hint tells. By the independent
    arm it stood 0.12 mm early at the corner."""
    program, forces = inner_corner()
    job = Job(tmp_path, program=program, forces=forces)

    def held(depth: float, tolerance: float = 5.0) -> tuple[np.ndarray, list[dict]]:
        run = job.correct("--json", "--keep-targets", "--force", "--max-slope", "100000", "--tolerance", f"{tolerance}",
                          "--depth-of-cut", f"{depth}")
        assert run.code == 0, run
        return kit.column(job.offsets(), "ox_mm", "oy_mm", "oz_mm"), [
            one for one in run.json["findings"] if one["code"] == "CS4116"]

    asked, nothing = held(0.13)
    made, [found] = held(0.11)
    size = 1e3 * np.linalg.norm(made - asked, axis=1)
    worst, told = int(np.argmax(size)), int((size > 5).sum())
    assert (nothing, found["level"], found["target"]) == ([], "warning", worst)
    assert found["message"].endswith(f"towards the wall behind {told} corrections are held back, by up to {size[worst]:.0f} "
                                     "um, which may be left there as stock")
    assert size[worst] > 150
    np.testing.assert_array_equal(np.flatnonzero(size), np.arange(15, 21))
    for times, many in ((0.99, 1), (1.01, 0)):
        _, again = held(0.11, times * size[worst])
        assert len(again) == many
        assert all("1 correction is held back" in one["message"] for one in again)


def test_a_step_at_a_sharp_corner_is_the_paths_own(tmp_path: Path) -> None:
    """Beside a right angle the offsets stay those that their forces ask for, whatever the limit of their slope; on a straight
    path the same forces are blended."""
    forces = [300.0] * 10 + [160.0] + [20.0] * 10
    program, named = turning(forces)
    limit = ("--json", "--keep-targets", "--max-slope", "20")
    job = Job(tmp_path, program=program, forces=named)
    result = job.correct(*limit)
    assert "CS4113" not in kit.codes(result)
    offset = 1e3 * kit.column(job.offsets(), "ox_mm", "oy_mm", "oz_mm")
    deviation = kit.column(job.offsets(), "dx_um", "dy_um", "dz_um")
    made, wanted = (np.linalg.norm(each, axis=1) for each in (offset, deviation))       # object and base
    np.testing.assert_allclose(np.delete(made, 10), np.delete(wanted, 10), atol=0.5)
    assert np.linalg.norm(offset[9] - offset[11]) > 3 * 20 * 4, "they stand 4 mm apart"
    job.program = line(20, 2).program()
    job.forces = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},0,{force},0\n" for i, force in enumerate(forces[:20]))
    assert "CS4113" in kit.codes(job.correct(*limit, "--force"))


STEP = ([0.0] * 10, [200.0] * 20, [0.0] * 10)


def stepped(key: str) -> str:
    """Force along y that jumps to 200 N and back on 40 targets, 0.2 mm apart."""
    levels = [level for part in STEP for level in part]
    rows = [f"{i if key == 'target' else 0.2 * i:.1f},0,{level},0" for i, level in enumerate(levels)]
    return "\n".join([f"{key},fx_n,fy_n,fz_n", *rows]) + "\n"


def test_a_step_of_the_force_is_blended_where_the_log_could_be_off_its_place(tmp_path: Path) -> None:
    path = line(40, 0.2)
    job = Job(tmp_path, program=path.program(), forces=stepped("path_mm"))
    result = job.correct("--json", "--max-slope", "300")
    assert result.code == 0
    assert "CS4113" in kit.codes(result)
    offset = 1e3 * kit.column(job.offsets(), "ox_mm", "oy_mm", "oz_mm")
    assert np.all(np.abs(np.diff(offset, axis=0)) <= 300 * 0.2 + 0.1)
    assert np.all(offset[:10] == 0)
    assert np.all(offset[30:] == 0)
    deviation = kit.column(job.offsets(), "dx_um", "dy_um", "dz_um")
    assert abs(np.linalg.norm(offset[20]) - np.linalg.norm(deviation[20])) < 0.5, "the middle of the cut is corrected in full"
    assert result.json["result"]["held_back"] > 0


def test_target_numbers_place_a_step_exactly(tmp_path: Path) -> None:
    job = Job(tmp_path, program=line(40, 0.2).program(), forces=stepped("target"))
    result = job.correct("--json")
    assert result.code == 0
    assert "CS4113" not in kit.codes(result)
    assert result.json["result"]["held_back"] == 0


def test_confidence_from_the_command_line(tmp_path: Path) -> None:
    """Stiffnesses known to a factor: a demanding user gets less of the correction, `--confidence 0.5` all of it."""
    job = Job(tmp_path, program=line(6, 5).program(), stiffness=kit.stiffness_text(relative=0.9),
              forces="target,fx_n,fy_n,fz_n\n" + "".join(f"{i},0,200,0\n" for i in range(6)))
    sizes = []
    for number, confidence in enumerate(("0.5", "0.8")):
        result = job.correct("--json", "--force", "--confidence", confidence)
        assert result.code == 0
        sizes.append(np.linalg.norm(kit.column(job.offsets(), "ox_mm", "oy_mm", "oz_mm"), axis=1))
        assert result.json["result"]["expected_worse"] > 0
        told = [one for one in result.json["findings"] if one["code"] == "CS4112"]
        assert len(told) == number
    left = 1e3 * (sizes[0] - sizes[1])
    out = int((sizes[1] < 1e-9).sum())
    assert told[0]["message"].startswith(
        f"small against their own uncertainty: 6 corrections; {out} left out, {6 - out} reduced")
    assert float(re.search(r"up to ([\d.]+) um", told[0]["message"])[1]) == pytest.approx(left.max(), rel=0.01)
    assert told[0]["target"] == np.argmax(left)
    assert np.all(sizes[1] < 0.9 * sizes[0])
    assert "0.5" in job.correct("--force", "--confidence", "0.3").err
