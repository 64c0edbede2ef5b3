"""Force that follows the cut, piece by piece, on paths of a few targets whose numbers are worked out here."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from compensator.correction import engagement
from compensator.correction.cutting_prior import depths, slot_depths
from compensator.correction.cutting_stiffness import CuttingStiffness
from compensator.correction.engagement import LoggedPass, across_feed, depth_logged, standing
from compensator.correction.least_depth import least_depth
from compensator.correction.settings import CorrectionSettings
from compensator.correction.slot_cut import Slots
from identification.common.findings import CompstiffError, Finding, Refused
from identification.model.kinematics import forward
from identification.model.rotations import Frame, rotation_matrix
from tests.support import robot

DOWN = rotation_matrix(np.array([0, np.pi, 0]))


def planned(force: list[list[float]], x_mm: list[float], deviation_um: list[list[float]], **chosen: Any) -> Any:
    """A straight path along x, the tool from above; force (N, 3) [N]; targets with force are those that have any."""
    wrench = np.hstack([np.array(force, dtype=float), np.zeros((len(force), 3))])
    targets = np.flatnonzero(wrench.any(axis=1))
    position = 1e-3 * np.column_stack([x_mm, np.zeros(len(x_mm)), np.full(len(x_mm), 700.0)])
    frame = SimpleNamespace(position=position, rotation=np.tile(DOWN, (len(x_mm), 1, 1)))
    toolpath = Lines(len(x_mm))
    path = SimpleNamespace(
        rest_from_tcp=frame, base_from_tcp=frame, known=np.isfinite(position).all(axis=1), toolpath=toolpath,
        to_flange=np.tile([0, 0, 1.0], (len(x_mm), 1)), length=1e-3 * (np.array(x_mm) - x_mm[0]),
        axes=SimpleNamespace(turned_to_base=lambda vectors, rows: vectors, turned_to_rest=lambda vectors, rows: vectors),
        finding=lambda target, code, level, message, hint="": Finding(code, level, message, "p.mod", target + 5, target=target,
                                                                      hint=hint))
    return SimpleNamespace(
        path=path, targets=targets, prediction=SimpleNamespace(position=1e-6 * np.array(deviation_um, dtype=float)),
        forces=SimpleNamespace(wrench=wrench, forced=wrench.any(axis=1)), findings=(),
        loaded=SimpleNamespace(learned=None), settings=SimpleNamespace(correction=CorrectionSettings(**chosen)))


@dataclass
class Forces:
    """Of a log, as far as they grow."""

    wrench: np.ndarray
    forced: np.ndarray | None = None


class Lines:
    """A toolpath of so many targets, one a line."""

    def __init__(self, count: int) -> None:
        self.source, self.number, self.line = "p.mod", np.arange(count), np.arange(count) + 5

    def __len__(self) -> int:
        return len(self.number)


@pytest.mark.parametrize(("force", "n", "across"), [
    ([300, 40, 0], [0, 1, 0], 40), ([0, -30, 40], [0, -0.6, 0.8], 50), ([900, 30, -40], [0, 0.6, -0.8], 50),
    ([1000, 49, 0], [0, 0, 0], 0), ([1000, 51, 0], [0, 1, 0], 51), ([0, 0, 0], [0, 0, 0], 0)])
def test_the_push_across_is_what_is_square_to_the_feed(force: list[float], n: list[float], across: float) -> None:
    """And nothing where that is under a twentieth of the force."""
    found = across_feed(planned([force] * 3, [0, 1, 3], [[0, 0, 0]] * 3).path, np.array([force] * 3, dtype=float))
    np.testing.assert_allclose(found[0], [n] * 3, atol=1e-12)
    np.testing.assert_allclose(found[1], [across] * 3, atol=1e-9)


def test_of_a_single_place_no_feed_is_known() -> None:
    """Then all of the force may stand across it; of two the feed is known."""
    for count, across in ((1, 5.0), (2, 4.0)):
        force = np.tile([3.0, 4.0, 0.0], (count, 1))
        found = across_feed(planned(force.tolist(), [7.0, 9.0][:count], [[0, 0, 0]] * count).path, force)
        np.testing.assert_allclose(found[1], across)


def test_the_tool_stood_where_offsets_and_deviation_took_it() -> None:
    job = planned([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [0, 1, 2], [[10, 20, 30], [1, 2, 3]])
    offsets = np.full((3, 3), 5e-6)
    np.testing.assert_allclose(standing(job, offsets), 1e-6 * np.array([[5, 5, 5], [15, 25, 35], [6, 7, 8]]))
    np.testing.assert_allclose(standing(job, None), 1e-6 * np.array([[0, 0, 0], [10, 20, 30], [1, 2, 3]]))
    np.testing.assert_array_equal(offsets, 5e-6)


@pytest.mark.parametrize(("aside_mm", "deep_mm"), [(0.3, 0.7), (-0.3, 1.3), (0.74, 0.26), (0.76, 0.25), (5.0, 0.25)])
def test_a_cut_is_never_taken_for_under_a_quarter_of_its_depth(aside_mm: float, deep_mm: float) -> None:
    assert depth_logged(1e-3, np.array([1e-3 * aside_mm])) == pytest.approx([1e-3 * deep_mm])


@pytest.mark.parametrize(("growth", "followed", "left"), [
    (0.25, 0.0, 10.0), (0.0, 0.5, 0.0), (0.25, 0.75, 6.25), (0.5, -0.95, 50 * 0.5 / 0.55), (0.2, -1.15, 50 * 0.2 / 0.1)])
def test_what_a_growing_force_leaves(growth: float, followed: float, left: float) -> None:
    """|d| g / (1 + g) of 50 um, whatever of the growth is followed in the part of it that counts; never more than ten times
    the growth's share."""
    job = planned([[0, 5, 0]], [0.0], [[0, 30, 40]])
    assert 1e6 * engagement._left(job, np.array([growth]), followed) == pytest.approx([left])


def test_what_is_left_over_all_depths_is_a_root_mean_square_with_their_weights() -> None:
    """50 um of deviation, the force growing by 0.4 mm by the depth, the tool 0.2 mm aside: at 1.2 mm of depth by 0.4, at 2.2 mm
    by 0.2. And what single depths leave, over all targets."""
    job = planned([[0, 5, 0], [0, 5, 0]], [0, 1], [[0, 30, 40], [0, 0, 0]])
    drawn = (np.array([1.2e-3, 2.2e-3]), np.array([0.7, 0.3]))
    left, told = engagement._of_any_depth(job, np.full(2, 0.4e-3), np.full(2, 0.2e-3), drawn, (1.2e-3,))
    one, other = 50 * 0.4 / 1.4, 50 * 0.2 / 1.2
    assert 1e6 * left == pytest.approx([np.sqrt(0.7 * one**2 + 0.3 * other**2), 0.0])
    assert told == ((1.2e-3, pytest.approx(1e-6 * one / np.sqrt(2))),)


def test_where_the_force_changes_along_the_path_a_step_aside_changes_it_as_much() -> None:
    """By the lesser slope of both sides, in shares of what is there: of 100, 100, 160, 280 and 280 N, 1 mm apart and then 2 mm,
    with the tool 0.5 mm aside. What has no force beside it on one side goes by the other; on neither, by nothing."""
    force = [[0, value, 0] for value in (0.0, 100, 100, 160, 280, 280, 0, 80, 0)]
    job = planned(force, [0, 1, 2, 3, 5, 6, 7, 8, 9], [[0, 0, 0]] * 6)
    found = engagement._where_it_changes(job, np.full(9, 0.5e-3))
    np.testing.assert_allclose(found, [0, 0, 0, 0.5 * 60 / 160, 0, 0, 0, 0, 0], atol=1e-12)
    rising = planned([[0, value, 0] for value in (100.0, 160, 280, 520)], [0, 1, 2, 3], [[0, 0, 0]] * 4)
    np.testing.assert_allclose(engagement._where_it_changes(rising, np.full(4, 0.5e-3)), [
        0.5 * 60 / 100, 0.5 * 60 / 160, 0.5 * 120 / 280, 0.5 * 240 / 520])


@pytest.mark.parametrize(("growth", "refused"), [
    ([0.2, 0.99, -0.99, 0.3], None), ([0.2, 1.0, 0.1, 0.3], None), ([0.2, 0.1, -1.2, 0.3], 2), ([0.2, 1.4, -1.1, 0.3], 2)])
@pytest.mark.parametrize("no_zero", [False, True])
def test_a_stiffness_does_not_fit_where_a_twentieth_of_the_push_would_vanish_or_double(
    growth: list[float], refused: int | None, no_zero: bool
) -> None:
    """Of 100, 10, 40 and 60 N across: 10 are under a twentieth of all, 40 are not. The target with most push is named."""
    job = planned([[0, 100, 0], [0, 10, 0], [0, 40, 0], [0, 60, 0]], [0, 1, 2, 3], [[0, 0, 0]] * 4)
    job.findings = (Finding("CS3041", "warning", "no tare"),) if no_zero else ()
    told = (job, np.array(growth), np.full(4, 25e3), np.array([100.0, 10, 40, 60]))
    if refused is None:
        engagement._refuse_what_does_not_fit(*told)
        return
    with pytest.raises(CompstiffError) as stopped:
        engagement._refuse_what_does_not_fit(*told)
    [found] = stopped.value.findings
    assert (found.code, found.file, found.line, found.target) == ("CS4123", "p.mod", 5 + refused, refused)
    assert found.message == (f"with a cutting stiffness of 25 N/mm the force here would change by "
                             f"{100 * growth[refused]:.0f} %, expected less than 100 %")
    assert found.hint.startswith("name an air move with --tare") == no_zero


@pytest.mark.parametrize(("growth", "stiffness", "words"), [
    ([0.1, 0.3, -0.5], [0, 25e3, 20e3], "with a cutting stiffness of 25 N/mm the corrected pass meets forces that are +10.0 % "
     "(median), 50.0 % at most, off the logged"),
    ([0.1, 0.0, -0.5], [0, 0, 0], "in slots the corrected pass meets forces that are -20.0 % (median), 50.0 % at most, off the "
     "logged; 1 with next to no force across the feed, or in another cut, keep theirs")])
def test_the_corrected_pass_meets_forces_that_have_grown(growth: list[float], stiffness: list[float], words: str) -> None:
    job = planned([[1, 2, 3]] * 3, [0, 1, 2], [[0, 0, 0]] * 3)
    wrench = np.arange(18.0).reshape(3, 6)
    job.forces = Forces(wrench)
    forces, [found] = engagement._engaged(job, np.array(growth), np.array(stiffness, dtype=float), np.ones(3, dtype=bool))
    np.testing.assert_allclose(forces.wrench, wrench * np.array([[1 + one] for one in growth]))
    assert (found.code, found.level, found.file) == ("CS4120", "note", "p.mod")
    assert found.message == f"force follows the cut: {words}"


def of_angles(*degrees: float) -> Any:
    """100 N at these angles to the left of the feed, square to the tool's axis; 50 um of deviation at each."""
    angle = np.radians(degrees)
    force = np.column_stack([100 * np.cos(angle), 100 * np.sin(angle), 0 * angle])
    return planned(force.tolist(), list(range(len(degrees))), [[0, 30, 40]] * len(degrees))


def stays(grows: np.ndarray, followed: np.ndarray) -> np.ndarray:
    return 50e-6 * grows / (1 + grows + followed)


KNOWN = {"stated": CuttingStiffness(20e3, 4e3, "stated"), "climbing": CuttingStiffness(20e3, 4e3, "passes", climb_only=True),
         "unsure": CuttingStiffness(20e3, 15e3, "passes", climb_only=True), "exact": CuttingStiffness(20e3, 0.0, "stated"),
         "exact climb": CuttingStiffness(20e3, 0.0, "passes", climb_only=True)}


@pytest.mark.parametrize("slot", [None, CuttingStiffness(9e4, 1e4, "depth")])
@pytest.mark.parametrize("known", KNOWN)
def test_what_is_known_of_a_wall_is_followed_where_it_holds(known: str, slot: CuttingStiffness | None) -> None:
    """At climb milling, half way to a slot, a slot and conventional milling: a K of climb milling alone, or one of all places,
    in slots too as long as nothing else is known of these. What is not followed leaves its error, or all of its size."""
    one, climb, slots = KNOWN[known], np.array([1, 0.5, 0, 0]), np.array([0, 0.5, 1, 0])
    per_newton = np.array([5e-6, -8e-6, 6e-6, 4e-6])
    wall = engagement._wall(of_angles(70, 90, 115, 160), LoggedPass(None, one, slot=slot), np.full(4, 90.0), per_newton)
    beside = 1 - slots if one.climb_only or slot else np.ones(4)
    share = np.zeros(4) if known == "unsure" else climb if one.climb_only else beside
    np.testing.assert_allclose(wall.stiffness, share * 20e3, atol=1e-6)
    size = np.sqrt((share * one.std) ** 2 + ((beside - share) ** 2) * (one.value**2 + one.std**2)) * np.abs(per_newton)
    followed = np.array([0.1, -0.16, 0.12, 0.0])
    np.testing.assert_allclose(wall.left(followed), stays(size, followed), atol=1e-12)
    assert (wall.exact, wall.at_depths) == (known == "exact", ())


@pytest.mark.parametrize("depth", [None, 1e-3])
def test_where_nothing_is_known_of_a_wall_what_it_leaves_goes_by_the_depths_that_there_are(depth: float | None) -> None:
    """Three quarters of the push grow with the depth, outside of slots; by a log-normal depth, wide where none is stated. Told
    at 0.3, 1 and 3 mm, where none is."""
    job = of_angles(70, 90, 115)
    job.settings = SimpleNamespace(correction=CorrectionSettings(depth_of_cut=depth))
    aside = np.array([20e-6, -30e-6, 10e-6])
    wall = engagement._wall(job, LoggedPass(None, None), np.full(3, 90.0), aside / 90.0)
    beside = np.array([1, 0.5, 0])
    drawn = (depth or 0.75e-3) * np.exp((0.3 if depth else 0.8) * np.random.default_rng(1).standard_normal(200_000))

    def at(deep: np.ndarray) -> np.ndarray:
        logged = np.maximum(deep[:, None] - aside, deep[:, None] / 4)
        return stays(0.75 * beside * np.abs(aside) / logged, np.zeros(3))

    np.testing.assert_allclose(wall.left(np.zeros(3)), np.sqrt(np.mean(at(drawn) ** 2, axis=0)), rtol=0.03)
    assert not wall.stiffness.any()
    assert not wall.exact
    told = [(deep, np.sqrt(np.mean(at(np.array([deep]))[0] ** 2))) for deep in (0.3e-3, 1e-3, 3e-3)]
    np.testing.assert_allclose(np.array(wall.at_depths), np.array(told if depth is None else []))


@pytest.mark.parametrize(("rise_um", "growth"), [(100, 0.5), (-100, -0.5), (189, 0.945), (191, 0.0)])
@pytest.mark.parametrize("std", [10e3, 60e3])
def test_a_slot_is_followed_up_to_95_per_cent_where_it_is_known(rise_um: float, growth: float, std: float) -> None:
    """K of 100 N/mm in a push of 20 N; what is not followed leaves all of its size, and of what is its error."""
    known = CuttingStiffness(100e3, std, "depth")
    share, rise = np.array([1.0, 0.4, 0.0]), np.full(3, 1e-6 * rise_um)
    job = of_angles(115, 115, 115)
    found = engagement._slot(job, LoggedPass(None, None, slot=known), Slots(share, rise / 20.0, rise))
    taken = share * (growth != 0) * (std == 10e3)
    np.testing.assert_allclose(found.growth, taken * growth, atol=1e-12)
    error = np.sqrt((taken * std) ** 2 + (share - taken) ** 2 * (100e3**2 + std**2)) * np.abs(rise) / 20.0
    np.testing.assert_allclose(found.left(found.growth), stays(error, found.growth), rtol=1e-9)
    assert found.at_depths == ()


@pytest.mark.parametrize(("wall", "counts"), [
    (None, True), (CuttingStiffness(20e3, 4e3, "passes", climb_only=True), True),
    (CuttingStiffness(20e3, 4e3, "stated"), False)])
def test_where_nothing_is_known_of_slots_a_k_of_all_places_holds_in_them(wall: CuttingStiffness | None, counts: bool) -> None:
    """Else all of the force grows with a depth from 0.4 to 10 mm, of which 1, 2 and 5 mm are told."""
    job, rise = of_angles(115, 115), np.array([40e-6, -20e-6])
    found = engagement._slot(job, LoggedPass(None, wall), Slots(np.array([1.0, 0.5]), rise / 90, rise))
    assert not found.growth.any()
    drawn = 2e-3 * np.exp(0.8 * np.random.default_rng(2).standard_normal(200_000))[:, None]

    def at(deep: np.ndarray) -> np.ndarray:
        return stays(np.abs([1.0, 0.5] * rise) / np.maximum(deep - rise, deep / 4), np.zeros(2))

    np.testing.assert_allclose(found.left(np.zeros(2)), counts * np.sqrt(np.mean(at(drawn) ** 2, axis=0)), rtol=0.03)
    told = [(deep, np.sqrt(np.mean(at(np.array([deep])) ** 2))) for deep in (1e-3, 2e-3, 5e-3)]
    np.testing.assert_allclose(np.array(found.at_depths), np.array(told if counts else []))


@pytest.mark.parametrize("on_plan", [True, False])
def test_where_nothing_is_followed_the_pass_is_as_logged(on_plan: bool) -> None:
    """The forces and the deviation are those of the log. Of forces that a tool on its plan meets nothing is left by the cut; of
    logged ones what an unknown cut leaves, and what 10 N/mm would: 50 um of deviation, 40 of them along 90 N of push."""
    job = planned([[0, 0, 0], [0, 90, 0], [0, 90, 0], [0, 90, 0]], [0, 1, 2, 3], [[0, 40, 30]] * 3)
    found, prediction = engagement.following_the_cut(job, np.arange(4), LoggedPass(None, None, on_plan=on_plan))
    assert (found.loaded, prediction, found.gain, found.findings) == (job.loaded, job.prediction, 0.0, ())
    np.testing.assert_array_equal(found.in_covariance, 0.0)
    np.testing.assert_array_equal(found.uncorrected, 1.0)
    assert len(found.uncorrected) == len(found.left) == len(found.in_covariance) == 3
    if on_plan:
        assert not found.left.any()
        assert not found.stood.any()
        assert (found.left_as_logged, found.at_depths, found.at_slot_depths) == (None, (), ())
        return
    np.testing.assert_allclose(found.stood, [[0, 40e-6, 30e-6]] * 3)
    grown = 1e4 * 40e-6 / 90
    np.testing.assert_allclose(found.left_as_logged, 50e-6 * grown / (1 + grown))
    assert [depth for depth, _ in found.at_depths] == [0.3e-3, 1e-3, 3e-3]
    slot = [depth for depth, _ in found.at_slot_depths]
    # 90 degrees to the left of the feed is half a slot, which rises by 30 um.
    assert slot == [1e-3, 2e-3, 5e-3]
    wall, in_slot = (np.array([left for _, left in told]) for told in (found.at_depths, found.at_slot_depths))
    for depth, left in zip((0.3e-3, 1e-3, 3e-3), wall, strict=True):
        grown = 0.75 * 0.5 * 40e-6 / (depth - 40e-6)
        assert left == pytest.approx(50e-6 * grown / (1 + grown))
    for depth, left in zip(slot, in_slot, strict=True):
        grown = 0.5 * 30e-6 / (depth - 30e-6)
        assert left == pytest.approx(50e-6 * grown / (1 + grown))
    assert found.left[1] == pytest.approx(float(np.hypot(*(
        engagement._of_any_depth(job, np.full(4, grows), np.full(4, aside), drawn, ())[0][1] for grows, aside, drawn in (
            (0.375 * 40e-6, 40e-6, depths(CorrectionSettings())), (0.5 * 30e-6, 30e-6, slot_depths()))))))


@pytest.mark.parametrize(("steady", "more"), [(True, 0.0), (False, 40e-3 * 30 / 90)])
def test_where_the_force_changes_more_is_left(steady: bool, more: float) -> None:
    """By 30 N a millimetre, with the tool 40 um aside: beside what is not known of the cut; where a K is stated as exact it is
    taken as such everywhere."""
    job = planned([[0, value, 0] for value in ([90, 90, 90, 90] if steady else [60, 90, 120, 150])], [0, 1, 2, 3],
                  [[0, 40, 0]] * 4)
    unsure = CuttingStiffness(1e-9, 1.0, "stated")
    found, _ = engagement.following_the_cut(job, np.arange(4), LoggedPass(None, unsure))
    assert found.left[1] == pytest.approx(40e-6 * more / (1 + more), abs=1e-10)
    nothing = CuttingStiffness(0.0, 0.0, "stated")
    assert not engagement.following_the_cut(job, np.arange(4), LoggedPass(None, nothing))[0].left.any()


@dataclass(frozen=True)
class Pass:
    """As far as a followed force changes it: a prediction, or a path under load."""

    position: np.ndarray | None = None
    covariance: np.ndarray | None = None
    learned: Any = None
    forces: Any = None
    theta: np.ndarray | None = None

    def each_tool(self) -> list[tuple[Frame, np.ndarray]]:
        return [(TOOL, np.arange(len(self.theta if self.theta is not None else ())))]


TOOL = Frame(np.eye(3), np.array([0.1, 0.0, 0.25]))
COMPLIANCE = 1e-7 * np.array([2.0, 3, 2, 9, 9, 9])


def followed_by(monkeypatch: pytest.MonkeyPatch, logged: LoggedPass, push: list[float], deviation_um: list[float], *,
                learned_um: list[float] | None = None) -> tuple[Any, Any, Any]:
    """The corrected pass of a log with this push across and this deviation along it, and its deviation, which the robot is said
    to have under the forces that it meets: 7 um along z and 24 along y, known to 2 um an axis."""
    job = planned([[0, one, 0] for one in push], list(range(len(push))), [[0, one, 0] for one in deviation_um])
    shift = None if learned_um is None else 1e-6 * np.column_stack([0 * np.array(push), learned_um, 0 * np.array(push)])
    job.forces = Forces(job.forces.wrench, job.forces.forced)
    theta = np.array([0.1, 0.2, -0.3, 0.2, 0.8, 0.1]) + 0.1 * np.arange(len(push))[:, None]
    job = World(job, Pass(job.prediction.position, None, shift), Pass(forces=job.forces, theta=theta, learned=shift))
    told: list[Any] = []

    def predict_path(loaded: Any) -> Pass:
        told.append(loaded)
        return Pass(np.tile([0, 24e-6, 7e-6], (len(push), 1)), np.tile(4e-12 * np.eye(3), (len(push), 1, 1)))

    monkeypatch.setattr(engagement, "predict_path", predict_path)
    found, prediction = engagement.following_the_cut(cast(Any, job), np.arange(len(push)), logged)
    assert told == [found.loaded]
    return job, found, prediction


@dataclass(frozen=True)
class World:
    """A predicted program whose parts can be replaced."""

    of: Any
    prediction: Pass
    loaded: Pass

    @property
    def model(self) -> Any:
        return SimpleNamespace(robot=robot(), compliance=COMPLIANCE)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.of, name)


def test_a_followed_force_has_the_error_of_its_stiffness_in_its_covariance(monkeypatch: pytest.MonkeyPatch) -> None:
    """20 +- 4 N/mm of all places, 90 N of push, 27 um of deviation: the force grows by 0.6 %, and 0.12 % are not known, of the
    deviation that the corrected pass has, along it."""
    logged = LoggedPass(None, CuttingStiffness(20e3, 4e3, "stated"))
    _, found, prediction = followed_by(monkeypatch, logged, [90.0] * 4, [27.0] * 4)
    np.testing.assert_allclose(found.loaded.forces.wrench, np.tile([0, 90 * 1.006, 0, 0, 0, 0], (4, 1)))
    left = 27e-6 * 0.0012 / 1.0072 * 1.006
    np.testing.assert_allclose(found.left, left)
    np.testing.assert_allclose(found.in_covariance, left)
    along = np.array([0, 24, 7]) / 25
    np.testing.assert_allclose(prediction.covariance, np.tile(4e-12 * np.eye(3) + left**2 * np.outer(along, along), (4, 1, 1)))
    assert (found.left_as_logged, found.uncorrected.tolist()) == (None, [1.0] * 4)
    assert [one.code for one in found.findings] == ["CS4120"]
    np.testing.assert_allclose(found.stood, np.tile([0, 27e-6, 0], (4, 1)))


def test_the_gain_is_the_largest_of_the_targets(monkeypatch: pytest.MonkeyPatch) -> None:
    """K by how far a newton along the push moves the tool, by differences of the forward kinematics; refused from 1 on."""
    def gains(stiffness: float) -> tuple[float, np.ndarray]:
        logged = LoggedPass(None, CuttingStiffness(stiffness, 0.0, "stated"))
        job, found, _ = followed_by(monkeypatch, logged, [90.0] * 3, [0.1] * 3)
        moves = []
        for angles in job.loaded.theta:
            there = forward(robot(), angles[None], TOOL).position[0]
            columns = [(forward(robot(), (angles + 1e-6 * one)[None], TOOL).position[0] - there) / 1e-6 for one in np.eye(6)]
            moves.append(sum(c * column[1] ** 2 for c, column in zip(COMPLIANCE, columns, strict=True)))
        return found.gain, np.array(moves)

    gain, moves = gains(20e3)
    assert gain == pytest.approx(20e3 * moves.max(), rel=1e-4)
    assert moves.max() > 1.001 * moves.min()
    gains(0.999 / moves.max())
    with pytest.raises(Refused) as stopped:
        gains(1.001 / moves.max())
    [found] = stopped.value.findings
    assert (found.code, found.file, found.target) == ("CS3200", "p.mod", int(np.argmax(moves)))
    assert f"{1.001e-3 / moves.max():.3g} N/mm of depth against {1e-3 / moves.max():.3g} N/mm of the tool" in found.message


def test_what_is_beyond_95_per_cent_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 0.5 N, where 20 N/mm of 40 um are 1.6 times all of it: 0.65 of what is met then stay out of 2.6, of the deviation that
    the pass has there; nothing elsewhere, for the K is exact."""
    logged = LoggedPass(None, CuttingStiffness(20e3, 0.0, "stated"))
    _, found, _ = followed_by(monkeypatch, logged, [90.0, 90, 90, 0.5], [40.0] * 4)
    np.testing.assert_allclose(found.left, [0, 0, 0, 40e-6 * 0.65 / 2.6 * 1.95], atol=1e-12)
    np.testing.assert_allclose(found.loaded.forces.wrench[:, 1], [90.8, 90.8, 90.8, 0.975])
    assert [(one.code, one.target) for one in found.findings] == [("CS4120", 3), ("CS4120", None)]


def test_of_a_pass_with_offsets_the_planned_program_has_another_deviation(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tool stood 400 um aside, 40 of them by its deviation: on the plan it meets 8.9 % more, uncorrected 0.9 % less than
    there. And what one of them would be beyond 95 % is not followed."""
    offsets: Any = SimpleNamespace(over=lambda path, kept=None: np.tile([0, 360e-6, 0], (3, 1)))
    logged = LoggedPass(offsets, CuttingStiffness(20e3, 0.0, "stated"))
    _, found, _ = followed_by(monkeypatch, logged, [90.0, 90, 90], [40.0] * 3)
    np.testing.assert_allclose(found.stood, np.tile([0, 400e-6, 0], (3, 1)))
    np.testing.assert_allclose(found.uncorrected, (1 + 8 / 90) / (1 + 0.8 / 90))
    np.testing.assert_allclose(found.loaded.forces.wrench[:, 1], 98.0)


@pytest.mark.parametrize("yields_um", [39.0, 46.0])
def test_a_set_up_that_was_learned_says_nothing_of_the_stiffness(monkeypatch: pytest.MonkeyPatch, yields_um: float) -> None:
    """5 mm aside, of which the springs yield 39 um: at 2 N/um that is less than 90 N. With 46 um it does not fit the log."""
    logged = LoggedPass(None, CuttingStiffness(2e6, 0.0, "stated"))
    monkeypatch.setattr(engagement, "_check_gain", lambda *arguments: 0.5)
    told = (monkeypatch, logged, [90.0] * 3, [5000.0] * 3)
    if yields_um < 45:
        _, found, _ = followed_by(*told, learned_um=[5000 - yields_um] * 3)
        np.testing.assert_allclose(found.loaded.forces.wrench[:, 1], 90 * 1.95)
        assert [one.code for one in found.findings] == ["CS5325", "CS4120"]
        return
    with pytest.raises(CompstiffError, match="CS4123.*2000 N/mm the force here would change by 102 %"):
        followed_by(*told, learned_um=[5000 - yields_um] * 3)


def test_how_much_deeper_the_tool_goes_counts_by_the_newton_where_there_is_a_push() -> None:
    """e . n / F_n, of targets with force alone."""
    job = planned([[9, 40, 0], [9, 50, 0], [9, 0, 0], [0, 0, 0]], [0, 1, 2, 3], [[7, 30, 0], [7, -20, 0], [7, 30, 0]])
    direction, across = np.tile([0, 1.0, 0], (4, 1)), np.array([40.0, 50, 0, 0])
    offsets = np.tile([1e-6, 2e-6, 0], (4, 1))
    per_newton, chosen = engagement._deeper(job, offsets, direction, across)
    np.testing.assert_allclose(per_newton, [32e-6 / 40, -18e-6 / 50, 0, 0])
    assert chosen.tolist() == [True, True, False, False]


@pytest.mark.parametrize(("learned", "beyond", "code", "level"), [
    (False, [], "", ""), (False, [0, 2], "CS4120", "note"), (True, [], "", ""), (True, [1], "CS5325", "note"),
    (True, [1, 2], "CS5325", "warning")])
def test_how_far_a_force_is_followed_is_said(learned: bool, beyond: list[int], code: str, level: str) -> None:
    """Where a part was learned a warning from a twentieth of all the push across on: 9 of 200 N, and 12."""
    job = planned([[0, 188, 0], [0, 9, 0], [0, 3, 0]], [0, 1, 2], [[0, 0, 0]] * 3)
    job.loaded = SimpleNamespace(learned=object() if learned else None)
    found = engagement._limited(job, np.array(beyond, dtype=np.intp), np.array([188.0, 9, 3]))
    assert [(one.code, one.level, one.target) for one in found] == ([(code, level, beyond[0])] if code else [])
    assert all("the force is taken to change by 95 % there, no more" in one.message for one in found)
    assert all(f"at {len(beyond)} target" in one.message for one in found)
    assert all(bool(one.hint) == (level == "warning") for one in found)


def least(angle_deg: float, stood_um: list[float], stiffness: CuttingStiffness | None, **chosen: Any) -> np.ndarray:
    """Of 100 N square to the tool's axis at so many degrees to the left of the feed."""
    angle = np.radians(angle_deg)
    force = [100 * np.cos(angle), 100 * np.sin(angle), 0.0]
    job = planned([force] * 3, [0, 1, 2], [[0, 0, 0]] * 3, **chosen)
    return least_depth(job, LoggedPass(None, stiffness), np.tile(1e-6 * np.array(stood_um), (3, 1)))


def test_the_push_of_a_climbing_cut_tells_how_deep_it_is_at_least() -> None:
    """0.75 F_n / K, less one sigma by K (a fifth) and by how cutters differ (0.16), and as much more as the tool stood aside;
    towards the wall it stood no shallower."""
    known = CuttingStiffness(50e3, 10e3, "passes")
    push = 100 * np.sin(np.radians(70))
    deep = 0.75 * push / 50e3 * np.exp(-np.sqrt(0.2**2 + 0.16**2))
    np.testing.assert_allclose(least(70, [900, 80, 70], known), deep + 80e-6, rtol=1e-9)
    np.testing.assert_allclose(least(70, [900, -80, 70], known), deep, rtol=1e-9)
    np.testing.assert_allclose(least(70, [0, 80, 0], known, depth_of_cut=1.3e-3), 1.3e-3)


@pytest.mark.parametrize(("angle", "known"), [
    (70.0, None), (70.0, CuttingStiffness(50e3, 26e3, "passes")), (91.0, CuttingStiffness(50e3, 1e3, "passes")),
    (-70.0, CuttingStiffness(50e3, 1e3, "passes")), (0.5, CuttingStiffness(50e3, 1e3, "passes"))])
def test_nothing_tells_the_depth_of_another_cut(angle: float, known: CuttingStiffness | None) -> None:
    """Nothing known of its stiffness, too little of it, more of a slot than of climb milling, conventional, or no push."""
    assert np.isnan(least(angle, [0, 80, 0], known)).all()
    assert not np.isnan(least(89.0, [0, 80, 0], CuttingStiffness(50e3, 1e3, "passes"))).any()
