"""What looks most like each effect hidden in its place, and what the dictionary does not know: no wrong name, all places.

    OMP_NUM_THREADS=1 python benchmarks/confounders.py

tests/runs/hidden_effects tries one place of each confounder (most with --long alone), and of what is outside the dictionary
what takes least; this all.
Printed: a line a case. Exit 1 where an answer is wrong.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.runs.hidden_effects.judge import label
from tests.runs.hidden_effects.places import ALL, OUTSIDE, OUTSIDE_LONG, check_confounder, check_unknown


def main() -> int:
    """Diagnoses each, and says what is wrong."""
    cases: list[tuple[str, Callable[[], None]]] = []
    for where in ALL:
        other = label(where.confounder.effect, where.confounder.joint)
        cases.append((f"{other}, seed {where.seed}, is not {where.label}",
                      lambda where=where: check_confounder(where, few=False)))
    for hidden, seed in (*OUTSIDE, *OUTSIDE_LONG):
        cases.append((f"{hidden.effect}, seed {seed}, is unknown",
                      lambda it=hidden, seed=seed: check_unknown(it, seed, few=False)))
    wrong = 0
    for said, check in cases:
        try:
            check()
            print(f"holds  {said}", flush=True)
        except AssertionError as reason:
            wrong += 1
            print(f"WRONG  {said}: {reason}", flush=True)
    print(f"{len(cases)} cases, {wrong} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
