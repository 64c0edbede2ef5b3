"""Which mistake it is: named only where it is clearly better than every other one, and than what else may explain the rows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.common.command_line import call
from identification.common.findings import CompstiffError, Finding, Level
from identification.fit.held_out import left_out, poses
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.evidence import ORDINARY, ordinary
from identification.fit.mistakes.first_look import refuse_absurd
from identification.fit.mistakes.search import Candidate, Search, likeliest_at_a_glance, search
from identification.fit.mistakes.units import common_factor, time_mistake, unit_mistake, unit_of
from identification.fit.noise_parts import VarianceComponents
from identification.fit.posterior import Posterior, posterior

Array = NDArray[np.float64]
# Chi-squared a reading under the stated noise from which a misfit is gross: three times the stated noise.
GROSS = 9.0
# What a mistake must take away of what is beyond the noise: of a gross misfit, and of any.
NEARLY_ALL, MOST = 0.95, 0.9
# ln of how much likelier than the rows as they are a mistake must make them, one that is named before physics is tried, and one
# that only stands beside physics which is no likelier.
SUPPORT, SURE, BESIDE = 10.0, 30.0, 3.0
# ln of how much likelier than a rival a mistake must be to be named alone (20 to 1), and the physics.
RIVAL = 3.0
# A size is known when it is so many of its own standard deviations.
KNOWN = 4.0
# A chi-squared a reading no further above 1 is noise.
AT_THE_NOISE = 0.1


@dataclass(frozen=True, eq=False)
class NamedMistake:
    """A mistake that these rows may hold. probability: among the mistakes and what else was tried. support: ln of how much
    likelier the mended rows are. explained: share of the misfit beyond the noise. before, after [m]: RMS of every pose
    predicted from the others. tried: how many mistakes were."""

    candidate: Candidate
    probability: float
    support: float
    explained: float
    before: float
    after: float
    tried: int

    @property
    def key(self) -> str:
        """Its name in diagnosis.json."""
        return self.candidate.mistake.key

    @property
    def sentence(self) -> str:
        """In plain words, with the rows it holds for."""
        return self.candidate.mistake.sentence.format(rows=self._rows)

    @property
    def _rows(self) -> str:
        rows, where = self.candidate.data.rows, self.candidate.rows
        if where is None:
            return f"all {len(rows)} rows"
        numbers = rows.row[where]
        return f"rows {numbers.min()} to {numbers.max()}"

    def lines(self) -> list[str]:
        """The answer in plain words."""
        lines = [f"mistake in the {self.candidate.mistake.of}: {self.sentence}"]
        if self.support:
            gained = f"{1e6 * self.before:.2f} -> {1e6 * self.after:.2f} um RMS"
            lines.append(f"  every pose predicted from the others: {gained} with it mended; ln Bayes factor {self.support:.0f} "
                         f"against the files as they are, {self.tried} mistakes tried")
        return lines

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        candidate = self.candidate
        where = np.ones(len(candidate.data.rows), dtype=bool) if candidate.rows is None else candidate.rows
        numbers, size = candidate.data.rows.row[where], candidate.found
        return {
            "mistake": self.key, "of": candidate.mistake.of, "sentence": self.sentence, "probability": self.probability,
            "rows": int(where.sum()), "first_row": int(numbers.min()), "last_row": int(numbers.max()),
            "parameters": {name: {"estimate": value, "std": std, "unit": size.size.units}
                           for name, (value, std) in size.shown().items()} if size else {},
            "log_bayes_factor": self.support, "explained": self.explained, "tried": self.tried,
            "held_out_rms_um": [1e6 * self.before, 1e6 * self.after], "settles": candidate.mistake.settles,
        }


@dataclass(frozen=True, eq=False)
class Mistakes:
    """What the search for mistakes came to. sure: the one that is named whatever physics says; possible: those that may be it,
    the likeliest first, where physics is no likelier; slight: those that are not likely enough to be named, where there is none
    that is. found: the search itself, None where none was made."""

    found: Search | None = None
    possible: tuple[NamedMistake, ...] = ()
    sure: NamedMistake | None = None
    slight: tuple[NamedMistake, ...] = ()

    def against(self, physics: float, named: bool) -> tuple[NamedMistake, ...]:
        """Those left beside physics of this ln posterior: empty where physics is clearly likelier; slight ones only beside a
        physical cause that is named."""
        rivals = self.possible or (self.slight if named else ())
        best = max((self._log_posterior(each) for each in rivals), default=-np.inf)
        return rivals if best > physics - RIVAL else ()

    def clearly(self, physics: float) -> bool:
        """Whether one mistake is clearly likelier than physics."""
        return len(self.possible) == 1 and self._log_posterior(self.possible[0]) > physics + RIVAL

    @staticmethod
    def _log_posterior(named: NamedMistake) -> float:
        return named.candidate.log_posterior


class Mistaken(CompstiffError):
    """Rows that have no plain fit, with the mistake that does that."""

    def __init__(self, finding: Finding, mistake: NamedMistake) -> None:
        self.mistake = mistake
        super().__init__(finding)


def fitted_or_mistaken(data: LoadTest) -> Posterior:
    """The plain fit. Raises what `posterior` raises; Mistaken in place of CS1010, data that prefer all compliances negative,
    where it is clear which mistake does that; and CS1018 for readings in a unit that leaves nothing to fit."""
    try:
        fitted = posterior(data)
    except CompstiffError as refused:
        finding = refused.findings[0]
        mistake = _before_any_fit(data) if finding.code == "CS1010" else None
        if mistake is None:
            raise
        without = call("diagnose", data.cell.source, data.rows.source, "-o", "diagnosis.json", "--mend", "MENDED")
        raise Mistaken(replace(
            finding, message=f"{finding.message}; {mistake.sentence}",
            hint=f"{finding.hint}; check: {mistake.candidate.mistake.settles}; {without} writes the file without the mistake"),
            mistake) from None
    refuse_absurd(data)
    return fitted


def _before_any_fit(data: LoadTest) -> NamedMistake | None:
    """The mistake without which rows that have no plain fit have one; None where none is clear."""
    mistake = likeliest_at_a_glance(data)
    if mistake is None:
        return None
    try:
        mended = posterior(mistake.mended(data))
    except CompstiffError:
        return None
    held = left_out(mended, poses(mended.data.rows))
    return NamedMistake(Candidate(mistake, data, None, (mended,), 0.0, held), 1.0, 0.0, 0.0, np.nan, rms(held), 1)


def beyond_the_fit(plain: Posterior) -> NamedMistake | None:
    """A unit that the residual does not show: of all forces, all deflections or the times."""
    mistake, probability = unit_mistake(plain) or (time_mistake(plain.data), 1.0)
    if mistake is None:
        return None
    held = left_out(plain, poses(plain.data.rows))
    unseen = Candidate(mistake, plain.data, None, (plain,), 0.0, held)
    return NamedMistake(unseen, probability, 0.0, 0.0, rms(held), rms(held), 1)


def mistakes_in(plain: Posterior) -> Mistakes:
    """The mistakes that these rows may hold, without a look at physics."""
    found = search(plain)
    # Rows of two robots are named of a gross misfit alone; of any other they only stand beside what is named.
    if _is_gross(found.plain) or any(_named(found, each) for each in found.candidates):
        found = found.with_those_apart()
    good = [named for each in found.candidates if (named := _named(found, each)) is not None]
    if not good:
        return Mistakes(found, (), None, tuple(
            named for each in found.candidates if (named := _named(found, each, BESIDE)) is not None))
    best = good[0].candidate.log_posterior
    # One that is not good enough by itself still stands beside the best as its rival.
    rivals = [each for each in found.candidates if each.log_posterior > best + RIVAL]
    possible = () if rivals else tuple(each for each in good if each.candidate.log_posterior > best - RIVAL)
    sure = None
    if len(possible) == 1 and _is_gross(found.plain) and possible[0].candidate.found is None and len(
            possible[0].candidate.models) == 1 and possible[0].explained >= NEARLY_ALL and possible[0].support >= SURE and (
            not possible[0].candidate.mistake.like_physics):
        sure = possible[0]
    return Mistakes(found, possible, sure)


def _is_gross(plain: Posterior) -> bool:
    return plain.chi2 >= GROSS * plain.readings


def _named(found: Search, candidate: Candidate, enough: float = SUPPORT) -> NamedMistake | None:
    """The candidate with what speaks for it; None where that is not enough."""
    plain = found.plain
    support, size = candidate.log_posterior - found.log_evidence, candidate.found
    # Springs that change along the file may as well be gears that warm up: two robots differ by more.
    slight = len(candidate.models) > 1 and not _is_gross(plain)
    if support < enough or slight or (size is not None and (size.moved < 1 or size.sigmas < KNOWN)):
        return None
    explained = _explained(plain, candidate)
    held = left_out(plain, poses(plain.data.rows))
    before, after = rms(held), rms(candidate.left)
    if explained < MOST or after >= before:
        return None
    weight = np.array([other.log_posterior for other in found.candidates] + [found.log_evidence])
    probability = float(np.exp(candidate.log_posterior - np.logaddexp.reduce(weight)))
    return NamedMistake(candidate, probability, support, explained, before, after, found.tried)


def _explained(plain: Posterior, candidate: Candidate) -> float:
    """Share of the misfit beyond the noise that is gone in the mended rows; noise no larger than ordinary."""
    before = after = 0.0
    count = 0
    for model in candidate.models:
        components = model.components
        usual = ordinary(model)
        # A Student distribution's variance is more than its scale squared.
        heavier = 1.0 if np.isinf(components.degrees) else min(components.degrees / (components.degrees - 2.0), ORDINARY)
        before += _chi2(plain, model, usual) / heavier
        after += _chi2(model, model, usual) / heavier
        count += model.readings
    left = after / count - 1.0
    if left <= AT_THE_NOISE:
        return 1.0
    return 1.0 - left / max(before / count - 1.0, left)


def _chi2(fitted: Posterior, mended: Posterior, components: VarianceComponents) -> float:
    """Chi-squared of a fit's residual in the rows of the mended one, with its noise; where a mistake moves readings to another
    column, with the noise of the column that they stand in."""
    data = mended.data if fitted is mended else fitted.data
    own = np.isin(data.rows.row, mended.data.rows.row)
    moved = not np.array_equal(np.isnan(data.rows.deflection[own]), np.isnan(mended.data.rows.deflection))
    noise = (fitted if moved else mended).at_map.noise
    residual = np.nan_to_num(fitted.residual_of(data))
    whitened = np.einsum("nij,nj->ni", noise.whitening, residual[own])[:, :, None]
    return float(noise.weights(components).inner(whitened, whitened)[0, 0])


def mistake_finding(named: NamedMistake, source: str, level: Level) -> Finding:
    """The mistake as a finding (CS1700)."""
    return Finding("CS1700", level, named.sentence, file=source, hint=f"check: {named.candidate.mistake.settles}; compstiff "
                   "diagnose --mend writes the file without it")


def common_factor_findings(fitted: Posterior) -> list[Finding]:
    """A factor common to all joints against the prior that is no unit, or not likelier one than the robot's own (CS1702)."""
    found = common_factor(fitted)
    if found is None:
        return []
    unit = unit_of(found)
    looks = f", as they would with {unit.quantity}s {unit.words}" if unit else ""
    return [Finding("CS1702", "warning", f"all joints come out {found.words} than the prior's medians{looks}",
                    file=fitted.data.rows.source, hint="is it the right robot, and are forces in newton and deflections in "
                    "micrometres? If the robot really is so, state prior.stiffness_nm_per_rad in cell.yaml")]
