"""Mistakes of a newcomer that had ended with exit code 0 and no word: each is made, and its right variant beside it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_mistakes import IDENTIFY, PLACED, ROBOTS, call, instead, slot
from tests.runs.command_line.workshop import workshop

OFFSETS = ("ox_mm", "oy_mm", "oz_mm")


def timed(text: str, step: float) -> str:
    """A table of load tests with a row every `step` seconds."""
    header, *rows = text.splitlines()
    return "\n".join([f"{header},time_s,dwell_s", *(f"{row},{step * k:g},{step / 2:g}" for k, row in enumerate(rows))]) + "\n"


@pytest.mark.parametrize(("step", "names"), [
    (20.0, []), (1800.0, []), (1801.0, ["time_s"]), (3600.0, ["time_s"]), (20e3, ["time_s", "dwell_s"])])
def test_times_in_milliseconds_are_said(tmp_path: Path, step: float, names: list[str]) -> None:
    """Half an hour a row, or under a load, is a slow morning; more is no second's count."""
    job = workshop(ROBOTS[0])
    said = job.run(tmp_path, {"measurements.csv": timed(job.files["measurements.csv"], step)}, *IDENTIFY)
    assert said.code == 0, said
    told = [one["message"] for one in said.json["findings"] if one["code"] == "CS1026"]
    taken = {"time_s": step, "dwell_s": step / 2}
    assert told == [f"by {name} a row takes {taken[name] / 3600:.3g} hours, in the middle: in milliseconds?" for name in names]


@pytest.mark.parametrize(("feed", "odd"), [(40.0, False), (4.9, False), (4.7, True), (0.6, True)])
def test_a_feed_in_metres_a_minute_is_said_where_the_cutter_is_stated(tmp_path: Path, feed: float, odd: bool) -> None:
    """Of 16 mm at 9000 rpm; 2.4 m/min are 40 mm/s. A five-hundredth of the diameter a turn is little: 4.8 mm/s."""
    shop = workshop(ROBOTS[0])
    cutter = "cutting: {material: aluminium, tool_diameter_mm: 16}\n"
    cell = shop.files["cell.yaml"].replace("sign: on_tool", "sign: on_tool, spindle_rpm: 9000") + PLACED + cutter
    posted = shop.run(tmp_path, {"part.csv": slot(ROBOTS[0], feed, 200), "cell.yaml": cell}, "post", "@cell.yaml", "@part.csv",
                      "-o", "@posted.mod")
    assert posted.code == 0, posted
    assert ("CS4307" in kit.codes(posted)) is odd


def edited(source: Path, to: Path, factor: float) -> Path:
    """The offsets of `source` times a factor, as a spreadsheet writes them."""
    with source.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    with to.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(row | {name: factor * float(row[name]) for name in OFFSETS} for row in rows)
    return to


@pytest.mark.parametrize("robot", ROBOTS)
def test_offsets_changed_after_correct_wrote_them_are_not_pushed(tmp_path: Path, robot: str) -> None:
    """The record beside them has their SHA-256; under another name they are somebody's own."""
    assert workshop(robot).run(tmp_path, {}, *call("--offsets", "@offsets.csv")).code == 0
    cell, offsets = tmp_path / "cell.yaml", tmp_path / "offsets.csv"
    sound = kit.run("push", cell, offsets, "--any-program", "--json")
    assert (sound.code, kit.codes(sound) & {"CS5025", "CS5026", "CS5027"}) == (0, set())
    other = kit.run("push", cell, edited(offsets, tmp_path / "mine.csv", 2.0), "--any-program", "--json")
    assert (other.code, kit.codes(other) & {"CS5026", "CS5027"}) == (0, {"CS5027"})
    turned = kit.run("push", cell, edited(offsets, tmp_path / "mine.csv", -1.0), "--any-program", "--json")
    assert "CS5027" in kit.codes(turned)
    changed = kit.run("push", cell, edited(offsets, offsets, 2.0), "--any-program", "--json")
    assert (changed.code, kit.codes(changed)) == (3, {"CS5026"})
    (tmp_path / "out.mod.json").unlink()
    assert kit.run("push", cell, offsets, "--any-program").code == 0


def test_changed_offsets_in_another_folder_are_known_by_the_program_they_were_made_from(tmp_path: Path) -> None:
    """The record stands beside the program; offsets of another program that have the same name are nobody's business."""
    away = tmp_path / "usb"
    away.mkdir()
    assert workshop(ROBOTS[0]).run(tmp_path, {}, *call("--offsets", "@usb/offsets.csv")).code == 0
    push = ("push", tmp_path / "cell.yaml", away / "offsets.csv")
    program = ("--program", tmp_path / "part.mod")
    assert kit.run(*push, *program, "--json").code == 0
    edited(away / "offsets.csv", away / "offsets.csv", 1.2)
    changed = kit.run(*push, *program, "--json")
    assert (changed.code, kit.codes(changed)) == (3, {"CS5026"})
    (tmp_path / "part.mod").write_text((tmp_path / "part.mod").read_text() + "\n")
    assert "CS5026" not in kit.codes(kit.run(*push, *program, "--json"))


@pytest.mark.parametrize(("identified", "there", "refused"), [
    ("66-1234", "66-1234", False), ("66-1234", "66-4321", True), ("66-1234", "", False), ("", "66-4321", False)])
def test_stiffnesses_of_another_robot_of_the_type_are_refused(
    tmp_path: Path, identified: str, there: str, refused: bool
) -> None:
    """By the serial number, where both files state one; check says the same."""
    shop = workshop(ROBOTS[0])

    def cell(number: str) -> dict[str, str | bytes | None]:
        return {"cell.yaml": shop.files["cell.yaml"] + (f"serial_number: '{number}'\n" if number else "")}

    assert shop.run(tmp_path, cell(identified), *IDENTIFY).code == 0
    assert json.loads((tmp_path / "found.json").read_text()).get("serial_number", "") == identified
    done, checked = (shop.run(tmp_path, cell(there), *words) for words in (
        instead("@stiffness.json", "@found.json"), ("check", "@cell.yaml", "@part.mod", "@found.json")))
    assert (done.code != 0, "CS1202" in kit.codes(done)) == (refused, refused), done
    assert ("CS1202" in kit.codes(checked)) == refused
    assert (tmp_path / "out.mod").exists() != refused


@pytest.mark.parametrize(("words", "said"), [
    ((), ""), (("--tool-mass", "80", "--spindle-rpm", "24000", "--deflection-std", "0.1"), ""),
    (("--tool-mass", "80000"), "tool.mass_kg is 80000"), (("--deflection-std", "0.002"), "deflection_std_um is 0.002"),
    (("--spindle-rpm", "9"), "spindle_rpm is 9"), (("--tool-tcp", "12000,0,250"), "1.2e+04 mm from the flange"),
    (("--force-frame", "sensor", "--sensor-position", "0,0,0.08"), "sensor_position_mm is 0.08"),
    (("--tool-quaternion", "0,0,0,1"), "read as x y z w it would be no turn")])
def test_numbers_that_no_cell_has_are_said_by_init_and_check(tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    known = {"CS0119", "CS0117"}
    tcp = () if "--tool-tcp" in words else ("--tool-tcp", "120,0,250")
    made = kit.run("init", tmp_path / "new", "--robot", ROBOTS[1], *tcp, *words, "--json")
    checked = kit.run("check", tmp_path / "new" / "cell.yaml", "--json")
    for run in (made, checked):
        assert run.code == 0, run
        told = [one for one in run.json["findings"] if one["code"] in known]
        assert len(told) == bool(said), told
        assert all(said in one["message"] and Path(one["file"]) == tmp_path / "new" / "cell.yaml" for one in told)


def test_a_payload_in_grams_is_said_where_its_weight_is_subtracted(tmp_path: Path) -> None:
    shop = workshop(ROBOTS[0])
    cell = shop.files["cell.yaml"]
    stated = "force_log: {frame: base, sign: on_tool"
    assert cell.count(stated) == 1
    grams = cell.replace(stated, f"{stated}, payload: {{mass_kg: 71000, centre_of_mass_mm: [0, 0, 120]}}")
    told = [shop.run(tmp_path, {"cell.yaml": text}, *call("--force")) for text in (cell, grams)]
    assert ["CS0119" in kit.codes(done) for done in told] == [False, True], told
    assert "force_log.payload.mass_kg is 71000" in told[1].out


def test_a_prediction_is_no_measurement(tmp_path: Path) -> None:
    """`verify` and `learn` with the offsets.csv of the correction itself in place of what was measured."""
    shop = workshop(ROBOTS[0])
    assert shop.run(tmp_path, {}, *call("--offsets", "@offsets.csv")).code == 0
    learn = ("learn", "@cell.yaml", "@part.mod", "@offsets.csv", "--stiffness", "@stiffness.json", "--forces", "@forces.csv",
             "-o", "@learned.json")
    for words in (("verify", "@cell.yaml", "@offsets.csv", "@offsets.csv"), learn):
        run = shop.run(tmp_path, {}, *words)
        assert (run.code, kit.codes(run)) == (1, {"CS6039"})
    assert not (tmp_path / "learned.json").exists()


@pytest.mark.parametrize(("factor", "said"), [(1.0, None), (1 / 25.4, "in mil"), (2.1, "of the diameter"),
                                              (-1.0, "check sign")])
def test_readings_in_another_unit_are_named(tmp_path: Path, factor: float, said: str | None) -> None:
    """Before a correction, against what was predicted; the probe states its 1 sigma in the unit of its readings."""
    shop = workshop(ROBOTS[0])
    assert shop.run(tmp_path, {}, *call("--offsets", "@offsets.csv")).code == 0
    with (tmp_path / "offsets.csv").open(newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["note"] != "no force"]

    def table(share: float) -> str:
        lines = [",".join([row["target"], *(f"{factor * (share * float(row[name]) + 3 * (k % 3 - 1)):.6f}" for name in
                                            ("dx_um", "dy_um", "dz_um")), *3 * [f"{abs(factor) * 2:.6f}"]])
                 for k, row in enumerate(rows)]
        return "\n".join(["target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um", *lines]) + "\n"

    run = shop.run(tmp_path, {"before.csv": table(1.0), "after.csv": table(0.05)}, "verify", "@cell.yaml", "@before.csv",
                   "@after.csv", "--predicted", str(tmp_path / "offsets.csv"))
    told = [one["hint"] for one in run.json["findings"] if one["code"] == "CS6031"]
    assert bool(told) == bool(said), run
    assert all(str(said) in one for one in told)


def test_passes_that_share_next_to_no_place_are_not_compared(tmp_path: Path) -> None:
    """A part whose y is the other way round meets itself on a line only; half of a part is compared."""
    shop = workshop(ROBOTS[0])
    places = [(x, y) for x in range(0, 60, 5) for y in range(0, 50, 5)]

    def table(which: list[tuple[int, int]], sign: int, size: int) -> str:
        return "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um\n" + "".join(
            f"{x},{sign * y},0,{size + x % 7},{y % 5 - size},{size}\n" for x, y in which)

    before = table(places, 1, 100)
    for after, answer in ((table(places, 1, 10), 0), (table(places[::2], 1, 10), 0), (table(places, -1, 10), 0),
                          (table([(x, y) for x, y in places if y > 4 or x > 50], -1, 10), 1)):
        run = shop.run(tmp_path, {"before.csv": before, "after.csv": after}, "verify", "@cell.yaml", "@before.csv",
                       "@after.csv")
        assert run.code == answer, run
        assert ("CS6023" in kit.codes(run)) is bool(answer)


def test_watch_once_says_what_it_did_not_take(tmp_path: Path) -> None:
    """Logs of nearly the right name, a table, and nothing at all."""
    shop = workshop(ROBOTS[0])
    for name in ("cell.yaml", "stiffness.json"):
        (tmp_path / name).write_text(shop.files[name])
    (tmp_path / "in").mkdir()
    words = ("watch", tmp_path / "in", tmp_path / "out", "--cell", tmp_path / "cell.yaml", "--stiffness",
             tmp_path / "stiffness.json", "--once", "--settle", "0")
    assert "nothing new to correct" in kit.run(*words).err
    (tmp_path / "in" / "table.forces.csv").write_text(shop.files["forces.csv"])
    assert "CS6013" in kit.run(*words).err
    (tmp_path / "in" / "table.forces.csv").unlink()
    (tmp_path / "in" / "part.mod").write_text(shop.files["part.mod"])
    for name in ("part_forces.csv", "Part.Forces.csv"):
        (tmp_path / "in" / name).write_text(shop.files["forces.csv"])
        said = kit.run(*words).err
        assert f"is it {name}? Then rename it" in said
        (tmp_path / "in" / name).unlink()
    (tmp_path / "in" / "part.forces.csv").write_text(shop.files["forces.csv"])
    done = kit.run(*words).err
    assert "12 targets corrected" in done
    assert "nothing new" not in done
    assert "CS6013" not in done
    assert "nothing new to correct" in kit.run(*words).err
