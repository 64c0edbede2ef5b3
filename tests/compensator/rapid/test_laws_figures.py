"""Numbers written all at once, and moves found all at once, are what one at a time gives."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from compensator.rapid import INLINE, read_rapid, rewrite
from compensator.rapid.figures import renumbered_poses
from compensator.rapid.inline_moves import inline_moves

DIGITS = st.text("0123456789", min_size=1, max_size=6)
MANTISSA = st.one_of(DIGITS, st.builds("{}.{}".format, DIGITS, st.text("0123456789", max_size=17)), DIGITS.map(".{}".format))
NUMBER = st.builds("{}{}{}".format, st.sampled_from(["", "-", "+"]), MANTISSA,
                   st.sampled_from(["", "", "", "E0", "e-3", "E+2", "e-20"]))
BLANK = st.sampled_from(["", "", " ", "\t", "\r\n  "])
CHANGE = st.sampled_from([0.0, 1e-12, 4e-9, -6e-9, 3e-5, -5e-5, 6e-5, 0.25, -1000.0])
TAILS = st.sampled_from(["v100,z1,tool0;", r"[100,500,5000,1000],fine\Inpos:=inpos20,tool0\WObj:=wobj0;", "v5 , z0 ,tool0 ;"])


@st.composite
def poses(draw):
    """The text of a pose as RAPID may spell it."""
    numbers = [draw(BLANK) + draw(NUMBER) + draw(BLANK) for _ in range(7)]
    return f"[{draw(BLANK)}[{','.join(numbers[:3])}]{draw(BLANK)},[{','.join(numbers[3:])}]{draw(BLANK)}"


@st.composite
def moves(draw):
    """One move to an inline target."""
    rest = "[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    way = draw(st.sampled_from(["MoveL", "MoveJ", "movel", "MOVEJ"]))
    return way + draw(BLANK) + draw(poses()) + "," + draw(BLANK) + rest + draw(BLANK) + "," + draw(TAILS)


def decimals(number: str) -> int:
    """As RAPID's reader counts them: 3 of -12.500, 6 of -1.2E-05."""
    mantissa, _, exponent = number.lower().partition("e")
    return min(max(len(mantissa.partition(".")[2]) - int(exponent or 0), 0), 15)


def written(token: str, value: float, least: int) -> str:
    """The promise of docs/formats.md for one number, in Python's own arithmetic."""
    places = max(decimals(token), least)
    before, after = (f"{number:.{places}f}" for number in (float(token), value))
    before, after = (text.lstrip("-") if float(text) == 0 else text for text in (before, after))
    return token if before == after else after


@given(st.lists(poses(), min_size=1, max_size=5), st.data())
def test_every_number_is_written_as_promised_and_every_other_byte_stays(texts, data) -> None:
    whole = "##".join(texts).encode()
    ends = np.cumsum([len(text) + 2 for text in texts]) - 2
    starts = np.append(0, ends[:-1] + 2)
    tokens = [[token.strip() for token in text.replace("[", ",").split(",") if token.strip()]
              for text in (text.replace("]", ",") for text in texts)]
    old = np.array([[float(token) for token in row] for row in tokens])
    new = old + np.array(data.draw(st.lists(CHANGE, min_size=old.size, max_size=old.size))).reshape(old.shape)
    got = renumbered_poses(whole, starts, ends, old, new)
    for text, row, values, result, changed in zip(texts, tokens, new, got.texts, got.changed, strict=True):
        wanted, at, differ = "", 0, 0
        for number, (token, value) in enumerate(zip(row, values, strict=True)):
            place = text.index(token, at)
            fresh = written(token, value, 4 if number < 3 else 8)
            wanted, at, differ = wanted + text[at:place] + fresh, place + len(token), differ + (fresh != token)
        assert result == (wanted + text[at:]).encode()
        assert changed == differ


@given(st.lists(st.tuples(moves(), BLANK), min_size=1, max_size=4), st.integers(20, 60))
def test_moves_found_together_are_those_found_one_by_one(some, times) -> None:
    """Long enough for the way by brackets and semicolons; alone each goes by the regular expression."""
    text = "".join(move + blank for move, blank in some).encode() * times
    many = inline_moves(b"  " + text, 2, 2 + len(text))
    found = list(INLINE.finditer(b"  " + text))
    for name, column in (("pose", many.start), ("rest", many.rest), ("tail", many.tail)):
        assert column.tolist() == [match.start(name) for match in found]
    assert many.end.tolist() == [match.end("rest") for match in found]
    assert many.stop.tolist() == [match.end("tail") for match in found]
    assert [b"JL"[way:way + 1] for way in many.way] == [match["way"].upper() for match in found]


def test_chunks_join_without_a_seam() -> None:
    """More targets than go through at once, a comment and a symbol among them, each corrected by its own offset."""
    line = "MoveL [[{:.3f},2.5,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v5,z1,tool0;"
    lines = [line.format(k / 8) for k in range(50_000)]
    lines[20_000] = lines[20_000].replace("2.5", "2.5!{\n")
    lines[30_000] = lines[30_000].replace("[1,0", "[one,0")
    text = "MODULE m\nCONST num one:=1;\nPROC main()\n" + "\n".join(lines) + "\nENDPROC\nENDMODULE\n"
    program = read_rapid(text.encode())
    assert len(program.toolpath) == 50_000
    position = program.toolpath.position + np.arange(50_000)[:, None] * 1e-6
    again = read_rapid(rewrite(program, np.arange(50_000), position, program.toolpath.quaternion).content)
    assert np.abs(again.toolpath.position - position).max() < 0.51e-7
    assert np.array_equal(again.toolpath.quaternion, program.toolpath.quaternion)
