"""Which program a robot's controller runs: RAPID is ABB's, and no other maker's robot is driven by it."""

from __future__ import annotations

from identification.common.command_line import call
from identification.common.findings import error
from identification.model.robot import RobotModel

RAPID_MAKERS = ("", "ABB")          # "": a robot file that names no maker is taken at its user's word


def runs_rapid(robot: RobotModel) -> bool:
    """Whether a corrected program can be written for this robot."""
    return robot.manufacturer.strip().upper() in RAPID_MAKERS


def use_of_stiffnesses(
    robot: RobotModel, cell_file: object, stiffness_file: object, *more: object, report: bool = False
) -> str:
    """The call that stiffnesses are identified for: a program corrected, or, where the controller runs no RAPID, a path of
    another kind predicted. more: options in place of the log's."""
    log = more or ("--forces", "PART.forces.csv")
    if runs_rapid(robot):
        return call("correct", cell_file, "PART.mod", "--stiffness", stiffness_file, *log, "-o", "PART_corrected.mod",
                    *(("--report", "correct.html") if report else ()))
    return call("predict", cell_file, "PART.cls", "--stiffness", stiffness_file, *log, "-o", "PART.deviation.csv",
                *(("--report", "predict.html") if report else ()))


def check_rapid(robot: RobotModel, doing: str, file: str | None = None) -> None:
    """Raises CompstiffError (CS0060) where the robot's controller does not run RAPID. doing: what wants it; file: where."""
    if not runs_rapid(robot):
        raise error("CS0060", f"{doing}: RAPID runs on ABB controllers, the cell's robot {robot.name} is made by "
                    f"{robot.manufacturer}", file=file or str(robot.source),
                    hint="name the ABB robot that runs it as robot: in cell.yaml; for other makers identify, diagnose, design "
                    "without --rapid, and predict of an APT file or a table")
