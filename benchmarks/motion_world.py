"""Joint records in motion with a hidden cause: `python benchmarks/motion_world.py N SEED FOLDER`.

Its author had read docs/formats.md and `compstiff diagnose -h`, and nothing of identification/motion. A case is a folder with
cell.yaml, robot.yaml, one or two records and truth.json; it shares no code or law with the packages. Two-mass drives under a
servo loop are integrated in time; the logged torque is that of the gear, as a controller that knows its motor tells it, but
where motor inertia or friction are what is hidden. A cause is sized to show by 8 to 300 sigma in a regression on a plain spring
(all samples, white noise), at most five times the noise of a sample.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
import yaml

from benchmarks.motion_drive import Array, Axis, Motion, run
from benchmarks.motion_hidden import BY_KIND, CAUSES, PAIRS, Cause, Reading
from benchmarks.motion_robots import Instruments, Robot, Task, instruments, robot, task


def at(motion: Motion, signal: Array, every: int, late: float) -> Array:
    """A signal at the log's times, as it was `late` seconds before."""
    fine = np.arange(len(signal)) * motion.step
    return np.asarray(np.interp(fine[::every] - late, fine, signal))


def lagged(signal: Array, step: float, time: float) -> Array:
    """Behind a first-order filter."""
    from scipy.signal import lfilter

    keep = np.exp(-step / time)
    return np.asarray(lfilter([1 - keep], [1, -keep], signal, zi=[keep * signal[0]])[0])


def channels(axis: Axis, motion: Motion, how: Reading, every: int, others: Array | None) -> tuple[Array, Array, Array]:
    """Motor angle, link angle [rad] and torque [Nm] as they are told, without noise, each (rows,)."""
    torque = motion.gear_torque + motion.friction + how.inertia * axis.motor_inertia * motion.acceleration
    torque = torque * (1 + how.torque_gain + how.saturation[0] * (torque / how.saturation[1]) ** 2 + how.side * (torque > 0))
    torque = torque + how.torque_zero + how.ripple[0] * np.sin(how.ripple[1] * motion.motor)
    if how.torque_lag:
        torque = lagged(torque, motion.step, how.torque_lag)
    share = np.linspace(0, 1, len(motion.load))
    link = motion.load + how.eccentric[0] * np.sin(motion.load + how.eccentric[1]) + how.zero
    link = link + how.walk[0] * (1 - np.exp(-share / how.walk[1])) + how.slip[0] * (share > how.slip[1])
    if how.cross and others is not None:
        link = link + how.cross * others
    told = at(motion, link, every, how.link_late)
    if how.lost[0]:
        place = int(how.lost[1] * len(told))
        early = at(motion, link, every, how.link_late - how.lost[0] * every * motion.step)
        told = np.concatenate([told[:place], early[place:]])
    return at(motion, motion.motor, every, how.motor_late) * (1 + how.ratio), told, at(motion, torque, every, how.torque_late)


def remembering(rng: np.random.Generator, count: int, std: float, memory: float, rate: float) -> Array:
    from scipy.signal import lfilter

    keep = float(np.exp(-1 / (rate * memory))) if memory else 0.0
    return np.asarray(lfilter([std * np.sqrt(1 - keep * keep)], [1, -keep], rng.normal(size=count + 1000))[1000:])


def measured(rng: np.random.Generator, axis: Axis, told: tuple[Array, Array, Array], tools: Instruments,
             peak: float) -> list[Array]:
    """With noise and steps, in degrees and Nm."""
    motor, link, torque = told
    count = len(motor)
    step = 2 * np.pi / 2**tools.motor_bits / axis.ratio
    motor = step * np.round(motor / step + rng.uniform())
    step = 2 * np.pi / 2**tools.link_bits
    link = step * np.round((link + remembering(rng, count, tools.link_std, tools.memory, tools.rate)) / step + rng.uniform())
    torque = torque + remembering(rng, count, tools.torque_std * peak, tools.memory, tools.rate)
    step = peak / 4096
    return [np.degrees(motor), np.degrees(link), step * np.round(torque / step)]


def noise_of(axis: Axis, tools: Instruments, peak: float) -> float:
    """One sigma of link minus motor minus what the torque says [rad]."""
    steps = np.array([2 * np.pi / 2**tools.link_bits, 2 * np.pi / 2**tools.motor_bits / axis.ratio])
    return float(np.sqrt(tools.link_std**2 + (tools.torque_std * peak / axis.gear.stiffness) ** 2 + np.sum(steps**2) / 12))


def shown(told: tuple[Array, Array, Array]) -> float:
    """RMS that a zero and a plain spring leave of link minus motor [rad]."""
    motor, link, torque = told
    columns = np.column_stack([np.ones_like(torque), torque])
    seen = link - motor
    return float(np.sqrt(np.mean((seen - columns @ np.linalg.lstsq(columns, seen, rcond=None)[0]) ** 2)))


def beyond(seen: float, before: float) -> float:
    return float(np.sqrt(max(seen**2 - before**2, 0.0)))


def peak_of(axis: Axis, one: Task, place: int) -> float:
    """The largest torque the load asks for [Nm]."""
    reference = one.references[place]
    acceleration = np.gradient(np.gradient(reference, one.step), one.step)
    return float(np.abs(axis.load_inertia * acceleration + axis.gravity * np.cos(reference + axis.level)).max())


def sized(cause: Cause, axis: Axis, one: Task, place: int, seed: int, target: float, others: Array | None) -> float:
    """The size at which the cause shows by `target` RMS [rad] in this record beyond what shows without it (the gear's damping),
    within what is plausible."""
    size, peak = cause.size, peak_of(axis, one, place)
    short = slice(0, max(len(one.references[place]) // 2, int(8 / one.step)))                  # half a record tells it
    plain = run(axis, one.references[place][short], one.step, one.disturbances[place][short])
    before = shown(channels(axis, plain, Reading(), one.every, None))
    for _ in range(4):
        changed, how = cause.make(axis, size, peak, np.random.default_rng(seed))
        motion = run(changed, one.references[place][short], one.step, one.disturbances[place][short]) if cause.drive else plain
        seen = beyond(shown(channels(changed, motion, how, one.every, None if others is None else others[short])), before)
        new = float(np.clip(size * np.clip(target / max(seen, 1e-12), 0.1, 10), 0, cause.most))
        if abs(np.log(new / size)) < 0.1:
            return new
        size = new
    return size


def deck(count: int, rng: np.random.Generator) -> Iterator[tuple[str, ...]]:
    """A fifth nothing, a seventh pairs; of the others each before any comes again."""
    nothing, pairs = round(count / 5), round(count / 7)
    single = [cause.kind for cause in CAUSES]
    drawn: list[tuple[str, ...]] = [()] * nothing
    for others, upto in (([*PAIRS], nothing + pairs), ([(kind,) for kind in single], count)):
        while len(drawn) < upto:
            drawn += [others[i] for i in rng.permutation(len(others))][:upto - len(drawn)]
    for i in rng.permutation(count):
        yield drawn[i]


def case(kinds: tuple[str, ...], rng: np.random.Generator, folder: Path) -> dict[str, Any]:
    """Writes one case; what is true of it."""
    causes = [BY_KIND[kind] for kind in kinds]
    while True:
        one = robot(rng)
        if len(one.axes) >= max([1, *(cause.axes for cause in causes)]):
            break
    tools = instruments(rng, one.size)
    how_many = max([1 + (rng.random() < 0.6), *(cause.records for cause in causes)])
    tasks = [task(rng, one, tools) for _ in range(how_many)]
    place = int(rng.integers(len(one.axes)))
    plain, axis = list(one.axes), one.axes[place]
    peak = peak_of(axis, tasks[0], place)
    noise = noise_of(axis, tools, peak)
    rows = len(tasks[0].references[0]) // tasks[0].every
    other = (place + 1) % len(one.axes)
    others = [run(plain[other], t.references[other], t.step, t.disturbances[other]).gear_torque
              if kinds == ("crosstalk",) else None for t in tasks]
    sizes, seeds, hidden, how = [], [], axis, Reading()
    for cause in causes:
        seed = int(rng.integers(2**31))
        target = min(float(np.exp(rng.uniform(np.log(8), np.log(300)))) / np.sqrt(rows), 5.0) * noise
        size = cause.size * float(np.exp(rng.uniform(-0.7, 0.7))) if cause.fixed else sized(
            cause, axis, tasks[0], place, seed, target, others[0])
        changed, told = cause.make(hidden, size, peak, np.random.default_rng(seed))
        hidden, how = changed, replace(how, **{k: v for k, v in asdict(told).items() if v != asdict(Reading())[k]})
        sizes.append(size)
        seeds.append(seed)
    everywhere = bool(causes and rng.random() < causes[0].everywhere and len(one.axes) > 1 and len(causes) == 1)
    folder.mkdir(parents=True, exist_ok=True)
    seen, seen_ratio, peaks = [], [], []
    shift = sizes[0] * float(rng.choice([-1, 1])) if kinds == ("zero_shift",) else 0.0
    # Joints that are as they should be keep the zero of their encoders from one record to the next.
    zeros = [float(rng.normal(0, 3e-4)) for _ in one.axes]
    for number, work in enumerate(tasks):
        table: dict[str, Array] = {"time_s": np.arange(rows) / tools.rate}
        for j, normal in enumerate(plain):
            here, reads = (hidden, how) if j == place else (normal, how if everywhere else Reading())
            motion = run(here, work.references[j], work.step, work.disturbances[j])
            reads = replace(reads, zero=zeros[j] + (shift * number if j == place else 0.0))
            told = channels(here, motion, reads, work.every, others[number] if j == place else None)
            largest = peak_of(normal, work, j)
            if j == place:
                as_it_is = run(normal, work.references[j], work.step, work.disturbances[j])
                seen_ratio.append(beyond(shown(told), shown(channels(normal, as_it_is, Reading(), work.every, None))) / noise)
                seen.append(seen_ratio[-1] * np.sqrt(rows))
                peaks.append(largest)
            motor, link, torque = measured(rng, here, told, tools, largest)
            name = f"q{normal.number}"
            table |= {f"{name}_motor_deg": motor, f"{name}_link_deg": link, f"{name}_torque_nm": torque}
        formats = ["%.8f" if name.endswith("_deg") else "%.4f" for name in table]
        np.savetxt(folder / f"record{number + 1}.csv", np.column_stack(list(table.values())), formats, ",",
                   header=",".join(table), comments="")
    write_cell(folder, one)
    second = "validate" if how_many > 1 and rng.random() < 0.3 and kinds != ("zero_shift",) else "also"
    truth = {"kinds": list(kinds), "joint": axis.number, "everywhere": everywhere, "sizes": sizes, "sigmas": seen,
             "of_noise": seen_ratio, "noise_rad": noise, "second": second if how_many > 1 else None, "shift_rad": shift,
             "robot": one.size, "lines": [cycles for _, cycles, _ in hidden.gear.ripples],
             "stiffness": {a.number: a.gear.stiffness for a in plain},
             "ratio": {a.number: a.ratio for a in plain}, "peak_nm": peaks,
             "damping_s": {a.number: a.gear.damping / a.gear.stiffness for a in plain},
             "inertia": axis.motor_inertia, "moves": [t.kinds for t in tasks], "instruments": asdict(tools), "seeds": seeds}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))
    return truth


def write_cell(folder: Path, one: Robot) -> None:
    (folder / "robot.yaml").write_text(yaml.safe_dump({
        "name": f"judge-{one.size}", "manufacturer": "none", "load_path": "serial",
        "prior": {"stiffness_nm_per_rad": list(one.prior), "relative_std": 2.0}}))
    (folder / "cell.yaml").write_text(yaml.safe_dump({
        "robot": "robot.yaml", "tool": {"position_mm": [0, 0, 200], "quaternion": [1, 0, 0, 0]}}))


def main() -> None:
    count, seed, folder = int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
    print(f"seed {seed}, {count} cases into {folder}")
    for number, kinds in enumerate(deck(count, np.random.default_rng(seed))):
        truth = case(kinds, np.random.default_rng([seed, number]), folder / f"case{number:03d}")
        print(number, "+".join(kinds) or "nothing", f"joint {truth['joint']}", f"{truth['sigmas'][0]:.0f} sigma", flush=True)


if __name__ == "__main__":
    main()
