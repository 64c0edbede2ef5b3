"""What a newcomer meets on the way to the first upload, and what is said of it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from compensator.upload.local_module import check_name, read_module
from identification.common.findings import CompstiffError, Refused
from tests.compensator.upload import kit
from tests.compensator.upload.emulator import Emulator, RobotController


@pytest.mark.parametrize("host", ["http://127.0.0.1", "127.0.0.1:80", "robot/rw", "my robot"])
def test_a_host_is_a_name_alone(tmp_path: Path, host: str) -> None:
    module, cell = kit.write_module(tmp_path), kit.cell_yaml(tmp_path, 80)
    by_option = kit.call(cell, module, "--host", host)
    assert (by_option.code, by_option.codes) == (1, ["CS6104"])
    cell.write_text(cell.read_text().replace("host: 127.0.0.1", f"host: '{host}'"))
    in_file = kit.call(cell, module)
    assert (in_file.code, in_file.codes) == (1, ["CS0102"])
    assert "a name or an address alone" in in_file.message


def test_a_host_is_stated_in_the_cell_or_in_the_call(tmp_path: Path) -> None:
    module, cell = kit.write_module(tmp_path), kit.cell_yaml(tmp_path, 80)
    cell.write_text(cell.read_text().replace("host: 127.0.0.1, ", ""))
    none = kit.call(cell, module)
    assert (none.code, none.codes, none.message) == (1, ["CS6104"], "states no controller.host")
    assert none.document["findings"][0]["file"] == str(cell)
    with Emulator(RobotController()) as emulator:
        stated = kit.call(cell, module, "--host", "127.0.0.1", "--port", emulator.port)
    assert (stated.code, stated.codes) == (0, [])


@pytest.mark.parametrize("host", ["192.168.125.1", "fe80::1", "robot7.plant.local"])
def test_names_and_addresses_are_hosts(tmp_path: Path, host: str) -> None:
    cell = kit.cell_yaml(tmp_path, 9)
    cell.write_text(cell.read_text().replace("host: 127.0.0.1", f"host: '{host}'"))
    assert "CS0102" not in kit.call(cell, kit.write_module(tmp_path), "--timeout", "0.05", "--retries", "0").codes


def test_a_password_in_the_cell_is_no_misspelt_port(tmp_path: Path) -> None:
    found = kit.call(kit.cell_yaml(tmp_path, 80, "tls: false, password: secret"), kit.write_module(tmp_path))
    assert found.codes == ["CS0102"]
    assert "no password stands in a file" in found.document["findings"][0]["hint"]
    assert "secret" not in found.text


def test_nobody_is_sent_to_apply_where_nothing_could_be_asked(tmp_path: Path) -> None:
    """TLS asked of an IRC5, none of an OmniCore: said as that."""
    module = kit.write_module(tmp_path)
    for generation, tls, said in ((1, "true", "speaks no TLS"), (2, "false", "over TLS alone")):
        with Emulator(RobotController(generation), kit.server_context() if generation == 2 else None) as emulator:
            dry = kit.call(kit.cell_yaml(tmp_path, emulator.port, f"tls: {tls}"), module, "--retries", "0")
        assert (dry.code, dry.codes) == (0, ["CS6110"])
        assert said in dry.document["findings"][0]["hint"]
        assert "--apply" not in dry.text


MAIN = b"""MODULE Big
  PROC main()
    Load \\Dynamic,"HOME:/big_001.mod";
    %"big_001_moves"%;
    UnLoad "HOME:/big_001.mod";
  ENDPROC
ENDMODULE
"""


def test_parts_that_are_loaded_at_run_time_must_have_the_names_they_are_loaded_by(tmp_path: Path) -> None:
    main = kit.write_module(tmp_path, "big.mod", MAIN)
    part = kit.write_module(tmp_path, "big_001.mod", kit.module_text("big_001"), record=False)
    record = json.loads((tmp_path / "big.mod.json").read_text())
    record["parts"] = [{"file": part.name, "sha256": hashlib.sha256(part.read_bytes()).hexdigest()}]
    (tmp_path / "big.mod.json").write_text(json.dumps(record))
    with Emulator(RobotController()) as emulator:
        cell = kit.cell_yaml(tmp_path, emulator.port)
        assert "loads HOME/big_001.mod at run time" in kit.call(cell, main).message
        hashed = kit.call(cell, part)
        assert hashed.codes == ["CS6125"]
        assert hashed.document["findings"][0]["hint"] == "--name big_001.mod"
        assert kit.call(cell, part, "--name", "big_001.mod").codes == []
        cell.write_text(cell.read_text().replace("tls: false", "tls: false, folder: HOME/milling"))
        assert "controller.folder HOME" in kit.call(cell, part, "--name", "big_001.mod").document["findings"][0]["hint"]
        # Of a folder that stands in a variable the name alone is held.
        main.write_bytes(MAIN.replace(b'"HOME:/big_001.mod";', b'diskhome \\File:="big_001.mod";', 1))
        assert kit.call(cell, part, "--name", "big_001.mod").codes == []
        named = kit.call(cell, part, "--name", "other.mod").document["findings"][0]
        assert (named["code"], named["hint"]) == ("CS6125", "--name big_001.mod")


@pytest.mark.parametrize(("statement", "place"), [
    ('Load \\Dynamic,"HOME:/other.mod";', "HOME/other.mod"),
    ('StartLoad "HOME:/milling/other.mod",slot;', "HOME/milling/other.mod"),
    ('Load \\Dynamic, "HOME:" \\File:="other.mod";', "HOME/other.mod"),
    ('Load\\Dynamic,"HOME:/milling/"\\File:="OTHER.MOD";', "HOME/milling/OTHER.MOD"),
    ('! Load \\Dynamic,"HOME:/other.mod";', ""), ('Load \\Dynamic,"HOME:/big.mod";', ""), ('UnLoad "HOME:/other.mod";', ""),
    ('Load \\Dynamic,where;', ""), ('LoadId load1;', ""), ('Load \\Dynamic, diskhome \\File:="other.mod";', "other.mod")])
def test_what_a_module_loads_is_told_as_it_writes_it(tmp_path: Path, statement: str, place: str) -> None:
    """By the ways that RAPID has; not itself, nor what a comment, an UnLoad or a variable says."""
    main = kit.write_module(tmp_path, "big.mod", MAIN.replace(b'Load \\Dynamic,"HOME:/big_001.mod";', statement.encode(), 1))
    found = read_module(main, kit.ROBOT).loads("HOME", "big.mod")
    assert [(one.code, one.level, one.file, one.message) for one in found] == [(
        "CS6125", "warning", str(main), f"it loads {place} at run time: they must be there under these names")] * bool(place)
    folder = place.rpartition("/")[0]
    assert all(one.hint.endswith(f"loaded by, and controller.folder {folder}" if folder else "loaded by") for one in found)


@pytest.mark.parametrize("count", [3, 4])
def test_three_of_what_a_module_loads_are_named(tmp_path: Path, count: int) -> None:
    names = [f"HOME/part_{k}.mod" for k in range(count)]
    loads = "".join(f'    Load \\Dynamic,"{name.replace("HOME", "HOME:")}";\n' for name in names)
    main = kit.write_module(tmp_path, "big.mod", MAIN.replace(b'    Load \\Dynamic,"HOME:/big_001.mod";\n', loads.encode(), 1))
    found, = read_module(main, kit.ROBOT).loads("HOME", "big.mod")
    assert found.message == (f"it loads {', '.join(names[:3])}{' ...' if count > 3 else ''} at run time: they must be there "
                             "under these names")


@pytest.mark.parametrize(("name", "stem"), [
    ("part.mod", "part"), ("-Fr\u00e4se part (1).MOD", "Fr_se_part__1_"), ("---.mod", "_"), ("a" * 40 + "b.sysx", "a" * 40),
    ("--" + "a" * 40 + ".modx", "a" * 38)])
def test_a_new_file_is_named_after_its_program_and_its_content(tmp_path: Path, name: str, stem: str) -> None:
    """So that no other content ever has its name; of letters that every controller's file system has."""
    file = kit.write_module(tmp_path, name)
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    module = read_module(file, kit.ROBOT)
    assert module.new_name == f"{stem}-{digest[:10]}{file.suffix.lower()}"
    assert check_name(module.new_name) == module.new_name
    assert module.lines() == [f"module: Insert, {len(file.read_bytes())} bytes, SHA-256 {digest[:16]}...",
                              "record: corrected from input.x, stiffness.x, forces.x, cell.x",
                              "record: 9 targets corrected, largest offset 0.1234 mm"]


@pytest.mark.parametrize(("name", "fits"), [
    ("a" * 60 + ".mod", True), ("a" * 61 + ".mod", False), ("_-9.SYSX", True), ("-a.mod", False), ("a.mod.bak", False),
    (".mod", False)])
def test_a_name_on_the_controller_has_64_letters_at_most(name: str, fits: bool) -> None:
    if fits:
        assert check_name(name) == name
    else:
        with pytest.raises(CompstiffError, match=r"CS6100.*is no name for a module.s file"):
            check_name(name)


def test_a_dry_run_says_what_is_there_among_files_of_the_program(tmp_path: Path) -> None:
    """Whole, beside another content of it, in one state or the other."""
    file, controller = kit.write_module(tmp_path), RobotController()
    path = kit.new_path(file)
    controller.files |= {"HOME/Part_corrected-0123456789.mod": b"an earlier one", "HOME/other.mod": b"not ours"}
    with Emulator(controller) as emulator:
        cell = kit.cell_yaml(tmp_path, emulator.port)
        before = kit.call(cell, file)
        controller.files[path] = file.read_bytes()
        after = kit.call(cell, file)
        controller.files[path] += b" "
        taken = kit.call(cell, file)
    for done, there, same in ((before, 1, False), (after, 2, True)):
        result = done.document["result"]
        assert (len(result["there"]), result["already_there"], result["applied"], result["results"]) == (there, same, False, [])
    assert (taken.code, taken.codes) == (3, ["CS6111"])
    assert f"has another file {path} already, {len(file.read_bytes()) + 1} bytes; the new file is not there" in taken.message


def split_in(folder: Path, **changed: object) -> tuple[Path, list[Path]]:
    """A corrected program in two parts with its one record, of which entries were changed."""
    main = kit.write_module(folder, "big.mod", MAIN)
    parts = [kit.write_module(folder, f"big_00{k}.mod", kit.module_text(f"big_00{k}"), record=False) for k in (1, 2)]
    record = json.loads((folder / "big.mod.json").read_text())
    record["parts"] = [{"file": part.name, "sha256": hashlib.sha256(part.read_bytes()).hexdigest()} for part in parts]
    (folder / "big.mod.json").write_text(json.dumps(record | changed))
    return main, parts


def test_a_part_is_held_against_what_the_record_says_of_it_and_not_of_another(tmp_path: Path) -> None:
    """Copied over one another, the second part would be milled in place of the first."""
    main, (one, two) = split_in(tmp_path)
    for file in (main, one, two):
        assert [finding.code for finding in read_module(file, kit.ROBOT).findings] == []
    one.write_bytes(two.read_bytes())
    with pytest.raises(Refused) as stopped:
        read_module(one, kit.ROBOT)
    (found,) = stopped.value.findings
    assert (found.code, found.file, found.message) == (
        "CS6101", str(one), "is not what its record big.mod.json says: it was changed since it was corrected")
    (warned,) = read_module(one, kit.ROBOT, changed=True).findings
    assert (warned.code, warned.level, warned.hint) == ("CS6101", "warning", "")
    # Under another name with its record it is what it was.
    renamed = tmp_path / "shaft.mod"
    main.rename(renamed)
    (tmp_path / "big.mod.json").rename(tmp_path / "shaft.mod.json")
    assert read_module(renamed, kit.ROBOT).findings == ()


@pytest.mark.parametrize(("main", "said"), [
    ("big.mod", True), ("./big.mod", False), (None, False), (7, False), ("gone.mod", False), ("big_001.mod", False)])
def test_by_what_name_a_part_is_loaded_is_read_in_its_main_module(tmp_path: Path, main: object, said: bool) -> None:
    """Which lies beside it, by the record; a record that names none, or a path, tells nothing."""
    entry = {"file": main, "sha256": hashlib.sha256(MAIN).hexdigest()}
    _, (part, _) = split_in(tmp_path, output={} if main is None else entry)
    found = read_module(part, kit.ROBOT).loads("HOME/milling", "part-1.mod")
    assert [(one.code, one.level, one.file, one.message, one.hint) for one in found] == ([(
        "CS6125", "warning", str(part), "big.mod loads it as HOME/big_001.mod at run time, and here it would be "
        "HOME/milling/part-1.mod", "--name big_001.mod, and controller.folder HOME")] if said else [])
    assert read_module(part, kit.ROBOT).loads("home", "BIG_001.mod") == ()      # the controller tells no capitals


def test_a_record_that_says_little_is_told_as_far_as_it_says_it(tmp_path: Path) -> None:
    file = kit.write_module(tmp_path)
    record = tmp_path / f"{file.name}.json"
    whole = json.loads(record.read_text())
    record.write_text(json.dumps(whole | {"stiffness": None, "forces": "none", "summary": {"corrected": 3, "offset_mm": 7}}))
    module = read_module(file, kit.ROBOT)
    assert module.lines()[1:] == ["record: corrected from input.x, cell.x"]
    shown = module.as_dict()
    assert (shown["file"], shown["module"], shown["bytes"]) == (str(file), "Insert", len(file.read_bytes()))
    assert shown["record"] == {"input": "input.x", "stiffness": None, "forces": None, "cell": "cell.x", "robot": kit.ROBOT,
                               "compstiff": None, "targets": None, "corrected": 3, "largest_offset_mm": None}
    for text in ("[]", "{}", json.dumps(whole | {"format": "another"}), json.dumps(whole | {"output": []}), "[" * 100_000):
        record.write_text(text)
        found = read_module(file, kit.ROBOT)
        assert ([one.code for one in found.findings], found.record, found.as_dict()["record"]) == (["CS6102"], None, None)
        assert len(found.lines()) == 1
