"""What each bounded number of a file takes, and what it is where the file does not say: by a table written by hand."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Annotated, Any

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

# Of a file's section the interval; a default where there is one.
LIMITS: dict[str, tuple[Any, ...]] = {
    "MeasurementFile.force_relative_std": (0, 0.3, 0.0), "MeasurementFile.force_gain_std": (0, 0.3, 0.0),
    "ForceLogFile.position_late_ms": (-1000, 1000, 0.0), "ForceLogFile.gain_std": (0, 0.5, 0.01),
    "ForceLogFile.mounting_std_deg": (0, 20, None),
    "LimitsFile.max_offset_mm": (None, 100, 2.0), "LimitsFile.max_tilt_deg": (None, 30, 0.5),
    "CuttingFile.teeth": (1, 100, None), "CuttingFile.wear_std": (0, 2, 0.25), "MotionFile.compliance_std": (0, 0.5, 0.02),
    "AccuracyFile.position_um": (5, 20_000), "AccuracyFile.length_mm": (20, 10_000, None),
    "ModbusFile.port": (1, 65_535, 5020), "ModbusFile.unit": (0, 255, 1), "ControllerFile.port": (1, 65_535, None),
    "CouplingFile.joint": (1, 6), "CouplingFile.driven_by": (1, 6),
    "StockFile.resolution_mm": (0.02, 5, None), "StockFile.position_std_mm": (None, 10, None),
    "_Cutter.diameter_mm": (None, 1000), "_Cutter.teeth": (1, 100), "_Cutter.corner_radius_mm": (0, 500),
    "_Cutter.flute_mm": (None, None, None), "CoefficientsFile.model_error": (0, 10),
    "_Frame.radius_mm": (None, 1e5), "_Frame.duration_s": (0, 1e9), "_Remainder.length_mm": (None, 1e6),
    "_Remainder.amplitude_um": (0, 1e5), "LearnedFile.springs": (6, 200), "_Row.estimate": (0, 10**9), "_Bad.rows": (0, 10**9),
}
FILES = ("identification.model.cell_file", "identification.model.robot_file", "identification.model.stiffness_file",
         "compensator.cutting.coefficients", "compensator.cutting.stock_file", "compensator.learned.learned_file",
         "identification.design.discrimination")


def bounded() -> Iterator[tuple[str, FieldInfo]]:
    """All fields that have a bound of their own."""
    for module in map(importlib.import_module, FILES):
        for name, kind in vars(module).items():
            if isinstance(kind, type) and issubclass(kind, BaseModel) and kind.__module__ == module.__name__:
                for field, info in kind.model_fields.items():
                    told = repr(info.metadata) + repr(info.annotation)
                    if any(word in told for word in ("Ge(", "Gt(", "Le(", "Lt(")):
                        yield f"{name}.{field}", info


def test_every_bounded_number_is_in_the_table() -> None:
    assert {name for name, _ in bounded()} == set(LIMITS)


@pytest.mark.parametrize(("text", "taken"), [("", False), ("7", True), (60 * "7", True), (61 * "7", False)])
def test_a_serial_number_is_short_and_not_empty(text: str, taken: bool) -> None:
    info = importlib.import_module("identification.model.cell_file").CellFile.model_fields["serial_number"]
    adapter: TypeAdapter[Any] = TypeAdapter(Annotated[info.annotation, "", *info.metadata])
    if taken:
        assert adapter.validate_python(text) == text
    else:
        with pytest.raises(ValidationError):
            adapter.validate_python(text)


@pytest.mark.parametrize(("name", "info"), [pytest.param(*each, id=each[0]) for each in bounded()])
def test_a_bounded_number_takes_its_numbers_and_no_others(name: str, info: FieldInfo) -> None:
    low, high, *default = LIMITS[name]
    adapter: TypeAdapter[Any] = TypeAdapter(Annotated[info.annotation, "", *info.metadata])
    whole = any(isinstance(limit, int) and "int" in repr(info.annotation) for limit in (low, high))
    step = 1 if whole else 1e-3

    def taken(value: float) -> bool:
        try:
            adapter.validate_python([value] if name == "_Bad.rows" else value)
        except ValidationError:
            return False
        return True

    # Without a lower bound of its own it is a size: positive, or none.
    assert taken(step if low is None else low)
    assert not taken((-step) if low is None else low - step)
    if high is not None:
        assert (taken(high), taken(high + step)) == (True, False)
    assert ([] if info.is_required() else [info.default]) == default
