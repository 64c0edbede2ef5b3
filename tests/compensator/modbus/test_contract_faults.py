"""A share of the fault points of a transfer; benchmarks/modbus.py tries them all."""

import pytest

from compensator.modbus.server import Loopback
from tests.compensator.modbus import tables_and_devices as kit
from tests.compensator.modbus.faults import network_faults
from tests.compensator.modbus.proxy import Proxy

# A sound reply is there by then, even where the machine has much else to do: a request that is repeated shifts the count.
PATIENT_S = 0.6


@pytest.mark.parametrize("phase", ["connect", "page", "CRC", "commit", "reply", "read-back"])
def test_after_a_fault_the_table_is_whole_the_answer_true_and_a_second_push_completes(phase, tmp_path):
    faults = network_faults()[phase]
    share = faults[::max(1, len(faults) // 8)]
    device, old, new = kit.offset_device(tmp_path), kit.random_table(1), kit.random_table(2)
    kit.load(device, old)
    fired = 0
    with Loopback(device) as server, Proxy(server.port, 1.5 * PATIENT_S) as proxy:
        for fault in share:
            proxy.arm(fault)
            ending = kit.push(proxy.port, new, timeout_s=PATIENT_S)
            kit.check_honest(ending, kit.rows_on_disk(tmp_path), old, new)
            fired += proxy.fired
            again = kit.push(server.port, new, timeout_s=2.0)
            assert again.code == 0, (fault, again)
            assert kit.rows_on_disk(tmp_path) == kit.offsets_of(new)
            old, new = new, old
    assert fired == len(share)
