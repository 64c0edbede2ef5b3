"""The robots of this cell: public lengths from the built-in robot files, everything else written down here.

Home pose, as a drawing shows it: column up, lower arm upright, forearm level to the front (+x). Axes 1 to 6 turn about z, y, y,
x, y, x there; the flange's z looks to the front and its x down (ABB's tool0). Masses are made up for tests.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tests.second_cell.chain import hinge, placed

FILES = Path(__file__).parents[2] / "identification/model/robots"
X, Y, Z = np.eye(3)
HOME_FLANGE = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])    # base_from_flange, columns
# Windows the poses are drawn from [deg], drive angles; `elbow` is the angle between lower arm and forearm.
WINDOWS = np.array([[-70, 70], [-25, 60], [-15, 60], [-150, 150], [20, 100], [-170, 170]])
ELBOW = (-55.0, 55.0)


@dataclass(frozen=True)
class Robot:
    """screws (6, 6) at home; drive (6, 6): angles of the axes by the drives'; joints (3, 3), flange (3,) [m]: where shoulder,
    elbow, wrist and flange are at home; stiffness (6,) [N m/rad]: published, about which the truth is drawn; text: of the
    robot file; size: how long it is, times the built-in one of that name; built_in: whether the packages have it."""

    name: str
    text: str
    screws: np.ndarray
    drive: np.ndarray
    joints: np.ndarray
    flange: np.ndarray
    stiffness: np.ndarray
    size: float = 1.0
    built_in: bool = True

    @property
    def rod(self) -> bool:
        """Whether a parallel rod holds the forearm's angle against the horizontal."""
        return bool(self.drive[2, 1])

    def tcp_home(self, tool: np.ndarray) -> np.ndarray:
        """The TCP (3,) [m] at home; tool (3,) [m] in the flange frame."""
        return np.asarray(self.flange + HOME_FLANGE @ tool)

    def tcp(self, q: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """The rigid arm's TCP (n, 3) [m] at drive angles (n, 6) [rad]."""
        return placed(self.screws, q @ self.drive.T).point(5, self.tcp_home(tool))

    def poses(self, count: int, tool: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Random drive angles (count, 6) [rad] in the windows, the tool in front of the robot and above the floor."""
        found = np.empty((0, 6))
        while len(found) < count:
            q = np.round(rng.uniform(*WINDOWS.T, (400, 6)), 3)
            q[:, 4] *= rng.choice([-1, 1], 400)
            elbow = q[:, 2] - q[:, 1] * self.rod
            tcp = self.tcp(np.radians(q), tool)
            reach = np.hypot(tcp[:, 0], tcp[:, 1])
            fine = (elbow > ELBOW[0]) & (elbow < ELBOW[1]) & (tcp[:, 2] > 0.2 * self.size) & (reach > 0.8 * self.size)
            found = np.concatenate([found, np.radians(q[fine])])
        return found[:count]


@cache
def robot(name: str) -> Robot:
    """One of the built-in robots' lengths as this cell's arm."""
    text = (FILES / f"{name}.yaml").read_text(encoding="utf-8")
    return _built(name, text, yaml.safe_load(text))


def foreign(rng: np.random.Generator) -> Robot:
    """A robot of nobody's: 0.4 to 1.3 times as long as a built-in one, each length by itself, and stiffnesses as an arm of that
    size may have them, of which its file knows no more than half and double."""
    content = yaml.safe_load((FILES / f"{rng.choice(ROBOTS)}.yaml").read_text(encoding="utf-8"))
    size = float(np.exp(rng.uniform(np.log(0.4), np.log(1.3))))
    for joint in content["joints"]:
        for key in ("a_mm", "d_mm"):
            joint[key] = round(float(joint[key] * size * rng.uniform(0.85, 1.15)), 1)
    stiffness = np.array(content["prior"]["stiffness_nm_per_rad"], dtype=float) * size**2 * np.exp(rng.uniform(-0.7, 0.7, 6))
    said = stiffness * np.exp(rng.uniform(-0.7, 0.7))
    content["prior"] = {"stiffness_nm_per_rad": [float(f"{k:.3g}") for k in said], "relative_std": float(rng.choice([1, 2, 3]))}
    content["name"] = "arm"
    for key in ("data_sheet", "poses", "manufacturer"):
        content.pop(key, None)
    built = _built("arm", yaml.safe_dump(content, sort_keys=False), content)
    return replace(built, stiffness=stiffness, size=size, built_in=False)


def _built(name: str, text: str, content: dict[str, Any]) -> Robot:
    lengths = {f"{key}{i}": joint[f"{key}_mm"] / 1e3 for i, joint in enumerate(content["joints"], 1) for key in "ad"}
    shoulder = np.array([lengths["a2"], 0, lengths["d1"]])
    elbow = shoulder + lengths["a3"] * Z
    wrist = elbow + lengths["d4"] * X + lengths["a4"] * Z
    screws = np.array([hinge(Z, np.zeros(3)), hinge(Y, shoulder), hinge(Y, elbow), hinge(X, wrist), hinge(Y, wrist),
                       hinge(X, wrist)])
    drive = np.eye(6)
    drive[2, 1] = -1.0 if "coupling" in content else 0.0
    return Robot(name, text, screws, drive, np.array([shoulder, elbow, wrist]), wrist + lengths["d6"] * X,
                 np.array(content["prior"]["stiffness_nm_per_rad"], dtype=float))


ROBOTS = ("irb6660-205-1.90", "irb6700-200-2.60", "irb4400-60", "irb6640-235-2.55")
