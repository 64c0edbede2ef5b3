"""Toolpaths of other systems in a folder: known by their ending, paired by their stem."""

from pathlib import Path

from compstiff.batch.pairing import Folders, paired, programs_in


def test_every_ending_that_is_read_is_found_with_its_log(tmp_path):
    for name in ("a.mod", "b.ncl.3", "c.aptsource", "d.CLS", "e.ncl", "f.mod.1", "g.txt", "b.forces.csv", "c.forces.csv",
                 ".h.ncl.1"):
        (tmp_path / name).write_text("")
    programs = programs_in(tmp_path)
    assert [path.name for path in programs] == ["a.mod", "b.ncl.3", "c.aptsource", "d.CLS", "e.ncl"]
    files = {one.program.name: one for one in paired(programs, None, Folders(Path("out"), Path("out"), Path("out")))}
    assert [log.name for log in files["b.ncl.3"].logs] == ["b.forces.csv"]
    assert [path.name for path in files["b.ncl.3"].outputs.files()][:3] == ["b.mod", "b.mod.json", "b.offsets.csv"]
    assert files["e.ncl"].logs == ()


def test_two_versions_of_one_file_are_rivals(tmp_path):
    for name in ("a.ncl.1", "a.ncl.2"):
        (tmp_path / name).write_text("")
    assert all(one.rival for one in paired(programs_in(tmp_path), None, Folders(Path("out"))))
