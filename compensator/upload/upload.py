"""`upload`: a RAPID module onto the controller, dry or applied: look, place under a new name, load where asked, log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from compensator.upload.address import Controller
from compensator.upload.answers import Answered, Lost
from compensator.upload.loading import NOT_LOADED, check_loadable, executing, load_module
from compensator.upload.local_module import LocalModule, check_name, read_module
from compensator.upload.remote import Remote, RemoteFile, System, TaskNow
from compensator.upload.session import Session
from compensator.upload.transfer import NEW, OLD, UNKNOWN, name_taken, place, stopped
from identification.common import audit
from identification.common.findings import CompstiffError, Finding, Interrupted, Refused
from identification.model.cell import Cell
from identification.model.controller import check_rapid

LOG = "upload-log.jsonl"


@dataclass(frozen=True)
class Wanted:
    """name: of the file on the controller, else one that belongs to its content. task: load the module into it; replace: also
    in place of one of that name. changed: a module that differs from its record is taken."""

    name: str | None = None
    task: str | None = None
    replace: bool = False
    changed: bool = False


@dataclass(frozen=True, eq=False)
class Seen:
    """What the controller had before. files: those of this program, by their stem; same: whether the new one is among them;
    task: where one was asked about."""

    system: System
    files: tuple[RemoteFile, ...]
    same: bool
    task: TaskNow | None


@dataclass(frozen=True, eq=False)
class UploadResult:
    """What an upload would do, or has done. path: of the file on the controller; seen: None where it could not be asked;
    endings: what was done, none in a dry run."""

    module: LocalModule
    controller: Controller
    path: str
    wanted: Wanted
    seen: Seen | None
    findings: tuple[Finding, ...]
    endings: tuple[str, ...] = ()

    @property
    def applied(self) -> bool:
        """Whether anything was done."""
        return bool(self.endings)

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        seen = self.seen
        return {
            "target": {"url": self.controller.url, "user": self.controller.user, "path": self.path},
            **self.module.as_dict(),
            "controller": seen.system.as_dict() if seen else None,
            "there": [file.as_dict() for file in seen.files] if seen else None,
            "already_there": seen.same if seen else None,
            "load": {"task": self.wanted.task, "replace": self.wanted.replace,
                     "state": seen.task.state if seen and seen.task else None,
                     "loaded_before": seen.task.has(self.module.name) if seen and seen.task else None}
            if self.wanted.task else None,
            "applied": self.applied, "results": list(self.endings),
        }

    def lines(self) -> list[str]:
        """What the terminal shows."""
        shown = [f"controller: {self.controller.url}, user {self.controller.user}"]
        if self.seen:
            system = self.seen.system
            shown[0] += f", system {system.name}, RobotWare {system.version} ({system.dialect})"
        shown += self.module.lines()
        if self.seen:
            shown += [f"there now: {file.name}, {file.size} bytes, {file.modified}" for file in self.seen.files] or [
                "there now: no file of this program"]
            shown.append(f"{'already there, nothing to upload' if self.seen.same else 'new file'}: {self.path}")
            if self.seen.task:
                shown.append(self._load_line(self.seen.task))
        else:
            shown.append(f"new file: {self.path}")
        return [*shown, "; ".join(self.endings) if self.applied else "dry run: nothing was sent"]

    def _load_line(self, task: TaskNow) -> str:
        name = self.module.name
        what = f"would replace the module {name}" if task.has(name) else f"would load the module {name}"
        return f"task {task.name}: {task.state}, {len(task.modules)} modules; {'' if self.applied else what}".rstrip("; ")


def upload(
    cell: Cell, file: str | Path, controller: Controller, *, apply: bool = False, wanted: Wanted | None = None,
    log: Path | None = None, say: Callable[[str], None] = lambda text: None,
) -> UploadResult:
    """Puts the module onto the controller if `apply`; else looks what is there and says what would be done.

    log: file that keeps every upload that is applied; say: called with each step. Never starts, stops or moves anything. Raises
    what `read_module`, `place` and `load_module` raise; Refused: CS6107 certificate, CS6108 no web services, CS6121 another
    system than controller.system, CS6122 no such folder; Unconfirmed: CS6109 (in a dry run a warning, CS6110); Interrupted:
    CS6120; CompstiffError: CS0004 the log, CS0060 another maker's robot.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> nobody = compstiff.Controller("127.0.0.1", "Default User", "secret", port=9, timeout_s=1.0, retries=0)
    >>> dry_run = compstiff.upload(cell, "insert_corrected.mod", nobody)
    >>> [finding.code for finding in dry_run.findings], dry_run.lines()[-1]
    (['CS6110'], 'dry run: nothing was sent')
    """
    wanted = wanted or Wanted()
    check_rapid(cell.robot, "upload loads RAPID", str(file))
    module = read_module(Path(file), cell.robot.name, changed=wanted.changed)
    name = check_name(wanted.name) if wanted.name else module.new_name
    folder = cell.controller.folder
    planned = UploadResult(module, controller, f"{folder}/{name}", wanted, None,
                           (*module.findings, *module.loads(folder, name)))
    try:
        with Session(controller) as session:
            result = _looked(planned, Remote(session), cell.controller.system)
            if apply:
                result = _applied(result, Remote(session), log, say)
    except (Lost, Answered) as reason:
        if apply or isinstance(reason, Answered):
            raise stopped(controller, reason, OLD) from reason
        return _with(planned, Finding("CS6110", "warning", f"{controller.url} could not be asked ({reason}): not compared with "
                                      "what is there", hint=_unreached(controller, str(reason))))
    return result if session.logged_out else _with(result, _not_logged_out(controller))


def _unreached(controller: Controller, reason: str) -> str:
    """What to look at where nobody answers."""
    if controller.tls and "WRONG_VERSION" in reason:
        return "what answers there speaks no TLS: an IRC5 has none, state controller: {tls: false}; or is it another port?"
    if not controller.tls and "disconnected" in reason:
        return "an OmniCore answers over TLS alone: state controller: {tls: true}; or is it another port?"
    return "check controller.host, port and tls"


def _looked(planned: UploadResult, remote: Remote, system: str | None) -> UploadResult:
    """What the controller has of this program, and whether what is wanted can be done. Raises Refused, Lost, Answered."""
    found = remote.system()
    if system is not None and found.name != system:
        raise Refused(Finding("CS6121", "error", f"{planned.controller.url} is the system '{found.name}', the cell states "
                              f"controller.system '{system}'; nothing was sent", hint="check controller.host"))
    folder, _, name = planned.path.rpartition("/")
    try:
        files = remote.files(folder)
    except Answered as answer:
        if answer.status in (400, 404):
            raise Refused(Finding("CS6122", "error", f"the controller has no folder {folder} ({answer}); nothing was sent",
                                  hint="make it at the controller, or state another controller.folder")) from answer
        raise
    module, wanted = planned.module, planned.wanted
    own = tuple(file for file in files if file.name == name or file.name.lower().startswith(module.stem.lower()))
    there = remote.read(planned.path) if any(file.name == name for file in own) else None
    same = there == module.content
    if there is not None and not same:
        raise name_taken(planned.path, there)
    task = remote.task(wanted.task) if wanted.task else None
    if wanted.task:
        check_loadable(task, wanted.task, module.name, replace=wanted.replace)
    findings = (executing(task, "warning"),) if task and task.executes else ()
    return replace(planned, seen=Seen(found, own, same, task), findings=(*planned.findings, *findings))


def _applied(planned: UploadResult, remote: Remote, log: Path | None, say: Callable[[str], None]) -> UploadResult:
    """Places and loads, and logs it."""
    module, wanted = planned.module, planned.wanted
    if planned.seen and planned.seen.task and planned.seen.task.executes:
        raise Refused(executing(planned.seen.task))
    entry = {"module": str(module.file), "sha256": module.sha256, "controller": planned.controller.url,
             "robot_user": planned.controller.user, "path": planned.path, "load": wanted.task, "replace": wanted.replace}

    def keep(**more: Any) -> None:
        if log:
            audit.append(log, {**entry, **more})

    keep(result="started")
    endings: list[str] = []
    try:
        folder, _, name = planned.path.rpartition("/")
        endings.append(f"{place(remote, folder, name, module.content)}, SHA-256 read back: {planned.path}")
        if wanted.task:
            say(endings[0])
            endings.append(load_module(remote, wanted.task, module.name, planned.path, replace=wanted.replace))
    except CompstiffError as failed:
        keep(result=failed.findings[0].message, exit_code=failed.exit_code)
        raise failed.beside(_not_released(planned.controller, remote)) from failed
    except KeyboardInterrupt as interrupt:
        finding = _after_interrupt(planned)
        keep(result=finding.message, exit_code=Interrupted.exit_code)
        raise Interrupted(finding) from interrupt
    keep(result="; ".join(endings), exit_code=0)
    return replace(planned, endings=tuple(endings), findings=(*planned.findings, *_not_released(planned.controller, remote)))


def _after_interrupt(planned: UploadResult) -> Finding:
    """What is there, asked anew; what was half written is taken away first."""
    wanted, module = planned.wanted, planned.module
    try:
        with Session(replace(planned.controller, retries=0)) as session:
            remote = Remote(session)
            remote.delete(f"{planned.path}.part")
            state = NEW if remote.read(planned.path) == module.content else OLD
            if wanted.task:
                before = planned.seen is not None and planned.seen.task is not None and planned.seen.task.has(module.name)
                now = remote.task(wanted.task)
                state += (f", the module {module.name} is loaded in {wanted.task}, the one before or the new one" if before
                          else f", the module {module.name} is loaded in {wanted.task}" if now and now.has(module.name)
                          else f", {NOT_LOADED}")
    except (Lost, Answered, Refused):
        state = UNKNOWN
    return Finding("CS6120", "error", f"interrupted; {state}", hint="upload again to settle it")


def _with(result: UploadResult, finding: Finding) -> UploadResult:
    return replace(result, findings=(*result.findings, finding))


def _not_logged_out(controller: Controller) -> Finding:
    return Finding("CS6119", "warning", f"{controller.url} did not confirm the logout: the session ends there by itself after "
                   "some minutes", hint="nothing to do, unless it happens often: a controller has room for a few dozen of them")


def _not_released(controller: Controller, remote: Remote) -> tuple[Finding, ...]:
    """That mastership may still be held (CS6124), also where loading failed."""
    return () if remote.released else (Finding(
        "CS6124", "warning", f"{controller.url} did not confirm that mastership was given back; the logout ends it",
        hint="where the FlexPendant says that another has control, restart the web services or wait some minutes"),)
