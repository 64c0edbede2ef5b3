"""Plans with dead weights: what hangs when, which way it pulls, what that cannot show, and a certificate that holds."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from compstiff.cli.design import design
from identification.design.criteria import d_criterion
from identification.design.dead_weights import DeadWeights
from identification.design.domain import Domain, random_pool
from identification.design.information import instrument
from identification.design.loads import slot, weight_slot
from identification.design.request import Request, prepare
from identification.design.search import Effort, optimal_design
from identification.design.task import Task, free_demand
from identification.design.unseen import Sideways, seen_by, sideways, unseen_finding
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import compliance_matrix, regressor
from identification.model.gravity import fall_in_base
from identification.model.inverse import inverse
from identification.model.rotations import Frame
from tests.identification.design.conftest import CELL
from tests.support import write_cell

TURNED = "base_frame: {{quaternion: [{:.9f}, {:.9f}, {:.9f}, {:.9f}]}}\n"
RUNS = 2


def hung(cell, text="20,40"):
    slot = weight_slot(DeadWeights.of(text), "cycle", fall_in_base(cell.world_from_base))
    return Domain(instrument(cell), (slot,), np.array([[1.36, 0.0, 0.81]]))


@pytest.mark.parametrize(("text", "hangs", "lifted"), [
    ("20,40", [0, 20, 40, 0], 20 + 60 + 40), ("20,20+20", [0, 20, 40, 20, 0], 80), ("40,20", [0, 20, 40, 0], 120),
    ("20,40,20+40", [0, 20, 40, 60, 40, 0], 20 + 60 + 20 + 20 + 40), ("15", [0, 15, 0], 30),
    ("20,30,20+40", [0, 20, 30, 60, 20, 0], 20 + 50 + 90 + 40 + 20)])
def test_what_hangs_when(text, hangs, lifted):
    weights = DeadWeights.of(text)
    assert [sum(step) for step in weights.steps] == hangs
    assert weights.lifted(weights.steps) == lifted
    top = hangs.index(max(hangs))
    for before, after in zip(weights.steps[top:], weights.steps[top + 1:], strict=False):
        assert weights.handled(before, after)[1] == ()           # on the way down nothing is hung on


@pytest.mark.parametrize("text", ["", "0", "-5", "20,20", "20+20,40", "twenty", "5000.1", "20,", "nan", "20+0"])
def test_no_weights(text):
    assert DeadWeights.of("5000").levels == ((5000.0,),)
    with pytest.raises(ValueError, match=r"weights are|same mass|could not convert"):
        DeadWeights.of(text)


@pytest.mark.parametrize(("axis", "degrees", "left_out"), [
    ((0, 0, 1), 0.0, (1,)), ((0, 0, 1), 70.0, (1,)),        # upright, turned about the vertical or not
    ((1, 0, 0), 15.0, ()), ((1, 0, 0), 90.0, ()),           # tilted, on a wall
    ((0, 1, 0), 15.0, (1,)), ((1, 1, 0), 15.0, ())])        # tilted, but the tool plumb above or below axis 1; half so
def test_joint_1_is_seen_where_gravity_passes_its_axis(axis, degrees, left_out, prior, tmp_path):
    half = np.radians(degrees) / 2
    turned = np.sin(half) * np.array(axis) / np.linalg.norm(axis)
    tilted = read_cell(write_cell(tmp_path, CELL + TURNED.format(np.cos(half), *turned)))
    seen = seen_by(hung(tilted), prior, 8, np.random.default_rng(1))
    assert (() if seen is None else d_criterion().of_seen(seen).left_out) == left_out
    if left_out:
        np.testing.assert_allclose(seen @ seen.T, np.diag([0.0, 1, 1, 1, 1, 1]), atol=1e-9)


def test_the_criterion_is_that_of_the_other_joints(cell, prior):
    """A prior without correlations: what is left out is a row and a column."""
    domain = hung(cell)
    criterion = d_criterion().of_seen(seen_by(domain, prior, 8, np.random.default_rng(1)))
    runs = random_pool(domain, 5, np.random.default_rng(2))
    information = prior + runs.information.sum(axis=0)
    assert float(criterion.value(information)) == pytest.approx(np.linalg.det(information[1:, 1:]) ** 0.2, rel=1e-9)


@pytest.fixture(scope="module")
def plan(cell, prior):
    domain = hung(cell)
    criterion = d_criterion().of_seen(seen_by(domain, prior, RUNS, np.random.default_rng(1)))
    return optimal_design(Task(domain, criterion, prior, free_demand(1, RUNS)), np.random.default_rng(0),
                          Effort(poses=800, exchanges=20, refinements=3, moves=1, climbs=12))


def dense_value(cell, prior, theta):
    """The criterion from the whole covariance of all rows of each run, without any of the design's formulas."""
    noise, compliance = cell.noise, 1 / cell.prior.stiffness
    mass = np.array([0.0, 20.0, 40.0, 0.0])
    information = prior.copy()
    for q in theta:
        wrench = np.zeros((4, 6))
        wrench[:, 2] = -9.80665 * mass
        rows = np.repeat(q[None], 4, axis=0)
        slope = (regressor(cell.robot, rows, cell.flange_from_tcp, wrench)[:, :3] * compliance).reshape(12, 6)
        carried = compliance_matrix(cell.robot, q[None], cell.flange_from_tcp, compliance)[0, :3, :3]
        covariance = np.kron(np.ones((4, 4)), np.diag(noise.pose_offset**2))
        for k in range(4):
            # Where nothing hangs there is no force to be wrong.
            force = np.diag((mass[k] > 0) * noise.force**2 + (noise.force_relative * wrench[k, :3]) ** 2)
            block = slice(3 * k, 3 * k + 3)
            covariance[block, block] += np.diag(noise.deflection**2) + carried @ force @ carried.T
        information += slope.T @ np.linalg.solve(covariance, slope)
    return np.linalg.det(information[1:, 1:]) ** 0.2


def test_the_plan_s_value_is_the_dense_one(plan, cell, prior):
    assert plan.certificate.value == pytest.approx(dense_value(cell, prior, plan.runs.theta), rel=1e-6)


# Long: plans that the certificate has not seen stay under its bound in test_laws_certificate.py; only the domain is another
# here.
@pytest.mark.long
def test_no_independent_search_beats_the_certificate(plan, cell, prior):
    """Nelder and Mead over the tool's orientations and the arm's branches, from poses of their own."""
    domain, rng = hung(cell), np.random.default_rng(31)
    position = domain.positions[0]

    def pose(vector, branch):
        target = Frame(Rotation.from_rotvec(vector).as_matrix()[None], position[None])
        solved = inverse(cell.robot, target @ cell.flange_from_tcp.inverse())
        if not solved.reachable.reshape(-1)[branch]:
            return None
        theta = solved.theta.reshape(-1, 6)[branch]
        run = domain.runs(theta[None], np.zeros(1, dtype=int), np.zeros(1, dtype=int), np.eye(3)[:1])
        return theta if domain.excess(run)[0] <= 1e-6 else None

    def cost(x, branches):
        poses = [pose(x[3 * i:3 * i + 3], branch) for i, branch in enumerate(branches)]
        return 0.0 if any(one is None for one in poses) else -dense_value(cell, prior, poses)

    best = []
    while len(best) < 3:
        x, branches = np.concatenate([Rotation.random(rng=rng).as_rotvec() for _ in range(RUNS)]), rng.integers(0, 8, RUNS)
        if cost(x, branches) < 0:
            best.append(-minimize(cost, x, args=(branches,), method="Nelder-Mead", options={"maxfev": 160}).fun)
    assert max(best) <= plan.certificate.bound * (1 + 1e-6)
    assert plan.certificate.value >= 0.999 * max(best)
    assert 0.6 < plan.certificate.efficiency <= 1


def test_one_load_over_a_pulley_shows_it_as_it_says(plan, cell, prior):
    domain = plan.task.domain
    found = sideways(domain, plan.runs, plan.information, 1)
    assert abs(found.force[2]) < 1e-9
    assert np.linalg.norm(found.force) == pytest.approx(40 * 9.80665)
    assert found.before == pytest.approx(cell.prior.log_std[0], rel=1e-3)
    assert found.after < 0.1 * found.before
    # Against the whole covariance of a zero and a loaded row.
    q, noise, compliance = plan.runs.theta[found.run], cell.noise, 1 / cell.prior.stiffness
    wrench = np.append(found.force, np.zeros(3))[None]
    slope = regressor(cell.robot, q[None], cell.flange_from_tcp, wrench)[0, :3] * compliance
    carried = compliance_matrix(cell.robot, q[None], cell.flange_from_tcp, compliance)[0, :3, :3]
    force = np.diag(noise.force**2 + (noise.force_relative * found.force) ** 2)
    zero = np.diag(noise.deflection**2)
    offset = np.diag(noise.pose_offset**2)
    loaded = offset + np.diag(noise.deflection**2) + carried @ force @ carried.T
    loaded -= offset @ np.linalg.solve(offset + zero, offset)       # the zero row tells some of the offset
    after = plan.information + slope.T @ np.linalg.solve(loaded, slope)
    assert found.after == pytest.approx(np.sqrt(np.linalg.inv(after)[0, 0]), rel=1e-6)


def test_a_load_over_a_pulley_is_as_large_as_the_largest_and_the_best_of_sixteen(cell, prior) -> None:
    """Of all directions evenly around, at each of the poses, by the rows of a zero and a load there."""
    domain = Domain(instrument(cell), (slot("x", "single", 100.0), slot("y", "single", 250.0)), np.array([[1.36, 0.0, 0.81]]))
    runs = random_pool(domain, 3, np.random.default_rng(6))
    found = sideways(domain, runs, prior, 4)
    assert np.linalg.norm(found.force) == pytest.approx(250.0)
    assert found.before == pytest.approx(cell.prior.log_std[3])
    after = []
    for turn in 2 * np.pi * np.arange(16) / 16:
        along = slot("free", "single", 250.0)
        line = np.tile([np.cos(turn), np.sin(turn), 0.0], (len(runs), 1))
        told = Domain(domain.rig, (along,), domain.positions).runs(runs.theta, 0 * runs.slot, runs.place, line).information
        after.append(np.sqrt(np.linalg.inv(prior + told)[:, 3, 3]))
    assert found.after == pytest.approx(np.min(after), rel=1e-6)
    assert np.min(after, axis=0)[found.run] == pytest.approx(np.min(after), rel=1e-5)


@pytest.mark.parametrize(("left", "shows"), [(0.899, True), (0.9, False)])
def test_a_load_that_leaves_nine_tenths_of_the_spread_is_no_advice(cell, left: float, shows: bool) -> None:
    load = Sideways(4, 0, np.array([0.0, 30.0, 40.0]), 2.0, 2.0 * left)
    finding = unseen_finding(hung(cell), (load,), ("pose 3",))
    assert (finding.code, finding.level) == ("CS1507", "warning")
    advice = "one load of 50 N turned sideways by a rope over a pulley, towards base (0.00 0.60 0.80) at the joints of pose 3"
    assert (advice in finding.hint) == shows
    assert ("no force at this tool point shows k4 at these poses: load the tool beside the axis" in finding.hint) != shows


@pytest.mark.parametrize(("before", "level"), [(0.2, "note"), (0.201, "warning")])
@pytest.mark.parametrize("pushed", [False, True])
def test_a_joint_that_the_loads_cannot_show_is_warned_of_where_it_is_not_known(cell, domain, before, level, pushed) -> None:
    """From a fifth on (sigma of ln k), beside one that is known better."""
    loads = (Sideways(1, 0, np.array([50.0, 0, 0]), 0.01, 0.02), Sideways(6, 0, np.array([50.0, 0, 0]), before, 0.02))
    finding = unseen_finding(domain if pushed else hung(cell), loads, ("pose 1", "pose 2"))
    assert finding.level == level
    assert finding.message == "these loads cannot show k1 and k6: " + (
        "the loads turn it at no admissible pose" if pushed else
        "the weights' line makes no moment about the axis at any admissible pose") + (
        ". Only what is known beforehand carries it, and the plan is judged by what the loads do show")
    assert ("turning axis 1 or the whole robot about the vertical shows nothing" in finding.hint) != pushed
    alone = unseen_finding(hung(cell), loads[1:], ("pose 2",))
    assert "about the vertical" not in alone.hint


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("weights")
    cell_file = write_cell(folder, CELL)
    arguments = [cell_file, "-o", folder / "plan.csv", "--dead-weight", "20,40,20+40", "--measurements", 3, "--validate", 1,
                 "--quick", "--rapid", folder / "plan.mod", "--report", folder / "plan.html", "--json"]
    done = CliRunner().invoke(design, [str(argument) for argument in arguments])
    assert done.exit_code == 0, done.output
    return folder, json.loads(done.stdout)


def test_the_files_of_the_command(written):
    folder, document = written
    cell = read_cell(folder / "cell.yaml")
    rows = read_measurements(folder / "plan.csv", cell, planned=True)
    expected = np.tile([0, 20, 40, 60, 40, 0], 4)
    np.testing.assert_allclose(rows.wrench[:, :3], np.outer(expected, [0, 0, -9.80665]), atol=1e-9)
    assert rows.visit.max() == 3
    assert rows.weights == ("--dead-weight", "20,40,60")
    result = document["result"]
    assert [one["joint"] for one in result["unseen"]] == [1]
    assert result["unseen"][0]["log_std_after"] < 0.1
    warned = [finding for finding in document["findings"] if finding["code"] == "CS1507"]
    assert len(warned) == 1
    assert "k1" in warned[0]["message"]
    assert "pulley" in warned[0]["hint"]
    grades = [joint["grade"] for joint in result["forecast"]["joints"]]
    assert grades[0] == "not identifiable"
    assert set(grades[1:]) == {"reliable"}
    prompts = re.findall(r'TPReadFK nAnswer,"([^"]*)"', (folder / "plan.mod").read_text())
    assert max(map(len, prompts)) <= 80
    assert sum("take off 20 kg, then hang on 40 kg" in prompt for prompt in prompts) == 4
    assert "60\u00a0kg" in (folder / "plan.html").read_text()


@pytest.mark.parametrize("asked", [None, "20,40"])
def test_further_runs_without_the_weights_are_told(written, asked):
    cell = read_cell(written[0] / "cell.yaml")
    rows = read_measurements(written[0] / "plan.csv", cell, planned=True)
    carried = compliance_matrix(cell.robot, rows.theta, cell.flange_from_tcp, 1 / cell.prior.stiffness)[:, :3]
    filled = replace(rows, deflection=np.einsum("nij,nj->ni", carried, rows.wrench))
    findings = prepare(cell, Request(measurements=1, measured=filled, dead_weight=asked), None).findings
    told = [(finding.level, finding.message, finding.hint) for finding in findings if finding.code == "CS1513"]
    assert told == [("warning", f"the loads of {rows.source} are weights that hung, those of these runs are pushed, by up to "
                     "300 N and sideways too", "--dead-weight 20,40,60 plans for the same weights")] * (asked is None)
    pushed = replace(filled, hung=None)
    findings = prepare(cell, Request(measurements=1, measured=pushed, dead_weight=asked), None).findings
    assert "CS1513" not in {finding.code for finding in findings}


def test_calls_that_contradict_themselves(written, tmp_path):
    cell_file = written[0] / "cell.yaml"
    for wrong in (["20,x"], ["20", "--axes", "z"], ["20", "--max-force", "100"], ["20", "--direction", "free"],
                  ["20", "--preset", "paper"]):
        done = CliRunner().invoke(design, [str(cell_file), "-o", str(tmp_path / "p.csv"), "--dead-weight", *wrong])
        assert done.exit_code == 2, (wrong, done.output)
