"""A table's own header told in the names of docs/formats.md, quantity and unit: said, never taken unasked."""

from __future__ import annotations

import re
from collections.abc import Sequence

_UNIT = (r"[ _]*(?:[\[(/] ?)?(?P<unit>°|deg|degrees|grad|rad|k?n|lbf?|kgf?|k?n ?[*·.]? ?[cm]?m|lbf?[ ._·*]?(?:in|ft)|[cm]?m|in|"
         r"[µμu]m|mym|[mµμu]?s|sec|sek|min|g)[\])]?")
_WHAT = (
    (r"(?:achse|axis|gelenk|joint|theta|θ|[aqj])[ _]?(?P<number>[1-6])", "joint"),
    (r"(?:f|force|kraft)[ _]?(?P<axis>[xyz])", "force"), (r"(?:m|moment|torque)[ _]?(?P<axis>[xyz])", "moment"),
    (r"(?:d|delta|Δ|δ|deflection|verformung|weg|auslenkung)[ _]?(?P<axis>[xyz])", "deflection"),
    (r"(?:pos|position|tcp)?[ _]?(?P<axis>[xyz])", "place"), (r"t|time|zeit", "time"),
    (r"dwell(?:[ _]?time)?|haltezeit|verweilzeit", "dwell"), (r"mass|masse", "mass"))
_PATTERNS = [(re.compile(f"(?:{what}){_UNIT}"), kind) for what, kind in _WHAT]
_WORDS = {"target": "target", "pose": "pose"}
# By the kind of a quantity, its units here, and what it is called in them.
_NAMES = {
    "joint": ({"deg"}, "q{number}_deg"), "force": ({"n"}, "f{axis}_n"), "moment": ({"nm"}, "m{axis}_nm"),
    "deflection": ({"um"}, "d{axis}_um"), "place": ({"mm"}, "{axis}_mm"), "time": ({"s", "ms"}, "time_{unit}"),
    "dwell": ({"s"}, "dwell_s"), "mass": ({"kg"}, "mass_kg")}
_SAME = {"°": "deg", "degrees": "deg", "grad": "deg", "µm": "um", "μm": "um", "mym": "um", "sec": "s", "sek": "s"}
_NEEDED = {"joint": "degrees", "force": "newtons", "moment": "newton metres", "deflection": "micrometres",
           "place": "millimetres", "time": "seconds", "dwell": "seconds", "mass": "kilograms"}


def meant(name: str) -> tuple[str, str]:
    """The column that a header means beyond doubt, and "": "fx_n" of "Fx [N]". Where the quantity is clear and its unit is
    another one, that column and the unit it must be in: ("dx_um", "micrometres") of "dx [mm]". ("", "") of anything else."""
    name = name.strip().lower()
    if name in _WORDS:
        return _WORDS[name], ""
    for pattern, kind in _PATTERNS:
        found = pattern.fullmatch(name)
        if found:
            groups = found.groupdict()
            unit = re.sub(r"[ *·]", "", groups["unit"])
            unit = _SAME.get(unit, unit)
            units, column = _NAMES[kind]
            there = unit in units
            return column.format(**groups | {"unit": unit if there else "s"}), "" if there else _NEEDED[kind]
    return "", ""


def renamed(header: Sequence[str], wanted: Sequence[str]) -> str:
    """What the columns of a header should be called, as a hint: "call 'Fx [N]' fx_n, ..."; "" where none is beyond doubt."""
    told = {name: meant(name) for name in header}
    columns = [column for column, _ in told.values()]
    sure = [(name, column, needed) for name, (column, needed) in told.items()
            if column in wanted and column != name and columns.count(column) == 1]
    if not sure:
        return ""
    calls = ", ".join(f"'{name}' {column}" for name, column, needed in sure if not needed)
    others = []
    for unit in dict.fromkeys(needed for _, _, needed in sure if needed):
        alike = [(f"'{name}'", column) for name, column, needed in sure if needed == unit]
        theirs = "its" if len(alike) == 1 else "their"
        others.append(f"{', '.join(name for name, _ in alike)} must be {', '.join(column for _, column in alike)}, in {unit}: "
                      f"convert {theirs} numbers")
    return "; ".join([f"call {calls}"] * bool(calls) + others)
