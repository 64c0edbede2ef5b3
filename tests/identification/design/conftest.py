"""A small cell, its domain and its pool, shared by the tests of the design."""

from __future__ import annotations

import numpy as np
import pytest

from identification.design.domain import Domain, random_pool
from identification.design.information import instrument
from identification.design.loads import slot
from identification.model.cell import read_cell
from tests.support import write_cell

CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250], mass_kg: 80, centre_of_mass_mm: [0, 0, 120]}
measurement:
  {deflection_std_um: [2, 2, 3], force_std_n: [0.5, 0.5, 0.5], force_relative_std: 0.005, pose_offset_std_um: [3, 3, 0]}
"""


@pytest.fixture(scope="session")
def cell(tmp_path_factory):
    return read_cell(write_cell(tmp_path_factory.mktemp("design"), CELL))


@pytest.fixture(scope="session")
def domain(cell):
    slots = tuple(slot(axis, "cycle", 300.0) for axis in "xyz")
    return Domain(instrument(cell), slots, np.array([[1.36, 0.0, 0.81]]))


@pytest.fixture(scope="session")
def pool(domain):
    return random_pool(domain, 1000, np.random.default_rng(4))


@pytest.fixture(scope="session")
def prior(cell):
    return np.eye(6) / cell.prior.log_std**2
