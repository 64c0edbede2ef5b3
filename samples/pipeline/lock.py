"""The locks of the container: which file of which version of each package pip would install here, with its SHA-256.

    python3.12 -m venv lock && lock/bin/python samples/pipeline/lock.py        # on Linux, x86-64, CPython 3.12, as the image is

Writes requirements.lock (what compstiff runs on) and build.lock (what builds it) beside this file, from pyproject.toml. They
are of one system and one Python: pip refuses them on another. Asks the registry that pip is set to.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent


def resolved(requirements: list[str]) -> dict[str, Any]:
    """pip's report on what it would install into an empty environment, ready builds alone."""
    asked = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--ignore-installed", "--only-binary", ":all:",
             "--report", "-", *requirements]
    done = subprocess.run(asked, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def locked(report: dict[str, Any]) -> str:
    """Its lines for `pip install --require-hashes`, in the order of the names."""
    lines = []
    for entry in report["install"]:
        digest = entry["download_info"]["archive_info"]["hashes"]["sha256"]
        name = entry["metadata"]["name"].lower().replace("_", "-")
        lines.append(f"{name}=={entry['metadata']['version']} --hash=sha256:{digest}\n")
    system = report["environment"]
    return (f"# {system['platform_system']} {system['platform_machine']}, CPython {system['python_version']}; "
            "made by samples/pipeline/lock.py\n" + "".join(sorted(lines)))


def main() -> None:
    """Writes both."""
    project = tomllib.loads((HERE.parents[1] / "pyproject.toml").read_text(encoding="utf-8"))
    for name, wanted in (("requirements", project["project"]["dependencies"]), ("build", project["build-system"]["requires"])):
        (HERE / f"{name}.lock").write_text(locked(resolved(wanted)), encoding="utf-8")


if __name__ == "__main__":
    main()
