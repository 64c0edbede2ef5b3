"""Brings a headless Chromium for the tests of reports from the npm registry, held against its hash, and prints where it starts.

    COMPSTIFF_BROWSER=$(python tests/runs/reports/fetch_chromium.py) pytest tests/runs/reports

The package @sparticuz/chromium (MIT; Chromium itself BSD) is made for machines without a desktop: one program for Linux on
x86_64, with the libraries such machines lack (NSS, expat), drawing by the processor, and a font. It needs the C library and
libgcc of the system, and no root: it is unpacked once (some 220 MB) below the user's cache folder. npm fetches it, from the
registry that npm is set up for. Only for the tests: the program itself needs no browser.
"""

from __future__ import annotations

import base64
import hashlib
import io
import os
import platform
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from xml.sax.saxutils import escape

PACKAGE, VERSION = "@sparticuz/chromium", "153.0.0"
# sha512 in base64, as npm writes it: `npm view @sparticuz/chromium@VERSION dist.integrity`
INTEGRITY = "jiGWqSvPMdu4+P9TilYqAR7yEGPEHINx+lCvE/NqNO/EHYzF/x1hUiI5T6ioVIt7dEy7n88byyT0vk+dnsgQwA=="
ARCHIVES = ("al2023", "swiftshader", "fonts")
# LANG: with LANG=C this build tells pages a language "en-US@posix", which no page can read.
START = """#!/bin/sh
here=$(dirname "$(readlink -f "$0")")
export LD_LIBRARY_PATH="$here/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" FONTCONFIG_FILE="$here/fonts.conf"
export LANG=en_US.UTF-8 LC_ALL=en_US.UTF-8
exec "$here/chromium" "$@"
"""
# The package's font alone: a page is laid out alike on every computer.
FONTS = """<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig><dir prefix="relative">fonts</dir><cachedir>{cache}</cachedir></fontconfig>
"""


class NoBrowser(Exception):
    """Why there is none, in one sentence."""


def cache() -> Path:
    """The folder of this version, whether it is there or not."""
    root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root) / "compstiff-tests" / f"chromium-{VERSION}"


def fetched(folder: Path) -> bytes:
    """The package as npm downloads it, below `folder`; NoBrowser where it cannot, or where the hash is another."""
    command = ["npm", "pack", f"{PACKAGE}@{VERSION}", "--silent", "--ignore-scripts", "--pack-destination", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    files = list(folder.glob("*.tgz"))
    if done.returncode != 0 or len(files) != 1:
        told = done.stderr.strip()[-300:]
        raise NoBrowser(f"npm pack did not bring {PACKAGE} {VERSION} (exit code {done.returncode}) {told}")
    data = files[0].read_bytes()
    digest = base64.b64encode(hashlib.sha512(data).digest()).decode()
    if digest != INTEGRITY:
        raise NoBrowser(f"{PACKAGE} {VERSION} has the hash sha512-{digest}, expected sha512-{INTEGRITY}: not unpacked")
    return data


def unpacked(package: bytes, folder: Path) -> None:
    """chromium, its libraries in lib/, its fonts, and the script that starts it, into `folder`."""
    inflate = 'process.stdin.pipe(require("zlib").createBrotliDecompress()).pipe(process.stdout)'
    with tarfile.open(fileobj=io.BytesIO(package)) as outer:
        for name in ("chromium", *(f"{archive}.tar" for archive in ARCHIVES)):
            member = outer.extractfile(f"package/bin/{name}.br")
            assert member is not None
            content = subprocess.run(["node", "-e", inflate], input=member.read(), stdout=subprocess.PIPE, check=True).stdout
            if name == "chromium":
                (folder / name).write_bytes(content)
            else:
                with tarfile.open(fileobj=io.BytesIO(content)) as inner:
                    inner.extractall(folder, filter="data")
    (folder / "fonts.conf").write_text(FONTS.format(cache=escape(str(cache() / "fonts-cache"))), encoding="utf-8")
    (folder / "start").write_text(START, encoding="utf-8")
    for program in ("chromium", "start"):
        (folder / program).chmod(0o755)


def browser() -> Path:
    """The script that starts it; fetched where the cache folder has none. NoBrowser says why there is none."""
    place = cache()
    if not (place / "start").is_file():
        if (sys.platform, platform.machine()) != ("linux", "x86_64"):
            raise NoBrowser(f"the package is for Linux on x86_64, this is {sys.platform} on {platform.machine()}")
        if missing := [tool for tool in ("npm", "node") if shutil.which(tool) is None]:
            raise NoBrowser(f"{' and '.join(missing)} not found: Node.js brings both")
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=place.parent) as work:
            whole = Path(work) / "whole"
            whole.mkdir()
            unpacked(fetched(Path(work)), whole)
            # Whole or not at all, and whoever comes second keeps the first.
            if not place.exists():
                whole.rename(place)
    done = subprocess.run([place / "start", "--version"], capture_output=True, text=True, timeout=60)
    if done.returncode != 0:
        raise NoBrowser(f"{place / 'start'} does not start: {done.stderr.strip()[-300:]}")
    return place / "start"


if __name__ == "__main__":
    try:
        print(browser())
    except (NoBrowser, OSError, subprocess.SubprocessError) as reason:
        sys.exit(f"no browser for the tests of reports: {reason}")
