"""Faults while a command works, each in a process of its own: what was done to it, and what is wrong with what it left.

A command runs in a fork of this process, so that it starts at once. A fault is a function of a command and a folder; it gives
the sentences that say what is wrong, none where all promises hold: an exit code that is promised (never 70), no traceback,
every file whole or as it was before, and a second call that completes with the outputs of an undisturbed one.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from tests.runs.command_line import user_files as kit
from tests.runs.faults.jobs import COMMANDS, Command, Place

PROMISED = (0, 1, 2, 3, 4, 130)
NOBODY = 65534
TEMPORARY = ".part"
# What a journal, a lock and a log are besides: files that grow, or stay empty.
GROWING = ("compstiff-watch.jsonl", "compstiff-watch.lock", "push-log.jsonl")
OLD = b"old"
Arrange = Callable[[], None]


@dataclass(frozen=True)
class Ended:
    """How a command ended. code: its exit code, None where it was killed."""

    code: int | None
    out: str = ""
    err: str = ""


def nothing() -> None:
    """No fault."""


def run(command: Command, place: Place, *more: str, arrange: Arrange = nothing, kill_after: float | None = None,
        timeout: float = 120.0) -> Ended:
    """The command in a fork; arrange: called there before it begins. kill_after [s]: SIGKILL then."""
    return finish(start(command, place, *more, arrange=arrange), kill_after, timeout)


def start(command: Command, place: Place, *more: str, arrange: Arrange = nothing) -> tuple[int, int]:
    """Its process, and the pipe that its answer comes through."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)         # a fork of a process with threads, from Python 3.12 on
        child = os.fork()
    if child == 0:
        os.close(reading)
        code = 1
        try:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            with _device(command, place) as port:
                arrange()
                done = kit.run(*command.call(place, *port, *more))
            with os.fdopen(writing, "wb") as stream:
                pickle.dump((done.code, done.out, done.err), stream)
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    os.close(writing)
    return child, reading


def finish(started: tuple[int, int], kill_after: float | None = None, timeout: float = 120.0) -> Ended:
    """Waits for its end."""
    child, reading = started
    until = time.monotonic() + (timeout if kill_after is None else kill_after)
    ended = 0
    while not ended and time.monotonic() < until:
        ended, _ = os.waitpid(child, os.WNOHANG)
        if not ended:
            time.sleep(0.002)
    if not ended:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    with os.fdopen(reading, "rb") as stream:
        said = stream.read()
    if not said:
        return Ended(None, err="" if kill_after is not None or ended else f"hangs: killed after {timeout:g} s")
    return Ended(*pickle.loads(said))


@contextlib.contextmanager
def _device(command: Command, place: Place) -> Iterator[list[str]]:
    """The words that name the offset device's port, where the command needs one."""
    if not command.cell:
        yield []
        return
    from compensator.modbus.embedded import device_of
    from compensator.modbus.server import Loopback
    from identification.model.cell import read_cell

    with Loopback(device_of(read_cell(place.inputs / "cell.yaml"))) as server:
        yield ["--port", str(server.port)]


# ---- what must be left -----------------------------------------------------------------------------------------------------


@cache
def undisturbed(name: str, other: bool = False) -> dict[str, bytes]:
    """The outputs of a command that nothing happens to, by name. other: of its other inputs."""
    with tempfile.TemporaryDirectory() as folder:
        place = Place.make(Path(folder) / "place", COMMANDS[name].other if other else None)
        ended = run(COMMANDS[name], place)
        assert ended.code == 0, ended
        return left(place)


def left(place: Place) -> dict[str, bytes]:
    """The files among the outputs, by name; reports name their inputs, whose folder is another one at each trial."""
    if not place.outputs.is_dir():
        return {}
    folder = os.fsencode(place.folder)
    files = (file for file in sorted(place.outputs.iterdir()) if file.is_file())
    return {file.name: file.read_bytes().replace(folder, b"FOLDER") for file in files}


def wrong_answer(ended: Ended, codes: tuple[int, ...] = PROMISED) -> list[str]:
    """What is wrong with how it ended."""
    if ended.code is None:
        return [ended.err or "it was killed"]
    said = [] if ended.code in codes else [f"exit {ended.code}, expected {codes}: {ended.err[-400:]}"]
    if "Traceback" in ended.err or "CS0070" in ended.err + ended.out:
        said.append(f"a defect: {ended.err[-400:]}")
    if ended.code and not ended.err.strip():
        said.append(f"exit {ended.code} without a word")
    return said


def not_whole(command: Command, place: Place, before: dict[str, bytes], *, temporary: bool = False) -> list[str]:
    """Outputs that are neither as before nor whole. temporary: what a killed process could not delete may be left."""
    good, said = undisturbed(command.name), []
    for name, content in left(place).items():
        if name.startswith(".") and name.endswith(TEMPORARY):
            said += [] if temporary else [f"the temporary file {name} is left"]
        elif name in GROWING:
            said += [f"{name}: a line is torn" for line in content.split(b"\n")[:-1] if not _is_json(line)]
        elif content != before.get(name) and content != good.get(name):
            said.append(f"{name} is half written: {len(content)} bytes")
    said += [f"{name} is gone" for name in before if name not in left(place) and name not in GROWING]
    return said


def _is_json(line: bytes) -> bool:
    with contextlib.suppress(ValueError):
        json.loads(line)
        return True
    return False


def not_completed(command: Command, place: Place) -> list[str]:
    """What is wrong with a second call, to which nothing happens."""
    place.outputs.mkdir(exist_ok=True)
    ended = run(command, place, "--force")
    if ended.code != 0:
        return [f"called again: exit {ended.code}: {ended.err[-400:]}"]
    good, now = undisturbed(command.name), left(place)
    said = [f"called again: {name} differs" for name in good if name not in GROWING and now.get(name) != good[name]]
    return said + [f"called again: {name} is left" for name in now if name.endswith(TEMPORARY)]


# ---- faults ----------------------------------------------------------------------------------------------------------------


class Steps:
    """Calls of the system that write, in this process: `at` is called before each, with its number and name, and the name of
    the file that is opened, "" for other calls."""

    NAMES = ("open", "write", "fsync", "chmod", "replace", "link", "unlink")

    def __init__(self, at: Callable[[int, str, str], None]) -> None:
        self.count, self.at = 0, at

    def __call__(self) -> None:
        for name in self.NAMES:
            setattr(os, name, self._counted(name, getattr(os, name)))

    def _counted(self, name: str, real: Callable[..., object]) -> Callable[..., object]:
        def step(*arguments: object, **named: object) -> object:
            if name != "open" or (len(arguments) > 1 and int(str(arguments[1])) & os.O_CREAT):
                self.count += 1
                self.at(self.count, name, Path(str(arguments[0])).name if name == "open" else "")
            return real(*arguments, **named)
        return step


def steps_of(command: Command, place: Place, *more: str) -> int:
    """How many calls of the system that write a command makes."""
    file = place.folder / "steps"
    file.write_text("0")
    with file.open("w") as stream:
        def note(number: int, name: str, file: str) -> None:
            stream.seek(0)
            stream.write(str(number))
            stream.flush()
        run(command, place, *more, arrange=Steps(note))
    return int(file.read_text() or 0)


def killed_at_steps(command: Command, folder: Path, most: int = 1000) -> list[str]:
    """SIGKILL before each call of the system that writes, `most` of them, first into an empty folder, then over old files."""
    said: list[str] = []
    count = steps_of(command, Place.make(folder))
    if not count:
        return ["it made no step that writes"]
    for old in (False, True):
        every = range(1, count + 1) if count <= most else sorted({1 + (count - 1) * k // (most - 1) for k in range(most)})
        for number in every:
            place, before = _with_old(command, folder, old)

            def kill(at: int, name: str, file: str, number: int = number) -> None:
                if at == number:
                    os.kill(os.getpid(), signal.SIGKILL)

            ended = run(command, place, *(["--force"] if old else []), arrange=Steps(kill))
            found = not_whole(command, place, before, temporary=True) + _without_record(command, place)
            found += [] if ended.code is None or old else wrong_answer(ended)
            said += [f"killed before step {number} of {count}{' over old files' if old else ''}: {each}" for each in found]
    said += not_completed(command, Place(folder))
    return said


def _with_old(command: Command, folder: Path, old: bool) -> tuple[Place, dict[str, bytes]]:
    place = Place.make(folder)
    before = {name: OLD for name in undisturbed(command.name) if name not in GROWING} if old else {}
    for name, content in before.items():
        (place.outputs / name).write_bytes(content)
    return place, before


def _without_record(command: Command, place: Place) -> list[str]:
    """A corrected program never stands without the record that keeps it from being corrected again."""
    now, good = left(place), undisturbed(command.name)
    return [f"{name[:-5]} is there without its record" for name in good if name.endswith(".mod.json")
            and now.get(name[:-5], OLD) != OLD and now.get(name, OLD) == OLD]


def killed_at_random(command: Command, folder: Path, most: int = 5, seed: int = 0) -> list[str]:
    """SIGKILL at moments drawn evenly over the time that it takes."""
    import numpy as np

    place = Place.make(folder)
    begun = time.monotonic()
    run(command, place)
    took = time.monotonic() - begun
    said: list[str] = []
    for share in np.random.default_rng(seed).uniform(0, 1, most):
        place, before = _with_old(command, folder, True)
        run(command, place, "--force", kill_after=share * took)
        said += [f"killed after {share * took:.3f} s: {each}" for each in not_whole(command, place, before, temporary=True)]
    return said + not_completed(command, place)


def disk_full(command: Command, folder: Path, most: int = 3) -> list[str]:
    """No file may grow beyond a size (RLIMIT_FSIZE): none at all, half of the largest, all but the last byte."""
    largest = max(len(content) for content in undisturbed(command.name).values())
    said: list[str] = []
    for size in (largest // 2, largest - 1, 0)[:most]:
        place, before = _with_old(command, folder, True)

        def limit(size: int = size) -> None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

        ended = run(command, place, "--force", arrange=limit)
        found = wrong_answer(ended, (1, 4)) + not_whole(command, place, before)
        said += [f"files of at most {size} bytes: {each}" for each in found]
    return said + not_completed(command, Place(folder))


def no_space(command: Command, folder: Path) -> list[str]:
    """The folder of outputs is a file system of 64 KB that is full but for some blocks (tmpfs; needs root)."""
    said: list[str] = []
    for free in (0, 1, 3):
        filler = b"x" * ((16 - free) * 4096)
        place = Place.make(folder)
        with mounted(place.outputs, f"size={64 << 10}"):
            (place.outputs / "filler").write_bytes(filler)
            ended = run(command, place)
            full = sum(-(-len(content) // 4096) for content in undisturbed(command.name).values()) > free
            found = wrong_answer(ended, (1, 4) if full else PROMISED) + not_whole(command, place, {"filler": filler})
            said += [f"{free} blocks free: {each}" for each in found]
    return said + not_completed(command, Place.make(folder))


@contextlib.contextmanager
def mounted(folder: Path, options: str) -> Iterator[None]:
    """A file system in memory at the folder. Raises OSError where that is not allowed."""
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], capture_output=True, check=False)
    if done.returncode:
        raise OSError(done.stderr.decode())
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def read_only(command: Command, folder: Path) -> list[str]:
    """Nobody may write into the folder of outputs. Root may anywhere: then the process becomes nobody."""
    place = Place.make(folder)
    for path in (folder, *folder.parents):
        if os.stat(path).st_uid == os.geteuid() and path.is_relative_to(tempfile.gettempdir()):
            path.chmod(path.stat().st_mode | 0o055)
    place.outputs.chmod(0o555)

    def drop(number: int, name: str, file: str) -> None:
        if os.geteuid() == 0:
            os.setgroups([])
            os.setegid(NOBODY)
            os.seteuid(NOBODY)

    try:
        said = wrong_answer(run(command, place, arrange=Steps(drop)), (1, 4)) + not_whole(command, place, {})
    finally:
        place.outputs.chmod(0o755)
    return said + not_completed(command, place)


def folder_vanishes(command: Command, folder: Path) -> list[str]:
    """The folder of outputs is deleted when the first file is made in it, and when the first is put in its place."""
    said: list[str] = []
    for step in ("open", "replace"):
        place = Place.make(folder)

        def vanish(number: int, name: str, file: str, step: str = step, place: Place = place) -> None:
            if name == step and place.outputs.is_dir():
                shutil.rmtree(place.outputs)

        ended = run(command, place, arrange=Steps(vanish))
        said += [f"deleted before {step}: {each}" for each in wrong_answer(ended, (0, 1, 4)) + not_whole(command, place, {})]
        if ended.code == 0 and not place.outputs.is_dir() and not command.cell:
            said.append(f"deleted before {step}: exit 0 and nothing is there")
        said += not_completed(command, place)
    return said


def input_replaced(command: Command, folder: Path) -> list[str]:
    """Each input becomes another file after it was read, when the first output is made: nothing of it is written, and that is
    said. Of several programs the next one reads the other file, and is written."""
    said: list[str] = []
    for name in command.reads:
        place = Place.make(folder)
        file = place.inputs / name
        if file.is_dir():
            continue

        def exchange(number: int, step: str, opened: str, file: Path = file, kept: bytes = file.read_bytes()) -> None:
            # A journal is begun before anything is read.
            if opened and opened not in GROWING and file.read_bytes() == kept:
                other = file.with_name("other")
                other.write_bytes(kept + b"\n")
                other.rename(file)

        ended = run(command, place, arrange=Steps(exchange))
        if command.cell:        # it is on its way to the machine: what was read is what is sent, whatever becomes of the file
            said += [f"{name} replaced: {each}" for each in wrong_answer(ended, (0,)) + not_whole(command, place, {})]
            continue
        found = wrong_answer(ended, (1,))
        if not any(code in ended.err for code in ("CS0080", "CS6004")):
            found.append(f"exit {ended.code}, no CS0080")
        if any(not command.several or other.startswith("a.") for other in left(place) if other not in GROWING):
            found.append("outputs were written")
        said += [f"{name} replaced: {each}" for each in found]
    return said + not_completed(command, Place.make(folder))


def clock_back(command: Command, folder: Path) -> list[str]:
    """The clock goes back an hour at each look; inputs and old outputs are from the year 2099."""
    place, _ = _with_old(command, folder, True)
    for file in [*place.inputs.rglob("*"), *place.outputs.iterdir()]:
        os.utime(file, (4.07e9, 4.07e9))

    def back() -> None:
        now = time.time()
        hours = iter(range(10**6))
        time.time = lambda: now - 3600.0 * next(hours)

    said = wrong_answer(run(command, place, "--force", arrange=back), (0,))
    good, now = undisturbed(command.name), left(place)
    return said + [f"{name} differs" for name in good if name not in GROWING and now.get(name) != good[name]]


def two_at_once(command: Command, folder: Path, most: int = 3) -> list[str]:
    """Two calls with other inputs onto the same outputs, their renames slowed down: the files of one call, never of both."""
    said: list[str] = []

    def slow(number: int, name: str, file: str) -> None:
        if name == "replace":
            time.sleep(0.03)

    for _ in range(most):
        place = Place.make(folder)
        other = Place.make(folder / "other", command.other)
        rival = Place(folder / "other")
        shutil.rmtree(other.outputs)
        other.outputs.symlink_to(place.outputs)
        both = [start(command, each, "--force", arrange=Steps(slow)) for each in (place, rival)]
        ended = [finish(one) for one in both]
        for each in ended:
            said += wrong_answer(each, (0, 1))
        if all(each.code for each in ended):
            said.append("neither was done")
        now = {name: content.replace(b"FOLDER/other", b"FOLDER")
               for name, content in left(place).items() if name not in GROWING}
        wanted = [{name: content for name, content in undisturbed(command.name, which).items() if name not in GROWING}
                  for which in (False, True)]
        if now not in wanted:
            said.append(f"files of both: {[[now.get(name) == content for name, content in one.items()] for one in wanted]}, "
                        f"{sorted(now)}")
    return said


def links(command: Command, folder: Path) -> list[str]:
    """Outputs that are symbolic links: to a file elsewhere, to nothing, to itself, to an input; and a folder that is a link."""
    good = [name for name in undisturbed(command.name) if name not in GROWING]
    said: list[str] = []
    for name in good[:2]:
        for kind in ("file", "nothing", "itself", "input"):
            for force in (False, True):
                place = Place.make(folder)
                elsewhere = place.folder / "elsewhere"
                elsewhere.write_bytes(OLD)
                source = place.inputs / (command.reads[0] if command.reads else "cell.yaml")
                target = {"file": elsewhere, "nothing": place.folder / "none", "itself": place.outputs / name,
                          "input": source}[kind]
                kept = source.read_bytes() if source.is_file() else b""
                (place.outputs / name).symlink_to(target)
                ended = run(command, place, *(["--force"] if force else []))
                found = wrong_answer(ended, PROMISED if force else (1, 3))
                if elsewhere.read_bytes() != OLD or (place.folder / "none").exists():
                    found.append("what the link leads to was written")
                if source.is_file() and source.read_bytes() != kept:
                    found.append("an input was overwritten")
                if not force and not (place.outputs / name).is_symlink():
                    found.append("the link was replaced without --force")
                said += [f"{name} a link to {kind}{', --force' if force else ''}: {each}" for each in found]
    place = Place.make(folder)
    place.outputs.rmdir()
    (place.folder / "real").mkdir()
    place.outputs.symlink_to(place.folder / "real")
    found = wrong_answer(run(command, place), (0,)) + not_whole(command, place, {})
    return said + [f"a folder that is a link: {each}" for each in found]


NAMES = {
    "a line end": "a\nb", "no UTF-8": "a\udcffb", "255 bytes": "n" * 251, "a bell": "a\x07\x1b[31mb", "blanks": "  a  b ",
    "a formula": "=cmd|'!A1", "a minus": "-a", "quotes": "a'b\"c`d", "composed": "a\u0301\u202e", "a percent": "%s{0}\\n",
}


def odd_names(command: Command, folder: Path) -> list[str]:
    """Outputs and inputs of names that a file system allows: a line end, no UTF-8, 255 bytes, control characters and such."""
    said: list[str] = []
    for kind, stem in NAMES.items():
        for mark in (">", "@"):
            place = Place.make(folder)
            words = list(command.words)
            which = [k for k, word in enumerate(words) if word.startswith(mark) and "." in word]
            if not which:
                continue
            at = which[-1] if mark == "@" else which[0]
            suffix = Path(words[at]).suffix
            new = f"{stem[:255 - len(suffix)]}{suffix}"
            old = words[at][1:]
            words[at] = f"{mark}{Path(old).parent / new}"
            if mark == "@":
                (place.inputs / old).rename(place.inputs / Path(old).parent / new)
            renamed = replace(command, words=tuple(words))
            ended = run(renamed, place)
            found = wrong_answer(ended, (0, 1, 2))
            if ended.code == 0 and mark == ">" and not (place.outputs / new).is_file():
                found.append("exit 0 and the file is not there")
            if ended.code and kind not in ("255 bytes", "no UTF-8"):
                found.append(f"not done: {ended.err[-200:]!r}")
            found += [f"{name} is left" for name in left(place) if name.endswith(TEMPORARY)]
            if any(ord(letter) < 32 and letter not in "\n\t" for letter in ended.err + ended.out):
                found.append("control characters reach the terminal")
            said += [f"{'an output' if mark == '>' else 'an input'} of {kind}: {each}" for each in found]
    return said


FAULTS: dict[str, Callable[..., list[str]]] = {
    "killed at each step": killed_at_steps, "killed at random": killed_at_random, "file size limit": disk_full,
    "read-only folder": read_only, "folder vanishes": folder_vanishes, "input replaced": input_replaced,
    "clock set back": clock_back, "two at once": two_at_once, "links": links, "odd names": odd_names,
}
assert sys.platform != "win32"
