"""Mistakes that have a size: the TCP is elsewhere, a joint counts from another zero, the reference was taken under a load.

Each is a term beside the springs (fitted_model.py), so that its size comes with its interval.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.common.quantities import two_sigma
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.mistake import Mistake, table_mistake
from identification.model.effects import Effect, Parameter
from identification.model.load_state import LoadState
from identification.model.rotations import Frame

Array = NDArray[np.float64]


class Size(Effect):
    """A mistake with a size. smallest: what is worth a name, in the unit of the parameters (norm of all)."""

    family = "force measurement"
    of_robot = False
    smallest: float

    @abstractmethod
    def mistake(self, data: LoadTest, joint: int | None, values: Array, std: Array) -> Mistake:
        """The mistake of this size."""

    @abstractmethod
    def shown(self, values: Array) -> Array:
        """In the units of docs/formats.md."""

    units: str

    def term(self, joint: int | None, start: Array) -> Term:
        """To be fitted from a start (P,)."""
        typical = np.array([parameter.typical for parameter in self.parameters])
        return Term(self, joint, start, typical, np.zeros(len(typical)))


def _along(axes: str, unit: str, typical: float, bound: float, source: str) -> tuple[Parameter, ...]:
    return tuple(Parameter(axis, unit, typical, -bound, bound, source=source, bounds_source=source) for axis in axes)


class ToolOffset(Size):
    """The TCP lies beside the one of cell.yaml, flange frame [m]: load and sensors meet the tool there. axes: the coordinates
    that are off, all of one that was taught badly, one of a tool of another length or a number mistyped."""

    name = "tcp"
    smallest = 0.002
    units = "mm"
    sentence = "the TCP lies elsewhere"
    settles = "teach the TCP again (four-point method) and compare it with tool.position_mm"

    def __init__(self, axes: str = "xyz") -> None:
        self.axes = axes
        self.parameters = _along(axes, "m", 0.02, 0.5, "engineering judgement: a tool changed or measured to its face is 10 to "
                                 "50 mm off; half a metre is a tool's length")

    def _offset(self, values: Array) -> Array:
        offset = np.zeros(3)
        offset[["xyz".index(axis) for axis in self.axes]] = values
        return offset

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        arm = np.einsum("nij,j->ni", rows.flange, self._offset(values))
        jacobian = rows.jacobian.copy()
        # The TCP's motion at the other point, and the torques of the same force there.
        jacobian[:, :3] += np.cross(jacobian[:, 3:], arm[:, :, None], axis=1)
        moved = np.einsum("nri,ni->nr", jacobian, rows.compliance * np.einsum("nri,nr->ni", jacobian, rows.wrench))
        return np.asarray(moved - rows.compliant(rows.wrench))

    def shown(self, values: Array) -> Array:
        return np.asarray(1e3 * values)

    def mistake(self, data: LoadTest, joint: int | None, values: Array, std: Array) -> Mistake:
        frame = data.cell.flange_from_tcp
        there = Frame(frame.rotation, frame.position + self._offset(values))
        at = ", ".join(f"{x:.1f}" for x in 1e3 * there.position)
        sizes = [f"{1e3 * value:+.1f} +- {1e3 * two_sigma(spread):.1f} mm along {axis}"
                 for axis, value, spread in zip(self.axes, values, std, strict=True)]
        return Mistake(
            "tcp", f"the TCP of {{rows}} seems to lie beside the one in cell.yaml, {', '.join(sizes)}: at ({at}) mm in the "
            "flange frame", self.settles, "cell",
            lambda other: replace(other, cell=replace(other.cell, flange_from_tcp=there)))


class JointZero(Size):
    """A joint counts from another zero: the robot stood at q + delta [rad]."""

    name = "joint_zero"
    smallest = float(np.radians(0.1))
    units = "deg"
    joints = (1, 2, 3, 4, 5, 6)
    parameters = (Parameter("delta", "rad", 0.03, -0.35, 0.35,
                            source="engineering judgement: a mastering by eye is 1 to 3 degrees off",
                            bounds_source="engineering judgement: 20 degrees are seen by eye"),)
    sentence = "joint {joint} counts from another zero"
    settles = "drive the joint to its mark (calibration scale) and read its angle"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        theta = rows.theta.copy()
        theta[:, (joint or 1) - 1] += values[0]
        # A load test reads no rotation.
        moved = replace(rows, theta=theta).elastic_position - rows.elastic_position
        return np.concatenate([moved, np.zeros_like(moved)], axis=1)

    def shown(self, values: Array) -> Array:
        return np.degrees(values)

    def mistake(self, data: LoadTest, joint: int | None, values: Array, std: Array) -> Mistake:
        shift = np.zeros(6)
        shift[(joint or 1) - 1] = values[0]
        also = " (or forces and deflections are turned about base z by so much)" if joint == 1 else ""
        return table_mistake(
            f"joint_zero[{joint}]", f"the zero of joint {joint} seems to be off: the robot stood at q{joint} "
            f"{np.degrees(values[0]):+.2f} +- {np.degrees(two_sigma(std[0])):.2f} degrees{also} in {{rows}}",
            self.settles, lambda other: {"theta": other.rows.theta + shift})


class ReferenceLoad(Size):
    """The unloaded reference was taken under this force [N], base frame; or the force was zeroed under its opposite."""

    name = "reference_load"
    smallest = 10.0
    units = "N"
    parameters = _along("xyz", "N", 50.0, 2000.0, "engineering judgement: a cylinder's preload or a hanging tool is 20 to 200 "
                        "N; 2 kN moves the robot by eye")
    sentence = "the reference was taken under a load"
    settles = "take all load off, zero force and sensors there, and repeat one row"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return rows.compliant(self._wrench(rows, values))

    @staticmethod
    def _wrench(rows: LoadState, values: Array) -> Array:
        return np.broadcast_to(np.concatenate([-values, np.zeros(3)]), rows.wrench.shape)

    def shown(self, values: Array) -> Array:
        return values

    def mistake(self, data: LoadTest, joint: int | None, values: Array, std: Array) -> Mistake:
        force = np.concatenate([values, np.zeros(3)])
        words = ", ".join(f"{x:.0f}" for x in values)
        return table_mistake(
            "reference_load", f"the unloaded reference of {{rows}} seems to have been taken under a load of ({words}) +- "
            f"({', '.join(f'{x:.0f}' for x in two_sigma(std))}) N, or the force was not zeroed there", self.settles,
            lambda other: {"wrench": other.rows.wrench - force})


SIZES: tuple[Size, ...] = (ToolOffset(), ToolOffset("x"), ToolOffset("y"), ToolOffset("z"), JointZero(), ReferenceLoad())
