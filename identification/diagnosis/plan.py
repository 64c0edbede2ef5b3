"""What a plan could and could not tell, before anything is measured (docs/effects.md, `--plan`).

With the stated noise and the prior's stiffnesses, an effect of size a (in typical sizes) gives a noncentrality `a sqrt(G)` once
the stiffnesses are free. It is found with a probability of 80 % where that is the family-wise critical value plus 0.84, and
told from another effect where as much is left when that one is free too (with any shape of its own).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.dictionary import Dictionary, Entry, dictionary
from identification.diagnosis.projection import Base
from identification.diagnosis.search import base_at
from identification.fit.fitted_model import situation_of
from identification.fit.noise import NoiseSize, noise_model
from identification.fit.priors import PriorModel
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import Effect, effects

Array = NDArray[np.float64]
ALARM = 0.05
POWER_80 = 0.8416
# Places of a step are tried up to so many, evenly over the plan.
MOST_PLACES = 12


@dataclass(frozen=True, eq=False)
class Outlook:
    """What the plan can say of one effect. detectable, identifiable: smallest size [typical sizes] that is found, and that is
    told from every other effect, with 80 % probability. alike: effects it cannot be told from at its typical size.
    parameter: the one that the sizes are of, typical: its typical size [unit]."""

    entry: Entry
    detectable: float
    identifiable: float
    alike: tuple[str, ...]
    parameter: str
    typical: float
    unit: str

    @property
    def grade(self) -> str:
        """identifiable, detectable (something is wrong, but not what) or invisible, at the typical size."""
        return "identifiable" if self.identifiable <= 1 else "detectable" if self.detectable <= 1 else "invisible"

    def as_dict(self) -> dict[str, Any]:
        """JSON values; sizes beyond 1e6 typical ones are null."""
        def size(value: float, of: float = 1.0) -> float | None:
            return value * of if value < 1e6 else None

        return {"effect": self.entry.effect.name, "joint": self.entry.joint, "grade": self.grade,
                "minimal_detectable_typical_sizes": size(self.detectable),
                "minimal_identifiable_typical_sizes": size(self.identifiable), "parameter": self.parameter,
                "unit": self.unit, "typical": self.typical, "minimal_detectable": size(self.detectable, self.typical),
                "minimal_identifiable": size(self.identifiable, self.typical), "alike": list(self.alike),
                "settles": self.entry.effect.settles}


def outlook(cell: Cell, rows: Measurements, catalogue: dict[str, Effect] | None = None) -> tuple[list[Outlook], dict[str, str]]:
    """What these planned rows can say of every effect; and the effects they cannot show at all, with the reason."""
    from scipy.stats import norm

    catalogue = effects() if catalogue is None else catalogue
    start = -np.log(cell.prior.stiffness)
    planned = _as_if_measured(rows)
    noise = noise_model(cell, planned, np.exp(start))
    where = situation_of(cell, planned, np.exp(start))
    words = dictionary(where, noise, catalogue)
    base = base_at(cell, planned, PriorModel(cell.prior), start, noise, noise.weights(NoiseSize()))
    gram, slices = _gram(base, words)
    needed = float(norm.isf(ALARM / 2 / len(words.entries))) + POWER_80
    found = []
    for k, entry in enumerate(words.entries):
        own = [slices[s] for s in entry.signatures if s in slices]
        # The shape in the middle of the range: not the easiest, not the hardest.
        by_strength = sorted(own, key=lambda one: _weakest(gram[one, one]))
        mine = by_strength[len(by_strength) // 2]
        detectable = needed / _weakest(gram[mine, mine])
        left = {other.label: min(_left(gram, mine, slices[s]) for s in other.signatures if s in slices)
                for j, other in enumerate(words.entries) if j != k}
        worst = min(left.values(), default=np.inf)
        alike = tuple(label for label, value in sorted(left.items(), key=lambda item: item[1])
                      if needed / max(value, 1e-12) > max(1.0, detectable))
        identifiable = max(detectable, needed / max(worst, 1e-12))
        size = next(p for p in entry.effect.parameters if not p.shape)
        found.append(Outlook(entry, detectable, identifiable, alike[:6] if detectable <= 1 else (), size.name, size.typical,
                             size.unit))
    return found, words.left_out


def _as_if_measured(rows: Measurements) -> Measurements:
    """The rows with a reading in every component: a plan leaves them empty."""
    from dataclasses import replace

    return replace(rows, deflection=np.zeros_like(rows.deflection))


def _gram(base: Base, words: Dictionary) -> tuple[Array, dict[int, slice]]:
    """Information of all signatures together, and where each stands in it; of an effect with very many, some."""
    kept: list[int] = []
    for entry in words.entries:
        members = np.arange(entry.signatures.start, entry.signatures.stop)
        if len(members) > MOST_PLACES:
            members = members[np.linspace(0, len(members) - 1, MOST_PLACES).astype(int)]
        kept += members.tolist()
    slices, columns, place = {}, [], 0
    for s in kept:
        width = int(words.widths[s])
        slices[s] = slice(place, place + width)
        columns.append(words.columns[:, :, s, :width])
        place += width
    return base.gram(np.concatenate(columns, axis=2)), slices


def _weakest(information: Array) -> float:
    """Root of the typical information of a block: what an effect of unit size in an average direction gives."""
    return float(np.sqrt(max(np.trace(information) / len(information), 1e-12)))


def _left(gram: Array, mine: slice, other: slice) -> float:
    """The same once the other block is free."""
    cross = gram[mine, other]
    free = gram[other, other] + 1e-9 * (np.trace(gram[other, other]) + 1e-12) * np.eye(other.stop - other.start)
    return _weakest(gram[mine, mine] - cross @ np.linalg.solve(free, cross.T))


def shown_size(one: Outlook, size: float) -> str:
    """A size [typical sizes] in the unit of the effect's parameter; never, where it is beyond a thousand typical ones."""
    return f"{size * one.typical:.2g}" if size < 1e3 else "never"


def not_told_apart(found: Iterable[Outlook]) -> list[str]:
    """Effects that would be noticed at their typical size and not be told from others, in words."""
    return [f"{one.entry.label} from {', '.join(one.alike)}" for one in found if one.alike]


def plan_lines(found: list[Outlook], left_out: dict[str, str]) -> list[str]:
    """The outlook in plain words."""
    lines = [f"{'effect':<28}{'found from':>12}{'named from':>12}{'typical':>10}"]
    for one in found:
        sizes = "".join(f"{shown_size(one, value):>12}" for value in (one.detectable, one.identifiable))
        alike = f"  like {', '.join(one.alike[:3])}" if one.alike else ""
        lines.append(f"{one.entry.label:<28}{sizes}{one.typical:>10.2g} {one.unit if one.unit != '1' else '':<11} "
                     f"{one.grade}{alike}".rstrip())
    counts = {grade: sum(one.grade == grade for one in found) for grade in ("identifiable", "detectable", "invisible")}
    lines.append(f"of {len(found)} possible causes at their typical size this plan names {counts['identifiable']}, only "
                 f"notices {counts['detectable']} and misses {counts['invisible']}")
    lines += [f"{name} cannot show: {why}" for name, why in left_out.items()]
    return lines
