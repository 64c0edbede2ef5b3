"""Solid: a blank from an STL file, refused unless it is one closed surface with material inside; cut at a height into edges."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compensator.cutting.stock import MOST_BYTES, MOST_LAYERS, SAME_LEVEL
from identification.common.arrays import Array, read_only
from identification.common.findings import CompstiffError, error

# A blank is smaller than this, and its least side larger than that [m]: others are files in other units.
LARGEST, LEAST = 10.0, 0.5e-3
# A face is level or upright where the vertical part of its normal is that near to 1 or 0.
STRAIGHT = 1e-6
# Levels of a part that layers end at; more are a curved surface.
MOST_FLATS = 64


@dataclass(frozen=True, eq=False)
class Solid:
    """corner (T, 3, 3) [m]: of its triangles; normal (T, 3): outward. Work object. source: the file."""

    source: Path
    corner: Array
    normal: Array

    def __post_init__(self) -> None:
        read_only(self.corner, self.normal)

    @property
    def bounds(self) -> Array:
        """Least and greatest coordinates (2, 3) [m]."""
        return np.stack([self.corner.min(axis=(0, 1)), self.corner.max(axis=(0, 1))])

    def heights(self, program: Array, lowest: float, thickness: float, points: int) -> Array:
        """Heights (L + 1,) [m] between layers: those that suit the program (P,), its level faces, and even ones of `thickness`
        [m] where above the lowest tip [m] a wall leans. points: of the grid; layers are as many as the memory may hold."""
        upright, low, high = np.abs(self.normal[:, 2]), *self.bounds[:, 2]
        flats = np.unique(np.round(self.corner[upright > 1 - STRAIGHT][:, 0, 2] / SAME_LEVEL)) * SAME_LEVEL
        leans = self.corner[(upright > STRAIGHT) & (upright <= 1 - STRAIGHT)][:, :, 2]
        edges = np.concatenate([program, flats[(flats > low) & (flats < high)] if len(flats) <= MOST_FLATS else []])
        if len(leans):
            may = max(int(min(MOST_LAYERS, MOST_BYTES / 2 / (4 * points))) - len(edges), 8)
            grid = np.linspace(low, high, int(np.clip(np.ceil((high - low) / thickness), 1, may)) + 1)
            # A piece between two heights leans where a face that leans begins below its top and ends above its foot.
            begin, end = np.sort(leans.min(axis=1)), np.sort(leans.max(axis=1))
            crossed = np.searchsorted(begin, grid[1:], side="left") > np.searchsorted(end, grid[:-1], side="right")
            kept = crossed & (grid[1:] > lowest)
            edges = np.concatenate([edges, grid[:-1][kept], grid[1:][kept]])
        edges = np.sort(edges)
        edges = edges[np.insert(np.diff(edges) > SAME_LEVEL, 0, True)]
        return edges if len(edges) <= MOST_LAYERS else np.linspace(low, high, MOST_LAYERS + 1)

    def edges_at(self, height: float) -> tuple[Array, Array]:
        """Its outline at a height [m]: straight edges (E, 2, 2) [m], and which way is out of the material (E, 2).

        A corner that stands at the height counts as above it, so that every outline is closed.
        """
        above = self.corner[:, :, 2] >= height
        cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
        corner, above = self.corner[cut], above[cut]
        # Of three corners one is alone on its side: both edges of the triangle that are cut begin there.
        alone = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)
        row = np.arange(len(cut))
        ends = []
        for other in (1, 2):
            a, b = corner[row, alone], corner[row, (alone + other) % 3]
            # From the lower to the upper end, whichever triangle asks: neighbours find the very same point.
            swap = (a[:, 2] > b[:, 2])[:, None]
            foot, head = np.where(swap, b, a), np.where(swap, a, b)
            share = ((height - foot[:, 2]) / (head[:, 2] - foot[:, 2]))[:, None]
            ends.append(foot[:, :2] + share * (head[:, :2] - foot[:, :2]))
        return np.stack(ends, axis=1), self.normal[cut, :2]


def read_solid(file: Path, unit: float) -> Solid:
    """Reads an STL, binary or ASCII, whose coordinates are in `unit` [m].

    Raises CompstiffError: CS0005, CS4712 no triangles, CS4713 not one closed surface with its normals out, CS4714 a size
    that no blank has.
    """
    import trimesh
    from trimesh.exchange.stl import load_stl

    name = str(file)
    try:
        with file.open("rb") as stream:
            found = load_stl(stream)
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror or reason}", file=name) from reason
    except Exception as reason:      # the package raises what its parsing meets
        raise error("CS4712", f"is no STL: {reason}", file=name, hint="binary or ASCII STL, whole") from reason
    if not len(found.get("faces", ())) or not len(found.get("vertices", ())):
        raise error("CS4712", "holds no triangles: empty, cut short, or no STL", file=name,
                    hint="export the blank as STL again")
    vertices = np.asarray(found["vertices"], dtype=float) * unit
    if not np.isfinite(vertices).all():
        raise error("CS4712", "holds coordinates that are no numbers", file=name, hint="export the blank as STL again")
    _check_size(np.ptp(vertices, axis=0), name)
    with np.errstate(all="ignore"):
        mesh = trimesh.Trimesh(vertices / unit, found["faces"], process=True)
        faces, points = np.asarray(mesh.faces), np.asarray(mesh.vertices)
        whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
        mesh = trimesh.Trimesh(points, faces[whole], process=False)
        if not mesh.is_watertight:
            raise _not_whole(name, "is not watertight: it has edges that belong to one triangle, or to more than two",
                             "mend it in CAM, or export the blank as a solid body")
        if not mesh.is_winding_consistent:
            raise _not_whole(name, "has triangles that face against their neighbours", "unify its normals in CAM")
        if mesh.volume <= 0:
            raise _not_whole(name, "is inside out: its normals point into the material", "flip its normals in CAM")
    corner = points[faces[whole]] * unit
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(normal, axis=1)
    return Solid(file, corner, normal / np.maximum(size, 1e-300)[:, None])


def _check_size(extent: Array, name: str) -> None:
    """Raises CompstiffError (CS4714)."""
    words = " x ".join(f"{1e3 * value:.4g}" for value in extent)
    if extent.max() > LARGEST:
        raise error("CS4714", f"the blank is {words} mm, expected at most {1e3 * LARGEST:g}", file=name,
                    hint="is it in the `units` that the stock file states? Export it in millimetres or inches")
    if extent.min() < LEAST:
        raise error("CS4714", f"the blank is {words} mm, expected at least {1e3 * LEAST:g} each way", file=name,
                    hint="a file in metres? Export it in millimetres or inches, and state `units`")


def _not_whole(name: str, message: str, hint: str) -> CompstiffError:
    return error("CS4713", message, file=name, hint=hint)
