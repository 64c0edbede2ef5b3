"""How long everything takes, with what it is held against measured in the same run: one command for every table of speed.

    OPENBLAS_NUM_THREADS=1 python benchmarks/speed.py [TARGETS ...]

CPU time and peak memory of whole processes: the start, `correct` at each size through the command line with offsets (its
floor: a plain Python loop that does no more than read the same numbers twice and write them once), then the stages
(correct_time.py) and the kernel (kernel.py, against `pin`, where it is installed). CPU time changes with what else the machine
does; ratios less so.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.correct_time import write_job

HERE = Path(__file__).parent
# An installation is compiled: what a first start takes for that is not counted, whatever the environment says of it.
COMPILED = tempfile.TemporaryDirectory()
FLOOR = """
import re, sys
text = open(sys.argv[1], encoding="latin-1").read()
number = re.compile(r"-?\\d+\\.\\d+")
values = list(map(float, number.findall(text)))
again = list(map(float, number.findall(text)))
open(sys.argv[2], "w").write(",".join(["%.8f" % value for value in values]))
"""


def cost(*arguments: str) -> tuple[float, float]:
    """CPU time [s] and peak memory [MB] of a Python process."""
    environ = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environ |= {"PYTHONPATH": str(HERE.parent), "PYTHONPYCACHEPREFIX": COMPILED.name}
    pid = os.posix_spawn(sys.executable, [sys.executable, *arguments], environ,
                         file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0),
                                       (os.POSIX_SPAWN_OPEN, 2, os.devnull, os.O_WRONLY, 0)])
    _, status, used = os.wait4(pid, 0)
    assert status == 0, arguments
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def starts() -> None:
    """What the imports cost; the best of five."""
    print("| start | CPU [s] | times bare Python with NumPy |\n|---|---|---|")
    bare = 0.0
    for name, code in (("Python, `import numpy`", "import numpy"), ("`import pandas`", "import pandas"),
                       ("`compstiff --version`", "from compstiff.cli.main import main"),
                       ("all that `correct` imports", "import compensator.correction.files, pyarrow.csv"),
                       ("all that `identify` imports", "import compstiff.cli.identify, identification.fit.fit")):
        seconds = min(cost("-c", code)[0] for _ in range(5))
        bare = bare or seconds
        print(f"| {name} | {seconds:.2f} | {seconds / bare:.1f} |", flush=True)


def programs(sizes: list[int]) -> None:
    """The whole command."""
    print("\n| targets | CPU [s] | peak [MB] | times the floor |\n|---|---|---|---|")
    for count in sizes:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            # A process of its own: what this one has held would count as the peak of those that it starts.
            maker = multiprocessing.Process(target=write_job, args=(folder, count, "target"))
            maker.start()
            maker.join()
            files = {key: str(folder / file) for key, file in (("cell", "cell.yaml"), ("program", "long.mod"))}
            seconds, peak = min(
                cost("-m", "compstiff", "correct", files["cell"], files["program"], "--stiffness",
                     str(folder / "stiffness.json"), "--forces", str(folder / "long.forces.csv"), "-o",
                     str(folder / f"out{k}.mod"), "--offsets", str(folder / f"offsets{k}.csv"))
                for k in range(2 if count <= 10_000 else 1))
            floor, _ = cost("-c", FLOOR, files["program"], str(folder / "floor.txt"))
            print(f"| {count} | {seconds:.2f} | {peak:.0f} | {seconds / floor:.1f} |", flush=True)


def main() -> None:
    sizes = [int(text) for text in sys.argv[1:]] or [10_000, 100_000]
    starts()
    programs(sizes)
    subprocess.run([sys.executable, str(HERE / "correct_time.py"), *map(str, sizes)], check=True)
    if importlib.util.find_spec("pinocchio"):
        print()
        subprocess.run([sys.executable, str(HERE / "kernel.py")], check=True)


if __name__ == "__main__":
    main()
