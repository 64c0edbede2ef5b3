"""What effects of one kind have in common, so that the file of an effect holds its law and its data alone."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter, Signature
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

# What free play and a soft zone have in common, whatever the gear's real law.
SOFTER_NEAR_ZERO = "the gear of joint {joint} is softer near zero torque"
WEIGHT_IS_KNOWN = "the robot file has links"
ONLY_IN_MOTION = "it shows only in logs taken in motion"
ONLY_AS_SCATTER = "it is scatter, which is looked for by itself"
NOTHING_HANGS = "the loads are not those of hung weights"
NO_TRACK = "cell.yaml has no track under the robot"
NO_LOAD_OFF = "no load was taken off in steps"
ONE_SIZE = "all loads are of one size"
ONE_TIME = "no dwell_s says that loads were on for different times"
# Reasons that need no word: they lie in the kind of the data, or of the cell.
OF_THE_KIND = (ONLY_IN_MOTION, ONLY_AS_SCATTER, NOTHING_HANGS, NO_TRACK, NO_LOAD_OFF, ONE_SIZE, ONE_TIME)
# Torques [N m] that are tried where nobody stated what hangs on the wrist, and on the arm: play is crossed at one of them.
OF_TOOL = tuple(np.geomspace(40.0, 800.0, 31).round(1).tolist())
OF_ARM = tuple(np.geomspace(400.0, 8000.0, 31).round(0).tolist())
# Where a gear is worn: so many angles, evenly over those of the rows, and half widths [rad] are tried.
PLACES, WIDTHS = 9, (0.25, 0.5)
# What a gear that is uneven does beside its law (engineering judgement, as of all gears' laws): waves so often within a turn,
# each part of one, 1 sigma, this share of its size.
WAVES, UNLIKE = (1, 2, 3), 0.2
# A load hangs where it is plumb to this share; loads are of hung weights where so many of them are plumb.
PLUMB = 1e-3
MOST_HANG = 0.75


def hanging(rows: LoadState) -> NDArray[np.bool_]:
    """Loaded rows (n,) whose force is plumb, or straight up where weights were taken off."""
    force, down = rows.wrench[:, :3], rows.fall / np.linalg.norm(rows.fall)
    size = np.linalg.norm(force, axis=1)
    return np.asarray((size > 0) & (np.linalg.norm(np.cross(force, down), axis=1) <= PLUMB * size))


def nothing_hangs(rows: LoadState) -> str:
    """Why effects of hung weights cannot show, "" where most loads hang."""
    loaded = int(np.any(rows.wrench[:, :3] != 0, axis=1).sum())
    return "" if loaded and hanging(rows).sum() >= MOST_HANG * loaded else NOTHING_HANGS


def reference_at(rows: LoadState, row: int) -> int | None:
    """The number of the reference that holds at a row of the file, or at the next of these; None after the last."""
    after = rows.row >= row
    return int(rows.reference[int(np.argmax(after))]) if after.any() else None


def from_row_on(rows: LoadState, row: int, reference: int | None) -> NDArray[np.bool_]:
    """The rows (n,) from one of the file on, while this reference holds; the one at that row where none is given."""
    reference = reference_at(rows, row) if reference is None else reference
    return np.asarray((rows.row >= row) & (rows.reference == (-1 if reference is None else reference)))


def evenly(places: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    """At most so many of the places (m,), the first among them."""
    return places[:: -(-len(places) // most)] if len(places) else places


def as_it_is(coefficients: Array) -> Array:
    """The values of a signature whose coefficients are the effect's parameters."""
    return coefficients


def crossed(values: Array) -> Array:
    """What axes see of each other (3, 3), alike in both directions, of the shares (3,) xy, xz and yz."""
    xy, xz, yz = values
    return np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]])


def one_way(typical: float, *, source: str, bounds_source: str) -> tuple[Parameter, ...]:
    """Shares (6,) that each of three axes sees of each of the others."""
    return tuple(Parameter(a + b, "1", typical, -0.5, 0.5, source=source, bounds_source=bounds_source)
                 for a in "xyz" for b in "xyz" if a != b)


def crossed_one_way(values: Array) -> Array:
    """What axes see of each other (3, 3), of the shares (6,) xy, xz, yx, yz, zx and zy."""
    share = np.zeros((3, 3))
    share[~np.eye(3, dtype=bool)] = values
    return share


class AtJoint(Effect):
    """An effect that sits at a joint."""

    of_robot = True

    def index(self, joint: int | None) -> int:
        """Place of the joint in the arrays of a LoadState, from 0; of the first it may sit at where none is given."""
        return (joint or self.joints[0]) - 1


class GearTwist(AtJoint):
    """A gear twists beyond its spring, which moves the TCP by `J_i twist`: one of the laws of a gear."""

    family = "gear"
    joints: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
    gear_law = True

    @abstractmethod
    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        """Twist (n,) [rad] of the gear beyond its spring; i its place in the arrays of `rows`, values (P,)."""

    def preload(self, rows: LoadState, i: int, values: Array) -> Array:
        """Torque (n,) [N m] on the gear before the load."""
        return np.asarray(rows.gravity[:, i])

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = self.index(joint)
        return np.asarray(rows.jacobian[:, :, i] * self.twist(rows, i, values)[:, None])


class UnderUnknownWeight(GearTwist):
    """A gear of a robot whose file has no links: the torque on it before the load, its last parameter, is searched."""

    weighed = True

    def missing(self, rows: LoadState) -> str:
        return "" if rows.robot.link_mass is None else WEIGHT_IS_KNOWN

    @abstractmethod
    def hanging(self, rows: LoadState) -> Array:
        """Torques (n, 6) at the springs of what hangs there for one unit of the parameter."""

    def preload(self, rows: LoadState, i: int, values: Array) -> Array:
        return np.asarray(values[-1] * self.hanging(rows)[:, i])

    def turns(self, rows: LoadState, joint: int | None) -> bool:
        """Whether what hangs there turns the joint's axis anywhere."""
        return bool(np.abs(self.hanging(rows)[:, self.index(joint)]).max(initial=0.0) >= NO_LEVER)

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        if not self.turns(rows, joint):
            return []
        return [replace(shape, weight=float(shape.values(np.zeros(len(shape.scale)))[-1]))
                for shape in super().signatures(rows, joint)]


class UnderTheTool(UnderUnknownWeight):
    """A gear of the wrist: the weight hangs on the axis of the flange; that on the last gear on the way to the TCP."""

    law = "wrist"
    joints: tuple[int, ...] = (4, 5, 6)
    formula_source = ("engineering judgement: the first law, under the torque of a weight on the axis of the flange; on gear 6 "
                      "of one on the way to the TCP")

    def hanging(self, rows: LoadState) -> Array:
        return rows.hung_on_flange


class UnderTheArm(UnderUnknownWeight):
    """A gear of the arm: the weight hangs on the forearm."""

    law = "arm"
    joints: tuple[int, ...] = (2, 3)
    formula_source = "engineering judgement: the first law, under the torque of a weight on the forearm"

    def hanging(self, rows: LoadState) -> Array:
        return rows.hung_on_forearm


# A weight that turns an axis by less than this share of its own torque leaves it as it is.
NO_LEVER = 0.05


def of_tool(every: int = 1) -> Parameter:
    """What hangs on the wrist; every: so many of the torques that are tried are one."""
    return Parameter("weight_nm", "N*m", 200.0, 0.0, 2000.0, grid=OF_TOOL[::every], shape=True,
                     source="engineering judgement: a spindle of 70 kg, 0.3 m before the wrist",
                     bounds_source="engineering judgement: none, to 400 kg half a metre before the wrist")


def of_arm(every: int = 1) -> Parameter:
    """What hangs on the forearm."""
    return Parameter("weight_nm", "N*m", 2000.0, 0.0, 20000.0, grid=OF_ARM[::every], shape=True,
                     source="engineering judgement: 200 kg a metre out",
                     bounds_source="engineering judgement: none, to two tonnes a metre out")


class OfWrench(Effect):
    """What acted is not the wrench that was reported: the springs answer to the difference."""

    of_robot = False

    @abstractmethod
    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array: ...

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return rows.compliant(self.true_wrench(rows, joint, values) - rows.wrench)


class ForceAxes(OfWrench):
    """What the axes of a force measurement get wrong: true force = (1 + E) reported force, E in the base frame or, on_flange,
    in the frame that turns with the flange."""

    family = "force measurement"
    on_flange: ClassVar[bool] = False

    @abstractmethod
    def share(self, values: Array) -> Array:
        """E (3, 3) of values (P,)."""

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        force, share = rows.wrench[:, :3, None], self.share(values)
        if self.on_flange:
            share = rows.flange @ share @ rows.flange.transpose(0, 2, 1)
        return np.concatenate([(force + share @ force)[:, :, 0], rows.wrench[:, 3:]], axis=1)


class OfReading(Effect):
    """The deflection sensors read something else than the tool's displacement."""

    family = "deflection measurement"
    of_robot = False

    @abstractmethod
    def misread(self, rows: LoadState, values: Array) -> Array:
        """Reading minus displacement (n, 3) [m]; values (P,)."""

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        read = np.zeros((len(rows), 6))
        read[:, :3] = self.misread(rows, values)
        return read


class InMotion(Effect):
    """An effect that shows in logs taken in motion alone."""

    def missing(self, rows: LoadState) -> str:
        return ONLY_IN_MOTION

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.zeros((len(rows), 6))

    @abstractmethod
    def log_contribution(self, log: JointLog, values: Array) -> Array: ...


class SizeAndAngle(Effect):
    """A size a and an angle phi that enter as a cos phi and a sin phi: one signature, linear in these two."""

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        columns = [self.contribution(rows, joint, np.array([1.0, angle]))[:, :3] for angle in (0.0, np.pi / 2)]
        return [Signature(np.stack(columns, axis=2), np.full(2, self.parameters[0].typical), False, _polar, self),
                *self.of_other_laws(rows, joint)]


class OfTheAngle(GearTwist):
    """The gear is softer at some angles of its joint than at others. Further ways: other waves over the angle."""

    gear_law = False
    ways = 2 * len(WAVES)

    def further_ways(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = self.index(joint)
        angles = np.multiply.outer(rows.theta[:, i], WAVES)
        waves = UNLIKE * values[0] * np.concatenate([np.cos(angles), np.sin(angles)], axis=1)
        return np.asarray(np.einsum("na,n,nw->naw", rows.jacobian[:, :, i], rows.torque[:, i] * rows.compliance[i], waves))


class SofterAtAngles(SizeAndAngle, OfTheAngle):
    """`J_i tau_i c_i alpha cos(n q_i + phi)`, n the harmonic, linear in alpha cos phi and alpha sin phi."""

    @property
    @abstractmethod
    def harmonic(self) -> int:
        """How often the gear is as soft within a turn."""

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        share = values[0] * np.cos(self.harmonic * rows.theta[:, i] + values[1])
        return np.asarray(rows.torque[:, i] * rows.compliance[i] * share)


class SofterAbout(OfTheAngle):
    """`J_i tau_i c_i a exp(-(q_i - q_0)^2 / 2 w^2)`: the gear is softer about one angle of its joint."""

    law = "worn"
    formula_source = "engineering judgement: wear is as the angles at which the joint worked are spread"
    parameters = (
        Parameter("share", "1", 0.3, 0.0, 5.0,
                  source="engineering judgement: as the amplitude of a wave, peak to peak",
                  bounds_source="engineering judgement: none, to a gear that has a sixth of its stiffness left there"),
        Parameter("angle_rad", "rad", 1.0, -6.2832, 6.2832, shape=True,
                  source="engineering judgement: no angle is more likely than another",
                  bounds_source="engineering judgement: any angle that a joint reaches"),
        Parameter("width_rad", "rad", 0.35, 0.1, 1.5, shape=True,
                  source="engineering judgement: 15 to 30 degrees, what one job moves the joint",
                  bounds_source="engineering judgement: a few teeth, to half of the joint's way"),
    )

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        share, angle, width = values
        return np.asarray(rows.torque[:, i] * rows.compliance[i] * share
                          * np.exp(-0.5 * ((rows.theta[:, i] - angle) / width) ** 2))

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        angle = rows.theta[:, self.index(joint)]
        found = []
        for shape in ((place, width) for place in np.linspace(angle.min(), angle.max(), PLACES) for width in WIDTHS):
            column = self.contribution(rows, joint, np.array([1.0, *shape]))[:, :3, None]
            found.append(Signature(column, self.typical(rows, joint)[:1], True, partial(np.append, values=shape), self))
        return found


def amplitude_and_phase(typical: float, source: str) -> tuple[Parameter, Parameter]:
    """Those of SofterAtAngles; typical: amplitude, and where it comes from."""
    return (
        Parameter("amplitude", "1", typical, 0.0, 1.0, source=source,
                  bounds_source="engineering judgement: beyond 1 the joint's compliance would be negative at some angle"),
        Parameter("phase_rad", "rad", 1.0, -3.1416, 3.1416, shape=True,
                  source="engineering judgement: no angle is more likely than another",
                  bounds_source="engineering judgement: any direction, a full turn"),
    )


def _polar(coefficients: Array) -> Array:
    """(a cos phi, a sin phi) of `a cos(x + phi) = (a cos phi) cos x + (a sin phi) cos(x + pi/2)`, as (a, phi)."""
    return np.array([np.hypot(*coefficients), np.arctan2(coefficients[1], coefficients[0])])


def along_axes(
    name: str, unit: str, typical: float, bound: float, *, source: str = "", bounds_source: str = "",
) -> tuple[Parameter, ...]:
    """Three parameters of either sign, alike along x, y and z: `{}` in the name stands for the axis."""
    return tuple(Parameter(name.format(axis), unit, typical, -bound, bound, source=source, bounds_source=bounds_source)
                 for axis in "xyz")
