"""Grades, the ellipsoid in words and the spectrum of what the data say: each side of its limits, by hand."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.fit import identifiability
from identification.fit.identifiability import JointGrade, ellipsoid, grade_joints, information_spectrum
from identification.fit.misfit import ModelCheck
from identification.fit.noise_parts import VarianceComponents
from identification.model.cell import read_cell
from tests.identification.fit.exact_rows import by_compliance
from tests.identification.fit.test_laws_posterior import TRUE
from tests.support import random_poses, write_cell


def graded(monkeypatch: pytest.MonkeyPatch, std: float, before: float, rejected: bool = False) -> JointGrade:
    """The grade of joint 4, whose ln k is known to `std`, `before` the measurements."""
    monkeypatch.setattr(identifiability, "_helpful", lambda posterior, joint: f"a load for {joint}")
    covariance = np.diag(np.array([0.1, 0.1, 0.1, std, 0.1, 0.1]) ** 2)
    design = np.full((4, 3, 6), 3.0)
    design[2, 1, 3] = -90.0
    state = SimpleNamespace(torque=np.ones((4, 6)), wrench=np.ones((4, 6)), fall=np.array([0.0, 0, -9.81]))
    posterior: Any = SimpleNamespace(
        covariance=covariance, components=VarianceComponents(sensor=2.0), at_map=SimpleNamespace(design=design),
        load_state=state, prior=SimpleNamespace(log_std=np.full(6, before)))
    return grade_joints(posterior, ModelCheck(1.0, rejected, ""))[3]


@pytest.mark.parametrize(("std", "before", "grade"), [
    (0.195, 0.8, "reliable"), (0.205, 0.8, "tentative"), (0.53, 0.8, "tentative"), (0.54, 0.8, "not identifiable"),
    (0.09, 0.13, "not identifiable"), (0.09, 0.14, "reliable")])
@pytest.mark.parametrize("rejected", [False, True])
def test_a_joint_is_reliable_to_a_fifth_and_not_identifiable_where_its_prior_has_not_shrunk_by_a_third(
        monkeypatch: pytest.MonkeyPatch, std: float, before: float, grade: str, rejected: bool) -> None:
    """None is reliable while the model is rejected; what is told of the others stays."""
    found = graded(monkeypatch, std, before, rejected)
    fallen, reason = rejected and grade == "reliable", "it moves a reading by up to 45 times the sensor's sigma"
    assert found.joint == 4
    assert found.grade == ("tentative" if fallen else grade)
    assert found.shrinkage == pytest.approx(std / before)
    assert found.signal == pytest.approx(45.0)
    assert (found.partner, found.correlation) == (0, 0.0)
    assert found.reason == (f"the model of all joints is rejected; by itself {reason}" if fallen else reason)
    assert found.helpful == ("compstiff diagnose looks for what the model lacks" if fallen else
                             "" if grade == "reliable" else "a load for 3")


@pytest.mark.parametrize("joint", [0, 4])
def test_the_load_that_helps_is_the_best_of_many_and_leaves_what_it_says(tmp_path: Path, joint: int) -> None:
    """Along one base axis at a pose that the robot reaches, under a noise of three times the stated: no other load of some
    hundreds leaves a tenth less of the variance."""
    cell = read_cell(write_cell(tmp_path, "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"
                                          "measurement: {deflection_std_um: [20, 60, 40]}\n"))
    root = np.random.default_rng(2).standard_normal((6, 6))
    covariance = 0.04 * (np.eye(6) + 0.05 * root @ root.T)
    posterior: Any = SimpleNamespace(data=SimpleNamespace(cell=cell), mean=-np.log(TRUE), covariance=covariance,
                                     components=VarianceComponents(sensor=3.0))

    def left(theta: np.ndarray, axis: np.ndarray) -> np.ndarray:
        each = by_compliance(theta, cell.flange_from_tcp.position, 300 * np.eye(3)[axis]) / TRUE
        precision = np.diag((3.0 * np.array([20e-6, 60e-6, 40e-6])) ** -2.0)
        after = np.linalg.inv(np.linalg.inv(covariance) + np.swapaxes(each, 1, 2) @ precision @ each)
        return np.sqrt(after[:, joint, joint] / covariance[joint, joint])

    hint = identifiability._helpful(posterior, joint)
    told = re.fullmatch(r"one load of 300 N along base ([xyz]) at joints \((.*)\) deg would bring the uncertainty of "
                        rf"k{joint + 1} to (\d+) % of what it is", hint)
    assert told, hint
    theta = np.radians([[float(angle) for angle in told[2].split(",")]])
    assert np.all(cell.robot.limit_excess(theta) <= 0)
    (found,) = left(theta, np.array(["xyz".index(told[1])]))
    assert float(told[3]) / 100 == pytest.approx(found, abs=0.015)
    assert 0.1 < found < 0.9
    others = np.repeat(random_poses(cell.robot, 300, np.random.default_rng(7), 0.7), 3, axis=0)
    assert found**2 < 1.1 * left(others, np.tile(np.arange(3), 300)).min() ** 2


def shaped(longest: list[float], lengths: np.ndarray, radius: float = 12.0) -> Any:
    """A posterior of this covariance: its longest axis along `longest`."""
    first = np.array(longest) / np.linalg.norm(longest)
    others = np.linalg.svd(first[None])[2][1:]
    axes = np.vstack([first, others])
    return SimpleNamespace(covariance=axes.T @ np.diag(lengths**2) @ axes, draws=SimpleNamespace(
        radius=lambda level, count: radius if (level, count) == (0.95, 6) else np.nan))


@pytest.mark.parametrize(("longest", "words"), [
    ([0, 0, 1, 0.1, 0, 0], "k3"), ([0, 0, -1, 0.1, 0, 0], "k3"),
    ([0.8, 0.6, 0, 0, 0, 0], "k1 and k2 together, in the same sense"),
    ([-0.6, 0, 0, 0, -0.8, 0], "k5 and k1 together, in the same sense"),
    ([0.6, 0, 0, 0, -0.8, 0], "k5 against k1"),
    # Four tenths of a unit vector are a share of it, and less is none.
    ([1, 0, 0, 0, 0, 0.405 / np.sqrt(1 - 0.405**2)], "k1 and k6 together, in the same sense"),
    ([1, 0, 0, 0, 0, 0.395 / np.sqrt(1 - 0.395**2)], "k1"),
    ([1, 0.9, 0, -0.95, 0, 0], "k1 and k2 against k4"), ([1, 0.95, 0, -0.9, 0, 0], "k1 and k2 against k4"),
    ([-0.9, 0.95, 0, 1, 0, 0], "k4 and k2 against k1"), ([-0.5, 0.9, 0.3, -0.2, 0.25, 0.1], "k2 against k1")])
def test_the_ellipsoid_is_as_large_as_its_quantile_and_its_longest_axis_in_words(longest: list[float], words: str) -> None:
    """Axes, longest first, of the root of that times their variance; its volume is pi^3 / 6 of their product."""
    lengths = np.array([0.5, 0.2, 0.1, 0.05, 0.02, 0.01])
    found = ellipsoid(shaped(longest, lengths))
    assert_allclose(found.semi_axes, np.sqrt(12.0) * lengths)
    assert found.volume == pytest.approx(np.pi**3 / 6 * np.prod(np.sqrt(12.0) * lengths))
    assert found.sentence == (f"least certain: {words}, a factor {np.exp(np.sqrt(12.0) * 0.5):.3g} either way at the end of "
                              "the longest axis")
    along = np.array(longest) / np.linalg.norm(longest)
    assert_allclose(found.directions[0], along * np.sign(along[np.argmax(np.abs(along))]), atol=1e-9)
    assert_allclose(found.directions @ found.directions.T, np.eye(6), atol=1e-9)
    assert all(one[np.argmax(np.abs(one))] > 0 for one in found.directions)
    assert found.as_dict() == {"volume": found.volume, "semi_axes_log": found.semi_axes.tolist(),
                               "directions": found.directions.tolist(), "words": found.sentence}


def test_the_spectrum_is_what_the_data_tell_in_units_of_the_prior_s() -> None:
    """Of joints by themselves the information times the prior's variance, the largest first; of a mixture its product stays."""
    information, log_std = np.array([4.0, 100.0, 1.0, 9.0, 0.25, 16.0]), np.array([0.5, 0.2, 2.0, 1.0, 1.0, 0.3])
    posterior: Any = SimpleNamespace(information=np.diag(information), prior=SimpleNamespace(log_std=log_std))
    assert_allclose(information_spectrum(posterior), [9.0, 4.0, 4.0, 1.44, 1.0, 0.25])
    root = np.random.default_rng(1).standard_normal((6, 6))
    posterior.information = root @ root.T
    found = information_spectrum(posterior)
    assert np.all(np.diff(found) < 0)
    assert np.prod(found) == pytest.approx((np.linalg.det(root) * np.prod(log_std)) ** 2)
    assert np.sum(found) == pytest.approx(np.sum(np.diag(root @ root.T) * log_std**2))
