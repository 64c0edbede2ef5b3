"""What a newcomer meets on the way to the first upload, and what is said of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from compensator.upload.local_module import read_module
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
    import hashlib
    import json

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
