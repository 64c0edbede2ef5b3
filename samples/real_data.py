"""docs/real-data.md and its pictures, from the two measured records of a KUKA KR300.

    python -m samples.real_data FOLDER

FOLDER holds data_A.mat and data_B.mat (github.com/JonasWeigand/Robot_Identification, commit 9e403c0, MIT licence); neither is
part of this project.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from identification.motion.axis_diagnosis import MICRO, AxisDiagnosis
from identification.motion.band import BAND
from identification.motion.lines import Line, fitted, session
from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.prediction import held_out
from identification.motion.procedure import diagnose_axes
from identification.motion.stiffness import DISAGREE, AxisStiffness, axis_stiffness
from identification.motion.transmission import ODDS, Transmission
from samples.pictures import Panel, Series, svg

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent / "docs"
BEFORE, AFTER = "#c0392b", "#2b6ca3"
# Model stiffness of axes 1-3 in the authors' own controller model (`para.c_rad_ff`) [N m/rad], and their gear ratios.
AUTHORS = {1: 4.5778e6, 2: 7.5189e6, 3: 4.0999e6}
RATIO = {1: 256.857, 2: 267.429, 3: 252.333}
# By how much the tested record's link encoder is turned, to see what that does; lines of A and B nearer than this are one.
MOVED_DEG, SAME_CYCLES = 0.14, 4.0
# The other record, by source.
OTHERS: dict[str, MotionLog] = {}


def main() -> None:
    """Writes the page and its pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--docs", type=Path, default=DOCS, help="where real-data.md goes")
    chosen = parser.parse_args()
    a, b = (read_motion_log(next(iter(sorted(chosen.folder.rglob(f"data_{name}.mat"))))) for name in "AB")
    OTHERS.update({a.source: b, b.source: a})
    found = {"A": diagnose_axes([a], b, replicates=199), "B": diagnose_axes([b], a, replicates=199)}
    both = diagnose_axes([a, b], replicates=199)
    pictures = chosen.docs / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    for name, panels in (("real-torque", [_torque(one) for one in found["A"]]),
                         ("real-residual", [_residual(one) for one in found["A"]]),
                         ("real-held-out", [_held_out(one) for one in found["A"]]),
                         ("real-spectrum", [_spectrum(one) for one in found["A"]])):
        (pictures / f"{name}.svg").write_text(svg(panels), encoding="utf-8")
    text = (HERE / "real_data.md.in").read_text(encoding="utf-8")
    tables = {"PLAIN": _plain(a, b), "NAMED": _named(found), "GAIN": _gain(found), "ZEROS": _zeros(found),
              "LINES": _lines(found, a, b), "SMOOTH": _smooth(found), "STIFFNESS": _stiffness(found, both, a, b),
              "AGREE": _agree([one.stiffness for one in both]), "LEFT": _left(found), "CLAIMS": _claims(found, both, a, b)}
    for name, table in tables.items():
        text = text.replace(f"<!-- {name} -->", table)
    (chosen.docs / "real-data.md").write_text(text, encoding="utf-8")


def _some(*columns: np.ndarray) -> list[np.ndarray]:
    step = max(1, len(columns[0]) // 420)
    return [column[::step] for column in columns]


def _torque(one: AxisDiagnosis) -> Panel:
    torque = one.axis.logs[0].torque
    c = float(one.named.solved.coefficients[1])
    spring = MICRO * (c * (torque - torque.mean()) + one.residuals[:, 1])
    x, before, after = _some(torque / 1e3, MICRO * (one.deflection - one.deflection.mean()), spring - spring.mean())
    return Panel(f"axis {one.joint}", "torque, gear side [kN m]", "motor minus link [urad]",
                 [Series(x, before, BEFORE, "as measured"), Series(x, after, AFTER, "without what was named")])


def _residual(one: AxisDiagnosis) -> Panel:
    x, before, after = _some(one.axis.logs[0].time, *(MICRO * one.residuals.T))
    return Panel(f"axis {one.joint}, fitted on A", "time [s]", "residual [urad]",
                 [Series(x, before, BEFORE, "plain spring", True), Series(x, after, AFTER, "extended model", True)])


def _held_out(one: AxisDiagnosis) -> Panel:
    assert one.gain is not None
    time = 4e-3 * np.arange(len(one.gain.residuals))
    x, before, after = _some(time, *(MICRO * one.gain.residuals.T))
    return Panel(f"axis {one.joint}, fitted on A, seen on B", "time [s]", "residual [urad]",
                 [Series(x, before, BEFORE, "plain spring", True), Series(x, after, AFTER, "extended model", True)])


def _spectrum(one: AxisDiagnosis) -> Panel:
    left = one.residuals[:, 1] - one.residuals[:, 1].mean()
    rate = one.axis.rates[0]
    length, parts = 500, []
    for start in range(0, len(left) - length + 1, length // 2):
        parts.append(np.abs(np.fft.rfft(left[start: start + length] * np.hanning(length))) ** 2)
    power = np.mean(parts, axis=0) / (rate * np.sum(np.hanning(length) ** 2)) * 2 * MICRO**2
    frequency = np.fft.rfftfreq(length, 1 / rate)
    return Panel(f"axis {one.joint}, what is left on A", "frequency [Hz]", "log10 of urad^2/Hz",
                 [Series(frequency[1:], np.log10(power[1:]), AFTER, "extended model", True)])


def _share(y: np.ndarray, *columns: np.ndarray) -> float:
    wide = np.column_stack([np.ones_like(y), *columns])
    left = y - wide @ np.linalg.lstsq(wide, y, rcond=None)[0]
    return 1 - float(np.var(left) / np.var(y))


def _plain(a: MotionLog, b: MotionLog) -> str:
    rows = ["| axis | record | deflection RMS [µrad] | torque | torque, its friction sign | speed alone | torque and speed |",
            "|---|---|---|---|---|---|---|"]
    for joint in a.joints:
        for name, log in (("A", a), ("B", b)):
            one = log.joints[joint]
            y, t, v = one.deflection, one.torque, one.speed
            shares = [_share(y, t), _share(y, t, np.sign(v)), _share(y, v), _share(y, t, v)]
            told = " | ".join(f"{100 * share:.1f} %" for share in shares)
            rows.append(f"| {joint} | {name} | {MICRO * np.std(y):.0f} | {told} |")
    return "\n".join(rows)


def _named(found: dict[str, tuple[AxisDiagnosis, ...]]) -> str:
    rows = ["| axis | record | verdict | named (probability) | link delay [ms] (95 %) | others, not settled (probability) | "
            "withdrawn |", "|---|---|---|---|---|---|---|"]
    for name, axes in found.items():
        for one in axes:
            named = ", ".join(f"{cause.shape.name} ({cause.probability:.2f})" for cause in one.causes) or "-"
            delays = [cause for cause in one.causes if cause.shape.name == "channel_delay (link)"]
            delay = "-"
            if delays:
                value, half = 1e3 * delays[0].values[0], 1.96e3 * delays[0].std[0]
                delay = f"{value:.2f} ({value - half:.2f} ... {value + half:.2f})"
            others = ", ".join(f"{cause.shape.name} ({cause.probability:.2f})" for cause in one.alternatives
                               if cause.probability >= 0.1)
            rows.append(f"| {one.joint} | {name} | {one.verdict} | {named} | {delay} | {others or '-'} | "
                        f"{', '.join(one.withdrawn) or '-'} |")
    return "\n".join(rows)


def _gain(found: dict[str, tuple[AxisDiagnosis, ...]]) -> str:
    rows = ["| axis | fitted on | there: RMS plain → extended [µrad] | tested on | there: RMS plain → extended [µrad] | "
            "variance explained | ratio (95 %) | without the transmission error |", "|---|---|---|---|---|---|---|---|"]
    for name, axes in found.items():
        for one in axes:
            rms = np.std(one.residuals, axis=0)
            line = (f"| {one.joint} | {name} | {MICRO * rms[0]:.0f} → {MICRO * rms[1]:.0f} | {'B' if name == 'A' else 'A'} | ")
            gain = one.gain
            assert gain is not None
            without = held_out(one.joint, BAND, one.named, Transmission(one.joint), list(one.records), _other(one))[0]
            rows.append(line + (
                f"{MICRO * gain.before:.0f} → {MICRO * gain.after:.0f} | {100 * gain.explained[0]:.1f} → "
                f"{100 * gain.explained[1]:.1f} % | {gain.ratio:.1f} ({gain.interval[0]:.1f} ... {gain.interval[1]:.1f}) | "
                f"{without.ratio:.1f} |"))
    return "\n".join(rows)


def _zeros(found: dict[str, tuple[AxisDiagnosis, ...]]) -> str:
    """The ratio with each record's own zero, with the fitted record's, and both once the other record's zero is moved."""
    rows = ["| axis | fitted on, tested on | zero, A to B [µrad] (95 %) | ratio, own zero | ratio, zero of the fitted record | "
            f"own zero, link encoder moved by {MOVED_DEG:g}° | zero of the fitted record, moved |",
            "|---|---|---|---|---|---|---|"]
    for name, axes in found.items():
        for one in axes:
            gain, other = one.gain, _other(one)
            assert gain is not None
            away = other.less(one.joint, np.full(len(other.time), np.radians(MOVED_DEG)))
            moved = held_out(one.joint, BAND, one.named, one.transmission, list(one.records), away)[0]
            zero = one.zeros[0]
            sign = 1 if name == "A" else -1
            shift, half = sign * MICRO * zero.shift, 1.96 * MICRO * zero.std
            rows.append(f"| {one.joint} | {name}, {'B' if name == 'A' else 'A'} | {shift:.0f} ({shift - half:.0f} ... "
                        f"{shift + half:.0f}) | {gain.ratio:.1f} | {gain.with_zero[0] / gain.with_zero[1]:.1f} | "
                        f"{moved.ratio:.1f} | {moved.with_zero[0] / moved.with_zero[1]:.1f} |")
    return "\n".join(rows)


def _pairs(found: dict[str, tuple[AxisDiagnosis, ...]], k: int) -> list[tuple[Line | None, Line | None]]:
    """Lines searched in A and in B that are the same."""
    of_a, of_b = (list(found[name][k].transmission.lines) for name in "AB")
    pairs: list[tuple[Line | None, Line | None]] = []
    for line in of_a:
        near = min(of_b, key=lambda other: abs(other.cycles - line.cycles), default=None)
        same = near if near is not None and abs(near.cycles - line.cycles) < SAME_CYCLES else None
        if same is not None:
            of_b.remove(same)
        pairs.append((line, same))
    pairs += [(None, line) for line in of_b]
    return sorted(pairs, key=lambda pair: next(line.cycles for line in pair if line))


def _lines(found: dict[str, tuple[AxisDiagnosis, ...]], a: MotionLog, b: MotionLog) -> str:
    rows = ["| axis | found in A: a turn | found in B | turns of the motor | amplitude in A, B [µrad] | phase in A, B [rad] | "
            "found again: A's in B, B's in A |", "|---|---|---|---|---|---|---|"]
    for k, joint in enumerate(a.joints):
        pairs = _pairs(found, k)
        cycles = np.array([np.mean([line.cycles for line in pair if line]) for pair in pairs])
        sizes = [fitted(session(joint, [log]), cycles).amplitudes for log in (a, b)]
        for pair, each, of_a, of_b in zip(pairs, cycles, *sizes, strict=True):
            told = [f"{line.cycles:.1f} ± {line.std:.1f}" if line else "-" for line in pair]
            again = [("yes" if line.confirmed else "no") if line else "-" for line in pair]
            rows.append(f"| {joint} | {told[0]} | {told[1]} | {each / RATIO[joint]:.3f} | {MICRO * abs(of_a):.1f}, "
                        f"{MICRO * abs(of_b):.1f} | {np.angle(of_a):.1f}, {np.angle(of_b):.1f} | {', '.join(again)} |")
    return "\n".join(rows)


def _smooth(found: dict[str, tuple[AxisDiagnosis, ...]]) -> str:
    rows = ["| axis | fitted on | evidence there (ln) | tested on, under 6 Hz: RMS without → with [µrad] | ratio (95 %) | "
            "named |", "|---|---|---|---|---|---|"]
    for name, axes in found.items():
        for one in axes:
            test = one.transmission.smooth_test
            if test is None:
                rows.append(f"| {one.joint} | {name} | under {np.log(ODDS):.0f} | - | - | no |")
                continue
            tested = "B" if name == "A" else "A"
            rows.append(f"| {one.joint} | {name} | {test.log_odds:.0f} | {tested}: {MICRO * test.before:.0f} → "
                        f"{MICRO * test.after:.0f} | {test.before / test.after:.2f} ({test.interval[0]:.2f} ... "
                        f"{test.interval[1]:.2f}) | {'yes' if test.confirmed else 'no'} |")
    return "\n".join(rows)


def _claims(found: dict[str, tuple[AxisDiagnosis, ...]], both: tuple[AxisDiagnosis, ...], a: MotionLog, b: MotionLog) -> str:
    """What a further record of the same robot must show, in numbers."""
    rows = ["| axis | link delay [ms] | lines: a turn (amplitude [µrad]) | k [1e6 N m/rad] | ratio, own zero, at least |",
            "|---|---|---|---|---|"]
    for k, one in enumerate(both):
        delays = [(cause.values[0], cause.std[0]) for axes in (*found.values(), both) for cause in axes[k].causes
                  if cause.shape.name == "channel_delay (link)"]
        low, high = (1e3 * edge for edge in (min(v - 1.96 * s for v, s in delays), max(v + 1.96 * s for v, s in delays)))
        sure = [[line for line in pair if line] for pair in _pairs(found, k)
                if any(line and line.confirmed for line in pair) and all(line is None or line.confirmed for line in pair)]
        cycles = np.array([np.mean([line.cycles for line in lines]) for lines in sure])
        sizes = [np.abs(fitted(session(one.joint, [log]), cycles).amplitudes) for log in (a, b)] if sure else [[], []]
        told = [f"{each:.1f} ± {max(1.0, 3 * max(line.std for line in lines)):.1f} ({MICRO * 0.7 * min(x, y):.1f} ... "
                f"{MICRO * 1.3 * max(x, y):.1f})" for each, lines, x, y in zip(cycles, sure, *sizes, strict=True)]
        bounds = [axes[k].gain for axes in found.values()]
        least = min(gain.interval[0] for gain in bounds if gain is not None)
        stiff = "none" if one.stiffness.refused else _interval(one.stiffness).split(" ", 1)[1].strip("()")
        rows.append(f"| {one.joint} | {low:.2f} ... {high:.2f} | {'; '.join(told) or '-'} | {stiff} | {least:.1f} |")
    return "\n".join(rows)


def _other(one: AxisDiagnosis) -> MotionLog:
    return OTHERS[one.records[0].source]


def _interval(one: AxisStiffness) -> str:
    low, high = one.interval_95
    k = f"{1e-6 / one.compliance:.2f}" if one.compliance > 0 else "-"
    return f"{k} ({1e-6 * low:.2f} ... {1e-6 * high:.2f})".replace("inf", "∞")


def _stiffness(
    found: dict[str, tuple[AxisDiagnosis, ...]], both: tuple[AxisDiagnosis, ...], a: MotionLog, b: MotionLog
) -> str:
    rows = ["| axis | record | straight line k | k (95 %) | c ± noise ± reading [1e-7 rad/(N m)] | torque's own share | "
            "worth, of samples | grade | without the transmission error: k (95 %), grade |",
            "|---|---|---|---|---|---|---|---|---|"]
    listed = [(name, one.stiffness) for name, axes in found.items() for one in axes]
    listed += [("A and B", one.stiffness) for one in both]
    logs = {"A": [a], "B": [b], "A and B": [a, b]}
    for name, one in sorted(listed, key=lambda item: (item[1].joint, item[0] == "A and B", item[0])):
        without = axis_stiffness(one.joint, logs[name])
        rows.append(f"| {one.joint} | {name} | {1e-6 / one.straight:.2f} | {_interval(one)} | {1e7 * one.compliance:.2f} ± "
                    f"{1e7 * one.noise_std:.2f} ± {1e7 * one.law_std:.2f} | {100 * one.share:.1f} % | {one.worth:.0f} of "
                    f"{one.samples} | {one.grade} | {_interval(without)}, {without.grade} |")
    return "\n".join(rows)


def _agree(both: list[AxisStiffness]) -> str:
    rows = ["| axis | A against B [standard deviations of the difference] | agree | authors' model value [1e6 N m/rad] | "
            "inside the interval of A and B |", "|---|---|---|---|---|"]
    for one in both:
        low, high = one.interval_95
        inside = "yes" if low <= AUTHORS[one.joint] <= high else "no"
        rows.append(f"| {one.joint} | {one.apart:.1f} | {'yes' if one.apart <= DISAGREE else 'no'} | "
                    f"{1e-6 * AUTHORS[one.joint]:.2f} | {inside}{' (refused)' if one.refused else ''} |")
    return "\n".join(rows)


def _left(found: dict[str, tuple[AxisDiagnosis, ...]]) -> str:
    bands = [f"{low:g}-{high:.0f} Hz" for low, high, _ in found["A"][0].left.spectrum]
    rows = [f"| axis | record | {' | '.join(bands)} | follows the angle (p) | follows the torque (p) |",
            "|---" * (len(bands) + 4) + "|"]
    for name, axes in found.items():
        for one in axes:
            shares = " | ".join(f"{100 * share:.0f} %" for _, _, share in one.left.spectrum)
            follows = " | ".join(f"{100 * share:.0f} % ({p:.3f})" for _, share, p in one.left.follows)
            rows.append(f"| {one.joint} | {name} | {shares} | {follows} |")
    return "\n".join(rows)


if __name__ == "__main__":
    main()
