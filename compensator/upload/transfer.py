"""A file onto the controller under a new name: written beside it, read back, renamed, read back; and what is there if not.

The new name is given only to a file that was read back whole, so it is there whole or not at all, and nothing that was there
is written over.
"""

from __future__ import annotations

import hashlib

from compensator.upload.address import Controller
from compensator.upload.answers import Answered, Lost
from compensator.upload.remote import Remote
from compensator.upload.session import PASSING
from identification.common.findings import CompstiffError, Finding, Refused, Unconfirmed

NEW = "the new file is there, whole (read back)"
OLD = "the new file is not there, what was there is as it was"
UNKNOWN = "state unknown: the new file is there whole, or not at all"


def place(remote: Remote, folder: str, name: str, content: bytes) -> str:
    """Writes the file; returns "uploaded" or "already there". Raises Refused: CS6111 the name is taken by another content,
    CS6113 and CS6106 the controller does not do it; Unconfirmed: CS6109 it was lost, CS6112 what is read back differs. Every
    message says what is there."""
    final, part, digest = f"{folder}/{name}", f"{folder}/{name}.part", _digest(content)
    try:
        before = remote.read(final)
    except (Lost, Answered) as reason:
        raise stopped(remote.session.controller, reason, OLD) from reason
    if before is not None:
        if _digest(before) == digest:
            return "already there"
        raise name_taken(final, before)
    _write(remote, part, content, digest)
    _give_name(remote, part, final, digest)
    return "uploaded"


def name_taken(path: str, there: bytes) -> Refused:
    """That the name belongs to another content (CS6111)."""
    return Refused(Finding("CS6111", "error", f"the controller has another file {path} already, {len(there)} bytes; {OLD}",
                           hint="give another --name: nothing is written over"))


def _write(remote: Remote, part: str, content: bytes, digest: str) -> None:
    try:
        remote.write(part, content)
        # A second look, should the first one have been spoilt on its way.
        same = any(_digest(remote.read(part)) == digest for _ in range(2))
    except (Lost, Answered) as reason:
        raise stopped(remote.session.controller, reason, OLD + _tidied(remote, part)) from reason
    if not same:
        raise Unconfirmed(Finding("CS6112", "error", f"what is read back of {part} is not what was sent; {OLD}"
                                  f"{_tidied(remote, part)}", hint="free some space on the controller and upload again"))


def _give_name(remote: Remote, part: str, final: str, digest: str) -> None:
    failure: Exception | None = None
    try:
        remote.rename(part, final.rpartition("/")[2])
    except (Lost, Answered) as reason:
        failure = reason
    controller = remote.session.controller
    # Without the part a rename that is still on its way can no longer succeed.
    left = _tidied(remote, part) if failure else ""
    try:
        back = remote.read(final)
        if back is not None and _digest(back) != digest:
            back = remote.read(final)
    except (Lost, Answered) as reason:
        raise stopped(controller, Lost(str(failure or reason)), UNKNOWN) from reason
    if _digest(back) == digest:
        return
    if back is not None:
        raise Unconfirmed(Finding("CS6112", "error", f"what is read back of {final} is not what was sent", hint="do not load "
                                  "it; delete it on the controller and upload again"))
    if failure is None or left:
        raise stopped(controller, Lost(str(failure or "the file does not have its new name")), UNKNOWN)
    raise stopped(controller, failure, OLD)


def _tidied(remote: Remote, part: str) -> str:
    """Deletes what is half written; says where that could not be."""
    try:
        remote.delete(part)
    except (Lost, Answered):
        return f" ({part} may be left)"
    return ""


def stopped(controller: Controller, reason: Exception, state: str) -> CompstiffError:
    """Why it ended, and what is there now: lost or busy (CS6109, Unconfirmed), login (CS6106) or another refusal (CS6113)."""
    again = "upload again: that settles it and does no harm"
    if isinstance(reason, Answered) and reason.status == 401:
        return Refused(Finding("CS6106", "error", f"{controller.url} refuses the login of '{controller.user}'; {state}",
                               hint="check controller.user and the password; several wrong ones may lock the user"))
    if isinstance(reason, Answered) and reason.status not in PASSING:
        return Refused(Finding("CS6113", "error", f"{controller.url} refuses: {reason}; {state}",
                               hint="check the folder, the space and the rights of the user on the controller"))
    return Unconfirmed(Finding("CS6109", "error", f"no sound answer from {controller.url} ({reason}); {state}", hint=again))


def _digest(content: bytes | None) -> str:
    return "" if content is None else hashlib.sha256(content).hexdigest()
