"""A toolpath as those who correct it take it: some of its targets as a path of their own, numbers as people know them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compensator.rapid.reader import read_rapid
from compensator.toolpath import Move, OtherFiles, Toolpath, Way

TEXT = "[[{},0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
MOVES = ("MoveJ {0},v100,z1,tool0;", "MoveL {1},v50,fine,tool0;", "MoveC {2},{3},v50,z1,tool0;",
         "MoveAbsJ [[0,0,0,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;", "MoveL {4},v20,z1,tool0;")


@pytest.fixture
def path() -> Toolpath:
    moves = "\n".join(MOVES).format(*(TEXT.format(10 * k) for k in range(5)))
    return read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode()).toolpath


def test_joints_lead_on_moves_by_joints_alone(path: Toolpath) -> None:
    assert path.move.tolist() == [Move.JOINT, Move.LINEAR, Move.ARC_VIA, Move.ARC_END, Move.ABSOLUTE, Move.LINEAR]
    assert path.by_joints.tolist() == [True, False, False, False, True, False]
    assert len(set(Move)) == 5


def test_people_are_told_the_numbers_of_the_program_as_it_was_given(path: Toolpath) -> None:
    assert path.number.tolist() == [0, 1, 2, 3, 4, 5]
    given = np.array([0, 1, 1, 2, 2, 3])
    assert replace(path, given=given).number is given


@pytest.mark.parametrize("order", [[5, 1, 1], [], [0, 1, 2, 3, 4, 5]])
def test_some_of_its_targets_are_a_path_of_their_own(path: Toolpath, order: list[int]) -> None:
    """Row by row; what is of the whole program alone stays behind."""
    whole = replace(path, given=np.arange(6), driven=np.array(order), switched=((1, "s", True),), uncounted=((-1, 0), (4, 5)),
                    ways=(Way(np.arange(6), (), True),), together=np.arange(6) == 5, others=OtherFiles(called=("more",)))
    taken = whole.taken(np.array(order, dtype=np.intp))
    assert len(taken) == len(order)
    for name in ("move", "line", "column", "position", "quaternion", "confdata", "has_confdata", "external", "joints", "tool",
                 "workobject", "feed", "zone", "block", "together"):
        np.testing.assert_array_equal(getattr(taken, name), getattr(whole, name)[order], err_msg=name)
    assert (taken.given, taken.driven, taken.ways, taken.switched, taken.findings) == (None, None, (), (), ())
    assert (taken.tools, taken.workobjects, taken.others) == (whole.tools, whole.workobjects, whole.others)
    assert taken.uncounted == {3: (), 0: (), 6: ((-1, 0), (4, 5))}[len(order)]


def test_a_path_that_names_no_configurations_is_not_stopped_by_one(path: Toolpath) -> None:
    """As of tables and of APT: only RAPID has a controller watch it, unless it says ConfL\\Off."""
    assert path.monitored
    assert OtherFiles() == OtherFiles(started=True, called=(), targets=())
    names = [name for name in vars(path) if name != "monitored"]
    assert not Toolpath(**{name: getattr(path, name) for name in names}).monitored
