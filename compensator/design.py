"""`compstiff design`: identification's command, with the reader of milling programs and the templates of this package."""

from __future__ import annotations

from pathlib import Path

from identification.design.commands import MillingReader, design_command


def _reader() -> MillingReader:
    from compensator.milling_poses import milling_poses

    return milling_poses


def _templates() -> Path:
    from compensator.data import shipped

    return shipped("rapid_templates")


design = design_command(_reader, _templates)
