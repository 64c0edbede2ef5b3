"""Axes mixed up, and what is told of it: the words are taken at their word, on readings of the independent arm."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.fit.mistakes.axes import axes_mistakes
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.kinematics import forward
from identification.model.rotations import Frame
from tests.runs.mistakes.planted import right


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    cell_file, table = right(21, "irb6700-200-2.60").write(tmp_path_factory.mktemp("axes"))
    cell = read_cell(cell_file)
    return LoadTest.of(cell, read_measurements(table, cell.robot))


def test_a_mix_up_is_told_by_what_mends_it(data: LoadTest) -> None:
    """The sentence is taken at its word: which columns change their sign, which change places, which column of the table is
    base x, y and z, by what angle both are turned. Met every week are signs, two columns exchanged, another order without a
    sign, and both turned about z."""
    rows, names = data.rows, {"force": ("fx", "fy", "fz"), "deflection": ("dx", "dy", "dz")}
    count, usual = 0, 0
    for mistake in axes_mistakes(data):
        quantity, _, kind = mistake.key.split("[")[0].rpartition("_")
        if kind not in ("sign", "swapped", "axes", "turned", "signs"):
            continue
        said, inside = mistake.sentence.removesuffix(" in {rows}"), mistake.key.partition("[")[2].removesuffix("]")
        matrix, of = np.eye(3), names.get(quantity, ("x", "y", "z"))
        about_z = re.search(r"seem to be given in axes turned by (-?\d+) degrees about z \(or joint 1 ", said)
        order = re.search(r"base x, y, z is (\S+), (\S+), (\S+) of the table$", said)
        if kind == "sign":
            turned = re.fullmatch(r"(\w\w)(?: and (\w\w))?(?: and (\w\w))? (seems?) to have the other sign", said)
            assert turned
            changed = [name for name in turned.groups()[:3] if name]
            assert turned[4] == ("seems" if len(changed) == 1 else "seem")
            matrix = np.diag([-1.0 if name in changed else 1.0 for name in of])
            assert inside == "".join(name[1] for name in changed)
        elif kind == "swapped":
            one, other = said.removesuffix(" seem to be swapped").split(" and ")
            matrix[[of.index(one), of.index(other)]] = matrix[[of.index(other), of.index(one)]]
            assert inside == one[1] + other[1]
        elif kind == "signs":
            assert said.startswith("all forces (or all deflections")
            matrix, quantity = -matrix, "force"
        elif about_z:
            angle = np.radians(float(about_z[1]))
            matrix[:2, :2] = np.round([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            assert inside == f"z {about_z[1]}"
        else:
            assert order
            matrix = np.array([[float(name == each.lstrip("-")) * (-1 if each[0] == "-" else 1) for name in of]
                               for each in order.groups()])
            assert inside == " ".join(order.groups())
            assert said.startswith("forces and deflections seem to be given in other axes than the robot's base: "
                                    if kind == "turned" else f"{', '.join(of)} seem to be mixed up")
        changed_too = ("force", "deflection") if kind == "turned" else (quantity,)
        mended = mistake.mended(data).rows
        for name, values in (("wrench", rows.wrench[:, :3]), ("deflection", rows.deflection)):
            there = getattr(mended, name)[:, :3]
            assert_allclose(there, values @ matrix.T if {"wrench": "force"}.get(name, name) in changed_too else values)
        plain = kind in ("sign", "swapped", "signs") or (kind == "axes" and "-" not in inside)
        assert mistake.usual is (plain or bool(about_z))
        count, usual = count + 1, usual + mistake.usual
    # Seven signs of either but all, of which forces alone; three exchanged, two more orders of either; three turns about z.
    assert (count, usual) == (47 + 46 + 23, 2 * (6 + 3 + 2) + 1 + 3)


@pytest.mark.parametrize("gap", [False, True])
def test_a_frame_of_the_cell_turns_what_was_given_in_it(data: LoadTest, gap: bool) -> None:
    """Of the tool, of the flange and of the sensor as they stand at each pose, of the world and the workobject for all; none
    that stands as another, and deflections where all were read."""
    def turn(axis: int, degrees: float) -> NDArray[np.float64]:
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        matrix = np.eye(3)
        i, j = [k for k in range(3) if k != axis]
        matrix[i, i], matrix[j, j], matrix[i, j], matrix[j, i] = c, c, -s, s
        return matrix

    cell = data.cell
    tool, sensor, base, part = turn(0, 30), turn(1, 40), turn(2, 50), turn(0, 70)
    cell = replace(cell, flange_from_tcp=replace(cell.flange_from_tcp, rotation=tool),
                   world_from_base=replace(cell.world_from_base, rotation=base),
                   world_from_object=replace(cell.world_from_object, rotation=part),
                   force_log=replace(cell.force_log, flange_from_sensor=replace(cell.flange_from_tcp, rotation=sensor)))
    deflection = data.rows.deflection.copy()
    deflection[3, 1] = np.nan if gap else deflection[3, 1]
    turned = replace(data, cell=cell).with_rows(replace(data.rows, deflection=deflection))
    flange = forward(cell.robot, data.rows.theta, Frame.identity()).rotation
    to_base = {"tool": flange @ tool, "flange": flange, "sensor": flange @ sensor, "world": base.T, "workobject": base.T @ part}
    found = {each.key: each for each in axes_mistakes(turned) if "_frame[" in each.key}
    kinds = ("forces",) if gap else ("forces", "deflections", "forces and deflections")
    assert list(found) == [f"{kind.replace('s and ', '_and_').removesuffix('s')}_frame[{name}]"
                           for kind in kinds for name in to_base]
    for key, each in found.items():
        kind, name = each.sentence.split(" seem to be given in the ")
        matrices = np.broadcast_to(to_base[key.partition("[")[2][:-1]], (len(deflection), 3, 3))
        mended = each.mended(turned).rows
        for column, values, words in (("wrench", data.rows.wrench[:, :3], "forces"), ("deflection", deflection, "deflections")):
            expected = np.einsum("nij,nj->ni", matrices, values) if words in kind.split(" and ") else values
            assert_allclose(getattr(mended, column)[:, :3], expected, atol=1e-12)
        assert name == f"{key.partition('[')[2][:-1]}'s frame, not in the robot's base, in {{rows}}"
    plain = [each.key for each in axes_mistakes(data) if "_frame[" in each.key]
    same = np.allclose(data.cell.flange_from_tcp.rotation, np.eye(3))
    assert same
    assert plain == ["force_frame[tool]", "deflection_frame[tool]", "force_and_deflection_frame[tool]"]


@pytest.mark.parametrize(("base", "part", "named"), [
    (0, 0, ["tool"]), (50, 0, ["tool", "world", "workobject"]), (50, 50, ["tool", "world"]), (0, 70, ["tool", "workobject"])])
def test_a_frame_that_stands_as_another_is_named_once(data: LoadTest, base: float, part: float, named: list[str]) -> None:
    """The flange's is the tool's here; a world that is the base, and a workobject along the base, change nothing."""
    def about_x(degrees: float) -> NDArray[np.float64]:
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])

    cell = replace(data.cell, world_from_base=replace(data.cell.world_from_base, rotation=about_x(base)),
                   world_from_object=replace(data.cell.world_from_object, rotation=about_x(part)))
    found = [each.key for each in axes_mistakes(replace(data, cell=cell)) if "_frame[" in each.key]
    assert found == [f"{kind}_frame[{name}]" for kind in ("force", "deflection", "force_and_deflection") for name in named]
