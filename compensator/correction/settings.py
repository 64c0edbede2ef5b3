"""What a user may choose of one job, grouped by the room that uses it. Quantities are in SI, or have their unit in the name."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

from compensator.cutting.settings import CuttingSettings
from compensator.forces.settings import LogSettings
from compensator.learned.learned import Repeats
from compensator.posting.settings import PostingSettings


class Estimate(NamedTuple):
    """A number and its standard error, in one unit."""

    value: float
    std: float = 0.0


class Spacing(NamedTuple):
    """How near to each other targets may stand: length [m], and time [s] at the programmed feed."""

    length: float
    time: float = 0.0


EXACTLY_ONE = Estimate(1.0)
# No document of a controller says how near to each other fly-by points may stand: docs/formats.md says what there is.
CLOSEST = Spacing(0.25e-3, 6e-3)
# Where a ball mill enters the shipped sample the offset changes by 140 um/mm at most, in the sharp corners of the simulated
# milled part by up to 1000; a place that is 0.05 mm off then errs by 50 um.
SLOPE = 1.0


# Depth of cut across the feed [m] that is the middle of what is reckoned with where none is stated (cutting_prior.py).
DEPTH = 0.75e-3


@dataclass(frozen=True)
class CorrectionSettings:
    """confidence: probability with which a correction must make its point better; at 0.69 those larger than their own standard
    deviation are made in full, those below half of it left out. slope [m/m]: the steepest change of the offset along the
    path; None: SLOPE, and no limit where the log names its targets, for then every step is the force's own.
    cutting_stiffness [N/m]: how the force grows with the depth of cut. depth_of_cut [m]: across the feed, which tells it where
    nothing tells more; None: not stated. slot_depth [m]: of its slots, along the tool's axis. logged_with: the offsets.csv that
    the program had while the force was logged; first_forces: the log of the pass before, without offsets. scale: factor on all
    joint compliances, from a measured pass. accept_rejected: use a model that its own measurements reject. tolerance [m]: how
    far the correction along a move may be from what its place asks for; min_spacing: how near to each other intermediate
    targets may stand; long_move [m]: no shorter MoveL, or half a MoveC, gets any; keep_targets: none does. tighten_zones: zones
    that cut corners by more than the tolerance are made smaller. advise: say which turn about the tool's axis would lower the
    deviation. correct_again: also a program that a record names as the output of a correction."""

    confidence: float = 0.69
    slope: float | None = None
    cutting_stiffness: Estimate | None = None
    depth_of_cut: float | None = None
    slot_depth: float | None = None
    logged_with: Path | None = None
    first_forces: Path | None = None
    scale: Estimate = EXACTLY_ONE
    accept_rejected: bool = False
    tolerance: float = 5e-6
    min_spacing: Spacing = CLOSEST
    long_move: float = 0.0
    keep_targets: bool = False
    tighten_zones: bool = False
    advise: bool = False
    correct_again: bool = False
    learned: Path | None = None
    repeats: Repeats = "nothing"

    @property
    def taken_depth(self) -> float:
        """The middle of the depths of cut [m] reckoned with where the cut's stiffness is not known: as stated, else DEPTH."""
        return DEPTH if self.depth_of_cut is None else self.depth_of_cut


@dataclass(frozen=True)
class FeedSettings:
    """check_feed: work out whether the robot can hold the programmed feed; strict_feed: and refuse a cut that cannot."""

    check_feed: bool = False
    strict_feed: bool = False


GROUPS: dict[str, type[Any]] = {"log": LogSettings, "correction": CorrectionSettings, "feed": FeedSettings,
                                "cutting": CuttingSettings,
                                "posting": PostingSettings}


@dataclass(frozen=True)
class Settings:
    """All of them. No name stands in two groups.

    >>> settings = compstiff.Settings.of(tare=((0, 2),), check_feed=True)
    >>> settings.log.tare, settings.correction.tolerance
    (((0, 2),), 5e-06)
    """

    log: LogSettings = field(default_factory=LogSettings)
    correction: CorrectionSettings = field(default_factory=CorrectionSettings)
    feed: FeedSettings = field(default_factory=FeedSettings)
    posting: PostingSettings = field(default_factory=PostingSettings)
    cutting: CuttingSettings = field(default_factory=CuttingSettings)

    @classmethod
    def of(cls, **values: Any) -> Settings:
        """From names of the groups' fields: `Settings.of(tare=((0, 2),), check_feed=True)`. Raises TypeError for an unknown."""
        chosen = {group: {item.name: values.pop(item.name) for item in fields(kind) if item.name in values}
                  for group, kind in GROUPS.items()}
        if values:
            raise TypeError(f"no such setting: {', '.join(values)}")
        return cls(**{group: kind(**chosen[group]) for group, kind in GROUPS.items()})

    def values(self) -> dict[str, Any]:
        """Every value by its name, groups one after the other."""
        groups = [getattr(self, item.name) for item in fields(self)]
        return {item.name: getattr(group, item.name) for group in groups for item in fields(group)}

    def files(self) -> list[tuple[str, Path]]:
        """The input files among them, by name."""
        return [(name, value) for name, value in self.values().items() if isinstance(value, Path)]

    def as_dict(self) -> dict[str, Any]:
        """JSON values, files by their name."""
        return {name: value.name if isinstance(value, Path) else value for name, value in self.values().items()}

    def as_options(self) -> list[str]:
        """What `correct` needs to read the log, the stiffness and the cut as here, as words of the command line."""
        scale, options = self.correction.scale, self.log_options()
        options += ["--scale", f"{scale.value:g}" + (f":{scale.std:g}" if scale.std else "")] if scale != EXACTLY_ONE else []
        stiffness = self.correction.cutting_stiffness
        options += ["--cutting-stiffness", f"{1e-3 * stiffness.value:g}:{1e-3 * stiffness.std:g}"] if stiffness else []
        for name, depth in (("--depth-of-cut", self.correction.depth_of_cut), ("--slot-depth", self.correction.slot_depth)):
            options += [name, f"{1e3 * depth:g}"] if depth is not None else []
        for name, file in (("--logged-with", self.correction.logged_with), ("--first-forces", self.correction.first_forces)):
            options += [name, str(file)] if file is not None else []
        options += ["--accept-rejected"] if self.correction.accept_rejected else []
        options += ["--predict-force", str(self.cutting.predict_force)] if self.cutting.predict_force else []
        options += ["--stock", str(self.cutting.stock)] if self.cutting.stock else []
        options += ["--learned", str(self.correction.learned)] if self.correction.learned else []
        options += ["--repeats", self.correction.repeats] if self.correction.repeats != "nothing" else []
        return options

    def log_options(self) -> list[str]:
        """What any command needs to read the log as here, as words of the command line."""
        log = self.log
        options = [word for first, last in log.tare for word in ("--tare", f"{first}:{last}")]
        options += ["--trust-tare"] if log.trust_tare else []
        options += ["--log-format", log.log_format] if log.log_format else []
        options += ["--spindle-rpm", f"{log.spindle_rpm:g}"] if log.spindle_rpm else []
        return options


DEFAULTS = Settings()
