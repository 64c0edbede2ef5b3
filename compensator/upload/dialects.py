"""RWS 1.0 and RWS 2.0: what differs between them in what is asked, and how (docs/rws.md names the source of each line)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import quote

from compensator.upload.answers import State, json_states, xhtml_states


@dataclass(frozen=True)
class Dialect:
    """Paths have {task}, {file} and {action} in them. query: asks for the form of the answer that `states` reads; root: what
    stands before HOME; file_type: of a file's content; form_type: of a form."""

    name: str
    accept: str
    query: str
    root: str
    file_type: str
    form_type: str
    modules_path: str
    load_path: str
    mastership_path: str
    rename_path: str
    rename_form: tuple[tuple[str, str], ...]
    states: Callable[[bytes], list[State]]

    def file(self, path: str) -> str:
        """The resource of a file or folder such as HOME/part.mod."""
        return f"/fileservice/{self.root}{quote(path)}"

    def on_controller(self, path: str) -> str:
        """A file as the controller itself names it, where it is to load it."""
        return f"{self.root}{path}"

    def of_task(self, path: str, task: str) -> str:
        """A path with its task."""
        return path.format(task=quote(task, safe=""))


RWS_1 = Dialect(
    name="RWS 1.0", accept="application/json, application/xhtml+xml, */*", query="json=1", root="$",
    file_type="application/octet-stream", form_type="application/x-www-form-urlencoded",
    modules_path="/rw/rapid/modules?task={task}", load_path="/rw/rapid/tasks/{task}?action=loadmod",
    mastership_path="/rw/mastership/rapid?action={action}",
    rename_path="{file}", rename_form=(("fs-action", "rename"),), states=json_states)

RWS_2 = Dialect(
    name="RWS 2.0", accept="application/xhtml+xml;v=2.0", query="", root="",
    file_type="text/plain;v=2.0", form_type="application/x-www-form-urlencoded;v=2.0",
    modules_path="/rw/rapid/tasks/{task}/modules", load_path="/rw/rapid/tasks/{task}/loadmod",
    mastership_path="/rw/mastership/edit/{action}",
    rename_path="{file}/rename", rename_form=(), states=xhtml_states)
