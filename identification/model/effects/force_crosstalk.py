"""Each axis of the force measurement sees a share of the force along the others."""

from __future__ import annotations

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import ForceAxes, crossed, crossed_one_way, one_way


class _Crosstalk(ForceAxes):
    """`xy` of a force along y is missing along x, and as much the other way round: the part of a sensor's cross-talk that is no
    turn of its frame (`force_misalignment`); axes that are not square look the same."""

    name = "force_crosstalk"
    formula_source = ("engineering judgement: a sensor's error matrix is gains, a turn, and what is left: alike in both "
                      "directions")
    parameters = tuple(
        Parameter(pair, "1", 0.01, -0.2, 0.2,
                  source="engineering judgement: cross-talk of six-axis sensors is stated as 1 to 2 % of the full range; half "
                         "of it is a turn",
                  bounds_source="engineering judgement: either way, to axes that are 11 degrees off square")
        for pair in ("xy", "xz", "yz"))
    sentence = ("the axes of the force measurement see each other: cross-talk of the sensor (then a log of it is off by as "
                "much), or axes that are not square")
    settles = "push along one axis of the force sensor after the other and read all three"

    def share(self, values: Array) -> Array:
        return crossed(values)


class OnTheFlange(_Crosstalk):
    """The sensor turns with the flange, and its axes are the flange's."""

    law, on_flange = "flange", True


class OneWay(_Crosstalk):
    """`xy` of a force along y is missing along x, and another share the other way round."""

    law = "one_way"
    plainer = "force_misalignment"
    formula_source = "engineering judgement: an amplifier's wire, or one cylinder that leans, is not alike in both directions"
    parameters = one_way(0.01, source="engineering judgement: cross-talk of six-axis sensors is stated as 1 to 2 %",
                         bounds_source="engineering judgement: either way, to an axis that is 27 degrees off")

    def share(self, values: Array) -> Array:
        return crossed_one_way(values)


class OneWayOnTheFlange(OneWay):
    """The same of a sensor that turns with the flange."""

    law, on_flange = "one_way_flange", True


class ForceCrosstalk(_Crosstalk):
    """The axes are the base's: cylinders set up along them, a little off square."""

    other_laws = (OnTheFlange(), OneWay(), OneWayOnTheFlange())
