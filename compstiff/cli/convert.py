"""`compstiff convert`: public logs as columns that the other commands read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.outcome import Outcome, Session

if TYPE_CHECKING:
    pass


@command("convert", writes=True)
@click.argument("log", metavar="LOG", type=READABLE)
@click.option("--form", required=True, type=click.Choice(["kuka-kr300", "metallicadour", "lvm", "net-ft"]),
              help="What LOG is.")
@click.option("-o", "--output", required=True, type=WRITABLE, help="The CSV or Parquet file to write.")
@click.option("--rate", type=click.FloatRange(min=0, min_open=True), help="Samples a second (metallicadour, net-ft).")
@click.option("--channels", default="Fx,Fy,Fz,Mx,My,Mz", show_default=True, help="Force, then moment channels (lvm).")
@click.option("--counts-per-force", type=click.FloatRange(min=0, min_open=True), default=1e6, show_default=True,
              help="Of the sensor (net-ft).")
@click.option("--counts-per-torque", type=click.FloatRange(min=0, min_open=True), default=1e6, show_default=True,
              help="Of the sensor (net-ft).")
def convert(
    session: Session, log: Path, form: str, output: Path, rate: float | None, channels: str, counts_per_force: float,
    counts_per_torque: float,
) -> Outcome:
    """Turn a public or a sensor's own log into columns that the other commands read."""
    from compstiff import convert_log
    from identification.common.files import check_writable, write_whole

    session.inputs.append(log)
    check_writable([output], overwrite=session.overwrite)
    converted = convert_log(log, form, rate=rate, channels=tuple(name.strip() for name in channels.split(",")),
                            counts=(counts_per_force, counts_per_torque))
    content = converted.content(parquet=output.suffix.lower() in (".parquet", ".pq"))
    write_whole({output: content}, overwrite=session.overwrite, read=session.read)
    return Outcome(converted.as_dict(), converted.findings, converted.lines())
