"""Joint deflection logs as files: what is read, and what is said of a file that cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

from identification.common.findings import CompstiffError
from identification.formats import kuka_kr300
from identification.motion.log_file import is_motion_log, read_motion_log
from tests.identification.motion.simulated_joint import columns, write


def failure(path: Path) -> str:
    with pytest.raises(CompstiffError) as caught:
        read_motion_log(path)
    return str(caught.value)


def test_csv_and_parquet_are_the_same(tmp_path: Path) -> None:
    values = columns(0, {}, seconds=5)
    text = read_motion_log(write(tmp_path / "a.csv", values))
    pd.DataFrame(values).to_parquet(tmp_path / "a.parquet")
    table = read_motion_log(tmp_path / "a.parquet")
    assert is_motion_log(tmp_path / "a.csv")
    assert is_motion_log(tmp_path / "a.parquet")
    assert list(text.joints) == list(table.joints) == [2]
    assert text.joints[2].deflection == pytest.approx(table.joints[2].deflection, abs=1e-9)
    assert text.rate == pytest.approx(250)


def test_measurements_of_the_tcp_are_no_log(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("q1_deg,fx_n\n1,2\n")
    assert not is_motion_log(tmp_path / "m.csv")


def test_a_joint_needs_both_encoders_and_torque(tmp_path: Path) -> None:
    values = columns(0, {}, seconds=5)
    del values["q2_torque_nm"]
    assert "CS0202" in failure(write(tmp_path / "a.csv", values))
    assert "CS1501" in failure(write(tmp_path / "b.csv", {"time_s": np.arange(9.0)}))


def test_text_has_line_and_column(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", columns(0, {}, seconds=5))
    lines = path.read_text().splitlines()
    lines[41] = lines[41].replace(",", ",x", 1)
    path.write_text("\n".join(lines))
    assert f"{path}:42:2: error CS0203" in failure(path)


def test_a_gap_in_time_has_its_line(tmp_path: Path) -> None:
    values = {name: np.delete(column, slice(100, 110)) for name, column in columns(0, {}, seconds=5).items()}
    assert ":102: error CS1501: time_s steps by 0.044 s" in failure(write(tmp_path / "a.csv", values))


def test_too_short(tmp_path: Path) -> None:
    assert "expected 3 s" in failure(write(tmp_path / "a.csv", columns(0, {}, seconds=1)))


@pytest.mark.parametrize(("samples", "words"), [
    (2.0, "8.0 ms behind"), (-3.0, "12.0 ms ahead of"), (4.8, "19.2 ms behind"), (12.0, "20.0 ms or more behind"),
    (-7.0, "20.0 ms or more ahead of"), (0.6, "2.4 ms behind"), (0.4, ""), (-0.4, ""), (0.0, "")])
def test_a_speed_channel_that_lags_is_said(tmp_path: Path, samples: float, words: str) -> None:
    """From half a sample of 4 ms on, and up to five are looked at."""
    values = columns(0, {}, seconds=5)
    speed, index = values["q2_speed_deg_s"], np.arange(1250.0)
    values["q2_speed_deg_s"] = np.interp(index - samples, index, speed)
    log = read_motion_log(write(tmp_path / "a.csv", values))
    assert [(one.level, one.message) for one in log.findings if one.code == "CS1506"] == [
        ("note", f"q2_speed_deg_s lies {words} the motor angle; the speed is taken from the angle")][: bool(words)]


def test_a_log_too_short_to_compare_tells_no_lag(tmp_path: Path) -> None:
    """Ten samples of two a second: nothing is left inside, and the first lag that was tried had been told, 2.5 s."""
    values = {name: column[::125] for name, column in columns(0, {}, seconds=5).items()}
    assert len(values["time_s"]) == 10
    assert "CS1506" not in {one.code for one in read_motion_log(write(tmp_path / "a.csv", values)).findings}


def kuka(path: Path, **changes: object) -> Path:
    values = columns(0, {}, seconds=5)
    motor, link, torque, speed = (np.zeros((6, 1250)) for _ in range(4))
    motor[1], link[1] = values["q2_motor_deg"], values["q2_link_deg"]
    torque[1], speed[1] = values["q2_torque_nm"] / 267.4, values["q2_speed_deg_s"]
    rec = {"time_cont": values["time_s"], "act_pos_mot_deg": motor, "act_pos_se_deg": link, "act_vel_mot_deg_per_s": speed,
           "act_torque_abs_nm": torque} | changes
    scipy.io.savemat(path, {"rec": rec, "para": {"u": np.array([256.9, 267.4, 252.3, 221.0, 239.6, 154.3])}})
    return path


def test_public_record_has_its_torque_on_the_gear_side(tmp_path: Path) -> None:
    log = read_motion_log(kuka(tmp_path / "a.mat"))
    assert list(log.joints) == [2]
    assert log.joints[2].torque == pytest.approx(columns(0, {}, seconds=5)["q2_torque_nm"], rel=1e-9)


def test_other_matlab_files_are_refused(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "a.mat", {"x": 1})
    assert "has no rec.act_pos_mot_deg" in failure(tmp_path / "a.mat")
    (tmp_path / "b.mat").write_text("no")
    assert "CS0201" in failure(tmp_path / "b.mat")
    assert "has shape (6, 3)" in failure(kuka(tmp_path / "c.mat", act_torque_abs_nm=np.zeros((6, 3))))
    clock = columns(0, {}, seconds=5)["time_s"]
    for wrong in (clock[:-1], np.where(clock == clock[7], np.nan, clock)):
        told = failure(kuka(tmp_path / "d.mat", time_cont=wrong))
        assert f"d.mat: error CS0201: rec.time_cont has shape ({len(wrong)},), expected (1250,), in finite numbers" in told
    content = scipy.io.loadmat(kuka(tmp_path / "e.mat"))
    scipy.io.savemat(tmp_path / "e.mat", {"rec": content["rec"], "para": {"u": np.ones(5)}})
    assert "e.mat: error CS0201: para.u has shape (5,), expected (6,)" in failure(tmp_path / "e.mat")


@pytest.mark.parametrize(("field", "column", "scale"), [
    ("act_pos_mot_deg", "q2_motor_deg", 1), ("act_pos_se_deg", "q2_link_deg", 1),
    ("act_vel_mot_deg_per_s", "q2_speed_deg_s", 1), ("act_torque_abs_nm", "q2_torque_nm", 1 / 267.4)])
def test_a_sample_of_a_record_that_is_no_number_is_refused_where_it_stands(
        tmp_path: Path, field: str, column: str, scale: float) -> None:
    """As in a table. Such a record ended as a defect, told a lag of the speed that was none, or had "no link encoder"."""
    lost = np.zeros((6, 1250))
    lost[1] = scale * columns(0, {}, seconds=5)[column]
    lost[1, 700] = np.nan
    assert failure(kuka(tmp_path / "a.mat", **{field: lost})).splitlines()[0].endswith(
        f"a.mat: error CS0203: rec.{field}, joint 2: found nan as number 701, expected a finite number up to 1e+19 in size")


def test_a_joint_without_a_link_encoder_may_have_no_number_at_all(tmp_path: Path) -> None:
    link = np.full((6, 1250), np.nan)
    link[1] = columns(0, {}, seconds=5)["q2_link_deg"]
    assert list(read_motion_log(kuka(tmp_path / "a.mat", act_pos_se_deg=link)).joints) == [2]


def test_a_file_of_numbers_its_reader_does_not_end_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kuka_kr300, "PATIENCE_S", 0.01)
    assert "a.mat: error CS0201: is not a MATLAB file that can be read: its reader took over 0.01 s" in failure(
        kuka(tmp_path / "a.mat"))


def test_a_log_that_is_not_there_or_short(tmp_path: Path) -> None:
    assert not is_motion_log(tmp_path / "none.parquet")
    (tmp_path / "no.parquet").write_text("no")
    assert is_motion_log(tmp_path / "no.parquet") is False
    assert is_motion_log(tmp_path / "none.mat")
    short = {name: column[:1] for name, column in columns(0, {}, seconds=5).items()}
    assert "a.csv: error CS1501: has 1 sample\n" in failure(write(tmp_path / "a.csv", short))


def test_a_record_with_a_step_and_no_clock(tmp_path: Path) -> None:
    kuka(tmp_path / "clock.mat")
    content = scipy.io.loadmat(tmp_path / "clock.mat", squeeze_me=True, struct_as_record=True)
    rec = {name: content["rec"][name].item() for name in content["rec"].dtype.names if name != "time_cont"}
    stated = {"rec": rec, "para": {"u": content["para"]["u"].item()}}
    scipy.io.savemat(tmp_path / "step.mat", stated | {"time_data": {"dt": 0.004}})
    log = read_motion_log(tmp_path / "step.mat")
    assert log.time == pytest.approx(0.004 * np.arange(1250))
    assert [finding.message for finding in log.findings if finding.code == "CS1614"] == [
        "has no clock; time is the row's number times time_data.dt = 0.004 s"]
    assert read_motion_log(tmp_path / "clock.mat").findings == ()
    scipy.io.savemat(tmp_path / "none.mat", stated)
    assert "has no clock" in failure(tmp_path / "none.mat")


def test_what_the_reader_of_matlab_files_warns_of_is_a_finding(tmp_path: Path) -> None:
    """The variables of the file stand in it twice, behind its header of 128 bytes."""
    kuka(tmp_path / "a.mat")
    content = (tmp_path / "a.mat").read_bytes()
    (tmp_path / "a.mat").write_bytes(content + content[128:])
    said = [one.message for one in read_motion_log(tmp_path / "a.mat").findings if one.code == "CS1615"]
    assert len(said) == len(set(said)) > 0
    assert all("Duplicate variable name" in message for message in said)


def test_a_table_without_clock_is_told_how_to_make_one(tmp_path: Path) -> None:
    values = columns(0, {}, seconds=5)
    del values["time_s"]
    told = failure(write(tmp_path / "a.csv", values))
    assert "has no column time_s" in told
    assert "0.004" in told
