"""docs/real-data.md and its pictures, from the two measured records of a KUKA KR300.

    python -m samples.real_data FOLDER

FOLDER holds data_A.mat and data_B.mat (github.com/JonasWeigand/Robot_Identification, commit 9e403c0, MIT licence); neither is
part of this project.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from identification.motion.axis import axis_of
from identification.motion.axis_diagnosis import MICRO, AxisDiagnosis
from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.procedure import diagnose_axes
from identification.motion.remainder import angle_columns
from identification.motion.stiffness import DISAGREE, AxisStiffness, axis_stiffness
from samples.pictures import Panel, Series, svg

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent / "docs"
BEFORE, AFTER = "#c0392b", "#2b6ca3"
# Model stiffness of axes 1-3 in the authors' own controller model (`para.c_rad_ff`) [N m/rad], and their gear ratios.
AUTHORS = {1: 4.5778e6, 2: 7.5189e6, 3: 4.0999e6}
RATIO = {1: 256.857, 2: 267.429, 3: 252.333}


def main() -> None:
    """Writes the page and its pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--docs", type=Path, default=DOCS, help="where real-data.md goes")
    chosen = parser.parse_args()
    a, b = (read_motion_log(next(iter(sorted(chosen.folder.rglob(f"data_{name}.mat"))))) for name in "AB")
    found = {"A": diagnose_axes([a], b, replicates=199), "B": diagnose_axes([b], a, replicates=199)}
    both = [axis_stiffness(joint, [a, b]) for joint in sorted(a.joints)]
    pictures = chosen.docs / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    for name, panels in (("real-torque", [_torque(one) for one in found["A"]]),
                         ("real-residual", [_residual(one) for one in found["A"]]),
                         ("real-held-out", [_held_out(one) for one in found["A"]]),
                         ("real-spectrum", [_spectrum(one) for one in found["A"]])):
        (pictures / f"{name}.svg").write_text(svg(panels), encoding="utf-8")
    text = (HERE / "real_data.md.in").read_text(encoding="utf-8")
    tables = {"PLAIN": _plain(a, b), "NAMED": _named(found), "GAIN": _gain(found), "STIFFNESS": _stiffness(found, both),
              "AGREE": _agree(both), "LEFT": _left(found), "ANGLE": _angle(found, a, b), "MOTOR": _motor(found)}
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
    rows = ["| axis | fitted on | there: RMS plain → extended [µrad] | variance explained | tested on | there: RMS plain → "
            "extended [µrad] | variance explained | ratio (95 %) |", "|---|---|---|---|---|---|---|---|"]
    for name, axes in found.items():
        for one in axes:
            total, rms = float(np.var(one.deflection)), np.std(one.residuals, axis=0)
            shares = 100 * (1 - rms**2 / total)
            line = (f"| {one.joint} | {name} | {MICRO * rms[0]:.0f} → {MICRO * rms[1]:.0f} | {shares[0]:.1f} → "
                    f"{shares[1]:.1f} % | {'B' if name == 'A' else 'A'} | ")
            gain = one.gain
            rows.append(line + ("- | - | - |" if gain is None else (
                f"{MICRO * gain.before:.0f} → {MICRO * gain.after:.0f} | {100 * gain.explained[0]:.1f} → "
                f"{100 * gain.explained[1]:.1f} % | {gain.ratio:.1f} ({gain.interval[0]:.1f} ... {gain.interval[1]:.1f}) |")))
    return "\n".join(rows)


def _interval(one: AxisStiffness) -> str:
    low, high = one.interval_95
    k = f"{1e-6 / one.compliance:.2f}" if one.compliance > 0 else "-"
    return f"{k} ({1e-6 * low:.2f} ... {1e-6 * high:.2f})".replace("inf", "∞")


def _stiffness(found: dict[str, tuple[AxisDiagnosis, ...]], both: list[AxisStiffness]) -> str:
    rows = ["| axis | record | straight line k | k (95 %) | c ± noise ± reading [1e-7 rad/(N m)] | torque's own share | "
            "worth, of samples | grade |", "|---|---|---|---|---|---|---|---|"]
    listed = [(name, one.stiffness) for name, axes in found.items() for one in axes]
    listed += [("A and B", one) for one in both]
    for name, one in sorted(listed, key=lambda item: (item[1].joint, item[0] == "A and B", item[0])):
        rows.append(f"| {one.joint} | {name} | {1e-6 / one.straight:.2f} | {_interval(one)} | {1e7 * one.compliance:.2f} ± "
                    f"{1e7 * one.noise_std:.2f} ± {1e7 * one.law_std:.2f} | {100 * one.share:.1f} % | {one.worth:.0f} of "
                    f"{one.samples} | {one.grade} |")
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


def _angle(found: dict[str, tuple[AxisDiagnosis, ...]], a: MotionLog, b: MotionLog) -> str:
    """A curve over the angle, learnt from what one record leaves: how much of the other's it explains where both have been."""
    rows = ["| axis | angles both have been at [deg] | learnt on A, of B's | learnt on B, of A's |", "|---|---|---|---|"]
    for k, joint in enumerate(a.joints):
        low = max(float(log.angle[joint].min()) for log in (a, b))
        high = min(float(log.angle[joint].max()) for log in (a, b))
        sides = []
        for name, record in (("A", a), ("B", b)):
            one = found[name][k]
            axis = axis_of(joint, [record])
            left = axis.deflection - one.named.columns(axis) @ one.named.solved.coefficients
            inside = (axis.angle >= low) & (axis.angle <= high)
            columns = np.column_stack([np.ones(inside.sum()), angle_columns(axis.angle[inside], (low, high))])
            sides.append((columns, left[inside]))
        shares = []
        for (x, y), (u, w) in ((sides[0], sides[1]), (sides[1], sides[0])):
            guess = u @ np.linalg.lstsq(x, y, rcond=None)[0]
            shares.append(1 - float(np.var(w - guess) / np.var(w)))
        rows.append(f"| {joint} | {np.degrees(low):.0f} ... {np.degrees(high):.0f} | {100 * shares[0]:.0f} % | "
                    f"{100 * shares[1]:.0f} % |")
    return "\n".join(rows)


def _motor(found: dict[str, tuple[AxisDiagnosis, ...]]) -> str:
    """Share of what is left above 10 Hz that goes with whole multiples of the motor's turns."""
    rows = ["| axis | record | strongest multiples of the motor's turn (share of what is left) |", "|---|---|---|"]
    for name, axes in found.items():
        for one in axes:
            angle = one.axis.angles[0] * RATIO[one.joint]
            left = one.residuals[:, 1] - one.residuals[:, 1].mean()
            shares = {order: _share(left, np.cos(order * angle), np.sin(order * angle)) for order in range(1, 25)}
            best = sorted(shares, key=lambda order: -shares[order])[:3]
            told = ", ".join(f"{order}x: {100 * shares[order]:.1f} %" for order in best)
            rows.append(f"| {one.joint} | {name} | {told} |")
    return "\n".join(rows)


if __name__ == "__main__":
    main()
