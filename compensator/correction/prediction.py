"""Predicted deviation of the uncorrected targets under their force, with its covariance.

Forces that were predicted are those of a tool on its plan, F0, and so is the deviation d0 = C F0 under them, which a correction
has to take away. The program as it is has another: its tool yields, stands less deep and meets less, F0 + J d, where J is what
the engagement says that the force changes by aside. It comes to rest at d = (1 - C J)^-1 d0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.correction.forward import StateChange, load_state_of, loaded_blocks, state_changes
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.turned_sensor import by_turned_sensor, lever_of, mounting_std
from compensator.correction.wide_springs import WideSprings
from compensator.learned.learned import Rest
from identification.common.arrays import held_once, read_only
from identification.common.findings import CompstiffError, Finding
from identification.common.quantities import cause_words
from identification.model.compliance import carried_by, symmetric
from identification.model.kinematics import chunks, forward, spring_columns
from identification.model.stiffness import IdentifiedModel
from identification.model.stiffness_file import same_tool

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
POSITION = slice(0, 3)
# No cut is as light, and no robot as stiff [m].
HARDLY = 2e-6
# A cut makes no more of a deviation than so many times what it is on the plan.
MOST_DRAWN = 2.0


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted deviation of the `targets` (M,) with force, without correction, base frame.

    position (M, 3) [m], covariance (M, 3, 3) [m^2] of it: posterior of the stiffnesses and effects, plus the scatter of the
    mean force where the log gives one, plus what is learned of the rest.
    notes (M,): the effects whose state changes before the target, "" where none does. learned (M, 3) [m]: the part of position
    that a measured part taught; of_learned (M,) [m^2]: its part of the covariance's trace; of_scatter (M,)
    [m^2]: that of the mean force's scatter, of_force (M,) [m^2]: that of a force that was predicted; unseen (M, 3, 3) [m^2]:
    the part of covariance of what no measured part shows there, None: nothing was learned.
    at_rest (M, 3) [m], at_rest_covariance (M, 3, 3) [m^2]: where the tool of the program as it is comes to rest. Of logged
    forces, which are those of that pass, they are position and covariance.
    turned (M, 3, 3) [m^2]: covariance beside that by a sensor that is turned in its seat; None: nothing is said of that. wide:
    what is more where springs are known to a factor; None: they are known well.
    """

    targets: Indices
    position: Array
    covariance: Array
    notes: NDArray[np.object_]
    findings: tuple[Finding, ...]
    learned: Array
    of_learned: Array
    of_scatter: Array
    unseen: Array | None
    of_force: Array
    at_rest: Array
    at_rest_covariance: Array
    turned: Array | None = None
    wide: WideSprings | None = None

    @property
    def known(self) -> Array:
        """The covariance (M, 3, 3) [m^2] without what no measured part shows, which no correction has to do with."""
        return self.covariance if self.unseen is None else np.asarray(self.covariance - self.unseen)

    @property
    def std(self) -> Array:
        """1 sigma of each component (M, 3) [m]."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def at_rest_std(self) -> Array:
        """The same of `at_rest`."""
        return np.sqrt(np.diagonal(self.at_rest_covariance, axis1=1, axis2=2))


def predict_path(loaded: LoadedPath) -> Prediction:
    """Deviation of the uncorrected targets under their force, with its covariance.

    The scatter of the force is carried through the springs alone, effects left out. Raises CompstiffError: CS1101 no
    equilibrium, CS1202 another tool than the one an effect in force was identified with.
    """
    _check_tools(loaded)
    model, targets, theta, wrench = loaded.model, loaded.targets, loaded.planned_theta, loaded.wrench
    count = len(targets)
    of_effects = model.of_effects(load_state_of(loaded, theta)).of(targets) if model.effects and count else None
    position, covariance = np.empty((count, 3)), np.empty((count, 3, 3))
    learned, of_learned, unseen = np.broadcast_to(0.0, (count, 3)), np.broadcast_to(0.0, count), None
    unknown, follows, of_zero = loaded.forces.unknown, loaded.forces.follows, loaded.forces.of_zero
    yields = None if follows is None else np.empty((count, 3, 3))
    turned_by = mounting_std(loaded)
    turned, lever = (np.empty((count, 3, 3)), lever_of(loaded)) if turned_by else (None, None)
    wide = WideSprings.of(model, count)
    of_scatter, of_force = np.zeros(count), np.broadcast_to(0.0, count) if unknown is None else np.zeros(count)
    for block in loaded_blocks(loaded, theta, weight=True):
        tool, places = block.flange_from_tcp, block.places
        position[places] = block.tool.position - forward(model.robot, theta[places], tool).position
        for part in chunks(len(places)):
            few = places[part]
            scatter = np.nan_to_num(loaded.forces.standard_error[targets[few]]) ** 2 + of_zero[targets[few]]
            columns = spring_columns(model.robot, theta[few], tool)
            adding = None if of_effects is None else of_effects.of(few)
            spread = model.covariance_by(columns, wrench[few], adding, rows=POSITION)
            if turned is not None and lever is not None:
                turned[few] = by_turned_sensor(columns, model.compliance, wrench[few], lever[few], turned_by).T
            if wide is not None:
                wide.put(few, model, columns, wrench[few])
            if scatter.any() or unknown is not None:
                carried = carried_by(columns, model.compliance)
                if unknown is not None:
                    of_forces = carried.T @ unknown[targets[few]] @ carried.T
                    spread += of_forces.T
                    of_force[few] = np.trace(of_forces, axis1=1, axis2=2)
                if yields is not None and follows is not None:
                    yields[few] = _yields(carried.T, follows[targets[few]])
                if scatter.any():
                    scattered = symmetric(carried, scatter.T[:, None] * carried)
                    spread += scattered
                    of_scatter[few] = np.trace(scattered)
            covariance[few] = spread.T
    outside: list[Finding] = []
    if loaded.learned is not None and loaded.rest is not None:
        learned = loaded.rest.mean.copy()
        added, unseen = loaded.learned.covariance_beside(deviation_slopes(loaded)[:, :3], loaded.rest)
        of_learned = np.trace(added, axis1=1, axis2=2)
        position, covariance = position + learned, covariance + added
        read_only(learned, of_learned, unseen)
        outside = _outside(loaded, loaded.rest)
    notes, findings = _state_notes(loaded, state_changes(loaded) if model.effects else [])
    notes = held_once(notes)
    largest = np.linalg.norm(position, axis=1).max(initial=0.0)
    if count and largest < HARDLY:
        findings = [*findings, Finding(
            "CS4125", "warning", f"the largest predicted deviation is {1e6 * largest:.2g} um, with forces of up to "
            f"{np.linalg.norm(wrench[:, :3], axis=1).max():.3g} N", file=loaded.path.toolpath.source,
            hint="are the forces in newtons, and is it the stiffness file of this robot?")]
    at_rest, at_rest_covariance = position, covariance
    if yields is not None:
        at_rest = np.einsum("nij,nj->ni", yields, position)
        at_rest_covariance = yields @ covariance @ yields.swapaxes(1, 2)
    read_only(position, covariance, notes, of_scatter, of_force, at_rest, at_rest_covariance,
              *([] if turned is None else [turned]))
    return Prediction(targets, position, covariance, notes, (*_unknown_gravity(model), *outside, *findings), learned,
                      of_learned, of_scatter, unseen, of_force, at_rest, at_rest_covariance, turned, wide)


def _yields(compliance: Array, follows: Array) -> Array:
    """(1 - C J)^-1 (n, 3, 3) of compliances C [m/N] and what the force follows, J [N/m]; 1 where that would go far beyond the
    place that J was found at: a cut that draws the tool in."""
    inverse = np.linalg.inv(np.eye(3) - compliance @ follows)
    far = np.linalg.norm(inverse, ord=2, axis=(1, 2)) > MOST_DRAWN
    inverse[far] = np.eye(3)
    return np.asarray(inverse)


def deviation_slopes(loaded: LoadedPath) -> Array:
    """Derivative (M, 6, 6 + P) [m, rad] of the deviation by the model's parameters, at the planned angles."""
    model, theta, wrench = loaded.model, loaded.planned_theta, loaded.wrench
    of_effects = model.of_effects(load_state_of(loaded, theta)).of(loaded.targets) if model.effects and len(theta) else None
    slopes = np.empty((len(theta), 6, len(model.mean)))
    for tool, places in loaded.each_tool():
        slopes[places] = model.deviation_slopes(theta[places], wrench[places], tool,
                                                None if of_effects is None else of_effects.of(places))
    return slopes


def _outside(loaded: LoadedPath, rest: Rest) -> list[Finding]:
    """A warning (CS5323) where targets stand outside of what was measured."""
    off = np.flatnonzero(~rest.inside)
    if not len(off):
        return []
    return [loaded.path.finding(
        int(loaded.targets[off[0]]), "CS5323", "warning", f"{len(off)} of {len(rest.inside)} targets with force "
        f"({100 * len(off) / len(rest.inside):.0f} %) stand where no measured part was: the learned remainder shrinks to "
        f"nothing there, and its width of {1e6 * loaded.learned.remainder.amplitude if loaded.learned else 0:.0f} um stays",
        "the springs learned hold there too; measure a part there to learn the rest")]


def _check_tools(loaded: LoadedPath) -> None:
    """CompstiffError (CS1202) where a move with force uses another tool than the one an effect was identified with."""
    path, targets = loaded.path, loaded.targets
    of_tool = ", ".join(effect.label for effect in loaded.model.effects if effect.effect.of_tool)
    others = [int(targets[places[0]]) for tool, places in loaded.each_tool()
              if of_tool and not same_tool(tool, loaded.model.flange_from_tcp)]
    if others:
        raise CompstiffError(*(
            path.finding(target, "CS1202", "error", f"{of_tool} was identified with the cell's tool; this move with force uses "
                         f"{path.toolpath.tools[path.toolpath.tool[target]].name}, whose TCP is another",
                         "identify with this tool, or use a stiffness file without that effect") for target in others))


def _unknown_gravity(model: IdentifiedModel) -> list[Finding]:
    """A note (CS1404) where gravity enters an effect and the robot file does not tell it."""
    upright = bool(np.all(np.abs(model.fall[:2]) < 1e-6))
    asking = [effect.label for effect in model.effects
              if effect.effect.of_gravity and not effect.effect.weighed and not (upright and effect.joint == 1)]
    if not asking or model.robot.link_mass is not None:
        return []
    return [Finding("CS1404", "note", "the robot file has no links: gravity torques are taken as zero in "
                    f"{', '.join(map(cause_words, asking))}",
                    file=str(model.robot.source), hint="add links (mass and centre) to a robot file of your own")]


def _state_notes(loaded: LoadedPath, changes: list[StateChange]) -> tuple[NDArray[np.object_], list[Finding]]:
    """A note (M,) for each target before which the state of an effect changes, and one finding (CS4111) for each effect."""
    targets = loaded.targets
    notes, findings = np.full(len(targets), "", dtype=object), []
    for change in changes:
        words = f"{cause_words(change.of.label)} {change.of.effect.turning} before"
        notes[change.places] = [f"{note}{'; ' if note else ''}{words} this target" for note in notes[change.places]]
        largest = int(np.argmax(change.step))
        findings.append(loaded.path.finding(
            int(targets[change.places[largest]]), "CS4111", "note", f"{words} {len(change.places)} of {len(targets)} targets "
            f"with force: deviation and correction step there, by up to {1e6 * change.step[largest]:.1f} um",
            "the column note of the offsets names the targets"))
    return notes, findings
