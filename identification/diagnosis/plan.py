"""What a plan could and could not tell, before anything is measured (docs/effects.md, `--plan`).

With the stated noise and the prior's stiffnesses, an effect is found from the size on that `diagnose` will say it would have
noticed (power.py). It is told from another effect, with the same probability, where a family-wise critical value plus 0.84 is
left of its distance from the springs when that one is free too, with any shape of its own; of several parameters in all but the
worst fifth of the directions.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding
from identification.common.quantities import cause_words, readable_unit, two_places
from identification.common.tails import normal_above
from identification.diagnosis.dictionary import Dictionary, Entry, dictionary_of
from identification.diagnosis.power import NEVER, POWER, in_the_middle, noticed_from, weakest
from identification.diagnosis.projection import PRIOR_SIZES, Base
from identification.diagnosis.replicates import FittedNoise
from identification.diagnosis.search import base_at
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel, noise_model
from identification.fit.noise_parts import VarianceComponents
from identification.fit.planned_noise import planned_covariance
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import Effect, effects
from identification.model.effects_in_force import SPRINGS

Array = NDArray[np.float64]
ALARM = 0.05
# Places of a step are tried up to so many, evenly over the plan.
MOST_PLACES = 12
# So many effects that look alike are listed.
MOST_ALIKE = 6
GRADES = ("identifiable", "detectable", "invisible")
FORMAT = "compstiff-diagnosis-plan"


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

    def shown(self, size: float) -> str:
        """A size [typical sizes] in the unit of the parameter; never, where it is beyond a thousand typical ones."""
        return two_places(size * self.typical / self.read_in[0]) if size < NEVER else "never"

    @property
    def read_in(self) -> tuple[float, str]:
        """What sizes are divided by to be read, and the unit they are in then."""
        return readable_unit(self.typical, self.unit)

    def as_dict(self) -> dict[str, Any]:
        """JSON values; sizes beyond a thousand typical ones are null."""
        def size(value: float, of: float = 1.0) -> float | None:
            return value * of if value < NEVER else None

        return {"effect": self.entry.effect.name, "joint": self.entry.joint, "grade": self.grade,
                "minimal_detectable_typical_sizes": size(self.detectable),
                "minimal_identifiable_typical_sizes": size(self.identifiable), "parameter": self.parameter,
                "unit": self.unit, "typical": self.typical, "minimal_detectable": size(self.detectable, self.typical),
                "minimal_identifiable": size(self.identifiable, self.typical), "alike": list(self.alike),
                "settles": self.entry.effect.settles}


@dataclass(frozen=True, eq=False)
class PlanOutlook:
    """What a plan can say of every effect; left_out: effects it cannot show at all, and why."""

    effects: tuple[Outlook, ...]
    left_out: dict[str, str]
    findings: tuple[Finding, ...]

    @property
    def counts(self) -> dict[str, int]:
        """How many effects are identifiable, detectable, invisible at their typical size."""
        return {grade: sum(outlook.grade == grade for outlook in self.effects) for grade in GRADES}

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"format": FORMAT, "version": 1, "effects": [outlook.as_dict() for outlook in self.effects],
                "not_offered": self.left_out}

    def lines(self) -> list[str]:
        """A line an effect, and how many of each grade."""
        lines = [f"{'effect':<28}{'found from':>12}{'named from':>12}{'typical':>10}"]
        for outlook in self.effects:
            sizes = "".join(f"{outlook.shown(size):>12}" for size in (outlook.detectable, outlook.identifiable))
            alike = f"  like {', '.join(map(cause_words, outlook.alike[:3]))}" if outlook.alike else ""
            lines.append(f"{cause_words(outlook.entry.label):<28}{sizes}{outlook.shown(1.0):>10} "
                         f"{outlook.read_in[1]:<12} {outlook.grade}{alike}".rstrip())
        counts = self.counts
        lines.append(f"of {len(self.effects)} possible causes at their typical size this plan names {counts['identifiable']}, "
                     f"only notices {counts['detectable']} and misses {counts['invisible']}")
        return lines + [f"{name} cannot show: {why}" for name, why in self.left_out.items()]


def judge_plan(cell: Cell, planned: Measurements) -> PlanOutlook:
    """What planned rows, validate rows left aside, can say of every effect at the prior's stiffnesses.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> planned = compstiff.read_measurements("measurements.csv", cell.robot, planned=True)
    >>> outlook = compstiff.judge_plan(cell, planned)
    >>> len(outlook.as_dict()["effects"]) > 40
    True
    """
    data, log_compliance = _planned(cell, planned), -np.log(cell.prior.stiffness)
    base, dictionary, noise = _linearised(data, log_compliance, effects())
    known = FittedNoise(noise, VarianceComponents(), planned_covariance(data, log_compliance, noise, base.design),
                        np.ones(len(data.rows)))
    shown = noticed_from(base, dictionary, dictionary.entries, known, -float(np.log10(ALARM / len(dictionary.entries))))
    gram, slices = _gram(base, dictionary)
    freed = _freed(gram, slices)
    needed = normal_above(ALARM / 2 / len(dictionary.entries)) + normal_above(1 - POWER)
    outlooks = tuple(_outlook(dictionary, k, each.size, gram, slices, freed, needed) for k, each in enumerate(shown))
    return PlanOutlook(outlooks, dictionary.left_out, planned.findings)


@dataclass(frozen=True, eq=False)
class VisitInformation:
    """What single visits tell of everything at once. of (V, m, m): information of each visit about the six ln c, then the
    coefficients of the causes, `labels`, in typical sizes; prior (m, m): what is known of them before."""

    of: Array
    prior: Array
    labels: tuple[str, ...]


def visit_information(cell: Cell, planned: Measurements, log_compliance: Array) -> VisitInformation:
    """Of planned rows, the arm linearised at ln c (6,). Of a cause with several shapes the one in the middle of the range.
    Causes that are bound to a place in the table, or go with the time that it took, are left out: they hang on the order of the
    visits."""
    catalogue = {name: effect for name, effect in effects().items() if not effect.where and not effect.unsettles}
    data = _planned(cell, planned)
    base, dictionary, _ = _linearised(data, log_compliance, catalogue)
    columns, labels = [base.design], []
    for entry in dictionary.entries:
        shapes = dictionary.unweighed(entry)
        strength = [np.sum(dictionary.of(shape) ** 2) for shape in shapes]
        middle = shapes[int(np.argsort(strength)[len(shapes) // 2])]
        columns.append(dictionary.of(middle))
        labels += [entry.label] * int(dictionary.widths[middle])
    stacked = np.concatenate(columns, axis=2)
    weighted = base.weights.apply(stacked)
    _, first = np.unique(data.rows.visit, return_index=True)
    # Rows of a visit stand together; visits share no error.
    of = np.stack([np.einsum("nap,naq->pq", mine, its) for mine, its in zip(
        np.split(stacked, first[1:]), np.split(weighted, first[1:]), strict=True)])
    prior = np.eye(stacked.shape[2]) / PRIOR_SIZES**2
    prior[SPRINGS, SPRINGS] = base.precision
    return VisitInformation(of, prior, tuple(labels))


def _planned(cell: Cell, planned: Measurements) -> LoadTest:
    """The planned rows with a reading in every component, validate rows left aside: a plan leaves the readings empty."""
    rows = planned.select(~planned.validate)
    return LoadTest.of(cell, replace(rows, deflection=np.zeros_like(rows.deflection)))


def _linearised(
    data: LoadTest, log_compliance: Array, catalogue: dict[str, Effect]
) -> tuple[Base, Dictionary, NoiseModel]:
    """The plain model at ln c (6,) and the dictionary, as planned rows would show them, in their stated noise."""
    noise, state = noise_model(data, np.exp(log_compliance)), data.load_state(np.exp(log_compliance))
    base = base_at(data, log_compliance, noise, noise.weights(VarianceComponents()))
    return base, dictionary_of(state, noise, catalogue), noise


def _outlook(
    dictionary: Dictionary, number: int, detectable: float, gram: Array, slices: dict[int, slice], freed: list[_Freed],
    needed: float,
) -> Outlook:
    """Of one entry; detectable: its smallest size that is found; freed: all signatures; needed: the
    distance at which it is told from others."""
    entry = dictionary.entries[number]
    own = [s for s in entry.signatures if s in slices]
    mine = slices[in_the_middle({s: float(weakest(gram[slices[s], slices[s]])) for s in own})]
    beside = _left(gram, mine, freed)
    left = {other.label: min(beside[s] for s in other.signatures if s in slices)
            for k, other in enumerate(dictionary.entries) if k != number}
    worst = min(left.values(), default=np.inf)
    alike = tuple(label for label, value in sorted(left.items(), key=lambda item: item[1])
                  if needed / max(value, 1e-12) > max(1.0, detectable))
    parameter = entry.effect.size_parameter
    return Outlook(entry, detectable, max(detectable, needed / max(worst, 1e-12)),
                   alike[:MOST_ALIKE] if detectable <= 1 else (), parameter.name,
                   dictionary.amplitude(entry.signatures.start), parameter.unit)


def _gram(base: Base, dictionary: Dictionary) -> tuple[Array, dict[int, slice]]:
    """Information of all signatures together, and where each stands in it; of an effect with very many, some."""
    kept: list[int] = []
    for entry in dictionary.entries:
        members = np.array(dictionary.unweighed(entry))
        if len(members) > MOST_PLACES:
            members = members[np.linspace(0, len(members) - 1, MOST_PLACES).astype(int)]
        kept += members.tolist()
    slices, place = {}, 0
    for s in kept:
        width = int(dictionary.widths[s])
        slices[s] = slice(place, place + width)
        place += width
    return base.gram(dictionary.of(*kept)), slices


@dataclass(frozen=True, eq=False)
class _Freed:
    """Signatures (S,) of one width p: where they stand in the information of all (S, p), and the inverse (S, p, p) of their
    own, of one that shows nothing too."""

    signatures: list[int]
    places: NDArray[np.intp]
    inverse: Array


def _freed(gram: Array, slices: dict[int, slice]) -> list[_Freed]:
    """All signatures, those of one width together."""
    found = []
    for width in sorted({place.stop - place.start for place in slices.values()}):
        alike = [s for s, place in slices.items() if place.stop - place.start == width]
        places = np.array([slices[s].start for s in alike])[:, None] + np.arange(width)
        own = gram[places[:, :, None], places[:, None, :]]
        ridge = 1e-9 * (np.trace(own, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(width)
        found.append(_Freed(alike, places, np.asarray(np.linalg.inv(own + ridge), dtype=float)))
    return found


def _left(gram: Array, mine: slice, freed: list[_Freed]) -> dict[int, float]:
    """What a cause of unit size gives (`weakest`) once each signature is free beside it."""
    left: dict[int, float] = {}
    for each in freed:
        cross = gram[mine][:, each.places].swapaxes(0, 1)
        values = weakest(gram[mine, mine] - cross @ each.inverse @ cross.swapaxes(1, 2))
        left |= dict(zip(each.signatures, values.tolist(), strict=True))
    return left


def not_told_apart(outlooks: Iterable[Outlook]) -> list[str]:
    """Effects that would be noticed at their typical size and not be told from others, in words."""
    return [f"{cause_words(outlook.entry.label)} from {', '.join(map(cause_words, outlook.alike))}"
            for outlook in outlooks if outlook.alike]
