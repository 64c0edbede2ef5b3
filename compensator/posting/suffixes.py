"""What a toolpath's file name says: its format, and the stem that its force log shares."""

from __future__ import annotations

import re
from pathlib import Path

RAPID_SUFFIXES = (".mod", ".modx", ".prg", ".sys")
APT_SUFFIXES = (".apt", ".aptsource", ".cls", ".cl", ".ncl")
TABLE_SUFFIXES = (".csv", ".parquet", ".pq")
# What is taken for a toolpath in a folder; a table is one only where it is named.
TOOLPATH_SUFFIXES = (*RAPID_SUFFIXES, *APT_SUFFIXES)
# Creo numbers the versions of a file: roughing.ncl.3.
_VERSION = re.compile(r"\.\d+\Z")


def _unversioned(file: Path) -> Path:
    plain = file.with_name(_VERSION.sub("", file.name) or file.name)
    return plain if plain.suffix.lower() in APT_SUFFIXES else file


def toolpath_suffix(file: Path) -> str:
    """The suffix in lower case, without Creo's version number: `.ncl` of `roughing.ncl.3`."""
    return _unversioned(file).suffix.lower()


def toolpath_stem(file: Path) -> str:
    """The name without suffix and version: `roughing` of `roughing.ncl.3`."""
    return _unversioned(file).stem


def rapid_suffix(toolpath: Path) -> str:
    """The suffix of the RAPID program made from a toolpath."""
    return toolpath.suffix if toolpath.suffix.lower() in RAPID_SUFFIXES else ".mod"
