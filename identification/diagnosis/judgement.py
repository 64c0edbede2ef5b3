"""Judgement: what the procedure makes of the rows; the record, the report and the model to correct with come from it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.diagnosis.blocks import Thinning
from identification.diagnosis.detect import Detection
from identification.diagnosis.discrimination import NextLoad
from identification.diagnosis.gain import Gain
from identification.diagnosis.gross import BadRow
from identification.diagnosis.power import Showing
from identification.diagnosis.scatter import Scatter
from identification.diagnosis.share import Share
from identification.fit.mending import BadVisit
from identification.fit.mistakes.judge import NamedMistake
from identification.fit.noise import residual_std
from identification.fit.posterior import Posterior
from identification.fit.subsets import Conflict, subset_conflicts
from identification.fit.validation import Validation
from identification.fit.visits import VisitTest
from identification.measurements import Measurements
from identification.model.effects_in_force import EffectInForce

Array = NDArray[np.float64]
# Of the readings that were left out so many poses and rows are told by name.
MOST_NAMED = 4
# What a choice makes of a correction is small under such a share of the deflections that were measured.
SMALL_CHOICE = 0.02
# What would not show at so many times its typical size (force_gain never does) is no matter of some further rows.
FAR = 10.0
Verdict = Literal["adequate", "named", "ambiguous", "unknown", "mistake"]


@dataclass(frozen=True, eq=False)
class Cause(EffectInForce):
    """One effect with its probability (of being at work, alone or with others; where other laws of the same gear do as well,
    of any of them). open_laws: those, by name, with their probabilities."""

    probability: float
    open_laws: dict[str, float] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        """The cause in plain words."""
        if self.open_laws:
            return self.effect.law_family.format(joint=self.joint)
        return super().sentence


@dataclass(frozen=True, eq=False)
class Rival:
    """A set of causes that explains the rows as well, fitted, and how likely it is."""

    fitted: Posterior
    probability: float


@dataclass(frozen=True, eq=False)
class Judgement:
    """What is wrong. plain: the fit without effects; extended: with the likeliest ones (the plain fit where none was
    found). detection: of the plain model, adequacy: of the extended one. causes, alternatives: see
    docs/formats.md#diagnose. companions: what the extended model has beside the causes without a name: small, yet of use on
    rows that were not fitted. scatter: parts of the noise that outgrow what was stated. patterns: what is seen of an
    unknown cause. robot_difference: by how much [m, RMS] the rivals (or the laws that a cause leaves open) differ in what
    the robot does under the largest load, None where nothing is open. left_out: effects these rows cannot show, and why.
    law_differs: the causes explain nearly all of the misfit, and what is left is still more than noise. withdrawn: names
    that were all but given, and what spoke against each. log_odds: ln odds of the named model, or of the likeliest of an
    ambiguous answer, against the plain one, all parameters and the noise's sizes integrated out. lost: sets whose fit
    did not converge, which are no candidates. bad_rows: not among `rows`. thinning: how the rows of machined passes were
    averaged. share: how many of the rows were looked at, None: all. carried: the extended model with the laws of its
    effects free within what real ones differ by, or of an ambiguous answer the likeliest candidate so, None where there is
    neither: it is the one to use; rivals: the other candidates. scatters: of weights that hang, or of zero readings, found in
    what the model leaves and allowed for in the rows' noise. tried: where nothing is named, the likeliest causes, fitted.
    visits: whether single visits fit the others; bad_visits: those that do not, not among `rows`; suspects: those that a
    sensor named for their pose explains as well. validation: the outliers among the validate rows. mistakes: those of the
    table or the cell file: the one where the verdict is one, else rivals of the alternatives. showing: where six springs, or
    they and what is named, are enough, from which size on each other cause would have been noticed."""

    verdict: Verdict
    plain: Posterior
    extended: Posterior
    detection: Detection
    adequacy: Detection | None = None
    causes: tuple[Cause, ...] = ()
    companions: tuple[Cause, ...] = ()
    alternatives: tuple[Cause, ...] = ()
    gain: Gain | None = None
    next_loads: tuple[NextLoad, ...] = ()
    robot_difference: float | None = None
    scatter: dict[str, float] = field(default_factory=dict)
    patterns: tuple[str, ...] = ()
    left_out: dict[str, str] = field(default_factory=dict)
    withdrawn: dict[str, str] = field(default_factory=dict)
    log_odds: float | None = None
    lost: tuple[str, ...] = ()
    law_differs: bool = False
    bad_rows: tuple[BadRow, ...] = ()
    thinning: Thinning | None = None
    share: Share | None = None
    carried: Posterior | None = None
    rivals: tuple[Rival, ...] = ()
    scatters: tuple[Scatter, ...] = ()
    tried: Posterior | None = None
    visits: VisitTest | None = None
    bad_visits: tuple[BadVisit, ...] = ()
    suspects: tuple[BadVisit, ...] = ()
    validation: Validation | None = None
    mistakes: tuple[NamedMistake, ...] = ()
    showing: tuple[Showing, ...] = ()

    def __post_init__(self) -> None:
        """Refuses (ValueError) a verdict whose names contradict it: no such answer may leave the program."""
        left_out = bool(self.bad_rows or self.bad_visits or self.scatters)
        few = len({cause.label for cause in self.alternatives}) + len(self.mistakes) < 2
        contradicts = {
            "adequate": bool(self.causes or self.alternatives or self.withdrawn or self.gain or self.mistakes) or left_out,
            "named": not (self.causes or left_out) or bool(self.withdrawn or self.mistakes) or (
                bool(self.causes) and self.gain is None),
            "ambiguous": bool(self.causes or self.withdrawn) or few,
            "unknown": bool(self.causes or self.mistakes) or self.extended is not self.plain,
            "mistake": bool(self.causes or self.alternatives or self.withdrawn) or not self.mistakes,
        }[self.verdict]
        given = [cause.label for cause in (*self.causes, *self.companions)]
        contradicts |= bool(self.companions) and not self.causes
        doubled = len(set(given)) < len(given) or set(given) & {cause.label for cause in self.alternatives}
        if contradicts or doubled:
            others = [cause.label for cause in self.alternatives]
            raise ValueError(f"{self.verdict} with causes {given}, alternatives {others}, withdrawn {list(self.withdrawn)}, "
                             f"{len(self.bad_rows)} bad rows, {len(self.bad_visits)} bad visits, {len(self.mistakes)} "
                             f"mistakes, gain {self.gain}")

    def as_unknown(self, patterns: tuple[str, ...]) -> Judgement:
        """The judgement without its names, which are the nearest ones then; patterns: what is seen of the cause."""
        return replace(self, verdict="unknown", extended=self.plain, causes=(), companions=(), gain=None, next_loads=(),
                       alternatives=(*self.causes, *self.companions, *self.alternatives), robot_difference=None, withdrawn={},
                       log_odds=None, law_differs=False, carried=None, rivals=(), mistakes=(), patterns=patterns,
                       tried=self.extended)

    @property
    def dropped(self) -> tuple[str, int]:
        """Which readings do not fit the others and are not among `rows`, in words, and how many; the first few of many."""
        named = [f"the {'reading' if len(bad.score.rows) == 1 else f'{len(bad.score.rows)} readings'} of {bad.score.name}"
                 for bad in self.bad_visits]
        named += [f"row {bad.row}" for bad in self.bad_rows]
        count = sum(len(bad.score.rows) for bad in self.bad_visits) + len(self.bad_rows)
        return ", ".join(named[:MOST_NAMED]) + (f" and {len(named) - MOST_NAMED} more" if named[MOST_NAMED:] else ""), count

    @property
    def overlooked(self) -> tuple[Showing, ...]:
        """Of `showing`: the causes that would not have been noticed at their typical size, what moves the tool most first; last
        what other loads would hardly show either."""
        return tuple(sorted((each for each in self.showing if not each.of_typical_size),
                            key=lambda each: (each.size > FAR, -each.typical_largest)))

    @property
    def unsettled(self) -> bool:
        """Whether the springs changed while they were measured, or may have, so that those told are not the ones to mill
        with."""
        models = (self.extended, *(rival.fitted for rival in self.rivals), *((self.carried,) if self.carried else ()))
        return any(term.effect.unsettles for model in models for term in model.terms)

    @property
    def choice_is_small(self) -> bool:
        """Whether it is open which of several causes it is, and a correction need hardly know: whatever it is, the robot does
        nearly the same."""
        if self.carried is None or self.unsettled or self.mistakes or self.robot_difference is None:
            return False
        return self.verdict == "ambiguous" and self.robot_difference < SMALL_CHOICE * rms(np.nan_to_num(self.rows.deflection))

    @property
    def loads_settle(self) -> bool:
        """Whether further loads tell apart what is open: a cause and a mistake in a file, or two of these, they do not."""
        return self.verdict == "ambiguous" and len({cause.label for cause in self.alternatives}) > 1

    @property
    def rows(self) -> Measurements:
        """The rows that were fitted (n)."""
        return self.plain.data.rows

    @property
    def expected_std(self) -> Array:
        """What the noise allows (n, 3) [m]: as estimated with the causes named; else, since that has grown for want of them, as
        stated or as is usual (the sensor's own as estimated where it is not stated)."""
        components = self.extended.components
        if self.verdict in ("ambiguous", "unknown", "mistake"):
            usual = components.within(self.plain.at_map.noise.stated).at_most(1.0).of_the_usual_parts()
            components = replace(usual, degrees=np.inf)
        return residual_std(self.plain.data, components, self.extended.compliance)

    @property
    def conflicts(self) -> tuple[Conflict, ...]:
        """Parts of the data that want different springs, under the plain model: what its misfit looks like before it has a
        name."""
        return tuple(conflict for conflict in subset_conflicts(self.plain) if conflict.is_conflict)
