"""Every refusal says file, line and column."""

import numpy as np
import pytest

from compensator.posting.apt import read_apt
from identification.common.findings import CompstiffError

HEAD = "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/30,20,5\n"         # three lines


@pytest.mark.parametrize(("text", "code", "line", "column", "says"), [
    ("GOTO/1,2,x", "CS2101", 4, 10, "'X'|'x'"),
    ("  GOTO/1,,3", "CS2101", 4, 10, "found nothing, expected a number"),
    ("GOTO/ 1,   x, 3", "CS2101", 4, 12, "'x'"),
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/20,30,5,20,30,5,7", "CS2101", 5, 22, "found 7 numbers, expected 3"),
    ("GOTO/1,2,3,4", "CS2101", 4, 12, "found 4 numbers, expected 3"),
    ("GOTO/1,2,$\n  nan", "CS2101", 5, 3, "'nan'"),
    ("GOTO/1_0,2,3", "CS2101", 4, 6, "'1_0'"),
    ("GOTO/P1", "CS2101", 4, 6, "P1"),
    ("GOTO/1,2,$", "CS2101", 4, None, "end of the file"),
    ("1,2,3", "CS2102", 4, 1, "moves the tool"),
    ("P1=POINT/1,2,3", "CS2102", 4, 1, "P1"),
    ("TRACUT/M1", "CS2101", 4, 8, "found 1 arguments, expected 12 numbers"),
    ("TRACUT/2,0,0,5,0,1,0,0,0,0,1,0", "CS2182", 4, 8, "no rotation"),
    ("TRACUT/1,0,0,5,0,1,0,0,0,0,-1,0", "CS2182", 4, 8, "mirror"),
    ("TRACUT/1,0,0,1e9,0,1,0,0,0,0,1,0", "CS2101", 4, 14, "found 1E9, expected at most 100 m"),
    ("CSYS/1,0,0,0,0,1,0,0,0,0,1,5", "CS2182", 4, 6, "no TRNTYP/WORLD"),
    ("CSYS/0,0,1,0,0,-1,0,0,1,0,0,0", "CS2182", 4, 6, "no TRNTYP/WORLD"),
    ("TRNTYP/WORLD,0,0,5", "CS2182", 4, 1, "expected TRNTYP/WORLD,0,0,0"),
    ("TRNTYP/LOCAL", "CS2182", 4, 1, "not known where the points stand"),
    ("TRNTYP/WORLD,0,0,0\nCSYS/0,0,1,0,0,-1,0,0,1,0,0,0\nGOTO/1,2,3", "CS2112", 6, 1, r"CSYS that is turned \(line 5\)"),
    ("$$-> CSYS / 0, -1, 0, 0, $\n 1, 0, 0, 0, $\n 0, 0, 1, 0", "CS2182", 4, 1, "Creo does not say"),
    ("GOTO/1,2,1e300", "CS2101", 4, 10, "found 1E300, expected at most 100 m"),
    ("FEDRAT/1e300\nGOTO/1,2,3", "CS2107", 5, 1, "expected 1e-06 to 100000"),
    ("CIRCLE/20,20,5,0,0,1,10,.1,.1,1,0,TIMES,1e9\nGOTO/30,20,0", "CS2108", 4, 1, "n from 1 to 1000"),
    ("MOVARC/20,20,5,0,0,1,10,ANGLE,1e300\nGOTO/20,30,5", "CS2108", 4, 31, "up to 360000"),
    ("CIRCLE/20,20,5,0,0,1\nGOTO/20,30.05,5", "CS2108", 4, 1, r"end is \+0.0500 mm off"),
    ("CIRCLE/30,20,5,0,0,1\nGOTO/20,30,5", "CS2108", 4, 1, "the radius is 0 mm"),
    ("UNIT/FEET", "CS2105", 4, 6, "UNIT: found FEET"),
    ("METRIC", "CS2105", 4, 1, "may be the unit of length"),
    ("PPUNIT/3", "CS2105", 4, 1, "may be the unit of length"),
    ("SYSTEM/INCH", "CS2105", 4, 1, "found SYSTEM/INCH"),
    ("SYSTEM/MM,INCH", "CS2105", 4, 1, "found SYSTEM/MM,INCH"),
    ("CALSUB/5", "CS2102", 4, 1, "CALSUB"),
    ("TLCOMP/ON,LEFT", "CS2102", 4, 1, "TLCOMP"),
    ("CYCLE83/10,0,2,-50", "CS2102", 4, 1, "CYCLE83"),
    ("SYN/G,GOTO", "CS2102", 4, 1, "what words mean"),
    ("GOFWD/C1", "CS2102", 4, 1, "GOFWD"),
    ("CYCLE/DRILL,5,MMPM,100", "CS2102", 4, 13, "found '5', expected one of DEPTH, FEDTO"),
    ("CYCLE/TAP,DEPTH,5,CLEAR,1", "CS2102", 4, 1, "of the drilling cycles DRILL, FACE, DEEP, DEEP2 are driven"),
    ("CYCLE/BRKCHP,DEPTH,5,CLEAR,1,STEP,1", "CS2102", 4, 1, "in its own way"),
    ("CYCLE/DRILL,DEPTH,5,MMPM,100", "CS2102", 4, 1, "without CLEAR or RAPTO"),
    ("CYCLE/DRILL,CLEAR,1", "CS2102", 4, 1, "without DEPTH or FEDTO"),
    ("CYCLE/DEEP,DEPTH,5,CLEAR,1", "CS2102", 4, 1, "without STEP or 1STPECK"),
    ("CYCLE/DRILL,DEPTH,5,DEPTH,6,CLEAR,1", "CS2102", 4, 21, "found 'DEPTH'"),
    ("CYCLE/DRILL,DEPTH,5,CLEAR,1,THRU", "CS2102", 4, 29, "found 'THRU'"),
    ("CYCLE/DRILL,DEPTH,x,CLEAR,1", "CS2101", 4, 19, "'x'"),
    ("CYCLE/DRILL,DEPTH,0,CLEAR,1", "CS2102", 4, 1, "above zero"),
    ("CYCLE/DEEP,DEPTH,5,STEP,1e-9,CLEAR,1", "CS2102", 4, 1, "over 1000 pecks"),
    ("CYCLE/DRILL,DEPTH,5,CLEAR,1,MMPM,0", "CS2107", 4, 1, "a feed above zero"),
    ("CYCLE/DRILL,DEPTH,5,CLEAR,1\nRAPID\nGOTO/1,2,3", "CS2102", 6, 1, "RAPID before a GOTO"),
    ("CYCLE/DRILL,DEPTH,5,CLEAR,1\nGODLTA/1,2,3", "CS2102", 5, 1, "other than GOTO while CYCLE/DRILL"),
    ("RAPID/MODAL,ON", "CS2102", 4, 7, "RAPID alone"),
    ("GOHOME\nGOTO/1,2,3", "CS2102", 4, 1, "behind GOHOME"),
    ("CUTCOM/LEFT,1\nPAINT/PATH\nGOTO/1,2,3", "CS2103", 6, 1, r"CUTCOM/LEFT,1 \(line 4\)"),
    ("CUTCOM\nGODLTA/1,2,3", "CS2103", 5, 1, r"while CUTCOM \(line 4\)"),
    ("CUTCOM/RIGHT,XYPLAN,7\nCYCLE/DRILL,DEPTH,5,CLEAR,1\nGOTO/1,2,3", "CS2103", 6, 1, r"CUTCOM/RIGHT,XYPLAN,7 \(line 4\)"),
    ("CUTCOM/OFF\nCUTCOM/LEFT\nCIRCLE/20,20,5,0,0,1,10\nGOTO/20,30,5", "CS2103", 7, 1, r"CUTCOM/LEFT \(line 5\)"),
    ("UNITS/FEET", "CS2105", 4, 7, "FEET"),
    ("FEDRAT/0,MMPM", "CS2107", 4, 8, "above zero"),
    ("FEDRAT/INVERS,AUTO", "CS2101", 4, 8, "INVERS"),
    ("FEDRAT/0.1,MMPR\nGOTO/1,2,3", "CS2107", 5, 1, "no SPINDL"),
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/20,30.05,5", "CS2108", 4, 1, r"end is \+0.0500 mm off"),
    ("CIRCLE/20,21,5,0,0,1,10\nGOTO/20,30,5", "CS2108", 4, 1, "start is"),
    ("CIRCLE/20,20,5,0,0", "CS2108", 4, 1, "found 5 numbers"),
    ("CIRCLE/20,20,5,0,0,2,10\nGOTO/20,30,5", "CS2108", 4, 16, "length 2"),
    ("CIRCLE/20,20,5,0,0,1,10", "CS2108", 4, 1, "no GOTO behind"),
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/20,10,5,20,30,5,10,20,5", "CS2108", 4, 1, "do not follow"),
    ("MOVARC/20,20,5,0,0,1,10,ANGLE,80\nGOTO/20,30,5", "CS2108", 4, 1, "80.0000 degrees"),
    ("TLON,GOFWD/ (CIRCLE/20,20,5,10),ON,(LINE/20,20,5,20,30,5)", "CS2108", 4, 1, "INDIRV"),
    ("INDIRV/1,0,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,(LINE/20,20,5,20,30,5)", "CS2108", 5, 1, "not along the circle"),
    ("INDIRV/0,-1,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,(LINE/20,20,5,20,30,5)", "CS2108", 5, 1, "270.0 degrees"),
    ("INDIRV/0,1,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,(LINE/20,20,5,10.0034,19.7382,5)", "CS2108", 5, 1, "181.5 degrees"),
    ("INDIRV/0,1,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,(LINE/25,20,5,20,30,5)", "CS2108", 5, 1, "start at its centre"),
    ("LOADTL/1\nGOTO/1,2,3\nLOADTL/2\nGOTO/1,2,3", "CS2110", 6, 1, "tool 2 behind tool 1"),
    ("MSYS/0,0,0,1,0,0,0,1,0\nMSYS/0,0,5,1,0,0,0,1,0", "CS2110", 5, 1, "second coordinate system"),
    ("$$*CATIA0\n$$ 1 0 0 0\n$$ 0 1 0 0\n$$ 0 0 1 0\n$$*CATIA0\n$$ 1 0 0 9\n$$ 0 1 0 0\n$$ 0 0 1 0", "CS2110", 11, 1, "second"),
    ("MULTAX/OFF\nGOTO/1,2,3,0.6,0,0.8", "CS2112", 5, 12, "MULTAX is off"),
    ("GOTO/1,2,3,0,0,0", "CS2112", 4, 12, "length 0"),
    ("INDIRV/0,0,0", "CS2108", 4, 8, "INDIRV: the direction has no length"),
    ("INDIRV/1,0", "CS2101", 4, 8, "INDIRV: found 2 numbers, expected 3"),
    ("GODLTA/1,2,3,4", "CS2101", 4, 8, "GODLTA: found 4 numbers, expected 3"),
    ("FROM/1,2", "CS2101", 4, 6, "FROM: found 2 numbers, expected 3 or 6"),
    ("FROM/1,2,3,0,0,1,7", "CS2101", 4, 6, "FROM: found 7 numbers"),
    ("GOHOME/1,2,3,4", "CS2101", 4, 8, "GOHOME: found 4 numbers, expected 3 or 6"),
    ("FEDRAT/600,700", "CS2101", 4, 12, "FEDRAT: found '700', expected a value and one of"),
    ("FEDRAT/MMPM,600,PRES", "CS2101", 4, 17, "found 'PRES'"),
    ("CIRCLE/-69970,20,5,0,0,1,70000,.1,.1,1,0,TIMES,1000\nGOTO/30,20,0", "CS2108", 4, 1,
     r"the arc makes 1000 turns in \d.* chords, at most 1000 and 1000000"),
    ("INDIRV/0,1,0\nTLON,GOFWD/ (CIRCLE/20,20,5),ON,(LINE/20,20,5,20,30,5)", "CS2108", 5, 1,
     "CIRCLE: found 3 numbers and 6 of LINE, expected 4 and 6"),
    ("INDIRV/0,1,0\nTLON,GOFWD/ (CYLNDR/20,20,5,10),ON,(LINE/20,20,5,20,30)", "CS2108", 5, 1,
     "CYLNDR: found 4 numbers and 5 of LINE, expected 7 and 6"),
    ("CYCLE/DRILL,DEPTH,5,CLEAR,1,DWELL,x", "CS2101", 4, 35, "'X'|'x'"),
    # Just beyond what is read below.
    ("GOTO/0,0,100001", "CS2101", 4, 10, "expected at most 100 m"),
    ("FEDRAT/6100000\nGOTO/1,2,3", "CS2107", 5, 1, "found a feed of 101667 mm/s"),
    ("FEDRAT/0.00005\nGOTO/1,2,3", "CS2107", 5, 1, "found a feed of 8.33333e-07 mm/s"),
    ("CIRCLE/20,20,5,0,0,1,10.022\nGOTO/20,30.022,5", "CS2108", 4, 1, r"start is -0.0220 mm off"),
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/20,29.978,5", "CS2108", 4, 1, r"end is -0.0220 mm off"),
    ("CIRCLE/30.018,20,5,0,0,1\nGOTO/30.018,20.018,5", "CS2108", 4, 1, "the radius is 0.018 mm, more than 0.02"),
    ("CIRCLE/20,20,5,0,0,1,10,.1,.1,1,0,TIMES,1001\nGOTO/30,20,0", "CS2108", 4, 1, "n from 1 to 1000"),
    ("MOVARC/20,20,5,0,0,1,10,ANGLE,360360\nGOTO/30,20,5", "CS2108", 4, 31, "up to 360000"),
    ("MOVARC/20,20,5,0,0,1,10,ANGLE,90.7\nGOTO/20,30,5", "CS2108", 4, 1, "stated to turn by 90.7000 degrees, its end is at 90"),
    ("CIRCLE/20,20,5,0,0,1.002,10\nGOTO/20,30,5", "CS2108", 4, 16, "length 1.002"),
    ("GOTO/1,2,3,0,0,1.0011", "CS2112", 4, 12, r"the tool axis \[0.0, 0.0, 1.0011\] has length 1.001, expected 1"),
    ("MULTAX/OFF\nGOTO/1,2,3,0.0000014,0,1", "CS2112", 5, 12, r"where it would stay \[0.0, 0.0, 1.0\]"),
    ("CYCLE/DEEP,DEPTH,10,STEP,0.00999,CLEAR,1", "CS2102", 4, 1, "over 1000 pecks"),
    ("TRACUT/1,0,0,5,0,1,0.00003,0,0,0,1,0", "CS2182", 4, 8, "no rotation"),
    ("INDIRV/0.55,0.8,0\nTLON,GOFWD/ (CIRCLE/20,20,5,1e5),ON,(LINE/20,20,5,20,30,5)", "CS2108", 5, 1, "start is"),
    ("INDIRV/0,1,0\nTLON,GOFWD/ (CIRCLE/20,20,5,100001),ON,(LINE/20,20,5,20,30,5)", "CS2101", 5, 1, "numbers up to 100000"),
    ("INDIRV/0.88,0.475,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,(LINE/20,20,5,20,30,5)", "CS2108", 5, 1, r"\(62 degrees off\)"),
    ("INDIRV/0,1,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,(LINE/20.022,20,5,20,30,5)", "CS2108", 5, 1, "start at its centre"),
    ("INDIRV/0,1,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,2,INTOF,(LINE/20,20,5,10.0034,20.2618,5)", "CS2108", 5, 1,
     "178.5 degrees"),
])
def test_refusals(tmp_path, text, code, line, column, says):
    file = tmp_path / "part.apt"
    file.write_text(HEAD + text + "\n")
    with pytest.raises(CompstiffError, match=says) as caught:
        read_apt(file)
    found = caught.value.findings[0]
    assert (found.code, found.file, found.line, found.column) == (code, str(file), line, column)


@pytest.mark.parametrize("text", [
    "GOTO/0,0,99999", "FEDRAT/5900000\nGOTO/1,2,3", "FEDRAT/0.00007\nGOTO/1,2,3",
    "CIRCLE/20,20,5,0,0,1,10.018\nGOTO/20,30.018,5", "CIRCLE/20,20,5,0,0,1,10\nGOTO/20,29.982,5",
    "CIRCLE/30.022,20,5,0,0,1\nGOTO/30.022,20.022,5", "CIRCLE/20,20,5,0,0,1,10,.1,.1,1,0,TIMES,1000\nGOTO/30,20,0",
    "MOVARC/20,20,5,0,0,1,10,ANGLE,360000\nGOTO/30,20,0", "MOVARC/20,20,5,0,0,1,10,ANGLE,90.5\nGOTO/20,30,5",
    "CIRCLE/20,20,5,0,0,1.0009,10\nGOTO/20,30,5", "GOTO/1,2,3,0,0,1.0009\nGOTO/1,2,3,0,0,0.9991",
    "MULTAX/OFF\nGOTO/1,2,3,0.0000007,0,1\nGOTO/1,2,3",
    "TRNTYP/WORLD,0,0,0\nCSYS/0,0,1,0,0,-1,0,0,1,0,0,0\nGOTO/1,2,3,0,0,1\nGOTO/1,2,3",
    "CYCLE/DEEP,DEPTH,10,STEP,0.01001,CLEAR,1\nGOTO/1,2,3",
    "TRACUT/1,0,0,5,0,1,0.000009,0,0,-0.000009,1,0\nGOTO/1,2,3",
    "INDIRV/0.85,0.527,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,(LINE/20,20,5,20,30,5)",
    "INDIRV/0,1,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,(LINE/20.018,20,5,20,30,5)",
    # Half a turn, but for a degree: either may be meant.
    "INDIRV/0,1,0\nTLON,GOFWD/ (CIRCLE/20,20,5,10),ON,2,INTOF,(LINE/20,20,5,10.0015,20.1745,5)",
])
def test_just_within_its_limits_it_is_read(tmp_path, text):
    (tmp_path / "part.apt").write_text(HEAD + text + "\n")
    assert read_apt(tmp_path / "part.apt").position.shape[0] > 1


@pytest.mark.parametrize(("data", "code"), [
    (b"\xff\xfeG\x00O\x00", "CS2100"),
    (b"UNITS/MM\n", "CS2113"),
    (b"", "CS2113"),
    (b"UNITS/MM\nGOTO/1,2,3\n", "CS2107"),
    (b"FEDRAT/1,MMPM\nFEDRAT/1,IPM\nGOTO/1,2,3\n", "CS2105"),
    (b"UNITS/MM\nFEDRAT/1\nCIRCLE/0,0,0,0,0,1,5\nGOTO/1,2,3\n", "CS2108"),
])
def test_files_without_a_path(tmp_path, data, code):
    file = tmp_path / "part.apt"
    file.write_bytes(data)
    with pytest.raises(CompstiffError, match=code) as caught:
        read_apt(file)
    assert caught.value.findings[0].line is not None


@pytest.mark.parametrize("harmless", ["CUTCOM/OFF", "CUTCOM/LEFT,1\nCUTCOM/OFF", "CUTCOM/LENGTH,5", "CYCLE/OFF",
                                      "TRACUT/NOMORE", "ORIGIN/0.0,0,0", "CUTCOM/ADJUST,1",
                                      "LOADTL/2", "CYCLE/INIT", "CSYS/1.,0,0,0,0,1.,0,0,0,0,1.,0", "TRNTYP/WORLD,0,0,0",
                                      "TLCOMP/OFF", "$$-> CSYS / 1, 0, 0, 0, 0, 1, 0, 0, $\n 0, 0, 1, 0"])
def test_words_that_change_nothing_are_taken(tmp_path, harmless):
    file = tmp_path / "part.apt"
    file.write_text(f"{HEAD}{harmless}\nGOTO/1,2,3\n")
    assert len(read_apt(file)) == 2


@pytest.mark.parametrize("word", ["MAGAZN/5,MM", "MAGAZN/IN,OUT", "MAGAZN"])
def test_a_unit_among_other_arguments_says_no_unit_of_the_file(tmp_path, word):
    """Passed over, as every word that nobody knows is, and said."""
    file = tmp_path / "part.apt"
    file.write_text(f"{HEAD}{word}\nGOTO/1,2,3\n")
    read = read_apt(file)
    assert len(read) == 2
    assert any("MAGAZN" in finding.message for finding in read.findings)


def test_from_and_gohome_state_the_tool_s_axis_too(tmp_path):
    """With six numbers: the moves behind them have it, until another is stated."""
    file = tmp_path / "part.apt"
    file.write_text("UNITS/MM\nMULTAX/ON\nFEDRAT/600,MMPM\nFROM/0,0,50,0,0.6,0.8\nGOTO/1,2,3\nGOHOME/0,0,60,0.6,0,0.8\n")
    read = read_apt(file)
    np.testing.assert_allclose(1e3 * read.position, [[1, 2, 3], [0, 0, 60]], atol=1e-9)
    np.testing.assert_allclose(read.axis, [[0, 0.6, 0.8], [0.6, 0, 0.8]], atol=1e-12)
    assert read.rapid.tolist() == [False, True]


def test_deep_holes_of_nx_are_those_of_the_others(tmp_path):
    """CYCLE/DRILL,DEEP is CYCLE/DEEP."""
    def read(words):
        (tmp_path / "part.apt").write_text(f"{HEAD}CYCLE/{words},DEPTH,10,STEP,4,CLEAR,2\nGOTO/1,2,3\nCYCLE/OFF\nGOTO/9,9,9\n")
        return read_apt(tmp_path / "part.apt")
    deep, plain = read("DRILL,DEEP"), read("DEEP")
    assert len(deep) == len(plain) > 6
    np.testing.assert_array_equal(deep.position, plain.position)
    # The bottom of each peck, of a point at 3.
    assert sorted({round(1e3 * z, 6) for z in deep.position[deep.stop, 2]}) == [-7, -5, -1]


@pytest.mark.parametrize(("dwell", "remark"), [
    ("DWELL,1.5", "DWELL 1.5 at the bottom"), ("DWELL,REV,3", "DWELL 3 turns at the bottom"), ("", "")])
def test_a_dwell_is_told_not_driven(tmp_path, dwell, remark):
    """Behind it the words of the cycle go on."""
    words = ",".join(filter(None, ("CYCLE/DRILL,DEPTH,10", dwell, "CLEAR,2")))
    (tmp_path / "part.apt").write_text(f"{HEAD}{words}\nGOTO/1,2,3\nCYCLE/OFF\n")
    read = read_apt(tmp_path / "part.apt")
    assert 1e3 * read.position[:, 2].min() == pytest.approx(-7)
    assert any("DWELL is not driven" in finding.message for finding in read.findings) == bool(dwell)
    assert [remark in text for texts in read.remarks.values() for text in texts if "DWELL" in text] == ([True] if dwell else [])


@pytest.mark.parametrize(("cycle", "holes", "said"), [
    ("DRILL,DEPTH,10,CLEAR,2,RTRCTO,20", 1, []), ("DRILL,DEPTH,10,CLEAR,2,RTRCTO,20", 2, []),
    ("DEEP,DEPTH,10,STEP,4,CLEAR,2,RTRCTO,20", 1, ["chips"]), ("DRILL,DEPTH,10,CLEAR,2", 1, ["back"]),
    ("DRILL,DEPTH,10,DWELL,1,CLEAR,2,RTRCTO,20", 1, ["dwell"]),
    ("DEEP,DEPTH,10,STEP,4,DWELL,1,CLEAR,2", 2, ["chips", "back", "dwell"])])
def test_holes_are_told_with_what_was_made_of_them(tmp_path, cycle, holes, said):
    """From the first cycle on; of a part without any nothing is."""
    words = {"chips": "chips are cleared up to the clearance, and the tool comes back in the air to 1 mm above the depth it "
             "had reached", "dwell": "DWELL is not driven",
             "back": "the tool goes back to the height it had before the cycle, for no RETURN or RTRCTO says how far"}
    other = "GOTO/9,2,3\n" * (holes - 1)
    (tmp_path / "part.apt").write_text(f"{HEAD}CYCLE/{cycle}\nGOTO/1,2,3\n{other}CYCLE/OFF\nGOTO/9,9,9\n")
    [found] = [one for one in read_apt(tmp_path / "part.apt").findings if one.code == "CS2183"]
    assert (found.level, found.line) == ("note", 4)
    assert found.message.split("; ") == [
        f"{holes} hole{'s' * (holes > 1)} of drilling cycles (from CYCLE/{cycle} on) became single moves, with a stop at the "
        "bottom", *(words[one] for one in said)]
    (tmp_path / "part.apt").write_text(f"{HEAD}CYCLE/{cycle}\nCYCLE/OFF\nGOTO/9,9,9\n")
    assert "CS2183" not in [one.code for one in read_apt(tmp_path / "part.apt").findings]
