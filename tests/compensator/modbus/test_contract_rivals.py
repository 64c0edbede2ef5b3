"""Others on the same cell: another writer in between, two pushes at once, a cell that is killed and restarted."""

import socket
import threading

import numpy as np
import pytest

from compensator.modbus import registers as at
from compensator.modbus.link import Address, Link
from compensator.modbus.registers import Command, Robot
from compensator.modbus.server import Loopback
from compensator.modbus.state import TableStore
from compensator.modbus.wire import split
from tests.compensator.modbus import tables_and_devices as kit
from tests.compensator.modbus.proxy import Fault, Proxy

# Retries whose pauses are over a minute, the first ones 5 ms: a cell that starts again takes its time on a busy machine.
PATIENT = 14


@pytest.mark.parametrize("request_number", [kit.BEGIN, *kit.PAGES, kit.COMMIT, kit.READ_BACK])
@pytest.mark.parametrize("whole", [True, False])
def test_another_writer_in_between(tmp_path, request_number, whole):
    """It tries a whole transfer, or only begins one; the active table is that of one of the two, and the push says which."""
    device, old, new, other = kit.offset_device(tmp_path), kit.random_table(1), kit.random_table(2), kit.random_table(3)
    kit.load(device, old)
    got = []
    with Loopback(device) as server, Proxy(server.port, 0) as proxy:
        def interfere() -> None:
            if whole:
                got.append(kit.push(server.port, other, patience_s=0.0).code)
                return
            with Link(Address("127.0.0.1", server.port, 1, kit.TIMEOUT_S, 0)) as link:
                for command in ([Command.BEGIN, *other.header.registers()], [Command.COMMIT, *other.header.registers()]):
                    try:
                        link.write(at.COMMAND, command)
                    except Exception as reason:
                        got.append(str(reason))

        proxy.arm(Fault("before request", request_number), interfere)
        ending = kit.push(proxy.port, new, retries=0)
        assert got
        assert proxy.fired
        active = kit.rows_on_disk(tmp_path)
        if ending.code == 0:
            assert active == kit.offsets_of(new)
        else:
            assert (ending.code, active) == (3, kit.offsets_of(other))
            assert f"table {other.header.name} with 90 rows is active (read back)" in ending.text
            assert ending.finding.code == "CS5014"
            assert "somebody else pushed" in ending.finding.hint
        assert kit.push(server.port, new).code == 0
        assert kit.rows_on_disk(tmp_path) == kit.offsets_of(new)


def test_noise_on_the_port_changes_nothing(tmp_path):
    """Random bytes, frames of random length, function and content, and connections left open."""
    device, old, new = kit.offset_device(tmp_path), kit.random_table(1), kit.random_table(2)
    kit.load(device, old)
    rng = np.random.default_rng(7)
    with Loopback(device) as server:
        left_open = []
        for _ in range(60):
            noise = rng.bytes(int(rng.integers(1, 300)))
            function = bytes([int(rng.integers(1, 24))])
            frame = b"\0\1\0\0" + (2 + len(noise)).to_bytes(2, "big") + b"\1" + function + noise
            left_open.append(socket.create_connection(("127.0.0.1", server.port), timeout=2))
            left_open[-1].sendall(noise if rng.integers(2) else frame)
            if rng.integers(2):
                left_open.pop().close()
        assert kit.push(server.port, new, retries=5, patience_s=5.0).code == 0
        for connection in left_open:
            connection.close()
    assert kit.rows_on_disk(tmp_path) == kit.offsets_of(new)


def test_two_pushes_at_once_leave_one_of_the_two_tables_whole(tmp_path):
    device = kit.offset_device(tmp_path)
    tables = [kit.random_table(seed, rows=1200) for seed in (1, 2)]
    endings: dict[int, kit.Ending] = {}
    with Loopback(device) as server:
        threads = [threading.Thread(target=lambda i=i: endings.update({i: kit.push(server.port, tables[i], timeout_s=5,
                                                                                  patience_s=10)})) for i in (0, 1)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30)
    active = kit.rows_on_disk(tmp_path)
    assert active in [kit.offsets_of(table) for table in tables]
    assert 0 in {ending.code for ending in endings.values()}
    for ending in endings.values():
        # 3: the other one committed between this one's commit and its read-back.
        assert ending.code in (0, 3)


def test_a_busy_cell_is_waited_for_and_named(tmp_path):
    device, old, new = kit.offset_device(tmp_path, lease_s=60.0), kit.random_table(1), kit.random_table(2)
    kit.load(device, old)
    with Loopback(device) as server:
        device.write(at.COMMAND, [Command.BEGIN, *kit.random_table(3).header.registers()])
        ending = kit.push(server.port, new, patience_s=0.2)
        assert ending.code == 4
        assert "busy: another writer's transfer is under way; old table active (read back)" in ending.text
        device.write(at.COMMAND, [Command.ABORT, *kit.random_table(3).header.registers()])
        device.write(at.ROBOT, [1, Robot.RUNNING, 0, *split(old.header.id)])
        ending = kit.push(server.port, new, patience_s=0.2)
        assert "busy: the robot is running with the active table; old table active (read back)" in ending.text
        device.write(at.ROBOT + 1, [Robot.IDLE])
        assert kit.push(server.port, new).code == 0


def test_after_old_table_active_nothing_late_can_commit(tmp_path):
    """The commit is stuck in the network, the push reports the old table, then the commit arrives."""
    device, old, new = kit.offset_device(tmp_path), kit.random_table(1), kit.random_table(2)
    kit.load(device, old)
    with Loopback(device) as server:
        with Link(Address("127.0.0.1", server.port, 1)) as link:
            link.write(at.COMMAND, [Command.BEGIN, *new.header.registers()])
            for page in range(3):
                link.write(at.PAGE, new.page(page))
        with Proxy(server.port, 0) as proxy:
            # Every commit is refused as busy on its way, so the push gives up.
            proxy.arm(Fault("refuse request", kit.COMMIT, code=6))
            ending = kit.push(proxy.port, new, patience_s=-1.0)
        assert (ending.code, "old table active (read back)" in ending.text) == (4, True)
        with Link(Address("127.0.0.1", server.port, 1, retries=0)) as late, pytest.raises(Exception, match="out of sequence"):
            late.write(at.COMMAND, [Command.COMMIT, *new.header.registers()])
    assert kit.rows_on_disk(tmp_path) == kit.offsets_of(old)


@pytest.mark.parametrize(("kind", "request_number", "retries"), [
    ("before request", kit.PAGES[1], PATIENT), ("before request", kit.COMMIT, 0)])
def test_a_killed_and_restarted_cell(tmp_path, kind, request_number, retries):
    old, new = kit.random_table(1), kit.random_table(2)
    with kit.DeviceProcess(tmp_path) as device, Proxy(device.port, 0) as proxy:
        assert kit.push(device.port, old, timeout_s=5).code == 0

        def restart() -> None:
            device.kill()
            device.start()

        proxy.arm(Fault(kind, request_number), restart)
        # With no patience for a restart the answer is honest; with it the push gets through.
        ending = kit.push(proxy.port, new, timeout_s=10, retries=retries)
        assert proxy.fired
        kit.check_honest(ending, kit.rows_on_disk(device.state), old, new)
        if retries:
            assert ending.code == 0
        assert kit.push(device.port, new, timeout_s=5, retries=PATIENT).code == 0
        assert kit.rows_on_disk(device.state) == kit.offsets_of(new)
        device.kill()
        device.start()
        with Link(Address("127.0.0.1", device.port, 1)) as link:
            assert link.read(at.ACTIVE, 11) == new.header.registers()
        assert kit.push(device.port, new, timeout_s=5).text == "already active"


@pytest.mark.parametrize(("kept", "code"), [(True, 0), (False, 3)])
def test_a_cell_that_lost_its_table_is_told_from_another_writer(tmp_path, kept, code):
    """Restarted after the commit, before it is read back: without its files it has no table at all."""
    device, old, new = kit.offset_device(tmp_path), kit.random_table(1), kit.random_table(2)
    kit.load(device, old)

    def restart() -> None:
        kit.restart(device, device.store if kept else TableStore())

    with Loopback(device) as server, Proxy(server.port, 0) as proxy:
        proxy.arm(Fault("before request", kit.READ_BACK), restart)
        ending = kit.push(proxy.port, new, retries=0)
    assert (proxy.fired, ending.code) == (True, code)
    if code:
        assert ending.finding.code == "CS5014"
        assert ending.text == "the active table is neither this one nor the one before: no table is active (read back)"
        assert "the cell was restarted" in ending.finding.hint
        assert "somebody" not in ending.finding.hint
