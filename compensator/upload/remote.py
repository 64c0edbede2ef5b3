"""The controller as far as an upload needs it: what it is, its files, its tasks; and loading a module under mastership.

Nothing here starts, stops or moves anything.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from compensator.upload.answers import Answered, Lost, State
from compensator.upload.session import Session

# Execution states of a task in which it does not execute.
AT_REST = ("ready", "stopped", "initiated", "uninitialized")


@dataclass(frozen=True)
class System:
    """name: of the robot system; version: of RobotWare; dialect: of its web services."""

    name: str
    version: str
    dialect: str

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"name": self.name, "robotware": self.version, "dialect": self.dialect}


@dataclass(frozen=True)
class RemoteFile:
    """A file in the folder: bytes and time as the controller states them."""

    name: str
    size: str
    modified: str

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"file": self.name, "bytes": self.size, "modified": self.modified}


@dataclass(frozen=True)
class TaskNow:
    """A task, and the controller, as they were when asked. modules: the names of those that are loaded in the task."""

    name: str
    state: str
    controller_state: str
    modules: tuple[str, ...]

    @property
    def executes(self) -> bool:
        """Whether the task, or the controller, executes RAPID; an unknown state counts as that."""
        return self.state not in AT_REST or self.controller_state != "stopped"

    def has(self, module: str) -> bool:
        """Whether a module of that name is loaded: RAPID does not tell upper from lower case."""
        return module.lower() in (name.lower() for name in self.modules)


class Remote:
    """A controller behind an open session. Every method raises Lost and Answered. released: whether the last mastership was
    given back, and that answered."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.dialect = session.dialect
        self.released = True

    def system(self) -> System:
        """What answers."""
        state = _one(self.session.states("/rw/system"), "rwversion")
        return System(state.get("name", ""), state["rwversion"], self.dialect.name)

    def files(self, folder: str) -> tuple[RemoteFile, ...]:
        """The files of a folder."""
        states = self.session.states(self.dialect.file(folder))
        return tuple(RemoteFile(state["_title"], state.get("fs-size", ""), state.get("fs-mdate", ""))
                     for state in states if state.get("_type") == "fs-file" and state.get("_title"))

    def read(self, path: str) -> bytes | None:
        """The bytes of a file, None where there is none."""
        try:
            return self.session.download(self.dialect.file(path))
        except Answered as answer:
            if answer.status == 404:
                return None
            raise

    def write(self, path: str, content: bytes) -> None:
        """Writes a file, over one of that name."""
        self.session.send(self.dialect.file(path), content)

    def rename(self, path: str, name: str) -> None:
        """Gives a file another name in its folder. Not repeated."""
        self.session.post(self.dialect.rename_path.format(file=self.dialect.file(path)),
                          {"fs-newname": name, **dict(self.dialect.rename_form)})

    def delete(self, path: str) -> None:
        """Deletes a file, if it is there."""
        self.session.delete(self.dialect.file(path))

    def task(self, name: str) -> TaskNow | None:
        """The task and what is loaded in it, None where the controller has none of that name."""
        found = next((state for state in self.session.states("/rw/rapid/tasks") if state.get("name") == name), None)
        if found is None:
            return None
        modules = self.session.states(self.dialect.of_task(self.dialect.modules_path, name))
        execution = _one(self.session.states("/rw/rapid/execution"), "ctrlexecstate")
        return TaskNow(name, found.get("excstate", ""), execution["ctrlexecstate"],
                       tuple(state["name"] for state in modules if state.get("name")))

    def load(self, task: str, path: str, *, replace: bool) -> None:
        """Loads a module from a file into a task. Not repeated; mastership is needed."""
        self.session.post(self.dialect.of_task(self.dialect.load_path, task),
                          {"modulepath": self.dialect.on_controller(path), "replace": "true" if replace else "false"})

    @contextlib.contextmanager
    def mastership(self) -> Iterator[None]:
        """Mastership over RAPID, given back whatever happens in here, also where only the answer to the request was lost."""
        self.released = True
        try:
            try:
                self.session.post(self.dialect.mastership_path.format(action="request"), {})
            except Answered as answer:
                self.released = answer.meant
                if 400 <= answer.status < 500:
                    raise MastershipRefused(answer.status, answer.code, str(answer)) from answer
                raise
            self.released = False
            yield
        except Lost:
            self.released = False
            raise
        finally:
            if not self.released:
                self._release()

    def _release(self) -> None:
        """Asks until it is given back, or the controller itself says that there is nothing to give back."""
        for _ in range(1 + self.session.controller.retries):
            try:
                self.session.post(self.dialect.mastership_path.format(action="release"), {}, repeat=True)
                self.released = True
            except Lost:
                return
            except Answered as answer:
                self.released = answer.meant
            if self.released:
                return


class MastershipRefused(Answered):
    """Somebody else has mastership, or this controller gives none."""

    def __init__(self, status: int, code: int | None, message: str) -> None:
        super().__init__(status, code)
        self.args = (message,)


def _one(states: list[State], key: str) -> State:
    found = next((state for state in states if state.get(key)), None)
    if found is None:
        raise Lost(f"an answer without {key}")
    return found
