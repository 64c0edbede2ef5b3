"""The call that is named next is of the same job: what was said of its log and of its cut is in it, and nothing else."""

from __future__ import annotations

import html
import re
import shlex
from pathlib import Path

import pytest

from compensator.correction.settings import Estimate, Settings
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.user_files import Job


@pytest.mark.parametrize(("chosen", "words"), [
    ({}, ""), ({"tare": ((0, 2), (7, 7)), "trust_tare": True, "spindle_rpm": 9000.0},
               "--tare 0:2 --tare 7:7 --trust-tare --spindle-rpm 9000"),
    ({"log_format": "rsi", "scale": Estimate(1.1, 0.02)}, "--log-format rsi --scale 1.1:0.02"),
    ({"scale": Estimate(1.1, 0.0), "depth_of_cut": 1.5e-3, "slot_depth": 2e-3},
     "--scale 1.1 --depth-of-cut 1.5 --slot-depth 2"),
    ({"cutting_stiffness": Estimate(30e3, 4.5e3)}, "--cutting-stiffness 30:4.5"),
    ({"cutting_stiffness": Estimate(30e3, 0.0)}, "--cutting-stiffness 30:0"),
    ({"logged_with": Path("o.csv"), "first_forces": Path("f.csv")}, "--logged-with o.csv --first-forces f.csv"),
    ({"accept_rejected": True, "predict_force": Path("c.json"), "stock": Path("s.yaml")},
     "--accept-rejected --predict-force c.json --stock s.yaml"),
    ({"learned": Path("l.json"), "repeats": "job"}, "--learned l.json --repeats job"),
    ({"tolerance": 1e-6, "keep_targets": True, "confidence": 0.9}, "")])
def test_what_was_said_of_log_and_cut_is_in_the_words_of_the_next_call(chosen: dict[str, object], words: str) -> None:
    assert " ".join(Settings.of(**chosen).as_options()) == words


@pytest.mark.parametrize("first", [False, True])
def test_the_correction_that_a_budget_names_next_is_the_one_that_it_worked_out(tmp_path: Path, first: bool) -> None:
    """Of a second pass, whose program had offsets, with a stated cut: in the terminal and on the page; its own page names the
    budget of the same pass."""
    program = line(45, 4).program()
    job = Job(tmp_path, program=program, forces="target,fx_n,fy_n,fz_n\n" + "".join(
        f"{k},60,{150 + 2 * k},-80\n" for k in range(45)))
    assert job.correct("--keep-targets").code == 0
    (tmp_path / "sent.csv").write_bytes(job.offsets_file.read_bytes())
    (tmp_path / "first.csv").write_text(str(job.forces))
    job.forces = str(job.forces).replace(",60,", ",66,")
    said = ("--cutting-stiffness", "30:5", "--logged-with", tmp_path / "sent.csv",
            *(("--first-forces", tmp_path / "first.csv") if first else ()))
    page = tmp_path / "page.html"
    told = job.predict(*said, "--budget", "--tolerance-um", "100", "--report", page, "--force")
    assert told.code == 0, told
    named = shlex.split(told.err.split("next: ")[1].splitlines()[0])
    assert set(map(str, said)) < set(named)
    assert "--logged-with" in html.unescape(page.read_text())
    named[named.index("-o") + 1] = str(tmp_path / "next.mod")
    assert kit.run(*named[1:]).code == 0
    assert job.correct(*said, "--force", "--report", page).code == 0
    assert (tmp_path / "next.mod").read_bytes() == job.out.read_bytes()
    (of_page,) = re.findall(r"compstiff predict .*--budget.*?</code>", page.read_text())
    assert set(map(str, said)) < set(shlex.split(html.unescape(re.sub(r"<[^>]*>", "", of_page))))
