"""The map read and written by another implementation: pyModbusTCP, which shares no code with pymodbus."""

import binascii
import struct

import pytest
from pyModbusTCP.client import ModbusClient

from compensator.modbus.server import Loopback
from tests.compensator.modbus import tables_and_devices as kit


@pytest.fixture
def served(tmp_path):
    with Loopback(kit.offset_device(tmp_path)) as server:
        client = ModbusClient("127.0.0.1", server.port, unit_id=1, timeout=3.0, auto_open=True)
        yield client, server, tmp_path
        client.close()


def transfer(client: ModbusClient, identity: int, um: list[list[int]]) -> list[bool | None]:
    """By docs/modbus.md alone, with none of the project's code."""
    registers = [32768 + component for row in um for component in row]
    crc = binascii.crc32(struct.pack(f">{len(registers)}H", *registers))
    header = [identity >> 16, identity & 65535, len(um), crc >> 16, crc & 65535, 0, 0, 0, len(um), 1, 1]
    answers = [client.write_multiple_registers(96, [1, *header])]
    for page in range(-(-len(um) // 40)):
        rows = registers[120 * page:120 * page + 120]
        answers.append(client.write_multiple_registers(128, [identity >> 16, identity & 65535, page, *rows]))
    return [*answers, client.write_multiple_registers(96, [2, *header])]


def test_another_client_writes_a_table_and_reads_it_back(served):
    client, server, folder = served
    assert client.read_holding_registers(0, 6) == [0x4353, 0x4D42, 1, 40, 20000, 2000]
    assert client.read_input_registers(6, 2) == list(divmod(binascii.crc32(kit.ROBOT.encode()), 65536))
    um = [[row, -row, 3 * row] for row in range(97)]
    assert transfer(client, 0x12345678, um) == [True] * 5
    assert client.read_holding_registers(32, 3) == [0x1234, 0x5678, 97]
    assert kit.rows_on_disk(folder) == um
    table = [word for row in range(97) for word in client.read_holding_registers(4096 + 3 * row, 3)]
    assert table == [32768 + component for row in um for component in row]
    # compstiff reads what the other wrote as the old table, and replaces it.
    assert kit.push(server.port, kit.random_table(1)).text == "committed"
    assert client.read_holding_registers(32, 11) == kit.random_table(1).header.registers()


def test_a_gateway_asks_for_rows_with_single_writes(served):
    client, server, _ = served
    table = kit.random_table(1)
    kit.push(server.port, table)
    for row in (0, 41, 89):
        assert client.write_single_register(50, row)
        answer = client.read_input_registers(64, 11)
        assert answer[4:8] == [row, *table.registers[row].tolist()]


def test_the_exceptions_of_the_map(served):
    client, _, folder = served
    for call, arguments, code in (
        (client.write_multiple_registers, (0, [1, 2]), 2), (client.write_single_register, (4096, 1), 2),
        (client.read_holding_registers, (60000, 10), 2), (client.read_holding_registers, (24, 1), 2),
        (client.write_multiple_registers, (96, [1, 2, 3]), 3),
        (client.write_multiple_registers, (128, [0, 1, 0, 32768, 32768, 32768]), 7),
        (client.read_coils, (0, 1), 1), (client.write_single_coil, (0, True), 1), (client.read_discrete_inputs, (0, 1), 1),
        (client.write_read_multiple_registers, (48, [1], 0, 1), 1),
    ):
        assert not call(*arguments)
        assert client.last_except == code, (call, arguments)
    assert transfer(client, 7, [[2500, 0, 0]]) == [True, True, False]
    assert kit.rows_on_disk(folder) is None
