"""The files that `compstiff post` makes of a toolpath: the planned program, whole or in parts, and the record of it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from compensator.posting.mark_test import mark_test
from compensator.posting.post import Posted, post, read_cam_path
from compensator.posting.settings import PostingSettings
from compensator.posting.split_files import split_files
from compensator.posting.suffixes import APT_SUFFIXES, TABLE_SUFFIXES, toolpath_suffix
from compensator.rapid import with_marks
from identification.common.files import check_distinct, check_writable, json_bytes, sha256
from identification.common.findings import Finding, error, fold
from identification.model.cell import read_cell
from identification.model.controller import check_rapid

RECORD = "compstiff-post"


@dataclass(frozen=True, eq=False)
class PostedFiles:
    """files: what to write, the main module first, the record last. parts: the targets of each part, none where the program is
    one module."""

    posted: Posted
    files: dict[Path, bytes]
    parts: tuple[int, ...]
    findings: tuple[Finding, ...]

    def as_dict(self) -> dict[str, Any]:
        """Of the posted program, with its parts."""
        return {**self.posted.as_dict(), "parts": list(self.parts)}

    def lines(self) -> list[str]:
        """Of the posted program, with its parts."""
        split = f"parts: {len(self.parts)}, of {min(self.parts)} to {max(self.parts)} targets" if self.parts else ""
        return [*self.posted.lines(), *([split] if split else [])]


def post_files(
    cell_file: Path, toolpath_file: Path, output: Path, settings: PostingSettings, *, overwrite: bool = False
) -> PostedFiles:
    """Posts an APT or CSV toolpath; nothing is written. The record stands beside output.

    Raises CompstiffError: CS4201 (a format that is not posted), CS0003 (a file is there already, and not `overwrite`), CS0006
    (an output is an input), CS0060 (another maker's robot), and what `read_cell`, `read_cam_path`, `post` and `split_files`
    raise.

    >>> from pathlib import Path
    >>> posted = compstiff.post_files(Path("post.yaml"), Path("part.apt"), Path("part.mod"), compstiff.Settings().posting)
    >>> posted.as_dict()["targets"]
    51
    """
    inputs, record_file = [cell_file, toolpath_file], output.with_name(output.name + ".json")
    check_distinct(inputs, [output, record_file])
    check_writable([output, record_file], overwrite=overwrite)
    posted_suffixes = (*APT_SUFFIXES, *TABLE_SUFFIXES)
    if toolpath_suffix(toolpath_file) not in posted_suffixes:
        raise error("CS4201", f"toolpath format '{toolpath_file.suffix}' is not posted, expected one of "
                    f"{', '.join(posted_suffixes)}", file=str(toolpath_file),
                    hint="a RAPID program is planned already: give it to predict and correct as it is; of G-code give the "
                    "cutter locations (APT, CLS) that the CAM system made it from")
    cell = read_cell(cell_file)
    check_rapid(cell.robot, "post writes RAPID")
    posted = post(read_cam_path(toolpath_file, settings), cell, settings, str(output))
    content, of_marks = with_marks(posted.program, settings.mark) if settings.mark else (posted.content, ())
    files, parts, of_splitting = split_files(content, posted.rapid, settings, output, overwrite=overwrite)
    if settings.mark:
        files[output.with_name(f"{output.stem}_marktest.mod")] = mark_test(settings.mark)
        check_writable(files, overwrite=overwrite)
    check_distinct(inputs, files)
    result = PostedFiles(posted, files, parts, (*posted.findings, *of_marks, *of_splitting))
    # The record first: killed between two renames, no program is left without it.
    return replace(result, files={record_file: json_bytes(_record(cell_file, toolpath_file, result)), **files})


def _record(cell_file: Path, toolpath_file: Path, result: PostedFiles) -> dict[str, Any]:
    """What was made from what (docs/formats.md, post)."""
    return {
        "format": RECORD, "version": 1, "compstiff": version("compstiff"),
        "input": {"file": toolpath_file.name, "sha256": sha256(toolpath_file)},
        "cell": {"file": cell_file.name, "sha256": sha256(cell_file)},
        "outputs": [{"file": file.name, "sha256": hashlib.sha256(data).hexdigest()} for file, data in result.files.items()],
        "summary": result.as_dict(),
        "findings": [finding.as_dict() | {"file": Path(finding.file).name if finding.file else None}
                     for finding in fold(result.findings)],
    }
