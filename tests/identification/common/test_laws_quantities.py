"""Values for people are the same values: read back from their words, whatever their size and unit."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.common.quantities import cause_words, parameter_words, quantity, readable_unit
from identification.model.effects import effects

MEANS = {"": 1.0, "m": 1e-3, "u": 1e-6}
TURN = {"deg": math.pi / 180, "arcsec": math.pi / 648000}


@given(st.floats(1e-12, 1e6), st.sampled_from([1, -1]), st.sampled_from(["rad", "m", "s", "rad/(N*m)", "m/N", "N", "1/m", "1"]))
def test_the_words_say_the_value(size: float, sign: int, unit: str) -> None:
    value = sign * size
    words = quantity(value, 0.1 * size, unit)
    number, std, name, angle = re.fullmatch(r"(\S+) \+- (\S+)(?: (?!\()(\S+))?(?: \((.*)\))?", words).groups()
    prefix = MEANS[(name or "").removesuffix("" if unit == "1" else unit)]
    assert float(number) * prefix == pytest.approx(value, rel=6e-3)
    assert float(std) * prefix == pytest.approx(0.2 * size, rel=6e-2), "two sigma"
    assert bool(angle) == (unit == "rad")
    if angle:
        turned, of = angle.split()
        assert float(turned) * TURN[of] == pytest.approx(value, rel=6e-3)


def test_every_typical_size_is_read_without_powers_of_ten_where_its_unit_has_a_prefix() -> None:
    for effect in effects().values():
        for parameter in effect.parameters:
            assert parameter_words(parameter.name)
            if re.match(r"(rad|m|s)(/|$)", parameter.unit) and not parameter.shape:
                factor, _ = readable_unit(parameter.typical, parameter.unit)
                assert 1e-3 < abs(parameter.typical) / factor < 1e3, (effect.name, parameter.name)


@pytest.mark.parametrize(("name", "words"), [
    ("half_gap_rad", "half gap"), ("compliance_rad_per_nm", "compliance"), ("x_m", "x"), ("share", "share"), ("time_s", "time"),
    ("torque_nm", "torque"), ("flexibility_per_nm2", "flexibility")])
def test_a_parameter_is_called_by_what_it_is_and_not_by_its_unit(name: str, words: str) -> None:
    assert parameter_words(name) == words


@pytest.mark.parametrize(("label", "words"), [
    ("soft_zone[2]", "soft zone of joint 2"), ("link_bending[3]", "link bending of link 3"), ("tool_point", "tool point"),
    ("force_sign[y]", "force sign y"), ("soft_zone[5] + link_bending[2]", "soft zone of joint 5 + link bending of link 2")])
def test_a_cause_is_called_by_its_kind_and_where_it_is(label: str, words: str) -> None:
    assert cause_words(label) == words
