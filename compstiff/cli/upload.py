"""The command `upload`: a RAPID module onto the robot controller over Robot Web Services."""

from __future__ import annotations

import dataclasses
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.outcome import Outcome, Session, call

if TYPE_CHECKING:
    from compensator.upload.upload import UploadResult

PASSWORD = "COMPSTIFF_CONTROLLER_PASSWORD"


@command("upload")
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("module_file", metavar="MODULE", type=READABLE)
@click.option("--apply", "applies", is_flag=True, help="Really upload; without it nothing changes.")
@click.option("--load", "task", metavar="TASK", help="Then load the module into this task, such as T_ROB1.")
@click.option("--replace", is_flag=True, help="With --load: also where a module of that name is loaded.")
@click.option("--name", help="Name of the file on the controller.  [default: one that belongs to its content]")
@click.option("--changed", is_flag=True, help="Also a module that was changed since it was corrected.")
@click.option("--host", help="Instead of controller.host.")
@click.option("--port", type=click.IntRange(1, 65535), help="Instead of controller.port.")
@click.option("--user", help="Instead of controller.user.")
@click.option("--timeout", type=click.FloatRange(0.05, 600), default=10.0, show_default=True, help="For every answer [s].")
@click.option("--retries", type=click.IntRange(0, 10), default=3, show_default=True,
              help="Repetitions of what may be done twice.")
@click.option("--log", type=WRITABLE, help="Log of the uploads.  [default: upload-log.jsonl beside CELL]")
def upload(
    session: Session, cell_file: Path, module_file: Path, applies: bool, task: str | None, replace: bool, name: str | None,
    changed: bool, host: str | None, port: int | None, user: str | None, timeout: float, retries: int, log: Path | None,
) -> Outcome:
    """Put a RAPID module onto the controller over Robot Web Services; a dry run unless --apply.

    CELL is cell.yaml with a section controller, MODULE what correct wrote. The file gets a new name, is read back and compared;
    nothing there is written over. It is loaded only with --load. Nothing is started, stopped or moved. The password comes from
    COMPSTIFF_CONTROLLER_PASSWORD or a prompt.
    """
    if replace and not task:
        raise click.UsageError("--replace belongs to --load")
    from compensator.upload.upload import LOG, Wanted
    from compstiff import Controller, read_cell
    from compstiff import upload as upload_module

    session.inputs += [cell_file, module_file]
    cell = read_cell(cell_file, geometry=False)
    nobody = Controller.of(cell, "", host=host, port=port, user=user, timeout_s=timeout, retries=retries)
    controller = dataclasses.replace(nobody, password=_password(session, nobody.url, nobody.user))
    result = upload_module(cell, module_file, controller, apply=applies, wanted=Wanted(name, task, replace, changed),
                           log=log or cell_file.parent / LOG, say=session.say)
    words = sys.argv[1:] if session.command in sys.argv else ["upload", str(cell_file), str(module_file)]
    return Outcome(result.as_dict(), result.findings, result.lines(), _next(result, words, applies))


def _next(result: UploadResult, words: list[str], applies: bool) -> str:
    """The next step; none where nobody could be asked what is there."""
    if applies:
        return (f"set the program pointer in {result.wanted.task}, and run it first in air" if result.wanted.task
                else f"load {result.path} into its task at the controller (or --load TASK), and run it first in air")
    return call(*words, "--apply") if result.seen else ""


def _password(session: Session, url: str, user: str) -> str:
    """From the environment, else from the person at the terminal. Raises CompstiffError (CS6105) where there is neither."""
    from identification.common.findings import error

    if PASSWORD in os.environ:
        return os.environ[PASSWORD]
    if not sys.stdin.isatty() or session.as_json:
        raise error("CS6105", f"no password for '{user}' at {url}", hint=f"set {PASSWORD}, or call it at a terminal")
    prompted: str = click.prompt(f"password of {user} at {url}", hide_input=True, err=True, default="", show_default=False)
    return prompted
