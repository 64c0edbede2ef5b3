"""Fuzzing in process: spoilt and grown files through every door; refused or wholly valid, never a defect, a warning or a hang.

    python benchmarks/fuzz.py [--seconds 600] [--seed 0] [--door NAME ...] [--state DIR]

A file is a sound one with one to six changes (numbers, bytes, lines, words of its language, spans moved, doubled or taken from
another, nesting, encodings), or is grown from a small grammar. Inputs that get an answer of a new kind (the codes of the
findings, the words of a complaint) are kept and changed further. A defect is an exception that is no complaint, exit code 70, a
warning of Python, an output its own reader refuses or that holds what is no number, over 5 s, or 400 MB more memory than any
before it. The state (counts, kept inputs, defects) is a folder: the same call goes on where it stopped. Printed: runs by door,
and each kind of defect with the file that makes it. Exit 1 where there is one.
"""

from __future__ import annotations

import argparse
import collections
import faulthandler
import hashlib
import json
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from types import FrameType

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np

from benchmarks.fuzz_doors import Door, doors
from benchmarks.fuzz_load_tests import doors_of_load_tests
from benchmarks.unbreakable import BYTES, NUMBER, VALUES
from identification.common.findings import CompstiffError

GROWTH_MB, ADDRESSES = 400, 6 << 30
LARGEST = 1 << 18               # bytes of a file that is changed; larger ones are `GIANTS` in tests/runs/faults
MOST_KEPT = 400                 # inputs of a door
NUMBERS = re.compile(NUMBER.pattern.encode())
HUGE = (*VALUES, "1000000000", "2147483648", "-2147483649", "18446744073709551616", "1e5", "99999999", "0.1e-400")
WORD = re.compile(rb"[A-Za-z_]\w*")
Corpus = dict[str, list[bytes]]


class Hang(BaseException):
    """Nothing catches it but this file."""


def spoilt(data: bytes, door: Door, kept: list[bytes], rng: np.random.Generator) -> bytes:
    """The data with one to six changes."""
    for _ in range(1 + int(rng.geometric(0.5)) % 6):
        data = _changed(data, door, kept, rng)[:LARGEST]
    return data


def _changed(data: bytes, door: Door, kept: list[bytes], rng: np.random.Generator) -> bytes:
    kind, size = rng.random(), len(data)
    word = door.words[int(rng.integers(len(door.words)))].encode("utf-8", "surrogatepass")
    at, to = sorted(rng.integers(0, size + 1, 2).tolist())
    short = min(to, at + 1 + int(rng.geometric(0.05)))
    if kind < 0.30 and (places := [match.span() for match in NUMBERS.finditer(data)]):
        start, end = places[int(rng.integers(len(places)))]
        return data[:start] + HUGE[int(rng.integers(len(HUGE)))].encode() + data[end:]
    if kind < 0.45:
        return data[:at] + word + data[at:]
    if kind < 0.52 and (words := [match.span() for match in WORD.finditer(data)]):
        start, end = words[int(rng.integers(len(words)))]
        return data[:start] + word + data[end:]
    if kind < 0.60:
        byte = BYTES[int(rng.integers(len(BYTES)))] if rng.random() < 0.7 else int(rng.integers(256))
        return data[:at] + bytes([byte]) + data[at + 1:]
    if kind < 0.68:
        return data[:at] + data[short:]
    if kind < 0.74:
        return data[:short] + data[at:short] * int(rng.choice([1, 1, 1, 2, 50])) + data[short:]
    if kind < 0.86:
        lines = data.split(b"\n")
        one, other = rng.integers(len(lines), size=2).tolist()
        if rng.random() < 0.4:
            lines[one], lines[other] = lines[other], lines[one]
        elif rng.random() < 0.5:
            del lines[one]
        else:
            lines.insert(other, lines[one])
        return b"\n".join(lines)
    if kind < 0.92:
        donor = kept[int(rng.integers(len(kept)))]
        start, end = sorted(rng.integers(0, len(donor) + 1, 2).tolist())
        return data[:at] + donor[start:end] + data[to:]
    if kind < 0.95:
        return data[:at]
    if kind < 0.97:
        pair = [(b"[", b"]"), (b"(", b")"), (b"{", b"}"), (b"{a: ", b"}"), (b'"', b'"'), (b"- ", b"")][int(rng.integers(6))]
        depth = int(rng.choice([3, 60, 2000, 20000]))
        return data[:at] + pair[0] * depth + data[at:to] + pair[1] * depth + data[to:]
    text = data.decode("utf-8", "replace")
    return [lambda: text.encode("utf-16"), lambda: b"\xef\xbb\xbf" + data, lambda: data.replace(b"\n", b"\r\n"),
            lambda: data.replace(b"\n", b"\r"), lambda: text.encode("latin-1", "replace"), lambda: data.replace(b".", b","),
            lambda: data.upper(), lambda: data.replace(b",", b";"), lambda: text.encode("utf-16-be"),
            lambda: data + b"\x00" * 64][int(rng.integers(10))]()


def grown(grammar: dict[str, tuple[str, ...]], rng: np.random.Generator, start: str = "start") -> bytes:
    """A sentence of the grammar; what would grow over 3000 steps is closed by the shortest productions."""
    out, stack, steps = [], [f"<{start}>"], 0
    while stack:
        steps += 1
        part = stack.pop()
        name = part[1:-1]
        if part[:1] == "<" and part[-1:] == ">" and name in grammar:
            options = grammar[name]
            chosen = min(options, key=len) if steps > 3000 else options[int(rng.integers(len(options)))]
            stack += reversed([piece for piece in re.split(r"(<\w+>)", chosen) if piece])
        else:
            out.append(part)
        if steps > 20000:
            break
    return "".join(out).encode()


def _rang(number: int, frame: FrameType | None) -> None:
    raise Hang


def enter(door: Door, data: bytes, folder: Path) -> tuple[str, str]:
    """What the door makes of the data: ("", a word for the answer's kind), or (what is wrong, where)."""
    file = folder / f"fuzzed{door.suffix}"
    file.write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.signal(signal.SIGPROF, _rang)
    # Of this process' own time: the machine may have other work.
    signal.setitimer(signal.ITIMER_PROF, door.patience)
    try:
        try:
            answer = f"taken {door.enter(file)}"
        except CompstiffError as refused:
            answer = "refused " + " ".join(sorted({f"{one.code} {_plain(one.message)}" for one in refused.findings[:3]}))
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
    except Hang:
        return f"over {door.patience:g} s", _where()
    except KeyboardInterrupt:
        raise
    except BaseException as defect:
        return f"{type(defect).__name__}: {_plain(str(defect))[:160]}", _where()
    grew = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    return (f"grew by {grew:.0f} MB", "") if grew > GROWTH_MB else ("", answer)


def _plain(text: str) -> str:
    """A message without what differs from file to file."""
    return re.sub(r"'[^']*'|\"[^\"]*\"|[-+]?[\d.]+(?:e[-+]?\d+)?", "#", text)[:120]


def _where() -> str:
    """The innermost place in the packages."""
    own = [frame for frame in traceback.extract_tb(sys.exc_info()[2])
           if re.search(r"/(compensator|identification|compstiff)/", frame.filename)]
    return f"{Path(own[-1].filename).name}:{own[-1].name}" if own else ""


class State:
    """A folder with the counts, the inputs kept of each door, and the defects."""

    def __init__(self, folder: Path, all_doors: dict[str, Door]) -> None:
        self.folder = folder
        (folder / "defects").mkdir(parents=True, exist_ok=True)
        self.doors = all_doors
        counts = folder / "counts.json"
        self.runs: collections.Counter[str] = collections.Counter(json.loads(counts.read_text()) if counts.exists() else {})
        self.kept: Corpus = {}
        self.answers: dict[str, set[str]] = collections.defaultdict(set)
        self.defects: dict[str, str] = {}
        for name, door in all_doors.items():
            place = self._place(name)
            place.mkdir(parents=True, exist_ok=True)
            self.kept[name] = [*door.seeds, *(path.read_bytes() for path in sorted(place.iterdir()))]
        said = folder / "defects.jsonl"
        if said.exists():
            self.defects = {entry["key"]: entry["file"] for entry in map(json.loads, said.read_text().splitlines())}

    def _place(self, name: str) -> Path:
        return self.folder / "kept" / name.replace(":", "-")

    def keep(self, name: str, data: bytes, answer: str) -> None:
        if answer not in self.answers[name]:
            self.answers[name].add(answer)
            if len(self.kept[name]) < MOST_KEPT:
                self.kept[name].append(data)
                (self._place(name) / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)

    def defect(self, name: str, data: bytes, what: str, where: str) -> None:
        key = f"{name.split(':')[0]} {what} in {where}"
        if key in self.defects:
            return
        digest = hashlib.sha256(data).hexdigest()[:12]
        file = self.folder / "defects" / f"{name.replace(':', '-')}-{digest}{self.doors[name].suffix}"
        file.write_bytes(data)
        self.defects[key] = str(file)
        with (self.folder / "defects.jsonl").open("a") as said:
            said.write(json.dumps({"key": key, "door": name, "file": str(file)}) + "\n")
        print(f"{key}\n  {file}", flush=True)

    def save(self) -> None:
        (self.folder / "counts.json").write_text(json.dumps(self.runs))


def main() -> int:
    """Runs until the time is over."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--door", action="append")
    parser.add_argument("--state", type=Path, default=Path(tempfile.gettempdir()) / "compstiff-fuzz")
    chosen = parser.parse_args()
    warnings.simplefilter("error")
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, resource.RLIM_INFINITY))
    folder = chosen.state / "work"
    folder.mkdir(parents=True, exist_ok=True)
    every = doors(folder) | {door.name: door for door in doors_of_load_tests()}
    state = State(chosen.state, every if chosen.door is None else {name: every[name] for name in chosen.door})
    until = time.monotonic() + chosen.seconds
    print(f"seed {chosen.seed}, from run {sum(state.runs.values())}, {len(state.doors)} doors, in {chosen.state}", flush=True)
    names, batch = list(state.doors), 0
    log = (chosen.state / "killed.txt").open("w")
    faulthandler.enable(log)
    while time.monotonic() < until:
        name = names[batch % len(names)]
        (chosen.state / "door.txt").write_text(name)
        door, ends = state.doors[name], time.monotonic() + (3.0 if ":" in name else 2.0)
        rng = np.random.default_rng([chosen.seed, state.runs[name], batch])
        while time.monotonic() < ends:
            kept = state.kept[name]
            if door.grammar and rng.random() < 0.3:
                data = grown(door.grammar, rng)
                data = spoilt(data, door, kept, rng) if rng.random() < 0.5 else data
            else:
                data = spoilt(kept[int(rng.integers(len(kept)))], door, kept, rng)
            faulthandler.dump_traceback_later(60, exit=True, file=log)
            wrong, answer = enter(door, data, folder)
            faulthandler.cancel_dump_traceback_later()
            state.runs[name] += 1
            if wrong:
                state.defect(name, data, wrong, answer)
            else:
                state.keep(name, data, answer)
        batch += 1
        state.save()
    faulthandler.enable()
    log.close()
    for name in names:
        print(f"{name:28} {state.runs[name]:8} runs, {len(state.kept[name]):4} inputs kept")
    for key, file in state.defects.items():
        print(f"\n{key}\n  {file}")
    print(f"\n{sum(state.runs.values())} runs, {len(state.defects)} kinds of defect")
    return int(bool(state.defects))


if __name__ == "__main__":
    raise SystemExit(main())
