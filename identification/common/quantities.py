"""Physical values for people: half a gap of 86 urad, where files say 8.6e-05 rad; and their uncertainty, always two sigma."""

from __future__ import annotations

import math
import re
from typing import TypeVar

from identification.common.arrays import Array

Spread = TypeVar("Spread", float, Array)
# What a value is read in, from the largest unit that leaves a tenth of it before the point.
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "u"))
TAKES_PREFIX = re.compile(r"(rad|m|s)(/|$)")
# Of the names of parameters: the unit at their end.
UNIT = re.compile(r"(_(rad|m|n|nm|s|kg))?(_per_\w+)?$")


def readable_unit(size: float, unit: str) -> tuple[float, str]:
    """What a value of this size [unit] is divided by to be read, and the unit that it is in then.

    >>> readable_unit(8.6e-5, "rad"), readable_unit(3.0, "N")
    ((1e-06, 'urad'), (1.0, 'N'))
    """
    if not TAKES_PREFIX.match(unit) or not size or not math.isfinite(size):
        return 1.0, "" if unit == "1" else unit
    factor, prefix = next((one for one in PREFIXES if abs(size) >= 0.1 * one[0]), PREFIXES[-1])
    return factor, prefix + unit


def two_places(value: float) -> str:
    """Two significant places without a power of ten, as far as people read such numbers.

    >>> [two_places(value) for value in (134.2, 0.0547, 1.04e6, 1.6e-7, 0.0)]
    ['130', '0.055', '1e+06', '1.6e-07', '0']
    """
    text = f"{value:.2g}"
    return f"{float(text):g}"


def two_sigma(std: Spread) -> Spread:
    """What words call the uncertainty of a result, and what stands behind +-; files and what a user states have one sigma."""
    return 2.0 * std


def quantity(value: float, std: float, unit: str) -> str:
    """A value with two of its standard deviations (0 or NaN: none is told), angles in degrees or arc seconds too.

    >>> quantity(8.62e-5, 3.3e-6, "rad"), quantity(1.07e-7, 3.7e-9, "rad/(N*m)")
    ('86.2 +- 6.6 urad (17.8 arcsec)', '0.107 +- 0.0074 urad/(N*m)')
    """
    factor, name = readable_unit(value, unit)
    spread = f" +- {two_sigma(std) / factor:.2g}" if std and math.isfinite(std) else ""
    angle = ""
    if unit == "rad":
        degrees = math.degrees(value)
        angle = f" ({degrees:.3g} deg)" if abs(degrees) >= 0.05 else f" ({3600 * degrees:.3g} arcsec)"
    return f"{value / factor:.3g}{spread} {name}{angle}".rstrip()


def parameter_words(name: str) -> str:
    """The name of a parameter without its unit.

    >>> [parameter_words(name) for name in ("half_gap_rad", "compliance_rad_per_nm", "x_m", "share")]
    ['half gap', 'compliance', 'x', 'share']
    """
    return UNIT.sub("", name).replace("_", " ") or name


def cause_words(label: str) -> str:
    """The name of a cause, or of several at once, for people; in files, and for `explain`, it is the label.

    >>> [cause_words(label) for label in ("soft_zone[2]", "link_bending[3]", "tool_point", "force_sign[y]")]
    ['soft zone of joint 2', 'link bending of link 3', 'tool point', 'force sign y']
    >>> cause_words("soft_zone[5] + spindle_compliance")
    'soft zone of joint 5 + spindle compliance'
    """
    if " + " in label:
        return " + ".join(map(cause_words, label.split(" + ")))
    name, _, place = label.partition("[")
    place = place.removesuffix("]")
    part = "link " if name == "link_bending" else "joint "
    return name.strip().replace("_", " ") + (f" of {part}{place}" if place.isdigit() else f" {place}".rstrip())
