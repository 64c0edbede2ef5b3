"""What `diagnose` says of load tests as one writes them at a desk (tests/desk_world.py):

    python benchmarks/desk_world.py 6 900000 [--shares 0.3 0.7]

Six load tests of each term and of none, from seed 900000 on; the share of the deflection that a term makes is drawn between
those two (8 and 25 %). A set that holds the truth counts as "in the set": a base and a
stand that give way along the load are one to any load test, a gear's free play and softness may be left open under one name.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import compstiff
from tests.desk_world import TERMS, desk


def answered(seed: int, term: str | None, shares: tuple[float, float]) -> tuple[str, str]:
    """The outcome, and what was said."""
    case = desk(seed, term, shares)
    with TemporaryDirectory() as folder:
        cell_file, table = case.write(Path(folder))
        cell = compstiff.read_cell(cell_file)
        judgement = compstiff.diagnose(cell, compstiff.read_measurements(table, cell.robot)).judgement
    names, others = ([cause.label.replace("gravity_compensator[2]", "gravity_compensator") for cause in causes]
                     for causes in (judgement.causes, judgement.alternatives))
    said = f"{judgement.verdict} {', '.join(names)}" + (f" | {', '.join(others)}" if judgement.verdict == "ambiguous" else "")
    if judgement.verdict == "named":
        open_laws = [f"{law}[{cause.joint}]" for cause in judgement.causes for law in cause.open_laws]
        return "right" if names == [case.hidden] else "in the set" if case.hidden in open_laws else "wrong", said
    if judgement.verdict == "ambiguous":
        return "in the set" if case.hidden in others else "set without it", said
    return judgement.verdict, said


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--shares", type=float, nargs=2, default=(0.08, 0.25))
    options = parser.parse_args()
    count, first = options.count, options.seed
    for k, term in enumerate((*TERMS, None)):
        seeds = range(first + 1000 * k, first + 1000 * k + count)
        results = [(seed, *answered(seed, term, tuple(options.shares))) for seed in seeds]
        print(f"{term or 'nothing'} ({seeds[0]} on): {dict(Counter(outcome for _, outcome, _ in results))}", flush=True)
        for seed, outcome, said in results:
            if outcome not in ("right", "in the set") and (term or outcome != "adequate"):
                print(f"    {seed}: {said}", flush=True)


if __name__ == "__main__":
    main()
