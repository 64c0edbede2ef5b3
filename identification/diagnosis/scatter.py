"""Causes that are scatter: they displace nothing in the mean, are allowed for in the noise of the rows, and nothing is carried
on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior
from identification.model.effects import Effect


@dataclass(frozen=True)
class Scatter(ABC):
    """size: 1 sigma, in the unit of the effect's parameter; log_std: of its ln. p_value: of so much by chance. largest [m]: 1
    sigma of what it moves a reading by at most."""

    size: float
    log_std: float
    p_value: float
    largest: float

    effect: ClassVar[Effect]
    # The finding, the rows that count for less, and the headline.
    code: ClassVar[str]
    rows: ClassVar[str]
    short: ClassVar[str]

    @property
    @abstractmethod
    def sentence(self) -> str:
        """In plain words."""

    @abstractmethod
    def allowed_for(self, data: LoadTest, fitted: Posterior) -> LoadTest:
        """The same rows with that in their noise."""

    @property
    def line(self) -> str:
        """As an answer."""
        return f"{self.sentence} (up to {1e6 * self.largest:.0f} um, 1 sigma; it is scatter, and nothing is carried on)"

    def as_dict(self) -> dict[str, Any]:
        """A cause of diagnosis.json."""
        (parameter,) = self.effect.parameters
        return {"effect": self.effect.name, "joint": None, "probability": 1.0 - self.p_value, "family": self.effect.family,
                "of_robot": False, "sentence": self.sentence, "parameters": {parameter.name: {
                    "estimate": self.size, "std": self.size * self.log_std, "unit": parameter.unit}},
                "largest_um": 1e6 * self.largest}
