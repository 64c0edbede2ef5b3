"""Static equilibrium of the closed-loop arm on MuJoCo's kinematics, solved here to rounding error.

MuJoCo gives positions, Jacobians and gravity at a configuration `z`. With the loop closure `g(z) = 0` (its Jacobian split
into elastic and passive joints, `G = (G_e, G_p)`) and the generalised forces `Q = J^T w + gravity`, the passive joints
carry nothing:

    Q_p + G_p^T lambda = 0 ,    tau = Q_e + G_e^T lambda ,    x = phi(tau) ,

where `x` is what the elastic joints give beyond their commanded place and `phi` the springs (laws.py): compliances, so that
a rigid joint is simply zero. The iteration puts `x <- phi(tau(z))` and takes a Newton step on the closure. It is Newton's
method with the geometric stiffness left out of the matrix, which costs a factor 0.01 a round (geometric over joint
stiffness) and no derivative; it ends when neither moves by more than `TOLERANCE`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import mujoco
import numpy as np

from tests.virtual_cell.arm_model import DRIVES, LINKAGE, ZERO_FLANGE, Tool, compile_model, placed

TOLERANCE = 1e-13       # [rad], [m]
MAX_ROUNDS = 80


@dataclass(frozen=True)
class State:
    """At rest: configuration z (nv,), how far it is off the commanded one moved (nv,), what the elastic joints give x (e,) and
    carry torque (e,), TCP (3,) [m, base]."""

    z: np.ndarray
    moved: np.ndarray
    x: np.ndarray
    torque: np.ndarray
    tcp: np.ndarray
    residual: float     # largest of |x - phi(tau)| and of the loop's gap [rad, m]


class Statics:
    """Solves the balance of one arm with one tool; gravity on or off."""

    def __init__(self, tool: Tool, gravity: bool = True) -> None:
        self.model = compile_model(tool, gravity=gravity)
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(i).name for i in range(self.model.njnt)]
        self.address = {name: int(self.model.joint(name).qposadr[0]) for name in joints}
        self.elastic = [name for name in joints if name not in LINKAGE]
        self.index = {name: i for i, name in enumerate(self.elastic)}
        self.e = np.array([self.address[name] for name in self.elastic])
        self.p = np.array([self.address[name] for name in LINKAGE])
        self._tcp, self._rod_end, self._lever = (self.model.site(name).id for name in ("tcp", "rod_end", "lever"))
        self._tool = self.model.body("tool").id
        nv = self.model.nv
        # The data's own memory: to ask for it takes as long as to use it.
        self._at, self._places = self.data.qpos, self.data.site_xpos
        self._turn = self.data.xmat[self._tool].reshape(3, 3)
        self._force_jacobian, self._moment_jacobian, self._rod, self._back = np.zeros((4, 3, nv))
        self._bias = np.zeros(nv)

    @cached_property
    def drives(self) -> np.ndarray:
        """Where drives 1 … 6 stand among the elastic joints."""
        return np.array([self.index[name] for name in DRIVES])

    def place(self, q: np.ndarray) -> np.ndarray:
        """Configuration (nv,) of the rigid arm at the controller's angles q (6,) [rad]."""
        z, at = np.zeros(self.model.nv), placed(q)
        z[[self.address[name] for name in at]] = list(at.values())
        return z

    def tcp_pose(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """TCP [m] and base_from_flange rotation (3, 3) at a configuration."""
        self.data.qpos[:] = z
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.site_xpos[self._tcp].copy(), self.data.xmat[self._tool].reshape(3, 3) @ ZERO_FLANGE

    def _closure(self, commanded: np.ndarray, z: np.ndarray, rod_ratio: float) -> tuple[np.ndarray, np.ndarray]:
        """Gap g (3,) of the loop and its Jacobian (3, nv).

        rod_ratio 1 is the rod itself. Anything else is the gear 3 of a serial arm (0), or one whose housing goes along with
        that share of gear 2's twist: the forearm stands at its commanded angle plus twist 3 against the lower arm, less
        `rod_ratio` times twist 2; the rod then only rides along.
        """
        if rod_ratio == 1.0:
            mujoco.mj_jacSite(self.model, self.data, self._rod, None, self._rod_end)
            mujoco.mj_jacSite(self.model, self.data, self._back, None, self._lever)
            return self._places[self._rod_end] - self._places[self._lever], self._rod - self._back
        moved, slope = z - commanded, np.zeros((3, len(z)))
        slope[np.arange(3), self.p] = 1.0
        slope[0, self.address["drive3"]] = -1.0
        slope[0, self.address["drive2"]] = rod_ratio
        return slope @ moved, slope

    def solve(
        self, q: np.ndarray, springs: Callable[[np.ndarray], np.ndarray], force: np.ndarray, *,
        offset: np.ndarray | None = None, beside: np.ndarray | None = None, rod_ratio: float = 1.0, start: State | None = None,
        tolerance: float = TOLERANCE,
    ) -> State:
        """The arm at rest, commanded to q (6,) [rad].

        force (3,) [N] in the base frame acts on the tool at the displaced TCP, or beside it by offset (3,) [m] in flange
        axes and beside (3,) [m] in base axes; springs: torques (e,) -> what the elastic joints give (e,); start: a
        state of this pose, or of one close by, to start from; tolerance [rad, m] of the balance.
        """
        commanded = self.place(q)
        z = commanded.copy() if start is None else commanded + start.moved
        in_tool = None if offset is None else ZERO_FLANGE @ offset
        e, p, data, model = self.e, self.p, self.data, self.model
        for _ in range(MAX_ROUNDS):
            self._at[:] = z
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            tcp = point = self._places[self._tcp]
            if in_tool is not None:
                point = point + self._turn @ in_tool
            if beside is not None:
                point = point + beside
            mujoco.mj_jac(model, data, self._force_jacobian, None, point, self._tool)
            mujoco.mj_rne(model, data, 0, self._bias)
            load = force @ self._force_jacobian - self._bias
            gap, slope = self._closure(commanded, z, rod_ratio)
            inverse = _inverse(slope[:, p])
            elastic = slope[:, e]
            torque = load[e] - (load[p] @ inverse) @ elastic
            change = commanded[e] + springs(torque) - z[e]
            residual = max(map(abs, (*change.tolist(), *gap.tolist())))
            if residual <= tolerance:
                return State(z, z - commanded, z[e] - commanded[e], torque, tcp.copy(), residual)
            z[e] += change
            z[p] -= inverse @ (gap + elastic @ change)
        raise RuntimeError(f"no equilibrium after {MAX_ROUNDS} rounds, residual {residual:.1e}; commanded {np.degrees(q)} deg")


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Of (3, 3), by its cofactors: a round asks for one, and LAPACK takes longer to be asked than to answer."""
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    first, second, third = e * i - f * h, f * g - d * i, d * h - e * g
    return np.array([[first, c * h - b * i, b * f - c * e], [second, a * i - c * g, c * d - a * f],
                     [third, b * g - a * h, a * e - b * d]]) / (a * first + b * second + c * third)


@lru_cache(maxsize=8)
def statics(tool: Tool, gravity: bool = True) -> Statics:
    """The solver of a tool, compiled once a process."""
    return Statics(tool, gravity)
