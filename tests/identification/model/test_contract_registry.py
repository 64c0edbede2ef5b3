"""The registry of effects, and the worked example of docs/effects.md."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from identification.model import effects as package
from identification.model.effects import Effect, Parameter, drift, effects
from identification.model.effects.kinds import (
    along_axes,
    amplitude_and_phase,
    crossed,
    crossed_one_way,
    of_arm,
    of_tool,
    one_way,
)
from identification.model.effects.transmission_error import BetweenPoses
from identification.model.law_of import known
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame
from tests.runs.command_line import user_files as kit
from tests.support import random_poses, robot

DOCUMENT = (Path(__file__).parents[3] / "docs" / "effects.md").read_text()
CONTRACT = [
    "backlash", "soft_zone", "soft_beyond", "one_sided", "hysteresis", "bearing_tilt", "link_bending", "base_rocking",
    "base_shift",
    "force_sensor_compliance", "spindle_compliance", "parallelogram", "gravity_compensator", "uneven_gear", "wrist_coupling",
    "force_gain", "force_misalignment", "side_load", "tool_point", "deflection_sensor_gain", "deflection_sensor_rotation",
    "target_curvature", "drift", "creep", "channel_delay", "joint_friction", "motor_inertia", "gear_damping", "sensor_step",
    "hook_offset", "swinging_weight", "transmission_error", "soft_track", "stand_compliance",
    "gear_creep", "lost_motion", "soft_gears", "load_leak", "reading_point", "gauge_friction", "load_friction", "hook_weight",
    "force_curve", "tool_play", "gear_softening", "unsettled_zero", "encoder_slip", "lost_samples", "torque_crosstalk",
    "force_axis_gain", "force_crosstalk", "force_offset", "deflection_sensor_crosstalk", "encoder_zero", "softening"]


def test_the_dictionary_is_the_contract_s() -> None:
    assert sorted(effects()) == sorted(CONTRACT)
    for effect in effects().values():
        assert effect.sentence.format(joint=1)
        assert effect.settles
        for parameter in effect.parameters:
            assert parameter.low <= parameter.typical <= parameter.high
    for name in CONTRACT:
        assert f"`{name}`" in DOCUMENT


def test_what_the_robot_does_and_what_the_measurement_is_the_documentation_s() -> None:
    """By the table of families: the first law of each name is where its name stands first."""
    table = re.findall(r"^\| ([a-z ]+) \|(.*?)\|(.*?)\|$", DOCUMENT.partition("## The procedure")[0], re.M)
    listed: dict[str, tuple[str, bool]] = {}
    for family, of_robot, of_measurement in table:
        for column, whose in ((of_robot, True), (of_measurement, False)):
            for name in re.findall(r"`(\w+)`", column):
                listed.setdefault(name, (family, whose))
    assert {name: listed[name] for name in CONTRACT} == {
        effect.name: (effect.family, effect.of_robot) for effect in effects().values()}
    assert {law.stored for law in every_law() if law.of_robot != effects()[law.name].of_robot} == {
        "hysteresis.seats", "transmission_error.poses"}


def test_structures_stiffen_and_other_laws_do_not() -> None:
    """Bearings, links, the base, what stands under it, the force sensor, the spindle; and a rod that is drawn or pressed."""
    assert {law.stored.partition(".")[0] if law.stored != "parallelogram.rod" else law.stored
            for law in every_law() if law.stiffens} == {
        "base_rocking", "base_shift", "bearing_tilt", "force_sensor_compliance", "link_bending", "parallelogram.rod",
        "soft_track", "spindle_compliance"}
    assert {law.name for law in every_law() if not law.stiffens} & {
        "base_rocking", "base_shift", "bearing_tilt", "force_sensor_compliance", "link_bending", "soft_track"} == set()


def test_a_law_of_gravity_is_one_that_the_links_weight_changes() -> None:
    """The other laws yield alike whatever the arm weighs; those of unknown weight have it as a parameter."""
    model = robot()
    rng = np.random.default_rng(1)
    theta, wrench = random_poses(model, 6, rng), np.concatenate([rng.uniform(-300, 300, (6, 3)), np.zeros((6, 3))], axis=1)
    heavy = replace(model, link_mass=np.full(6, 150.0), link_centre=np.full((6, 3), 0.2))
    light, weighs = (load_state(arm, Frame(np.eye(3), np.array([0.12, 0.0, 0.25])), theta, wrench, 1 / model.prior.stiffness)
                     for arm in (model, heavy))
    for law in every_law():
        joint = law.places[-1]
        either = [law.contribution(rows, joint, law.typical(light, joint)) for rows in (light, weighs)]
        assert np.array_equal(*either) != (law.of_gravity and not law.weighed), law.stored


def test_what_shows_in_a_joint_s_log_may_show_in_any_joint_s() -> None:
    of_logs = [effect for effect in effects().values() if type(effect).log_contribution is not Effect.log_contribution]
    assert {"encoder_slip", "lost_samples", "torque_crosstalk"} <= {effect.name for effect in of_logs if effect.joints}
    for effect in of_logs:
        assert effect.joints in ((), (1, 2, 3, 4, 5, 6)), effect.name


def every_law() -> list[Effect]:
    return [law for effect in effects().values() for law in (effect, *effect.other_laws)]


def test_shapes_are_tried_so_close_that_none_is_missed() -> None:
    """Slips of a gear from 10 to 640 N m, none farther than a factor of 1.5 from one that is tried."""
    tried = np.array(known("hysteresis").parameters[1].grid)
    away = np.abs(np.log(np.geomspace(10, 640, 100)[:, None] / tried)).min(axis=1)
    assert np.exp(away.max()) < 1.5


def test_every_law_yields_in_as_many_further_ways_as_it_says() -> None:
    model = robot()
    wrench = np.concatenate([np.full((4, 3), 120.0), np.zeros((4, 3))], axis=1)
    rows = load_state(model, Frame(np.eye(3), np.array([0.12, 0.0, 0.25])), random_poses(model, 4, np.random.default_rng(1)),
                      wrench, 1 / model.prior.stiffness)
    with_ways = [law for law in every_law() if law.ways]
    assert with_ways
    for law in with_ways:
        for joint in law.places:
            assert law.further_ways(rows, joint, law.typical(rows, joint)).shape == (4, 6, law.ways)


def source_table() -> list[str]:
    """The table under "Sources" of docs/effects.md, as the code has it: parameters with the same sources share their rows."""
    lines = ["| effect | what | source |", "|---|---|---|"]
    for effect in every_law():
        lines.append(f"| `{effect.stored}` | formula | {effect.formula_source} |")
        alike: dict[tuple[object, ...], list[str]] = {}
        for p in effect.parameters:
            alike.setdefault((p.typical, p.low, p.high, p.unit, p.source, p.bounds_source), []).append(f"`{p.name}`")
        for (typical, low, high, unit, source, bounds_source), names in alike.items():
            size, bounds = f"{typical:g} {unit}", f"{low:g} to {high:g} {unit}"
            lines += [f"| | {' '.join(names)}: {size.removesuffix(' 1')} | {source} |",
                      f"| | {bounds.removesuffix(' 1')} | {bounds_source} |"]
    return lines


def test_every_effect_and_every_parameter_states_its_source() -> None:
    """A document with a year, a page of the project, the paper (docs/paper.md), a data sheet, or engineering judgement."""
    told = re.compile(r"\b(19|20)\d\d\b|\bdocs/|\bthe paper\b|catalogue|FAQ|tech tool|Table \d|StrengthBook|^the same: "
                      r"|^engineering judgement: .{10}")
    for effect in every_law():
        sources = [effect.formula_source]
        sources += [source for p in effect.parameters for source in (p.source, p.bounds_source)]
        for source in sources:
            assert told.search(source), (effect.name, source)


def test_the_sources_in_the_documentation_are_the_code_s() -> None:
    table = "\n".join(source_table())
    assert table in DOCUMENT, f"docs/effects.md, Sources: write\n{table}"


@pytest.fixture
def with_entry(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    source = re.search(r"```python\n(.*?)```", DOCUMENT, re.S)
    assert source
    (tmp_path / "riser_twist.py").write_text(source.group(1))
    monkeypatch.syspath_prepend(tmp_path)
    entry = re.search(r'riser_twist = "(riser_twist:RiserTwist)"', DOCUMENT)
    assert entry
    found = [EntryPoint("riser_twist", entry.group(1), package.ENTRY_POINTS)]
    monkeypatch.setattr(package, "entry_points", lambda group: found if group == package.ENTRY_POINTS else [])
    effects.cache_clear()
    yield
    effects.cache_clear()


def test_the_documented_example_works(with_entry: None) -> None:
    """It joins the dictionary, and turns the TCP about flange z as it says."""
    twist = effects()["riser_twist"]
    model = robot()
    rng = np.random.default_rng(0)
    theta = random_poses(model, 5, rng)
    wrench = np.concatenate([rng.uniform(-300, 300, (5, 3)), np.zeros((5, 3))], axis=1)
    tool = Frame(np.eye(3), np.array([0.12, 0.0, 0.25]))
    rows = load_state(model, tool, theta, wrench, 1 / model.prior.stiffness)
    moved = twist.contribution(rows, None, np.array([1e-6]))
    axis = rows.flange[:, :, 2]
    moment = np.einsum("ni,ni->n", axis, np.cross(rows.tcp - rows.origins[:, 5], wrench[:, :3]))
    np.testing.assert_allclose(moved[:, 3:], 1e-6 * moment[:, None] * axis, atol=1e-15)
    np.testing.assert_allclose(moved[:, :3], np.cross(moved[:, 3:], rows.tcp - rows.origins[:, 5]), atol=1e-15)
    assert len(twist.signatures(rows, None)) == 1
    assert twist.formula_source
    assert twist.parameters[0].source


def test_an_effect_of_one_s_own_need_not_state_sources() -> None:
    class Bare(Effect):
        name, family, of_robot, sentence, settles = "bare", "tool", True, "it gives way", "a dial gauge"
        parameters = (Parameter("relative", "1", 0.1, 0.0, 1.0),)

        def contribution(self, rows: LoadState, joint: int | None, values: np.ndarray) -> np.ndarray:
            return values[0] * rows.elastic

    assert (Bare().formula_source, Bare().parameters[0].source, Bare().parameters[0].bounds_source) == ("", "", "")


@pytest.mark.parametrize(("value", "words", "hint"), [
    ("no_such_package:Effect", " (no_such_package:Effect) cannot be loaded: ModuleNotFoundError: No module", "uninstall"),
    ("identification.model.effects:Effect", "effects:Effect) cannot be loaded: TypeError: Can't", "uninstall"),
    ("pathlib:PurePosixPath", " gives PurePosixPath, expected an Effect", "docs/effects.md has a worked example"),
    ("identification.model.effects.drift:Drift", " brings an effect 'drift', which exists already", "give it another name")])
def test_an_entry_that_is_no_effect_is_refused(
    monkeypatch: pytest.MonkeyPatch, with_entry: None, value: str, words: str, hint: str
) -> None:
    """By what asks for the causes, as no defect of compstiff; the documented example beside it is fine."""
    assert "riser_twist" in effects()
    good = package.entry_points(group=package.ENTRY_POINTS)
    monkeypatch.setattr(package, "entry_points", lambda group: [*good, EntryPoint("mine", value, group)])
    effects.cache_clear()
    done = kit.run("explain")
    first, second = done.err.splitlines()
    assert (done.code, done.out) == (1, "")
    assert first.startswith("error CS1301: the entry point 'mine' ")
    assert words in first
    assert second.startswith("hint: ")
    assert hint in second
    monkeypatch.setattr(package, "entry_points", lambda group: good)
    effects.cache_clear()
    assert "riser_twist" in kit.run("explain").out


def test_zero_size_changes_nothing() -> None:
    model = robot()
    theta = random_poses(model, 4, np.random.default_rng(1))
    wrench = np.full((4, 6), 50.0)
    rows = load_state(model, Frame(np.eye(3), np.array([0.12, 0.0, 0.25])), theta, wrench, 1 / model.prior.stiffness)
    for effect in effects().values():
        for joint in effect.places:
            values = effect.neutral(rows)
            shaped = np.array([parameter.typical if parameter.shape else value
                               for parameter, value in zip(effect.parameters, values, strict=True)])
            assert not effect.contribution(rows, joint, shaped).any(), effect.name


def test_effects_are_documented_classes() -> None:
    for effect in effects().values():
        assert isinstance(effect, Effect)
        assert type(effect).__doc__


def test_a_law_that_each_visit_may_change_says_by_how_much_and_no_other_one_does() -> None:
    """Play and friction, which the way to the pose leaves at one end or the other."""
    assert {law.stored for law in every_law() if law.by_visit} == {
        law.stored for law in every_law() if type(law).of_each_visit is not Effect.of_each_visit}
    assert {"lost_motion", "backlash", "hysteresis", "tool_play"} == {law.name for law in every_law() if law.by_visit}


def test_a_wave_of_a_gear_is_from_nothing_to_all_of_its_compliance_at_any_phase() -> None:
    amplitude, phase = amplitude_and_phase(0.05, "here")
    assert (amplitude.typical, amplitude.low, amplitude.high, amplitude.source) == (0.05, 0.0, 1.0, "here")
    assert [-phase.low, phase.high] == pytest.approx([np.pi] * 2, abs=1e-4)
    assert (amplitude.shape, phase.shape) == (False, True)


def test_three_parameters_along_the_axes_are_alike_and_of_either_sign() -> None:
    found = along_axes("lever_{}_m", "m", 0.25, 3.0, source="here", bounds_source="there")
    assert [(one.name, one.unit, one.typical, one.low, one.high, one.source, one.bounds_source) for one in found] == [
        (f"lever_{axis}_m", "m", 0.25, -3.0, 3.0, "here", "there") for axis in "xyz"]


def test_what_hangs_unknown_on_wrist_and_arm_is_searched_over_the_documented_range() -> None:
    """Torques [N m]; of those that are tried every third, where so few are enough, begins with the same one."""
    for made, typical, high, least, most in ((of_tool, 200.0, 2000.0, 40.0, 800.0), (of_arm, 2000.0, 20000.0, 400.0, 8000.0)):
        weight, coarse = made(), made(3)
        assert (weight.typical, weight.low, weight.high, weight.shape) == (typical, 0.0, high, True)
        assert f"| | `weight_nm`: {typical:g} N*m | {weight.source} |" in DOCUMENT
        assert f"| | 0 to {high:g} N*m | {weight.bounds_source} |" in DOCUMENT
        assert (weight.grid[0], weight.grid[-1]) == (least, most)
        assert np.diff(np.log(weight.grid)) == pytest.approx(np.log(most / least) / 30, rel=0.02)
        assert coarse.grid == weight.grid[::3]


def test_shares_that_axes_see_of_each_other_are_six_in_the_order_of_their_names() -> None:
    """Row: the axis that reads, column: the one that it sees; with three they are alike in both directions."""
    found = one_way(0.02, source="here", bounds_source="there")
    assert [(one.name, one.typical, one.low, one.high) for one in found] == [
        (name, 0.02, -0.5, 0.5) for name in ("xy", "xz", "yx", "yz", "zx", "zy")]
    assert crossed_one_way(np.arange(1.0, 7)).tolist() == [[0, 1, 2], [3, 0, 4], [5, 6, 0]]
    assert crossed(np.array([1.0, 2, 3])).tolist() == [[0, 1, 2], [1, 0, 3], [2, 3, 0]]


def test_a_law_sits_at_joints_of_the_robot_each_once() -> None:
    """And what any gear may do at each of them."""
    for law in every_law():
        assert list(law.joints) == sorted({*law.joints} & {*range(1, 7)}), law.stored
    whole = {"backlash", "soft_zone", "soft_beyond", "one_sided", "hysteresis", "gear_creep", "gear_softening", "encoder_zero"}
    assert {name for name in whole if effects()[name].joints != (1, 2, 3, 4, 5, 6)} == set()


def test_values_that_are_tried_go_up_in_steps_alike_within_the_bounds() -> None:
    """By differences or by factors, none half as wide again as another of a grid, so that nothing is missed. What is typical
    lies among them, but for a direction or a place, which have none, and shares of what acts on the robot at hand."""
    grids = [(law, parameter) for law in every_law() for parameter in law.parameters if parameter.grid]
    assert len(grids) > 30
    for law, parameter in grids:
        which, tried = f"{law.stored} {parameter.name}", np.array(parameter.grid, dtype=float)
        assert (np.diff(tried) > 0).all(), which
        ways = (np.diff(tried), np.diff(np.log(tried[tried > 0])))
        assert min(step.max() / step.min() for step in ways if len(step)) < 1.5, which
        if law.stored in SHARES_OF_LOAD:
            continue
        assert parameter.low <= tried[0] < tried[-1] <= parameter.high, which
        if not parameter.name.startswith(("axis_rad", "centre_", "crank_rad")):
            assert tried[0] <= parameter.typical <= tried[-1], which
    assert {law.stored for law in every_law() if type(law).grid is not Effect.grid} >= SHARES_OF_LOAD


SHARES_OF_LOAD = {"base_rocking.opens", "tool_play.opens"}


def test_waves_that_are_tried_lie_side_by_side() -> None:
    """From pose to pose those that come once to forty times a turn; over time those that come 0.7 to 8 times in all."""
    turns, spans = np.array(BetweenPoses.cycles_tried), np.array(drift.CYCLES)
    assert (turns[0], turns[-1]) == pytest.approx((1.0, 40.0), abs=0.75)
    assert 0.5 <= np.diff(turns).min() <= np.diff(turns).max() <= 0.75
    assert (spans[0], spans[-1]) == (0.7, 8.0)
    assert 1.3 < (spans[1:] / spans[:-1]).min() <= (spans[1:] / spans[:-1]).max() <= 1.5
