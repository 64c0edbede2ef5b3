"""What the correction promises, checked on the independent arm and against the posterior it states."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from compensator.correction import offsets
from compensator.correction.correct import Corrected, correct
from compensator.correction.correctable import targets_to_correct
from compensator.correction.correction import correct_path
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.offsets import offsets_csv
from compensator.correction.prediction import predict_path
from compensator.correction.read_back import read_back
from compensator.correction.settings import Settings
from compensator.rapid import read_rapid
from identification.common.findings import CompstiffError, Refused
from identification.model.compliance import loaded_pose
from identification.model.rotations import Frame, quaternion_to_matrix, rotation_vector
from tests.virtual_cell.arm import IRB6660


def residual_of(sample: Corrected, compliance: np.ndarray) -> np.ndarray:
    """Distance vectors (M, 3) [m] of the loaded tool from the plan when the robot really has this compliance."""
    plan, targets = sample.predicted.path, sample.correction.targets
    tool = sample.predicted.cell.flange_from_tcp
    loaded = loaded_pose(sample.predicted.cell.robot, sample.correction.theta, tool, sample.predicted.forces.wrench[targets],
                         compliance)
    return loaded.position - plan.base_from_tcp.position[targets]


def under(loaded: LoadedPath, factor: float) -> LoadedPath:
    """The same path under forces so many times as large."""
    return replace(loaded, forces=replace(loaded.forces, wrench=factor * loaded.forces.wrench))


def test_the_loaded_independent_arm_stands_on_the_plan(sample: Corrected) -> None:
    """From the written text alone: the independent arm, commanded to the corrected target, comes to rest on the plan."""
    before = sample.predicted.program.toolpath
    after = read_rapid(sample.content, "corrected.mod").toolpath
    fixture = quaternion_to_matrix([0.99965732, 0, 0, 0.02617695])
    corner, tcp = np.array([1.05, -0.07, 0.62]), np.array([0.12, 0, 0.25])
    stiffness = sample.predicted.model.stiffness
    targets = sample.correction.targets[::90]
    assert len(targets) > 25
    for target in targets:
        wanted = corner + fixture @ before.position[target]
        goal = fixture @ quaternion_to_matrix(before.quaternion[target])
        commanded = corner + fixture @ after.position[target]
        turned = fixture @ quaternion_to_matrix(after.quaternion[target])
        row = int(np.searchsorted(sample.correction.targets, target))
        q = sample.correction.theta[row]
        reached, flange = IRB6660.pose(q, tcp)
        assert_allclose(reached, commanded, atol=1e-7)              # the text names the pose of these joint angles
        assert_allclose(flange.as_matrix(), turned, atol=1e-7)
        rest = IRB6660.loaded(q, tcp, sample.predicted.forces.wrench[target], stiffness)
        loaded, flange = IRB6660.pose(rest, tcp)
        assert np.linalg.norm(loaded - wanted) < 2e-10
        assert np.linalg.norm(rotation_vector(flange.as_matrix() @ goal.T)) < 1e-9


def test_more_than_99_percent_of_the_predicted_deviation_is_gone(sample: Corrected) -> None:
    figures = sample.as_dict()
    assert figures["deviation_um"]["largest"] > 100
    assert figures["residual_um"]["largest"] < 0.01 * figures["deviation_um"]["largest"]
    assert figures["residual_um"]["rms"] < 0.01 * figures["deviation_um"]["rms"]


def test_the_residual_of_robots_drawn_from_the_posterior_is_what_the_covariance_says(sample: Corrected) -> None:
    predicted = sample.predicted
    # These robots have no weight.
    model, targets = replace(predicted.model, unknown_weight=0.0), sample.correction.targets
    rng = np.random.default_rng(1)
    squares = [np.mean(residual_of(sample, np.exp(rng.multivariate_normal(model.mean, model.covariance))) ** 2, axis=0)
               for _ in range(60)]
    covariance = model.deviation_covariance(predicted.path.theta[targets], predicted.forces.wrench[targets],
                                            predicted.cell.flange_from_tcp)
    stated = np.mean(np.diagonal(covariance, axis1=1, axis2=2)[:, :3], axis=0)
    assert_allclose(np.mean(squares, axis=0), stated, rtol=0.5)


def test_no_target_is_made_worse_by_such_a_robot(sample: Corrected) -> None:
    """Over robots drawn from the posterior: no target ends up farther off than before by more than 2 of its sigmas."""
    predicted = sample.predicted
    model = predicted.model
    tool, targets = predicted.cell.flange_from_tcp, sample.correction.targets
    sigma = np.linalg.norm(predicted.prediction.std, axis=1)
    rng = np.random.default_rng(2)
    for _ in range(10):
        compliance = np.exp(rng.multivariate_normal(model.mean, model.covariance))
        loaded = loaded_pose(predicted.cell.robot, predicted.path.theta[targets], tool, predicted.forces.wrench[targets],
                             compliance)
        before = np.linalg.norm(loaded.position - predicted.path.base_from_tcp.position[targets], axis=1)
        after = np.linalg.norm(residual_of(sample, compliance), axis=1)
        assert np.all(after <= before + 2 * sigma)


def test_stiffnesses_wrong_by_30_percent_leave_30_percent(sample: Corrected) -> None:
    before = np.linalg.norm(sample.predicted.prediction.position, axis=1)
    left = np.linalg.norm(residual_of(sample, 1.3 * sample.predicted.model.compliance), axis=1)
    full = sample.correction.share == 1
    assert_allclose(left[full], 0.3 * before[full], rtol=0.02)


def test_no_force_no_correction(sample: Corrected) -> None:
    forces = replace(sample.predicted.forces, forced=np.zeros_like(sample.predicted.forces.forced))
    targets, findings = targets_to_correct(sample.predicted.path, forces)
    unforced = replace(sample.predicted.loaded, forces=forces, targets=targets)
    assert not findings
    with pytest.raises(Refused, match="CS3086: nothing is corrected: by this log no move has force"):
        correct(replace(sample.predicted, loaded=unforced, prediction=predict_path(unforced)))


def test_opposite_forces_give_opposite_first_order_corrections(sample: Corrected) -> None:
    loaded = sample.predicted.loaded
    mirrored = correct_path(under(loaded, -1.0))
    full = correct_path(loaded)
    size = np.linalg.norm(full.offset, axis=1)
    assert np.all(np.linalg.norm(mirrored.offset + full.offset, axis=1) < 5e-3 * size)


def test_another_base_frame_changes_nothing_in_the_base(sample: Corrected, sample_inputs, tmp_path) -> None:
    """World and work object moved together with the base: the corrections are the same."""
    from compensator.correction.files import Inputs, predict_files

    cell = tmp_path / "cell.yaml"
    cell.write_text(sample_inputs.cell.read_text() + "base_frame: {position_mm: [500, -300, 200], quaternion: "
                    "[0.70710678118654752, 0, 0, 0.70710678118654752]}\n")
    world_from_base = Frame.from_quaternion([0.5, -0.3, 0.2], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    moved = world_from_base @ Frame.from_quaternion([1.05, -0.07, 0.62], [0.99965732, 0, 0, 0.02617695])
    old = b"[[1050.0000,-70.0000,620.0000],[0.99965732,0.00000000,0.00000000,0.02617695]]"
    numbers = ",".join(f"{1e3 * x:.12f}" for x in moved.position), ",".join(f"{x:.16f}" for x in moved.quaternion)
    new = f"[[{numbers[0]}],[{numbers[1]}]]".encode()
    text = sample_inputs.toolpath.read_bytes()
    assert old in text
    program = tmp_path / "insert.mod"
    program.write_bytes(text.replace(old, new))
    again = correct(predict_files(
        Inputs(cell, program, sample_inputs.stiffness, sample_inputs.forces), Settings.of(tare=((0, 2),))))
    # A sample on the border between two targets may fall to the other one by the last digit: a few nanometres there.
    assert_allclose(again.correction.offset, sample.correction.offset, atol=2e-8)


def test_limits_refuse(sample: Corrected) -> None:
    predicted, targets = sample.predicted, sample.correction.targets
    tight = replace(predicted.path, cell=replace(predicted.cell, max_offset=1e-4))
    with pytest.raises(Refused, match=r"CS4107.*exceed the limit: the largest offset is 0\.3.* mm, the limit 0\.1 mm"):
        correct_path(replace(predicted.loaded, path=tight))
    tilt = replace(predicted.path, cell=replace(predicted.cell, max_tilt=np.radians(0.01)))
    with pytest.raises(Refused, match=r"CS4107.*largest rotation is 0\.02.* deg, the limit 0\.01 deg"):
        correct_path(replace(predicted.loaded, path=tilt))
    limits = predicted.cell.robot.limits.copy()
    limits[4, 1] = predicted.path.theta[targets, 4].max() - 1e-4
    narrow = replace(predicted.path, cell=replace(predicted.cell, robot=replace(predicted.cell.robot, limits=limits)))
    with pytest.raises(Refused, match=r"CS4105.*as planned: joint 5 at"):
        targets_to_correct(narrow, predicted.forces)


def test_absurd_forces_are_an_error_not_a_program(sample: Corrected) -> None:
    with pytest.raises(CompstiffError):
        correct_path(under(sample.predicted.loaded, 1e5))


def test_a_program_that_does_not_read_back_is_not_written(sample: Corrected, monkeypatch: pytest.MonkeyPatch) -> None:
    """A writer that spoils a corrected number, a number it should leave alone, or a move: refused each time (CS4203)."""
    from compensator.correction import correct as pipeline
    from compensator.rapid import Rewritten

    air = next(line for line in sample.content.split(b"\r\n") if b"vAir" in line and line.lstrip().startswith(b"MoveL"))
    cut = next(line for line in sample.content.split(b"\r\n") if b"v45cut" in line and line.lstrip().startswith(b"MoveL"))
    corrected = sample.content.split(b"\r\n")[int(sample.predicted.path.toolpath.line[sample.correction.targets[50]]) - 1]
    for old, new in (
        (corrected, corrected.replace(b"MoveL [[", b"MoveL [[9")),
        (air, air.replace(b"MoveL [[", b"MoveL [[9")),
        (cut, cut.replace(b"v45cut", b"v36cut")),
        (air + b"\r\n", b""),
    ):
        assert old != new
        spoiled = sample.content.replace(old, new, 1)

        monkeypatch.setattr(pipeline, "rewrite", lambda *_, content=spoiled, **__: Rewritten(content, (), 0, 0))
        with pytest.raises(CompstiffError, match="CS4203.*does not read back"):
            correct(sample.predicted)


def test_what_is_left_where_a_correction_is_held_back_is_what_the_written_program_leaves(sample: Corrected) -> None:
    """To the rounding of the written numbers, which are read and loaded again."""
    settings = sample.planned.settings
    steep = replace(sample.planned, settings=replace(settings, correction=replace(settings.correction, slope=2e-5)))
    corrected = correct(steep)
    held = corrected.correction.share < 0.9
    assert held.sum() > 20
    assert corrected.correction.residual[held].min() > 1e-7
    assert_allclose(corrected.correction.residual, corrected.residual, rtol=0, atol=2e-7)


def test_offsets_do_not_depend_on_how_many_are_written_at_once(sample: Corrected, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [offsets_csv(sample).decode().splitlines()]
    for many in (500, len(sample.kept)):
        monkeypatch.setattr(offsets, "CHUNK", many)
        rows.append(offsets_csv(sample).decode().splitlines())
    assert rows[0] == rows[1] == rows[2]
    assert [row.split(",")[0] for row in rows[1]] == ["target", *map(str, range(len(sample.kept)))]


def test_reading_back_catches_every_wrong_digit(sample: Corrected) -> None:
    """Each digit of the moves to two corrected targets put up by one, a sign turned, a zone's and a tool's name: CS4203."""
    lines = sample.content.split(b"\r\n")
    path, targets = sample.predicted.path, sample.correction.targets
    again = read_rapid(sample.content, "program.mod").toolpath
    loaded = replace(sample.predicted.loaded, targets=targets)
    read_back(loaded, sample.correction, sample.content, np.arange(0))
    spoiled = 0
    for target in targets[[40, 2000]]:
        number = int(again.line[target]) - 1
        line = lines[number]
        behind = line.index(b"]]")
        wrong = [line[:k] + bytes([48 + (line[k] - 47) % 10]) + line[k + 1:] for k in range(behind) if line[k] in b"0123456789"
                 and not (line[k - 1:k].isalpha() or line[k:k + 2] == b"9E" or line[k - 1:k] == b"E")]
        wrong += [line.replace(b"[[-", b"[[", 1) if b"[[-" in line else line.replace(b"[[", b"[[-", 1),
                  line.replace(b"]],v", b"]],v1", 1), line.replace(b",z", b",z1", 1)]
        for text in wrong:
            assert text != line
            spoiled += 1
            with pytest.raises(CompstiffError, match=r"CS4203|CS2005"):
                read_back(loaded, sample.correction, b"\r\n".join([*lines[:number], text, *lines[number + 1:]]), np.arange(0))
    assert spoiled > 100
    assert len(path.toolpath) == len(again)


def test_a_correction_that_the_forward_model_does_not_confirm_is_refused(sample: Corrected, monkeypatch) -> None:
    from compensator.correction import correction
    from identification.model.compliance import joint_torque

    monkeypatch.setattr(correction, "joint_torque", lambda *arguments: 1.01 * joint_torque(*arguments))
    with pytest.raises(CompstiffError, match="CS4108.*did not converge"):
        correct_path(sample.predicted.loaded)


def test_the_scatter_of_the_force_is_a_cause_of_its_own(sample: Corrected) -> None:
    """Each component's standard error by what one newton of it moves, in squares; the model's part is the rest of the sigma."""
    predicted, left = sample.predicted, sample.left
    model, targets = predicted.model, predicted.targets
    error = predicted.forces.standard_error[targets]
    some = np.flatnonzero(np.linalg.norm(error, axis=1) > 0)[::400]
    assert len(some) > 4
    theta, wrench = predicted.path.theta[targets[some]], predicted.forces.wrench[targets[some]]
    expected = np.zeros(len(some))
    for axis in range(3):
        more = wrench.copy()
        more[:, axis] += 1.0
        moved = [model.predict(theta[k:k + 1], load[k:k + 1])[0][0] for load in (wrench, more) for k in range(len(some))]
        step = np.array(moved[len(some):]) - np.array(moved[:len(some)])
        expected += (error[some, axis] * np.linalg.norm(step, axis=1)) ** 2
    assert_allclose(left.scatter[some], np.sqrt(expected), rtol=0.01)
    whole = np.trace(predicted.prediction.covariance, axis1=1, axis2=2)[some]
    assert_allclose(left.model[some] ** 2 + left.scatter[some] ** 2, whole + sample.residual[some] ** 2, rtol=0.01)
