"""Joint angles in other columns, of the other sign, from another zero or in radians; and another robot than the cell's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.fit.mistakes.mistake import Mistake, table_mistake
from identification.fit.priors import PriorModel
from identification.model.kinematics import forward
from identification.model.robot import RobotModel, built_in_robots, read_robot
from identification.model.rotations import Frame

Array = NDArray[np.float64]
# A zero that is off may take a pose a little over the joint's limit.
BEYOND_LIMITS = np.radians(5.0)
SETTLES = "read the six angles of one pose on the pendant and compare them with its row"
QUARTERS = (90.0, -90.0, 180.0)
# The axis about which a tool may be mounted, or given, turned.
LAST = 5


def joint_mistakes(data: LoadTest) -> list[Mistake]:
    """Those whose mended angles the robot could have had."""
    found = [_angles("radians", "the joint angles seem to be in radians, not in degrees, in {rows}", np.degrees)]
    found += [_angles(f"joints_swapped[{i + 1}{j + 1}]", f"q{i + 1} and q{j + 1} seem to be swapped in {{rows}}",
                      _order(tuple(j if k == i else i if k == j else k for k in range(6))))
              for i, j in combinations(range(6), 2)]
    found += [_angles(f"joints_shifted[{by:+d}]", f"the joint columns seem to stand one place too far {words} in {{rows}}",
                      _order(tuple((k + by) % 6 for k in range(6)))) for by, words in ((1, "right"), (-1, "left"))]
    found += [_angles(f"joint_sign[{j + 1}]", f"q{j + 1} seems to have the other sign in {{rows}}", _signed(j))
              for j in range(6)]
    found += [_angles(f"joint_zero[{j + 1} {turn:+.0f}]", f"q{j + 1} seems to count from another zero, {turn:+.0f} degrees "
                      "off, in {rows}", _from(j, -np.radians(turn)), usual=False,
                      or_else=_or_turned_tool(data, _from(j, -np.radians(turn))) if j == LAST else "")
              for j in range(1, 6) for turn in QUARTERS]
    return [mistake for mistake in found + _coupled(data.cell.robot) if _possible(data, mistake)] + _robots(data)


def _possible(data: LoadTest, mistake: Mistake) -> bool:
    mended = mistake.mended(data)
    return bool(np.max(mended.cell.robot.limit_excess(mended.rows.theta)) <= BEYOND_LIMITS)


def _angles(
    key: str, sentence: str, mended: Callable[[Array], Array], usual: bool = True, or_else: str = "",
) -> Mistake:
    return table_mistake(key, sentence, SETTLES + or_else, lambda data: {"theta": mended(data.rows.theta)}, usual=usual)


def _or_turned_tool(data: LoadTest, mended: Callable[[Array], Array]) -> str:
    """What else the same rows may say: axis 6 stands as it is written, and the tool is turned about it."""
    robot, tool, zero = data.cell.robot, data.cell.flange_from_tcp, np.zeros((1, 6))
    stands = forward(robot, zero, Frame.identity()).inverse() @ forward(robot, mended(zero), tool)
    place = ", ".join(f"{value:.1f}" for value in 1e3 * stands.position[0] + 0.0)
    return f"; where they agree the tool is turned about axis 6, and tool.position_mm should be [{place}]"


def _order(columns: tuple[int, ...]) -> Callable[[Array], Array]:
    return lambda theta: np.ascontiguousarray(theta[:, list(columns)])


def _signed(joint: int) -> Callable[[Array], Array]:
    signs = np.ones(6)
    signs[joint] = -1
    return lambda theta: theta * signs


def _from(joint: int, by: float) -> Callable[[Array], Array]:
    shift = np.zeros(6)
    shift[joint] = by
    return lambda theta: theta + shift


def _coupled(robot: RobotModel) -> list[Mistake]:
    """The angle of the coupled joint, or of the third, given against its neighbour instead of the controller's, or the other
    way round."""
    if not np.array_equal(robot.coupling, np.diag(robot.sense)):
        named = "the joint with the parallel rod" if robot.rod else "the coupled joint"
        words = f"the angle of {named} seems to be counted the other way (against its neighbour) in {{rows}}"
        return [_angles("joint_coupling", words, lambda theta: (theta * robot.sense) @ robot.uncoupling.T)]
    return [_angles(f"joint_coupling[{sign:+d}]", f"q3 seems to be written with q2 {words} (counted from elsewhere than this "
                    "controller does) in {rows}", _third_with(sign)) for sign, words in ((1, "taken off"), (-1, "added"))]


def _third_with(sign: int) -> Callable[[Array], Array]:
    """q3 with q2 taken off or added."""
    by = np.eye(6)
    by[2, 1] = sign
    return lambda theta: theta @ by.T


def _robots(data: LoadTest) -> list[Mistake]:
    """The rows of another robot of the same maker that comes with the program. Makers count angles in ways so different that
    nobody takes one's table for another's; a file that names no maker is held against ABB's."""
    found = []
    for name, other in _family(data.cell.robot.manufacturer.strip().upper() or "ABB"):
        if other.geometry_sha256 == data.cell.robot.geometry_sha256:
            continue
        mistake = Mistake(f"robot[{name}]", f"{{rows}} seem to be of another robot: {name}, not {data.cell.robot.name}",
                          "read the type plate of the robot that was measured", "cell", _of_robot(other), like_physics=True)
        if _possible(data, mistake):
            found.append(mistake)
    return found


@cache
def _family(maker: str) -> tuple[tuple[str, RobotModel], ...]:
    """The built-in robots of a maker, by name."""
    robots = [(name, read_robot(file)) for name, file in built_in_robots().items()]
    return tuple((name, robot) for name, robot in robots if robot.manufacturer.upper() == maker)


def _of_robot(other: RobotModel) -> Callable[[LoadTest], LoadTest]:
    def change(data: LoadTest) -> LoadTest:
        return replace(data, cell=replace(data.cell, robot=other, prior=other.prior), prior=PriorModel(other.prior))

    return change
