"""`cutting` of a log with a stock, cutter or pass that are not its own: said, and nothing of right ones. The truth is the
virtual cell's end mill and engagement alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.milling.first_part_job import CUTTING, stock_file
from tests.runs.milling.milling_job import MillingJob
from tests.support import long
from tests.virtual_cell.milled_part import slot_and_pocket

SAID = {"CS3035", "CS3075", "CS3076", "CS3094", "CS4733", "CS4734", "CS4735", "CS4738", "CS4745", "CS4746", "CS4747"}


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> MillingJob:
    made = MillingJob(tmp_path_factory.mktemp("part"), 47451, part=slot_and_pocket(2.0))
    made.springs("springs.json", made.case.stiffness)
    made.cell_with("cut.yaml", CUTTING)
    made.log(made.first, made.planned, "part.forces.csv")
    stock_file(made.part, made.folder / "part.stock.npz")
    return made


def cutting(
    job: MillingJob, stock: Path, *words: object, cell: str = "cut.yaml", log: str = "part.forces.csv", code: int = 0
) -> set[str]:
    done = kit.run("cutting", job.folder / cell, job.program, "--stock", stock, "--stiffness", job.folder / "springs.json",
                   "--forces", job.folder / log, "--tare", "0:2", "-o", job.folder / "cutting.json", "--force", "--json",
                   *words)
    assert done.code == code, done
    return kit.codes(done) & SAID


def moved(job: MillingJob, **by_mm: float) -> Path:
    """The stock, with its grid or its heights elsewhere."""
    with np.load(job.folder / "part.stock.npz") as whole:
        arrays = dict(whole)
    for name, value in by_mm.items():
        arrays[name] = arrays[name] + value
    file = job.folder / "moved.npz"
    np.savez(file, **arrays)
    return file


def test_nothing_is_said_of_the_right_stock(job: MillingJob) -> None:
    assert cutting(job, job.folder / "part.stock.npz") == set()


def test_a_block_for_a_roughed_pocket_and_what_the_pass_itself_left(job: MillingJob) -> None:
    block = job.folder / "block.yaml"
    block.write_text("box: {from_mm: [-62, -42, -20], to_mm: [62, 64, 0]}\n")
    assert "CS4745" in cutting(job, block)
    left = job.folder / "left.npz"
    cutting(job, job.folder / "part.stock.npz", "--leaves", left)
    assert "CS4745" in cutting(job, left)


def test_coefficients_that_their_log_rejects_are_refused(job: MillingJob) -> None:
    """As a stiffness file is, and with the option for that they are used and it is said; beside a log of the program itself
    they decide nothing. The right ones are not refused."""
    block, stock = job.folder / "block.yaml", job.folder / "part.stock.npz"
    block.write_text("box: {from_mm: [-62, -42, -20], to_mm: [62, 64, 0]}\n")

    def predicted(*words: object) -> kit.Run:
        return kit.run("predict", job.folder / "cut.yaml", job.program, "--stiffness", job.folder / "springs.json",
                       "--predict-force", job.folder / "cutting.json", "--stock", stock, "-o", job.folder / "deviation.csv",
                       "--force", "--json", *words)

    cutting(job, block)
    assert "CS4752" in kit.codes(kit.run("check", job.folder / "cut.yaml", job.folder / "cutting.json", "--json"))
    (job.folder / "deviation.csv").unlink(missing_ok=True)
    refused = predicted()
    assert refused.code == 3
    (said,) = [one for one in refused.json["findings"] if one["code"] == "CS4752"]
    assert said["level"] == "error"
    assert "the fit leaves" in said["message"]
    assert not (job.folder / "deviation.csv").exists()
    for words in (["--accept-rejected"], ["--forces", job.folder / "part.forces.csv", "--tare", "0:2"]):
        done = predicted(*words)
        assert done.code == 0, done
        assert [one["level"] for one in done.json["findings"] if one["code"] == "CS4752"] == ["warning"]
    cutting(job, stock)
    assert "CS4752" not in kit.codes(predicted())


def test_a_ball_for_a_flat_cutter(job: MillingJob) -> None:
    job.cell_with("ball.yaml", CUTTING.replace("teeth: 3", "teeth: 3, corner_radius_mm: 8"))
    assert "CS4745" in cutting(job, job.folder / "part.stock.npz", cell="ball.yaml")


def test_a_stock_that_stands_higher_in_its_file(job: MillingJob) -> None:
    assert "CS4747" in cutting(job, moved(job, height_mm=2.0))


@pytest.mark.parametrize(("old", "new", "said"), [
    ("teeth: 3", "teeth: 2", {"CS3094"}), long("teeth: 3", "teeth: 4", {"CS3094"}), long("9000", "4500", {"CS3094"}),
    ("9000", "18000", {"CS3035"}), ("aluminium", "titanium", {"CS4747"}), long("aluminium", "superalloy", {"CS4747"})])
def test_a_cutter_a_speed_and_a_material_that_are_not_those_of_the_log(
    job: MillingJob, old: str, new: str, said: set[str]
) -> None:
    """The truth has three teeth at 9000 rpm, and Ktc of 767 N/mm^2."""
    assert old in CUTTING
    job.cell_with("other.yaml", CUTTING.replace(old, new))
    assert cutting(job, job.folder / "part.stock.npz", cell="other.yaml") == said


@pytest.mark.parametrize("aside_mm", [150.0, -150.0])
def test_a_stock_that_stands_beside_the_cut_is_refused(job: MillingJob, aside_mm: float) -> None:
    """As in another work object, or taken from the blank's other corner; what an earlier call wrote stays."""
    (job.folder / "cutting.json").write_text("{}")
    assert cutting(job, moved(job, origin_mm=aside_mm), code=3) == {"CS4738"}
    assert (job.folder / "cutting.json").read_text() == "{}"


def test_the_log_of_the_corrected_pass_without_its_offsets(job: MillingJob) -> None:
    """`cutting`, `predict` and `learn` hear of it as `correct` does; named with its offsets nothing is said."""
    model = job.folder / "springs.json"
    found = job.correct(job.folder / "part.forces.csv", model)
    offsets = job.offsets(found, "offsets.csv")
    job.log(job.mill(found.commands, part=found.part), found.commands, "second.forces.csv", part=found.part)
    stock = job.folder / "part.stock.npz"
    assert cutting(job, stock, log="second.forces.csv") == {"CS3075"}
    assert cutting(job, stock, "--logged-with", offsets, log="second.forces.csv") == set()
    assert cutting(job, stock, "--logged-with", offsets) == {"CS3076"}
    for log, said in (("second.forces.csv", {"CS3075"}), ("part.forces.csv", set())):
        done = kit.run("predict", job.folder / "cut.yaml", job.program, "--stiffness", model, "--forces", job.folder / log,
                       "--tare", "0:2", "-o", job.folder / "deviation.csv", "--force", "--json")
        assert kit.codes(done) & SAID == said
