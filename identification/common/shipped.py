"""Folders that come with the program: the samples and the RAPID templates."""

from __future__ import annotations

from pathlib import Path


def shipped(folder: str) -> Path:
    """The folder `samples` or `rapid_templates`: inside the installed package, or beside it in a checkout."""
    here = Path(__file__).resolve().parent
    installed = here / "_data" / folder
    return installed if installed.is_dir() else here.parents[1] / folder
