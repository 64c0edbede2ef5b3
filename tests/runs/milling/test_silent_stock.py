"""Ordinary mistakes of who predicts forces from a stock: the stock higher, another spindle speed or cutter. Each is said, and
a sound job is not."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.runs.command_line.workshop import Workshop, workshop

CELL = """workobject: {{position_mm: [1400, -50, 700]}}
cutting: {{material: aluminium, tool_diameter_mm: {diameter}, teeth: {teeth}, flute_mm: {flute}}}
"""
STOCK = "box: {{from_mm: [0, -4, -20], to_mm: [60, 40, {top}]}}\nposition_std_mm: 0.1\n"


def table() -> str:
    """Down beside the block, along its edge 4 mm deep into it and 2 mm down, off it, and back over it, fast, 5 mm above."""
    rows = [(-30, -10, 40, 200, 1), (-30, -10, -2, 200, 1), (-20, -10, -2, 40, 0),
            *((x, -10, -2, 40, 0) for x in range(0, 61, 5)), (80, -10, -2, 40, 0), (80, -5, 5, 200, 1), (-30, -5, 5, 200, 1)]
    return "x_mm,y_mm,z_mm,q1,q2,q3,q4,feed_mm_s,rapid\n" + "".join(
        f"{x},{y},{z},0,0,1,0,{feed},{rapid}\n" for x, y, z, feed, rapid in rows)


def run(job: Workshop, folder: Path, *, top: float = 0, rpm: float = 12000, diameter: float = 20, teeth: int = 3,
        flute: float = 30) -> tuple[dict[str, str], dict]:
    """Messages by the codes of what is said, and the result."""
    cell = job.files["cell.yaml"].replace("sign: on_tool}", f"sign: on_tool, spindle_rpm: {rpm:g}}}")
    files = {"cell.yaml": cell + CELL.format(diameter=diameter, teeth=teeth, flute=flute), "path.csv": table(),
             "stock.yaml": STOCK.format(top=top)}
    assert job.run(folder, files, "cutting", "@cell.yaml", "@path.csv", "-o", "@cutting.json").code == 0
    said = job.run(folder, files, "predict", "@cell.yaml", "@path.csv", "--stiffness", "@stiffness.json", "--predict-force",
                   "@cutting.json", "--stock", "@stock.yaml", "-o", "@deviation.csv")
    assert said.code == 0, said
    return {one["code"]: one["message"] for one in said.json["findings"]}, said.json["result"]


@pytest.fixture
def job() -> Workshop:
    return workshop("irb6660-205-1.90")


def test_a_sound_job_says_what_it_cuts_and_warns_of_nothing(job: Workshop, tmp_path: Path) -> None:
    said, _ = run(job, tmp_path)
    assert not said.keys() & {"CS4708", "CS4709", "CS4748", "CS4749"}
    assert "on average 2.00 mm deep along the axis and 3.52 mm across the feed" in said["CS4706"]
    assert "0.0667 mm a tooth" in said["CS4706"]


@pytest.mark.parametrize("wrong", [{"rpm": 1200}, {"rpm": 120000}, {"teeth": 30}, {"rpm": 12}])
def test_a_chip_that_no_end_mill_has_is_said(job: Workshop, tmp_path: Path, wrong: dict) -> None:
    said, _ = run(job, tmp_path, **wrong)
    assert "% of the diameter" in said["CS4748"]


@pytest.mark.parametrize("right", [{"rpm": 24000, "teeth": 2}, {"rpm": 8000, "teeth": 2}, {"rpm": 4000, "teeth": 4}])
def test_chips_that_end_mills_have_are_not(job: Workshop, tmp_path: Path, right: dict) -> None:
    assert "CS4748" not in run(job, tmp_path, **right)[0]


def test_a_move_of_the_air_through_the_stock_is_said(job: Workshop, tmp_path: Path) -> None:
    said, _ = run(job, tmp_path, top=8)
    assert "1 move at 200 mm/s goes through the stock, where the others cut at 40" in said["CS4749"]


@pytest.mark.parametrize(("flute", "known"), [(30, True), (2.5, True), (1.9, False), (1, False)])
def test_a_cut_deeper_than_the_edges_are_long_has_no_force(job: Workshop, tmp_path: Path, flute: float, known: bool) -> None:
    """What stands above the edges rubs on the shank: it was a cut of the edges alone, or none, without a word."""
    said, result = run(job, tmp_path, flute=flute)
    assert ("CS4708" not in said) == known
    assert ("cutting.flute_mm" in said.get("CS4708", "")) != known
    assert bool(result["with_force"]) == known
