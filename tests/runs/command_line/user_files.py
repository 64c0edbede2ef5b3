"""What the acceptance tests compute for themselves: frames, inverse kinematics by a root finder, a reader of the RAPID they
wrote, cells and force logs on disk, and the command line run in this process or in its own. Nothing here uses the packages'
physics."""

from __future__ import annotations

import contextlib
import io
import json
import re
import subprocess
import sys
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tests.virtual_cell.arm import IRB6660, Arm

K = np.array([2.0e6, 4.0e6, 1.5e6, 0.5e6, 0.25e6, 0.1e6])
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


def rotation(quaternion: object) -> Rotation:
    """Rotation of w x y z."""
    w, x, y, z = np.asarray(quaternion, dtype=float)
    return Rotation.from_quat([x, y, z, w])


def quaternion(turn: Rotation) -> np.ndarray:
    """w x y z of a rotation, w >= 0."""
    return np.roll(turn.as_quat(canonical=True), 1)


@dataclass(frozen=True)
class Frame:
    """A pose: position [m] and orientation."""

    p: np.ndarray
    r: Rotation

    @classmethod
    def mm(cls, position: object, quat: object = (1, 0, 0, 0)) -> Frame:
        return cls(np.asarray(position, dtype=float) / 1e3, rotation(quat))

    def __matmul__(self, other: Frame) -> Frame:
        return Frame(self.p + self.r.apply(other.p), self.r * other.r)

    def inv(self) -> Frame:
        return Frame(-self.r.inv().apply(self.p), self.r.inv())

    def rapid(self, digits: int = 10) -> str:
        """[[x,y,z],[q1,q2,q3,q4]] in millimetres."""
        p, q = self.p * 1e3, quaternion(self.r)
        return f"[[{','.join(f'{v:.{digits}f}' for v in p)}],[{','.join(f'{v:.{digits}f}' for v in q)}]]"


IDENTITY = Frame(np.zeros(3), Rotation.identity())


def _about(axis: int, angle: np.ndarray) -> np.ndarray:
    """Turns (..., 3, 3) about an axis by angles (...) [rad]."""
    turn, (i, j) = np.zeros((*np.shape(angle), 3, 3)), ((axis + 1) % 3, (axis + 2) % 3)
    turn[..., axis, axis] = 1
    turn[..., i, i] = turn[..., j, j] = np.cos(angle)
    turn[..., j, i] = np.sin(angle)
    turn[..., i, j] = -turn[..., j, i]
    return turn


_TOOL0 = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])


def point(arm: Arm, q: np.ndarray, tcp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`Arm.pose` in plain matrices, for many joint angles (..., 6) at once: the TCP (..., 3) [m] and its turn (..., 3, 3);
    test_user_files.py compares the two."""
    first, lower, upper, *wrist = np.moveaxis(q, -1, 0)
    column, lower_arm = _about(2, first), _about(1, lower)
    forearm = _about(1, upper if arm.parallel_rod else lower + upper)
    hand = column @ forearm @ _about(0, wrist[0]) @ _about(1, wrist[1]) @ _about(0, wrist[2])
    flange = hand @ _TOOL0
    elbow = np.array([arm.shoulder, 0, arm.height]) + lower_arm @ [0, 0, arm.lower_arm] + forearm @ [arm.forearm, 0, arm.elbow]
    return (column @ elbow[..., None])[..., 0] + hand @ [arm.flange, 0, 0] + flange @ tcp, flange


def _vee(m: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3) of small turns (..., 3, 3), exact where they are zero."""
    return np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1) / 2


def _slopes(arm: Arm, q: np.ndarray, tcp: np.ndarray) -> np.ndarray:
    """d pose / d drive angles (..., 6, 6), central differences."""
    step = 1e-5 * np.eye(6)
    (p, r), (o, s) = point(arm, q[..., None, :] + step, tcp), point(arm, q[..., None, :] - step, tcp)
    return np.concatenate([p - o, _vee(r @ s.swapaxes(-1, -2))], axis=-1).swapaxes(-1, -2) / 2e-5


def solve(arm: Arm, flange: Frame, start: np.ndarray) -> np.ndarray:
    """Joint angles [rad] near start that put the flange there, by Newton's method; many tests ask for the same."""
    return _solved(arm, flange.p.tobytes(), flange.r.as_matrix().tobytes(), np.array(start, dtype=float).tobytes()).copy()


@lru_cache(maxsize=20_000)
def _solved(arm: Arm, place: bytes, turn: bytes, start: bytes) -> np.ndarray:
    q, aim, p_aim = np.frombuffer(start).copy(), np.frombuffer(turn).reshape(3, 3), np.frombuffer(place)
    for _ in range(20):
        p, r = point(arm, q, np.zeros(3))
        miss = np.concatenate([p - p_aim, _vee(r @ aim.T)])
        if np.max(np.abs(miss)) < 1e-14:
            break
        q -= np.linalg.solve(_slopes(arm, q, np.zeros(3)), miss)
    assert np.max(np.abs(miss)) < 1e-11
    return q


def loaded(arm: Arm, q: np.ndarray, tcp: np.ndarray, wrench: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Drive angles (..., 6) at rest under wrenches (..., 6): `Arm.loaded` by repeated substitution."""
    at = q
    for _ in range(200):
        last, at = at, q + np.einsum("...ri,...r->...i", _slopes(arm, at, tcp), wrench) / k
        if np.max(np.abs(at - last)) < 1e-12:
            return at
    raise AssertionError("not at rest")


def deviation(arm: Arm, q: np.ndarray, tcp: np.ndarray, wrench: np.ndarray, k: np.ndarray) -> np.ndarray:
    """TCP displacement (..., 3) [m], base frame."""
    return point(arm, loaded(arm, q, tcp, wrench, k), tcp)[0] - point(arm, q, tcp)[0]


def tcp_pose(arm: Arm, q: np.ndarray, tool: Frame) -> Frame:
    p, r = point(arm, q, tool.p)
    return Frame(p, Rotation.from_matrix(r) * tool.r)


def confdata(q: np.ndarray) -> str:
    """[cf1,cf4,cf6,cfx] of joint angles [rad] with the wrist centre in front of axis 1 and of the lower arm."""
    quarter = [int(np.floor(np.degrees(v) / 90)) for v in (q[0], q[3], q[5])]
    return f"[{quarter[0]},{quarter[1]},{quarter[2]},{0 if q[4] >= 0 else 1}]"


# ---- the cell of the correction tests: no frame is trivial -----------------------------------------------------------------

BASE = Frame.mm([250.0, -400.0, 130.0], quaternion(Rotation.from_euler("zyx", [35, 3, -2], degrees=True)))
TOOL = Frame.mm([110.0, -20.0, 260.0], quaternion(Rotation.from_euler("yz", [40, 15], degrees=True)))
USER = Frame.mm([900.0, 300.0, 500.0], quaternion(Rotation.from_euler("zxy", [20, 5, -4], degrees=True)))
OBJECT = Frame.mm([40.0, -60.0, 25.0], quaternion(Rotation.from_euler("xz", [90, -30], degrees=True)))
START = np.radians([12.0, 18.0, 22.0, 25.0, 48.0, -30.0])


def work_object(base: Frame = BASE, user: Frame = USER, obj: Frame = OBJECT) -> Frame:
    """The work object in the robot's base frame."""
    return base.inv() @ user @ obj


def rod_path(count: int, length: float = 0.12, seed: int = 5) -> np.ndarray:
    """Joint angles (count, 6) [rad] of a curved path whose orientation turns by some degrees."""
    first = tcp_pose(IRB6660, START, TOOL)
    q, out = START, []
    for s in np.linspace(0, 1, count):
        at = Frame(
            first.p + np.array([0.3 * s, s, 0.25 * np.sin(4 * s)]) * length,
            Rotation.from_rotvec(np.array([0.05, -0.08, 0.1]) * s) * first.r,
        )
        q = solve(IRB6660, at @ TOOL.inv(), q)
        out.append(q)
    return np.array(out)


def yaml_frame(frame: Frame) -> str:
    p, q = frame.p * 1e3, quaternion(frame.r)
    return f"{{position_mm: [{', '.join(f'{v:.10f}' for v in p)}], quaternion: [{', '.join(f'{v:.12f}' for v in q)}]}}"


def cell_text(robot: str = "irb6660-205-1.90", tool: Frame = TOOL, base: Frame | None = BASE, extra: str = "") -> str:
    text = f"robot: {robot}\ntool: {yaml_frame(tool)}\n"
    if base is not None:
        text += f"base_frame: {yaml_frame(base)}\n"
    return text + extra


def stiffness_text(
    k: np.ndarray = K, relative: float = 0.02, log: bool = True, correlation: float = 0.0, **changes: object
) -> str:
    """stiffness.json written by hand."""
    std = k * relative
    corr = np.full((6, 6), correlation) + (1 - correlation) * np.eye(6)
    cov = np.outer(std, std) * corr
    data: dict[str, object] = {
        "format": "compstiff-stiffness",
        "version": 1,
        "robot": "irb6660-205-1.90",
        "parameters": [
            {
                "name": f"k{i + 1}",
                "unit": "N*m/rad",
                "estimate": float(k[i]),
                "std": float(std[i]),
                "interval_95": [float(k[i] - 1.96 * std[i]), float(k[i] + 1.96 * std[i])],
            }
            for i in range(6)
        ],
        "covariance": cov.tolist(),
    }
    if log:
        data |= {
            "load_path": "drive",
            "tool": {"position_mm": (TOOL.p * 1e3).tolist(), "quaternion": quaternion(TOOL.r).tolist()},
            "log_compliance": {"mean": (-np.log(k)).tolist(), "covariance": (cov / np.outer(k, k)).tolist()},
            "effects": [],
        }
    data |= changes
    return json.dumps({key: value for key, value in data.items() if value is not None})


# ---- RAPID -----------------------------------------------------------------------------------------------------------------

E = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def robtarget(pose: Frame, conf: str = "[0,0,0,0]", eax: str = E, digits: int = 6) -> str:
    inner = pose.rapid(digits)[1:-1]
    return f"[{inner},{conf},{eax}]"


def tooldata(tool: Frame = TOOL, held: str = "TRUE") -> str:
    return f"PERS tooldata tMill:=[{held},{tool.rapid()},[80,[0,0,120],[1,0,0,0],0,0,0]];"


def wobjdata(user: Frame = USER, obj: Frame = OBJECT, held: str = "FALSE", fixed: str = "TRUE", unit: str = "") -> str:
    return f'PERS wobjdata wPart:=[{held},{fixed},"{unit}",{user.rapid()},{obj.rapid()}];'


def module(moves: list[str], data: list[str] | None = None, name: str = "Part") -> str:
    lines = [
        f"MODULE {name}",
        *(data if data is not None else [tooldata(), wobjdata()]),
        "PROC main()",
        *moves,
        "ENDPROC",
        "ENDMODULE",
    ]
    return "\n".join(lines) + "\n"


def move(target: str, kind: str = "MoveL", zone: str = "z1") -> str:
    return f"    {kind} {target},v50,{zone},tMill\\WObj:=wPart;"


TARGET = re.compile(
    rf"\[\[({NUMBER}),({NUMBER}),({NUMBER})\],\[({NUMBER}),({NUMBER}),({NUMBER}),({NUMBER})\],"
    rf"\[({NUMBER}),({NUMBER}),({NUMBER}),({NUMBER})\],"
)


def targets_of(text: str) -> list[Frame]:
    """The robtargets of a module in the order of its text, in the work object."""
    out = []
    for found in TARGET.finditer(re.sub(r"\s", "", text)):
        v = [float(x) for x in found.groups()]
        out.append(Frame.mm(v[:3], v[3:7]))
    return out


# ---- running ---------------------------------------------------------------------------------------------------------------


@dataclass
class Run:
    code: int
    out: str
    err: str

    @property
    def json(self) -> dict:
        def refuse(word: str) -> None:
            raise AssertionError(f"JSON holds {word}")

        return json.loads(self.out, parse_constant=refuse)

    def __str__(self) -> str:
        return f"exit {self.code}\n--- stdout\n{self.out}\n--- stderr\n{self.err}"


def run(*arguments: object) -> Run:
    """The command line, in this process."""
    import os

    from compstiff.cli import main as cli

    out, err = io.StringIO(), io.StringIO()
    code: object = 0
    argv, handlers = sys.argv, dict(os.environ)
    sys.argv = ["compstiff", *map(str, arguments)]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                cli.main()
            except SystemExit as stop:
                code = stop.code
    finally:
        sys.argv = argv
        assert dict(os.environ) == handlers
    return Run(int(code or 0), out.getvalue(), err.getvalue())


def spawn(*arguments: object, cwd: Path | None = None, timeout: float = 300) -> Run:
    """The command line, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "compstiff", *map(str, arguments)], cwd=cwd, capture_output=True, timeout=timeout
    )
    return Run(done.returncode, done.stdout.decode("utf-8"), done.stderr.decode("utf-8"))


@dataclass
class Job:
    """A folder with a cell, a program, a stiffness file and a force log."""

    folder: Path
    cell: str = field(default_factory=cell_text)
    program: str | bytes = ""
    stiffness: str = field(default_factory=stiffness_text)
    forces: str = ""
    name: str = "part.mod"

    def write(self) -> Job:
        (self.folder / "cell.yaml").write_text(self.cell)
        raw = self.program if isinstance(self.program, bytes) else self.program.encode()
        (self.folder / self.name).write_bytes(raw)
        (self.folder / "stiffness.json").write_text(self.stiffness)
        (self.folder / "forces.csv").write_text(self.forces)
        return self

    @property
    def out(self) -> Path:
        return self.folder / "out.mod"

    @property
    def offsets_file(self) -> Path:
        return self.folder / "offsets.csv"

    def arguments(self, *more: object, command: str = "correct") -> list[object]:
        f = self.folder
        return [
            command,
            f / "cell.yaml",
            f / self.name,
            "--stiffness",
            f / "stiffness.json",
            "--forces",
            f / "forces.csv",
            "-o",
            self.out if command == "correct" else f / "deviation.csv",
            *(["--offsets", self.offsets_file] if command == "correct" else []),
            *more,
        ]

    def correct(self, *more: object) -> Run:
        self.write()
        return run(*self.arguments(*more))

    def predict(self, *more: object) -> Run:
        self.write()
        return run(*self.arguments(*more, command="predict"))

    def nothing_written(self) -> None:
        left = sorted(p.name for p in self.folder.iterdir())
        assert left == sorted(["cell.yaml", self.name, "stiffness.json", "forces.csv"]), left

    def offsets(self) -> list[dict[str, str]]:
        return table(self.offsets_file)


def table(path: Path) -> list[dict[str, str]]:
    import csv

    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def column(rows: list[dict[str, str]], *names: str) -> np.ndarray:
    return np.array([[float(row[n]) if row[n] != "" else np.nan for n in names] for row in rows])


def codes(result: Run) -> set[str]:
    return {f["code"] for f in result.json["findings"]}


def lands(
    commanded: Frame,
    planned: Frame,
    q: np.ndarray,
    wrench: np.ndarray,
    *,
    obj: Frame | None = None,
    tool: Frame = TOOL,
    arm: Arm = IRB6660,
    k: np.ndarray = K,
) -> tuple[float, float]:
    """Distance [m] and angle [rad] between the loaded TCP of the commanded target and the planned target.

    Both targets in the work object `obj` (in the base frame); `q` joint angles near by; `wrench` base frame, at the TCP.
    """
    obj = work_object() if obj is None else obj
    aim = obj @ planned
    at = solve(arm, obj @ commanded @ tool.inv(), q)
    rest = tcp_pose(arm, loaded(arm, at, tool.p, wrench, k), tool)
    return float(np.linalg.norm(rest.p - aim.p)), float((rest.r * aim.r.inv()).magnitude())
