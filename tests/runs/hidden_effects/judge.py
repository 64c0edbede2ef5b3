"""Judges a diagnosis against what was hidden. Knows nothing of how the diagnosis came about.

What it reads of a diagnosis is what diagnosis.json says (docs/formats.md#diagnose): verdict, causes, alternatives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from tests.virtual_cell.hidden import EFFECTS

# part: a name that is true, but not all of them. ambiguous in: the whole truth is in the set, part: some of it.
Outcome = Literal["right", "part", "ambiguous in", "ambiguous part", "ambiguous out", "wrong", "missed", "unknown", "quiet"]
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)
Names = frozenset[str]


@dataclass(frozen=True)
class Answer:
    """A diagnosis: names given, and the names it cannot tell apart, the likeliest first; all as in `label`. families: of a name
    that stands for its family (free play or a soft zone of one gear), all that are in it."""

    verdict: str
    names: Names = frozenset()
    alternatives: tuple[str, ...] = ()
    families: tuple[Names, ...] = ()

    def may_mean(self, truth: Names) -> bool:
        """Whether the truth is what is named, a name that stands for its family taken for another one of it."""
        free = [family for family in self.families if family & self.names]
        fixed = self.names - frozenset().union(*free)
        return fixed <= truth and len(self.names) == len(truth) and all(len(family & truth) == 1 for family in free)

    @property
    def likeliest(self) -> str | None:
        """The name it comes down to, if any."""
        given = sorted(self.names) or (list(self.alternatives) if self.verdict == "ambiguous" else [])
        return given[0] if given else None


def label(effect: str, joint: int | None) -> str:
    """backlash[1], drift. An effect that can sit at one joint only is known by its name alone."""
    entry = EFFECTS.get(effect)
    alone = joint is None or (entry is not None and len(entry.joints) == 1)
    return effect if alone else f"{effect}[{joint}]"


def answer(content: Mapping[str, Any]) -> Answer:
    """The answer of a diagnosis.json."""
    causes, alternatives = ([label(one["effect"], one["joint"]) for one in content[key]] for key in ("causes", "alternatives"))
    names = frozenset(causes) - {"bad_visit"}
    # That something is wrong at a pose is no name of an effect.
    unknown = content["verdict"] == "named" and not names
    families = tuple(frozenset(label(name, one["joint"]) for name in (one["effect"], *one.get("open_laws", {})))
                     for one in content["causes"] if one.get("open_laws"))
    return Answer("unknown" if unknown else content["verdict"], names, tuple(alternatives), families)


def truth_names(truth: Sequence[Mapping[str, Any]]) -> Names:
    """Labels of `Case.truth`."""
    return frozenset(label(one["effect"], one["joint"]) for one in truth)


def judge(truth: Names, given: Answer) -> Outcome:
    """What the answer is worth. `quiet`: nothing hidden and nothing said; `missed`: something hidden and nothing said."""
    if given.verdict == "adequate":
        return "missed" if truth else "quiet"
    if given.verdict == "unknown":
        return "unknown"
    if given.verdict == "named":
        if given.names == truth != frozenset():
            return "right"
        # The family is named and the truth is in it: as good as a set with the truth in it.
        return "ambiguous in" if given.may_mean(truth) else "part" if frozenset() < given.names < truth else "wrong"
    found = truth & set(given.alternatives)
    return "ambiguous out" if not found else "ambiguous in" if found == truth else "ambiguous part"


def permuted(given: Answer, rename: Callable[[str], str]) -> Answer:
    """The same answer with a shuffled dictionary."""
    return Answer(given.verdict, frozenset(map(rename, given.names)), tuple(map(rename, given.alternatives)))


@dataclass(frozen=True)
class Targets:
    """What a set of judged cases must reach, as shares: least right, most wrong, most false alarms."""

    right: float
    wrong: float
    alarms: float

    def broken(self, identifiable: Sequence[Outcome], hidden: Sequence[Outcome], null: Sequence[Outcome]) -> list[str]:
        """What is not reached, in words; empty where all is well. identifiable: among `hidden`, those that can be named."""
        def share(outcomes: Sequence[Outcome], *kinds: Outcome) -> float:
            return sum(outcome in kinds for outcome in outcomes) / max(len(outcomes), 1)

        right, wrong, alarms = share(identifiable, "right"), share([*hidden, *null], "wrong"), 1 - share(null, "quiet")
        found = [f"named right {right:.0%} of what can be named, at least {self.right:.0%} expected"] * (right < self.right)
        found += [f"wrong names in {wrong:.0%}, at most {self.wrong:.0%} allowed"] * (wrong > self.wrong)
        return found + [f"false alarms in {alarms:.0%}, at most {self.alarms:.0%} allowed"] * (alarms > self.alarms)
