"""Text from files and their names stays text: it becomes no line of a program or a log, and no command of a terminal."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from compensator.modbus.receiver import receiver_text
from identification.common import audit
from identification.common.findings import one_line
from tests.compensator.modbus.tables_and_devices import random_table

INTRUDER = "a\n  MoveL p,v5000,fine,tool0;\r! \x1b[2J\u2028b\u0085SetDO doDoor,1;.csv"


def test_a_file_s_name_becomes_no_line_of_the_receiver() -> None:
    text = receiver_text([random_table(3, 3)], 2e-3, "offsets", f"folder/{INTRUDER}", corrwrite=False)
    told = [line for line in text.splitlines() if "MoveL p" in line or "SetDO doDoor" in line]
    assert len(told) == 1
    assert told[0].strip().startswith("!")
    assert text.isascii()
    assert "\x1b" not in text


def test_one_line_is_one_line() -> None:
    assert one_line(INTRUDER) == "a MoveL p,v5000,fine,tool0; ! ?[2J b SetDO doDoor,1;.csv"


def test_user_and_host_forge_no_entry_of_a_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    forged = 'x\n{"time": "2020-01-01", "user": "somebody else"}'
    monkeypatch.setattr("getpass.getuser", lambda: forged)
    monkeypatch.setattr("socket.gethostname", lambda: forged)
    audit.append(tmp_path / "log.jsonl", {"file": forged})
    entries = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert [(entry["user"], entry["host"], entry["file"]) for entry in entries] == [(forged, forged, forged)]


def test_a_torn_line_of_a_log_takes_none_with_it(tmp_path: Path) -> None:
    file = tmp_path / "log.jsonl"
    audit.append(file, {"number": 1})
    file.write_bytes(file.read_bytes() + b'{"time": "2026-')
    audit.append(file, {"number": 2})
    first, torn, second = file.read_text().splitlines()
    assert (json.loads(first)["number"], torn, json.loads(second)["number"]) == (1, '{"time": "2026-', 2)
