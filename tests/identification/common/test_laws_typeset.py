"""Words for a page: other marks, the same digits, and nothing of a column's, an option's or a file's name touched."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.common.typeset import typeset


@pytest.mark.parametrize(("plain", "printed"), [
    ("left 5.96 um RMS", "left 5.96\xa0µm RMS"), ("residual [um]", "residual [µm]"), ("0.2 urad", "0.2\xa0µrad"),
    ("30.14 -> 4.88 um", "30.14\xa0→ 4.88\xa0µm"), ("4.1e-05 +- 6e-07 rad", "4.1e-05\xa0±\xa06e-07\xa0rad"),
    ("95 % (4.95e+06 ... 5.05e+06)", "95\xa0% (4.95e+06\xa0… 5.05e+06)"), ("k [N m/rad]", "k [N\xa0m/rad]"),
    ("torque_nm = 160 N*m", "torque_nm = 160\xa0N·m"), ("urad", "µrad"), ("urad/(N*m)", "µrad/(N·m)"), ("um/N", "µm/N"),
])
def test_marks(plain: str, printed: str) -> None:
    assert typeset(plain) == printed


@pytest.mark.parametrize("name", ["fill in dx_um dy_um dz_um", "dx_um,dy_um", "--tare 0:2 -o um.mod", "unit um is unknown",
                                  "sum 3 umbrellas", "a -> b", "wait ...", "C:\\um\\part 3 umlaut.mod"])
def test_names_stay(name: str) -> None:
    assert typeset(name) == name


@given(st.text(alphabet="0123456789.-+>umradN* %[]/^e", max_size=60))
def test_digits_stay(text: str) -> None:
    """Every number of the text, in its order; and twice is once."""
    assert re.findall(r"\d+", typeset(text)) == re.findall(r"\d+", text)
    assert typeset(typeset(text)) == typeset(text)
