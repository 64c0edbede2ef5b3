"""Others on the same cell: another writer in between, two pushes at once, a cell that is killed and restarted."""

import socket
import threading

import numpy as np
import pytest

from compensator.modbus import registers as at
from compensator.modbus.link import Address, Link
from compensator.modbus.registers import Command, Robot
from compensator.modbus.server import Loopback
from compensator.modbus.wire import page_words, split
from tests.compensator.modbus import tables_and_cells as kit
from tests.compensator.modbus.proxy import Fault, Proxy


@pytest.mark.parametrize("request_number", [kit.BEGIN, *kit.PAGES, kit.COMMIT, kit.READ_BACK])
@pytest.mark.parametrize("whole", [True, False])
def test_another_writer_in_between(tmp_path, request_number, whole):
    """It tries a whole transfer, or only begins one; the active table is that of one of the two, and the push says which."""
    cell, old, new, other = kit.machine(tmp_path), kit.table(1), kit.table(2), kit.table(3)
    kit.load(cell, old)
    got = []
    with Loopback(cell) as server, Proxy(server.port, 0) as proxy:
        def interfere() -> None:
            if whole:
                got.append(kit.push(server.port, other, patience_s=0.0).code)
                return
            with Link(Address("127.0.0.1", server.port, 1, kit.TIMEOUT_S, 0)) as link:
                for command in ([Command.BEGIN, *other.header.words()], [Command.COMMIT, *other.header.words()]):
                    try:
                        link.write(at.COMMAND, command)
                    except Exception as reason:
                        got.append(str(reason))

        proxy.arm(Fault("before request", request_number), interfere)
        ending = kit.push(proxy.port, new, timeout_s=2.0, retries=0)
        assert got
        assert proxy.fired
        active = kit.rows_on_disk(tmp_path)
        if ending.code == 0:
            assert active == kit.offsets_of(new)
        else:
            assert (ending.code, active) == (3, kit.offsets_of(other))
            assert f"table {other.header.name} with 90 rows is active (read back)" in ending.text
        assert kit.push(server.port, new, timeout_s=2.0).code == 0
        assert kit.rows_on_disk(tmp_path) == kit.offsets_of(new)


def test_noise_on_the_port_changes_nothing(tmp_path):
    """Random bytes, frames of random length, function and content, and connections left open."""
    cell, old, new = kit.machine(tmp_path), kit.table(1), kit.table(2)
    kit.load(cell, old)
    rng = np.random.default_rng(7)
    with Loopback(cell) as server:
        left_open = []
        for _ in range(60):
            noise = rng.bytes(int(rng.integers(1, 300)))
            function = bytes([int(rng.integers(1, 24))])
            frame = b"\0\1\0\0" + (2 + len(noise)).to_bytes(2, "big") + b"\1" + function + noise
            left_open.append(socket.create_connection(("127.0.0.1", server.port), timeout=2))
            left_open[-1].sendall(noise if rng.integers(2) else frame)
            if rng.integers(2):
                left_open.pop().close()
        assert kit.push(server.port, new, timeout_s=2.0, retries=5, patience_s=5.0).code == 0
        for one in left_open:
            one.close()
    assert kit.rows_on_disk(tmp_path) == kit.offsets_of(new)


def test_two_pushes_at_once_leave_one_of_the_two_tables_whole(tmp_path):
    cell = kit.machine(tmp_path)
    tables = [kit.table(seed, rows=1200) for seed in (1, 2)]
    endings: dict[int, kit.Ending] = {}
    with Loopback(cell) as server:
        threads = [threading.Thread(target=lambda i=i: endings.update({i: kit.push(server.port, tables[i], timeout_s=5,
                                                                                  patience_s=10)})) for i in (0, 1)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30)
    active = kit.rows_on_disk(tmp_path)
    assert active in [kit.offsets_of(one) for one in tables]
    assert 0 in {ending.code for ending in endings.values()}
    for ending in endings.values():
        # 3: the other one committed between this one's commit and its read-back.
        assert ending.code in (0, 3)


def test_a_busy_cell_is_waited_for_and_named(tmp_path):
    cell, old, new = kit.machine(tmp_path, lease_s=60.0), kit.table(1), kit.table(2)
    kit.load(cell, old)
    with Loopback(cell) as server:
        cell.write(at.COMMAND, [Command.BEGIN, *kit.table(3).header.words()])
        ending = kit.push(server.port, new, patience_s=0.2)
        assert ending.code == 4
        assert "busy: another writer's transfer is under way; old table active (read back)" in ending.text
        cell.write(at.COMMAND, [Command.ABORT, *kit.table(3).header.words()])
        cell.write(at.ROBOT, [1, Robot.RUNNING, 0, *split(old.header.id)])
        ending = kit.push(server.port, new, patience_s=0.2)
        assert "busy: the robot is running with the active table; old table active (read back)" in ending.text
        cell.write(at.ROBOT + 1, [Robot.IDLE])
        assert kit.push(server.port, new).code == 0


def test_after_old_table_active_nothing_late_can_commit(tmp_path):
    """The commit is stuck in the network, the push reports the old table, then the commit arrives."""
    cell, old, new = kit.machine(tmp_path), kit.table(1), kit.table(2)
    kit.load(cell, old)
    with Loopback(cell) as server:
        with Link(Address("127.0.0.1", server.port, 1)) as link:
            link.write(at.COMMAND, [Command.BEGIN, *new.header.words()])
            for page in range(3):
                link.write(at.PAGE, page_words(new.header, new.words, page))
        with Proxy(server.port, 0) as proxy:
            # Every commit is refused as busy on its way, so the push gives up.
            proxy.arm(Fault("refuse request", kit.COMMIT, code=6))
            ending = kit.push(proxy.port, new, patience_s=-1.0)
        assert (ending.code, "old table active (read back)" in ending.text) == (4, True)
        with Link(Address("127.0.0.1", server.port, 1, retries=0)) as late, pytest.raises(Exception, match="out of sequence"):
            late.write(at.COMMAND, [Command.COMMIT, *new.header.words()])
    assert kit.rows_on_disk(tmp_path) == kit.offsets_of(old)


@pytest.mark.parametrize(("kind", "request_number", "retries"), [
    ("before request", kit.PAGES[1], 10), ("before request", kit.COMMIT, 0)])
def test_a_killed_and_restarted_cell(tmp_path, kind, request_number, retries):
    old, new = kit.table(1), kit.table(2)
    with kit.CellProcess(tmp_path) as cell, Proxy(cell.port, 0) as proxy:
        assert kit.push(cell.port, old, timeout_s=5).code == 0

        def restart() -> None:
            cell.kill()
            cell.start()

        proxy.arm(Fault(kind, request_number), restart)
        # With no patience for a restart the answer is honest; with it the push gets through.
        ending = kit.push(proxy.port, new, timeout_s=10, retries=retries)
        assert proxy.fired
        kit.check_honest(ending, kit.rows_on_disk(cell.state), old, new)
        if retries:
            assert ending.code == 0
        assert kit.push(cell.port, new, timeout_s=5, retries=10).code == 0
        assert kit.rows_on_disk(cell.state) == kit.offsets_of(new)
        cell.kill()
        cell.start()
        with Link(Address("127.0.0.1", cell.port, 1)) as link:
            assert link.read(at.ACTIVE, 11) == new.header.words()
        assert kit.push(cell.port, new, timeout_s=5).text == "already active"
