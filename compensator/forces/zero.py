"""What a force log shows without contact: the sensor's bias, and what hangs on it at each target's orientation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.payload import Payload, estimate_payload, turns, weight
from compensator.forces.program_time import moves_in_air
from compensator.forces.tare_check import Range, TaredLog, doubts
from compensator.forces.target_rows import TargetRows
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array, read_only
from identification.common.findings import CompstiffError, Finding, counted, error
from identification.common.quantities import two_sigma
from identification.model.cell import Cell, ForceLogFrame
from identification.model.gravity import FREE_FALL, fall_in_base
from identification.model.rotations import Frame

# A log whose quiet targets show less than this share of a weight does not hold it, if taking it off leaves them the rest.
NOT_IN_LOG = 0.2
NOTHING = (np.zeros((0, 3)), np.zeros((0, 3)))
# A bias takes a weight of so many newtons back where it is such a share of it and stands aside by no more than that share; the
# weight that is left is that of another unit within this share (engineering judgement: sensors' zeros are some per cent of it).
HEAVY, TAKEN_BACK, ASIDE, SAME_UNIT = 50.0, (0.5, 0.97), 0.15, 0.3
UNITS = {"kgf": FREE_FALL, "lbf": 4.4482216}
# A weight of so many newtons stands in a log along another line where a bias of over such a share of it turns it round and
# leaves its size within that share: rarely so by chance, a sensor's own zero is seldom as large (engineering judgement).
HEAVY_TURNED, TURNED_BIAS, SAME_SIZE = 200.0, 0.7, 0.1
# From so many degrees on it points the other way, and not merely aside.
UPWARDS = 150.0
# A noise told by fewer degrees of freedom is not taken by them alone: by four it may be told three times too small. A bias that
# is the mean of fewer samples is known badly, and said.
FEW = 8
# Stretches that differ from their mean by more than this share of the payload's weight, and than so many standard deviations of
# theirs, contradict it.
APART, CHANCE = 0.1, 4.0
# A median of absolute values of a normal distribution, in sigmas.
MEDIAN = 0.6745


@dataclass(frozen=True, eq=False)
class Air:
    """Samples of air stretches. mean (k, 6) [N, N m] and fall (k, 3) [m/s^2] of each stretch, log frame; covariance (6, 6) of
    one sample as the mean of many shows it, by so many degrees of freedom; each (k,): how many there are."""

    mean: Array
    fall: Array
    covariance: Array
    degrees: int
    each: Array

    @property
    def noise(self) -> Array:
        """1 sigma (6,) of one sample."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def steadied(self) -> Array:
        """The covariance, FEW more degrees of freedom of which hold the axes for alike: by few some direction would seem quiet
        by chance."""
        alike = np.diag(np.repeat(np.diag(self.covariance).reshape(2, 3).mean(axis=1), 3))
        return np.asarray((self.degrees * self.covariance + FEW * alike) / (self.degrees + FEW))

    @property
    def samples(self) -> float:
        """So many samples of one stretch make as sure a mean as that of the stretches, each counting alike."""
        return float(len(self.each) ** 2 / np.sum(1 / self.each))

    @property
    def bias_std(self) -> Array:
        """1 sigma (6,) of the mean of the stretches."""
        return np.asarray(self.noise / np.sqrt(self.samples))


@dataclass(frozen=True, eq=False)
class Zero:
    """offset (N, 6) as logged at each target without contact; bias (6,) in it, None where none is known; noise (6,) of one
    sample; spread: covariances (6, 6) of that, and (6, 6) of the offset, or (N, 6, 6) where its weight was told by the tare,
    too; both None without a tare."""

    offset: Array
    bias: Array | None
    noise: Array | None
    findings: tuple[Finding, ...]
    spread: tuple[Array, Array] | None

    @property
    def own_std(self) -> float:
        """1 sigma [N] of each axis of a bias that is the same at all targets, root mean square; 0 without a tare, and where the
        weight was told by it, too."""
        return 0.0 if self.spread is None or self.spread[1].ndim > 2 else float(np.sqrt(np.trace(self.spread[1][:3, :3]) / 3))

    def __post_init__(self) -> None:
        held = (self.offset, self.bias, self.noise, *(self.spread or ()))
        read_only(*(array for array in held if array is not None))


def of_six(loads: Array) -> Array:
    """Loads (n, 6) [N, N m] of loads (n, 3 or 6): moments that were not logged are zero."""
    return loads if loads.shape[1] == 6 else np.concatenate([loads, np.zeros((len(loads), 3))], axis=1)


def base_from_log(path: RobotPath, cell: Cell) -> Frame:
    """The log's axes and origin at each target (N)."""
    if cell.force_log.kind == "sensor" and cell.force_log.flange_from_sensor is not None:
        return path.base_from_flange @ cell.force_log.flange_from_sensor
    if cell.force_log.kind == "tool":
        return path.base_from_tcp
    return Frame(np.broadcast_to(np.eye(3), path.base_from_tcp.rotation.shape), path.base_from_tcp.position)


def zero_of(
    log: ForceLog, path: RobotPath, cell: Cell, loads: Array, rows: TargetRows, tare: Sequence[Range],
    outside: tuple[Array, Array] = NOTHING, *, trusted: bool = False
) -> Zero:
    """The zero of a log placed on a path: loads (m, 3 or 6) before any averaging of its rows; outside: those of the rows before
    and after the program. trusted: what speaks against the tare is a warning.

    A tare gives the bias; stretches of different orientation give mass and centre too, where cell.yaml names none. Without a
    tare the bias is cell.yaml's. Raises CompstiffError: CS3006 no sample in a stretch, CS3032 the weight is not in the log,
    CS3039 a stretch is not in air, CS3066 nothing shows that it is.
    """
    form = cell.force_log
    frame = base_from_log(path, cell)
    fall = np.nan_to_num(frame.inverse().turn(fall_in_base(cell.world_from_base)))
    weighs = form.kind != "base" and form.weight != "removed"
    mass, centre = (form.mass, form.centre) if weighs else (None, None)
    findings: list[Finding] = []
    air = _air(log, loads, rows, fall, tare, moves_in_air(path.toolpath)) if tare else None
    spread = None if air is None else (air.steadied, air.steadied / air.samples)
    if air is not None and not mass and weighs and len(tare) > 1:
        payload = estimate_payload(air.fall, form.sign * air.mean, has_moment=log.has_moment,
                                   noise=air.noise / np.sqrt(air.each)[:, None])
        findings.append(_estimated(payload, air, log))
        if payload is not None and payload.told_from_none:
            # The centre in the log's own frame, where the sensor sits: carried to the flange once.
            mass, centre = payload.mass, _in_flange(payload, _tool_of(path, rows, tare), form)
            spread = air.steadied, payload.covariance(fall, air.steadied[3:, 3:] / air.samples)
    held = np.zeros((len(path.toolpath), 6))
    if mass:
        arm = None
        if centre is not None and log.has_moment:
            arm = frame.inverse().apply(path.base_from_flange.apply(centre))
        elif log.has_moment:
            findings.append(Finding("CS3013", "warning", f"the moment of the payload of {mass:g} kg is not subtracted: its "
                                    "centre of mass is not known", file=log.source, hint="state centre_of_mass_mm"))
        held = form.sign * np.nan_to_num(weight(fall, mass, arm))
    if air is not None:
        before, after = (load[:, :3] - held[end, :3] for load, end in zip(outside, (0, -1), strict=True))
        stated = None if form.bias is None else form.bias[:3]
        unheld = loads[:, :3] - held[rows.target, :3]
        tared = TaredLog(log.source, unheld, rows, moves_in_air(path.toolpath), before, after, stated)
        findings += _answered(doubts(tared, tare), trusted=trusted)
        biases = air.mean - _per_stretch(held, rows, tare)
        bias = biases.mean(axis=0)
        findings += _tared(log, biases, bias, mass, tare, air)
        stated_weight = _per_stretch(held, rows, tare)[:, :3].mean(axis=0)
        findings += _taken_back(log, bias[:3], stated_weight, mass)
        findings += _turned_round(log, bias[:3], stated_weight, mass)
    else:
        bias = np.zeros(6) if form.bias is None else form.bias.copy()
        bias[3:] *= log.has_moment
    if mass:
        seen = rows.samples > 0
        mean = rows.mean(loads[:, :3] - bias[:3])
        findings.append(_weighed(log, form, mass, mean[seen], held[seen, :3], tared=air is not None))
    known = air is not None or form.bias is not None
    return Zero(held + bias, bias if known else None, None if air is None else air.noise, tuple(findings), spread)


def _air(
    log: ForceLog, loads: Array, rows: TargetRows, fall: Array, tare: Sequence[Range], in_air: NDArray[np.bool_]
) -> Air:
    """Means over the stretches. The noise is such that sigma of a mean of n samples is noise / sqrt(n), correlation between
    neighbours included: from up to 32 consecutive batches; where those are few the scatter of the samples themselves, which
    such a correlation hides from, stands in for what is missing to FEW, and where they are few too, that of neighbours on the
    other moves in the air (N,)."""
    means, falls, each, squares, degrees, scatter = [], [], [], np.zeros((6, 6)), 0, np.zeros((6, 6))
    rest = 0
    for first, last in tare:
        if last >= len(fall):
            raise error("CS3006", f"--tare {first}:{last} names targets beyond the program, which has "
                        f"{counted(len(fall), 'target')} (0 to {len(fall) - 1})", file=log.source,
                        hint="name targets of an air move: FIRST:LAST, counted from 0 in the order of the text")
        inside = rows.between(first, last)
        if not len(inside):
            raise error("CS3006", f"no sample lies on the targets {first} to {last} of --tare", file=log.source,
                        hint="name targets of an air move during which the log was already running")
        samples = rows.weight[inside]
        load = of_six(loads[inside])
        means.append(np.average(load, axis=0, weights=samples))
        falls.append(np.average(fall[rows.target[inside]], axis=0, weights=samples))
        batches = np.array_split(np.arange(len(inside)), min(32, max(len(inside) // 4, 1)))
        scatter += ((load - means[-1]).T * samples) @ (load - means[-1])
        each.append(float(samples.sum()))
        rest += len(inside) - 1
        if len(batches) > 1:
            of_batch = np.array([np.average(load[batch], axis=0, weights=samples[batch]) for batch in batches])
            off = of_batch - of_batch.mean(axis=0)
            squares += off.T @ off * samples.sum() / len(batches)
            degrees += len(batches) - 1
    beside = _beside(loads, rows, in_air) if rest < FEW else None
    if beside is not None:
        scatter, rest = scatter + (FEW - rest) * beside, FEW
    missing = max(FEW - degrees, 0)
    covariance = (squares + missing * scatter / max(rest, 1)) / (degrees + missing)
    return Air(np.array(means), np.array(falls), covariance, degrees + missing, np.array(each))


def _beside(loads: Array, rows: TargetRows, in_air: NDArray[np.bool_]) -> Array | None:
    """Variances (6, 6) of one sample by how far rows that follow each other on moves in the air differ, in the middle: what
    drifts, or touches, is no noise. Targets (N,) reached and left in the air; None where there are too few."""
    calm = (in_air & np.append(in_air[1:], True))[rows.target]
    pairs = np.flatnonzero(calm[1:] & calm[:-1])
    if len(pairs) < FEW:
        return None
    steps = np.abs(of_six(loads[pairs + 1] - loads[pairs]))
    return np.diag(0.5 * np.mean(rows.weight[pairs]) * (np.median(steps, axis=0) / MEDIAN) ** 2)


def _answered(doubts: list[Finding], *, trusted: bool) -> list[Finding]:
    """Raises CompstiffError with the doubts of a tare; one that is trusted is used, and they are said."""
    if doubts and not trusted:
        raise CompstiffError(*doubts)
    return [replace(doubt, level="warning", message=f"{doubt.message}; used all the same (--trust-tare)", hint="")
            for doubt in doubts]


def _per_stretch(values: Array, rows: TargetRows, tare: Sequence[Range]) -> Array:
    """Means (k, 6) over the samples of each stretch of what each target has."""
    inside = [rows.between(*stretch) for stretch in tare]
    return np.array([np.average(values[rows.target[part]], axis=0, weights=rows.weight[part]) for part in inside])


def _tool_of(path: RobotPath, rows: TargetRows, tare: Sequence[Range]) -> Frame:
    """The tool, flange_from_tcp, that most samples of the stretches have: one may begin at a home with tool0."""
    inside = np.concatenate([rows.between(*stretch) for stretch in tare])
    target = rows.target[inside]
    tool = path.toolpath.tool[target]
    return path.flange_from_tcp[int(target[np.argmax(np.bincount(tool, rows.weight[inside])[tool])])]


def _in_flange(payload: Payload, flange_from_tcp: Frame, form: ForceLogFrame) -> Array | None:
    """The payload's centre (3,) [m] in the flange's frame; flange_from_tcp: the tool of the stretches it was told by."""
    if payload.centre is None:
        return None
    if form.kind == "sensor" and form.flange_from_sensor is not None:
        return form.flange_from_sensor.apply(payload.centre)
    return flange_from_tcp.apply(payload.centre)


def _estimated(payload: Payload | None, air: Air, log: ForceLog) -> Finding:
    if payload is None:
        return Finding("CS3034", "note", f"the {len(air.mean)} stretches of --tare turn the sensor by "
                       f"{np.degrees(turns(air.fall)[0]):.1f} deg: that does not tell a payload from the bias", file=log.source,
                       hint="compstiff tare finds it from still readings in orientations that differ more")
    text = f"payload {payload.mass:.2f} +- {two_sigma(payload.mass_std):.2f} kg"
    no_weight = f"{text} in the stretches of --tare: the log holds no weight"
    if payload.negative:
        return Finding("CS3042", "warning", no_weight, file=log.source,
                       hint="a negative mass: check force_log.sign and the sensor's frame")
    if not payload.told_from_none:
        return Finding("CS3043", "note", no_weight, file=log.source)
    if payload.centre is not None and payload.centre_std is not None:
        text += (f", centre {_list(1e3 * payload.centre, 1)} +- {_list(1e3 * two_sigma(payload.centre_std), 1)} mm in the "
                 "log's frame")
    return Finding("CS3033", "note", f"{text}, estimated from {len(air.mean)} stretches of --tare (+-: 2 sigma)",
                   file=log.source)


def _tared(
    log: ForceLog, biases: Array, bias: Array, mass: float | None, tare: Sequence[Range], air: Air
) -> list[Finding]:
    """What is said of the bias, the mean of those (k, 6) of each stretch."""
    where = ", ".join(f"{first} to {last}" for first, last in tare)
    known = float(np.sqrt(np.mean(air.bias_std[:3] ** 2)))
    few = air.samples < FEW and known > 0
    of = f"{counted(int(air.each.sum()), 'sample')} of targets {where}, known to +-{two_sigma(known):.1f} N" if few else (
        f"targets {where}")
    short = int(np.argmin(air.each))
    better = (f"leave targets {tare[short][0]} to {tare[short][1]} out, a stretch of {counted(int(air.each[short]), 'sample')} "
              "that counts as much as each other one" if air.each.sum() >= FEW
              else "name a longer stretch in the air with --tare, or several")
    findings = [Finding("CS3008", "warning" if few else "note", f"bias {_list(bias[:3], 2)} N, mean of {of}, was subtracted",
                        file=log.source, hint=f"every force is off by what that is off by: {better}" if few else "")]
    off = np.linalg.norm(biases[:, :3] - bias[:3], axis=1)
    apart = float(off.max())
    by_chance = CHANCE * np.linalg.norm(air.noise[:3]) * np.sqrt((1 - 2 / len(off)) / air.each + 1 / air.samples)
    if mass and (off > np.maximum(APART * mass * FREE_FALL, by_chance)).any():
        findings.append(Finding("CS3046", "warning", f"with a payload of {mass:g} kg taken off, the stretches of --tare differ "
                                f"from their mean by up to {apart:.1f} N", file=log.source,
                                hint="is the mass right, and its weight still in the log (force_log.weight)?"))
    return findings


def _taken_back(log: ForceLog, bias: Array, held: Array, mass: float | None) -> list[Finding]:
    """A warning (CS3130) where a tare's bias (3,) [N] takes back a part of the weight held (3,) [N] in its stretches, and
    nothing else: it is not in the log as it is stated. All of it a sensor has that was zeroed with the tool on."""
    heavy = float(np.linalg.norm(held))
    if not mass or heavy < HEAVY:
        return []
    share = -float(bias @ held) / heavy**2
    if not TAKEN_BACK[0] < share < TAKEN_BACK[1] or np.linalg.norm(bias + share * held) > ASIDE * heavy:
        return []
    unit = next((f"; forces in {unit} would be so" for unit, newton in UNITS.items()
                 if abs((1 - share) * newton - 1) < SAME_UNIT), "")
    return [Finding("CS3130", "warning", f"the bias takes {100 * share:.0f} % of the weight of {mass:g} kg back: the log shows "
                    f"{(1 - share) * heavy:.0f} of {heavy:.0f} N{unit}", file=log.source,
                    hint="are the forces in newtons, and is the payload's mass_kg what hangs on the sensor? A sensor that was "
                    "zeroed with the tool on takes all of it back")]


def _turned_round(log: ForceLog, bias: Array, held: Array, mass: float | None) -> list[Finding]:
    """A warning (CS3131) where a tare's bias (3,) [N] is what turns a weight round into the stated one, held (3,) [N] in its
    stretches: the log has it in full, along another line."""
    heavy = float(np.linalg.norm(held))
    if not mass or heavy < HEAVY_TURNED or np.linalg.norm(bias) < TURNED_BIAS * heavy:
        return []
    shown = bias + held
    if abs(np.linalg.norm(shown) - heavy) > SAME_SIZE * heavy:
        return []
    turned = float(np.degrees(np.arccos(np.clip(shown @ held / (np.linalg.norm(shown) * heavy), -1, 1))))
    if turned > UPWARDS:
        where, hint = "pointing upwards", ("is force_log.sign right, and base_frame, if the robot hangs or stands on a wall? "
                                           "With the wrong sign the correction doubles the error.")
    else:
        where, hint = f"{turned:.0f} degrees from plumb", ("how does the sensor sit on the flange (force_log.frame, "
                                                           "sensor_quaternion)?")
    return [Finding("CS3131", "warning", f"the log shows the weight of {mass:g} kg {where}: {np.linalg.norm(shown):.0f} N of "
                    f"{heavy:.0f}, and a bias of {np.linalg.norm(bias):.0f} N would have to make up for it", file=log.source,
                    hint=f"{hint} Only a sensor whose own zero is that far off would show the same")]


def _weighed(log: ForceLog, form: ForceLogFrame, mass: float, mean: Array, held: Array, *, tared: bool) -> Finding:
    """What is said of the weight that is subtracted: mean (n, 3) [N] of each target with samples, without the bias, and the
    weight held (n, 3) [N] there. Raises CompstiffError (CS3032) where the log does not hold it."""
    heavy = mass * FREE_FALL
    quiet = float(np.quantile(np.linalg.norm(mean, axis=1), 0.05))
    left = float(np.quantile(np.linalg.norm(mean - held, axis=1), 0.05))
    if not tared and quiet < NOT_IN_LOG * heavy and left > (1 - NOT_IN_LOG) * heavy:
        raise error("CS3032", f"the payload of {mass:g} kg weighs {heavy:.0f} N, and the quietest targets of the log show "
                    f"{quiet:.1f} N: its weight is not in the log", file=log.source,
                    hint="state force_log.weight: removed in cell.yaml if the logger takes it off; if the sensor was zeroed "
                    "with the tool on, name an air move with --tare")
    stated = tared or form.bias is not None or form.weight is not None
    return Finding("CS3031", "note" if stated else "warning", f"the weight of the payload of {mass:g} kg, {heavy:.0f} N, was "
                   "subtracted at each target's orientation", file=log.source,
                   hint="" if stated else "right only if the log holds that weight and the sensor has no bias: say so with "
                   "force_log.weight: in_log (or removed) in cell.yaml, or name an air move with --tare")


def _list(values: Array, digits: int) -> str:
    return ", ".join(f"{x:.{digits}f}" for x in values)
