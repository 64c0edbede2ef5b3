"""A module that is on the controller into a task: refused while anything executes, under mastership, looked up afterwards."""

from __future__ import annotations

from compensator.upload.answers import Answered, Lost
from compensator.upload.remote import MastershipRefused, Remote, TaskNow
from compensator.upload.transfer import NEW, stopped
from identification.common.findings import CompstiffError, Finding, Level, Refused, Unconfirmed

NOT_LOADED = "nothing was loaded"
UNKNOWN_LOAD = "state unknown: the module may be loaded or not, whole"
UNKNOWN_REPLACED = "state unknown: the module that is loaded is the one before or the new one, whole"


def check_loadable(now: TaskNow | None, task: str, module: str, *, replace: bool) -> TaskNow:
    """The task. Raises Refused: CS6114 there is none, CS6116 a module of that name is loaded and `replace` not asked for."""
    if now is None:
        raise Refused(Finding("CS6114", "error", f"the controller has no task '{task}'", hint="upper and lower case count"))
    if now.has(module) and not replace:
        raise Refused(Finding("CS6116", "error", f"a module {module} is loaded in {task} already; {NOT_LOADED}",
                              hint="--replace exchanges it"))
    return now


def executing(now: TaskNow, level: Level = "error") -> Finding:
    """That RAPID executes (CS6115)."""
    return Finding("CS6115", level, f"RAPID executes: task {now.name} is '{now.state}', the controller "
                   f"'{now.controller_state}'; {NOT_LOADED}", hint="stop it at the controller; this command never does")


def load_module(remote: Remote, task: str, module: str, path: str, *, replace: bool) -> str:
    """Loads it; returns what is said of that. Raises what `check_loadable` raises; Refused: CS6115 RAPID executes, CS6117 no
    mastership, CS6123 RobotWare 8, CS6113; Unconfirmed: CS6118. Every message says what is loaded."""
    controller = remote.session.controller
    failure: Exception | None = None
    before = False
    try:
        with remote.mastership():
            now = check_loadable(remote.task(task), task, module, replace=replace)
            if now.executes:
                raise Refused(executing(now))
            before = now.has(module)
            try:
                remote.load(task, path, replace=replace)
            except (Lost, Answered) as reason:
                failure = reason
    except MastershipRefused as refusal:
        raise _no_mastership(refusal) from refusal
    except (Lost, Answered) as reason:
        raise stopped(controller, reason, f"{NEW}, {NOT_LOADED}") from reason
    return _looked_up(remote, task, module, before=before, failure=failure)


def _looked_up(remote: Remote, task: str, module: str, *, before: bool, failure: Exception | None) -> str:
    """What is loaded, after mastership was given back: a request that is still on its way can no longer be carried out."""
    unknown = UNKNOWN_REPLACED if before else UNKNOWN_LOAD
    try:
        now = remote.task(task)
    except (Lost, Answered) as reason:
        raise _unconfirmed(str(failure or reason), unknown) from reason
    loaded = now is not None and now.has(module)
    refused = isinstance(failure, Answered) and failure.meant
    if loaded and (failure is None or not before):
        return f"replaced {module} in {task}" if before else f"loaded {module} into {task}"
    if failure is None:
        raise _unconfirmed(f"the controller does not list {module} in {task}", UNKNOWN_LOAD)
    if before and not refused:
        raise _unconfirmed(str(failure), unknown)
    if not remote.released:
        raise _unconfirmed(str(failure), unknown)
    raise stopped(remote.session.controller, failure, f"{NEW}, {NOT_LOADED}")


def _unconfirmed(reason: str, state: str) -> Unconfirmed:
    return Unconfirmed(Finding("CS6118", "error", f"loading was not confirmed ({reason}); {NEW}; {state}",
                               hint="look at the controller, or give the same call again with --replace"))


def _no_mastership(refusal: MastershipRefused) -> CompstiffError:
    if refusal.status == 410:
        return Refused(Finding("CS6123", "error", "this controller has no mastership any more (RobotWare 8): modules are not "
                               f"loaded there; {NEW}, {NOT_LOADED}", hint="load it at the FlexPendant"))
    return Refused(Finding("CS6117", "error", f"mastership over RAPID was refused: {refusal}; {NEW}, {NOT_LOADED}",
                           hint="AUTO mode, no RobotStudio with write access, and a user who may load; then load again"))
