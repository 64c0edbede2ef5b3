"""A share of the fault points of an upload, in both generations; benchmarks/upload.py tries them all."""

import pytest

from compensator.upload import session
from tests.compensator.upload.fault_runs import Bench

SHARE = 41


# Long: a module that was not loaded before, on the other generation.
@pytest.mark.parametrize(("replace", "generation"), [
    pytest.param(False, 1, id="load-1", marks=pytest.mark.long), pytest.param(False, 2, id="load-2"),
    pytest.param(True, 1, id="replace-1"), pytest.param(True, 2, id="replace-2")])
def test_after_a_fault_the_file_is_whole_the_answer_true_and_a_second_upload_completes(
    generation, replace, tmp_path, monkeypatch
):
    monkeypatch.setattr(session, "LEAST_INTERVAL_S", 0.0)
    monkeypatch.setattr(session, "FIRST_PAUSE_S", 0.002)
    with Bench(tmp_path, generation, replace=replace) as bench:
        share = bench.all_faults()[5 * generation + replace::SHARE]
        codes = set()
        for fault in share:
            run = bench.run(fault)
            bench.check(fault, run)
            assert bench.proxy.fired, fault
            assert bench.controller.holder is None or fault.kind == "late request", fault
            codes.add(run.code)
            if bench.generation == 1:
                bench.replace_again()
                assert bench.upload(bench.emulator.port).code == 0, fault
                assert bench.controller.loaded()["Insert"] == bench.new
    assert codes == {0, 3, 4}
