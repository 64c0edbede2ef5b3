"""Force follows the cut: a corrected path cuts deeper than the pass in which the force was logged, and the force grows with it.

While the log was taken the tool stood at e = o + d off the plan: o the offsets the program had then (none in the planned
program), d the deviation under the logged force F. Corrected, it stands on the plan, moved by -e. The material pushes the
tool along n, the unit vector of the force's part across the feed, F_n = F . n; moving the tool by -e takes it e . n deeper.
With the cutting stiffness K [N/m], the change of F_n per metre of depth, and all parts of the force growing alike,

    F' = F (1 + K (e . n) / F_n) .

The corrected tool is on the plan, so this is the solution of the coupled problem, not a step towards it. K is given, or
comes from two passes of one program: K = sum dF_n dt_n / sum dt_n^2 over their targets, t_n the depth, with a standard error
from stretches of the path, since neighbouring targets err alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.correction.loaded_path import LoadedPath
from compensator.correction.predict import Predicted, under_forces
from compensator.correction.prediction import Prediction, predict_path
from compensator.correction.settings import Estimate
from compensator.forces.placement import TargetForces
from compensator.forces.two_logs import compared
from compensator.path.robot_path import RobotPath
from identification.common.findings import CompstiffError, Finding, Refused, counted, error
from identification.common.tables import read_table

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Where less than this share of the force stands across the feed it says nothing of a depth.
LEAST_ACROSS = 0.05
STRETCHES = 20
FEWEST_TARGETS = 40
# What is left for this cutting stiffness [N/m] is told where none is known.
ASSUMED = 1e4
# So large a share of the force grows with the depth of cut; that of the edges does not. Engineering judgement.
GROWS = 0.5
# The planned positions in an offsets file are this program's [m].
SAME_PLACE = 2e-6
OFFSETS, PLACES = ("ox_mm", "oy_mm", "oz_mm"), ("x_mm", "y_mm", "z_mm")


def read_offsets(file: Path, path: RobotPath) -> Array:
    """The offsets (N, 3) [m], base frame, that the program had in a pass: an offsets.csv of this program.

    Raises CompstiffError: CS4121 the file belongs to another program; and what `read_table` raises.
    """
    table = read_table(file, required=("target", *OFFSETS), optional=PLACES, may_be_empty=PLACES)
    count = len(path.toolpath)
    wrong = "" if np.array_equal(table.numbers["target"], np.arange(count)) else (
        f"has {counted(len(table), 'row')}, the program {counted(count, 'target')}: expected one row a target, in order")
    if not wrong and all(name in table.numbers for name in PLACES):
        apart = np.linalg.norm(1e-3 * table.stack(*PLACES) - path.toolpath.position, axis=1)
        if np.nanmax(apart, initial=0.0) > SAME_PLACE:
            wrong = f"target {int(np.nanargmax(apart))} is {1e3 * np.nanmax(apart):.4g} mm from where this program has it"
    if wrong:
        raise error("CS4121", f"these are not the offsets of this program: {wrong}", file=str(file),
                    hint="name the offsets.csv that was written with the program the log was taken with")
    return np.asarray(np.einsum("nij,nj->ni", path.base_from_object.rotation, 1e-3 * table.stack(*OFFSETS)))


def across_feed(path: RobotPath, force: Array) -> tuple[Array, Array]:
    """n (N, 3) unit vectors of the force's part across the feed, and that part F_n (N,) [N]; zeros where it is too small.

    force (N, 3) [N], base frame. The feed's direction at a target is that from the target before to the one after.
    """
    position = path.base_from_tcp.position
    known = np.flatnonzero(path.known)
    along = np.zeros_like(position)
    if len(known) > 1:
        along[known] = np.gradient(position[known], axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    across = force - np.einsum("ni,ni->n", force, along)[:, None] * along
    size = np.linalg.norm(across, axis=1)
    enough = size > LEAST_ACROSS * np.linalg.norm(force, axis=1)
    return np.where(enough[:, None], across / np.maximum(size, 1e-300)[:, None], 0.0), np.where(enough, size, 0.0)


@dataclass(frozen=True, eq=False)
class LoggedPass:
    """What is known of the pass that the log was taken in. offsets (N, 3) [m], base frame, that the program had then, None: it
    was the planned one; stiffness: of the cut [N/m], None: not known."""

    offsets: Array | None
    stiffness: Estimate | None
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True, eq=False)
class CorrectedPass:
    """The path under the forces that the corrected pass meets, and the deviation that they cause. left_as_logged (M,) [m]: how
    far off the plan a cutting stiffness of ASSUMED would leave the tool, None where the force follows the cut."""

    loaded: LoadedPath
    prediction: Prediction
    left_as_logged: Array | None
    findings: tuple[Finding, ...] = ()


def logged_pass(predicted: Predicted) -> LoggedPass:
    """As the settings say: the cutting stiffness stated, or that of two passes. Raises what `read_offsets` and `two_passes`
    raise, and what the first pass's log raises."""
    settings = predicted.settings.correction
    offsets = read_offsets(settings.logged_with, predicted.path) if settings.logged_with else None
    if settings.cutting_stiffness is not None or settings.first_forces is None or offsets is None:
        return LoggedPass(offsets, settings.cutting_stiffness)
    first = under_forces(predicted.path, predicted.program, predicted.model, settings.first_forces, predicted.settings,
                         predicted.loaded.learned)
    agreed = compared(first.forces, predicted.forces, predicted.path)
    stiffness = two_passes(first, predicted, offsets)
    return LoggedPass(offsets, stiffness, (
        *agreed,
        Finding("CS4124", "note", f"cutting stiffness from the two passes: {1e-3 * stiffness.value:.3g} N/mm, standard "
                f"error {1e-3 * stiffness.std:.2g}", file=predicted.forces.log.source),))


def following_the_cut(predicted: Predicted, kept: Indices, logged: LoggedPass) -> CorrectedPass:
    """The corrected pass of a program whose targets as given stand at the places `kept`."""
    offsets = _at_all(logged.offsets, kept, predicted)
    if logged.stiffness is None:
        with np.errstate(over="ignore", invalid="ignore"):      # absurd numbers in targets without force
            return CorrectedPass(predicted.loaded, predicted.prediction, left_as_logged(predicted, ASSUMED, offsets))
    forces, findings = engaged(predicted, logged.stiffness, offsets)
    loaded = replace(predicted.loaded, forces=forces)
    return CorrectedPass(loaded, predict_path(loaded), None, findings)


def _at_all(offsets: Array | None, kept: Indices, predicted: Predicted) -> Array | None:
    """Offsets of the targets as given, at all targets of the program (N, 3) [m]."""
    if offsets is None:
        return None
    return np.column_stack([np.interp(np.arange(len(predicted.path.toolpath)), kept, axis) for axis in offsets.T])


def standing(predicted: Predicted, offsets: Array | None) -> Array:
    """Where the tool stood off the plan in the logged pass (N, 3) [m], base frame: offsets plus deviation."""
    stood = np.zeros((len(predicted.path.toolpath), 3)) if offsets is None else offsets.copy()
    stood[predicted.targets] += predicted.prediction.position
    return stood


def engaged(
    predicted: Predicted, stiffness: Estimate, offsets: Array | None
) -> tuple[TargetForces, tuple[Finding, ...]]:
    """The forces of the corrected pass, out of those of the logged pass; offsets (N, 3) [m] the log was taken with.

    The uncertainty of the stiffness joins the force's standard error. Raises CompstiffError (CS4123) where the force would
    vanish or more than double: then the stiffness does not fit the log.
    """
    forces, toolpath = predicted.forces, predicted.path.toolpath
    per_newton, chosen = _deeper(predicted, offsets)
    growth = stiffness.value * per_newton
    worst = int(np.argmax(np.abs(growth))) if len(growth) else 0
    if len(growth) and abs(growth[worst]) >= 1:
        raise CompstiffError(Finding(
            "CS4123", "error", f"with a cutting stiffness of {1e-3 * stiffness.value:g} N/mm the force here would change by "
            f"{100 * growth[worst]:.0f} %, expected less than 100 %", file=toolpath.source, line=int(toolpath.line[worst]),
            target=int(toolpath.number[worst]),
            hint="the unit is newton per millimetre of depth; about force divided by depth of cut"))
    error_of = np.abs(forces.wrench[:, :3] * per_newton[:, None]) * stiffness.std
    cut = replace(forces, wrench=forces.wrench * (1 + growth)[:, None],
                  standard_error=np.sqrt(forces.standard_error**2 + error_of**2) if stiffness.std else forces.standard_error)
    size = growth[chosen]
    left = len(predicted.targets) - int(chosen.sum())
    note = f"; {left} with next to no force across the feed keep theirs" if left else ""
    return cut, (Finding(
        "CS4120", "note", f"force follows the cut: with a cutting stiffness of {1e-3 * stiffness.value:.3g} N/mm the corrected "
        f"pass meets forces that are {100 * np.median(size) if len(size) else 0:+.1f} % (median), "
        f"{100 * np.max(np.abs(size), initial=0):.1f} % at most, off the logged{note}", file=toolpath.source),)


def left_as_logged(predicted: Predicted, stiffness: float, offsets: Array | None) -> Array:
    """How far off the plan (M,) [m] the tool stays with a cutting stiffness [N/m] where the forces are taken as logged.

    By g = K (e . n) / F_n more force it yields by g |d| more, which takes it out of the cut again: |d| g / (1 + g) is left.
    """
    per_newton, _ = _deeper(predicted, offsets)
    return _left(predicted, stiffness * per_newton)


def left_at_depth(predicted: Predicted, kept: Indices, logged: LoggedPass) -> Array:
    """The same (M,) [m] for a cut of the settings' depth a across the feed: half the force grows with it, K = F_n / 2 a."""
    with np.errstate(over="ignore", invalid="ignore"):          # absurd numbers in targets without force
        per_newton, _ = _deeper(predicted, _at_all(logged.offsets, kept, predicted))
        _, across = across_feed(predicted.path, predicted.forces.wrench[:, :3])
    return _left(predicted, GROWS * per_newton * across / predicted.settings.correction.depth_of_cut)


def _left(predicted: Predicted, growth: Array) -> Array:
    growth = np.abs(growth[predicted.targets])
    return np.asarray(np.linalg.norm(predicted.prediction.position, axis=1) * growth / (1 + growth))


def _deeper(predicted: Predicted, offsets: Array | None) -> tuple[Array, NDArray[np.bool_]]:
    """(e . n) / F_n (N,) [m/N], and where there is such a force (N,)."""
    direction, across = across_feed(predicted.path, predicted.forces.wrench[:, :3])
    deeper = np.einsum("ni,ni->n", standing(predicted, offsets), direction)
    chosen = np.zeros(len(across), dtype=bool)
    chosen[predicted.targets] = True
    chosen &= across > 0
    return np.where(chosen, deeper / np.maximum(across, 1e-300), 0.0), chosen


def two_passes(first: Predicted, second: Predicted, offsets: Array) -> Estimate:
    """K from a pass of the planned program (first) and one with offsets (N, 3) [m] (second), each under its own log.

    Raises CompstiffError (CS4122) where the passes do not determine it: too few targets, or an error of more than half;
    Refused (CS3117) where the force falls with the depth.
    """
    direction, across = across_feed(first.path, first.forces.wrench[:, :3])
    both = np.zeros(len(across), dtype=bool)
    both[np.intersect1d(first.targets, second.targets)] = True
    both &= across > 0
    change = np.einsum("ni,ni->n", second.forces.wrench[:, :3] - first.forces.wrench[:, :3], direction)[both]
    depth = np.einsum("ni,ni->n", standing(first, None) - standing(second, offsets), direction)[both]
    power = float(depth @ depth)
    if len(depth) >= FEWEST_TARGETS and power > 0:
        value = float(depth @ change) / power
        moments = np.array([part.sum() for part in np.array_split(depth * (change - value * depth), STRETCHES)])
        std = float(np.sqrt((moments**2).sum() * STRETCHES / (STRETCHES - 1))) / power
        if value > 2 * std:
            return Estimate(value, std)
        if value < -3 * std:
            raise Refused(Finding(
                "CS3117", "error", f"the corrected pass, which by force_log.sign cut {1e6 * np.abs(depth).mean():.0f} um "
                f"deeper, shows less force ({np.sign(np.median(change)) * np.abs(change).mean():+.1f} N): "
                f"{1e-3 * value:.3g} N/mm of depth, standard error {1e-3 * std:.3g}", file=second.forces.log.source,
                hint="force_log.sign in cell.yaml is wrong (then the first correction doubled the error), or the logs are "
                "swapped"))
        why = f"{1e-3 * value:.3g} N/mm with a standard error of {1e-3 * std:.3g}"
    else:
        why = f"only {counted(len(depth), 'target')} with force in both, expected at least {FEWEST_TARGETS}"
    raise error("CS4122", f"the two passes do not determine the cutting stiffness: {why}", file=first.path.toolpath.source,
                hint="is each log that of its pass? state it with --cutting-stiffness, or correct from the second log alone")
