"""The sample part, its toolpath by opencamlib, the force model and the RAPID template, against laws and geometry."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samples import cam, cutting, part


@pytest.fixture(scope="module")
def triangles():
    return part.read_stl(part.stl_bytes(part.mesh()))


@pytest.fixture(scope="module")
def path(triangles):
    pytest.importorskip("opencamlib", reason="the samples extra is not installed: opencamlib makes the toolpath")
    return cam.sample_path(triangles)


def distance_to_triangles(point, triangles):
    """Smallest distance of a point to triangles (T, 3, 3): the foot of the plane, or else the nearest edge."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.sum((point - a) * normal, axis=1)
    foot = point - height[:, None] * normal
    inside = np.ones(len(triangles), dtype=bool)
    best = np.full(len(triangles), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.sum(np.cross(q - p, foot - p) * normal, axis=1) >= 0.0
        share = np.clip(np.sum((point - p) * (q - p), axis=1) / np.sum((q - p) ** 2, axis=1), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(point - (p + share[:, None] * (q - p)), axis=1))
    return float(np.where(inside, np.abs(height), best).min())


def near(point, triangles, reach):
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    return triangles[np.all((low < point + reach) & (high > point - reach), axis=1)]


# the part


def test_the_surface_is_closed_and_consistently_turned(triangles):
    _, corner = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = corner.reshape(-1, 3)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    directed = {(int(a), int(b)) for a, b in edges}
    assert len(directed) == len(edges)                          # each direction once ...
    assert all((b, a) in directed for a, b in directed)         # ... and its reverse: exactly two triangles an edge


def test_the_surface_does_not_fold(triangles):
    area = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.linalg.norm(area, axis=1).min() > 0.0
    assert np.clip(area[:, 2], 0.0, None).sum() == pytest.approx(240.0 * 160.0, rel=1e-6)
    front = np.all(triangles[:, :, 1] == 0.0, axis=1)
    assert np.linalg.norm(area[front], axis=1).sum() == pytest.approx(-area[front, 1].sum(), rel=1e-6)


def test_size_and_volume(triangles):
    assert np.allclose(triangles.reshape(-1, 3).min(axis=0), 0.0)
    assert triangles.reshape(-1, 3).max(axis=0) == pytest.approx([240.0, 160.0, 39.8], abs=0.1)
    x, y = np.meshgrid(np.arange(0.5, 240.0), np.arange(0.5, 160.0), indexing="ij")
    top = part.top_height_mm(x, y)
    offset = part.outline_distance_mm(x, y)
    height = np.linspace(0.0, 25.0, 2501)                       # the wall's height over its offset, by inversion
    wall = part.FLOOR_MM + np.interp(offset, part.wall_offset_mm(height), height)
    columns = np.where(offset < 0.0, part.FLOOR_MM, np.minimum(top, wall))
    assert part.volume_mm3(triangles) == pytest.approx(columns.sum(), rel=2e-3)


def test_the_stl_is_deterministic_and_refuses_a_torn_file(triangles):
    data = part.stl_bytes(part.mesh())
    assert data == part.stl_bytes(part.mesh())
    assert len(data) == 84 + 50 * len(triangles) < 600_000
    with pytest.raises(ValueError, match="received"):
        part.read_stl(data[:-1])


def test_the_allowance_is_in_its_range():
    x, y = np.meshgrid(np.linspace(0, 240, 241), np.linspace(0, 160, 161))
    stock = part.allowance_mm(x, y)
    assert 0.3 <= stock.min() < 0.35
    assert 1.45 < stock.max() <= 1.5
    assert np.abs(np.gradient(stock)).max() < 0.05              # smooth: less than 0.05 mm a millimetre


# the path


def test_counts_spacing_and_reach(path):
    assert 2000 <= len(path) <= 4000
    step = np.linalg.norm(np.diff(path.position_mm, axis=0), axis=1)
    cut = step[path.cutting[1:]]
    assert cut.min() > 0.3
    assert cut.max() < 3.3
    assert 2.0 < np.median(cut) < 3.0
    assert not np.any(path.cutting & path.rapid)
    assert path.rapid[0]
    assert path.rapid[-1]
    assert len(path.passes) == path.pass_index[-1] + 1
    assert 120.0 < path.duration_s.sum() < 400.0


def test_directions_are_units_and_square_to_each_other(path):
    for vectors in (path.tool_axis, path.contact_normal, path.side):
        assert np.allclose(np.linalg.norm(vectors, axis=1), 1.0)
    assert np.abs(np.sum(path.contact_normal * path.side, axis=1)).max() < 1e-12
    tilt = np.degrees(np.arccos(path.tool_axis[:, 2]))
    assert tilt.max() < 8.0
    assert np.ptp(tilt) > 3.0
    turn = np.degrees(np.linalg.norm(np.diff(path.tool_axis, axis=0), axis=1))
    assert turn[path.cutting[1:]].max() < 1.0                   # smooth: under a degree a move


def test_the_ball_touches_and_does_not_gouge(path, triangles):
    """Cutting moves: every tenth target lies on the surface offset; every tenth chord's middle does not gouge."""
    centre = path.centre_mm
    middle = 0.5 * (centre[1:] + centre[:-1])
    touching = []
    for i in np.flatnonzero(path.cutting)[::10]:
        for point in (centre[i], middle[i - 1]):
            close = near(point, triangles, path.radius_mm + 0.1)
            distance = distance_to_triangles(point, close) if len(close) else np.inf
            assert distance >= path.radius_mm - 0.02
            touching.append(distance <= path.radius_mm + 0.02)
    assert np.mean(touching) > 0.8                              # all but run-in and run-out beside the part


def test_air_moves_and_leads_stay_clear(path, triangles):
    centre = path.centre_mm
    for i in np.flatnonzero(~path.cutting)[1:]:
        length = np.linalg.norm(centre[i] - centre[i - 1])
        for share in np.linspace(0.0, 1.0, 2 + int(length / 10.0)):
            point = centre[i - 1] + share * (centre[i] - centre[i - 1])
            close = near(point, triangles, path.radius_mm)
            if len(close):
                assert distance_to_triangles(point, close) >= path.radius_mm - 0.02


def test_the_shank_stays_clear(path, triangles):
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    for centre, axis in zip(path.centre_mm[::12], path.tool_axis[::12], strict=True):
        along = (corners - centre) @ axis
        across = np.linalg.norm(corners - centre - along[:, None] * axis, axis=1)
        assert across[along > 0.0].min(initial=np.inf) >= path.radius_mm - 0.02


def test_the_path_is_deterministic(path, triangles):
    again = cam.parallel_passes(cam.surface(triangles), (0.0, 240.0), [2.5], 26.0)[0]
    first = path.centre_mm[(path.pass_index == 0) & path.cutting][3:-4]
    assert np.allclose(first, again.centre, atol=1e-9)


def test_thin_keeps_the_tolerance_and_the_ends():
    angle = np.linspace(0.0, 2.0, 2001)
    arc = 40.0 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    keep = cam.thin(arc, 0.01, 3.0)
    assert keep[0] == 0
    assert keep[-1] == 2000
    chord = np.linalg.norm(np.diff(arc[keep], axis=0), axis=1)
    assert chord.max() < np.sqrt(8.0 * 40.0 * 0.01) + 0.05      # sagitta = chord^2 / (8 r)
    assert chord.min() > 0.5 * chord.max() - 0.1


def test_tool_quaternion_turns_z_against_the_axis():
    rng = np.random.default_rng(7)
    axis = cam.unit(rng.normal(size=(200, 3)))
    w, x, y, z = cam.tool_quaternion(axis, [0.2, 1.0, 0.1]).T
    third = np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    assert np.allclose(third, -axis, atol=1e-12)
    first = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    assert np.all(first @ [0.2, 1.0, 0.1] > 0.0)
    assert np.allclose(w * w + x * x + y * y + z * z, 1.0)


# the force


def straight(n=2, length=60.0, feed=45.0, cutting_moves=None):
    """A straight cut along x over a flat top, TCP height 0."""
    one = np.ones(n)
    position = np.column_stack([np.linspace(0.0, length, n), 0 * one, 0 * one])
    axis = np.tile(cam.unit([0.08, 0.03, 1.0]), (n, 1))
    flags = np.ones(n, dtype=bool) if cutting_moves is None else np.array(cutting_moves)
    up, left = np.tile([0.0, 0.0, 1.0], (n, 1)), np.tile([0.0, 1.0, 0.0], (n, 1))
    return cam.CutterPath(position, axis, feed * one, flags, ~flags, np.zeros(n, dtype=np.intp), up, left, 5.0 * one,
                          ("cut",), 8.0)


def steady(x, y):
    return np.full(np.shape(x), 0.9)


def test_the_mean_over_whole_revolutions_does_not_know_the_phase():
    rate = 150.0 * 16                                           # 16 samples a revolution at 9000 rpm
    means = []
    for phase in (0.0, 0.7, 2.9):
        log = cutting.force_log(straight(), steady, rate_hz=rate, phase_rad=phase)
        means.append(log.force_n[16:16 * 101].mean(axis=0))
    assert np.linalg.norm(means[0]) > 80.0
    assert np.ptp(means, axis=0).max() < 0.01 * np.linalg.norm(means[0])


def test_the_spectrum_has_its_line_at_tooth_passing():
    process = cutting.Process(runout_mm=(0.0, 0.0, 0.0))
    log = cutting.force_log(straight(), steady, process, rate_hz=2400.0)
    force = log.force_n[:2400, 0] - log.force_n[:2400, 0].mean()
    spectrum = np.abs(np.fft.rfft(force * np.hanning(2400)))    # 1 Hz a bin
    assert abs(int(np.argmax(spectrum)) - process.tooth_passing_hz) <= 1
    once = spectrum[148:153].max()
    with_runout = cutting.force_log(straight(), steady, rate_hz=2400.0).force_n[:2400, 0]
    uneven = np.abs(np.fft.rfft((with_runout - with_runout.mean()) * np.hanning(2400)))[148:153].max()
    assert uneven > 5.0 * max(once, 1.0)                        # run-out shows once a revolution


def test_no_force_in_the_air():
    log = cutting.force_log(straight(4, 60.0, cutting_moves=[False, False, True, False]), steady)
    busy = np.linalg.norm(log.force_n, axis=1) > 0.0
    assert busy.any()
    assert log.position_mm[busy, 0].min() >= 20.0 - 0.1
    assert log.position_mm[busy, 0].max() <= 40.0 + 0.1
    assert not cutting.force_log(straight(), steady, stock=lambda x, y, z: np.zeros(x.shape, dtype=bool)).force_n.any()


def test_entry_ramps_over_the_contact_length():
    """The cut begins when the front of the contact, sqrt(2 R a) before the centre, meets the edge."""
    log = cutting.force_log(straight(), steady, stock=lambda x, y, z: x > 30.0)
    size = np.convolve(np.linalg.norm(log.force_n, axis=1), np.ones(10) / 10.0, "same")
    centre_x = log.position_mm[:, 0] + 8.0 * cam.unit([0.08, 0.03, 1.0])[0]
    start = centre_x[np.flatnonzero(size > 1.0)[0]]
    assert start == pytest.approx(30.0 - np.sqrt(2 * 8.0 * 0.9), abs=0.7)
    assert size[centre_x > 30.5][:-10].min() > 0.7 * size.max()


def test_the_force_follows_stock_and_feed():
    def mean(stock=0.9, feed=45.0, process=None):
        log = cutting.force_log(straight(feed=feed), lambda x, y: np.full(x.shape, stock), process, rate_hz=2400.0)
        return np.linalg.norm(log.force_n[:1600].mean(axis=0))

    assert mean(0.3) < mean(0.6) < mean(0.9) < mean(1.5)
    shear_only = replace(cutting.Process(), edge_n_mm=(0.0, 0.0, 0.0), runout_mm=(0.0, 0.0, 0.0))
    assert mean(feed=60.0, process=shear_only) == pytest.approx(2.0 * mean(feed=30.0, process=shear_only), rel=0.02)


def test_the_cut_resists_and_the_ball_is_pushed_off():
    """With a chip on both sides (a groove), the force resists the feed; an inclined edge near the tip lifts the tool."""
    groove = straight()
    groove = replace(groove, step_mm=np.full(2, 50.0))
    force = cutting.force_log(groove, steady, rate_hz=2400.0).force_n[:1600].mean(axis=0)
    assert force[0] < 0.0
    assert force[2] > 0.0


def test_turning_everything_about_z_turns_the_force():
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    base = straight()
    turned = replace(base, **{name: getattr(base, name) @ turn.T
                              for name in ("position_mm", "tool_axis", "contact_normal", "side")})
    a = cutting.force_log(base, steady, rate_hz=2400.0).force_n[:1600].mean(axis=0)
    b = cutting.force_log(turned, steady, rate_hz=2400.0).force_n[:1600].mean(axis=0)
    assert b == pytest.approx(turn @ a, abs=0.01 * np.linalg.norm(a))


def test_the_log_runs_along_the_path_at_the_programmed_feed(path):
    short = 400
    values = {name: getattr(path, name) for name in cam.CutterPath.__dataclass_fields__}
    cut = cam.CutterPath(**{name: v[:short] if isinstance(v, np.ndarray) else v for name, v in values.items()})
    log = cutting.force_log(cut, part.allowance_mm, stock=part.is_stock, rate_hz=1500.0)
    assert np.allclose(np.diff(log.time_s), 1.0 / 1500.0)
    assert log.time_s[-1] == pytest.approx(cut.duration_s.sum(), abs=1.0 / 1500.0)
    speed = np.linalg.norm(np.diff(log.position_mm, axis=0), axis=1) * 1500.0
    inside = log.target[1:] == log.target[:-1]
    assert speed[inside] == pytest.approx(cut.feed_mm_s[log.target[1:]][inside], rel=1e-6)
    after = np.minimum(log.target + 1, short - 1)               # a sample's average may reach into the next move
    assert not log.force_n[~cut.cutting[log.target] & ~cut.cutting[after] & ~cut.cutting[log.target - 1]].any()
    smooth = np.column_stack([np.convolve(f, np.ones(50) / 50, "same") for f in log.force_n.T])     # 5 revolutions
    strength = np.linalg.norm(smooth, axis=1)
    assert 200.0 < strength.max() < 400.0
    assert np.median(strength[cut.cutting[log.target]]) > 80.0


def test_the_sensor_is_deterministic_and_quantised():
    force = np.zeros((4000, 3))
    a = cutting.sensor(force, np.random.default_rng(1))
    assert np.array_equal(a, cutting.sensor(force, np.random.default_rng(1)))
    assert not np.array_equal(a, cutting.sensor(force, np.random.default_rng(2)))
    assert np.array_equal(a * 32.0, np.round(a * 32.0))
    assert a.mean(axis=0) == pytest.approx([2.6, -3.4, 4.1], abs=0.1)
    assert a.std(axis=0) == pytest.approx([1.5] * 3, rel=0.05)


def test_a_process_needs_a_run_out_for_each_tooth():
    with pytest.raises(ValueError, match="one entry a tooth"):
        cutting.Process(teeth=2)


def test_the_script_writes_the_cell_that_is_shipped() -> None:
    text = (Path(__file__).parents[2] / "samples" / "make_samples.py").read_text()
    written = re.search(r'CELL = """\\\n(.*?)"""', text, re.S)
    assert written
    assert written.group(1) == (Path(__file__).parents[2] / "samples" / "cell.yaml").read_text()
