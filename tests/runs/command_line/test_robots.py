"""Robots of other makers on the command line: the check of a robot file, the example of docs/robots.md, what RAPID refuses."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identification.model.robot import built_in_robots
from tests.identification.model.urdf_arms import ARMS
from tests.runs.command_line import user_files as kit
from tests.support import compstiff, long

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/robots.md").read_text()
CELL = "robot: {}\ntool: {{position_mm: [100, 0, 200]}}\n"
TOOL = np.array([0.1, 0, 0.2])
STIFFNESS = np.array([1.6e6, 3.1e6, 2.4e6, 0.6e6, 0.4e6, 0.12e6])
# Poses in front of the arm, as pendants show them [deg].
POSES = {
    "kr210-r2700-extra": ([0, -75, 100, 20, 60, 30], [35, -95, 115, -40, -50, -60], [-50, -60, 90, 60, 70, 10],
                          [15, -110, 130, 10, -70, 90], [-20, -85, 80, -30, 45, -120], [60, -70, 120, 80, -60, 45]),
    "r2000ic-210f": ([0, -10, -20, 20, 60, 30], [35, 20, -45, -40, -50, -60], [-50, 40, -10, 60, 70, 10],
                     [15, -20, 5, 10, -70, 90], [-20, 5, -50, -30, 45, -120], [60, 30, -30, 80, -60, 45]),
}


def tcp(name: str, degrees: np.ndarray) -> np.ndarray:
    """By the URDF's own chain."""
    position, rotation = ARMS[name].flange(degrees)
    return np.asarray(position + rotation @ TOOL)


def deflection(name: str, degrees: np.ndarray, force: np.ndarray) -> np.ndarray:
    """The TCP's shift [m] of the arm with a spring at each serial axis, at equilibrium, by differences of the URDF's chain."""
    chain = ARMS[name]
    couple = np.eye(6)
    couple[2, 1] = -1.0 if chain.interlocked else 0.0      # a serial turn of axis 2 alone moves the pendant's J3 too
    step, turned = 1e-4, np.zeros(6)
    for _ in range(12):
        here = degrees + np.degrees(couple @ turned)
        moved = np.array([tcp(name, here + np.degrees(couple[:, j] * step)) - tcp(name, here - np.degrees(couple[:, j] * step))
                          for j in range(6)]) / (2 * step)
        turned = moved @ force / STIFFNESS
    return tcp(name, degrees + np.degrees(couple @ turned)) - tcp(name, degrees)


@pytest.mark.parametrize("name", ["kr210-r2700-extra", long("r2000ic-210f")])
def test_another_makers_robot_is_identified_from_its_own_angles(name: str, tmp_path: Path) -> None:
    """Load tests made with the URDF's chain, angles as the pendant shows them: the stiffnesses come back."""
    rng, rows = np.random.default_rng(21), ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um,pose"]
    for number, pose in enumerate(POSES[name]):
        for force in 300 * np.vstack([np.eye(3), -np.eye(3)]):
            shift = 1e6 * deflection(name, np.array(pose, dtype=float), force) + rng.normal(0, 1.0, 3)
            rows.append(",".join(f"{x:.4f}" for x in (*pose, *force, *shift)) + f",{number}")
    stated = "measurement: {deflection_std_um: [1, 1, 1], force_std_n: [0.1, 0.1, 0.1], pose_offset_std_um: [1, 1, 1]}\n"
    (tmp_path / "cell.yaml").write_text(CELL.format(name) + stated)
    (tmp_path / "m.csv").write_text("\n".join(rows) + "\n")
    done = compstiff("identify", "cell.yaml", "m.csv", "-o", "stiffness.json", "--report", "r.html", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads((tmp_path / "stiffness.json").read_text())
    estimates = np.array([each["estimate"] for each in found["parameters"][:6]])
    stds = np.array([each["std"] for each in found["parameters"][:6]])
    assert np.all(np.abs(estimates / STIFFNESS - 1) < 0.05), estimates / STIFFNESS
    assert np.all(np.abs(estimates - STIFFNESS) < 4 * stds)
    # No RAPID runs on this robot.
    assert "compstiff predict cell.yaml PART.cls" in re.sub(r"<[^>]+>", "", (tmp_path / "r.html").read_text(encoding="utf-8"))


def cell_and_files(folder: Path, robot: str) -> None:
    (folder / "cell.yaml").write_text(
        CELL.format(robot) + "workobject: {position_mm: [1500, 0, 900], quaternion: [1, 0, 0, 0]}\n")
    rows = [f"{x},{0},{0},0,0,1,0,20,0" for x in range(0, 100, 10)]
    (folder / "path.csv").write_text("x_mm,y_mm,z_mm,q1,q2,q3,q4,feed_mm_s,rapid\n" + "\n".join(rows) + "\n")
    (folder / "path.forces.csv").write_text("target,fx_n,fy_n,fz_n\n" + "\n".join(f"{n},60,90,-120" for n in range(10)) + "\n")
    (folder / "offsets.csv").write_text("target,ox_mm,oy_mm,oz_mm\n0,0.1,0,0\n")
    (folder / "part.mod").write_bytes((ROOT / "samples/insert.mod").read_bytes())
    parameters = [{"name": f"k{j + 1}", "unit": "N*m/rad", "estimate": float(k), "std": 0.02 * float(k),
                   "interval_95": [0.9 * k, 1.1 * k], "grade": "reliable"} for j, k in enumerate(STIFFNESS)]
    covariance = np.diag((0.02 * STIFFNESS) ** 2).tolist()
    (folder / "stiffness.json").write_text(json.dumps({
        "format": "compstiff-stiffness", "version": 1, "robot": robot, "load_path": "serial", "parameters": parameters,
        "covariance": covariance}))


MODEL = ["--stiffness", "stiffness.json", "--forces", "path.forces.csv"]
RAPID = {
    "predict of a RAPID program": ["predict", "cell.yaml", "part.mod", *MODEL, "-o", "out.csv"],
    "correct of a RAPID program": ["correct", "cell.yaml", "part.mod", *MODEL, "-o", "out.mod"],
    "predict with a budget": ["predict", "cell.yaml", "path.csv", *MODEL, "-o", "out.csv", "--budget", "--tolerance-um", "100"],
    "correct of a table": ["correct", "cell.yaml", "path.csv", *MODEL, "--tare", "0:1", "--trust-tare", "-o", "out.mod"],
    "post": ["post", "cell.yaml", "path.csv", "-o", "out.mod"],
    "design --rapid": ["design", "cell.yaml", "-o", "plan.csv", "--measurements", "2", "--quick", "--rapid", "out.mod"],
    "upload": ["upload", "cell.yaml", "part.mod", "--host", "127.0.0.1", "--port", "9"],
    "push --receiver": ["push", "cell.yaml", "offsets.csv", "--receiver", "out.mod"],
}


@pytest.mark.parametrize("robot", ["kr210-r2700-extra", "r2000ic-210f"])
@pytest.mark.parametrize("call", RAPID.values(), ids=list(RAPID))
def test_rapid_is_refused_for_another_makers_robot(
    call: list[str], robot: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COMPSTIFF_CONTROLLER_PASSWORD", "of upload")
    cell_and_files(tmp_path, robot)
    before = {path.name for path in tmp_path.iterdir()}
    done = compstiff(*call, "--json", cwd=tmp_path)
    document = json.loads(done.stdout)
    assert done.returncode == 1, done.stdout
    assert [finding["code"] for finding in document["findings"]] == ["CS0060"], document["findings"]
    assert robot in document["findings"][0]["message"]
    assert {path.name for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("name", sorted(POSES))
def test_a_table_is_predicted_for_another_makers_robot(name: str, tmp_path: Path) -> None:
    """The deviation is the one that the URDF's own chain has under the same force, at the pendant's angles in the table."""
    cell_and_files(tmp_path, name)
    force = np.array([60.0, 90, -120])
    poses = np.array(POSES[name][0]) + np.outer(np.arange(10), [0.4, 0.2, -0.3, 0.5, 0.3, 0.4])
    rows = ["x_mm,y_mm,z_mm,q1,q2,q3,q4,feed_mm_s," + ",".join(f"q{j}_deg" for j in range(1, 7))]
    for pose in poses:
        place = 1e3 * tcp(name, pose) - [1500, 0, 900]
        x, y, z, w = Rotation.from_matrix(ARMS[name].flange(pose)[1]).as_quat()
        rows.append(",".join(f"{value:.9g}" for value in (*place, w, x, y, z, 20, *pose)))
    (tmp_path / "path.csv").write_text("\n".join(rows) + "\n")
    done = compstiff("predict", "cell.yaml", "path.csv", *MODEL, "-o", "out.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    assert "compstiff correct" not in done.stderr
    found = np.array([[float(row[key]) for key in ("dx_um", "dy_um", "dz_um")] for row in kit.table(tmp_path / "out.csv")])
    wanted = 1e6 * np.array([deflection(name, pose, force) for pose in poses])
    assert np.linalg.norm(wanted, axis=1).min() > 50
    np.testing.assert_allclose(found, wanted, atol=0.05)


@pytest.mark.parametrize(("share", "said"), [(0.02, False), (1.0, True)])
def test_a_prediction_that_is_mostly_unknown_says_so_first(share: float, said: bool, tmp_path: Path) -> None:
    """As where no load test reached a joint, and the stiffness is what the robot file says."""
    cell_and_files(tmp_path, "kr210-r2700-extra")
    model = json.loads((tmp_path / "stiffness.json").read_text())
    model["covariance"] = np.diag((share * STIFFNESS) ** 2).tolist()
    (tmp_path / "stiffness.json").write_text(json.dumps(model))
    done = compstiff("predict", "cell.yaml", "path.csv", *MODEL, "-o", "out.csv", "--report", "out.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert ("NOT KNOWN WELL" in (tmp_path / "out.html").read_text()) == said


def test_a_plan_is_made_for_another_makers_robot(tmp_path: Path) -> None:
    name = "kr210-r2700-extra"
    cell_and_files(tmp_path, name)
    plan = compstiff("design", "cell.yaml", "-o", "plan.csv", "--measurements", "2", "--axes", "z", "--quick", "--json",
                      cwd=tmp_path)
    assert plan.returncode == 0, plan.stdout
    rows = [line for line in (tmp_path / "plan.csv").read_text().splitlines() if not line.startswith("#")]
    angles = np.array([[float(x) for x in row.split(",")[:6]] for row in rows[1:]])
    low, high = np.array([[-185, 185], [-140, -5], [-120, 155], [-350, 350], [-125, 125], [-350, 350]], dtype=float).T
    assert len(angles) > 4
    assert ((angles > low) & (angles < high)).all()
    # The arm reaches to the front in most of what can be planned: A2 and A3 are counted as on the pendant.
    assert all(np.hypot(*tcp(name, pose)[:2]) > 0.5 for pose in angles)


def test_the_page_s_example_runs(tmp_path: Path) -> None:
    """docs/robots.md: the file, both calls, and every line shown."""
    text = re.search(r"```yaml\n(name: my-kr210.*?)```", PAGE, re.S)
    shown = re.findall(r"```\n\$ compstiff (robots --check my_robot\.yaml)\n(.*?)```", PAGE, re.S)
    assert text
    assert len(shown) == 2
    wrong = text[1]
    right = wrong.replace("offset_deg: 0,   sense: 1,  limits_deg: [-185", "offset_deg: 0,   sense: -1, limits_deg: [-185")
    assert right != wrong
    for content, (call, lines), code in ((wrong, shown[0], 3), (right, shown[1], 0)):
        (tmp_path / "my_robot.yaml").write_text(content)
        done = compstiff(*call.split(), cwd=tmp_path)
        assert done.returncode == code, done.stdout + done.stderr
        printed = (done.stdout + done.stderr).splitlines()
        assert lines.strip()
        for line in lines.strip().splitlines():
            assert line in printed, (line, printed)
    (tmp_path / "cell.yaml").write_text("robot: my_robot.yaml\ntool: {position_mm: [100, 0, 200]}\n")
    plan = compstiff("design", "cell.yaml", "-o", "plan.csv", "--measurements", "1", "--quick", cwd=tmp_path)
    assert plan.returncode == 0, plan.stderr


def test_the_page_s_tables_are_those_of_the_built_in_robots() -> None:
    """sense, offset_deg and coupling of each maker; twists and zeros of the frames."""
    import yaml

    makers = {"ABB": [], "KUKA": [], "FANUC": []}
    for file in built_in_robots().values():
        robot = yaml.safe_load(re.sub(r"(\d)e(\d)", r"\1e+\2", file.read_text()))
        makers[robot["manufacturer"]].append(robot)
    for maker, robots in makers.items():
        row = re.search(rf"^\| {maker}: [^|]*\| ([-\d ]+) \| ([-\d ]+) \|", PAGE, re.M)
        assert row
        for robot in robots:
            joints = robot["joints"]
            assert [joint.get("sense", 1) for joint in joints] == [int(x) for x in row[1].split()]
            assert [joint["offset_deg"] for joint in joints] == [int(x) for x in row[2].split()]
            assert [joint["alpha_deg"] for joint in joints] == [0, -90, 0, -90, 90, -90]
            assert [joints[k]["a_mm"] for k in (0, 4, 5)] == [0, 0, 0]
            assert [joints[k]["d_mm"] for k in (1, 2, 4)] == [0, 0, 0]
            assert robot.get("coupling", {}).get("rod", True) == (maker != "FANUC")


def test_robots_are_listed_with_maker_reach_payload_and_sources() -> None:
    listed = json.loads(compstiff("robots", "--json").stdout)["result"]["robots"]
    assert {robot["name"] for robot in listed} == set(built_in_robots())
    for robot in listed:
        assert robot["payload_kg"] > 0
        assert 1900 < robot["reach_mm"] < 4000
        assert all(robot["sources"][key] for key in ("geometry", "limits", "speed", "acceleration", "prior", "data_sheet"))
    told = compstiff("robots").stdout
    assert all(re.search(rf"^{re.escape(robot['name'])} +{robot['manufacturer']} ", told, re.M) for robot in listed)


def test_exit_codes_of_the_check(tmp_path: Path) -> None:
    text = built_in_robots()["kr60-ha"].read_text()
    for name, content, code, status in (
            ("sound", text, 0, "ok"), ("wrong", text.replace("a_mm: 850", "a_mm: 950"), 3, "refused"),
            ("warned", text.partition("poses:")[0], 0, "ok"), ("no file of this kind", "robot: x\n", 1, "failed")):
        path = tmp_path / f"{name.replace(' ', '_')}.yaml"
        path.write_text(content)
        done = compstiff("robots", "--check", path, "--json")
        document = json.loads(done.stdout)
        assert (done.returncode, document["status"]) == (code, status), done.stdout
        assert document["inputs"][0]["file"] == str(path)
    assert compstiff("robots", "--check", tmp_path / "missing.yaml").returncode == 2
