"""The RAPID module: accepted by an independent grammar check, with the scale and the ids of exactly these tables."""

import re
import subprocess
import sys

import numpy as np
import pytest

from compensator.modbus.receiver import receiver_text
from compensator.modbus.registers import MAP
from tests.compensator.modbus.tables_and_devices import random_table
from tests.compensator.rapid.test_contract_checker import CONFIGURATION

FIRST = random_table(1, rows=100, window=1, windows=2, total=150)
SECOND = random_table(2, rows=50, first=100, window=2, windows=2, total=150)


def text(corrwrite: bool = False) -> str:
    tables = [FIRST, SECOND]
    return receiver_text(tables, 2e-3, "offsets", "offsets.csv", corrwrite=corrwrite)


@pytest.mark.parametrize("corrwrite", [False, True])
def test_rapidchecker_accepts_it(tmp_path, corrwrite):
    (tmp_path / "rapidchecker.toml").write_text(CONFIGURATION)
    body = text(corrwrite).split("%%%\n")[-1]
    assert ("CorrWrite" in body) == corrwrite
    for content, accepted in ((body, True), (body.replace("PDispSet peCs;", "PDispSet peCs"), False)):
        (tmp_path / "module.sys").write_text(content)
        run = subprocess.run([sys.executable, "-m", "rapidchecker", "module.sys"], cwd=tmp_path, capture_output=True, text=True)
        assert (run.returncode == 0) == accepted, run.stdout


def test_it_names_each_window_once():
    for number, (rows, first, table) in enumerate(((100, 0, FIRST), (50, 100, SECOND)), 1):
        body = re.search(rf"IF window={number} THEN\n(.*?)ELSE", text(), re.S)
        assert body
        constants = dict(re.findall(r"(nCs\w+):=(\d+);", body[1]))
        assert constants == {"nCsIdHi": str(table.header.id >> 16), "nCsIdLo": str(table.header.id & 65535),
                             "nCsRows": str(rows), "nCsFirst": str(first)}


def test_its_scale_turns_registers_into_the_millimetres_that_were_sent():
    """The module's own constants and formula, evaluated in single precision as RAPID does."""
    module = text()
    constants = {name: np.float32(value) for name, value in re.findall(r"CONST num (CS_\w+):=([\d.]+);", module)}
    formula = re.search(r"RETURN (\(word-CS_ZERO_WORD\)/CS_UM_PER_MM);", module)
    assert formula
    for mm, word in ((0.0, 32768), (2.0, 34768), (-2.0, 30768), (0.001, 32769), (-32.766, 2)):
        assert eval(formula[1], {}, {**constants, "word": np.float32(word)}) == pytest.approx(mm, abs=2e-6)
    assert (constants["CS_NONE_LOW"], constants["CS_NONE_HIGH"], constants["CS_LIMIT_MM"]) == (0, 65535, 2)


def test_the_signals_in_its_head_are_registers_of_the_map():
    by_name = {"giCsIdHi": 64, "giCsCount": 66, "giCsBeat": 67, "giCsRow": 68, "giCsX": 69, "giCsCheck": 72, "giCsWindow": 73,
               "goCsBeat": 48, "goCsState": 49, "goCsRow": 50, "goCsIdHi": 51, "goCsWindow": 53}
    head = dict(re.findall(r"(g[io]Cs\w+) \[(\d+)\]", text()))
    starts = {register.address for register in MAP}
    for name, address in by_name.items():
        assert (head[name], address in starts) == (str(address), True)
    used = set(re.findall(r"\bg[io]Cs\w+", text()))
    assert used == set(head)


def test_lines_and_identifiers_are_within_what_rapid_takes():
    module = text(corrwrite=True)
    assert module.isascii()
    assert max(len(name) for name in re.findall(r"[A-Za-z]\w*", module)) <= 32
    assert all(len(string) <= 80 for string in re.findall(r'"([^"]*)"', module))


@pytest.mark.parametrize(("name", "module"), [
    ("roof_12", "roof_12"), ("12_roof", "M12_roof"), ("_roof", "M_roof"), ("part-1.2 left", "part_1_2_left"),
    ("D\u00e4chle", "D_chle"), ("\u0663", "M_"), ("", "M"), ("a" * 40, "a" * 32), ("7" * 40, "M" + "7" * 31)])
def test_any_name_is_an_identifier_of_rapid(name: str, module: str) -> None:
    """A letter first, then letters, digits and _, at most 32; letters of other alphabets are none to RAPID."""
    written = receiver_text([random_table(3, 3)], 2e-3, name, "offsets.csv", corrwrite=False)
    assert re.findall(r"^MODULE (\S+)", written, re.MULTILINE) == [module]
