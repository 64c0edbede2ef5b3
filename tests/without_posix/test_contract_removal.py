"""The removal takes away what it says; and what the program does where it is gone, which tests with POSIX see as well."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from identification.common import files
from identification.common.findings import CompstiffError
from tests.without_posix.removal import ASKED

ROOT = Path(__file__).resolve().parents[2]


def without_posix(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs code in a process without POSIX, whatever this one has."""
    return subprocess.run(
        [sys.executable, "-c", f"from tests.without_posix.removal import apply; apply()\n{code}", *map(str, arguments)],
        capture_output=True, text=True, timeout=120, cwd=ROOT, env={**os.environ, ASKED: "1"})


def test_the_packages_see_no_posix_and_their_children_neither() -> None:
    code = ("import subprocess, sys, os\n"
            "import identification.common.files as files, compstiff.batch.finished_files as finished\n"
            "assert files.os.name == 'nt' and not hasattr(files.os, 'getuid') and not hasattr(os, 'fork')\n"
            "assert not hasattr(files.signal, 'SIGKILL') and hasattr(__import__('signal'), 'SIGKILL')\n"
            "exec(\"try:\\n import fcntl\\nexcept ImportError:\\n print('gone')\", {'__name__': 'compstiff.x'})\n"
            "child = 'import os; from compstiff.batch import watch; print(watch.os.name, hasattr(os, \"fork\"))'\n"
            "print(subprocess.run([sys.executable, '-c', child], capture_output=True, text=True).stdout)")
    done = without_posix(code)
    assert done.stdout.split() == ["gone", "nt", "False"], done.stderr


def test_a_file_that_a_reader_holds_open_is_waited_for_then_refused(tmp_path: Path) -> None:
    """All targets keep what they had, those before it too."""
    code = ("import sys, threading, time, pathlib\n"
            "from identification.common.files import write_whole\n"
            "from identification.common.findings import CompstiffError\n"
            "a, b = (pathlib.Path(name) for name in sys.argv[1:])\n"
            "reader = open(b)\n"
            "try:\n    write_whole({a: b'new', b: b'new'})\n"
            "except CompstiffError as stopped:\n    print(stopped.findings[0].code)\n"
            "print(a.read_text(), b.read_text(), sorted(path.name for path in a.parent.iterdir()))\n"
            "threading.Timer(0.3, reader.close).start()\n"
            "write_whole({a: b'new', b: b'new'})\n"
            "print(a.read_text(), b.read_text(), sorted(path.name for path in a.parent.iterdir()))\n")
    for name in ("a", "b"):
        (tmp_path / name).write_text("old")
    done = without_posix(code, tmp_path / "a", tmp_path / "b")
    assert done.stdout.splitlines() == ["CS0050", "old old ['a', 'b']", "new new ['a', 'b']"], done.stderr


@pytest.mark.parametrize("there", [True, False])
def test_files_written_before_one_that_fails_get_back_what_they_had(tmp_path, monkeypatch, there) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    b.write_text("old b")
    if there:
        a.write_text("old a")
    plain = files.os.replace
    monkeypatch.setattr(files, "PAUSES", (0.001,))

    def refuses(source, target):
        if Path(target) == b:
            raise PermissionError(13, "in use", str(target))
        plain(source, target)

    monkeypatch.setattr(files.os, "replace", refuses)
    with pytest.raises(CompstiffError, match="CS0050"):
        files.write_whole({a: b"new", b: b"new"})
    assert (a.exists(), b.read_text()) == (there, "old b")
    assert not there or a.read_text() == "old a"
    assert {path.name for path in tmp_path.iterdir()} == ({"a", "b"} if there else {"b"})


@pytest.mark.parametrize("code_page", ["cp1252", "cp437"])
def test_a_terminal_that_lacks_a_letter_gets_its_number(tmp_path: Path, code_page: str) -> None:
    """In file names that are printed as results (stdout) and in messages (stderr)."""
    content = b"MODULE A\nENDMODULE\n"
    (tmp_path / "a.mod").write_bytes(content)
    (tmp_path / "a.mod.json").write_text(json.dumps({
        "format": "compstiff-correction", "output": {"sha256": hashlib.sha256(content).hexdigest()},
        "input": {"file": "Fr\u00e4se \u03c0\u2192.mod"}, "robot": {"name": "irb6660-205-1.90"}}))
    cell = tmp_path / "Zelle \u03c0\u2192.yaml"
    cell.write_text("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\ncontroller: {host: 127.0.0.1, port: 9}\n")
    environment = {**os.environ, "PYTHONIOENCODING": code_page, "PYTHONUTF8": "0", "COMPSTIFF_CONTROLLER_PASSWORD": "x"}

    def shown(*options: str) -> subprocess.CompletedProcess[bytes]:
        return subprocess.run([sys.executable, "-m", "compstiff", "upload", str(cell), str(tmp_path / "a.mod"), *options],
                              capture_output=True, cwd=ROOT, env=environment)

    done = shown("--retries", "0")
    assert done.returncode == 0, done.stderr
    assert "corrected from Fr\u00e4se \u03c0\u2192.mod".encode(code_page, "backslashreplace") in done.stdout
    cell.write_text("robot: nowhere\ntool: {position_mm: [120, 0, 250]}\n")
    failed = shown()
    assert failed.returncode == 1
    assert "Zelle \u03c0\u2192.yaml: error CS0104".encode(code_page, "backslashreplace") in failed.stderr


def test_a_path_on_another_drive_has_no_way_to_it(monkeypatch) -> None:
    from compstiff.batch import watch

    def no_way(path, start):
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    assert watch._from(Path("out"), Path("out/x.csv")) == "x.csv"
    monkeypatch.setattr(watch.os.path, "relpath", no_way)
    assert Path(watch._from(Path("out"), Path("x.csv"))).is_absolute()


def test_a_call_to_copy_is_written_for_the_shell_of_the_system() -> None:
    done = without_posix("from compstiff.outcome import call\nprint(call('push', r'C:\\Fräse 1\\cell.yaml', '--apply'))")
    assert done.stdout.strip() == 'compstiff push "C:\\Fräse 1\\cell.yaml" --apply', done.stderr


def test_without_toppra_only_what_needs_it_is_refused(sample_inputs, tmp_path, monkeypatch) -> None:
    """Windows has no ready build of it."""
    from compensator.correction.files import Outputs, correct_files
    from compensator.correction.settings import Settings

    monkeypatch.setitem(sys.modules, "toppra", None)
    outputs = Outputs(tmp_path / "out.mod")
    with pytest.raises(CompstiffError, match="CS0051"):
        correct_files(sample_inputs, outputs, Settings.of(tare=((0, 2),), check_feed=True), overwrite=False)
    assert not list(tmp_path.iterdir())
    correct_files(sample_inputs, outputs, Settings.of(tare=((0, 2),)), overwrite=False)
    assert (tmp_path / "out.mod").exists()
