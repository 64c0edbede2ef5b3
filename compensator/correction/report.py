"""The report of `predict` and `correct`: the path coloured by its deviation, and the deviation along the path."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correct import Corrected
from compensator.correction.expected_left import CAUSES
from compensator.correction.feed_pages import feed_figures, feed_table
from compensator.correction.predict import Predicted
from compensator.correction.settings import EXACTLY_ONE
from identification.common.report import AXES, AXIS_COLOURS, Figure, ReportTable, render

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# What a browser draws fluently.
MOST_POINTS = 20_000


def path_report(job: Predicted | Corrected) -> str:
    """The report of one program, predicted or corrected."""
    corrected = job if isinstance(job, Corrected) else None
    predicted = job.predicted if isinstance(job, Corrected) else job
    figures = job.as_dict()
    name = Path(predicted.program.source or predicted.path.toolpath.source).name
    deviation, std = figures["deviation_um"], figures["deviation_std_um"]
    lead = [
        f"{figures['predicted']} of {figures['targets']} targets of {name} carry force. Without correction the tool is pushed "
        f"off its path by up to {deviation['largest']:.0f} um ({deviation['rms']:.0f} um RMS); that prediction is uncertain "
        f"by up to {std['largest']:.1f} um (1 sigma)."]
    rows = [["targets", f"{figures['targets']}"], ["with force", f"{figures['with_force']}"],
            ["without a sample", f"{figures['without_sample']}"],
            ["predicted deviation, largest / RMS [um]", f"{deviation['largest']:.1f} / {deviation['rms']:.1f}"],
            ["its 1 sigma, largest / RMS [um]", f"{std['largest']:.1f} / {std['rms']:.1f}"]]
    if corrected is not None:
        offset, residual = figures["offset_mm"], figures["residual_um"]
        lead.append(
            f"{figures['corrected']} targets were corrected, by up to {offset['largest']:.3f} mm. With the written numbers the "
            f"same model leaves {residual['largest']:.2f} um at most. "
            f"{corrected.left.sentence(predicted.settings.correction.depth_of_cut)} "
            f"{figures['expected_worse']:.1f} of the targets are expected to end up farther off than uncorrected. "
            + (f"The force follows the cut: {corrected.stiffness.words()} ({corrected.stiffness.origin})."
               if corrected.left_as_logged is None and corrected.stiffness is not None else
               "The forces are taken as logged. A corrected path cuts a little more, and the force changes with it: "
               f"{corrected.as_logged()}."))
        if predicted.settings.correction.scale == EXACTLY_ONE:
            lead.append("The stiffnesses come from load tests at rest. In motion robots have been measured to give way more: "
                        "measure a corrected pass, and let verify set --scale.")
        if corrected.advice is not None:
            lead += corrected.advice.lines()
        rows += [["intermediate targets", f"{figures['added_targets']}"],
                 ["corrections held back", f"{figures['held_back']}"],
                 ["largest correction [mm]", f"{offset['largest']:.4f}"],
                 ["largest rotation [deg]", f"{figures['turn_deg']['largest']:.4f}"],
                 ["left at targets by the same model, largest / RMS [um]",
                  f"{residual['largest']:.2f} / {residual['rms']:.2f}"]]
        for cause, words in CAUSES.items():
            rows.append([f"expected to be left on the part: {words}, RMS [um]", f"{figures['expected_left_um'][cause]:.2f}"])
        if figures["between_um"]:
            between = figures["between_um"]
            rows.append(["left between targets, largest / RMS [um]", f"{between['largest']:.2f} / {between['rms']:.2f}"])
            lead.append(f"Between the targets of the {between['moves']} moves that were looked at it leaves "
                        f"{between['largest']:.1f} um at most; zones are not counted.")
    along = _along(predicted, corrected)
    tables, drawn = [ReportTable("In figures", ["what", "value"], rows, numbers=(1,))], [_space(predicted), along]
    if corrected is not None and corrected.feed is not None:
        tables.append(feed_table(corrected.feed))
        drawn += feed_figures(corrected.feed)
    return render(f"{'Corrected' if corrected else 'Predicted'}: {name}", lead, tables, drawn,
                  job.findings, figures)


def _kept(predicted: Predicted) -> tuple[Indices, str]:
    """The targets that are drawn: all, or the ends and the largest deviation of equal stretches; and a word on it."""
    count = len(predicted.path.toolpath)
    if count <= MOST_POINTS:
        return np.arange(count), ""
    size = np.zeros(count)
    size[predicted.targets] = np.linalg.norm(predicted.prediction.position, axis=1)
    stretches = np.array_split(np.arange(count), MOST_POINTS // 2)
    kept = np.unique([index for part in stretches for index in (part[0], part[np.argmax(size[part])])])
    return kept, f" {len(kept)} of {count} targets are drawn: of each stretch the first and the one that deviates most."


def _space(predicted: Predicted) -> Figure:
    """The path in the base frame; colour: deviation along the direction in which the tool is pushed most."""
    targets = predicted.targets
    kept, note = _kept(predicted)
    where = 1e3 * predicted.path.base_from_tcp.position
    known = predicted.path.known[kept]
    air = np.where(known[:, None], where[kept], np.nan)
    data: list[dict[str, Any]] = [
        {"type": "scatter3d", "mode": "lines", "x": air[:, 0], "y": air[:, 1], "z": air[:, 2], "name": "path",
         "line": {"color": "#bbb", "width": 1}, "hoverinfo": "skip"}]
    drawn = np.flatnonzero(np.isin(targets, kept))
    caption = "No target has force."
    if len(drawn):
        position = 1e6 * predicted.prediction.position
        # The sign of the deviation is counted along its own main direction, so that the colours diverge about zero.
        direction = np.linalg.svd(position, full_matrices=False)[2][0]
        direction = direction * (np.sign(direction[np.argmax(np.abs(direction))]) or 1.0)
        along = (position @ direction)[drawn]
        limit = float(np.percentile(np.abs(along), 99)) or 1.0
        clipped = int((np.abs(along) > limit).sum())
        points = where[targets[drawn]]
        data.append({
            "type": "scatter3d", "mode": "markers", "x": points[:, 0], "y": points[:, 1], "z": points[:, 2],
            "name": "with force", "text": [f"target {t}, {a:.1f} um" for t, a in zip(
                predicted.path.toolpath.number[targets[drawn]], along, strict=True)],
            "hoverinfo": "text",
            "marker": {"size": 2.5, "color": along, "colorscale": "RdBu", "reversescale": True, "cmin": -limit,
                       "cmax": limit, "colorbar": {"title": {"text": "um"}}}})
        caption = (f"Base frame. Colour: predicted deviation along ({', '.join(f'{x:.2f}' for x in direction)}), the direction "
                   f"the tool is pushed in most; {clipped} of {len(along)} points are beyond the ends of the scale." + note)
    axes = {f"{axis}axis": {"title": {"text": f"{axis} [mm]"}} for axis in AXES}
    camera = {"eye": {"x": 1.3, "y": -1.6, "z": 1.3}}
    layout = {"scene": {"aspectmode": "data", "camera": camera, **axes}, "showlegend": False}
    return Figure("The path and where the tool is pushed", caption, data, layout, height=560)


def _along(predicted: Predicted, corrected: Corrected | None) -> Figure:
    kept, note = _kept(predicted)
    targets = predicted.targets
    count = len(predicted.path.toolpath)
    length = 1e3 * predicted.path.length[kept]
    values, sigma = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    values[targets], sigma[targets] = 1e6 * predicted.prediction.position, 1e6 * predicted.prediction.std
    values, sigma = values[kept], sigma[kept]
    data: list[dict[str, Any]] = []
    for axis in range(3):
        data.append({"type": "scatter", "mode": "lines", "x": length, "y": values[:, axis], "name": f"d{AXES[axis]}",
                     "line": {"color": AXIS_COLOURS[axis], "width": 1.5}, "connectgaps": False})
        for sign in (-2, 2):
            data.append({"type": "scatter", "mode": "lines", "x": length, "y": values[:, axis] + sign * sigma[:, axis],
                         "line": {"color": AXIS_COLOURS[axis], "width": 0.5, "dash": "dot"}, "showlegend": False,
                         "hoverinfo": "skip", "connectgaps": False})
    if corrected is not None:
        left = np.full(count, np.nan)
        left[targets] = 1e6 * corrected.residual
        data.append({"type": "scatter", "mode": "lines", "x": length, "y": left[kept], "name": "left, same model",
                     "line": {"color": "#222", "width": 1.5}, "connectgaps": False})
    layout = {"xaxis": {"title": {"text": "path length [mm]"}, "gridcolor": "#eee"},
              "yaxis": {"title": {"text": "deviation [um]"}, "gridcolor": "#eee", "zerolinecolor": "#888"}}
    caption = "Predicted deviation of the uncorrected program, base frame; dotted: 2 sigma."
    return Figure("Deviation along the path", caption + note, data, layout)
