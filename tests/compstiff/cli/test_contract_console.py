"""What every command promises: exit codes, one JSON document, no traceback, nothing half written."""

import contextvars
import gc
import hashlib
import io
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from compstiff import __main__ as entry
from compstiff import explain_code
from compstiff.cli import console
from compstiff.cli import main as main_module
from compstiff.cli import push as pushing
from compstiff.cli.main import compstiff as group
from compstiff.cli.options import MinSpacing, TargetRange
from compstiff.outcome import Outcome, Session, attempt, document
from identification.common import progress
from identification.common.catalogue import catalogue
from identification.common.files import check_writable, write_whole
from identification.common.findings import CompstiffError, Finding, Refused, error, fold
from tests.support import compstiff_process, started

ROOT = Path(__file__).parents[3]


def run(body, *arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(console.command("try", writes=True)(body), list(arguments))
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize(("raised", "code", "status"), [
    (error("CS0203", "text", file="a.csv", line=3, column=7, hint="mend it"), 1, "failed"),
    (Refused(Finding("CS4107", "error", "too large")), 3, "refused"),
    (KeyboardInterrupt(), 130, "interrupted"),
    (RuntimeError("oops"), 70, "defect"),
])
def test_exit_codes_and_json(raised: BaseException, code: int, status: str) -> None:
    def body(session: Session) -> Outcome:
        raise raised

    assert run(body)[0] == code
    exit_code, stdout, stderr = run(body, "--json")
    document = json.loads(stdout)
    assert (exit_code, document["exit_code"], document["status"]) == (code, code, status)
    assert document["result"] is None
    assert document["findings"]
    assert stderr == ""


def test_messages_follow_the_contract() -> None:
    def body(session: Session) -> Outcome:
        raise error("CS0203", "found 'x', expected a number", file="a.csv", line=3, column=7, hint="mend it")

    _, stdout, stderr = run(body)
    assert stdout == ""
    assert stderr == "a.csv:3:7: error CS0203: found 'x', expected a number\nhint: mend it\n"


def test_a_defect_leaves_a_log_and_no_traceback() -> None:
    def body(session: Session) -> Outcome:
        raise ZeroDivisionError("somewhere deep")

    _, _, stderr = run(body)
    assert "Traceback" not in stderr
    log = re.search(r"log file (\S+)", stderr)
    assert log
    assert "ZeroDivisionError: somewhere deep" in Path(log[1]).read_text()
    Path(log[1]).unlink()


@pytest.mark.parametrize("written", [True, False])
def test_a_result_that_json_cannot_say_is_a_defect_and_one_document(tmp_path: Path, written: bool) -> None:
    """It says whether files are there: they are whole or not there at all."""
    def body(session: Session) -> Outcome:
        if written:
            write_whole({tmp_path / "a.csv": b"new"}, overwrite=True)
        return Outcome({"rms_um": float("nan")}, lines=["rms nan"])

    code, stdout, stderr = run(body, "--json")
    document = json.loads(stdout)
    (found,) = document["findings"]
    assert (code, document["exit_code"], document["status"], found["code"], stderr) == (70, 70, "defect", "CS0070", "")
    assert found["hint"].startswith("what was written before it is whole; " if written else "nothing was written; ")
    Path(found["hint"].rpartition(" ")[2]).unlink()
    assert run(body) == (0, "rms nan\n", "")


@pytest.mark.parametrize(("words", "said"), [([], "a word\n"), (["--quiet"], ""), (["--json"], "")])
def test_what_is_said_on_the_way_is_for_people(words: list[str], said: str) -> None:
    def body(session: Session) -> Outcome:
        session.say("a word")
        return Outcome()

    assert run(body, *words)[2] == said


@pytest.mark.parametrize(("code", "anew", "told"), [(0, False, False), (3, False, True), (3, True, False)])
def test_an_old_output_beside_what_was_refused_is_told(tmp_path: Path, code: int, anew: bool, told: bool) -> None:
    """Of a result that is refused with all that was found; not where the call wrote, or was not refused."""
    old = tmp_path / "offsets.csv"
    old.write_text("old")

    def body(session: Session) -> Outcome:
        check_writable([old], overwrite=True)
        if anew:
            write_whole({tmp_path / "report.html": b"new"})
        return Outcome(exit_code=code)

    assert ("warning CS0014: offsets.csv stands there still" in run(body)[2]) == told


@pytest.mark.parametrize(("count", "told"), [
    (1, "a.csv stands"), (2, "a.csv and b.mod stand"), (3, "a.csv, b.mod and c.html stand")])
def test_all_old_outputs_are_named(tmp_path: Path, count: int, told: str) -> None:
    olds = [tmp_path / name for name in ("a.csv", "b.mod", "c.html")[:count]]
    for old in olds:
        old.write_text("old")

    def body(session: Session) -> Outcome:
        check_writable(olds, overwrite=True)
        return Outcome(exit_code=3)

    assert f"warning CS0014: {told} there still, of an earlier call" in run(body)[2]


def test_findings_fold_and_quiet_keeps_errors() -> None:
    notes = tuple(Finding("CS3011", "note", "same", file="a", line=i) for i in (4, 5, 6))
    assert fold(notes) == (Finding("CS3011", "note", "same", file="a", line=4, count=3),)

    def body(session: Session) -> Outcome:
        return Outcome({"x": 1}, notes, ["done"], "the next step")

    assert run(body) == (0, "done\n", "a:4: note CS3011: same (and 2 more like it)\nnext: the next step\n")
    assert run(body, "-q") == (0, "done\n", "")
    assert len(json.loads(run(body, "--json", "-v")[1])["findings"]) == 3


def test_a_script_is_shown_findings_folded_unless_it_asks() -> None:
    notes = Outcome(findings=tuple(Finding("CS3011", "note", "same", file="a", line=i) for i in (4, 5, 6)))
    assert [len(document(session, notes, "ok", 0)["findings"]) for session in (Session("try"), Session("try", verbose=True))
            ] == [1, 3]
    assert document(Session("try"), Outcome(), "failed", 1)["result"] is None
    assert document(Session("try"), Outcome(), "ok", 0)["result"] == {}
    assert document(Session("try"), Outcome({"a": 1}), "refused", 3)["result"] == {"a": 1}


@pytest.mark.parametrize(("terminal", "words", "shown"), [
    (True, {}, True), (False, {}, False), (True, {"quiet": True}, False), (True, {"as_json": True}, False)])
def test_progress_is_shown_where_a_person_watches(
    monkeypatch: pytest.MonkeyPatch, terminal: bool, words: dict[str, bool], shown: bool
) -> None:
    seen = []

    def body() -> Outcome:
        seen.append(progress.shown.get())
        return Outcome()

    monkeypatch.setattr(sys, "stderr", Terminal(terminal))
    assert contextvars.copy_context().run(attempt, Session("try", **words), body)[1:] == ("ok", 0)
    assert seen == [shown]


class Terminal(io.StringIO):
    """Where something is written to that a person sees, or not."""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


@pytest.mark.parametrize(("terminal", "words", "after", "shown"), [
    (True, {}, 1.1, True), (True, {}, 0.9, False), (False, {}, 9.0, False), (True, {"quiet": True}, 9.0, False),
    (True, {"as_json": True}, 9.0, False)])
def test_pages_of_offsets_are_counted_for_a_person_who_waits(
    monkeypatch: pytest.MonkeyPatch, terminal: bool, words: dict[str, bool], after: float, shown: bool
) -> None:
    """Every tenth and the last, on one line."""
    stream, now = Terminal(terminal), [100.0]
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(pushing.time, "monotonic", lambda: now[0])
    told = pushing._progress(Session("push", **words))
    now[0] += after
    for page in range(1, 24):
        told(page, 23)
    assert stream.getvalue() == ("\rpage 10 of 23\rpage 20 of 23\rpage 23 of 23\n" if shown else "")


def test_wrong_calls_exit_2_with_json_too() -> None:
    assert compstiff_process("identify", "--nonsense").returncode == 2
    missing = compstiff_process("identify", "no.yaml", "no.csv", "-o", "x.json", "--json")
    assert missing.returncode == 2
    assert json.loads(missing.stdout)["findings"][0]["code"] == "CS0002"
    assert compstiff_process("nonsense").returncode == 2


def test_help_and_version() -> None:
    for arguments in (["-h"], ["--help"], ["correct", "-h"], ["--version"]):
        done = compstiff_process(*arguments)
        assert done.returncode == 0
        assert done.stdout


def test_help_starts_fast() -> None:
    """What costs time (numpy, pandas, scipy, jinja2, pymodbus, toppra, pydantic) stays out of the start-up path."""
    slow = ["numpy", "pandas", "scipy", "pymodbus", "toppra", "pydantic", "yaml", "jinja2", "pyarrow"]
    code = f"import sys, compstiff.cli.main; print([m for m in {slow!r} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_a_reader_that_goes_away_is_no_defect() -> None:
    done = subprocess.run(["bash", "-c", f"{sys.executable} -m compstiff explain --json | head -c 10"], capture_output=True,
                          text=True, timeout=300)
    assert done.stdout == '{\n "format'
    assert done.stderr == ""


@pytest.mark.parametrize(("words", "code"), [
    ("robots --json", 0), ("check {cell} --json", 1), ("check none.yaml --json", 2)])
def test_the_exit_code_is_the_outcome_s_where_nobody_reads_on(tmp_path: Path, words: str, code: int) -> None:
    """`head` that has what it wanted, or `true`: what was done is done, and what failed has failed."""
    (tmp_path / "cell.yaml").write_text("robot: nothing\n")
    call = f"{sys.executable} -m compstiff {words.format(cell=tmp_path / 'cell.yaml')}"
    done = subprocess.run(["bash", "-c", f"{call} | true; echo ${{PIPESTATUS[0]}}"], capture_output=True, text=True,
                          timeout=300)
    assert int(done.stdout) == code, done
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr


def test_the_entry_is_a_program_and_a_module() -> None:
    """`python -m compstiff` runs it; to import it does nothing."""
    called = subprocess.run([sys.executable, "-m", "compstiff", "--version"], capture_output=True, text=True, timeout=300)
    assert called.stdout.startswith("compstiff")
    call = "import compstiff.__main__; print('and on')"
    done = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout) == (0, "and on\n"), done


def test_ctrl_c_exits_130(tmp_path) -> None:
    code = ("import sys, time\nfrom compstiff.cli import console\n"
            "def body(session):\n    print('ready', flush=True)\n    time.sleep(30)\n"
            "console.command('wait')(body)(standalone_mode=False)")
    with started(sys.executable, "-c", code, stdout=subprocess.PIPE, text=True, stderr=subprocess.PIPE) as process:
        assert process.stdout
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=300)
    assert process.returncode == 130
    assert "Traceback" not in stderr


@pytest.mark.parametrize(("stated", "threads"), [(None, "1"), ("4", None)])
def test_the_linear_algebra_has_one_thread_unless_its_user_says(
    monkeypatch: pytest.MonkeyPatch, stated: str | None, threads: str | None
) -> None:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "ARROW_DEFAULT_MEMORY_POOL"):
        monkeypatch.setenv(name, "")            # so that all is put back
        monkeypatch.delenv(name)
    if stated:
        monkeypatch.setenv("OMP_NUM_THREADS", stated)
    monkeypatch.setattr(main_module, "main", lambda: None)
    before = gc.get_threshold()
    try:
        entry.run()
    finally:
        gc.set_threshold(*before)
    assert (os.environ.get("OPENBLAS_NUM_THREADS"), os.environ.get("OMP_NUM_THREADS")) == (threads, stated)
    assert os.environ["ARROW_DEFAULT_MEMORY_POOL"] == "system"


@pytest.mark.parametrize(("written", "code"), [([], 130), (["a.mod"], 0)])
def test_ctrl_c_that_nobody_answers_says_whether_files_were_written(written: list[str], code: int) -> None:
    """It reaches the entry while modules are imported, or after the last file: the exit code tells what is there."""
    call = ("import identification.common.files as files, compstiff.cli.main as cli, compstiff.__main__ as entry\n"
            f"files.written.extend({written})\ndef stopped():\n    raise KeyboardInterrupt\n"
            "cli.main = stopped\nentry.run()")
    assert subprocess.run([sys.executable, "-c", call], timeout=300).returncode == code


def test_files_are_written_whole_or_not_at_all(tmp_path) -> None:
    first, second = tmp_path / "a.txt", tmp_path / "missing" / "b.txt"
    first.write_text("old")
    with pytest.raises(CompstiffError, match="CS0004"):
        write_whole({first: b"new", second: b"new"})
    assert first.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt"]
    write_whole({first: b"new"})
    assert first.read_text() == "new"
    with pytest.raises(CompstiffError, match="CS0003.*not overwritten"):
        check_writable([first], overwrite=False)


def test_every_code_has_its_page_and_every_page_its_code() -> None:
    used = set()
    for package in ("identification", "compensator", "compstiff"):
        for path in (ROOT / package).rglob("*.py"):
            used |= set(re.findall(r"\"(CS\d{4})\"", path.read_text()))
    assert used == set(catalogue())
    for page in catalogue().values():
        assert set(page) == {"title", "cause", "effect", "remedy"}
        assert all(page.values())


def test_every_finding_is_named_by_a_test() -> None:
    """What no test names nobody has seen told: of 69 such findings a third said something wrong, or nothing, when they were."""
    tests = [file.read_text(encoding="utf-8") for file in (ROOT / "tests").rglob("*.py")]
    named = {code for text in tests for code in re.findall(r"CS\d{4}", text)}
    assert sorted(set(catalogue()) - named) == []


def test_explain_and_robots() -> None:
    shown = compstiff_process("explain", "cs1010")
    assert shown.returncode == 0
    assert "Negative compliances" in shown.stdout
    assert compstiff_process("explain", "CS9999").returncode == 1
    # As a report has it, and as diagnosis.json has it.
    for words in (("soft", "zone", "of", "joint", "2"), ("soft zone",), ("soft_zone[2]",)):
        assert compstiff_process("explain", *words).stdout.startswith("soft_zone: the gear of joint N is softer")
    listed = json.loads(compstiff_process("robots", "--json").stdout)["result"]["robots"]
    assert {"irb6660-205-1.90", "irb6640-235-2.55", "irb6700-200-2.60", "irb4400-60"} <= {robot["name"] for robot in listed}
    assert {"drive", "serial"} == {robot["load_path"] for robot in listed}


@pytest.mark.parametrize(("words", "said", "hint"), [
    (("CS1O02",), "there is no code or cause 'CS1O02'", "compstiff COMMAND -h explains a command"),
    (("cs0000",), "there is no code 'cs0000'", "near it: CS6000, CS0100, CS0080"),
    (("CS99999",), "there is no code 'CS99999'", "codes look like CS1002"),
    (("hysterisis",), "there is no cause 'hysterisis'", "near it: hysteresis"),
    (("force_x",), "there is no cause 'force_x'", "near it: force_gain, force_curve, force_axis_gain"),
    (("base", "rockin"), "there is no cause 'base rockin'", "near it: base_rocking"),
    (("Verify",), "'Verify' is a command, no finding or cause", "compstiff verify -h explains it")])
def test_what_cannot_be_explained_is_said_with_what_is_near(words: tuple[str, ...], said: str, hint: str) -> None:
    done = CliRunner().invoke(group, ["explain", *words])
    first, second = done.stderr.splitlines()
    assert (done.exit_code, done.stdout, first) == (1, "", f"error CS0009: {said}")
    assert second.startswith("hint: ")
    assert second.endswith(hint)


def test_a_script_is_told_of_a_code_that_is_not() -> None:
    """In any case of its letters there is one; a digit beside it there is none."""
    assert explain_code("cs0009") == {"code": "CS0009", **catalogue()["CS0009"]}
    with pytest.raises(CompstiffError) as stopped:
        explain_code("CS0008x")
    (found,) = stopped.value.findings
    assert (found.code, found.message) == ("CS0009", "there is no code 'CS0008x'")
    near = found.hint.removeprefix("near it: ").split(", ")
    assert len(near) == 3
    assert set(near) < set(catalogue())


def test_readme_and_help_name_the_same_commands() -> None:
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    told = re.search(r"The commands in the order of the work, each with `-h`:(.*?)\. ", readme)
    assert told
    listed = group.list_commands(click.Context(group))
    assert len(listed) > 15
    assert sorted(re.findall(r"`(\w+)`", told[1])) == sorted(listed)


@pytest.mark.parametrize(("words", "said"), [
    (("--gap-um", "50mm"), "found '50mm', expected a number, without its unit: it is in um"),
    (("--gap-um", "0,5"), "found '0,5', expected a number, with a point for the decimals"),
    (("--gap-um", "wide"), "found 'wide', expected a number"), (("--teeth", "4.0"), "found '4.0', expected a whole number"),
    (("--teeth", "4z"), "found '4z', expected a whole number, without its unit"),
    (("--gap-um", "0"), "0.0 is not in the range"),
    (("--widely", "50"), "extra argument (50) ('50' behind --widely, which takes no value)"), (("50",), "extra argument (50)")])
def test_a_wrong_call_says_what_stands_where(words: tuple[str, ...], said: str) -> None:
    """A unit behind its number, a decimal comma, a value behind a switch; the range of a number is said as click says it."""
    def body(session: Session, gap_um: float, teeth: int, widely: bool) -> Outcome:
        return Outcome()

    for decorate in (click.option("--gap-um", type=click.FloatRange(0, min_open=True), default=1.0),
                     click.option("--teeth", type=click.IntRange(1), default=1), click.option("--widely", is_flag=True)):
        body = decorate(body)
    code, _, stderr = run(body, *words)
    assert (code, said in stderr, "which takes" in stderr) == (2, True, "which takes" in said), stderr


def test_a_folder_is_no_file_and_a_range_is_one_of_targets(tmp_path: Path) -> None:
    """A range that was read already stays as it is: click reads a default again."""
    done = CliRunner().invoke(group, ["identify", str(tmp_path), str(tmp_path), "-o", str(tmp_path / "s.json")])
    assert done.exit_code == 2
    assert "is a directory" in done.output
    ranges = TargetRange()
    assert ranges.convert(ranges.convert("3:11", None, None), None, None) == (3, 11)


@pytest.mark.parametrize(("option", "least", "most"), [("--depth-of-cut", 0.01, 100.0), ("--slot-depth", 0.01, 100.0)])
def test_a_depth_is_one_of_a_cut(option: str, least: float, most: float) -> None:
    """[mm]: ten micrometres are a cut, as ten centimetres are; what is beyond is in another unit."""
    command = group.get_command(click.Context(group), "correct")
    assert command is not None
    (given,) = [one for one in command.params if option in one.opts]
    for number in (least, most):
        assert given.type.convert(str(number), given, None) == pytest.approx(1e-3 * number)
    for number in (0.99 * least, 1.01 * most):
        with pytest.raises(click.BadParameter):
            given.type.convert(str(number), given, None)


def test_a_file_that_may_not_be_read_is_a_wrong_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Told before anything is done, whoever asks: a test that runs as root may read all."""
    file = tmp_path / "rows.csv"
    file.write_text("a,b\n")
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode, **named: mode != os.R_OK and may(path, mode, **named))
    done = CliRunner().invoke(group, ["convert", str(file), "-o", str(tmp_path / "other.csv")])
    assert done.exit_code == 2
    assert f"'{file}' is not readable" in done.stderr


S = ("--stiffness", "s.json")
F = ("--forces", "f.csv")
ROBOT = "irb6660-205-1.90"
TOOL = ("--robot", ROBOT, "--tool-tcp", "120,0,250")


@pytest.mark.parametrize(("words", "said"), [
    (("correct", "cell.yaml", "part.mod", "second.mod", *S, *F, "--shard", "1/2", "-o", "out"),
     "--scheduler and --shard are for several programs: these are the modules of one job"),
    (("correct", "cell.yaml", "part.mod", *S, *F, "--scheduler", "tcp://h:1", "-o", "out.mod"),
     "--scheduler and --shard are for several programs, or a folder of them"),
    (("correct", "cell.yaml", "folder", *S, "--predict-force", "s.json", "--stock", "stock.yaml", "-o", "out"),
     "part.stock.yaml (or .npz) beside part.mod"),
    (("correct", "cell.yaml", "part.mod", *S, *F, "--tare", "\u00b2:3", "-o", "out.mod"), "is not a range of targets"),
    (("correct", "cell.yaml", "part.mod", *S, *F, "--tare", "3:2", "-o", "out.mod"), "is not a range of targets"),
    (("correct", "cell.yaml", "folder", *S, *F, "--shard", "3/2", "-o", "out"), "'3/2' is no part K/N"),
    (("correct", "cell.yaml", "folder", *S, *F, "--shard", "half", "-o", "out"), "'half' is no part K/N"),
    (("correct", "cell.yaml", "part.mod", *S, *F, "--tool-x", "1,0", "-o", "out.mod"), "'1,0' is not a direction"),
    (("correct", "cell.yaml", "part.mod", *S, *F, "--tool-x", "0,0,0", "-o", "out.mod"), "'0,0,0' has no direction"),
    (("correct", "cell.yaml", "part.mod", *S, *F, "--tool-x", "1,nan,0", "-o", "out.mod"), "'1,nan,0' has no direction"),
    (("predict", "cell.yaml", "part.mod", *S, *F, "--budget", "-o", "d.csv"), "--budget and --tolerance-um go together"),
    (("predict", "cell.yaml", "part.mod", *S, *F, "--tolerance-um", "50", "-o", "d.csv"), "--budget and --tolerance-um go"),
    (("predict", "cell.yaml", "part.mod", *S, *F, "--depth-of-cut", "3", "-o", "d.csv"), "are for correct, and for --budget"),
    (("predict", "cell.yaml", "part.mod", *S, *F, "--budget", "--tolerance-um", "50", "--first-forces", "f.csv", "-o", "d.csv"),
     "--first-forces needs --logged-with"),
    (("push", "cell.yaml", "off.csv", "--corrwrite"), "--corrwrite belongs to --receiver"),
    (("push", "cell.yaml", "off.csv", "--apply"), "--apply needs --program"),
    (("cutting", "cell.yaml", "part.mod", *F, "--stock", "stock.yaml", "-o", "c.json"), "--forces needs --stiffness."),
    (("cutting", "cell.yaml", "part.mod", *F, "-o", "c.json"), "--forces needs --stock and --stiffness."),
    (("cutting", "cell.yaml", "part.mod", *S, "-o", "c.json"), "are about a log: name it with --forces"),
    (("post", "cell.yaml", "path.apt", "path.csv", "-o", "out.mod"), "posted one by one; only RAPID modules are joined"),
    (("identify", "cell.yaml", "rows.csv", "--also", "motion.csv", "-o", "k.json"), "rows.csv is none"),
    (("diagnose", "cell.yaml", "rows.csv", "--also", "motion.csv", "-o", "k.json"), "rows.csv is none"),
    (("diagnose", "cell.yaml", "motion.csv", "--mend", "m", "-o", "k.json"), "--mend is for load tests"),
    (("design", "cell.yaml", "--axes", "xx", "-o", "p.csv"), "'xx' is not one to three different letters of xyz"),
    (("design", "cell.yaml", "--axes", "w", "-o", "p.csv"), "'w' is not one to three different letters of xyz"),
    (("design", "cell.yaml", "--add", "3", "rows.csv", "--criterion", "C", "--diagnosis", "s.json", "-o", "p.csv"),
     "give one of them"),
    (("design", "cell.yaml", "--add", "3", "rows.csv", "--measurements", "4", "-o", "p.csv"), "--add says how many runs"),
    (("design", "cell.yaml", "--add", "3", "rows.csv", "--preset", "paper", "-o", "p.csv"), "--add says how many runs"),
    (("design", "cell.yaml", "--preset", "paper", "--measurements", "5", "-o", "p.csv"), "--preset paper has five"),
    (("design", "cell.yaml", *F, "-o", "p.csv"), "--forces belongs to --toolpath"),
    (("design", "cell.yaml", "--position", "1", "2", "3", "--box", *"123456", "-o", "p.csv"), "--position and --box exclude"),
    (("design", "cell.yaml", "--diagnosis", "s.json", "-o", "p.csv"), "--diagnosis belongs to --add N MEASUREMENTS"),
    (("design", "cell.yaml", "--dead-weight", "much", "-o", "p.csv"), "--dead-weight takes masses in kg such as 20,40"),
    *((("design", "cell.yaml", "--direction", "free", *more, "-o", "p.csv"), "--direction free loads each pose along a line")
      for more in (("--axes", "xy"), ("--every-axis",), ("--preset", "paper"))),
    *((("design", "cell.yaml", "--dead-weight", "20,40", *more, "-o", "p.csv"), "--dead-weight only pulls down")
      for more in (("--preset", "paper"), ("--every-axis",), ("--axes", "z"), ("--direction", "free"), ("--max-force", "300"))),
    *((("correct", "cell.yaml", "part.mod", "path.apt", *S, *more, "-o", "out"), "name the log of one program: call it")
      for more in (("--other-forces", "f.csv"), ("--first-forces", "f.csv"))),
    (("correct", "cell.yaml", "part.mod", "second.mod", *S, *F, "-o", "out.mod"), "-o names a folder, not 'out.mod'"),
    (("correct", "cell.yaml", "part.mod", *S, "-o", "out.mod"), "there is no force log part.forces.csv (or .parquet) beside"),
    (("correct", "cell.yaml", "part.mod", *S, *F, "--first-forces", "f.csv", "-o", "x.mod"), "--first-forces needs"),
    (("correct", "cell.yaml", "part.mod", *S, *F, "--predict-force", "s.json", "-o", "x.mod"), "--predict-force and --stock"),
    (("correct", "cell.yaml", "part.mod", *S, *F, "--stock", "stock.yaml", "-o", "x.mod"), "--predict-force and --stock"),
    *((("push", "cell.yaml", "off.csv", *more), "--tls-ca, --tls-cert and --tls-key belong together") for more in (
        ("--tls-ca", "s.json"), ("--tls-ca", "s.json", "--tls-key", "s.json"), ("--tls-cert", "s.json", "--tls-key", "s.json"),
        ("--tls-ca", "s.json", "--tls-cert", "s.json"))),
    *((("identify", "cell.yaml", "motion.csv", *more, "-o", "k.json"), "are for measured TCP deflections, not for logs")
      for more in (("--prior", "gaussian"), ("--gamma", "2"), ("--profile",))),
    (("init", "new", "--robot", ROBOT), "Missing option '--tool-tcp': there is no terminal to ask on."),
    (("init", "new"), "Missing option '--robot' and '--tool-tcp'"),
    (("init", "new", *TOOL, "--force-frame", "sensor"), "--force-frame sensor needs --sensor-position."),
    *((("init", "new", *TOOL, *more), "belong to --force-frame sensor.")
      for more in (("--sensor-position", "1,2,3"), ("--sensor-quaternion", "1,0,0,0", "--force-frame", "tool"))),
    *((("init", "new", *TOOL, *more), "--cutter-diameter and --contact belong to --material.")
      for more in (("--cutter-diameter", "10"), ("--contact", "3"))),
    (("init", "new", *TOOL, "--material", "cheese"), "'cheese' is none of "),
    (("init", "new", *TOOL, "--weights", "heavy"), "takes masses in kg such as 20,40"),
    (("init", "new", "--tool-tcp", "120,0"), "is not 3 numbers with commas between them, such as 120,0,250"),
    (("init", "new", "--tool-tcp", "120,0,high"), "is not 3 numbers with commas between them, such as 120,0,250")])
def test_words_that_do_not_go_together_are_a_wrong_call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], said: str
) -> None:
    """Before anything is read or written, with exit code 2 and in one sentence."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    header = {"rows.csv": "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um\n",
              "motion.csv": "time_s,q1_motor_deg,q1_link_deg,tau1_nm\n0,0,0,0\n1,1,1,1\n"}
    for name in ("cell.yaml", "part.mod", "second.mod", "s.json", "f.csv", "off.csv", "stock.yaml", "path.apt", "path.csv",
                 "rows.csv", "motion.csv"):
        (tmp_path / name).write_text(header.get(name, "nothing\n"))
    before = sorted(tmp_path.rglob("*"))
    done = CliRunner().invoke(group, list(words))
    assert (done.exit_code, said in done.stderr.replace("\n", " ")) == (2, True), (done.output, done.exception)
    assert sorted(tmp_path.rglob("*")) == before


def test_how_near_targets_may_stand_is_no_nearer_than_a_twentieth_of_a_millimetre() -> None:
    """With a time behind a colon, or without; none is as near as nothing."""
    kind = MinSpacing()
    assert kind.convert("0.05", None, None) == pytest.approx((0.05e-3, 0.0))
    assert kind.convert("2:15", None, None) == pytest.approx((2e-3, 15e-3))
    for wrong in ("0.049", "1:-1", "x", "1:y"):
        with pytest.raises(click.BadParameter):
            kind.convert(wrong, None, None)


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    """Of the demo, or of what a cell keeps: a wrong call, before anything is made."""
    file = tmp_path / "part.mod"
    file.write_text("MODULE part\nENDMODULE\n")
    done = CliRunner().invoke(group, ["demo", str(file)])
    assert done.exit_code == 2
    assert "is a file" in done.stderr
    done = CliRunner().invoke(group, ["watch", str(file), str(tmp_path / "out"), "--cell", str(file), "--stiffness", str(file)])
    assert done.exit_code == 2
    assert "is a file" in done.stderr


@pytest.mark.parametrize(("option", "value", "said"), [
    ("--width", "2.5", ""), ("--width", "nan", "found 'nan', expected a finite number"), ("--width", "-NaN", "found 'nan'"),
    ("--width", "inf", "found 'inf', expected a finite number"), ("--width", "-inf", "is not in the range x>0"),
    ("--wide", "-2.5", ""), ("--wide", "nan", "found 'nan'"), ("--wide", "-inf", "found '-inf'"),
    ("--corner", "2.5", ""), ("--corner", "nan", "found 'nan'"), ("--corner", "inf", "found 'inf'")])
def test_what_is_no_finite_number_is_in_no_range(option: str, value: str, said: str) -> None:
    """Against NaN no bound holds: a part within a tolerance of NaN had been accepted."""
    taken: list[object] = []

    def body(session: Session, **given: object) -> Outcome:
        taken.append(given)
        return Outcome()

    for decorate in (click.option("--width", type=click.FloatRange(0, min_open=True)), click.option("--wide", type=float),
                     click.option("--corner", type=float, nargs=2, multiple=True)):
        body = decorate(body)
    code, _, stderr = run(body, option, value, *(["1"] if option == "--corner" else []))
    assert (code, len(taken), said in stderr) == (2 if said else 0, 0 if said else 1, True), stderr


def test_a_document_names_the_inputs_that_are_there_by_what_is_in_them(tmp_path: Path) -> None:
    """One that has gone since is left out."""
    (tmp_path / "a.csv").write_bytes(b"target\n")
    session = Session("verify", inputs=[tmp_path / "a.csv", tmp_path / "gone.csv"])
    assert document(session, Outcome(), "ok", 0)["inputs"] == [
        {"file": str(tmp_path / "a.csv"), "sha256": hashlib.sha256(b"target\n").hexdigest()}]
