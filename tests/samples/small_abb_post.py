"""A small post processor of the kind that RoboDK calls, for the tests: it writes MoveAbsJ and MoveL with inline targets."""

from __future__ import annotations

import math
from pathlib import Path

from robodk.robomath import Pose_2_ABB


def frame(pose: object) -> str:
    """[[x,y,z],[q1,q2,q3,q4]]."""
    x, y, z, *turn = Pose_2_ABB(pose)
    return f"[[{x:.6f},{y:.6f},{z:.6f}],[{','.join(f'{value:.9f}' for value in turn)}]]"


class RobotPost:
    """What RoboDK asks of a post, as far as the test's program needs it."""

    PROG_EXT = "mod"
    PROG_FILES: list[str] | str = []  # noqa: RUF012 - RoboDK's own posts have it so, one list of the class

    def __init__(self, post: str, robot: str, axes: int = 6, **_: object) -> None:
        self.data: dict[str, str] = {}
        self.moves: list[str] = []
        self.speed = "v50"

    def ProgStart(self, name: str) -> None:
        self.name = name

    def ProgFinish(self, name: str) -> None: ...

    def setFrame(self, pose: object, *_: object) -> None:
        self.data["wobjdata wPart"] = f'[FALSE,TRUE,"",{frame(pose)},[[0,0,0],[1,0,0,0]]]'

    def setTool(self, pose: object, *_: object) -> None:
        self.data["tooldata tMill"] = f"[TRUE,{frame(pose)},[80,[0,0,120],[1,0,0,0],0,0,0]]"

    def setSpeed(self, mm_s: float) -> None:
        self.speed = f"v{mm_s:g}"

    def MoveL(self, pose: object, joints: list[float], conf: list[int]) -> None:
        quarter = [math.floor(joints[k] / 90) for k in (0, 3, 5)]
        conf_data = ",".join(map(str, [*quarter, 4 * conf[0] + 2 * conf[1] + conf[2]]))
        inner = frame(pose)[1:-1]
        self.moves.append(f"    MoveL [{inner},[{conf_data}],[9E9,9E9,9E9,9E9,9E9,9E9]],{self.speed},z1,tMill\\WObj:=wPart;")

    def ProgSave(self, folder: str, name: str, ask_user: bool = False, show_result: bool = False) -> None:
        data = [f"PERS {kind}:={value};" for kind, value in self.data.items()]
        file = Path(folder) / f"{name}.{self.PROG_EXT}"
        file.write_text("\n".join([f"MODULE MOD_{name}", *data, f"PROC {name}()", *self.moves, "ENDPROC", "ENDMODULE"]) + "\n")
        print(f"SAVED: {file}")
        self.PROG_FILES = str(file)
