"""Reads what a program starts from: stock.yaml, or what an earlier program left (docs/cutting.md#stock); writes what it
leaves."""

from __future__ import annotations

import io
import tokenize
import zipfile
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from compensator.cutting.sections import solid_stock
from compensator.cutting.solid import Solid, read_solid
from compensator.cutting.stock import Stock, box_stock, check_size, layers_for, made_of, relayered
from identification.common.arrays import Array
from identification.common.findings import error, one_line
from identification.common.yaml_source import NotNegative, Strict, Triple, read_yaml

FORMAT, VERSION = "compstiff-stock", 1
# Points of the grid [m] where nothing is stated; the error at an edge is c^2 / 8R.
RESOLUTION = 0.2e-3
# Layers of a stock that is cut at many levels [m].
THICKNESS = 0.1e-3
# Where a blank stands that nobody measured, 1 sigma [m]; engineering judgement.
POSITION_STD = 0.1e-3
# Of the coordinates in an STL, which says none [m].
UNITS = {"mm": 1e-3, "inch": 25.4e-3}
# What NumPy raises of a file that is no archive of arrays, or one with a byte that is wrong.
DAMAGED = (ValueError, TypeError, EOFError, KeyError, RuntimeError, zipfile.BadZipFile, zlib.error, tokenize.TokenError)
ARRAYS = ("origin_mm", "cell_mm", "height_mm", "inside_mm", "unknown_mm", "position_std_mm")


class BoxFile(Strict):
    """Two corners of a box, work object."""

    from_mm: Triple
    to_mm: Triple


class StockFile(Strict):
    """stock.yaml: a box, an STL with its units, or the file that an earlier program left."""

    box: BoxFile | None = None
    stl: str | None = None
    units: Literal["mm", "inch"] | None = None
    left_by: str | None = None
    resolution_mm: Annotated[float, Field(ge=0.02, le=5)] | None = None
    position_std_mm: Annotated[NotNegative, Field(le=10)] | None = None
    unknown: tuple[BoxFile, ...] = ()


@dataclass(frozen=True, eq=False)
class Blank:
    """What a program starts from, before its layers are chosen: a box, low and high (3,) [m], a solid, or a stock as it was
    left; unknown (K, 2, 3) [m]; cell [m]; position_std [m], stated: the file says so."""

    source: Path
    corners: Array | None
    solid: Solid | None
    left: Stock | None
    unknown: Array
    cell: float
    position_std: float
    stated: bool

    @property
    def bounds(self) -> Array:
        """Least and greatest coordinates (2, 3) [m] of what may be material."""
        if self.left is not None:
            size = self.left.cell * (np.array(self.left.inside.shape[:0:-1]) - 1)
            low = np.append(self.left.origin, self.left.height[0])
            return np.stack([low, np.append(self.left.origin + size, self.left.height[-1])])
        found = self.corners if self.solid is None else self.solid.bounds
        assert found is not None
        return found

    def stock(self, tips: Array, corner: float) -> Stock:
        """In layers for a program whose tip comes to the heights `tips` (n,) [m] with a cutter of this corner radius [m]. A new
        one each time. Raises CompstiffError (CS4704): too large."""
        if self.left is not None:
            low, high = float(self.left.height[0]), float(self.left.height[-1])
            own = self.left.height
            wanted = np.unique(np.concatenate([own, layers_for(low, high, tips, corner, THICKNESS)]))
            close = np.insert(np.diff(wanted) > 1e-7, 0, True)
            made = relayered(self.left, wanted[close])
        elif self.solid is not None:
            low3, high3 = self.solid.bounds
            few = layers_for(float(low3[2]), float(high3[2]), tips, corner, THICKNESS)
            points = int(np.prod(np.ceil((high3 - low3)[:2] / self.cell) + 5))
            lowest = float(tips.min()) if len(tips) else float(low3[2])
            made = solid_stock(self.solid, self.solid.heights(few, lowest, THICKNESS, points), self.cell)
        else:
            assert self.corners is not None
            low3, high3 = self.corners
            made = box_stock(low3, high3, layers_for(float(low3[2]), float(high3[2]), tips, corner, THICKNESS), self.cell)
        return replace(made, unknown=self.unknown, position_std=self.position_std)


def read_stock(file: str | Path) -> Blank:
    """Reads stock.yaml or a stock as `--leaves` wrote it (.npz).

    Raises CompstiffError: CS0005, CS0101 and CS0102 (content, with line and column), CS4704 too large, CS4705 not such a file,
    and what `read_solid` raises.
    """
    file = Path(file)
    if file.suffix.lower() == ".npz":
        left = read_npz(file)
        return Blank(file, None, None, left, left.unknown, left.cell, left.position_std, True)
    described = read_yaml(file, StockFile)
    named = [key for key in ("box", "stl", "left_by") if getattr(described, key) is not None]
    if len(named) != 1:
        raise error("CS0102", f"names {' and '.join(named) or 'none'} of box, stl and left_by, expected one", file=str(file),
                    hint="box: {from_mm: [x, y, z], to_mm: [x, y, z]}, stl: blank.stl with units: mm, or left_by: what "
                    "--leaves of the earlier program wrote")
    if (described.stl is None) != (described.units is None):
        raise error("CS0102", "an STL says nothing of its units: stl and units go together", file=str(file),
                    hint="units: mm, or units: inch")
    unknown = _corners(described.unknown, file, "unknown")
    std, stated = described.position_std_mm, described.position_std_mm is not None
    if described.left_by is not None:
        if described.resolution_mm is not None:
            raise error("CS0102", "resolution_mm is stated, and a stock that was left has its own", file=str(file),
                        hint="leave it out")
        left = read_npz(file.parent / described.left_by)
        return Blank(file, None, None, left, np.concatenate([left.unknown, unknown]), left.cell,
                     left.position_std if std is None else 1e-3 * std, True)
    cell = RESOLUTION if described.resolution_mm is None else 1e-3 * described.resolution_mm
    solid = None if described.stl is None or described.units is None else read_solid(
        file.parent / described.stl, UNITS[described.units])
    box = None if described.box is None else _corners((described.box,), file, "box")[0]
    corners = box if solid is None else solid.bounds
    assert corners is not None
    with made_of(file):
        check_size(1, *(int(np.ceil(size / cell)) + 5 for size in (corners[1] - corners[0])[1::-1]))
    return Blank(file, box, solid, None, unknown, cell, POSITION_STD if std is None else 1e-3 * std, stated)


def named_by(file: Path) -> tuple[Path, ...]:
    """The files that a stock file names beside itself: an STL, or what an earlier program left. Raises what `read_yaml`
    raises."""
    if file.suffix.lower() == ".npz":
        return ()
    described = read_yaml(file, StockFile)
    return tuple(file.parent / name for name in (described.stl, described.left_by) if name is not None)


def _corners(boxes: tuple[BoxFile, ...], file: Path, key: str) -> Array:
    """(K, 2, 3) [m]. Raises CompstiffError (CS0102) for one without a volume."""
    corners = 1e-3 * np.array([(box.from_mm, box.to_mm) for box in boxes]).reshape(-1, 2, 3)
    if (corners[:, 1] <= corners[:, 0]).any():
        raise error("CS0102", f"{key}: to_mm must be greater than from_mm in x, y and z", file=str(file),
                    hint="two corners of a box in the work object, the least coordinates first")
    return np.asarray(corners)


def stock_npz(stock: Stock) -> bytes:
    """The file of a stock: arrays by the names of ARRAYS, millimetres, work object."""
    content = io.BytesIO()
    np.savez_compressed(
        content, format=np.array(FORMAT), version=np.array(VERSION), origin_mm=1e3 * stock.origin,
        cell_mm=np.array(1e3 * stock.cell), height_mm=1e3 * stock.height, inside_mm=1e3 * stock.inside,
        unknown_mm=1e3 * stock.unknown, position_std_mm=np.array(1e3 * stock.position_std))
    return content.getvalue()


def read_npz(file: Path) -> Stock:
    """Reads a stock. Raises CompstiffError: CS0005, CS4704, CS4705."""
    name = str(file)
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            found = {key: content[key] for key in content.files if key in (*ARRAYS, "format", "version")}
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror or reason}", file=name) from reason
    except DAMAGED as reason:
        raise error("CS4705", f"is no stock, or damaged: {one_line(str(reason))}", file=name,
                    hint="name the file that --leaves wrote") from reason
    if str(found.get("format")) != FORMAT or str(found.get("version")) != str(VERSION) or any(
            key not in found or found[key].dtype.kind != "f" for key in ARRAYS):
        missing = [key for key in ("format", "version", *ARRAYS) if key not in found]
        raise error("CS4705", f"is no stock of version {VERSION}" + (f": {', '.join(missing)} missing" if missing else ""),
                    file=name, hint="name the file that --leaves wrote")
    inside, height = found["inside_mm"], np.atleast_1d(found["height_mm"])
    whole = (inside.ndim == 3 and height.shape == (len(inside) + 1,) and found["origin_mm"].shape == (2,)
             and min(inside.shape[1:]) >= 2 and found["cell_mm"].shape == () and found["unknown_mm"].shape[1:] == (2, 3)
             and found["position_std_mm"].shape == ())
    if not whole or not all(np.isfinite(found[key]).all() for key in ARRAYS) or not found["cell_mm"] > 0 or (
            np.diff(height) <= 0).any() or found["position_std_mm"] < 0:
        raise error("CS4705", f"its arrays do not fit together: inside_mm {inside.shape}, height_mm {height.shape}, origin_mm "
                    f"{found['origin_mm'].shape}", file=name, hint="(layers, ny, nx), (layers + 1,), (2,), heights ascending, "
                    "all finite")
    with made_of(file):
        check_size(*inside.shape)
    inside *= 1e-3
    return Stock(1e-3 * found["origin_mm"], 1e-3 * float(found["cell_mm"]), 1e-3 * height,
                 inside.astype(np.float32, copy=False), 1e-3 * found["unknown_mm"], 1e-3 * float(found["position_std_mm"]))
