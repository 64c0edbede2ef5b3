"""Hides an effect, runs `compstiff diagnose` on the written files, and says what is wrong with the answer.

The command line sees the three files of a user and nothing else; only the judging knows the truth.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner

from compstiff.cli.main import compstiff
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.runs.hidden_effects.judge import Answer, answer, judge, label, truth_names
from tests.runs.hidden_effects.oracle import OTHER_LAW, oracle, squares_left
from tests.virtual_cell.arm_model import Tool
from tests.virtual_cell.cell import Case, Hidden, simulate

VALIDATION_POSES = 6
# The oracle's gain counts where it takes away this share of the squares at least.
WORTH = 0.1
ENOUGH = 0.8
# Enough to tell 5 % from less; where they are not, the program draws more. They take half of the time of the usual number.
REPLICATES = 39
FEW = ("--replicates", str(REPLICATES))


@dataclass(frozen=True)
class Run:
    """A case, what diagnose wrote about it, and the sum of squares [um^2] that the true model leaves on the validation rows
    (None where the dictionary cannot say what was hidden)."""

    case: Case
    content: Mapping[str, Any]
    extended: Mapping[str, Any]
    oracle: float | None

    @property
    def answer(self) -> Answer:
        return answer(self.content)

    @property
    def outcome(self) -> str:
        return judge(truth_names(self.case.truth), self.answer)


def diagnose(folder: Path, *options: str) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Runs the command on the files in the folder: diagnosis.json and the extended stiffness.json."""
    written, extended = folder / "diagnosis.json", folder / "extended.json"
    result = CliRunner().invoke(compstiff, ["diagnose", str(folder / "cell.yaml"), str(folder / "measurements.csv"), "-o",
                                            str(written), "--extended", str(extended), "--force", *options])
    assert result.exit_code == 0, result.output
    return json.loads(written.read_text()), json.loads(extended.read_text())


def run(seed: int, *hidden: Hidden, design: str = "ladder12", straight_tool: bool = False, few: bool = True) -> Run:
    """One case, diagnosed; the same object for the same arguments, in whichever way they are written."""
    return _kept(seed, hidden, design, straight_tool, few)


def run_anew(
    seed: int, hidden: tuple[Hidden, ...] = (), design: str = "ladder12", straight_tool: bool = False, few: bool = True,
) -> Run:
    """One case, diagnosed, with few replicates or as many as usual; nothing is kept of it."""
    tool = Tool(tcp=(0.0, 0.0, 0.25)) if straight_tool else None
    case = simulate(seed, design, hidden, validation=VALIDATION_POSES, tool=tool)
    with tempfile.TemporaryDirectory() as name:
        cell_file, file = case.write(name)
        content, extended = diagnose(Path(name), *(FEW if few else ()))
        cell = read_cell(cell_file)
        measurements = read_measurements(file, cell.robot)
        informed = oracle(cell, measurements, case) if hidden else None
        left = None if informed is None else squares_left(measurements, informed)
    return Run(case, content, extended, left)


_kept = cache(run_anew)


@dataclass(frozen=True)
class Place:
    """Where the ladder design can see an effect, and what else looks most like it there. long: a faster test, of the desk's
    load tests or the second cell's, names this effect, too. half: a seed at which half of the poses see it, in half of the
    time."""

    hidden: Hidden
    seed: int
    confounder: Hidden
    long: bool = False
    half: int | None = None

    @property
    def run(self) -> Run:
        """The effect hidden here, diagnosed."""
        return run(self.seed, self.hidden) if self.half is None else run(self.half, self.hidden, design="ladder6")

    @property
    def label(self) -> str:
        return label(self.hidden.effect, self.hidden.joint)


def place(
    effect: str, joint: int | None, seed: int, confounder: str, at: int | None = None, factor: float = 1.5,
    long: bool = False, half: int | None = None,
) -> Place:
    """A place; the confounder is hidden at the same joint where `at` does not say otherwise."""
    return Place(Hidden(effect, joint, factor), seed, Hidden(confounder, at, factor), long, half)


def check_answer(content: Mapping[str, Any]) -> None:
    """What docs/formats.md promises of verdict, causes, alternatives and what was withdrawn."""
    def labels(key: str) -> set[tuple[str, int | None]]:
        return {(one["effect"], one["joint"]) for one in content[key]}

    verdict = content["verdict"]
    assert bool(content["causes"]) == (verdict == "named") or content["causes"][0]["parameters"].get("single_row")
    assert not labels("causes") & labels("alternatives")
    assert not content["withdrawn"] or verdict == "unknown"
    assert list(content["withdrawn_because"]) == content["withdrawn"]
    if verdict == "adequate":
        assert not content["alternatives"]
        assert not content["noise_beyond_stated"]
    if verdict == "ambiguous":
        assert len(labels("alternatives")) >= 2
    if verdict == "named":
        assert content["gain"] is not None
    for cause in content["causes"]:
        sizes = [one for name, one in cause["parameters"].items()
                 if one["std"] and not name.startswith(("torque", "time", "phase"))]
        # Several sizes may be known by their differences alone (the gains of three sensors, beside the springs).
        known = any(abs(one["estimate"]) >= 2 * one["std"] for one in sizes)
        assert len(sizes) != 1 or known or cause["effect"] == "parallelogram"


def complaints(found: Run) -> list[str]:
    """What is wrong with the answer to a single hidden effect that can be told; empty where all is well."""
    if found.outcome != "right":
        return [f"{found.outcome}: hidden {sorted(truth_names(found.case.truth))}, answered {found.answer}"]
    return [*_parameters_off(found), *_gain_short(found)]


def _parameters_off(found: Run) -> list[str]:
    """Parameters more than three stated standard deviations off, where the hidden law is the dictionary's."""
    (truth,), (cause,) = found.case.truth, found.content["causes"]
    off = []
    for name, stated in cause["parameters"].items():
        if truth["effect"] in OTHER_LAW or name not in truth["parameters"] or stated["std"] == 0:
            continue
        error = stated["estimate"] - truth["parameters"][name]
        if name in ("angle_rad", "phase_rad"):
            error = (error + np.pi) % (2 * np.pi) - np.pi
        if abs(error) > 3 * stated["std"]:
            off.append(f"{name} is {stated['estimate']:.3g} +- {stated['std']:.2g}, true {truth['parameters'][name]:.3g}")
    return off


def _gain_short(found: Run) -> list[str]:
    """Whether the gain on the validation rows is under four fifths of the oracle's, in squares taken away."""
    gain = found.content["gain"]
    if gain is None or gain["held_out"] != "validate":
        return [f"no gain on the validation rows: {gain}"]
    count = 3 * int(found.case.validate.sum())
    before, after = count * gain["rms_before_um"] ** 2, count * gain["rms_after_um"] ** 2
    if found.oracle is None or before - found.oracle < WORTH * before:
        return []
    share = (before - after) / (before - found.oracle)
    return [f"{share:.0%} of the gain that the true model gives"] * (share < ENOUGH)
