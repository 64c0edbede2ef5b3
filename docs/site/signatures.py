"""How each cause shows: what it adds to the deflection of a load cycle, and what looks like it in an ordinary plan."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np

from compstiff import judge_plan, read_cell, read_measurements
from identification.diagnosis.plan import Outlook
from identification.model.load_state import LoadState, load_state
from samples.pictures import Panel, Series, svg

ROOT = Path(__file__).resolve().parents[2]
# A pose of the sample cell away from every singularity, and a cycle both ways that comes back without leaving it.
POSE = np.radians([10.0, 15, 30, 40, 50, -30])
CYCLE = 300 * np.concatenate([np.linspace(0, 1, 13), np.linspace(1, -1, 25)[1:], np.linspace(-1, 0, 13)[1:]])
COLOURS = ("#1b6ca8", "#c0392b", "#2e7d32")
STEP_S = 20.0


def signatures_page() -> dict[str, str]:
    """The page and its pictures, by their names in the site."""
    cell = read_cell(ROOT / "samples/cell.yaml")
    outlook = judge_plan(cell, read_measurements(ROOT / "samples/measurements.csv", cell, planned=True))
    states = []
    for axis in range(3):
        wrench = np.zeros((len(CYCLE), 6))
        wrench[:, axis] = CYCLE
        state = load_state(cell.robot, cell.flange_from_tcp, np.tile(POSE, (len(CYCLE), 1)), wrench, 1 / cell.prior.stiffness)
        time = STEP_S * np.arange(1.0, len(CYCLE) + 1)
        states.append(replace(state, time=time, dwell=np.full(len(CYCLE), 0.5 * STEP_S)))
    files, parts = {}, [INTRODUCTION]
    first: dict[str, list[Outlook]] = {}
    for one in outlook.effects:
        first.setdefault(one.entry.effect.name, []).append(one)
    for name, several in sorted(first.items()):
        drawn = picture(several[0], states)
        if drawn:
            files[f"signatures/{name}.svg"] = drawn
        parts.append(section(name, several, bool(drawn)))
    return {"signatures.md": "\n\n".join(parts) + "\n", **files}


INTRODUCTION = """# How each cause shows

At one pose of the sample cell, an IRB 6660, the tool is pushed along base x, y and z in turn, up to 300 N, through zero to
-300 N and back to zero. Each picture has what the cause at its typical size adds to the deflection, along the direction in
which it adds most: a straight line is one more spring, a step at zero is play, a loop is something that remembers, and what
does not follow the load at all is the sensor or the time.

What is listed as alike is what `diagnose` cannot tell from it with the poses and loads of the sample's plan; another plan may.
What [the dictionary](effects.md) says of each cause is not repeated here."""


def picture(one: Outlook, states: list[LoadState]) -> str:
    """Three lines, a load direction each; "" where such a cycle does not show the effect."""
    effect, joint = one.entry.effect, one.entry.joint
    series = []
    for axis, state in zip("xyz", states, strict=True):
        if effect.missing(state):
            return ""
        added = 1e6 * effect.contribution(state, joint, effect.typical(state, joint))[:, :3]
        _, _, main = np.linalg.svd(added - added[0], full_matrices=False)
        along = main[0] * (1 if main[0][np.argmax(np.abs(main[0]))] > 0 else -1)
        series.append(Series(CYCLE, added @ along, COLOURS["xyz".index(axis)], f"along {axis}", line=True))
    if not all(np.isfinite(line.y).all() for line in series) or max(np.ptp(line.y) for line in series) < 1e-3:
        return ""
    return svg([Panel(one.entry.label, "load [N]", "added deflection [um]", series)])


def section(name: str, several: list[Outlook], drawn: bool) -> str:
    """One effect: its sentence, its picture, what looks like it, and what would settle it."""
    effect, joints = several[0].entry.effect, [one.entry.joint for one in several if one.entry.joint]
    alike = sorted({other for one in several for other in one.alike})
    sentence = effect.sentence.format_map(defaultdict(lambda: "...", joint="N"))
    where = f" (joints {', '.join(map(str, joints))})" if joints else ""
    lines = [f"## {name}", f"{sentence[0].upper()}{sentence[1:]}{where}."]
    lines.append(f"![What {name} adds over a load cycle](signatures/{name}.svg){{ width=320 }}" if drawn else
                 "This cycle does not show it.")
    lines.append(f"*Alike in this plan:* {', '.join(alike)}." if alike else "*Alike in this plan:* nothing.")
    lines.append(f"*What settles it:* {effect.settles}.")
    return "\n\n".join(lines)
