"""A foreign client, PyPI abb-robot-client, on the same emulator: what it writes we see, what we write it reads (RWS 1.0)."""

import pytest
from abb_robot_client.rws import RWS

from compensator.upload import session
from tests.compensator.upload import kit
from tests.compensator.upload.emulator import PASSWORD, USER, RobotController


@pytest.fixture
def cell_and_client(tmp_path, monkeypatch):
    monkeypatch.setattr(session, "LEAST_INTERVAL_S", 0.0)
    controller = RobotController(1, cookie_domain="")
    with kit.emulated(tmp_path, controller) as cell:
        port = cell.read_text().split("port: ")[1].split(",")[0]
        client = RWS(f"http://127.0.0.1:{port}", USER, PASSWORD)
        yield cell, client
        client.close()
    assert kit.left_clean(controller)


def test_it_reads_what_we_upload_and_sees_the_same_tasks(cell_and_client, tmp_path):
    cell, client = cell_and_client
    file = kit.write_module(tmp_path)
    assert kit.call(cell, file, "--apply", "--load", "T_ROB1").code == 0
    name = kit.new_path(file).removeprefix("HOME/")
    assert name in client.list_files("$HOME")
    assert client.read_file(f"$HOME/{name}") == file.read_bytes()
    tasks = client.get_tasks()
    assert {task: state.excstate for task, state in tasks.items()} == {"T_ROB1": "ready", "T_BCK": "started"}
    assert client.get_execution_state().ctrlexecstate == "stopped"


def test_what_it_uploaded_under_our_name_is_there_already_or_refused(cell_and_client, tmp_path):
    cell, client = cell_and_client
    file = kit.write_module(tmp_path)
    path = f"${kit.new_path(file)}"
    client.upload_file(path, file.read_bytes())
    done = kit.call(cell, file, "--apply")
    assert (done.code, done.document["result"]["already_there"]) == (0, True)
    client.upload_file(path, b"MODULE X\nENDMODULE\n")
    assert kit.call(cell, file, "--apply").codes == ["CS6111"]
    client.delete_file(path)
    assert kit.call(cell, file, "--apply").code == 0
