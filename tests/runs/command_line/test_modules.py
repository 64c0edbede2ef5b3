"""A job of several modules with one log of all of it: a main program that calls routines in the files beside it."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from compensator.posting.modules import separate
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import IRB6660, TOOL, K, Path3
from tests.runs.command_line.test_several_positions import OTHER, POINTS, deviations, log, moves, only_the_first_ten
from tests.runs.command_line.user_files import Job

PATH = Path3(POINTS)
HEAD = kit.module([]).split("PROC")[0].rstrip()
CUTS = np.array([90.0, -50, 160])


def main(call: str = "rWay;") -> str:
    """A cut, a routine of another file, and another cut."""
    return f"{HEAD}\nPROC main()\n{moves(PATH.text[:10])}    {call}\n{moves(PATH.text[20:])}ENDPROC\nENDMODULE\n"


def routine(name: str, targets: list[str], module: str = "Way") -> str:
    return f"MODULE {module}\nPROC {name}()\n{moves(targets)}ENDPROC\nENDMODULE\n"


def meant(k: int, force: np.ndarray) -> np.ndarray:
    return kit.deviation(IRB6660, PATH.q[k], TOOL.p, np.r_[force, 0, 0, 0], K) * 1e6


@pytest.mark.parametrize("text", [
    routine("rWay", PATH.text[10:20]),
    f"MODULE Way\r\nLOCAL PROC rInner()\r\n{moves(PATH.text[10:20])}ENDPROC\r\nproc RWAY()\r\n  rInner;\r\nendproc\r\n"
    "ENDMODULE\r\n"])
def test_forces_behind_a_routine_of_the_file_beside_do_not_land_on_other_targets(tmp_path: Path, text: str) -> None:
    """It is given nothing, and drives: the file beside the program shows it."""
    (tmp_path / "way.mod").write_bytes(text.encode())
    result = Job(tmp_path, program=main(), forces=log(PATH)).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert {"CS2016", "CS3124"} <= kit.codes(result)
    said = next(finding for finding in result.json["findings"] if finding["code"] == "CS2016")
    assert "way.mod" in said["message"]
    assert "compstiff post CELL part.mod way.mod -o job.mod" in said["hint"]
    only_the_first_ten(tmp_path, PATH)


def test_a_routine_beside_that_does_not_drive_is_no_matter(tmp_path: Path) -> None:
    (tmp_path / "way.mod").write_text("MODULE W\nPROC rWay()\n  Set doSpindle;\nENDPROC\nPROC rOther()\n"
                                      f"{moves(PATH.text[10:20])}ENDPROC\nENDMODULE\n")
    result = Job(tmp_path, program=main(), forces=log(PATH, True)).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert not {"CS2016", "CS3124", "CS3007"} & kit.codes(result)
    np.testing.assert_allclose(deviations(tmp_path)[15], meant(25, OTHER), atol=0.5)


def test_a_log_that_goes_on_is_told_which_routine_nobody_holds(tmp_path: Path) -> None:
    result = Job(tmp_path, program=main("rWay;\n    SingArea\\Wrist;\n    ConfL\\Off;"), forces=log(PATH)).correct("--json")
    said = next(finding for finding in result.json["findings"] if finding["code"] == "CS3007")
    assert said["level"] == "warning"
    assert "rWay (line 15)" in said["hint"]
    assert "SingArea" not in said["hint"]
    assert "ConfL" not in said["hint"]


def joined(folder: Path, *files: str) -> None:
    run = kit.run("post", folder / "cell.yaml", *(folder / file for file in files), "-o", folder / "job.mod")
    assert run.code == 0, run


def corrected(folder: Path, program: str, output: str, *options: object) -> kit.Run:
    return kit.run("correct", folder / "cell.yaml", folder / program, "--stiffness", folder / "stiffness.json", "--forces",
                   folder / "forces.csv", "--json", "-o", folder / output, *options)


@pytest.mark.parametrize("order", [("part.mod", "way.mod"), ("way.mod", "part.mod"), ("job.pgf",)])
def test_the_modules_of_a_job_are_corrected_by_one_log(tmp_path: Path, order: tuple[str, ...]) -> None:
    """Joined, placed, corrected, and written as the modules that they were."""
    Job(tmp_path, program=main(), forces=log(PATH)).write()
    (tmp_path / "way.mod").write_text(routine("rWay", PATH.text[10:20]))
    (tmp_path / "job.pgf").write_text("<?xml version=\"1.0\" encoding=\"ISO-8859-1\" ?>\n<Program>\n<Module>part.mod</Module>\n"
                                      "<Module>way.mod</Module>\n</Program>\n")
    joined(tmp_path, *order)
    (tmp_path / "out").mkdir()
    run = corrected(tmp_path, "job.mod", "out/part.mod", "--modules", "--keep-targets", "--offsets", tmp_path / "offsets.csv")
    assert run.code == 0, run
    assert not {"CS2016", "CS3124", "CS3007"} & kit.codes(run)
    # Where a target stands is told in the file that its user has.
    forced = [finding for finding in run.json["findings"] if finding["code"] == "CS4115" or finding["target"] is not None]
    assert forced
    for finding in forced:
        line = (tmp_path / Path(finding["file"]).name).read_text().splitlines()[finding["line"] - 1]
        assert finding["file"] in ("part.mod", "way.mod"), finding
        assert line.lstrip().startswith("Move"), finding
    first = 10 if order[0] == "way.mod" else 0              # targets count in the order of the files
    np.testing.assert_allclose(deviations(tmp_path)[first + 15], meant(25, OTHER), atol=0.5)
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["part.mod", "part.mod.json", "way.mod"]
    numbers = re.compile(kit.NUMBER)
    for name in ("part.mod", "way.mod"):
        written, planned = ((folder / name).read_text() for folder in (tmp_path / "out", tmp_path))
        assert numbers.sub("0", written) == numbers.sub("0", planned)
        assert (written != planned) == (name == "part.mod")     # the way was driven without force
    again = corrected(tmp_path, "out/way.mod", "again.mod")
    assert again.code == 3
    assert "CS4204" in kit.codes(again)


def test_modules_come_back_as_they_were(tmp_path: Path) -> None:
    """Byte by byte: header blocks, line ends, a byte of Latin-1 in a comment."""
    target = PATH.text[0]
    texts = {"part.mod": b"%%%\r\n  VERSION:1\r\n  LANGUAGE:ENGLISH\r\n%%%\r\n" + main().replace("\n", "\r\n").encode(),
             "way.mod": b"! fr\xe4sen\n" + routine("rWay", [target]).encode(),
             "idle.sys": b"MODULE Idle(SYSMODULE)\n PERS num n:=1;\nENDMODULE\n\n"}
    Job(tmp_path).write()
    for name, text in texts.items():
        (tmp_path / name).write_bytes(text)
    joined(tmp_path, *texts)
    files = separate((tmp_path / "job.mod").read_bytes(), tmp_path / "out" / "part.mod")
    assert files == {tmp_path / "out" / name: text for name, text in texts.items()}


def test_several_modules_with_one_log_are_one_job(tmp_path: Path) -> None:
    """What post, and correct with --modules, make of it; never over the planned modules, and never twice."""
    Job(tmp_path, program=main(), forces=log(PATH)).write()
    (tmp_path / "way.mod").write_text(routine("rWay", PATH.text[10:20]))
    joined(tmp_path, "part.mod", "way.mod")
    (tmp_path / "one").mkdir()
    assert corrected(tmp_path, "job.mod", "one/part.mod", "--modules").code == 0

    def direct(output: str, *programs: str) -> kit.Run:
        return kit.run("correct", tmp_path / "cell.yaml", *(tmp_path / program for program in programs), "--stiffness",
                       tmp_path / "stiffness.json", "--forces", tmp_path / "forces.csv", "-o", tmp_path / output, "--force")

    run = direct("out", "part.mod", "way.mod")
    assert run.code == 0, run
    assert "joined: part.mod, way.mod" in run.out
    for name in ("part.mod", "way.mod"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "one" / name).read_bytes()
    assert (tmp_path / "part_job.mod").read_bytes() == (tmp_path / "job.mod").read_bytes()
    planned = (tmp_path / "part.mod").read_bytes()
    assert "CS0006" in direct("", "part.mod", "way.mod").err
    assert (tmp_path / "part.mod").read_bytes() == planned
    assert "CS4204" in direct("again", "out/part.mod", "out/way.mod").err
    assert "names a folder" in direct("job_corrected.mod", "part.mod", "way.mod").err


def test_one_module_by_the_path_lengths_of_the_whole_job_is_refused(tmp_path: Path) -> None:
    """It has no main: where the job's log was when this module began is in another file."""
    job = Job(tmp_path, cell=kit.cell_text(extra=f"workobject: {kit.yaml_frame(kit.USER @ kit.OBJECT)}\n"),
              program=routine("rWay", PATH.text[:10]), forces=log(PATH))
    result = job.correct("--json")
    assert result.code == 1, result
    error = next(finding for finding in result.json["findings"] if finding["level"] == "error")
    assert error["code"] == "CS3007"
    assert "no routine main" in error["hint"]


def test_of_layers_a_log_of_positions_is_that_of_the_one_it_lies_on(tmp_path: Path) -> None:
    """Three layers 0.6 mm apart, each under a force of its own: the second module gets that of the second."""
    layers = [Path3(np.array([[6.0 * k, 8 * (k % 2), 5 - 0.6 * layer] for k in range(12)])) for layer in range(3)]
    rows = ["x_mm,y_mm,z_mm,fx_n,fy_n,fz_n"]
    for layer, path in enumerate(layers):
        legs = zip(path.xyz, path.xyz[1:], strict=False)
        way = np.concatenate([np.linspace(a, b, 20, endpoint=False) for a, b in legs])
        up = np.linspace(path.xyz[-1], path.xyz[-1] + [0, 0, 30], 15)
        across = np.linspace(up[-1], path.xyz[0] + [0, 0, 30], 15)
        for places, force in ((way, CUTS * (1 + layer)), (up[1:], 0 * CUTS), (across, 0 * CUTS)):
            rows += [",".join(f"{value:.4f}" for value in (*place, *force)) for place in path.at(places)]
    job = Job(tmp_path, cell=kit.cell_text(extra=f"workobject: {kit.yaml_frame(kit.USER @ kit.OBJECT)}\n"),
              program=routine("layer2", layers[1].text), forces="\n".join(rows) + "\n")
    result = job.correct("--json", "--keep-targets")
    assert result.code == 0, result
    said = next(finding for finding in result.json["findings"] if finding["code"] == "CS3128")
    # The first layer ends after 249 rows and the header; 220 on the second, and some of the way up that are near its end.
    [(first, last)] = re.findall(r"^the log goes along this path 3 times, as layer upon layer does: that of rows (\d+) to "
                                 r"(\d+) is taken, 0\.0\d mm off it in the middle$", said["message"])
    assert (first, said["line"]) == ("251", 251)
    assert 470 <= int(last) <= 473
    force = kit.deviation(IRB6660, layers[1].q[5], TOOL.p, np.r_[2 * CUTS, 0, 0, 0], K) * 1e6
    np.testing.assert_allclose(deviations(tmp_path)[5], force, atol=0.5)
    job.forces = "\n".join([rows[0], *rows[250:499]]) + "\n"
    alone = job.correct("--json", "--keep-targets", "--force")
    assert "CS3128" not in kit.codes(alone)
    np.testing.assert_allclose(deviations(tmp_path)[5], force, atol=0.5)


def named(*modules: str) -> tuple[str, dict[str, str]]:
    """The program with all of its targets by name, and the modules that declare them, in turn."""
    names = [f"p{10 * (k + 1)}" for k in range(len(PATH.text))]
    rows = [f"CONST robtarget {name}:={target};\n" for name, target in zip(names, PATH.text, strict=True)]
    texts = {f"{module}.mod": f"MODULE {module}\n{''.join(rows[k::len(modules)])}ENDMODULE\n"
             for k, module in enumerate(modules)}
    return f"{HEAD}\nPROC main()\n{moves(names)}ENDPROC\nENDMODULE\n", texts


@pytest.mark.parametrize("key", ["target", "position", "path"])
def test_targets_that_another_module_declares_are_told_in_one_finding(tmp_path: Path, key: str) -> None:
    """With the module, and the call that takes both; that call corrects the job."""
    program, texts = named("Targets")
    way = np.concatenate([np.linspace(*ends, 20) for ends in pairwise(PATH.at(POINTS))])
    place = {"target": ("target", [[k] for k in range(30)]), "position": ("x_mm,y_mm,z_mm", way.tolist())}
    header, rows = place.get(key, ("", []))
    forces = log(PATH) if key == "path" else f"{header},fx_n,fy_n,fz_n\n" + "".join(
        f"{','.join(map(str, row))},90,-50,160\n" for row in rows)
    Job(tmp_path, program=program, forces=forces).write()
    alone = corrected(tmp_path, "part.mod", "out.mod")
    assert alone.code == 1, alone
    (found,) = alone.json["findings"]
    assert (found["code"], found["line"], found["target"]) == ("CS2011", program.split("p10,")[0].count("\n") + 1, 0)
    assert found["message"].startswith("p10 and 29 more names are not declared in this file: 30 targets")
    (tmp_path / "Targets.mod").write_text(texts["Targets.mod"])
    (tmp_path / "other.mod").write_text("MODULE Other\nLOCAL CONST num p10:=1;\nPROC r()\n"
                                        "VAR num p20:=1;\nENDPROC\nENDMODULE\n")
    (found,) = corrected(tmp_path, "part.mod", "out.mod").json["findings"]
    assert found["message"].startswith("p10 and 29 more names are not declared in this file, but in Targets.mod beside it: ")
    assert "compstiff correct CELL part.mod Targets.mod --forces LOG -o FOLDER/" in found["hint"]
    both = kit.run("correct", tmp_path / "cell.yaml", tmp_path / "part.mod", tmp_path / "Targets.mod", "--stiffness",
                   tmp_path / "stiffness.json", "--forces", tmp_path / "forces.csv", "-o", tmp_path / "out/", "--json")
    assert both.code == 0, both
    assert (tmp_path / "out" / "Targets.mod").read_text() != texts["Targets.mod"]
    # Beside what the job left, the same is said.
    (found,) = corrected(tmp_path, "part.mod", "out.mod").json["findings"]
    assert "but in Targets.mod beside it" in found["message"]


def test_which_modules_declare_the_targets(tmp_path: Path) -> None:
    """Some each, some nowhere, or each of two all of them."""
    program, texts = named("One", "Two")
    Job(tmp_path, program=program).write()

    def said() -> dict[str, str]:
        return next(finding for finding in corrected(tmp_path, "part.mod", "out.mod").json["findings"]
                    if finding["code"] == "CS2011")

    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    assert "p10 and 29 more names are not declared in this file, but in One.mod, Two.mod beside it" in said()["message"]
    assert "correct CELL part.mod One.mod Two.mod --forces" in said()["hint"]
    (tmp_path / "Two.mod").unlink()
    assert "; 15 of them are in One.mod beside it" in said()["message"]
    for name in ("One.mod", "Two.mod"):
        (tmp_path / name).write_text(named("All")[1]["All.mod"])
    assert "but in each of One.mod, Two.mod beside it" in said()["message"]


def test_a_folder_with_a_job_in_several_modules_is_sound(tmp_path: Path) -> None:
    """The module without a move is what the other names; the other is sound with it, and not without."""
    program, texts = named("Targets")
    Job(tmp_path, program=program).write()
    (tmp_path / "forces.csv").unlink()
    (tmp_path / "part.forces.csv").write_text("target,fx_n,fy_n,fz_n\n" + "".join(f"{k},90,-50,160\n" for k in range(30)))
    (tmp_path / "Targets.mod").write_text(texts["Targets.mod"])

    def check() -> tuple[int, dict[str, str], set[str]]:
        run = kit.run("check", tmp_path / "cell.yaml", tmp_path, "--json")
        return run.code, {Path(one["file"]).name: one["verdict"] for one in run.json["result"]["files"]}, kit.codes(run)

    code, verdicts, codes = check()
    assert (code, verdicts["Targets.mod"], verdicts["part.mod"]) == (0, "ok", "warning")
    assert "CS2011" in codes
    assert not {"CS4202", "CS3010", "CS3005"} & codes
    (tmp_path / "part.mod").write_text(main())
    (tmp_path / "part.forces.csv").unlink()
    code, verdicts, codes = check()
    assert (code, verdicts["Targets.mod"]) == (1, "error")          # nobody names what it declares
    (tmp_path / "Targets.mod").unlink()
    (tmp_path / "part.mod").write_text(program)
    code, verdicts, codes = check()
    assert (code, verdicts["part.mod"]) == (1, "error")
