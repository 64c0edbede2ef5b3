"""Cut: a program that goes through its stock: the engagement along its path, and what its mean forces weigh coefficients
with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.chips import SHEAR
from compensator.cutting.cutter import Cutter, cutter_of, said_of_cutter
from compensator.cutting.removal import Engagement, mill_through
from compensator.cutting.stock import Stock, made_of, more_layers
from compensator.cutting.stock_file import Blank, read_stock
from compensator.cutting.track import Track, in_object, refuse_other_objects, stock_object, track_of
from compensator.path.driven_path import DrivenPath, driven_path
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding, Refused, counted, error, verb

# Steps of a track are so long at most, and this share of the cutter's radius [m].
LONGEST, SHARE = 0.5e-3, 1 / 16
# A tool that yields, and a stock that stands aside, are further off than this nowhere [m].
MOST_ASIDE = 5e-3
# Steps of height in which a tool that yields has cut off its level [m].
YIELDED = 0.05e-3
# So many places that stay as they are are named.
NAMED = 5
# Steps that cut deeper than the edges are long by this are no rounding [m].
DEEPER = 1e-6
# Feeds a tooth, as parts of the cutter's diameter, and cutting speeds [m/s] beyond which no end mill is run: ten times what
# catalogues have for the finest and the coarsest (engineering judgement).
CHIPS, SPEEDS = (4e-4, 0.025), (0.05, 75.0)
# A move that goes through the stock at so many times the feed of the others is no cut.
FAST = 1.9
# Steps whose cut ends so near to the top of the stock reach it [m].
AT_THE_TOP = 0.1e-3
# A tool is lifted where so much of its way is upwards.
LIFTED = 0.9


@dataclass(frozen=True, eq=False)
class Cut:
    """A program under way: path, cutter, revolution [s] of the spindle, blank; track and engagement (S steps); left: the stock
    behind it."""

    path: RobotPath
    cutter: Cutter
    revolution: float
    blank: Blank
    track: Track
    engagement: Engagement
    left: Stock

    @cached_property
    def per_step(self) -> Array:
        """A (S, 3, 6): the mean force of a step [N], base frame, is A K; coefficients K in N/m^2 and N/m. Zero where it is not
        known."""
        scaled = self.engagement.weights.copy()
        scaled[:, :, SHEAR] *= self._chip[:, None, None]
        scaled[self.engagement.unknown] = 0.0
        return np.asarray(np.einsum("sij,sjk->sik", self._base_from_object, scaled))

    def change(self, coefficients: Array) -> Array:
        """What the mean forces of the steps (S, 3, 3) [N], base frame, change by where the tool stands aside, as `cut_of` was
        asked: columns are x, y and z of the work object. Coefficients (6,)."""
        engagement = self.engagement
        assert engagement.moved is not None
        own = np.broadcast_to(coefficients, (len(self.track), 6)).copy()
        own[:, SHEAR] *= self._chip[:, None]
        own[engagement.unknown] = 0.0
        here = np.einsum("sij,sj->si", engagement.weights, own)
        moved = np.stack([np.einsum("sij,sj->si", weights, own) - here for weights in engagement.moved], axis=2)
        return np.asarray(self._base_from_object @ moved)

    def by_top(self, coefficients: Array, step: float) -> Array:
        """What the mean forces of the targets (N, 3) change by for each metre that the top of the stock is higher [N/m], base
        frame: as with the tool so much deeper where the cut reaches it. Coefficients (6,); step [m]: as `cut_of` was asked."""
        tip = np.minimum(self.track.start[:, 2], self.track.end[:, 2])
        reaches = tip + self.engagement.depth >= self.blank.bounds[1, 2] - AT_THE_TOP
        return self.mean(np.where(reaches[:, None], -self.change(coefficients)[:, :, 2] / step, 0.0))

    @property
    def _chip(self) -> Array:
        return np.where(np.isfinite(self.track.chip), self.track.chip, 0.0)

    @property
    def _base_from_object(self) -> Array:
        return np.asarray(self.path.base_from_object.rotation[self.track.target])

    @cached_property
    def time(self) -> Array:
        """What the steps (S,) count in a mean: their time [s], for one feed in their length."""
        feed = self.path.toolpath.feed[self.track.move]
        usual = np.nanmedian(feed) if np.isfinite(feed).any() else 1.0
        return np.asarray(self.track.length / np.where(np.isfinite(feed) & (feed > 0), feed, usual))

    @cached_property
    def per_target(self) -> Array:
        """A (N, 3, 6) of the targets: the mean over half the way to its neighbours."""
        return self.mean(self.per_step)

    def mean(self, values: Array) -> Array:
        """Means (N, ...) over each target's stretch of values (S, ...) of the steps."""
        count = len(self.path.toolpath)
        total = np.maximum(np.bincount(self.track.target, self.time, minlength=count), 1e-300)
        flat = values.reshape(len(values), -1)
        summed = np.column_stack([np.bincount(self.track.target, self.time * column, minlength=count) for column in flat.T])
        return np.asarray((summed / total[:, None]).reshape(count, *values.shape[1:]))

    @cached_property
    def unknown(self) -> NDArray[np.bool_]:
        """Targets (N,) that cut somewhere in their stretch with a force that is not known."""
        return np.bincount(self.track.target[self.engagement.unknown], minlength=len(self.path.toolpath)) > 0

    @cached_property
    def cuts(self) -> NDArray[np.bool_]:
        """Targets (N,) that cut somewhere in their stretch."""
        return np.bincount(self.track.target[self.engagement.cuts], minlength=len(self.path.toolpath)) > 0

    def figures(self) -> dict[str, float | int]:
        """JSON values: lengths in mm."""
        cuts, time, chip = self.engagement.cuts, self.time, self.track.chip
        if not cuts.any():
            return {"cutting_targets": 0, "unknown_targets": int(self.unknown.sum())}
        weight = time[cuts] / time[cuts].sum()
        return {
            "cutting_targets": int(self.cuts.sum()), "unknown_targets": int(self.unknown.sum()),
            "depth_mm": 1e3 * float(weight @ self.engagement.depth[cuts]),
            "width_mm": 1e3 * float(weight @ self.engagement.width[cuts]),
            "feed_a_tooth_mm": 1e3 * float(np.nanmedian(chip[cuts])),
            "climb_share": float(weight @ (self.engagement.low[cuts] + self.engagement.high[cuts] < 0)),
        }

    def line(self) -> str:
        """For the terminal."""
        figures = self.figures()
        if not figures["cutting_targets"]:
            return "engagement: the program touches its stock nowhere"
        return (f"engagement: {figures['cutting_targets']} targets cut, on average {figures['depth_mm']:.2f} mm deep along the "
                f"axis and {figures['width_mm']:.2f} mm across the feed, {100 * figures['climb_share']:.0f} % climb, "
                f"{figures['feed_a_tooth_mm']:.3g} mm a tooth")

    def findings(self) -> list[Finding]:
        """What a user must know of it."""
        toolpath, found = self.path.toolpath, []
        source, stock = str(self.blank.source), self.left
        found.append(Finding("CS4706", "note", f"{self.cutter.words()}; stock {stock.words()}; {self.line()}", file=source))
        found += [*self._said_of_chips(), *self._said_of_fast_moves()]
        found += said_of_cutter(self.path.cell, toolpath.cutters)
        if not self.blank.stated:
            found.append(Finding("CS4707", "note", f"where the stock stands is taken to be known to "
                                 f"{1e3 * stock.position_std:g} mm, 1 sigma, in x, y and z", file=source,
                                 hint="state position_std_mm"))
        lost = np.flatnonzero(self.unknown)
        if len(lost):
            where = ", ".join(str(toolpath.line[target]) for target in lost[:NAMED])
            found.append(self.path.finding(
                int(lost[0]), "CS4708", "warning", f"the force of {counted(len(lost), 'target')} that may cut is not known and "
                f"stays out (lines {where}{' ...' if len(lost) > NAMED else ''}): joint moves, plunges (down by over 5 "
                "degrees, a bull-nose also up; a ball: down by over 60 on its tip), a tool that leans by over 1 degree (a "
                "ball: by over 60, or that cuts above its ball), no feed, a cut deeper than the edges are long "
                "(cutting.flute_mm), or a box that the stock file calls unknown",
                "they stay where they are; log a pass to correct them too"))
        if toolpath.ways:
            by = "by the values in the file" if toolpath.ways[0].stated else "as if all of them were driven"
            found.append(Finding("CS3123", "warning", "the text does not say which of the program's branches are driven: the "
                                 f"stock is taken away {by}", file=toolpath.source,
                                 hint="give their conditions a value in the file, such as CONST bool; or log a pass"))
        if not self.cuts.any():
            found.append(Finding("CS4709", "warning", "the program touches its stock nowhere", file=source,
                                 hint="is the stock in the program's work object, in millimetres?"))
        return found


    def _said_of_chips(self) -> list[Finding]:
        """A warning (CS4748) where cutter, teeth and the spindle's speed make a chip or a speed that no end mill has."""
        chip = self.track.chip[self.engagement.cuts]
        if not np.isfinite(chip).any():
            return []
        middle, speed = float(np.nanmedian(chip)), 2 * np.pi * self.cutter.radius / self.revolution
        part = middle / (2 * self.cutter.radius)
        if CHIPS[0] <= part <= CHIPS[1] and SPEEDS[0] <= speed <= SPEEDS[1]:
            return []
        return [Finding(
            "CS4748", "warning", f"a tooth takes {1e3 * middle:.3g} mm, {100 * part:.2g} % of the diameter, at "
            f"{60 * speed:.3g} m/min: end mills take {100 * CHIPS[0]:g} to {100 * CHIPS[1]:g} % at {60 * SPEEDS[0]:g} to "
            f"{60 * SPEEDS[1]:g} m/min",
            file=str(self.path.cell.source), hint="are spindle_rpm, cutting.teeth and cutting.tool_diameter_mm those of this "
            "program, and its feeds mm/s?")]

    def _said_of_fast_moves(self) -> list[Finding]:
        """A warning (CS4749) where moves go through the stock much faster than the program cuts; not of a tool that is lifted
        out of it, which springs back meanwhile."""
        feed, cuts = self.path.toolpath.feed, self.cuts
        known = cuts & np.isfinite(feed)
        if not known.any():
            return []
        own = self.path.toolpath.feed[self.track.move]
        with np.errstate(over="ignore", invalid="ignore"):      # absurd numbers in targets without force
            rise = np.einsum("ni,ni->n", self.path.steps, self.path.base_from_object.rotation[:, :, 2])
            lifted = rise > LIFTED * np.linalg.norm(self.path.steps, axis=1)
        fast = self.engagement.cuts & (own > FAST * float(np.median(feed[known]))) & ~lifted[self.track.move]
        moves = np.unique(self.track.move[fast])
        if not len(moves):
            return []
        return [self.path.finding(
            int(moves[0]), "CS4749", "warning", f"{counted(len(moves), 'move')} at {1e3 * float(feed[moves].max()):.4g} mm/s "
            f"{verb(len(moves), 'go')} through the stock, where the others cut at {1e3 * float(np.median(feed[known])):.4g}: "
            "moves of the air?",
            "where does the stock stand in the program's work object, and how high is it?")]


def cut_of(path: RobotPath, stock: str | Path | Blank, rpm: float | None, aside: Array | None = None, step: float = 0.0) -> Cut:
    """A program milled through its stock: a file, or one that was read. rpm: of the spindle; aside (N, 3) [m], base frame:
    where the tool stood off the plan; step [m]: also with all of it aside by so much (`change`).

    Raises Refused (CS4744): a file that turns the spindle counterclockwise. CompstiffError: what `cutter_of` raises, CS4702
    cuts in another work object, CS4703 no spindle speed, CS4715 an STL that lies away from the program, and what `read_stock`
    raises.
    """
    cell = path.cell
    turned = next((finding for finding in path.toolpath.findings if finding.code == "CS2116"), None)
    if turned is not None:
        raise Refused(Finding("CS4744", "error", "the spindle turns counterclockwise, and the force coefficients are those of "
                              "a cutter that turns clockwise", file=turned.file, line=turned.line,
                              hint="log a pass and correct by that alone (--forces, without --stock), or correct SPINDL in the "
                              "CAM system"))
    cutter = cutter_of(cell, path.toolpath.cutters)
    speed = rpm or cell.force_log.form.spindle_rpm
    if not speed:
        raise error("CS4703", "the chip's thickness needs the spindle's speed", file=str(cell.source),
                    hint="--spindle-rpm, or force_log.spindle_rpm in cell.yaml")
    blank = stock if isinstance(stock, Blank) else read_stock(stock)
    driven = driven_path(path)
    number = stock_object(path if driven is None else driven.run)
    path = in_object(path, number)
    off = None if aside is None else path.base_from_object.inverse().turn(aside)
    piece = min(LONGEST, SHARE * cutter.radius)
    ball = cutter.radius if cutter.ball else 0.0
    run = path if driven is None else in_object(driven.run, number)
    off = off if off is None or driven is None else off[driven.order]
    track = track_of(run, cutter.teeth, 60 / speed, piece, off, ball)
    _check_near(blank, track, cutter)
    planned = track if off is None else track_of(run, cutter.teeth, 60 / speed, piece, ball=ball)
    sideways = _sideways(planned, blank.bounds, cutter.radius + MOST_ASIDE)
    levels = _heights(planned, sideways)
    # Where the edges end within the stock a layer ends, too.
    ends = levels + cutter.flute
    with made_of(blank.source):
        made = blank.stock(np.concatenate([levels, ends[ends < blank.bounds[1, 2]]]), cutter.corner)
        if off is not None:
            made = more_layers(made, levels, _heights(track, sideways) - levels, YIELDED)
    engagement, left = mill_through(made, track, cutter, step)
    refuse_other_objects(run, number, track, engagement.cuts)
    if (track.start[:, 2] + cutter.flute < made.height[-1]).any():
        whole, _ = mill_through(made, track, replace(cutter, flute=np.inf))
        deeper = whole.depth > np.minimum(engagement.depth, cutter.flute) + DEEPER
        engagement = replace(engagement, unknown=engagement.unknown | deeper,
                             depth=np.where(deeper, whole.depth, engagement.depth))
    if driven is not None:
        track, engagement = _in_text(track, engagement, driven)
    return Cut(path, cutter, 60 / speed, blank, track, engagement, left)


def _in_text(track: Track, engagement: Engagement, driven: DrivenPath) -> tuple[Track, Engagement]:
    """Steps of the moves as driven by the targets and the path length of the text; of targets that are driven more than once
    those of the first time."""
    place, _ = driven.in_text(track.place)
    first = np.flatnonzero(driven.first[track.target])
    # Along the path of the text, which is what a log is placed on.
    steps = first[np.argsort(place[first], kind="stable")]
    return track.some(steps, place, driven.order), engagement.some(steps)


def _check_near(blank: Blank, track: Track, cutter: Cutter) -> None:
    """Raises CompstiffError (CS4715) for a blank from an STL that the program comes nowhere near."""
    if blank.solid is None or not len(track):
        return
    own = blank.bounds
    way = np.stack([np.minimum(track.start, track.end).min(axis=0), np.maximum(track.start, track.end).max(axis=0)])
    low, high = way[0, :2] - cutter.radius, way[1, :2] + cutter.radius
    if (low < own[1, :2]).all() and (high > own[0, :2]).all() and way[0, 2] < own[1, 2]:
        return
    words = ["; ".join(f"{axis} {1e3 * a:.4g} to {1e3 * b:.4g}" for axis, a, b in zip("xyz", *box, strict=True))
             for box in (own, way)]
    raise error("CS4715", f"the blank lies away from the program: it has {words[0]} mm, the program {words[1]} mm",
                file=str(blank.solid.source), hint="export it in the program's work object; are its `units` the stated ones?")


def _sideways(track: Track, bounds: Array, reach: float) -> NDArray[np.bool_]:
    """The steps (S,) on which the tip goes sideways within `reach` [m] of the stock's bounds (2, 3): what it does beside the
    stock cuts no layer."""
    way = (track.end - track.start)[:, :2]
    low, high = np.minimum(track.start, track.end)[:, :2], np.maximum(track.start, track.end)[:, :2]
    return np.asarray((np.hypot(*way.T) > 1e-9) & ((low < bounds[1, :2] + reach) & (high > bounds[0, :2] - reach)).all(axis=1))


def _heights(track: Track, steps: NDArray[np.bool_]) -> Array:
    """Of the tip (n,) [m] at the ends of these steps (S,)."""
    return np.concatenate([track.start[steps, 2], track.end[steps, 2]])
