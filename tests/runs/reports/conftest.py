"""The reports of the sample job, written once, and one browser for all of their tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import compstiff
from compensator.correction.correct import Corrected
from identification.common.scene import SpaceLine, scene
from tests.runs.reports.browser import chromium
from tests.runs.reports.pages import (
    LIKE_ANOTHER,
    SLOW_ONES,
    diagnoses,
    joint_logs,
    learning,
    page_with,
    turned_measurements,
    verification,
)


@pytest.fixture(scope="session")
def launch() -> Iterator[Callable[..., Any]]:
    with chromium() as start:
        yield start


@pytest.fixture(scope="session")
def browser(launch: Callable[..., Any]) -> Iterator[Any]:
    one = launch()
    yield one
    one.close()


@pytest.fixture(scope="session")
def results(pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory, sample: Corrected) -> dict[str, Any]:
    """Every kind of result that has a report, `diagnose` with every verdict. Without `--long` or `--slow` not those that only
    such tests look at."""
    where, cell = tmp_path_factory.mktemp("results"), sample.planned.cell
    long = pytestconfig.getoption("--long")
    unseen = () if long else LIKE_ANOTHER if pytestconfig.getoption("--slow") else (*LIKE_ANOTHER, *SLOW_ONES)
    turned = compstiff.read_measurements(turned_measurements(where), cell.robot)
    return {
        "correct": sample, "predict": sample.planned, "budget": compstiff.error_budget(sample.planned, 50e-6),
        "identify": compstiff.fit_stiffness(cell, turned), "diagnose": compstiff.diagnose(cell, turned, replicates=19),
        "verify": verification(where, cell),
        "design": compstiff.design_plan(cell, compstiff.Request(measurements=1, axes="z"), quick=True),
        "learn": learning(where, sample.planned), **joint_logs(where),
        **diagnoses(where, unseen)}


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory, results: dict[str, Any]) -> Path:
    """Their reports, and corner, each .html."""
    where = tmp_path_factory.mktemp("reports")
    pages = {name: compstiff.report(result) for name, result in results.items()}
    # An L: 80 along x, then 30 along y.
    corner = SpaceLine(np.array([[0.0, 0, 0], [80, 0, 0], [80, 30, 0]]), "before", 4.0)
    pages["corner"] = page_with([scene("A corner", "", [corner])])
    for name, text in pages.items():
        (where / f"{name}.html").write_text(text, encoding="utf-8")
    return where
