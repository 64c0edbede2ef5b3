"""What was learned, in words for the terminal and the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compensator.learning.chance import FALSE_RATE

if TYPE_CHECKING:
    from compensator.learning.learn import Learning


def lines(learning: Learning) -> list[str]:
    """In sentences, figures in micrometres."""
    figures = learning.as_dict()
    parts, gone, motion = figures["parts_um"], figures["gone"], figures["motion"]
    said = [
        f"{figures['points_used']} of {figures['points']} points, {figures['places']} places: measured {figures['measured_um']:.1f} um "
        f"RMS; {parts['left']:.1f} um are left with all that was learned",
        f"gone of the measured deviation: {100 * gone['predicted']:.0f} % as it was predicted, {100 * gone['springs']:.0f} % with "
        f"the springs learned, {100 * gone['setup']:.0f} % with the set-up, {100 * gone['drift']:.0f} % with warming, "
        f"{100 * gone['remainder']:.0f} % with the smooth remainder",
        f"factor in motion (with the force sensor's gain): {motion['scale']:.3f}, standard error {motion['std']:.3f}",
        remainder(learning),
    ]
    if learning.held_out is not None:
        tried = figures["held_out"]
        said.append(f"on stretches that were left out: {tried['known_um']:.1f} um RMS as known before, {tried['physical_um']:.1f} um "
                    f"with springs, set-up and warming learned, {tried['learned_um']:.1f} um with all ({100 * tried['gain']:.0f} % "
                    f"less; {tried['standard_errors']:.1f} standard errors)")
    return said


def remainder(learning: Learning) -> str:
    """Whether there is a smooth remainder."""
    figures = learning.as_dict()
    chance = figures["remainder_by_chance"]
    if figures["remainder"] is None:
        return (f"no smooth remainder: chance alone shows as much in {100 * chance:.0f} % of parts (limit "
                f"{100 * FALSE_RATE:.0f} %), so none is learned")
    found = figures["remainder"]
    return (f"a smooth remainder of {figures['parts_um']['remainder']:.1f} um RMS over {found['length_mm']:.0f} mm; chance alone "
            f"shows as much in {100 * chance:.1f} % of parts at most")
