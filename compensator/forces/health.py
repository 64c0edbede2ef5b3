"""What is wrong with a force log by itself: saturated samples, stuck channels, samples that were lost. Found block by block.

A sensor's noise changes every reading, so repeats of exactly the same value tell. A channel is judged only while another one
moves, and all together where they hold a load, and scatter without repeating one elsewhere: a simulation is left in peace.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from compensator.forces.packet_counter import PacketCounter
from compensator.forces.source import Samples
from identification.common.arrays import Array
from identification.common.findings import Finding, Level, counted

Indices = NDArray[np.intp]
Flags = NDArray[np.uint16]
AXES = ("fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm")
# So many equal samples in a row at the largest value of all are a clipped peak, so many anywhere a channel that is stuck; both
# only in a channel of which at most this share of the other samples repeats the one before.
CLIPPED, STUCK, REPEATS = 3, 64, 0.05
# Noise turns up and down at two thirds of its samples, whatever it stands on; a calculation hardly ever does.
NOISY = 0.2
# Two of these that are the same in every sample are one column written twice.
PAIRS = ((0, 1), (0, 2), (1, 2))
# Fewer samples beside such runs than this do not tell how often a channel repeats itself.
FEWEST = 200
# A step in time longer than this many samples is a gap; steps are even where most are within EVEN of the middle one.
GAP, EVEN = 1.5, 0.1


@dataclass
class Channel:
    """What was seen of one channel so far. extreme: largest and smallest value; reset: sample number from which flags of that
    extreme count; clipped: samples of such runs while others moved, at_end: of all such runs, first_clipped: line of the first;
    held_from, held_to: sample numbers of the runs that stood still, held_at: what they held."""

    extreme: list[float] = field(default_factory=lambda: [-np.inf, np.inf])
    reset: list[int] = field(default_factory=lambda: [0, 0])
    clipped: list[int] = field(default_factory=lambda: [0, 0])
    at_end: list[int] = field(default_factory=lambda: [0, 0])
    first_clipped: list[int] = field(default_factory=lambda: [0, 0])
    repeats: int = 0
    stuck: int = 0
    first_stuck: int = 0
    longest: int = 0
    held_from: list[int] = field(default_factory=list)
    held_to: list[int] = field(default_factory=list)
    held_at: list[float] = field(default_factory=list)
    held: float = np.nan
    run: int = 0
    moving: int = 0
    run_line: int = 0

    def elsewhere(self, count: int, clipped: list[int]) -> tuple[int, int]:
        """Samples of `count`, and repeats among them, outside the runs that stood still and those at the sides `clipped`."""
        both = sum(to - begin for begin, to, held in zip(self.held_from, self.held_to, self.held_at, strict=True)
                   if held in [self.extreme[side] for side in clipped])
        taken = self.stuck + sum(self.at_end[side] for side in clipped) - both
        return count - taken, self.repeats - taken


class _Readings(NamedTuple):
    """One channel of a block: values (n,), same (n,): as the one before, moves (n,): some channel changes; line (n,)."""

    values: Array
    same: NDArray[np.bool_]
    moves: NDArray[np.bool_]
    line: Indices


@dataclass
class Health:
    """Looks at all samples in their order. limit (2,) [N, N m]: the sensor's range where it is stated, else None.

    period [s]: of one sample, None where it is not known. together: all channels as one; turns: how often their sum begins to
    rise or fall.
    """

    source: str
    limit: tuple[float | None, float | None]
    period: float | None
    channels: list[Channel] = field(default_factory=list)
    together: Channel = field(default_factory=Channel)
    turns: int = 0
    count: int = 0
    beyond: int = 0
    first_beyond: int = 0
    lost: int = 0
    gaps: int = 0
    first_gap: int = 0
    longest_gap: float = 0.0
    backwards: int = 0
    first_backwards: int = 0
    repeated: int = 0
    first_repeated: int = 0
    last_time: float | None = None
    counter: PacketCounter = field(default_factory=PacketCounter)
    last_load: Array | None = None
    alike: list[bool] = field(default_factory=lambda: [True] * len(PAIRS))

    def look(self, samples: Samples) -> tuple[Flags, Indices, Array]:
        """Flags (n,), two bits a channel (provisional, see `unsound`), the places before which time has a gap, and how many
        samples (n,) were lost before each as their counter tells, less those that stand twice."""
        load = samples.load
        if not self.channels:
            self.channels = [Channel() for _ in range(load.shape[1])]
        self.alike = [alike and np.array_equal(load[:, one], load[:, other])
                      for alike, (one, other) in zip(self.alike, PAIRS, strict=True)]
        flags = np.zeros(len(load), dtype=np.uint16)
        before = load[:1] if self.last_load is None else self.last_load
        same = np.empty(load.shape, dtype=bool, order="F")
        np.equal(load[1:], load[:-1], out=same[1:])
        same[0] = (load[0] == before[0]) if self.last_load is not None else False
        moves = ~np.logical_and.reduce([same[:, k] for k in range(load.shape[1])])
        for k, channel in enumerate(self.channels):
            readings = _Readings(load[:, k], same[:, k], moves, samples.line)
            self._runs(channel, readings)
            self._clipped(channel, readings, flags, 2 * k)
        # Readings of all channels as one that counts as moving: a logger that repeats the last it got.
        size = np.abs(load).sum(axis=1)
        self._runs(self.together, _Readings(size, ~moves, np.ones_like(moves), samples.line))
        up = np.diff(size) > 0
        self.turns += int(np.count_nonzero(up[1:] != up[:-1]))
        self._range(load, samples.line, flags)
        self.last_load = load[-1:].copy()
        gaps = self._times(samples)
        missing, lost = self._sequences(samples)
        self.count += len(load)
        return flags, np.union1d(gaps, missing), lost

    def _runs(self, channel: Channel, readings: _Readings) -> None:
        """Runs of one value while other channels move, over the border of blocks too."""
        values, same, moves, line = readings
        repeats = int(np.count_nonzero(same))
        channel.repeats += repeats
        if repeats + max(channel.run, 1) < STUCK:
            # Too few repeats for a run that counts: only where the last one began is needed.
            last = len(values) - 1 - int(np.argmin(same[::-1])) if repeats < len(values) else 0
            if repeats < len(values):
                channel.run, channel.moving, channel.run_line = 0, 0, int(line[last])
                channel.held = float(values[last])
            channel.run += len(values) - last
            channel.moving += int(np.count_nonzero(moves[last:] & same[last:]))
            return
        starts = np.flatnonzero(~same)
        # The run that goes on from the block before ends where the first new value stands.
        ends = np.append(starts, len(values))
        moved = np.cumsum(same & moves)
        first = int(moved[ends[0] - 1]) if ends[0] else 0
        channel.run, channel.moving = channel.run + int(ends[0]), channel.moving + first
        if not len(starts):
            return
        self._end_run(channel, self.count + int(ends[0]))
        length, inside = np.diff(ends), moved[ends[1:] - 1] - moved[starts]
        for k in np.flatnonzero(length[:-1] >= STUCK):
            channel.run, channel.moving, channel.run_line = int(length[k]), int(inside[k]), int(line[starts[k]])
            channel.held = float(values[starts[k]])
            self._end_run(channel, self.count + int(ends[k + 1]))
        channel.run, channel.moving, channel.run_line = int(length[-1]), int(inside[-1]), int(line[starts[-1]])
        channel.held = float(values[starts[-1]])

    @staticmethod
    def _end_run(channel: Channel, end: int) -> None:
        """end: number of the first sample behind the run."""
        if channel.run >= STUCK and 2 * channel.moving >= channel.run and channel.held != 0:
            channel.first_stuck = channel.first_stuck or channel.run_line
            channel.stuck += channel.run
            channel.longest = max(channel.longest, channel.run)
            channel.held_from.append(end - channel.run)
            channel.held_to.append(end)
            channel.held_at.append(channel.held)

    def _clipped(self, channel: Channel, readings: _Readings, flags: Flags, bit: int) -> None:
        """Runs at the largest and at the smallest value so far; a new extreme starts the count anew. bit: the channel's first
        in the flags."""
        values, same, moves, line = readings
        for side, extreme in enumerate((values.max(), values.min())):
            if extreme > channel.extreme[0] if side == 0 else extreme < channel.extreme[1]:
                channel.extreme[side], channel.clipped[side], channel.at_end[side] = float(extreme), 0, 0
                channel.reset[side], channel.first_clipped[side] = self.count, 0
            elif extreme != channel.extreme[side]:
                continue
            at = np.flatnonzero(values == extreme)
            if len(at) < CLIPPED:
                continue
            for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1):
                # Most repeats inside the run while another channel moves: else all stand still together, which alone tells
                # nothing of a sensor. One whose channels are clipped together stands so now and then.
                if len(run) < CLIPPED or not same[run[1:]].all():
                    continue
                channel.at_end[side] += len(run)
                flags[run] |= np.uint16(1 << (bit + side))
                channel.first_clipped[side] = channel.first_clipped[side] or int(line[run[0]])
                if 2 * np.count_nonzero(moves[run[1:]]) >= len(run) - 1:
                    channel.clipped[side] += len(run)

    def _range(self, load: Array, line: Indices, flags: Flags) -> None:
        for columns, limit in ((slice(0, 3), self.limit[0]), (slice(3, 6), self.limit[1])):
            if limit is None or not load[:, columns].shape[1]:
                continue
            over = (np.abs(load[:, columns]) >= limit * (1 - 1e-9)).any(axis=1)
            if over.any():
                self.first_beyond = self.first_beyond or int(line[np.argmax(over)])
                self.beyond += int(over.sum())
                flags[over] |= np.uint16(1 << 15)

    def _times(self, samples: Samples) -> Indices:
        if samples.time is None:
            return np.empty(0, dtype=np.intp)
        step = np.diff(samples.time, prepend=samples.time[0] if self.last_time is None else self.last_time)
        self.last_time = float(samples.time[-1])
        back = np.flatnonzero(step < 0)
        if len(back):
            self.first_backwards = self.first_backwards or int(samples.line[back[0]])
            self.backwards += len(back)
        if self.period is None:
            return back
        wide = np.flatnonzero(step > GAP * self.period)
        if len(wide):
            self.first_gap = self.first_gap or int(samples.line[wide[0]])
            self.gaps += len(wide)
            self.lost += int(np.sum(np.round(step[wide] / self.period) - 1))
            self.longest_gap = max(self.longest_gap, float(step[wide].max()))
        return np.sort(np.concatenate([back, wide]))

    def _sequences(self, samples: Samples) -> tuple[Indices, Array]:
        if samples.sequence is None:
            return np.empty(0, dtype=np.intp), np.zeros(len(samples))
        step, lost = self.counter.read(samples.sequence)
        again, missing = np.flatnonzero(step == 0), np.flatnonzero(step > 1)
        if len(again):
            self.repeated += len(again)
            self.first_repeated = self.first_repeated or int(samples.line[again[0]])
        # Where times tell of a gap, the same loss is not counted twice.
        if len(missing) and (self.period is None or samples.time is None):
            self.gaps += len(missing)
            self.lost += int(np.sum(step[missing] - 1))
            self.first_gap = self.first_gap or int(samples.line[missing[0]])
        return missing if self.counter.each else missing[:0], lost

    def clipped_sides(self) -> list[tuple[int, int]]:
        """Channel and side (0 largest, 1 smallest) of what is clipped."""
        sides = []
        for number, channel in enumerate(self.channels):
            clipped = [side for side in range(2) if 2 * channel.clipped[side] >= max(channel.at_end[side], 1)]
            others, repeats = channel.elsewhere(self.count, clipped)
            if others >= FEWEST and repeats <= REPEATS * others:
                sides += [(number, side) for side in clipped]
        return sides

    def unsound(self, flags: Flags, number: Indices) -> NDArray[np.bool_]:
        """Which samples (n,) are saturated for certain. number (n,): each sample's, from 0."""
        bad = (flags & np.uint16(1 << 15)) != 0
        for channel, side in self.clipped_sides():
            bad |= ((flags >> np.uint16(2 * channel + side)) & 1 == 1) & (number >= self.channels[channel].reset[side])
        return np.asarray(bad)

    def close(self) -> None:
        """All samples were looked at: the runs that reach to the end are over."""
        for channel in (*self.channels, self.together):
            if channel.run != self.count:
                self._end_run(channel, self.count)

    def no_forces(self, number: Indices, weight: Array, beside: int) -> NDArray[np.bool_]:
        """Which rows (n,), the means of `weight` samples from `number` (n,) on, hold a reading that stood still, or are within
        `beside` samples of one: what stands there is no force."""
        stood = [channel for channel in self.channels if channel.stuck and channel.run != self.count and self._told(channel)]
        stood += [self.together] if self._all_stood() else []
        bad = np.zeros(len(number), dtype=bool)
        for channel in stood:
            start, end = np.array(channel.held_from) - beside, np.array(channel.held_to) + beside
            # The first run that ends behind the row's beginning: does it begin before the row's end?
            run = np.searchsorted(end, number, side="right")
            bad |= (run < len(end)) & (start[np.minimum(run, len(end) - 1)] < number + weight)
        return np.asarray(bad)

    def findings(self) -> list[Finding]:
        """What was found."""
        return [*self._saturated(), *self._stuck(), *self._lost()]

    def _saturated(self) -> list[Finding]:
        findings = []
        hint = "the true force is larger than logged there: a larger range, or a lighter cut"
        if self.beyond:
            findings.append(Finding("CS3023", "warning", f"{counted(self.beyond, 'sample')} at or beyond the sensor's range "
                                    "stated in cell.yaml", file=self.source, line=self.first_beyond, hint=hint))
        for number, side in self.clipped_sides():
            channel = self.channels[number]
            findings.append(Finding(
                "CS3023", "warning", f"{AXES[number]}: {counted(channel.at_end[side], 'sample')} in runs of exactly "
                f"{channel.extreme[side]:.6g}, its {('largest', 'smallest')[side]} value: saturated", file=self.source,
                line=channel.first_clipped[side], hint=hint))
        return findings

    def _stuck(self) -> list[Finding]:
        findings = []
        moving = any(channel.repeats < REPEATS * self.count for channel in self.channels)
        silent = sum(channel.run == self.count for channel in self.channels[:len(AXES) // 2])
        for number, channel in enumerate(self.channels):
            if channel.run == self.count:
                # From the first sample to the last. A moment of zeros may just not be there, nor two forces, nor one that was
                # calculated; one of three that a sensor reads is lost.
                if moving and self.count >= FEWEST:
                    zero = channel.held == 0 and (number >= len(AXES) // 2 or silent > 1 or self.turns < NOISY * self.count)
                    level: Level = "note" if zero else "warning"
                    findings.append(Finding("CS3024", level, f"{AXES[number]} is {channel.held:.6g} in all "
                                            f"{counted(self.count, 'sample')}", file=self.source, line=channel.run_line,
                                            hint="check the cable and the channel" if not zero else ""))
            elif channel.stuck and self._told(channel):
                findings.append(Finding(
                    "CS3024", "warning", f"{AXES[number]} stood still while others moved: {counted(channel.stuck, 'sample')}, "
                    f"the longest run {channel.longest}", file=self.source, line=channel.first_stuck,
                    hint="these samples are not used: check the cable and the channel, and log the pass again"))
        findings += [Finding("CS3024", "warning", f"{AXES[one]} and {AXES[other]} are the same in all "
                             f"{counted(self.count, 'sample')}", file=self.source, hint="one column was written twice?")
                     for alike, (one, other) in zip(self.alike, PAIRS, strict=True)
                     if alike and moving and self.count >= FEWEST and self.channels[one].run != self.count]
        all_of_it = self.together
        if self._all_stood():
            findings.append(Finding(
                "CS3024", "warning", f"all channels stood still together: {all_of_it.stuck} samples, the longest run "
                f"{all_of_it.longest}", file=self.source, line=all_of_it.first_stuck,
                hint="the logger repeats the last reading it got: these samples are not used; log the pass again"))
        return findings

    def _all_stood(self) -> bool:
        """Whether all channels stood still together, in a log that has noise elsewhere."""
        noisy = self.turns >= NOISY * (self.count - self.together.stuck)
        return bool(self.together.stuck and noisy and self._told(self.together))

    def _told(self, channel: Channel) -> bool:
        """Whether the samples beside the runs that stood still are enough, and move."""
        others = self.count - channel.stuck
        return others >= FEWEST and channel.repeats - channel.stuck <= REPEATS * others

    def _lost(self) -> list[Finding]:
        findings = []
        if self.gaps:
            level: Level = "warning" if self.lost > 1e-3 * self.count else "note"
            longest = f", the longest {self.longest_gap:.3g} s" if self.longest_gap else ""
            findings.append(Finding(
                "CS3025", level, f"{counted(self.lost, 'sample')} of {self.count + self.lost} lost in "
                f"{counted(self.gaps, 'gap')}{longest}", file=self.source, line=self.first_gap,
                hint="a gap keeps its place; many say that the network or the disk is too slow"))
        if self.repeated:
            findings.append(Finding(
                "CS3025", "warning", f"{counted(self.repeated, 'sample')} with the sequence number of the one before",
                file=self.source, line=self.first_repeated))
        if self.backwards:
            findings.append(Finding(
                "CS3025", "warning", f"time runs back {self.backwards} times: more than one log in this file, or a clock that "
                "was set", file=self.source, line=self.first_backwards))
        return findings
