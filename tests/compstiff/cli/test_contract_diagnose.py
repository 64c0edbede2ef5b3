"""`diagnose` where a file has a mistake, or where words do not go together: what it writes, and what it says of the rest."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from types import SimpleNamespace

import click
import numpy as np
import pytest
from click.testing import CliRunner

import compstiff as api
from compstiff.cli.diagnose import _next_after
from compstiff.cli.main import compstiff
from identification.diagnosis.mended import MendedFile

SAMPLES = Path(__file__).parents[3] / "samples"
CELL, TABLE = SAMPLES / "cell.yaml", SAMPLES / "measurements.csv"


def call(*words: object) -> tuple[int, str]:
    done = CliRunner().invoke(compstiff, [str(word) for word in words])
    return done.exit_code, " ".join(done.stderr.split())


@pytest.mark.parametrize("suffix", [".csv", ".yaml"])
@pytest.mark.parametrize("mends", [False, True])
def test_a_model_that_is_not_written_leads_to_the_file_without_the_mistake(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, mends: bool) -> None:
    """CS1704: which option writes it, or, where it was just written, its name."""
    judgement = SimpleNamespace(mistakes=[SimpleNamespace(sentence="dx turned")], choice_is_small=False, unsettled=())
    found = SimpleNamespace(
        verdict="mistake", judgement=judgement, measurements=SimpleNamespace(weights=()), findings=(), as_dict=dict, lines=list,
        mended=lambda: MendedFile(suffix, b"without it\n", TABLE))
    monkeypatch.setattr(api, "diagnose", lambda *_, **__: found)
    extended, mended = tmp_path / "extended.json", (tmp_path / "mended").with_suffix(suffix)
    code, said = call("diagnose", CELL, TABLE, "-o", tmp_path / "d.json", "--extended", extended,
                      *(["--mend", tmp_path / "mended"] if mends else []))
    assert (code, "CS1704" in said, extended.exists(), mended.exists()) == (3, True, False, mends), said
    assert ("--mend writes the file without the mistake" in said) == (not mends)
    assert (f"diagnose again with {mended}, which is without it" in said) == mends


def test_rows_that_no_springs_fit_are_written_without_their_mistake_and_nothing_else_is(tmp_path: Path) -> None:
    """Unloaded minus loaded (CS1010): in the mended file loads and readings go together as before, of which of
    the two the sign was turned nobody can say from them alone."""
    rows = api.read_measurements(TABLE, api.read_cell(CELL))
    lines = TABLE.read_text().splitlines()
    start = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    header = lines[start].split(",")
    columns = [k for k, name in enumerate(header) if name in ("dx_um", "dy_um", "dz_um")]
    cells = [line.split(",") for line in lines[start + 1:]]
    for row in cells:
        for k in columns:
            row[k] = str(-float(row[k])) if row[k] else ""
    table, mended = tmp_path / "turned.csv", tmp_path / "mended"
    table.write_text("\n".join([",".join(header), *map(",".join, cells)]) + "\n")
    asked = ("diagnose", CELL, table, "-o", tmp_path / "d.json", "--extended", tmp_path / "e.json")
    code, said = call(*asked, "--mend", mended)
    assert (code, "CS1010" in said) == (1, True), said
    assert f"{mended}.csv is {table} without the mistake, to be diagnosed again; no other file was written" in said
    assert {file.name for file in tmp_path.iterdir()} == {"turned.csv", "mended.csv"}
    again = api.read_measurements(tmp_path / "mended.csv", api.read_cell(CELL))
    sign = np.sign(np.sum(again.deflection * rows.deflection))
    np.testing.assert_allclose(sign * again.deflection, rows.deflection, atol=1e-12)
    np.testing.assert_allclose(sign * again.wrench, rows.wrench, atol=1e-9)


@pytest.mark.parametrize(("verdict", "begins", "has"), [
    ("named", "compstiff diagnose ", ["--extended", "--force"]), ("mistake", "do the checks above; ", ["--mend", "--force"]),
    ("adequate", "compstiff identify ", ["stiffness.json"]),
    ("ambiguous", "compstiff design ", ["--add 3", "--diagnosis d.json", "--dead-weight 10,20", "loads that tell them apart"]),
    ("misfit", "do the checks above; ", ["--add 3", "--criterion C", "--dead-weight 10,20", "tell more causes apart"])])
def test_what_follows_each_verdict_is_a_call_of_the_command_that_leads_on(verdict: str, begins: str, has: list[str]) -> None:
    """With the weights that were measured with, where loads are planned; with its files and options as the command line takes
    them."""
    said = _next_after(verdict, Path("cell.yaml"), Path("m.csv"), Path("d.json"), ("--dead-weight", "10,20"))
    assert said.startswith(begins)
    assert all(words in said for words in has), said
    assert ("--dead-weight" in said) == ("compstiff design" in said)
    words = shlex.split(re.search(r"compstiff .*?(?:\.json|\.csv|--force)(?= plans| writes|,|$)", said)[0])
    command = compstiff.get_command(click.Context(compstiff), words[1])
    given, left, _ = command.make_parser(click.Context(command)).parse_args(words[2:])
    assert given["cell_file"] == "cell.yaml"
    assert not left
