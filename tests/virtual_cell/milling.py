"""A milling pass in the virtual cell: cutter, stock and the yielding arm in balance at every step, and the log of the pass.

The tool yields to the mean cutting force of the engagement that it has where it yields to: both are solved together, step by
step, with the gears remembering the way. A twin of the arm goes the same way in air: there a calibrated robot stands on its
command, and from there the tool is pushed. Tooth passing is superposed on the log alone: the arm is far too slow to follow it,
and a step of the path is two revolutions long. The controller is taken to interpolate straight between targets and to keep its
feed; zones, dynamics, the tilt of the tool and the moment of the force about the TCP are left out.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from tests.virtual_cell.astray import Astray
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import AIR, AIR_FEED_MM_S, SLOT, Part, Steps, steps_of
from tests.virtual_cell.plant import ForceOf

# How the part lies on the table, in the base frame. And the spindle in the work object, pointing down.
BASE_FROM_OBJECT = Rotation.from_euler("z", 10, degrees=True)
OBJECT_FROM_FLANGE = Rotation.from_matrix([[-1, 0, 0], [0, 1, 0], [0, 0, -1]])
SENSOR_TURN = Rotation.from_euler("zx", [35, 180], degrees=True)
NUMBER = r"\s*([-+0-9.eE]+)\s*"
TARGET = re.compile(r"Move[LJ] \[\[" + ",".join([NUMBER] * 3) + r"\],\[" + ",".join([NUMBER] * 4) + r"\]")


class Machine(Protocol):
    """What mills: the part's place object_m [m] in the base frame; `angles` and `pushed` as Plant has them."""

    object_m: tuple[float, float, float]

    def angles(self, tcp: np.ndarray, rotation: np.ndarray) -> np.ndarray: ...

    def pushed(self, theta: np.ndarray, time_s: np.ndarray, force_of: ForceOf) -> tuple[np.ndarray, np.ndarray]: ...


@dataclass(frozen=True)
class Commands:
    """Poses in the work object that a program names: position_mm (N, 3) and turn of the flange."""

    position_mm: np.ndarray
    turn: Rotation


@dataclass(frozen=True)
class Pass:
    """A milled pass, rows are the steps of the path, all in the work object.

    off_um (S, 3): tool against plan; force_n (S, 3): mean force on the tool; commanded_mm (S, 3); time_s (S,) at each step.
    """

    steps: Steps
    off_um: np.ndarray
    force_n: np.ndarray
    commanded_mm: np.ndarray
    time_s: np.ndarray

    @property
    def cutting(self) -> np.ndarray:
        """Steps (S,) that take material away."""
        return np.any(self.force_n != 0, axis=1)

    @property
    def surface_um(self) -> np.ndarray:
        """Error of the machined faces (S,) [um]: across the wall and, where the tool leaves a floor (the slot), up."""
        across = np.einsum("si,si->s", self.off_um, self.steps.left)
        return np.hypot(across, np.where(self.steps.feature == SLOT, self.off_um[:, 2], 0.0))


def planned(part: Part) -> Commands:
    return Commands(part.target_mm, Rotation.concatenate([OBJECT_FROM_FLANGE] * len(part.target_mm)))


def read_commands(rapid: str) -> Commands:
    """The poses of a program's MoveL and MoveJ, inline targets only."""
    rows = np.array([[float(value) for value in match.groups()] for match in TARGET.finditer(rapid)])
    return Commands(rows[:, :3], Rotation.from_quat(np.roll(rows[:, 3:], -1, axis=1)))


def angles(commands: Commands, machine: Machine) -> np.ndarray:
    """The controller's joint angles (N, 6) [rad], one wrist branch throughout."""
    tcp = np.array(machine.object_m) + 1e-3 * BASE_FROM_OBJECT.apply(commands.position_mm)
    return np.asarray(np.unwrap(machine.angles(tcp, (BASE_FROM_OBJECT * commands.turn).as_matrix()), axis=0))


def mill(machine: Machine, part: Part, commands: Commands, cutter: EndMill, given_n: np.ndarray | None = None,
         step_mm: float = 0.5, astray: Astray | None = None) -> Pass:
    """Mills the part with these commands, one a planned target. given_n (S, 3): forces that act whatever is cut. astray: how
    the tool stands off its command before it yields."""
    if len(commands.position_mm) != len(part.target_mm):
        raise ValueError(f"{len(commands.position_mm)} targets where the part has {len(part.target_mm)}")
    steps = steps_of(part, step_mm)
    plan = steps.between(part.target_mm)
    commanded = steps.between(commands.position_mm)
    turns = Slerp(np.arange(len(commands.position_mm)), commands.turn)(steps.segment - 1 + steps.share)
    duration = steps.duration_s(cutter.feed_mm_s)
    time = np.cumsum(duration) - 0.5 * duration
    shift = commanded - plan
    if astray is not None:
        shift = shift + astray.displacement_mm(commanded, time)

    turn = BASE_FROM_OBJECT.as_matrix()

    def force_of(i: int, moved: np.ndarray) -> np.ndarray:
        if given_n is not None:
            return np.asarray(turn @ given_n[i])
        if steps.feature[i] == AIR:
            return np.zeros(3)
        coverage, depth = engagement(part, steps, cutter, i, plan[i] + shift[i] + 1e3 * (moved @ turn))
        return np.asarray(turn @ _to_object(cutter.mean_force(coverage, depth), steps.feed[i]))

    off, force = machine.pushed(angles(Commands(commanded, turns), machine), time, force_of)
    return Pass(steps, 1e3 * shift + 1e6 * BASE_FROM_OBJECT.apply(off, inverse=True),
                BASE_FROM_OBJECT.apply(force, inverse=True), commanded, time)


# Of a step of half a millimetre, which a log must not see as one force: where a tool touches it steps there.
PLACES_LOGGED = 4


def engagement(part: Part, steps: Steps, cutter: EndMill, i: int, place_mm: np.ndarray) -> tuple[np.ndarray, float]:
    """Which pieces of the cutter's circle are in the stock at step i with the tool at place_mm (3,), and its depth [mm]."""
    along, left = steps.feed[i], steps.left[i, :2]
    rim = place_mm[:2] + cutter.rim_mm @ np.array([along, left])
    return cutter.coverage(part.inside_mm(int(steps.feature[i]), rim)), max(-float(place_mm[2]), 0.0)


def _to_object(local: np.ndarray, feed: np.ndarray) -> np.ndarray:
    """From along the feed, to its left, up (..., 3) to the work object's axes."""
    turned = np.array([[feed[0], -feed[1], 0], [feed[1], feed[0], 0], [0, 0, 1]])
    return np.asarray(local @ turned.T)


@dataclass(frozen=True)
class Sensor:
    """The force sensor between flange and spindle, and what it adds; all made up for tests.

    turn: its axes in the flange; drift over a minute; gain: one calibration error for all that it reads. The place is what the
    controller logs beside it: where it has commanded the TCP.
    """

    turn: Rotation = SENSOR_TURN
    position_mm: tuple[float, float, float] = (0.0, 0.0, 90.0)
    rate_hz: float = 2000.0
    bias_n: tuple[float, float, float] = (2.6, -3.4, 4.1)
    drift_n_min: tuple[float, float, float] = (2.0, -1.5, 3.0)
    noise_n: float = 1.5
    gain: float = 1.003
    quantum_n: float = 1 / 32
    place_noise_mm: float = 0.02
    instants: int = 4       # averaged into one sample, as an anti-alias filter does

    def cell_yaml(self) -> str:
        """The part of cell.yaml that describes it."""
        quaternion = np.roll(self.turn.as_quat(canonical=True), 1)
        return ("force_log:\n  frame: sensor\n  sign: on_tool\n"
                f"  sensor_quaternion: [{', '.join(f'{value:.10f}' for value in quaternion)}]\n"
                f"  sensor_position_mm: [{', '.join(f'{value:g}' for value in self.position_mm)}]\n")


@dataclass(frozen=True)
class Log:
    """What is logged: time_s (M,), force_n (M, 3) in the sensor's axes, position_mm (M, 3) in the work object, target (M,)."""

    time_s: np.ndarray
    force_n: np.ndarray
    position_mm: np.ndarray
    target: np.ndarray

    def averaged(self, samples: int) -> Log:
        """The log with a moving mean over so many samples, as a low-pass filter before the logger gives it."""
        ends = np.pad(self.force_n, ((samples // 2, samples - samples // 2), (0, 0)), mode="edge").cumsum(axis=0)
        return replace(self, force_n=(ends[samples:] - ends[:-samples]) / samples)

    def csv(self, by_target: bool = False) -> str:
        places = [self.target] if by_target else [*self.position_mm.T]
        names = "target" if by_target else "x_mm,y_mm,z_mm"
        rows = np.column_stack([self.time_s, *places, self.force_n])
        form = ",".join(["%.4f", *(["%d"] if by_target else ["%.3f"] * 3), *["%.5g"] * 3])
        return "\n".join([f"time_s,{names},fx_n,fy_n,fz_n", *(form % tuple(row) for row in rows.tolist())]) + "\n"


def log_of(done: Pass, part: Part, commands: Commands, cutter: EndMill, sensor: Sensor, rng: np.random.Generator) -> Log:
    """The pass as the sensor sees it, tooth by tooth; `target` is the one that the tool moves to."""
    steps = done.steps
    duration = steps.duration_s(cutter.feed_mm_s)
    ends = np.cumsum(duration)
    time = np.arange(int(ends[-1] * sensor.rate_hz) + 1) / sensor.rate_hz
    spread = (np.arange(sensor.instants) - 0.5 * (sensor.instants - 1)) / (sensor.instants * sensor.rate_hz)
    step = np.minimum(np.searchsorted(ends, time), len(ends) - 1)
    force = np.zeros((len(time), 3))
    share = np.clip((time - (ends[step] - duration[step])) / duration[step], 0, 1)
    # Within its step, of as many as its segment has.
    count = np.bincount(steps.segment)[steps.segment[step]]
    done_share = steps.share[step] + (share - 0.5) / count
    piece = PLACES_LOGGED * step + np.minimum((PLACES_LOGGED * share).astype(int), PLACES_LOGGED - 1)
    way = (steps.between(part.target_mm), np.diff(part.target_mm, axis=0)[steps.segment - 1]
           / np.bincount(steps.segment)[steps.segment][:, None])
    for one in np.unique(piece[steps.feature[step] != AIR]):
        i, number = divmod(int(one), PLACES_LOGGED)
        actual = way[0][i] + ((number + 0.5) / PLACES_LOGGED - 0.5) * way[1][i] + 1e-3 * done.off_um[i]
        rows = slice(*np.searchsorted(piece, [one, one + 1]))
        instants = (time[rows, None] + spread).ravel()
        coverage, depth = engagement(part, steps, cutter, i, actual)
        local = cutter.force(coverage, depth, 2 * np.pi * cutter.turns_per_s * instants)
        force[rows] = _to_object(local.reshape(-1, sensor.instants, 3).mean(axis=1), steps.feed[i])
    seen = sensor.gain * (OBJECT_FROM_FLANGE * sensor.turn).apply(force, inverse=True)
    seen += np.array(sensor.bias_n) + np.outer(time / 60, sensor.drift_n_min) + sensor.noise_n * rng.standard_normal(seen.shape)
    seen = sensor.quantum_n * np.round(seen / sensor.quantum_n)
    before, after = commands.position_mm[steps.segment[step] - 1], commands.position_mm[steps.segment[step]]
    place = before + done_share[:, None] * (after - before)
    return Log(time, seen, place + sensor.place_noise_mm * rng.standard_normal(place.shape), steps.segment[step])


def rapid(part: Part, theta: np.ndarray, cutter: EndMill, tool_mm: tuple[float, ...], object_m: tuple[float, ...]) -> str:
    """The planned program as a CAM system posts it; theta (N, 6) [rad] gives the configuration data."""
    def pose(position: np.ndarray, turn: Rotation) -> str:
        quaternion = np.roll(turn.as_quat(canonical=True), 1) + 0.0
        return f"[[{','.join(f'{x + 0.0:.4f}' for x in position)}],[{','.join(f'{x:.8f}' for x in quaternion)}]"

    placed = pose(1e3 * np.array(object_m), BASE_FROM_OBJECT)
    lines = ["MODULE Milled",
             f"  PERS tooldata tMill:=[TRUE,{pose(np.array(tool_mm), Rotation.identity())}],[80,[0,0,120],[1,0,0,0],0,0,0]];",
             f"  TASK PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],{placed}]];",
             f"  CONST speeddata vCut:=[{cutter.feed_mm_s:g},500,5000,1000];",
             f"  CONST speeddata vAir:=[{AIR_FEED_MM_S:g},500,5000,1000];", "  PROC main()", "    ConfL\\Off;"]
    quarters = np.floor(np.degrees(theta[:, [0, 3, 5]]) / 90).astype(int)
    for i, position in enumerate(part.target_mm):
        branch = 0 if theta[i, 4] >= 0 else 1
        speed = "vAir" if part.feature[i] == AIR else "vCut"
        conf = ",".join(map(str, [*quarters[i], branch]))
        lines.append(f"    Move{'L' if i else 'J'} {pose(position, OBJECT_FROM_FLANGE)},[{conf}],"
                     f"[9E9,9E9,9E9,9E9,9E9,9E9]],{speed},z0,tMill\\WObj:=wPart;")
    return "\n".join([*lines, "    ConfL\\On;", "  ENDPROC", "ENDMODULE"]) + "\n"
