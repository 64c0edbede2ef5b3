"""Coefficients: what a tool in a material is believed to need of force, with its covariance; and cutting.json, which keeps
it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from compensator.cutting.chips import COEFFICIENTS
from compensator.cutting.cutter import Cutter
from identification.common.arrays import Array, read_only
from identification.common.findings import error

FORMAT, VERSION = "compstiff-cutting", 1
# Newtons and millimetres, as such numbers are printed: N/mm^2 of the chip's three, N/mm of the edge's.
IN_MM = np.array([1e-6] * 3 + [1e-3] * 3)
# A cutter is the same within this [m].
SAME_CUTTER = 1e-5


@dataclass(frozen=True, eq=False)
class Coefficients:
    """mean (6,) of COEFFICIENTS [N/m^2, N/m] and covariance (6, 6). model_error: 1 sigma of what the model leaves of the force
    at a place, as a share of it. cutter and material (None: not stated) they hold for; chip (2,) [m]: least and largest feed a
    tooth of the log, None where no log was fitted; told: what they were made from, JSON values. rejected: why the log that they
    were fitted to says that they are none, in words, "" where it does not."""

    mean: Array
    covariance: Array
    model_error: float
    cutter: Cutter
    material: str | None
    chip: tuple[float, float] | None
    told: dict[str, Any]
    source: Path | None = None
    rejected: str = ""

    def __post_init__(self) -> None:
        read_only(self.mean, self.covariance)

    @property
    def rejection(self) -> str:
        """What to say of them where their own log rejects them, else ""."""
        return f"the log that these coefficients were fitted to rejects them: {self.rejected}" if self.rejected else ""

    @property
    def std(self) -> Array:
        """1 sigma (6,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def as_dict(self) -> dict[str, Any]:
        """What cutting.json holds."""
        unit, cutter = IN_MM, self.cutter
        covariance = self.covariance * np.outer(unit, unit)
        return {
            "format": FORMAT, "version": VERSION, "coefficients": list(COEFFICIENTS), "mean": (unit * self.mean).tolist(),
            "covariance": [covariance[row, :row + 1].tolist() for row in range(6)], "model_error": self.model_error,
            "cutter": {"diameter_mm": 2e3 * cutter.radius, "teeth": cutter.teeth, "corner_radius_mm": 1e3 * cutter.corner,
                       "flute_mm": 1e3 * cutter.flute if np.isfinite(cutter.flute) else None},
            "material": self.material, "feed_a_tooth_mm": None if self.chip is None else [1e3 * value for value in self.chip],
            "told": self.told, "rejected": self.rejected or None,
        }


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore")


class _Cutter(_Part):
    diameter_mm: FiniteFloat = Field(gt=0, le=1000)
    teeth: int = Field(ge=1, le=100)
    corner_radius_mm: FiniteFloat = Field(ge=0, le=500)
    flute_mm: FiniteFloat | None = Field(default=None, gt=0)


class CoefficientsFile(_Part):
    """cutting.json, beside its format and version."""

    coefficients: list[str]
    mean: list[FiniteFloat]
    covariance: list[list[FiniteFloat]]
    model_error: FiniteFloat = Field(ge=0, le=10)
    cutter: _Cutter
    material: str | None = None
    feed_a_tooth_mm: tuple[FiniteFloat, FiniteFloat] | None = None
    told: dict[str, Any] = {}
    rejected: str | None = None


def read_coefficients(file: str | Path) -> Coefficients:
    """Reads cutting.json. Raises CompstiffError: CS0005, CS4720 not such a file or not whole."""
    name = str(file)
    try:
        content = json.loads(Path(file).read_bytes())
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=name) from reason
    except (ValueError, RecursionError) as reason:
        raise error("CS4720", f"is not JSON: {reason}", file=name, hint="compstiff cutting writes it") from reason
    if not isinstance(content, dict) or content.get("format") != FORMAT or content.get("version") != VERSION:
        found = (content.get("format"), content.get("version")) if isinstance(content, dict) else type(content).__name__
        raise error("CS4720", f"holds no cutting coefficients: format and version are {found}, expected ('{FORMAT}', "
                    f"{VERSION})", file=name, hint="compstiff cutting writes it")
    try:
        part = CoefficientsFile.model_validate(content)
    except ValidationError as reason:
        first = reason.errors()[0]
        raise error("CS4720", f"{'.'.join(map(str, first['loc']))}: {first['msg']}", file=name) from reason
    lower_half = [len(row) for row in part.covariance] == list(range(1, 7))
    if tuple(part.coefficients) != COEFFICIENTS or len(part.mean) != 6 or not lower_half:
        raise error("CS4720", f"expected the mean of {', '.join(COEFFICIENTS)} and the lower half of their covariance",
                    file=name,
                    hint="edit no such file by hand")
    covariance = np.zeros((6, 6))
    for row, values in enumerate(part.covariance):
        covariance[row, :row + 1] = covariance[:row + 1, row] = values
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    if np.abs(covariance).max() > 1e18 or np.abs(part.mean).max() > 1e9 or (
            np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() < -1e-6):
        raise error("CS4720", "covariance is not positive semidefinite, or a number is beyond all sense", file=name,
                    hint="edit no such file by hand")
    cutter = Cutter(0.5e-3 * part.cutter.diameter_mm, part.cutter.teeth, 1e-3 * part.cutter.corner_radius_mm,
                    np.inf if part.cutter.flute_mm is None else 1e-3 * part.cutter.flute_mm)
    chip = None if part.feed_a_tooth_mm is None else (1e-3 * part.feed_a_tooth_mm[0], 1e-3 * part.feed_a_tooth_mm[1])
    return Coefficients(np.array(part.mean) / IN_MM, covariance / np.outer(IN_MM, IN_MM), part.model_error, cutter,
                        part.material,
                        chip, part.told, Path(file), part.rejected or "")


def check_same(coefficients: Coefficients, cutter: Cutter, material: str | None, cell: str) -> None:
    """Raises CompstiffError (CS4721) where coefficients are those of another cutter or material than the cell's."""
    own = coefficients.cutter
    differs = []
    if max(abs(own.radius - cutter.radius), abs(own.corner - cutter.corner)) > SAME_CUTTER:
        differs.append(f"a {own.words()}, the cell's is a {cutter.words()}")
    if coefficients.material and material and coefficients.material != material:
        differs.append(f"{coefficients.material}, the cell states {material}")
    if differs:
        raise error("CS4721", f"the coefficients are those of {' and of '.join(differs)}", file=str(coefficients.source or ""),
                    hint=f"fit them from a log with this tool and material, or correct `cutting` in {Path(cell).name}")
