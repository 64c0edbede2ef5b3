"""`compstiff design`: which poses and loads to measure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.outcome import Outcome, Session, call


class Axes(click.ParamType[str]):
    """One to three of x, y, z."""

    name = "XYZ"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        text = str(value).lower()
        if not text or set(text) - set("xyz") or len(set(text)) != len(text):
            self.fail(f"'{value}' is not one to three different letters of xyz", param, ctx)
        return text


@command("design", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.option("-o", "--output", required=True, type=WRITABLE, help="The plan to write: a measurement file to fill in.")
@click.option("--measurements", type=click.IntRange(1, 60), help="Runs: poses, each with its loads.  [default: 8]")
@click.option("--criterion", type=click.Choice(["D", "A", "E", "I", "C"]),
              help="What the plan is best for; C: to tell causes apart too.  [default: I with --toolpath, else D]")
@click.option("--toolpath", type=READABLE, help="The milling program whose predicted deflection shall be sure.")
@click.option("--forces", "forces_file", type=READABLE, help="Its force log; without it all directions count alike.")
@click.option("--protocol", type=click.Choice(["cycle", "single"]), default="cycle", show_default=True,
              help="Loads at a pose: up, back to zero and the other way, or zero and one load.")
@click.option("--axes", type=Axes(), default="xyz", show_default=True, help="Base axes the cylinder can push along.")
@click.option("--every-axis", is_flag=True, help="At each pose load along every axis in turn.")
@click.option("--direction", type=click.Choice(["axis", "free"]), default="axis", show_default=True,
              help="Push along base axes, or at each pose along a line of its own.")
@click.option("--max-force", type=click.FloatRange(1, 20000), help="Largest force [N].  [default: 300]")
@click.option("--dead-weight", metavar="KG[,KG...]",
              help="Weights that are hung on and taken off, in place of a cylinder; 20,40,20+40: two weights and both.")
@click.option("--position", "positions", type=float, nargs=3, multiple=True, metavar="X Y Z",
              help="Where the TCP stands in the base frame [mm]; several: any of them.")
@click.option("--box", type=float, nargs=6, metavar="X Y Z X Y Z", help="Or anywhere between these corners [mm].")
@click.option("--phi", type=click.FloatRange(5, 180), default=80.0, show_default=True,
              help="Window of the tool's orientation [deg]; 180: none.")
@click.option("--replicates", type=click.IntRange(1, 10), default=1, show_default=True, help="Visits to each pose.")
@click.option("--preset", type=click.Choice(["paper", "outlook"]),
              help="The paper's plan (4 orientations, 5 loads); or its outlook, all three axes at each pose.")
@click.option("--add", type=(click.IntRange(1, 60), READABLE), metavar="N MEASUREMENTS",
              help="The next N runs, given what was measured.")
@click.option("--diagnosis", type=READABLE, help="With --add: runs that tell its rival causes apart.")
@click.option("--validate", "kept", type=click.IntRange(0, 20), default=0, show_default=True,
              help="Further poses that are never fitted, to judge the fit by.")
@click.option("--rapid", type=WRITABLE, help="Also write a RAPID program that drives through the poses.")
@click.option("--report", type=WRITABLE, help="Also write an HTML report.")
@click.option("--quick", is_flag=True, help="A shorter search, ten to twenty seconds; a looser certificate.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the random starts.")
def design(
    session: Session, cell_file: Path, output: Path, measurements: int | None, criterion: str | None, toolpath: Path | None,
    forces_file: Path | None, protocol: str, axes: str, every_axis: bool, max_force: float | None, dead_weight: str | None,
    positions: tuple[tuple[float, float, float], ...], box: tuple[float, ...] | None, phi: float, replicates: int,
    preset: str | None, add: tuple[int, Path] | None, diagnosis: Path | None, kept: int, direction: str,
    rapid: Path | None, report: Path | None, quick: bool, seed: int,
) -> Outcome:
    """Plan the poses and loads that tell most, and certify how good the plan is.

    CELL is cell.yaml. The plan is a measurement file: fill in its deflections, then identify and diagnose it.

    A run is one pose with its loads. Poses keep 2 deg from the joint limits, 10 deg from wrist and elbow singularities and
    0.15 m from the shoulder's. Collisions are NOT checked: drive the program in manual mode first.
    """
    _check_call(measurements, preset, add, positions, box, forces_file, toolpath)
    _check_loads(axes, every_axis, direction, preset, diagnosis, add)
    if diagnosis and criterion == "C":
        raise click.UsageError("--criterion C is for causes of any kind, --diagnosis for its rival causes: give one of them")
    if dead_weight and (preset or every_axis or axes != "xyz" or direction == "free" or max_force):
        raise click.UsageError("--dead-weight only pulls down, with the weights' own force; it takes no --axes, --every-axis, "
                               "--direction, --max-force or --preset")
    import os

    # Matrices of six by six: threads only get into each other's way, five times as slow where the cores are shared.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    if dead_weight:
        _check_weights(dead_weight)
    from compstiff import Request, design_plan, milling_poses, read_cell, read_measurements
    from identification.common.files import check_writable, json_bytes, write_whole
    from identification.design.discrimination import read_diagnosis
    from identification.model.controller import check_rapid

    more, measured_file = add or (measurements, None)
    session.inputs += [file for file in (cell_file, toolpath, forces_file, measured_file, diagnosis) if file]
    check_writable([file for file in (output, rapid, report) if file], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    if rapid:
        check_rapid(cell.robot, "--rapid writes RAPID")     # before the search, which takes its time
    milling = milling_poses(cell, toolpath, forces_file) if toolpath else None
    plan = design_plan(cell, Request(
        measurements=more, criterion=criterion, protocol=protocol, axes=axes, every_axis=every_axis, free=direction == "free",
        force_n=max_force or 300.0, dead_weight=dead_weight, positions_mm=positions, box_mm=box, phi_deg=phi,
        replicates=replicates, preset=preset,
        measured=read_measurements(measured_file, cell) if measured_file else None,
        diagnosis=read_diagnosis(diagnosis, cell) if diagnosis else None, kept_back=kept,
    ), milling=milling, seed=seed, quick=quick, say=session.say)
    program = plan.rapid(rapid.stem) if rapid else None
    files = {output: plan.csv()}
    if rapid and program:
        files[rapid] = program.content
    if report:
        from identification.design.pages import design_report

        files[report] = design_report(plan, program).encode()
    content = plan.as_dict()
    json_bytes(content)             # what JSON cannot say stops it before anything is written
    write_whole(files, overwrite=session.overwrite, read=session.read)
    filled = output.with_name("measurements.csv")
    following = f"save it as {filled}, then " + call("identify", cell_file, filled, "-o",
                                                           output.with_name("stiffness.json"))
    if measured_file:
        again = call("diagnose", cell_file, measured_file, "-o", diagnosis or "diagnosis.json", "--force")
        following = f"append the rows to {measured_file}, then {again}"
    return Outcome(content, (*plan.findings, *(program.findings if program else ())), plan.lines(),
                   next_step=f"measure it, fill in dx_um dy_um dz_um, {following}")


def _check_call(
    measurements: int | None, preset: str | None, add: tuple[int, Path] | None, positions: tuple[Any, ...],
    box: tuple[float, ...] | None, forces: Path | None, toolpath: Path | None,
) -> None:
    """Raises click.UsageError for options that exclude each other."""
    if positions and box:
        raise click.UsageError("--position and --box exclude each other")
    if add and (measurements or preset):
        raise click.UsageError("--add says how many runs; it takes neither --measurements nor --preset")
    if preset == "paper" and measurements:
        raise click.UsageError("--preset paper has five measurements; leave --measurements out")
    if forces and not toolpath:
        raise click.UsageError("--forces belongs to --toolpath")


def _check_weights(text: str) -> None:
    """Raises click.UsageError for what is no list of weights."""
    from identification.design.dead_weights import DeadWeights

    try:
        DeadWeights.of(text)
    except ValueError as reason:
        raise click.UsageError(f"--dead-weight takes masses in kg such as 20,40 or 20,40,20+40, not '{text}': {reason}"
                               ) from reason


def _check_loads(
    axes: str, every_axis: bool, direction: str, preset: str | None, diagnosis: Path | None, add: tuple[int, Path] | None
) -> None:
    """Raises click.UsageError for options of the loads that exclude each other, or that are left without their partner."""
    if direction == "free" and (preset or every_axis or axes != "xyz"):
        raise click.UsageError("--direction free loads each pose along a line of its own; it takes no --axes, --every-axis or "
                               "--preset")
    if diagnosis and not add:
        raise click.UsageError("--diagnosis belongs to --add N MEASUREMENTS: the rivals are fitted to what was measured")
