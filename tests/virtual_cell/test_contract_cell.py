"""The virtual cell's interface: sizes of what it hides, reproducible cases, poses that a real robot would reach."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.virtual_cell.cell import AT_POSES, DICTIONARY, HUNG, NEAR, OUTSIDE, TRACK, Hidden, draw, main, parse, simulate
from tests.virtual_cell.designs import Design
from tests.virtual_cell.hidden import EFFECTS
from tests.virtual_cell.inverse import comfortable


def places(name: str) -> tuple[int | None, ...]:
    return EFFECTS[name].joints or (None,)


def test_names() -> None:
    assert len(DICTIONARY) == 31
    assert len(OUTSIDE) >= 6
    assert len(EFFECTS) == len(DICTIONARY) + len(OUTSIDE) + len(NEAR) + len(HUNG) + len(TRACK) + len(AT_POSES)


@cache
def twenty(seed: int) -> Design:
    """Poses take longer to find than all that is hidden there."""
    return simulate(seed, "poses20", noise="none").design


def test_each_effect_at_typical_size_is_some_micrometres() -> None:
    """Prints the table; each effect shows at one of its joints at least, and none breaks the robot."""
    plain = simulate(2, twenty(2), noise="none").deflection_um
    for name in (*DICTIONARY, *OUTSIDE, *NEAR):
        found = {joint: simulate(2, twenty(2), [Hidden(name, joint)], "none").deflection_um for joint in places(name)}
        rms = {joint: float(np.sqrt(np.mean((deflection - plain) ** 2))) for joint, deflection in found.items()}
        print(name.ljust(28), "  ".join(f"{joint or ''}: {size:.2f}" for joint, size in rms.items()))
        assert 0.2 < max(rms.values()) < 100


@pytest.mark.parametrize("name", [*DICTIONARY, *OUTSIDE, *NEAR])
def test_no_size_no_change(name: str) -> None:
    for joint in places(name):
        case = simulate(3, twenty(3), [Hidden(name, joint, 0.0)], "none")
        assert np.abs(case.effect_um).max() < 1e-5


def test_the_same_seed_is_the_same_case() -> None:
    for design in ("paper5", "poses20", "ladder12"):
        hidden = [draw(np.random.default_rng(4)) for _ in range(2)]
        first, second = (simulate(7, design, hidden, validation=2) for _ in range(2))
        np.testing.assert_array_equal(first.deflection_um, second.deflection_um)
        assert first.truth == second.truth
        plain = simulate(7, design, validation=2)
        np.testing.assert_array_equal(first.theta, plain.theta)
        np.testing.assert_array_equal(first.stiffness, plain.stiffness)
        assert first.noise == plain.noise
        assert not np.array_equal(first.deflection_um, simulate(8, design, hidden, validation=2).deflection_um)


def test_pairs_add_up() -> None:
    pair = [Hidden("backlash", 1), Hidden("base_shift")]
    both = simulate(5, "poses20", pair, "none").effect_um
    single = [simulate(5, "poses20", [hidden], "none").effect_um for hidden in pair]
    np.testing.assert_allclose(both, sum(single), atol=0.5)


def test_noise_is_what_was_drawn() -> None:
    case = simulate(9, noise="white")
    assert np.std(case.deflection_um - case.plain_um) == pytest.approx(5.0, rel=0.1)
    realistic = [simulate(seed, "paper5").noise for seed in range(200)]
    assert 0.1 < np.mean([noise.degrees_of_freedom is not None for noise in realistic]) < 0.4
    for noise in realistic:
        assert 0.6 < noise.stated_sensor_um / noise.sensor_um < 1.5


def test_designs() -> None:
    counts = {"paper5": (5, 4), "poses20": (20, 20), "ladder12": (252, 12)}
    for design, (rows, poses) in counts.items():
        for seed in range(6):
            case = simulate(seed, design, noise="none")
            assert (len(case.theta), len(set(case.pose))) == (rows, poses)
            assert comfortable(case.theta).all()
            assert (np.diff(case.time) >= case.dwell[1:]).all()
            assert (np.count_nonzero(case.wrench, axis=1) <= 1).all()
            assert np.ptp(case.theta, axis=0)[1] > np.radians(2 if design == "paper5" else 30)
    points = np.unique(np.round(case.tcp, 4), axis=0)
    assert len(points) == 3


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert parse("backlash:3:0.5+drift") == (Hidden("backlash", 3, 0.5), Hidden("drift"))
    main(["1", "poses20", "link_bending+creep", str(tmp_path)])
    assert "flexibility_per_nm2" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"cell.yaml", "robot.yaml", "measurements.csv", "truth.json"}
    with pytest.raises(ValueError, match="no effect 'backlsh'"):
        simulate(1, "paper5", [Hidden("backlsh", 1)])
    with pytest.raises(ValueError, match="sits at"):
        simulate(1, "paper5", [Hidden("backlash", 7)])
