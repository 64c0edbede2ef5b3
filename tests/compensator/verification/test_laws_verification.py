"""`verify`: the intervals cover under autocorrelated noise, known gains and scales are found, pairs are the right ones, and the
answers have their exit codes."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from scipy.stats import norm, t

from compensator.verification.batch_means import mean_along
from compensator.verification.comparison import Scale, compare, estimate_scale
from compensator.verification.readings import Readings, nearest, read_readings
from compensator.verification.verify import Verification, _comparison_text, _scale_findings, _scale_text
from compensator.verification.verify import verify as verify_files
from compstiff.cli.main import compstiff
from identification.common.findings import CompstiffError
from identification.model.cell import read_cell
from tests.support import long, write_cell

SIGMAS = "target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um"


def remembering(rng: np.random.Generator, count: int, phi: float, size: float = 1.0) -> np.ndarray:
    """A first-order autoregression (count, 3) of standard deviation `size`, from its stationary state."""
    start = rng.normal(size=(1, 3))
    rest = lfilter([np.sqrt(1 - phi**2)], [1, -phi], rng.normal(size=(count - 1, 3)), axis=0, zi=phi * start)[0]
    return size * np.concatenate([start, rest])


def csv(folder: Path, name: str, header: str, rows: np.ndarray) -> Path:
    path = folder / name
    text = "\n".join(",".join("" if np.isnan(x) else f"{x:.9g}" for x in row) for row in rows)
    path.write_text(f"{header}\n{text}\n")
    return path


def verify(*arguments: object) -> Result:
    return CliRunner().invoke(compstiff, ["verify", *map(str, arguments)])


@pytest.mark.parametrize(("unit", "said"), [(1.0, None), (1e-3, "in millimetres?"), (0.0, "Were they measured?")])
@pytest.mark.parametrize("sigmas", ["", ",sx_um,sy_um,sz_um"])
def test_a_part_measured_in_millimetres_is_not_accepted(tmp_path: Path, unit: float, said: str | None, sigmas: str) -> None:
    """24 um in millimetres are 0.024: within any tolerance. A probe of 10 nm that says so is believed."""
    rng, cell = np.random.default_rng(5), read_cell(write_cell(tmp_path))
    rows = unit * rng.normal(0, 14, (20, 3))
    file = tmp_path / "after.csv"

    def written(sigma: float) -> Path:
        file.write_text("target,dx_um,dy_um,dz_um" + sigmas + "\n" + "".join(
            f"{k},{','.join(f'{x:.5f}' for x in row)}{f',{sigma},{sigma},{sigma}' if sigmas else ''}\n"
            for k, row in enumerate(rows)))
        return file

    if said is None:
        assert len(read_readings(written(2.0), cell)) == 20
        return
    with pytest.raises(CompstiffError, match="CS6035") as refused:
        read_readings(written(2.0), cell)
    assert said in refused.value.findings[0].hint
    if sigmas and unit:
        assert len(read_readings(written(0.01), cell)) == 20


@pytest.mark.parametrize("seed", range(30))
def test_a_unit_that_the_sigma_has_too_is_told(tmp_path: Path, seed: int) -> None:
    """Readings and their 1 sigma in millimetres show a part without error, of a probe that does not exist; in nanometres one
    that is off by centimetres. Any part of 0.5 to 2000 um and a probe of 0.05 to 30 are believed."""
    rng, cell = np.random.default_rng((6036, seed)), read_cell(write_cell(tmp_path))
    size, sigma = 10 ** rng.uniform(-0.3, 3.3), 10 ** rng.uniform(-1.3, 1.5)
    rows, file = rng.normal(0, np.hypot(size, sigma), (int(rng.integers(5, 60)), 3)), tmp_path / "part.csv"

    def written(unit: float, stated: float) -> Path:
        file.write_text("target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um\n" + "".join(
            f"{k},{','.join(f'{unit * x:.9g}' for x in row)}{3 * f',{unit * stated:.9g}'}\n" for k, row in enumerate(rows)))
        return file

    assert len(read_readings(written(1.0, sigma), cell)) == len(rows)
    with pytest.raises(CompstiffError, match="CS6036"):
        read_readings(written(1e-3, 2.0), cell)
    with pytest.raises(CompstiffError, match="CS6036"):
        read_readings(written(1e6, sigma), cell)
    lines = written(1.0, sigma).read_text().splitlines()
    lines[3] = f"2,{','.join(f'{x:.9g}' for x in rows[2])},{sigma:.9g},1e-160,{sigma:.9g}"
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(CompstiffError, match="CS6036") as stopped:
        read_readings(file, cell)
    assert stopped.value.findings[0].line == 4


@pytest.mark.parametrize("phi", [long(0.0), long(0.5), 0.9])
def test_intervals_cover_under_autocorrelated_noise(phi: float) -> None:
    """400 simulated pairs of passes: the true ratio and the true scale lie in their 95 % intervals as often as stated, and
    intervals that took the places as independent would not hold them."""
    rng = np.random.default_rng(7)
    runs, count, scale = 400, 1200, 1.3
    held_ratio = held_scale = naive = 0
    for _ in range(runs):
        predicted = 1e-6 * remembering(rng, count, 0.8, 100.0)
        before = scale * predicted + 1e-6 * remembering(rng, count, phi, 30.0)
        after = 0.1 * predicted + 1e-6 * remembering(rng, count, phi, 20.0)
        # Variances of the generator, three components alike.
        ratio = np.sqrt((130.0**2 + 30.0**2) / (10.0**2 + 20.0**2))
        found = compare(*(Readings("", "target", np.arange(count)[:, None], one, np.full((count, 3), 1e-6), None)
                          for one in (before, after)))
        assert found.interval is not None
        assert found.ratio is not None
        held_ratio += found.interval[0] <= ratio <= found.interval[1]
        z = np.sum(before**2 / np.sum(before**2) - after**2 / np.sum(after**2), axis=1) / 2 * count
        naive += abs(np.log(found.ratio / ratio)) <= 1.96 * z.std() / np.sqrt(count)
        fitted = estimate_scale(before, predicted)
        assert fitted is not None
        assert fitted.interval is not None
        held_scale += fitted.interval[0] <= scale <= fitted.interval[1]
    # Three standard errors of a binomial share of 400 are 3.3 %.
    assert 0.915 <= held_ratio / runs <= 0.985
    assert 0.915 <= held_scale / runs <= 0.985
    assert naive / runs < 0.87


def test_where_nothing_was_measured_or_predicted_there_is_no_scale() -> None:
    some, none = np.ones((40, 3)), np.zeros((40, 3))
    assert estimate_scale(none, some) is estimate_scale(some, none) is None
    assert estimate_scale(some, some) is not None


def test_the_interval_of_a_ratio_is_as_wide_as_that_of_chance() -> None:
    """Of n places, each of three components that are Gaussian and remember nothing, the logarithm of the ratio has the
    variance 1 / (3 n)."""
    rng, count = np.random.default_rng(5), 3000
    before, after = (Readings("", "target", np.arange(count)[:, None], 1e-6 * size * rng.normal(size=(count, 3)),
                              np.full((count, 3), 1e-6), None) for size in (60.0, 20.0))
    found = compare(before, after)
    assert found.interval is not None
    assert 0.7 < np.log(found.interval[1] / found.interval[0]) / (2 * 1.96 / np.sqrt(3 * count)) < 1.4
    assert found.interval[0] < 3 < found.interval[1]


def test_a_comparison_is_that_of_its_places_one_by_one() -> None:
    """In a loop over places, of which components are missing: sizes, what got worse by over two sigma of both sizes, the noise
    of what is left, and the interval of the means of sixteen blocks (of the logarithm of the ratio, to first order)."""
    rng, count = np.random.default_rng(31), 480
    both = [1e-6 * size * rng.normal(size=(count, 3)) for size in (12.0, 10.0)]
    sigmas = [1e-6 * rng.uniform(1.0, 6.0, (count, 3)) for _ in range(2)]
    for deviation in both:
        deviation[rng.random((count, 3)) < 0.2] = np.nan
    found = compare(*(Readings("", "target", np.arange(count)[:, None], deviation, sigma, None)
                      for deviation, sigma in zip(both, sigmas, strict=True)))
    size, noise, worse = [], [], 0
    for k in range(count):
        some = [axis for axis in range(3) if np.isfinite(both[0][k, axis]) and np.isfinite(both[1][k, axis])]
        if not some:
            continue
        own = [float(np.linalg.norm(deviation[k, some])) for deviation in both]
        along = [float(np.sqrt(sum((deviation[k, axis] / length * sigma[k, axis]) ** 2 for axis in some)))
                 for deviation, length, sigma in zip(both, own, sigmas, strict=True)]
        worse += own[1] - own[0] > 2 * np.hypot(*along)
        size.append(own)
        noise.append(sum(sigmas[1][k, axis] ** 2 for axis in some))
    before, after = np.array(size).T
    assert (found.before.points, found.worse) == (len(before), worse)
    assert worse > 20
    assert found.noise_um == pytest.approx(1e6 * np.sqrt(np.mean(noise)))
    for figures, own in ((found.before, before), (found.after, after)):
        assert (figures.rms_um, figures.mean_um, figures.max_um) == pytest.approx(
            (1e6 * np.sqrt(np.mean(own**2)), 1e6 * own.mean(), 1e6 * own.max()))
        assert figures.p95_um == pytest.approx(1e6 * np.quantile(own, 0.95))
    ratio = np.sqrt(np.mean(before**2) / np.mean(after**2))
    told = 0.5 * (before**2 / np.mean(before**2) - after**2 / np.mean(after**2))
    blocks = np.array([np.mean(part) for part in np.array_split(told, 16)])
    half = t.ppf(0.975, 15) * blocks.std(ddof=1) / 4
    assert found.ratio == pytest.approx(ratio)
    assert found.interval == pytest.approx((ratio * np.exp(-half), ratio * np.exp(half)))
    assert (found.verdict, found.log_ratio.blocks if found.log_ratio else 0) == ("better", 16)
    both[0], both[1] = both[1], both[0]
    assert compare(*(Readings("", "target", np.arange(count)[:, None], deviation, sigma, None)
                     for deviation, sigma in zip(both, sigmas, strict=True))).verdict == "worse"


def test_the_scale_beside_a_constant_is_that_of_the_components_that_were_measured() -> None:
    """Against least squares with a constant for each axis over what is known of either, and with none."""
    rng = np.random.default_rng(18)
    predicted = 1e-5 * rng.normal(3.0, 1.0, (60, 3))
    measured = 1.2 * predicted + [2e-5, -1e-5, 0.0] + 1e-6 * rng.normal(size=(60, 3))
    measured[rng.random((60, 3)) < 0.3] = np.nan
    predicted[rng.random((60, 3)) < 0.1] = np.nan
    measured[7] = np.nan
    row, axis = np.nonzero(np.isfinite(measured) & np.isfinite(predicted))
    m, p = measured[row, axis], predicted[row, axis]
    found = estimate_scale(measured, predicted)
    assert found is not None
    beside, *constants = np.linalg.lstsq(np.column_stack([p, *(axis == k for k in range(3))]), m, rcond=None)[0]
    assert found.scale == pytest.approx(float(m @ p / (p @ p)), rel=1e-9)
    assert found.with_constant == pytest.approx(beside, rel=1e-9)
    assert found.constant_um == pytest.approx(1e6 * np.array(constants), rel=1e-6)
    assert found.points == len(set(row))


SURE = Scale(100, 1.2, (1.1, 1.3), 0.9, 0.95, 100.0, 20.0, None, None, (0.0,) * 3, False, 16, False)


@pytest.mark.parametrize(("change", "option"), [
    ({}, "--scale 1.2:0.051"), ({"interval": (0.9, 1.3)}, "--scale 1:0.1"), ({"interval": None}, ""),
    ({"interval": (-0.1, 2.0)}, ""), ({"interval": (0.9, 1.3), "constant_shown": True}, ""), ({"constant_shown": True}, ""),
    ({"interval": (0.9, 1.3), "other_axes": "x y exchanged"}, ""), ({"other_axes": "x y exchanged"}, ""),
    ({"scale": 9.0, "interval": (8.0, 10.0)}, "")])
def test_a_scale_is_handed_on_where_it_is_one(change: dict[str, object], option: str) -> None:
    """A half width of the interval is 1.96 sigma. Nothing where a constant shows beside it, other axes, or a size that no robot
    has; where 1 will do, 1."""
    assert replace(SURE, **change).option == option


@pytest.mark.parametrize(("x", "y", "apart"), [
    ((1.0, 1.2), (1.3, 1.5), True), ((1.3, 1.5), (1.0, 1.2), True), ((1.0, 1.3), (1.2, 1.5), False),
    ((1.2, 1.5), (1.0, 1.3), False), ((1.0, 1.6), (1.2, 1.4), False), ((1.2, 1.4), (1.0, 1.6), False),
    (None, (1.3, 1.5), False), ((1.0, 1.2), None, False)])
@pytest.mark.parametrize("share", [0.045, 0.055])
def test_axes_are_told_apart_whose_intervals_have_nothing_in_common(
    x: tuple[float, float] | None, y: tuple[float, float] | None, apart: bool, share: float
) -> None:
    """Where one scale leaves over a twentieth of the measured beyond what is left with each its own, by the sum of squares."""
    own = {axis: replace(SURE, scale=1.0 if interval is None else float(np.mean(interval)), interval=interval, points=points,
                         residual_rms_um=left) for axis, interval, points, left in (("x", x, 80, 8.0), ("y", y, 100, 12.0))}
    squares = 80 * 8.0**2 + 100 * 12.0**2 + 100 * (100 * share) ** 2
    found = [one for one in _scale_findings(replace(SURE, residual_rms_um=float(np.sqrt(squares / 100))), own, "before.csv")
             if one.code == "CS6030"]
    assert len(found) == (apart and share > 0.05)
    for one in found:
        assert one.message.startswith(f"along x the measured deviation is {own['x'].scale:.3f} times")
        assert f"one scale leaves {100 * share:.1f} um RMS that would not be left with each its own" in one.message


@pytest.mark.parametrize(("interval", "inside"), [((0.9, 1.1), True), ((1.0, 1.2), True), ((0.8, 1.0), True),
                                                  ((1.01, 1.2), False), ((0.8, 0.99), False)])
def test_a_scale_is_advised_where_one_lies_outside(interval: tuple[float, float], inside: bool) -> None:
    """And where it lies inside that is said, and no scale advised. A robot at rest gives way less than one in motion, not
    more."""
    scale = Scale(100, float(np.mean(interval)), interval, 0.9, 0.95, 100.0, 20.0, None, None, (0.0,) * 3, False, 16, False)
    text = _scale_text(scale)
    assert ("1 lies inside: no scale is needed" in text) == inside
    assert ("Advice: correct" in text) != inside
    assert ("So it is where the load tests were taken at standstill" in text) == (not inside and scale.scale > 1)
    assert "No scale is advised" not in text
    assert "No scale is advised" in _scale_text(replace(scale, interval=None))


@pytest.mark.parametrize("alone", [True, False])
def test_a_part_that_is_off_as_before_is_said_beside_what_else_is_said(tmp_path: Path, alone: bool) -> None:
    """Measured twice with a micrometre of noise, the second time at a place less; the very same readings are said to be that.
    """
    rng, cell = np.random.default_rng(19), read_cell(write_cell(tmp_path))
    before = rng.normal(0, 40, (40, 3))

    def file(name: str, values: np.ndarray) -> Path:
        count = len(values)
        return csv(tmp_path, name, SIGMAS, np.column_stack([np.arange(count), values, np.ones((count, 3))]))

    first, second = file("before.csv", before), before + rng.normal(0, 1, before.shape)
    again = file("again.csv", second if alone else second[:-1])
    said = [finding.code for finding in verify_files(cell, first, again).findings]
    assert ("CS6022" in said, "CS6048" in said, "CS6034" in said) == (not alone, True, False)
    said = [finding.code for finding in verify_files(cell, first, file("same.csv", before)).findings]
    assert ("CS6034" in said, "CS6048" in said) == (True, False)


def test_the_interval_is_student_s_with_one_less_than_the_blocks() -> None:
    """Blocks of 100 values whose means are known: t(0.975; 15) = 2.1314, of the tables."""
    rng = np.random.default_rng(8)
    values = rng.normal(3.0, 1.0, 1600)
    mean = mean_along(values)
    assert mean.blocks == 16
    error = values.reshape(16, 100).mean(axis=1).std(ddof=1) / 4
    assert mean.half_width == pytest.approx(2.1314 * error, rel=1e-4)


def test_figures_by_hand(tmp_path: Path) -> None:
    cell = read_cell(write_cell(tmp_path))
    before = csv(tmp_path, "b.csv", "target,dx_um,dy_um", np.array([[3, 30, 40], [1, 0, 20], [2, np.nan, 10], [9, 5, 5]]))
    after = csv(tmp_path, "a.csv", "target,dx_um,dy_um", np.array([[1, 3, 4], [2, 1, 30], [3, 0, np.nan], [10, 1, 1]]))
    result = verify(tmp_path / "cell.yaml", before, after, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)["result"]
    # Pairs 1, 2, 3, and not 9 with its neighbour; of 2 only y, of 3 only x is measured in both.
    assert (found["points"], found["unpaired_before"], found["unpaired_after"]) == (3, 1, 1)
    assert found["before"]["rms_um"] == pytest.approx(np.sqrt((20**2 + 10**2 + 30**2) / 3))
    assert found["after"]["rms_um"] == pytest.approx(np.sqrt((5**2 + 30**2 + 0) / 3))
    assert found["after"]["max_um"] == pytest.approx(30)
    assert found["after"]["mean_um"] == pytest.approx(35 / 3)
    assert found["ratio"] == pytest.approx(np.sqrt(1400 / 925))
    assert found["ratio_interval_95"] is None       # Three places say nothing of their scatter.
    assert found["worse_points"] == 1
    assert found["axes"]["y"]["before"]["mean_um"] == pytest.approx(15)
    assert "z" not in found["axes"]
    assert _comparison_text(verify_files(cell, before, after).comparison).endswith("too few places to say how sure that is.")
    assert {one["code"] for one in json.loads(result.stdout)["findings"]} == {"CS6022", "CS6024", "CS6025"}
    assert read_readings(before, cell).place[:, 0].tolist() == [1, 2, 3, 9]


@pytest.mark.parametrize("columns", ["target", "x_mm,y_mm,z_mm"])
@pytest.mark.parametrize(("shared", "words"), [(3, ""), (2, "only 2 of 30 rows belong"), (0, "no row belongs")])
def test_a_tenth_of_the_places_belongs_together(tmp_path: Path, columns: str, shared: int, words: str) -> None:
    """Of the smaller pass; how many have no counterpart is told of each. Targets have no distance to set."""
    cell, rng = read_cell(write_cell(tmp_path)), np.random.default_rng(23)

    def file(name: str, target: np.ndarray) -> Path:
        where = target[:, None] if columns == "target" else np.column_stack([5.0 * target, 0 * target, 0 * target])
        off = rng.normal(0, 40, (len(target), 3))
        return csv(tmp_path, name, f"{columns},dx_um,dy_um,dz_um", np.column_stack([where, off]))

    before, after = file("before.csv", np.arange(40)), file("after.csv", np.arange(30) + 40 - shared)
    if not words:
        told = [one for one in verify_files(cell, before, after).findings if one.code == "CS6022"]
        assert [(one.level, one.file, one.message.partition(" without")[0]) for one in told] == [
            ("warning", str(before), "37 readings of 40"), ("warning", str(after), "27 readings of 30")]
        return
    with pytest.raises(CompstiffError) as stopped:
        verify_files(cell, before, after)
    (found,) = stopped.value.findings
    assert (found.code, found.file, found.message.startswith(words)) == ("CS6023", str(after), True)
    assert ("within-mm" in found.hint, "at most 1 mm apart" in found.message) == (columns != "target", columns != "target")


@pytest.mark.parametrize("columns", ["target", "x_mm,y_mm,z_mm"])
def test_readings_without_a_predicted_target_are_left_out_of_the_scale_and_counted(tmp_path: Path, columns: str) -> None:
    """Three are aside by 1.05 mm, or have other numbers; what is told of the distance helps."""
    cell, rng = read_cell(write_cell(tmp_path)), np.random.default_rng(24)
    target = np.arange(60)
    of_program = rng.normal(0, 80, (60, 3))
    told = csv(tmp_path, "told.csv", "target,x_mm,y_mm,z_mm,dx_um,dy_um,dz_um",
               np.column_stack([target, 5.0 * target, 0 * target, 0 * target, of_program]))
    aside = np.isin(target, (7, 8, 30))
    where = (target + 1000 * aside)[:, None] if columns == "target" else np.column_stack(
        [5.0 * target, 1.05 * aside, 0 * target])
    read = csv(tmp_path, "read.csv", f"{columns},dx_um,dy_um,dz_um", np.column_stack([where, of_program]))
    result = verify_files(cell, read, read, told)
    (found,) = (one for one in result.findings if one.code == "CS6022")
    assert (found.level, found.file) == ("warning", str(read))
    assert found.message == f"3 readings of 60 without a target in {told}; left out of the scale"
    assert found.hint == ("" if columns == "target" else "the nearest may be 1 mm away: --within-mm sets it")
    assert result.scale is not None
    assert result.scale.points == 57
    if columns != "target":
        wider = verify_files(cell, read, read, told, within=1.1e-3)
        assert wider.scale is not None
        assert ("CS6022" in {one.code for one in wider.findings}, wider.scale.points) == (False, 60)


def test_pairs_are_each_others_nearest_within_the_distance() -> None:
    first = np.array([[0.0], [1.0], [2.0], [10.0]])
    second = np.array([[0.1], [0.2], [2.4], [50.0]])
    mine, other = nearest(first, second, 0.5)
    assert (mine.tolist(), other.tolist()) == ([0, 2], [0, 2])


def test_readings_at_one_place_are_paired_along_their_normals_and_in_their_order(tmp_path: Path) -> None:
    """Both walls of six corners, each read twice; the second pass in another order. So the hint of CS6020 can be followed."""
    corner, wall, again = (grid.ravel() for grid in np.meshgrid(np.arange(6), [0, 1], [0, 1], indexing="ij"))
    off = 100.0 + 10 * corner + 50 * wall + again
    rows = np.column_stack([5 * corner, 0 * corner, 0 * corner, wall == 0, wall == 1, 0 * corner, off])
    cell, columns = read_cell(write_cell(tmp_path)), "x_mm,y_mm,z_mm,nx,ny,nz,dn_um"
    before = csv(tmp_path, "before.csv", columns, rows)
    order = np.lexsort([again, -corner, wall])
    half = rows[order].copy()
    half[:, 6] /= 2
    result = verify_files(cell, before, csv(tmp_path, "after.csv", columns, half))
    assert "CS6022" not in {one.code for one in result.findings}
    assert result.rows_after.tolist() == np.argsort(order).tolist()
    assert result.comparison.before.points == 24
    assert result.comparison.ratio == pytest.approx(2, rel=1e-9)

    other_way = half.copy()
    other_way[:, 3:] *= -1
    with pytest.raises(CompstiffError) as stopped:
        verify_files(cell, before, csv(tmp_path, "turned.csv", columns, other_way))
    (found,) = stopped.value.findings
    assert (found.code, "at most 1 mm apart, along normals at most 30 degrees apart" in found.message) == ("CS6023", True)
    assert "out of the material" in found.hint


def test_places_that_got_worse_by_chance_are_as_many_as_stated(tmp_path: Path) -> None:
    """The same deviation twice with the stated noise: 2.3 % of the places look worse."""
    rng = np.random.default_rng(3)
    cell = read_cell(write_cell(tmp_path))
    true = 100.0 + np.zeros((4000, 3))
    sigma = np.tile([2.0, 5.0, 9.0], (4000, 1))
    readings = [true + sigma * rng.normal(size=true.shape) for _ in range(2)]
    passes = [csv(tmp_path, f"{number}.csv", SIGMAS, np.column_stack([np.arange(4000), one, sigma]))
              for number, one in enumerate(readings)]
    comparison = compare(*(read_readings(path, cell) for path in passes))
    assert comparison.worse / 4000 == pytest.approx(0.0228, abs=0.008)
    assert comparison.verdict == "no difference shown"
    assert comparison.noise_um == pytest.approx(np.sqrt(4 + 25 + 81))

# What a vector's components become along axes that are turned by 25 degrees about z.
TURNED = Rotation.from_euler("z", 25, degrees=True).as_matrix()


@pytest.fixture
def passes(tmp_path: Path) -> dict[str, Path]:
    """A path of 600 targets: predicted 100 um RMS, measured 1.25 times that before and a fifth of it after; the work object of
    the cell is turned against the base."""
    rng = np.random.default_rng(11)
    half = np.sqrt(0.5)
    cell = write_cell(tmp_path, "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"
                      f"workobject: {{position_mm: [900, 0, 400], quaternion: [{half}, 0, 0, {half}]}}\n")
    targets = np.arange(600)
    place = np.column_stack([0.5 * targets, np.zeros(600), np.zeros(600)])
    base = remembering(rng, 600, 0.9, 100.0)
    # A quarter turn about z: the work object's x axis is the base's y, its y the base's -x.
    turned = np.column_stack([base[:, 1], -base[:, 0], base[:, 2]])
    before, after = (factor * base + remembering(rng, 600, 0.7, 5.0) for factor in (1.25, 0.2))
    in_object = 1.25 * turned + remembering(rng, 600, 0.7, 5.0)
    normal = np.column_stack([np.cos(targets / 40), np.sin(targets / 40), np.zeros(600)])
    along = np.sum(normal * before, axis=1)
    header = "target,dx_um,dy_um,dz_um"
    return {
        "cell": cell,
        "before": csv(tmp_path, "before.csv", header, np.column_stack([targets, before])),
        "after": csv(tmp_path, "after.csv", header, np.column_stack([targets, after])),
        "places": csv(tmp_path, "places.csv", "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um", np.column_stack([place + 0.1, in_object])),
        "normal": csv(tmp_path, "normal.csv", "target,dn_um,nx,ny,nz", np.column_stack([targets, along, normal])),
        "shifted": csv(tmp_path, "shifted.csv", header, np.column_stack([targets, before + np.array([0, 0, 400])])),
        "turned": csv(tmp_path, "turned.csv", header, np.column_stack([targets, before @ TURNED])),
        "mirrored": csv(tmp_path, "mirrored.csv", header, np.column_stack([targets, before * [-1, 1, 1]])),
        "predicted": csv(tmp_path, "deviation.csv", "target,x_mm,y_mm,z_mm,dx_um,dy_um,dz_um",
                         np.column_stack([targets, place, base])),
    }


def test_gain_and_scale_are_found(passes: dict[str, Path], tmp_path: Path) -> None:
    report = tmp_path / "r.html"
    result = verify(passes["cell"], passes["before"], passes["after"], "--predicted", passes["predicted"], "--json", "--report",
                    report)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)["result"]
    assert found["verdict"] == "better"
    assert found["ratio_interval_95"][0] < 1.25 / 0.2 < 1.1 * found["ratio_interval_95"][1]
    scale = found["predicted"]
    assert scale["interval"][0] < 1.25 < scale["interval"][1]
    assert scale["advised_scale"] == pytest.approx(1.25, abs=0.02)
    assert re.fullmatch(r"\d\.\d{1,3}", str(scale["advised_scale"]))
    # What s = 1 leaves of 1.25 p and the noise: (0.25^2 + 0.05^2) / (1.25^2 + 0.05^2).
    assert scale["share"] == pytest.approx(1 - 0.065 / 1.565, abs=0.01)
    assert scale["share_scaled"] > 0.99
    assert set(scale["axes"]) == {"x", "y", "z"}
    page = report.read_text()
    assert re.search(r"correct --scale 1\.2[345]\d*:0\.0", re.sub(r"<[^>]+>", "", page))
    assert "http" not in page.split("<body>")[1].split("<script>")[0]


@pytest.mark.parametrize(("tolerance", "word"), [(1000, "ACCEPTED"), (1, "NOT ACCEPTED")])
def test_either_answer_has_a_step_to_copy_and_names_the_worst_place(
        passes: dict[str, Path], tmp_path: Path, tolerance: float, word: str) -> None:
    """The step that the terminal tells, as a command; and where the part is worst, by the file's own numbers."""
    report = tmp_path / "r.html"
    result = verify(passes["cell"], passes["before"], passes["after"], "--tolerance-um", tolerance, "--report", report)
    assert "add --predicted" in result.output
    page = re.sub(r"<[^>]+>", "", report.read_text().split("<body>")[1])
    assert word in page
    assert re.search(r"compstiff verify \S*cell.yaml \S*before.csv \S*after.csv --predicted", page)
    target, *size = np.loadtxt(passes["after"], delimiter=",", skiprows=1).T
    worst = target[np.argmax(np.linalg.norm(size, axis=0))]
    assert f"at target {worst:.0f}" in page


def page_of(passes: dict[str, Path], before: Path, after: Path, *options: object) -> str:
    report = passes["cell"].with_name("answer.html")
    result = verify(passes["cell"], before, after, "--report", report, *options)
    assert result.exit_code in (0, 3), result.output
    return re.sub(r"<[^>]+>", "", report.read_text().split("<body>")[1]).replace("\xa0", " ")


@pytest.mark.parametrize(("first", "second", "options", "word", "advice"), [
    ("before", "after", (), "BETTER", "No tolerance was stated"),
    ("after", "before", (), "WORSE THAN BEFORE", "Do not use this correction"),
    ("after", "before", ("--tolerance-um", 1000), "WORSE THAN BEFORE", "Do not use this correction"),
    ("before", "again", (), "NO CLEAR DIFFERENCE", "do not show that one is better")])
def test_the_page_answers_what_the_part_showed(
    passes: dict[str, Path], tmp_path: Path, first: str, second: str, options: tuple[object, ...], word: str, advice: str,
) -> None:
    """Also where a part that became worse is within a wide tolerance. Where it did, the next step is the log, not the next
    part."""
    target, *off = np.loadtxt(passes["before"], delimiter=",", skiprows=1).T
    again = np.array(off).T + remembering(np.random.default_rng(3), len(target), 0.7, 20.0)
    passes = {**passes, "again": csv(tmp_path, "again.csv", "target,dx_um,dy_um,dz_um", np.column_stack([target, again]))}
    page = page_of(passes, passes[first], passes[second], *options)
    answers = ["NOT ACCEPTED", "ACCEPTED", "BETTER", "WORSE THAN BEFORE", "NO CLEAR DIFFERENCE"]
    assert [each for each in answers if each in page] == [word]
    assert advice in page
    assert ("--other-forces SECOND.forces.csv" in page, "compstiff learn" in page) == (word[0] == "W", word[0] != "W")


@pytest.mark.parametrize(("header", "place", "said"), [
    ("path_mm", [[12.34 * k] for k in range(40)], "at path length 86.4 mm"),
    ("x_mm,y_mm,z_mm", [[12.34 * k, -0.5 * k, 3] for k in range(40)], "at x y z 86.4, -3.5, 3.0 mm")])
def test_the_worst_place_is_named_as_the_file_has_it(
    passes: dict[str, Path], tmp_path: Path, header: str, place: list[list[float]], said: str
) -> None:
    """The eighth, off by 90 um after."""
    rng = np.random.default_rng(4)
    before, after = 100 * rng.normal(size=(40, 1)), 10 * rng.uniform(-1, 1, (40, 1))
    after[7] = -90
    one, two = (csv(tmp_path, name, f"{header},dz_um", np.hstack([place, off]))
                for name, off in (("b.csv", before), ("a.csv", after)))
    page = page_of(passes, one, two, "--tolerance-um", 50)
    assert f"the worst {said}" in page
    assert ("path length [mm]" in page, "in the order of the first file" in page) == (
        header == "path_mm", header != "path_mm")


@pytest.mark.parametrize(("other", "file", "said"), [
    ("target,dn_um,nx,ny,nz\n0,5,0,0,1\n1,5,0,0,1\n", "other", "has the deviation along normal"),
    ("target,dy_um\n0,5\n1,5\n", "other", "no component was measured in both passes"),
    ("target,dx_um\n0,5\n1,5\n", "", "")])
def test_passes_that_were_not_measured_alike_are_not_compared(
    passes: dict[str, Path], tmp_path: Path, other: str, file: str, said: str
) -> None:
    first, second = tmp_path / "first.csv", tmp_path / "other.csv"
    first.write_text("target,dx_um,dz_um\n0,50,20\n1,55,20\n")
    second.write_text(other)
    result = verify(passes["cell"], first, second, "--json")
    told = [one for one in json.loads(result.stdout)["findings"] if one["level"] == "error"]
    assert result.exit_code == (1 if said else 0)
    assert [(one["code"], one["file"]) for one in told] == ([("CS6020", str(second))] if said else [])
    assert all(said in one["message"] for one in told)


@pytest.mark.parametrize(("readings", "file", "said"), [
    ("x_mm,y_mm,z_mm,dx_um\n0,0,0,5\n1,0,0,5\n", "told.csv", "has no x_mm y_mm z_mm"),
    ("target,dn_um\n0,5\n1,5\n", "r.csv", "not the normal"), ("target,dn_um,nx,ny,nz\n0,5,0,0,1\n1,5,0,0,1\n", "", "")])
def test_what_a_prediction_needs_of_the_readings_is_asked_for(
    passes: dict[str, Path], tmp_path: Path, readings: str, file: str, said: str
) -> None:
    """Its targets have no places: readings at targets can be joined, those along a normal where that is known."""
    read, told = tmp_path / "r.csv", tmp_path / "told.csv"
    read.write_text(readings)
    told.write_text("target,dx_um,dy_um,dz_um\n0,1,2,3\n1,2,3,4\n")
    result = verify(passes["cell"], read, read, "--predicted", told, "--json")
    errors = [one for one in json.loads(result.stdout)["findings"] if one["level"] == "error"]
    assert [(one["code"], Path(one["file"]).name) for one in errors] == ([("CS6028", file)] if said else [])
    assert all(said in one["message"] for one in errors)
    assert result.exit_code == (1 if said else 0)


@pytest.mark.parametrize(("count", "said"), [(4, "no interval"), (30, "rather too narrow"), (600, "")])
def test_a_scale_of_too_few_places_is_told(passes: dict[str, Path], tmp_path: Path, count: int, said: str) -> None:
    """What it leaves is alike over dozens of places."""
    rng = np.random.default_rng(5)
    target = np.arange(count)
    told = np.column_stack([80 + 40 * np.sin(target / 3), 60 * np.cos(target / 5), 50 * np.sin(target / 7)])
    off = 1.2 * told + remembering(rng, count, 0.9 if count < 600 else 0.5, 10.0)
    read, file = (csv(tmp_path, name, "target,dx_um,dy_um,dz_um", np.column_stack([target, what]))
                  for name, what in (("r.csv", off), ("told.csv", told)))
    result = verify(passes["cell"], read, passes["after"], "--predicted", file, "--json")
    told_of = [one for one in json.loads(result.stdout)["findings"] if one["code"] == "CS6024" and "scale" in one["message"]]
    assert [(one["level"], one["file"], f"{count} places" in one["message"], said in one["message"]) for one in told_of] == (
        [("warning", str(read), True, True)] if said else [])


@pytest.mark.parametrize(("count", "phi", "words"), [
    (7, 0.0, "7 places too few for an interval"), (8, 0.0, ""), (40, 0.95, "places with deviations that are alike over"),
    (1200, 0.5, "")])
def test_a_comparison_of_too_few_places_is_told(tmp_path: Path, count: int, phi: float, words: str) -> None:
    """Of independent ones under eight; of 40 that are alike over a dozen the interval is what it is, and said to be narrow."""
    rng, cell, target = np.random.default_rng(6024), read_cell(write_cell(tmp_path)), np.arange(count)
    before, after = (csv(tmp_path, name, "target,dx_um,dy_um,dz_um", np.column_stack([
        target, remembering(rng, count, phi, size)])) for name, size in (("before.csv", 60.0), ("after.csv", 9.0)))
    found = verify_files(cell, before, after)
    told = [one for one in found.findings if one.code == "CS6024"]
    assert [(one.level, one.file, words in one.message) for one in told] == [("warning", str(after), True)] * bool(words)
    assert (found.comparison.interval is None) == (count < 8)
    if count == 40:
        places = re.search(r"alike over ([\d.]+) of them: the interval is rather too narrow", told[0].message)
        assert places
        assert 1.2 < float(places[1]) < 40


@pytest.mark.parametrize(("name", "options"), [("places", ("--frame", "workobject")), ("normal", ())])
def test_the_scale_in_other_frames_and_along_the_normal(passes: dict[str, Path], name: str, options: tuple[str, ...]) -> None:
    result = verify(passes["cell"], passes[name], passes[name], "--predicted", passes["predicted"], *options, "--json")
    assert result.exit_code == 0, result.output
    scale = json.loads(result.stdout)["result"]["predicted"]
    assert scale["interval"][0] < 1.25 < scale["interval"][1]
    assert scale["interval"][1] - scale["interval"][0] < 0.04


@pytest.mark.parametrize("frame", ["base", "workobject"])
def test_places_on_the_surface_are_those_of_the_tool_beside_it(passes: dict[str, Path], tmp_path: Path, frame: str) -> None:
    """The table that `learn` takes: 8 mm beside the path along the normal."""
    target, along, *base = np.loadtxt(passes["normal"], delimiter=",", skiprows=1).T
    normal = np.array(base).T
    in_object = np.column_stack([normal[:, 1], -normal[:, 0], normal[:, 2]])       # a quarter turn about z, as above
    surface = np.column_stack([0.5 * target, 0 * target, 0 * target]) - 8 * in_object
    columns = np.column_stack([surface, along, in_object if frame == "workobject" else normal])
    points = csv(tmp_path, "surface.csv", "x_mm,y_mm,z_mm,dn_um,nx,ny,nz", columns)
    words = (passes["cell"], points, points, "--predicted", passes["predicted"], "--frame", frame, "--json")
    result = verify(*words, "--tool-radius-mm", "8")
    assert result.exit_code == 0, result.output
    low, high = json.loads(result.stdout)["result"]["predicted"]["interval"]
    assert 1.2 < low < 1.25 < high < 1.3


@pytest.mark.parametrize(("name", "radius", "refused"), [
    ("before", 8, True), ("normal", 8, True), ("places", 8, True), ("normal", 0, False)])
def test_a_radius_asks_for_places_and_their_normals(passes: dict[str, Path], name: str, radius: float, refused: bool) -> None:
    """Targets, targets with normals, and places without; the test above has both."""
    result = verify(passes["cell"], passes[name], passes[name], "--predicted", passes["predicted"], "--json",
                    *(["--tool-radius-mm", radius] if radius else []))
    assert result.exit_code == int(refused), result.output
    told = [finding for finding in json.loads(result.stdout)["findings"] if finding["level"] == "error"]
    assert [(finding["code"], finding["file"]) for finding in told] == ([("CS5304", str(passes[name]))] if refused else [])


def test_rows_without_a_number_are_left_out_and_counted(tmp_path: Path) -> None:
    """One component of three is a measured row."""
    cell, file = read_cell(write_cell(tmp_path)), tmp_path / "pass.csv"
    file.write_text("target,dx_um,dy_um,dz_um\n0,5,,\n1,5,6,7\n")
    whole = read_readings(file, cell)
    assert (len(whole), "CS6032" in {finding.code for finding in whole.findings}) == (2, False)
    file.write_text("target,dx_um,dy_um,dz_um\n0,5,,\n2,,,\n1,5,6,7\n3,,,\n")
    left = read_readings(file, cell)
    assert left.place.tolist() == [[0.0], [1.0]]
    [finding] = [finding for finding in left.findings if finding.code == "CS6032"]
    assert (finding.level, finding.message, finding.file) == ("note", "2 rows without a measured component left out", str(file))


def test_readings_of_one_target_are_averaged_and_counted(tmp_path: Path) -> None:
    """The mean of those that there are, with the sigma of a mean: of 3 and 4 um the half of 5 um."""
    cell, file = read_cell(write_cell(tmp_path)), tmp_path / "pass.csv"
    file.write_text("target,dx_um,dy_um,sx_um,sy_um,sz_um\n7,4,1,3,2,1\n3,10,2,1,2,1\n7,8,,4,2,1\n")
    read = read_readings(file, cell)
    assert read.place.tolist() == [[3.0], [7.0]]
    np.testing.assert_allclose(1e6 * read.deviation[:, :2], [[10, 2], [6, 1]])
    np.testing.assert_allclose(1e6 * read.sigma[:, :2], [[1, 2], [2.5, 2]])
    [finding] = [finding for finding in read.findings if finding.code == "CS6033"]
    assert (finding.level, finding.file) == ("note", str(file))
    assert finding.message == "1 further reading of a target that has one: averaged with it"
    file.write_text("path_mm,dx_um\n7,4\n7,8\n")          # at one place, but not of one target
    assert (len(read_readings(file, cell)), "CS6033" in {one.code for one in read_readings(file, cell).findings}) == (2, False)
    file.write_text("target,dx_um\n7,4\n8,8\n")
    assert "CS6033" not in {one.code for one in read_readings(file, cell).findings}


@pytest.mark.parametrize("degrees", [0, 29, 31, 90, 180])
def test_readings_of_one_target_along_other_normals_are_not_one(tmp_path: Path, degrees: float) -> None:
    """Of two walls of a corner, or of a rib: their mean is nobody's deviation. Of all components it is, whatever the normal."""
    cell, file = read_cell(write_cell(tmp_path)), tmp_path / "pass.csv"
    along = f"{np.cos(np.radians(degrees)):.6f},{np.sin(np.radians(degrees)):.6f},0"
    file.write_text(f"target,dx_um,nx,ny,nz\n7,40,1,0,0\n7,-40,{along}\n")
    np.testing.assert_allclose(read_readings(file, cell).deviation[0, 0], 0, atol=1e-12)
    file.write_text(f"path_mm,dn_um,nx,ny,nz\n7,40,1,0,0\n7,-40,{along}\n")
    assert len(read_readings(file, cell)) == 2
    file.write_text(f"target,dn_um,nx,ny,nz\n7,40,1,0,0\n9,10,0,0,1\n7,,{along}\n")      # one that was not measured
    np.testing.assert_allclose(1e6 * read_readings(file, cell).deviation, [[40], [10]], atol=1e-9)
    file.write_text(f"target,dn_um,nx,ny,nz\n7,40,1,0,0\n9,10,0,0,1\n7,-40,{along}\n")
    if degrees < 30:
        np.testing.assert_allclose(1e6 * read_readings(file, cell).deviation, [[0], [10]], atol=1e-9)
        return
    with pytest.raises(CompstiffError) as stopped:
        read_readings(file, cell)
    [finding] = stopped.value.findings
    assert (finding.code, finding.line) == ("CS6020", 4)
    assert f"target 7 has readings along normals that are {degrees:g} degrees apart" in finding.message


def test_how_far_the_nearest_target_is_is_said(passes: dict[str, Path], tmp_path: Path) -> None:
    rows = np.loadtxt(passes["places"], delimiter=",", skiprows=1) + np.array([0, 0, 8, 0, 0, 0])
    points = csv(tmp_path, "beside.csv", "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um", rows)
    result = verify(passes["cell"], points, points, "--predicted", passes["predicted"], "--json")
    assert result.exit_code == 1, result.output
    assert "8.1 mm away in the middle" in next(
        finding["message"] for finding in json.loads(result.stdout)["findings"] if finding["code"] == "CS6028")


@pytest.mark.parametrize(("carries", "kind", "exit_code"), [
    ("workobject", "linear", 0), ("workobject", "rotary", 1), ("robot", "rotary", 1), ("nothing", "rotary", 0)])
def test_a_work_object_that_may_turn_against_the_base_is_not_compared(
    passes: dict[str, Path], carries: str, kind: str, exit_code: int
) -> None:
    """The predicted deviations are in the base frame, and the file does not say where a table stood; a slide turns nothing."""
    axis = f"{{eax: a, kind: {kind}{'' if carries == 'nothing' else ', direction: [0, 0, 1]'}}}"
    unit = f"{{name: STN1, carries: {carries}, axes: [{axis}]}}"
    passes["cell"].write_text(passes["cell"].read_text() + f"mechanical_units: [{unit}]\n")
    result = verify(passes["cell"], passes["places"], passes["places"], "--predicted", passes["predicted"], "--frame",
                    "workobject", "--json")
    assert result.exit_code == exit_code, result.output
    assert ("CS4513" in result.output) == (exit_code == 1)
    same = verify(passes["cell"], passes["before"], passes["after"], "--predicted", passes["predicted"], "--json")
    assert same.exit_code == 0, same.output


@pytest.mark.parametrize(("name", "options", "code"), [
    ("shifted", (), "CS6029"),                              # a set-up error of 0.4 mm
    ("mirrored", (), "CS6030"),                             # a wrong sign along x
    ("before", ("--frame", "workobject"), "CS6031"),        # the wrong frame
])
def test_what_a_scale_does_not_mend_is_said(passes: dict[str, Path], name: str, options: tuple[str, ...], code: str) -> None:
    result = verify(passes["cell"], passes[name], passes["after"], "--predicted", passes["predicted"], *options, "--json")
    assert result.exit_code == 0, result.output
    assert code in {finding["code"] for finding in json.loads(result.stdout)["findings"]}


def test_a_work_object_that_the_cell_does_not_state_is_not_taken_for_the_base(passes: dict[str, Path]) -> None:
    """A program that declares its own stands elsewhere: at 10 degrees a scale of 1.10 had come out as 1.086 +- 0.002."""
    lines = passes["cell"].read_text().splitlines()
    passes["cell"].write_text("\n".join(line for line in lines if "workobject" not in line) + "\n")
    words = (passes["cell"], passes["places"], passes["places"], "--frame", "workobject", "--json")
    stopped = verify(*words, "--predicted", passes["predicted"])
    assert (stopped.exit_code, "CS6051" in stopped.output) == (1, True), stopped.output
    assert verify(*words).exit_code == 0


@pytest.mark.parametrize(("frame", "way"), [
    ("workobject", "give the readings in the base frame (--frame base)"),
    ("base", "give the places of the tool's centre, without --tool-radius-mm")])
@pytest.mark.parametrize(("lost", "code"), [("workobject", "CS6051"), ("", "CS4513"), (None, "")])
def test_normals_in_the_base_frame_need_the_work_object_too_for_places_on_the_surface(
    passes: dict[str, Path], tmp_path: Path, lost: str | None, code: str, frame: str, way: str
) -> None:
    """Not stated, or turned by a table. Who has them in the base frame already is not told to give them in it."""
    text = passes["cell"].read_text()
    if lost:
        text = "".join(line for line in text.splitlines(keepends=True) if lost not in line)
    elif lost is not None:
        text += "mechanical_units: [{name: T, carries: workobject, axes: [{eax: a, kind: rotary, direction: [0, 0, 1]}]}]\n"
    passes["cell"].write_text(text)
    normal = [1, 0, 0] if frame == "base" else [0, -1, 0]               # -y of the work object is x of the base
    points = csv(tmp_path, "p.csv", "x_mm,y_mm,z_mm,dn_um,nx,ny,nz",
                 np.array([[k / 2, 8, 0, 50 + k, *normal] for k in range(9)]))
    result = verify(passes["cell"], points, points, "--predicted", passes["predicted"], "--frame", frame, "--json",
                    "--tool-radius-mm", 8)
    assert result.exit_code == (1 if code else 0), result.output
    told = [one for one in json.loads(result.stdout)["findings"] if one["level"] == "error"]
    assert [one["code"] for one in told] == [code] * bool(code)
    assert all(way in one["hint"] for one in told)


@pytest.mark.parametrize(("name", "options", "said"), [
    ("mirrored", (), "x with the other sign"), ("turned", (), "turned by 25 deg about"),
    ("before", ("--frame", "workobject"), "the base frame (--frame base)"),
    ("before", (), ""), ("shifted", (), ""), ("places", ("--frame", "workobject"), "")])
def test_readings_along_other_axes_are_told_and_no_scale_is_advised(
    passes: dict[str, Path], name: str, options: tuple[str, ...], said: str
) -> None:
    result = verify(passes["cell"], passes[name], passes["places" if name == "places" else "after"], "--predicted",
                    passes["predicted"], *options, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    told = [finding["message"] for finding in document["findings"] if finding["code"] == "CS6050"]
    assert [said in message for message in told] == ([True] if said else [])
    if said:
        assert document["result"]["predicted"]["advised_scale"] is None


@pytest.mark.parametrize(("count", "said"), [(11, False), (12, True)])
def test_other_axes_are_told_from_twelve_places_on_with_what_they_would_leave(
    passes: dict[str, Path], tmp_path: Path, count: int, said: bool
) -> None:
    """Both by the best multiple, beside a constant."""
    rows, told = (np.loadtxt(passes[name], delimiter=",", skiprows=1)[20:20 + count] for name in ("before", "predicted"))
    mirrored = csv(tmp_path, "m.csv", "target,dx_um,dy_um,dz_um", rows * [1, 1, -1, 1])
    result = verify(passes["cell"], mirrored, mirrored, "--predicted", passes["predicted"], "--json")
    found = [one["message"] for one in json.loads(result.stdout)["findings"] if one["code"] == "CS6050"]
    left = []
    for turned in (1, -1):
        off, p = ((part - part.mean(axis=0)).ravel() for part in (rows[:, 1:] * [1, -1, 1], told[:, 4:] * [1, turned, 1]))
        left.append(np.sqrt(np.mean((off - (off @ p) / (p @ p) * p) ** 2)))
    assert found == [f"the readings are off as is predicted, but along other axes: y with the other sign, which would leave "
                     f"{left[1]:.1f} um in place of {left[0]:.1f}"] * said


@pytest.mark.parametrize(("factor", "said"), [(1.08, False), (1.11, True), (1.25, True)])
def test_axes_that_differ_by_a_few_per_cent_need_no_word(
    passes: dict[str, Path], tmp_path: Path, factor: float, said: bool
) -> None:
    """Of a difference d along one of three like axes one scale leaves d sqrt(2) / 3: 4 % of the deviation, and 11."""
    rows = np.loadtxt(passes["before"], delimiter=",", skiprows=1) * [1, factor, 1, 1]
    unlike = csv(tmp_path, "unlike.csv", "target,dx_um,dy_um,dz_um", rows)
    result = verify(passes["cell"], unlike, passes["after"], "--predicted", passes["predicted"], "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    axes = [document["result"]["predicted"]["axes"][axis]["interval"] for axis in "xy"]
    assert axes[0][0] > axes[1][1], "the intervals are apart"
    told_of = [one["message"] for one in document["findings"] if one["code"] == "CS6030"]
    assert bool(told_of) == said
    if said:        # by the squares that the best multiple of all, and of each axis, leaves
        p = np.loadtxt(passes["predicted"], delimiter=",", skiprows=1)[:, 4:]
        one = np.sum(p * rows[:, 1:]) / np.sum(p**2)
        each = np.sum(p * rows[:, 1:], axis=0) / np.sum(p**2, axis=0)
        more = np.sqrt(np.mean(np.sum((rows[:, 1:] - one * p) ** 2 - (rows[:, 1:] - each * p) ** 2, axis=1)))
        assert len(told_of) == 2, "x and y, x and z"
        assert all(f"one scale leaves {more:.1f} um RMS" in message for message in told_of)
        assert told_of[0].startswith(f"along x the measured deviation is {each[0]:.3f} times")
        assert f"along y {each[1]:.3f} times" in told_of[0]


def test_exit_codes_of_the_answer(passes: dict[str, Path], tmp_path: Path) -> None:
    files = (passes["cell"], passes["before"], passes["after"])
    assert verify(*files, "--tolerance-um", 200).exit_code == 0
    report = tmp_path / "r.html"
    refused = verify(*files, "--tolerance-um", 60, "--report", report)
    assert refused.exit_code == 3
    assert "CS6026" in refused.stderr
    assert report.exists()
    document = json.loads(verify(*files, "--tolerance-um", 60, "--json").stdout)
    assert (document["status"], document["result"]["within_tolerance"]) == ("refused", False)
    assert "CS6027" not in refused.stderr
    exchanged = verify(passes["cell"], passes["after"], passes["before"])
    assert exchanged.exit_code == 0
    assert "CS6027" in exchanged.stderr
    assert "became larger" in exchanged.stdout


def of_code(result: Result, code: str) -> list[dict[str, str]]:
    return [finding for finding in json.loads(result.stdout)["findings"] if finding["code"] == code]


@pytest.mark.parametrize(("worst", "said"), [
    ((5, 12), "none"), ((40, 96), "none"), ((0, 13), "none"), ((5, 12.01), "1 of 4 readings"), ((0, 13.01), "1 of 4 readings")])
def test_a_reading_of_just_the_tolerance_is_within_it(tmp_path: Path, worst: tuple[float, float], said: str) -> None:
    """Of 5 and 12 um the size is 13. A reading that has no counterpart before counts, too."""
    cell, limit = write_cell(tmp_path), 104 if worst[0] == 40 else 13
    before = csv(tmp_path, "before.csv", "target,dx_um,dz_um", np.array([[k, 50 + k, 20] for k in range(3)]))
    after = csv(tmp_path, "after.csv", "target,dx_um,dz_um", np.array([[0, 1, 2], [1, np.nan, -7], [2, 3, 4], [3, *worst]]))
    result = verify(cell, before, after, "--tolerance-um", limit, "--json")
    over = said != "none"
    assert (result.exit_code, json.loads(result.stdout)["result"]["over_tolerance"]) == ((3, 1) if over else (0, 0))
    assert [said in one["message"] and "the largest by 13.0 um" in one["message"] for one in of_code(result, "CS6026")] == [
        True] * over


def test_no_part_is_within_a_tolerance_that_is_no_number(tmp_path: Path) -> None:
    """By a script as on the command line."""
    cell = write_cell(tmp_path)
    file = csv(tmp_path, "part.csv", "target,dx_um", np.array([[0, 500], [1, 600]]))
    assert verify_files(read_cell(cell), file, file, tolerance_um=np.nan).accepted is False
    refused = verify(cell, file, file, "--tolerance-um", "nan")
    assert (refused.exit_code, "'--tolerance-um': found 'nan'" in refused.stderr) == (2, True), refused.stderr


@pytest.mark.parametrize(("rows", "over"), [
    ([(0, 9), (1, 9), (1, -9), (2, 9)], 0), ([(0, 9), (1, 14), (1, -14), (2, 9)], 2), ([(0, 9), (1, 14), (1, 4), (2, 9)], 1)])
def test_no_reading_hides_behind_another_of_its_target(tmp_path: Path, rows: list[tuple[int, float]], over: int) -> None:
    """The tolerance of 10 um is asked of each; what is compared with the pass before are the means."""
    cell, report = write_cell(tmp_path), tmp_path / "page.html"
    before = csv(tmp_path, "before.csv", "target,dx_um", np.array([[k, 50 + k] for k in range(3)]))
    after = csv(tmp_path, "after.csv", "target,dx_um", np.array(rows))
    result = verify(cell, before, after, "--tolerance-um", 10, "--report", report, "--json")
    found = json.loads(result.stdout)["result"]
    assert (result.exit_code, found["over_tolerance"], found["within_tolerance"]) == (3 if over else 0, over, not over)
    means = [np.mean([off for target, off in rows if target == k]) for k in range(3)]
    assert found["after"]["rms_um"] == pytest.approx(np.sqrt(np.mean(np.square(means))))
    assert [one["message"] for one in of_code(result, "CS6026")] == [
        f"{over} of 4 readings deviate by more than the tolerance of 10 um, the largest by 14.0 um"] * bool(over)
    page = re.sub(r"<[^>]+>", "", report.read_text()).replace("\xa0", " ")
    assert (f"{over} of 4 readings exceed the tolerance of 10 µm, the worst at target 1." if over
            else "All 4 readings are within 10 µm.") in page


def test_a_reading_at_a_target_that_was_added_is_held_to_the_tolerance_too(tmp_path: Path) -> None:
    """It has no counterpart in the pass before, and is part of the part."""
    offsets = tmp_path / "offsets.csv"
    offsets.write_text("target,dx_um,dy_um,dz_um,added\n" + "".join(
        f"{k},{40 + k},{k * k},3,{'0.3 0.6' if k == 2 else ''}\n" for k in range(5)))
    before = csv(tmp_path, "before.csv", "target,dx_um", np.array([[k, 40 + k] for k in range(5)]))
    for worst, over in ((9, 0), (14, 1)):
        after = csv(tmp_path, "after.csv", "target,dx_um", np.array([[k, worst if k == 3 else 5] for k in range(7)]))
        result = verify(write_cell(tmp_path), before, after, "--predicted", offsets, "--tolerance-um", 10, "--json",
                        "--report", tmp_path / "page.html", "--force")
        assert (result.exit_code, len(of_code(result, "CS6037"))) == (3 if over else 0, 1)
        assert [one["message"].partition(" deviate")[0] for one in of_code(result, "CS6026")] == ["1 of 7 readings"] * over
        assert json.loads(result.stdout)["result"]["after"]["max_um"] == pytest.approx(5)
        assert ("the worst at target 3." in re.sub(r"<[^>]+>", "", (tmp_path / "page.html").read_text())) == bool(over)


@pytest.mark.parametrize(("after_um", "said"), [(30.0, False), (40.5, False), (45.0, True)])
def test_a_pass_is_worse_where_chance_does_not_make_it_so(tmp_path: Path, after_um: float, said: bool) -> None:
    """40 um before, of 120 readings whose sizes scatter by a third: 45 are worse, 40.5 may be chance. The sentence has both."""
    rng, cell = np.random.default_rng(6027), write_cell(tmp_path)
    header, each = "target,dx_um,sx_um,sy_um,sz_um", np.arange(120)

    def measured(name: str, size: float) -> Path:
        off = size * rng.choice([-1, 1], 120) * (1 + rng.permutation(np.linspace(-0.3, 0.3, 120)))
        return csv(tmp_path, name, header, np.column_stack([each, off, np.ones((120, 3))]))

    before, after = measured("before.csv", 40.0), measured("after.csv", after_um)
    size = [np.sqrt(np.mean(np.loadtxt(file, delimiter=",", skiprows=1)[:, 1] ** 2)) for file in (before, after)]
    told = of_code(verify(cell, before, after, "--json"), "CS6027")
    assert [(one["message"], one["file"]) for one in told] == [
        (f"the deviation grew from {size[0]:.1f} to {size[1]:.1f} um RMS", str(after))] * said


@pytest.mark.parametrize(("share", "noise", "said"), [
    (0.03, 0.02, False), (0.045, 0.02, False), (0.06, 0.02, True), (0.06, 1.0, False)])
def test_a_constant_beside_the_predicted_is_told_from_a_twentieth_on(
    tmp_path: Path, share: float, noise: float, said: bool
) -> None:
    """Of the RMS measured, along y; not one that the scatter may be. The numbers are those of least squares with a constant."""
    rng, count = np.random.default_rng(6029), 300
    at = np.arange(count)
    told = np.column_stack([80 + 20 * np.sin(at / 5), 30 + 60 * np.cos(at / 7), 50 * np.sin(at / 3)])
    rms = np.sqrt(np.mean(np.sum((1.3 * told) ** 2, axis=1)))
    off = 1.3 * told + [0, share * rms, 0] + noise * rms * rng.normal(size=told.shape)
    predicted, measured = (csv(tmp_path, name, "target,dx_um,dy_um,dz_um", np.column_stack([at, what]))
                           for name, what in (("told.csv", told), ("off.csv", off)))
    result = verify(write_cell(tmp_path), measured, measured, "--predicted", predicted, "--json")
    found = of_code(result, "CS6029")
    through = np.sum(told * off) / np.sum(told**2)
    columns = np.column_stack([told.ravel(), np.tile(np.eye(3), (count, 1))])
    beside, *constant = np.linalg.lstsq(columns, off.ravel(), rcond=None)[0]
    assert [one["message"] for one in found] == [
        f"a part of ({', '.join(f'{x:.0f}' for x in constant)}) um does not follow the force; with it the scale would be "
        f"{beside:.3f} in place of {through:.3f}"] * said
    assert not said or json.loads(result.stdout)["result"]["predicted"]["advised_scale"] is None


@pytest.mark.parametrize(("count", "share", "refused"), [
    (9, 0.05, False), (10, 0.05, True), (10, 0.11, False), (40, 0.095, True)])
def test_readings_are_too_small_from_ten_numbers_and_under_a_tenth_of_their_sigma(
    tmp_path: Path, count: int, share: float, refused: bool
) -> None:
    file = csv(tmp_path, "part.csv", "target,dn_um,sn_um", np.array([[k, share * 2 * (-1) ** k, 2] for k in range(count)]))
    if not refused:
        assert len(read_readings(file, read_cell(write_cell(tmp_path)))) == count
        return
    with pytest.raises(CompstiffError) as stopped:
        read_readings(file, read_cell(write_cell(tmp_path)))
    [found] = stopped.value.findings
    assert (found.code, found.file) == ("CS6035", str(file))
    assert found.message.startswith(f"all {count} deviations together are {share:.2g} times their own 1 sigma, RMS")


@pytest.mark.parametrize(("numbers", "code", "kept"), [
    ([0, 1], "", [0, 1]), ([0, 1, 2], "CS6038", [0, 1, 2]), ([2, 3], "CS6038", [2, 3]), ([1, 2, 4], "", [1, 2, 4]),
    ([0, 2, 4, 5], "CS6037", [0, 2, 3]), ([1, 3, 6, 6], "CS6037", [1, 4])])
def test_whose_numbers_readings_name_is_told_where_it_matters(
    tmp_path: Path, numbers: list[int], code: str, kept: list[int]
) -> None:
    """Of five targets the corrected program has seven, two added before the third: up to 1 both count alike, up to 4 it may be
    either's (the last of the planned ones is theirs), from 5 on it is the corrected one's: its 4, 5, 6 are the planned 2, 3, 4.
    """
    offsets = tmp_path / "offsets.csv"
    offsets.write_text("target,dx_um,dy_um,dz_um,added\n" + "".join(
        f"{k},{40 + k},{k * k},3,{'0.3 0.6' if k == 2 else ''}\n" for k in range(5)))
    before = csv(tmp_path, "before.csv", "target,dx_um", np.array([[k, 40 + k] for k in range(5)]))
    after = csv(tmp_path, "after.csv", "target,dx_um", np.array([[k, 10 + k] for k in numbers]))
    found = verify_files(read_cell(write_cell(tmp_path)), before, after, offsets)
    told = [one for one in found.findings if one.code in ("CS6037", "CS6038")]
    assert [(one.code, one.file) for one in told] == [(code, str(after))] * bool(code)
    assert found.after.place[:, 0].tolist() == kept
    if code == "CS6038":
        assert told[0].message == (f"names targets up to {max(numbers)}: taken as the planned program numbers them; the "
                                   "corrected one has 2 more and numbers them otherwise from target 2 on")
    elif code:
        assert f"({sum(k in (2, 3) for k in numbers)} row at targets that were added left out)" in told[0].message


@pytest.mark.parametrize(("header", "row", "code"), [
    ("target,fx_n", [1, 2], "CS6020"),
    ("target,dx_um,dn_um", [1, 2, 3], "CS6020"),
    ("target,dx_um", [1, np.nan], "CS6020"),
    ("dx_um", [1], "CS6021"),
    ("path_mm,dx_um", [1, 2], "CS6021"),
    ("target,dz_um", [7000, 2], "CS6023"),
    ("target,dx_um", [1.5, 2], "CS3004"),
    ("target,dn_um,nx,ny,nz", [1, 2, 1, 1, 0], "CS0203"),
    ("target,dx_um,sx_um,sy_um,sz_um", [1, 2, 0, 1, 1], "CS0203"),
])
def test_files_that_cannot_be_compared(
    passes: dict[str, Path], tmp_path: Path, header: str, row: list[float], code: str
) -> None:
    other = csv(tmp_path, "other.csv", header, np.array([row]))
    result = verify(passes["cell"], passes["before"], other)
    assert result.exit_code == 1
    assert f"error {code}" in result.stderr


def test_a_reading_along_a_normal_has_the_mean_variance_of_the_cell_s_axes(passes: dict[str, Path], tmp_path: Path) -> None:
    cell = read_cell(passes["cell"])
    cell = replace(cell, noise=replace(cell.noise, deflection=1e-6 * np.array([1.0, 2.0, 4.0])))
    along, across = (read_readings(csv(tmp_path, "r.csv", f"target,{names}", np.array([row])), cell).sigma
                     for names, row in (("dn_um,nx,ny,nz", [0, 5, 1, 0, 0]), ("dx_um,dy_um,dz_um", [0, 5, 6, 7])))
    np.testing.assert_allclose(1e6 * along, [[np.sqrt(7.0)]])
    np.testing.assert_allclose(1e6 * across, [[1.0, 2.0, 4.0]])


@pytest.mark.parametrize(("noise", "header", "said"), [
    ("4, 1, 1", "target,dx_um,dy_um,dz_um", "no column sx_um sy_um sz_um: {}, 4, 1, 1 um"),
    ("2, 2, 2", "target,dx_um,dy_um,dz_um", "no column sx_um sy_um sz_um: {}, 2 um"),
    ("4, 1, 1", "target,dn_um", "no column sn_um: {}, 2.45 um"),
    ("4, 1, 1", "target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um", ""), ("4, 1, 1", "target,dn_um,sn_um", ""),
    ("4, 1, 1", "target,dx_um,dy_um,dz_um,std_um", "")])
def test_a_sigma_that_is_not_stated_is_the_cells_which_is_said_axis_by_axis(
    tmp_path: Path, noise: str, header: str, said: str
) -> None:
    cell = write_cell(tmp_path, write_cell(tmp_path).read_text() + f"measurement: {{deflection_std_um: [{noise}]}}\n")
    row = [40 + 7 * k for k in range(len(header.split(",")))]
    found = [one for one in read_readings(csv(tmp_path, "p.csv", header, np.array([[0, *row[1:]]])), read_cell(cell)).findings
             if one.code == "CS6025"]
    text = said.format("1 sigma of a reading taken from the cell's measurement.deflection_std_um")
    assert [(one.level, one.message) for one in found] == [("note", text)] * bool(said)


@pytest.mark.parametrize(("header", "rows", "line"), [
    ("target,dx_um", [[0, 1], [1.5, 2], [3, 1], [-1, 2]], 3), ("target,dn_um,nx,ny,nz", [[0, 1, 1, 0, 0], [1, 2, 1, 1, 0]], 3),
    ("target,dn_um,nx,ny,nz", [[0, 1, 1.2, 0, 0], [1, 2, 0.5, 0, 0]], 3)])
def test_the_first_line_that_is_wrong_is_named(
    passes: dict[str, Path], tmp_path: Path, header: str, rows: list[list[float]], line: int,
) -> None:
    with pytest.raises(CompstiffError) as stopped:
        read_readings(csv(tmp_path, "r.csv", header, np.array(rows)), read_cell(passes["cell"]))
    assert stopped.value.findings[0].line == line


def test_a_prediction_that_cannot_be_joined(passes: dict[str, Path], tmp_path: Path) -> None:
    by_length = csv(tmp_path, "l.csv", "path_mm,dx_um", np.column_stack([np.arange(20), np.ones(20)]))
    result = verify(passes["cell"], by_length, by_length, "--predicted", passes["predicted"])
    assert result.exit_code == 1
    assert "CS6028" in result.stderr
    unloaded = csv(tmp_path, "u.csv", "target,dx_um,dy_um,dz_um", np.column_stack([np.arange(600), np.zeros((600, 3))]))
    result = verify(passes["cell"], passes["before"], passes["after"], "--predicted", unloaded)
    assert result.exit_code == 1
    assert "predicts no deviation" in result.stderr


@pytest.mark.parametrize(("name", "options"), [("before", ()), ("places", ("--frame", "workobject"))])
def test_a_target_without_a_place_is_no_obstacle(
    passes: dict[str, Path], tmp_path: Path, name: str, options: tuple[str, ...],
) -> None:
    """A MoveAbsJ has a row in offsets.csv and no place: every number is as if the row were not there."""
    header, *rows = passes["predicted"].read_text().splitlines()
    joint = tmp_path / "joint.csv"
    joint.write_text("\n".join([header, "600,,,,0,0,0", *rows, "601,,,,0,0,0"]) + "\n")
    given = (passes["cell"], passes[name], passes[name], *options, "--json", "--predicted")
    without, held = (verify(*given, file) for file in (passes["predicted"], joint))
    assert held.exit_code == 0, held.output
    assert json.loads(held.stdout)["result"] == json.loads(without.stdout)["result"]
    assert json.loads(held.stdout)["findings"] == json.loads(without.stdout)["findings"]
    nowhere = tmp_path / "nowhere.csv"
    nowhere.write_text(f"{header}\n600,,,,0,0,0\n")
    assert verify(*given, nowhere).exit_code == 1


def test_a_measured_table_may_have_rows_without_a_place(passes: dict[str, Path], tmp_path: Path) -> None:
    """As they stand where a sheet was made from offsets.csv; not where something was measured there, and by its place."""
    cell = read_cell(passes["cell"])
    (tmp_path / "m.csv").write_text("x_mm,y_mm,z_mm,dx_um\n,,,\n1,2,3,40\n")
    assert read_readings(tmp_path / "m.csv", cell).place.tolist() == [[pytest.approx(x) for x in (0.001, 0.002, 0.003)]]
    (tmp_path / "m.csv").write_text("x_mm,y_mm,z_mm,dx_um\n,,,7\n1,2,3,40\n")
    with pytest.raises(CompstiffError) as stopped:
        read_readings(tmp_path / "m.csv", cell)
    assert (stopped.value.findings[0].code, stopped.value.findings[0].line) == ("CS0203", 2)
    (tmp_path / "m.csv").write_text("target,x_mm,y_mm,z_mm,dx_um\n0,,,,7\n1,1,2,3,40\n")
    assert read_readings(tmp_path / "m.csv", cell).place.tolist() == [[0.0], [1.0]]
    (tmp_path / "m.csv").write_text("target,x_mm,y_mm,z_mm,dx_um,time_s,samples,note\n0,,,,7,0,0,\n1,1,2,3,40,1,5,\n")
    with pytest.raises(CompstiffError, match="CS6039"):
        read_readings(tmp_path / "m.csv", cell)


@pytest.mark.parametrize(("header", "value", "place"), [
    ("path_mm", "12.5", [0.0125]), ("x_mm,y_mm,z_mm", "12.5,-40,3", [0.0125, -0.04, 0.003]), ("target", "7", [7.0])])
def test_places_are_read_in_metres(tmp_path: Path, header: str, value: str, place: list[float]) -> None:
    (tmp_path / "pass.csv").write_text(f"{header},dx_um\n{value},5\n")
    read = read_readings(tmp_path / "pass.csv", read_cell(write_cell(tmp_path)))
    assert read.place.tolist() == [pytest.approx(place)]


def test_equal_values_have_no_correlation_whatever_their_last_digits() -> None:
    """0.1 as it comes out of two ways of adding: what rounding leaves of it is alternating, or slow, and means nothing."""
    exactly = mean_along(np.full(64, 0.1))
    for size in (1.0, 1e6):
        two = size * np.array([0.1, np.nextafter(0.1, 1)])
        for rounded in (np.repeat(two, 32), np.tile(two, 32)):
            mean = mean_along(rounded)
            assert (mean.blocks, mean.correlation) == (exactly.blocks, exactly.correlation)
            assert mean.half_width == pytest.approx(0.0, abs=1e-15 * size)
    assert exactly.blocks == 16
    # A difference that is small against the values, and far above rounding, is one.
    assert mean_along(np.repeat([1.0, 1.0 + 1e-9], 32)).correlation != exactly.correlation


@pytest.mark.parametrize(("count", "size", "code"), [
    (10, 0.09, "CS6035"), (9, 0.09, ""), (10, 0.11, ""), (10, 2250.0, ""), (10, 2750.0, "CS6036")])
def test_ten_readings_of_a_tenth_of_their_sigma_or_ten_millimetres_are_no_part(tmp_path: Path, count, size, code: str) -> None:
    """Of a sigma of 4 um: 9 and 11 mm are 2250 and 2750 of it."""
    values = 4 * size * (-1.0) ** np.arange(count)
    file = csv(tmp_path, "r.csv", SIGMAS, np.column_stack([np.arange(count), values, *[np.full(count, np.nan)] * 2,
                                                           *[np.full(count, 4.0)] * 3]))
    cell = read_cell(write_cell(tmp_path))
    if not code:
        assert len(read_readings(file, cell)) == count
        return
    with pytest.raises(CompstiffError) as stopped:
        read_readings(file, cell)
    [found] = stopped.value.findings
    assert found.code == code
    assert found.message.startswith("all 10 deviations together are 0.09 times their own 1 sigma" if size < 1
                                    else "deviations of 1.1e+04 um, RMS")


@pytest.mark.parametrize(("shared", "said"), [(4, ""), (3, "only 3 of 40 rows belong to a row of "), (0, "no row belongs")])
def test_two_passes_share_a_tenth_of_the_smaller_ones_places(tmp_path: Path, shared: int, said: str) -> None:
    cell = read_cell(write_cell(tmp_path))
    first, second = (csv(tmp_path, name, "target,dx_um", np.column_stack([targets, np.full(len(targets), 30.0)]))
                     for name, targets in (("b.csv", np.arange(100)), ("a.csv", np.arange(40) + 100 - shared)))
    if not said:
        assert verify_files(cell, first, second).comparison.before.points == shared
        return
    with pytest.raises(CompstiffError) as stopped:
        verify_files(cell, first, second)
    [found] = stopped.value.findings
    assert (found.code, found.file, found.message[:len(said)]) == ("CS6023", str(second), said)


def test_a_place_got_worse_where_it_did_by_two_sigma_of_both_readings(tmp_path: Path) -> None:
    """Of 3 and 4 um, 5 together: 11 um more count, 9 do not. By chance it is a Gaussian's share beyond two sigma."""
    before, after = np.full(40, 50.0), np.full(40, 20.0)
    after[[3, 9, 14]] = [61, -61, 59]
    passes = [csv(tmp_path, name, "target,dn_um,sn_um", np.column_stack([np.arange(40), off, np.full(40, sigma)]))
              for name, off, sigma in (("b.csv", before, 3), ("a.csv", after, 4))]
    result = verify_files(read_cell(write_cell(tmp_path)), *passes)
    assert result.comparison.worse == 2
    assert result.as_dict()["worse_share_by_chance"] == pytest.approx(norm.sf(2), abs=1e-4)
    assert "2 places (5.0 %) got worse by more than 2 sigma of the readings" in " ".join(result.lines())


def scaled(folder: Path, scale: float, size: float = 100.0) -> tuple[Verification, list[str]]:
    """A path that is off by so many times the prediction, but for a thousandth: the result and what is said of the scale."""
    rng = np.random.default_rng(6031)
    told = size * rng.normal(size=(200, 3))
    rows = np.column_stack([np.arange(200), scale * told * (1 + 1e-3 * rng.normal(size=told.shape))])
    read = csv(folder, "r.csv", SIGMAS, np.column_stack([rows, np.full((200, 3), max(1e-2, 1e-3 * scale * size))]))
    file = csv(folder, "told.csv", "target,dx_um,dy_um,dz_um", np.column_stack([np.arange(200), told]))
    result = verify_files(read_cell(write_cell(folder)), read, read, file)
    return result, [one.code for one in result.findings if one.code in ("CS6031", "CS6049")]


@pytest.mark.parametrize(("scale", "codes"), [
    (0.45, ["CS6031"]), (0.55, ["CS6049"]), (0.84, ["CS6049"]), (0.86, []), (1.9, []), (2.1, ["CS6031"])])
def test_a_scale_is_advised_from_a_half_to_two_and_doubted_under_85_per_cent(tmp_path: Path, scale: float, codes) -> None:
    result, said = scaled(tmp_path, scale)
    assert result.scale is not None
    assert said == codes
    assert result.scale.advised == (None if "CS6031" in codes else pytest.approx(scale, abs=2e-3))


@pytest.mark.parametrize(("scale", "size", "unit"), [
    (0.04, 100.0, "in mil"), (1e-3, 100.0, "in millimetres"), (1e3, 1.0, "in nanometres"), (2.1, 100.0, "of the diameter"),
    (0.2, 100.0, ""), (4.5, 100.0, "")])
def test_readings_in_another_unit_are_asked_about_it(tmp_path: Path, scale: float, size: float, unit: str) -> None:
    result, _ = scaled(tmp_path, scale, size)
    [hint] = [one.hint for one in result.findings if one.code == "CS6031"]
    assert re.findall(r"are they in micrometres, or (.*)\? Else check sign", hint) == ([unit] if unit else [])


@pytest.mark.parametrize(("halves", "share", "shown"), [
    (1.65, 0.0, True), (1.35, 0.0, False), (0, 0.055, True), (0, 0.045, False)])
def test_a_constant_is_there_at_one_and_a_half_half_widths_and_a_twentieth_of_the_whole(halves: float, share, shown) -> None:
    """Beside a prediction of mean 0, and noise of mean 0 that has nothing of it: its blocks of 100 give the half width with
    t(0.975; 15) = 2.1314. Where there is next to no noise the twentieth counts."""
    rng = np.random.default_rng(6029)
    predicted = np.tile([1.0, -1.0], 800) * rng.normal(size=1600)
    predicted -= predicted.mean()
    noise = rng.normal(size=1600)
    noise -= noise.mean() + predicted * (noise @ predicted) / (predicted @ predicted)
    if share:
        noise *= 1e-3
    else:
        predicted *= 0.3
    half = 2.1314 * noise.reshape(16, 100).mean(axis=1).std(ddof=1) / 4
    constant = halves * half if halves else share * float(np.sqrt(np.mean(predicted**2)))
    found = estimate_scale(1e-6 * (predicted + noise + constant)[:, None], 1e-6 * predicted[:, None])
    assert found is not None
    assert found.blocks == 16
    assert found.constant_um == pytest.approx((constant,), rel=1e-6)
    assert found.constant_shown == shown


@pytest.mark.parametrize(("count", "size", "change", "said"), [
    (10, 50.0, 0.13, "but for 13 % of it"), (9, 50.0, 0.13, ""), (10, 50.0, 0.17, ""),
    (10, 0.77, 0.0, "but for 2.6 % of it"), (10, 0.64, 0.0, "")])
def test_ten_places_that_are_clearly_off_as_before_but_for_15_per_cent_were_not_corrected(
        tmp_path: Path, count: int, size: float, change: float, said: str) -> None:
    """Sigma of a tenth of a micrometre: five times the noise of both passes are 0.71 um."""
    off = size * (-1.0) ** np.arange(count)
    passes = [csv(tmp_path, name, SIGMAS, np.column_stack([np.arange(count), values, *[np.full(count, np.nan)] * 2,
                                                           *[np.full(count, 0.1)] * 3]))
              for name, values in (("b.csv", off), ("a.csv", (1 - change) * off + (0 if change else 0.02)))]
    found = [one.message for one in verify_files(read_cell(write_cell(tmp_path)), *passes).findings if one.code == "CS6048"]
    assert [said in message for message in found] == [True] * bool(said)
