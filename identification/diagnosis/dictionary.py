"""The dictionary as columns: how every effect would show in these rows, whitened, in units of its typical size."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from weakref import ReferenceType, WeakKeyDictionary, ref

import numpy as np
from numpy.typing import NDArray

from identification.fit.fitted_model import Term
from identification.fit.sight import Sight
from identification.model.effects import Effect, Signature
from identification.model.effects_in_force import EffectInForce
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Coefficients of one signature; the widest have one for each axis that sees another.
WIDEST = 6
# Weights on a gear that differ by less than such a factor are one as far as a second cause is concerned.
ALIKE = 1.2
# Numbers of a dictionary that is kept as long as its state: of some three hundred rows.
MOST_KEPT = 3_000_000


@dataclass(frozen=True, eq=False)
class Entry(EffectInForce):
    """An effect at a joint (1-based, None where it belongs to none), with its signatures' places in the dictionary."""

    signatures: range


@dataclass(frozen=True, eq=False)
class Dictionary:
    """entries: what is tried. signatures (S): one for each value of what does not enter linearly. columns (n, 3, m) as the rows
    see them, whitened, in units of the typical size, those of one signature side by side; of a machined part (n, 1, m). widths
    (S,): how many a signature has; positive (S,). left_out: effects that these rows cannot show at all, and why."""

    entries: tuple[Entry, ...]
    signatures: tuple[Signature, ...]
    columns: Array
    widths: NDArray[np.intp]
    positive: NDArray[np.bool_]
    left_out: dict[str, str]

    @cached_property
    def entry_of(self) -> NDArray[np.intp]:
        """Index of the entry each signature belongs to (S,)."""
        return np.concatenate([np.full(len(entry.signatures), k) for k, entry in enumerate(self.entries)]).astype(np.intp)

    @cached_property
    def log_share(self) -> Array:
        """ln of how likely each signature (S,) is of its entry's, beforehand: each law alike, and each of a law's alike."""
        share = np.empty(len(self.signatures))
        for entry in self.entries:
            laws = [self.signatures[s].effect.stored for s in entry.signatures]
            number = Counter(laws)
            share[entry.signatures] = [-np.log(number[law] * len(number)) for law in laws]
        return share

    @cached_property
    def starts(self) -> NDArray[np.intp]:
        """Where the columns of each signature begin (S,)."""
        return np.asarray(np.cumsum(self.widths) - self.widths)

    @cached_property
    def alike(self) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """The signatures with as many coefficients as each other, (s,), and their columns (s, width)."""
        return [(some, self.starts[some][:, None] + np.arange(width))
                for width in np.unique(self.widths) for some in [np.flatnonzero(self.widths == width)]]

    def of(self, *signatures: int) -> Array:
        """Columns (n, 3, p) of these signatures, one after the other."""
        places = [np.arange(self.starts[s], self.starts[s] + self.widths[s]) for s in signatures]
        return self.columns[:, :, np.concatenate(places)]

    def shapes(self, entry: int, signature: int) -> Array:
        """Columns (n, 3, m) of an entry whose law is not exactly the dictionary's: its signatures for all values of what does
        not enter linearly, and those of the laws near it; `signature` alone for one that is bound to a place."""
        named = self.entries[entry]
        if self.signatures[signature].effect.where:
            members = [signature]
        else:
            near = [other for other in self.entries
                    if other.joint == named.joint and other.effect.name in named.effect.near_laws]
            weight = self.signatures[signature].weight
            # A weight that is searched may be none.
            members = [k for each in (named, *near) for k in each.signatures
                       if not self.signatures[k].weight or weight / ALIKE <= self.signatures[k].weight <= weight * ALIKE]
        return self.of(*members)

    def unweighed(self, entry: Entry) -> list[int]:
        """The signatures of an entry but those under a weight that is searched: a plan is judged as if nothing hung there."""
        return [k for k in entry.signatures if not self.signatures[k].weight]

    def nearest(self, entry: int, effect: Effect, values: Array) -> int:
        """The signature of an entry that is most like its effect in force with values (P,)."""
        weight = values[-1] if effect.weighed else 0.0
        bound = [k for k in self.entries[entry].signatures if self.signatures[k].effect.where == effect.where]
        return min(bound, key=lambda k: abs(self.signatures[k].weight - weight))

    def undecided(self, state: LoadState, joint: int | None) -> Array:
        """What the gear of a joint may do (n, 3, 2) [m], in its typical size, in the rows in which a force error decides it: at
        each pose the same in all of them, or turning round with the load; (n, 3, 0) where there are none."""
        mask = np.zeros(len(state), dtype=bool)
        scale = 0.0
        for entry in self.entries:
            if joint is not None and entry.joint == joint:
                mine = entry.effect.undecided(state, joint)
                if mine.any():
                    mask, scale = mask | mine, max(scale, float(entry.effect.typical(state, joint)[0]))
        if joint is None or not mask.any():
            return np.zeros((len(state), 3, 0))
        force = state.wrench[:, :3]
        sign = np.sign(np.take_along_axis(force, np.argmax(np.abs(force), axis=1)[:, None], axis=1)[:, 0])
        move = state.jacobian[:, :3, joint - 1] * (scale * mask)[:, None]
        return np.stack([move, move * sign[:, None]], axis=2)

    def gear_laws(self, joint: int) -> list[int]:
        """The entries that are laws of this joint's gear."""
        return [k for k, entry in enumerate(self.entries) if entry.joint == joint and entry.effect.gear_law]

    def amplitude(self, signature: int) -> float:
        """The typical size of a signature's effect [unit of its first law's first parameter]."""
        first = self.entries[self.entry_of[signature]].signatures.start
        return float(self.signatures[first].scale[0])

    def part(self, entries: list[int]) -> Dictionary:
        """These entries alone."""
        kept = [s for k in entries for s in self.entries[k].signatures]
        part, place = [], 0
        for k in entries:
            count = len(self.entries[k].signatures)
            part.append(Entry(self.entries[k].effect, self.entries[k].joint, range(place, place + count)))
            place += count
        return Dictionary(tuple(part), tuple(self.signatures[s] for s in kept), self.of(*kept), self.widths[kept],
                          self.positive[kept], {})

    def term(self, state: LoadState, signature: int, coefficients: Array) -> Term:
        """The effect in force with these coefficients (6,) in typical sizes."""
        shape = self.signatures[signature]
        joint, effect = self.entries[self.entry_of[signature]].joint, shape.effect
        values = shape.values(coefficients[: self.widths[signature]] * shape.scale)
        bounds = np.array([(parameter.low, parameter.high) for parameter in effect.parameters])
        return Term(effect, joint, np.clip(values, *bounds.T), effect.typical(state, joint), effect.neutral(state))


@dataclass(frozen=True)
class _Made:
    """A dictionary that may still be in use, with what it was made of; held: a small one, which lives as long as its state."""

    sight: ReferenceType[Sight]
    catalogue: dict[str, Effect]
    dictionary: ReferenceType[Dictionary]
    held: Dictionary | None


# Of a state that lives its last dictionary: who looks for causes and who tests what is left ask for the same one. A large one
# is kept by its users alone, since of long load tests it is most of what is held.
_MADE: WeakKeyDictionary[LoadState, _Made] = WeakKeyDictionary()


def dictionary_of(state: LoadState, sight: Sight, catalogue: dict[str, Effect]) -> Dictionary:
    """All effects of the catalogue (`effects()`) at all their places, as these rows would show them."""
    made = _MADE.get(state)
    if made is not None and made.sight() is sight and made.catalogue is catalogue:
        known = made.dictionary()
        if known is not None:
            return known
    dictionary = _made_anew(state, sight, catalogue)
    _MADE[state] = _Made(ref(sight), catalogue, ref(dictionary), dictionary if dictionary.columns.size <= MOST_KEPT else None)
    return dictionary


def _made_anew(state: LoadState, sight: Sight, catalogue: dict[str, Effect]) -> Dictionary:
    entries: list[Entry] = []
    signatures: list[Signature] = []
    left_out = {}
    for effect in catalogue.values():
        why = effect.missing(state)
        if why:
            left_out[effect.name] = why
            continue
        for joint in effect.places:
            shapes = effect.signatures(state, joint)
            entries.append(Entry(effect, joint, range(len(signatures), len(signatures) + len(shapes))))
            signatures += shapes
    # Entry by entry: of long load tests all of them together are most of what is held.
    widths = np.array([shape.rows.shape[2] for shape in signatures], dtype=np.intp)
    columns = np.empty((*sight.whitened(np.zeros((len(state), 3, 0))).shape[:2], int(widths.sum())))
    end = 0
    for entry in filter(lambda entry: entry.signatures, entries):
        moved = np.concatenate([signatures[s].rows * signatures[s].scale for s in entry.signatures], axis=2)
        start, end = end, end + moved.shape[2]
        columns[:, :, start:end] = sight.whitened(moved)
    return Dictionary(tuple(entries), tuple(signatures), columns, widths,
                      np.array([shape.positive for shape in signatures], dtype=bool), left_out)
