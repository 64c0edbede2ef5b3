"""`upload` as a user calls it, on an emulated controller of either generation: what it shows, does, refuses and logs."""

import hashlib
import json
import re

import pytest
from click.testing import CliRunner

from compensator.upload import local_module, session
from compensator.upload.address import Controller
from compensator.upload.upload import Wanted
from compstiff.cli.upload import upload
from tests.compensator.upload import kit
from tests.compensator.upload.emulator import PASSWORD, RobotController
from tests.compensator.upload.fault_runs import allowed


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(session, "LEAST_INTERVAL_S", 0.0)
    monkeypatch.setattr(session, "FIRST_PAUSE_S", 0.002)


@pytest.fixture(params=[1, 2], ids=["IRC5", "OmniCore"])
def controller(request):
    return RobotController(request.param)


@pytest.fixture
def cell(controller, tmp_path):
    with kit.emulated(tmp_path, controller) as described:
        yield described
    assert kit.left_clean(controller)
    assert all(allowed(method, path) for method, path in controller.log), controller.log


def test_dry_run_then_the_file_then_the_module(controller, cell, tmp_path):
    file = kit.write_module(tmp_path)
    path = kit.new_path(file)
    controller.files["HOME/part_corrected-0123456789.mod"] = b"an earlier upload"
    controller.files["HOME/other.mod"] = b"not ours"
    shown = CliRunner().invoke(upload, [str(cell), str(file), "--load", "T_ROB1"], env=kit.ENVIRONMENT)
    assert shown.exit_code == 0, shown.output
    for text in ("system 6660-500123", controller.robotware, f"RWS {controller.generation}.0", "module: Insert", "input.x",
                 "9 targets corrected, largest offset 0.1234 mm", f"new file: {path}", "task T_ROB1: ready",
                 "there now: part_corrected-0123456789.mod, 17 bytes", "would load the module Insert", "dry run"):
        assert text in shown.stdout
    assert "other.mod" not in shown.stdout
    assert len(controller.files) == 2
    assert not (tmp_path / "upload-log.jsonl").exists()

    done = kit.call(cell, file, "--apply")
    assert done.code == 0, done.text
    assert controller.files[path] == file.read_bytes()
    assert "Insert" not in controller.loaded()
    done = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert done.code == 0, done.text
    assert done.document["result"]["already_there"] is True
    assert controller.loaded()["Insert"] == file.read_bytes()
    assert controller.files["HOME/part_corrected-0123456789.mod"] == b"an earlier upload"

    log = [json.loads(line) for line in (tmp_path / "upload-log.jsonl").read_text().splitlines()]
    assert [(line["result"].split(",")[0], line.get("exit_code")) for line in log] == [
        ("started", None), ("uploaded", 0), ("started", None), ("already there", 0)]
    assert all(line["sha256"] == done.document["result"]["sha256"] and line["user"] and line["time"] for line in log)


def test_a_module_that_is_loaded_is_replaced_only_when_asked(controller, cell, tmp_path):
    file = kit.write_module(tmp_path)
    controller.loaded()["INSERT"] = b"old"      # RAPID does not tell upper from lower case
    for arguments in ((), ("--apply",)):
        refused = kit.call(cell, file, *arguments, "--load", "T_ROB1")
        assert (refused.code, refused.codes) == (3, ["CS6116"])
    assert (controller.files, controller.loaded()["INSERT"]) == ({}, b"old")
    controller.loaded()["Insert"] = controller.loaded().pop("INSERT")
    replaced = kit.call(cell, file, "--apply", "--load", "T_ROB1", "--replace")
    assert replaced.code == 0, replaced.text
    assert replaced.document["result"]["results"][1] == "replaced Insert in T_ROB1"
    assert controller.loaded()["Insert"] == file.read_bytes()


@pytest.mark.parametrize(("state", "executing"), [("started", "stopped"), ("ready", "running"), ("blown up", "stopped")])
def test_nothing_is_loaded_while_rapid_executes(controller, cell, tmp_path, state, executing):
    file = kit.write_module(tmp_path)
    controller.tasks["T_ROB1"]["excstate"], controller.executing = state, executing
    dry = kit.call(cell, file, "--load", "T_ROB1")
    assert (dry.code, dry.codes) == (0, ["CS6115"])
    applied = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert (applied.code, applied.codes) == (3, ["CS6115"])
    assert controller.files == {}
    assert kit.call(cell, file, "--apply").code == 0        # the file alone goes


def test_rapid_that_starts_between_the_look_and_the_load_is_seen(controller, cell, tmp_path, monkeypatch):
    from compensator.upload import remote

    file = kit.write_module(tmp_path)
    asked = remote.Remote.mastership

    def started(self):
        controller.executing = "running"
        return asked(self)

    monkeypatch.setattr(remote.Remote, "mastership", started)
    refused = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert (refused.code, refused.codes) == (3, ["CS6115"])
    assert "Insert" not in controller.loaded()


def test_no_mastership_no_load_and_the_file_stays(controller, cell, tmp_path):
    file = kit.write_module(tmp_path)
    controller.holder = "other"
    refused = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert (refused.code, refused.codes) == (3, ["CS6117"])
    assert "Requested resource is held by someone else" in refused.message
    assert "the new file is there, whole (read back), nothing was loaded" in refused.message
    assert (controller.holder, list(controller.files)) == ("other", [kit.new_path(file)])


def test_robotware_8_takes_the_file_and_is_not_loaded(tmp_path):
    controller, file = RobotController(2, robotware="8.1.1+614"), kit.write_module(tmp_path)
    with kit.emulated(tmp_path, controller) as cell:
        refused = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert (refused.code, refused.codes) == (3, ["CS6123"])
    assert list(controller.files) == [kit.new_path(file)]


def test_what_is_refused_before_anything_is_sent(controller, cell, tmp_path):
    file = kit.write_module(tmp_path)
    controller.files[kit.new_path(file)] = b"somebody changed it"
    assert kit.call(cell, file, "--apply").codes == ["CS6111"]
    text = cell.read_text()

    def refused(more: str, *arguments: object) -> tuple[int, list[str], str]:
        """With a dry run it is the same."""
        cell.write_text(text.replace("host:", f"{more}host:"))
        endings = [kit.call(cell, file, "--name", "a.mod", *arguments, *apply) for apply in ((), ("--apply",))]
        assert endings[0].message == endings[1].message
        assert endings[0].code == endings[1].code
        return endings[1].code, endings[1].codes, endings[1].message

    for task in ("T_ROB9", "t_rob1"):
        assert refused("", "--load", task) == (3, ["CS6114"], f"the controller has no task '{task}'")
    code, codes, said = refused("folder: HOME/nowhere, ")
    assert (code, codes) == (3, ["CS6122"])
    assert re.fullmatch(r"the controller has no folder HOME/nowhere \(.*40[04].*\); nothing was sent", said)
    code, codes, said = refused("system: another, ")
    assert (code, codes) == (3, ["CS6121"])
    assert "is the system '6660-500123', the cell states controller.system 'another'; nothing was sent" in said
    cell.write_text(text.replace("host:", "system: 6660-500123, folder: HOME/milling, host:"))
    assert controller.files == {kit.new_path(file): b"somebody changed it"}
    assert kit.call(cell, file, "--apply", "--name", "Part_1.MOD").code == 0
    assert controller.files["HOME/milling/Part_1.MOD"] == file.read_bytes()


def test_a_wrong_password_is_refused_once_and_never_shown(controller, cell, tmp_path, caplog):
    file, wrong = kit.write_module(tmp_path), "not-the-password-4711"
    controller.logins.clear()
    with caplog.at_level("DEBUG"):
        refused = kit.call(cell, file, "--apply", environment={"COMPSTIFF_CONTROLLER_PASSWORD": wrong})
        assert kit.call(cell, file, "--apply", "--load", "T_ROB1").code == 0
    assert (refused.code, refused.codes) == (3, ["CS6106"])
    said = refused.text + "".join(path.read_text(errors="replace") for path in tmp_path.iterdir())
    for secret in (wrong, PASSWORD):
        assert secret not in said
        assert secret not in "".join(record.getMessage() for record in caplog.records if not record.name.startswith("httpcore"))


def test_no_password_no_call(controller, cell, tmp_path):
    controller.logins.clear()
    missing = kit.call(cell, kit.write_module(tmp_path), "--apply", environment={"COMPSTIFF_CONTROLLER_PASSWORD": None})
    assert (missing.code, missing.codes, controller.logins) == (1, ["CS6105"], [])


def test_a_session_is_used_for_a_whole_upload_and_always_given_back(controller, cell, tmp_path):
    """With room for a single session every upload still goes through, four times."""
    controller.most_sessions = 1
    for number in range(4):
        file = kit.write_module(tmp_path, f"p{number}.mod")
        assert kit.call(cell, file, "--apply", "--load", "T_ROB1", "--replace").code == 0
    controller.holder, controller.tasks["T_ROB1"]["modules"] = "other", {}
    for _ in range(3):
        assert kit.call(cell, kit.write_module(tmp_path), "--apply", "--load", "T_ROB1").codes == ["CS6117"]


def test_a_controller_that_is_full_is_waited_for_and_then_reported(controller, cell, tmp_path):
    controller.sessions, controller.most_sessions = {"a", "b"}, 2
    full = kit.call(cell, kit.write_module(tmp_path), "--apply", "--retries", 1)
    controller.sessions.clear()
    assert (full.code, full.codes) == (4, ["CS6109"])
    assert "503" in full.message


def test_passing_errors_are_asked_again_and_others_are_not(controller, cell, tmp_path):
    file = kit.write_module(tmp_path)
    root = "$HOME" if controller.generation == 1 else "HOME"
    part = ("PUT", f"/fileservice/{root}/{kit.new_path(file)[5:]}.part")
    controller.sick = {part: [503, 500]}
    assert kit.call(cell, file, "--apply").code == 0
    assert controller.log.count(part) == 3
    other = kit.write_module(tmp_path, "other.mod")
    part = ("PUT", f"/fileservice/{root}/{kit.new_path(other)[5:]}.part")
    controller.sick, controller.log = {part: [403, 200]}, []
    refused = kit.call(cell, other, "--apply")
    assert (refused.code, refused.codes) == (3, ["CS6113"])
    assert "out of order" in refused.message
    assert "the new file is not there" in refused.message
    assert controller.log.count(part) == 1


def release_of(controller) -> tuple[str, str]:
    """The request that gives mastership back."""
    return "POST", "/rw/mastership/" + ("rapid?action=release" if controller.generation == 1 else "edit/release")


def load_of(controller) -> tuple[str, str]:
    """The request that loads a module."""
    return "POST", "/rw/rapid/tasks/T_ROB1" + ("?action=loadmod" if controller.generation == 1 else "/loadmod")


@pytest.mark.parametrize(("failures", "codes"), [(1, []), (2, ["CS6119"])])
def test_a_logout_that_is_not_confirmed_is_told(controller, cell, tmp_path, failures, codes):
    """With one repetition: the second failure is one too many. What was asked for is done all the same."""
    file = kit.write_module(tmp_path)
    controller.sick = {("GET", "/logout"): [503] * failures}
    done = kit.call(cell, file, "--apply", "--retries", 1)
    controller.sessions.clear()
    assert (done.code, done.codes, controller.files[kit.new_path(file)]) == (0, codes, file.read_bytes())
    assert [finding["level"] for finding in done.document["findings"]] == ["warning"] * len(codes)
    assert ("127.0.0.1" in done.message) == ("did not confirm the logout" in done.message) == bool(codes)


@pytest.mark.parametrize(("failures", "codes"), [(3, []), (4, ["CS6124"])])
def test_mastership_that_may_still_be_held_is_told(controller, cell, tmp_path, failures, codes):
    """With one repetition it is asked twice in each of two rounds."""
    file = kit.write_module(tmp_path)
    controller.sick = {release_of(controller): [503] * failures}
    done = kit.call(cell, file, "--apply", "--load", "T_ROB1", "--retries", 1)
    assert (done.code, done.codes, controller.loaded()["Insert"]) == (0, codes, file.read_bytes())
    assert (controller.holder is not None) == bool(codes)
    assert ("did not confirm that mastership was given back" in done.message) == bool(codes)
    controller.holder = None


@pytest.mark.parametrize(("failures", "codes"), [(3, ["CS6115"]), (4, ["CS6115", "CS6124"])])
def test_mastership_that_may_still_be_held_is_told_where_nothing_was_loaded(
    controller, cell, tmp_path, monkeypatch, failures, codes
):
    """RAPID starts after the look."""
    from compensator.upload.remote import Remote

    request = Remote.mastership

    def started(self):
        controller.executing = "running"
        return request(self)

    monkeypatch.setattr(Remote, "mastership", started)
    controller.sick = {release_of(controller): [503] * failures}
    done = kit.call(cell, kit.write_module(tmp_path), "--apply", "--load", "T_ROB1", "--retries", 1)
    assert (done.code, done.codes, "Insert" in controller.loaded()) == (3, codes, False)
    controller.holder = None


def test_a_load_that_is_not_confirmed_is_told_with_what_may_be_loaded(controller, cell, tmp_path):
    """The controller says that it loads a module and does not list it; then it fails while it exchanges one, and says only in
    the end that it did not."""
    file, load = kit.write_module(tmp_path), load_of(controller)
    controller.sick = {load: [200]}
    done = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert (done.code, done.codes, "Insert" in controller.loaded()) == (4, ["CS6118"], False)
    assert done.message == ("loading was not confirmed (the controller does not list Insert in T_ROB1); the new file is there, "
                            "whole (read back); state unknown: the module may be loaded or not, whole")
    assert "--replace" in done.document["findings"][0]["hint"]
    controller.loaded()["Insert"] = b"MODULE Insert ENDMODULE"
    again = (cell, file, "--apply", "--load", "T_ROB1", "--replace")
    for status, ending in ((503, (4, ["CS6118"])), (403, (3, ["CS6113"])), (None, (0, []))):
        controller.sick = {load: [status] if status else []}
        done = kit.call(*again)
        assert (done.code, done.codes) == ending
        assert ("state unknown: the module that is loaded is the one before or the new one, whole" in done.message) == (
            done.codes == ["CS6118"])
    assert controller.loaded()["Insert"] == file.read_bytes()


@pytest.mark.parametrize(("of_load", "reason"), [([], "HTTP 503"), ([502], "HTTP 502")])
def test_a_load_after_which_nothing_can_be_seen_is_told_by_its_first_reason(controller, cell, tmp_path, of_load, reason):
    """The tasks are asked for before it, under mastership, and after it."""
    controller.sick = {load_of(controller): [*of_load], ("GET", "/rw/rapid/tasks"): [0, 0, 503]}
    done = kit.call(cell, kit.write_module(tmp_path), "--apply", "--load", "T_ROB1", "--retries", 0)
    assert (done.code, done.codes, "Insert" in controller.loaded()) == (4, ["CS6118"], not of_load)
    assert f"loading was not confirmed ({reason}: " in done.message


class Disk(dict):
    """Files of which one keeps no more than so many bytes; read, a file may come spoilt so many times."""

    def __init__(self, space: int = 1 << 20, ending: str = "", spoilt: int = 0) -> None:
        super().__init__()
        self.space, self.ending, self.spoilt = space, ending, spoilt

    def __setitem__(self, name: str, content: bytes) -> None:
        super().__setitem__(name, content[:self.space])

    def __getitem__(self, name: str) -> bytes:
        content = super().__getitem__(name)
        if self.ending and name.endswith(self.ending) and self.spoilt:
            self.spoilt -= 1
            return content[:-1] + b"?"
        return content


@pytest.mark.parametrize(("missing", "code"), [(0, 0), (1, 4)])
def test_a_file_that_does_not_fit_is_told_and_does_not_get_its_name(controller, cell, tmp_path, missing, code):
    file = kit.write_module(tmp_path)
    controller.files = Disk(len(file.read_bytes()) - missing)
    done = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert (done.code, list(controller.files)) == (code, [] if missing else [kit.new_path(file)])
    if missing:
        [finding] = done.document["findings"]
        assert (finding["code"], "Insert" in controller.loaded()) == ("CS6112", False)
        assert finding["message"] == (f"what is read back of {kit.new_path(file)}.part is not what was sent; the new file is "
                                      "not there, what was there is as it was")
        assert "free some space" in finding["hint"]


def test_what_is_half_written_and_cannot_be_deleted_is_named(controller, cell, tmp_path):
    file = kit.write_module(tmp_path)
    part = f"{kit.new_path(file)}.part"
    controller.files = Disk(10)
    controller.sick = {("DELETE", f"/fileservice/{'$' if controller.generation == 1 else ''}{part}"): [403]}
    done = kit.call(cell, file, "--apply")
    assert (done.codes, list(controller.files)) == (["CS6112"], [part])
    assert done.message.endswith(f"({part} may be left)")
    controller.files.clear()


@pytest.mark.parametrize(("ending", "spoilt", "code"), [(".part", 1, 0), (".part", 2, 4), (".mod", 1, 0), (".mod", 2, 4)])
def test_what_comes_back_spoilt_is_read_once_more(controller, cell, tmp_path, ending, spoilt, code):
    file = kit.write_module(tmp_path)
    controller.files = Disk(ending=ending, spoilt=spoilt)
    done = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert (done.code, done.codes) == (code, ["CS6112"] if code else [])
    assert ("Insert" in controller.loaded()) == (not code)
    assert ("do not load it" in done.text) == (ending == ".mod" and bool(code))
    assert f"what is read back of {kit.new_path(file)}{'.part' * (ending == '.part')} is not" in done.message or not code


def test_the_controller_that_answers_is_named(controller, cell, tmp_path):
    told = kit.call(cell, kit.write_module(tmp_path)).document["result"]["controller"]
    dialect = told.pop("dialect")
    assert told == {"name": controller.system, "robotware": controller.robotware}
    assert str(controller.generation) in dialect


def test_nobody_there(tmp_path):
    file, cell = kit.write_module(tmp_path), kit.cell_yaml(tmp_path, 9)
    dry = kit.call(cell, file, "--retries", 0)
    assert (dry.code, dry.codes, dry.document["result"]["controller"]) == (0, ["CS6110"], None)
    applied = kit.call(cell, file, "--apply", "--retries", 0)
    assert (applied.code, applied.codes) == (4, ["CS6109"])
    assert CliRunner().invoke(upload, [str(cell), str(file), "--replace"], env=kit.ENVIRONMENT).exit_code == 2


def test_a_log_that_cannot_be_written_stops_it(controller, cell, tmp_path):
    stopped = kit.call(cell, kit.write_module(tmp_path), "--apply", "--log", tmp_path / "no" / "log")
    assert (stopped.code, stopped.codes, controller.files) == (1, ["CS0004"], {})


@pytest.mark.parametrize(("content", "name"), [
    (b"no module", "a.mod"), (b"MODULE A\nPROC main()\n", "a.mod"), (kit.module_text() * 2, "a.mod"),
    (kit.module_text(), "a.txt"), (b"! MODULE A\n! ENDMODULE\n", "a.mod"), (kit.module_text() + b"ENDMODULE\n", "a.mod"),
    (b"MODULE A\n" + kit.module_text(), "a.mod"),
])
def test_what_is_not_one_whole_module_is_refused(tmp_path, content, name):
    file = kit.write_module(tmp_path, name, content)
    assert kit.call(kit.cell_yaml(tmp_path, 9), file).codes == ["CS6100"]


@pytest.mark.parametrize("name", ["../x.mod", "a b.mod", "x.exe", "", "x" * 70 + ".mod", "-x.mod", "$HOME.mod"])
def test_a_name_that_leads_elsewhere_is_refused(controller, cell, tmp_path, name):
    refused = kit.call(cell, kit.write_module(tmp_path), "--apply", "--name", name)
    assert refused.codes == (["CS6100"] if name else [])
    assert all("/" not in path.removeprefix("HOME/") for path in controller.files)


@pytest.mark.parametrize("folder", ["HOME/../x", "/etc/../x", "HOME//x", "C:", "HOME/.hidden", ""])
def test_a_folder_that_leads_elsewhere_is_refused(tmp_path, folder):
    cell = kit.cell_yaml(tmp_path, 9, f"folder: '{folder}'")
    assert kit.call(cell, kit.write_module(tmp_path)).codes == ["CS0102"]


def test_the_record_is_held_against_the_module(controller, cell, tmp_path):
    file = kit.write_module(tmp_path)
    file.write_bytes(file.read_bytes().replace(b"v50", b"v80"))
    refused = kit.call(cell, file, "--apply")
    assert (refused.code, refused.codes, controller.files) == (3, ["CS6101"], {})
    taken = kit.call(cell, file, "--apply", "--changed")
    assert (taken.code, taken.codes) == (0, ["CS6101"])
    other = kit.write_module(tmp_path, "b.mod", robot="irb140")
    for changed in (b"", b"! by hand\n"):       # on purpose or not, it is of another robot
        other.write_bytes(other.read_bytes() + changed)
        before = dict(controller.files)
        refused = kit.call(cell, other, "--apply", "--changed")
        assert (refused.code, refused.codes, controller.files) == (3, ["CS6103"], before)
    assert "was corrected for the robot 'irb140', the cell has '" in refused.message
    plain = kit.write_module(tmp_path, "c.mod", record=False)
    assert (kit.call(cell, plain, "--apply").code, kit.call(cell, plain).codes) == (0, ["CS6102"])


def test_a_name_that_belongs_to_another_file_is_told_before_anything_is_sent(controller, cell, tmp_path):
    """Whatever it is called; the same content is there already."""
    file = kit.write_module(tmp_path)
    controller.files["HOME/other.mod"] = b"another's"
    for arguments in ((), ("--apply",)):
        taken = kit.call(cell, file, "--name", "other.mod", *arguments)
        assert (taken.code, taken.codes) == (3, ["CS6111"])
        assert "the controller has another file HOME/other.mod already, 9 bytes" in taken.message
    assert controller.files == {"HOME/other.mod": b"another's"}
    controller.files["HOME/other.mod"] = file.read_bytes()
    there = kit.call(cell, file, "--name", "other.mod").document["result"]
    assert (there["already_there"], [one["file"] for one in there["there"]]) == (True, ["other.mod"])


def test_a_name_that_was_taken_since_the_look_is_not_written_over(controller, cell, tmp_path):
    from compensator.upload.address import Controller
    from compensator.upload.remote import Remote
    from compensator.upload.session import Session
    from compensator.upload.transfer import place
    from identification.common.findings import Refused
    from identification.model.cell import read_cell

    controller.files["HOME/a.mod"] = b"another's"
    with Session(Controller.of(read_cell(cell), PASSWORD)) as opened, pytest.raises(Refused, match="CS6111"):
        place(Remote(opened), "HOME", "a.mod", b"ours")
    assert controller.files == {"HOME/a.mod": b"another's"}


def test_the_record_of_a_real_correction_is_read(controller, cell, tmp_path, sample_inputs):
    from compensator.correction.files import Outputs, correct_files
    from compensator.correction.settings import Settings

    out = tmp_path / "insert_corrected.mod"
    correct_files(sample_inputs, Outputs(out), Settings.of(tare=((0, 2),)), overwrite=False)
    written = json.loads(out.with_name(f"{out.name}.json").read_text())
    done = kit.call(cell, out, "--apply", "--load", "T_ROB1")
    assert (done.code, done.codes) == (0, []), done.text
    record = done.document["result"]["record"]
    assert record["largest_offset_mm"] == written["summary"]["offset_mm"]["largest"] > 0
    assert (record["targets"], record["corrected"]) == (written["summary"]["targets"], written["summary"]["corrected"])
    assert (record["input"], record["forces"]) == ("insert.mod", "insert.forces.parquet")
    assert controller.loaded()[done.document["result"]["module"]] == out.read_bytes()


def test_a_part_of_a_split_program_has_the_record_of_its_main_module(controller, cell, tmp_path):
    main = kit.write_module(tmp_path, "out.mod")
    part = kit.write_module(tmp_path, "out_001.mod", kit.module_text("Part1"), record=False)
    assert kit.call(cell, part).codes == ["CS6102"]
    record = json.loads(main.with_name("out.mod.json").read_text())
    record["parts"] = [{"file": "out_001.mod", "sha256": hashlib.sha256(part.read_bytes()).hexdigest()}]
    main.with_name("out.mod.json").write_text(json.dumps(record))
    assert kit.call(cell, part, "--apply").codes == []
    part.write_bytes(part.read_bytes() + b"! later\r\n")
    assert kit.call(cell, part, "--apply").codes == ["CS6101"]


def test_the_password_typed_at_a_terminal_is_not_echoed(controller, cell, tmp_path, monkeypatch):
    monkeypatch.setattr("click.testing._NamedTextIOWrapper.isatty", lambda self: True)
    done = CliRunner().invoke(upload, [str(cell), str(kit.write_module(tmp_path)), "--apply"], input=f"{PASSWORD}\n",
                              env={"COMPSTIFF_CONTROLLER_PASSWORD": None})
    assert done.exit_code == 0, done.output
    assert "password of Default User at http" in done.stderr
    assert PASSWORD not in done.output
    assert len(controller.files) == 1


def test_ctrl_c_while_it_is_under_way_says_what_is_there(controller, cell, tmp_path, monkeypatch):
    from compensator.upload import remote

    file = kit.write_module(tmp_path)
    renamed = remote.Remote.rename

    def interrupted_after(self, path, name):
        renamed(self, path, name)
        raise KeyboardInterrupt

    def interrupted_before(self, path, name):
        raise KeyboardInterrupt

    monkeypatch.setattr(remote.Remote, "rename", interrupted_before)
    stopped = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert (stopped.code, stopped.codes) == (130, ["CS6120"])
    assert "interrupted; the new file is not there, what was there is as it was, nothing was loaded" in stopped.message
    assert controller.files == {}
    monkeypatch.setattr(remote.Remote, "rename", interrupted_after)
    stopped = kit.call(cell, file, "--apply", "--load", "T_ROB1")
    assert "interrupted; the new file is there, whole (read back), nothing was loaded" in stopped.message
    assert list(controller.files) == [kit.new_path(file)]
    log = [json.loads(line) for line in (tmp_path / "upload-log.jsonl").read_text().splitlines()]
    assert [line.get("exit_code") for line in log] == [None, 130, None, 130]


def test_a_record_is_read_up_to_the_size_of_a_module(tmp_path, monkeypatch):
    """JSON may end in spaces: one byte more than the limit, and it is not read."""
    file = kit.write_module(tmp_path)
    record = file.with_name(f"{file.name}.json")
    monkeypatch.setattr(local_module, "MOST_BYTES", 100_000)
    text = record.read_bytes()
    for size, there in ((100_000, True), (100_001, False)):
        record.write_bytes(text.ljust(size))
        found = local_module.read_module(file, kit.ROBOT)
        assert (found.record is not None) == there
        assert [finding.code for finding in found.findings] == ([] if there else ["CS6102"])


def test_a_script_asks_as_the_command_does():
    """As long and as often; encrypted, and in place of nothing."""
    stated = {option.name: option.default for option in upload.params}
    controller, wanted = Controller("192.0.2.1", "user", "secret"), Wanted()
    assert (controller.timeout_s, controller.retries, controller.url) == (
        stated["timeout"], stated["retries"], "https://192.0.2.1:443")
    assert (wanted.name, wanted.task, wanted.replace, wanted.changed) == (None, None, False, False)
