"""Do three further visits settle what the fifth judge's load tests leave open: `python benchmarks/settled.py FOLDER`, after
fifth_judge.py.

Of each load test whose answer was a set with the truth in it, `design --add 3` plans three load cycles with the largest force
of the test, one time with `--diagnosis`, one time without; they are measured on the same arm with the same cause by the same
instrument, and all is diagnosed again.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
import yaml

from benchmarks.fifth_judge import asked, judged
from benchmarks.fifth_trial import Trial, table_of
from benchmarks.fifth_world import case, deck, written

RUNS = 3
PLANS = {"told apart": ["--diagnosis", "diagnosis.json"], "by D": ["--criterion", "D"]}


def planned(at: Path, name: str, force: float) -> list[dict[str, str]]:
    """The rows of the further visits."""
    call = [sys.executable, "-m", "compstiff", "design", "cell.yaml", "--add", str(RUNS), "measurements.csv", *PLANS[name],
            "--max-force", f"{force:.0f}", "--quick", "-o", "more.csv", "--force", "--json", "-q"]
    done = subprocess.run(call, cwd=at, capture_output=True, text=True, check=False)
    (at / f"plan {name}.json").write_text(done.stdout, encoding="utf-8")
    lines = (at / "more.csv").read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def as_trial(one: Trial, rows: list[dict[str, str]], began: float) -> Trial:
    """The planned rows as a test of the same arm, which begins after the other has ended."""
    visit = np.unique([row["reference"] for row in rows], return_inverse=True)[1]
    time = began + np.cumsum(np.where(np.append(True, np.diff(visit) != 0), 120.0, 30.0))
    return replace(one, shown=np.radians([[float(row[f"q{j}_deg"]) for j in range(1, 7)] for row in rows]), visit=visit,
                   force=np.array([[float(row[f"f{axis}_n"]) for axis in "xyz"] for row in rows]), time=time)


def main(folder: Path) -> None:
    grades: dict[str, Counter[str]] = {name: Counter() for name in PLANS}
    for at in sorted(one for one in folder.iterdir() if (one / "answer.json").exists()):
        truth = json.loads((at / "truth.json").read_text(encoding="utf-8"))
        result = json.loads((at / "answer.json").read_text(encoding="utf-8")).get("result") or {}
        if truth["cause"] == "nothing" or "verdict" not in result or judged(truth, result)[0] != "set with the truth":
            continue
        seed, number = truth["seed"]
        cause = list(deck(number + 1, np.random.default_rng(seed)))[number]
        one, _, size, _, made_with = case(cause, np.random.default_rng([seed, number]))
        if one.design == "dead weights":
            continue
        said = f"{at.name} {cause.name:17} {len(result['alternatives']):2} names"
        for place, name in enumerate(PLANS):
            rows = planned(at, name, float(one.amount.max()))
            fresh = as_trial(one, rows, float(one.time[-1]) + 600.0)
            rng = np.random.default_rng([seed, number, place])
            hidden = cause.make(np.random.default_rng(made_with), fresh, size)
            if any(truth[key] != value for key, value in hidden.told.items()):
                said += f"; {name}: not the same cause"
                continue
            again = at / f"again {name}"
            if not again.exists():
                sheet = yaml.safe_load((at / "cell.yaml").read_text(encoding="utf-8"))
                written(fresh, table_of(fresh, hidden, rng), sheet, truth, again)
            more = (again / "measurements.csv").read_text(encoding="utf-8").replace(",R", ",S").replace(",P", ",Q")
            head, *lines = more.splitlines(keepends=True)
            before = (at / "measurements.csv").read_text(encoding="utf-8")
            assert before.startswith(head)
            (again / "measurements.csv").write_text(before + "".join(lines), encoding="utf-8")
            grade, names = judged(truth, asked(again)["result"])
            grades[name][grade] += 1
            said += f"; {name}: {grade}, {len(names)} names"
        print(said, flush=True)
    for name, count in grades.items():
        print(f"{name}: " + ", ".join(f"{grade} {number}" for grade, number in count.most_common()))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
