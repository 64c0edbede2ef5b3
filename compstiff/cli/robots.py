"""`compstiff robots`: the built-in robots."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compstiff.cli.console import command
from compstiff.outcome import Outcome, Session

if TYPE_CHECKING:
    pass


@command("robots")
def robots(session: Session) -> Outcome:
    """List the built-in robots."""
    import numpy as np

    from compstiff import built_in_robots
    from identification.model.robot import read_robot

    listed, lines = [], [f"{'name':<22}{'reach':>9}  {'springs':<8}{'prior k1 ... k6 [1e6 N m/rad]'}"]
    for name, path in built_in_robots().items():
        robot = read_robot(path)
        reach = robot.a[1] + robot.a[2] + float(np.hypot(robot.a[3], robot.d[3]))
        prior = robot.prior.stiffness
        listed.append({"name": name, "manufacturer": robot.manufacturer, "load_path": robot.load_path,
                       "reach_mm": 1e3 * reach, "stiffness_nm_per_rad": prior.tolist(), "file": str(path)})
        lines.append(f"{name:<22}{1e3 * reach:>6.0f} mm  {robot.load_path:<8}" + "  ".join(f"{k / 1e6:.2f}" for k in prior))
    return Outcome({"robots": listed}, lines=lines,
                   next_step="write cell.yaml (robot, tool), then compstiff identify cell.yaml measurements.csv")
