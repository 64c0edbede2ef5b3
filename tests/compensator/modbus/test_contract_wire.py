"""What stands in the registers, against answers worked out by hand or by another implementation."""

import binascii
import re
from pathlib import Path

import numpy as np
import pytest

from compensator.modbus import registers, wire
from compensator.modbus.link import ExceptionReply
from tests.compensator.modbus.tables_and_devices import random_table


def test_offset_binary_micrometres():
    um = np.array([[0, 1, -1], [2000, -2000, 32766], [-32766, 0, 0]])
    registers = wire.to_registers(um)
    assert registers.tolist() == [[32768, 32769, 32767], [34768, 30768, 65534], [2, 32768, 32768]]
    assert (wire.to_micrometres(registers) == um).all()
    for outside in (32767, -32767, -32768):
        with pytest.raises(ValueError, match="does not fit"):
            wire.to_registers(np.array([[0, outside, 0]]))


def test_the_values_of_a_dead_input_are_no_offset():
    good = wire.to_registers(np.array([[10, 20, 30]]))
    assert wire.acceptable(good, 100)
    for dead in (0, 65535):
        registers = good.copy()
        registers[0, 1] = dead
        assert not wire.acceptable(registers, 65535)


def test_the_limit_is_the_length_of_the_offset():
    # 3-4-5: 1200, 1600 has the length 2000 exactly; a micrometre is allowed for the rounding of the components.
    assert wire.acceptable(wire.to_registers(np.array([[1200, 1600, 0]])), 2000)
    assert wire.acceptable(wire.to_registers(np.array([[0, 0, -2001]])), 2000)
    assert not wire.acceptable(wire.to_registers(np.array([[0, 0, -2002]])), 2000)
    assert not wire.acceptable(wire.to_registers(np.array([[1500, 1500, 0]])), 2000)


def test_crc_is_the_common_one_over_the_bytes_on_the_wire():
    # The check value of CRC-32/ISO-HDLC is that of the text "123456789"; with a tenth character it fills five registers.
    registers = np.frombuffer(b"1234567890..", ">u2").astype(np.uint16).reshape(-1, 3)
    assert wire.crc32(registers) == binascii.crc32(b"1234567890..")
    assert binascii.crc32(b"123456789") == 0xCBF43926


def test_a_header_goes_there_and_back_and_the_id_follows_the_content():
    table = random_table(1)
    assert wire.Header.from_registers(table.header.registers()) == table.header
    assert len(table.header.registers()) == wire.HEADER_REGISTERS
    assert random_table(1).header == table.header
    ids = {table.header.id, random_table(2).header.id, random_table(1, rows=89).header.id, random_table(1, total=91).header.id,
           random_table(1, window=1, windows=2).header.id, random_table(1, first=1, total=91).header.id}
    assert len(ids) == 6
    assert 0 not in ids


def test_pages_put_together_are_the_table():
    table = random_table(3, rows=81)
    pages = [table.page(page) for page in range(table.header.pages)]
    assert [len(page) for page in pages] == [123, 123, 6]
    assert [page[2] for page in pages] == [0, 1, 2]
    assert [word for page in pages for word in page[3:]] == table.registers.ravel().tolist()


def test_the_map_has_no_overlaps_and_fits_the_address_space():
    end = 0
    for register in registers.MAP:
        assert register.address >= end
        end = register.address + register.count
    assert end - 1 == registers.LAST_ADDRESS <= 65535


def test_the_documented_map_is_the_map():
    text = (Path(__file__).parents[3] / "docs" / "modbus.md").read_text()
    rows = re.findall(r"^\| (\d+) \| (\d+) \| (r|rw|w) \| (.+?) \| (.+?) \|$", text, re.M)
    assert rows == [(str(item.address), str(item.count), item.access, item.name, item.meaning) for item in registers.MAP]


def test_the_documented_refusals_are_those_of_the_device():
    """By number: a robot's program, or another maker's writer, knows no names."""
    text = " ".join((Path(__file__).parents[3] / "docs" / "modbus.md").read_text().split())
    listed = re.search(r"`last result`: (.*?)\.", text)
    assert listed
    words = {"header": "header", "sequence": "sequence", "page length": "page_length", "offset": "offset", "CRC": "crc",
             "disk": "storage", "another writer": "other_writer", "robot running": "robot_running",
             "a repeated page differs": "page_changed"}
    entries = re.findall(r"(\d) ([^,]+?)(?: over the limit or no offset)?(?:,|$)", listed[1])
    told = {word: int(number) for number, word in entries}
    assert told == {word: registers.Result[name.upper()].value for word, name in words.items()}
    assert sorted(registers.Result) == [0, *sorted(told.values())]


def test_the_documented_exceptions_commands_and_states_are_those_of_the_device():
    """By number, as whoever programs a PLC after the page has them: exception codes of the specification."""
    text = (Path(__file__).parents[3] / "docs" / "modbus.md").read_text()
    table = text[text.index("| exception |"):].partition("\n\n")[0]
    told = {int(number): word
            for numbers, words in re.findall(r"^\| ([\d, ]+?)(?: and others)? \| (.+?)(?: \(.*?\)|:.*?)? \|", table, re.M)
            for number, word in zip(numbers.split(", "), words.split(", "), strict=True)}
    assert told == {registers.Refusal.FUNCTION: "illegal function", registers.Refusal.ADDRESS: "illegal address",
                    registers.Refusal.FAILURE: "failure", registers.Refusal.VALUE: "illegal value",
                    registers.Refusal.BUSY: "busy", registers.Refusal.SEQUENCE: "out of sequence"}
    for names, name in ((registers.Command, "command"), (registers.Robot, "robot state"), (registers.State, "state")):
        [meaning] = [item.meaning for item in registers.MAP if item.name == name]
        listed = re.findall(r"(\d) (idle|receiving|begin|commit|abort|running|window done)", meaning)
        assert [(str(one.value), one.name.lower().replace("_", " ")) for one in names] == listed


@pytest.mark.parametrize(("code", "word"), [
    (1, "function"), (2, "address"), (3, "value"), (4, "failure"), (5, "acknowledge"), (6, "busy"), (8, "parity"),
    (10, "gateway path"), (11, "gateway target"), (99, "unknown")])
def test_an_exception_is_named_as_the_specification_names_it(code: int, word: str):
    """MODBUS Application Protocol 1.1b3, section 7."""
    assert re.fullmatch(rf"exception reply {code} \(.*{word}.*\)", str(ExceptionReply(code)))
