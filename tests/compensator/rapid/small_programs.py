"""Small RAPID texts for the tests of compensator/rapid."""

from __future__ import annotations

import numpy as np

from compensator.rapid import RapidProgram, Rewritten, read_rapid, rewrite
from compensator.toolpath import Toolpath
from identification.common.findings import Finding

UNUSED = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def target(x: float | str = 0, y: float | str = 0, z: float | str = 0, q: str = "[1,0,0,0]", conf: str = "[0,0,0,0]") -> str:
    return f"[[{x},{y},{z}],{q},{conf},{UNUSED}]"


def program(body: str, declarations: str = "") -> str:
    return f"MODULE Test\n{declarations}\nPROC main()\n{body}\nENDPROC\nENDMODULE\n"


def load(body: str, declarations: str = "") -> RapidProgram:
    return read_rapid(program(body, declarations).encode(), "test.mod")


def path(body: str, declarations: str = "") -> Toolpath:
    return load(body, declarations).toolpath


def millimetres(toolpath: Toolpath) -> list[list[float]]:
    return np.round(toolpath.position * 1e3, 9).tolist()


def found(toolpath: Toolpath, code: str) -> list[Finding]:
    return [finding for finding in toolpath.findings if finding.code == code]


def shift(text: str | bytes, targets: list[int], by: list[list[float]], **changes: object) -> Rewritten:
    """The program with the targets moved by so many millimetres each."""
    data = text.encode() if isinstance(text, str) else text
    read = read_rapid(data, "test.mod")
    position = read.toolpath.position[targets] + np.array(by) / 1e3
    quaternion = changes.get("quaternion", read.toolpath.quaternion[targets])
    return rewrite(read, targets, position, quaternion, changes.get("confdata"))


def same(a: Toolpath, b: Toolpath) -> None:
    """Everything but the place in the text is equal."""
    for name in ("move", "position", "quaternion", "confdata", "has_confdata", "external", "joints", "tool", "workobject",
                 "feed", "zone"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    assert [text.lower() for text in a.block] == [text.lower() for text in b.block]
    assert [tool.name.lower() for tool in a.tools] == [tool.name.lower() for tool in b.tools]
    for one, other in zip((*a.tools, *a.workobjects), (*b.tools, *b.workobjects), strict=True):
        assert one.problem == other.problem
        assert (one.position is None) == (other.position is None)
        if one.position is not None:
            np.testing.assert_array_equal(one.position, other.position)
            np.testing.assert_array_equal(one.quaternion, other.quaternion)
