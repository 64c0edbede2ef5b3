"""The lower arm (2) or the forearm (3) bends like a cantilever, or the lower arm twists about its length."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import AtJoint
from identification.model.load_state import LoadState

# By the joint that a link follows.
LINKS = {2: "lower arm", 3: "forearm"}
# GJ over EI of the walls of a closed steel box: J is 1.5 I of a square one, G is 0.385 E.
TWIST_STIFFNESS = 0.58


class Twist(AtJoint):
    """The moment M_u along the lower arm turns all beyond it about the arm by M_u L / GJ. (The forearm's twist is what the gear
    of axis 4 does.)"""

    name = "link_bending"
    law = "twist"
    family = "structure"
    stiffens = True
    joints = (2,)
    formula_source = ("Engineering Mechanics OER, StrengthBook (engineeringmechanicsoer.github.io/StrengthBook), torsion of a "
                      "bar: T L / GJ")
    parameters = (
        Parameter("flexibility_per_nm2", "1/(N*m^2)", 1e-7, 0.0, 4e-6,
                  source="engineering judgement: GJ = 1e7 N m^2, a closed steel box of 0.26 m with walls of 5 mm",
                  bounds_source="engineering judgement: rigid, to a fortieth of the typical GJ"),
    )
    sentence = "the lower arm (link 2) twists about its length"
    settles = "a dial gauge on either side of the elbow while the tool is pushed sideways"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        start, end = rows.origins[:, 1], rows.origins[:, 2]
        along = end - start
        length = np.linalg.norm(along, axis=1, keepdims=True)
        u = along / length
        moment = u * np.sum(u * rows.moment_about(end), axis=1, keepdims=True)
        return np.asarray(rows.turned(end, values[0] * length * moment))


class Beam(AtJoint):
    """It bends, alike in both planes, and twists, as a closed box does both."""

    name = "link_bending"
    law = "beam"
    family = "structure"
    stiffens = True
    joints = (2,)
    formula_source = "the same: both of the other laws, GJ = 0.58 EI of a square box of steel"
    parameters = (
        Parameter("flexibility_per_nm2", "1/(N*m^2)", 7.9e-8, 0.0, 2e-6,
                  source="the same: EI = 1.3e7 N m^2", bounds_source="the same: rigid, to a twenty-fifth of the typical EI"),
    )
    sentence = "the lower arm (link 2) bends and twists"
    settles = "a force at the elbow, not at the tool"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return _bent(rows, 2, values[0]) + Twist().contribution(rows, joint, values / TWIST_STIFFNESS)


class LinkBending(AtJoint):
    """An end force F across the link moves its end by F L^3 / 3EI and turns it by u x F L^2 / 2EI; an end moment M by
    M x u L^2 / 2EI and M L / EI. On a parallel-rod robot the rod keeps the forearm's angle, so that bending of the lower arm in
    the arm's plane does not turn it, and the forearm's moment does not enter it."""

    name = "link_bending"
    family = "structure"
    stiffens = True
    joints = (2, 3)
    other_laws = (Twist(), Beam())
    formula_source = ("Engineering Mechanics OER, StrengthBook, Appendix B.2 "
                      "(engineeringmechanicsoer.github.io/StrengthBook), cantilever beams: P L^3 / 3EI and P L^2 / 2EI, the "
                      "moment's part by reciprocity; that links yield beside joints: A. Klimchik, S. Caro, B. Furet, A. "
                      "Pashkevich, Complete Stiffness Model for a Serial Robot, SciTePress, 2014")
    parameters = (
        Parameter("flexibility_per_nm2", "1/(N*m^2)", 7.9e-8, 0.0, 2e-6,
                  source="engineering judgement: EI = 1.3e7 N m^2, a steel box of 0.26 m with walls of 5 mm",
                  bounds_source="engineering judgement: rigid, to a twenty-fifth of the typical EI"),
    )
    sentence = "link {joint} (2 lower arm, 3 forearm) bends"
    settles = "a force at the elbow, not at the tool"

    def told(self, joint: int | None) -> str:
        return f"the {LINKS[joint]} (link {joint}) bends" if joint in LINKS else super().told(joint)

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return _bent(rows, self.index(joint) + 1, values[0])


def _bent(rows: LoadState, joint: int, flexibility: float) -> Array:
    """Deviation (n, 6) by a link of this EI^-1 [1/(N m^2)]."""
    z2 = rows.axes[:, 1]
    rod = joint == 2 and rows.robot.rod is not None
    if joint == 2:
        start, end = rows.origins[:, 1], rows.origins[:, 2]
    else:
        start, end = rows.origins[:, 3] - rows.robot.d[3] * rows.axes[:, 3], rows.origins[:, 3]
    length = np.linalg.norm(end - start, axis=1, keepdims=True)
    u = (end - start) / length
    force = rows.wrench[:, :3] - u * np.sum(u * rows.wrench[:, :3], axis=1, keepdims=True)
    moment = rows.moment_about(end)
    moment = moment - u * np.sum(u * moment, axis=1, keepdims=True)
    if rod:
        moment = moment - z2 * np.sum(z2 * moment, axis=1, keepdims=True)
    shift = force * length**3 / 3 + np.cross(moment, u) * length**2 / 2
    turn = np.cross(u, force) * length**2 / 2 + moment * length
    if rod:
        turn = turn - z2 * np.sum(z2 * turn, axis=1, keepdims=True)
    moved = rows.turned(end, flexibility * turn)
    moved[:, :3] += flexibility * shift
    return moved
