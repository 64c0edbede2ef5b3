"""`push` and `cell` as a user calls them: what they print, write and answer, exit code by exit code."""

import hashlib
import json
import socket
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import compstiff as compstiff_api
from compensator.modbus import registers as at
from compensator.modbus.link import Address
from compensator.modbus.push import Waiting
from compensator.modbus.server import Endpoint, Loopback
from compstiff.cli.push import push
from identification.common.findings import CompstiffError
from tests.compensator.modbus import tables_and_devices as kit
from tests.support import compstiff_process, free_port, started

LIMITS = "limits: {max_offset_mm: 2.0}"


def offsets_csv(folder: Path, rows: list[list[object]], header: str = "target,ox_mm,oy_mm,oz_mm") -> Path:
    file = folder / "offsets.csv"
    file.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows), ""]))
    return file


def cell_yaml(folder: Path, port: int, more: str = LIMITS) -> Path:
    file = folder / "cell.yaml"
    file.write_text(f"robot: {kit.ROBOT}\ntool: {{position_mm: [120, 0, 250]}}\nmodbus: {{port: {port}}}\n{more}\n")
    return file


def rows_mm(table) -> list[list[object]]:
    return [[target, *(f"{um / 1000:.3f}" for um in row)] for target, row in enumerate(kit.offsets_of(table))]


def call(*arguments: object) -> tuple[int, dict]:
    seen = ["--any-program"] if "--apply" in arguments and "--program" not in arguments else []
    done = CliRunner().invoke(push, [*map(str, arguments), *seen, "--json"])
    return done.exit_code, json.loads(done.stdout)


@pytest.fixture
def listener():
    """A port on which somebody listens and counts."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.2)
        yield server


def test_dry_run_then_apply_then_again(tmp_path):
    device = kit.offset_device(tmp_path / "state")
    (tmp_path / "state").mkdir()
    table = kit.random_table(1)
    file = offsets_csv(tmp_path, rows_mm(table))
    with Loopback(device) as server:
        described = cell_yaml(tmp_path, server.port)
        shown = CliRunner().invoke(push, [str(described), str(file)])
        assert shown.exit_code == 0
        largest = np.linalg.norm(np.array(kit.offsets_of(table)), axis=1)
        for text in (f"127.0.0.1:{server.port}", "rows: 90, targets 0 to 89, ",
                     f"{largest.max() / 1000:.4f} mm at target {largest.argmax()}", "limit 2 mm", "active table: none",
                     "dry run"):
            assert text in shown.stdout
        assert (device.active, list((tmp_path / "state").iterdir())) == (None, [])
        assert not (tmp_path / "push-log.jsonl").exists()

        code, document = call(described, file, "--apply")
        assert (code, document["result"]["results"]) == (0, ["committed"])
        assert kit.rows_on_disk(tmp_path / "state") == kit.offsets_of(table)

        code, document = call(described, file, "--apply")
        assert (code, document["result"]["results"]) == (0, ["already active"])

        changed = rows_mm(table)
        changed[4][2] = "0.001"
        code, document = call(described, offsets_csv(tmp_path, changed))
        assert document["result"]["difference"] == {
            "same": False, "rows_in_both": 90, "rows_changed": 1, "rows_only_new": 0, "rows_only_active": 0,
            "largest_change_mm": abs(kit.offsets_of(table)[4][1] - 1) / 1000}
        assert kit.rows_on_disk(tmp_path / "state") == kit.offsets_of(table)
    log = [json.loads(line) for line in (tmp_path / "push-log.jsonl").read_text().splitlines()]
    assert [(line["result"], line.get("exit_code")) for line in log] == [
        ("started", None), ("committed", 0), ("started", None), ("already active", 0)]
    assert all(line["sha256"] and line["user"] and line["time"] and line["tables"] == [table.header.name] for line in log)


def test_the_log_has_the_hash_of_what_was_read_and_not_of_what_stands_there_now(tmp_path):
    device = kit.offset_device(tmp_path / "state")
    (tmp_path / "state").mkdir()
    file = offsets_csv(tmp_path, rows_mm(kit.random_table(1)))
    sent = hashlib.sha256(file.read_bytes()).hexdigest()
    offsets = compstiff_api.read_offsets(file, reach_mm=10.0)
    file.write_text("something else")
    with Loopback(device) as server:
        cell = compstiff_api.read_cell(cell_yaml(tmp_path, server.port))
        log = tmp_path / "log.jsonl"
        compstiff_api.push(cell, offsets, compstiff_api.Address("127.0.0.1", server.port, 1), apply=True, log=log)
    assert {json.loads(line)["sha256"] for line in log.read_text().splitlines()} == {sent}


@pytest.mark.parametrize(("row", "code", "exit_code"), [
    ([0, 1.5, 1.5, 0], "CS5003", 3), ([0, 2.001, 0, 0], "CS5003", 3), ([0, "nan", 0, 0], "CS0203", 1),
    ([0, "inf", 0, 0], "CS0203", 1),
    ([0, 1, "", 0], "CS5006", 1), ([1.5, 0, 0, 0], "CS5001", 1),
])
def test_bad_offsets_are_refused_before_a_connection_is_opened(tmp_path, listener, row, code, exit_code):
    described, file = cell_yaml(tmp_path, listener.getsockname()[1]), offsets_csv(tmp_path, [row])
    answered, document = call(described, file, "--apply")
    assert (answered, document["findings"][0]["code"]) == (exit_code, code)
    assert document["findings"][0]["line"] == 2
    with pytest.raises(TimeoutError):
        listener.accept()


@pytest.mark.parametrize(("rows", "words"), [
    ([[5, 2.001, 0, 0], [6, 1.5, 1.5, 0], [7, 1.9, 0, 0]],
     "2 offsets over the limit: the largest is 2.1213 mm at target 6, the limit 2 mm"),
    ([[0, 0, 0, -2.0004]], "1 offset over the limit: the largest is 2.0004 mm at target 0, the limit 2 mm")])
def test_offsets_over_the_limit_are_counted_and_the_largest_is_named(tmp_path, rows, words):
    code, document = call(cell_yaml(tmp_path, 1), offsets_csv(tmp_path, rows))
    (found,) = (one for one in document["findings"] if one["level"] == "error")
    assert (code, found["code"], found["message"]) == (3, "CS5003", words)
    assert found["target"] == int(words.split(" at target ")[1].split(",")[0])
    assert found["line"] == 2 + [row[0] for row in rows].index(found["target"])


@pytest.mark.parametrize(("targets", "line", "words"), [
    ((0, 1, 3), 4, "found 3 where 2 should follow"), ((4, 5, 5), 4, "found 5 where 6 should follow"),
    ((4, 3), 3, "found 3 where 5 should follow"), ((-1, 0), 2, "found -1, expected a whole number from 0"),
    ((0.5, 1.5), 2, "found 0.5, expected a whole number from 0"), ((4, 5, 6), None, ""), ((0,), None, "")])
def test_targets_are_counted_up_without_gaps(tmp_path, targets, line, words):
    file = offsets_csv(tmp_path, [[target, 0, 0, 0.1] for target in targets])
    if not words:
        assert compstiff_api.read_offsets(file, reach_mm=10.0).first == targets[0]
        return
    with pytest.raises(compstiff_api.CompstiffError) as stopped:
        compstiff_api.read_offsets(file, reach_mm=10.0)
    (found,) = stopped.value.findings
    assert (found.code, found.line, found.message) == ("CS5001", line, f"column 'target': {words}")


@pytest.mark.parametrize(("mm", "exit_code"), [(32.766, 4), (-32.766, 4), (32.767, 3), (-32.767, 3), (-32.768, 3), (40, 3)])
def test_what_does_not_fit_into_16_bits_is_refused(tmp_path, listener, mm, exit_code):
    """32.766 mm is the last that fits: it goes on to a cell that does not answer."""
    described = cell_yaml(tmp_path, listener.getsockname()[1], "limits: {max_offset_mm: 100}")
    file = offsets_csv(tmp_path, [[0, 0, mm, 0]])
    answered, document = call(described, file, "--apply", "--timeout", "0.05", "--retries", "0")
    assert (answered, document["findings"][0]["code"]) == (exit_code, "CS5004" if exit_code == 3 else "CS5012")


def test_the_target_whose_component_does_not_fit_is_named(tmp_path):
    """Not the longest offset, whose components fit."""
    code, document = call(cell_yaml(tmp_path, 1, "limits: {max_offset_mm: 100}"),
                          offsets_csv(tmp_path, [[4, 32.7, 32.7, 0], [5, 0, -32.767, 0], [6, 0, 0, 0]]))
    (found,) = (one for one in document["findings"] if one["level"] == "error")
    assert (code, found["code"], found["target"], found["line"]) == (3, "CS5004", 5, 3)
    assert found["message"].startswith("an offset component of 32.7670 mm does not fit")


def test_exactly_the_limit_passes(tmp_path):
    device = kit.offset_device()
    with Loopback(device) as server:
        file = offsets_csv(tmp_path, [[0, 1.2, -1.6, 0], [1, 2, 0, 0], [2, 0, 0, -2.0], [3, 1.154700, 1.154700, 1.154700]])
        assert call(cell_yaml(tmp_path, server.port), file, "--apply")[0] == 0
    sent = (device.active.registers.astype(int) - 32768).tolist()
    assert sent == [[1200, -1600, 0], [2000, 0, 0], [0, 0, -2000], [1155, 1155, 1155]]


@pytest.mark.parametrize(("cells", "code", "words"), [
    ("0.1,0.2,0", "", ""), ("0.1,,0", "CS5006", "an offset with 1 empty cell of three"),
    (",,0", "CS5006", "an offset with 2 empty cells of three"), (",,", "CS5002", "1 target without an offset: 0 is sent")])
def test_an_offset_is_there_or_not(tmp_path, cells, code, words):
    """Of the second target, with its line."""
    file = tmp_path / "offsets.csv"
    file.write_text(f"target,ox_mm,oy_mm,oz_mm\n4,1,0,0\n5,{cells}\n6,1,0,0\n")
    if code == "CS5006":
        with pytest.raises(CompstiffError) as stopped:
            compstiff_api.read_offsets(file, reach_mm=10.0)
        found = stopped.value.findings
    else:
        read = compstiff_api.read_offsets(file, reach_mm=10.0)
        found = [one for one in read.findings if one.code == "CS5002"]
        assert (1e3 * read.offset).tolist() == [[1, 0, 0], [0, 0, 0] if code else [0.1, 0.2, 0], [1, 0, 0]]
    assert [(one.code, one.message, one.file, one.line) for one in found] == [(code, words, str(file), 3)] * bool(code)


def test_empty_offsets_go_as_zero_and_the_turn_not_sent_is_said(tmp_path):
    device = kit.offset_device()
    with Loopback(device) as server:
        file = offsets_csv(tmp_path, [[7, "", "", "", 0, 0, 0], [8, 0.1, 0, 0, 0.03, 0, 0.04]],
                           "target,ox_mm,oy_mm,oz_mm,orx_deg,ory_deg,orz_deg")
        code, document = call(cell_yaml(tmp_path, server.port), file, "--apply", "--reach", "20")
    assert code == 0
    assert device.active.header.first == 7
    assert (device.active.registers.astype(int) - 32768).tolist() == [[0, 0, 0], [100, 0, 0]]
    said = {finding["code"]: finding["message"] for finding in document["findings"]}
    assert "1 target without an offset" in said["CS5002"]
    # 0.05 degrees at 20 mm: 17.45 um.
    assert "0.0500 deg (target 8)" in said["CS5005"]
    assert "20 mm from it up to 17.5 um" in said["CS5005"]


@pytest.mark.parametrize(("header", "turn", "code"), [
    ("", "", "CS5007"), (",orx_deg,ory_deg,orz_deg", ",,,", "CS5007"), (",orx_deg,ory_deg,orz_deg", ",0,0,0", "CS5005")])
def test_a_turn_that_the_file_does_not_say_is_not_taken_for_none(tmp_path, header, turn, code):
    """No columns, empty ones, and one target of two that says it."""
    file = tmp_path / "offsets.csv"
    file.write_text(f"target,ox_mm,oy_mm,oz_mm{header}\n0,0.1,0,0{turn}\n1,0.1,0,0{',,,' if header else ''}\n")
    findings = compstiff_api.read_offsets(file, reach_mm=10.0).findings
    assert [(finding.code, finding.level, finding.file) for finding in findings] == [(code, "note", str(file))]
    assert ("the error that leaves is not known" in findings[0].message) == (code == "CS5007")


@pytest.mark.parametrize(("rows", "windows"), [(100, 0), (101, 2), (250, 3)])
def test_a_program_that_goes_in_several_windows_is_told_so(tmp_path, rows, windows):
    file = offsets_csv(tmp_path, rows_mm(kit.random_table(1, rows=rows)))
    with Loopback(kit.offset_device(window_rows=100)) as server:
        code, document = call(cell_yaml(tmp_path, server.port), file)
    said = [(finding["level"], finding["message"], finding["file"]) for finding in document["findings"]
            if finding["code"] == "CS5021"]
    assert (code, len(document["result"]["tables"])) == (0, max(windows, 1))
    assert said == ([("note", f"{rows} rows go in {windows} windows of up to 100: each is active whole or not at all, the "
                      "program as a whole is not", str(file))] if windows else [])


@pytest.mark.parametrize(("rows", "told"), [(20_000, False), (20_001, True)])
def test_windows_are_told_also_where_the_cell_is_not_asked(tmp_path, rows, told):
    cell = compstiff_api.read_cell(cell_yaml(tmp_path, 1))
    offsets = compstiff_api.read_offsets(offsets_csv(tmp_path, [[target, 0, 0, 0] for target in range(rows)]), reach_mm=10.0)
    planned = compstiff_api.push(cell, offsets, compstiff_api.Address("127.0.0.1", free_port(), 1))
    said = {finding.code: finding.message for finding in planned.findings}
    assert ("CS5021" in said, "CS5015" in said) == (told, True)
    assert not told or "20001 rows go in 2 windows of up to 20000" in said["CS5021"]


def test_a_busy_cell_is_waited_for_as_long_as_patience_says(tmp_path):
    """Another writer's transfer, until it has been silent for a second."""
    device = kit.offset_device(lease_s=1.0)
    with Loopback(device) as server:
        described, file = cell_yaml(tmp_path, server.port), offsets_csv(tmp_path, rows_mm(kit.random_table(2)))
        other = kit.random_table(3).header.registers()
        device.write(at.COMMAND, [at.Command.BEGIN, *other])
        code, document = call(described, file, "--apply", "--patience", "0.01")
        [busy] = [finding for finding in document["findings"] if finding["level"] == "error"]
        assert (code, busy["code"], device.active) == (4, "CS5013", None)
        assert busy["message"] == "the cell is busy: another writer's transfer is under way; old table active (read back): none"
        assert call(described, file, "--apply", "--patience", "60")[0] == 0
    assert device.active.header == kit.random_table(2).header


def test_the_receiver_is_written_by_the_dry_run_and_not_in_the_way_of_the_same_call_with_apply(tmp_path):
    device, module = kit.offset_device(), tmp_path / "receiver.mod"
    with Loopback(device) as server:
        described, file = cell_yaml(tmp_path, server.port), offsets_csv(tmp_path, rows_mm(kit.random_table(1)))
        assert call(described, file, "--receiver", module)[0] == 0
        assert f"nCsIdLo:={kit.random_table(1).header.id & 65535};" in module.read_text()
        assert call(described, file, "--receiver", module, "--apply")[0] == 0
        other = offsets_csv(tmp_path, rows_mm(kit.random_table(2)))
        code, document = call(described, other, "--receiver", module, "--apply")
        assert (code, document["findings"][0]["code"], device.active.header) == (1, "CS0003", kit.random_table(1).header)
        assert call(described, other, "--receiver", module, "--apply", "--force")[0] == 0


def test_gaps_in_the_targets_are_an_error_with_their_line(tmp_path):
    file = offsets_csv(tmp_path, [[0, 0, 0, 0], [1, 0, 0, 0], [3, 0, 0, 0]])
    code, document = call(cell_yaml(tmp_path, 1), file)
    assert (code, document["findings"][0]["code"], document["findings"][0]["line"]) == (1, "CS5001", 4)
    assert call(cell_yaml(tmp_path, 1), offsets_csv(tmp_path, []))[0] == 1


def test_without_a_cell(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    described, file = cell_yaml(tmp_path, port), offsets_csv(tmp_path, [[0, 0, 0, 0]])
    code, document = call(described, file)
    assert (code, document["status"], document["result"]["difference"]) == (0, "ok", None)
    assert "CS5015" in [finding["code"] for finding in document["findings"]]
    code, document = call(described, file, "--apply", "--retries", "1")
    assert (code, document["findings"][0]["code"]) == (4, "CS5012")
    assert "state unknown" in document["findings"][0]["message"]


def test_a_wrong_device_and_another_robots_cell_are_refused(tmp_path):
    from pyModbusTCP.server import ModbusServer

    file = offsets_csv(tmp_path, [[0, 0, 0, 0]])
    other = ModbusServer("127.0.0.1", free_port(), no_block=True)
    other.start()
    try:
        code, document = call(cell_yaml(tmp_path, other.port), file, "--apply")
    finally:
        other.stop()
    assert (code, document["findings"][0]["code"]) == (3, "CS5010")
    device = kit.offset_device()
    device.robot_id ^= 1
    with Loopback(device) as server:
        code, document = call(cell_yaml(tmp_path, server.port), file, "--apply")
    assert (code, document["findings"][0]["code"], device.active) == (3, "CS5010", None)


def test_a_cell_with_a_lower_limit_refuses_too(tmp_path):
    device = kit.offset_device()
    device.limit_um = 500
    with Loopback(device) as server:
        code, document = call(cell_yaml(tmp_path, server.port), offsets_csv(tmp_path, [[0, 0, 0.6, 0]]), "--apply")
        assert (code, document["findings"][0]["code"]) == (3, "CS5011")
        # and one that only says so when the page comes
        registers = kit.to_registers(np.array([[0, 600, 0]]))
        ending = kit.push(server.port, kit.OffsetTable.of(registers, 0, 1, 1, 1))
    assert (ending.code, device.active) == (3, None)
    assert "an offset over its limit; old table active (read back)" in ending.text


def test_a_log_that_cannot_be_written_stops_the_push(tmp_path):
    device = kit.offset_device()
    with Loopback(device) as server:
        code, document = call(cell_yaml(tmp_path, server.port), offsets_csv(tmp_path, [[0, 0, 0, 0]]), "--apply", "--log",
                              tmp_path / "no" / "log")
    assert (code, document["findings"][0]["code"], device.active) == (1, "CS0004", None)


def test_the_cell_command_says_what_is_wrong(tmp_path, listener):
    described = cell_yaml(tmp_path, listener.getsockname()[1])
    busy = compstiff_process("cell", described)
    assert busy.returncode == 1
    assert "CS5103: cannot listen on 127.0.0.1" in busy.stderr
    assert compstiff_process("cell", described, "--tls-key", described).returncode == 2
    wrong = compstiff_process("cell", described, "--tls-key", described, "--tls-ca", described, "--tls-cert", described)
    assert wrong.returncode == 1
    assert "CS5105" in wrong.stderr


def test_the_cell_stops_on_signals_and_warns_where_it_is_open(tmp_path):
    import signal
    import subprocess

    described = cell_yaml(tmp_path, 1)
    for sent, code in ((signal.SIGINT, 130), (signal.SIGTERM, 0)):
        with started(sys.executable, "-m", "compstiff", "cell", described, "--port", "0", "--json", stdout=subprocess.PIPE,
                     stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr
            assert process.stderr.readline().startswith("listening on 127.0.0.1:")
            process.send_signal(sent)
            stdout, _ = process.communicate(timeout=60)
        document = json.loads(stdout)
        assert (process.returncode, document["exit_code"]) == (code, code)
        assert [finding["code"] for finding in document["findings"]] == ["CS5106"]


@pytest.mark.parametrize(("host", "told"), [
    ("127.0.0.1", False), ("127.0.0.2", False), ("localhost", False), ("0.0.0.0", True)])
def test_a_cell_that_the_network_reaches_is_told(tmp_path, host, told):
    served = kit.served_and_stopped(compstiff_api.read_cell(cell_yaml(tmp_path, 1)), Endpoint(host, 0, 1))
    said = {finding.code: finding for finding in served.findings}
    assert ("CS5104" in said, "CS5106" in said) == (told, True)
    assert not told or (said["CS5104"].level, said["CS5104"].message) == (
        "warning", "listening on 0.0.0.0: Modbus has no login, whoever reaches this port can change offsets")


def test_ctrl_c_while_a_push_waits_says_what_is_active(tmp_path):
    import signal
    import subprocess
    import time

    device, old = kit.offset_device(lease_s=60.0), kit.random_table(1)
    kit.load(device, old)
    with Loopback(device) as server:
        device.write(96, [1, *kit.random_table(3).header.registers()])
        described, file = cell_yaml(tmp_path, server.port), offsets_csv(tmp_path, rows_mm(kit.random_table(2)))
        with started(sys.executable, "-m", "compstiff", "push", described, file, "--any-program", "--apply", "--patience", "60",
                     stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            until = time.monotonic() + 60
            while device.result != 7:
                assert time.monotonic() < until, "the push never asked for the busy cell"
                time.sleep(0.02)
            process.send_signal(signal.SIGINT)
            _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "CS5018: interrupted; old table active (read back)" in stderr
    assert json.loads((tmp_path / "push-log.jsonl").read_text().splitlines()[-1])["result"] == "interrupted"


@pytest.mark.parametrize("unit", [0, 255])
def test_any_unit(tmp_path, unit):
    device = kit.offset_device()
    with Loopback(device, unit=unit) as server:
        file = offsets_csv(tmp_path, [[0, 0.5, 0, 0]])
        assert call(cell_yaml(tmp_path, server.port), file, "--apply", "--unit", unit)[0] == 0
        if unit:
            assert call(cell_yaml(tmp_path, server.port), file, "--apply", "--unit", 3, "--retries", 0)[0] == 4


def planned(folder: Path, places: list[list[float]], name: str = "part.mod") -> Path:
    """A RAPID program with these targets [mm], in the order of the file."""
    moves = "".join(f"    MoveL [[{x:.4f},{y:.4f},{z:.4f}],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z0,tool0;\n"
                    for x, y, z in places)
    file = folder / name
    file.write_text(f"MODULE Part\n  PROC main()\n{moves}  ENDPROC\nENDMODULE\n")
    return file


PLACES = [[900 + 5.0 * k, 100 - 3.0 * k, 600.0] for k in range(30)]
SHIFT = [0.31, -0.12, 0.05]


def with_places(folder: Path, places: list[list[float]]) -> Path:
    return offsets_csv(folder, [[k, *place, *(SHIFT if k > 3 else [0, 0, 0])] for k, place in enumerate(places)],
                       "target,x_mm,y_mm,z_mm,ox_mm,oy_mm,oz_mm")


def moved(by: float, target: int) -> list[list[float]]:
    return [[x, y + by * (k == target), z] for k, (x, y, z) in enumerate(PLACES)]


def corrected(by: float = 0.0) -> list[list[float]]:
    """The program with these offsets in it; by [mm]: off that along x, at one target."""
    return [[a + b + by * (k == 9 and axis == 0) for axis, (a, b) in enumerate(zip(
        place, SHIFT if k > 3 else [0, 0, 0], strict=True))] for k, place in enumerate(PLACES)]


@pytest.mark.parametrize(("program", "code"), [
    (PLACES, None), (moved(0.01, 7), "CS5022"), (PLACES[:-1], "CS5022"), (PLACES[1:], "CS5022"),
    ([*PLACES, [1, 2, 3]], "CS5022"), (PLACES[::-1], "CS5022"),
    (corrected(), "CS5023"), (corrected(1.9e-3), "CS5023"), (corrected(2.1e-3), "CS5022"),
    (moved(1.9e-3, 7), None), (moved(2.1e-3, 7), "CS5022"), (corrected()[:-1], "CS5022"),
])
def test_only_the_program_they_were_made_for_gets_the_offsets(tmp_path, program, code):
    device = kit.offset_device()
    with Loopback(device) as server:
        described, file = cell_yaml(tmp_path, server.port), with_places(tmp_path, PLACES)
        answered, document = call(described, file, "--program", planned(tmp_path, program), "--apply")
    codes = [finding["code"] for finding in document["findings"] if finding["level"] == "error"]
    assert (answered, codes) == ((0, []) if code is None else (3, [code]))
    assert (device.active is not None) == (code is None)
    assert "CS5024" not in [finding["code"] for finding in document["findings"]]
    if program in (moved(0.01, 7), moved(2.1e-3, 7)):
        assert f"target 7 is {program[7][1] - PLACES[7][1]:.4g} mm from where the program has it" in document["findings"][0][
            "message"]


def test_without_planned_places_the_number_of_targets_is_what_is_held(tmp_path):
    device = kit.offset_device()
    with Loopback(device) as server:
        described = cell_yaml(tmp_path, server.port)
        file = offsets_csv(tmp_path, [[k, *SHIFT] for k in range(30)])
        for places, exit_code, code in ((PLACES[:-1], 3, "CS5022"), (moved(1.0, 3), 0, "CS5024")):
            answered, document = call(described, file, "--program", planned(tmp_path, places), "--apply")
            assert (answered, code in [finding["code"] for finding in document["findings"]]) == (exit_code, True)


def test_nothing_is_sent_where_nobody_says_which_program_runs(tmp_path, listener):
    described, file = cell_yaml(tmp_path, listener.getsockname()[1]), with_places(tmp_path, PLACES)
    done = CliRunner().invoke(push, [str(described), str(file), "--apply"])
    assert done.exit_code == 2
    assert "--program" in done.stderr
    with pytest.raises(TimeoutError):
        listener.accept()


def test_a_script_waits_as_long_and_asks_as_often_as_the_command():
    stated = {option.name: option.default for option in push.params}
    address, waiting = Address("192.0.2.1", 1502, 1), Waiting()
    assert (address.timeout_s, address.retries, address.tls) == (stated["timeout"], stated["retries"], None)
    assert (waiting.patience_s, waiting.robot_s, waiting.restart) == (
        stated["patience"], stated["robot_wait"], False)
