"""demo, robots, explain: what a new user types first."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.runs.command_line import user_files as kit


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, kit.Run]:
    folder = tmp_path_factory.mktemp("demo") / "out"
    return folder, kit.spawn("demo", folder)


def test_demo(demo: tuple[Path, kit.Run]) -> None:
    folder, result = demo
    assert result.code == 0, result
    assert re.search(r"k1 .*k6 ", result.out, re.S), "stiffnesses with their uncertainty"
    assert "predicted deviation" in result.out
    assert "residual" in result.out or "left after correction" in result.out
    assert (folder / "stiffness.json").exists()
    assert list(folder.glob("*corrected*.mod")) or list(folder.glob("*.mod"))


def test_the_demo_s_cell_states_its_spindle_and_its_cut(demo: tuple[Path, kit.Run]) -> None:
    """What a cell.yaml should have: then targets are added where the force asks for them, and a few micrometres are expected
    on the part."""
    _, result = demo
    said = result.out + result.err
    assert "CS3067" not in said
    assert "CS3093" not in said
    added = re.search(r"intermediate targets added: (\d+)", said)
    assert added
    assert int(added.group(1)) > 100
    expected = re.search(r"expected to be left on the part, 2 sigma: ([\d.]+) um RMS.*cut ([\d.]+),", said)
    assert expected
    assert float(expected.group(1)) < 20
    assert float(expected.group(2)) < 8


def test_the_readme_shows_what_the_demo_prints(demo: tuple[Path, kit.Run]) -> None:
    """Piece by piece, but for what it leaves out with three points."""
    _, result = demo
    readme = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    shown = re.search(r"What it prints, shortened:\n\n```\n(.*?)```", readme, re.S)
    assert shown
    lines = [line for line in shown.group(1).splitlines() if line.strip("\n .")]
    assert len(lines) >= 5
    for line in lines:
        for piece in re.split(r", | \(|\)", line):
            assert piece == "..." or piece in result.out, piece


def test_the_readme_s_picture_is_of_this_demo(demo: tuple[Path, kit.Run]) -> None:
    """samples/demo_picture.py draws it from the offsets that the demo writes."""
    from samples.demo_picture import PICTURE, picture

    folder, _ = demo
    assert picture(folder / "offsets.csv") == PICTURE.read_text(encoding="utf-8")


def test_demo_does_not_overwrite(demo: tuple[Path, kit.Run]) -> None:
    folder, _ = demo
    before = {p.name: p.read_bytes() for p in folder.iterdir()}
    again = kit.run("demo", folder)
    assert again.code == 1, again
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before


def test_the_demo_s_program_lands(demo: tuple[Path, kit.Run], tmp_path: Path) -> None:
    """Some targets of the shipped program, by the independent arm, with the stiffnesses identify found; none added, so that the
    targets of both programs are the same."""
    import json

    import numpy as np

    folder, _ = demo
    k = np.array([p["estimate"] for p in json.loads((folder / "stiffness.json").read_text())["parameters"]])
    source = next(p for p in folder.glob("*.mod") if "correct" not in p.name)
    corrected, offsets_file = tmp_path / "kept.mod", tmp_path / "offsets.csv"
    done = kit.run("correct", folder / "cell.yaml", source, "--stiffness", folder / "stiffness.json", "--forces",
                   next(folder.glob("*.forces.parquet")), "--tare", "0:2", "--keep-targets", "-o", corrected,
                   "--offsets", offsets_file)
    assert done.code == 0, done
    before, after = kit.targets_of(source.read_text()), kit.targets_of(corrected.read_text())
    assert len(before) == len(after) > 1000
    offsets = kit.table(offsets_file)
    assert len(offsets) == len(before) == len(kit.table(next(folder.glob("*offsets*.csv"))))
    number = 0
    obj = kit.Frame.mm([1050.0, -70.0, 620.0], [0.99965732, 0, 0, 0.02617695])
    tool = kit.Frame.mm([120.0, 0.0, 250.0])
    q = np.radians([0.0, 20, 40, 0, 40, 0])
    for i in range(0, len(before), 97):
        shift = (after[i].p - before[i].p) * 1e3
        np.testing.assert_allclose(kit.column([offsets[i]], "ox_mm", "oy_mm", "oz_mm")[0], shift, atol=1.1e-4)
        if not shift.any():
            continue
        number += 1
        # the deviation of the planned pose is opposite to the correction to first order
        base = obj.r.apply(shift) * 1e3
        deviation = kit.column([offsets[i]], "dx_um", "dy_um", "dz_um")[0]
        assert np.linalg.norm(base + deviation) < 0.02 * np.linalg.norm(deviation) + 0.2
    assert number > 5
    assert k.shape == q.shape
    assert tool.p[2] == 0.25


def test_robots(tmp_path: Path) -> None:
    result = kit.run("robots", "--json")
    names = [r["name"] for r in result.json["result"]["robots"]]
    assert "irb6660-205-1.90" in names
    assert len(names) >= 3
    assert "serial" in {r["load_path"] for r in result.json["result"]["robots"]}
    told = kit.run("robots")
    assert all(n in told.out for n in names)


def test_explain() -> None:
    assert kit.run("explain", "CS4107").code == 0
    # A cause as diagnose writes it, with its joint.
    play = kit.run("explain", "backlash[3]")
    assert "free play" in play.out
    assert "urad" in play.out
    assert "correct takes it into account" in play.out
    assert "taken out of the data" in kit.run("explain", "stand_compliance").out
    assert {"CS4107", "backlash"} <= {line.split()[0] for line in kit.run("explain").out.splitlines() if line}
    assert "near it: hysteresis" in kit.run("explain", "hysterisis").err
    for command in ("verify", "Correct"):
        assert f"compstiff {command.lower()} -h" in kit.run("explain", command).err
    neither = kit.run("explain", "wobble", "board").err
    for example in ("CS1002", "backlash", "compstiff explain", "COMMAND -h"):
        assert example in neither
    unknown = kit.run("explain", "CS9999", "--json")
    assert unknown.code in (1, 2)
    assert unknown.json["findings"]


@pytest.mark.parametrize("columns", [60, 100])
def test_sentences_break_between_words_on_a_terminal(columns: int) -> None:
    """And not where they are piped, where every finding is a line; what is read together is the same."""
    pty = pytest.importorskip("pty", reason="a terminal of POSIX")
    primary, secondary = pty.openpty()
    command = [sys.executable, "-m", "compstiff", "explain", "CS1016"]
    with subprocess.Popen(command, stdin=secondary, stdout=secondary, stderr=secondary, env=os.environ | {
            "COLUMNS": str(columns)}) as process:
        os.close(secondary)
        shown = b""
        with contextlib.suppress(OSError):      # what a terminal says when nobody writes to it any more
            while part := os.read(primary, 4096):
                shown += part
        process.wait(timeout=300)
    os.close(primary)
    piped = kit.run("explain", "CS1016").out
    lines = shown.decode().splitlines()
    assert max(map(len, piped.splitlines())) > 100
    assert columns - 20 < max(map(len, lines)) <= columns
    assert " ".join(shown.decode().split()) == " ".join(piped.split())


def test_help_is_quick_and_everywhere() -> None:
    for command in ("", "correct", "predict", "identify", "demo", "robots", "explain"):
        for flag in ("-h", "--help"):
            result = kit.run(*([command] if command else []), flag)
            assert result.code == 0
            assert "Usage" in result.out
