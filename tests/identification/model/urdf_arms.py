"""Arms as public URDF files state them: the origin and the axis of each joint, chained by plain rotations.

Shares nothing with the packages: no Denavit-Hartenberg frames, none of their code, none of their robot files. Numbers are those
of the files named, in metres; each joint's frame is parallel to its parent's at zero, as in all of these files.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

ABB, KUKA, FANUC = "zyyxyx", "ZyyXyX", "zyYXYX"             # axes of joints 1 to 6; capitals: against them
DOWN = Rotation.from_euler("xyz", [0, 90, 0], degrees=True)         # tool0 of ABB and KUKA, rpy 0 90 0
UP = Rotation.from_euler("xyz", [180, -90, 0], degrees=True)        # tool0 of FANUC, rpy 180 -90 0


@dataclass(frozen=True)
class Arm:
    """urdf: the file. axes: of the joints. origins: xyz of joints 1 to 6 and of tool0, in the parent's frame [m].

    tool: rotation of tool0 in the last link. base: height of the maker's base frame above the URDF's root [m]. interlocked: the
    pendant's J3 holds the forearm's angle against the horizontal, so that the URDF's joint 3 is J3 + J2.
    """

    urdf: str
    axes: str
    origins: tuple[tuple[float, float, float], ...]
    tool: Rotation = DOWN
    base: float = 0.0
    interlocked: bool = False

    def flange(self, degrees: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) [m] and rotation (3, 3) of tool0 in the maker's base, at the pendant's angles (6,) [deg]."""
        turns = np.array(degrees, dtype=float)
        if self.interlocked:
            turns[2] += turns[1]
        at, turned = np.array([0.0, 0.0, -self.base]), Rotation.identity()
        for origin, axis, turn in zip(self.origins, self.axes, turns, strict=False):
            at = at + turned.apply(origin)
            turned = turned * Rotation.from_euler(axis.lower(), -turn if axis.isupper() else turn, degrees=True)
        return at + turned.apply(self.origins[6]), (turned * self.tool).as_matrix()


def _abb(urdf: str, d1: float, a1: float, a2: float, a3: float, d4: float, d6: float) -> Arm:
    return Arm(f"ros-industrial/abb, {urdf}", ABB, ((0, 0, d1), (a1, 0, 0), (0, 0, a2), (0, 0, a3), (d4, 0, 0), (d6, 0, 0),
                                                    (0, 0, 0)))


ARMS = {
    "irb4600-40-2.55": _abb("abb_irb4600_support/urdf/irb4600_40_255_macro.xacro", 0.495, 0.175, 1.095, 0.175, 1.270, 0.135),
    "irb4600-60-2.05": _abb("abb_irb4600_support/urdf/irb4600_60_205_macro.xacro", 0.495, 0.175, 0.9, 0.175, 0.960, 0.135),
    "irb6640-185-2.80": _abb("abb_irb6640_support/urdf/irb6640_185_280_macro.xacro", 0.780, 0.320, 1.075, 0.2, 1.392, 0.2),
    "irb6650s-125-3.50": _abb("abb_irb6650s_support/urdf/irb6650s_125_350_macro.xacro", 0.630, 0.600, 1.280, 0.2, 1.592, 0.2),
    "irb6650s-90-3.90": _abb("abb_irb6650s_support/urdf/irb6650s_90_390_macro.xacro", 0.630, 0.600, 1.280, 0.200, 2.042, 0.200),
    "irb6700-200-2.60": _abb("abb_irb6700_support/urdf/irb6700_200_260_macro.xacro", 0.78, 0.32, 1.125, 0.2, 1.1425, 0.2),
    "irb6700-235-2.65": _abb("abb_irb6700_support/urdf/irb6700_235_265_macro.xacro", 0.78, 0.32, 1.135, 0.2, 1.1825, 0.2),
    "irb7600-150-3.50": Arm(
        "ros-industrial/abb, abb_irb7600_support/urdf/irb7600_150_350_macro.xacro", ABB,
        ((0, 0, 0), (0.410, 0, 0.780), (0, 0, 1.075), (0, 0, 0.165), (2.012, 0, 0), (0.250, 0, 0), (0, 0, 0))),
    "kr60-ha": Arm(
        "ros-industrial/kuka_experimental, kuka_kr60_support/urdf/kr60ha_macro.xacro", KUKA,
        ((0, 0, 0), (0.35, 0, 0.815), (0.85, 0, 0), (0.465, 0, 0.145), (0.355, 0, 0), (0.17, 0, 0), (0, 0, 0))),
    "kr150-r3100-prime": Arm(
        "ros-industrial/kuka_experimental, kuka_kr150_support/urdf/kr150_r3100_prime_macro.xacro", KUKA,
        ((0, 0, 0.675), (0.35, 0, 0), (1.350, 0, 0), (0, 0, -0.041), (1.400, 0, 0), (0.215, 0, 0), (0, 0, 0))),
    "kr210-r2700-extra": Arm(
        "ros-industrial/kuka_experimental, kuka_kr210_support/urdf/kr210r2700extra_macro.xacro", KUKA,
        ((0, 0, 0.675), (0.350, 0, 0), (1.150, 0, 0), (0, 0, -0.041), (1.200, 0, 0), (0.215, 0, 0), (0, 0, 0))),
    "m710ic-50": Arm(
        "ros-industrial/fanuc, fanuc_m710ic_support/urdf/m710ic50_macro.xacro", FANUC,
        ((0, 0, 0.565), (0.150, 0, 0), (0, 0, 0.870), (0, 0, 0.170), (1.016, 0, 0), (0.175, 0, 0), (0, 0, 0)),
        UP, 0.565, interlocked=True),
    "r2000ic-210f": Arm(
        "ros-industrial/fanuc, fanuc_r2000ic_support/urdf/r2000ic210f_macro.xacro", FANUC,
        ((0, 0, 0.670), (0.312, 0, 0), (0, 0, 1.075), (0, 0, 0.225), (1.280, 0, 0), (0.215, 0, 0), (0, 0, 0)),
        UP, 0.670, interlocked=True),
}
