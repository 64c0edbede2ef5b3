"""One program corrected into its files: all of them, or none; and what a person reads of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from compensator.correction.job import (
    Corrected,
    Inputs,
    Predicted,
    as_logged,
    check_distinct,
    check_not_corrected,
    correct_program,
    predict_program,
    record,
    summary,
)
from compensator.correction.offsets import offsets_csv
from compensator.correction.settings import Settings
from compensator.posting.split_files import split_files
from identification.common.files import check_writable, json_bytes, write_whole
from identification.common.findings import counted


def run_correction(
    inputs: Inputs, output: Path, offsets: Path | None, report: Path | None, settings: Settings, *, overwrite: bool,
    before_writing: Callable[[], None] | None = None,
) -> Corrected:
    """Corrects one program and writes all its files, or none. What `before_writing` raises stops it at the last moment."""
    record_file = output.with_name(output.name + ".json")
    outputs = [output, record_file, *(path for path in (offsets, report) if path)]
    check_distinct(inputs, outputs)
    check_writable(outputs, overwrite=overwrite)
    if not overwrite:
        check_not_corrected(inputs.toolpath)
    corrected = correct_program(predict_program(inputs, settings))
    air = ~corrected.predicted.forces.forced | corrected.predicted.rapid
    files, _, said = split_files(corrected.content, air, settings.posting, output, overwrite=overwrite)
    check_distinct(inputs, list(files))
    corrected = replace(corrected, findings=(*corrected.findings, *said))
    files[record_file] = json_bytes(record(corrected, files))
    if offsets:
        files[offsets] = offsets_csv(corrected)
    if report:
        from compensator.correction.report import path_report

        files[report] = path_report(corrected.predicted, corrected).encode()
    if before_writing:
        before_writing()
    write_whole(files)
    return corrected


def prediction_lines(predicted: Predicted) -> list[str]:
    figures = summary(predicted)
    deviation, std = figures["deviation_um"], figures["deviation_std_um"]
    return [
        f"targets: {figures['targets']}, {figures['with_force']} with force, {figures['without_sample']} without a sample",
        f"predicted deviation: largest {deviation['largest']:.1f} um, RMS {deviation['rms']:.1f} um; its standard deviation "
        f"up to {std['largest']:.1f} um",
    ]


def correction_lines(corrected: Corrected) -> list[str]:
    """The correction for the terminal."""
    figures = summary(corrected.predicted, corrected)
    offset, residual = figures["offset_mm"], figures["residual_um"]
    added = [f"intermediate targets added: {figures['added_targets']}"] if figures["added_targets"] else []
    return [
        *prediction_lines(corrected.planned), *added,
        f"corrected: {figures['corrected']} targets; largest correction {offset['largest']:.4f} mm and "
        f"{figures['turn_deg']['largest']:.4f} deg",
        f"left after correction, by the same model: largest {residual['largest']:.2f} um, RMS {residual['rms']:.2f} um ("
        + (f"{counted(figures['held_back'], 'correction')} held back, else the rounding of the written numbers)"
           if figures["held_back"] else "the rounding of the written numbers)"),
        f"expected to end up farther off than uncorrected: {figures['expected_worse']:.1f} of {figures['corrected']} targets",
        *([f"forces taken as logged: {as_logged(figures)}"] if figures["left_at_10_n_per_mm_um"] else []),
        *(corrected.advice.words() if corrected.advice else []),
        *([] if figures["feed_check"] is None else _feed_lines(**figures["feed_check"])),
    ]


def _feed_lines(planned: dict[str, Any], corrected: dict[str, Any]) -> list[str]:
    def both(key: str, form: str, factor: int = 1) -> str:
        return f"{factor * corrected[key]:{form}} (as planned {factor * planned[key]:{form}})"

    return [
        f"feed cannot be held by {both('held_back', 'd')} of {corrected['judged']} moves, in the cut by "
        f"{both('held_back_with_force', 'd')}; lowest share {both('lowest_feed_ratio', '.0f', 100)} %, in the cut "
        f"{both('lowest_feed_ratio_with_force', '.0f', 100)} %",
        f"time: {both('time_s', '.1f')} s, of them {both('lost_held_back_s', '.2f')} s lost where the feed cannot be held and "
        f"{both('lost_ramps_s', '.2f')} s at stops and changes of feed",
    ]
