"""What a user may choose of the posting of APT and CSV toolpaths, and of splitting a program."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PostingSettings:
    """zone_mm of every move, rapid_mm_s in the air, feed_mm_s where a table has none, tool_x the direction of the work object
    that the tool's x axis is turned towards, None to choose it. tool: of an APT file with several tools the one to post, by
    its number or name; None: there may be only one. split: most targets of a part, None to write one module; modules: a
    program of several modules is written as a file of each; split_load: parts are loaded one after the other. mark: the
    output that the written program switches at its targets, so that a force log shows when the robot was where; None: none."""

    zone_mm: float = 0.3
    rapid_mm_s: float = 200.0
    feed_mm_s: float = 20.0
    tool_x: tuple[float, float, float] | None = None
    tool: str | None = None
    split: int | None = None
    modules: bool = False
    split_load: bool = False
    mark: str | None = None
