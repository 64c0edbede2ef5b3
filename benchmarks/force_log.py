"""CPU time and peak memory of reading force logs, as a ratio to bare pandas in chunks on the same file in the same run.

    python -m benchmarks.force_log [ROWS ...]          # default 1e6 1e7; 4.6e7 is half an hour at 25.6 kHz

Each reading is a process of its own; best of three up to 1e7 rows. Files go to a temporary folder (33 bytes a row as CSV).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

RATE, RPM = 25600.0, 9000.0
COLUMNS = ["path_mm", "fx_n", "fy_n", "fz_n"]


def write(folder: Path, rows: int) -> dict[str, Path]:
    """One log as CSV and as Parquet: three teeth at 9000 rpm, run-out, noise; 648 mm/min."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    files = {"csv": folder / f"{rows}.csv", "parquet": folder / f"{rows}.parquet"}
    rng, schema = np.random.default_rng(0), pa.schema([(name, pa.float64()) for name in COLUMNS])
    with open(files["csv"], "w") as text, pq.ParquetWriter(files["parquet"], schema) as table:
        text.write(",".join(COLUMNS) + "\n")
        for first in range(0, rows, 200_000):
            k = np.arange(first, min(first + 200_000, rows))
            angle = 2 * np.pi * RPM / 60 * k / RATE
            wave = 1 + 0.8 * np.cos(3 * angle) + 0.1 * np.cos(angle)
            force = np.outer(wave, [120, -200, 60]) + rng.normal(0, 2, (len(k), 3))
            frame = pd.DataFrame(np.round(np.column_stack([k * 10.8 / RATE, force]), 4), columns=COLUMNS)
            frame.to_csv(text, header=False, index=False)
            table.write_table(pa.Table.from_pandas(frame, schema, preserve_index=False))
    return files


def measure(how: str, file: str) -> tuple[float, float]:
    """CPU seconds and peak MB of one reading in a process of its own, imports left out of the time."""
    run = subprocess.run([sys.executable, "-m", "benchmarks.force_log", "--one", how, file], check=True, capture_output=True,
                         text=True)
    seconds, megabytes = run.stdout.split()[-2:]
    return float(seconds), float(megabytes)


def one(how: str, file: str) -> None:
    """Reads the file in this process."""
    if file.endswith(".parquet"):
        import pyarrow.parquet as pq

    if how == "pandas":
        begun = time.process_time()
        if file.endswith(".parquet"):
            for batch in pq.ParquetFile(file).iter_batches(batch_size=200_000):
                batch.to_pandas().to_numpy().sum()
        else:
            for chunk in pd.read_csv(file, chunksize=200_000):
                chunk.to_numpy().sum()
    else:
        from compensator.forces.log import read_force_log
        from identification.model.cell_file import ForceLogFile

        borders = 1e-3 * np.arange(0.5, 30_000)
        begun = time.process_time()
        read_force_log(file, ForceLogFile(rate_hz=RATE), spindle_rpm=RPM if how == "stated" else None,
                       borders=borders) if how != "plain" else read_force_log(file, borders=borders)
    seconds = time.process_time() - begun
    # Not ru_maxrss: that includes the parent's memory before exec.
    peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    print(seconds, int(peak.split()[1]) / 1024)


def main() -> None:
    """Prints the table."""
    if sys.argv[1:2] == ["--one"]:
        one(*sys.argv[2:4])
        return
    print("| rows | file | reading | CPU s | ratio to pandas in chunks | peak MB |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for rows in [int(float(text)) for text in sys.argv[1:]] or [10**6, 10**7]:
            for kind, file in write(Path(folder), rows).items():
                base = 0.0
                for how in ("pandas", "plain", "stated", "found"):
                    runs = [measure(how, str(file)) for _ in range(3 if rows <= 10**7 else 1)]
                    seconds, megabytes = min(run[0] for run in runs), max(run[1] for run in runs)
                    base = base or seconds
                    print(f"| {rows:.2g} | {kind} | {how} | {seconds:.2f} | {seconds / base:.2f} | {megabytes:.0f} |",
                          flush=True)
                file.unlink()


if __name__ == "__main__":
    main()
