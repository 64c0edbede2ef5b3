"""The sample's toolpath: a ball mill over the freeform top and round the pocket's wall, by opencamlib.

Drop cutter (parallel passes, to and fro) and push cutter (waterline) give cutter locations for an upright tool. A ball
may then be tilted about its centre without leaving the surface, so every pass is kept as centres; the TCP is the tip:
`position = centre - radius * tool_axis`. Semi-finishing: 5 mm between passes leaves a scallop of 0.4 mm.

Lengths in mm in the work object (= the part's frame). `tool_axis` points from the tip to the spindle.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from samples import part

Array = NDArray[np.float64]
PlanMask = Callable[[Array, Array], NDArray[np.bool_]]

CUTTER_RADIUS_MM = 8.0
TOLERANCE_MM, SPACING_MM = 0.01, 3.0            # chord error and length at most
STEPOVER_MM, STEPDOWN_MM = 5.0, 5.0
WATERLINES_MM = (29.0, 24.0, 19.0)              # heights of the tip, downwards
EXTENSION_MM, LEAD_RADIUS_MM, SAFE_MM = 8.0, 6.0, 70.0
FEED_TOP_MM_S, FEED_WALL_MM_S, FEED_LEAD_MM_S, FEED_RAPID_MM_S = 45.0, 36.0, 40.0, 250.0


@dataclass(frozen=True)
class CutterPath:
    """N targets; flags and feed belong to the move that ends at the target. Arrays are read-only.

    position_mm    (N, 3) TCP = tip of the ball, work object
    tool_axis      (N, 3) unit, from the tip to the spindle
    feed_mm_s      (N,)   TCP speed [mm/s]
    cutting        (N,)   True where the move is a cutting pass (its run-in and run-out beside the part included)
    rapid          (N,)   True for air moves; neither cutting nor rapid: plunge, lead-in, lead-out
    pass_index     (N,)   index into `passes`
    contact_normal (N, 3) unit, from the surface to the ball's centre
    side           (N, 3) unit, along the surface, across the feed, towards the stock not cut yet
    step_mm        (N,)   distance from the pass before [mm]
    passes         names of the passes
    radius_mm      of the ball
    """

    position_mm: Array
    tool_axis: Array
    feed_mm_s: Array
    cutting: NDArray[np.bool_]
    rapid: NDArray[np.bool_]
    pass_index: NDArray[np.intp]
    contact_normal: Array
    side: Array
    step_mm: Array
    passes: tuple[str, ...]
    radius_mm: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __len__(self) -> int:
        return len(self.position_mm)

    @property
    def centre_mm(self) -> Array:
        """Centres of the ball (N, 3) [mm]."""
        return self.position_mm + self.radius_mm * self.tool_axis

    @property
    def duration_s(self) -> Array:
        """Time of the move that ends at each target (N,) [s] at the programmed feed; 0 for the first."""
        length = np.linalg.norm(np.diff(self.position_mm, axis=0), axis=1)
        return np.concatenate([[0.0], length / self.feed_mm_s[1:]])


@dataclass(frozen=True)
class Pass:
    """One run of the ball over the surface: centres (n, 3) [mm], contact normals (n, 3), and where the stock lies."""

    name: str
    centre: Array
    normal: Array
    towards: tuple[float, float, float]     # rough direction of the stock not cut yet
    step_mm: float
    feed_mm_s: float


def unit(vectors: ArrayLike) -> Array:
    """Vectors (..., 3) divided by their length."""
    v = np.asarray(vectors, dtype=float)
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True), dtype=float)


def surface(triangles: Array) -> Any:
    """The opencamlib surface of triangles (T, 3, 3) [mm]."""
    import opencamlib as ocl

    stl = ocl.STLSurf()
    for a, b, c in triangles.tolist():
        stl.addTriangle(ocl.Triangle(ocl.Point(*a), ocl.Point(*b), ocl.Point(*c)))
    return stl


def drop_ball(stl: Any, plan_mm: Array, radius_mm: float) -> tuple[Array, Array]:
    """Centres and contact normals (n, 3) of an upright ball let down over points (n, 2) [mm] of the plan."""
    import opencamlib as ocl

    cutter = ocl.BallCutter(2.0 * radius_mm, 100.0)         # in a variable: the operation keeps a bare pointer to it
    drop = ocl.BatchDropCutter()
    drop.setSTL(stl)
    drop.setCutter(cutter)
    drop.setThreads(1)
    for x, y in plan_mm.tolist():
        drop.appendPoint(ocl.CLPoint(x, y, -100.0))
    drop.run()
    points = drop.getCLPoints()
    centre = np.array([(p.x, p.y, p.z + radius_mm) for p in points])
    contact = np.array([(c.x, c.y, c.z) for c in (p.cc() for p in points)])
    return centre, unit(centre - contact)


def waterline(stl: Any, height_mm: float, radius_mm: float, sampling_mm: float = 0.5) -> list[Array]:
    """Closed loops of centres (n, 3) [mm] of an upright ball pushed against the surface, its tip at one height."""
    import opencamlib as ocl

    cutter = ocl.BallCutter(2.0 * radius_mm, 100.0)
    line = ocl.Waterline()
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(line))      # kept for good: its destructor writes to stdout (2023.1.11)
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(cutter))    # and it holds a bare pointer to the cutter
    line.setSTL(stl)
    line.setCutter(cutter)
    line.setSampling(sampling_mm)
    line.setThreads(1)
    line.setZ(height_mm)
    line.run()
    return [np.array([(p.x, p.y, p.z + radius_mm) for p in loop]) for loop in line.getLoops()]


def thin(points: Array, tolerance_mm: float, spacing_mm: float) -> NDArray[np.intp]:
    """Indices of the points (n, 3) [mm] to keep: chords within the tolerance and no longer than the spacing.

    Greedy from the start; the last two chords are evened out, so that no stub is left at the end.
    """
    keep = [0]
    while keep[-1] < len(points) - 1:
        start, end = keep[-1], keep[-1] + 1
        while end + 1 < len(points):
            chord = points[end + 1] - points[start]
            length = float(np.linalg.norm(chord))
            if length > spacing_mm + 1e-9:
                break
            offset = np.cross(points[start + 1:end + 1] - points[start], chord / max(length, 1e-12))
            if np.max(np.linalg.norm(offset, axis=1)) > tolerance_mm:
                break
            end += 1
        keep.append(end)
    if len(keep) > 2:
        keep[-2] = (keep[-3] + keep[-1]) // 2
    return np.array(keep, dtype=np.intp)


def runs(mask: NDArray[np.bool_], at_least: int = 2) -> list[slice]:
    """Slices of the stretches of a boolean array that are True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= at_least]


def parallel_passes(stl: Any, x_mm: tuple[float, float], y_mm: Iterable[float], lowest_tip_mm: float,
                    steepest_deg: float = 12.0, name: str = "top") -> list[Pass]:
    """Passes along x at each y [mm], to and fro, where the surface is flatter than a limit and not below a height."""
    grid = np.linspace(*x_mm, round((x_mm[1] - x_mm[0]) / 0.49) + 1)     # six steps stay under the spacing
    lines = np.array(list(y_mm), dtype=float)
    plan = np.column_stack([np.tile(grid, lines.size), np.repeat(lines, grid.size)])
    centres, normals = (a.reshape(lines.size, grid.size, 3) for a in drop_ball(stl, plan, CUTTER_RADIUS_MM))
    out: list[Pass] = []
    for y, centre, normal in zip(lines, centres, normals, strict=True):
        wanted = (normal[:, 2] >= np.cos(np.radians(steepest_deg))) & (centre[:, 2] - CUTTER_RADIUS_MM >= lowest_tip_mm)
        pieces = runs(wanted, at_least=12)
        forward = not out or out[-1].centre[0, 0] > out[-1].centre[-1, 0]
        for piece in pieces if forward else pieces[::-1]:
            c, n = centre[piece], normal[piece]
            if not forward:
                c, n = c[::-1], n[::-1]
            keep = thin(c, TOLERANCE_MM, SPACING_MM)
            label = f"{name}, y = {y:.1f} mm, from x = {c[0, 0]:.1f} to {c[-1, 0]:.1f} mm"
            out.append(Pass(label, c[keep], n[keep], (0.0, 1.0, 0.0), STEPOVER_MM, FEED_TOP_MM_S))
    return out


def wall_passes(stl: Any, heights_mm: Iterable[float], inside: PlanMask, name: str = "wall") -> list[Pass]:
    """Passes round an open pocket, counter-clockwise (climb milling), one a height of the tip [mm].

    inside(x, y) tells which stretch of the waterline belongs to the pocket; the loop also runs round the block.
    """
    out = []
    for height in heights_mm:
        loop = max(waterline(stl, height, CUTTER_RADIUS_MM), key=len)
        wanted = inside(loop[:, 0], loop[:, 1])
        start = int(np.flatnonzero(~wanted)[0])             # begin outside, so that the stretch is in one piece
        loop, wanted = np.roll(loop, -start, axis=0), np.roll(wanted, -start)
        stretch = max(runs(wanted), key=lambda s: s.stop - s.start)
        centre = loop[stretch]
        inward = np.cross([0.0, 0.0, 1.0], centre[1] - centre[0])
        middle = centre.mean(axis=0)
        if inward @ (middle - centre[0]) < 0.0:             # counter-clockwise: the pocket lies to the left
            centre = centre[::-1]
        centre = centre[thin(centre, TOLERANCE_MM, SPACING_MM)]
        _, normal = drop_ball(stl, centre[:, :2], CUTTER_RADIUS_MM)
        label = f"{name}, tip at z = {height:.1f} mm"
        out.append(Pass(label, centre, normal, (0.0, 0.0, -1.0), STEPDOWN_MM, FEED_WALL_MM_S))
    return out


def _arc(end: Array, tangent: Array, normal: Array) -> Array:
    """Points (4, 3) [mm] of a quarter circle that leaves the surface at `end`, the tangent first, then the normal."""
    turn = np.radians([22.5, 45.0, 67.5, 90.0])[:, None]
    return np.asarray(end + LEAD_RADIUS_MM * (np.sin(turn) * tangent + (1.0 - np.cos(turn)) * normal))


def link(passes: list[Pass], axis: Callable[[str, Array], Array], radius_mm: float) -> CutterPath:
    """One path: for each pass plunge, lead-in arc, run-in, pass, run-out, lead-out arc, retract, air move high up.

    axis(name, centre (n, 3) [mm]) gives the tool axis (n, 3) of a pass at each of its centres.
    """
    columns: dict[str, list[Array]] = {field.name: [] for field in fields(CutterPath)[:-2]}
    for index, item in enumerate(passes):
        start, end = unit(item.centre[0] - item.centre[1]), unit(item.centre[-1] - item.centre[-2])
        ext = np.arange(EXTENSION_MM, 0.0, -2.0)[:, None]
        run_in, run_out = item.centre[0] + ext * start, item.centre[-1] + ext[::-1] * end
        lead_in = _arc(run_in[0], start, item.normal[0])[::-1]
        lead_out = _arc(run_out[-1], end, item.normal[-1])
        approach = lead_in[[0, 0]]
        approach[:, 2] = [SAFE_MM, lead_in[0, 2] + 5.0]
        retract = lead_out[-1:].copy()
        retract[:, 2] = SAFE_MM
        core = np.concatenate([run_in, item.centre, run_out])
        centre = np.concatenate([approach, lead_in, core, lead_out, retract])
        first, last = 6, 6 + len(core)
        normal = np.concatenate([np.repeat(item.normal[:1], first + len(run_in), axis=0), item.normal,
                                 np.repeat(item.normal[-1:], len(run_out) + 5, axis=0)])
        tangent = unit(np.gradient(core, axis=0))
        tangent = np.concatenate([np.repeat(tangent[:1], first, axis=0), tangent, np.repeat(tangent[-1:], 5, axis=0)])
        side = unit(np.cross(normal, tangent))
        side *= np.where(side @ np.array(item.towards) < 0.0, -1.0, 1.0)[:, None]
        count = len(centre)
        cutting, rapid = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        cutting[first + 1:last] = True                      # the move to the first point of the run-in ends the lead-in
        rapid[[0, 1, -1]] = True
        tool_axis = axis(item.name, centre)
        feed = np.where(rapid, FEED_RAPID_MM_S, np.where(cutting, item.feed_mm_s, FEED_LEAD_MM_S))
        values = (centre - radius_mm * tool_axis, tool_axis, feed, cutting, rapid, np.full(count, index), normal, side,
                  np.full(count, item.step_mm))
        for column, value in zip(columns.values(), values, strict=True):
            column.append(np.asarray(value))
    joined: dict[str, Any] = {name: np.concatenate(parts) for name, parts in columns.items()}
    return CutterPath(**joined, passes=tuple(item.name for item in passes), radius_mm=radius_mm)


def sample_axis(name: str, centre_mm: Array) -> Array:
    """Tool axis (n, 3) of the sample at centres (n, 3) [mm]: a smooth field, so the robot turns slowly.

    Top: leaning 1 to 7 deg towards +x (the tip, which has no cutting speed, stays clear) and up to 2.5 deg along y.
    Wall: leaning up to 4.5 deg into the pocket, so that the shank stays clear of a wall with 5 deg of draft.
    """
    x, y = centre_mm[:, 0], centre_mm[:, 1]
    if name.startswith("wall"):
        depth = np.maximum(y, 0.0)
        lean_x = -4.5 * (x - part.MOUTH_X_MM) / np.hypot(x - part.MOUTH_X_MM, 20.0)
        lean_y = -4.5 * depth**2 / (depth**2 + 35.0**2)
    else:
        lean_x = 4.0 + 3.0 * np.sin(2.0 * np.pi * x / part.LENGTH_MM)
        lean_y = 2.5 * np.cos(np.pi * y / part.WIDTH_MM)
    return unit(np.column_stack([np.tan(np.radians(lean_x)), np.tan(np.radians(lean_y)), np.ones(len(x))]))


def sample_path(triangles: Array | None = None) -> CutterPath:
    """The sample's path over the sample's part: semi-finishing of the top, then of the pocket's wall."""
    if triangles is None:
        triangles = part.mesh()
    low, high = triangles.min(axis=1), triangles.max(axis=1)            # below: the pocket's surroundings
    near = (low[:, 0] < 175.0) & (high[:, 0] > 65.0) & (low[:, 1] < 75.0) & (high[:, 2] > 1.0)

    def in_pocket(x: Array, y: Array) -> NDArray[np.bool_]:
        return (y > 0.0) & (part.outline_distance_mm(x, y) < part.FILLET_MM)

    y = np.arange(0.5 * STEPOVER_MM, part.WIDTH_MM, STEPOVER_MM)
    top = parallel_passes(surface(triangles), (0.0, part.LENGTH_MM), y, lowest_tip_mm=part.FLOOR_MM + 8.0)
    wall = wall_passes(surface(triangles[near]), WATERLINES_MM, in_pocket)
    return link(top + wall, sample_axis, CUTTER_RADIUS_MM)


def tool_quaternion(tool_axis: ArrayLike, x_direction: ArrayLike = (1.0, 0.0, 0.0)) -> Array:
    """Quaternions (n, 4) w x y z, w >= 0, of a tool whose z points against the tool axis, into the part (as in RAPID).

    The tool's x lies in the plane of `x_direction` (3,) or (n, 3) and z, as near to that direction as it can be.
    """
    z = -unit(np.atleast_2d(np.asarray(tool_axis, dtype=float)))
    x = np.broadcast_to(np.asarray(x_direction, dtype=float), z.shape)
    x = unit(x - np.sum(x * z, axis=1, keepdims=True) * z)
    rotation = np.stack([x, np.cross(z, x), z], axis=2)     # columns: the tool's axes in the work object
    trace = np.trace(rotation, axis1=1, axis2=2)
    diagonal = np.diagonal(rotation, axis1=1, axis2=2)
    # q q^T from the matrix: row k is q times its k-th component; the row with the largest diagonal is well conditioned
    outer = np.empty((len(z), 4, 4))
    outer[:, 0, 0] = 1.0 + trace
    outer[:, 1:, 1:] = rotation + np.swapaxes(rotation, 1, 2)
    k = np.arange(3)
    outer[:, k + 1, k + 1] = 1.0 + 2.0 * diagonal - trace[:, None]
    for a, b, c in ((1, 2, 0), (2, 0, 1), (0, 1, 2)):       # w times component c: half the skew part
        outer[:, 0, c + 1] = outer[:, c + 1, 0] = rotation[:, b, a] - rotation[:, a, b]
    best = np.argmax(np.diagonal(outer, axis1=1, axis2=2), axis=1)
    q = outer[np.arange(len(z)), best]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return np.asarray(q * np.where(q[:, :1] < 0.0, -1.0, 1.0))
