"""Makes the files of this folder again: `python -m samples.make_samples` in a checkout with the extra `samples`.

Everything is simulated. The load tests and the truth behind them come from `tests/virtual_cell/arm.py`, an arm that shares
no physics code with the program; the toolpath is opencamlib's (`cam.py`), the forces are a milling model's (`cutting.py`).
"""

from __future__ import annotations

from pathlib import Path

import jinja2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from identification.model.cell import read_cell
from identification.model.inverse import configuration, inverse, nearest_solution
from identification.model.rotations import Frame
from samples import cam, cutting, part
from tests.virtual_cell.arm import IRB6660

HERE = Path(__file__).parent
SEED = 6660
# The robot behind the sample. Made up: each within a factor 2 of the paper's Table 1, which is the prior.
TRUE_STIFFNESS = np.array([1.55e6, 4.10e6, 1.35e6, 0.36e6, 0.19e6, 0.11e6])
LOAD_CYCLE_N = (0, 100, 200, 300, 0, -150, -300)
SENSOR_STD_UM, RESEATING_STD_UM, FORCE_RELATIVE = 2.0, 3.0, 0.005
# The insert's fixture on the table, in the base frame.
FIXTURE_MM, FIXTURE_QUATERNION = (1050.0, -70.0, 620.0), (0.99965732, 0.0, 0.0, 0.02617695)
CELL = """\
# The cell of the sample: an IRB 6660 with a milling spindle. Simulated; samples/README.md says how.
robot: irb6660-205-1.90
tool:
  position_mm: [120, 0, 250]       # beside axis 6, so that forces turn it and k6 can be seen
  quaternion: [1, 0, 0, 0]
measurement:
  deflection_std_um: [2, 2, 2]
  force_relative_std: 0.005
  pose_offset_std_um: [3, 3, 3]    # re-seating of the target between poses
force_log:
  frame: tool                      # the sensor sits behind the spindle, its payload is compensated, its bias is not
  sign: on_tool
  spindle_rpm: 9000
cutting: {material: aluminium, tool_diameter_mm: 16, contact_mm: 1}    # roughing left 0.3 to 1.5 mm
limits: {max_offset_mm: 2.0, max_tilt_deg: 0.5}
"""


def measurements(cell_file: Path, rng: np.random.Generator) -> str:
    """Load tests: 12 poses to identify and 4 to validate, a load cycle along one base axis each."""
    robot = read_cell(cell_file).robot
    low, high = np.radians([[-40, -20, 0, -80, 30, -120], [40, 45, 50, 80, 100, 120]])
    tcp = 1e-3 * np.array([120.0, 0, 250])
    names = [*(f"q{i}_deg" for i in range(1, 7)), "fx_n", "fy_n", "fz_n", "dx_um", "dy_um", "dz_um", "time_s", "dwell_s",
             "pose", "purpose"]
    lines = ["# Simulated load tests: loaded minus unloaded TCP, base frame", ",".join(names)]
    time, number = 0.0, 0
    while number < 16:
        theta = np.round(rng.uniform(low, high), 4)
        if robot.limit_excess(theta[None]).any():
            continue
        offset = RESEATING_STD_UM * rng.standard_normal(3)
        time += 180
        for load in LOAD_CYCLE_N:
            force = np.zeros(3)
            force[number % 3] = load
            applied = force * (1 + FORCE_RELATIVE * rng.standard_normal())
            deviation, _ = IRB6660.deviation(theta, tcp, np.concatenate([applied, np.zeros(3)]), TRUE_STIFFNESS)
            reading = 1e6 * deviation + offset + SENSOR_STD_UM * rng.standard_normal(3)
            time += 20
            lines.append(",".join([
                *(f"{x:.6f}" for x in np.degrees(theta)), *(f"{x:g}" for x in force), *(f"{x:.1f}" for x in reading),
                f"{time:g}", "10", f"P{number + 1}", "identify" if number < 12 else "validate"]))
        number += 1
    return "\n".join(lines) + "\n"


def program(path: cam.CutterPath, cell_file: Path) -> str:
    """The toolpath as RAPID, the way a CAM system posts it, with the robot's configuration at each target."""
    cell = read_cell(cell_file)
    position = np.round(path.position_mm, 4)
    quaternion = np.round(cam.tool_quaternion(path.tool_axis, (-1.0, 0.0, 0.0)), 8)
    base_from_object = Frame.from_quaternion(1e-3 * np.array(FIXTURE_MM), FIXTURE_QUATERNION)
    flange = base_from_object @ Frame.from_quaternion(1e-3 * position, quaternion) @ cell.flange_from_tcp.inverse()
    solutions = inverse(cell.robot, flange)
    theta, branch = nearest_solution(cell.robot, solutions, np.radians(np.tile([0.0, 0, 40, 0, 50, 0], (len(path), 1))))
    assert (branch == 0).all()
    assert not cell.robot.limit_excess(theta).any()
    confdata = configuration(cell.robot, theta)
    rows = []
    before = -1
    for i in range(len(path)):
        row = {
            "kind": "MoveJ" if i == 0 else "MoveL", "position": position[i], "quaternion": quaternion[i],
            "confdata": confdata[i].tolist(), "speed": f"v{path.feed_mm_s[i]:g}cut", "zone": "z0",
        }
        if path.rapid[i]:
            row |= {"speed": "vAir", "zone": "z5"}
        if path.pass_index[i] != before:
            before = int(path.pass_index[i])
            row["comment"] = [path.passes[before]]
        rows.append(row)
    feeds = np.unique(path.feed_mm_s[~path.rapid])
    environment = jinja2.Environment(trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
                                     undefined=jinja2.StrictUndefined)
    template = environment.from_string((HERE.parent / "rapid_templates" / "milling_program.mod.j2").read_text())
    text = template.render(
        module="Insert", header=True, comments=["Mould insert, semi-finishing with a 16 mm ball mill", "Toolpath: opencamlib"],
        tool={"name": "tSpindle", "position": (120.0, 0.0, 250.0), "quaternion": (1.0, 0.0, 0.0, 0.0), "mass": 80,
              "cog": (0, 0, 120)},
        wobj={"name": "wInsert", "oframe": {"position": FIXTURE_MM, "quaternion": FIXTURE_QUATERNION}},
        speeds=[{"name": "vAir", "tcp": f"{cam.FEED_RAPID_MM_S:g}"},
                *({"name": f"v{feed:g}cut", "tcp": f"{feed:g}"} for feed in feeds)], rows=rows,
        spindle={"on_signal": "doSpindle", "speed_signal": "goSpindleRpm", "speed": 9000, "delay_s": 5})
    return text.replace("\n", "\r\n")


def force_table(path: cam.CutterPath, cell_file: Path, rng: np.random.Generator) -> pa.Table:
    """The log of the pass: time, TCP in the work object, force on the tool in the tool frame as the sensor gives it."""
    log = cutting.force_log(path, part.allowance_mm, stock=part.is_stock)
    quaternion = cam.tool_quaternion(path.tool_axis, (-1.0, 0.0, 0.0))
    object_from_tool = Frame.from_quaternion(np.zeros((len(path), 3)), quaternion)
    turned = Frame(object_from_tool.rotation[log.target], np.zeros((len(log.target), 3))).inverse().turn(log.force_n)
    reading = cutting.sensor(turned, rng)
    where = log.position_mm + 0.02 * rng.standard_normal(log.position_mm.shape)
    columns = {"time_s": np.round(log.time_s, 6)}
    columns |= {f"{axis}_mm": np.round(where[:, i], 2).astype(np.float32) for i, axis in enumerate("xyz")}
    columns |= {f"f{axis}_n": reading[:, i].astype(np.float32) for i, axis in enumerate("xyz")}
    return pa.table(columns)


def main() -> None:
    """Writes the sample files beside this script."""
    rng = np.random.default_rng(SEED)
    cell_file = HERE / "cell.yaml"
    cell_file.write_text(CELL)
    (HERE / "measurements.csv").write_text(measurements(cell_file, rng))
    triangles = part.mesh()
    (HERE / "insert.stl").write_bytes(part.stl_bytes(triangles))
    path = cam.sample_path(triangles)
    (HERE / "insert.mod").write_bytes(program(path, cell_file).encode("ascii"))
    pq.write_table(force_table(path, cell_file, rng), HERE / "insert.forces.parquet", compression="zstd", compression_level=19,
                   use_dictionary=False)


if __name__ == "__main__":
    main()
