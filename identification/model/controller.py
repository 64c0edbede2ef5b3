"""Which program a robot's controller runs: RAPID is ABB's, and no other maker's robot is driven by it."""

from __future__ import annotations

from identification.common.findings import error
from identification.model.robot import RobotModel

RAPID_MAKERS = ("", "ABB")          # "": a robot file that names no maker is taken at its user's word


def check_rapid(robot: RobotModel, doing: str, file: str | None = None) -> None:
    """Raises CompstiffError (CS0060) where the robot's controller does not run RAPID. doing: what wants it; file: where."""
    if robot.manufacturer.strip().upper() not in RAPID_MAKERS:
        raise error("CS0060", f"{doing}: RAPID runs on ABB controllers, the cell's robot {robot.name} is made by "
                    f"{robot.manufacturer}", file=file or str(robot.source),
                    hint="name the ABB robot that runs it as robot: in cell.yaml; for other makers identify, diagnose, design "
                    "without --rapid, and predict of an APT file or a table")
