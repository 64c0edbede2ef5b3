"""What an effect is: its contribution, its parameters, and how it shows in the data (docs/effects.md).

A user's own package adds one by subclassing Effect and naming an instance in the entry point group `compstiff.effects`;
docs/effects.md has a worked example.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

Family = Literal["gear", "structure", "base", "tool", "load path", "force measurement", "deflection measurement"]


@dataclass(frozen=True)
class Parameter:
    """One parameter. typical: the size met in practice, low and high: physical bounds, all in `unit`. A lower bound of zero
    or more means that the effect has one sign only. grid: values to try where it does not enter linearly, else empty.
    shape: it says how the effect looks, not how large it is. source, bounds_source: the document the typical size and the
    bounds come from, or "engineering judgement" with its reason."""

    name: str
    unit: str
    typical: float
    low: float
    high: float
    grid: tuple[float, ...] = ()
    shape: bool = False
    source: str = ""
    bounds_source: str = ""

    @property
    def positive(self) -> bool:
        """Whether the sign is known."""
        return self.low >= 0 or self.high <= 0


@dataclass(frozen=True, eq=False)
class Signature:
    """How an effect shows, linear in p coefficients for given values of what is not linear: rows (n, 3, p) [m].

    scale (p,): typical size of the coefficients; positive: each has one sign. values: coefficients (p,) -> the effect's
    parameter values. effect: the effect itself, or one of its kind that is bound to a place. local: it touches one pose
    only, so that no other pose can tell of it. weight: that hangs on the gear, as its law takes it, where nobody stated one.
    """

    rows: Array
    scale: Array
    positive: bool
    values: Callable[[Array], Array]
    effect: Effect
    local: bool = False
    weight: float = 0.0


class Effect(ABC):
    """One physical effect. joints: the joints it may sit at (1-based), empty where it belongs to none.

    of_robot: the robot does it, so `predict` and `correct` use it; otherwise the measurement does, and it is taken out of the
    data. of_track: the track under the robot does it. stiffens: it is a structure, and real ones yield less the more they
    carry. ways: in how many further ways one of its kind yields (`further_ways`). gear_law: one of the laws by which a gear's
    twist may follow its torque. unsettles: while it acts the springs change. by_visit: it
    does something otherwise at each visit (`of_each_visit`). carries_weight: it carries the arm beside a gear.
    near_laws: effects of the same joint whose shapes a real one of this kind may mix in. leaves_open: an effect that comes with
    it and that no row shows, "" where there is none. law_family: what laws of one gear
    that imitate each other have in common, as a sentence; "" where there is no other. weighed: its last parameter is what
    hangs on the gear, where nobody stated that; no slope leads to it. plainer: an effect that its numbers may stand for, with
    fewer of its own. law: which law this is, where one name has several (""
    for the first); other_laws: the others, of the first, whose signatures have theirs too. sentence: the cause as a shop-floor
    engineer says it ({joint} is filled in). settles: what would separate it from its look-alikes, and is no load.
    formula_source: the document its law comes from, or "engineering judgement" with its reason.
    """

    name: str
    family: ClassVar[Family]
    of_robot: bool
    of_tool: ClassVar[bool] = False
    of_gravity: ClassVar[bool] = False
    of_track: ClassVar[bool] = False
    stiffens: ClassVar[bool] = False
    ways: ClassVar[int] = 0
    joints: tuple[int, ...] = ()
    parameters: tuple[Parameter, ...]
    gear_law: ClassVar[bool] = False
    unsettles: ClassVar[bool] = False
    by_visit: ClassVar[bool] = False
    carries_weight: ClassVar[bool] = False
    near_laws: ClassVar[tuple[str, ...]] = ()
    leaves_open: ClassVar[str] = ""
    law_family: ClassVar[str] = ""
    weighed: ClassVar[bool] = False
    plainer: ClassVar[str] = ""
    law: str = ""
    other_laws: ClassVar[tuple[Effect, ...]] = ()
    sentence: ClassVar[str]
    settles: ClassVar[str]
    turning: ClassVar[str] = ""
    formula_source: ClassVar[str] = ""

    @property
    def stored(self) -> str:
        """Its name in stiffness.json, with its law."""
        return f"{self.name}.{self.law}" if self.law else self.name

    def told(self, joint: int | None) -> str:
        """The sentence of the cause at this joint."""
        return self.sentence.format(joint=joint)

    @property
    def size_parameter(self) -> Parameter:
        """The first parameter that says how large it is."""
        return next(parameter for parameter in self.parameters if not parameter.shape)

    @property
    def where(self) -> dict[str, int | str | float]:
        """What says, beside the joint, which one it is (the row of a step)."""
        return {}

    def neutral(self, rows: LoadState) -> Array:
        """The parameter values (P,) at which the effect is absent; of no meaning for those that only shape it."""
        return np.zeros(len(self.parameters))

    def typical(self, rows: LoadState, joint: int | None) -> Array:
        """Typical sizes (P,) of the parameters on this robot."""
        return np.array([parameter.typical for parameter in self.parameters])

    def grid(self, rows: LoadState, joint: int | None, parameter: Parameter) -> tuple[float, ...]:
        """Values of a parameter that are tried on this robot."""
        return parameter.grid

    @property
    def places(self) -> tuple[int | None, ...]:
        """The joints it may sit at, (None,) where it belongs to none."""
        return self.joints or (None,)

    def missing(self, rows: LoadState) -> str:
        """Why these rows cannot show it at all, "" where they can."""
        return ""

    def undecided(self, rows: LoadState, joint: int | None) -> NDArray[np.bool_]:
        """Rows (n,) in which an error of the force decides what the effect does, so that they tell nothing of it."""
        return np.zeros(len(rows), dtype=bool)

    def loose(self, rows: LoadState, joint: int | None, values: Array) -> NDArray[np.bool_]:
        """Rows (n,) in which the effect in force with values (P,) may rest anywhere, so that none of them is a bad reading."""
        return self.undecided(rows, joint)

    def brings(self, values: Array) -> dict[str, float]:
        """Other effects' names, or those of their laws, each with the size of its parameters up to which this one, with
        parameters (P,), brings it along: so much of it beside this one is no cause of its own."""
        return {}

    def further_ways(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        """What one of this kind and of this size (P,) may do beside its law: (n, 6, ways) of position [m] and rotation [rad],
        each 1 sigma."""
        return np.zeros((len(rows), 6, 0))

    @abstractmethod
    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        """What it adds to the deviation, or to the reading: (n, 6), position [m] and rotation [rad]; values (P,)."""

    def side(self, rows: LoadState, joint: int | None, values: Array) -> Array | None:
        """At which end of its play or friction each row rests (n,): -1 or 1, 0 in between. None: it has no such ends."""
        return None

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array | None:
        """The wrench (n, 6) that really acted where the effect is one of the force's measurement; None: as reported."""
        return None

    def of_each_visit(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        """What it may do otherwise at each visit by itself (n, 6, d), 1 sigma each, where `by_visit` says that it does: part of
        the noise of a fit that has it."""
        raise NotImplementedError(self.name)

    def log_contribution(self, log: JointLog, values: Array) -> Array | None:
        """What it adds to the deflection of a joint in a log taken in motion (n,) [rad]; None: it does not show there."""
        return None

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        """All signatures of the effect at one place, then those of its other laws: by differences of `contribution`, one for
        each value of the grids."""
        grids = [self.grid(rows, joint, parameter) or (None,) for parameter in self.parameters]
        linear = [k for k, parameter in enumerate(self.parameters) if not parameter.grid]
        scale = self.typical(rows, joint)[linear]
        positive = all(self.parameters[k].positive for k in linear)
        signatures = []
        for choice in itertools.product(*grids):
            fixed = np.array([0.0 if value is None else value for value in choice])
            columns = [self._slope(rows, joint, fixed, k) for k in linear]
            signatures.append(Signature(np.stack(columns, axis=2), scale, positive, _placed(fixed, linear), self))
        return [*signatures, *self.of_other_laws(rows, joint)]

    def of_other_laws(self, rows: LoadState, joint: int | None) -> list[Signature]:
        """The signatures of its other laws at one place."""
        return [signature for law in self.other_laws if joint in law.places and not law.missing(rows)
                for signature in law.signatures(rows, joint)]

    def _slope(self, rows: LoadState, joint: int | None, fixed: Array, which: int) -> Array:
        """Contribution to the position (n, 3) for one unit of a linear parameter."""
        step = np.zeros(len(fixed))
        step[which] = self.parameters[which].typical
        ahead = self.contribution(rows, joint, fixed + step)[:, :3]
        if self.parameters[which].positive:
            return np.asarray(ahead / step[which])
        return np.asarray((ahead - self.contribution(rows, joint, fixed - step)[:, :3]) / (2 * step[which]))


def _placed(fixed: Array, linear: list[int]) -> Callable[[Array], Array]:
    def values(coefficients: Array) -> Array:
        result = fixed.copy()
        result[linear] += coefficients
        return result

    return values


def saturated(x: Array) -> Array:
    """x between -1 and 1."""
    # For arrays of some hundred numbers np.clip takes twice as long.
    return np.asarray(np.minimum(np.maximum(x, -1.0), 1.0))


def held_over(side: Array, starts: NDArray[np.bool_]) -> Array:
    """Sides (n,), -1 to 1, of what friction holds while it is pressed to no end: there the last one that the visit pressed it
    to, 0 before any; starts (n,): first rows of visits."""
    pressed, number = np.trunc(side), np.arange(len(side))
    first = np.maximum.accumulate(np.where(starts, number, 0))
    last = np.maximum.accumulate(np.where((pressed != 0) | starts, number, 0))
    return np.asarray(pressed[np.maximum(last, first)])
