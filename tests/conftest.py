"""The sample job, run once: identify, predict and correct on the shipped files."""

from __future__ import annotations

import gc
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from compensator.correction.correct import Corrected, correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Settings
from identification.common.shipped import shipped
from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import read_cell

# Checks that several files of tests share: their assertions explain themselves too. Named before any of these is imported.
pytest.register_assert_rewrite("tests.runs.hidden_effects.hide_and_diagnose", "tests.runs.hidden_effects.places")

# How long an example takes on a busy machine says nothing.
settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")

TARE = (0, 2)

# What takes longest is given out first: a process that gets such a file last keeps the other one waiting.
LONGEST = ("reports/test_contract_browser", "hidden_effects/test_desk_world", "tests/test_documentation", "runs/mistakes",
           "forces/test_laws_time_alignment", "command_line/test_mistakes", "compstiff/test_contract_front_door",
           "second_cell/test_answers", "runs/hidden_effects", "command_line/test_rejected", "runs/milling",
           "batch/test_contract_cluster", "identification/fit", "identification/motion", "identification/diagnosis",
           "runs/faults", "upload/test_contract_faults", "path/test_laws_timing", "identification/design",
           "compensator/cutting",
           "command_line/test_laws_growth", "tests/test_fourth_world", "tests/test_fifth_world", "tests/test_site")


# What took longest when it was last measured: without --slow or --long a run leaves it out, so that one
# waits for a dozen minutes and not for twice as long.
SLOW = frozenset(line for line in Path(__file__).with_name("slow.txt").read_text(encoding="utf-8").splitlines()
                 if line and not line.startswith("#"))


# The functions of which every case is long, so that none of it runs without --long (tests/test_markers.py).
LONG_ALONE = pytest.StashKey[list[Callable[..., None]]]()
# The names of all that was collected.
COLLECTED = pytest.StashKey[frozenset[str]]()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The files in LONGEST first, in that order; all others as they were. Without `--long` no test that is marked so, without
    `--slow` none that is named in slow.txt."""
    tests = [item for item in items if isinstance(item, pytest.Function)]
    told = {item.function for item in tests if not item.get_closest_marker("long")}
    config.stash[LONG_ALONE] = [*dict.fromkeys(item.function for item in tests if item.function not in told)]
    config.stash[COLLECTED] = frozenset(item.nodeid for item in items)
    long = config.getoption("--long")
    slow = long or config.getoption("--slow")
    left = [item for item in items if (item.get_closest_marker("long") and not long) or (item.nodeid in SLOW and not slow)]
    if left:
        config.hook.pytest_deselected(items=left)
        without = {item.nodeid for item in left}
        items[:] = [item for item in items if item.nodeid not in without]
    items.sort(key=lambda item: next((i for i, name in enumerate(LONGEST) if name in item.nodeid), len(LONGEST)))


# What is collected stays until the end: to look through it for garbage time and again takes a fiftieth of the CPU.
gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--no-posix`: without what Windows does not have (tests/without_posix/removal.py). `--slow`: with the tests of slow.txt.
    `--long`: with these and with those that tell what a faster one tells in small."""
    parser.addoption("--slow", action="store_true", help="with the tests that took longest (tests/slow.txt)")
    parser.addoption("--long", action="store_true", help="with these and with those that a faster one tells in small")
    parser.addoption("--no-posix", action="store_true", help="take fcntl, fork, POSIX signals and renames over open files away")


@pytest.fixture(scope="session")
def sample_inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    """The shipped files, with the stiffnesses identified from the shipped measurements; the cell says nothing of spindle and
    cut, so that the forces are taken as logged."""
    samples, folder = shipped("samples"), tmp_path_factory.mktemp("sample")
    lines = (samples / "cell.yaml").read_text().splitlines(keepends=True)
    kept = [line for line in lines if "spindle_rpm" not in line and not line.startswith("cutting")]
    assert len(kept) == len(lines) - 2
    (folder / "cell.yaml").write_text("".join(kept))
    cell = read_cell(folder / "cell.yaml")
    fit = fit_stiffness(cell, read_measurements(samples / "measurements.csv", cell.robot))
    stiffness: Path = folder / "stiffness.json"
    stiffness.write_text(json.dumps(fit.model.as_dict()))
    return Inputs(folder / "cell.yaml", samples / "insert.mod", stiffness, samples / "insert.forces.parquet")


@pytest.fixture(scope="session")
def sample(sample_inputs: Inputs) -> Corrected:
    """The corrected sample program."""
    return correct(predict_files(sample_inputs, Settings.of(tare=(TARE,))))
