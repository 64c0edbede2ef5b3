"""ForceLog: a logged pass, read in bounded memory, averaged over whole revolutions of the spindle, checked on the way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.forces import revolutions
from compensator.forces.health import EVEN, Health
from compensator.forces.predicted_forces import PredictedForces
from compensator.forces.ripple import Ripple, ripple_of
from compensator.forces.source import TIMES, BothPlaces, ForceSource, Key, Samples, open_force_log, placed_by
from identification.common.arrays import Array, read_only
from identification.common.findings import CompstiffError, Finding, counted, error
from identification.common.progress import progress
from identification.model.cell_file import ForceLogFile

Indices = NDArray[np.intp]
# A log longer than twice this is kept as means of consecutive samples, about this many, or this many a target.
ROWS, ROWS_PER_TARGET = 250_000, 16
AS_IT_IS = ForceLogFile()
# Positions and joint angles in one log are held against each other here along it.
LOOKED_AT = tuple(np.linspace(0, 1, 81)[1:-1].tolist())
# What plain means cost is said of a target's stretch of this time [s].
A_STRETCH = 0.1
# A cutter has fewer teeth: the lines of so many times the stated speed are those of a faster spindle.
MOST_TURNS = 24
# A milling spindle that turns slower has its speed in another unit.
SLOWEST_RPM = 100.0


@dataclass(frozen=True, eq=False)
class ForceLog:
    """A logged pass, M rows in time order, as logged: forces (M, 3) [N] and moments (M, 3) [N m] in the log's frame.

    A row is a sample, or the mean of `weight` (M,) consecutive ones. key: what places a row; place: (M,) target index, path
    length [m] or time [s], (M, 3) TCP position in the work object [m], or (M, 6) joint angles [rad]. time (M,) [s] or None;
    rate [Hz] of the samples, None where it is not known. revolution [s]: every force is the mean over that time about it;
    None: it is not. plain (M, 3 or 6): `load` before that, which tells a cut's edge to the sample.
    saturated (M,): a sample at the end of the sensor's range is in the row. spread (M,) [m]: 1 sigma of a path length that was
    estimated. lines_left [N s]: where plain means had to be taken of forces with a spindle's lines, what a mean over a second
    keeps of them, one over T seconds 1/T times that. predicted: what is known of forces that were worked out, None: logged.
    held (M,): rows in which a channel stood still (health.py), which place the log and are no forces. on_path: the rows were
    placed along the path; sent: by where the program sent the tool, so that its offsets are in the place. beside (M, 3) [m],
    world: how far each row stood beside the path then, NaN where it is not on it. ripple: how often the force repeats in a turn
    of the spindle as stated, None where it is not stated, or the spectrum does not show that speed. twice: some samples of a
    log that has positions and joint angles, None else. counted: the path lengths are the logger's own, of the way it was sent.
    """

    source: str
    force: Array
    moment: Array
    has_moment: bool
    key: Key
    place: Array
    line: Indices
    weight: Array
    time: Array | None
    rate: float | None
    revolution: float | None
    plain: Array
    saturated: NDArray[np.bool_]
    findings: tuple[Finding, ...] = ()
    spread: Array | None = None
    lines_left: float = 0.0
    predicted: PredictedForces | None = None
    held: NDArray[np.bool_] | None = None
    on_path: bool = False
    sent: bool = False
    beside: Array | None = None
    ripple: Ripple | None = None
    twice: BothPlaces | None = None
    counted: bool = False

    def __post_init__(self) -> None:
        read_only(*(array for array in vars(self).values() if isinstance(array, np.ndarray)))

    @property
    def load(self) -> Array:
        """Forces and moments (M, 6) [N, N m] as logged; the forces alone (M, 3) where the log has no moments."""
        return np.concatenate([self.force, self.moment], axis=1) if self.has_moment else self.force

    def on_stretches(self, start: Array, end: Array) -> ForceLog:
        """A log that names targets, by path length: the samples of each evenly on its stretch, from start (N,) to end (N,)
        [m]."""
        target = self.place.astype(np.intp)
        order = np.argsort(target, kind="stable")
        done = np.cumsum(self.weight[order]) - 0.5 * self.weight[order]
        total = np.bincount(target, self.weight, minlength=len(start))
        share = np.empty(len(target))
        share[order] = (done - (np.cumsum(total) - total)[target[order]]) / total[target[order]]
        return replace(self, key="path_mm", place=start[target] + share * (end[target] - start[target]), on_path=True)

    def along_the_path(self) -> ForceLog:
        """Its rows by their place, where time does not go forwards along the path."""
        return replace(self.rows(np.argsort(self.place, kind="stable")), time=None)

    def without_rows(self) -> ForceLog:
        """What is known of the log as a whole."""
        return replace(self.rows(slice(0, 0)), predicted=None)

    def rows(self, which: NDArray[np.bool_] | Indices | slice) -> ForceLog:
        """Some of its rows, by which (M,), or by their numbers in another order."""
        some: dict[str, Any] = {
            name: field[which].copy() for name, field in vars(self).items() if isinstance(field, np.ndarray)}
        if self.predicted is not None:
            some["predicted"] = replace(self.predicted, step=self.predicted.step[which].copy())
        return replace(self, **some)


def read_force_log(
    file: str | Path, form: ForceLogFile = AS_IT_IS, *, log_format: str | None = None, spindle_rpm: float | None = None,
    borders: Array | None = None,
) -> ForceLog:
    """Reads a force log.

    form: how this cell's logger writes it. log_format: one of source.LOG_FORMATS, None for CSV or Parquet. spindle_rpm:
    overrides the form's. borders (N - 1,) [m]: path lengths half way between targets: no row of a long log placed by path
    length reaches over one. Raises CompstiffError: CS0201 to CS0203, CS3001 no column places the samples, CS3002 empty,
    CS3004 no target number, CS3020 no header, CS3022 counts without a scale.

    >>> log = compstiff.read_force_log("insert.forces.parquet")
    >>> log.key, log.force.shape
    ('position', (328756, 3))
    """
    source = open_force_log(Path(file), form, log_format)
    if not source.rows:
        raise _empty(source)
    rate, of_rate = _rate(source)
    turn = _spindle(source, rate, spindle_rpm or form.spindle_rpm)
    spindle = turn.speed
    window = rate / spindle if rate and spindle else None
    size = max(source.rows // max(ROWS, ROWS_PER_TARGET * (0 if borders is None else len(borders) + 1)), 1)
    health = Health(str(file), (form.saturation_n, form.saturation_nm), 1 / rate if rate and not of_rate else None)
    kept = Kept(source.rows // size)
    with progress(f"reading {Path(file).name}", source.rows) as bar:
        for block in _blocks(source, health, rate, window):
            kept.add(_reduced(block, size, source.key, borders))
            bar.add(len(block.samples))
    if not kept.count:
        raise _empty(source)
    rows = kept.rows()
    findings = [Finding("CS3003", "note", f"{counted(health.count, 'sample')}, placed by {placed_by(source)}", file=str(file)),
                *source.findings, *of_rate, *turn.findings]
    if size > 1:
        findings.append(Finding("CS3030", "note", f"kept as {len(rows.line)} means of up to {size} consecutive samples",
                                file=str(file)))
    health.close()
    findings += health.findings()
    time, weight = rows.time, np.broadcast_to(1.0, len(rows.line)) if rows.weight is None else rows.weight
    place = rows.place[:, 0] if source.key in ("target", "path_mm") else rows.place
    if source.key == "time":
        assert time is not None         # a log without times and without a rate has no such key
        place = time
    moment = rows.load[:, 3:] if source.has_moment else np.broadcast_to(0.0, (len(rows.line), 3))
    return ForceLog(
        str(file), rows.load[:, :3], moment, source.has_moment, source.key, place, rows.line,
        weight, time, rate,
        revolution=1 / spindle if window and spindle else None, plain=rows.plain if window else rows.load,
        saturated=health.unsound(rows.flags, rows.number), findings=tuple(findings), lines_left=turn.left,
        ripple=turn.ripple, twice=source.both_places(LOOKED_AT),
        held=health.no_forces(rows.number, weight, int(np.ceil(0.5 * window)) if window else 0))


def _empty(source: ForceSource) -> CompstiffError:
    return error("CS3002", "no samples below the header line", file=str(source.file), hint="check the logger")


def _rate(source: ForceSource) -> tuple[float | None, list[Finding]]:
    """Samples a second: as stated, else from the first times; and why the times are of no use."""
    stated = source.form.rate_hz
    first = next(iter(source.blocks()), None) if set(TIMES) & set(source.wanted) else None
    if first is None or first.time is None or len(first) < 3:
        return stated, []
    step = np.diff(first.time)
    middle = float(np.median(step))
    if middle > 0 and np.mean(np.abs(step - middle) <= EVEN * middle) > 0.9:
        # The mean of the steps without gaps: one step may be rounded.
        usual = step[np.abs(step - middle) <= EVEN * middle]
        return stated or float(1 / usual.mean()), []
    return stated, [Finding(
        "CS3036", "note", "the steps of time_s are not even (they are rounded, or the logger has no fixed rate): "
        "gaps in them are not looked for" + ("" if stated else ", nor the spindle's speed"), file=str(source.file),
        hint="" if stated else "state force_log.rate_hz in cell.yaml if the logger has a fixed rate")]


@dataclass(frozen=True)
class _Turn:
    """The spindle's speed [Hz], None: not known; what is to be said of it; what plain means keep of its lines where it is
    ambiguous [N s]; ripple as in ForceLog."""

    speed: float | None
    findings: tuple[Finding, ...] = ()
    left: float = 0.0
    ripple: Ripple | None = None


def _spindle(source: ForceSource, rate: float | None, stated_rpm: float | None) -> _Turn:
    """What is known of the spindle's speed, stated or not."""
    name = str(source.file)
    if rate is None:
        return _Turn(None) if stated_rpm is None else _Turn(None, (Finding(
            "CS3028", "warning", f"the spindle speed {stated_rpm:g} rpm is stated, but not how fast the log was sampled: plain "
            "means were taken", file=name, hint="log time_s, or state force_log.rate_hz"),))
    stated = None if stated_rpm is None else stated_rpm / 60
    if stated is not None and 2 * stated > rate:
        return _Turn(None, (Finding("CS3028", "warning", f"under two samples a revolution ({rate:g} Hz at {stated_rpm:g} rpm): "
                                    "plain means were taken", file=name),))
    seen = revolutions.spectrum(source.stretches, rate, source.rows)
    spindle = None if seen is None else revolutions.find_spindle(*seen, stated)
    if stated is None:
        return _found(seen is None, spindle, rate, name)
    if seen is not None and spindle is not None and abs(spindle.frequency / stated - 1) <= revolutions.SLIP:
        # Any line is a multiple of a turn that is slow enough: 150 a minute for 150 a second.
        widest = revolutions.find_spindle(*seen)
        slow = widest is not None and widest.frequency > MOST_TURNS * stated
        said = (_averaged(spindle.frequency, f"stated {stated_rpm:g}, found so in the spectrum", name),)
        if widest is not None and slow:
            return _Turn(spindle.frequency, (*said, _other_speed(widest.frequency, stated, name)))
        return _Turn(spindle.frequency, said, ripple=ripple_of(*seen, spindle.frequency))
    other = None if seen is None else revolutions.find_spindle(*seen)
    said = (_averaged(stated, "as stated", name),)
    return _Turn(stated, said if other is None else (*said, _other_speed(other.frequency, stated, name)))


def _found(too_short: bool, spindle: revolutions.Spindle | None, rate: float, name: str) -> _Turn:
    """The speed that nothing states, by the spectrum."""
    if spindle is None:
        few = "the log is too short" if too_short else "no comb of lines stands out of its spectrum"
        return _Turn(None, (Finding("CS3028", "note", f"spindle speed not found ({few}): plain means were taken", file=name,
                                    hint="state it: --spindle-rpm, or force_log.spindle_rpm in cell.yaml"),))
    if spindle.rivals:
        return _Turn(None, (_ambiguous(spindle, rate, name),), spindle.left)
    return _Turn(spindle.frequency, (_averaged(
        spindle.frequency, f"found in the spectrum: {100 * spindle.share:.0f} % of its lines at multiples, the strongest "
        f"at {spindle.strongest:.1f} Hz", name), _turn_or_tooth(spindle, name)))


def _other_speed(found: float, stated: float, name: str) -> Finding:
    return Finding("CS3035", "warning", f"the spectrum shows a period of {60 * found:.1f} rpm, not the stated {60 * stated:g}",
                   file=name, hint="is that the speed of this program, in revolutions a minute?")


def _ambiguous(spindle: revolutions.Spindle, rate: float, name: str) -> Finding:
    """Where tooth passing folds back at half the rate and several speeds make the same lines."""
    speeds = ", ".join(f"{60 * frequency:.0f}" for frequency in (spindle.frequency, *spindle.rivals[:4]))
    return Finding(
        "CS3067", "warning", f"the spindle's speed is ambiguous: logged at {rate:g} Hz, {speeds} rpm and others, such as whole "
        "fractions of them, make the same lines. Plain means were taken: a mean over "
        f"{A_STRETCH:g} s keeps up to {spindle.left / A_STRETCH:.1f} N of the lines", file=name,
        hint="state the speed: --spindle-rpm, or force_log.spindle_rpm in cell.yaml; or log at some thousand samples a second")


def _turn_or_tooth(spindle: revolutions.Spindle, name: str) -> Finding:
    """CS3242: what was found may be the rate of the teeth, and why the means are right all the same."""
    rpm = 60 * spindle.frequency
    if spindle.faster is None:
        said = (f"{rpm:.0f} rpm may be the rate of the teeth that pass, the spindle's then a half, a third ... of it. The "
                "spectrum shows no line of such a slower turn, so that a mean over this period is right for both")
    else:
        said = (f"a spindle of {60 * spindle.faster:.0f} rpm would make the same lines, some of them folded back. {rpm:.0f} "
                "rpm is taken: a mean over this period is one over whole periods of both")
    return Finding("CS3242", "note", f"nothing states the spindle's speed: {said}", file=name,
                   hint="state it: --spindle-rpm, or force_log.spindle_rpm in cell.yaml")


def _averaged(frequency: float, how: str, name: str) -> Finding:
    slow = 60 * frequency < SLOWEST_RPM
    return Finding("CS3027", "warning" if slow else "note", f"forces averaged over whole revolutions of {1e3 / frequency:.4g} "
                   f"ms, spindle at {60 * frequency:.1f} rpm ({how})", file=name,
                   hint="is the speed in revolutions a minute? So long a mean blurs the force along the path" if slow else "")


@dataclass(frozen=True, eq=False)
class Block:
    """Samples with their flags (n,) (health.py) and their numbers (n,) from 0; plain (n, c): loads as they were before
    they were averaged, (n, 0) where they are not."""

    samples: Samples
    flags: NDArray[np.uint16]
    number: Indices
    plain: Array

    def part(self, which: slice) -> Block:
        """Some of them."""
        return Block(self.samples.part(which), self.flags[which], self.number[which], self.plain[which])


def _blocks(source: ForceSource, health: Health, rate: float | None, window: float | None) -> Iterator[Block]:
    """The blocks of a log, checked, and averaged over `window` samples; without times of their own those by the rate."""
    waiting: list[Block] = []

    def checked() -> Iterator[tuple[Array, Indices]]:
        for samples in source.blocks():
            number = np.arange(health.count, health.count + len(samples))
            flags, gaps, lost = health.look(samples)
            if samples.time is None and rate:
                samples = replace(samples, time=(number + lost) / rate)
            waiting.append(Block(samples, flags, number, samples.load[:, : 0 if window is None else None]))
            yield samples.load, gaps

    if window is None:
        for _ in checked():
            yield waiting.pop()
        return
    for load in revolutions.averaged(checked(), window):
        given = 0
        while given < len(load):
            block = waiting.pop(0)
            take = min(len(block.samples), len(load) - given)
            if take < len(block.samples):
                waiting.insert(0, block.part(slice(take, None)))
                block = block.part(slice(0, take))
            yield replace(block, samples=replace(block.samples, load=load[given:given + take]))
            given += take


@dataclass(frozen=True, eq=False)
class Rows:
    """What is kept of the log; fields as in ForceLog, weight None where each row is one sample. number (n,): of the first
    sample of each row."""

    load: Array
    place: Array
    time: Array | None
    line: Indices
    weight: Array | None
    flags: NDArray[np.uint16]
    number: Indices
    plain: Array


class Kept:
    """Rows as they come in, in arrays that double: many small ones between large passing ones would tear memory to pieces.
    expected: how many rows, about."""

    def __init__(self, expected: int = 0) -> None:
        self.count = 0
        self._expected = expected
        self._held: list[NDArray[Any] | None] = []

    def add(self, rows: Rows) -> None:
        """More rows, copied."""
        fields, stop = list(vars(rows).values()), self.count + len(rows.line)
        room = max(self._expected + (self._expected >> 4), 1 << 16, 2 * stop if self._held else stop)
        self._held = self._held or [
            None if field is None else np.empty((room, *field.shape[1:]), dtype=field.dtype) for field in fields]
        for number, field in enumerate(fields):             # one by one: the old one goes before the next one grows
            held = self._held[number]
            if held is None:
                continue
            if stop > len(held):
                grown = self._held[number] = np.empty((room, *held.shape[1:]), dtype=held.dtype)
                grown[:self.count] = held[:self.count]
                held = grown
            held[self.count:stop] = field
        self.count = stop

    def rows(self) -> Rows:
        """All of them."""
        held: list[Any] = [None if held is None else held[:self.count] for held in self._held]
        return Rows(*held)


def _reduced(block: Block, size: int, key: Key, borders: Array | None) -> Rows:
    """Means of up to `size` consecutive samples; none reaches over a change of target."""
    samples, count = block.samples, len(block.samples)
    if size == 1:
        return Rows(samples.load, samples.place, samples.time, samples.line, None, block.flags, block.number, block.plain)
    begins = np.zeros(count, dtype=bool)
    begins[::size] = True
    if key == "target" or (key == "path_mm" and borders is not None):
        target = samples.place[:, 0] if key == "target" or borders is None else np.searchsorted(borders, samples.place[:, 0])
        begins[1:] |= target[1:] != target[:-1]
    starts = np.flatnonzero(begins)
    weight = np.diff(starts, append=count).astype(float)
    place = samples.place[starts] if key == "target" else np.add.reduceat(samples.place, starts, axis=0) / weight[:, None]
    time = None if samples.time is None else np.add.reduceat(samples.time, starts) / weight
    return Rows(np.add.reduceat(samples.load, starts, axis=0) / weight[:, None], place, time, samples.line[starts], weight,
                np.bitwise_or.reduceat(block.flags, starts), block.number[starts],
                np.add.reduceat(block.plain, starts, axis=0) / weight[:, None])
