"""A quick look at every mistake of the list: how likely each makes the rows in the linear model of screen.py.

A mistake that stands in all rows, or from one pose visit on (another day, tool or robot), or in the rows before; columns
that slipped, from any row on. All are counted: the prior of a mistake is shared out over those that were tried.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.fit.mistakes.axes import axes_mistakes
from identification.fit.mistakes.cell_file import cell_mistakes
from identification.fit.mistakes.joints import joint_mistakes
from identification.fit.mistakes.mistake import Mistake
from identification.fit.mistakes.readings import reading_mistakes
from identification.fit.mistakes.screen import Linear, Sums, linear, log_scores, spring_jacobian, sums
from identification.fit.mistakes.sizes import SIZES, Size
from identification.fit.mistakes.slipped import slipped_mistakes
from identification.measurements import Measurements

Array = NDArray[np.float64]
# Visits from which on a mistake may hold.
MOST_BOUNDARIES = 24
# ln of how much likelier than none the quick look must find a mistake, less for one with a size, and how far behind the best
# one without a size it may be.
WORTH, WORTH_WITH_SIZE, BEHIND = 4.0, -8.0, 30.0
MOST_FITTED = 5
# The size of a mistake is found in so many steps.
SIZE_STEPS = 5
# A gauge that was unplugged reads nothing [m].
LEAST_SPREAD = 1e-9
# A mistake in a part of the rows is that much rarer (ln) than in all.
PART = -np.log(4.0)


@dataclass(frozen=True, eq=False)
class Guess:
    """What the quick look takes for worth a fit. parts: rows that are fitted apart; size and joint: of one with a size, start
    (P,) its value."""

    mistake: Mistake
    rows: NDArray[np.bool_] | None
    score: float
    log_prior: float
    split: bool = False
    size: Size | None = None
    joint: int | None = None
    start: Array | None = None


def of_alike(guesses: list[Guess]) -> Guess:
    """Of guesses that leave the same rows the first usual one; what else it may be, to these rows, goes with its sentence."""
    usual = [guess for guess in guesses if guess.mistake.usual] or guesses[:1]
    chosen, quantities, others = usual[0], {usual[0].mistake.key.split("_")[0]}, []
    for guess in usual[1:]:
        quantity = guess.mistake.key.split("_")[0]
        same = guess.rows is chosen.rows or (guess.rows is not None and chosen.rows is not None
                                             and np.array_equal(guess.rows, chosen.rows))
        if same and quantity not in quantities:
            quantities.add(quantity)
            others.append(guess.mistake.sentence)
    if not others:
        return chosen
    sentence = f"{chosen.mistake.sentence}, or, which is the same to these rows, {', or '.join(others)}"
    return replace(chosen, mistake=replace(chosen.mistake, sentence=sentence))


class Look:
    """The quick look at all mistakes of these rows."""

    def __init__(self, data: LoadTest) -> None:
        self.data = data
        self.mistakes = [*axes_mistakes(data), *joint_mistakes(data), *slipped_mistakes(data), *reading_mistakes(data),
                         *cell_mistakes(data)]
        self.visits, self._number = np.unique(data.rows.visit, return_inverse=True)
        self._log_std = data.prior.prior.log_std
        self._arm = spring_jacobian(data)
        count = len(self.visits)
        evenly = np.linspace(1, count - 1, min(count - 1, MOST_BOUNDARIES)) if count > 1 else np.empty(0)
        self.boundaries = np.unique(evenly.astype(int))
        self.places = sum(len(size.joints) or 1 for size in SIZES)
        self.usual = sum(mistake.usual for mistake in self.mistakes) + self.places + 1
        self.tried = len(self.mistakes) + self.places + 1

    def _linear(self, mended: LoadTest) -> Linear:
        """The linear model of mended data; where the poses are those of the table the arm is known."""
        as_it_is = mended.cell is self.data.cell and mended.rows.theta is self.data.rows.theta
        return linear(mended, self._arm if as_it_is else None)

    def guesses(self) -> list[Guess]:
        """The few that are worth a fit, the likeliest first, and all with a size that may be: those are told apart by what the
        readings of a visit share, which the quick look does not know."""
        plain = sums(self._linear(self.data))
        scores, springs = log_scores(plain.total(), self._log_std)
        found, none = self._of_columns(plain), float(scores[0])
        found += self._from_their_rows(found)
        best = max((guess.score for guess in found), default=-np.inf)
        kept = self._unlike(sorted((guess for guess in found if guess.score >= max(best - BEHIND, none + WORTH)),
                                   key=lambda guess: -round(guess.score, 6)))
        sized = [guess for guess in self._of_sizes(springs[0]) if guess.score >= none + WORTH_WITH_SIZE]
        return [*kept[:MOST_FITTED], *sized]

    def _from_their_rows(self, found: list[Guess]) -> list[Guess]:
        """Of mistakes that may begin at any row the likeliest guess of a part, from the likeliest row on near its begin."""
        best: dict[str, Guess] = {}
        for guess in sorted(found, key=lambda guess: -guess.score):
            if guess.mistake.from_a_row and guess.rows is not None and not guess.rows[0]:
                best.setdefault(guess.mistake.key, guess)
        return [self._from_its_row(guess, guess.rows) for guess in best.values() if guess.rows is not None]

    def _from_its_row(self, guess: Guess, rows: NDArray[np.bool_]) -> Guess:
        """The guess, from the likeliest row on within a visit of where these rows (n,) begin."""
        near = np.abs(self._number - self._number[int(np.argmax(rows))]) <= 1
        parts = [np.arange(len(near)) >= row for row in np.flatnonzero(near) if row > 0]
        mended = [guess.mistake.mended(self.data, part) for part in parts]
        scores, _ = log_scores(Sums.joined([sums(self._linear(each)).total() for each in mended]), self._log_std)
        scores = scores + [log_lost(self.data, each) for each in mended]
        likeliest = int(np.argmax(scores))
        return replace(guess, rows=parts[likeliest], score=float(scores[likeliest]) + guess.log_prior)

    def _unlike(self, guesses: list[Guess]) -> list[Guess]:
        """One of those that leave the same rows: where a column is empty or zero in all of them, a mistake is the same with it
        and without it. So are, to the springs, a force and all that was read under it of the other sign. None of those that
        change one row alone of the part they are of: that is a slip in that row."""
        alike: dict[tuple[bytes, str, bool], list[Guess]] = {}
        plain = _to_springs(self.data.rows)
        for guess in guesses:
            left = _to_springs(guess.mistake.mended(self.data, guess.rows).rows)
            if guess.rows is not None and np.count_nonzero(np.any(left != plain, axis=1)) == 1:
                continue
            key = left.tobytes(), guess.mistake.key if guess.mistake.of == "cell" else "", guess.split
            alike.setdefault(key, []).append(guess)
        return [of_alike(group) for group in alike.values()]

    def _of_columns(self, plain: Sums) -> list[Guess]:
        """Those without a size: in all rows, before or from a visit on; and two sets of springs."""
        each = [sums(self._linear(mistake.mended(self.data))) for mistake in self.mistakes]
        volume = [self._log_volume(mistake) for mistake in self.mistakes]
        # Before each boundary, then from each on.
        parts = [(self._number < b) == head for head in (True, False) for b in self.boundaries]
        places = [(None, 1.0), *((part, float(part.mean())) for part in parts)]
        totals, labels = [one.total() for one in each], [(k, 0) for k in range(len(each))]
        before = plain.up_to()
        for k, one in enumerate(each):
            if not self.mistakes[k].usual or self.mistakes[k].of == "cell":
                continue
            mended, first, last = one.up_to(), self.boundaries - 1, slice(-1, None)
            totals += [mended[first] + before[last] - before[first], before[first] + mended[last] - mended[first]]
            labels += [(k, place) for place in range(1, len(places))]
        scores, _ = log_scores(Sums.joined(totals), self._log_std)
        found = []
        for score, (k, place) in zip(scores, labels, strict=True):
            rows, share = places[place]
            if rows is None and self.mistakes[k].in_part:
                continue
            prior = self._log_prior(self.mistakes[k].usual, rows is not None)
            found.append(Guess(self.mistakes[k], rows, float(score) + volume[k] * share + prior, prior))
        return found + self._of_two_robots(before)

    def _of_two_robots(self, before: Sums) -> list[Guess]:
        """The rows from a visit on want other springs."""
        if not len(self.boundaries):
            return []
        heads = before[self.boundaries - 1]
        scores = log_scores(heads, self._log_std)[0] + log_scores(before[slice(-1, None)] - heads, self._log_std)[0]
        prior = self._log_prior(True, True)
        return [Guess(_two_robots(), self._number >= b, float(score) + prior, prior, split=True)
                for b, score in zip(self.boundaries, scores, strict=True)]

    def _of_sizes(self, springs: Array) -> list[Guess]:
        """Those with a size, which is found step by step in the linear model."""
        prior, found = self._log_prior(True, False), []
        for size in SIZES:
            for joint in size.places:
                start, score = self._sized(size, joint, springs)
                # A size costs half of ln of how many readings tell it, each.
                cost = 0.5 * len(start) * np.log(3 * len(self.data.rows))
                found.append(Guess(size.mistake(self.data, joint, start, start), None, score - cost + prior, prior,
                                    size=size, joint=joint, start=start))
        return found

    def _sized(self, size: Size, joint: int | None, springs: Array) -> tuple[Array, float]:
        """The size (P,) that fits best, and its score."""
        typical = np.array([parameter.typical for parameter in size.parameters])
        high = np.array([parameter.high for parameter in size.parameters])
        values, x, best, score = np.zeros(len(typical)), springs, np.zeros(len(typical)), -np.inf
        for _ in range(SIZE_STEPS):
            model = self._linear(size.mistake(self.data, joint, values, values).mended(self.data))
            columns, readings = model.columns, model.readings
            own, at = log_scores(sums(model).total(), self._log_std)
            if own[0] > score:
                best, score, x = values, float(own[0]), at[0]
            slopes = np.stack([self._linear(size.mistake(self.data, joint, values + 0.1 * step, values).mended(
                self.data)).columns @ np.exp(x) for step in np.diag(typical)], axis=2)
            design = np.concatenate([columns * np.exp(x), (slopes - (columns @ np.exp(x))[:, :, None]) / 0.1], axis=2)
            left = readings - columns @ np.exp(x)
            weight = np.where(np.isnan(self.data.rows.deflection), 0.0, 1 / model.variance[:, None])
            gram = np.einsum("nap,na,naq->pq", design, weight, design) + np.diag(np.r_[1 / self._log_std**2, 0.04 / typical**0])
            step = np.linalg.solve(gram, np.einsum("nap,na,na->p", design, weight, left))[6:]
            values = np.clip(values + typical * np.clip(step, -3, 3), -high, high)
        return best, score

    def _log_prior(self, usual: bool, part: bool) -> float:
        share = -np.log(2 * (self.usual if usual else max(self.tried - self.usual, 1)))
        return float(share + (PART - np.log(2 * len(self.boundaries)) if part else 0.0))

    def _log_volume(self, mistake: Mistake) -> float:
        """ln of how much larger the mended readings are, all rows together, and how likely those are that it leaves out."""
        measured = ~np.isnan(self.data.rows.deflection)
        return float((measured * np.log(mistake.scale)).sum()) + log_lost(self.data, mistake.mended(self.data))


def log_lost(data: LoadTest, mended: LoadTest, per_unit: Array | float = 1.0) -> float:
    """ln of how likely the readings are that a mended table leaves out, as draws from all; per_unit (n, 3) [1/m]."""
    before, after = ~np.isnan(data.rows.deflection), ~np.isnan(mended.rows.deflection)
    # A reading that is in another column than before is not lost.
    lost = before & ~after & (after.sum(axis=1) < before.sum(axis=1))[:, None]
    if not lost.any():
        return 0.0
    taken = np.maximum((~np.isnan(data.rows.deflection)).sum(axis=0), 1)
    spread = np.maximum(np.sqrt(np.nansum(data.rows.deflection**2, axis=0) / taken), LEAST_SPREAD) * per_unit
    return -float(np.sum(np.log(np.broadcast_to(spread, lost.shape)[lost]) + 0.5))


def _to_springs(rows: Measurements) -> Array:
    """What springs see of the rows (n, 15)."""
    first = np.argmax(rows.wrench != 0, axis=1)[:, None]
    sign = np.sign(np.take_along_axis(rows.wrench, first, axis=1))
    return np.nan_to_num(np.column_stack([sign * rows.wrench, sign * rows.deflection, rows.theta]), nan=np.inf) + 0.0


def _two_robots() -> Mistake:
    return Mistake("two_robots", "{rows} seem to be of another robot or tool than the others: they want other springs",
                   "sort the rows by robot, tool and day; identify each by itself", "table", lambda data: data)
