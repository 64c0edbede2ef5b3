"""A program that was corrected tells it by its own orientations, also where its record did not come along."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.correct import Corrected, correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.turned_already import said_of_own_turns
from identification.model.rotations import Frame
from tests.runs.command_line.test_placement import Path3
from tests.runs.command_line.user_files import Job

COUNT, CUT = 30, (5, 25)


def corrected(folder: Path, program: str) -> Corrected:
    """Thirty targets of one orientation, twenty of them in a cut whose force turns."""
    turn = np.linspace(0, 2.5, COUNT)
    rows = [(k, 300 * np.cos(turn[k]), 300 * np.sin(turn[k]), -80) if CUT[0] <= k < CUT[1] else (k, 0, 0, 0)
            for k in range(COUNT) for _ in range(2)]
    folder.mkdir(exist_ok=True)
    log = "target,fx_n,fy_n,fz_n\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)
    Job(folder, program=program, forces=log).write()
    names = ("cell.yaml", "part.mod", "stiffness.json", "forces.csv")
    return correct(predict_files(Inputs(*(folder / name for name in names))))


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Corrected:
    path = Path3(np.array([[4.0 * k, 0, 0] for k in range(COUNT)]))
    return corrected(tmp_path_factory.mktemp("first") / "job", path.program())


def told(done: Corrected) -> bool:
    return "CS4207" in {finding.code for finding in done.findings}


def test_a_corrected_program_is_told_and_the_planned_one_is_not(first: Corrected, tmp_path: Path) -> None:
    assert len(first.kept) == len(first.predicted.path.toolpath), "targets were added: the log's numbers name others then"
    assert not told(first)
    assert told(corrected(tmp_path / "fetched", first.content.decode()))


@pytest.mark.parametrize(("kind", "said"), [("as corrected", True), ("the other way", False), ("by chance", False),
                                            ("leaning along the path", False), ("none", False)])
def test_only_turns_as_by_a_correction_are_told(first: Corrected, kind: str, said: bool) -> None:
    """Targets that are turned in the work object, each in another way, by as much as a correction turns them."""
    path, targets = first.predicted.path, first.correction.targets
    rng = np.random.default_rng(4207)
    turn = first.correction.turn
    size = np.linalg.norm(turn, axis=1, keepdims=True)
    way = rng.normal(0, 1, turn.shape)
    turns = {"as corrected": 1.1 * turn + 0.1 * size * way, "the other way": -turn, "none": 0 * turn, "by chance": size * way,
             "leaning along the path": np.outer(np.linspace(0, 0.2, len(turn)), [1.0, 0, 0])}[kind]
    rotation = path.base_from_tcp.rotation.copy()
    in_object = np.swapaxes(path.base_from_object.rotation, -1, -2)[targets] @ rotation[targets]
    rotation[targets] = path.base_from_object.rotation[targets] @ Rotation.from_rotvec(turns).as_matrix() @ in_object
    own = SimpleNamespace(base_from_object=path.base_from_object, toolpath=path.toolpath,
                          base_from_tcp=Frame(rotation, path.base_from_tcp.position))
    seen = SimpleNamespace(path=own, targets=first.predicted.targets, program=first.predicted.program)
    assert bool(said_of_own_turns(seen, first.kept, first.correction)) == said


@pytest.mark.parametrize(("times", "others", "air", "said"), [
    (0.58, 0, 10, False), (0.62, 0, 10, True), (1.58, 0, 10, True), (1.62, 0, 10, False),
    (1.0, 4, 10, True), (1.0, 5, 10, False), (1.0, 0, 3, True), (1.0, 0, 2, False)])
def test_turns_are_told_by_their_size_beside_enough_of_one_orientation(
    first: Corrected, times: float, others: int, air: int, said: bool
) -> None:
    """0.6 to 1.6 times as this correction turns; three targets in the air at least, six of ten of them alike."""
    path, targets, turn = first.predicted.path, first.correction.targets, first.correction.turn
    free = np.setdiff1d(first.kept, first.predicted.targets)
    rotation = path.base_from_tcp.rotation.copy()
    work = path.base_from_object.rotation
    for which, turns in ((targets, times * turn), (free[:others], 0.02 * np.eye(3)[np.arange(others) % 3] * (
            1 + np.arange(others))[:, None])):
        in_object = np.swapaxes(work, -1, -2)[which] @ rotation[which]
        rotation[which] = work[which] @ Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix() @ in_object
    own = SimpleNamespace(base_from_object=path.base_from_object, toolpath=path.toolpath,
                          base_from_tcp=Frame(rotation, path.base_from_tcp.position))
    seen = SimpleNamespace(path=own, targets=first.predicted.targets, program=first.predicted.program)
    kept = np.sort(np.append(targets, free[:air]))
    found = said_of_own_turns(seen, kept, first.correction)
    size = np.degrees(np.sqrt(np.mean(np.sum((times * turn) ** 2, axis=1))))
    assert [(one.code, one.level) for one in found] == [("CS4207", "warning")] * said
    assert all(one.message.startswith(
        f"the orientations of {len(targets)} targets are turned off the program's own by {size:.4f} deg RMS, {times:.2f} times")
        for one in found)


def is_told(first: Corrected, own: np.ndarray, correction: np.ndarray, air: dict[int, float], fewer: int = 0) -> bool:
    """The program with its cut turned by `own` (M, 3) [rad], where this correction would turn it by `correction` (M, 3), and
    with targets in the air turned about x by so much; without `fewer` of those in the air."""
    path, targets = first.predicted.path, first.correction.targets
    turn = np.zeros((len(path.toolpath), 3))
    turn[targets] = own
    turn[list(air), 0] = list(air.values())
    in_object = np.swapaxes(path.base_from_object.rotation, -1, -2) @ path.base_from_tcp.rotation
    rotation = path.base_from_object.rotation @ Rotation.from_rotvec(turn).as_matrix() @ in_object
    seen = SimpleNamespace(targets=first.predicted.targets, program=first.predicted.program, path=SimpleNamespace(
        base_from_object=path.base_from_object, toolpath=path.toolpath,
        base_from_tcp=Frame(rotation, path.base_from_tcp.position)))
    kept = np.setdiff1d(first.kept, np.setdiff1d(first.kept, targets)[:fewer])
    return bool(said_of_own_turns(seen, kept, SimpleNamespace(targets=targets, turn=correction)))


@pytest.fixture(scope="module")
def turns(first: Corrected) -> tuple[np.ndarray, np.ndarray]:
    """Of a correction, with an RMS size of 0.1 mrad, and others of that RMS that have nothing of them."""
    turn = first.correction.turn * 1e-4 / np.sqrt(np.mean(np.sum(first.correction.turn**2, axis=1)))
    other = np.random.default_rng(4208).normal(size=turn.shape)
    other -= turn * np.sum(other * turn) / np.sum(turn**2)
    return turn, other * np.sqrt(np.sum(turn**2) / np.sum(other**2))


@pytest.mark.parametrize(("times", "said"), [(0.54, False), (0.66, True), (1.5, True), (1.7, False)])
def test_turns_of_0_6_to_1_6_of_a_correction_are_its(first: Corrected, turns, times: float, said: bool) -> None:
    assert is_told(first, times * turns[0], turns[0], {}) == said


@pytest.mark.parametrize(("other", "said"), [(0.27, True), (0.33, False)])
def test_seven_tenths_of_the_turns_are_a_corrections(first: Corrected, turns, other: float, said: bool) -> None:
    """By their squares; the rest is something else."""
    assert is_told(first, turns[0] + np.sqrt(other / (1 - other)) * turns[1], turns[0], {}) == said


@pytest.mark.parametrize(("size", "largest", "said"), [
    (1.8e-5, 0, False), (2.2e-5, 0, True), (0, 0.9, True), (0, 1.1, False)])
def test_turns_of_twenty_microradians_to_a_degree_are_judged(first: Corrected, turns, size: float, largest, said) -> None:
    scale = size / 1e-4 if size else np.radians(largest) / np.linalg.norm(turns[0], axis=1).max()
    assert is_told(first, scale * turns[0], scale * turns[0], {}) == said


@pytest.mark.parametrize(("air", "fewer", "said"), [
    (dict.fromkeys(range(4), 0.01), 0, True), (dict.fromkeys(range(5), 0.01), 0, False),        # six, and five, of ten
    (dict.fromkeys(range(5), 0.9e-6), 0, True), (dict.fromkeys(range(5), 1.1e-6), 0, False),
    ({}, 7, True), ({}, 8, False)])                                                             # three, and two, in all
def test_most_of_the_targets_in_the_air_show_the_programs_own_orientation(first: Corrected, turns, air, fewer, said) -> None:
    """Within a microradian."""
    assert is_told(first, turns[0], turns[0], air, fewer) == said
