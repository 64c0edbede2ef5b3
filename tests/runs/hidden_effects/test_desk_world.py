"""What real cells have, in load tests as one writes them at a desk: nothing is taken for something else."""

from __future__ import annotations

from pathlib import Path

import pytest

import compstiff
from tests.desk_world import TERMS, desk


@pytest.mark.parametrize("term", TERMS)
def test_it_is_named_or_in_the_set(term: str, tmp_path: Path) -> None:
    """A gear's free play and its softness near zero may stay open under one name."""
    case = desk(910001, term)
    cell_file, table = case.write(tmp_path)
    cell = compstiff.read_cell(cell_file)
    judgement = compstiff.diagnose(cell, compstiff.read_measurements(table, cell.robot)).judgement
    assert judgement.verdict in ("named", "ambiguous")
    named = [{cause.label, *(f"{law}[{cause.joint}]" for law in cause.open_laws)} for cause in judgement.causes]
    found = named or [{cause.label for cause in judgement.alternatives}]
    assert len(found) == 1
    assert case.hidden in {label.replace("gravity_compensator[2]", "gravity_compensator") for label in found[0]}


def test_a_law_that_explains_nothing_gives_way_to_its_rival(tmp_path: Path) -> None:
    """Under a noise that has grown for want of the cause free play seems as likely as the gear that is softer near zero."""
    cell_file, table = desk(1108001, "a gear softer near zero").write(tmp_path)
    cell = compstiff.read_cell(cell_file)
    found = compstiff.diagnose(cell, compstiff.read_measurements(table, cell.robot))
    assert [cause.label for cause in found.causes] == ["soft_zone[5]"]


def test_a_drift_without_a_clock_says_what_was_assumed(tmp_path: Path) -> None:
    cell_file, table = desk(910002, "drift without a clock").write(tmp_path)
    cell = compstiff.read_cell(cell_file)
    found = compstiff.diagnose(cell, compstiff.read_measurements(table, cell.robot))
    assert [cause.label for cause in found.causes] == ["drift"]
    assert "CS1409" in {finding.code for finding in found.findings}
