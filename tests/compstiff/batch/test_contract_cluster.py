"""`correct --scheduler` and `--shard`: the same bytes as alone, nothing lost with a worker, TLS or this machine alone."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import dask
import pytest
import trustme
from click.testing import Result
from distributed import Client, Future

from compstiff.batch.cluster import standing
from compstiff.batch.pairing import Folders, paired, share_of
from compstiff.batch.processes import in_processes
from compstiff.batch.programs import Shared
from compstiff.batch.running import correct_programs
from tests.compstiff.batch.deadly import Deadly, as_told, dies_at_a
from tests.compstiff.batch.programs import Shop, shop
from tests.support import answers, free_port, processes_in, started


@pytest.fixture
def place(tmp_path: Path) -> Shop:
    return shop(tmp_path)


TLS = ("--tls-ca-file", "--tls-cert", "--tls-key")


@contextmanager
def cluster(folder: Path, workers: int, *, threads: int = 1, tls: tuple[Path, ...] = ()) -> Iterator[str]:
    """A scheduler that listens, with its workers on their way, as one starts them; its address."""
    kind = "tls" if tls else "tcp"
    port = free_port()
    address = f"{kind}://localhost:{port}"
    options = ["--no-dashboard", *(word for pair in zip(TLS, tls, strict=False) for word in pair)]
    with ExitStack() as stack:
        words = stack.enter_context((folder / "dask.txt").open("a"))

        def start(module: str, *more: object) -> None:
            stack.enter_context(started(sys.executable, "-m", f"distributed.cli.{module}", *more, *options, cwd=folder,
                                        stdout=words, stderr=words))

        start("dask_scheduler", "--host", f"{kind}://localhost", "--port", port)
        answers(port)
        if workers:
            start("dask_worker", address, "--nworkers", workers, "--nthreads", threads, "--local-directory", folder / "dask")
        yield address


def on(place: Shop, address: str, *more: object, out: str = "out") -> Result:
    return place.correct(place.source, "-o", f"{place.folder / out}/", "--scheduler", address, "--json", *more)


WORKER, SCHEDULER = b"spawn_main", b"dask_scheduler"


def test_the_same_bytes_and_a_worker_that_dies_takes_nothing_with_it(place: Shop) -> None:
    names = [f"p{number:02}" for number in range(8)]
    place.put(*names)
    out = place.folder / "out"
    out.mkdir()
    batch = paired(sorted(place.source.glob("*.mod")), None, Folders(out))
    with cluster(place.folder, 2) as address:
        results = []
        for result in correct_programs(batch, Shared(place.cell, place.stiffness), scheduler=address):
            if not results:
                os.kill(processes_in(place.folder, WORKER)[0], signal.SIGKILL)
            results.append(result)
        assert [(result.files.program.stem, result.status) for result in results] == [(name, "ok") for name in names]
        alone = place.alone()
        assert all((out / f"{name}.mod").read_bytes() == alone for name in names)
        # Again, over what is there: each says so, none is touched.
        again = on(place, address)
        assert again.exit_code == 1
        assert [[finding["code"] for finding in json.loads(line)["findings"] if finding["level"] == "error"]
                for line in again.stdout.splitlines()] == [["CS0003"]] * len(names)


# Long: a worker that dies takes nothing with it above.
@pytest.mark.long
def test_a_worker_lost_right_after_its_result_came(place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scheduler's word that the data are lost follows the data themselves."""
    place.put("a", "b")
    gather = Client._gather

    async def lost(self: Client, futures: list[Future[object]], *more: object, **named: object) -> object:
        results = await gather(self, futures, *more, **named)
        for future in futures:
            self._handle_lost_data(key=future.key)
        return results

    with cluster(place.folder, 1) as address:
        monkeypatch.setattr(Client, "_gather", lost)
        done = on(place, address)
        assert done.exit_code == 0, done.output
    assert {path.read_bytes() for path in (place.folder / "out").glob("*.mod")} == {place.alone()}


def test_a_scheduler_that_is_lost_is_said_and_the_next_call_completes(place: Shop) -> None:
    names = [f"p{number:02}" for number in range(8)]
    place.put(*names)
    out = place.folder / "out"
    # A process of its own: what people see is also what Dask writes to the terminal.
    call = (sys.executable, "-m", "compstiff", "correct", place.cell, place.source, "--stiffness", place.stiffness,
            "-o", f"{out}/", "--json", "--scheduler")
    with cluster(place.folder, 1) as address, started(
            *call, address, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as called:
        assert called.stdout is not None
        assert json.loads(called.stdout.readline())["status"] == "ok"
        os.kill(processes_in(place.folder, SCHEDULER)[0], signal.SIGKILL)
        told, words = called.communicate(timeout=300)
    assert called.returncode == 1
    *written, last = map(json.loads, told.splitlines())
    assert [(one["code"], one["message"]) for one in last["findings"]] == [
        ("CS6046", f"was lost: {1 + len(written)} of 8 programs were dealt with")]
    assert "Traceback" not in words
    assert {path.read_bytes() for path in out.glob("*.mod")} == {place.alone()}
    with cluster(place.folder, 1) as address:
        done = on(place, address, "--force")
        assert done.exit_code == 0, done.output
    assert sorted(path.stem for path in out.glob("*.mod")) == names


def test_over_tls_and_nobody_else(place: Shop, tmp_path: Path) -> None:
    place.put("a")
    authority, files = trustme.CA(), [tmp_path / name for name in ("ca.pem", "cert.pem", "key.pem")]
    authority.cert_pem.write_to_path(files[0])

    def certified(by: trustme.CA) -> None:
        leaf = by.issue_cert("localhost")
        leaf.cert_chain_pems[0].write_to_path(files[1])
        leaf.private_key_pem.write_to_path(files[2])

    certified(authority)
    ca, certificate, key = map(str, files)
    with cluster(place.folder, 1, tls=tuple(files)) as address:
        assert code(on(place, address, out="a")) == "CS6041"
        with dask.config.set({"distributed.comm.tls.ca-file": ca, "distributed.comm.tls.client.cert": certificate,
                              "distributed.comm.tls.client.key": key}):
            done = on(place, address)
            assert done.exit_code == 0, done.output
            assert (place.folder / "out" / "a.mod").read_bytes() == place.alone()
            assert code(on(place, address.replace("tls", "tcp"), out="b")) == "CS6042"
            certified(trustme.CA())
            assert code(on(place, address, out="c")) == "CS6042"


def code(done: Result) -> str:
    assert done.exit_code == 1, done.output
    return str(json.loads(done.stdout.splitlines()[-1])["findings"][-1]["code"])


@pytest.mark.parametrize("address", ["tcp://192.0.2.1:8786", "http://localhost:1", "localhost:8786", "tcp://localhost"])
def test_an_open_scheduler_elsewhere_is_not_spoken_to(place: Shop, address: str) -> None:
    place.put("a")
    assert code(on(place, address)) == "CS6041"


def test_what_differs_is_said_before_anything_is_begun(place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    place.put("a")
    here = standing(place.cell, place.stiffness)
    with cluster(place.folder, 1, threads=2) as address:
        threads = on(place, address)
        assert code(threads) == "CS6044"
        assert "2 threads" in threads.stdout
        for wrong, said in (({"has": here["has"] | {"numpy": "1.0"}, "files": here["files"]}, "CS6044"),
                            ({"has": here["has"], "files": {}}, "CS6045")):
            monkeypatch.setattr("compstiff.batch.cluster.standing", Standing(wrong))
            assert code(on(place, address)) == said
    assert not list((place.folder / "out").glob("*"))


@dataclass(frozen=True)
class Standing:
    """Here it says what is wrong; sent to a worker it says what the worker has."""

    wrong: dict[str, object]

    def __call__(self, *files: Path) -> object:
        return self.wrong

    def __reduce__(self) -> object:
        return (_standing, ())


def _standing() -> object:
    return standing


def test_without_a_scheduler_or_a_worker_it_says_so(place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    place.put("a")
    monkeypatch.setattr("compstiff.batch.cluster.PATIENCE", 1.0)
    assert code(on(place, f"tcp://localhost:{free_port()}")) == "CS6042"
    monkeypatch.setattr("compstiff.batch.cluster.PATIENCE", 5.0)
    with cluster(place.folder, 0) as address:
        assert code(on(place, address)) == "CS6043"


def test_without_dask_it_says_what_to_install(place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    place.put("a")
    monkeypatch.setitem(sys.modules, "distributed", None)
    done = on(place, "tcp://localhost:8786")
    assert code(done) == "CS6040"
    assert "compstiff[cluster]" in done.stdout


def test_shards_are_a_partition_that_stays(place: Shop) -> None:
    for number in range(12):
        program, = place.put(f"p{number:02}")
        program.write_bytes(place.part.read_bytes().replace(b"MODULE", b"! number %d\nMODULE" % number, 1))
    folders = []
    for part in (1, 2, 3):
        done = place.correct(place.source, "-o", f"{place.folder / str(part)}/", "--shard", f"{part}/3", "--json")
        assert done.exit_code == 0, done.output
        folders.append({path.name for path in (place.folder / str(part)).glob("*.mod")})
    assert sum(map(len, folders)) == 12
    assert set.union(*folders) == {f"p{number:02}.mod" for number in range(12)}
    assert all(folders)
    # Another name and others gone: still in the same part.
    moved = sorted(folders[0])[0]
    shutil.copy(place.source / moved, place.folder / "x.mod")
    batch = paired([place.folder / "x.mod"], None, Folders(place.folder))
    assert [len(share_of(batch, (part, 3))) for part in (1, 2, 3)] == [1, 0, 0]


@pytest.mark.parametrize("shard", ["0/3", "4/3", "1", "a/b", "-1/-1"])
def test_a_shard_that_is_none(place: Shop, shard: str) -> None:
    place.put("a")
    assert place.correct(place.source, "-o", f"{place.folder / 'out'}/", "--shard", shard).exit_code == 2


def test_a_deadly_program_is_blamed_alone(place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COMPSTIFF_TEST_PROCESS", str(os.getpid()))
    place.put(*"abcdef")
    out = place.folder / "out"
    out.mkdir()
    batch = paired(sorted(place.source.glob("*.mod")), None, Folders(out))
    batch[0] = Deadly(**vars(batch[0]))         # so that another one is under way when its process ends
    results = list(correct_programs(batch, Shared(place.cell, place.stiffness), processes=2))
    assert [result.status for result in results] == ["defect", "ok", "ok", "ok", "ok", "ok"]
    assert [finding.code for finding in results[0].findings] == ["CS6010"]


def test_outputs_that_exist_are_of_this_call_only_where_a_process_was_lost(place: Shop) -> None:
    batch = paired(place.put("a", "b"), None, Folders(place.folder))
    done = in_processes(deque(batch), as_told, 2, lambda: False)
    assert [result for _, result in done] == [("a.mod", False), ("b.mod", False)]


# Long: the deadly program is blamed alone above, and all others are corrected there.
@pytest.mark.long
def test_who_was_under_way_beside_it_is_tried_again(place: Shop) -> None:
    batch = paired(place.put("a", "b", "c"), None, Folders(place.folder))
    done = list(in_processes(deque(batch), dies_at_a, 2, lambda: False))
    assert [result for _, result in done] == [None, "b.mod", "c.mod"]
