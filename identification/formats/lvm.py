"""LabVIEW measurement files (.lvm): tab separated text, a header, then segments each with a header of its own.

Header lines are a tag and its values: `Separator` (the character behind it stands in place of tabs), `Decimal_Separator`,
`X_Columns` (No, One, Multi); a segment has `Channels`, `Samples`, `X0` and `Delta_X`, one value a channel, and ends its header
with `***End_of_Header***` and a line of column names.
Time is X0 + row Delta_X: a segment carries its own offset, so blocks written one behind the other stand at their true times.
(NI, "Specification for the LabVIEW Measurement File".)
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.common.findings import Finding, counted, error
from identification.common.sizes import LARGEST_CELL
from identification.formats.force_samples import ForceSamples

Array = NDArray[np.float64]
CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
END = "***End_of_Header***"
# Units that a file may state, without the sign between their factors, and what makes newtons or newton metres of them.
NEWTONS = {"N": 1.0, "Newton": 1.0, "Newtons": 1.0, "newton": 1.0, "newtons": 1.0, "kN": 1e3, "mN": 1e-3,
           "lbf": 4.4482216152605, "kgf": 9.80665}
NEWTON_METRES = {"Nm": 1.0, "Newtonmeter": 1.0, "Newtonmeters": 1.0, "kNm": 1e3, "Nmm": 1e-3, "mNm": 1e-3, "Ncm": 1e-2,
                 "lbfft": 1.3558179483314, "lbfin": 0.1129848290276, "kgfm": 9.80665, "kgfcm": 0.0980665, "kgfmm": 0.00980665}
# Names of channels that are none, whatever they are chosen for.
NO_LOAD = re.compile(r"tach|rpm|speed|drehzahl", re.IGNORECASE)
# A step between blocks that is longer than this many samples is a gap.
GAP = 1.5


@dataclass(frozen=True, eq=False)
class Segment:
    """One block: names of its channels, their stated units ("" where none is), time (n, c), step (c,) [s], values (n, c)."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    time: Array
    step: Array
    values: Array


def read_lvm(file: str | Path, channels: Sequence[str] = CHANNELS) -> ForceSamples:
    """Reads a force log; channels: names of the three force channels and, or not, three moment channels.

    Raises CompstiffError: CS0005 cannot be read, CS0201 no such file, CS0202 a channel is missing, CS0203 not a number,
    CS1612 a channel is no force.
    """
    name = str(file)
    segments = read_segments(file)
    present = [channel for channel in channels if channel in segments[0].names]
    if len(present) not in (3, 6) or list(channels[:3]) != present[:3]:
        missing = ", ".join(channel for channel in channels[:3] if channel not in present)
        raise error("CS0202", f"channels missing: {missing or 'a moment'}; found {', '.join(segments[0].names)}", file=name,
                    hint="convert --channels Fx,Fy,Fz,Mx,My,Mz names them as the file does, the forces first, in the order "
                    "of the sensor's axes")
    for segment in segments:
        if segment.names != segments[0].names:
            raise error("CS0202", f"a block has channels {', '.join(segment.names)}, the first has "
                        f"{', '.join(segments[0].names)}", file=name)
    place = [segments[0].names.index(channel) for channel in present]
    time = np.concatenate([segment.time[:, place[0]] for segment in segments])
    if not len(time):
        raise error("CS0201", "has no row of data", file=name, hint="was the measurement stopped before it began?")
    for segment in segments:
        _at_once(segment, place, name)
    findings: list[Finding] = []
    scale = [_scale(segment, place, name, findings) for segment in segments]
    values = np.concatenate([segment.values[:, place] * each for segment, each in zip(segments, scale, strict=True)])
    if len(time) > 1:
        step = np.diff(time)
        gaps, back = int(np.sum(step > GAP * np.median(step))), int(np.sum(step <= 0))
        if gaps or back:
            said = [counted(gaps, "gap")] * bool(gaps) + [f"{counted(back, 'step')} back in time"] * bool(back)
            findings.append(Finding("CS0205", "warning", f"{' and '.join(said)} between blocks", file=name,
                                    hint="blocks were not acquired without a break"))
    return ForceSamples(name, time - time[0], values[:, :3], values[:, 3:] if len(present) == 6 else None,
                        findings=tuple(findings))


def _at_once(segment: Segment, place: list[int], name: str) -> None:
    """Refuses channels that were not taken at the times of the first of them, to half a sample (CS0201)."""
    if not len(segment.time):
        return
    apart = np.abs(segment.time[:, place] - segment.time[:, place[:1]]).max(axis=0)
    worst = int(np.argmax(apart))
    if apart[worst] > 0.5 * segment.step[place[0]]:
        raise error("CS0201", f"channel {segment.names[place[worst]]} was not taken at the times of {segment.names[place[0]]}, "
                    f"by X0 and Delta_X: up to {apart[worst]:.4g} s apart", file=name,
                    hint="log the channels of the force with one clock, or give them as CSV, each row at one time")


def _scale(segment: Segment, place: list[int], name: str, findings: list[Finding]) -> Array:
    """What makes newtons, then newton metres of the channels at `place`; a unit that is none of either is refused."""
    scale = np.ones(len(place))
    said = {finding.message for finding in findings}
    unstated = []
    for k, column in enumerate(place):
        channel, unit = segment.names[column], segment.units[column]
        what, known = ("a force", NEWTONS) if k < 3 else ("a moment", NEWTON_METRES)
        told = re.sub(r"[\s*\N{MIDDLE DOT}-]", "", unit).rstrip(".")
        if (unit and told not in known) or NO_LOAD.search(channel):
            raise error("CS1612", f"channel {channel} is {f'in {unit}' if unit else 'a speed by its name'}, not {what}",
                        file=name, hint="volts need the sensor's calibration: log newtons, or scale the columns and give "
                        "them as CSV; name other channels where these are not the force's")
        scale[k] = known.get(told, 1.0)
        if not unit:
            unstated.append(channel)
        elif scale[k] != 1.0:
            text = f"channel {channel} is in {unit}: taken times {scale[k]:g}"
            findings += [Finding("CS1613", "note", text, file=name)] if text not in said else []
    if unstated:
        text = f"states no unit for {', '.join(unstated)}: taken for newtons and newton metres"
        findings += [Finding("CS1613", "note", text, file=name)] if text not in said else []
    return scale


def read_segments(file: str | Path) -> list[Segment]:
    """All blocks of the file in their order."""
    name = str(file)
    try:
        lines = Path(file).read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=name) from reason
    if not lines or not lines[0].startswith("LabVIEW Measurement"):
        raise error("CS0201", "is not a LabVIEW measurement file: its first line names another", file=name, line=1)
    ends = [k for k, line in enumerate(lines) if line.startswith(END)]
    if not ends:
        raise error("CS0201", f"has no {END}", file=name, line=len(lines))
    # By the specification the character behind the word is it, in the headers too; a header of tabs may name the comma.
    behind = next((line.removeprefix("Separator")[0] for line in lines[: ends[0]] if re.match("Separator.", line)), "\t")
    tags = _tags(lines[: ends[0]], behind)
    separator = "," if tags.get("Separator") == ["Comma"] else behind
    segments = []
    start = ends[0] + 1
    for k, end in enumerate(ends[1:], start=1):
        stop = len(lines) if k + 1 == len(ends) else _next_header(lines, end, ends[k + 1])
        segments.append(_segment(lines, start, end, stop, separator, tags, name))
        start = stop
    if not segments:
        raise error("CS0201", "has a header and no block of data", file=name, line=ends[0] + 1)
    return segments


def _next_header(lines: list[str], end: int, following: int) -> int:
    """Where the header of the next block begins: its line `Channels`."""
    return next((k for k in range(following, end, -1) if lines[k].startswith("Channels")), following)


def _tags(lines: list[str], separator: str) -> dict[str, list[str]]:
    parted = [line.split(separator) for line in lines if line.strip()]
    return {cells[0].strip(): [cell.strip() for cell in cells[1:] if cell.strip()] for cells in parted}


def _segment(
    lines: list[str], start: int, end: int, stop: int, separator: str, header: dict[str, list[str]], name: str
) -> Segment:
    tags = _tags(lines[start:end], separator)
    decimal = next(iter(header.get("Decimal_Separator", [])), ".")
    if decimal not in (".", ",") or decimal == separator:
        raise error("CS0201", f"Decimal_Separator is '{decimal}' and cells are separated by '{separator}'", file=name,
                    hint="a point or a comma, and not what separates the cells")
    try:
        count = int(tags["Channels"][0])
        offsets, steps = ([float(cell.replace(decimal, ".")) for cell in tags[tag]] for tag in ("X0", "Delta_X"))
    except (KeyError, IndexError, ValueError) as reason:
        raise error("CS0201", f"a block without Channels, X0 or Delta_X: {reason}", file=name, line=end + 1) from reason
    if not all(math.isfinite(value) and abs(value) <= LARGEST_CELL for value in (*offsets, *steps)):
        raise error("CS0203", "X0 or Delta_X is no number of seconds", file=name, line=end + 1)
    if count < 1 or len(offsets) != count or len(steps) != count:
        raise error("CS0201", f"{count} channels with {len(offsets)} values of X0 and {len(steps)} of Delta_X", file=name,
                    line=end + 1)
    x_columns = next(iter(header.get("X_Columns", [])), "One")
    if x_columns not in ("No", "One", "Multi"):
        raise error("CS0201", f"X_Columns is '{x_columns}', expected No, One or Multi", file=name)
    titles = [cell.strip() for cell in lines[end + 1].split(separator)] if end + 1 < stop else []
    # X columns stand first, or before each channel; the last title is the comment's.
    columns = list(range(1, 2 * count, 2)) if x_columns == "Multi" else list(range(1, count + 1))
    if len(titles) <= columns[-1]:
        raise error("CS0201", f"the line of column names has {len(titles)} cells, expected {columns[-1] + 1} or more",
                    file=name, line=end + 2)
    body = [k for k in range(end + 2, stop) if lines[k].strip()]
    values = _numbers([lines[k] for k in body], columns, separator, decimal, name, [k + 1 for k in body])
    rows = np.arange(len(values))[:, None]
    stated = next((line.split(separator)[1:] for line in lines[start:end] if line.startswith("Y_Unit_Label")), [])
    units = tuple(stated[k].strip() if k < len(stated) else "" for k in range(count))
    step = np.array(steps)
    return Segment(tuple(titles[k] for k in columns), units, np.array(offsets) + rows * step, step, values)


def _numbers(body: list[str], columns: list[int], separator: str, decimal: str, name: str, line: list[int]) -> Array:
    """The columns (n, c) of rows of text that stand on these lines."""
    if not body:
        return np.empty((0, len(columns)))
    wide = "\n".join(separator.join(line.split(separator)[: columns[-1] + 1]) for line in body)
    try:
        frame = pd.read_csv(io.StringIO(wide), sep=separator, header=None, decimal=decimal, quoting=csv.QUOTE_NONE,
                            low_memory=False, names=range(columns[-1] + 1))
    except pd.errors.ParserError as reason:
        raise error("CS0201", f"a block is not a table: {reason}", file=name, line=line[0]) from reason
    numbers = frame.reindex(columns=columns).apply(pd.to_numeric, errors="coerce")
    values = np.asarray(numbers.to_numpy(dtype=float), dtype=float)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        raise error("CS0203", "expected a finite number", file=name, line=line[int(bad[0][0])],
                    column=columns[int(bad[0][1])] + 1)
    return values
