"""What the moves of a toolpath say of how it begins and ends, of rows that stand there twice or were mistyped, and of what it
is posted with."""

from __future__ import annotations

import numpy as np

from compensator.posting.campath import CamPath
from compensator.posting.settings import PostingSettings
from identification.common.arrays import Array
from identification.common.findings import Finding, counted

# Under so many targets nothing is said; a target in the cut is lower than the moves in the air by this [m]; a cut that goes out
# and back by so many middling steps, over more than this turn, is a slip where it is rare (engineering judgement).
FEWEST, BELOW = 20, 1e-3
OUT_AND_BACK, BACK, RARE = 3.0, -0.7, 2
# A zone that leaves the path by more than this [m] is not one for milling.
ROUND = 2.5e-4


def said_of_moves(cam_path: CamPath, up: Array, settings: PostingSettings) -> list[Finding]:
    """Warnings: it begins or ends in the cut (CS4317), stands in the file twice (CS4318), a single target out of line (CS4319),
    air moves slower than the cuts (CS4323), zones that cut corners away (CS4324). up (N, 3): unit vectors to the spindle."""
    slow = _slow(cam_path, settings) + _rounded(cam_path, settings)
    if len(cam_path) < FEWEST:
        return slow
    return [*_ends(cam_path, up), *_twice(cam_path), *_out_of_line(cam_path), *slow]


def _ends(cam_path: CamPath, up: Array) -> list[Finding]:
    rapid = cam_path.rapid
    if not rapid.any() or rapid.all():
        return []
    findings = []
    for at, what in ((0, "begins: the first move, MoveJ, goes there from wherever the robot stands"),
                     (len(rapid) - 1, "ends, and the tool is left there")):
        height = cam_path.position @ up[at]
        if not rapid[at] and height[at] < height[rapid].min() - BELOW:
            below = 1e3 * (height[rapid].min() - height[at])
            findings.append(Finding(
                "CS4317", "warning", f"a cut {below:.3g} mm below all moves in the air is where the program {what}",
                file=cam_path.source, line=int(cam_path.line[at]),
                hint="were rows lost? Approach and retract belong to the program"))
    return findings


def _twice(cam_path: CamPath) -> list[Finding]:
    half, odd = divmod(len(cam_path), 2)
    position = cam_path.position
    if odd or not np.array_equal(position[:half], position[half:]):
        return []
    return [Finding("CS4318", "warning", f"the {half} targets of the first half come again in the second, all of them: the "
                    "part is milled twice", file=cam_path.source, line=int(cam_path.line[half]),
                    hint="were the rows pasted twice? A spring pass repeats its last cuts, not the approach too")]


def _out_of_line(cam_path: CamPath) -> list[Finding]:
    cut, step = ~cam_path.rapid, np.diff(cam_path.position, axis=0)
    length = np.linalg.norm(step, axis=1)
    between = cut[:-2] & cut[1:-1] & cut[2:]
    if between.sum() < FEWEST:
        return []
    usual = float(np.median(length[np.append(between, False)]))
    turned = np.einsum("ni,ni->n", step[:-1], step[1:]) < BACK * length[:-1] * length[1:]
    lone = np.flatnonzero(between & turned & (np.minimum(length[:-1], length[1:]) > OUT_AND_BACK * max(usual, 1e-9))) + 1
    if not 0 < len(lone) <= RARE:
        return []
    at = int(lone[0])
    off, apart = min(length[at - 1], length[at]), np.linalg.norm(cam_path.position[at + 1] - cam_path.position[at - 1])
    return [Finding("CS4319", "warning", f"target {at} stands {1e3 * off:.3g} mm off both its neighbours, which are "
                    f"{1e3 * apart:.3g} mm apart; steps are {1e3 * usual:.3g} mm, in the middle",
                    file=cam_path.source, line=int(cam_path.line[at]),
                    hint="a digit or a sign too many? Right where the tool goes into a slit and back")]


def _slow(cam_path: CamPath, settings: PostingSettings) -> list[Finding]:
    feed = 1e3 * cam_path.feed[~cam_path.rapid & (cam_path.feed > 0)]
    if not len(feed) or not cam_path.rapid.any() or settings.rapid_mm_s >= np.median(feed):
        return []
    return [Finding("CS4323", "warning", f"moves in the air at {settings.rapid_mm_s:g} mm/s are slower than the cuts, "
                    f"{np.median(feed):.3g} mm/s in the middle", file=cam_path.source,
                    hint="--rapid-mm-s is millimetres a second; are the feeds millimetres a minute?")]


def _rounded(cam_path: CamPath, settings: PostingSettings) -> list[Finding]:
    """Zones are parabolas, of half the way to the neighbour at most: the corner is missed by half the zone's radius times the
    sine of half the turn."""
    step = np.diff(cam_path.position, axis=0)
    length = np.linalg.norm(step, axis=1)
    way = step / np.maximum(length, 1e-12)[:, None]
    half_sine = np.sqrt(np.clip((1 - np.einsum("ni,ni->n", way[:-1], way[1:])) / 2, 0, 1))
    radius = np.minimum(1e-3 * settings.zone_mm, np.minimum(length[:-1], length[1:]) / 2)
    inside = ~cam_path.rapid[1:-1] & ~cam_path.rapid[2:] & ~cam_path.stop[1:-1]
    miss = np.where(inside, radius * half_sine / 2, 0.0)
    wide = np.flatnonzero(miss > ROUND)
    if not len(wide):
        return []
    worst = int(np.argmax(miss)) + 1
    return [Finding("CS4324", "warning", f"zones of {settings.zone_mm:g} mm cut off {counted(len(wide), 'corner')} of the cut, "
                    f"the worst by {1e3 * miss.max():.2g} mm", file=cam_path.source, line=int(cam_path.line[worst]),
                    hint="--zone-mm is the size of the corner that is driven round: a few tenths for milling")]
