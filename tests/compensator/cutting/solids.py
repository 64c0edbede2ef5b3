"""STL files that tests write triangle by triangle, and the mean force of a straight slot by summing over a fine edge."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

Predicate = Callable[[np.ndarray], np.ndarray]      # points (..., 3) [mm] -> inside or not


def prism(outline_mm: np.ndarray, low: float, high: float, shift_mm: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Triangles (T, 3, 3) of a convex outline (K, 2), counterclockwise, between two heights; its top moved aside by shift."""
    count = len(outline_mm)
    foot = np.column_stack([outline_mm, np.full(count, low)])
    top = np.column_stack([outline_mm + shift_mm, np.full(count, high)])
    faces = [[foot[0], foot[k + 1], foot[k]] for k in range(1, count - 1)]
    faces += [[top[0], top[k], top[k + 1]] for k in range(1, count - 1)]
    for a in range(count):
        b = (a + 1) % count
        faces += [[foot[a], foot[b], top[b]], [foot[a], top[b], top[a]]]
    return np.array(faces)


def box_faces(low: tuple[float, float, float], high: tuple[float, float, float]) -> np.ndarray:
    outline = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    return prism(outline, low[2], high[2])


def circle(radius: float, count: int = 720, turn: float = 0.3) -> np.ndarray:
    angle = 2 * np.pi * np.arange(count) / count + turn
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def tube(outer: np.ndarray, inner: np.ndarray, low: float, high: float) -> np.ndarray:
    """A casting with a hole through it: outlines (K, 2) of as many corners, both counterclockwise."""
    walls = []
    for outline, sense in ((outer, 1), (inner, -1)):
        count = len(outline)
        for a in range(count):
            b = (a + 1) % count
            p, q = (outline[a], outline[b]) if sense > 0 else (outline[b], outline[a])
            walls += [[[*p, low], [*q, low], [*q, high]], [[*p, low], [*q, high], [*p, high]]]
    for a in range(len(outer)):
        b = (a + 1) % len(outer)
        for height, sense in ((high, 1), (low, -1)):
            one = [[*outer[a], height], [*outer[b], height], [*inner[b], height]]
            two = [[*outer[a], height], [*inner[b], height], [*inner[a], height]]
            walls += [face[::sense] for face in (one, two)]
    return np.array(walls)


def binary(faces: np.ndarray) -> bytes:
    """The normals of the file are left zero, as some writers do: the order of the corners says which side is out."""
    rows = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")])
    rows["corner"] = faces
    return b"blank".ljust(80, b" ") + struct.pack("<I", len(faces)) + rows.tobytes()


def ascii_stl(faces: np.ndarray) -> bytes:
    lines = ["solid blank"]
    for face in faces:
        lines += [" facet normal 0 0 0", "  outer loop", *(f"   vertex {x:.6f} {y:.6f} {z:.6f}" for x, y, z in face),
                  "  endloop", " endfacet"]
    return ("\n".join([*lines, "endsolid blank"]) + "\n").encode()


def stock_of(folder: Path, content: bytes, more: str = "units: mm\n") -> Path:
    """stock.yaml beside its blank.stl."""
    (folder / "blank.stl").write_bytes(content)
    file = folder / "stock.yaml"
    file.write_text("stl: blank.stl\n" + more)
    return file


def summed_force(inside: Predicate, axis_mm: np.ndarray, heading: float, radius: float, teeth: int, high: float, chip: float,
                 shear: tuple[float, float, float], edge: tuple[float, float, float], turn_deg: float = 0.25,
                 rise_mm: float = 0.02) -> np.ndarray:
    """Mean force [N] on a flat cutter at axis_mm (3,), the tip, on its first way through a solid: the linear-edge law summed
    over steps of the half circle that faces the feed, and of height."""
    phi = np.radians(np.arange(-90 + 0.5 * turn_deg, 90, turn_deg))
    z = np.arange(axis_mm[2] + 0.5 * rise_mm, high, rise_mm)
    rim = np.empty((len(phi), len(z), 3))
    rim[..., 0] = (axis_mm[0] + radius * np.cos(heading + phi))[:, None]
    rim[..., 1] = (axis_mm[1] + radius * np.sin(heading + phi))[:, None]
    rim[..., 2] = z
    depth = rise_mm * inside(rim).sum(axis=1) * teeth / (2 * np.pi) * np.radians(turn_deg)
    h = chip * np.cos(phi)
    (kt, kr, ka), (et, er, ea) = shear, edge
    out = np.column_stack([np.cos(heading + phi), np.sin(heading + phi)])
    against = np.column_stack([-out[:, 1], out[:, 0]])
    flat = depth @ ((kt * h + et)[:, None] * against - (kr * h + er)[:, None] * out)
    return np.array([*flat, -float(depth @ (ka * h + ea))])
