"""What is fuzzed: each door through which a file comes in, sound files for it, words of its language, and what must be true of
what it lets in."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fuzz_files import (
    DIAGNOSIS,
    JOURNAL,
    LVM,
    METALLICADOUR,
    NAMED,
    NET_FT,
    NORMALS,
    OFFSETS,
    POINTS,
    cell,
    joint_log_text,
    learned_text,
    matlab,
    parquet,
    workbook,
)
from benchmarks.fuzz_languages import (
    APT_GRAMMAR,
    APT_WORDS,
    CSV_WORDS,
    JSON_WORDS,
    LVM_WORDS,
    RAPID_GRAMMAR,
    RAPID_WORDS,
    YAML_GRAMMAR,
    YAML_WORDS,
)
from benchmarks.unbreakable import APT, CELL, COMMANDS, TABLE, VERIFIED, sound_files
from tests.runs.command_line import user_files as kit

ROOT = Path(__file__).parents[1]
STEP = 1e-4                     # [m] by which targets are moved to see that nothing else moves
GOOD = (0, 1, 3)
# Reading again what a number is written as: 4 decimals of a millimetre, and what a double holds of it.
ROUNDING, DIGITS = 1e-7, 1e-12
QUOTED = re.compile(r'"[^"]*"')
NO_NUMBER = re.compile(r"(?:^|[,\s\[(:])[-+]?(?:nan|inf(?:inity)?)(?=$|[,\s\]);])", re.IGNORECASE | re.MULTILINE)


class Unsound(AssertionError):
    """What came out is not wholly valid."""


@dataclass(frozen=True)
class Door:
    """name, suffix of its file, sound files, words of its language, productions of its grammar (empty: none), and `enter`:
    raises CompstiffError where the file is refused, Unsound where what it makes of it is not valid; returns what tells one
    answer from another. patience [s]: what takes longer hangs."""

    name: str
    suffix: str
    seeds: tuple[bytes, ...]
    words: tuple[str, ...]
    enter: Callable[[Path], object]
    grammar: dict[str, tuple[str, ...]]
    patience: float = 5.0


def sound(condition: bool, what: str) -> None:
    """Raises Unsound with what is wrong where the condition does not hold."""
    if not condition:
        raise Unsound(what)


# ---- the doors -----------------------------------------------------------------------------------------------------------


def rapid(file: Path) -> object:
    """Read; every second free target moved by STEP; read again: those have moved, and nothing else has."""
    from compensator.rapid import read_rapid, rewrite
    from compensator.toolpath import Move

    program = read_rapid(file.read_bytes(), file.name)
    path = program.toolpath
    free = np.flatnonzero((path.block == "") & (path.move != Move.ABSOLUTE))
    for values in (path.position, path.quaternion):
        sound(bool(np.isfinite(values[free]).all()), "a free target is no number")
    moved = free[::2]
    moved = moved[np.abs(path.position[moved]).max(axis=1, initial=0) < 1e6]
    meant = path.position.copy()
    meant[moved] += STEP
    written = rewrite(program, moved, meant[moved], path.quaternion[moved])
    again = read_rapid(written.content, file.name).toolpath
    sound(len(again) == len(path), f"{len(path)} targets before, {len(again)} after")
    sound(bool((again.move == path.move).all() and (again.block == path.block).all()), "moves or blocks differ")
    other = np.setdiff1d(np.arange(len(path)), moved)
    for name in ("position", "quaternion", "joints", "external"):
        before, after = getattr(path, name, None), getattr(again, name, None)
        if before is not None and len(before):
            sound(np.array_equal(before[other], after[other], equal_nan=True), f"{name} of a target that was not moved differs")
    off = np.abs(again.position[moved] - meant[moved]).max(initial=0)
    sound(bool(off <= ROUNDING + DIGITS * np.abs(meant[moved]).max(initial=0)), f"moved targets stand {off} m off")
    return codes(path.findings), codes(written.findings)


def posted(file: Path) -> object:
    """The posted program reads back as it is meant, all of it in numbers."""
    from compensator.posting.read_toolpath import read_toolpath
    from compensator.rapid import read_rapid

    program = read_toolpath(file, cell(file.parent))
    again = read_rapid(program.text.source.data, "again.mod").toolpath
    path = program.toolpath
    sound(len(again) == len(path) == len(program.air), "other targets in the text")
    sound(np.array_equal(again.position, path.position, equal_nan=True), "other positions in the text")
    sound(bool(np.isfinite(path.position).all() and np.isfinite(path.quaternion).all()), "a posted target is no number")
    return codes(path.findings)


def cell_file(file: Path) -> object:
    """cell.yaml, its robot and its frames in numbers."""
    from identification.model.cell import read_cell

    read = read_cell(file)
    sound(finite(vars(read)), "the cell holds what is no number")
    return read.robot.name


def robot_file(file: Path) -> object:
    """A robot file, and what `robots --check` says of it."""
    from identification.model.robot_check import check_robot

    checked = check_robot(file)
    json.dumps(checked.as_dict(), allow_nan=False)
    return checked.sound, codes(checked.findings)


def measurements(file: Path) -> object:
    from identification.measurements import read_measurements

    read = read_measurements(file, cell(file.parent))
    sound(all(np.isfinite(values).all() for values in (read.theta, read.wrench)), "an angle or a load is no number")
    sound(bool((np.isnan(read.deflection) | np.isfinite(read.deflection)).all()), "a deflection is infinite")
    return codes(read.findings)


def stiffness(file: Path) -> object:
    """stiffness.json; what is read can be written and read again."""
    from identification.common.files import json_bytes
    from identification.model.stiffness_file import read_stiffness

    model = read_stiffness(file, cell(file.parent))
    again = file.with_name("again.json")
    again.write_bytes(json_bytes(model.as_dict()))
    other = read_stiffness(again, cell(file.parent))
    sound(bool(np.allclose(other.stiffness, model.stiffness, rtol=1e-9)), "another stiffness after writing and reading")
    return len(model.stiffness)


def force_log(file: Path) -> object:
    from compensator.forces.log import read_force_log

    read = read_force_log(file, cell(file.parent).force_log.form)
    sound(finite({"force": read.force}), "a force is no number")
    return read.key, codes(read.findings)


def offsets(file: Path) -> object:
    from compensator.modbus.offset_file import read_offsets

    read = read_offsets(file, 10.0)
    sound(bool(np.isfinite(read.offset).all()) and read.micrometres.shape == read.offset.shape, "an offset is no number")
    return codes(read.findings)


def learned(file: Path) -> object:
    from compensator.learned.learned_file import learned_json, read_learned

    read = read_learned(file, cell(file.parent))
    json.dumps(learned_json(read, cell(file.parent)), allow_nan=False)
    return read.springs


def diagnosis(file: Path) -> object:
    from identification.design.discrimination import read_diagnosis

    return len(read_diagnosis(file, cell(file.parent)).names)


def readings(file: Path) -> object:
    from compensator.verification.readings import read_readings

    read = read_readings(file, cell(file.parent))
    return read.key, codes(read.findings)


def points(file: Path) -> object:
    from compensator.learning.measured_points import read_points

    read = read_points(file, cell(file.parent))
    sound(bool(np.isfinite(read.value).all() and np.isfinite(read.sigma).all()), "a measured point is no number")
    return codes(read.findings)


def joint_log(file: Path) -> object:
    from identification.motion.log_file import read_motion_log

    read = read_motion_log(file)
    return sorted(read.joints), codes(read.findings)


def converted(form: str) -> Callable[[Path], object]:
    def enter(file: Path) -> object:
        from identification.formats.convert import convert_log

        read = convert_log(file, form)
        sound(not NO_NUMBER.search(read.content(parquet=False).decode()), "the table holds what is no number")
        return codes(read.findings)
    return enter


def journal(file: Path) -> object:
    """The journal of a watched folder, read at a restart."""
    from compstiff.batch.journal import NAME, Journal

    folder = file.parent / "watched"
    folder.mkdir(exist_ok=True)
    (folder / NAME).write_bytes(file.read_bytes())
    held = Journal(folder)
    try:
        held.sweep()
        return len(held.last) > 0, codes(held.findings)
    finally:
        held.close()


def command(name: str, spoilt: str) -> Callable[[Path], object]:
    """A whole command with one file of a sound job spoilt: its exit code, its document, and every file it wrote."""
    def enter(file: Path) -> object:
        folder = file.parent / name
        folder.mkdir(exist_ok=True)
        for beside, text in sound_files().items():
            (folder / beside).write_text(text)
        (folder / spoilt).write_bytes(file.read_bytes())
        output = folder / "out"
        output.mkdir(exist_ok=True)
        for left in output.iterdir():
            left.unlink()
        words = COMMANDS[name][1]
        made = words[words.index("-o") + 1][1:] if "-o" in words else None
        given = [str(output / made) if word == f"@{made}" else str(folder / word[1:]) if word.startswith("@") else word
                 for word in words]
        result = kit.run(*given, *(["--offsets", str(output / "offsets.csv")] if name == "correct" else []), "--json")
        sound("Warning" not in result.err and "Traceback" not in result.err, f"on stderr: {result.err[-300:]}")
        said = result.json
        if result.code not in GOOD:
            raise Unsound(f"exit {result.code}: {[finding['message'] for finding in said['findings']]}")
        written = sorted(output.iterdir())
        sound(bool(written) == (result.code == 0 and made is not None), f"exit {result.code} and {len(written)} files")
        for each in written:
            valid(each)
        return result.code, tuple(sorted({finding["code"] for finding in said["findings"]}))
    return enter


def valid(file: Path) -> None:
    """Raises Unsound where a file that was written is not one that its readers take."""
    from compensator.rapid import read_rapid

    text = file.read_bytes()
    sound(bool(text), f"{file.name} is empty")
    if file.suffix == ".json":
        json.loads(text, parse_constant=lambda word: sound(False, f"{file.name} holds {word}"))
    elif file.suffix == ".csv":
        sound(not NO_NUMBER.search(QUOTED.sub("", text.decode())), f"{file.name} holds what is no number")
    else:
        read_rapid(text, file.name)


def finite(values: dict[str, Any]) -> bool:
    """Whether all arrays of numbers hold numbers (joint angles may be infinite limits)."""
    return all(not np.isnan(value).any() for value in values.values()
               if isinstance(value, np.ndarray) and value.dtype.kind == "f")


def codes(findings: Any) -> tuple[str, ...]:
    return tuple(sorted({finding.code for finding in findings}))


def whole_lines(text: str) -> bytes:
    """The lines that stand whole in the first 3000 characters."""
    return text[:3000].rpartition("\n")[0].encode() + b"\n"


def doors(folder: Path) -> dict[str, Door]:
    """All doors by name. folder: where the sound cell is put."""
    files = sound_files()
    of = {name: text.encode() for name, text in files.items()}
    programs = [path.read_bytes() for path in sorted((ROOT / "tests/compensator/rapid/programs").glob("*.mod"))]
    apt = [path.read_bytes() for path in sorted((ROOT / "tests/compensator/posting/apt/manners").iterdir())]
    robots = sorted((ROOT / "identification/model/robots").rglob("*.yaml"))
    listed = [
        Door("rapid", ".mod", (NAMED.encode(), of["part.mod"], *(text[:20000] for text in programs)), RAPID_WORDS, rapid,
             RAPID_GRAMMAR),
        Door("apt", ".apt", (APT.encode(), *(text[:20000] for text in apt)), APT_WORDS, posted, APT_GRAMMAR),
        Door("table", ".csv", (TABLE.encode(),), CSV_WORDS, posted, {}),
        Door("cell", ".yaml", (CELL.encode(), (ROOT / "samples/cell.yaml").read_bytes()), YAML_WORDS, cell_file, YAML_GRAMMAR),
        Door("robot", ".yaml", tuple(path.read_bytes() for path in robots[:3]), YAML_WORDS, robot_file, {}),
        Door("measurements", ".csv", tuple(map(whole_lines, (files["measurements.csv"], (
            ROOT / "samples/measurements.csv").read_text()))), CSV_WORDS, measurements, {}),
        Door("workbook", ".xlsx", (workbook(),), CSV_WORDS, measurements, {}),
        Door("parquet", ".parquet", (parquet(),), CSV_WORDS, force_log, {}),
        Door("stiffness", ".json", (of["stiffness.json"],), JSON_WORDS, stiffness, {}),
        Door("forces", ".csv", (of["forces.csv"], of["along.csv"]), CSV_WORDS, force_log, {}),
        Door("offsets", ".csv", (OFFSETS.encode(),), CSV_WORDS, offsets, {}),
        Door("learned", ".json", (learned_text(folder).encode(),), JSON_WORDS, learned, {}),
        Door("diagnosis", ".json", (DIAGNOSIS.encode(),), JSON_WORDS, diagnosis, {}),
        Door("readings", ".csv", (VERIFIED.encode(),), CSV_WORDS, readings, {}),
        Door("points", ".csv", (POINTS.encode(), NORMALS.encode()), CSV_WORDS, points, {}),
        Door("joint_log", ".csv", (joint_log_text().encode(),), CSV_WORDS, joint_log, {}),
        Door("lvm", ".lvm", (LVM.encode(),), LVM_WORDS, converted("lvm"), {}),
        Door("metallicadour", ".csv", (METALLICADOUR.encode(),), CSV_WORDS, converted("metallicadour"), {}),
        Door("net_ft", ".bin", (NET_FT,), ("\x00\x00\x00\x00", "\x7f"), converted("net-ft"), {}),
        Door("kuka", ".mat", (matlab(),), ("\x00", "\x01"), converted("kuka-kr300"), {}, patience=30.0),   # a process each
        Door("journal", ".jsonl", (JOURNAL.encode(),), JSON_WORDS, journal, {}),
    ]
    for name, (names, _) in COMMANDS.items():
        for spoilt in names:
            suffix = Path(spoilt).suffix
            words = {".mod": RAPID_WORDS, ".apt": APT_WORDS, ".yaml": YAML_WORDS, ".json": JSON_WORDS}.get(suffix, CSV_WORDS)
            listed.append(Door(f"{name}:{spoilt}", suffix, (of[spoilt],), words, command(name, spoilt), {}))
    return {door.name: door for door in listed}
