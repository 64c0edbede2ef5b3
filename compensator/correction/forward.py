"""The forward model along a program (docs/architecture.md): where each target's tool rests under its force, effects included.

The springs are those of compliance.py. Effects beyond them are evaluated over all targets of the program in their order, air
moves with zero load among them, as one visit from zero load: what a gear remembers of its load passes from target to target,
whatever tool is in the spindle. A target of unknown pose stands for the pose before it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.loaded_path import LoadedPath
from identification.common.findings import CompstiffError
from identification.model.compliance import CHUNK, displacement, equilibrium, loaded_angles
from identification.model.effects_in_force import EffectInForce, displaced, split, turned
from identification.model.kinematics import chunks, forward
from identification.model.load_state import LoadState
from identification.model.rotations import Frame

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Newton's method for the angles under an effect: a step shrinks the error by the effect's slope, a few thousandths where it is
# linear and up to one half where a gear crosses its gap.
MAX_ROUNDS = 60
TOLERANCE = 1e-11
# Damping of its pseudo-inverse [m/rad, 1], against singular poses: far below the Jacobian's singular values elsewhere.
DAMPING = 1e-6


@dataclass(frozen=True, eq=False)
class Block:
    """Some of the targets that are looked at, all with one tool: their places (n,) among the M, the tool, and base_from_tcp (n)
    under their force."""

    places: Indices
    flange_from_tcp: Frame
    tool: Frame


def loaded_blocks(loaded: LoadedPath, theta: Array, *, weight: bool = False) -> Iterator[Block]:
    """The loaded tool, block by block, when the robot is commanded to theta (M, 6) [rad] at the targets and to the planned
    angles elsewhere: where an unloaded robot would have to be commanded to, to stand there, its own weight and all; or, with
    `weight`, as one sees it who measures from where the unloaded robot stands at theta: the weight the load moves is in it.

    Raises CompstiffError (CS1101) where the springs find no equilibrium.
    """
    alone, rest = loaded.model.of_springs_alone, np.empty((0, 6)) if loaded.model.of_springs_alone else np.empty_like(theta)
    blocks = _plain(loaded, theta, rest)
    if alone or not len(loaded.targets):
        yield from blocks
        return
    if not loaded.model.effects:
        wrench = np.nan_to_num(loaded.wrench)
        for block in blocks:
            rows = loaded.model.load_state(rest[block.places], wrench[block.places], block.flange_from_tcp)
            yield replace(block, tool=displaced(block.tool, loaded.model.added(rows) + (rows.of_weight if weight else 0.0)))
        return
    plain = list(blocks)                # effects remember: they are worked out over the whole program
    rows = load_state_of(loaded, rest)
    added = (loaded.model.added(rows) + (rows.of_weight if weight else 0.0))[loaded.targets]
    for block in plain:
        yield replace(block, tool=displaced(block.tool, added[block.places]))


def loaded_tool(loaded: LoadedPath, theta: Array) -> Frame:
    """base_from_tcp (M) of all targets, as in `loaded_blocks`."""
    rotation, position = np.empty((len(theta), 3, 3)), np.empty((len(theta), 3))
    for block in loaded_blocks(loaded, theta):
        rotation[block.places], position[block.places] = block.tool.rotation, block.tool.position
    return Frame(rotation, position)


def off_goal(loaded: LoadedPath, theta: Array) -> Array:
    """Distance (M,) [m] of the loaded tool from where the model shall bring it."""
    distance = np.empty(len(theta))
    for block in loaded_blocks(loaded, theta):
        off = block.tool.position - loaded.goal_of(block.places).position
        distance[block.places] = np.linalg.norm(off, axis=1)
    return distance


def _plain(loaded: LoadedPath, theta: Array, rest: Array) -> Iterator[Block]:
    """The tool under the springs alone; into rest (M, 6) [rad], where it is not empty, the angles at which an unloaded robot
    stands there."""
    path, model, targets = loaded.path, loaded.model, loaded.targets
    for tool, of_tool in loaded.each_tool():
        for part in chunks(len(of_tool), CHUNK):
            places = of_tool[part]
            try:
                state = equilibrium(model.robot, theta[places], tool, loaded.forces.wrench[targets[places]], model.compliance)
            except CompstiffError as stopped:
                force = np.linalg.norm(loaded.wrench[of_tool, :3], axis=1)
                worst = int(targets[of_tool[np.argmax(force)]])
                raise CompstiffError(*(path.finding(worst, finding.code, "error", f"{finding.message} (largest force "
                                                    f"{force.max():.3g} N)", finding.hint)
                                       for finding in stopped.findings)) from stopped
            angles = loaded_angles(model.robot, theta[places], state.deflection)
            if len(rest):
                rest[places] = angles
            yield Block(places, tool, forward(model.robot, angles, tool))


def load_state_of(loaded: LoadedPath, rest: Array) -> LoadState:
    """All targets of the program (N), as the effects see them: at rest at angles rest (M, 6) [rad] at those looked at, at the
    planned angles elsewhere."""
    path = loaded.path
    planned = path.theta.copy()
    planned[loaded.targets] = rest
    known = ~np.isnan(planned).any(axis=1)
    before = np.maximum.accumulate(np.where(known, np.arange(len(planned)), int(np.argmax(known))))
    wrench = np.nan_to_num(loaded.forces.wrench)
    # A target's force acts during the move there; moves of unknown feed take no time.
    return loaded.model.load_state(planned[before], wrench, path.flange_from_tcp, np.nan_to_num(path.move_time, posinf=0.0))


def resting_angles(loaded: LoadedPath) -> Array:
    """Angles (M, 6) [rad] at which the springs must hold the robot, so that what the effects add brings the tool to the plan.

    Newton's method on the pose with the Jacobian of the joints alone; where an effect changes so steeply that a step does not
    bring the tool nearer, that target's steps are halved. What has not converged is left for the caller to find.
    """
    model, targets, goal, rest = loaded.model, loaded.targets, loaded.goal, loaded.theta
    last, share = np.full(len(targets), np.inf), np.ones(len(targets))
    for _ in range(MAX_ROUNDS):
        rows = load_state_of(loaded, rest)
        tool = displaced(Frame(rows.tool[targets], rows.tcp[targets]), model.added(rows)[targets])
        missing = np.concatenate(displacement(goal, tool), axis=1)
        distance = np.linalg.norm(missing, axis=1)
        if not distance.max(initial=0.0) > TOLERANCE:
            break
        share = np.where(distance > (1 - 0.25 * share) * last, 0.5 * share, share)
        last = distance
        columns = rows.serial_jacobian[targets]
        normal = columns @ np.swapaxes(columns, 1, 2) + DAMPING**2 * np.eye(6)
        turn = np.einsum("nri,nr->ni", columns, np.linalg.solve(normal, missing[:, :, None])[:, :, 0])
        rest = rest + share[:, None] * turn @ model.robot.uncoupling.T
    return np.asarray(rest)


@dataclass(frozen=True, eq=False)
class StateChange:
    """An effect that rests at another end of its play or friction than before: places (K,) in the targets with force, largest
    (K,) [m] of the steps that its contribution makes there from the target before."""

    of: EffectInForce
    places: Indices
    step: Array


def state_changes(loaded: LoadedPath) -> list[StateChange]:
    """Where along the program the state of an effect changes, with the loaded tool on the plan."""
    model, targets = loaded.model, loaded.targets
    if not len(targets):
        return []
    rows = load_state_of(loaded, loaded.theta)
    changes = []
    for effect, values in zip(model.effects, split(model.values, model.effects), strict=True):
        side = effect.effect.side(rows, effect.joint, values)
        if side is None:
            continue
        places = np.flatnonzero(turned(side)[targets])
        if len(places):
            moved = effect.contribution(rows, values)[:, :3]
            step = np.linalg.norm(moved[targets[places]] - moved[targets[places] - 1], axis=1)
            changes.append(StateChange(effect, places, step))
    return changes
