"""The first part right, by the command line: coefficients from one program's log correct another that was never milled. The
truth is the virtual cell alone; benchmarks/first_part.py has the figures over robots."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.files import Inputs, predict_files
from compensator.correction.first_screen import keys_of, steps_of
from compensator.correction.settings import Settings
from compensator.cutting.cut import cut_of
from compensator.cutting.stock_file import read_npz
from compensator.path.robot_path import robot_path
from compensator.posting.read_toolpath import read_toolpath
from identification.model.cell import read_cell
from tests.compensator.cutting.solids import binary, box_faces, stock_of
from tests.runs.command_line import user_files as kit
from tests.runs.milling.first_part_job import CUTTING, stock_file
from tests.runs.milling.milling_job import MillingJob, rms
from tests.support import long
from tests.virtual_cell import milling
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.leaning_ball import LeaningBall, mean_force, tilted
from tests.virtual_cell.milled_part import slot_and_pocket

SEED = 6


class Shop:
    """A robot with a program A that was logged, and a program B that was not; the files of both."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in "ab":
            (folder / name).mkdir()
        self.a = MillingJob(folder / "a", SEED, part=slot_and_pocket())
        self.b = MillingJob(folder / "b", SEED,
                            part=slot_and_pocket(spacing_mm=1.5, allowance_mm=0.8, wall_depth_mm=6.0))
        self.stiffness = self.a.identify()
        self.cell = self.a.cell_with("cut.yaml", CUTTING)
        self.log = self.a.log(self.a.first, self.a.planned, "a.csv")
        self.stocks = [stock_file(job.part, folder / f"{name}.npz") for name, job in (("a", self.a), ("b", self.b))]

    def run(self, *words: object) -> dict[str, Any]:
        done = kit.run(*words, "--json")
        assert done.code == 0, done.out
        return json.loads(done.out)["result"]

    def gone(self, program: Path) -> float:
        first, after = self.b.first, self.b.mill(milling.read_commands(program.read_text()))
        cut = first.cutting | after.cutting
        return 1 - rms(np.linalg.norm(after.off_um[cut], axis=1)) / rms(np.linalg.norm(first.off_um[cut], axis=1))


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Shop:
    return Shop(tmp_path_factory.mktemp("shop"))


@pytest.fixture(scope="module")
def fitted(shop: Shop) -> dict[str, Any]:
    return shop.run("cutting", shop.cell, shop.a.program, "--stock", shop.stocks[0], "--stiffness", shop.stiffness, "--forces",
                    shop.log, "--tare", "0:2", "-o", shop.folder / "log.json", "--leaves", shop.folder / "left.npz")


def test_a_log_tells_the_coefficients(shop: Shop, fitted: dict[str, Any]) -> None:
    """To 15 % of the largest of their kind: the run-out of the cutter is not in the model."""
    truth = np.array([*EndMill().shear_n_mm2, *EndMill().edge_n_mm])
    kept = json.loads((shop.folder / "log.json").read_text())
    assert kept["mean"] == fitted["mean"]
    off = np.abs(np.array(kept["mean"]) - truth) / np.repeat(truth[[0, 3]], 3)
    assert off.max() < 0.15
    assert fitted["grades"].count("reliable") >= 4
    assert fitted["engagement"]["cutting_targets"] > 150
    assert 0.5 < fitted["engagement"]["climb_share"] < 0.9
    left, before = read_npz(shop.folder / "left.npz"), read_npz(shop.stocks[0])
    assert left.volume < before.volume


def test_what_a_thicker_stock_would_have_made_of_the_coefficients_is_said(shop: Shop, fitted: dict[str, Any]) -> None:
    """About what comes out with the top half a millimetre lower in the file than it was: no check of one log can see it."""
    thinner = shop.run("cutting", shop.cell, shop.a.program, "--stock",
                       stock_file(shop.a.part, shop.folder / "thin.npz", higher_mm=-0.5), "--stiffness", shop.stiffness,
                       "--forces", shop.log, "--tare", "0:2", "-o", shop.folder / "thin.json")
    came_out = thinner["mean"][0] / fitted["mean"][0] - 1
    assert 0.7 < 0.5 * fitted["log"]["were_the_top_1_mm_higher"] / came_out < 1.3
    assert came_out > 0.05


def test_another_program_is_corrected_without_a_log(shop: Shop, fitted: dict[str, Any]) -> None:
    """Nine tenths of its deviation are gone on its first part; from the table seven."""
    assert fitted["log"]["rows"] > 150
    shop.run("cutting", shop.cell, shop.b.program, "-o", shop.folder / "table.json")
    gone, stated = {}, {}
    for name in ("log", "table"):
        program = shop.folder / f"b_{name}.mod"
        result = shop.run("correct", shop.cell, shop.b.program, "--stiffness", shop.stiffness, "--predict-force",
                          shop.folder / f"{name}.json", "--stock", shop.stocks[1], "-o", program, "--keep-targets",
                          "--report", shop.folder / f"{name}.html")
        gone[name] = shop.gone(program)
        stated[name] = result["expected_left_um"]["force"]
        assert result["cutting_stiffness"] is None
    assert gone["log"] > 0.8
    assert gone["table"] > 0.65
    record = json.loads((shop.folder / "b_log.mod.json").read_text())
    assert record["predict_force"]["file"] == "log.json"
    assert record["stock"]["file"] == "b.npz"
    # The table is known to 40 %, the log to a few per cent: what is stated shows it.
    assert stated["table"] > 3 * stated["log"]


def test_the_program_as_it_is_yields_and_cuts_less(tmp_path: Path) -> None:
    """On an arm twice as soft, by true coefficients and springs, no run-out: forces of a tool on its plan, which a
    correction needs, would push it a tenth too far; what is stated is where the virtual cell's first pass stands."""
    job = MillingJob(tmp_path, SEED, part=slot_and_pocket(spacing_mm=1.5, allowance_mm=0.8, wall_depth_mm=6.0),
                     cutter=EndMill(runout_mm=(0.0, 0.0, 0.0)))
    job.case.plant.compliance *= 2
    stiffness = job.springs("k.json", job.case.stiffness / 2)
    true = [*job.cutter.shear_n_mm2, *job.cutter.edge_n_mm]
    (tmp_path / "true.json").write_text(json.dumps({
        "format": "compstiff-cutting", "version": 1, "coefficients": ["Ktc", "Krc", "Kac", "Kte", "Kre", "Kae"], "mean": true,
        "covariance": [[0.0] * row + [1e-6] for row in range(6)], "model_error": 0.03,
        "cutter": {"diameter_mm": 16, "teeth": 3, "corner_radius_mm": 0}}))
    found = predict_files(Inputs(job.cell_with("cut.yaml", CUTTING), job.program, stiffness, None), Settings.of(
        predict_force=tmp_path / "true.json", stock=stock_file(job.part, tmp_path / "b.npz"))).prediction
    # A target's truth is the mean over the half moves beside it, where all of that cuts.
    steps, count = job.first.steps, len(job.part.target_mm)
    own = np.where(steps.share < 0.5, steps.segment - 1, steps.segment)
    share = np.column_stack([np.bincount(own, values, minlength=count) for values in (job.first.cutting, *job.first.off_um.T)])
    share /= np.maximum(np.bincount(own, minlength=count), 1)[:, None]
    some = np.flatnonzero(share[found.targets, 0] == 1)
    truth = milling.BASE_FROM_OBJECT.apply(share[found.targets[some], 1:])
    told, on_plan = (1e6 * values[some] for values in (found.at_rest, found.position))
    size = rms(truth)
    assert len(some) > 150
    assert size > 200
    assert rms(on_plan) > 1.07 * size
    assert rms(told) == pytest.approx(size, rel=0.03)
    assert rms(told - truth) < min(0.1 * size, 0.6 * rms(on_plan - truth))
    assert found.at_rest_std.mean() < found.std.mean()


@pytest.mark.parametrize(("changed", "code", "words"), [
    ({}, "CS4740", "they agree"), ({"edge_n_mm": (55.4, 53.2, 0.7)}, "CS4741", "worn edges"),
    long({"feed_mm_s": 25.2}, "CS4741 CS4742", "feed of"),
    long({"runout_mm": (0.024, 0.0, 0.0)}, "CS4740 CS4741 CS4742", "run out"),
    long({"shear_n_mm2": (1073.8, 236.3, 310.8), "edge_n_mm": (38.8, 37.2, 1.0)}, "CS4741", "another material")])
def test_a_log_beside_the_stock(shop: Shop, fitted: dict[str, Any], tmp_path: Path, changed: dict[str, Any], code: str,
                                words: str) -> None:
    """What was changed in the virtual cell since A was logged is named from a log of B."""
    assert fitted["grades"]
    (tmp_path / "b").mkdir()
    job = MillingJob(tmp_path / "b", SEED, part=shop.b.part)
    job.cutter = replace(EndMill(), **changed)
    log = job.log(job.first, job.planned, "b.csv")
    done = kit.run("predict", shop.cell, job.program, "--stiffness", shop.stiffness, "--forces", log, "--tare", "0:2",
                   "--predict-force", shop.folder / "log.json", "--stock", shop.stocks[1], "-o", tmp_path / "d.csv", "--json")
    assert done.code == 0, done
    said = [finding for finding in json.loads(done.out)["findings"] if finding["code"].startswith("CS474")]
    assert len(said) == 1
    # So light a change of the feed may be told as one of two causes, the true one first.
    assert said[0]["code"] in code.split()
    assert words in said[0]["message"]


def test_a_log_that_is_read_wrongly_is_told_beside_the_stock(shop: Shop, fitted: dict[str, Any], tmp_path: Path) -> None:
    """A sensor turned by a quarter about the tool's axis shows a force that some cutter may feel, and not this one here."""
    assert fitted["grades"]
    head, *rows = shop.b.log(shop.b.first, shop.b.planned, "turned.csv").read_text().splitlines()
    assert head.endswith("fx_n,fy_n,fz_n")
    turned = [f"{','.join(cells[:-3])},{-float(cells[-2])},{cells[-3]},{cells[-1]}" for cells in (
        row.split(",") for row in rows[::4])]
    (tmp_path / "turned.csv").write_text("\n".join([head, *turned]) + "\n")
    done = kit.run("predict", shop.cell, shop.b.program, "--stiffness", shop.stiffness, "--forces", tmp_path / "turned.csv",
                   "--tare", "0:2", "--predict-force", shop.folder / "log.json", "--stock", shop.stocks[1], "-o",
                   tmp_path / "d.csv", "--json")
    assert done.code == 0, done
    findings = {finding["code"]: finding["message"] for finding in json.loads(done.out)["findings"]}
    assert "with the columns fy_n fx_n fz_n in this order, with y turned over" in findings["CS4750"]
    assert not findings.keys() & {"CS3068", "CS3069", "CS3074", "CS3078", "CS3125"}


def test_what_another_stock_or_cutter_would_mean_is_said(shop: Shop, fitted: dict[str, Any], tmp_path: Path) -> None:
    """About what comes out with the stock moved and with a thicker cutter; on the terminal and in the report."""
    kept = json.loads((shop.folder / "log.json").read_text())
    assert kept["mean"] == fitted["mean"]

    def said(name: str, stock: Path, diameter: int = 16, edges: float = 1.0) -> tuple[Any, np.ndarray]:
        cell = shop.cell.with_name(f"{name}.yaml")
        cell.write_text(shop.cell.read_text().replace("tool_diameter_mm: 16", f"tool_diameter_mm: {diameter}"))
        coefficients = kept | {"cutter": kept["cutter"] | {"diameter_mm": diameter},
                               "mean": [*kept["mean"][:3], *(edges * value for value in kept["mean"][3:])]}
        (tmp_path / f"{name}.json").write_text(json.dumps(coefficients))
        found = predict_files(Inputs(cell, shop.b.program, shop.stiffness, None), Settings.of(
            predict_force=tmp_path / f"{name}.json", stock=stock))
        known = np.full((len(found.path.toolpath), 3), np.nan)
        known[found.targets] = 1e6 * found.prediction.position
        return found, known

    found, here = said("right", shop.stocks[1])
    told = found.another
    assert told.words in "".join(found.lines())
    assert "were the stock 1 mm aside" in [key.label for key in keys_of(found, None)]
    # The command to copy names coefficients and stock, and no log: there is none.
    commands = [step.command for step in steps_of(found, None, None)]
    assert all("--predict-force" in command and "--forces" not in command for command in commands)
    for stated, changed in ((0.5 * told.aside, said("aside", stock_file(shop.b.part, tmp_path / "m.npz", aside_mm=0.5))),
                            (0.5 * told.higher, said("higher", stock_file(shop.b.part, tmp_path / "h.npz", higher_mm=0.5))),
                            (told.thicker, said("thick", shop.stocks[1], diameter=17)),
                            (told.worn, said("worn", shop.stocks[1], edges=1.5))):
        other = np.linalg.norm(changed[1] - here, axis=1)
        assert 0.6 < stated / rms(other[np.isfinite(other)]) < 1.7


def test_edges_that_wear_are_in_sigma(shop: Shop, fitted: dict[str, Any], tmp_path: Path) -> None:
    """What edges need more since the log moves the part by that share of their force, and so far sigma reaches; not of the
    table, whose width has it."""
    kept = json.loads((shop.folder / "log.json").read_text())
    assert kept["mean"] == fitted["mean"]

    def predicted(wear: float, edges: float, table: bool = False) -> Any:
        cell = shop.cell.with_name(f"wear_{wear}.yaml")
        cell.write_text(shop.cell.read_text().replace("material: aluminium", f"material: aluminium, wear_std: {wear}"))
        mean = [*kept["mean"][:3], *(edges * value for value in kept["mean"][3:])]
        file = tmp_path / "edges.json"
        file.write_text(json.dumps(kept | {"mean": mean} | ({"feed_a_tooth_mm": None} if table else {})))
        found = predict_files(Inputs(cell, shop.b.program, shop.stiffness, None),
                              Settings.of(predict_force=file, stock=shop.stocks[1]))
        return found.prediction

    sharp = predicted(0.0, 1.0)
    change = predicted(0.0, 1.4).position - sharp.position
    assert 1e6 * rms(np.linalg.norm(change, axis=1)) > 5
    more = predicted(0.4, 1.0).covariance - sharp.covariance
    # In a corner the mean of what the force may do is more than what its mean may do.
    ratio = np.trace(more, axis1=1, axis2=2) / np.sum(change**2, axis=1)
    assert 0.99 < np.median(ratio) < 1.01
    assert ratio.min() > 0.98
    assert np.array_equal(predicted(0.4, 1.0, table=True).covariance, predicted(0.0, 1.0, table=True).covariance)


@pytest.mark.parametrize(("words", "code"), [
    (("--predict-force", "log.json"), 2), (("--stock", "b.npz"), 2), ((), 2),
    (("--predict-force", "log.json", "--stock", "b.npz", "--tare", "0:2"), 1)])
def test_half_of_what_is_needed_is_refused(shop: Shop, fitted: dict[str, Any], tmp_path: Path, words: tuple[str, ...],
                                           code: int) -> None:
    assert fitted["grades"]
    given = [shop.folder / word if "." in word else word for word in words]
    done = kit.run("predict", shop.cell, shop.b.program, "--stiffness", shop.stiffness, "-o", tmp_path / "d.csv", *given)
    assert done.code == code, done
    assert not (tmp_path / "d.csv").exists()


def test_clamps_stay_uncorrected_and_are_listed(shop: Shop, fitted: dict[str, Any], tmp_path: Path) -> None:
    """A box of which nothing is known over half of the slot: its targets keep their place, the others do not."""
    assert fitted["grades"]
    stock = tmp_path / "stock.yaml"
    stock.write_text(f"left_by: {shop.stocks[1]}\nunknown:\n  - {{from_mm: [0, 30, -20], to_mm: [60, 70, 10]}}\n")
    done = kit.run("correct", shop.cell, shop.b.program, "--stiffness", shop.stiffness, "--predict-force",
                   shop.folder / "log.json", "--stock", stock, "-o", tmp_path / "b.mod", "--keep-targets", "--json")
    assert done.code == 0, done
    assert [finding for finding in json.loads(done.out)["findings"] if finding["code"] == "CS4708"]
    moved = np.linalg.norm(milling.read_commands((tmp_path / "b.mod").read_text()).position_mm - shop.b.part.target_mm, axis=1)
    x, y = shop.b.part.target_mm[:, 0], shop.b.part.target_mm[:, 1]
    slot = (y == 50.0) & (shop.b.part.target_mm[:, 2] < 0)
    assert not moved[slot & (x > -8) & (x < 50)].any()
    assert (moved[slot & (x > -45) & (x < -15)] > 0.05).all()


def test_a_blank_from_an_stl_is_predicted_as_its_box(shop: Shop, fitted: dict[str, Any], tmp_path: Path) -> None:
    """The same deviation at every target; away from the program it is refused, and nothing is written."""
    assert fitted["grades"]
    low, high = (-62.0, -42.0, -20.0), (62.0, 63.0, 0.0)
    (tmp_path / "box.yaml").write_text(f"box: {{from_mm: {list(low)}, to_mm: {list(high)}}}\nposition_std_mm: 0.05\n")
    stock_of(tmp_path, binary(box_faces(low, high)), "units: mm\nposition_std_mm: 0.05\n")
    words = ("predict", shop.cell, shop.b.program, "--stiffness", shop.stiffness, "--predict-force", shop.folder / "log.json")
    deviation = {}
    for name in ("box", "stock"):
        shop.run(*words, "--stock", tmp_path / f"{name}.yaml", "-o", tmp_path / f"{name}.csv")
        deviation[name] = np.genfromtxt(tmp_path / f"{name}.csv", delimiter=",", names=True)
    for column in ("dx_um", "dy_um", "dz_um"):
        most = np.nanmax(np.abs(deviation["box"][column]))
        assert most > 50
        assert deviation["stock"][column] == pytest.approx(deviation["box"][column], abs=0.002 * most, nan_ok=True)
    (tmp_path / "blank.stl").write_bytes(binary(box_faces((900.0, -42.0, -20.0), (1000.0, 63.0, 0.0))))
    done = kit.run(*words, "--stock", tmp_path / "stock.yaml", "-o", tmp_path / "no.csv", "--json")
    assert done.code == 1, done
    assert [finding["code"] for finding in json.loads(done.out)["findings"]][-1] == "CS4715"
    assert not (tmp_path / "no.csv").exists()


def test_the_cutter_of_an_apt_file(shop: Shop, fitted: dict[str, Any], tmp_path: Path) -> None:
    """Program B as APT: CUTTER fills what cell.yaml leaves out, to the same deviation; another one is refused at its line."""
    assert fitted["grades"]
    position = shop.b.part.target_mm
    program = tmp_path / "b.apt"
    moves = "\n".join(f"GOTO/{x:.4f},{y:.4f},{z:.4f}" for x, y, z in position)
    program.write_text(f"UNITS/MM\nCUTTER/16,0\nFEDRAT/{60 * 36.0},MMPM\n{moves}\nFINI\n")
    words = ("--stiffness", shop.stiffness, "--predict-force", shop.folder / "log.json", "--stock", shop.stocks[1],
             "--tool-x=-1,0,0")
    text = "workobject: {position_mm: [1350, -100, 750], quaternion: [0.99619470, 0, 0, 0.08715574]}\n" + shop.cell.read_text()
    deviation = {}
    for name, block in (("stated", "tool_diameter_mm: 16, "), ("left out", "")):
        cell = shop.cell.with_name(f"{name}.yaml")
        cell.write_text(text.replace("tool_diameter_mm: 16, ", block))
        done = kit.run("predict", cell, program, *words, "-o", tmp_path / f"{name}.csv", "--json")
        assert done.code == 0, done.out
        codes = [finding["code"] for finding in json.loads(done.out)["findings"]]
        assert ("CS4717" in codes) == (not block)
        deviation[name] = (tmp_path / f"{name}.csv").read_bytes()
    assert deviation["stated"] == deviation["left out"]
    assert np.nanmax(np.genfromtxt(tmp_path / "stated.csv", delimiter=",", names=True)["dx_um"]) > 50
    program.write_text(program.read_text().replace("CUTTER/16,0", "CUTTER/12,0"))
    done = kit.run("predict", shop.cell.with_name("stated.yaml"), program, *words, "-o", tmp_path / "no.csv", "--json")
    assert done.code == 1, done
    [stop] = [finding for finding in json.loads(done.out)["findings"] if finding["level"] == "error"]
    assert (stop["code"], stop["line"], Path(stop["file"]).name) == ("CS4716", 2, "b.apt")


def in_folder(shop: Shop, folder: Path) -> Path:
    """Programs with a stock, with a log, with both, and with neither, as b, a, both and none."""
    folder.mkdir()
    own = shop.b.log(shop.b.first, shop.b.planned, "b.csv")
    for name, program, log, stock in (("b", shop.b.program, None, shop.stocks[1]), ("a", shop.a.program, shop.log, None),
                                      ("both", shop.b.program, own, shop.stocks[1]), ("none", shop.b.program, None, None)):
        shutil.copy(program, folder / f"{name}.mod")
        if log:
            shutil.copy(log, folder / f"{name}.forces.csv")
        if stock:
            shutil.copy(stock, folder / f"{name}.blank.npz")
            (folder / f"{name}.stock.yaml").write_text(f"left_by: {name}.blank.npz\n")
    return folder


def test_a_ball_that_leans_is_predicted_from_its_program(shop: Shop, tmp_path: Path) -> None:
    """A program whose tool leans by 15 degrees, written by the tool's tip: on the plateau the force is that of the engine edge
    by edge, turned into the base frame; a bull-nose that leans is refused and listed."""
    axis, radius, chip = np.array(tilted(8.0, -13.0)), 8.0, 36.0 / 150 / 3
    lean, _ = Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])
    quaternion = np.roll((lean * milling.OBJECT_FROM_FLANGE).as_quat(canonical=True), 1)
    middle = np.column_stack([np.linspace(-75, 75, 31), np.full(31, 5.0), np.full(31, radius - 0.8)])
    text = shop.b.program.read_text().splitlines()
    first = next(k for k, line in enumerate(text) if "MoveL" in line)
    tail = text[first].split("]", 2)[2].replace("vAir", "vCut")
    moves = [f"    MoveL [[{x:.5f},{y:.5f},{z:.5f}],[{','.join(f'{q:.9f}' for q in quaternion)}]{tail}"
             for x, y, z in middle - radius * axis]
    program, stock = tmp_path / "leaning.mod", tmp_path / "stock.yaml"
    program.write_text("\n".join([*text[:first], *moves, "  ENDPROC", "ENDMODULE"]) + "\n")
    stock.write_text("box: {from_mm: [-60, -40, -20], to_mm: [60, 40, 0]}\nposition_std_mm: 0.05\n")
    for corner, known in ((8, True), (3, False)):
        words = CUTTING.replace("teeth: 3", f"teeth: 3, corner_radius_mm: {corner}")
        cell = read_cell(shop.a.cell_with(f"corner{corner}.yaml", words))
        cut = cut_of(robot_path(read_toolpath(program, cell).toolpath, cell), stock, None)
        within = np.abs(1e3 * cut.track.start[:, 0]) < 40
        assert cut.unknown[1:-1].any() != known
        if known:
            truth = mean_force(LeaningBall(tuple(axis)), np.array([0.0, 5.0, radius - 0.8]), np.array([chip, 0.0, 0.0]),
                               ((-60.0, -40.0, -20.0), (60.0, 40.0, 0.0)))
            true = np.array([*(1e6 * np.array(EndMill().shear_n_mm2)), *(1e3 * np.array(EndMill().edge_n_mm))])
            force = np.median((cut.per_step @ true)[within], axis=0)
            assert force == pytest.approx(milling.BASE_FROM_OBJECT.apply(truth), abs=0.05 * np.linalg.norm(truth))
        else:
            assert [finding for finding in cut.findings() if finding.code == "CS4708"]


def test_a_row_over_a_roof_is_predicted_from_its_program(shop: Shop, tmp_path: Path) -> None:
    """Up 25 degrees and down again, upright ball: all of it is predicted, on both sides as the engine edge by edge says; with a
    flat cutter the way down is listed."""
    rise, chip, x = np.tan(np.radians(25.0)), 36.0 / 150 / 3, np.linspace(-75, 75, 301)
    tip = np.column_stack([x, np.full(301, 5.0), -1.5 - rise * np.abs(x)])
    text = shop.b.program.read_text().splitlines()
    first = next(k for k, line in enumerate(text) if "MoveL" in line)
    head, tail = text[first].split("]", 1)[0].rsplit("[", 1)[0], text[first].split("]", 1)[1].replace("vAir", "vCut")
    moves = [f"{head}[{x:.5f},{y:.5f},{z:.5f}]{tail}" for x, y, z in tip]
    program, stock = tmp_path / "roof.mod", tmp_path / "stock.yaml"
    program.write_text("\n".join([*text[:first], *moves, "  ENDPROC", "ENDMODULE"]) + "\n")
    stock.write_text("box: {from_mm: [-6, -40, -20], to_mm: [6, 40, 0]}\nposition_std_mm: 0.05\n")
    for corner, known in ((8, True), (0, False)):
        words = CUTTING.replace("teeth: 3", f"teeth: 3, corner_radius_mm: {corner}")
        cell = read_cell(shop.a.cell_with(f"roof{corner}.yaml", words))
        cut = cut_of(robot_path(read_toolpath(program, cell).toolpath, cell), stock, None)
        assert cut.cuts.sum() > 20
        assert cut.unknown.any() != known
        if not known:
            assert (1e3 * cut.path.toolpath.position[cut.unknown, 0] > -0.6).all()
            assert [finding for finding in cut.findings() if finding.code == "CS4708"]
            continue
        true = np.array([*(1e6 * np.array(EndMill().shear_n_mm2)), *(1e3 * np.array(EndMill().edge_n_mm))])
        place = 0.5e3 * (cut.track.start + cut.track.end)
        for at, side in ((-2.0, 1.0), (3.0, -1.0)):
            step = int(np.argmin(np.abs(place[:, 0] - at)))
            feed = chip * np.array([1.0, 0.0, side * rise]) / np.hypot(1.0, rise)
            before = [] if side > 0 else [np.array([[-75.0, 5.0, 6.5 - 75 * rise], [0.0, 5.0, 6.5]])]
            truth = mean_force(LeaningBall((0.0, 0.0, 1.0)), place[step] + [0.0, 0.0, 8.0], feed,
                               ((-6.0, -40.0, -20.0), (6.0, 40.0, 0.0)), before)
            force = cut.per_step[step] @ true
            assert np.linalg.norm(truth) > 10
            assert force == pytest.approx(milling.BASE_FROM_OBJECT.apply(truth), abs=0.05 * np.linalg.norm(truth)), at


def test_a_batch_takes_logs_and_stocks(shop: Shop, fitted: dict[str, Any], tmp_path: Path) -> None:
    """Each as if alone: predicted, by its log, by its log held against its stock; without either it is left alone."""
    assert fitted["grades"]
    folder, out, alone = in_folder(shop, tmp_path / "in"), tmp_path / "out", tmp_path / "alone.mod"
    words = ("--stiffness", shop.stiffness, "--predict-force", shop.folder / "log.json", "--json")
    done = kit.run("correct", shop.cell, folder, *words, "--tare", "0:2", "-o", f"{out}/")
    said = {Path(line["program"]).stem: line for line in map(json.loads, done.out.splitlines())}
    assert done.code == 0, done
    assert {name: line["status"] for name, line in said.items()} == {"a": "ok", "b": "ok", "both": "ok", "none": "left"}
    codes = {name: {finding["code"] for finding in line["findings"]} for name, line in said.items()}
    assert ["CS4737" in codes[name] for name in ("a", "b", "both")] == [True, False, False]
    assert "CS4740" in codes["both"]
    assert "no stock none.stock.yaml" in said["none"]["findings"][0]["message"]
    assert kit.run("correct", shop.cell, folder / "b.mod", *words, "--stock", folder / "b.stock.yaml", "-o", alone).code == 0
    assert (out / "b.mod").read_bytes() == alone.read_bytes()
    record = json.loads((out / "b.mod.json").read_text())
    assert (record["stock"]["file"], record["blank"]["file"]) == ("b.stock.yaml", "b.blank.npz")


# Long: a batch takes stocks above; what is taken again, tests/compstiff/batch/test_contract_watch.py.
@pytest.mark.long
def test_a_watch_takes_a_stock_and_another_one_again(shop: Shop, fitted: dict[str, Any], tmp_path: Path) -> None:
    """Once for each content of the stock, what its file names included; then by the log that comes."""
    assert fitted["grades"]
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    shutil.copy(shop.b.program, folder / "b.mod")

    def look(*more: object) -> list[str]:
        done = kit.run("watch", folder, out, "--cell", shop.cell, "--stiffness", shop.stiffness, "--predict-force",
                       shop.folder / "log.json", "--tare", "0:2", "--once", "--settle", 0, "--json", *more)
        return [json.loads(line)["status"] for line in done.out.splitlines() if json.loads(line).get("program")]

    assert look() == ["waiting"]
    shutil.copy(shop.stocks[1], folder / "blank.npz")
    (folder / "b.stock.yaml").write_text("left_by: blank.npz\n")
    assert look() == ["ok"]
    first = (out / "b.mod").read_bytes()
    assert look() == []
    with np.load(shop.stocks[1]) as content:        # a wall that stands 0.4 mm further in
        np.savez(folder / "blank.npz", **{**content, "inside_mm": (content["inside_mm"] + 0.4).astype(np.float32)})
    assert look() == ["ok"]
    assert (out / "b.mod").read_bytes() != first
    shutil.copy(shop.b.log(shop.b.first, shop.b.planned, "b.csv"), folder / "b.forces.csv")
    assert look() == ["ok"]
    record = json.loads((out / "b.mod.json").read_text())
    assert (record["forces"]["file"], record["stock"]["file"]) == ("b.forces.csv", "b.stock.yaml")
    journal = [json.loads(line) for line in (out / "compstiff-watch.jsonl").read_text().splitlines()]
    assert [len(line["stocks_sha256"]) for line in journal if line["event"] == "done"] == [1, 1, 1]


# Long: that a gain is in the covariance of what is fitted is held in tests/identification/fit/test_laws_force_gain.py.
@pytest.mark.long
def test_an_uncertain_gain_of_the_sensor_is_in_the_coefficients_and_moves_none(shop: Shop, tmp_path: Path) -> None:
    """All six are as uncertain together as the gain: g^2 c c^T beside what the rows tell."""
    kept = {}
    for gain, seat in ((0.0, 0), (0.2, 0), (3.0, 3)):
        cell = shop.a.cell_with("gain.yaml", f"  gain_std: {gain % 3}\n  mounting_std_deg: {seat}\n{CUTTING}")
        shop.run("cutting", cell, shop.a.program, "--stock", shop.stocks[0], "--stiffness", shop.stiffness, "--forces",
                 shop.log, "--tare", "0:2", "-o", tmp_path / f"{gain}.json")
        kept[gain] = json.loads((tmp_path / f"{gain}.json").read_text())
    mean = np.array(kept[0.0]["mean"])
    assert kept[0.2]["mean"] == pytest.approx(kept[0.0]["mean"])
    told, alone, seat_told = (np.concatenate(kept[gain]["covariance"]) for gain in (0.2, 0.0, 3.0))
    assert told - alone == pytest.approx(0.04 * np.outer(mean, mean)[np.tril_indices(6)], rel=1e-6)
    # A seat turned by three degrees: three directions of the coefficients and no more, so large a share of the largest.
    seat = np.zeros((6, 6))
    seat[np.tril_indices(6)] = seat_told - alone
    sizes = np.linalg.eigvalsh(seat + np.tril(seat, -1).T)
    assert np.abs(sizes[:3]).max() < 1e-9 * sizes[-1]
    assert 0.3 < np.sqrt(sizes[-1]) / (np.radians(3) * mean.max()) < 3


# Long: what a seat that may be turned makes uncertain, tests/compensator/correction/test_laws_stated_errors.py.
@pytest.mark.long
def test_a_sensor_that_may_be_turned_makes_coefficients_uncertain_as_turned_ones_say(shop: Shop, tmp_path: Path) -> None:
    """Fitted again with the sensor's stated axes turned by a third of a degree about each, to either side: how they move is the
    sigma."""
    frame = shop.a.cell.read_text()
    (stated,) = re.findall(r"sensor_quaternion: \[(.*)\]", frame)
    w, *xyz = map(float, stated.split(","))
    sensor, kept = Rotation.from_quat([*xyz, w]), {}
    turns = zip("xyzXYZ", np.concatenate([np.eye(3), -np.eye(3)]), strict=True)
    for axis, turn in (("none", np.zeros(3)), ("seat", np.zeros(3)), *turns):
        x, y, z, w = (sensor * Rotation.from_rotvec(np.radians(turn / 3))).as_quat()
        cell = shop.a.cell_with("seat.yaml", f"  mounting_std_deg: {3 * (axis == 'seat')}\n{CUTTING}")
        cell.write_text(cell.read_text().replace(stated, f"{w:.12f}, {x:.12f}, {y:.12f}, {z:.12f}"))
        shop.run("cutting", cell, shop.a.program, "--stock", shop.stocks[0], "--stiffness", shop.stiffness, "--forces",
                 shop.log, "--tare", "0:2", "-o", tmp_path / f"{axis}.json")
        kept[axis] = json.loads((tmp_path / f"{axis}.json").read_text())
    slopes = 4.5 * np.array([np.subtract(kept[axis]["mean"], kept[axis.upper()]["mean"]) for axis in "xyz"])
    told, alone = (np.concatenate(kept[axis]["covariance"]) for axis in ("seat", "none"))
    expected = (slopes.T @ slopes)[np.tril_indices(6)]
    assert told - alone == pytest.approx(expected, rel=0.15, abs=0.03 * np.abs(expected).max())
