"""What was learned, in words for the terminal and the report."""

from __future__ import annotations

from typing import Any

from identification.common.quantities import two_sigma


def lines(figures: dict[str, Any]) -> list[str]:
    """The figures of a learning (`Learning.as_dict`) in sentences."""
    parts, gone, motion = figures["parts_um"], figures["gone"], figures["motion"]
    beside = figures["along_normals"]
    said = [] if beside is None else [
        f"taken off all numbers along their normals: {beside['all_um']:.1f} +- {two_sigma(beside['std_um']):.1f} um (2 sigma)"]
    said += [
        f"{figures['points_used']} of {figures['points']} points, {figures['places']} places: measured "
        f"{figures['measured_um']:.1f} um RMS; {parts['left']:.1f} um are left with all that was learned",
        f"gone of the measured deviation: {100 * gone['predicted']:.0f} % as it was predicted, {100 * gone['springs']:.0f} % "
        f"with the springs learned, {100 * gone['setup']:.0f} % with the set-up, {100 * gone['drift']:.0f} % with warming, "
        f"{100 * gone['remainder']:.0f} % with the smooth remainder",
        f"factor in motion (with the force sensor's gain): {motion['scale']:.3f} +- {two_sigma(motion['std']):.3f} (2 sigma)",
        _remainder(figures),
        *_causes(figures["causes"]),
    ]
    tried = figures["held_out"]
    if tried is not None:
        said.append(f"on stretches that were left out: {tried['known_um']:.1f} um RMS as known before, "
                    f"{tried['physical_um']:.1f} um with springs, set-up and warming learned, {tried['learned_um']:.1f} um "
                    f"with all ({100 * tried['gain']:.0f} % less; {tried['standard_errors']:.1f} standard errors)")
    return said


def _causes(asked: dict[str, Any]) -> list[str]:
    """What acts with the force beyond the model."""
    if asked["verdict"] == "adequate":
        return [f"no cause beyond the model is seen (chance shows as much in {100 * asked['p_value']:.0f} % of parts)"]
    if not asked["carried"]:
        return []
    return [f"{each['name']}: {each['estimate']:.3g} +- {two_sigma(each['std']):.2g} {each['unit']} (2 sigma)"
            for each in asked["parameters"]]


def _remainder(figures: dict[str, Any]) -> str:
    """Whether there is a smooth remainder."""
    chance, found = figures["remainder_by_chance"], figures["remainder"]
    if found is None:
        return (f"no smooth remainder: chance alone shows as much in {100 * chance:.0f} % of parts, over the limit of "
                f"{100 * figures['false_rate']:.0f} %: none is learned")
    return (f"a smooth remainder of {figures['parts_um']['remainder']:.1f} um RMS over {found['length_mm']:.0f} mm; chance "
            f"alone shows as much in {100 * chance:.1f} % of parts at most")
