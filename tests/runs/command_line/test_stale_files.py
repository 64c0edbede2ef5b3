"""What stands in a folder of an earlier run and is not of this one: said, by the records of the corrections; what is as it was
is not spoken of."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path

import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_mistakes import ROBOTS, call
from tests.runs.command_line.test_silent_mistakes import edited
from tests.runs.command_line.workshop import workshop

SAID = {"CS1205", "CS4129", "CS4205", "CS4206", "CS5026", "CS5028", "CS6101", "CS6103"}


@pytest.fixture
def corrected(tmp_path: Path) -> Path:
    """A folder in which a program was corrected, out.mod with offsets.csv."""
    done = workshop(ROBOTS[0]).run(tmp_path, {}, *call("--offsets", "@offsets.csv"))
    assert done.code == 0, done
    return tmp_path


def remarked(file: Path) -> None:
    text = file.read_text()
    file.write_text(text.replace("{", "{ ", 1) if file.suffix == ".json" else text + "! once more\n")


def push(folder: Path, cell: str = "cell.yaml") -> kit.Run:
    return kit.run("push", folder / cell, folder / "offsets.csv", "--program", folder / "part.mod", "--json")


def upload(folder: Path, monkeypatch: pytest.MonkeyPatch, *options: str) -> kit.Run:
    """A dry run, nobody there."""
    monkeypatch.setenv("COMPSTIFF_CONTROLLER_PASSWORD", "secret")
    return kit.run("upload", folder / "cell.yaml", folder / "out.mod", "--host", "127.0.0.1", "--port", "9", "--retries", "0",
                   "--json", *options)


def again(folder: Path) -> kit.Run:
    """The second correction, by the log of a pass with the offsets."""
    words = [word.replace("@out.mod", "@second.mod") for word in call("--logged-with", "@offsets.csv", "--force")]
    return kit.run(*(str(folder / word[1:]) if word.startswith("@") else word for word in words), "--json")


@pytest.mark.parametrize(("changed", "names"), [
    ((), ""), (("part.mod",), "part.mod was"), (("stiffness.json",), "stiffness.json was"),
    (("part.mod", "stiffness.json"), "part.mod and stiffness.json were"), (("cell.yaml",), ""), (("forces.csv",), "")])
def test_a_program_or_stiffness_file_that_was_changed_since(
    corrected: Path, monkeypatch: pytest.MonkeyPatch, changed: tuple[str, ...], names: str
) -> None:
    """The cell gets its controller and the log its next pass; both count for nothing here."""
    cell = corrected / "cell.yaml"
    for name in changed:
        if name == "cell.yaml":
            cell.write_text(cell.read_text() + "# stands in hall 3\n")
        elif name == "forces.csv":
            (corrected / name).write_text((corrected / name).read_text().replace("\n", "\n\n", 1))
        else:
            remarked(corrected / name)
    for done in (push(corrected), upload(corrected, monkeypatch)):
        assert done.code == 0, done
        told = [one["message"] for one in done.json["findings"] if one["code"] == "CS4205"]
        assert [one.startswith(names) for one in told] == ([True] if names else []), told
        assert kit.codes(done) & SAID == ({"CS4205"} if names else set())


def test_of_a_module_that_was_changed_on_purpose_is_told_what_it_was_made_from(
    corrected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    remarked(corrected / "out.mod")
    assert kit.codes(upload(corrected, monkeypatch)) & SAID == {"CS6101"}
    assert kit.codes(upload(corrected, monkeypatch, "--changed")) & SAID == {"CS6101"}
    remarked(corrected / "part.mod")
    done = upload(corrected, monkeypatch, "--changed")
    assert (done.code, kit.codes(done) & SAID) == (0, {"CS6101", "CS4205"})


def test_offsets_of_another_robot_are_not_pushed(corrected: Path) -> None:
    other = workshop(ROBOTS[1]).files["cell.yaml"]
    (corrected / "neighbour.yaml").write_text(other)
    done = push(corrected, "neighbour.yaml")
    assert (done.code, kit.codes(done) & SAID) == (3, {"CS5028"})


def test_offsets_without_places_are_not_pushed_onto_a_corrected_program(tmp_path: Path) -> None:
    """It has as many targets as the planned one, and its record tells it; where that did not come along, a warning asks."""
    assert workshop(ROBOTS[0]).run(tmp_path, {}, *call("--offsets", "@offsets.csv", "--keep-targets")).code == 0
    by_hand = tmp_path / "by-hand.csv"
    with (tmp_path / "offsets.csv").open() as file, by_hand.open("w") as bare:
        rows = csv.DictReader(file)
        written = csv.DictWriter(bare, ["target", "ox_mm", "oy_mm", "oz_mm"], extrasaction="ignore")
        written.writeheader()
        written.writerows(rows)

    def pushed(program: str) -> tuple[int, set[tuple[str, str]]]:
        done = kit.run("push", tmp_path / "cell.yaml", by_hand, "--program", tmp_path / program, "--json")
        return done.code, {(one["code"], one["level"]) for one in done.json["findings"] if one["code"] in ("CS5023", "CS5024")}

    assert pushed("part.mod") == (0, {("CS5024", "warning")})
    assert pushed("out.mod") == (3, {("CS5023", "error")})
    (tmp_path / "out.mod").rename(tmp_path / "renamed.mod")
    assert pushed("renamed.mod") == (3, {("CS5023", "error")})
    (tmp_path / "out.mod.json").unlink()
    assert pushed("renamed.mod") == (0, {("CS5024", "warning")})


def test_other_offsets_of_the_planned_program_are_not_pushed_onto_a_corrected_one(corrected: Path) -> None:
    """It does not have these, and is no planned program all the same: its record says what it is."""
    other = edited(corrected / "offsets.csv", corrected / "other.csv", 0.8)
    for record, code in ((True, "CS5023"), (False, "CS5022")):
        if not record:
            (corrected / "out.mod.json").unlink()
        run = kit.run("push", corrected / "cell.yaml", other, "--program", corrected / "out.mod", "--json")
        assert (run.code, [one["code"] for one in run.json["findings"] if one["level"] == "error"]) == (3, [code])


def test_offsets_of_a_logged_pass_that_were_changed(corrected: Path) -> None:
    assert kit.codes(again(corrected)) & SAID == set()
    edited(corrected / "offsets.csv", corrected / "offsets.csv", 0.8)
    assert kit.codes(again(corrected)) & SAID == {"CS4129"}


def test_offsets_of_a_logged_pass_of_a_program_that_was_changed(corrected: Path) -> None:
    remarked(corrected / "part.mod")
    assert kit.codes(again(corrected)) & SAID == {"CS4205"}


def test_offsets_without_a_record_are_taken_as_they_are(corrected: Path) -> None:
    (corrected / "out.mod.json").unlink()
    edited(corrected / "offsets.csv", corrected / "offsets.csv", 1.05)
    assert kit.codes(push(corrected)) & SAID == set()


@pytest.fixture
def of_a_table(tmp_path: Path) -> Path:
    """The same folder with stiffnesses that `identify` found in measurements.csv, which the correction is made with."""
    assert workshop(ROBOTS[0]).run(tmp_path, {}, "identify", "@cell.yaml", "@measurements.csv", "-o", "@stiffness.json",
                                   "--force").code == 0
    done = again_with(tmp_path)
    assert (done.code, kit.codes(done) & SAID) == (0, set()), done
    return tmp_path


def again_with(folder: Path) -> kit.Run:
    words = call("--offsets", "@offsets.csv", "--force")
    return kit.run(*(str(folder / word[1:]) if word.startswith("@") else word for word in words), "--json")


def test_load_tests_that_were_changed_since_they_were_identified(of_a_table: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Told by all that uses the stiffnesses, and no more once they are identified anew, or where the table is not there."""
    table, stiffness = of_a_table / "measurements.csv", of_a_table / "stiffness.json"

    def told() -> list[set[str]]:
        calls = (again_with(of_a_table), push(of_a_table), upload(of_a_table, monkeypatch),
                 kit.run("check", of_a_table / "cell.yaml", stiffness, "--json"))
        assert [done.code for done in calls] == [0] * 4, calls
        return [kit.codes(done) & SAID for done in calls]

    assert told() == [set()] * 4
    *rows, last = table.read_text().splitlines()
    table.write_text("\n".join(rows) + "\n")         # its last reading is left out
    assert told() == [{"CS1205"}] * 4
    table.rename(of_a_table / "kept.csv")
    assert told() == [set()] * 4
    (of_a_table / "kept.csv").rename(table)
    assert kit.run("identify", of_a_table / "cell.yaml", table, "-o", stiffness, "--force", "--json").code == 0
    assert told() == [set()] * 4
    diagnosed = kit.run("diagnose", of_a_table / "cell.yaml", table, "-o", of_a_table / "d.json", "--extended", stiffness,
                        "--replicates", "19", "--force", "--json")
    assert diagnosed.code == 0, diagnosed
    table.write_text("\n".join([*rows, last]) + "\n")
    assert kit.codes(again_with(of_a_table)) & SAID == {"CS1205"}


def test_stiffnesses_that_name_no_table_are_read_as_before(of_a_table: Path) -> None:
    content = json.loads((of_a_table / "stiffness.json").read_text())
    del content["made_from"]
    (of_a_table / "stiffness.json").write_text(json.dumps(content))
    (of_a_table / "measurements.csv").write_text("")
    assert kit.codes(again_with(of_a_table)) & SAID == set()


def test_the_earlier_of_two_corrections(corrected: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second is made from the log of the pass with the first one's offsets, whatever the times of the files say; of two
    from one log the later counts, and neither where a copy gave both one time, to a second or two."""
    words = [word.replace("@out.mod", "@second.mod") for word in call(
        "--logged-with", "@offsets.csv", "--offsets", "@second.csv", "--scale", "1.05")]
    done = kit.run(*(str(corrected / word[1:]) if word.startswith("@") else word for word in words), "--json")
    assert (done.code, kit.codes(done) & SAID) == (0, set()), done
    records = [corrected / "out.mod.json", corrected / "second.mod.json"]
    os.utime(records[1], (records[0].stat().st_mtime - 3600,) * 2)
    for first in (push(corrected), upload(corrected, monkeypatch)):
        assert kit.codes(first) & SAID == {"CS4206"}
    (corrected / "second.csv").rename(corrected / "offsets.csv")
    assert kit.codes(push(corrected)) & SAID == {"CS5026"}
    record = json.loads(records[1].read_text())
    record["offsets"]["file"], record["logged_with"] = "offsets.csv", None
    for earlier, said in ((-3600.0, set()), (0.0, set()), (1.0, set()), (3.0, {"CS4206"}), (3600.0, {"CS4206"})):
        records[1].write_text(json.dumps(record))
        os.utime(records[1], (records[0].stat().st_mtime + earlier,) * 2)
        assert kit.codes(upload(corrected, monkeypatch)) & SAID == said
    assert kit.codes(push(corrected)) & SAID == set()
