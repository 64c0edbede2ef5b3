"""LoadState: what a physical effect may look at, at the pose the loaded plain robot stands in.

Effects beyond the plain springs (effects/) are small beside them, so each is a contribution on top of the plain model at its
equilibrium: torques, Jacobians and lever arms are those of the loaded pose, which leaves an error of second order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.model.compliance import Equilibrium, cross, equilibrium, loaded_angles
from identification.model.gravity import DOWN, gravity_torque, sagged_angles
from identification.model.kinematics import Chain, chain
from identification.model.robot import RobotModel
from identification.model.rotations import Frame

Array = NDArray[np.float64]
# Where the weight of forearm and tool hangs, and that of the lower arm with it: of the way from elbow to wrist.
FOREARM = 0.4
# Time [s] that one row is taken to last where no row has a time: half a minute until nothing creeps, and a reading.
PACE_S = 60.0
# Angles are moved by so much for a slope [rad].
STEP = 1e-4


@dataclass(frozen=True, eq=False)
class LoadState:
    """n rows in the order the loads were put on.

    theta (n, 6) controller angles [rad]; wrench (n, 6) on the tool at the TCP, base frame [N, N m]; compliance (6,)
    [rad/(N m)]; visit (n,) number of the pose visit: load history starts from zero at each; reference (n,) number of the
    unloaded reference; time (n,) [s] since the file's first row, dwell (n,) [s], NaN where not known; labels (n,) of the poses;
    row (n,) number of the row in its file, from 1.
    fall (3,) acceleration of free fall in the base frame; tool_mass [kg] and tool_centre (3,) [m] in the flange frame.
    at_load: theta is the loaded pose itself (a planned toolpath), not the commanded one; then flange_from_tcp may be one frame
    a row (several tools).
    """

    robot: RobotModel
    flange_from_tcp: Frame
    theta: Array
    wrench: Array
    compliance: Array
    visit: NDArray[np.intp]
    reference: NDArray[np.intp]
    time: Array
    dwell: Array
    labels: NDArray[np.object_]
    row: NDArray[np.intp]
    fall: Array
    tool_mass: float | None = None
    tool_centre: Array | None = None
    at_load: bool = False

    def __len__(self) -> int:
        return len(self.theta)

    def with_compliance(self, compliance: Array) -> LoadState:
        """The same loaded rows on a robot with other springs (6,) [rad/(N m)], which hold the loaded pose that this robot
        reaches: exact where that is given (`at_load`), else of first order."""
        other, torque = replace(self, compliance=compliance), self.torque
        # What was worked out at the loaded pose (all but these) holds for any springs.
        changed = ("compliance", "at_rest", "elastic", "elastic_position", "_sagged", "of_sag", "of_weight")
        vars(other).update({name: value for name, value in vars(self).items() if name not in changed})
        if not self.at_load:
            more = (compliance - self.compliance) * torque
            vars(other)["elastic"] = self.elastic + np.einsum("nri,ni->nr", self.jacobian, more)
            vars(other)["elastic_position"] = other.elastic[:, :3]
        return other

    @cached_property
    def held(self) -> Array:
        """How long each row's load is on (n,) [s]. Where no row of a load test says so each load is taken to have come on right
        after the reading before, and where there are no times either, for PACE_S; along a toolpath nothing is held."""
        if self.at_load or not np.isnan(self.dwell).all():
            return np.nan_to_num(self.dwell)
        step = np.where(self.starts, np.nan, np.diff(self.time, prepend=np.nan))
        step = np.where(step > 0, step, np.nan)
        return np.nan_to_num(step, nan=PACE_S if np.isnan(step).all() else float(np.nanmedian(step)))

    @cached_property
    def at_rest(self) -> Equilibrium:
        """The plain robot under the load."""
        return equilibrium(self.robot, self.theta, self.flange_from_tcp, self.wrench, self.compliance)

    def slope_by_angle(self, axis: int) -> Array:
        """What a radian more at an axis, from 0, makes of the plain robot's deflection (n, 3) [m]."""
        moved = STEP * np.eye(6)[axis]
        ahead, behind = (replace(self, theta=self.theta + way * moved).elastic_position for way in (1, -1))
        return np.asarray((ahead - behind) / (2 * STEP))

    @cached_property
    def loaded(self) -> Array:
        """Controller angles (n, 6) [rad] at which an unloaded robot stands where the loaded one is."""
        return self.theta if self.at_load else loaded_angles(self.robot, self.theta, self.at_rest.deflection)

    @cached_property
    def frames(self) -> Chain:
        """Joint frames at the loaded pose, components first."""
        return chain(self.robot, np.ascontiguousarray(self.robot.serial_angles(self.loaded).T))

    @cached_property
    def axes(self) -> Array:
        """Joint axes z_i (n, 6, 3)."""
        return np.ascontiguousarray(self.frames.axes.transpose(2, 0, 1))

    @cached_property
    def origins(self) -> Array:
        """Origins of the joint frames, after their d (n, 6, 3) [m]; the sixth is the flange."""
        return np.ascontiguousarray(self.frames.origins.transpose(2, 0, 1))

    @cached_property
    def flange(self) -> Array:
        """base_from_flange rotations (n, 3, 3)."""
        return np.ascontiguousarray(self.frames.rotation.transpose(2, 0, 1))

    @cached_property
    def tool(self) -> Array:
        """base_from_tcp rotations (n, 3, 3)."""
        return np.asarray(self.flange @ self.flange_from_tcp.rotation)

    @cached_property
    def tcp(self) -> Array:
        """TCP (n, 3) [m]."""
        return np.asarray(self.origins[:, 5] + (self.flange @ self.flange_from_tcp.position[..., None])[..., 0])

    @cached_property
    def link_x(self) -> Array:
        """x axes of the joint frames (n, 6, 3)."""
        planes = np.empty((6, 3, len(self.loaded)), dtype=np.complex128)
        chain(self.robot, np.ascontiguousarray(self.robot.serial_angles(self.loaded).T), planes)
        return np.asarray(planes.real.transpose(2, 0, 1))

    @cached_property
    def serial_jacobian(self) -> Array:
        """J~ (n, 6, 6): rows position [m/rad], rotation; one column a serial axis."""
        axes = self.frames.axes         # [axis, component, pose]
        moved = cross(axes, self.tcp.T - self.frames.origins)
        return np.ascontiguousarray(np.concatenate([moved, axes], axis=1).transpose(2, 1, 0))

    @cached_property
    def jacobian(self) -> Array:
        """J = J~ L (n, 6, 6), one column a spring."""
        return np.asarray(self.serial_jacobian @ self.robot.load_matrix)

    @cached_property
    def torque(self) -> Array:
        """Torques of the wrench at the springs (n, 6) [N m], at equilibrium (paper eq. 5)."""
        return np.asarray(np.einsum("nri,nr->ni", self.jacobian, self.wrench))

    @cached_property
    def gravity(self) -> Array:
        """Gravity torques at the springs (n, 6) [N m]; zero for a robot file without `links`."""
        return self._gravity_at(self.theta)

    @cached_property
    def hung_on_flange(self) -> Array:
        """Torques at the springs (n, 6) of a weight on the axis of the flange, 1 N m while that is level and across a joint's
        own axis; on the last joint, whose axis that is, on the way to the TCP, 1 N m as far out as the TCP is."""
        axis, beside = self.flange[:, :, 2], self.tcp - self.origins[:, 5]
        out = beside / np.maximum(np.linalg.norm(beside, axis=1, keepdims=True), 1e-9)
        return self.hung(np.stack([*[axis] * 5, out], axis=1))

    @cached_property
    def hung_on_forearm(self) -> Array:
        """Torques at the springs (n, 6), of use for joints 2 and 3, of a weight on the forearm, 1 N m as far out as the lower
        arm is long."""
        elbow, wrist = self.origins[:, 2], self.origins[:, 4]
        lower_arm = np.linalg.norm(self.origins[:1, 2] - self.origins[:1, 1])
        return self.hung(((elbow + FOREARM * (wrist - elbow))[:, None] - self.origins) / lower_arm)

    def hung(self, lever: Array) -> Array:
        """Torques at the springs (n, 6) of 1 N that hangs at these levers (n, 6, 3) [m] from the axes."""
        down = self.fall / np.linalg.norm(self.fall)
        return np.asarray(np.sum(self.axes * np.cross(lever, down), axis=2) @ self.robot.load_matrix)

    def _gravity_at(self, theta: Array) -> Array:
        return gravity_torque(self.robot, theta, self.fall, self.tool_mass, self.tool_centre)

    @cached_property
    def _sagged(self) -> LoadState | None:
        """The robot as it sags under its own weight, where theta does not say so: at the loaded pose of a plan. None: it does,
        or the robot file has no `links`."""
        if self.robot.link_mass is None or not self.at_load:
            return None
        sagged = sagged_angles(self.robot, self.theta, self.compliance, self.fall, self.tool_mass, self.tool_centre)
        return replace(self, theta=sagged)

    @cached_property
    def of_sag(self) -> Array:
        """How much further (n, 6) [m, rad] the springs yield because the load acts at the sagged pose, first order."""
        if self._sagged is None:
            return np.zeros((len(self), 6))
        return np.asarray(np.einsum("nri,ni->nr", self.jacobian, self.compliance * (self._sagged.torque - self.torque)))

    @cached_property
    def of_weight(self) -> Array:
        """What the robot's own weight adds to the deviation (n, 6) [m, rad] beside `of_sag`, first order: the load moves the
        weight, and the change of the gravity torques turns the springs once more; and yielding at the sagged pose moves the
        tool otherwise. With `of_sag` 0.1 to 0.4 % of the deflection on the IRB 6660, zero without `links`."""
        if self.robot.link_mass is None:
            return np.zeros((len(self), 6))
        if self.at_load:
            unloaded = loaded_angles(self.robot, self.theta, -self.compliance * self.torque)
            change = self.gravity - self._gravity_at(unloaded)
        else:
            change = self._gravity_at(self.loaded) - self.gravity
        turned = np.asarray(np.einsum("nri,ni->nr", self.jacobian, self.compliance * change))
        return turned if self._sagged is None else turned + self._sagged.elastic - self.elastic - self.of_sag

    @cached_property
    def elastic(self) -> Array:
        """The plain model's deviation (n, 6): position [m], rotation [rad] (paper eq. 2-6)."""
        rotation = np.einsum("nri,ni->nr", self.jacobian[:, 3:], self.compliance * self.torque)
        return np.concatenate([self.elastic_position, rotation], axis=1)

    @cached_property
    def elastic_position(self) -> Array:
        """Its position (n, 3) [m] alone, which asks for no Jacobian of a load test."""
        if self.at_load:
            return np.asarray(np.einsum("nri,ni->nr", self.jacobian[:, :3], self.compliance * self.torque))
        return self.at_rest.position

    def compliant(self, wrench: Array) -> Array:
        """Deviation (n, 6) that an additional wrench (n, 6) causes through the springs, first order (paper eq. 3)."""
        torque = np.einsum("nri,nr->ni", self.jacobian, wrench)
        return np.asarray(np.einsum("nri,ni->nr", self.jacobian, self.compliance * torque))

    def turned(self, pivot: Array, rotation: Array) -> Array:
        """Deviation (n, 6) of the TCP where all beyond the pivots (n, 3) [m] turns by rotation vectors (n, 3) [rad]."""
        return np.concatenate([np.cross(rotation, self.tcp - pivot), rotation], axis=1)

    def moment_about(self, point: Array) -> Array:
        """Moment (n, 3) [N m] of the wrench about points (n, 3) [m] (paper eq. 5)."""
        return np.asarray(np.cross(self.tcp - point, self.wrench[:, :3]) + self.wrench[:, 3:])

    def tilted(self, compliance: Array | float, ahead: Array | float) -> Array:
        """Deviation (n, 6) of the TCP where all beyond a point of the flange's axis, so far ahead of the flange [m], tilts
        about flange x and y by a compliance [rad/(N m)]: numbers, or (n,)."""
        axis = self.flange[:, :, 2]
        pivot = self.origins[:, 5] + np.reshape(ahead, (-1, 1)) * axis
        moment = self.moment_about(pivot)
        across = moment - axis * np.sum(axis * moment, axis=1, keepdims=True)
        return self.turned(pivot, np.reshape(compliance, (-1, 1)) * across)

    @cached_property
    def starts(self) -> NDArray[np.bool_]:
        """True at the first row of each pose visit (n,): load history starts there."""
        return np.concatenate([[True], np.diff(self.visit) != 0])[: len(self.theta)]


def load_state(
    robot: RobotModel, flange_from_tcp: Frame, theta: Array, wrench: Array, compliance: Array, *, fall: Array = DOWN,
    tool_mass: float | None = None, tool_centre: Array | None = None, at_load: bool = False, dwell: Array | None = None,
) -> LoadState:
    """A stretch of one toolpath: one visit, one reference, no times, dwell (n,) [s] where it is known."""
    count = len(theta)
    nothing, zero = np.full(count, np.nan), np.zeros(count, dtype=np.intp)
    return LoadState(robot, flange_from_tcp, theta, wrench, compliance, zero, zero, nothing,
                     nothing if dwell is None else dwell, np.full(count, "", dtype=object), np.arange(1, count + 1), fall,
                     tool_mass, tool_centre, at_load)
