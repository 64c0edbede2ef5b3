"""Which schedulers are spoken to and which workers are taken, without either: a client that answers as the test says."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import dask
import pytest
from distributed import Client

from compstiff.batch import cluster
from compstiff.batch.cluster import _is_tls, checked, connected, standing
from compstiff.batch.programs import Shared
from identification.common.findings import CompstiffError

HAS = standing()["has"]


@pytest.mark.parametrize(("address", "tls"), [
    ("tls://cell-pc:8786", True), ("tls://192.0.2.1:8786", True), ("tcp://localhost:8786", False), ("tcp://127.0.0.1:1", False),
    ("tcp://[::1]:8786", False), ("tcp://127.3.4.5:8786", False)])
def test_over_tls_or_on_this_machine(address: str, tls: bool) -> None:
    assert _is_tls(address) == tls


@pytest.mark.parametrize(("address", "said"), [
    ("tcp://192.0.2.1:8786", "is open"), ("tcp://cell-pc:8786", "is open"), ("tcp://[2001:db8::1]:8786", "is open"),
    ("tls://cell-pc", "is no address"), ("tls://:8786", "is no address"), ("http://localhost:1", "is no address"),
    ("localhost:8786", "is no address"), ("tls://cell-pc:99999", "is no address")])
def test_an_open_scheduler_of_others_and_what_is_no_address_are_refused(address: str, said: str) -> None:
    with pytest.raises(CompstiffError, match=f"CS6041: {said}"):
        _is_tls(address)


@dataclass
class Workers:
    """As a client of Dask answers for its workers. lost: how often one of them is gone before it answers."""

    answers: dict[str, Any]
    threads: dict[str, int] = field(default_factory=lambda: {"tcp://a:1": 1, "tcp://b:2": 1, "tcp://c:3": 1})
    lost: int = 0
    asked: int = 0

    def wait_for_workers(self, count: int, timeout: float) -> None:
        if not self.threads:
            raise TimeoutError

    def run(self, function: Any, *files: Path, on_error: str) -> dict[str, Any]:
        self.asked += 1
        return {**self.answers, "tcp://b:2": OSError("gone")} if self.asked <= self.lost else self.answers

    def nthreads(self) -> dict[str, int]:
        return self.threads


@pytest.fixture
def shared(tmp_path: Path) -> Shared:
    for name in ("cell.yaml", "stiffness.json"):
        (tmp_path / name).write_text(name)
    return Shared(tmp_path / "cell.yaml", tmp_path / "stiffness.json")


def asked(shared: Shared, workers: Workers) -> int:
    return checked(cast(Client, workers), shared, "tcp://localhost:8786")


def sound(shared: Shared) -> dict[str, Any]:
    return {name: copy.deepcopy(standing(*shared.files)) for name in ("tcp://a:1", "tcp://b:2", "tcp://c:3")}


def test_workers_that_have_what_is_here_are_counted(shared: Shared) -> None:
    assert asked(shared, Workers(sound(shared))) == 3
    assert set(HAS) == {"compstiff", "Python", "numpy", "scipy", "pyarrow", "toppra"}
    assert len(HAS["compstiff"]) == 12


@pytest.mark.parametrize("name", sorted(HAS))
def test_a_worker_with_another_release_is_named(shared: Shared, name: str) -> None:
    """Of the last of three; one that has something more is none other."""
    answers = sound(shared)
    answers["tcp://c:3"]["has"]["pandas"] = "9"
    assert asked(shared, Workers(answers)) == 3
    answers["tcp://c:3"]["has"][name] = "0.1"
    with pytest.raises(CompstiffError) as caught:
        asked(shared, Workers(answers))
    told, = caught.value.findings
    assert (told.code, told.file, told.message) == ("CS6044", "tcp://c:3", f"has {name} 0.1 in place of {HAS[name]}")


def test_a_worker_that_sees_other_files_or_has_threads_is_named(shared: Shared) -> None:
    answers = sound(shared)
    answers["tcp://b:2"]["files"][str(shared.cell)] = "No such file or directory"
    with pytest.raises(CompstiffError, match=f"tcp://b:2: error CS6045: does not see {shared.cell} and {shared.stiffness} as"):
        asked(shared, Workers(answers))
    threads = {"tcp://a:1": 1, "tcp://b:2": 1, "tcp://c:3": 2}
    with pytest.raises(CompstiffError, match="tcp://c:3: error CS6044: has 2 threads"):
        asked(shared, Workers(sound(shared), threads))
    with pytest.raises(CompstiffError, match="CS6043: has no worker"):
        asked(shared, Workers(sound(shared), {}))
    missing = standing(shared.cell / "none")["files"]
    assert list(missing.values()) == ["Not a directory"]


class Gone(Workers):
    """All lost right after they answered."""

    def nthreads(self) -> dict[str, int]:
        return {}


def test_workers_that_are_gone_again_are_waited_for_with_one_program(shared: Shared) -> None:
    """What is handed out to none would never be done."""
    assert asked(shared, Gone(sound(shared))) == 1


@pytest.mark.parametrize("there", [(), ("ca-file",), ("client.cert",)])
def test_over_tls_both_the_authority_and_a_certificate_are_asked_for(there: tuple[str, ...]) -> None:
    names = {f"distributed.comm.tls.{name}": f"{name}.pem" if name in there else None for name in ("ca-file", "client.cert")}
    with dask.config.set(names), pytest.raises(CompstiffError, match="CS6041: needs certificates"), connected("tls://pc:8786"):
        pass


@pytest.mark.parametrize(("lost", "stays"), [(0, True), (4, True), (5, False)])
def test_workers_that_come_back_under_another_address_are_asked_again(
    shared: Shared, monkeypatch: pytest.MonkeyPatch, lost: int, stays: bool
) -> None:
    """A few times, and no longer than one waits for the first of them."""
    waited = list[float]()
    monkeypatch.setattr(cluster.time, "sleep", waited.append)
    if stays:
        assert asked(shared, Workers(sound(shared), lost=lost)) == 3
    else:
        with pytest.raises(CompstiffError, match="CS6043: has workers that do not stay"):
            asked(shared, Workers(sound(shared), lost=lost))
    assert len(waited) == lost
    assert lost * 0.5 <= sum(waited) <= cluster.PATIENCE
