"""Lets PyPI's figaroh choose runs from a pool; called by benchmarks/design.py with an interpreter that has figaroh.

    python benchmarks/figaroh_pick.py POOL.npz

POOL.npz: information (n, 6, 6), prior (6, 6), count. Prints a line of JSON for each, as soon as it has it: of the SOCP the
chosen rows, of DetMax the value of the criterion (it keeps its rows to itself, and on some pools never ends), and the seconds.
Its classes take information matrices without a prior, so each run gets its share of it: exact for the SOCP's weights, and for
DetMax while its set has `count` runs.
"""

from __future__ import annotations

import json
import random
import sys
import time

import numpy as np


def main(path: str) -> None:
    import picos
    from figaroh.optimal.base_optimal_calibration import Detmax, SOCPOptimizer

    given = np.load(path)
    count = int(given["count"])
    pieces = count * given["information"] + given["prior"]
    scale = np.median(np.linalg.eigvalsh(pieces)[:, -1])
    pool = {i: picos.Constant(piece / scale) for i, piece in enumerate(pieces)}
    begin = time.perf_counter()
    _, by_weight = SOCPOptimizer(pool, {"NbSample": len(pool)}).solve()
    rows = [int(i) for i in list(by_weight)[:count]]
    print(json.dumps({"SOCP": (rows, time.perf_counter() - begin)}), flush=True)
    random.seed(0)
    begin = time.perf_counter()
    # Its set of runs stays a local variable (`cur_set` of the object is empty after the search): only the value comes out.
    reached = Detmax(pool, count).main_algo()[-1]
    print(json.dumps({"DetMax": (reached * scale / count, time.perf_counter() - begin)}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
