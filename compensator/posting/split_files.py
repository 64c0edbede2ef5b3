"""The files of a program that may be split into parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.posting.settings import PostingSettings
from identification.common.files import check_writable
from identification.common.findings import Finding, error


def split_files(
    content: bytes, air: NDArray[np.bool_], settings: PostingSettings, output: Path, *, overwrite: bool
) -> tuple[dict[Path, bytes], tuple[int, ...], tuple[Finding, ...]]:
    """What to write, file -> bytes, the main module first; the targets of each part (empty: one module); findings.

    Raises what `split_program`, `separate` and `check_writable` raise, CS4310 where --split-load stands alone.
    """
    if settings.modules:
        if settings.split is not None:
            raise error("CS4310", "--modules and --split do not go together: a program of several modules is none of one plain "
                        "procedure", hint="leave one of them out")
        from compensator.posting.modules import separate

        files = separate(content, output)
        check_writable(files, overwrite=overwrite)
        return files, (), ()
    if settings.split is None:
        if settings.split_load:
            raise error("CS4310", "--split-load says how parts are loaded, and --split N is not given", hint="add --split N")
        return {output: content}, (), ()
    from compensator.posting.splitting import split_program

    split = split_program(content, air, settings.split, output, load=settings.split_load)
    files = {output: split.main} | {output.with_name(name): part for name, part in split.parts.items()}
    check_writable(files, overwrite=overwrite)
    old = [part.name for part in sorted(output.parent.glob(f"{output.stem}_[0-9][0-9][0-9]{output.suffix}"))
           if part not in files]
    findings = split.findings
    if old:
        findings += (Finding("CS4314", "warning", f"{', '.join(old[:3])}{' ...' if len(old) > 3 else ''}: parts of an earlier "
                             "split that this one does not have", str(output), hint="delete them, so that nobody loads them"),)
    return files, split.sizes if split.parts else (), findings
