"""Sets of causes that are as likely as they are told to be, without any fit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any


def survey(*sets: tuple[tuple[int, ...], float]) -> Any:
    """Sets of causes with their probabilities. Of the causes 0 and 1 are laws of gear 1, 2 one of gear 2; 3 and 4 others."""
    def cause(name: str, joint: int | None, family: str) -> Any:
        label = name if joint is None else f"{name}[{joint}]"
        return SimpleNamespace(label=label, joint=joint, effect=SimpleNamespace(name=name, law_family=family))

    entries = [cause("play", 1, "gear"), cause("soft", 1, "gear"), cause("play", 2, "gear"), cause("rocking", None, ""),
               cause("drift", None, "")]
    hypotheses = [SimpleNamespace(entries=entries_of, key=frozenset(entries_of), probability=probability, signatures=entries_of)
                  for entries_of, probability in sets]
    signatures = [SimpleNamespace(local=local) for local in (True, True, False, True, False)]
    return SimpleNamespace(hypotheses=tuple(hypotheses), dictionary=SimpleNamespace(entries=entries, signatures=signatures))
