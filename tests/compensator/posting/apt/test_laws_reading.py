"""What is read from an APT file, against an interpreter of its own and against geometry."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compensator.posting.apt import read_apt
from compensator.toolpath import Move
from identification.common.findings import CompstiffError
from tests.compensator.posting.apt.interpreter import visited

HEAD = "UNITS/MM\nFEDRAT/600,MMPM\n"


@pytest.fixture
def read(tmp_path):
    def from_text(text: str, name: str = "part.apt"):
        (tmp_path / name).write_text(text)
        return read_apt(tmp_path / name)

    return from_text


def codes(path) -> list[str]:
    return [finding.code for finding in path.findings]


coordinate = st.floats(-500, 500).map(lambda x: round(x, 4))
step = st.one_of(
    st.tuples(coordinate, coordinate, coordinate).map(lambda p: "GOTO/{:.4f},{:.4f},{:.4f}".format(*p)),
    st.tuples(coordinate, coordinate, coordinate).map(lambda p: "GOTO / {:.4f}, {:.4f},$\n {:.4f} $$ c".format(*p)),
    st.tuples(coordinate, st.floats(-0.9, 0.9)).map(
        lambda p: f"GOTO/{p[0]:.4f},0,1,{np.sin(p[1]):.9f},0.000000000,{np.cos(p[1]):.9f}"),
    st.tuples(coordinate, coordinate).map(lambda p: "GODLTA/{:.3f},0.,{:.3f}".format(*p)),
    st.just("RAPID"),
    st.floats(1, 9999).map(lambda f: f"FEDRAT/{f:.3f},MMPM"),
    st.floats(1, 99).map(lambda f: f"FEDRAT/IPM,{f:.3f}"),
    st.floats(1, 99).map(lambda f: f"FEDRAT/{f:.3f}"),
    st.sampled_from(["PAINT/COLOR,31", "$$ GOTO/1,2,3", "PPRINT GOTO/9,9,9", "COOLNT/ON", "", "INTOL/0.01"]))


@given(st.lists(step, max_size=30), st.sampled_from(["MM", "INCHES"]))
@settings(max_examples=60)
def test_straight_moves_are_those_of_another_interpreter(tmp_path_factory, lines, unit):
    text = "\n".join([f"UNITS / {unit}", "FEDRAT/100,MMPM", "GOTO/1,2,3", *lines]) + "\n"
    file = tmp_path_factory.mktemp("apt") / "a.cls"
    file.write_text(text)
    path = read_apt(file)
    want = visited(text)
    assert len(path) == len(want)
    np.testing.assert_allclose(1e3 * path.position, [p for p, _, _ in want], atol=1e-9)
    np.testing.assert_allclose(path.axis, [a for _, a, _ in want], atol=1e-8)
    np.testing.assert_allclose(1e3 * path.feed, [np.nan if f is None else f for _, _, f in want], rtol=1e-12)
    assert path.rapid.tolist() == [f is None for _, _, f in want]


def test_units_come_from_the_file_the_feed_or_are_said_to_be_assumed(read):
    assert read("UNITS/INCHES\nFEDRAT/60\nGOTO/1,0,0\n").position[0, 0] == pytest.approx(0.0254)
    inch = read("RAPID\nGOTO/1,0,0\nFEDRAT/IPM,60\nGOTO/1,0,0\n")
    assert inch.position[0, 0] == pytest.approx(0.0254)
    assert inch.feed[1] == pytest.approx(0.0254)
    assert "CS2106" in codes(inch)
    metric = read("FEDRAT/MMPM,60\nGOTO/1,0,0\n")
    assert metric.position[0, 0] == pytest.approx(1e-3)
    assert "CS2106" in codes(metric)
    bare = read("SPINDL/6000,RPM\nFEDRAT/0.1,PERREV\nGOTO/1,0,0\n")
    assert [(one.level, one.code) for one in bare.findings if one.code == "CS2106"] == [("warning", "CS2106")]
    assert codes(read(HEAD + "GOTO/1,0,0,0,0,1\n")) == []


@pytest.mark.parametrize(("unit", "millimetres"), [
    ("MM", 1), ("MMS", 1), ("CM", 10), ("IN", 25.4), ("INCH", 25.4), ("INCHES", 25.4)])
def test_every_unit_of_length_and_of_feed(read, unit, millimetres):
    head = f"UNITS/{unit}\nSPINDL/3000,RPM\n"
    feeds = {"60,MMPM": 1, "60,IPM": 25.4, "60": millimetres, "60,PERMIN": millimetres, "0.02,MMPR": 1, "0.02,IPR": 25.4,
             "0.02,PERREV": millimetres}
    path = read(head + "".join(f"FEDRAT/{said}\nGOTO/{k + 1},0,0\n" for k, said in enumerate(feeds)))
    np.testing.assert_allclose(1e3 * path.position[:, 0], millimetres * np.arange(1, 8), rtol=1e-12)
    np.testing.assert_allclose(1e3 * path.feed, list(feeds.values()), rtol=1e-12)


def test_feed_per_turn_takes_the_spindle(read):
    path = read("UNITS/MM\nSPINDL/RPM,6000,CLW\nFEDRAT/0.2,MMPR\nGOTO/1,0,0\nSPINDL/3000,RPM,CLW\nGOTO/2,0,0\n")
    np.testing.assert_allclose(path.feed, [0.02, 0.01], rtol=1e-12)
    with pytest.raises(ValueError, match="CS2107: the feed is per turn, and no SPINDL says the speed"):
        read("UNITS/MM\nSPINDL/RPM,6000,CLW\nFEDRAT/0.2,MMPR\nGOTO/1,0,0\nSPINDL/SMM,300\nGOTO/2,0,0\n")


@pytest.mark.parametrize("spindle", [
    "SPINDL/RANGE,2,RPM,6000,CLW", "SPINDL/MAXRPM,9000,RPM,6000", "SPINDL/6000,RPM,RANGE,2", "SPINDL/CLW,6000,RANGE,2",
    "SPINDL/RPM,6000\nSPINDL/ORIENT,90", "SPINDL/RPM,6000\nSPINDL/RANGE,2\nSPINDL/ON"])
def test_the_numbers_of_other_words_of_the_spindle_are_no_speed(read, spindle):
    path = read(f"UNITS/MM\n{spindle}\nFEDRAT/0.2,MMPR\nGOTO/1,0,0\n")
    np.testing.assert_allclose(path.feed, [0.02], rtol=1e-12)


@pytest.mark.parametrize(("spindle", "line"), [
    ("SPINDL/6000,RPM,CLW\n", None), ("SPINDL/6000,RPM\n", None), ("SPINDL/RPM,6000,CCLW\n", 3),
    ("SPINDL/CCLW\nSPINDL/6000\n", 3),
    ("SPINDL/9,RPM,CCLW\nSPINDL/9,RPM,CLW\n", None), ("SPINDL/9,RPM,CCLW\nRAPID\nGOTO/5,5,5\nSPINDL/CLW\n", None)])
def test_a_cut_with_a_spindle_that_turns_counterclockwise_is_said(read, spindle, line):
    """By a move that cuts, not by the word; the sense holds until another one is stated."""
    said = [one for one in read(HEAD + spindle + "GOTO/1,0,0\nGOTO/2,0,0\n").findings if one.code == "CS2116"]
    assert [(one.level, one.line) for one in said] == ([] if line is None else [("warning", line)])


def test_rapid_holds_for_the_next_motion_only(read):
    path = read(HEAD + "RAPID\nPAINT/COLOR,186\nGOTO/0,0,50\nGOTO/0,0,0\n")
    assert path.rapid.tolist() == [True, False]


def test_the_tool_axis_holds_until_another_is_given_and_multax_off_sets_it_upright(read):
    path = read(HEAD + "MULTAX/ON\nGOTO/0,0,0,0.6,0,0.8\nGOTO/1,0,0\nMULTAX/OFF\nGOTO/2,0,0\nTLAXIS/0,0,1\nGOTO/3,0,0,0,0,1\n")
    np.testing.assert_allclose(path.axis, [[0.6, 0, 0.8], [0.6, 0, 0.8], [0, 0, 1], [0, 0, 1]], atol=1e-12)


def on_circle(path, centre, radius, rows=slice(1, None)):
    out = 1e3 * path.position[rows, :2] - centre
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), radius, atol=1e-6)
    return np.unwrap(np.arctan2(out[:, 1], out[:, 0]))


def total(path, centre, radius) -> float:
    """Signed angle [deg] the tool turns by about the z axis, from the points alone."""
    return float(np.degrees(np.ptp(angles) * np.sign(angles[-1] - angles[0]))) if len(
        angles := on_circle(path, centre, radius, slice(0, None))) else 0.0


START = HEAD + "GOTO/30,20,5\n"         # on the circle of radius 10 about (20, 20), east of its centre


@pytest.mark.parametrize(("text", "turned"), [
    # Creo: right-hand rule, so +z is counter-clockwise; to the north
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/20,30,5\n", 90),
    ("CIRCLE/20,20,5,0,0,-1,10\nGOTO/20,30,5\n", -270),
    # NX: the vector of a clockwise motion
    ("CIRCLE/20,20,5,0,0,1,10,0.06,0.5,10,0\nGOTO/20,10,5\n", -90),
    ("CIRCLE/20,20,5,0,0,-1,10,0.06,0.5,10,0\nGOTO/20,10,5\n", 270),
    # Autodesk
    ("MOVARC/20,20,5,0,0,1,10,ANGLE,180\nGOTO/10,20,5\n", 180),
    # CATIA: starts along INDIRV, stops on the line from the centre
    ("INDIRV/0,1,0\nTLON,GOFWD/ (CIRCLE/ 20,20,5,$\n10),ON,(LINE/20,20,5,20,30,5)\n", 90),
    ("AUTOPS\nINDIRV/0,-1,0\nTLON,GOFWD/ (CIRCLE/ 20,20,5,$\n10),ON,2,INTOF,$\n (LINE/20,20,5,20,30,5)\n", -270),
    ("INDIRV/0,1,0\nCIRCLE/20,20,5,0,0,-1,10\nGOTO/20,30,5\n", 90),
    # a full circle
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/30,20,5\n", 360),
    # points on the arc beside its end
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/20,30,5,$\n10,20,5,20,10,5\n", 270),
])
def test_arcs_turn_the_way_their_system_means(read, text, turned):
    path = read(START + text)
    assert total(path, [20, 20], 10) == pytest.approx(turned, abs=1e-6)
    assert set(path.move[1:].tolist()) == {Move.ARC_VIA, Move.ARC_END}
    np.testing.assert_allclose(path.position[:, 2], 5e-3)
    steps = np.abs(np.diff(on_circle(path, [20, 20], 10, slice(0, None))))
    np.testing.assert_allclose(steps, steps[0])             # the circle point is in the middle
    assert np.degrees(2 * steps[0]) <= 120 + 1e-9           # of one MoveC


def test_an_arc_in_an_inclined_plane_keeps_to_its_plane_and_radius(read):
    normal = np.array([0.0, 0.6, 0.8])
    u, v = np.array([1.0, 0, 0]), np.cross(normal, [1.0, 0, 0])
    centre = np.array([1.0, 2, 3])
    start, end = centre + 7 * u, centre - 7 * v
    text = "".join([HEAD, "GOTO/{:.6f},{:.6f},{:.6f}\n".format(*start), "CIRCLE/1,2,3,0,0.6,0.8,7\n",
                    "GOTO/{:.6f},{:.6f},{:.6f}\n".format(*end)])
    out = 1e3 * read(text).position - centre
    np.testing.assert_allclose(out @ normal, 0, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 7, atol=1e-5)
    assert np.degrees(np.ptp(np.unwrap(np.arctan2(out @ v, out @ u)))) == pytest.approx(270, abs=1e-4)


@pytest.mark.parametrize(("text", "turned", "end"), [
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/30,20,3\n", 360, 3),                                    # Creo: one orbit of a helix
    ("CIRCLE/20,20,5,0,0,-1,10,0.06,0.5,1,0,TIMES,3\nGOTO/30,20,2\n", 1080, 2),             # NX
])
def test_a_helix_becomes_chords_within_two_micrometres(read, text, turned, end):
    path = read(START + text)
    assert set(path.move[1:].tolist()) == {Move.LINEAR}
    angle = on_circle(path, [20, 20], 10, slice(0, None))
    assert np.degrees(angle[-1]) == pytest.approx(turned)
    height = 1e3 * path.position[:, 2]
    np.testing.assert_allclose(height, 5 + (end - 5) * angle / angle[-1], atol=1e-9)
    sagitta = 10 * (1 - np.cos(np.diff(angle).max() / 2))
    assert 1.9e-3 < sagitta <= 2.001e-3
    assert [one.message for one in path.findings if one.code == "CS2115"] == [
        "1 arc became chords within 0.002 mm: a helix, a turning tool axis, or too small for MoveC"]


@pytest.mark.parametrize(("arcs", "words", "circular"), [
    ("", "", 0),
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/20,10,5\n", "1 arc became MoveC of up to 120 degrees, at most 15.7 mm long", 3),
    ("CIRCLE/20,20,5,0,0,1,10\nGOTO/10,20,5\nCIRCLE/20,20,5,0,0,1,10\nGOTO/20,10,5\n",
     "2 arcs became MoveC of up to 120 degrees, at most 15.7 mm long", 3)])
def test_what_became_of_arcs_is_told(read, arcs, words, circular):
    """Three quarters of a circle of 10 mm, in one or in two arcs, are three of a quarter each: 15.7 mm."""
    path = read(f"{HEAD}GOTO/30,20,5\n{arcs}")
    assert (path.move == Move.ARC_VIA).sum() == circular
    assert [(one.level, one.message.partition(";")[0]) for one in path.findings if one.code == "CS2115"] == [
        ("note", words)] * bool(words)


def test_an_arc_with_a_turning_tool_axis_becomes_chords(read):
    path = read(HEAD + "MULTAX/ON\nGOTO/30,20,5,0,0,1\nCIRCLE/20,20,5,0,0,1,10\nGOTO/20,30,5,0.6,0,0.8\n")
    assert set(path.move.tolist()) == {Move.LINEAR}
    tilt = np.degrees(np.arccos(path.axis[:, 2]))
    assert np.all(np.diff(tilt) > 0)
    assert tilt[-1] == pytest.approx(np.degrees(np.arccos(0.8)))


def test_an_arc_too_small_for_the_controller_is_a_chord(read):
    path = read(HEAD + "GOTO/20.05,20,5\nCIRCLE/20,20,5,0,0,1,0.05\nGOTO/20,20.05,5\n")
    assert set(path.move.tolist()) == {Move.LINEAR}
    np.testing.assert_allclose(path.position[-1], [0.02, 0.02005, 0.005])


@pytest.mark.parametrize(("radius", "degrees", "moves"), [
    # The controller takes up to 240 degrees a MoveC, which here are 120 at most; and points 0.2 mm and two degrees apart.
    (10, 119, 1), (10, 121, 2), (10, 239, 2), (10, 241, 3), (0.3, 90, 1), (0.25, 90, 0), (30, 4.1, 1), (30, 3.9, 0)])
def test_an_arc_takes_as_many_moves_as_the_controller_needs(read, radius, degrees, moves):
    end = 20 + radius * np.cos(np.radians(degrees)), 20 + radius * np.sin(np.radians(degrees))
    path = read(HEAD + f"GOTO/{20 + radius},20,5\nCIRCLE/20,20,5,0,0,1,{radius}\nGOTO/{end[0]:.6f},{end[1]:.6f},5\n")
    assert np.sum(path.move == Move.ARC_END) == moves


@pytest.mark.parametrize(("degrees", "told"), [(118, False), (122, True)])
def test_an_arc_turns_back_from_120_degrees_on(read, degrees, told):
    """Against the move before it, which comes from so far round."""
    x, y = 10 * np.cos(np.radians(degrees)), 10 * np.sin(np.radians(degrees))
    forward = "GOTO/0,0,0\nGOTO/10,0,0\nCIRCLE/10,10,0,0,0,1,10\nGOTO/20,10,0\n"
    path = read(HEAD + forward + f"GOTO/{-x:.6f},{-y:.6f},0\nGOTO/0,0,0\nCIRCLE/0,10,0,0,0,1,10\nGOTO/10,10,0\n")
    assert ("CS2109" in codes(path)) == told


def test_an_arc_that_turns_back_is_noticed(read):
    forward = "GOTO/0,0,0\nGOTO/10,0,0\nCIRCLE/10,10,0,0,0,1,10\nGOTO/20,10,0\n"
    back = "GOTO/0,0,0\nGOTO/10,0,0\nCIRCLE/10,10,0,0,0,-1,10\nGOTO/20,10,0\n"
    assert "CS2109" not in codes(read(HEAD + forward))
    assert "CS2109" in codes(read(HEAD + forward + back))
    with pytest.raises(ValueError, match="CS2109: 2 of 2 arcs"):
        read(HEAD + back + back)


def test_what_the_machine_should_do_becomes_comments_and_unknown_words_are_counted(read):
    path = read("PARTNO BRACKET $ 1\n" + HEAD + "SPINDL/9000,RPM,CLW\nGOTO/0,0,0\n$$ OPERATION NAME : Finish.1\nFOO/1\nFOO/2\n"
                "COOLNT/OFF\nFINI\nGOTO/9,9,9\n")
    assert path.remarks == {0: ("BRACKET $ 1", "SPINDL/9000,RPM,CLW"), 1: ("OPERATION NAME : Finish.1", "COOLNT/OFF")}
    found = {finding.code: finding for finding in path.findings}
    assert found["CS2104"].count == 2
    assert found["CS2104"].line == 7
    assert found["CS2111"].line == 4
    assert "2 machine commands (from SPINDL/9000,RPM,CLW on)" in found["CS2111"].message
    assert "1 statement behind FINI" in found["CS2114"].message
    assert not {"CS2104", "CS2111", "CS2114"} & set(codes(read(
        "PARTNO BRACKET\n" + HEAD + "GOTO/1,0,0\nFINI\n$$ the end\n$$-> END /\n")))
    assert len(path) == 1


def driven_hole(path) -> list[tuple[float, float, bool, bool]]:
    """x and z [mm], whether in the air, whether a stop, of each target."""
    return [(*row, rapid, stop) for row, rapid, stop in zip(np.round(1e3 * path.position[:, [0, 2]], 9).tolist(),
                                                           path.rapid.tolist(), path.stop.tolist(), strict=True)]


@pytest.mark.parametrize(("word", "up"), [("RTRCTO,4", 14), ("RETURN,20", 30), ("RTRCTO,AUTO", 12), ("", 12)])
def test_a_hole_from_below_its_clearance_is_driven_peck_by_peck(read, word, up):
    """The surface at 10 mm, 2 mm of clearance: up in the air where the tool is, across, then 3, 5 and 6 mm deep; after each
    peck out, and back in the air to 1 mm above the depth reached."""
    cycle = f"CYCLE/DEEP,DEPTH,6,CLEAR,2,STEP,3,SUBPECK,2,MMPM,60{',' if word else ''}{word}"
    path = read(f"UNITS/MM\nFEDRAT/600\nGOTO/0,0,11\n{cycle}\nGOTO/30,0,10\nCYCLE/OFF\n")
    assert driven_hole(path) == [
        (0, 11, False, False), (0, 12, True, False), (30, 12, True, False), (30, 7, False, True), (30, 12, True, False),
        (30, 8, True, False), (30, 5, False, True), (30, 12, True, False), (30, 6, True, False), (30, 4, False, True),
        (30, up, True, False)]
    np.testing.assert_allclose(path.feed[[0, 3, 6, 9]], [10e-3, 1e-3, 1e-3, 1e-3])


@pytest.mark.parametrize("first", [0.5, 1.5])
def test_the_way_back_to_a_depth_is_in_the_air_where_it_begins_above_a_millimetre(read, first):
    """Without clearance: half a millimetre deep the tool is within one millimetre of it already."""
    path = read(f"UNITS/MM\nFEDRAT/600\nGOTO/30,0,0\nCYCLE/DEEP,DEPTH,2,CLEAR,0,STEP,{first},SUBPECK,2\n"
                "GOTO/30,0,0\nCYCLE/OFF\n")
    back = [(30, 1 - first, True, False)] if first > 1 else []
    assert driven_hole(path)[1:] == [(30, -first, False, True), (30, 0, True, False), *back, (30, -2, False, True),
                                     (30, 0, True, False)]


@pytest.mark.parametrize("first", [2, 3])
def test_a_hole_no_deeper_than_its_first_peck_is_drilled_at_once(read, first):
    path = read(f"UNITS/MM\nFEDRAT/600\nGOTO/30,0,9\nCYCLE/DEEP,DEPTH,2,CLEAR,1,STEP,{first}\nGOTO/30,0,0\nCYCLE/OFF\n")
    assert [step for step in driven_hole(path) if step[3]] == [(30, -2, False, True)]


@pytest.mark.parametrize("degrees", [(30, 0), (-77, 10), (131, -20), (10, 33), (45, 45)])
def test_a_turn_with_six_decimals_is_one(read, degrees):
    """Whether its rounding makes it a little larger or smaller."""
    turn, lean = np.radians(degrees)
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]) @ np.array(
        [[1, 0, 0], [0, np.cos(lean), -np.sin(lean)], [0, np.sin(lean), np.cos(lean)]])
    rows = ",".join(f"{value:.6f}" for row in np.column_stack([rotation, [5, 6, 7]]) for value in row)
    path = read(f"UNITS/MM\nFEDRAT/600\nTRACUT/{rows}\nGOTO/10,20,30,0,0,1\n")
    np.testing.assert_allclose(1e3 * path.position[0], rotation @ [10, 20, 30] + [5, 6, 7], atol=1e-4)
    np.testing.assert_allclose(path.axis[0], rotation[:, 2], atol=1e-6)


@pytest.mark.parametrize(("rows", "told"), [
    ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], False), ([[1.000004, 0, 0], [0, 1, 0], [0, 0, 1]], False),
    ([[1.000006, 0, 0], [0, 1, 0], [0, 0, 1]], True), ([[1, 0.000009, 0], [0, 1, 0], [0, 0, 1]], False),
    ([[1, 0.000011, 0], [0, 1, 0], [0, 0, 1]], True), ([[1.3, 0, 0], [0, 1.3, 0], [0, 0, 1.3]], True),
    ([[1, 0, 0], [0, 1, 0], [0, 0, -1]], True), ([[0, 1, 0], [1, 0, 0], [0, 0, 1]], True),
    ([[0, 0, 0], [0, 0, 0], [0, 0, 0]], True), ([[0, 1, 0], [0, 0, 1], [1, 0, 0]], False), ([[1e300] * 3] * 3, True)])
def test_what_scales_skews_or_mirrors_is_no_turn(read, rows, told):
    """From a hundred thousandth on, of the products of the rows."""
    numbers = ",".join(f"{value:.6f}" if abs(value) < 10 else f"{value}" for row in rows for value in (*row, 0))
    text = f"UNITS/MM\nFEDRAT/600\nTRACUT/{numbers}\nGOTO/10,20,30,0,0,1\nTRACUT/NOMORE\nGOTO/1,2,3\n"
    if told:
        with pytest.raises(CompstiffError) as stopped:
            read(text)
        [said] = stopped.value.findings
        assert (said.code, said.line, said.column) == ("CS2182", 3, 8)
        return
    path = read(text)
    np.testing.assert_allclose(1e3 * path.position, [np.array(rows) @ [10, 20, 30], [1, 2, 3]], atol=1e-3)


@pytest.mark.parametrize(("before", "starts"), [("GOTO/30,0,0\n", True), ("FROM/30,0,0\n", False), ("", False)])
def test_an_arc_begins_where_a_target_stands(read, before, starts):
    """Where FROM says that the tool is nobody has driven it to."""
    text = f"UNITS/MM\nFEDRAT/600\n{before}CIRCLE/0,0,0,0,0,1,30\nGOTO/0,30,0\n"
    if starts:
        np.testing.assert_allclose(1e3 * read(text).position[-1], [0, 30, 0], atol=1e-9)
        return
    with pytest.raises(CompstiffError, match="CS2108: no GOTO before this arc says where it starts"):
        read(text)


def test_home_is_where_from_said(read):
    path = read(HEAD + "FROM/0,0,100\nRAPID\nGOTO/1,2,3\nGOHOME\n")
    np.testing.assert_allclose(1e3 * path.position, [[1, 2, 3], [0, 0, 100]])
    assert path.rapid.tolist() == [True, True]
    assert "CS2114" not in codes(path)
    left = next(one for one in read(HEAD + "GOTO/1,2,3\nGOHOME\n").findings if one.code == "CS2114")
    assert (left.level, left.line) == ("warning", 4)
    with pytest.raises(ValueError, match="CS2102: found a motion behind GOHOME"):
        read(HEAD + "GOTO/1,2,3\nGOHOME\nGOTO/4,5,6\n")
    assert read(HEAD + "GOTO/1,2,3\nGOHOME/5,5,50\n").position[1, 2] == pytest.approx(0.05)


def test_line_ends_encoding_and_sequence_numbers(read, tmp_path):
    text = "PPRINT ÄÖ\r\nunits/mm\r\nN10 fedrat/600,mmpm\r\n0020  GOTO/1.,+2.0,-.5E1\r\n"
    (tmp_path / "b.cl").write_bytes(text.encode("latin-1"))
    path = read_apt(tmp_path / "b.cl")
    np.testing.assert_allclose(1e3 * path.position, [[1, 2, -5]])
    assert path.line.tolist() == [4]


def test_time_grows_with_the_length_only(read):
    def seconds(count: int) -> float:
        text = HEAD + "".join(f"GOTO/{x:.4f},{x % 7:.4f},0.0000,0.0000000,0.0000000,1.0000000\n" for x in range(count))
        begin = time.process_time()
        assert len(read(text)) == count
        return time.process_time() - begin

    seconds(1000)
    short, long = seconds(10_000), seconds(40_000)
    assert long < 12 * short
    assert long < 6


def test_a_comment_ends_a_statement_that_goes_on(read):
    path = read(HEAD + "GOTO/1,2,3$\n$$ half way\nGOTO/4,5,$\n6 $$ GOTO/7,8,9\n")
    np.testing.assert_allclose(1e3 * path.position, [[1, 2, 3], [4, 5, 6]])
