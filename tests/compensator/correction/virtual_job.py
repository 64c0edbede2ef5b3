"""A small milling job on the virtual cell's robot: files for the package, and the same path for the independent plant."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compensator.correction.correct import Corrected, correct
from compensator.correction.files import Inputs, predict_files
from identification.model.cell import Cell, read_cell
from identification.model.effects import effects
from identification.model.stiffness import EffectInForce, IdentifiedModel
from tests.runs.command_line import user_files as kit
from tests.virtual_cell.arm_model import Tool
from tests.virtual_cell.cell import Hidden
from tests.virtual_cell.designs import Design
from tests.virtual_cell.files import robot_yaml
from tests.virtual_cell.hidden import install
from tests.virtual_cell.inverse import inverse
from tests.virtual_cell.plant import Plant
from tests.virtual_cell.statics import statics

STIFFNESS = np.array([1.6e6, 5.1e6, 1.5e6, 0.5e6, 0.2e6, 0.08e6])
TOOL = Tool()
CELL = """\
robot: robot.yaml
tool: {position_mm: [120, 0, 250], mass_kg: 80, centre_of_mass_mm: [0, 0, 120]}
"""
RELATIVE = 0.02     # standard deviation of ln k and, of its typical size, of an effect's parameter


@dataclass(frozen=True)
class Path6:
    """A path: angles (n, 6) [rad] of the planned targets, wrench (n, 6) on the tool there, base frame."""

    theta: np.ndarray
    wrench: np.ndarray


# Targets of the first and of the second cut of `there_and_back`, and the air moves (one, five, one).
FIRST, SECOND, AIR = slice(1, 13), slice(18, 30), [0, 13, 14, 15, 16, 17, 30]


def there_and_back() -> Path6:
    """Two cuts along base y with air moves before, between and after; the side force turns round in the second."""
    flange = kit.Rotation.from_euler("yx", [150.0, 12.0], degrees=True).as_matrix()
    y = np.concatenate([[-0.12], np.linspace(-0.1, 0.1, 12), np.linspace(0.12, 0.13, 5), np.linspace(0.1, -0.1, 12), [-0.12]])
    tcp = np.column_stack([1.35 + 0.1 * y, y, np.full(len(y), 0.9)])
    theta = inverse(tcp, np.repeat(flange[None], len(tcp), axis=0), TOOL)[:, 0]
    assert np.isfinite(theta).all()
    wrench = np.zeros((len(y), 6))
    wrench[FIRST, :3] = [120.0, 260.0, -90.0]
    wrench[SECOND, :3] = [-100.0, -280.0, -60.0]
    return Path6(theta, wrench)


def model_of(cell: Cell, hidden: Sequence[Hidden] = ()) -> IdentifiedModel:
    """The model with the true springs and these effects at these parameters."""
    in_force = tuple(EffectInForce(effects()[one.effect], one.joint) for one in hidden)
    values = [(one.parameters or {})[parameter.name] for one, other in zip(hidden, in_force, strict=True)
              for parameter in other.effect.parameters]
    spread = [RELATIVE * parameter.typical for one in in_force for parameter in one.effect.parameters]
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, np.concatenate([-np.log(STIFFNESS), values]),
                           np.diag(np.concatenate([np.full(6, RELATIVE), spread]) ** 2), effects=in_force)


def job(folder: Path, path: Path6, hidden: Sequence[Hidden] = (), cell_text: str = CELL) -> Inputs:
    """Writes cell, robot, program, forces and stiffness."""
    folder.mkdir(exist_ok=True)
    (folder / "robot.yaml").write_text(robot_yaml())
    (folder / "cell.yaml").write_text(cell_text)
    cell = read_cell(folder / "cell.yaml")
    solver = statics(TOOL)
    moves = []
    for number, q in enumerate(path.theta):
        position, rotation = solver.tcp_pose(solver.place(q))
        pose = kit.Frame(position, kit.Rotation.from_matrix(rotation))
        moves.append(kit.move(kit.robtarget(pose, kit.confdata(q), digits=9), "MoveL" if number else "MoveJ"))
    tool = kit.Frame.mm([120.0, 0.0, 250.0])
    (folder / "part.mod").write_text(kit.module(moves, [kit.tooldata(tool), kit.wobjdata(kit.IDENTITY, kit.IDENTITY)]))
    rows = [f"{i}," + ",".join(f"{x:.9g}" for x in w[:3]) for i, w in enumerate(path.wrench)]
    (folder / "forces.csv").write_text("\n".join(["target,fx_n,fy_n,fz_n", *rows]) + "\n")
    (folder / "stiffness.json").write_text(json.dumps(model_of(cell, hidden).as_dict()))
    return Inputs(folder / "cell.yaml", folder / "part.mod", folder / "stiffness.json", folder / "forces.csv")


def corrected(folder: Path, path: Path6, hidden: Sequence[Hidden] = ()) -> Corrected:
    return correct(predict_files(job(folder, path, hidden)))


def plant_of(hidden: Sequence[Hidden], gravity: bool = True) -> Plant:
    """The independent plant with these effects."""
    plant = Plant(STIFFNESS, TOOL, gravity)
    design = _design(np.zeros((1, 6)), np.zeros((1, 6)))
    for one in hidden:
        install(plant, one, np.random.default_rng(0), design)
    return plant


def driven(plant: Plant, theta: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Where the plant's TCP (n, 3) [m] is, driven along theta (n, 6) [rad] under the forces, its gears remembering the way."""
    moved = plant.displacement(_design(theta, wrench))[0]
    return unloaded(plant, theta[:1]) + moved


def _design(theta: np.ndarray, wrench: np.ndarray) -> Design:
    """One pose number for all rows: the gears keep their state, and each displacement is counted from the first row's rest."""
    count = len(theta)
    return Design(theta, wrench[:, :3], np.arange(count, dtype=float), np.ones(count), np.ones(count, dtype=int),
                  np.zeros(count, dtype=bool))


def unloaded(plant: Plant, theta: np.ndarray) -> np.ndarray:
    """Where the plant's TCP (n, 3) [m] is at theta (n, 6) [rad] without a force, sagging under its weight."""
    return np.array([plant.solver.solve(q, lambda torque: plant.compliance @ torque, np.zeros(3), rod_ratio=plant.rod_ratio).tcp
                     for q in theta])


def rigid(theta: np.ndarray) -> np.ndarray:
    """TCP (n, 3) [m] of the rigid arm."""
    solver = statics(TOOL)
    return np.array([solver.tcp_pose(solver.place(q))[0] for q in theta])
