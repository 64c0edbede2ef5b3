"""Predicted deviation of the uncorrected targets under their force, with its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.correction.forward import StateChange, each_tool, loaded_path, program, state_changes
from compensator.forces.placement import TargetForces
from compensator.path.robot_path import RobotPath
from identification.common.findings import CompstiffError, Finding
from identification.model.compliance import compliance_matrix, displacement
from identification.model.kinematics import forward
from identification.model.rotations import Frame
from identification.model.stiffness import IdentifiedModel
from identification.model.stiffness_file import same_tool

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# No cut is as light, and no robot as stiff [m].
HARDLY = 2e-6


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted deviation of the `targets` (M,) with force, without correction, base frame.

    position (M, 3) [m], rotation (M, 3) rotation vector [rad], covariance (M, 3, 3) [m^2] of the position: posterior of
    the stiffnesses and effects, plus the scatter of the mean force where the log gives one. notes (M,): the effects whose state
    changes before the target, "" where none does.
    """

    targets: Indices
    position: Array
    rotation: Array
    covariance: Array
    notes: NDArray[np.object_]
    findings: tuple[Finding, ...]

    @property
    def std(self) -> Array:
        """1 sigma of each component (M, 3) [m]."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


def predict_path(path: RobotPath, forces: TargetForces, model: IdentifiedModel, targets: Indices) -> Prediction:
    """Deviation of the uncorrected targets under their force, with its covariance.

    The scatter of the force is carried through the springs alone, effects left out. Raises CompstiffError: CS1101 no
    equilibrium, CS1202 another tool than the one an effect in force was identified with.
    """
    _check_tools(path, model, targets)
    count = len(targets)
    loaded = loaded_path(path, forces, model, targets, path.theta[targets])
    of_effects = None
    if model.effects and count:
        of_effects = model.slopes(program(path, forces, model, targets, path.theta[targets]))[targets]
    position, rotation, covariance = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3, 3))
    for tool, places in each_tool(path, targets):
        theta, wrench = path.theta[targets[places]], forces.wrench[targets[places]]
        position[places], rotation[places] = displacement(
            Frame(loaded.rotation[places], loaded.position[places]), forward(model.robot, theta, tool))
        covariance[places] = model.deviation_covariance(
            theta, wrench, tool, None if of_effects is None else of_effects[places])[:, :3, :3]
        scatter = np.nan_to_num(forces.standard_error[targets[places]]) ** 2
        if scatter.any():
            carried = compliance_matrix(model.robot, theta, tool, model.compliance)[:, :3, :3]
            covariance[places] += np.einsum("nij,nj,nkj->nik", carried, scatter, carried)
    notes, findings = _state_notes(path, targets, state_changes(path, forces, model, targets) if model.effects else [])
    largest = np.linalg.norm(position, axis=1).max(initial=0.0)
    if count and largest < HARDLY:
        findings = [*findings, Finding(
            "CS4125", "warning", f"the largest predicted deviation is {1e6 * largest:.2g} um, with forces of up to "
            f"{np.linalg.norm(forces.wrench[targets, :3], axis=1).max():.3g} N", file=path.toolpath.source,
            hint="are the forces in newtons, and is it the stiffness file of this robot?")]
    return Prediction(targets, position, rotation, covariance, notes, (*_unknown_gravity(model), *findings))


def _check_tools(path: RobotPath, model: IdentifiedModel, targets: Indices) -> None:
    """CompstiffError (CS1202) where a move with force uses another tool than the one an effect was identified with."""
    of_tool = ", ".join(one.label for one in model.effects if one.effect.of_tool)
    others = [int(targets[places[0]]) for tool, places in each_tool(path, targets)
              if of_tool and not same_tool(tool, model.flange_from_tcp)]
    if others:
        raise CompstiffError(*(path.finding(target, "CS1202", "error", f"{of_tool} was identified with the cell's tool; this "
                                            "move "
                                  f"with force uses {path.toolpath.tools[path.toolpath.tool[target]].name}, whose TCP is "
                                  "another", "identify with this tool, or use a stiffness file without that effect")
                               for target in others))


def _unknown_gravity(model: IdentifiedModel) -> list[Finding]:
    """A note (CS1404) where gravity enters an effect and the robot file does not tell it."""
    upright = bool(np.all(np.abs(model.fall[:2]) < 1e-6))
    asking = [one.label for one in model.effects if one.effect.of_gravity and not (upright and one.joint == 1)]
    if not asking or model.robot.link_mass is not None:
        return []
    return [Finding("CS1404", "note", f"the robot file has no links: gravity torques are taken as zero in {', '.join(asking)}",
                    file=str(model.robot.source), hint="add links (mass and centre) to a robot file of your own")]


def _state_notes(path: RobotPath, targets: Indices, changes: list[StateChange]) -> tuple[NDArray[np.object_], list[Finding]]:
    """A note (M,) for each target before which the state of an effect changes, and one finding (CS4111) for each effect."""
    notes, findings = np.full(len(targets), "", dtype=object), []
    for change in changes:
        words = f"{change.of.label} {change.of.effect.turning} before"
        notes[change.places] = [f"{note}{'; ' if note else ''}{words} this target" for note in notes[change.places]]
        largest = int(np.argmax(change.step))
        findings.append(path.finding(int(targets[change.places[largest]]), "CS4111", "note", f"{words} {len(change.places)} of "
                           f"{len(targets)} targets with force: deviation and correction step there, by up to "
                           f"{1e6 * change.step[largest]:.1f} um", "the column note of the offsets names the targets"))
    return notes, findings
