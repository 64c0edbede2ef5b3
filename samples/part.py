"""The sample part: an aluminium mould insert, 240 x 160 x 40 mm, as a closed triangle mesh.

A block with a gently doubly curved top and a pocket that is open towards y = 0: rounded corners, a wall with draft
and a fillet to the flat floor. Made up for the sample. Lengths in mm in the work object: origin at the lower front
left corner of the block, z up.

The mesh is built on rays from the middle of the pocket's mouth: contour, wall, floor and top share the same columns,
so that the surface is closed by construction (every edge in exactly two triangles).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

LENGTH_MM, WIDTH_MM = 240.0, 160.0
FLOOR_MM = 18.0                     # height of the pocket's floor
MOUTH_X_MM = 120.0                  # the pocket is symmetric about this x
FLOOR_HALF_WIDTH_MM, FLOOR_DEPTH_MM, FLOOR_CORNER_MM = 36.0, 56.0, 16.0     # outline of the flat floor
FILLET_MM = 10.0
DRAFT_DEG = 5.0

_FILLET_STEPS, _RINGS = 12, 26
_CORNER_STEP_DEG, _LEG_STEP_MM = 3.0, 2.0


def top_height_mm(x_mm: ArrayLike, y_mm: ArrayLike) -> Array:
    """Height of the freeform top [mm] above the part's base at x, y [mm]; smallest radius of curvature about 500 mm."""
    x, y = np.asarray(x_mm, dtype=float), np.asarray(y_mm, dtype=float)
    dome = 4.0 * np.cos(2.0 * np.pi * (x - 70.0) / 340.0) * np.cos(np.pi * (y - 70.0) / 280.0)
    return np.asarray(35.0 + dome + 1.2 * np.sin(2.0 * np.pi * (x + y) / 310.0), dtype=float)


def allowance_mm(x_mm: ArrayLike, y_mm: ArrayLike) -> Array:
    """Stock left by roughing, along the surface normal [mm], at x, y [mm]: smooth, 0.3 to 1.5 mm."""
    x, y = np.asarray(x_mm, dtype=float), np.asarray(y_mm, dtype=float)
    wave = np.sin(2.0 * np.pi * x / 170.0 + 0.4) * np.cos(2.0 * np.pi * y / 230.0 - 0.9)
    return np.asarray(0.9 + 0.6 * wave, dtype=float)


def outline_distance_mm(x_mm: ArrayLike, y_mm: ArrayLike) -> Array:
    """Signed distance [mm] in plan to the outline of the pocket's flat floor, positive outside the floor (y > 0)."""
    x, y = np.asarray(x_mm, dtype=float), np.asarray(y_mm, dtype=float)
    side = np.abs(x - MOUTH_X_MM) - (FLOOR_HALF_WIDTH_MM - FLOOR_CORNER_MM)
    back = y - (FLOOR_DEPTH_MM - FLOOR_CORNER_MM)
    corner = np.hypot(np.maximum(side, 0.0), np.maximum(back, 0.0))
    return np.asarray(corner + np.minimum(np.maximum(side, back), 0.0) - FLOOR_CORNER_MM, dtype=float)


def wall_offset_mm(height_mm: ArrayLike) -> Array:
    """Distance in plan [mm] of the pocket's wall from the floor's outline at a height above the floor [mm]."""
    height = np.asarray(height_mm, dtype=float)
    turn = np.radians(90.0 - DRAFT_DEG)
    blend = FILLET_MM * (1.0 - np.cos(turn))
    angle = np.arccos(1.0 - np.clip(height, 0.0, blend) / FILLET_MM)
    return np.asarray(FILLET_MM * np.sin(angle) + np.maximum(height - blend, 0.0) * np.tan(np.radians(DRAFT_DEG)))


def is_stock(x_mm: ArrayLike, y_mm: ArrayLike, z_mm: ArrayLike) -> NDArray[np.bool_]:
    """True where a point [mm] lies in the block's plan and not in the pocket as roughed; heights are not judged.

    Roughing left `allowance_mm` on the pocket's wall; what lies above the top is for the caller's depth of cut.
    """
    x, y, z = (np.asarray(a, dtype=float) for a in (x_mm, y_mm, z_mm))
    in_block = (x >= 0.0) & (x <= LENGTH_MM) & (y >= 0.0) & (y <= WIDTH_MM)
    return in_block & (outline_distance_mm(x, y) >= wall_offset_mm(z - FLOOR_MM) - allowance_mm(x, y))


def _floor_outline() -> tuple[Array, Array]:
    """Points (K, 2) and outward normals (K, 2) of the floor's outline, from (+x, y = 0) round to (-x, y = 0)."""
    w, d, r = FLOOR_HALF_WIDTH_MM, FLOOR_DEPTH_MM, FLOOR_CORNER_MM
    leg = np.linspace(0.0, d - r, round((d - r) / _LEG_STEP_MM) + 1)
    back = np.linspace(w - r, -(w - r), round(2.0 * (w - r) / _LEG_STEP_MM) + 1)
    turn = np.radians(np.arange(_CORNER_STEP_DEG, 90.0, _CORNER_STEP_DEG))
    right = np.column_stack([w - r + r * np.cos(turn), d - r + r * np.sin(turn)])
    left = right[::-1] * [-1.0, 1.0]
    points = np.concatenate([
        np.column_stack([np.full(leg.size, w), leg]), right, np.column_stack([back, np.full(back.size, d)]), left,
        np.column_stack([np.full(leg.size, -w), leg[::-1]])])
    along = np.column_stack([np.cos(turn), np.sin(turn)])
    normals = np.concatenate([
        np.tile([1.0, 0.0], (leg.size, 1)), along, np.tile([0.0, 1.0], (back.size, 1)), along[::-1] * [-1.0, 1.0],
        np.tile([-1.0, 0.0], (leg.size, 1))])
    return points + np.array([MOUTH_X_MM, 0.0]), normals


def _edge_height_mm(points: Array, normals: Array) -> Array:
    """Height above the floor [mm] at which the wall that starts at each outline point meets the top (fixed point)."""
    height = np.full(len(points), 18.0)
    for _ in range(30):                                     # contracts by slope times tan(draft), below 0.01 a step
        plan = points + wall_offset_mm(height)[:, None] * normals
        height = top_height_mm(plan[:, 0], plan[:, 1]) - FLOOR_MM
    return height


def _block_outline(edge: Array) -> Array:
    """Points (K, 2) of the block's outline, seen from the pocket's mouth behind `edge` (K, 2), corners included."""
    ray = edge - [MOUTH_X_MM, 0.0]
    with np.errstate(divide="ignore"):
        reach = np.minimum(0.5 * LENGTH_MM / np.abs(ray[:, 0]), WIDTH_MM / np.abs(ray[:, 1]))
    outline = np.array([MOUTH_X_MM, 0.0]) + reach[:, None] * ray
    outline = np.clip(outline, 0.0, [LENGTH_MM, WIDTH_MM])                    # no -1e-14
    for corner in ([LENGTH_MM, WIDTH_MM], [0.0, WIDTH_MM]):
        outline[np.argmin(np.linalg.norm(outline - corner, axis=1))] = corner
    return outline


def _strip(first: NDArray[np.intp], second: NDArray[np.intp]) -> NDArray[np.intp]:
    """Two triangles for each pair of neighbours on two rows of vertices with equally many columns."""
    a, b, c, d = first[:-1], first[1:], second[1:], second[:-1]
    return np.concatenate([np.column_stack([a, d, c]), np.column_stack([a, c, b])])


def _fan(tip: int, row: NDArray[np.intp]) -> NDArray[np.intp]:
    return np.column_stack([np.full(row.size - 1, tip), row[:-1], row[1:]])


def mesh() -> Array:
    """Triangles (T, 3, 3) [mm] of the part, closed, outward normals, deterministic."""
    points, normals = _floor_outline()
    height = _edge_height_mm(points, normals)
    angle = np.radians(np.linspace(0.0, 90.0 - DRAFT_DEG, _FILLET_STEPS + 1))
    rise = FILLET_MM * (1.0 - np.cos(angle))
    rows = [np.column_stack([points + wall_offset_mm(h) * normals, np.full(len(points), FLOOR_MM + h)]) for h in rise]
    edge = points + wall_offset_mm(height)[:, None] * normals
    outline = _block_outline(edge)
    for t in np.linspace(0.0, 1.0, _RINGS + 1):
        plan = (1.0 - t) * edge + t * outline
        rows.append(np.column_stack([plan, top_height_mm(plan[:, 0], plan[:, 1])]))
    rows.append(np.column_stack([outline, np.zeros(len(outline))]))
    columns = len(points)
    vertices = np.concatenate([*rows, [[MOUTH_X_MM, 0.0, FLOOR_MM], [MOUTH_X_MM, 0.0, 0.0]]])
    index = np.arange(len(rows) * columns).reshape(len(rows), columns)
    mouth, mouth_below = len(vertices) - 2, len(vertices) - 1
    faces = [_strip(lower, upper) for lower, upper in pairwise(index)]
    faces += [_fan(mouth, index[0]), _fan(mouth_below, index[-1][::-1])]
    # front face y = 0, each half a fan from the block's lower corner, which sees all of it
    for column, turn in ((0, 1), (columns - 1, -1)):
        half = np.concatenate([[mouth_below, mouth], index[:-1, column]])
        faces.append(_fan(int(index[-1, column]), half[::-turn]))
    return np.asarray(vertices[np.concatenate(faces)], dtype=float)


def volume_mm3(triangles: ArrayLike) -> float:
    """Volume [mm^3] enclosed by triangles (T, 3, 3) [mm]; positive for outward normals (divergence theorem)."""
    a, b, c = np.moveaxis(np.asarray(triangles, dtype=float), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def stl_bytes(triangles: ArrayLike, title: str = "compstiff sample part [mm]") -> bytes:
    """Binary STL of triangles (T, 3, 3) [mm]: 80 bytes of title, count, normal and corners as float32."""
    corners = np.asarray(triangles, dtype=float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    record = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["normal"], record["corners"] = normal, corners
    return title.encode("ascii")[:80].ljust(80) + len(corners).to_bytes(4, "little") + record.tobytes()


def read_stl(data: bytes) -> Array:
    """Triangles (T, 3, 3) [mm] of a binary STL as `stl_bytes` writes it."""
    count = int(np.frombuffer(data, "<u4", 1, 80)[0])
    if len(data) != 84 + 50 * count:
        raise ValueError(f"a binary STL of {count} triangles has {84 + 50 * count} bytes; received {len(data)}")
    record = np.frombuffer(data, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")], count, 84)
    return np.asarray(record["corners"], dtype=float)
