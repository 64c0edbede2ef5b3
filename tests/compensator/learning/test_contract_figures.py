"""What `learn` writes of a part, number by number with its unit, and what it says of it on the terminal."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.settings import Estimate
from compensator.learned.learned import DRIFT, SETUP, JobFrame, Learned
from compensator.learned.remainder import Remainder
from compensator.learning.causes import Asked
from compensator.learning.held_out import HeldOut
from compensator.learning.learning import PARTS, Learning
from compensator.learning.pages import learn_report
from compensator.learning.sizes import Sizes
from identification.model.rotations import Frame

SPRINGS, PLACES = 6, 2
STIFF = np.array([4e6, 3.8e6, 2.5e6, 6e5, 5e5, 3e5])
SIGN = np.array([1.0, 1, -1, -1])           # the RMS of c times it is c


def learning() -> Learning:
    """Numbers by hand, of a part of which everything was seen: RMS 60 um measured, all parts along one pattern."""
    count = SPRINGS + SETUP + DRIFT + 3 * PLACES
    mean = np.zeros(count)
    mean[:SPRINGS] = -np.log(0.9 * STIFF)
    mean[SPRINGS:SPRINGS + SETUP] = 1e-6 * np.array([120, -40, 5, 8, 0, -2])
    mean[SPRINGS + SETUP:SPRINGS + SETUP + DRIFT] = 1e-6 * np.array([3, -30, 7])
    covariance = np.diag(np.concatenate([0.01 * np.arange(1, 7), 1e-6 * np.arange(11, 11 + count - SPRINGS)]) ** 2)
    frame = JobFrame(Frame.identity(), np.array([1.2, 0.1, 0.7]), 0.05, 412.0)
    remainder = Remainder(np.zeros((PLACES, 3)), np.zeros((PLACES, 6)), 0.1, 23e-6)
    learned = Learned(-np.log(STIFF), mean, covariance, frame, remainder)
    parts = {name: 1e-6 * size * SIGN for name, size in zip(
        ("predicted", "springs", "setup", "drift", "remainder", "left"), (30, 9, 6, 3, 7, 5), strict=True)}
    terms: Any = SimpleNamespace(job=np.eye(SETUP + DRIFT), rows=SimpleNamespace(position=np.zeros((17, 3))))
    rows: Any = None
    predicted: Any = None
    return Learning(predicted, terms, Sizes(1.3, 2.5e-6, 0.4e-3), learned, 60e-6 * SIGN, parts, Estimate(1.21, 0.03), 0.001,
                    HeldOut(40e-6, 25e-6, 10e-6, 3.4, 8), Asked(None, rows, "too few", p_value=0.2), (180, 200), "points.csv",
                    None, (), Estimate(-51e-6, 2e-6))


def test_each_figure_is_what_its_name_says() -> None:
    found = learning().as_dict()
    assert (found["points"], found["points_used"], found["places"]) == (200, 180, 17)
    assert found["measured_um"] == pytest.approx(60)
    assert found["along_normals"] == pytest.approx({"all_um": -51, "std_um": 2})
    assert found["parts_um"] == pytest.approx({
        "predicted": 30, "springs": 9, "setup": 6, "drift": 3, "remainder": 7, "left": 5})
    # Of 60 um 30 are left, 21, 15, 12 and 5, one after the other.
    assert found["gone"] == pytest.approx({
        "predicted": 0.5, "springs": 0.65, "setup": 0.75, "drift": 0.8, "remainder": 1 - 5 / 60})
    assert found["motion"] == {"scale": 1.21, "std": 0.03}
    assert found["stiffness"]["before"] == pytest.approx(STIFF.tolist())
    assert found["stiffness"]["in_motion"] == pytest.approx((0.9 * STIFF).tolist())
    assert found["stiffness"]["relative_std"] == pytest.approx([0.01, 0.02, 0.03, 0.04, 0.05, 0.06])
    # A turn of 8 um at a radius of 50 mm is 0.16 mrad.
    assert found["setup"]["shift_um"] == pytest.approx([120, -40, 5])
    assert found["setup"]["shift_std_um"] == pytest.approx([11, 12, 13])
    assert found["setup"]["turn_mrad"] == pytest.approx([0.16, 0, -0.04])
    assert found["setup"]["about_mm"] == pytest.approx([1200, 100, 700])
    assert found["drift"] == {"over_the_job_um": pytest.approx([3, -30, 7]), "std_um": pytest.approx([17, 18, 19]),
                              "duration_s": 412.0}
    assert found["remainder"] == pytest.approx({"amplitude_um": 23, "length_mm": 100})
    assert (found["remainder_by_chance"], found["false_rate"]) == (0.001, 0.01)
    assert found["noise"] == pytest.approx({"factor": 1.3, "shared_um": 2.5, "smear_mm": 0.4})
    assert found["held_out"] == pytest.approx({"stretches": 8, "known_um": 40, "physical_um": 25, "learned_um": 10,
                                               "gain": 0.75, "standard_errors": 3.4})
    assert found["causes"]["verdict"] == "not asked"


def test_what_was_not_seen_is_none() -> None:
    given = learning()
    terms: Any = SimpleNamespace(job=np.zeros((SETUP + DRIFT, SETUP + DRIFT)), rows=given.terms.rows)
    bare = replace(given, terms=terms, held_out=None, beside=None, learned=replace(
        given.learned, remainder=Remainder(np.zeros((0, 3)), np.zeros((0, 6)), 0.1, 23e-6)))
    found = bare.as_dict()
    assert [found[name] for name in ("setup", "drift", "remainder", "held_out", "along_normals")] == [None] * 5
    for part, name in ((slice(0, SETUP), "setup"), (slice(SETUP, None), "drift")):
        job = np.zeros((SETUP + DRIFT, SETUP + DRIFT))
        job[part, part] = np.eye(len(job[part]))
        terms = SimpleNamespace(job=job, rows=given.terms.rows)
        shown = replace(given, terms=terms).as_dict()
        assert [shown[each] is None for each in ("setup", "drift")] == [each != name for each in ("setup", "drift")]
    nothing = replace(given, measured=0 * SIGN, parts=dict.fromkeys(given.parts, 0 * SIGN)).gone()
    assert nothing == dict.fromkeys(("predicted", "springs", "setup", "drift", "remainder"), 1.0)


def test_it_is_said_in_sentences() -> None:
    assert learning().lines() == [
        "taken off all numbers along their normals: -51.0 +- 4.0 um (2 sigma)",
        "180 of 200 points, 17 places: measured 60.0 um RMS; 5.0 um are left with all that was learned",
        "gone of the measured deviation: 50 % as it was predicted, 65 % with the springs learned, 75 % with the set-up, 80 % "
        "with warming, 92 % with the smooth remainder",
        "factor in motion (with the force sensor's gain): 1.210 +- 0.060 (2 sigma)",
        "a smooth remainder of 7.0 um RMS over 100 mm; chance alone shows as much in 0.1 % of parts at most",
        "on stretches that were left out: 40.0 um RMS as known before, 25.0 um with springs, set-up and warming learned, "
        "10.0 um with all (75 % less; 3.4 standard errors)"]


def test_what_was_not_seen_is_said_or_left_out() -> None:
    given, rows = learning(), None
    found: Any = SimpleNamespace(verdict="adequate", causes=())
    bare = replace(given, held_out=None, beside=None, chance=0.34, asked=Asked(found, rows, p_value=0.27), learned=replace(
        given.learned, remainder=Remainder(np.zeros((0, 3)), np.zeros((0, 6)), 0.1, 23e-6)))
    assert bare.lines()[3:] == [
        "no smooth remainder: chance alone shows as much in 34 % of parts, over the limit of 1 %: none is learned",
        "no cause beyond the model is seen (chance shows as much in 27 % of parts)"]


@pytest.mark.parametrize(("known", "learned", "gain"), [(40.0, 10.0, 0.75), (40.0, 50.0, -0.25), (0.0, 0.0, 0.0)])
def test_what_is_gained_is_a_share_of_what_was_left(known: float, learned: float, gain: float) -> None:
    assert HeldOut(1e-6 * known, 0.0, 1e-6 * learned, 1.0, 8).gain == pytest.approx(gain)


@pytest.mark.parametrize("verdict", ["named", "ambiguous"])
def test_causes_are_said_with_their_parameters_where_they_are_carried(verdict: str) -> None:
    effect = SimpleNamespace(name="backlash", of_robot=True)
    cause = SimpleNamespace(label="backlash[2]", effect=effect, joint=2, probability=0.97, sentence="play", open_laws=())
    found: Any = SimpleNamespace(verdict=verdict, causes=(cause,), terms=("a term",))
    rows: Any = None
    gained = (HeldOut(9e-5, 9e-5, 3.1e-5, 3.0, 8), HeldOut(9e-5, 9e-5, 1.2e-5, 3.0, 8))
    asked = Asked(found, rows, p_value=0.003, after=0.4, gained=gained,
                  values=(("backlash[2].gap", "rad", Estimate(8.6e-5, 1.2e-5)),))
    given = asked.as_dict()
    carried = verdict == "named"
    assert given == {
        "verdict": verdict, "why_not": "", "p_value": 0.003, "p_value_after": 0.4, "carried": carried, "withdrawn": "",
        "causes": [{"effect": "backlash", "joint": 2, "probability": 0.97, "sentence": "play", "open_laws": ()}],
        "parameters": [{"name": "backlash[2].gap", "unit": "rad", "estimate": 8.6e-5, "std": 1.2e-5}] * carried,
        "left_out_um": [pytest.approx(31.0), pytest.approx(12.0)]}
    lines = replace(learning(), asked=asked).lines()
    assert ("backlash[2].gap: 8.6e-05 +- 2.4e-05 rad (2 sigma)" in lines) == carried
    assert len(lines) == len(learning().lines()) + carried


def test_the_page_has_the_figures_in_its_tables() -> None:
    """Each with its unit; springs with two sigma in per cent, what is left where it was learned and where it was not."""
    given = learning()
    rows: Any = SimpleNamespace(position=np.zeros((4, 3)), posture=np.zeros((4, 6)), length=np.arange(4) * 1e-3,
                                place=np.arange(4))
    terms: Any = SimpleNamespace(job=np.eye(SETUP + DRIFT), rows=rows)
    planned: Any = SimpleNamespace(program=SimpleNamespace(source=None), cell=SimpleNamespace(source="cell.yaml"),
                                   model=SimpleNamespace(source=None))
    page = learn_report(replace(given, terms=terms, predicted=planned))
    row, cell = (re.compile(rf"<{name}[^>]*>(.*?)</{name}>", re.DOTALL) for name in ("tr", "t[dh]"))
    table = [[" ".join(re.sub(r"<[^>]+>", " ", text).split()) for text in cell.findall(each)] for each in row.findall(page)]
    for words, um, gone in zip(PARTS.values(), ("30.0", "9.0", "6.0", "3.0", "7.0", "5.0"),
                               ("50.0 %", "65.0 %", "75.0 %", "80.0 %", "91.7 %", ""), strict=True):
        assert [words, um, gone] in table
    assert ["measured", "60.0", ""] in table
    assert ["the model as it was", "40.0"] in table
    assert ["springs, set-up and warming learned", "25.0"] in table
    assert ["the smooth remainder too", "10.0"] in table
    assert ["1", "4e+06", "3.6e+06", "2.0 %"] in table
    assert ["6", "3e+05", "2.7e+05", "12.0 %"] in table
    words = " ".join(re.sub(r"<[^>]+>", " ", page).replace("\xa0", " ").split())
    assert "On 8 stretches of the path, each left out once" in words
    for key in ("60 \u00b5m RMS over 4 places", "5 \u00b5m RMS, where it was learned", "RMS, 8 stretches left out",
                "1.21 times as at rest; 2 sigma 0.06"):
        assert key in words, words[:3000]
