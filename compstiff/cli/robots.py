"""`compstiff robots`: the built-in robots; and a robot file held against its data sheet."""

from __future__ import annotations

from pathlib import Path

import click

from compstiff.cli.console import READABLE, command
from compstiff.outcome import DONE, REFUSED, Outcome, Session, call


@command("robots", examples=("compstiff robots --check my_robot.yaml",))
@click.option("--check", "file", type=READABLE, metavar="FILE",
              help="Hold a robot file against itself and against what its data sheet states.")
def robots(session: Session, file: Path | None) -> Outcome:
    """List the built-in robots, or check a robot file.

    --check looks at units, axes, limits, the inverse kinematics, the reach and the poses that the data sheet states, and at
    what names no source. Exit code 3 where something in the file is wrong.
    """
    return _listed() if file is None else _checked(session, file)


def _listed() -> Outcome:
    from compstiff import built_in_robots
    from identification.common.yaml_source import read_yaml
    from identification.model.reach import reach
    from identification.model.robot import read_robot
    from identification.model.robot_file import RobotFile

    listed, lines = [], [f"{'name':<20}{'maker':<8}{'reach':>9}{'payload':>9}  springs"]
    for name, path in built_in_robots().items():
        robot, described = read_robot(path), read_yaml(path, RobotFile)
        far, payload = 1e3 * reach(robot), described.data_sheet.payload_kg
        listed.append({"name": name, "manufacturer": robot.manufacturer, "load_path": robot.load_path, "reach_mm": far,
                       "stated_reach_mm": described.data_sheet.reach_mm, "payload_kg": payload,
                       "stiffness_nm_per_rad": robot.prior.stiffness.tolist(), "sources": described.sources.model_dump(),
                       "file": str(path)})
        carried = "" if payload is None else f"{payload:g} kg"
        lines.append(f"{name:<20}{robot.manufacturer:<8}{far:>6.0f} mm{carried:>9}  {robot.load_path}")
    lines += ["", "reach: the wrist centre's largest distance from axis 1 inside the limits; every number's source: --json"]
    return Outcome({"robots": listed}, lines=lines,
                   next_step="compstiff init my-cell begins a cell with one of them; a robot that is not here: "
                   "docs/robots.md")


def _checked(session: Session, file: Path) -> Outcome:
    from compstiff import check_robot

    session.inputs.append(file)
    check = check_robot(file)
    following = f"put robot: {file} into cell.yaml, then " + call("identify", "cell.yaml", "measurements.csv")
    return Outcome(check.as_dict(), check.findings, check.lines(), next_step=following if check.sound else "",
                   exit_code=DONE if check.sound else REFUSED)
