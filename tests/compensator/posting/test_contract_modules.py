"""Modules of one job: which are not joined, which are not written apart, and what is said of a job without one main."""

from __future__ import annotations

from pathlib import Path

import pytest

from compensator.posting.modules import separate
from identification.common.findings import CompstiffError
from tests.compensator.correction.virtual_job import CELL, job, there_and_back
from tests.compensator.rapid.small_programs import target
from tests.runs.command_line import user_files as kit

LISTED = "<Program><Module>{}</Module><Module>{}</Module></Program>"


def module(name: str, routine: str, comment: str = "") -> str:
    return f"MODULE {name}\n{comment}PROC {routine}()\n    MoveL {target(800)},v20,fine,tool0;\nENDPROC\nENDMODULE\n"


MILL = "! fr\xe4sen\n"
MAIN, WAY = module("Main", "main"), module("Way", "rWay")


def posted(folder: Path, files: dict[str, str | bytes], *options: object) -> kit.Run:
    """The files of a job joined by `compstiff post`; a .pgf is named alone."""
    (folder / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n")
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    named = [name for name in files if name.endswith(".pgf")] or list(files)
    return kit.run("post", folder / "cell.yaml", *(folder / name for name in named), "-o", folder / "job.mod", "--json",
                   *options)


@pytest.mark.parametrize(("files", "options", "file", "words"), [
    ({"main.mod": MAIN, "way.apt": "GOTO/0,0,0\n"}, (), "way.apt", "'.apt' is no RAPID module"),
    ({"main.mod": MAIN, "two.mod": WAY + module("Other", "rOther")}, (), "two.mod", "holds 2 modules, expected one"),
    ({"main.mod": MAIN, "none.mod": "! nothing\n"}, (), "none.mod", "holds 0 modules, expected one"),
    ({"main.mod": MAIN, "old.mod": "! compstiff module: way.mod\n" + WAY}, (), "old.mod", "was joined already"),
    ({"main.mod": MAIN, "more/Main.mod": WAY}, (), "more/Main.mod", "has the name of {folder}/main.mod"),
    ({"main.mod": MAIN, "a.mod": module("A", "rA", MILL), "b.mod": module("B", "rB", MILL).encode("latin-1")}, (),
     "a.mod", "is UTF-8, and {folder}/b.mod is Latin-1"),
    ({"main.mod": MAIN, "way.mod": WAY}, ("--split", "5"), None, "modules are joined as they are"),
    ({"main.mod": MAIN, "way.mod": WAY}, ("--mark", "doCut"), None, "modules are joined as they are"),
    ({"job.pgf": "<Program><Module>main.mod</Program>"}, (), "job.pgf", "is no program file: mismatched tag"),
    ({"job.pgf": "<Program></Program>"}, (), "job.pgf", "lists no module"),
])
def test_modules_that_cannot_be_joined(
    tmp_path: Path, files: dict[str, str | bytes], options: tuple[str, ...], file: str | None, words: str
) -> None:
    """The file that is in the way is named, and nothing is written."""
    run = posted(tmp_path, files, *options)
    assert run.code == 1
    (found,) = run.json["findings"]
    assert (found["code"], found["level"]) == ("CS4350", "error")
    assert found["file"] == (str(tmp_path / file) if file else None)
    assert found["message"].startswith(words.format(folder=tmp_path))
    assert found["hint"]
    assert not (tmp_path / "job.mod").exists()


@pytest.mark.parametrize("files", [
    {"main.mod": MAIN, "way.mod": WAY}, {"main.mod": MAIN, "way.prg": WAY}, {"main.mod": MAIN, "more/main2.mod": WAY},
    {"main.mod": module("Main", "main", MILL), "way.mod": module("Way", "rWay", MILL)},
    {"main.mod": module("Main", "main", MILL).encode("latin-1"), "way.mod": WAY},
    {"main.mod": MAIN, "way.mod": WAY, "job.pgf": LISTED.format("main.mod", "way.mod")}])
def test_modules_that_can_be_joined(tmp_path: Path, files: dict[str, str | bytes]) -> None:
    run = posted(tmp_path, files)
    assert run.code == 0, run
    assert run.json["result"]["targets"] == 2
    assert not {"CS4350", "CS4352"} & kit.codes(run)


@pytest.mark.parametrize(("files", "file", "words"), [
    ({"way.mod": WAY, "other.mod": module("Other", "rOther")}, "other.mod", "no module has the routine main: which routine is "
     "driven first, and in which order, cannot be told"),
    ({"way.mod": WAY, "main.mod": MAIN, "again.mod": module("Again", "Main").replace("PROC", "LOCAL PROC")},
     "again.mod", "main.mod and again.mod have a routine main each: a task has one")])
def test_a_job_without_one_main_is_joined_with_a_warning(
    tmp_path: Path, files: dict[str, str | bytes], file: str, words: str
) -> None:
    run = posted(tmp_path, files)
    assert run.code == 0, run
    assert (tmp_path / "job.mod").exists()
    (found,) = (one for one in run.json["findings"] if one["code"] == "CS4352")
    assert (found["level"], found["file"], found["message"]) == ("warning", str(tmp_path / file), words)
    assert found["hint"] == "join all modules of the task, and no others"


@pytest.mark.parametrize(("content", "file", "words"), [
    (MAIN, "out.mod", "--modules writes each module in a file of its own, and the program is one module"),
    (WAY + MAIN, "Way.mod", "would be written twice: the module Way.mod and the one with main"),
    (WAY + WAY + MAIN, "out.mod", "would be written twice: the module Way.mod and another of its name"),
    ("! compstiff module: a.mod\n" + MAIN + "! compstiff module: b.mod\n" + WAY, "b.mod",
     "would be written twice: the module b.mod and the one with main")])
def test_modules_that_cannot_be_written_one_by_one(tmp_path: Path, content: str, file: str, words: str) -> None:
    with pytest.raises(CompstiffError) as stopped:
        separate(content.encode(), tmp_path / file)
    (found,) = stopped.value.findings
    assert (found.code, found.level) == ("CS4351", "error")
    assert found.message.startswith(words)
    assert found.file == str(tmp_path / (file if "another" not in words else "Way.mod"))


def test_modules_of_other_names_are_written_one_by_one(tmp_path: Path) -> None:
    assert sorted(file.name for file in separate((WAY + MAIN).encode(), tmp_path / "out.mod")) == ["Way.mod", "out.mod"]


def test_one_module_is_not_corrected_as_several(tmp_path: Path) -> None:
    inputs = job(tmp_path / "job", there_and_back(), cell_text=CELL)
    run = kit.run("correct", inputs.cell, inputs.toolpath, "--stiffness", inputs.stiffness, "--forces", inputs.forces,
                  "--modules", "-o", tmp_path / "out.mod", "--json")
    assert run.code == 1
    assert [(one["code"], one["file"]) for one in run.json["findings"] if one["level"] == "error"] == [
        ("CS4351", str(tmp_path / "out.mod"))]
    assert not (tmp_path / "out.mod").exists()
