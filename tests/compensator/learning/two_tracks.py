"""A program of two straight tracks 6 mm apart, 60 mm there and back in moves of 1 mm, whose log has a force along them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import compstiff
from compensator.correction.files import Inputs
from compensator.correction.predict import Predicted
from compensator.learning.learning import Learning
from identification.model.stiffness import IdentifiedModel

LENGTH, APART, DEPTH = 60.0, 6.0, 40.0      # mm, in the work object
POSE = "[0,0,1,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
# Targets: one above the part, 0 ... 60 mm, 60 ... 0 mm, one above the part.
COUNT = 124


@dataclass(frozen=True)
class TwoTracks:
    """inputs: the files; predicted: what they predict."""

    inputs: Inputs
    predicted: Predicted

    @property
    def model(self) -> IdentifiedModel:
        """The sample's springs."""
        return compstiff.read_stiffness(self.inputs.stiffness, compstiff.read_cell(self.inputs.cell))

    @property
    def off(self) -> np.ndarray:
        """The deviation (122, 3) [um] along the tracks, in the work object."""
        turn = self.predicted.path.base_from_object.rotation[self.predicted.targets]
        return 1e6 * np.einsum("nji,nj->ni", turn, self.predicted.prediction.position)

    def off_of(self, model: IdentifiedModel) -> np.ndarray:
        """The same with other springs."""
        return TwoTracks(self.inputs, predict(self.inputs, model)).off

    @property
    def place(self) -> np.ndarray:
        """Places (122, 3) [mm] of the targets with force."""
        return 1e3 * np.asarray(self.predicted.path.toolpath.position[self.predicted.targets])

    def measured(self, file: Path, rows: slice, off_um: np.ndarray, std_um: float = 2.0) -> Path:
        """A file of points at these rows of `place`, off by so much, with noise."""
        place = self.place[rows]
        noise = std_um * np.random.default_rng(7).standard_normal(place.shape)
        return written(file, "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,std_um", np.column_stack([
            place, off_um[rows] + noise, np.full(len(place), std_um)]))

    def learn(self, points: Path, model: IdentifiedModel | None = None) -> Learning:
        """What compstiff learns of them. model: in place of the sample's."""
        cell = compstiff.read_cell(self.inputs.cell)
        assert self.inputs.forces is not None
        return compstiff.learn(cell, compstiff.read_toolpath(self.inputs.toolpath, cell), model or self.model,
                               self.inputs.forces, points)


def predict(inputs: Inputs, model: IdentifiedModel) -> Predicted:
    cell = compstiff.read_cell(inputs.cell)
    return compstiff.predict(cell, compstiff.read_toolpath(inputs.toolpath, cell), model, inputs.forces)


def written(file: Path, header: str, rows: np.ndarray) -> Path:
    """A table; NaN: an empty cell."""
    text = [",".join("" if np.isnan(x) else f"{x:.6g}" for x in row) for row in rows]
    file.write_text("\n".join([header, *text]) + "\n")
    return file


def two_tracks(inputs: Inputs, folder: Path, second_object: bool = False) -> TwoTracks:
    """inputs: the sample's, whose cell and springs it has. second_object: the way back is in another work object."""
    head = inputs.toolpath.read_text().partition("    MoveJ")[0]
    [own] = [line for line in head.splitlines() if "wobjdata" in line]
    head = head.replace(own, f"{own}\n{own.replace('wInsert', 'wOther')}")
    along = np.arange(LENGTH + 1)
    places = [(0, 0, 60), *((x, 0, DEPTH) for x in along), *((x, APART, DEPTH) for x in along[::-1]), (0, APART, 60)]
    moves = "".join(f"    Move{'L' if k else 'J'} [[{x:g},{y:g},{z:g}],{POSE},v40cut,z0,tSpindle\\WObj:="
                    f"{'wOther' if second_object and k > COUNT // 2 else 'wInsert'};\n" for k, (x, y, z) in enumerate(places))
    program, log = folder / "tracks.mod", folder / "tracks.csv"
    program.write_text(f"{head}{moves}  ENDPROC\nENDMODULE\n")
    number = np.arange(COUNT)
    force = np.column_stack([60 + 20 * np.sin(number / 9), np.full(COUNT, 40.0), -30 * np.cos(number / 14)])
    force[[0, -1]] = 0
    written(log, "target,fx_n,fy_n,fz_n", np.column_stack([number, force]))
    files = replace(inputs, toolpath=program, forces=log)
    return TwoTracks(files, predict(files, compstiff.read_stiffness(files.stiffness, compstiff.read_cell(files.cell))))
