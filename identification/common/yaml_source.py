"""YAML files checked against a pydantic model, each complaint with its line and column."""

from __future__ import annotations

import difflib
import math
import re
from functools import lru_cache
from itertools import accumulate
from pathlib import Path
from textwrap import shorten
from typing import Annotated, Any, TypeVar

import yaml
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, FiniteFloat, ValidationError

from identification.common.findings import CompstiffError, Finding, error
from identification.common.sizes import LARGEST, SMALLEST, SOFTEST, STIFFEST

Place = tuple[int, int]
Key = tuple[str | int, ...]


class Strict(BaseModel):
    """Base of the file models: unknown keys are errors, values cannot change."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


def _sized(value: float) -> float:
    if abs(value) > LARGEST:
        raise ValueError(f"must be at most {LARGEST:g} in size")
    return value


def _positive(value: float) -> float:
    if value <= 0:
        raise ValueError("must be greater than zero")
    if value < SMALLEST:
        raise ValueError(f"must be at least {SMALLEST:g}")
    return value


def _not_negative(value: float) -> float:
    if value < 0:
        raise ValueError("must not be negative")
    if 0 < value < SMALLEST:
        raise ValueError(f"must be zero, or at least {SMALLEST:g}")
    return value


def _of_a_joint(value: float) -> float:
    if not SOFTEST <= value <= STIFFEST:
        raise ValueError(f"must be greater than zero, {SOFTEST:g} to {STIFFEST:g} N m/rad")
    return value


def _unit(value: tuple[float, ...]) -> tuple[float, ...]:
    norm = sum(component**2 for component in value) ** 0.5
    if abs(norm - 1) > 1e-3:
        raise ValueError(f"must be a unit quaternion w x y z (norm 1 within 1e-3); its norm is {norm:.6g}")
    return value


def _for_each_joint(value: object) -> object:
    if isinstance(value, (list, tuple)):
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError("must be a number, or six of them, one a joint")
    return (_positive(_sized(value)),) * 6


Number = Annotated[FiniteFloat, AfterValidator(_sized)]
Positive = Annotated[Number, AfterValidator(_positive)]
NotNegative = Annotated[Number, AfterValidator(_not_negative)]
Stiffness = Annotated[FiniteFloat, AfterValidator(_of_a_joint)]
Triple = tuple[Number, Number, Number]
Quaternion = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_unit)]
# A single number stands for all six joints.
EachJoint = Annotated[tuple[Positive, Positive, Positive, Positive, Positive, Positive], BeforeValidator(_for_each_joint)]
Model = TypeVar("Model", bound=BaseModel)
# A cell.yaml has some kilobytes, and brackets four deep.
LARGEST_FILE, DEEPEST, MOST_VALUES = 1 << 20, 60, 50_000
MEANT = "is this the YAML file that is meant? CELL, the cell.yaml, comes first on the command line"


class _Loader(yaml.SafeLoader):
    """SafeLoader that reads 2.03e6 as a number (YAML 1.2), which PyYAML's YAML 1.1 takes for text."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$|^[-+]?\.(inf|Inf|INF)$|^\.(nan|NaN|NAN)$"),
    list("-+.0123456789"),
)


def read_yaml(file: str | Path, model: type[Model]) -> Model:
    """The file as `model`. Raises CompstiffError (CS0101 not YAML, CS0102 wrong content) with every place at fault."""
    read: Model = _validated(_bytes(file), str(file), model)
    return read


def read_mapping(file: str | Path) -> dict[str, Any]:
    """The keys and values of a file, whatever they are. Raises CompstiffError (CS0101 not YAML, CS0102 no mapping)."""
    return _mapping(_bytes(file), str(file))[0]


@lru_cache(maxsize=64)
def _validated(content_bytes: bytes, name: str, model: type[BaseModel]) -> Any:
    """The content as `model`, which cannot change. Robots and cells are asked for again and again, and take long to parse."""
    content, places = _mapping(content_bytes, name)
    try:
        return model.model_validate(content)
    except ValidationError as reason:
        raise CompstiffError(*(_complaint(item, model, places, name) for item in reason.errors())) from reason


def _bytes(file: str | Path) -> bytes:
    try:
        return Path(file).read_bytes()
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(file)) from reason


def _mapping(content_bytes: bytes, name: str) -> tuple[dict[str, Any], dict[Key, Place]]:
    """The content of a file, and where each of its keys stands."""
    try:
        if len(content_bytes) > LARGEST_FILE:
            raise error("CS0101", f"has {len(content_bytes)} bytes, expected at most {LARGEST_FILE}", file=name, hint=MEANT)
        text = content_bytes.decode("utf-8-sig")
        if _depth(text) > DEEPEST:
            raise error("CS0101", f"is not a file of this kind: over {DEEPEST} brackets within each other", file=name,
                        hint=MEANT)
        node = yaml.compose(text, Loader=_Loader)
        places: dict[Key, Place] = {}
        content = None if node is None else _plain(node, (), places, name, _Loader(""))
    except UnicodeDecodeError as reason:
        raise error("CS0101", f"is not UTF-8 text: {reason.reason} at byte {reason.start}", file=name,
                    hint=f"{MEANT}; an editor saves it as UTF-8") from reason
    except yaml.MarkedYAMLError as reason:
        mark = reason.problem_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (None, None)
        hint = "indent with blanks: YAML takes no tabs" if "'\\t'" in str(reason.problem) else MEANT
        raise error("CS0101", f"is not YAML: {reason.problem}", file=name, line=line, column=column, hint=hint) from reason
    except yaml.YAMLError as reason:
        raise error("CS0101", f"is not YAML: {reason}", file=name, hint=MEANT) from reason
    except RecursionError as reason:
        raise error("CS0101", "is not a file of this kind: brackets nested too deeply", file=name) from reason
    if not isinstance(content, dict):
        raise error("CS0102", f"must be a mapping of keys to values, found {type(content).__name__}", file=name, line=1,
                    hint=MEANT)
    return content, places


def _depth(text: str) -> int:
    """The most brackets that are open at once, those in comments and texts included: it rules the reader's time."""
    return max(accumulate((letter in "[{") - (letter in "]}") for letter in text if letter in "[]{}"), default=0)


def _plain(node: yaml.Node, key: Key, places: dict[Key, Place], name: str, scalars: _Loader) -> Any:
    """The node's value as Python data; `places` receives where each key stands, `scalars` reads single values."""
    if len(places) > MOST_VALUES:
        raise error("CS0101", f"has over {MOST_VALUES} values, those that aliases (*name) repeat included", file=name,
                    hint=MEANT)
    places.setdefault(key, (node.start_mark.line + 1, node.start_mark.column + 1))
    if isinstance(node, yaml.MappingNode):
        mapping: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            label = str(key_node.value)
            line, column = key_node.start_mark.line + 1, key_node.start_mark.column + 1
            if label in mapping:
                raise error("CS0102", f"key '{label}' stands here a second time", file=name, line=line, column=column)
            places[(*key, label)] = (line, column)
            mapping[label] = _plain(value_node, (*key, label), places, name, scalars)
        return mapping
    if isinstance(node, yaml.SequenceNode):
        return [_plain(item, (*key, index), places, name, scalars) for index, item in enumerate(node.value)]
    try:
        return scalars.construct_object(node, deep=True)
    except ValueError as reason:
        line, column = places[key]
        raise error("CS0102", f"a value that cannot be read: {reason}", file=name, line=line, column=column) from reason


def _complaint(item: Any, model: type[BaseModel], places: dict[Key, Place], name: str) -> Finding:
    """A pydantic error as a finding at its line and column."""
    key: Key = tuple(item["loc"])
    known = key
    while known and known not in places:
        known = known[:-1]
    line, column = places.get(known, (1, 1))
    label = ".".join(f"{part + 1}" if isinstance(part, int) else part for part in key)
    hint = ""
    if item["type"] == "extra_forbidden":
        message = f"unknown key '{label}'"
        hint = _place_of(str(key[-1]), _keys(model, key[:-1]), model)
    elif item["type"] == "missing":
        message = (f"'{'.'.join(map(str, key[:-1]))}': number {key[-1] + 1} of the list is missing; found "
                   f"{len(item['input'])}" if isinstance(key[-1], int) else f"key '{label}' is missing")
    elif item["type"] == "value_error" and isinstance(item["input"], dict):
        # Of keys that do not go together: what was found of them it says itself.
        message = f"'{label}': {_wanted(item)}" if label else _wanted(item)
    else:
        message = f"'{label}': {_wanted(item)}; found {shorten(repr(item['input']), 200)}"
    return Finding("CS0102", "error", message, file=name, line=line, column=column, hint=hint)


def _place_of(key: str, known: list[str], model: type[BaseModel]) -> str:
    """Where an unknown key may belong: below another one, or to a known one that is written alike."""
    if key.lower() in ("password", "passwd", "pwd", "passwort"):
        return "no password stands in a file: leave it out; the command that needs it says where it comes from"
    above = [name for name in model.model_fields if key in _keys(model, (name,))]
    if above:
        return f"it stands below {' or '.join(above)}: indent it there"
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    if near:
        return f"the nearest known key is '{near[0]}'"
    return f"known keys are {', '.join(known)}" if known else ""


def _wanted(item: Any) -> str:
    """What was expected, in the words of somebody who writes YAML."""
    kind = item["type"]
    if kind in ("tuple_type", "list_type"):
        return "must be a list in square brackets, such as [120, 0, 250]"
    if kind in ("float_type", "float_parsing", "int_type", "int_parsing"):
        return "must be a plain number, without a unit"
    if kind == "too_long":
        exactly = item["ctx"]["field_type"] == "Tuple"
        return f"must be a list of {'' if exactly else 'at most '}{item['ctx']['max_length']}"
    if kind == "too_short":
        return f"must be a list of at least {item['ctx']['min_length']}"
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return "must have keys of its own, such as {key: value}"
    if kind == "string_type":
        return "must be text (a number in quotes)"
    what = str(item["msg"].removeprefix("Value error, "))
    return what[0].lower() + what[1:]


def _keys(model: type[BaseModel], path: Key) -> list[str]:
    """The keys the model knows at this path."""
    current: Any = model
    for part in path:
        if isinstance(part, str):
            current = current.model_fields[part].annotation
        for candidate in (current, *getattr(current, "__args__", ())):
            inner = (candidate, *getattr(candidate, "__args__", ()))
            found = [c for c in inner if isinstance(c, type) and issubclass(c, BaseModel)]
            if found:
                current = found[0]
                break
    return list(current.model_fields) if isinstance(current, type) and issubclass(current, BaseModel) else []
