"""Progress shows on a terminal and after a second, and nowhere else."""

from __future__ import annotations

import time

import pytest

from identification.common import progress


@pytest.mark.parametrize(("watched", "slow"), [(True, True), (True, False), (False, True)])
def test_progress(monkeypatch, capfd, watched: bool, slow: bool) -> None:
    monkeypatch.setattr(progress, "PATIENCE", 0.0 if slow else 60.0)
    token = progress.shown.set(watched)
    try:
        with progress.progress("reading part.csv", 10) as bar:
            for _ in range(10):
                time.sleep(0.002)
                bar.add(1)
    finally:
        progress.shown.reset(token)
    out, err = capfd.readouterr()
    assert out == ""
    assert bool(err) == (watched and slow)
