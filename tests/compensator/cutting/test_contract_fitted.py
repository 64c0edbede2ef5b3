"""What is said of fitted coefficients and of the cut that would tell more: grades at their shares, shares that are such."""

from __future__ import annotations

import hashlib
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.coefficients.fit import (
    _chips,
    _covered,
    _made_from,
    before,
    check_in_the_stock,
    said_of_the_fit,
    said_of_the_forces,
    said_of_the_material,
    share_of_table,
    table_coefficients,
)
from compensator.coefficients.fitted import FittedCoefficients
from compensator.coefficients.next_cut import TestCut as OneCut
from compensator.coefficients.next_cut import next_cut
from compensator.cutting.coefficients import Coefficients
from compensator.cutting.cut import cut_of
from compensator.cutting.materials import coefficients_of
from compensator.forces.log import ForceLog
from identification.common.findings import CompstiffError, Finding, Refused
from identification.model.cell import read_cell
from tests.compensator.cutting.milled import FLAT, TRUE
from tests.compensator.cutting.test_laws_posterior import textbook
from tests.support import CELL, write_cell


@pytest.mark.parametrize(("share", "left", "grade"), [
    (0.11, 0.89, "reliable"), (0.13, 0.89, "usable"), (0.29, 0.89, "usable"), (0.31, 0.89, "weak"),
    (0.11, 0.91, "not identifiable"), (0.31, 0.91, "not identifiable"), (0.31, 1.0, "not identifiable")])
def test_grades_are_those_of_the_stated_shares(share: float, left: float, grade: str) -> None:
    """share: 1 sigma of the largest of its kind; left: of what was assumed before."""
    std = share * np.repeat([TRUE[:3].max(), TRUE[3:].max()], 3)
    found = Coefficients(TRUE, np.diag(std**2), 0.05, FLAT, None, None, {})
    assert FittedCoefficients(found, std / left, None, None, None, ()).grades == [grade] * 6


@pytest.mark.parametrize("factor", [1e-3, 50.0])
def test_what_a_cut_would_tell_is_a_share(factor: float) -> None:
    """A material so many times as hard, known as well, in noise so many times as large: the same cut, to the same shares."""
    mean, covariance = coefficients_of("aluminium", 1e-4)
    one = next_cut(mean, covariance, FLAT, 4e-3, 1e-4, 5.0)
    other = next_cut(factor * mean, factor**2 * covariance, FLAT, 4e-3, 1e-4, factor * 5.0)
    assert replace(other, before=one.before, after=one.after) == one
    assert (other.before, other.after) == pytest.approx((one.before, one.after), rel=1e-9)


@pytest.mark.parametrize("width", [0.1, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("climb", [True, False])
def test_the_force_of_a_test_cut_is_the_integral_over_its_arc(width: float, climb: bool) -> None:
    """Numerically; of a slot from side to side, of less from the side that climbs, or from the other."""
    reach = np.arccos(1 - 2 * width)
    arc = (-np.pi / 2, -np.pi / 2 + reach) if climb else (np.pi / 2 - reach, np.pi / 2)
    found = OneCut(width, climb, 0.8e-4).weight(FLAT, 4e-3)
    assert found == pytest.approx(textbook(*arc, 0.8e-4, 4e-3), abs=1e-5 * np.abs(found).max())


def test_what_is_known_before_is_how_far_forces_scatter() -> None:
    """Of coefficients drawn from what is known: the force of the chosen cut scatters no more, as a share, than is said."""
    mean, covariance = coefficients_of("aluminium", 1e-4)
    found = next_cut(mean, covariance, FLAT, 4e-3, 1e-4, 5.0)
    # By eigenvectors: what is known of some differs from that of others by ten powers of ten.
    variance, vectors = np.linalg.eigh(covariance)
    unit = np.random.default_rng(6).standard_normal((40_000, len(mean)))
    drawn = mean + unit * np.sqrt(np.maximum(variance, 0.0)) @ vectors.T
    matrix = found.weight(FLAT, 4e-3)
    scatter = np.sqrt(np.sum(np.var(drawn @ matrix.T, axis=0))) / np.linalg.norm(matrix @ mean)
    assert found.after < found.before
    assert scatter < 1.03 * found.before


def most_telling(mean: np.ndarray, covariance: np.ndarray, depth: float, noise: float) -> tuple[OneCut, float]:
    """Of slots and shoulders of FLAT, chips about 0.1 mm, the one behind which the worst known is known best, and how well."""
    cuts = [OneCut(width, climb, factor * 1e-4) for width in (0.1, 0.5, 1.0) for climb in (True, False)
            for factor in (0.5, 1.0, 2.0) if climb or width < 1]
    matrices = [cut.weight(FLAT, depth) for cut in cuts]
    # In shares of what is known: coefficients of chips and of edges are ten powers of ten apart.
    root = np.diag(np.sqrt(np.diag(covariance)))
    known = np.linalg.inv(np.linalg.inv(root) @ covariance @ np.linalg.inv(root))

    def worst_after(matrix: np.ndarray) -> float:
        left = root @ np.linalg.inv(known + root @ matrix.T @ matrix @ root / noise**2) @ root
        return max(float(np.sqrt(np.trace(one @ left @ one.T)) / np.linalg.norm(one @ mean)) for one in matrices)

    after = [worst_after(matrix) for matrix in matrices]
    return cuts[int(np.argmin(after))], min(after)


def test_what_is_known_after_is_what_the_cut_adds_to_it() -> None:
    """By the sum of what both tell (the inverse covariances), of no cut is less known than is said of the worst, and another
    cut than the chosen one would leave more unknown."""
    mean, covariance = coefficients_of("aluminium", 1e-4)
    found, (cut, after) = next_cut(mean, covariance, FLAT, 4e-3, 1e-4, 5.0), most_telling(mean, covariance, 4e-3, 5.0)
    assert found.after == pytest.approx(after, rel=1e-6)
    assert replace(found, before=0.0, after=0.0) == cut


@pytest.mark.parametrize(("mean", "aside", "used", "said"), [
    ((8, 3, 1, 20, 10, 5), (2.9, -2.9, 0), 8, []), ((-8, 3, 1, 20, 10, 5), (0, 0, 0), 10, ["CS4734 a tangential"]),
    ((8, 3, 1, -2, 10, 5), (0, 0, 0), 10, ["CS4734 a tangential"]), ((8, -3, -1, 20, -10, -5), (0, 0, 0), 10, []),
    ((8, 3, 1, 20, 10, 5), (0, 3.5, -4), 10, ["CS4735 the log fits best where the stock stands aside by -0.70 mm in y, "
                                              "+0.80 mm in z, more than 3 times the 0.2 mm that its file says"]),
    ((8, 3, 1, 20, 10, 5), (0, 0, 0), 7, ["CS4733 3 of 10 targets with force"]),
])
def test_what_no_tool_and_no_stock_does_is_said(mean: tuple, aside: tuple, used: int, said: list[str]) -> None:
    """Either tangential coefficient negative, and no other; a stock beside where its file says by more than three of the 0.2 mm
    that this states, which is to the other side than the tool; more than a fifth of the targets with force left out."""
    forces = SimpleNamespace(log=SimpleNamespace(source="log.csv"), forced=np.arange(12) < 10)
    found = said_of_the_fit(np.array(mean, dtype=float), np.array(aside, dtype=float), 2e-4, forces, np.arange(12) < used)
    assert len(found) == len(said)
    for finding, words in zip(found, said, strict=True):
        assert (finding.level, finding.file) == ("warning", "log.csv")
        assert f"{finding.code} {finding.message}".startswith(words)


@pytest.mark.parametrize(("left", "radial", "codes"), [
    (0.09, 3.0, []), (0.11, 3.0, ["CS4745"]), (0.09, -1.9, []), (0.09, -2.1, ["CS4746"]), (0.11, -2.1, ["CS4745", "CS4746"])])
def test_a_fit_that_leaves_much_or_pulls_is_warned_of(left: float, radial: float, codes: list[str]) -> None:
    """A tenth of the middling force, and two standard deviations of Krc itself, whatever goes with it; left: as a share of
    500 N, in six of ten rows that follow each other, under a scatter that is larger and changes its sign with every row;
    radial: Krc in its standard deviations."""
    force = np.zeros((80, 3))
    force[:, 1] = 500.0
    residual = np.where(np.arange(80)[:, None] < 48, left, 0.0) * force
    residual[:, 2] = 200.0 * (-1.0) ** np.arange(80)
    covariance = np.full((6, 6), 1e12)
    covariance[1, 1] = 1e14
    found: Any = SimpleNamespace(residual=residual, mean=np.array([8e8, 1e7 * radial, 1, 20, 10, 5]), covariance=covariance)
    rows: Any = SimpleNamespace(force=force)
    assert [(one.code, one.level, one.file) for one in said_of_the_forces(rows, found, "log.csv")] == [
        (code, "warning", "log.csv") for code in codes]


@pytest.mark.parametrize(("together", "told"), [(1, False), (4, False), (8, True), (40, True)])
def test_what_eight_neighbours_share_is_left_and_what_they_scatter_is_not(together: int, told: bool) -> None:
    """An eighth of the force, to one side in so many rows that follow each other and to the other side in as many."""
    force = np.tile([0.0, 500.0, 0.0], (80, 1))
    residual = 0.125 * force * np.repeat((-1.0) ** np.arange(80 // together), together)[:, None]
    found: Any = SimpleNamespace(residual=residual, mean=np.array([8e8, 1e7, 1, 20, 10, 5]), covariance=1e12 * np.eye(6))
    said = said_of_the_forces(cast(Any, SimpleNamespace(force=force)), found, "log.csv")
    assert [one.message.split(", in the middle")[0] for one in said] == (
        ["the fit leaves 62.5 N of the 500 N of a target"] if told else [])


def test_coefficients_name_the_files_they_were_made_from(tmp_path: Path) -> None:
    """By name and SHA-256; what was given as a value, or is no file any more, is not one of them."""
    files = {name: tmp_path / f"{name}.txt" for name in ("cell", "toolpath", "stock", "forces")}
    for name, file in files.items():
        file.write_text(f"this is the {name}\n")
    named = {name: {"file": f"{name}.txt", "sha256": hashlib.sha256(f"this is the {name}\n".encode()).hexdigest()}
             for name in files}
    cell, program = (cast(Any, SimpleNamespace(source=files[name])) for name in ("cell", "toolpath"))
    assert _made_from(cell, program, files["stock"], str(files["forces"])) == named
    log = ForceLog(**{field.name: None for field in fields(ForceLog)} | {"source": str(files["forces"])})
    assert _made_from(cell, program, files["stock"], log) == named
    program.source = None
    files["stock"].unlink()
    assert _made_from(cell, program, files["stock"], log) == {name: named[name] for name in ("cell", "forces")}


@pytest.mark.parametrize(("shear", "stated", "said"), [
    (780.0, "aluminium", ""), (450.0, "aluminium", ""), (3000.0, "aluminium", ""), (780.0, None, ""), (0.0, "aluminium", ""),
    (780.0, "titanium", "31 % of the force that the table has for titanium, which it knows to about 40 %; it is 63 % of "
     "aluminium's or 64 % of copper alloy's"),
    (300.0, "aluminium", "24 % of the force that the table has for aluminium, which it knows to about 40 %"),
    (3600.0, "aluminium", "292 % of the force that the table has for aluminium, which it knows to about 40 %; it is 128 % of "
     "steel's or 118 % of stainless steel's or 143 % of titanium's")])
def test_a_chip_force_is_held_against_the_stated_material(shear: float, stated: str | None, said: str) -> None:
    """Kienzle by hand, of a chip 0.04 mm thick: (1 - m) k h^-m is 1233 N/mm^2 of aluminium (735, 0.25), 1215 of copper alloy
    (700, 0.27), 2809 of steel (1740, 0.23), 3060 of stainless (1970, 0.21), 2519 of titanium (1560, 0.23)."""
    found: Any = SimpleNamespace(mean=np.array([1e6 * shear, 0, 0, 0, 0, 0]))
    told = said_of_the_material(found, stated, 0.08e-3, "log.csv")
    assert share_of_table(found, stated, 0.08e-3) == (None if stated is None else pytest.approx(
        shear / {"aluminium": 1233, "titanium": 2519}[stated], rel=1e-3))
    assert [(one.code, one.level, one.message) for one in told] == (
        [("CS4747", "warning", f"the chip needs {said}")] if said else [])


@pytest.mark.parametrize(("touches", "refused"), [(10, False), (2, False), (1, True), (0, True)])
def test_a_cut_that_lies_beside_its_stock_is_refused(touches: int, refused: bool) -> None:
    """Of ten targets with force, two without count for nothing; over four fifths are too many."""
    forces = SimpleNamespace(forced=np.arange(12) < 10)
    there = (np.arange(12) < touches) | (np.arange(12) >= 10)
    if not refused:
        check_in_the_stock(forces, there, Path("stock.yaml"))
        return
    with pytest.raises(Refused, match=f"{10 - touches} of 10 targets") as stopped:
        check_in_the_stock(forces, there, Path("stock.yaml"))
    assert stopped.value.findings[0].code == "CS4738"


def test_no_force_is_taken_from_a_stock_where_the_spindle_turns_counterclockwise() -> None:
    """The file's own finding says so; it names the line."""
    said = Finding("CS2116", "warning", "SPINDL/9000,CCLW", "part.apt", 7)
    path = SimpleNamespace(cell=None, toolpath=SimpleNamespace(findings=(said,), cutters=()))
    with pytest.raises(Refused) as stopped:
        cut_of(path, "stock.yaml", 9000.0)
    assert (stopped.value.findings[0].code, stopped.value.findings[0].line) == ("CS4744", 7)


@pytest.mark.parametrize("contact_mm", [None, 3.0])
def test_the_table_s_chip_is_that_of_the_feed_in_the_cut(tmp_path: Path, contact_mm: float | None) -> None:
    """45 mm/s at 9000 a minute and three teeth: 0.1 mm a tooth, however many moves in air are ten times as fast, and however
    many state no feed. A cut that would tell more is as deep as the stated contact, or 1 mm; half a newton is not seen."""
    contact = "" if contact_mm is None else f", contact_mm: {contact_mm}"
    cell = read_cell(write_cell(tmp_path, CELL + "force_log: {spindle_rpm: 9000}\n"
                                f"cutting: {{tool_diameter_mm: 16, teeth: 3, material: aluminium{contact}}}\n"))
    feed, air = np.array([0.45] * 6 + [0.045] * 3 + [np.nan] * 4), np.arange(13) < 6
    program: Any = SimpleNamespace(toolpath=SimpleNamespace(feed=feed, by_joints=np.zeros(13, bool), cutters=(),
                                                            source="part.mod"), air=air, source=None)
    fitted = table_coefficients(cell, program)
    found, further = fitted.coefficients, fitted.further
    mean, covariance = coefficients_of("aluminium", 1e-4)
    cut, after = most_telling(mean, covariance, 1e-3 * (contact_mm or 1.0), 0.5)
    assert further is not None
    assert replace(further, before=0.0, after=0.0) == replace(cut, chip=pytest.approx(cut.chip))
    assert further.after == pytest.approx(after, rel=1e-6)
    np.testing.assert_allclose(found.mean, mean, rtol=1e-12)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-12)
    assert found.model_error == 0.05        # of the force at a place, beside the coefficients


@pytest.mark.parametrize(("stated", "gain", "seat"), [
    ("", 0.01, 0.0), ("force_log: {gain_std: 0.2}\n", 0.2, 0.0), ("force_log: {gain_std: 0}\n", 0.0, 0.0),
    ("force_log: {gain_std: 0, mounting_std_deg: 2}\n", 0.0, 2.0),
    ("force_log: {gain_std: 0.1, mounting_std_deg: 0.5}\n", 0.1, 0.5)])
def test_what_is_not_known_of_the_sensor_moves_the_coefficients_as_other_forces_do(
        tmp_path: Path, stated: str, gain: float, seat: float) -> None:
    """Of a fit that is linear in the forces: these so much larger, or turned about each axis of the sensor, beside its own
    covariance and the force that an axis off its place takes. A gain that is not stated is known to a hundredth
    (docs/formats.md), a seat that is not stated is exact."""
    rng = np.random.default_rng(31)
    force, slope = 100 * rng.standard_normal((40, 3)), rng.standard_normal((6, 40, 3))
    own, missing = np.diag(np.arange(1e4, 7e4, 1e4)), 30 * rng.standard_normal((40, 3))
    found: Any = SimpleNamespace(mean=np.einsum("kni,ni->k", slope, force), gain=slope, covariance=own)
    taken = np.einsum("kni,ni->k", slope, missing)
    expected = own + np.outer(gain * found.mean, gain * found.mean) + np.outer(taken, taken)
    for axis in np.eye(3):
        moved = np.einsum("kni,ni->k", slope, Rotation.from_rotvec(1e-6 * axis).apply(force) - force) / 1e-6
        expected += np.radians(seat) ** 2 * np.outer(moved, moved)
    form = read_cell(write_cell(tmp_path, CELL + stated)).force_log.form
    told = _covered(found, force, form, missing)
    np.testing.assert_allclose(told, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def test_without_a_material_next_to_nothing_is_known_before(tmp_path: Path) -> None:
    """Steel's, five times as wide as by the table; said, and not that a material was taken."""
    mean, covariance, material, said = before(read_cell(write_cell(tmp_path)), 0.1e-3)
    of_steel, as_known = coefficients_of("steel", 0.1e-3)
    np.testing.assert_array_equal(mean, of_steel)
    np.testing.assert_allclose(covariance, 25 * as_known, rtol=1e-12)
    assert material is None
    assert [(one.code, one.level) for one in said] == [("CS4732", "note")]
    assert "not stated" in said[0].message
    stated = read_cell(write_cell(tmp_path, CELL + "cutting: {material: steel}\n"))
    mean, covariance, material, said = before(stated, 0.1e-3)
    np.testing.assert_array_equal(mean, of_steel)
    np.testing.assert_array_equal(covariance, as_known)
    assert (material, [(one.code, one.level, one.file) for one in said]) == (
        "steel", [("CS4732", "note", str(tmp_path / "cell.yaml"))])
    assert said[0].message == "known before: the coefficients of steel by its specific cutting force, to about 40 %"


# N/mm^2 and N/mm; a fifth, a tenth, nothing left to learn ... of the largest of each kind.
MEANS, STDS = [700.0, 200, 90, 24, 15, 4], [70.0, 126, 300, 2.4, 12, 4]


def fitted(higher: float | None = -0.07, rejected: str = "", after: float = 0.1) -> FittedCoefficients:
    """As of a log: residuals of 3 N RMS an axis."""
    unit = np.repeat([1e6, 1e3], 3)
    coefficients = Coefficients(unit * MEANS, np.diag((unit * STDS) ** 2), 0.043, FLAT, "copper_alloy", None, {"from": "log"},
                                rejected=rejected)
    posterior: Any = SimpleNamespace(residual=np.tile([[3.0, -3, 3], [-3, 3, -3]], (40, 1)), memory=6.4,
                                     zero=np.array([1.0, -2, 0.5]), aside=np.array([0.3, -1.1]))
    cut: Any = SimpleNamespace(line=lambda: "engagement: so much", figures=lambda: {"cutting_targets": 7})
    # Before the log each but the third was known to nothing like this, the third as well.
    before_it = unit * np.array(STDS) * [10, 10, 1.05, 10, 10, 10]
    further = OneCut(0.5, False, 0.08e-3, 0.4, after)
    return FittedCoefficients(coefficients, before_it, posterior, cut, further, (), 0.63, higher)


def test_what_is_written_of_a_fit_is_in_the_units_of_its_names() -> None:
    found = fitted().as_dict()
    assert found["coefficients"] == ["Ktc", "Krc", "Kac", "Kte", "Kre", "Kae"]
    assert found["mean"] == pytest.approx(MEANS)
    assert found["std"] == pytest.approx(STDS)
    assert [row[-1] for row in found["covariance"]] == pytest.approx([std**2 for std in STDS])      # its lower half
    assert found["log"] == {
        "rows": 80, "residual_n": pytest.approx(3.0), "memory": 6.4, "zero_n": [1.0, -2.0, 0.5], "stock_aside": [0.3, -1.1],
        "chip_force_of_table": 0.63, "were_the_top_1_mm_higher": -0.07}
    assert found["engagement"] == {"cutting_targets": 7}
    assert found["next_cut"] == {"width": 0.5, "climb": False, "feed_a_tooth_mm": pytest.approx(0.08), "force_std_before": 0.4,
                                 "force_std_after": 0.1}
    assert found["grades"] == ["reliable", "usable", "not identifiable", "reliable", "weak", "usable"]
    bare = replace(fitted(), posterior=None, cut=None, further=None).as_dict()
    assert (bare["log"], bare["engagement"], bare["next_cut"]) == (None, None, None)


def test_a_fit_is_said_in_lines() -> None:
    assert fitted().lines() == [
        "engagement: so much",
        "coefficients (linear edge: force = chip x Kc + edge x Ke; +-: 2 sigma)",
        "Ktc      700.0 +- 1.4e+02 N/mm^2  reliable", "Krc      200.0 +- 2.5e+02 N/mm^2  usable",
        "Kac       90.0 +- 6e+02   N/mm^2  not identifiable", "Kte       24.0 +- 4.8     N/mm    reliable",
        "Kre       15.0 +- 24      N/mm    weak", "Kae        4.0 +- 8       N/mm    usable",
        "fit: 80 targets, residual 3.00 N RMS; what the model leaves at a place: 4.3 % of the force; neighbours remember each "
        "other over 6 targets",
        "were the top of the stock 1 mm higher than in its file, Ktc would be 7 % too small",
        "a chip needs 63 % of the force that the table has for copper alloy, which it knows to about 40 %",
        "what would tell most: log conventional milling 50 % of the diameter wide at 0.08 mm a tooth: the force of any slot or "
        "shoulder is then known to 10 % in place of 40 %"]


@pytest.mark.parametrize(("change", "line", "said"), [
    ({"higher": 0.07}, "Ktc would be 7 % too large", True), ({"higher": None}, "were the top of the stock", False),
    ({"rejected": "no"}, "predict and correct refuse these coefficients", True), ({}, "predict and correct refuse", False),
    ({"after": 0.31}, "what would tell most", True), ({"after": 0.33}, "what would tell most", False)])
def test_a_line_is_there_where_it_says_something(change: dict[str, Any], line: str, said: bool) -> None:
    """Another cut is named where it leaves under four fifths of what is not known."""
    assert any(line in one for one in fitted(**change).lines()) == said


@pytest.mark.parametrize(("width", "climb", "words"), [
    (1.0, True, "a full slot at 0.125 mm a tooth"), (0.1, True, "climb milling 10 % of the diameter wide at 0.125 mm a tooth"),
    (0.1, False, "conventional milling 10 % of the diameter wide at 0.125 mm a tooth")])
def test_a_cut_is_named(width: float, climb: bool, words: str) -> None:
    assert OneCut(width, climb, 0.125e-3).words() == words


def test_the_chips_of_a_log_are_all_but_what_it_seldom_cut() -> None:
    """Half a per cent of the time at either end; what cuts nothing, or is not known to, does not count. In any order."""
    chip = 1e-3 * np.array([0.08, 0.5, 0.01, 0.12, 0.02, 0.1, 0.9, 0.7])
    time = np.array([60.0, 0.4, 0.4, 20, 0.6, 18, 50, 50])
    engagement = SimpleNamespace(cuts=np.arange(8) != 6, unknown=np.arange(8) == 7)
    cut: Any = SimpleNamespace(engagement=engagement, track=SimpleNamespace(chip=chip), time=time)
    # Of 99.4 s the first 0.4 are under half a per cent, and so are the last.
    assert _chips(cut) == pytest.approx((0.02e-3, 0.12e-3))
    cut.time = np.array([60.0, 0.6, 0.6, 20, 0.6, 18, 50, 50])
    assert _chips(cut) == pytest.approx((0.01e-3, 0.5e-3))


@pytest.mark.parametrize(("rpm", "stated", "feed", "code", "words"), [
    (None, None, 0.045, "CS4703", "the chip's thickness needs the spindle's speed"),
    (9000.0, "", 0.045, "CS4731", "cutting.material is not stated"),
    (9000.0, None, np.nan, "CS4731", "the program states no feed")])
def test_a_table_needs_speed_material_and_feed(
    tmp_path: Path, rpm: float | None, stated: str | None, feed: float, code: str, words: str
) -> None:
    """Half of the moves are in the air, whose feed does not count."""
    material = ", material: aluminium" if stated is None else ""
    speed = "" if rpm is None else f"force_log: {{spindle_rpm: {rpm:g}}}\n"
    cell = read_cell(write_cell(tmp_path, CELL + speed + f"cutting: {{tool_diameter_mm: 16, teeth: 3{material}}}\n"))
    program: Any = SimpleNamespace(toolpath=SimpleNamespace(
        feed=np.where(np.arange(8) < 4, 0.4, feed), by_joints=np.zeros(8, bool), cutters=(), source="part.mod"),
        air=np.arange(8) < 4, source=None)
    with pytest.raises(CompstiffError, match=f"{code}.*{words}"):
        table_coefficients(cell, program)


@pytest.mark.parametrize(("unknown", "said"), [
    (0, ""),
    (2, "the feed of 2 of 6 moves that may cut is not known: the chip is that of the others, 45 mm/s or 0.1 mm a tooth")])
def test_moves_whose_feed_is_not_known_are_told(tmp_path: Path, unknown: int, said: str) -> None:
    cell = read_cell(write_cell(tmp_path, CELL + "force_log: {spindle_rpm: 9000}\n"
                                "cutting: {tool_diameter_mm: 16, teeth: 3, material: aluminium}\n"))
    feed = np.array([0.4, 0.4, *[0.045] * 6])
    feed[2:2 + unknown] = np.nan
    program: Any = SimpleNamespace(toolpath=SimpleNamespace(
        feed=feed, by_joints=np.zeros(8, bool), cutters=(), source="part.mod"), air=np.arange(8) < 2, source=None)
    found = [one for one in table_coefficients(cell, program).findings if one.code == "CS4753"]
    assert [(one.level, one.file, one.message) for one in found] == ([("warning", "part.mod", said)] if said else [])
