"""Options as they are typed, in the units of their help: what is taken in SI, and what is refused just beyond."""

from __future__ import annotations

import os
import re
import shutil
from itertools import pairwise

import click
import pytest
from click.testing import CliRunner

from compensator.correction.settings import DEFAULTS, Estimate, Settings
from compstiff.cli import console, options
from compstiff.cli.main import compstiff as group
from tests.compstiff.cli.test_contract_console import Terminal

ALL = (*options.LOG_OPTIONS, *options.LEARNED_OPTIONS, *options.FORCE_OPTIONS, *options.OTHER_LOG, *options.POSTING_OPTIONS,
       *options.SPLITTING_OPTIONS, *options.MODULE_OPTIONS, *options.CORRECTION_OPTIONS, *options.CUT_OPTIONS,
       *options.FEED_OPTIONS)


def settings(*words: str) -> Settings | str:
    """What a call with these words asks for, or why it is a wrong one."""
    taken = []
    command = click.command()(options.with_settings(*ALL)(lambda settings: taken.append(settings)))
    done = CliRunner().invoke(command, list(words))
    return taken[0] if taken else " ".join(done.stderr.split())


def test_a_call_without_options_is_the_documented_default() -> None:
    """Though those are told in other units, and their defaults read as if they had been typed."""
    assert settings() == DEFAULTS == Settings()


@pytest.mark.parametrize(("option", "typed", "name", "value"), [
    ("--max-slope", "1", "slope", 1e-3), ("--max-slope", "2.5", "slope", 2.5e-3), ("--tolerance", "0.1", "tolerance", 1e-7),
    ("--tolerance", "20", "tolerance", 2e-5), ("--long-move", "0", "long_move", 0.0), ("--long-move", "12", "long_move", 0.012),
    ("--min-spacing", "1:20", "min_spacing", (1e-3, 0.02)), ("--scale", "1.1:0.05", "scale", (1.1, 0.05)),
    ("--scale", "0.2", "scale", (0.2, 0.0)), ("--scale", "10", "scale", (10.0, 0.0)),
    ("--cutting-stiffness", "2000:300", "cutting_stiffness", (2e6, 3e5)),
    ("--cutting-stiffness", "0.5", "cutting_stiffness", (500.0, 0.0)), ("--confidence", "0.5", "confidence", 0.5),
    ("--confidence", "0.999", "confidence", 0.999), ("--zone-mm", "0", "zone_mm", 0.0), ("--zone-mm", "200", "zone_mm", 200.0),
    ("--rapid-mm-s", "1", "rapid_mm_s", 1.0), ("--rapid-mm-s", "7000", "rapid_mm_s", 7000.0),
    ("--feed-mm-s", "0.001", "feed_mm_s", 0.001), ("--feed-mm-s", "7000", "feed_mm_s", 7000.0), ("--split", "1", "split", 1),
    ("--spindle-rpm", "0.1", "spindle_rpm", 0.1), ("--tool-x", "1,0,-2.5", "tool_x", (1.0, 0.0, -2.5)),
    ("--tare", "0:0", "tare", ((0, 0),)), ("--tare", "3:11", "tare", ((3, 11),)), ("--slot-depth", "3", "slot_depth", 3e-3),
    ("--depth-of-cut", "0.5", "depth_of_cut", 5e-4)])
def test_an_option_is_taken_in_its_unit_and_nothing_else_changes(option: str, typed: str, name: str, value: object) -> None:
    found = settings(option, typed)
    assert isinstance(found, Settings), found
    assert found.values()[name] == (value if name == "tare" else pytest.approx(value, rel=1e-12))
    assert {key: kept for key, kept in found.values().items() if key != name} == {
        key: kept for key, kept in DEFAULTS.values().items() if key != name}


@pytest.mark.parametrize(("option", "typed", "said"), [
    ("--max-slope", "0.999", "'0.999' is not a number of at least 1"), ("--max-slope", "nan", "'nan' is not a number of at"),
    ("--tolerance", "0.099", "is not a number of at least 0.1"),
    ("--tolerance", "inf", "'inf' is not a number of at least 0.1"),
    ("--long-move", "-0.001", "is not a number of at least 0"), ("--long-move", "far", "'far' is not a number of at least 0"),
    ("--scale", "0.199", "'0.199' is under 0.2: it is a factor, 1.1 for ten per cent more"),
    ("--scale", "10.1", "'10.1' is over 10: it is a factor"), ("--scale", "0", "'0' is not positive"),
    ("--scale", "1:-0.1", "is not a number of at least 0"), ("--scale", "1:x", "'x' is not a number of at least 0"),
    ("--cutting-stiffness", "0", "'0' is not positive"), ("--confidence", "0.499", "0.5<=x<=0.999"),
    ("--confidence", "0.9991", "0.5<=x<=0.999"), ("--zone-mm", "-0.1", "0<=x<=200"), ("--zone-mm", "200.1", "0<=x<=200"),
    ("--rapid-mm-s", "0.9", "1<=x<=7000"), ("--rapid-mm-s", "7001", "1<=x<=7000"), ("--feed-mm-s", "0", "0<x<=7000"),
    ("--feed-mm-s", "7001", "0<x<=7000"), ("--split", "0", "x>=1"), ("--spindle-rpm", "0", "x>0"),
    ("--tool-x", "1,2,3,4", "is not a direction such as 1,0,0"), ("--tool-x", "1,x,0", "is not a direction"),
    ("--tool-x", "inf,0,0", "has no direction"), ("--tare", "3", "is not a range of targets such as 0:3"),
    ("--tare", "3:", "is not a range of targets"), ("--tare", ":3", "is not a range of targets"),
    ("--tare", "-1:3", "is not a range of targets"), ("--slot-depth", "101", "'101' is over 100: in which unit is it?")])
def test_what_is_beyond_is_a_wrong_call(option: str, typed: str, said: str) -> None:
    """In one sentence with what was typed."""
    found = settings(option, typed)
    assert isinstance(found, str)
    assert said in found


def test_an_estimate_that_was_read_is_one() -> None:
    """As click reads a default again."""
    kind = options.ScaledEstimate(1e3, 0.2, 10.0)
    assert kind.convert(Estimate(5e9, 1.0), None, None) == Estimate(5e9, 1.0)
    assert options.Direction().convert((1, 0, 0), None, None) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize(("typed", "part"), [("1/1", (1, 1)), ("2/8", (2, 8)), ("8/8", (8, 8)), ("9/8", None), ("0/8", None),
                                             ("1/2/3", None), ("1", None), ("1/0", None)])
def test_a_shard_is_one_of_so_many(typed: str, part: tuple[int, int] | None) -> None:
    kind = options.Shard()
    if part:
        assert kind.convert(typed, None, None) == part
    else:
        with pytest.raises(click.BadParameter, match=f"'{typed}' is no part K/N, 1 <= K <= N"):
            kind.convert(typed, None, None)


@pytest.mark.parametrize("width", [30, 60])
def test_sentences_go_on_below_on_a_terminal_and_what_is_copied_does_not(monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    """Between words alone, further lines two blanks further in; a table, a call with options and what is piped stay whole."""
    sentence = "a sentence that has a good many words of several sizes, and a well-known-hyphenated word at its end"
    whole = ["k2      4e+06                   3.8e+06 ... 4.22e+06         reliable, and more than there is room for",
             "next: compstiff correct cell.yaml part.mod --forces part.forces.csv -o corrected.mod", "", "short"]
    text = "\n".join([sentence, f"   {sentence}", *whole])
    with monkeypatch.context() as patched:      # pytest asks for the size of its own terminal as soon as the test has ended
        patched.setattr(shutil, "get_terminal_size", lambda *_, **__: os.terminal_size((width, 24)))
        assert console._in_lines(text, Terminal(False)) == text
        shown = console._in_lines(text, Terminal(True)).split("\n")
    assert shown[-4:] == whole
    first = next(k for k, line in enumerate(shown) if line.startswith("   a"))
    for lines, indent in ((shown[:first], 0), (shown[first:-4], 3)):
        assert " ".join(line.strip() for line in lines) == sentence
        assert [len(line) - len(line.lstrip()) for line in lines] == [indent, *[indent + 2] * (len(lines) - 1)]
        assert len(lines) > 1
        assert all(len(line) <= width for line in lines)
        # No line has room for the word with which the next begins.
        assert all(len(line) + 1 + len(after.split()[0]) > width for line, after in pairwise(lines))


def headings(command: str) -> list[str]:
    return re.findall(r"^(\w[^\n]*):$", CliRunner().invoke(group, [command, "-h"], terminal_width=100).output, re.MULTILINE)


def test_long_lists_of_options_have_headings_and_short_ones_none() -> None:
    """What all commands share stands last, with the help itself; the options without a heading first."""
    found = headings("correct")
    assert found[0] == "Options"
    assert found[-2:] == ["Common", "Examples"]
    assert len(set(found)) == len(found) > 5
    text = CliRunner().invoke(group, ["correct", "-h"], terminal_width=100).output
    common = text.partition("\nCommon:\n")[2].partition("\nExamples:")[0]
    assert re.findall(r"^  (-\w, )?(--\w+) {2,}\w", common, re.MULTILINE) == [
        ("", "--json"), ("-q, ", "--quiet"), ("-v, ", "--verbose"), ("", "--force"), ("-h, ", "--help")]
    assert "Common" not in headings("robots")
    short = CliRunner().invoke(group, ["robots", "-h"], terminal_width=100).output.partition("Options:")[2]
    assert re.findall(r"^  (?:-\w, )?(--[\w-]+)", short, re.MULTILINE)[:3] == ["--json", "--quiet", "--verbose"]
