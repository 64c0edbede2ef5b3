"""Laws that hold for any program: layout does not matter, nothing crashes, what is written reads back."""

from contextlib import suppress
from itertools import pairwise
from random import Random

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from compensator.rapid import read_rapid, rewrite
from compensator.toolpath import Move
from identification.common.findings import CompstiffError
from tests.compensator.rapid.small_programs import same

UNUSED = "[ 9E9 , 9E9 , 9E9 , 9E9 , 9E9 , 9E9 ]"
PLAIN = f"""MODULE Part
LOCAL CONST robtarget p10 := [ [ 1.5 , -2 , 3 ] , [ 0 , 1 , 0 , 0 ] , [ 0 , -1 , 0 , 0 ] , {UNUSED} ] ;
CONST robtarget pts {{ 2 }} := [ p10 , [ [ 4 , 5 , 6 ] , [ 1 , 0 , 0 , 0 ] , [ 0 , 0 , 0 , 0 ] , {UNUSED} ] ] ;
PERS tooldata mill := [ TRUE , [ [ 0 , 0 , 200 ] , [ 1 , 0 , 0 , 0 ] ] , [ 1 , [ 0 , 0 , 1 ] , [ 1 , 0 , 0 , 0 ] , 0 , 0 ,
                                                                          0 ] ] ;
PROC main ( num n , \\ switch s )
VAR robtarget p20 := [ [ 7 , 8 , 9 ] , [ 0 , 0 , 1 , 0 ] , [ 0 , 0 , 0 , 0 ] , {UNUSED} ] ;
IF n > 1 THEN
MoveL p10 , v100 , z1 , mill \\ WObj := wobj0 ;
ENDIF
IF n = 1 MoveJ p20 , v50 , fine , mill ;
MoveL [ [ 10 , 11 , 12 ] , [ 1 , 0 , 0 , 0 ] , [ 0 , 0 , 0 , 0 ] , {UNUSED} ] , v200 \\ V := 30 , z5 , mill ;
MoveC Offs ( p10 , 1 , 2 , - 3 ) , pts {{ 2 }} , v100 , z1 , tool0 \\ Corr ;
again :
MoveAbsJ [ [ 1 , 2 , 3 , 4 , 5 , 6 ] , {UNUSED} ] \\ NoEOffs , v100 , z1 , mill ;
MoveL CRobT ( ) , v100 , z1 , mill ;
MoveL RelTool ( p20 , 0 , 0 , 5 \\ Rz := 90 ) , [ 10 , 500 , 5000 , 1000 ] , z1 , mill ;
ENDPROC
ENDMODULE"""
WORDS = PLAIN.split()
REFERENCE = read_rapid(PLAIN.encode(), "x").toolpath
# between two words there must be something; beside a bracket or comma there need not be
GAPS = [" ", " ", "\t", "\n", "\r\n", "\r", "\r\r\n", "! a ; \" comment [1]\n", "! MoveL *,v5,z1,tool0;\r\n", " \n "]


def glued(before: str, after: str) -> bool:
    return not (before[-1].isalnum() and after[0].isalnum())


def layout(seed: int) -> str:
    """The reference with other blanks, comments, line ends and letter case. A seed, because one draw a blank is slow."""
    random = Random(seed)
    text = WORDS[0]
    for before, word in pairwise(WORDS):
        gap = "" if glued(before, word) and random.random() < 0.5 else random.choice(GAPS)
        text += gap + random.choice([word, word.upper(), word.lower()])
    return text


@given(st.integers(0, 2**32))
@settings(max_examples=80)
def test_layout_and_case_do_not_matter(seed):
    same(read_rapid(layout(seed).encode(), "x").toolpath, REFERENCE)


def test_the_reference_is_what_it_should_be():
    np.testing.assert_allclose(REFERENCE.position[:, 0] * 1e3, [1.5, 7, 10, 2.5, 4, np.nan, np.nan, 7], rtol=1e-12)
    assert REFERENCE.move.tolist() == [1, 0, 1, 2, 3, 4, 1, 1]
    np.testing.assert_allclose(REFERENCE.feed, [0.1, 0.05, 0.03, 0.1, 0.1, 0.1, 0.1, 0.01])
    assert [bool(block) for block in REFERENCE.block] == [False] * 3 + [True, True, False, True, False]


@given(st.binary(max_size=300))
@example(b"MoveL {")
@example(b"MoveL p{1e999},v1,z1,tool0;CONST robtarget p{1}:=[1];")
@example(b"\xef\xbb\xbf")
@settings(max_examples=150)
def test_random_bytes_are_read_or_refused(data):
    try:
        program = read_rapid(data, "x")
    except CompstiffError:
        return
    assert rewrite(program, [], [], []).content == data


PIECES = st.sampled_from([*WORDS, "MoveL", "MoveC", "(", ")", "{", "}", "\\", "*", "<SMT>", '"', '"text"', "!", "\n", "\r",
                          ";", ":=", ".",
                          "%", "IF", "THEN", "TEST", "CASE 1:", "RECORD", "ENDRECORD", "é", "\x00", "1e999", "-", "PROC a(",
                          "FOR", "DO",
                          "robtarget", "VAR", "Offs(", "p10", "1", "9E9", ",", "[", "]", "PDispOn", "SearchL"])


@given(st.lists(PIECES, max_size=60), st.booleans())
@settings(max_examples=200)
def test_scraps_of_rapid_are_read_or_refused(pieces, spaced):
    data = (" " if spaced else "").join(pieces).encode()
    try:
        program = read_rapid(data, "x")
    except CompstiffError:
        return
    assert rewrite(program, [], [], []).content == data


@st.composite
def damaged(draw):
    at = draw(st.integers(0, len(PLAIN) - 1))
    length = draw(st.integers(0, 3))
    return (PLAIN[:at] + draw(st.text("[](),;:=\\!\"{}.-+e9a \n", max_size=3)) + PLAIN[at + length:]).encode()


@given(damaged())
@settings(max_examples=200)
def test_a_damaged_program_is_read_or_refused(data):
    with suppress(CompstiffError):
        read_rapid(data, "x")


COORDINATE = st.floats(-3000, 3000).flatmap(lambda value: st.sampled_from([f"{value:.3f}", f"{value:.9f}", f"{value:.0f}",
                                                                           f"{value:.3E}"]))
NUDGE = st.floats(-2, 2)


@st.composite
def jobs(draw):
    """A program of inline, named, repeated and shifted targets, and corrections for some of them."""
    end = draw(st.sampled_from(["\n", "\r\n", "\r", "\r\r\n"]))
    rest = "[0,-1,0,0],[9E9,9E+09,9E9,9E9,9E9,9E9]]"

    def literal():
        turn = draw(st.sampled_from(["[1,0,0,0]", "[0.5,-0.5,0.5,0.5]", "[ 0.70711, 0 ,0.70710,0]", "[-1.2E-05,0,1,0]"]))
        return f"[[{draw(COORDINATE)},{draw(COORDINATE)},{draw(COORDINATE)}],{turn},{rest}"

    kinds = draw(st.lists(st.sampled_from(["inline", "a", "b", "pts{1}", "pts{2}", "Offs(a,1,2,3)",
                                           "RelTool(b,0,0,1\\Rx:=30)"]),
                          min_size=1, max_size=12))
    moves = [f"    MoveL {literal() if kind == 'inline' else kind},v100,z1,tool0;" for kind in kinds]
    lines = ["MODULE Größe", f"  CONST robtarget a:={literal()}; ! a", f"  PERS robtarget pts{{2}}:=[{literal()},{literal()}];",
             "  PROC main()", f"    VAR robtarget b:={literal()};", *moves, "  ENDPROC", "ENDMODULE", ""]
    chosen = draw(st.lists(st.sampled_from(range(len(kinds))), unique=True))
    nudges = [[draw(NUDGE) for _ in range(3)] for _ in chosen]
    turns = [[draw(st.floats(-0.01, 0.01)) for _ in range(4)] for _ in chosen]
    data = end.join(lines).encode(draw(st.sampled_from(["utf-8", "utf-8-sig", "latin-1"])))
    return data, chosen, np.array(nudges).reshape(-1, 3) / 1e3, np.array(turns).reshape(-1, 4)


@given(jobs())
@settings(max_examples=100)
def test_what_is_written_reads_back_and_the_rest_is_as_it_was(job):
    data, chosen, nudge, turn = job
    program = read_rapid(data, "x")
    before = program.toolpath
    position = before.position[chosen] + nudge
    quaternion = before.quaternion[chosen] + turn
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    written = rewrite(program, chosen, position, quaternion, before.confdata[chosen])
    after = read_rapid(written.content, "x").toolpath
    np.testing.assert_allclose(after.position[chosen], position, rtol=0, atol=0.51e-7)
    np.testing.assert_allclose(after.quaternion[chosen], quaternion, rtol=0, atol=2e-8)
    others = np.setdiff1d(np.arange(len(before)), chosen)
    for column in ("position", "quaternion"):
        np.testing.assert_array_equal(getattr(after, column)[others], getattr(before, column)[others])
    for column in ("move", "confdata", "has_confdata", "external", "feed", "zone", "tool", "workobject"):
        np.testing.assert_array_equal(getattr(after, column), getattr(before, column))
    assert not any(before.move == Move.ABSOLUTE)
    again = read_rapid(written.content, "x")
    repeated = rewrite(again, chosen, after.position[chosen], after.quaternion[chosen])
    # Once more: positions to the digit; quaternions were normalised on reading, which may move their last written digit.
    last = read_rapid(repeated.content, "x").toolpath
    np.testing.assert_array_equal(last.position, after.position)
    np.testing.assert_allclose(last.quaternion, after.quaternion, rtol=0, atol=2e-8)
