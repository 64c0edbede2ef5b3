"""What the procedure says, step by step: which of its answers becomes the judgement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import detect, naming, procedure
from identification.diagnosis.pages import _probabilities
from identification.diagnosis.plan import PlanOutlook
from identification.diagnosis.procedure import Procedure, beside
from identification.fit.mistakes.judge import Mistakes
from identification.fit.noise_parts import VarianceComponents


@dataclass(frozen=True)
class Said:
    """A judgement, as far as these steps ask."""

    verdict: str
    log_odds: float | None = None
    patterns: tuple[str, ...] = ()
    scatter: tuple[str, ...] = ()

    def as_unknown(self, patterns: tuple[str, ...]) -> Said:
        return replace(self, verdict="unknown", patterns=patterns)


@pytest.mark.parametrize(("far", "p_value", "setup", "sensor", "named", "verdict"), [
    (1.0, 0.2, 0.0, 1.0, Said("mistake"), "adequate"), (1.4, 0.6, 0.0, 1.0, Said("mistake"), "mistake"),
    (1.4, 0.6, 0.0, 1.0, Said("named"), "unknown"),
    (1.0, 0.2, 0.0, 1.0, Said("named", 3.0), "adequate"), (1.0, 0.2, 0.0, 1.0, Said("named", 7.0), "named"),
    (1.4, 0.2, 0.0, 1.0, Said("named", 7.0), "named"), (1.0, 0.2, 0.0, 1.0, Said("ambiguous", 7.0), "ambiguous"),
    (1.0, 0.04, 0.0, 1.0, Said("mistake"), "mistake"), (1.0, 0.6, 0.0, 1.0, Said("named", 9.0), "adequate"),
    (1.0, 0.6, 4.0, 1.0, Said("named", 5.0), "named"), (1.0, 0.6, 4.0, 1.0, Said("named", 4.0), "adequate"),
    (1.0, 0.6, 4.0, 1.0, Said("mistake"), "mistake"), (1.0, 0.6, 2.0, 1.0, Said("mistake"), "adequate"),
    (1.0, 0.6, 0.0, 1.8, Said("mistake"), "mistake"), (1.0, 0.6, 0.0, 1.7, Said("mistake"), "adequate"),
    (1.0, 0.6, 0.0, 1.8, Said("named", 7.0), "named"), (1.0, 0.6, 0.0, 1.8, Said("named", 5.0), "adequate")])
def test_what_is_looked_for_without_an_alarm_is_said_where_it_is_likely_or_needed(
    monkeypatch: pytest.MonkeyPatch, far: float, p_value: float, setup: float, sensor: float, named: Said, verdict: str,
) -> None:
    """An alarm at 0.05; without one a name must be a thousand times likelier than nothing, and a mistake is one where the
    readings are farther off than their noise allows, which is else unknown; where nothing is odd nothing is looked for. Forces
    that would have to differ by 0.4 % from set-up to set-up are odd: a mistake is one, and a name a hundred times likelier. So
    are sensors that scatter by half as much again as stated, 1.78 times where that is known to a tenth."""
    rows = SimpleNamespace(validate=np.zeros(3, dtype=bool), select=lambda kept: None)
    data: Any = SimpleNamespace(rows=rows, with_rows=lambda kept: None)
    stated = SimpleNamespace(noise=SimpleNamespace(stated=[True] * 6))
    plain = SimpleNamespace(load_state=None, components=VarianceComponents(sensor=sensor, setup=setup),
                            components_log_std=np.full(6, 0.104), at_map=stated)
    monkeypatch.setattr(procedure, "fitted_or_mistaken", lambda data: plain)
    monkeypatch.setattr(procedure, "goodness_of_fit", lambda *of: SimpleNamespace(p_value=p_value))
    monkeypatch.setattr(procedure, "beyond_stated", lambda *of: {})
    monkeypatch.setattr(procedure, "far_off", lambda plain: far)
    monkeypatch.setattr(procedure, "beyond_the_fit", lambda plain: None)
    monkeypatch.setattr(procedure, "Judgement", lambda verdict, *of, **more: Said(verdict))
    monkeypatch.setattr(Procedure, "named", lambda self, judgement: named)
    assert Procedure(data, {}, 0.05, 10, 0).judged().verdict == verdict


ALL, OTHERS = "all poses", "the other poses"


@pytest.mark.parametrize(("first", "again", "angle", "of", "verdict"), [
    ("named", "unknown", None, ALL, "named"), ("ambiguous", "unknown", None, ALL, "ambiguous"),
    ("unknown", "unknown", None, ALL, "unknown"), ("unknown", "unknown", 1.0, OTHERS, "unknown"),
    ("named", "adequate", None, OTHERS, "named"), ("named", "named", None, OTHERS, "named"),
    ("named", "ambiguous", None, OTHERS, "ambiguous"), ("ambiguous", "named", None, OTHERS, "named"),
    ("ambiguous", "adequate", None, OTHERS, "named"), ("unknown", "ambiguous", None, OTHERS, "ambiguous"),
    ("ambiguous", "mistake", None, OTHERS, "mistake")])
def test_an_answer_of_all_poses_stands_where_the_others_alone_have_none(
        monkeypatch: pytest.MonkeyPatch, first: str, again: str, angle: float | None, of: str, verdict: str) -> None:
    """A pose is left out where the others are explained then. Where they have no name but all of them do, or a few names to
    choose from, that is the better answer; where neither has, the pose is told for what is seen, unless its angle is wrong."""
    bad = (SimpleNamespace(score=SimpleNamespace(name="P7", wrong_angle=angle), mends=()),)
    monkeypatch.setattr(procedure, "with_mends", lambda *of: bad)
    monkeypatch.setattr(procedure, "replace", lambda thing, **changed: SimpleNamespace(**{**vars(thing), **changed}))
    rows = SimpleNamespace(row=np.arange(1, 10), select=lambda kept: kept)
    itself: Any = SimpleNamespace(data=SimpleNamespace(rows=rows, with_rows=lambda kept: kept.tolist()), sound=False)
    itself.judged = lambda: SimpleNamespace(verdict=again, of=OTHERS, patterns=())
    itself.without_bad_rows = lambda judgement: judgement
    judgement: Any = SimpleNamespace(verdict=first, of=ALL, patterns=("seen",), rows=None, mistakes=(), bad_visits=())
    test: Any = SimpleNamespace(rest=0, bad=[SimpleNamespace(rows=np.array([2, 5]))])
    found: Any = Procedure.without_bad_visits(itself, judgement, test)
    assert (found.of, found.verdict) == (of, verdict)
    assert found.bad_visits == (bad if of == OTHERS else ())
    least = "P7 fit least of all poses the springs of the others, which are not explained either"
    assert found.patterns == (() if of == OTHERS else (least, "seen") if first == "unknown" else ("seen",))


@pytest.mark.parametrize(("first", "answers", "seen", "verdict", "allowed"), [
    ("unknown", {"swing": "adequate"}, "swing", "named", "swing"), ("unknown", {"swing": "named"}, "swing", "named", "swing"),
    ("named", {"swing": "ambiguous"}, "swing", "ambiguous", "swing"), ("unknown", {"swing": "unknown"}, "swing", "unknown", ""),
    ("unknown", {"swing": "mistake"}, "swing", "unknown", ""), ("mistake", {}, "swing zero", "mistake", ""),
    ("adequate", {"swing": "adequate"}, "swing zero", "named", "swing zero"), ("adequate", {}, "zero", "adequate", ""),
    ("ambiguous", {"zero": "named"}, "zero", "named", "zero"), ("unknown", {"swing": "unknown"}, "swing zero", "named", "zero"),
    ("unknown", {"swing": "ambiguous", "zero": "unknown"}, "swing zero", "ambiguous", "swing")])
def test_scatter_is_in_the_noise_where_the_rows_are_explained_with_it(
        monkeypatch: pytest.MonkeyPatch, first: str, answers: dict[str, str], seen: str, verdict: str, allowed: str) -> None:
    """Of weights that swing, then of zeros that lie aside, each beside what was taken for one before, and looked for in what
    the fit that was tried leaves; springs that are enough beside it are a name. Beside a mistake nothing is looked for, and
    zeros lie aside where springs do not explain the rows alone."""
    def of(name: str) -> Any:
        def found(left: str) -> Any:
            looked.append((name, left))
            return SimpleNamespace(name=name, allowed_for=lambda data, plain: (*data, name)) if name in seen.split() else None
        return found

    looked: list[tuple[str, str]] = []
    monkeypatch.setattr(procedure, "swing_of", of("swing"))
    monkeypatch.setattr(procedure, "unsettled_zero_of", of("zero"))

    def replaced(thing: Any, **changed: Any) -> Any:
        changed = SimpleNamespace(**{**vars(thing), **changed})
        last = answers.get(changed.data[-1], "adequate") if getattr(changed, "data", ()) else ""
        changed.of_good_rows = lambda: SimpleNamespace(
            verdict=last, tried=None, extended=f"after {changed.data[-1]}", plain="plain", scatters=())
        return changed

    monkeypatch.setattr(procedure, "replace", replaced)
    itself: Any = SimpleNamespace(data=())
    judgement: Any = SimpleNamespace(verdict=first, tried="tried", extended="extended", plain="plain", scatters=())
    judged: Any = Procedure.allowing_for_scatter(itself, judgement)
    assert judged.verdict == verdict
    assert " ".join(scatter.name for scatter in judged.scatters) == allowed
    assert looked == [(name, "after swing" if name == "zero" and "swing" in allowed else "tried") for name in ("swing", "zero")
                      if first != "mistake" and not (name == "zero" and first == "adequate" and "swing" not in allowed)]


@pytest.mark.parametrize(("drawn", "rank"), [([0.0, 1.0, 2.0, 4.0], 2), ([5.0, 3.0, 9.0, 4.0], 5), ([0.0] * 4, 1)])
def test_rare_is_what_few_replicates_reach(monkeypatch: pytest.MonkeyPatch, drawn: list[float], rank: int) -> None:
    """The data, a surprise of 3, stand among five alike; rarer than the first of five nothing can be told to be."""
    noise: Any = SimpleNamespace(readings=12, draw=lambda rng, count: np.zeros((4, 3, count)))
    monkeypatch.setattr(detect, "OPEN", (2.0, 2.0))
    monkeypatch.setattr(detect, "surprise", lambda *of: (np.array([3.0, *drawn]), np.zeros((0, 5))))
    nothing: Any = None
    found = detect.detect(nothing, nothing, (), [noise], np.random.default_rng(0), 4)
    assert (found.p_value, found.resolution) == (rank / 5, 1 / 5)


def test_the_variance_is_what_the_fit_leaves_of_the_readings(monkeypatch: pytest.MonkeyPatch) -> None:
    """By least squares of numpy, a degree of freedom for each coefficient taken off, with weights of 4 for readings of 0.5."""
    rng, seen = np.random.default_rng(3), []
    design, drawn = rng.standard_normal((8, 3, 4)), rng.standard_normal((8, 3, 5))
    residual = rng.standard_normal((8, 3))
    weights: Any = SimpleNamespace(apply=lambda columns: 4.0 * columns)
    base = detect.Base(design, residual, weights, 1e-12 * np.eye(4), np.zeros(4))
    pattern: Any = SimpleNamespace(surprise=lambda base, left, variance: seen.append(variance) or np.zeros(6))
    monkeypatch.setattr(detect, "entry_surprise", lambda *of: np.zeros((1, 6)))
    nothing: Any = None
    detect.surprise(base, nothing, (pattern,), 24, [drawn])
    each = np.concatenate([residual[:, :, None], drawn], axis=2).reshape(24, 6)
    left = np.linalg.lstsq(2.0 * design.reshape(24, 4), 2.0 * each, rcond=None)[1]
    np.testing.assert_allclose(seen[0], left / 20, rtol=1e-9)


@dataclass(frozen=True)
class Named:
    """A judgement that names a cause, as far as mistakes beside it ask."""

    verdict: str = "named"
    causes: tuple[str, ...] = ("a cause",)
    alternatives: tuple[str, ...] = ()
    mistakes: tuple[Any, ...] = ()
    companions: tuple[str, ...] = ("a companion",)
    gain: float | None = 0.3
    carried: float | None = 1.0
    rivals: tuple[Any, ...] = ()
    withdrawn: dict[str, str] | None = None
    robot_difference: float | None = 2e-6
    next_loads: tuple[str, ...] = ("a load",)


@pytest.mark.parametrize(("first", "kept"), [(-4.0, None), (-2.0, True), (2.0, True), (4.0, False)])
def test_causes_stand_beside_mistakes_that_are_about_as_likely(first: float, kept: bool | None) -> None:
    """Within e^3 of each other both stay open; mistakes that are likelier by more take the causes' place, and no loads separate
    these any more. What the choice makes of a correction is not known: the rows may be others."""
    mistakes = tuple(SimpleNamespace(candidate=SimpleNamespace(log_posterior=50.0 + by)) for by in (first, first - 1.0))
    judgement: Any = Named()
    found = beside(judgement, Mistakes((), mistakes, None), 50.0)
    if kept is None:
        assert found is judgement
    else:
        assert (found.verdict, found.causes, found.mistakes) == ("ambiguous", (), mistakes)
        assert (found.alternatives, found.next_loads) == ((("a cause",), ("a load",)) if kept else ((), ()))
        assert (found.robot_difference, found.carried, found.gain) == (None, None, None)


@pytest.mark.parametrize(("verdict", "beside_it"), [("named", True), ("unknown", False)])
def test_mistakes_that_are_not_likely_enough_to_be_named_stand_beside_a_name_alone(verdict: str, beside_it: bool) -> None:
    slight = (SimpleNamespace(candidate=SimpleNamespace(log_posterior=49.0)),)
    judgement: Any = Named(verdict, alternatives=("the nearest",))
    found = beside(judgement, Mistakes((), (), None, slight), 50.0)
    assert (found.verdict, found.mistakes) == (("ambiguous", slight) if beside_it else (verdict, ()))


@pytest.mark.parametrize(("causes", "open_"), [(("a cause",), True), ((), False)])
def test_one_mistake_and_nothing_else_are_no_choice(causes: tuple[str, ...], open_: bool) -> None:
    mistake = (SimpleNamespace(candidate=SimpleNamespace(log_posterior=60.0)),)
    judgement: Any = Named("unknown", causes=(), alternatives=causes)
    found = beside(judgement, Mistakes((), mistake, None), 50.0)
    assert (found.verdict, found.alternatives) == (("ambiguous", causes) if open_ else ("unknown", causes))


@dataclass(frozen=True)
class Open:
    """A judgement with a misfit, as far as a set of names asks."""

    detection: Any
    extended: Any = None
    plain: Any = None
    verdict: str = ""
    alternatives: tuple[Any, ...] = ()
    withdrawn: dict[str, str] | None = None
    next_loads: tuple[Any, ...] = ()
    robot_difference: float | None = None
    patterns: tuple[str, ...] = ()
    law_differs: bool = False
    log_odds: float | None = None
    rivals: tuple[Any, ...] = ()
    carried: Any = None
    tried: Any = None


@pytest.mark.parametrize(("p_value", "odds", "support", "local", "one_visit", "verdict"), [
    (0.02, -0.6, -9.0, False, False, "ambiguous"), (0.02, -0.8, 9.0, False, False, "unknown"),
    (0.2, 7.0, 4.0, False, False, "ambiguous"), (0.2, 6.8, 4.0, False, False, "unknown"),
    (0.2, 7.0, 2.0, False, False, "unknown"), (0.2, 50.0, 50.0, True, False, "unknown"),
    (0.2, 7.0, 0.0, False, True, "ambiguous"), (0.2, 6.8, 0.0, False, True, "unknown")])
def test_several_names_need_what_one_needs(
    monkeypatch: pytest.MonkeyPatch, p_value: float, odds: float, support: float, local: bool, one_visit: bool, verdict: str,
) -> None:
    """A thousand to one against nothing (ln 6.9), and readings that were not fitted twenty times likelier (ln 3); what touches
    one pose alone an alarm, and with an alarm all together (the best has half of it: ln 2) are to be likelier than nothing. Of
    several readings of one visit the readings at other poses tell nothing. The likeliest goes on, with the others beside that
    have 95 % together with it."""
    names = tuple(SimpleNamespace(label=label) for label in "abcd")
    fits = {label: (label, share) for label, share in zip("abcd", (0.5, 0.3, 0.16, 0.04), strict=True)}
    for name, answer in (("credible", names), ("inclusion", names), ("only_local", local), ("log_odds", odds),
                         ("told_by_one_visit", one_visit), ("gain", SimpleNamespace(support=support, held_out="poses")),
                         ("rivals_of", fits),
                         ("next_loads", ()), ("robot_difference", 1e-6)):
        monkeypatch.setattr(procedure, name, lambda *of, answer=answer: answer)
    monkeypatch.setattr(procedure, "with_free_laws", lambda model: f"{model} with its laws")
    seen: Any = SimpleNamespace(dictionary=SimpleNamespace(entries=range(90)))
    judgement: Any = Open(SimpleNamespace(p_value=p_value, resolution=0.005, seen_patterns=()),
                          SimpleNamespace(terms=("a",)), SimpleNamespace(components=VarianceComponents(), data=None))
    nothing: Any = None
    best: Any = SimpleNamespace(probability=0.5)
    found: Any = Procedure(nothing, {}, 0.05, 10, 0).ambiguous(judgement, seen, best)
    assert found.verdict == verdict
    if verdict == "ambiguous":
        assert found.log_odds == odds
        assert found.carried == "a with its laws"
        assert [rival.fitted for rival in found.rivals] == ["b with its laws", "c with its laws"]
        assert [rival.probability for rival in found.rivals] == pytest.approx([0.3 / 0.96, 0.16 / 0.96])
    else:
        assert found.carried is None


@pytest.mark.parametrize(("moved", "told"), [
    ([0, 0, 0, 1, 1, 1, 0, 0, 0], True), ([0, 0, 0, 0, 1, 1, 0, 0, 0], False), ([0, 0, 1, 1, 1, 1, 0, 0, 0], False),
    ([1e-5, 0, 0, 1, 1, 1, 0, 0, 0], True), ([0] * 9, False)])
def test_several_readings_of_one_visit_are_told_by_no_other(
    monkeypatch: pytest.MonkeyPatch, moved: list[float], told: bool,
) -> None:
    """Three at least, each moved by more than a nanometre [um]; springs move all of them."""
    springs = 1e-6 * np.random.default_rng(0).normal(0, 50, (9, 3))
    monkeypatch.setattr(naming, "predicted_deflection", lambda data, x: springs)
    data = SimpleNamespace(rows=SimpleNamespace(visit=np.repeat(np.arange(3), 3)))
    fitted: Any = SimpleNamespace(data=data, log_compliance=np.zeros(6),
                                  predicted=lambda data: springs + 1e-6 * np.outer(moved, [0, 0, 9.0]))
    assert naming.told_by_one_visit(fitted) is told


def test_each_cause_that_is_drawn_has_room_for_its_words() -> None:
    def height(count: int) -> float:
        causes = tuple(SimpleNamespace(probability=0.1, sentence=f"cause {k}") for k in range(count))
        judgement: Any = SimpleNamespace(causes=(), alternatives=causes, verdict="ambiguous", robot_difference=None)
        [figure] = _probabilities(judgement)
        return float(figure.panels[0].height)

    assert height(3) - height(2) == height(8) - height(7) >= 20


def test_the_file_of_a_plan_says_what_it_is() -> None:
    found = PlanOutlook((), {"creep": "no times"}, ()).as_dict()
    assert found == {"format": "compstiff-diagnosis-plan", "version": 1, "effects": [], "not_offered": {"creep": "no times"}}
