"""The state directory: whatever instant the power goes at, a restart finds the old table or the new one, whole."""

import errno
import json
import os
import subprocess
import sys

import pytest

from compensator.modbus.registers import Refusal, Result
from compensator.modbus.state import TableFiles, locked
from identification.common.findings import CompstiffError
from tests.compensator.modbus.tables_and_devices import load, offset_device, offsets_of, push, random_table, rows_on_disk
from tests.compensator.modbus.test_contract_device import begin, commit, page, refused

# Dies, as by kill -9, at the n-th call of what touches the disk.
DIE = """
import os, sys
from pathlib import Path
from tests.compensator.modbus.tables_and_devices import load, offset_device, random_table
folder, left = Path(sys.argv[1]), int(sys.argv[2])
device = offset_device(folder)
def dying(call):
    def instead(*arguments, **options):
        global left
        left -= 1
        if left < 0:
            os._exit(9)
        return call(*arguments, **options)
    return instead
for name in ("open", "fsync", "replace", "chmod", "fdopen"):
    setattr(os, name, dying(getattr(os, name)))
load(device, random_table(2))
print("done", flush=True)
os._exit(0)
"""


def test_a_restart_finds_the_old_table_or_the_new_one_whole(tmp_path):
    old, new = random_table(1), random_table(2)
    seen = []
    for calls in range(40):
        folder = tmp_path / str(calls)
        folder.mkdir()
        load(offset_device(folder), old)
        run = subprocess.run([sys.executable, "-c", DIE, str(folder), str(calls)], capture_output=True, text=True, timeout=60)
        active = offset_device(folder).active
        assert active
        assert active.header in (old.header, new.header), run.stderr
        assert (active.registers == (old if active.header == old.header else new).registers).all()
        assert rows_on_disk(folder) == offsets_of(old if active.header == old.header else new)
        assert sorted(path.name for path in folder.iterdir()) == ["active.csv", "active.json"]
        seen.append(active.header == new.header)
        if run.returncode == 0:
            break
        assert run.returncode == 9, run.stderr
    assert run.stdout == "done\n"
    # Old up to one instant, new from there on.
    assert seen == sorted(seen)
    assert 4 < seen.index(True) < len(seen) - 1


@pytest.mark.parametrize("name", ["fsync", "replace"])
@pytest.mark.parametrize("calls", [0, 1])
def test_a_full_disk_leaves_the_old_table(tmp_path, monkeypatch, name, calls):
    old, new = random_table(1), random_table(2)
    device = offset_device(tmp_path)
    load(device, old)
    begin(device, new)
    for number in range(3):
        page(device, new, number)
    real, left = getattr(os, name), [calls]

    def full(*arguments):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(*arguments)

    monkeypatch.setattr(os, name, full)
    refused(Refusal.FAILURE, Result.STORAGE, device, commit, new)
    assert offset_device(tmp_path).active.header == old.header
    assert rows_on_disk(tmp_path) == offsets_of(old)
    monkeypatch.undo()
    commit(device, new)
    assert rows_on_disk(tmp_path) == offsets_of(new)


def test_a_push_onto_a_full_disk_says_so(tmp_path, monkeypatch):
    from compensator.modbus import state
    from compensator.modbus.server import Loopback
    from identification.common.findings import error

    device = offset_device(tmp_path)
    load(device, random_table(1))

    def full(files):
        raise error("CS0004", "No space left on device")

    with Loopback(device) as server:
        monkeypatch.setattr(state, "write_whole", full)
        ending = push(server.port, random_table(2))
        assert ending.code == 4
        assert "state directory cannot be written; old table active (read back)" in ending.text
        assert rows_on_disk(tmp_path) == offsets_of(random_table(1))
        monkeypatch.undo()
        assert push(server.port, random_table(2)).code == 0


def test_no_file_before_the_first_commit(tmp_path):
    device = offset_device(tmp_path)
    begin(device, random_table(1))
    assert list(tmp_path.iterdir()) == []


def test_targets_in_the_file_are_those_of_the_window(tmp_path):
    load(offset_device(tmp_path), random_table(1, first=500, total=590, window=2, windows=2))
    lines = (tmp_path / "active.csv").read_text().splitlines()
    assert (lines[0], lines[1].split(",")[0], lines[-1].split(",")[0]) == ("target,ox_um,oy_um,oz_um", "500", "589")


def test_a_table_that_somebody_changed_is_not_served(tmp_path):
    load(offset_device(tmp_path), random_table(1))
    file = tmp_path / "active.csv"
    content = file.read_text()
    for changed in (content.replace(",", ",1", 5), content[:-5], ""):
        file.write_text(changed)
        with pytest.raises(CompstiffError, match="CS5102"):
            TableFiles(tmp_path).load()
    file.write_text(content)
    assert TableFiles(tmp_path).load().header == random_table(1).header
    (tmp_path / "active.json").unlink()
    with pytest.raises(CompstiffError, match="CS5102"):
        TableFiles(tmp_path).load()


def test_two_cells_do_not_share_a_state_directory(tmp_path):
    folder = tmp_path / "made" / "here"
    with locked(folder), pytest.raises(CompstiffError, match="CS5101"), locked(folder):
        pass
    with locked(folder):
        pass


@pytest.mark.parametrize("key", ["rows", "crc"])
def test_a_header_that_is_of_other_rows_is_not_taken(tmp_path, key):
    """The rows as they were written, beside a header that counts or sums them otherwise."""
    load(offset_device(tmp_path), random_table(1))
    record = json.loads((tmp_path / "active.json").read_text())
    (header,) = record["tables"].values()
    header[key] += 1
    (tmp_path / "active.json").write_text(json.dumps(record))
    with pytest.raises(CompstiffError) as raised:
        offset_device(tmp_path)
    (finding,) = raised.value.findings
    assert (finding.code, finding.file) == ("CS5102", str(tmp_path / "active.csv"))
    assert finding.message == "is not as the cell wrote it (count or CRC differ)"


def test_a_state_directory_that_cannot_be_one_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(CompstiffError) as raised, locked(folder):
            pass
        (finding,) = raised.value.findings
        assert (finding.code, finding.file) == ("CS0004", str(folder))
        assert finding.message.startswith("cannot be used as a state directory: ")
        assert not finding.message.endswith("None")
