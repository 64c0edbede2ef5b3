"""Mutants of numbers outside functions are judged in modules that are loaded already (benchmarks/loaded_modules.py)."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from benchmarks.loaded_modules import Loaded

FILES = {
    "limits": "A, B = 2, 5\nTWICE: float = 2 * A\n\n\ndef half() -> float:\n    return A / 2\n",
    "user": "from lent.limits import B as BEYOND, TWICE, half\n\nMORE = TWICE + 1\n\n\n"
            "def told():\n    return MORE, half(), BEYOND\n",
    "third": "from lent.user import MORE\n\nMOST = (MORE,)\n",
    "apart": "from lent.limits import B\n\n\ndef told(size=B):\n    return size\n",
    "__init__": "",
}


@pytest.fixture
def lent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "lent"
    folder.mkdir()
    for name, text in FILES.items():
        (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield folder
    for name in [name for name in sys.modules if name.split(".")[0] == "lent"]:
        del sys.modules[name]


@pytest.mark.parametrize(("change", "further", "told"), [
    (("A, B = 2", "A, B = 4"), (), ((9, 2.0, 5), (9,))),
    (("TWICE: float = 2 *", "TWICE: float = 3 *"), ("apart",), ((7, 1.0, 5), (7,))),
    (("A, B = 2, 5", "A, B = 2, 6"), (), ((5, 1.0, 6), (5,)))])
def test_what_a_module_makes_of_a_number_is_made_again_wherever_it_is(
    lent: Path, change: tuple[str, str], further: tuple[str, ...], told: tuple
) -> None:
    user, third, *_ = (importlib.import_module(f"lent.{name}") for name in ("user", "third", *further))
    loaded = Loaded.of("lent")
    file = (lent / "limits").with_suffix(".py")
    file.write_text(file.read_text().replace(*change))
    assert loaded.given(str(file))
    assert (user.told(), third.MOST) == told


@pytest.mark.parametrize("change", [("A, B = 2, 5", "A, B = 2, 6"), ("A / 2", "A / 4")])
def test_a_default_and_a_function_s_own_code_are_left_to_others(lent: Path, change: tuple[str, str]) -> None:
    importlib.import_module("lent.apart")
    loaded = Loaded.of("lent")
    file = (lent / "limits").with_suffix(".py")
    file.write_text(file.read_text().replace(*change))
    assert not loaded.given(str(file))
