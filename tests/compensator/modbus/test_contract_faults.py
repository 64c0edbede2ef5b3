"""A share of the fault points of a transfer; benchmarks/modbus.py tries them all."""

import time

import pytest

from compensator.modbus.server import Loopback
from tests.compensator.modbus import tables_and_devices as kit
from tests.compensator.modbus.faults import network_faults
from tests.compensator.modbus.proxy import Proxy

# A sound reply is there by then: a request that is repeated shifts the count.
PATIENT_S = 0.6


def patience_s(port: int) -> float:
    """How long to wait for a reply [s]: five times what a whole transfer takes now, however much else the machine has to do."""
    before = time.monotonic()
    assert kit.push(port, kit.random_table(3), timeout_s=30.0).code == 0
    return max(PATIENT_S, 5 * (time.monotonic() - before))


@pytest.mark.parametrize("phase", ["connect", "page", "CRC", "commit", "reply", "read-back"])
def test_after_a_fault_the_table_is_whole_the_answer_true_and_a_second_push_completes(phase, tmp_path):
    faults = network_faults()[phase]
    share = faults[::max(1, len(faults) // 8)]
    device, old, new = kit.offset_device(tmp_path), kit.random_table(1), kit.random_table(2)
    fired = 0
    with Loopback(device) as server, Proxy(server.port, 0.0) as proxy:
        patient = patience_s(server.port)
        proxy.delay_s = 1.5 * patient
        kit.load(device, old)
        for fault in share:
            proxy.arm(fault)
            ending = kit.push(proxy.port, new, timeout_s=patient)
            kit.check_honest(ending, kit.rows_on_disk(tmp_path), old, new)
            fired += proxy.fired
            again = kit.push(server.port, new, timeout_s=10.0)
            assert again.code == 0, (fault, again)
            assert kit.rows_on_disk(tmp_path) == kit.offsets_of(new)
            old, new = new, old
    assert fired == len(share)
