"""One job from its files to its files: all that it writes, or nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from compensator.correction.correct import Corrected, correct
from compensator.correction.offsets import offset_blocks
from compensator.correction.predict import Predicted, predict
from compensator.correction.record import record
from compensator.correction.recorded import check_not_corrected
from compensator.correction.settings import DEFAULTS, Settings
from compensator.posting.read_toolpath import read_toolpath
from compensator.posting.split_files import split_files
from identification.common.files import AsRead, Content, check_distinct, check_writable, json_bytes, write_whole
from identification.model.cell import read_cell
from identification.model.stiffness_file import read_stiffness


@dataclass(frozen=True)
class Inputs:
    """The files of one job. forces: None where they are predicted (settings.cutting).

    >>> from pathlib import Path
    >>> compstiff.Inputs(*map(Path, ("cell.yaml", "insert.mod", "stiffness.json", "insert.forces.parquet"))).toolpath.name
    'insert.mod'
    """

    cell: Path
    toolpath: Path
    stiffness: Path
    forces: Path | None

    def files(self) -> list[Path]:
        """All of them."""
        return [self.cell, self.toolpath, self.stiffness, *([self.forces] if self.forces else [])]


@dataclass(frozen=True)
class Outputs:
    """What a correction writes: the program with its record beside it, the offsets and the report where they are wanted.

    >>> from pathlib import Path
    >>> [file.name for file in compstiff.Outputs(Path("part_corrected.mod"), offsets=Path("offsets.csv"), report=None).files()]
    ['part_corrected.mod', 'part_corrected.mod.json', 'offsets.csv']
    """

    program: Path
    offsets: Path | None = None
    report: Path | None = None

    @property
    def record(self) -> Path:
        """What the program was made from."""
        return self.program.with_name(self.program.name + ".json")

    def files(self) -> list[Path]:
        """All of them, but for the parts of a program that is split."""
        return [self.program, self.record, *(file for file in (self.offsets, self.report) if file)]


def predict_files(inputs: Inputs, settings: Settings = DEFAULTS) -> Predicted:
    """Reads the files and predicts. Raises what the readers and `predict` raise."""
    cell = read_cell(inputs.cell)
    model = read_stiffness(inputs.stiffness, cell)
    return predict(cell, read_toolpath(inputs.toolpath, cell, settings.posting), model, inputs.forces, settings)


def correct_files(
    inputs: Inputs, outputs: Outputs, settings: Settings, *, overwrite: bool,
    before_writing: Callable[[], None] | None = None,
) -> Corrected:
    """Corrects one program and writes all its files, or none. What `before_writing` raises stops it at the last moment.

    overwrite: files that exist. It does not allow a program that was corrected before: that is `settings.correction`'s.

    >>> from pathlib import Path
    >>> inputs = compstiff.Inputs(Path("cell.yaml"), Path("insert.mod"), Path("stiffness.json"), Path("insert.forces.parquet"))
    >>> outputs = compstiff.Outputs(Path("part_corrected.mod"), offsets=Path("part_offsets.csv"), report=None)
    >>> corrected = compstiff.correct_files(inputs, outputs, compstiff.Settings.of(tare=((0, 2),)), overwrite=False)
    >>> Path("part_corrected.mod.json").is_file()
    True
    """
    read = [*inputs.files(), *(file for _, file in settings.files())]
    check_distinct(read, outputs.files())
    check_writable(outputs.files(), overwrite=overwrite)
    as_read = AsRead.of(read)
    if not settings.correction.correct_again:
        check_not_corrected(inputs.toolpath, outputs.program.parent)
    corrected = correct(predict_files(inputs, settings))
    air = ~corrected.predicted.forces.forced | corrected.predicted.program.air
    files, _, of_parts = split_files(corrected.content, air, settings.posting, outputs.program, overwrite=overwrite)
    check_distinct(read, files)
    corrected = replace(corrected, findings=(*corrected.findings, *of_parts))
    # The record first: killed between two renames, no program is left without what keeps it from being corrected again.
    written: dict[Path, Content] = {outputs.record: json_bytes(record(corrected, files, outputs.offsets)), **files}
    if outputs.offsets:
        written[outputs.offsets] = offset_blocks(corrected)
    if outputs.report:
        from compensator.correction.report import path_report

        written[outputs.report] = path_report(corrected, offsets=outputs.offsets).encode()
    if before_writing:
        before_writing()
    write_whole(written, overwrite=overwrite, read=as_read)
    return corrected
