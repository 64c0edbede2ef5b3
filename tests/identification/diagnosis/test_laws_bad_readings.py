"""Which answer is given where readings, poses or the table are bad: step by step, each way that an answer can go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.diagnosis import procedure, slips_rather
from identification.diagnosis.procedure import Procedure
from identification.diagnosis.slips_rather import Suspected, suspected, wrong_angles_rather
from identification.fit.mistakes.judge import Mistakes


@dataclass(frozen=True)
class Rows:
    """Rows of a table, by their numbers in the file."""

    row: NDArray[np.intp]

    def select(self, kept: NDArray[np.bool_]) -> Rows:
        return Rows(self.row[kept])


@dataclass(frozen=True)
class Data:
    """A load test, as far as these steps ask."""

    rows: Rows

    def with_rows(self, rows: Rows) -> Data:
        return Data(rows)


@dataclass(frozen=True)
class Said:
    """A judgement, as far as these steps ask; of: which rows it is of."""

    verdict: str
    of: str = "all"
    mistakes: tuple[str, ...] = ()
    patterns: tuple[str, ...] = ()
    bad_rows: tuple[Any, ...] = ()
    bad_visits: tuple[Any, ...] = ()
    scatters: tuple[Any, ...] = ()
    causes: tuple[str, ...] = ()
    gain: Any = None
    visits: Any = None
    suspects: Any = None
    validation: Any = None
    plain: Any = "plain"
    extended: Any = "extended"
    tried: Any = None
    log_odds: float | None = None
    thinning: Any = None
    share: Any = None
    detection: Any = None
    adequacy: Any = None
    showing: Any = ()
    scatter: Any = None
    lost: tuple[str, ...] = ()
    law_differs: bool = False
    rows: Any = field(default_factory=lambda: Rows(np.arange(1, 7)))


@dataclass(frozen=True)
class Unknown(Said):
    """With what an unknown cause has more."""

    alternatives: tuple[Any, ...] = ("before",)
    withdrawn: Any = None


def steps(**more: Any) -> Procedure:
    data: Any = Data(Rows(np.arange(1, 7)))
    return Procedure(data, {}, 0.05, 10, 5, **more)


@pytest.mark.parametrize(("before", "again", "taken"), [
    ("named", "adequate", "rest"), ("adequate", "adequate", "rest"), ("named", "named", "rest"), ("unknown", "unknown", "rest"),
    ("ambiguous", "unknown", "rest"), ("named", "unknown", "all"), ("named", "ambiguous", "all"), ("named", "mistake", "all")])
def test_bad_rows_are_left_out_unless_a_name_would_go_with_them(
        monkeypatch: pytest.MonkeyPatch, before: str, again: str, taken: str) -> None:
    """Where all else is well they are what is wrong, with what it gains to leave them out."""
    asked: list[tuple[list[int], bool]] = []

    def judged(self: Procedure) -> Said:
        asked.append((self.data.rows.row.tolist(), self.sound))
        return Said(again, "rest")

    bad = (SimpleNamespace(row=2), SimpleNamespace(row=5))
    monkeypatch.setattr(Procedure, "judged", judged)
    monkeypatch.setattr(procedure, "bad_rows", lambda extended: bad if extended == "extended" else ())
    monkeypatch.setattr(procedure, "gain", lambda good, plain, extended, rng: (good.rows.row.tolist(), plain, extended))
    first: Any = Said(before)
    found: Any = steps().without_bad_rows(first)
    assert asked == [([1, 3, 4, 6], before == "named")]
    if taken == "all":
        assert found is first
    else:
        assert found == Said("named" if again == "adequate" else again, "rest", bad_rows=bad, gain=(
            [1, 3, 4, 6], "plain", "extended") if again == "adequate" else None, rows=found.rows)


def test_without_bad_rows_and_beside_a_mistake_nothing_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(procedure, "bad_rows", lambda extended: ())
    for verdict in ("named", "mistake"):
        first: Any = Said(verdict)
        assert steps().without_bad_rows(first) is first
        monkeypatch.setattr(procedure, "bad_rows", lambda extended: pytest.fail("looked for beside a mistake"))


@pytest.mark.parametrize(("before", "again", "slips", "verdict", "taken", "pattern"), [
    ("named", "unknown", True, "named", "all", ""), ("unknown", "unknown", False, "unknown", "all",
     "P7, P8 fit least of all poses the springs of the others, which are not explained either"),
    ("unknown", "unknown", True, "unknown", "rest", ""), ("unknown", "ambiguous", False, "ambiguous", "rest", ""),
    ("named", "named", False, "named", "rest", ""), ("adequate", "adequate", False, "named", "rest", ""),
    ("ambiguous", "unknown", False, "ambiguous", "all", "")])
def test_bad_poses_are_left_out_unless_the_others_have_no_name_either(
        monkeypatch: pytest.MonkeyPatch, before: str, again: str, slips: bool, verdict: str, taken: str, pattern: str) -> None:
    """Poses at which an angle was written wrongly always."""
    asked: list[tuple[list[int], bool]] = []

    def judged(self: Procedure) -> Said:
        asked.append((self.data.rows.row.tolist(), self.sound))
        return Said(again, "rest")

    scores = [SimpleNamespace(name=name, rows=np.array(rows), wrong_angle="an angle" if slips else None)
              for name, rows in (("P7", [1, 2]), ("P8", [6]))]
    bad = tuple(SimpleNamespace(score=score, mends=()) for score in scores)
    monkeypatch.setattr(procedure, "with_mends", lambda test, rest, rows: bad)
    monkeypatch.setattr(procedure, "bad_rows", lambda extended: ())
    monkeypatch.setattr(Procedure, "judged", judged)
    first: Any = Said(before)
    test: Any = SimpleNamespace(bad=scores, rest="rest")
    found: Any = steps().without_bad_visits(first, test)
    assert asked == [([3, 4, 5], before == "named")]
    assert (found.verdict, found.of, found.patterns) == (verdict, taken, (pattern,) if pattern else ())
    assert found.bad_visits == (bad if taken == "rest" else ())


@pytest.mark.parametrize(("angles", "rather", "bad", "crowded", "taken"), [
    (True, True, True, True, "angles"), (False, True, True, True, "rather"), (False, False, True, True, "bad"),
    (False, False, False, True, "crowded"), (False, False, False, False, "rows")])
def test_poses_are_looked_at_before_rows_and_wrong_angles_first(
        monkeypatch: pytest.MonkeyPatch, angles: bool, rather: bool, bad: bool, crowded: bool, taken: str) -> None:
    """Which poses are suspected besides is looked at again where the answer is another."""
    def test_of(name: str, found: bool = True) -> Any:
        return SimpleNamespace(name=name, bad=["P1"] * found, too_many=False)

    seen: list[Any] = []

    def of_suspects(judgement: Said, seed: int) -> Any:
        seen.append((judgement.of, seed))
        return SimpleNamespace(rather=test_of("rather") if rather else None, visits=(judgement.of,))

    first = Said("named")
    for name, answer in (("wrong_angles_rather", test_of("angles") if angles else None), ("bad_visits", test_of("bad", bad)),
                         ("with_crowded", test_of("crowded", crowded)), ("judge_validation", "validation")):
        monkeypatch.setattr(procedure, name, lambda *of, answer=answer: answer)
    monkeypatch.setattr(procedure, "suspected", of_suspects)
    monkeypatch.setattr(Procedure, "judged", lambda self: first)
    monkeypatch.setattr(Procedure, "without_bad_visits", lambda self, judgement, test: replace(judgement, of=test.name))
    monkeypatch.setattr(Procedure, "without_bad_rows", lambda self, judgement: judgement)
    found: Any = steps().of_good_rows()
    assert found.of == ("all" if taken == "rows" else taken)
    assert found.visits.name == ("crowded" if taken == "rows" else taken)
    assert found.suspects == (found.of,)
    assert found.validation == "validation"
    assert seen == [("all", 5)] + [(taken, 5)] * (taken != "rows")


@pytest.mark.parametrize(("verdict", "too_many", "told"), [
    ("adequate", True, "unknown"), ("adequate", False, "adequate"), ("named", True, "named")])
def test_poses_of_which_too_many_are_bad_are_no_adequate_answer(
        monkeypatch: pytest.MonkeyPatch, verdict: str, too_many: bool, told: str) -> None:
    test = SimpleNamespace(bad=(), too_many=too_many)
    for name, answer in (("wrong_angles_rather", None), ("bad_visits", test), ("with_crowded", test), ("bad_rows", ()),
                         ("suspected", SimpleNamespace(rather=None, visits=())), ("judge_validation", None)):
        monkeypatch.setattr(procedure, name, lambda *of, answer=answer: answer)
    monkeypatch.setattr(Procedure, "judged", lambda self: Said(verdict, patterns=("a pattern",)))
    found: Any = steps().of_good_rows()
    assert found.verdict == told
    assert found.patterns == (
        *["the readings at more than a third of the poses fit no stiffness that fits the others"] * (told == "unknown"),
        "a pattern")


def test_beside_a_mistake_in_the_table_no_pose_and_no_row_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(procedure, "suspected", lambda *of: pytest.fail("looked at"))
    first = Said("mistake")
    monkeypatch.setattr(Procedure, "judged", lambda self: first)
    assert steps().of_good_rows() is first


@pytest.mark.parametrize(("first", "swung", "aside", "again", "verdict", "scatters"), [
    ("unknown", True, False, "adequate", "named", ("swing",)), ("adequate", True, False, "adequate", "named", ("swing",)),
    ("adequate", False, True, "adequate", "adequate", ()), ("named", False, True, "named", "named", ("zeros",)),
    ("unknown", True, True, "ambiguous", "ambiguous", ("swing", "zeros")), ("unknown", True, True, "unknown", "unknown", ()),
    ("unknown", True, False, "mistake", "unknown", ()), ("mistake", True, True, "adequate", "mistake", ())])
def test_scatter_is_allowed_for_where_that_explains_the_rows(
        monkeypatch: pytest.MonkeyPatch, first: str, swung: bool, aside: bool, again: str, verdict: str,
        scatters: tuple[str, ...]) -> None:
    """Of weights that swing, and then, of rows that springs do not explain, of zeros that lie aside."""
    class Scatter(str):
        def allowed_for(self, data: Any, plain: Any) -> str:
            return f"{data} and {self}"

    asked: list[str] = []

    def of_good_rows(self: Any) -> Said:
        asked.append(self.data)
        return Said(again)

    looked: list[Any] = []
    for function, name, seen in (("swing_of", "swing", swung), ("unsettled_zero_of", "zeros", aside)):
        scatter = Scatter(name) if seen else None
        monkeypatch.setattr(procedure, function, lambda left, scatter=scatter: looked.append(left) or scatter)
    monkeypatch.setattr(Procedure, "of_good_rows", of_good_rows)
    data: Any = "rows"
    judgement: Any = Said(first, tried="tried" if first == "unknown" else None)
    found: Any = Procedure(data, {}, 0.05, 10, 5).allowing_for_scatter(judgement)
    assert (found.verdict, found.scatters) == (verdict, scatters)
    if scatters == ("swing", "zeros"):
        assert asked == ["rows and swing", "rows and swing and zeros"]
    assert looked[:1] == ([] if first == "mistake" else ["tried" if first == "unknown" else "extended"])


@pytest.mark.parametrize(("verdict", "causes", "detection", "adequacy", "shows"), [
    ("adequate", (), 0.06, None, True), ("adequate", (), 0.04, None, False), ("named", ("a cause",), 0.01, 0.06, True),
    ("named", ("a cause",), 0.06, 0.04, False), ("named", (), 0.06, None, True), ("ambiguous", (), 0.06, 0.06, False),
    ("unknown", (), 0.06, 0.06, False), ("named", ("a cause",), 0.06, None, False)])
def test_what_would_have_shown_is_told_where_what_is_left_is_noise(
        monkeypatch: pytest.MonkeyPatch, verdict: str, causes: tuple[str, ...], detection: float, adequacy: float | None,
        shows: bool) -> None:
    """Of rows with names beside these: by the test of the model that has them."""
    def test_of(p_value: float | None) -> Any:
        return None if p_value is None else SimpleNamespace(p_value=p_value, critical=100 * p_value)

    first = Said(verdict, causes=causes, detection=test_of(detection), adequacy=test_of(adequacy))
    monkeypatch.setattr(procedure, "in_blocks", lambda cell, rows: ("averaged", "thinning"))
    monkeypatch.setattr(procedure, "share_of", lambda rows: (f"share of {rows}", "share"))
    monkeypatch.setattr(procedure, "LoadTest", SimpleNamespace(of=lambda cell, rows: rows))
    monkeypatch.setattr(procedure, "showing", lambda extended, catalogue, critical: (extended, catalogue, critical))
    monkeypatch.setattr(Procedure, "of_good_rows", lambda self: first)
    monkeypatch.setattr(Procedure, "allowing_for_scatter", lambda self, judgement: replace(judgement, of=self.data))
    nothing: Any = None
    found: Any = procedure.judge(nothing, nothing, catalogue={})
    assert (found.of, found.thinning, found.share) == ("share of averaged", "thinning", "share")
    assert found.showing == (("extended", {}, pytest.approx(6.0)) if shows else ())


@pytest.mark.parametrize(("verdict", "odds", "angles", "taken"), [
    ("named", 10.0, [13.1], True), ("named", 10.0, [12.9], False), ("ambiguous", 10.0, [7.0, None, 6.1], True),
    ("ambiguous", 10.0, [7.0, None, 5.9], False), ("unknown", 10.0, [99.0], False), ("named", None, [99.0], False)])
def test_wrong_angles_take_a_cause_s_place_where_they_are_likelier_by_e_3(
        monkeypatch: pytest.MonkeyPatch, verdict: str, odds: float | None, angles: list[float | None], taken: bool) -> None:
    """All of them together."""
    bad = [SimpleNamespace(wrong_angle=None if value is None else SimpleNamespace(log_odds=value)) for value in angles]
    test = SimpleNamespace(bad=bad)
    monkeypatch.setattr(slips_rather, "bad_visits", lambda model, seed: test if (model, seed) == ("plain", 5) else None)
    judgement: Any = Said(verdict, log_odds=odds)
    assert wrong_angles_rather(judgement, 5) is (test if taken else None)


@pytest.mark.parametrize(("sure", "bad", "rather"), [
    ([0.96], 1, True), ([0.94], 1, False), ([0.96], 2, False), ([0.96, 0.97], 2, True), ([0.96, None], 2, False),
    ([], 0, False)])
def test_a_slip_takes_a_bumped_sensor_s_place_where_it_is_all_but_certain_at_each_pose(
        sure: list[float | None], bad: int, rather: bool) -> None:
    visits: Any = tuple(SimpleNamespace(mends=() if p is None else (SimpleNamespace(probability=p), SimpleNamespace(
        probability=1 - p))) for p in sure)
    test: Any = SimpleNamespace(bad=["P"] * bad)
    assert Suspected(test, visits).rather is (test if rather else None)


def places(**where: tuple[Callable[[int], bool], bool]) -> Any:
    """A fit of three poses of two rows with causes that move some rows, and have a place in the table or not."""
    rows = SimpleNamespace(visit=np.repeat(np.arange(3), 2), line=np.arange(2, 8))
    terms = []
    for name, (moved, placed) in where.items():
        contribution = np.array([[2e-6 * moved(row), 0.0, 0.0] for row in range(6)])
        effect = SimpleNamespace(name=name, where={"row": 3} if placed else {}, contribution=lambda *of, c=contribution: c)
        terms.append(SimpleNamespace(effect=effect, joint=None, scale=None))
    return SimpleNamespace(data=SimpleNamespace(rows=rows), load_state=None, terms=tuple(terms))


@pytest.mark.parametrize(("moved", "placed", "verdict", "found"), [
    (lambda row: row in (2, 3), True, "named", True), (lambda row: row in (2, 3), True, "ambiguous", True),
    (lambda row: row in (2, 3), True, "unknown", False), (lambda row: row in (2, 3), False, "named", False),
    (lambda row: row == 2, True, "named", False), (lambda row: row in (1, 2, 3), True, "named", False)])
def test_a_pose_is_suspected_all_of_whose_readings_a_cause_touches_and_no_other(
        monkeypatch: pytest.MonkeyPatch, moved: Callable[[int], bool], placed: bool, verdict: str, found: bool) -> None:
    """Of the poses that do not fit without that cause those for which it was named; the other causes stay in the model."""
    fitted = places(step=(moved, placed), play=(lambda row: True, False))
    monkeypatch.setattr(slips_rather, "visit_name", lambda rows, mine: f"pose of rows {mine.tolist()}")
    monkeypatch.setattr(slips_rather, "posterior", lambda data, terms, near: [term.effect.name for term in terms])
    test = SimpleNamespace(rest="rest")
    monkeypatch.setattr(slips_rather, "bad_visits", lambda model, seed: test if (model, seed) == (["play"], 5) else None)
    bad = [SimpleNamespace(score=SimpleNamespace(name=name)) for name in (
        "pose of rows [2, 3]", "pose of rows [2]", "pose of rows [1, 2, 3]", "another")]
    monkeypatch.setattr(slips_rather, "with_mends", lambda *of: bad)
    judgement: Any = Said(verdict, extended=fitted)
    assert suspected(judgement, 5).visits == ((bad[0],) if found else ())
    test.rest = None
    assert suspected(judgement, 5).visits == ()


def misfit(monkeypatch: pytest.MonkeyPatch, *, left: float = 0.5, chance: float = 0.01, scatter: Any = (), nearly: bool = False,
           support: float | None = 9.0, sure: Any = None, beyond: Any = None, sound: bool = False, strain: bool = False,
           enough: bool = True) -> tuple[Any, list[str]]:
    """What is said of rows whose misfit is of this chance, with causes that leave one of another; and the steps taken."""
    taken: list[str] = []

    def found(name: str) -> Any:
        return SimpleNamespace(
            name=name, named=SimpleNamespace(seen=SimpleNamespace(dictionary=SimpleNamespace(entries=range(9))), lost=("x",)),
            best=None if support is None else SimpleNamespace(log_evidence=support), fitted=f"fit of {name}", scatter=scatter,
            adequacy=SimpleNamespace(p_value=left), enough=enough)

    def step(name: str, answer: Any) -> Any:
        return lambda *of: taken.append(name) or answer

    search = SimpleNamespace(searched=step("searched", found("first")), likeliest=step("likeliest", found("likeliest")),
                             held_against_noise=step("held", found("held")))
    for name, answer in (("mistakes_in", Mistakes(None, (), sure)), ("without_slight", ("without slight", frozenset("s")))):
        monkeypatch.setattr(procedure, name, step(name, answer))
    for name, answer in (("beyond_the_fit", beyond), ("nearly_all", nearly), ("strained", strain), ("physics_of", 7.0)):
        monkeypatch.setattr(procedure, name, lambda *of, answer=answer: answer)
    monkeypatch.setattr(procedure, "beside", lambda judgement, mistakes, physics: replace(judgement, of=f"beside {physics}"))
    monkeypatch.setattr(Procedure, "search", search)
    monkeypatch.setattr(Procedure, "unknown", lambda self, judgement, seen, left: replace(
        judgement, verdict="unknown", patterns=(left.p_value,)))
    monkeypatch.setattr(Procedure, "with_names", lambda self, judgement, seen, best, slight: replace(
        judgement, verdict="named", patterns=tuple(slight)))
    plain = SimpleNamespace(with_usual_noise="usual")
    judgement: Any = Said("adequate", plain=plain, detection=SimpleNamespace(p_value=chance))
    return steps(sound=sound).named(judgement), taken


@pytest.mark.parametrize(("left", "chance", "scatter", "nearly", "verdict", "differs"), [
    (0.011, 0.01, (), False, "named", False), (0.009, 0.01, (), False, "unknown", False),
    (0.006, 0.2, (), False, "named", False), (0.004, 0.2, (), False, "unknown", False),
    (0.006, 0.001, (), False, "named", False), (0.004, 0.001, (), False, "unknown", False),
    (0.5, 0.01, ("sensor",), False, "unknown", False), (0.5, 0.01, ("sensor",), True, "named", True),
    (0.004, 0.001, (), True, "named", True), (0.5, 0.001, (), True, "named", False)])
def test_causes_are_named_that_leave_noise_or_next_to_nothing(
        monkeypatch: pytest.MonkeyPatch, left: float, chance: float, scatter: tuple[str, ...], nearly: bool, verdict: str,
        differs: bool) -> None:
    """Noise is what one in two hundred shows, and more than the misfit was where that alarmed. What explains nearly all, and
    leaves more, has another law. Terms that are none are taken out first."""
    found, taken = misfit(monkeypatch, left=left, chance=chance, scatter=scatter, nearly=nearly)
    assert (found.verdict, found.law_differs) == (verdict, differs)
    assert found.of == "beside 7.0"
    assert found.lost == ("x",)
    assert taken == ["mistakes_in", "searched", "likeliest"] + ["without_slight"] * (verdict == "named")
    assert found.extended == ("without slight" if verdict == "named" else "fit of likeliest")
    # Of an unknown cause what the causes leave is seen, where they explain anything.
    assert found.patterns == (("s",) if verdict == "named" else (left,))


@pytest.mark.parametrize(("support", "left"), [(0.9, 0.01), (None, 0.01)])
def test_where_no_cause_explains_anything_the_misfit_itself_is_seen(
        monkeypatch: pytest.MonkeyPatch, support: float | None, left: float) -> None:
    found, taken = misfit(monkeypatch, support=support)
    assert (found.verdict, found.patterns) == ("unknown", (left,))
    assert ("without_slight" in taken) is (support is not None)


@pytest.mark.parametrize(("strain", "enough", "held"), [(True, True, True), (True, False, False), (False, True, False)])
def test_causes_beside_a_noise_that_has_grown_are_held_against_it(
        monkeypatch: pytest.MonkeyPatch, strain: bool, enough: bool, held: bool) -> None:
    _, taken = misfit(monkeypatch, strain=strain, enough=enough)
    assert ("held" in taken) is held


@pytest.mark.parametrize(("sure", "beyond", "mistake"), [("sure", None, "sure"), (None, "a unit", "a unit"),
                                                        ("sure", "a unit", "sure")])
def test_a_mistake_that_is_clear_ends_the_search(
        monkeypatch: pytest.MonkeyPatch, sure: Any, beyond: Any, mistake: str) -> None:
    found, taken = misfit(monkeypatch, sure=sure, beyond=beyond)
    assert (found.verdict, found.mistakes) == ("mistake", (mistake,))
    assert taken == ["mistakes_in"]


def test_mistakes_are_not_looked_for_again_where_a_look_at_more_rows_found_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert misfit(monkeypatch, sound=True)[1] == ["searched", "likeliest", "without_slight"]


def test_all_that_is_drawn_begins_at_the_seed() -> None:
    assert [steps().rng.random() for _ in range(2)] == [np.random.default_rng(5).random()] * 2
    one = steps()
    assert one.search.rng is one.rng
    assert (one.search.alarm, one.search.replicates) == (0.05, 10)


@pytest.mark.parametrize(("found", "possible", "slight", "asked"), [
    (None, ("a",), (), False), ("search", (), (), False), ("search", ("a",), (), True), ("search", (), ("a",), True)])
def test_physics_is_weighed_where_there_is_a_mistake_to_hold_it_against(
        monkeypatch: pytest.MonkeyPatch, found: Any, possible: Any, slight: Any, asked: bool) -> None:
    monkeypatch.setattr(procedure, "log_posterior", lambda *of: of)
    seen: Any = SimpleNamespace(dictionary=SimpleNamespace(entries=range(9)))
    fitted: Any = "fit"
    value = procedure.physics_of(Mistakes(found, possible, None, slight), seen, fitted)
    assert value == (("search", "fit", 9) if asked else 0.0)


@pytest.mark.parametrize(("verdict", "mistakes", "sound"), [
    ("named", (), True), ("named", ("a",), False), ("ambiguous", (), False), ("adequate", (), False)])
def test_sound_is_what_names_causes_and_no_mistake(verdict: str, mistakes: tuple[str, ...], sound: bool) -> None:
    judgement: Any = Said(verdict, mistakes=mistakes)
    assert procedure.sound(judgement) is sound


def test_what_is_unknown_leaves_the_plain_model_and_what_was_tried() -> None:
    """With the nearest names and what is seen of it; no law is said to differ."""
    seen: Any = SimpleNamespace(hypotheses=(), dictionary=SimpleNamespace(entries=()))
    left: Any = SimpleNamespace(seen_patterns=("a pattern",))
    judgement: Any = Unknown("named", law_differs=True)
    found: Any = steps().unknown(judgement, seen, left, {"play[1]": "why"})
    assert found == replace(judgement, verdict="unknown", extended="plain", tried="extended", patterns=("a pattern",),
                            withdrawn={"play[1]": "why"}, law_differs=False, alternatives=())
    assert steps().unknown(judgement, seen, left).withdrawn == {}
