"""An APT file of two tools, posted: each is right with its own cell; a change written otherwise, or not at all, is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from compensator.posting.apt import read_apt
from tests.runs.command_line import user_files as kit

SAMPLE = Path(__file__).parents[4] / "samples" / "cell.yaml"
PLACE = "workobject: {position_mm: [1050, -70, 620], quaternion: [0.99965732, 0, 0, 0.02617695]}\n"


def text(first: str, second: str) -> str:
    """A roughing pass with 16 mm at 40 mm/s, a finishing one with 6 mm at 15; first, second: the words that change the tool."""
    def cut(y: int, z: int) -> str:
        return "".join(f"GOTO/{5 * k},{y},{z},0,0,1\n" for k in range(20))

    return (f"PARTNO/P\nUNITS/MM\n{first}\nCUTTER/16,0\nRAPID\nGOTO/0,0,60,0,0,1\nRAPID\nGOTO/0,0,20,0,0,1\nFEDRAT/2400,MMPM\n"
            f"{cut(0, 20)}RAPID\nGOTO/95,0,60,0,0,1\n{second}\nCUTTER/6,0\nRAPID\nGOTO/0,30,60,0,0,1\nFEDRAT/900,MMPM\n"
            f"{cut(30, 25)}RAPID\nGOTO/95,30,60,0,0,1\nFINI\n")


@pytest.mark.parametrize(("words", "tool", "diameter", "code", "odd"), [
    (("LOADTL/1", "LOADTL/2"), "1", 16, 0, ""), (("LOADTL/1", "LOADTL/2"), "2", 6, 0, ""),
    (("TURRET/1", "TURRET/2"), "2", 6, 0, ""),
    (("LOADTL/1", "LOADTL/2"), "", 16, 1, "CS2110"), (("LOADTL/1", "LOADTL/2"), "3", 16, 1, "CS2110"),
    (("LOADTL/1", "LOADTL/2"), "2", 16, 0, "CS4316"), (("LOADTL/1", "LOADTL/1"), "1", 16, 0, "CS4316"),
    (("LOADTL/ROUGH", "LOADTL/FINISH"), "", 16, 0, "CS4316"), (("PPRINT/TOOL 1", "PPRINT/TOOL 2"), "", 16, 0, "CS4316")])
def test_two_tools(tmp_path: Path, words: tuple[str, str], tool: str, diameter: float, code: int, odd: str) -> None:
    cell = SAMPLE.read_text(encoding="utf-8").replace("tool_diameter_mm: 16", f"tool_diameter_mm: {diameter}") + PLACE
    (tmp_path / "cell.yaml").write_text(cell)
    (tmp_path / "two.apt").write_text(text(*words))
    chosen = ("--tool", tool) if tool else ()
    run = kit.run("post", tmp_path / "cell.yaml", tmp_path / "two.apt", "-o", tmp_path / "two.mod", *chosen, "--json")
    assert run.code == code, run
    assert kit.codes(run) & {"CS2110", "CS4316"} == ({odd} if odd else set())
    if not code:
        assert run.json["result"]["targets"] == (45 if not tool or words[0] == words[1] else 23 if tool == "1" else 22)


def test_what_moves_on_from_where_another_tool_was_is_refused(tmp_path: Path) -> None:
    """The first tool comes back behind the second: where it stood then is not where it is."""
    (tmp_path / "cell.yaml").write_text(SAMPLE.read_text(encoding="utf-8") + PLACE)
    (tmp_path / "back.apt").write_text(
        "PARTNO/P\nUNITS/MM\nLOADTL/1\nRAPID\nGOTO/0,0,60,0,0,1\nFEDRAT/2400,MMPM\nGOTO/0,0,20,0,0,1\nLOADTL/2\nRAPID\n"
        "GOTO/50,0,60,0,0,1\nLOADTL/1\nGODLTA/0,0,5\nGOTO/9,0,20\nFINI\n")
    run = kit.run("post", tmp_path / "cell.yaml", tmp_path / "back.apt", "-o", tmp_path / "back.mod", "--tool", "1", "--json")
    assert (run.code, kit.codes(run)) == (1, {"CS2102"})
    assert not (tmp_path / "back.mod").exists()


@pytest.mark.parametrize(("tool", "rapid"), [("1", [False, False, True]), ("2", [False, True]), ("3", [True, False])])
def test_rapid_is_the_next_motion_s_of_the_same_tool_alone(tmp_path: Path, tool: str, rapid: list[bool]) -> None:
    """What stands before a change of tools is not carried over to the tool that comes in."""
    (tmp_path / "three.apt").write_text(
        "UNITS/MM\nFEDRAT/600,MMPM\nLOADTL/1\nGOTO/0,0,9\nRAPID\nLOADTL/2\nGOTO/0,0,0\nRAPID\nGOTO/0,0,5\nRAPID\nLOADTL/1\n"
        "GOTO/0,0,1\nRAPID\nGOTO/0,0,7\nLOADTL/3\nRAPID\nGOTO/0,0,8\nGOTO/0,0,2\n")
    assert read_apt(tmp_path / "three.apt", tool).rapid.tolist() == rapid
