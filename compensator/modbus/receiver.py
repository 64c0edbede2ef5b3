"""The RAPID module that receives the offsets in the robot, with the ids of exactly these tables and the scale of wire.py."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from compensator.modbus import wire
from compensator.modbus.registers import Robot
from identification.common.files import check_writable, write_whole
from identification.common.findings import one_line
from identification.common.shipped import shipped

TEMPLATE = "offset_receiver.mod.j2"
STALE_S = 2
WAIT_S = 60


@dataclass(frozen=True)
class Receiver:
    """The module as a file, which is named like it. corrwrite: with path correction too (controller option Path Offset)."""

    file: Path
    corrwrite: bool = False
    overwrite: bool = False

    def write(self, tables: list[wire.OffsetTable], limit: float, source: str) -> None:
        """Writes it for these tables. Raises CompstiffError: CS0003 exists and is another one, CS0004 not writable."""
        content = receiver_text(tables, limit, self.file.stem, source, corrwrite=self.corrwrite).encode("ascii")
        # The dry run has written it already: the same call with --apply must not stumble over it.
        if not (self.file.is_file() and self.file.read_bytes() == content):
            check_writable([self.file], overwrite=self.overwrite)
            write_whole({self.file: content}, overwrite=self.overwrite)


def receiver_text(tables: list[wire.OffsetTable], limit: float, name: str, source: str, *, corrwrite: bool) -> str:
    """The module; limit [m] of an offset, source: the offsets file it belongs to."""
    import jinja2

    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(shipped("rapid_templates")), trim_blocks=True,
                                     lstrip_blocks=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    shown = []
    for table in tables:
        high, low = wire.split(table.header.id)
        shown.append({"id_high": high, "id_low": low, "rows": table.header.rows, "first": table.header.first})
    count = sum(table.header.rows for table in tables)
    return environment.get_template(TEMPLATE).render(
        module=_identifier(name), header=True, corrwrite=corrwrite, tables=shown,
        comments=[f"Receives the offsets of {count} targets, table {tables[0].header.name}, made from",
                  one_line(Path(source).name)],
        zero_word=wire.ZERO, um_per_mm=wire.UM_PER_MM, none_low=wire.NO_OFFSET[0], none_high=wire.NO_OFFSET[1],
        limit_mm=f"{1e3 * limit:g}", stale_s=STALE_S, wait_s=WAIT_S,
        idle=int(Robot.IDLE), running=int(Robot.RUNNING), done=int(Robot.WINDOW_DONE))


def _identifier(name: str) -> str:
    """A RAPID identifier: a letter, then letters, digits and _, at most 32."""
    kept = "".join(letter if letter.isascii() and (letter.isalnum() or letter == "_") else "_" for letter in name)
    return (kept if kept[:1].isalpha() else "M" + kept)[:32]
