"""The force frame is turned against the base, or the sensor in its seat on the flange: true force = Rot(r) reported force; or
the load comes from a point that stands still."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, Signature
from identification.model.effects.kinds import OfWrench, along_axes, hanging, nothing_hangs
from identification.model.load_state import LoadState
from identification.model.rotations import rotation_matrix

# A lean by which differences are taken [-]; a pulley that is farther off than 1/this [m] stands at no place that could be told.
STEP, LEAST_PER_M = 1e-4, 1e-3


class _Misalignment(OfWrench):
    """The springs' answer to `(Rot(r) - 1) w`, r in the axes of the force."""

    name = "force_misalignment"
    family = "force measurement"
    formula_source = "the paper, eq. 4 and 5, with the force turned"
    parameters = along_axes(
        "r{}_rad", "rad", 0.021, 1.8,
        source="engineering judgement: 1 to 1.5 degrees, what a level and a square leave",
        bounds_source="engineering judgement: 103 degrees, axes of a hall that stand a quarter of a turn off, and more")
    sentence = "the force was not applied (or not measured) in the direction that was written down"
    settles = "read a dead weight with the force sensor, or check the cylinder's direction with a level"
    on_flange = False

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        turn = rotation_matrix(values)
        if self.on_flange:
            turn = rows.flange @ turn @ rows.flange.transpose(0, 2, 1)
        return np.asarray((turn[..., None, :, :] @ rows.wrench.reshape(-1, 2, 3, 1)).reshape(-1, 6))


class OnTheFlange(_Misalignment):
    """The sensor turns with the flange, and is turned in its seat there."""

    law, on_flange = "flange", True
    sentence = "the force sensor is turned in its seat on the flange against the axes that were written down"
    settles = "read a dead weight with the force sensor in two postures of the flange"


class OfHung(_Misalignment):
    """Of hung weights alone, beside other loads: plumb is not where z of the base is."""

    law = "hung"
    parameters = _Misalignment.parameters[:2]
    sentence = "hung weights pull along another line than base z: the robot's base is not level, or does not stand upright"
    settles = "put a level on the robot's foot, and write gravity's direction into cell.yaml"

    def missing(self, rows: LoadState) -> str:
        hangs, loaded = hanging(rows), np.any(rows.wrench[:, :3] != 0, axis=1)
        return "" if hangs.any() and (loaded & ~hangs).any() else "no weights hang beside other loads"

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        turned = super().true_wrench(rows, joint, np.append(values, 0.0))
        return np.where(hanging(rows)[:, None], turned, rows.wrench)


class FixedPulley(OfWrench):
    """A cable to a pulley that stands still, 1/p away along the load from a point A: `u - p (x - A)`, made a unit vector, is
    the direction of the force at the tool tip x, u the one written down."""

    name = "force_misalignment"
    law = "pulley"
    family = "force measurement"
    formula_source = "engineering judgement: a cable is straight, and the pulley is set up by the eye, once for several poses"
    parameters = (
        Parameter("per_m", "1/m", 0.2, 0.0, 2.0, source="engineering judgement: a pulley five metres off",
                  bounds_source="engineering judgement: far away, to half a metre off"),
        *along_axes("right_at_{}_m", "m", 1.5, 10.0, source="engineering judgement: within a robot's reach",
                    bounds_source="engineering judgement: within the hall"))
    sentence = ("the load ran over a pulley, or from a point, that stood still while the tool went from pose to pose: its "
                "direction is another at each, and one was written down")
    settles = "measure where the pulley stands and where the tool is, and write each pose's own direction"

    def missing(self, rows: LoadState) -> str:
        return "" if nothing_hangs(rows) else "hung loads hang plumb"

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return self._towards(rows, values[0] * (rows.tcp - values[1:]))

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        """Linear in p and p A."""
        columns = [rows.compliant(self._towards(rows, STEP * lean) - rows.wrench)[:, :3] / STEP
                   for lean in (rows.tcp, *(np.tile(-axis, (len(rows), 1)) for axis in np.eye(3)))]
        scale = self.typical(rows, joint)
        scale[1:] *= scale[0]
        return [Signature(np.stack(columns, axis=2), scale, False, _pulley, self)]

    @staticmethod
    def _towards(rows: LoadState, lean: Array) -> Array:
        """The wrenches (n, 6) with their forces turned towards `u - lean`, lean (n, 3)."""
        size = np.linalg.norm(rows.wrench[:, :3], axis=1, keepdims=True)
        way = np.divide(rows.wrench[:, :3], size, out=np.zeros_like(lean), where=size > 0) - lean * (size > 0)
        length = np.linalg.norm(way, axis=1, keepdims=True)
        turned = np.divide(size * way, length, out=np.zeros_like(lean), where=length > 0)
        return np.concatenate([turned, rows.wrench[:, 3:]], axis=1)


def _pulley(coefficients: Array) -> Array:
    """The parameters by p and p A (4,), within their bounds."""
    per_m = float(np.clip(coefficients[0], LEAST_PER_M, 2.0))
    return np.append(per_m, np.clip(coefficients[1:] / per_m, -10.0, 10.0))


class ForceMisalignment(_Misalignment):
    """The same in the cell, wherever the tool is turned to."""

    other_laws = (OnTheFlange(), OfHung(), FixedPulley())
