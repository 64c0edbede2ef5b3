"""The fifth judge's arm: finite motions of an elastic chain by the numbers of a robot file, and its equilibrium under a load.

Arrays run over the N rows of a test, in the order in which they were taken; SI, base frame. A gear's or a link's law
sees all rows at once, so that it may remember: equilibrium is where all laws and the geometry agree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

Array = NDArray[np.float64]
Gear = Callable[[Array], Array]                                 # torques at the springs (N, 6) [N m] -> turns (N, 6) [rad]
Seat = Callable[[Array, Array], tuple[Array, Array]]            # force, moment (N, 3) in the link -> shift [m], turn [rad]
ROBOTS = Path(__file__).parents[1] / "identification" / "model" / "robots"
WEIGHT = 9.80665                                                # [m/s^2]


@dataclass(frozen=True)
class Arm:
    """A robot file's numbers; the torques of its own weight are this judge's guess, by payload."""

    alpha: Array
    a: Array
    d: Array
    offset: Array
    sense: Array
    limits: Array                       # (6, 2) [rad], the controller's angles
    couples: float                      # serial angle 3 has this much of angle 2
    rod: bool                           # springs 2 and 3 sit at the drives
    prior: Array                        # (6,) [N m/rad]
    window: tuple[float, float] | None  # of serial angle 3, where the file has one [rad]
    payload: float                      # [kg]
    tool: Array                         # TCP in the flange (3,) [m], not turned
    maker: str

    def serial(self, shown: Array) -> Array:
        """Serial angles (N, 6) of those that the pendant shows [rad]."""
        angles: Array = self.sense * shown + self.offset
        angles[:, 2] += self.couples * shown[:, 1]
        return angles

    @property
    def drives(self) -> Array:
        """D (6, 6): turns of the serial axes = D turns of the springs; torques at the springs = D^T torques of the axes."""
        turned = np.eye(6)
        turned[2, 1] = self.couples if self.rod else 0.0
        return turned


def arm_of(name: str, tool: Array) -> Arm:
    told = yaml.safe_load((ROBOTS / f"{name}.yaml").read_text(encoding="utf-8"))
    column = {key: np.array([float(joint.get(key, 1)) for joint in told["joints"]])
              for key in ("alpha_deg", "a_mm", "d_mm", "offset_deg", "sense")}
    coupling = told.get("coupling", {})
    window = coupling.get("window_deg")
    return Arm(np.radians(column["alpha_deg"]), column["a_mm"] / 1e3, column["d_mm"] / 1e3, np.radians(column["offset_deg"]),
               column["sense"], np.radians([joint["limits_deg"] for joint in told["joints"]]), float(coupling.get("ratio", 0)),
               bool(coupling) and coupling.get("rod", True), np.array(told["prior"]["stiffness_nm_per_rad"], dtype=float),
               (np.radians(window[0]), np.radians(window[1])) if window else None, float(told["data_sheet"]["payload_kg"]),
               tool, told["manufacturer"])


@dataclass(frozen=True)
class Structure:
    """What yields: the six springs, and links' seats by the frame that they carry (0: the base, 6: the flange)."""

    gear: Gear
    seats: tuple[tuple[int, Array, Seat], ...] = ()             # frame, place of the seat in it (3,) [m], law
    weight: float = 1.0                                         # share of the arm's own weight that acts


def springs(stiffness: Array, weight: float = 1.0) -> Structure:
    return Structure(lambda torque: torque / stiffness, weight=weight)


def turning(vector: Array) -> Array:
    """Rotation matrices (N, 3, 3) of rotation vectors (N, 3)."""
    angle = np.linalg.norm(vector, axis=1)[:, None, None]
    x, y, z = vector.T
    zero = np.zeros_like(x)
    cross = np.stack([np.stack([zero, -z, y], 1), np.stack([z, zero, -x], 1), np.stack([-y, x, zero], 1)], 1)
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * cross @ cross


@dataclass(frozen=True)
class Posture:
    """Where everything stands: the axes' origins and directions (N, 6, 3), frames 0 to 6, the tool."""

    origins: Array
    axes: Array
    places: Array                       # (N, 7, 3) [m]
    turns: Array                        # (N, 7, 3, 3)
    tcp: Array                          # (N, 3) [m]

    @property
    def tool(self) -> Array:
        return self.turns[:, 6]


def posture(arm: Arm, angles: Array, seats: tuple[tuple[int, Array, Array, Array], ...] = ()) -> Posture:
    """The chain at serial angles (N, 6); seats as frame, place, shift (N, 3) and turn (N, 3) in that frame."""
    rows = len(angles)
    place, turn = np.zeros((rows, 3)), np.tile(np.eye(3), (rows, 1, 1))
    places, turns = [], []

    def seated(frame: int) -> None:
        nonlocal place, turn
        for at, where, shift, vector in seats:
            if at == frame:
                swung = turning(vector)
                place = place + np.einsum("nij,nj->ni", turn, where + shift - swung @ where)
                turn = turn @ swung
        places.append(place)
        turns.append(turn)

    seated(0)
    for i in range(6):
        c, s, ca, sa = np.cos(angles[:, i]), np.sin(angles[:, i]), np.cos(arm.alpha[i]), np.sin(arm.alpha[i])
        place = place + turn @ np.array([arm.a[i], -sa * arm.d[i], ca * arm.d[i]])
        zero = np.zeros(rows)
        turn = turn @ np.stack([np.stack([c, -s, zero], 1), np.stack([s * ca, c * ca, zero - sa], 1),
                                np.stack([s * sa, c * sa, zero + ca], 1)], 1)
        seated(i + 1)
    all_places, all_turns = np.stack(places, 1), np.stack(turns, 1)
    return Posture(all_places[:, 1:], all_turns[:, 1:, :, 2], all_places, all_turns, place + turn @ arm.tool)


def weight_torques(arm: Arm, stance: Posture) -> Array:
    """What the arm's own weight turns its axes by (N, 6): arm, forearm, spindle as points; a balancer takes 60 % of 2's."""
    torques = np.zeros((len(stance.tcp), 6))
    elbow, wrist = stance.places[:, 3], stance.places[:, 5]
    for share, centre, moved in ((1.2, (stance.places[:, 2] + elbow) / 2, 2), (2.0, 0.7 * elbow + 0.3 * wrist, 3),
                                 (0.4, wrist, 4), (0.45, (stance.places[:, 6] + stance.tcp) / 2, 6)):
        force = np.array([0.0, 0.0, -share * arm.payload * WEIGHT])
        lever = np.cross(centre[:, None, :] - stance.origins, force)
        torques[:, :moved] += np.einsum("nij,nij->ni", stance.axes, lever)[:, :moved]
    torques[:, 1] *= 0.4
    return torques


def equilibrium(arm: Arm, structure: Structure, shown: Array, force: Array, hook: Array | None = None) -> Posture:
    """The posture in which every spring's turn is its law's answer to the torque that it gets: of forces (N, 3) on the tool,
    which act at the TCP or beside it at `hook` (3,) in the tool frame, and of the arm's weight."""
    commanded = arm.serial(shown)
    angles, last = commanded, np.full((len(shown), 3), np.inf)
    seats: tuple[tuple[int, Array, Array, Array], ...] = ()
    for _ in range(60):
        stance = posture(arm, angles, seats)
        if np.abs(stance.tcp - last).max() < 1e-11:
            return stance
        last = stance.tcp
        at = stance.tcp if hook is None else stance.tcp + stance.tool @ hook
        torques = np.einsum("nij,nij->ni", stance.axes, np.cross(at[:, None, :] - stance.origins, force[:, None, :]))
        torques = torques + structure.weight * weight_torques(arm, stance)
        angles = commanded + structure.gear(torques @ arm.drives) @ arm.drives.T
        seats = tuple(_seat(stance, at, force, *one) for one in structure.seats)
    raise ArithmeticError(f"no equilibrium: {np.abs(stance.tcp - last).max():.1e} m from one round to the next")


def _seat(stance: Posture, at: Array, force: Array, frame: int, where: Array, law: Seat) -> tuple[int, Array, Array, Array]:
    turn = stance.turns[:, frame]
    moment = np.cross(at - stance.places[:, frame] - turn @ where, force)
    return frame, where, *law(np.einsum("nji,nj->ni", turn, force), np.einsum("nji,nj->ni", turn, moment))
