"""Where the cases of a benchmark are worked on: processes of this machine, or a Dask cluster, by the seam of `correct`.

Workers of a cluster need this checkout in their PYTHONPATH and the disk that holds the temporary folder (docs/cluster.md).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

from compstiff.batch.cluster import connected


def pool_options(parser: argparse.ArgumentParser) -> None:
    """Adds what `pool` is asked for."""
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--scheduler", metavar="ADDRESS", help="on the workers of this Dask scheduler instead")


@contextmanager
def pool(wanted: argparse.Namespace) -> Iterator[Executor]:
    """An executor, as the options say."""
    if wanted.scheduler is None:
        with ProcessPoolExecutor(wanted.processes) as processes:
            yield processes
        return
    with connected(wanted.scheduler) as client, client.get_executor() as workers:
        yield workers
