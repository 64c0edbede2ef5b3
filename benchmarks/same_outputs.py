"""Do two installations of compstiff say and write the same, byte for byte?

    python benchmarks/same_outputs.py OLD/bin/compstiff NEW/bin/compstiff [--help-texts]

Runs the whole chain on the samples with both (demo, identify, diagnose, design, post, tare, predict, correct, a batch, watch,
verify, push, cells and calls that must fail) in two folders and compares exit codes, stdout, stderr and every file. Only lines
that carry a version, an absolute path of the run or the day are put alike before. Texts that differ in nothing but figures of
seven places and more, by less than a billionth of each, are told apart from others: a sum in another order ends otherwise.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.virtual_cell.arm import IRB6660

SAMPLES = Path(__file__).resolve().parents[1] / "samples"
APT = """\
PARTNO SHELL
UNITS/MM
MULTAX/ON
LOADTL/7
RAPID
GOTO/-60,-20,80,0,0,1
RAPID
GOTO/-60,-20,5,0.0871557427,0,0.9961946981
FEDRAT/1234.5,MMPM
""" + "".join(
    f"GOTO/{x},{-20 + 0.013 * x:.4f},{0.001 * x * x:.4f},{np.sin(0.1 + 0.004 * x):.9f},0.0,{np.cos(0.1 + 0.004 * x):.9f}\n"
    for x in range(-60, 61, 3)) + """\
MULTAX/OFF
FEDRAT/35.7,IPM
GOTO/50,0,2
CIRCLE/40,0,2,0,0,1,10
GOTO/40,-10,2
RAPID
GOTO/40,-10,80
FINI
"""
POST_CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250], mass_kg: 80, centre_of_mass_mm: [0, 0, 120]}
base_frame: {position_mm: [10, 20, 30], quaternion: [0.9238795325112867, 0, 0, 0.3826834323650898]}
workobject: {position_mm: [1010, 990, 700], quaternion: [0.96592583, 0, 0, 0.25881905]}
"""
TARE_CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
force_log: {frame: tool, sign: on_tool}
"""
COMMON = ("--stiffness", "stiffness.json", "--forces", "insert.forces.parquet", "--tare", "0:2")
CHAIN: tuple[tuple[str, ...], ...] = (
    ("--version",), ("robots",), ("robots", "--json"), ("explain",), ("explain", "--json"), ("explain", "CS3034"),
    ("demo", "demo"), ("demo", "demo"), ("demo", "demo-json", "--json"),
    ("identify", "cell.yaml", "measurements.csv", "-o", "stiffness.json", "--profile", "--report", "identify.html", "-v"),
    ("identify", "cell.yaml", "measurements.csv", "-o", "stiffness.json"),
    ("identify", "cell.yaml", "measurements.csv", "-o", "gaussian.json", "--prior", "gaussian", "--gamma", "2", "--json"),
    ("diagnose", "cell.yaml", "measurements.csv", "-o", "diagnosis.json", "--extended", "extended.json", "--report",
     "diagnose.html"),
    ("diagnose", "cell.yaml", "measurements.csv", "-o", "diagnosis2.json", "--json", "--replicates", "49"),
    ("diagnose", "cell.yaml", "faulty.csv", "-o", "diagnosis3.json", "--extended", "faulty.json", "--report", "faulty.html"),
    ("diagnose", "cell.yaml", "--plan", "measurements.csv"),
    ("design", "cell.yaml", "-o", "plan.csv", "--measurements", "4", "--rapid", "plan.mod", "--report", "plan.html", "--quick",
     "--validate", "2"),
    ("design", "cell.yaml", "-o", "plan2.csv", "--measurements", "3", "--toolpath", "insert.mod", "--forces",
     "insert.forces.parquet", "--quick", "--json"),
    ("design", "cell.yaml", "-o", "plan3.csv", "--add", "2", "faulty.csv", "--diagnosis", "diagnosis3.json", "--quick"),
    ("design", "cell.yaml", "-o", "plan4.csv", "--preset", "paper", "--quick"),
    ("post", "post.yaml", "part.apt", "-o", "part.mod", "--zone-mm", "0.5"),
    ("post", "post.yaml", "part.apt", "-o", "part_split.mod", "--split", "20", "--json"),
    ("tare", "tare.yaml", "still.csv", "-o", "payload.yaml"), ("tare", "tare.yaml", "still.csv", "--json"),
    ("predict", "cell.yaml", "insert.mod", *COMMON, "-o", "deviation.csv", "--report", "predict.html"),
    ("predict", "cell.yaml", "insert.mod", *COMMON, "-o", "deviation2.csv", "--json", "--spindle-rpm", "9000"),
    ("correct", "cell.yaml", "insert.mod", *COMMON, "-o", "corrected.mod", "--offsets", "offsets.csv", "--report",
     "correct.html", "--check-feed", "--advise", "--tighten-zones", "--tolerance", "2", "--long-move", "5"),
    ("correct", "cell.yaml", "insert.mod", *COMMON, "-o", "corrected2.mod", "--json", "-v", "--max-slope", "200",
     "--cutting-stiffness", "400:100", "--scale", "1.1:0.05", "--keep-targets", "--confidence", "0.9"),
    ("correct", "cell.yaml", "insert.mod", "--stiffness", "faulty.json", "--forces", "insert.forces.parquet", "--tare", "0:2",
     "-o", "corrected3.mod", "--offsets", "offsets3.csv", "--split", "1000"),
    ("correct", "cell.yaml", "insert.mod", *COMMON, "--strict-feed", "-o", "corrected4.mod", "--logged-with", "offsets.csv",
     "--first-forces", "insert.forces.parquet"),
    ("correct", "cell.yaml", "corrected.mod", *COMMON, "-o", "twice.mod"),
    ("correct", "cell.yaml", "insert.mod", *COMMON, "-o", "corrected.mod"),
    ("correct", "cell.yaml", "batch", "--stiffness", "stiffness.json", "--tare", "0:2", "-o", "batch-out", "--offsets",
     "batch-offsets", "--report", "batch-reports", "--json"),
    ("correct", "cell.yaml", "batch", "--stiffness", "stiffness.json", "--tare", "0:2", "-o", "batch-out2", "--jobs", "2"),
    ("watch", "batch", "watched", "--cell", "cell.yaml", "--stiffness", "stiffness.json", "--tare", "0:2", "--once",
     "--settle", "0"),
    ("watch", "batch", "watched", "--cell", "cell.yaml", "--stiffness", "stiffness.json", "--tare", "0:2", "--once",
     "--settle", "0"),
    ("verify", "cell.yaml", "before.csv", "after.csv", "--predicted", "offsets.csv", "--tolerance-um", "20", "--report",
     "verify.html"),
    ("verify", "cell.yaml", "before.csv", "after.csv", "--json"),
    ("push", "cell.yaml", "offsets.csv"), ("push", "cell.yaml", "offsets.csv", "--json", "--receiver", "receiver.mod"),
    ("identify", "broken.yaml", "measurements.csv", "-o", "x.json"), ("identify", "cell.yaml", "broken.csv", "-o", "x.json"),
    ("correct", "cell.yaml", "broken.mod", *COMMON, "-o", "x.mod", "--json"), ("correct", "cell.yaml"),
    ("predict", "cell.yaml", "insert.mod", *COMMON, "--tare", "x", "-o", "x.csv", "--json"),
)
NAMES = ("robots", "identify", "diagnose", "explain", "convert", "design", "post", "tare", "predict", "correct", "watch",
         "demo", "verify", "push", "cell")


FIGURE = re.compile(rb"-?\d+\.\d{6,}(?:e[-+]?\d+)?|-?\d+(?:\.\d+)?e-\d+")


def prepare(folder: Path) -> None:
    """The samples, and small files made from them: a backlash in the measurements, readings, a batch, broken copies."""
    for name in ("cell.yaml", "measurements.csv", "insert.mod", "insert.forces.parquet"):
        shutil.copy(SAMPLES / name, folder / name)
    head, *rows = [line for line in (folder / "measurements.csv").read_text().splitlines() if not line.startswith("#")]
    names = head.split(",")
    table = [dict(zip(names, row.split(","), strict=True)) for row in rows]
    for row in table:
        for axis in "xyz":
            force = float(row[f"f{axis}_n"])
            row[f"d{axis}_um"] = f"{float(row[f'd{axis}_um']) + 40 * np.tanh(force / 20):.2f}"
    (folder / "faulty.csv").write_text("\n".join([head, *(",".join(row.values()) for row in table)]) + "\n")
    (folder / "broken.csv").write_text("\n".join([head, *rows[:4], rows[5].replace(".", "x", 1)]) + "\n")
    (folder / "broken.yaml").write_text((folder / "cell.yaml").read_text().replace("tool:", "tul:"))
    (folder / "broken.mod").write_bytes((folder / "insert.mod").read_bytes()[:200_000] + b"\nMoveL [[1,2")
    (folder / "post.yaml").write_text(POST_CELL)
    (folder / "part.apt").write_text(APT)
    (folder / "tare.yaml").write_text(TARE_CELL)
    rng = np.random.default_rng(5)
    still = ["time_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm"]
    for place, (q4, q5) in enumerate([(0, 90), (40, 60), (-40, 60), (0, 30), (80, 100), (0, 120)]):
        down = IRB6660.pose(np.radians([0, 10, 20, q4, q5, 0]), np.zeros(3))[1].inv().apply([0, 0, -1])
        for k in range(40):
            numbers = [place * 10 + 0.1 * k, 0, 10, 20, q4, q5, 0, *(100 * down + rng.normal(0, 0.5, 3) + 5),
                       *(np.cross([0, 0, 0.1], 100 * down) + rng.normal(0, 0.1, 3))]
            still.append(",".join(f"{x:.4f}" for x in numbers))
    (folder / "still.csv").write_text("\n".join(still) + "\n")
    for name, size in (("before.csv", 100.0), ("after.csv", 10.0)):
        lines = ["target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um"]
        lines += [f"{k},{size * np.sin(k / 50) + n[0]:.3f},{size / 2 + n[1]:.3f},{n[2]:.3f},2,2,2"
                  for k, n in zip(range(100, 1500, 2), rng.normal(0, 3, (700, 3)), strict=True)]
        (folder / name).write_text("\n".join(lines) + "\n")
    batch = folder / "batch"
    batch.mkdir()
    for name in ("one", "two"):
        shutil.copy(SAMPLES / "insert.mod", batch / f"{name}.mod")
        shutil.copy(SAMPLES / "insert.forces.parquet", batch / f"{name}.forces.parquet")
    shutil.copy(SAMPLES / "insert.mod", batch / "without_log.mod")


def run(program: str, folder: Path, *, help_texts: bool) -> dict[str, bytes]:
    """All calls of one installation: their exit codes and texts, and the files they left."""
    prepare(folder)
    said = {}
    calls = [*CHAIN, *((name, "-h") for name in NAMES if help_texts)]
    for number, call in enumerate(calls):
        done = subprocess.run([program, *call], cwd=folder, capture_output=True, timeout=600)
        name = f"{number:02d} compstiff {' '.join(call)}"
        said |= {f"{name}: exit code": str(done.returncode).encode(), f"{name}: stdout": done.stdout,
                 f"{name}: stderr": done.stderr}
    said |= {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
    return {name: alike(text, folder) for name, text in said.items()}


def alike(text: bytes, folder: Path) -> bytes:
    """Without what must differ: the folder, versions, times of day, names of temporary log files."""
    text = text.replace(str(folder).encode(), b"FOLDER")
    text = re.sub(rb'"(compstiff|numpy)": "[^"]*"', rb'"\1": VERSION', text)
    text = re.sub(rb"compstiff, version \S+", b"VERSION", text)
    *before, rest = text.split(b"/identification/model/robots/")
    text = b"ROBOTS/".join([*map(_without_last_word, before), rest])
    text = re.sub(rb"compstiff-\w{8}\.log", b"LOG", text)
    text = re.sub(rb'"(time|at|when)": "?[-0-9T:.+Z]+"?', rb'"\1": TIME', text)
    return re.sub(rb"20\d\d-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?", b"TIME", text)


def _without_last_word(text: bytes) -> bytes:
    """By hand: a pattern that begins with any letters takes minutes over the packed numbers of a report."""
    return text[:max(text.rfind(end) for end in (b'"', b" ", b"\n")) + 1]


def last_digits(one: bytes, other: bytes) -> bool:
    """Whether two texts differ in nothing but figures of seven places and more, by less than a billionth of each, and in the
    digests of files with such figures."""
    (bare, figures), (other_bare, other_figures) = (
        (FIGURE.sub(b"#", text), np.array(FIGURE.findall(text), dtype=float)) for text in (
            re.sub(rb"\b[0-9a-f]{64}\b", b"DIGEST", text) for text in (one, other)))
    return bare == other_bare and bool(np.allclose(figures, other_figures, rtol=1e-9, atol=1e-15))


def main() -> int:
    """Prints what differs; exit code 1 if anything does."""
    old, new = sys.argv[1:3]
    results = []
    for program in (old, new):
        with tempfile.TemporaryDirectory() as folder:
            results.append(run(program, Path(folder).resolve(), help_texts="--help-texts" in sys.argv))
    first, second = results
    unlike = [name for name in {**first, **second} if first.get(name) != second.get(name)]
    in_digits = [name for name in unlike if last_digits(first.get(name, b"(missing)"), second.get(name, b"(missing)"))]
    for name in in_digits:
        print(f"LAST DIGITS {name}")
    different = [name for name in unlike if name not in in_digits]
    for name in different:
        print(f"DIFFERENT {name}")
        one, other = first.get(name, b"(missing)"), second.get(name, b"(missing)")
        for a, b in zip(one.split(b"\n"), other.split(b"\n"), strict=False):
            if a != b:
                print(f"    old: {a[:200]!r}\n    new: {b[:200]!r}")
                break
    codes = {name: text.decode() for name, text in second.items() if name.endswith("exit code")}
    print(f"{len(CHAIN)} calls, exit codes {' '.join(codes[name] for name in sorted(codes))}; {len(first)} texts and files, "
          f"{len(in_digits)} different in the last digits of figures alone, {len(different)} different")
    return bool(different)


if __name__ == "__main__":
    sys.exit(main())
