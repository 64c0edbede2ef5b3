"""The centre of mass of what hangs on the flange: in millimetres, or it is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.model.cell import read_cell


def written(folder: Path, centre: list[float], where: str) -> Path:
    load = f"{{mass_kg: 12, centre_of_mass_mm: {centre}}}"
    tool = "position_mm: [120, 0, 250]" + (f", {load[1:-1]}" if where == "tool" else "")
    log = f"force_log: {{payload: {load}}}\n" if where == "force_log.payload" else ""
    (folder / "cell.yaml").write_text(f"robot: irb6660-205-1.90\ntool: {{{tool}}}\n{log}")
    return folder / "cell.yaml"


@pytest.mark.parametrize("where", ["tool", "force_log.payload"])
def test_a_centre_in_another_unit_is_told(tmp_path: Path, where: str) -> None:
    rng = np.random.default_rng(102)
    for _ in range(30):
        centre = (rng.normal(size=3) * 10 ** rng.uniform(1.5, 2.5)).round(1).tolist()
        read_cell(written(tmp_path, centre, where))
        for unit, named in ((1e-3, "metres"), (1e3, "micrometres")):
            with pytest.raises(CompstiffError, match=f"{where}.centre_of_mass_mm is") as refused:
                read_cell(written(tmp_path, [round(unit * x, 6) for x in centre], where))
            assert f"in {named}?" in refused.value.findings[0].hint
    read_cell(written(tmp_path, [0, 0, 0], where))
