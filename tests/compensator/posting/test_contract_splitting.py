"""Parts of a large program: every byte of every move, nothing split inside a cut."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compensator.correction.files import Inputs, Outputs, correct_files
from compensator.correction.recorded import check_not_corrected
from compensator.correction.settings import DEFAULTS, Settings
from compensator.posting.settings import PostingSettings
from compensator.posting.split_files import split_files
from compensator.posting.splitting import split_program
from compensator.rapid import read_rapid
from identification.common.findings import CompstiffError, Refused
from identification.model.cell import read_cell
from tests.compensator.correction.virtual_job import model_of
from tests.compensator.rapid.small_programs import target
from tests.support import compstiff, write_cell

OUT = Path("OUT.mod")


def moves(kinds: list[str]) -> tuple[str, list[bool]]:
    """Lines of moves and whether each target is in the air: a air, c cut, m MoveC in the cut, ! a comment, s a statement."""
    lines, air = [], []
    for number, kind in enumerate(kinds):
        here = target(number, 0.5, -1)
        if kind == "!":
            lines.append(f"    ! pass {number}: MoveL in a comment;")
        elif kind == "s":
            lines.append(f"    SetDO doAir,{number % 2};")
        elif kind == "m":
            lines.append(f"    MoveC {target(number, 1)},{here},v5,z1,tMill\\WObj:=wPart;")
            air += [False, False]
        else:
            lines.append(f"    MoveL {here},{'v1000' if kind == 'a' else 'v5'},z1,tMill\\WObj:=wPart;   ! {kind}")
            air.append(kind == "a")
    return "\n".join(lines) + "\n", air


def module(body: str, before: str = "    ConfL\\Off;\n", declarations: str = "") -> str:
    return (f"%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\nMODULE Whole\n  PERS tooldata tMill:=[TRUE,[[0,0,1],[1,0,0,0]],"
            f"[1,[0,0,1],[1,0,0,0],0,0,0]];\n{declarations}  PROC main()\n{before}{body}    ConfL\\On;\n  ENDPROC\nENDMODULE\n")


def inside(part: bytes) -> bytes:
    """What stands between the PROC and ENDPROC lines of a part."""
    lines = part.splitlines(keepends=True)
    first = next(i for i, line in enumerate(lines) if line.lstrip().startswith(b"PROC"))
    last = next(i for i, line in enumerate(lines) if line.lstrip().startswith(b"ENDPROC"))
    return b"".join(lines[first + 1:last])


@given(st.lists(st.sampled_from("aaccccm!s"), min_size=6, max_size=60), st.integers(1, 20), st.sampled_from(["\n", "\r\n"]),
       st.booleans())
@settings(max_examples=80)
def test_the_parts_hold_every_byte_and_break_in_the_air_only(kinds, most, eol, load):
    body, air = moves(["a", *kinds])
    content = module(body).replace("\n", eol).encode()
    count = len(air)
    if count > most and not any(air[:-1]):
        with pytest.raises(CompstiffError, match="CS4312"):
            split_program(content, np.array(air), most, OUT, load=load)
        return
    split = split_program(content, np.array(air), most, OUT, load=load)
    if count <= most:
        assert (split.main, split.parts) == (content, {})
        assert [(one.code, one.level) for one in split.findings] == [("CS4312", "note")]
        assert f"its {count} target{'s' * (count != 1)} fit into one part of {most}" in split.findings[0].message
        return
    # The first move begins the first part and the last one ends the last; nothing of the text is lost or doubled.
    joined = b"".join(inside(part) for part in split.parts.values())
    begin, end = content.index(b"    MoveL"), content.index(b"    ConfL\\On;")
    tail = joined[len(joined.rstrip()):]
    assert content[begin:end].startswith(joined[:len(joined) - len(tail)])
    assert b"Move" not in split.main.replace(b"_moves", b"").replace(b"MoveL in a comment", b"")
    assert content[:begin] == split.main[:begin]
    bounds = np.cumsum(split.sizes)
    assert bounds[-1] == count
    assert all(air[bound - 1] for bound in bounds[:-1])
    for size, bound in zip(split.sizes, bounds, strict=True):
        # A part that is too long has no place in the air where it could have ended before.
        assert size <= most or not any(air[bound - size:bound - 1])
    longest = max(split.sizes)
    assert [(one.code, one.target, one.message.partition(";")[0]) for one in split.findings] == [
        ("CS4311", sum(split.sizes[:split.sizes.index(longest)]),
         f"a cut is longer than a part shall be: {longest} targets in one part, {most} asked for")] * (longest > most)
    assert split.main.count(b"Load \\Dynamic") == load * len(split.parts)
    whole = read_rapid(content).toolpath
    parts = [read_rapid(part).toolpath for part in split.parts.values()]
    for name in ("position", "quaternion", "confdata", "move"):
        np.testing.assert_array_equal(np.concatenate([getattr(one, name) for one in parts]), getattr(whole, name))


def test_what_the_main_module_says():
    body, air = moves(list("acac"))
    split = split_program(module(body).encode(), np.array(air), 3, OUT)
    assert list(split.parts) == ["OUT_001.mod", "OUT_002.mod"]
    assert split.sizes == (3, 1)
    calls = "    OUT_001_moves;\n    OUT_002_moves;\n"
    assert split.main.decode() == module(calls)
    loaded = split_program(module(body).encode(), np.array(air), 3, OUT, load=True).main.decode()
    assert ('    Load \\Dynamic,"HOME:/OUT_001.mod";\n    %"OUT_001_moves"%;\n    WaitRob \\InPos;\n'
            '    UnLoad "HOME:/OUT_001.mod";\n') in loaded


@pytest.mark.parametrize(("before", "declarations", "says"), [
    ("    IF bDone THEN\n    ENDIF\n", "", "a loop, a branch"),
    ("    VAR num n;\n", "", "data of the procedure"),
    ("    RETURN;\n", "", "RETURN"),
    ("", "  LOCAL CONST num n:=1;\n", "LOCAL data"),
    ("", "  PROC other()\n  ENDPROC\n", "second module or routine"),
    ("", "  CONST num OUT_002_moves:=1;\n", "has the name out_002_moves"),
    ("", "PROC main(num n)", "a function, a trap or parameters"), ("", "TRAP main", "a function, a trap or parameters"),
    ("", "LOCAL FUNC num main()", "a function, a trap or parameters"),
    ("", "LOCAL PROC main()", ""), ("", "PROC main( )", ""),
])
def test_only_one_plain_procedure_is_split(before, declarations, says):
    body, air = moves(list("acaca"))
    text = module(body, before, "" if "main" in declarations else declarations)
    if "main" in declarations:
        text = text.replace("PROC main()", declarations)
    if not says:
        assert split_program(text.encode(), np.array(air), 2, OUT).sizes == (1, 2, 2)
        return
    with pytest.raises(CompstiffError, match=says) as refused:
        split_program(text.encode(), np.array(air), 2, OUT)
    found = refused.value.findings[0]
    assert found.code == "CS4310"
    assert found.hint


@pytest.mark.parametrize(("said", "instead", "data"), [
    ("0.5", "nUp", "CONST num nUp:=0.5;"), ("[0,0.5,-1]", "pUp", "CONST pos pUp:=[0,0.5,-1];"),
    ("[9E9,9E9,9E9,9E9,9E9,9E9]", "eNone", "CONST extjoint eNone:=[9E9,9E9,9E9,9E9,9E9,9E9];")])
def test_numbers_that_the_main_module_declares_are_split_too(said, instead, data):
    """The parts name what stands there, which a controller sees from all modules."""
    body, air = moves(list("acaca"))
    text = module(body.replace(said, instead), declarations=f"  {data}\n").encode()
    plain, named = (read_rapid(one, "w.mod").toolpath.position for one in (module(body).encode(), text))
    assert np.array_equal(named, plain)
    split = split_program(text, np.array(air), 2, OUT)
    assert split.sizes == (1, 2, 2)
    assert data.encode() in split.main
    assert b"".join(map(inside, split.parts.values())).decode() == body.replace(said, instead)


@pytest.mark.parametrize("wrong", ["a place", "a turn", "a kind", "one less", "one more", "another part", "main"])
def test_parts_that_do_not_say_what_the_program_said_are_not_written(monkeypatch, tmp_path, wrong):
    """Each by itself, everything else as it should be; as it should be they are written."""
    from compensator.posting import splitting

    part, behind, calls = splitting._part, splitting._behind, splitting._calls
    said, instead = {"a place": (b"0.5,", b"0.5001,"), "a turn": (b"[1,0,0,0]", b"[0,1,0,0]"), "a kind": (b"MoveL", b"MoveJ"),
                     "one less": (b"    MoveL", b"    ! MoveL"),
                     "one more": (b"  ENDPROC", b"  MoveL p1,v5,z1,tMill;\n  ENDPROC")}.get(wrong, (b"", b""))
    if said:
        monkeypatch.setattr(splitting, "_part", lambda *given: part(*given).replace(said, instead, 1))
    elif wrong == "main":
        monkeypatch.setattr(splitting, "_calls", lambda *given: [*calls(*given), "MoveL p1,v5,z1,tMill;"])
    else:       # the first line of the next part
        monkeypatch.setattr(splitting, "_behind", lambda data, at: data.index(b"\n", behind(data, at)) + 1)
    body, air = moves(list("acaca"))
    with pytest.raises(CompstiffError) as refused:
        split_files(module(body).encode(), np.array(air), PostingSettings(split=2), tmp_path / "OUT.mod", overwrite=False)
    (found,) = refused.value.findings
    assert (found.code, found.file) == ("CS4313", str(tmp_path / "OUT.mod"))
    assert found.message == "the parts do not read back as the program; nothing was written"
    monkeypatch.undo()
    assert split_files(module(body).encode(), np.array(air), PostingSettings(split=2), tmp_path / "OUT.mod",
                       overwrite=False)[1] == (1, 2, 2)


def test_names_of_parts_are_those_a_controller_takes():
    """Of at most 32 letters, however long the output's name is."""
    body, air = moves(list("acaca"))
    split = split_program(module(body).encode(), np.array(air), 2, Path(f"{'Long' * 10}.mod"))
    names = re.findall(rb"(?:MODULE|PROC) (\w+)", b"".join(split.parts.values()))
    assert len(names) == 6
    assert {len(name) for name in names} == {26, 32}


def test_one_cut_is_not_split():
    body, air = moves(list("cccc"))
    with pytest.raises(CompstiffError, match="CS4312: no target in the air"):
        split_program(module(body).encode(), np.array(air), 2, OUT)


@pytest.mark.parametrize(("there", "said"), [
    ((), ""), (("OUT_001.mod", "OUT_004.mod"), ""), (("OUT_5.mod", "OTHER_009.mod", "OUT_009.sys"), ""),
    (("OUT_005.mod", "OUT_006.mod", "OUT_007.mod"), "OUT_005.mod, OUT_006.mod, OUT_007.mod"),
    (("OUT_005.mod", "OUT_006.mod", "OUT_007.mod", "OUT_008.mod"), "OUT_005.mod, OUT_006.mod, OUT_007.mod ...")])
def test_parts_that_this_split_does_not_have_are_named(tmp_path, there, said):
    """Of four that it writes anew, or other files, nothing is said."""
    body, air = moves(list("acacac"))
    for name in there:
        (tmp_path / name).write_text("old")
    findings = split_files(module(body).encode(), np.array(air), PostingSettings(split=2), tmp_path / "OUT.mod",
                           overwrite=True)[2]
    assert [finding.message.partition(":")[0] for finding in findings if finding.code == "CS4314"] == [said] * bool(said)


def test_parts_of_an_earlier_split_are_reported_and_none_is_overwritten(tmp_path):
    body, air = moves(list("acacac"))
    content, output = module(body).encode(), tmp_path / "OUT.mod"
    (tmp_path / "OUT_009.mod").write_text("old")
    _, sizes, findings = split_files(content, np.array(air), PostingSettings(split=2), output, overwrite=False)
    assert sizes == (1, 2, 2, 1)
    assert [(finding.level, finding.file, finding.message.partition(":")[0]) for finding in findings if finding.code == "CS4314"
            ] == [("warning", str(output), "OUT_009.mod")]
    (tmp_path / "OUT_002.mod").write_text("old")
    with pytest.raises(CompstiffError, match="CS0003"):
        split_files(content, np.array(air), PostingSettings(split=2), output, overwrite=False)
    with pytest.raises(CompstiffError, match="--split N is not given"):
        split_files(content, np.array(air), PostingSettings(split_load=True), output, overwrite=False)


CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250], mass_kg: 80, centre_of_mass_mm: [0, 0, 120]}
workobject: {position_mm: [1300, -50, 700]}
"""


def apt_job(folder: Path) -> Inputs:
    """Four cuts with air moves between them, 12 targets each, and the forces of a pass logged by target."""
    text, forces = ["UNITS/MM", "FEDRAT/900,MMPM"], []
    for cut in range(4):
        text += ["RAPID", f"GOTO/0,{10 * cut},30", *(f"GOTO/{8 * i},{10 * cut},0" for i in range(10)), "RAPID",
                 f"GOTO/72,{10 * cut},30"]
        forces += [0, *([1] * 10), 0]
    (folder / "part.apt").write_text("\n".join(text) + "\n")
    rows = [f"{number},{120 * on},{260 * on},{-90 * on}" for number, on in enumerate(forces)]
    (folder / "forces.csv").write_text("target,fx_n,fy_n,fz_n\n" + "\n".join(rows) + "\n")
    cell_file = write_cell(folder, CELL)
    (folder / "stiffness.json").write_text(json.dumps(model_of(read_cell(cell_file)).as_dict()))
    return Inputs(cell_file, folder / "part.apt", folder / "stiffness.json", folder / "forces.csv")


def test_an_apt_toolpath_is_corrected_and_split(tmp_path):
    inputs = apt_job(tmp_path)
    whole = correct_files(inputs, Outputs(tmp_path / "one.mod"), DEFAULTS, overwrite=False)
    # Air moves of two targets between cuts have no force, and stay as they are.
    assert len(whole.correction.targets) == 40
    assert whole.residual.max() < 0.2e-6
    planned = whole.predicted.program.toolpath
    after = read_rapid((tmp_path / "one.mod").read_bytes()).toolpath
    moved = np.linalg.norm(after.position - planned.position, axis=1)
    assert ((moved > 50e-6) == (np.linalg.norm(whole.predicted.forces.wrench, axis=1) > 0)).all()
    correct_files(inputs, Outputs(tmp_path / "many.mod"), Settings.of(split=25), overwrite=False)
    parts = [tmp_path / "many_001.mod", tmp_path / "many_002.mod"]
    assert sorted(tmp_path.glob("many_*.mod")) == parts
    split = np.concatenate([read_rapid(part.read_bytes()).toolpath.position for part in parts])
    np.testing.assert_array_equal(split, after.position)
    # A part would be the input itself: refused, --force or not.
    (tmp_path / "two_001.mod").write_bytes((tmp_path / "one.mod").read_bytes())
    inside_out = Inputs(inputs.cell, tmp_path / "two_001.mod", inputs.stiffness, inputs.forces)
    with pytest.raises(CompstiffError, match="CS0006"):
        correct_files(inside_out, Outputs(tmp_path / "two.mod"), Settings.of(split=25, correct_again=True), overwrite=True)
    # The next step names the parts of this split, not one that an earlier split left behind.
    (tmp_path / "next_009.mod").write_bytes(parts[0].read_bytes())
    done = compstiff("correct", inputs.cell, inputs.toolpath, "--stiffness", inputs.stiffness, "--forces", inputs.forces, "-o",
                     tmp_path / "next.mod", "--split", "25")
    assert "next_001.mod ... next_002.mod into the robot" in done.stderr
    record = json.loads((tmp_path / "many.mod.json").read_text())
    assert [part["file"] for part in record["parts"]] == ["many_001.mod", "many_002.mod"]
    assert {"CS4300", "CS4302"} <= {finding["code"] for finding in record["findings"]}
    for path in (tmp_path / "many.mod", *parts):
        with pytest.raises(Refused, match="CS4204"):
            check_not_corrected(path)
