"""Tables of measured parts that are not what they seem are spoken of, and right ones are not: zeros where nothing was measured,
a second pass that was the first one again, a robot that would be another one in motion."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from compensator.verification.readings import read_readings
from compensator.verification.verify import verify
from identification.common.findings import CompstiffError
from identification.common.typed_zeros import typed_zeros
from identification.model.cell import Cell, read_cell
from tests.support import write_cell


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return read_cell(write_cell(tmp_path))


def field(rng: np.random.Generator, count: int, size: float) -> np.ndarray:
    """A smooth deviation along a path (count, 3) [um]."""
    place = np.linspace(0, 1, count)[:, None]
    waves = [rng.normal(size=3) * np.sin(2 * np.pi * k * place + rng.uniform(0, 6, 3)) for k in range(1, 5)]
    return np.asarray(size * sum(waves))


def rounded(values: np.ndarray, step: float) -> np.ndarray:
    return step * np.round(values / step)


@pytest.mark.parametrize("components", [1, 3])
def test_right_readings_have_no_typed_zeros_however_they_are_rounded(components: int) -> None:
    """Noise as stated, or half or twice of it, a part that is off by much or by nothing, steps of 0.01 to 20 um."""
    for seed in range(500):
        rng = np.random.default_rng([6047, components, seed])
        count, noise = int(rng.integers(20, 600)), rng.uniform(0.5, 8)
        stated = noise * rng.choice([0.5, 1.0, 2.0])
        off = field(rng, count, rng.choice([0.0, 1.0, 10.0, 100.0]))[:, :components]
        values = off + noise * rng.normal(size=(count, components))
        values = rounded(values, float(rng.choice([0.01, 0.1, 1.0, 5.0, 10.0, 20.0])))
        assert not typed_zeros(values, np.full(values.shape, stated)).any(), seed


@pytest.mark.parametrize(("step", "components"), [(0.01, 1), (0.1, 3), (1.0, 3)])
def test_zeros_where_nothing_was_measured_are_found(step: float, components: int) -> None:
    for seed in range(40):
        rng = np.random.default_rng([6147, seed])
        values = rounded(field(rng, 200, 30.0)[:, :components] + 3 * rng.normal(size=(200, components)), step)
        lost = rng.random(200) < 0.2
        values[lost] = 0.0
        assert (typed_zeros(values, np.full(values.shape, 3.0))[lost]).all(), seed


@pytest.mark.parametrize(("count", "zeros", "beside", "sigma", "told"), [
    (100, 4, 0, 100.0, True), (100, 3, 0, 100.0, False), (300, 6, 0, 100.0, True), (300, 5, 0, 100.0, False),
    (100, 12, 3, 100.0, True), (100, 12, 4, 100.0, False), (100, 12, 0, 10.5, True), (100, 12, 0, 9.5, False),
    (100, 12, 0, 0.1, False)])
def test_zeros_are_typed_from_four_and_two_per_cent_on_where_chance_and_their_neighbours_do_not_make_them(
        count: int, zeros: int, beside: int, sigma: float, told: bool) -> None:
    """In steps of a micrometre, of which 0.4 / sigma lie at zero by chance, each time: three times as many must be there.
    Beside zero, a step off, are under a third as many. A component that was not measured is none."""
    values = np.full((count, 2), np.nan)
    values[:, 0] = 50 + np.arange(count) % 30
    values[:beside, 0] = np.where(np.arange(beside) % 2, 1, -1)
    values[20:20 + zeros, 0] = 0
    found = typed_zeros(values, np.full(values.shape, sigma))
    assert np.flatnonzero(found).tolist() == (list(range(20, 20 + zeros)) if told else [])


def written(folder: Path, name: str, values_um: np.ndarray) -> Path:
    rows = [f"{k},{','.join(f'{x:.3f}' for x in row)},3,3,3" for k, row in enumerate(values_um)]
    (folder / name).write_text("\n".join(["target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um", *rows]) + "\n")
    return folder / name


def test_the_sigma_that_learn_reads_is_read_too(cell: Cell, tmp_path: Path) -> None:
    """One table of measured points serves both commands."""
    off = field(np.random.default_rng(3), 40, 40.0)
    both = []
    for header, sigma in (("sx_um,sy_um,sz_um", "7,7,7"), ("std_um", "7")):
        rows = [f"{k},{','.join(f'{x:.3f}' for x in row)},{sigma}" for k, row in enumerate(off)]
        (tmp_path / "points.csv").write_text("\n".join([f"target,dx_um,dy_um,dz_um,{header}", *rows]) + "\n")
        both.append(read_readings(tmp_path / "points.csv", cell))
    assert np.array_equal(both[0].sigma, both[1].sigma)
    assert both[1].findings == ()


def codes(cell: Cell, folder: Path, before: np.ndarray, after: np.ndarray, predicted: np.ndarray | None = None) -> set[str]:
    of_program = None
    if predicted is not None:
        rows = [f"{k},{','.join(f'{x:.3f}' for x in row)}" for k, row in enumerate(predicted)]
        of_program = folder / "deviation.csv"
        of_program.write_text("\n".join(["target,dx_um,dy_um,dz_um", *rows]) + "\n")
    said = verify(cell, written(folder, "before.csv", before), written(folder, "after.csv", after), of_program).findings
    return {finding.code for finding in said} & {"CS6047", "CS6048", "CS6049"}


def test_a_pass_that_was_the_first_one_again_is_said_and_a_correction_is_not(cell: Cell, tmp_path: Path) -> None:
    """A correction that leaves up to 80 % of the deviation is one, and so is one that makes it worse."""
    for seed in range(60):
        rng = np.random.default_rng([6048, seed])
        off, noise = field(rng, 120, 40.0), 3 * rng.normal(size=(3, 120, 3))
        left = rng.choice([0.0, 0.1, 0.3, 0.8, 1.3, 2.0]) * off + field(rng, 120, 5.0)
        assert codes(cell, tmp_path, off + noise[0], left + noise[1], off) == set(), seed
        assert codes(cell, tmp_path, off + noise[0], off + noise[2]) == {"CS6048"}, seed
        assert codes(cell, tmp_path, off + noise[0], np.round(off + noise[0], 1)) == {"CS6048"}, seed


@pytest.mark.parametrize(("share", "said"), [
    (0.48, "CS6031"), (0.52, "CS6049"), (0.6, "CS6049"), (0.82, "CS6049"), (0.88, ""), (1.0, ""), (1.3, ""), (1.55, ""),
    (1.65, "CS6052"), (1.96, "CS6052"), (2.04, "CS6031"), (-1.0, "CS6031"), (0.0, "CS6031")])
def test_a_robot_that_would_be_another_one_in_motion_is_said(cell: Cell, tmp_path: Path, share: float, said: str) -> None:
    """Stiffer by 15 %, or softer by 60; of twice, as of a diameter, of half, or where nothing follows no scale is advised."""
    for seed in range(8):
        rng = np.random.default_rng([6049, seed])
        predicted, noise = field(rng, 200, 40.0), 3 * rng.normal(size=(2, 200, 3))
        (tmp_path / "told.csv").write_text("target,dx_um,dy_um,dz_um\n" + "".join(
            f"{k},{','.join(f'{x:.3f}' for x in row)}\n" for k, row in enumerate(predicted)))
        found = verify(cell, written(tmp_path, "before.csv", share * predicted + noise[0]),
                       written(tmp_path, "after.csv", noise[1]), tmp_path / "told.csv")
        told = [one for one in found.findings if one.code in ("CS6031", "CS6049", "CS6052")]
        assert [one.code for one in told] == ([said] if said else []), seed
        assert found.scale is not None
        assert share == 1 or (found.scale.advised is None) == (said == "CS6031"), seed
        for one in told:
            scale, low, high = map(float, re.findall(r"-?\d+\.\d{3}", one.message)[:3])
            assert (low < share < high or abs(scale - share) < 0.01, low < scale < high) == (True, True)
            assert ("of the diameter" in one.hint) == (share == 2.04)
            assert ("deviation of a diameter" in one.hint) == (said == "CS6052")


@pytest.mark.parametrize(("empty", "code"), [("before", "CS6020"), ("after", "CS6020"), ("predicted", "CS6028")])
@pytest.mark.parametrize("place", ["target", "x_mm,y_mm,z_mm"])
def test_a_table_without_a_row_is_named(tmp_path: Path, cell: Cell, empty: str, code: str, place: str) -> None:
    files = {name: tmp_path / f"{name}.csv" for name in ("before", "after", "predicted")}
    for name, file in files.items():
        header = ("target,x_mm,y_mm,z_mm" if name == "predicted" else place) + ",dx_um,dy_um,dz_um"
        rows = [] if name == empty else [",".join(map(str, range(k, k + header.count(",") + 1))) for k in range(5)]
        file.write_text("\n".join([header, *rows]) + "\n")
    with pytest.raises(CompstiffError) as refused:
        verify(cell, files["before"], files["after"], files["predicted"])
    assert [str(one) for one in refused.value.findings] == [f"{files[empty]}:1: error {code}: has no row below its header"]
