"""identify: measurements from the independent arm in every spelling the contract allows; what it writes; what it refuses."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from identification.model.robot import built_in_robots
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import IRB6660, Frame, K, Run
from tests.virtual_cell.arm import IRB6700

TOOL = Frame.mm([120.0, 30.0, 250.0])
CELL = kit.cell_text(tool=TOOL, base=None, extra="measurement: {deflection_std_um: [1, 1, 1]}\n")
JOINTS = [f"q{i}_deg" for i in range(1, 7)]
FORCES, MOMENTS, READINGS = ["fx_n", "fy_n", "fz_n"], ["mx_nm", "my_nm", "mz_nm"], ["dx_um", "dy_um", "dz_um"]
PLAIN = [*JOINTS, *FORCES, *READINGS]
SIGMA = 1.0  # um


@dataclass(frozen=True)
class Data:
    """Rows of measurements as columns of numbers."""

    columns: dict[str, np.ndarray]

    def rows(self, names: list[str]) -> list[list[object]]:
        return [list(r) for r in zip(*(self.columns[n] for n in names), strict=True)]

    def text(
        self,
        names: list[str] = PLAIN,
        separator: str = ",",
        point: str = ".",
        more: dict[str, list[object]] | None = None,
        swap: dict[tuple[int, str], object] | None = None,
    ) -> str:
        more, swap = more or {}, swap or {}
        out = [separator.join([*names, *more])]
        for i, row in enumerate(self.rows(names)):
            cells = [swap.get((i, n), v) for n, v in zip(names, row, strict=True)] + [
                swap.get((i, n), more[n][i]) for n in more
            ]
            out.append(separator.join(f"{c:.7f}".replace(".", point) if isinstance(c, float) else str(c) for c in cells))
        return "\n".join(out) + "\n"


def measured(arm: kit.Arm = IRB6660, seed: int = 4, moments: bool = False, noise: float = SIGMA) -> Data:
    rng = np.random.default_rng(seed)
    low, high = np.array([-60, -20, 0, -90, 20, -90.0]), np.array([60, 40, 50, 90, 90, 90.0])
    q, w, d = [], [], []
    for _ in range(12):
        joints = np.radians(rng.uniform(low, high))
        for axis in np.eye(3):
            load = np.r_[axis * 300, rng.uniform(-40, 40, 3) * moments]
            q.append(np.degrees(joints))
            w.append(load)
            d.append(kit.deviation(arm, joints, TOOL.p, load, K) * 1e6 + rng.normal(0, noise, 3))
    table = np.concatenate([q, w, d], axis=1)
    return Data(dict(zip([*JOINTS, *FORCES, *MOMENTS, *READINGS], table.T.copy(), strict=True)))


@pytest.fixture(scope="module")
def data() -> Data:
    return measured()


def identify(folder: Path, text: str | bytes, *more: object, cell: str = CELL, name: str = "m.csv") -> Run:
    (folder / "cell.yaml").write_text(cell)
    (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return kit.run("identify", folder / "cell.yaml", folder / name, "-o", folder / "s.json", *more)


def stiffness(folder: Path) -> dict:
    def refuse(word: str) -> None:
        raise AssertionError(word)

    return json.loads((folder / "s.json").read_text(), parse_constant=refuse)


def weightless(folder: Path, robot: str | None = None, name: str = "mine.yaml") -> str:
    """A cell whose robot file, the shipped one or this text, says that the arm weighs nothing: what an unknown weight may do is
    no part of `posterior`."""
    (folder / "robots").mkdir()
    shipped = built_in_robots()["irb6660-205-1.90"].read_text()
    links = "links:\n" + "  - {mass_kg: 0, centre_of_mass_mm: [0, 0, 0]}\n" * 6
    (folder / "robots" / name).write_text((robot or shipped) + links)
    return CELL.replace("irb6660-205-1.90", f"robots/{name}")


def posterior(data: Data, arm: kit.Arm = IRB6660, columns: list[str] | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Median of k and covariance of log k, worked out again: Gauss-Newton in log c with the prior of cell.yaml's default."""
    prior = np.array([2.03e6, 6.02e6, 1.91e6, 0.45e6, 0.22e6, 0.07e6])
    weight = np.eye(6) / np.log(1 + 2.0**2)
    names = [*JOINTS, *FORCES, *(MOMENTS if columns else [])]
    q, w = np.radians(np.array(data.rows(JOINTS), dtype=float)), np.array(data.rows(names[6:]), dtype=float)
    d = np.array(data.rows(READINGS), dtype=float).ravel()
    w = np.pad(w, ((0, 0), (0, 6 - w.shape[1])))

    def predicted(k: np.ndarray) -> np.ndarray:
        return kit.deviation(arm, q, TOOL.p, w, k).ravel() * 1e6

    x = -np.log(K)
    for _ in range(3):
        base = predicted(np.exp(-x))
        slope = np.array([(predicted(np.exp(-(x + 1e-4 * e))) - base) / 1e-4 for e in np.eye(6)]).T / SIGMA
        precision = slope.T @ slope + weight
        x = x + np.linalg.solve(precision, slope.T @ (d - base) / SIGMA + weight @ (-np.log(prior) - x))
    return np.exp(-x), np.linalg.inv(precision)


def test_stiffnesses_are_the_posterior_s(tmp_path: Path, data: Data) -> None:
    result = identify(tmp_path, data.text(), "--json", cell=weightless(tmp_path))
    assert result.code == 0, result
    s = stiffness(tmp_path)
    k, cov = posterior(data)
    found = np.array([p["estimate"] for p in s["parameters"]])
    std = np.array([p["std"] for p in s["parameters"]])
    expected = k * np.sqrt(np.diag(cov))
    assert np.all(np.abs(found - k) < 0.5 * expected), (found, k)
    np.testing.assert_allclose(std, expected, rtol=0.3)  # the noise is estimated anew
    assert np.all(np.abs(found - K) < 4 * std)
    own = result.json["result"]
    assert own["parameters"] == s["parameters"]


def test_stiffness_json_by_the_contract(tmp_path: Path, data: Data) -> None:
    assert identify(tmp_path, data.text()).code == 0
    s = stiffness(tmp_path)
    assert (s["format"], s["version"], s["robot"], s["load_path"]) == ("compstiff-stiffness", 1, "irb6660-205-1.90", "drive")
    assert len(s["robot_sha256"]) == 64
    assert s["tool"] == {"position_mm": [120.0, 30.0, 250.0], "quaternion": [1.0, 0.0, 0.0, 0.0]}
    assert [p["name"] for p in s["parameters"]] == ["k1", "k2", "k3", "k4", "k5", "k6"]
    assert {p["unit"] for p in s["parameters"]} == {"N*m/rad"}
    assert s["effects"] == []
    fit = s["fit"]
    assert fit["rows"] == 36
    assert fit["residual_rms_um"] == pytest.approx(SIGMA, rel=0.25)
    assert fit["dof"] == 36 * 3 - 6
    assert fit["chi2"] == pytest.approx(fit["dof"], rel=0.4)
    k = np.array([p["estimate"] for p in s["parameters"]])
    mean, logcov = np.array(s["log_compliance"]["mean"]), np.array(s["log_compliance"]["covariance"])
    np.testing.assert_allclose(np.exp(-mean), k, rtol=1e-6)
    cov = np.array(s["covariance"])
    np.testing.assert_allclose(cov, cov.T, rtol=1e-9, atol=1e-6 * np.sqrt(np.outer(np.diag(cov), np.diag(cov))).min())
    assert np.all(np.linalg.eigvalsh(logcov) > 0)
    np.testing.assert_allclose(
        cov, logcov * np.outer(k, k), rtol=0.05, atol=0.02 * np.sqrt(np.outer(np.diag(cov), np.diag(cov))).min()
    )
    for p, spread, variance in zip(s["parameters"], np.sqrt(np.diag(logcov)), np.diag(cov), strict=True):
        assert p["std"] == pytest.approx(np.sqrt(variance), rel=1e-6)
        low, high = p["interval_95"]
        np.testing.assert_allclose([low, high], p["estimate"] * np.exp(np.array([-1.96, 1.96]) * spread), rtol=3e-3)


def test_correct_reads_what_identify_wrote(tmp_path: Path, data: Data) -> None:
    from tests.runs.command_line.test_placement import line

    assert identify(tmp_path, data.text()).code == 0
    path = line(3, 10)
    f = np.array([100.0, -150, 80])
    (tmp_path / "job").mkdir()
    job = kit.Job(
        tmp_path / "job",
        program=path.program(),
        forces=f"target,fx_n,fy_n,fz_n\n1,{f[0]},{f[1]},{f[2]}\n",
        stiffness=(tmp_path / "s.json").read_text(),
    )
    result = job.correct()
    assert result.code == 0, result
    k = np.array([p["estimate"] for p in stiffness(tmp_path)["parameters"]])
    plan, command = kit.targets_of(str(job.program))[1], kit.targets_of(job.out.read_text())[1]
    assert kit.lands(command, plan, path.q[1], np.r_[f, 0, 0, 0], k=k)[0] < 0.2e-6


SPELLINGS = {
    "semicolon and decimal comma": lambda d: d.text(separator=";", point=","),
    "tab and decimal comma": lambda d: d.text(separator="\t", point=","),
    "semicolon and point": lambda d: d.text(separator=";"),
    "byte-order mark and CRLF": lambda d: ("\ufeff" + d.text()).replace("\n", "\r\n"),
    "comments": lambda d: "# a; b, c\n" + d.text().replace("\n", "\n# in between\n", 3) + "# end\n",
    "columns in another order": lambda d: d.text(PLAIN[::-1]),
    "no line end at the end": lambda d: d.text().rstrip("\n"),
    "blanks": lambda d: d.text().replace(",", " , "),
    "other columns": lambda d: d.text(more={"operator": ["AB"] * 36}),
    "moments of zero": lambda d: d.text(more={n: [0] * 36 for n in MOMENTS}),
    "sigmas that say the same": lambda d: d.text(more={n: ["1.0"] * 36 for n in ("sx_um", "sy_um", "sz_um")}),
    "everything optional": lambda d: d.text(
        more={
            "time_s": [i * 20 for i in range(36)],
            "reference": ["a"] * 36,
            "pose": [f"P{i // 3}" for i in range(36)],
            "dwell_s": [10] * 36,
            "purpose": ["identify"] * 36,
        }
    ),
}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory, data: Data) -> list[float]:
    folder = tmp_path_factory.mktemp("plain")
    assert identify(folder, data.text()).code == 0
    return [p["estimate"] for p in stiffness(folder)["parameters"]]


@pytest.mark.parametrize("name", sorted(SPELLINGS))
def test_spellings(tmp_path: Path, data: Data, plain: list[float], name: str) -> None:
    result = identify(tmp_path, SPELLINGS[name](data))
    assert result.code == 0, result
    np.testing.assert_allclose([p["estimate"] for p in stiffness(tmp_path)["parameters"]], plain, rtol=1e-6)


def test_parquet(tmp_path: Path, data: Data, plain: list[float]) -> None:
    import pandas as pd

    pd.DataFrame({n: data.columns[n] for n in PLAIN}).to_parquet(tmp_path / "m.parquet")
    result = identify(tmp_path, (tmp_path / "m.parquet").read_bytes(), name="m.parquet")
    assert result.code == 0, result
    np.testing.assert_allclose([p["estimate"] for p in stiffness(tmp_path)["parameters"]], plain, rtol=1e-6)


def test_moments_count(tmp_path: Path) -> None:
    data = measured(moments=True)
    result = identify(tmp_path, data.text([*JOINTS, *FORCES, *MOMENTS, *READINGS]), cell=weightless(tmp_path))
    assert result.code == 0, result
    s = stiffness(tmp_path)
    k, cov = posterior(data, columns=MOMENTS)
    assert np.all(np.abs([p["estimate"] for p in s["parameters"]] - k) < 0.5 * k * np.sqrt(np.diag(cov)))


def test_sigmas_weigh_rows(tmp_path: Path, data: Data) -> None:
    """Rows that are 500 um wrong and say so pull nothing."""
    wrong = {(i, n): float(data.columns[n][i] + 500) for i in range(6) for n in READINGS}
    sigma = ["1000.0" if i < 6 else "1.0" for i in range(36)]
    result = identify(tmp_path, data.text(more={n: list(sigma) for n in ("sx_um", "sy_um", "sz_um")}, swap=wrong))
    assert result.code == 0, result
    s = stiffness(tmp_path)
    for p, k in zip(s["parameters"], K, strict=True):
        assert abs(p["estimate"] - k) < 5 * p["std"]


def test_validate_rows_are_never_fitted(tmp_path: Path, data: Data) -> None:
    purpose = ["validate" if i % 6 == 0 else "identify" for i in range(36)]
    estimates = []
    for shift in (0.0, 300.0):
        swap = {(i, "dx_um"): float(data.columns["dx_um"][i] + shift) for i in range(0, 36, 6)}
        result = identify(tmp_path, data.text(more={"purpose": list(purpose)}, swap=swap), "--force")
        assert result.code == 0, result
        s = stiffness(tmp_path)
        estimates.append([p["estimate"] for p in s["parameters"]])
        assert s["fit"]["rows"] == 30
    assert estimates[0] == estimates[1]


def test_components_not_measured(tmp_path: Path, data: Data) -> None:
    gaps = {(i, READINGS[i % 3]): "" for i in range(36)} | {(i, READINGS[(i + 1) % 3]): "" for i in range(0, 36, 4)}
    result = identify(tmp_path, data.text(swap=gaps), "--json")
    assert result.code == 0, result
    s = stiffness(tmp_path)
    assert s["fit"]["dof"] == 36 * 3 - len(gaps) - 6
    for p, k in zip(s["parameters"], K, strict=True):
        assert abs(p["estimate"] - k) < 4.5 * p["std"]


def test_zero_references_show_drift_and_do_not_hurt(tmp_path: Path, data: Data) -> None:
    text = data.text().splitlines()
    zero = ",".join([f"{data.columns[j][0]:.7f}" for j in JOINTS] + ["0", "0", "0", "0.4", "-0.3", "0.2"])
    result = identify(tmp_path, "\n".join([text[0], zero, *text[1:]]) + "\n")
    assert result.code == 0, result
    for p, k in zip(stiffness(tmp_path)["parameters"], K, strict=True):
        assert abs(p["estimate"] - k) < 4.5 * p["std"]


def test_a_joint_that_cannot_be_seen_is_said(tmp_path: Path) -> None:
    """`a TCP on axis 6 is never turned by a pure force: then k6 cannot be seen, and identify says so`."""
    on_axis = Frame.mm([0.0, 0.0, 250.0])
    rng = np.random.default_rng(1)
    lines = [",".join(PLAIN)]
    for _ in range(8):
        q = np.radians(rng.uniform([-60, -20, 0, -90, 20, -90], [60, 40, 50, 90, 90, 90]))
        for axis in np.eye(3) * 300:
            d = kit.deviation(IRB6660, q, on_axis.p, np.r_[axis, 0, 0, 0], K) * 1e6 + rng.normal(0, 1, 3)
            lines.append(",".join(f"{v:.7f}" for v in (*np.degrees(q), *axis, *d)))
    result = identify(
        tmp_path, "\n".join(lines) + "\n", "--json", cell=CELL.replace("120.0000000000, 30.0000000000", "0.0, 0.0")
    )
    assert result.code == 0, result
    assert any("k6" in f["message"] for f in result.json["findings"]), result
    low, high = stiffness(tmp_path)["parameters"][5]["interval_95"]
    assert high / low > 20


def test_terminal_and_report_tell_the_same_next_step(tmp_path: Path, data: Data) -> None:
    """After good measurements whether springs are all there is; after three rows what to measure, and no correction."""
    for rows, step in ((len(data.text().splitlines()), "diagnose"), (4, "design")):
        folder = tmp_path / step
        folder.mkdir()
        text = "\n".join(data.text().splitlines()[:rows]) + "\n"
        result = identify(folder, text, "--report", str(folder / "r.html"))
        assert result.code == 0, result
        told = re.findall(r"next: (compstiff .*)", result.err)
        page = re.sub(r"<[^>]+>", "", (folder / "r.html").read_text(encoding="utf-8"))
        first = re.findall(r"compstiff (?:diagnose|design|correct) .*?(?=Copy)", page)[0]
        assert told[0].split()[:2] == first.split()[:2] == ["compstiff", step]
        assert "compstiff correct" not in result.err
    assert re.search(r"2 sigma: a factor \d", page)


SERIAL = """\
name: my-robot
manufacturer: made up for tests
load_path: serial
joints:
  - {alpha_deg: 0,   a_mm: 0,    d_mm: 780,    offset_deg: 0,   limits_deg: [-170, 170]}
  - {alpha_deg: -90, a_mm: 320,  d_mm: 0,      offset_deg: -90, limits_deg: [-65, 85]}
  - {alpha_deg: 0,   a_mm: 1125, d_mm: 0,      offset_deg: 0,   limits_deg: [-180, 70]}
  - {alpha_deg: -90, a_mm: 200,  d_mm: 1142.5, offset_deg: 0,   limits_deg: [-300, 300]}
  - {alpha_deg: 90,  a_mm: 0,    d_mm: 0,      offset_deg: 0,   limits_deg: [-130, 130]}
  - {alpha_deg: -90, a_mm: 0,    d_mm: 200,    offset_deg: 180, limits_deg: [-360, 360]}
prior: {stiffness_nm_per_rad: [2.03e6, 6.02e6, 1.91e6, 0.45e6, 0.22e6, 0.07e6], relative_std: 2.0}
"""


def test_a_robot_file_by_path(tmp_path: Path) -> None:
    """Relative to the folder of cell.yaml; its name and load path go into stiffness.json."""
    speed = ", speed_deg_s: 100, acceleration_deg_s2: 400}"
    cell = weightless(tmp_path, SERIAL.replace("]}\n  -", "]" + speed + "\n  -").replace("360]}", "360]" + speed))
    data = measured(IRB6700)
    result = identify(tmp_path, data.text(), cell=cell)
    assert result.code == 0, result
    s = stiffness(tmp_path)
    assert (s["robot"], s["load_path"]) == ("my-robot", "serial")
    k, cov = posterior(data, IRB6700)
    assert np.all(np.abs([p["estimate"] for p in s["parameters"]] - k) < 0.5 * k * np.sqrt(np.diag(cov)))


def test_a_prior_s_width_alone_can_be_set(tmp_path: Path, data: Data) -> None:
    """`prior: optional; default: the robot file's`: the median may be left to the robot file."""
    result = identify(tmp_path, data.text(), cell=CELL + "prior: {relative_std: 1.0}\n")
    assert result.code == 0, result


def test_a_robot_file_with_links(tmp_path: Path, data: Data) -> None:
    """The optional links may be given, comments may stand anywhere."""
    import identification

    built_in = Path(identification.__file__).parent / "model" / "robots" / "irb6660-205-1.90.yaml"
    link = "  - {mass_kg: 500, centre_of_mass_mm: [150, 0, -200]}   # one a joint\n"
    (tmp_path / "r.yaml").write_text(built_in.read_text() + "links:\n" + 6 * link)
    result = identify(tmp_path, data.text(), cell=CELL.replace("irb6660-205-1.90", "r.yaml"))
    assert result.code == 0, result


def identified(folder: Path, springs: np.ndarray) -> Run:
    """What identify says of a robot with these springs (6,), measured to 0.05 um."""
    rng = np.random.default_rng(9)
    lines = [",".join(PLAIN)]
    for row in measured(noise=0).rows(PLAIN):
        q, f = np.radians(np.array(row[:6], dtype=float)), np.array(row[6:9], dtype=float)
        d = kit.deviation(IRB6660, q, TOOL.p, np.r_[f, 0, 0, 0], springs) * 1e6 + rng.normal(0, 0.05, 3)
        lines.append(",".join(f"{v:.7f}" for v in (*np.degrees(q), *f, *d)))
    return identify(folder, "\n".join(lines) + "\n", cell=CELL.replace("[1, 1, 1]", "[0.05, 0.05, 0.05]"))


@pytest.mark.parametrize("factor", [0.1, 0.3, 3.0, 10.0])
def test_robots_far_from_the_prior(tmp_path: Path, factor: float) -> None:
    """The prior is weak (factory values of one robot lie a factor 9 off another source's): the data win."""
    springs = K * factor ** np.array([1, -1, 1, -1, 1, -1])
    result = identified(tmp_path, springs)
    assert result.code == 0, result
    for p, k in zip(stiffness(tmp_path)["parameters"], springs, strict=True):
        assert abs(p["estimate"] - k) < 5 * p["std"] + 0.01 * k


@pytest.mark.parametrize(("factor", "unit"), [
    (1 / 9.80665, "kgf"), (25.4, "mil"), (10.0, "0.01 mm"), (1000.0, "mm")])
def test_one_factor_on_all_joints_is_a_unit(tmp_path: Path, factor: float, unit: str) -> None:
    result = identified(tmp_path, K * factor)
    assert result.code == 1
    assert f"in {unit}, not in" in result.err
    assert "CS1018" in result.err


def test_a_robot_softer_than_its_weak_prior_is_no_unit(tmp_path: Path) -> None:
    """4.4 times: the prior allows that (factory values of one robot lie up to a factor 9 off it), pounds look alike."""
    result = identified(tmp_path, K / 4.44822)
    assert result.code == 0, result
    assert "CS1702" in result.err
    assert "as they would with forces in lbf" in result.err


# ---- refused ---------------------------------------------------------------------------------------------------------------


def refused(folder: Path, result: Run, line: int | None = None, column: int | None = None, says: str = "") -> None:
    assert result.code == 1, result
    errors = [f for f in result.json["findings"] if f["level"] == "error"]
    assert errors
    assert errors[0]["code"].startswith("CS")
    assert Path(errors[0]["file"]).name.startswith("m."), errors
    if line is not None:
        assert errors[0]["line"] == line, errors
    if column is not None:
        assert errors[0]["column"] == column, errors
    assert says in errors[0]["message"] + errors[0]["hint"], errors
    assert not (folder / "s.json").exists()


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("dx_um", "nan", "dx_um"),
        ("dy_um", "inf", "dy_um"),
        ("dz_um", "-Infinity", "dz_um"),
        ("fx_n", "1e999", "fx_n"),
        ("q3_deg", "12 deg", "q3_deg"),
        ("fz_n", "", "fz_n"),
        ("q6_deg", "", "q6_deg"),
        ("dx_um", "--", "dx_um"),
        ("fx_n", "0x10", "fx_n"),
        ("fx_n", "1_000", "fx_n"),
    ],
)
def test_a_cell_that_is_no_number(tmp_path: Path, data: Data, name: str, value: str, says: str) -> None:
    result = identify(tmp_path, data.text(swap={(5, name): value}), "--json")
    refused(tmp_path, result, 7, PLAIN.index(name) + 1, says)


@pytest.mark.parametrize(
    ("swap", "column"),
    [
        ({(5, "q2_deg"): "86"}, 2),
        ({(5, "q3_deg"): "-21"}, 3),
        ({(5, "q5_deg"): "-120.5"}, 5),
        ({(5, "q2_deg"): "-30", (5, "q3_deg"): "60"}, None),
    ],
)
def test_joints_outside_their_limits(tmp_path: Path, data: Data, swap: dict, column: int | None) -> None:
    refused(tmp_path, identify(tmp_path, data.text(swap=swap), "--json"), 7, column)


@pytest.mark.parametrize("sigma", ["0", "-1", "nan"])
def test_a_sigma_of_zero_or_less(tmp_path: Path, data: Data, sigma: str) -> None:
    more = {n: [1] * 36 for n in ("sx_um", "sy_um", "sz_um")}
    refused(tmp_path, identify(tmp_path, data.text(more=more, swap={(5, "sy_um"): sigma}), "--json"), 7, 14)


def test_an_unknown_purpose(tmp_path: Path, data: Data) -> None:
    more = {"purpose": ["identify"] * 36}
    refused(tmp_path, identify(tmp_path, data.text(more=more, swap={(5, "purpose"): "fit"}), "--json"), 7, 13, "fit")


def test_a_load_without_a_reading(tmp_path: Path, data: Data) -> None:
    refused(tmp_path, identify(tmp_path, data.text(swap={(5, n): "" for n in READINGS}), "--json"), 7)


@pytest.mark.parametrize("missing", [*JOINTS, *FORCES, *READINGS])
def test_a_required_column_missing(tmp_path: Path, data: Data, missing: str) -> None:
    refused(tmp_path, identify(tmp_path, data.text([n for n in PLAIN if n != missing]), "--json"), 1, None, missing)


def test_a_column_twice(tmp_path: Path, data: Data) -> None:
    refused(tmp_path, identify(tmp_path, data.text([*PLAIN, "fx_n"]), "--json"), 1, None, "fx_n")


def test_no_load(tmp_path: Path, data: Data) -> None:
    refused(tmp_path, identify(tmp_path, data.text(swap={(i, n): "0" for i in range(36) for n in FORCES}), "--json"))


def test_negative_compliances(tmp_path: Path, data: Data) -> None:
    swap = {(i, n): float(-data.columns[n][i]) for i in range(36) for n in FORCES}
    result = identify(tmp_path, data.text(swap=swap), "--json")
    refused(tmp_path, result)
    assert "force" in result.json["findings"][0]["hint"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (CELL + "mesurement: {}\n", "measurement"),
        (CELL.replace("deflection_std_um", "deflection_std_mm"), "deflection_std_um"),
        (CELL.replace("[1, 1, 1]", "[1, 0, 1]"), "deflection_std_um"),
        (CELL.replace("quaternion: [1.0", "quaternion: [1.002"), "quaternion"),
        (CELL + "prior: {stiffness_nm_per_rad: [1e6, 1e6, 1e6, 1e6, 1e6, 1e6], relative_std: 0}\n", "relative_std"),
        (CELL + "prior: {relative_std: [1, 1, 1, 1, 1]}\n", "relative_std"),
        (CELL + "prior: {relative_std: [1, 1, 1, -1, 1, 1]}\n", "relative_std.4"),
        (CELL + "prior: {relative_std: wide}\n", "six of them, one a joint"),
        (CELL + "prior: {stiffness_nm_per_rad: [1e6, -1e6, 1e6, 1e6, 1e6, 1e6]}\n", "stiffness_nm_per_rad"),
    ],
)
def test_cells_refused(tmp_path: Path, data: Data, text: str, says: str) -> None:
    result = identify(tmp_path, data.text(), "--json", cell=text)
    assert result.code == 1, result
    error = result.json["findings"][0]
    assert Path(error["file"]).name == "cell.yaml"
    assert error["line"] is not None
    assert says in error["message"] + error["hint"]


def test_a_quaternion_within_1e_3_is_taken(tmp_path: Path, data: Data) -> None:
    assert identify(tmp_path, data.text(), cell=CELL.replace("quaternion: [1.0", "quaternion: [1.0005")).code == 0


def test_nothing_is_overwritten(tmp_path: Path, data: Data) -> None:
    (tmp_path / "s.json").write_text("mine")
    assert identify(tmp_path, data.text()).code == 1
    assert (tmp_path / "s.json").read_text() == "mine"
    assert identify(tmp_path, data.text(), "--force").code == 0
    first = (tmp_path / "s.json").read_bytes()
    assert identify(tmp_path, data.text(), "--force").code == 0
    assert (tmp_path / "s.json").read_bytes() == first


@pytest.mark.parametrize("column", ["mx", "sx", "weight"])
def test_a_column_that_is_not_read_is_reported(tmp_path: Path, data: Data, column: str) -> None:
    result = identify(tmp_path, data.text(more={column: [3] * 36}), "--json")
    assert result.code == 1 or any(column in f["message"] for f in result.json["findings"]), result.err


def test_one_moment_of_three_is_not_taken_silently(tmp_path: Path, data: Data) -> None:
    result = identify(tmp_path, data.text(more={"mx_nm": [0] * 36}), "--json")
    assert result.code == 1 or result.json["findings"], result.err


def test_outputs_of_an_earlier_call_are_told_where_this_one_ends_without_its_own(tmp_path: Path) -> None:
    """They are whole and not of these inputs: a script that does not look at the exit code would take them. Not told where
    there are none, nor where this call wrote its own."""
    cell, table, output, page = (tmp_path / name for name in ("cell.yaml", "m.csv", "stiffness.json", "identify.html"))
    cell.write_text(CELL)

    def called(text: str) -> list[str]:
        table.write_text(text)
        done = kit.run("identify", cell, table, "-o", output, "--report", page, "--force", "--json")
        assert (done.code == 0) == ("CS0203" not in kit.codes(done)), done
        return [one["message"] for one in done.json["findings"] if one["code"] == "CS0014"]

    good = measured().text()
    bad = measured().text(swap={(1, "dx_um"): "lost"})
    assert called(bad) == []
    assert called(good) == []
    assert called(good) == []
    before = output.read_bytes()
    assert called(bad) == [
        "stiffness.json and identify.html stand there still, of an earlier call: nothing was written now"]
    assert output.read_bytes() == before


def test_three_outputs_of_an_earlier_call_are_named_in_one_sentence(tmp_path: Path) -> None:
    table = tmp_path / "m.csv"
    (tmp_path / "cell.yaml").write_text(CELL)
    table.write_text(measured().text(swap={(1, "dx_um"): "lost"}))
    for name in ("d.json", "e.json", "r.html"):
        (tmp_path / name).write_text("")
    done = kit.run("diagnose", tmp_path / "cell.yaml", table, "-o", tmp_path / "d.json", "--extended", tmp_path / "e.json",
                   "--report", tmp_path / "r.html", "--force", "--json")
    (said,) = [one["message"] for one in done.json["findings"] if one["code"] == "CS0014"]
    assert said.startswith("d.json, e.json and r.html stand there still")


def test_the_re_seating_that_is_said_is_the_mean_of_the_three(tmp_path: Path) -> None:
    """In stiffness.json each axis has its own."""
    (tmp_path / "cell.yaml").write_text(CELL)
    (tmp_path / "m.csv").write_text(measured().text())
    done = kit.run("identify", tmp_path / "cell.yaml", tmp_path / "m.csv", "-o", tmp_path / "s.json")
    assert done.code == 0, done
    each = json.loads((tmp_path / "s.json").read_text())["fit"]["noise"]["pose_offset_um"]
    assert min(each) > 0.1
    assert f"re-seating {np.mean(each):.1f} um a pose" in done.out
