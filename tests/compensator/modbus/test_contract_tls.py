"""Modbus/TCP Security: certificates on both sides, and nobody else."""

import ssl
import time

import pytest
import trustme

from compensator.modbus.server import Endpoint, Loopback
from compensator.modbus.tls import TlsFiles
from identification.common.findings import CompstiffError
from identification.model.cell import read_cell
from tests.compensator.modbus import tables_and_devices as kit


@pytest.fixture
def certificates(tmp_path):
    """By name: files of the cell's and the client's side, and of a client that another authority vouches for."""
    made = {}
    for authority, names in (("ours", ("127.0.0.1", "client")), ("theirs", ("stranger",))):
        ca = trustme.CA()
        ca.cert_pem.write_to_path(str(tmp_path / f"{authority}.pem"))
        for name in names:
            own = ca.issue_cert(name)
            own.cert_chain_pems[0].write_to_path(str(tmp_path / f"{name}.pem"))
            own.private_key_pem.write_to_path(str(tmp_path / f"{name}.key"))
            made[name] = TlsFiles(tmp_path / "ours.pem", tmp_path / f"{name}.pem", tmp_path / f"{name}.key")
    return made


def test_a_push_over_tls(tmp_path, certificates):
    (tmp_path / "state").mkdir()
    table = kit.random_table(1, rows=500)
    with Loopback(kit.offset_device(tmp_path / "state"), tls=certificates["127.0.0.1"]) as server:
        ending = kit.push(server.port, table, tls=certificates["client"].context("client"))
        assert (ending.code, ending.text) == (0, "committed")
        assert kit.rows_on_disk(tmp_path / "state") == kit.offsets_of(table)
        # Without TLS, without a certificate, with another authority's: nothing.
        bare = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        bare.load_verify_locations(certificates["client"].ca)
        for context in (None, bare, certificates["stranger"].context("client")):
            before = time.monotonic()
            assert kit.push(server.port, kit.random_table(2), timeout_s=60.0, retries=0, tls=context).code == 4
            assert time.monotonic() - before < 30, "nobody refused it: its time was up"
    assert kit.rows_on_disk(tmp_path / "state") == kit.offsets_of(table)


def test_a_cell_that_knows_its_clients_may_be_open_to_the_network(tmp_path, certificates):
    """Without TLS the same host is warned of (test_contract_command.py)."""
    (tmp_path / "cell.yaml").write_text(f"robot: {kit.ROBOT}\ntool: {{position_mm: [120, 0, 250]}}\n")
    served = kit.served_and_stopped(read_cell(tmp_path / "cell.yaml"), Endpoint("0.0.0.0", 0, 1, certificates["127.0.0.1"]))
    assert [finding.code for finding in served.findings] == ["CS5106"]


def test_a_client_refuses_a_cell_it_cannot_trust(certificates):
    """A certificate of the same authority, but for another host."""
    device = kit.offset_device()
    with Loopback(device, tls=certificates["client"]) as server:
        trusting = certificates["client"].context("client")
        ending = kit.push(server.port, kit.random_table(1), timeout_s=10.0, retries=0, tls=trusting)
    assert (ending.code, device.active) == (4, None)
    assert "certificate verify failed" in ending.text.lower()


def test_files_that_are_no_certificates(tmp_path, certificates):
    good = certificates["client"]
    stranger = certificates["stranger"].key
    for wrong, file, words in (
        (TlsFiles(good.key, good.certificate, good.key), good.key, "is not a certificate authority in PEM"),
        (TlsFiles(good.ca, good.key, good.key), good.key, f"is not a certificate in PEM that belongs to {good.key}"),
        (TlsFiles(good.ca, good.certificate, stranger), good.certificate,
         f"is not a certificate in PEM that belongs to {stranger}"),
    ):
        for side in ("client", "server"):
            with pytest.raises(CompstiffError) as stopped:
                wrong.context(side)
            (found,) = stopped.value.findings
            assert (found.code, found.file, found.message.partition(": ")[0]) == ("CS5105", str(file), words)
    assert good.context("server").verify_mode == ssl.CERT_REQUIRED
