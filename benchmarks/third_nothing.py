"""The third judge's load tests with nothing hidden (third_world.py): the noise may be other than stated, or stated in part."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.third_trial import Hide, Trial, into

NOTHING: dict[str, Hide] = {}
quiet = into(NOTHING)
QUIET = {"adequate"}


@quiet
def nothing(trial: Trial, size: float) -> tuple[str, set[str]]:
    return "nothing", QUIET


@quiet
def bit_worse(trial: Trial, size: float) -> tuple[str, set[str]]:
    trial.noise.sensor *= 1.6
    trial.noise.seat *= 1.5
    trial.noise.relative *= 1.5
    return "nothing; noise 1.5 times the stated", QUIET


@quiet
def heavy(trial: Trial, size: float) -> tuple[str, set[str]]:
    trial.noise.heavy_tails = True
    trial.noise.sensor *= 1.2
    return "nothing; heavy-tailed readings (Student 3)", QUIET


@quiet
def wander(trial: Trial, size: float) -> tuple[str, set[str]]:
    trial.noise.stretch = 0.015
    trial.noise.turn = 0.8
    return "nothing; forces 1.5 % and 0.8 deg off a visit", QUIET


@quiet
def unstated(trial: Trial, size: float) -> tuple[str, set[str]]:
    trial.stated = {}
    return "nothing; measurement not stated", QUIET


@quiet
def partly(trial: Trial, size: float) -> tuple[str, set[str]]:
    trial.stated = {"deflection_std_um": trial.stated["deflection_std_um"]}
    return "nothing; only deflection_std stated", QUIET


@quiet
def few(trial: Trial, size: float) -> tuple[str, set[str]]:
    trial.visits, trial.kept = 5, 0
    trial.rows = [replace(row, validate=False) for row in trial.rows if row.visit < trial.visits]
    return "nothing; five poses", QUIET
