"""A call of the command line to copy, quoted as the shell of this system wants it."""

from __future__ import annotations

import os
import shlex


def call(*words: object) -> str:
    """A call of `compstiff`: a name with a blank is one word of it, as this system's shell writes it."""
    line = ["compstiff", *map(str, words)]
    if os.name == "nt":
        from subprocess import list2cmdline

        return list2cmdline(line)
    return shlex.join(line)
