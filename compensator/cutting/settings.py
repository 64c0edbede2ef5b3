"""What a user may choose of forces that are predicted from the stock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class CuttingSettings:
    """predict_force: cutting.json, whose coefficients tell the forces; stock: what the program starts from, stock.yaml or
    .npz."""

    predict_force: Path | None = None
    stock: Path | None = None
