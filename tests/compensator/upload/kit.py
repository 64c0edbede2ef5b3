"""What the upload tests share: a module with its record, a cell, the command called on an emulator, what must hold then."""

from __future__ import annotations

import contextlib
import hashlib
import json
import ssl
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import trustme
from click.testing import CliRunner

from compstiff.cli.upload import upload
from tests.compensator.upload.emulator import PASSWORD, Emulator, RobotController

ROBOT = "irb6660-205-1.90"
ENVIRONMENT = {"COMPSTIFF_CONTROLLER_PASSWORD": PASSWORD}


def module_text(name: str = "Insert", moves: int = 200) -> bytes:
    """A module with line ends as CAM systems write them, and a letter that is no ASCII."""
    rows = "".join(f"    MoveL [[{k}.1234,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tool0; ! Fräse\r\n"
                   for k in range(moves))
    return f"MODULE {name}\r\n  PROC main()\r\n{rows}  ENDPROC\r\nENDMODULE\r\n".encode("latin-1")


def write_module(folder: Path, name: str = "part_corrected.mod", content: bytes | None = None, robot: str = ROBOT,
                 record: bool = True) -> Path:
    file = folder / name
    file.write_bytes(module_text() if content is None else content)
    if record:
        named = {key: {"file": f"{key}.x", "sha256": "0"} for key in ("input", "stiffness", "cell", "forces")}
        (folder / f"{name}.json").write_text(json.dumps({
            "format": "compstiff-correction", "version": 1, **named, "parts": [], "robot": {"name": robot},
            "output": {"file": name, "sha256": hashlib.sha256(file.read_bytes()).hexdigest()},
            "summary": {"targets": 12, "corrected": 9, "offset_mm": {"largest": 0.1234, "rms": 0.1}}}))
    return file


def cell_yaml(folder: Path, port: int, more: str = "tls: false") -> Path:
    file = folder / "cell.yaml"
    file.write_text(f"robot: {ROBOT}\ntool: {{position_mm: [120, 0, 250]}}\n"
                    f"controller: {{host: 127.0.0.1, port: {port}, {more}}}\n")
    return file


@dataclass(frozen=True)
class Ending:
    """How a call ended: exit code, its JSON document, all it printed."""

    code: int
    document: dict
    text: str

    @property
    def codes(self) -> list[str]:
        return [finding["code"] for finding in self.document["findings"]]

    @property
    def message(self) -> str:
        return " ".join(finding["message"] for finding in self.document["findings"])


def call(*arguments: object, environment: dict[str, str] | None = None) -> Ending:
    done = CliRunner().invoke(upload, [*map(str, arguments), "--json"], env=ENVIRONMENT if environment is None else environment)
    return Ending(done.exit_code, json.loads(done.stdout), done.output)


@cache
def authority() -> trustme.CA:
    return trustme.CA()


@cache
def server_context() -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority().issue_cert("127.0.0.1").configure_cert(context)
    return context


@contextlib.contextmanager
def emulated(folder: Path, controller: RobotController) -> Iterator[Path]:
    """A controller of either generation, and the cell.yaml that finds and believes it."""
    tls = server_context() if controller.generation == 2 else None
    with Emulator(controller, tls) as emulator:
        authority().cert_pem.write_to_path(str(folder / "ca.pem"))
        yield cell_yaml(folder, emulator.port, "ca: ca.pem" if tls else "tls: false")


def new_path(file: Path) -> str:
    """Where the file is to be on the controller, by the documented rule."""
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    return f"HOME/{file.stem}-{digest[:10]}{file.suffix}"


def left_clean(controller: RobotController) -> bool:
    """Nobody logged in, no mastership, nothing half written."""
    return not controller.sessions and controller.holder in (None, "other") and not any(
        name.endswith(".part") for name in controller.files)
