"""Modbus frames spoilt in their bounds, to the embedded device and to the client (tests/compensator/modbus/frames.py).

    python benchmarks/fuzz_frames.py [--frames 20000] [--replies 2000] [--seed 0]

Printed: how many, and what is wrong. Exit 1 where anything is.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.compensator.modbus.frames import to_a_client, to_a_device


def main() -> int:
    """Sends and answers."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--replies", type=int, default=2_000)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    said = to_a_device(chosen.seed, chosen.frames)
    print(f"{chosen.frames} frames to a device: {len(said)} wrong", flush=True)
    more = to_a_client(chosen.seed, chosen.replies)
    print(f"{chosen.replies} replies to a client: {len(more)} wrong")
    print("\n".join([*said, *more][:40]))
    return int(bool(said or more))


if __name__ == "__main__":
    raise SystemExit(main())
