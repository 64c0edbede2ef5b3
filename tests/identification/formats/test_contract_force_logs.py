"""Readers of other people's force logs, on small files written in those forms from their description."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
from click.testing import CliRunner

from compstiff.cli.main import compstiff
from identification.common.findings import CompstiffError
from identification.formats.convert import Converted, convert_log
from identification.formats.lvm import read_lvm
from identification.formats.metallicadour import read_metallicadour
from identification.formats.net_ft import RECORD, read_net_ft

VALUES = np.round(np.random.default_rng(0).normal(0, 50, (40, 12)), 4)


@pytest.mark.parametrize("separator", [";", ",", " "])
def test_metallicadour_separators(tmp_path: Path, separator: str) -> None:
    folder = tmp_path / "5mm_648mm_mn_9000rpm"
    folder.mkdir()
    text = "\n".join(separator.join(f"{x:.4f}" for x in row) for row in VALUES)
    (folder / "a.csv").write_text(text.replace(".", ",") if separator == ";" else text)
    log = read_metallicadour(folder / "a.csv")
    assert log.force == pytest.approx(VALUES[:, 3:6])
    assert log.moment == pytest.approx(VALUES[:, 6:9])
    assert log.time[-1] == pytest.approx(39 / 25600)
    assert log.conditions == {"depth_mm": 5, "feed_mm_min": 648, "spindle_rpm": 9000}


@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), (";", "."), (",", "."), (" ", "."), ("\t", ".")])
def test_metallicadour_that_begins_with_whole_numbers(tmp_path: Path, separator: str, decimal: str) -> None:
    """A sensor at rest says 0, and no sign of how the rows behind it are spelled; a comma is a decimal one beside `;` alone."""
    values = np.round(VALUES, 1)
    values[0] = np.arange(12) - 3
    (tmp_path / "a.csv").write_text("\n".join(separator.join(f"{x:g}" for x in row) for row in values).replace(".", decimal))
    log = read_metallicadour(tmp_path / "a.csv")
    assert log.force == pytest.approx(values[:, 3:6], abs=1e-12)
    assert log.moment == pytest.approx(values[:, 6:9], abs=1e-12)


def test_metallicadour_complaints(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("1;2;3\n4;5;6\n")
    with pytest.raises(CompstiffError, match="has 3 channels, expected 12"):
        read_metallicadour(path)
    path.write_text(";".join(["1"] * 12) + "\n" + ";".join(["1"] * 4 + ["x"] + ["1"] * 7) + "\n")
    with pytest.raises(CompstiffError, match=r"a.csv:2:5: error CS0203"):
        read_metallicadour(path)


def test_metallicadour_with_a_separator_at_the_end_of_each_line(tmp_path: Path) -> None:
    """As loggers write it; a thirteenth channel is no such thing. A wrong cell has its line of the file, empty ones counted."""
    path, rows = tmp_path / "a.csv", [";".join(f"{x:.4f}" for x in row) + ";" for row in VALUES]
    path.write_text("\n".join(rows))
    assert read_metallicadour(path).force == pytest.approx(VALUES[:, 3:6])
    path.write_text("\n".join([rows[0] + "7", *rows[1:]]))
    with pytest.raises(CompstiffError, match="CS0201: has 13 channels, expected 12"):
        read_metallicadour(path)
    path.write_text("\n\n" + rows[0] + "\n\n" + ";".join(["1"] * 5 + ["x"] + ["1"] * 6) + ";\n")
    with pytest.raises(CompstiffError, match=r"a.csv:5:6: error CS0203: channel 6: found 'x'"):
        read_metallicadour(path)


def lvm(blocks: list[tuple[float, np.ndarray]], *, decimal: str = ".", x_columns: str = "No") -> str:
    lines = ["LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
             f"Decimal_Separator\t{decimal}", "Multi_Headings\tYes", f"X_Columns\t{x_columns}", "Time_Pref\tRelative",
             "Date\t2024/05/01", "***End_of_Header***\t", "\t"]
    for start, rows in blocks:
        count = rows.shape[1]
        lines += [f"Channels\t{count}", "Samples" + f"\t{len(rows)}" * count, "X_Dimension" + "\tTime" * count,
                  "X0" + f"\t{start:.6E}" * count, "Delta_X" + "\t0.000100" * count, "***End_of_Header***" + "\t" * count]
        names = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")[:count]
        if x_columns == "Multi":
            lines.append("\t".join(f"X_Value\t{name}" for name in names) + "\tComment")
            lines += ["\t".join(f"{start + 1e-4 * k:.6f}\t{x:.4f}" for x in row) for k, row in enumerate(rows)]
        else:
            lines.append("X_Value\t" + "\t".join(names) + "\tComment")
            first = [f"{start + 1e-4 * k:.6f}" if x_columns == "One" else "" for k in range(len(rows))]
            lines += [f"{x}\t" + "\t".join(f"{value:.4f}" for value in row) for x, row in zip(first, rows, strict=True)]
        lines.append("")
    text = "\r\n".join(lines)
    if decimal == ",":
        head, _, body = text.partition("X_Columns")
        text = head + "X_Columns" + body.replace(".", ",")
    return text


@pytest.mark.parametrize("x_columns", ["No", "One", "Multi"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_lvm_blocks_stand_at_their_times(tmp_path: Path, x_columns: str, decimal: str) -> None:
    path = tmp_path / "a.lvm"
    path.write_text(lvm([(0.0, VALUES[:20, :3]), (0.002, VALUES[20:, :3])], decimal=decimal, x_columns=x_columns))
    log = read_lvm(path)
    assert log.force == pytest.approx(VALUES[:, :3])
    assert log.moment is None
    assert log.time == pytest.approx(1e-4 * np.arange(40), abs=1e-9)
    assert [finding.code for finding in log.findings] == ["CS1613"]


@pytest.mark.parametrize(("begins", "said"), [
    ((0.0, 0.5, 0.501), "1 gap between blocks"), ((0.0, 0.5, 0.6), "2 gaps between blocks"),
    ((0.0, 0.00106, 0.00206), "1 gap between blocks"), ((0.0, 0.00104, 0.00204), ""), ((0.0, 0.001, 0.002), ""),
    ((0.0, 0.0009, 0.0019), "1 step back in time between blocks"),        # the last time of the first block once more
    ((0.5, 0.0, 0.001), "1 step back in time between blocks"),
    ((0.5, 0.0, 0.1), "1 gap and 1 step back in time between blocks")])
def test_lvm_gap_is_said(tmp_path: Path, begins: tuple[float, ...], said: str) -> None:
    """Of blocks of ten samples each 0.1 ms, from half a step on that nothing was taken in."""
    path = tmp_path / "a.lvm"
    path.write_text(lvm([(begin, VALUES[10 * k: 10 * k + 10, :3]) for k, begin in enumerate(begins)]))
    log = read_lvm(path)
    assert log.time[[0, 10, 20]] == pytest.approx(np.array(begins) - begins[0], abs=1e-9)
    assert [(one.level, one.message) for one in log.findings if one.code == "CS0205"] == [("warning", said)][: bool(said)]


def test_lvm_channels_of_other_times_are_no_force(tmp_path: Path) -> None:
    """X0 and Delta_X are given a channel: half a sample apart is at once."""
    path, text = tmp_path / "a.lvm", lvm([(0.0, VALUES[:20, :4])])
    x0, step = "X0" + "\t0.000000E+00" * 4, "Delta_X" + "\t0.000100" * 4
    for old, new, apart in ((x0, "X0\t0.0\t0.0\t4.9E-5\t1.0", 0), (x0, "X0\t0.0\t0.0\t-6E-5\t0.0", 6e-5),
                            (step, "Delta_X\t1e-4\t1e-4\t9.7e-5\t1e-4", 19 * 3e-6),
                            (step, "Delta_X\t1e-4\t1e-4\t9.8e-5\t1e-4", 0)):
        assert old in text
        path.write_text(text.replace(old, new))
        if apart:
            with pytest.raises(CompstiffError) as stopped:
                read_lvm(path, ("Fx", "Fy", "Fz"))
            assert [(one.code, one.message) for one in stopped.value.findings] == [(
                "CS0201", f"channel Fz was not taken at the times of Fx, by X0 and Delta_X: up to {apart:.4g} s apart")]
            assert read_lvm(path, ("Fx", "Fy", "Mx")).time == pytest.approx(1e-4 * np.arange(20)), "Fz is not asked for"
        else:
            log = read_lvm(path, ("Fx", "Fy", "Fz"))
            assert (log.time, log.force) == (pytest.approx(1e-4 * np.arange(20)), pytest.approx(VALUES[:20, :3]))


@pytest.mark.parametrize(("titles", "asked", "says"), [
    ("Fx\tFy\tFz\tMx", ("Fx", "Fy", "Fz", "Mx", "My", "Mz"), "channels missing: a moment; found Fx, Fy, Fz, Mx"),
    ("Fx\tFy\tMx\tMy", ("Fx", "Fy", "Fz", "Mx"), "channels missing: Fz; found Fx, Fy, Mx, My"),
    ("Fx\tA\tB\tC", ("Fx", "Fy", "Fz"), "channels missing: Fy, Fz; found Fx, A, B, C"),
    ("Fx\tFy\tFz", None, "the line of column names has 5 cells, expected 5 or more"),
    ("Fx\tFy", None, "the line of column names has 4 cells, expected 5 or more")])
def test_lvm_channels_that_are_not_there(tmp_path: Path, titles: str, asked: tuple[str, ...] | None, says: str) -> None:
    """A cell for each, X and comment beside them: without a name of its own the comment's is the fourth channel's."""
    path = tmp_path / "a.lvm"
    path.write_text(lvm([(0.0, VALUES[:5, :4])]).replace("Fx\tFy\tFz\tMx", titles))
    if asked is None and "5 cells" in says:
        assert read_lvm(path, ("Fx", "Fy", "Fz")).force == pytest.approx(VALUES[:5, :3])
        return
    with pytest.raises(CompstiffError) as stopped:
        read_lvm(path, asked or ("Fx", "Fy", "Fz"))
    assert stopped.value.findings[0].message == says
    assert stopped.value.findings[0].line == (18 if asked is None else None)


@pytest.mark.parametrize(("given", "step"), [(None, 1 / 25600), (1000.0, 1e-3)])
def test_a_converted_log_has_the_columns_and_the_clock_of_its_file(tmp_path: Path, given: float | None, step: float) -> None:
    """Without moments three of them; without a rate the one that is usual of the form; and what is said of it."""
    path = tmp_path / "5mm_648mm_mn_9000rpm" / "a.csv"
    path.parent.mkdir()
    path.write_text("\n".join(",".join(map(str, row)) for row in VALUES))
    converted = convert_log(path, "metallicadour", rate=given)
    assert list(converted.columns) == ["time_s", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"]
    assert converted.columns["time_s"] == pytest.approx(step * np.arange(40), rel=1e-12)
    assert converted.as_dict() == {
        "rows": 40, "seconds": pytest.approx(39 * step), "columns": list(converted.columns),
        "conditions": {"depth_mm": 5, "feed_mm_min": 648, "spindle_rpm": 9000}}
    assert converted.lines() == [f"40 samples over {39 * step:.3f} s: time_s, fx_n, fy_n, fz_n, mx_nm, my_nm, mz_nm, "
                                 "depth_mm 5, feed_mm_min 648, spindle_rpm 9000"]
    (tmp_path / "a.lvm").write_text(lvm([(0.0, VALUES[:, :3])]))
    converted = convert_log(tmp_path / "a.lvm", "lvm")
    assert converted.lines() == ["40 samples over 0.004 s: time_s, fx_n, fy_n, fz_n"]
    assert list(converted.columns) == ["time_s", "fx_n", "fy_n", "fz_n"]
    assert converted.columns["fz_n"] == pytest.approx(VALUES[:, 2])


@pytest.mark.parametrize(("counts", "rate"), [((2e6, 4e6), 1000.0), ((1e6, 1e6), None)])
def test_a_sensor_s_own_counts_and_rate_are_taken(tmp_path: Path, counts: tuple[float, float], rate: float | None) -> None:
    (tmp_path / "a.rdt").write_bytes(packets(np.arange(40)).tobytes())
    columns = convert_log(tmp_path / "a.rdt", "net-ft", counts=counts, rate=rate).columns
    assert columns["time_s"] == pytest.approx(4 * np.arange(40) / (rate or 7000.0))
    assert np.column_stack([columns[name] for name in ("fx_n", "fy_n", "fz_n")]) == pytest.approx(
        VALUES[:, :3] * 1e6 / counts[0])
    assert np.column_stack([columns[name] for name in ("mx_nm", "my_nm", "mz_nm")]) == pytest.approx(
        VALUES[:, 3:6] * 1e6 / counts[1])


def test_lvm_complaints(tmp_path: Path) -> None:
    path = tmp_path / "a.lvm"
    path.write_text("time\tFx\n")
    with pytest.raises(CompstiffError, match="is not a LabVIEW measurement file"):
        read_lvm(path)
    path.write_text(lvm([(0.0, VALUES[:5, :3])]))
    with pytest.raises(CompstiffError, match="channels missing: A; found Fx, Fy, Fz"):
        read_lvm(path, ("A", "Fy", "Fz"))
    path.write_text(lvm([(0.0, VALUES[:5, :3])]).replace(f"{VALUES[2, 1]:.4f}", "x"))
    with pytest.raises(CompstiffError, match=r"a.lvm:21:3: error CS0203"):
        read_lvm(path)
    path.write_text(lvm([(0.0, VALUES[:5, :3])]).replace(f"{VALUES[2, 1]:.4f}", "x").replace(
        f"\r\n\t{VALUES[1, 0]:.4f}", f"\r\n\r\n\r\n\t{VALUES[1, 0]:.4f}"))
    with pytest.raises(CompstiffError, match=r"a.lvm:23:3: error CS0203"):      # two empty lines above it
        read_lvm(path)
    path.write_text(lvm([(0.0, VALUES[:0, :3])]))
    with pytest.raises(CompstiffError, match=r"a.lvm: error CS0201: has no row of data"):
        read_lvm(path)
    path.write_text(lvm([]))
    with pytest.raises(CompstiffError, match=r"a.lvm:10: error CS0201: has a header and no block of data"):
        read_lvm(path)
    path.write_text("LabVIEW Measurement\t\nSeparator\tTab\nChannels\t3\n")
    with pytest.raises(CompstiffError, match=r"a.lvm:3: error CS0201: has no \*\*\*End_of_Header"):
        read_lvm(path)


def test_lvm_blocks_that_are_not_alike(tmp_path: Path) -> None:
    """Channels in another order would give the one's numbers to the other."""
    path, text = tmp_path / "a.lvm", lvm([(0.0, VALUES[:20, :3]), (0.002, VALUES[20:, :3])])
    first, _, second = text.rpartition("\tFx\tFy\tFz")
    path.write_text(first + "\tFx\tFz\tFy" + second)
    with pytest.raises(CompstiffError, match=r"a.lvm: error CS0202: a block has channels Fx, Fz, Fy, the first has Fx, Fy, Fz"):
        read_lvm(path)


@pytest.mark.parametrize(("old", "new", "says"), [
    ("Decimal_Separator\t.", "Decimal_Separator\t;", "error CS0201: Decimal_Separator is ';' and cells are separated by '\t'"),
    ("Separator\tTab\r\nDecimal_Separator\t.", "Separator\tComma\r\nDecimal_Separator\t,",
     "error CS0201: Decimal_Separator is ',' and cells are separated by ','"),
    ("X0" + "\t0.000000E+00" * 3, "X0" + "\t0.000000E+00" * 2, "CS0201: 3 channels with 2 values of X0 and 3 of Delta_X"),
    ("Delta_X" + "\t0.000100" * 3, "Delta_X" + "\t0.000100" * 4, "CS0201: 3 channels with 3 values of X0 and 4 of Delta_X"),
    ("X0" + "\t0.000000E+00" * 3, "X0" + "\t0.000000E+00" * 2 + "\tinf", "CS0203: X0 or Delta_X is no number of seconds"),
    ("Delta_X" + "\t0.000100" * 3, "Delta_X\t1e300" + "\t0.000100" * 2, "CS0203: X0 or Delta_X is no number of seconds"),
])
def test_lvm_headers_that_contradict_themselves(tmp_path: Path, old: str, new: str, says: str) -> None:
    path, text = tmp_path / "a.lvm", lvm([(0.0, VALUES[:5, :3])])
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(CompstiffError) as stopped:
        read_lvm(path)
    assert says in str(stopped.value)
    if "Delta_X" in says:
        assert stopped.value.findings[0].line == 17         # where the header of the block ends


def test_lvm_of_no_channel(tmp_path: Path) -> None:
    path = tmp_path / "a.lvm"
    path.write_text(lvm([(0.0, VALUES[:5, :0])]))
    with pytest.raises(CompstiffError, match="a.lvm:17: error CS0201: 0 channels with 0 values of X0 and 0 of Delta_X"):
        read_lvm(path)


def packets(rdt: np.ndarray, status: int = 0) -> np.ndarray:
    records = np.zeros(len(rdt), RECORD)
    records["rdt"], records["ft"], records["status"] = rdt % 2**32, 4 * rdt % 2**32, status
    records["force"] = np.round(1e6 * VALUES[: len(rdt), :3])
    records["moment"] = np.round(1e6 * VALUES[: len(rdt), 3:6])
    return records


def test_net_ft_counts(tmp_path: Path) -> None:
    path = tmp_path / "a.rdt"
    path.write_bytes(packets(np.arange(2**32 - 10, 2**32 + 30, dtype=np.int64)).tobytes())
    log = read_net_ft(path)
    assert log.force == pytest.approx(VALUES[:, :3])
    assert log.moment == pytest.approx(VALUES[:, 3:6])
    assert log.time == pytest.approx(4 * np.arange(40) / 7000)
    assert not log.findings


def test_net_ft_lost_late_and_faulty(tmp_path: Path) -> None:
    path = tmp_path / "a.rdt"
    records = packets(np.delete(np.arange(40), [5, 6]))
    records["status"][3] = 1
    swapped = records[[0, 1, 2, 4, 3, *range(5, 38)]]
    path.write_bytes(swapped.tobytes())
    log = read_net_ft(path)
    assert np.all(np.diff(log.time) > 0)
    assert [finding.message for finding in log.findings] == [
        "2 packets of 40 lost on the way", "1 packet came out of order", "1 sample with a sensor status that is not zero"]
    assert [(finding.code, finding.level) for finding in log.findings] == [
        ("CS0205", "warning"), ("CS0205", "note"), ("CS0205", "warning")]
    path.write_bytes(b"123")
    with pytest.raises(CompstiffError, match="expected a multiple of 36"):
        read_net_ft(path)


def test_convert(tmp_path: Path) -> None:
    (tmp_path / "a.rdt").write_bytes(packets(np.arange(40)).tobytes())
    run = CliRunner().invoke(compstiff, ["convert", str(tmp_path / "a.rdt"), "--form", "net-ft", "-o", str(tmp_path / "a.csv")])
    assert run.exit_code == 0, run.output
    frame = pd.read_csv(tmp_path / "a.csv")
    assert list(frame) == ["time_s", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"]
    assert frame["fy_n"].to_numpy() == pytest.approx(VALUES[:, 1])
    scipy.io.savemat(tmp_path / "b.mat", {"x": 1})
    run = CliRunner().invoke(compstiff, ["convert", str(tmp_path / "b.mat"), "--form", "kuka-kr300", "-o",
                                         str(tmp_path / "b.csv")])
    assert run.exit_code == 1


def test_a_public_record_is_converted_with_what_was_assumed(tmp_path: Path) -> None:
    """Of the joints whose link encoder moves, the torque behind the gear; without a clock of its own by its step."""
    moving = np.sin(np.arange(9.0))
    motor, link, torque, speed = (factor * np.eye(6)[:, 1:2] * moving for factor in (10.0, 11.0, 12.0, 13.0))
    rec = {"act_pos_mot_deg": motor, "act_pos_se_deg": link, "act_torque_abs_nm": torque, "act_vel_mot_deg_per_s": speed}
    content = {"rec": rec, "para": {"u": np.array([100.0, 200, 300, 400, 500, 600])}}
    scipy.io.savemat(tmp_path / "a.mat", {**content, "time_data": {"dt": 0.25}})
    converted = convert_log(tmp_path / "a.mat", "kuka-kr300")
    assert (converted.seconds, converted.conditions) == (2.0, {})
    assert converted.lines() == ["9 samples over 2.000 s: time_s, q2_motor_deg, q2_link_deg, q2_torque_nm, q2_speed_deg_s"]
    for name, factor in (("motor_deg", 10), ("link_deg", 11), ("torque_nm", 12 * 200), ("speed_deg_s", 13)):
        assert converted.columns[f"q2_{name}"] == pytest.approx(factor * moving)
    (said,) = converted.findings
    assert (said.code, said.level, said.message) == (
        "CS1614", "note", "has no clock; time is the row's number times time_data.dt = 0.25 s")
    scipy.io.savemat(tmp_path / "b.mat", {**content, "rec": {**rec, "time_cont": 7 + 0.5 * np.arange(9)}})
    with_clock = convert_log(tmp_path / "b.mat", "kuka-kr300")
    assert (with_clock.seconds, with_clock.columns["time_s"][0], with_clock.findings) == (4.0, 7.0, ())
    for step in (0.0, np.inf, np.nan):
        scipy.io.savemat(tmp_path / "c.mat", {**content, "time_data": {"dt": step}})
        with pytest.raises(CompstiffError, match="has no clock: neither rec.time_cont nor a step in time_data.dt"):
            convert_log(tmp_path / "c.mat", "kuka-kr300")


@pytest.mark.parametrize("form", ["net-ft", "lvm", "metallicadour", "kuka-kr300"])
def test_a_log_that_is_not_there_is_a_finding(tmp_path: Path, form: str) -> None:
    with pytest.raises(CompstiffError) as stopped:
        convert_log(tmp_path / "none", form)
    assert [(finding.code, finding.file) for finding in stopped.value.findings] == [("CS0005", str(tmp_path / "none"))]
    assert "cannot be read: " in str(stopped.value)


def test_a_log_is_converted_to_parquet_too(tmp_path: Path) -> None:
    """To the last digit, where CSV rounds to ten."""
    (tmp_path / "a.rdt").write_bytes(packets(np.arange(40)).tobytes())
    run = CliRunner().invoke(compstiff, ["convert", str(tmp_path / "a.rdt"), "--form", "net-ft", "-o",
                                         str(tmp_path / "a.parquet")])
    assert run.exit_code == 0, run.output
    frame = pd.read_parquet(tmp_path / "a.parquet")
    assert list(frame) == ["time_s", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"]
    assert frame["time_s"].tolist() == [4 * k / 7000 for k in range(40)]
    assert frame["mz_nm"].to_numpy() == pytest.approx(VALUES[:, 5], rel=1e-14)


def with_units(text: str, *units: str) -> str:
    return text.replace("\r\nX_Dimension", "\r\nY_Unit_Label\t" + "\t".join(units) + "\r\nX_Dimension")


def test_lvm_units_are_what_the_file_states(tmp_path: Path) -> None:
    path, text = tmp_path / "a.lvm", lvm([(0.0, VALUES[:20, :3]), (0.002, VALUES[20:, :3])])
    path.write_text(with_units(text, "kN", "N", "Newtons"))
    log = read_lvm(path)
    assert log.force == pytest.approx(VALUES[:, :3] * [1000, 1, 1])
    assert [finding.message for finding in log.findings] == ["channel Fx is in kN: taken times 1000"]
    path.write_text(with_units(text, "N", "Volts", "N"))
    with pytest.raises(CompstiffError, match=r"CS1612: channel Fy is in Volts, not a force"):
        read_lvm(path)
    path.write_text(with_units(text, "N", "", "N"))
    assert ["states no unit for Fy" in finding.message for finding in read_lvm(path).findings] == [True]


@pytest.mark.parametrize(("force", "moment", "newtons", "newton_metres"), [
    ("N", "Nm", 1, 1), ("kN", "kN m", 1e3, 1e3), ("mN", "mN\N{MIDDLE DOT}m", 1e-3, 1e-3), ("Newtons", "N-m", 1, 1),
    ("lbf", "lbf-ft", 0.45359237 * 9.80665, 0.45359237 * 9.80665 * 0.3048),
    ("lbf", "lbf*in", 0.45359237 * 9.80665, 0.45359237 * 9.80665 * 0.0254), ("N", "N mm", 1, 1e-3),
    ("N", "Ncm", 1, 1e-2), ("N", "N-cm", 1, 1e-2),
    ("kgf", "kgf*m", 9.80665, 9.80665), ("kgf", "kgf-cm", 9.80665, 0.0980665), ("kgf", "kgf mm", 9.80665, 0.00980665),
    ("Newton", "Newtonmeter", 1, 1), ("newton", "Newton-meters", 1, 1), ("newtons", "mNm", 1, 1e-3),
    ("kgf*m", "kgf*m", 0, 9.80665), ("kgf", "kgf", 9.80665, 0), ("kg", "kgf*m", 0, 1),
    ("N", "N", 1, 0), ("Nm", "Nm", 0, 1), ("V", "Nm", 0, 1)])
def test_lvm_numbers_are_taken_times_their_unit(
    tmp_path: Path, force: str, moment: str, newtons: float, newton_metres: float,
) -> None:
    """A force where a moment belongs, and the other way round, is none; what is taken as it stands is not spoken of."""
    path = tmp_path / "a.lvm"
    values = np.round(VALUES[:20, :6], 4)
    path.write_text(with_units(lvm([(0.0, values)]), *[force] * 3, *[moment] * 3), encoding="utf-8")
    wrong = next((f"channel {name} is in {unit}, not a {what}" for name, unit, what, factor in (
        ("Fx", force, "force", newtons), ("Mx", moment, "moment", newton_metres)) if not factor), "")
    if wrong:
        with pytest.raises(CompstiffError) as refused:
            read_lvm(path)
        (said,) = refused.value.findings
        assert (said.code, said.message) == ("CS1612", wrong)
        return
    log = read_lvm(path)
    assert log.moment is not None
    assert log.force == pytest.approx(newtons * values[:, :3], rel=1e-9)
    assert log.moment == pytest.approx(newton_metres * values[:, 3:], rel=1e-9)
    assert [(one.code, one.message) for one in log.findings] == [
        ("CS1613", f"channel {kind}{axis} is in {unit}: taken times {factor:g}")
        for kind, unit, factor in (("F", force, newtons), ("M", moment, newton_metres)) for axis in "xyz" if factor != 1]


def test_a_tachometer_is_no_force(tmp_path: Path) -> None:
    path, text = tmp_path / "a.lvm", lvm([(0.0, VALUES[:, :3])])
    path.write_text(text.replace("\tFz", "\tTacho"))
    with pytest.raises(CompstiffError, match="channel Tacho is a speed by its name"):
        read_lvm(path, ("Fx", "Fy", "Tacho"))
    path.write_text(with_units(text, "N", "N", "rpm"))
    with pytest.raises(CompstiffError, match="channel Fz is in rpm"):
        read_lvm(path)


def test_how_long_a_log_is_does_not_hang_on_when_it_began() -> None:
    columns = {"time_s": 1000.0 + 0.5 * np.arange(9), "fx_n": np.zeros(9)}
    converted = Converted(columns, {}, ())
    assert converted.seconds == 4.0
    assert converted.as_dict()["seconds"] == 4.0


@pytest.mark.parametrize(("place", "largest", "gear", "number"), [
    ("act_pos_mot_deg", 1e19, 200.0, None), ("act_pos_mot_deg", -1.1e19, 200.0, 4), ("act_pos_se_deg", np.inf, 200.0, 4),
    ("act_vel_mot_deg_per_s", np.nan, 200.0, 4), ("act_torque_abs_nm", 1e19, 1e19, None),
    ("act_torque_abs_nm", 1.0, np.nan, 1)])
def test_a_sample_of_a_public_record_that_is_no_number_is_told_with_its_place(
    tmp_path: Path, place: str, largest: float, gear: float, number: int | None
) -> None:
    """Up to 1e19 in size; of a joint that has no link encoder nothing is asked."""
    rec = {name: np.eye(6)[:, 1:2] * np.arange(9.0) for name in (
        "act_pos_mot_deg", "act_pos_se_deg", "act_torque_abs_nm", "act_vel_mot_deg_per_s")}
    rec[place][1, 3] = largest
    rec["act_pos_mot_deg"][4, 2] = np.nan
    ratios = np.array([100.0, gear, 300, 400, 500, np.inf])
    scipy.io.savemat(tmp_path / "a.mat", {"rec": {**rec, "time_cont": np.arange(9.0)}, "para": {"u": ratios}})
    if number is None:
        columns = convert_log(tmp_path / "a.mat", "kuka-kr300").columns
        assert list(columns) == ["time_s", "q2_motor_deg", "q2_link_deg", "q2_torque_nm", "q2_speed_deg_s"]
        assert (columns["q2_motor_deg"][3], columns["q2_torque_nm"][3]) == (
            (3.0, largest * gear) if place.endswith("nm") else (largest, 3 * gear))
        return
    with pytest.raises(CompstiffError) as stopped:
        convert_log(tmp_path / "a.mat", "kuka-kr300")
    (finding,) = stopped.value.findings
    where, found = ("para.u", gear) if np.isnan(gear) else (f"rec.{place}", largest)
    assert (finding.code, finding.file) == ("CS0203", str(tmp_path / "a.mat"))
    assert finding.message == (
        f"{where}, joint 2: found {found:g} as number {number}, expected a finite number up to 1e+19 in size")


@pytest.mark.parametrize("x_columns", ["No", "One", "Multi"])
@pytest.mark.parametrize(("separator", "word", "decimal"), [
    (",", "Comma", "."), (";", "Semicolon", "."), (";", "Semicolon", ","), ("\t", "Tab", ","), ("\t", "", ".")])
def test_lvm_cells_are_separated_by_what_stands_behind_the_word_separator(
    tmp_path: Path, separator: str, word: str, decimal: str, x_columns: str
) -> None:
    """In headers and rows alike (NI's specification); by a tab where the header does not say."""
    text = lvm([(0.0, VALUES[:20, :3]), (0.002, VALUES[20:, :3])], decimal=decimal, x_columns=x_columns)
    head, said, body = text.partition("Separator\tTab\r\n")
    said = f"Separator{separator}{word}\r\n" if word else ""
    (tmp_path / "a.lvm").write_text(head.replace("\t", separator) + said + body.replace("\t", separator), newline="")
    log = read_lvm(tmp_path / "a.lvm")
    assert log.force == pytest.approx(VALUES[:, :3])
    assert log.time == pytest.approx(1e-4 * np.arange(40), abs=1e-9)
