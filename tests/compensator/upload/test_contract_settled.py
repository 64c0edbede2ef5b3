"""What an upload says of a controller that answers otherwise than it should: files and a task written here in place of one."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from compensator.upload import local_module
from compensator.upload.answers import Answered, Lost
from compensator.upload.loading import load_module
from compensator.upload.local_module import read_module
from compensator.upload.remote import TaskNow
from compensator.upload.transfer import place
from identification.common.findings import CompstiffError, Unconfirmed

CONTENT, PART, FINAL = b"MODULE part\nENDMODULE\n", "$HOME/part.mod.part", "$HOME/part.mod"
LOST, REFUSED, BETWEEN = Lost("no answer"), Answered(403, -1073445859, "not allowed"), Answered(403)


class Scripted:
    """A controller with files. fails: what each step raises, also after it has done it (`does`); spoils: it keeps less than
    what is sent; gone: lost from the step of this name on. modules: loaded in the task; released: as of mastership."""

    def __init__(self, *, files: dict[str, bytes] | None = None, fails: dict[str, Exception] | None = None,
                 does: bool = False, spoils: bool = False, gone: str = "", modules: tuple[str, ...] = (),
                 after: tuple[str, ...] | None = None, released: bool = True) -> None:
        self.session = SimpleNamespace(controller=SimpleNamespace(url="https://cell", user="u", retries=0))
        self.files, self.fails, self.does, self.spoils, self.gone = dict(files or {}), fails or {}, does, spoils, gone
        self.modules, self.after, self.released, self.down = modules, modules if after is None else after, released, False

    def _step(self, name: str) -> bool:
        """Whether it is done; raised afterwards where it fails."""
        self.down = self.down or name == self.gone
        if self.down:
            raise LOST
        return name not in self.fails or self.does

    def _told(self, name: str) -> None:
        if name in self.fails:
            raise self.fails[name]

    def read(self, path: str) -> bytes | None:
        self._step("read")
        self._told("read")
        return self.files.get(path)

    def write(self, path: str, content: bytes) -> None:
        if self._step("write"):
            self.files[path] = content[:-1] if self.spoils else content
        self._told("write")

    def rename(self, path: str, name: str) -> None:
        if self._step("rename") and path in self.files:
            self.files[f"{path.rpartition('/')[0]}/{name}"] = self.files.pop(path)
        self._told("rename")

    def delete(self, path: str) -> None:
        self._step("delete")
        self._told("delete")
        self.files.pop(path, None)

    def task(self, name: str) -> TaskNow:
        self._step("task")
        self._told("task")
        return TaskNow(name, "stopped", "stopped", self.modules)

    def load(self, task: str, path: str, *, replace: bool) -> None:
        if self._step("load"):
            self.modules = self.after
        self._told("load")

    @contextlib.contextmanager
    def mastership(self) -> Iterator[None]:
        self._told("mastership")
        yield


def stopped(call: Any) -> tuple[str, int, str]:
    with pytest.raises(CompstiffError) as raised:
        call()
    (finding,) = raised.value.findings
    return finding.code, raised.value.exit_code, finding.message


NOT_THERE = "the new file is not there, what was there is as it was"
UNSURE = "state unknown: the new file is there whole, or not"


@pytest.mark.parametrize(("remote", "code", "said", "left"), [
    (Scripted(fails={"read": LOST}), "CS6109", NOT_THERE, []),
    (Scripted(fails={"read": Answered(401)}), "CS6106", NOT_THERE, []),
    (Scripted(fails={"write": LOST}, does=True), "CS6109", NOT_THERE, []),
    (Scripted(fails={"write": REFUSED}), "CS6113", NOT_THERE, []),
    (Scripted(fails={"write": LOST, "delete": LOST}, does=True), "CS6109", f"({PART} may be left)", [PART]),
    (Scripted(spoils=True), "CS6112", NOT_THERE, []),
    (Scripted(fails={"rename": LOST}), "CS6109", NOT_THERE, []),
    (Scripted(fails={"rename": REFUSED}), "CS6113", NOT_THERE, []),
    (Scripted(fails={"rename": LOST, "delete": LOST}), "CS6109", UNSURE, [PART]),
    (Scripted(gone="rename"), "CS6109", UNSURE, [PART])])
def test_a_file_that_was_not_placed_is_said_with_what_is_there(remote: Any, code: str, said: str, left: list[str]) -> None:
    """What stood there is as it was; half a file is taken away, or named where that was not possible."""
    remote.files["$HOME/other.mod"] = b"other"
    found, exit_code, message = stopped(lambda: place(remote, "$HOME", "part.mod", CONTENT))
    assert (found, exit_code, said in message) == (code, 3 if code in ("CS6106", "CS6113") else 4, True), message
    assert remote.files == {"$HOME/other.mod": b"other", **dict.fromkeys(left, CONTENT)}


def test_a_file_is_placed_though_the_answer_was_lost_and_not_twice() -> None:
    remote: Any = Scripted(fails={"rename": LOST}, does=True)
    assert place(remote, "$HOME", "part.mod", CONTENT) == "uploaded"
    assert remote.files == {FINAL: CONTENT}
    assert place(remote, "$HOME", "part.mod", CONTENT) == "already there"


@pytest.mark.parametrize(("spoilt", "placed"), [((2,), True), ((3,), True), ((2, 3), False)])
def test_a_spoilt_answer_is_looked_at_once_more(spoilt: tuple[int, ...], placed: bool) -> None:
    """Of the reads: the name before, then twice at most what was written, then the name."""
    remote: Any = Scripted()
    read, count = remote.read, 0

    def once_spoilt(path: str) -> bytes | None:
        nonlocal count
        count += 1
        content = read(path)
        return content[:-1] if content and count in spoilt else content

    remote.read = once_spoilt
    if placed:
        assert place(remote, "$HOME", "part.mod", CONTENT) == "uploaded"
        assert remote.files == {FINAL: CONTENT}
        return
    assert stopped(lambda: place(remote, "$HOME", "part.mod", CONTENT))[0] == "CS6112"
    assert remote.files == {}


@pytest.mark.parametrize("kept", [None, b"MODULE part\n"])
def test_a_name_with_other_content_than_sent_is_not_to_be_loaded(kept: bytes | None) -> None:
    """The rename was answered, and there is no such file, or half of one."""
    remote: Any = Scripted()

    def rename(path: str, name: str) -> None:
        remote.files = {} if kept is None else {FINAL: kept}

    remote.rename = rename
    code, exit_code, message = stopped(lambda: place(remote, "$HOME", "part.mod", CONTENT))
    assert (code, exit_code) == ("CS6109" if kept is None else "CS6112", 4)
    assert ("does not have its new name" in message, UNSURE in message) == (kept is None, kept is None)
    assert kept is None or f"what is read back of {FINAL} is not what was sent" in message


NOTHING, EITHER = "nothing was loaded", "the module may be loaded or not, whole"
OF_TWO = "the module that is loaded is the one before or the new one, whole"


@pytest.mark.parametrize(("remote", "code", "said"), [
    (Scripted(after=("part",)), "", "loaded part into T_ROB1"),
    (Scripted(after=("PART",), fails={"load": LOST}, does=True), "", "loaded part into T_ROB1"),
    (Scripted(modules=("part",)), "", "replaced part in T_ROB1"),
    (Scripted(fails={"mastership": LOST}), "CS6109", NOTHING),
    (Scripted(fails={"task": LOST}), "CS6109", NOTHING),
    (Scripted(after=("other",)), "CS6118", EITHER),
    (Scripted(fails={"load": REFUSED}), "CS6113", NOTHING),
    (Scripted(fails={"load": LOST}), "CS6109", NOTHING),
    (Scripted(fails={"load": LOST}, released=False), "CS6118", EITHER),
    (Scripted(gone="load"), "CS6118", EITHER),
    (Scripted(modules=("part",), gone="load"), "CS6118", OF_TWO),
    (Scripted(modules=("part",), fails={"load": LOST}), "CS6118", OF_TWO),
    (Scripted(modules=("part",), fails={"load": BETWEEN}), "CS6118", OF_TWO),
    (Scripted(modules=("part",), fails={"load": REFUSED}), "CS6113", NOTHING),
    (Scripted(modules=("part",), fails={"load": REFUSED}, released=False), "CS6118", OF_TWO)])
def test_what_is_loaded_is_said_whatever_the_controller_answers(remote: Any, code: str, said: str) -> None:
    """Of a module that was loaded before, only the controller's own word says that it is still that one. While mastership may
    be held a request may still be carried out."""
    def call() -> str:
        return load_module(remote, "T_ROB1", "part", FINAL, replace=True)

    if not code:
        assert call() == said
        return
    found, exit_code, message = stopped(call)
    assert (found, exit_code, said in message) == (code, 3 if code == "CS6113" else 4, True), message
    assert "the new file is there, whole (read back)" in message


def test_a_busy_controller_is_asked_again_later() -> None:
    """503 is no refusal."""
    remote: Any = Scripted(fails={"write": Answered(503)})
    with pytest.raises(Unconfirmed):
        place(remote, "$HOME", "part.mod", CONTENT)


@pytest.mark.parametrize("beyond", [0, 1])
def test_a_module_is_read_up_to_the_size_that_is_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, beyond: int
) -> None:
    """And told with its name, its limit and what helps; what is not there is told, too. The limit made small, to be fast."""
    most = 1 << 20
    monkeypatch.setattr(local_module, "MOST_BYTES", most)
    file = tmp_path / "part.mod"
    file.write_bytes(CONTENT + b" " * (most + beyond - len(CONTENT)))
    if not beyond:
        assert len(read_module(file, "irb6660-205-1.90").content) == most
    else:
        with pytest.raises(CompstiffError) as raised:
            read_module(file, "irb6660-205-1.90")
        assert [(one.code, one.file, "correct --split" in one.hint) for one in raised.value.findings] == [
            ("CS6100", str(file), True)]
        assert raised.value.findings[0].message == "is larger than 1 MiB"
    with pytest.raises(CompstiffError) as raised:
        read_module(tmp_path / "away.mod", "irb6660-205-1.90")
    assert [(one.code, one.file) for one in raised.value.findings] == [("CS0005", str(tmp_path / "away.mod"))]
