"""What is parsed once is still the file that is there now, and complaints name the file that was asked for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from identification.common.findings import CompstiffError
from identification.common.yaml_source import (
    EachJoint,
    NotNegative,
    Number,
    Positive,
    Quaternion,
    Stiffness,
    Strict,
    Triple,
    read_mapping,
    read_yaml,
)


class Sized(Strict):
    size: Positive


def test_a_file_that_changes_is_read_anew(tmp_path: Path) -> None:
    file = tmp_path / "one.yaml"
    for size in (1.0, 2.0, 1.0):
        file.write_text(f"size: {size}\n")
        assert read_yaml(file, Sized).size == size


def test_of_two_files_alike_each_has_its_complaint(tmp_path: Path) -> None:
    for name in ("one.yaml", "other.yaml", "one.yaml"):
        (tmp_path / name).write_text("size: -1\n")
        with pytest.raises(CompstiffError) as stopped:
            read_yaml(tmp_path / name, Sized)
        assert stopped.value.findings[0].file == str(tmp_path / name)


class Named(Strict):
    name: str
    share: NotNegative = 0.0


@pytest.mark.parametrize(("text", "says"), [
    ("name: a\nshare: -0.1\n", "'share': must not be negative; found -0.1"),
    ("name: a\nshare: 1e-300\n", "'share': must be zero, or at least"),
    ("share: 0\nname: 6660\n", "'name': must be text (a number in quotes); found 6660"),
])
def test_a_value_of_the_wrong_kind_has_its_line_and_what_is_wanted(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "one.yaml").write_text(text)
    with pytest.raises(CompstiffError) as stopped:
        read_yaml(tmp_path / "one.yaml", Named)
    (finding,) = stopped.value.findings
    assert (finding.code, finding.line) == ("CS0102", 2)
    assert says in finding.message
    (tmp_path / "one.yaml").write_text("name: '6660'\nshare: 0\n")
    assert read_yaml(tmp_path / "one.yaml", Named).name == "6660"


class Nested(Strict):
    tree: object = None


def deep(brackets: int) -> bytes:
    return b"tree: " + b"[" * brackets + b"]" * brackets + b"\n"


def aliased(values: int) -> bytes:
    """`values` of them: the tree itself, a list of 99 numbers (100 values with it), and the rest by aliases of it."""
    lists, more = divmod(values - 1, 100)
    return b"tree: [&a [" + b", ".join([b"1"] * 99) + b"]" + b", *a" * (lists - 1) + b", 2" * more + b"]\n"


@pytest.mark.parametrize(("content", "line", "column", "says"), [
    (b"tree: 1\n", None, None, ""), (b"\xef\xbb\xbftree: 1\n", None, None, ""),
    (b"tree: gr\xfcn\n", None, None, "is not UTF-8 text: invalid start byte at byte 8"),
    (b"tree: 1\n  other: 2\n", 2, 8, "is not YAML: mapping values are not allowed here"),
    (b"tree: [1, 2\n", 2, 1, "is not YAML: expected ',' or ']', but got '<stream end>'"),
    (b"tree: 1\x01\n", None, None, "is not YAML: unacceptable character"),
    (b"tree: 1\n#" + b" " * (2**20 - 9) + b"\n", None, None, "has 1048577 bytes, expected at most 1048576"),
    (deep(60), None, None, ""), (deep(61), None, None, "is not a file of this kind: over 60 brackets within each other"),
    (aliased(49_900), None, None, ""), (aliased(50_100), None, None, "has over 50000 values, those that aliases"),
])
def test_what_is_not_yaml_is_refused_with_its_place(tmp_path: Path, content: bytes, line: int, column: int, says: str) -> None:
    (tmp_path / "one.yaml").write_bytes(content)
    for reader in (lambda file: read_yaml(file, Nested), read_mapping):
        if not says:
            reader(tmp_path / "one.yaml")
            continue
        with pytest.raises(CompstiffError) as stopped:
            reader(tmp_path / "one.yaml")
        (found,) = stopped.value.findings
        assert (found.code, found.file, found.line, found.column) == ("CS0101", str(tmp_path / "one.yaml"), line, column)
        assert found.message.startswith(says)


def test_a_key_that_stands_twice_has_the_place_of_the_second(tmp_path: Path) -> None:
    (tmp_path / "one.yaml").write_text("share: 1\ntree: {c: 1,  c: 2}\n")
    with pytest.raises(CompstiffError) as stopped:
        read_mapping(tmp_path / "one.yaml")
    (found,) = stopped.value.findings
    assert (found.code, found.line, found.column, found.message) == ("CS0102", 2, 15, "key 'c' stands here a second time")


class Kinds(Strict):
    number: Number = 0.0
    positive: Positive = 1.0
    least: NotNegative = 0.0
    spring: Stiffness = 1.0
    turn: Quaternion = (1.0, 0.0, 0.0, 0.0)
    joints: EachJoint = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    place: Triple = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("key", "sound", "wrong", "says"), [
    ("number", ["1e12", "-1e12", "0"], ["1.001e12", "-1.001e12"], "must be at most 1e+12 in size"),
    ("number", [], [".inf", ".nan"], "nput should be a finite number"),
    ("number", ["7"], ["7 mm", "two", "[1]"], "must be a plain number, without a unit"),
    ("positive", ["1e-12", "1e12"], ["0.999e-12"], "must be at least 1e-12"),
    ("positive", [], ["0", "-1e-13", "-5"], "must be greater than zero"),
    ("least", ["0", "1e-12", "1e12"], ["0.999e-12", "1e-300"], "must be zero, or at least 1e-12"),
    ("least", [], ["-1e-13", "-2"], "must not be negative"),
    ("spring", ["1e-3", "1e20"], ["0.999e-3", "0", "-1", "1.001e20"], "must be greater than zero, 0.001 to 1e+20 N m/rad"),
    ("turn", ["[1.0009, 0, 0, 0]", "[0.9991, 0, 0, 0]", "[0.5, -0.5, 0.5, 0.5]"],
     ["[1.0011, 0, 0, 0]", "[0.9989, 0, 0, 0]", "[0.5, 0.5, 0.5, 0]"],
     "must be a unit quaternion w x y z (norm 1 within 1e-3); its norm is "),
    ("turn", [], ["[1, 0, 0, 0, 0]"], "must be a list of 4"), ("turn", [], ["1", "here"], "must be a list in square brackets"),
    ("joints", ["3", "[3, 3, 3, 3, 3, 3]"], ["true", "three", ".nan", ".inf"], "must be a number, or six of them, one a joint"),
    ("joints", [], ["0", "[1, 1, 1, 1, 1, 0]"], "must be greater than zero"), ("joints", [], ["2e12"], "must be at most 1e+12"),
    ("place", ["[1, 2, 3]"], ["[1, 2, 3, 4]"], "must be a list of 3"),
    ("place", [], ["[1, 2]"], "number 3 of the list is missing; found 2")])
def test_a_value_is_read_within_its_bounds_and_refused_beyond_with_what_is_wanted(
    tmp_path: Path, key: str, sound: list[str], wrong: list[str], says: str,
) -> None:
    """A number alone stands for all six joints."""
    file = tmp_path / "one.yaml"
    for value in sound:
        file.write_text(f"{key}: {value}\n")
        found, wanted = getattr(read_yaml(file, Kinds), key), yaml.safe_load(re.sub(r"(\d)e", r"\1.0e", value))
        if key == "joints" and not isinstance(wanted, list):
            wanted = [wanted] * 6
        assert (list(found) if isinstance(wanted, list) else found) == (wanted if isinstance(wanted, list) else float(wanted))
    for value in wrong:
        file.write_text(f"# first\n{key}: {value}\n")
        with pytest.raises(CompstiffError) as stopped:
            read_yaml(file, Kinds)
        (said, *_) = stopped.value.findings
        assert (said.code, said.line) == ("CS0102", 2)
        assert said.message.startswith(f"'{key}")
        assert says in said.message


@pytest.mark.parametrize(("key", "hint"), [
    ("posiive", "the nearest known key is 'positive'"), ("size", "it stands below inner: indent it there"),
    ("qqqqqq", "known keys are inner, positive"), ("Password", "no password stands in a file")])
def test_an_unknown_key_is_told_where_it_may_belong(tmp_path: Path, key: str, hint: str) -> None:
    class Outer(Strict):
        inner: Sized = Sized(size=1.0)
        positive: Positive = 1.0

    (tmp_path / "one.yaml").write_text(f"positive: 2\n{key}: 3\n")
    with pytest.raises(CompstiffError) as stopped:
        read_yaml(tmp_path / "one.yaml", Outer)
    (said,) = stopped.value.findings
    assert (said.message, said.line, said.column) == (f"unknown key '{key}'", 2, 1)
    assert said.hint.startswith(hint)
