"""`compstiff demo`: the main job on the shipped samples."""

from __future__ import annotations

from pathlib import Path

import click

from compstiff.cli.console import command
from compstiff.outcome import Outcome, Session


@command("demo", writes=True)
@click.argument("folder", metavar="[DIR]", default="compstiff-demo", type=click.Path(file_okay=False, path_type=Path))
def demo(session: Session, folder: Path) -> Outcome:
    """Run identify and correct on the shipped samples, into DIR.

    The samples are simulated (samples/README.md says how); DIR is compstiff-demo if it is not given.
    """
    from compstiff.demo import run_demo

    return run_demo(session, folder)
