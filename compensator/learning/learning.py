"""Learning: what a measured part and the log of its pass taught."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from compensator.correction.predict import Predicted
from compensator.correction.settings import Estimate
from compensator.learned.learned import DRIFT, SETUP, Learned
from compensator.learned.learned_file import learned_json
from compensator.learning.causes import Asked
from compensator.learning.chance import FALSE_RATE
from compensator.learning.held_out import HeldOut
from compensator.learning.sizes import Sizes
from compensator.learning.terms import Terms
from compensator.learning.words import lines
from identification.common.arrays import Array, rms
from identification.common.files import sha256
from identification.common.findings import Finding
from identification.model.effects_in_force import SPRINGS

PARTS = {"predicted": "deflection, as it was predicted", "springs": "springs and motion, learned",
         "setup": "set-up of the part", "drift": "warming over the job", "remainder": "smooth remainder", "left": "left"}


@dataclass(frozen=True, eq=False)
class Learning:
    """What a measured part taught. parts: the rows' displacement (n,) [m] that each took, by PARTS; measured (n,) [m].
    motion: factor on the deflection; chance: of a remainder as clear as this without one; asked: which causes the part shows.
    points: used, and in the file `source`; logged_with: the offsets of the pass; beside [m]: what was taken off all numbers
    along normals, None: nothing."""

    predicted: Predicted
    terms: Terms
    sizes: Sizes
    learned: Learned
    measured: Array
    parts: dict[str, Array]
    motion: Estimate
    chance: float
    held_out: HeldOut | None
    asked: Asked
    points: tuple[int, int]
    source: str
    logged_with: Path | None
    findings: tuple[Finding, ...]
    beside: Estimate | None = None

    @property
    def setup_on(self) -> bool:
        """Whether a displaced set-up was seen."""
        return bool(self.terms.job[:SETUP].any())

    @property
    def drift_on(self) -> bool:
        """Whether a drift was seen."""
        return bool(self.terms.job[SETUP:].any())

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        size = self.learned.springs
        job = self.learned.mean[size:size + SETUP + DRIFT]
        std = np.sqrt(np.diag(self.learned.covariance))
        frame, remainder = self.learned.frame, self.learned.remainder
        prior = -self.learned.prior[SPRINGS]
        return {
            "points": self.points[1], "points_used": self.points[0], "places": len(self.terms.rows.position),
            "measured_um": 1e6 * rms(self.measured),
            "along_normals": None if self.beside is None else {
                "all_um": 1e6 * self.beside.value, "std_um": 1e6 * self.beside.std},
            "parts_um": {name: 1e6 * rms(values) for name, values in self.parts.items()},
            "gone": self.gone(),
            "motion": {"scale": self.motion.value, "std": self.motion.std},
            "stiffness": {"before": np.exp(prior).tolist(), "in_motion": np.exp(-self.learned.mean[SPRINGS]).tolist(),
                          "relative_std": std[SPRINGS].tolist()},
            "setup": None if not self.setup_on else {
                "shift_um": (1e6 * job[:3]).tolist(), "shift_std_um": (1e6 * std[size:size + 3]).tolist(),
                "turn_mrad": (1e3 * job[3:6] / frame.radius).tolist(), "about_mm": (1e3 * frame.centre).tolist()},
            "drift": None if not self.drift_on else {
                "over_the_job_um": (1e6 * job[SETUP:]).tolist(),
                "std_um": (1e6 * std[size + SETUP:size + SETUP + DRIFT]).tolist(), "duration_s": frame.duration},
            "remainder": None if not len(remainder.places) else {
                "amplitude_um": 1e6 * remainder.amplitude, "length_mm": 1e3 * remainder.length},
            "remainder_by_chance": self.chance, "false_rate": FALSE_RATE,
            "noise": {"factor": self.sizes.noise, "shared_um": 1e6 * self.sizes.shared,
                      "smear_mm": 1e3 * self.sizes.smear},
            "held_out": self.held_out.as_dict() if self.held_out else None,
            "causes": self.asked.as_dict(),
        }

    def gone(self) -> dict[str, float]:
        """Share of the measured RMS that is gone with each part taken off too, one after the other, in the order of PARTS."""
        rest, shares = self.measured.copy(), {}
        size = max(rms(self.measured), 1e-30)
        for name in list(PARTS)[:-1]:
            rest = rest - self.parts[name]
            shares[name] = 1.0 - rms(rest) / size
        return shares

    def content(self) -> dict[str, Any]:
        """The content of learned.json: what `correct --learned` reads, with what it was made from."""
        made = {"cell": self.predicted.cell.source, "program": self.predicted.program.source,
                "stiffness": self.predicted.model.source, "forces": Path(self.predicted.forces.log.source),
                "points": Path(self.source), "logged_with": self.logged_with}
        named = {name: {"file": file.name, "sha256": sha256(file)} for name, file in made.items()
                 if file is not None and file.is_file()}
        told = {"compstiff": version("compstiff"), "settings": self.predicted.settings.as_dict(), "made_from": named,
                "figures": self.as_dict()}
        return learned_json(replace(self.learned, told=told), self.predicted.cell)

    def lines(self) -> list[str]:
        """What was learned, for the terminal."""
        return lines(self.as_dict())
