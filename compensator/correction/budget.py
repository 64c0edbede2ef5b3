"""The error budget of a program before it is milled: what spends the tolerance, which places will fail, what would help.

What is expected to be left on the part after a correction (expected_left.py), twice its sigma, is held against the largest
deviation that is accepted. A place fails where two sigma are over it: by the causes that are known, one part in twenty would.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correct import Corrected, correct
from compensator.correction.expected_left import CAUSES
from compensator.correction.predict import Predicted
from compensator.correction.remedies import Remedy, remedies
from identification.common.arrays import rms
from identification.common.findings import Finding, counted, verb
from identification.model.controller import check_rapid

Array = NDArray[np.float64]
SIGMAS = 2.0
# Runs of failing targets that are no farther apart than this belong to one place [targets].
NEAR = 3
# So many places are named by the terminal, and a remedy that gains less is not worth a line [m].
NAMED, LEAST_GAIN = 5, 0.05e-6
# Between these tolerances [m] robots mill: below a robot's own repeatability lies far less, above it a hand would do.
FINEST, COARSEST = 1e-6, 5e-3


@dataclass(frozen=True)
class Place:
    """Targets one after the other that are expected to fail: lines of the program first and last, how many targets, the largest
    two sigma [m] among them, and its main cause."""

    first_line: int
    last_line: int
    targets: int
    two_sigma: float
    cause: str

    def words(self) -> str:
        """For people."""
        lines = f"s {self.first_line} to {self.last_line}" if self.first_line < self.last_line else f" {self.first_line}"
        return f"line{lines}: up to {1e6 * self.two_sigma:.0f} um, mostly {CAUSES[self.cause]}"


@dataclass(frozen=True, eq=False)
class Budget:
    """corrected: the program as `correct` would write it; tolerance [m]; places: where it fails; remedies: by what they gain,
    the most first."""

    corrected: Corrected
    tolerance: float
    places: tuple[Place, ...]
    remedies: tuple[Remedy, ...]
    findings: tuple[Finding, ...]

    @property
    def two_sigma(self) -> Array:
        """(M,) [m] at the corrected targets."""
        return SIGMAS * self.corrected.left.std

    def as_dict(self) -> dict[str, Any]:
        """JSON values, micrometres."""
        left, two = self.corrected.left, self.two_sigma
        uncorrected = np.linalg.norm(self.corrected.predicted.prediction.at_rest, axis=1)
        square = max(float(np.mean(left.std**2)) if len(two) else 0.0, 1e-300)
        return {
            "tolerance_um": 1e6 * self.tolerance,
            "targets": len(two),
            "uncorrected_over": int((uncorrected > self.tolerance).sum()),
            "over": int((two > self.tolerance).sum()),
            "two_sigma_um": _figures(two),
            "causes": {cause: {
                "two_sigma_um": _figures(SIGMAS * getattr(left, cause)),
                "share_of_tolerance": float(SIGMAS * _rms(getattr(left, cause)) / self.tolerance),
                "share_of_square": _rms(getattr(left, cause)) ** 2 / square} for cause in CAUSES},
            "places": [{"first_line": place.first_line, "last_line": place.last_line, "targets": place.targets,
                        "two_sigma_um": 1e6 * place.two_sigma, "cause": place.cause} for place in self.places],
            "remedies": [{"do": remedy.name, "effort": remedy.effort, "gain_um": 1e6 * self.gain(remedy),
                          "two_sigma_um": _figures(SIGMAS * remedy.left),
                          "over": int((SIGMAS * remedy.left > self.tolerance).sum())} for remedy in self.remedies],
        }

    def gain(self, remedy: Remedy) -> float:
        """By how much a remedy lowers the RMS of two sigma [m]."""
        return SIGMAS * (_rms(self.corrected.left.std) - _rms(remedy.left))

    def lines(self) -> list[str]:
        """For the terminal."""
        figures = self.as_dict()
        two = figures["two_sigma_um"]
        text = [f"error budget for {figures['tolerance_um']:g} um: uncorrected {figures['uncorrected_over']} of "
                f"{counted(figures['targets'], 'target')} over it; corrected, two sigma are {two['rms']:.1f} um RMS, "
                f"{two['largest']:.1f} um at most, and {figures['over']} over it"]
        text += [f"  {CAUSES[cause]}: {100 * of['share_of_tolerance']:.1f} % of the tolerance (two sigma "
                 f"{of['two_sigma_um']['rms']:.1f} um RMS, {of['two_sigma_um']['largest']:.1f} um at most)"
                 for cause, of in sorted(figures["causes"].items(), key=lambda item: -item[1]["share_of_tolerance"])
                 if of["two_sigma_um"]["largest"]]
        text += [f"  may fail at {place.words()}" for place in self.places[:NAMED]]
        if len(self.places) > NAMED:
            text.append(f"  and at {counted(len(self.places) - NAMED, 'more place')} (--json, --report)")
        text += [f"  gains {remedy['gain_um']:.1f} um of {two['rms']:.1f} (then {remedy['over']} over): {remedy['do']} "
                 f"[{remedy['effort']}]" for remedy in figures["remedies"]]
        return text


def error_budget(predicted: Predicted, tolerance: float) -> Budget:
    """What a tolerance [m], the largest deviation that is accepted, is spent on. Raises what `correct` raises.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program, model = compstiff.read_toolpath("insert.mod", cell), compstiff.read_stiffness("stiffness.json", cell)
    >>> predicted = compstiff.predict(cell, program, model, "insert.forces.parquet", compstiff.Settings.of(tare=((0, 2),)))
    >>> budget = compstiff.error_budget(predicted, 200e-6)
    >>> budget.as_dict()["uncorrected_over"] > 1000, len(budget.remedies) > 3
    (True, True)
    """
    check_rapid(predicted.path.cell.robot, "an error budget is that of a corrected RAPID program")
    corrected = correct(predicted)
    budget = Budget(corrected, tolerance, _places(corrected, tolerance), (), ())
    found = remedies(corrected) if len(corrected.left.model) else []
    worth = sorted((remedy for remedy in found if budget.gain(remedy) > LEAST_GAIN), key=budget.gain, reverse=True)
    over = int((budget.two_sigma > tolerance).sum())
    findings = said_of_tolerance(tolerance, predicted.path.toolpath.source)
    findings += () if not over else (Finding(
        "CS3205", "warning", f"{over} of {counted(len(budget.two_sigma), 'target')} {verb(over, 'are')} expected over the "
        f"tolerance of {1e6 * tolerance:g} um: two sigma are up to {1e6 * budget.two_sigma.max():.0f} um there",
        file=predicted.path.toolpath.source, line=budget.places[0].first_line,
        hint=f"{worth[0].name}: gains {1e6 * budget.gain(worth[0]):.1f} um" if worth else ""),)
    return Budget(corrected, tolerance, budget.places, tuple(worth), findings)


def _places(corrected: Corrected, tolerance: float) -> tuple[Place, ...]:
    """The worst first; lines are those of the program as given."""
    left, kept, given = corrected.left, corrected.kept, corrected.planned.path.toolpath
    two = SIGMAS * left.std
    over = np.flatnonzero(two > tolerance)
    if not len(over):
        return ()
    causes = np.array([getattr(left, cause) for cause in CAUSES])
    at = corrected.predicted.targets[over]
    line = given.line[np.searchsorted(kept, at)]
    found = []
    for run in np.split(np.arange(len(over)), np.flatnonzero(np.diff(at) > NEAR) + 1):
        worst = over[run[np.argmax(two[over[run]])]]
        found.append(Place(int(line[run].min()), int(line[run].max()), len(run), float(two[worst]),
                           list(CAUSES)[int(np.argmax(causes[:, worst]))]))
    return tuple(sorted(found, key=lambda place: -place.two_sigma))


def _rms(values: Array) -> float:
    return rms(values) if len(values) else 0.0


def _figures(values: Array) -> dict[str, float]:
    return {"rms": 1e6 * _rms(values), "largest": 1e6 * float(values.max(initial=0.0))}


def said_of_tolerance(tolerance: float, source: str) -> tuple[Finding, ...]:
    """A warning (CS3206) for one [m] that nobody mills to."""
    if FINEST <= tolerance <= COARSEST:
        return ()
    return (Finding("CS3206", "warning", f"the tolerance is {1e6 * tolerance:g} um, {1e3 * tolerance:g} mm: robots mill to "
                    f"{1e6 * FINEST:g} to {1e6 * COARSEST:g} um", file=source, hint="--tolerance-um is in micrometres"),)
