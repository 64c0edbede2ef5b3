"""Two logged passes of one program: do their forces agree target by target, and if not, what would make them?

b, the force of one pass at each target, is compared with g a, that of the other times one common factor. Where g a leaves
more than DIFFERS of b's energy, readings of one log that people get wrong are tried in its place: the opposite sign, other
axes (the best rotation or mirror image of all), another place along the path, a constant more. One is named where it leaves
less than half of what g a leaves, and less than EXPLAINED; else they are logs of two jobs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.forces.target_forces import TargetForces
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import CompstiffError, Finding, Refused, counted

# Two passes of one job leave a few hundredths of the energy (wear, another depth, noise); engineering judgement, held against
# jobs of the virtual cell's end mill in benchmarks/two_logs.py.
DIFFERS, EXPLAINED = 0.25, 0.12
# A displaced log that agrees roughly is said where it would leave less than half, and the passes differ by more than this.
WORTH_SAYING = 0.02
# A simpler reading is as good up to this factor.
ABOUT = 1.5
# A target differs where it is off by so many standard errors, by this share of the largest force, and by so much [N].
SIGMAS, SHARE, LEAST = 5.0, 0.2, 5.0
# Places are tried up to this share of the path's length away, the factor of the second pass is told from these on.
REACH, TRIED, USUAL = 0.25, 121, (0.67, 1.5)
FEWEST = 6


@dataclass(frozen=True)
class Reading:
    """One way to read the second log: code of the finding, what is wrong with one of the logs, the share of the energy that
    it leaves, and what to look at."""

    code: str
    text: str
    left: float
    hint: str


def compared(first: TargetForces, second: TargetForces, path: RobotPath) -> list[Finding]:
    """What is to be said of two logs placed on one path.

    Raises CompstiffError (CS3118) for one log given twice, Refused (CS3110 sign, CS3111 axes, CS3112 place, CS3113 zero, CS3114
    nothing that would mend it) where they contradict each other.
    """
    names = f"{first.log.source} and {second.log.source}"
    both = (first.samples > 0) & (second.samples > 0) & (first.forced | second.forced)
    source = second.log.source
    if both.sum() < FEWEST:
        raise Refused(Finding("CS3114", "error", f"{names} have {counted(int(both.sum()), 'target')} with force in common, too "
                              "few to compare", file=source, hint="are they logs of this program?"))
    a, b = first.wrench[both, :3], second.wrench[both, :3]
    if a.shape == b.shape and np.array_equal(a, b):
        raise CompstiffError(Finding("CS3118", "error", f"{names} have the very same force at all {both.sum()} targets",
                                     file=source, hint="two passes never do: name the log of the other pass"))
    factor, plain = _scaled(a, b)
    # The simplest first: one that is all but as good as the best.
    readings = [_opposite(a, b), _displaced(a, b, path.length[both]), _more(a, b), _turned(a, b)]
    least = min(reading.left for reading in readings)
    best = next(reading for reading in readings if reading.left <= ABOUT * least + 0.2 * WORTH_SAYING)
    if plain > DIFFERS:
        apart = f"{names} do not agree: {100 * min(plain, 1):.0f} % of the force of one is not that of the other"
        if best.left < min(0.5 * plain, EXPLAINED):
            raise Refused(Finding(best.code, "error", f"{apart}; {best.text} leaves {100 * best.left:.0f} %", file=source,
                                  hint=best.hint))
        raise Refused(Finding("CS3114", "error", f"{apart}, and no sign, frame, displacement or zero mends it", file=source,
                              hint="is each the log of this program, placed by the same columns? Else the cut was another: "
                              "other stock, tool, feed or depth"))
    findings = [Finding("CS3115", "warning" if not USUAL[0] < factor < USUAL[1] else "note",
                        f"{names} agree at {both.sum()} targets: the force of the second is {factor:.2f} times that of the "
                        f"first, and {100 * plain:.1f} % of its energy differs", file=source)]
    if plain > WORTH_SAYING and best.left < 0.5 * plain:
        findings.append(Finding(best.code, "warning", f"{names} agree better with {best.text}: {100 * best.left:.1f} % differs "
                                f"in place of {100 * plain:.1f} %", file=source, hint=best.hint))
    return [*findings, *_differing(first, second, factor, both, path)]


def _left(b: Array, model: Array) -> float:
    """The share of the energy of b (n, 3) that a model leaves; of no force nothing is told."""
    return float(np.sum((b - model) ** 2) / np.sum(b**2)) if b.any() else 1.0


def _scaled(a: Array, b: Array) -> tuple[float, float]:
    """The common factor g, not negative, and the share of the energy of b (n, 3) that g a leaves."""
    factor = max(float(np.sum(a * b) / max(np.sum(a**2), 1e-300)), 0.0)
    return factor, _left(b, factor * a)


def _opposite(a: Array, b: Array) -> Reading:
    return Reading("CS3110", "the opposite sign of one of them", _scaled(-a, b)[1],
                   "was one log written with another sign (on_tool, by_tool) or by another amplifier? Push the tool by hand")


def _turned(a: Array, b: Array) -> Reading:
    """The best orthogonal matrix; named by the axes where it swaps or flips them."""
    u, size, vt = np.linalg.svd(b.T @ a)
    turn = u @ vt
    if size[1] < 2e-3 * size[0]:        # forces along one line do not tell a rotation
        return Reading("CS3111", "", np.inf, "")
    turned = a @ turn.T
    _, left = _scaled(turned, b)
    axes = [f"{'-' if turn[row, place] < 0 else ''}{'xyz'[place]}" for row, place in enumerate(np.abs(turn).argmax(axis=1))]
    clear = axes != ["x", "y", "z"] and bool((np.abs(turn).max(axis=1) > 0.95).all())
    # What is mirrored besides is so along the axis about which it is turned.
    angle = np.degrees(np.arccos(np.clip((np.trace(turn) - np.sign(np.linalg.det(turn))) / 2, -1, 1)))
    how = f"x y z of one as {' '.join(axes)} of the other" if clear else (
        f"axes turned by {angle:.0f} deg" + (" and mirrored" if np.linalg.det(turn) < 0 else ""))
    return Reading("CS3111", how, left, "was the sensor mounted or zeroed anew, are its columns in another order, or does one "
                   "log have another frame? One force_log in cell.yaml cannot read both")


def _displaced(a: Array, b: Array, length: Array) -> Reading:
    """The first log read some way further on or back along the path, length (n,) [m]."""
    reach = REACH * float(np.ptp(length))
    tried = np.linspace(-reach, reach, TRIED)
    order = np.argsort(length)
    left = []
    for away in tried:
        at = length + away
        inside = (at >= length.min()) & (at <= length.max())
        moved = np.column_stack([np.interp(at[inside], length[order], axis[order]) for axis in a.T])
        left.append(_scaled(moved, b[inside])[1] if inside.sum() >= FEWEST else np.inf)
    best = int(np.argmin(left))
    which = "the first" if tried[best] < 0 else "the second"
    return Reading("CS3112", f"{which} placed {1e3 * abs(tried[best]):.0f} mm further along the path", float(left[best]),
                   "are the clocks right, and do both logs begin where the program does? Log the target number or the position")


def _more(a: Array, b: Array) -> Reading:
    """A constant besides."""
    deviation = a - a.mean(axis=0)
    factor = float(np.sum(deviation * b) / max(np.sum(deviation**2), 1e-300))
    constant = b.mean(axis=0) - factor * a.mean(axis=0)
    left = _left(b, factor * a + constant) if factor > 0 else np.inf
    named = " ".join(str(round(x)) for x in constant.tolist())
    return Reading("CS3113", f"a constant of {named} N less in the second (base frame)", left,
                   "was the sensor zeroed under load, or does --tare name a cut in one of the logs?")


def _differing(
    first: TargetForces, second: TargetForces, factor: float, both: NDArray[np.bool_], path: RobotPath
) -> list[Finding]:
    """The targets whose forces differ beyond their scatter, in runs."""
    off = np.linalg.norm(second.wrench[:, :3] - factor * first.wrench[:, :3], axis=1)
    variance = np.nan_to_num(second.standard_error) ** 2 + factor**2 * np.nan_to_num(first.standard_error) ** 2
    error = np.sqrt(variance.sum(axis=1))
    largest = float(np.linalg.norm(second.wrench[:, :3], axis=1).max())
    apart = both & (off > np.maximum(max(LEAST, SHARE * largest), SIGMAS * error))
    if not apart.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], apart.astype(int), [0]])))
    runs = [f"{low}" if high - low == 1 else f"{low} to {high - 1}" for low, high in zip(edges[::2], edges[1::2], strict=True)]
    worst = int(np.argmax(np.where(apart, off, 0.0)))
    many = counted(int(apart.sum()), "target")
    return [Finding("CS3116", "warning", f"the forces of the two logs differ beyond their scatter at {many} "
                    f"({', '.join(runs[:5])}{' ...' if len(runs) > 5 else ''}), most at target {worst}, by {off[worst]:.0f} N",
                    file=path.toolpath.source, line=int(path.toolpath.line[worst]), target=worst,
                    hint="look there: a chip, other stock, a stop, a lost sample")]
