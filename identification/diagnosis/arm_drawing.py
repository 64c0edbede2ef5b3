"""A six-axis arm under test as a small drawing, the part that is to blame marked: one joint, the base, the tool, a sensor."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from identification.diagnosis.judgement import Cause

# Pixels of the drawing, seen from the side: the joints by number, then everything else that may be to blame.
JOINTS = {1: (150, 226), 2: (172, 188), 3: (138, 84), 4: (214, 74), 5: (300, 66), 6: (318, 92)}
PARTS = {"base": (150, 268), "track": (150, 300), "link": (152, 134), "rod": (112, 150), "spring": (196, 150),
         "column": (151, 222), "robot": JOINTS[3],
         "tool": (322, 146), "force sensor": (320, 116), "load": (322, 232), "deflection sensor": (372, 180)}
# What stands up to here is named on the left.
COLUMN = 172
# Of the links that may bend, by the joint they follow.
LINKS = {2: PARTS["link"], 3: (256, 70)}
OF_FAMILY = {"gear": "robot", "structure": "link", "base": "base", "tool": "tool", "load path": "load",
             "force measurement": "force sensor", "deflection measurement": "deflection sensor"}
# Effects, or one law of theirs, that sit at another place than their family; "": at their joint.
OF_EFFECT = {"soft_track": "track", "parallelogram": "rod", "gravity_compensator": "spring",
             "force_sensor_compliance": "force sensor",
             "tool_point": "tool", "wrist_coupling": "wrist", "creep": "robot", "softening": "robot",
             "base_rocking.column": "column", "gravity_compensator.worn": ""}
WORDS = {"base": "base and floor", "track": "track", "link": "links", "rod": "rod", "spring": "gravity compensator",
         "tool": "tool",
         "force sensor": "force sensor", "load": "load", "deflection sensor": "sensor and its stand", "wrist": "wrist",
         "column": "column", "robot": "all joints"}


def places(causes: Sequence[Cause]) -> list[tuple[str, tuple[int, int]]]:
    """What each cause is to be marked with, in words, and where; each place once."""
    marked: dict[str, tuple[int, int]] = {}
    for cause in causes:
        name = OF_EFFECT.get(cause.effect.stored, OF_EFFECT.get(cause.effect.name, ""))
        if name == "wrist":
            marked["wrist"] = JOINTS[5]
        elif cause.effect.name == "link_bending" and cause.joint in LINKS:
            marked[f"link {cause.joint}"] = LINKS[cause.joint]
        elif name:
            marked[WORDS[name]] = PARTS[name]
        elif cause.joint:
            marked[f"joint {cause.joint}"] = JOINTS[cause.joint]
        else:
            part = OF_FAMILY[cause.effect.family]
            marked[WORDS[part]] = PARTS[part]
    return list(marked.items())


def arm_drawing(causes: Sequence[Cause], certain: bool, rod: bool = True) -> Markup:
    """The drawing; certain: the causes are named, else they are what it may be, and the marks are broken rings. rod: the arm
    has a parallel rod. A gravity compensator is drawn where it may be to blame."""
    marked = places(causes)
    here = [ARM, *([ROD] if rod else []), *([SPRING] if WORDS["spring"] in dict(marked) else [])]
    kind = "bad" if certain else "warn"
    rings = [Markup('<circle class="line stroke-{}{}" stroke-width="4" cx="{}" cy="{}" r="21" fill="none"/>').format(
        kind, "" if certain else " dashed", *place)
        for name, where in marked for place in (JOINTS.values() if name == WORDS["robot"] else (where,))]
    names = [*_labels([one for one in marked if one[1][0] <= COLUMN], kind, left=True),
             *_labels([one for one in marked if one[1][0] > COLUMN], kind, left=False)]
    label = ("The arm under test; marked: " if certain else "The arm under test; it may be: ") + (
        ", ".join(name for name, _ in marked) or "nothing")
    return _drawing(label, [*here, *_joints(), *rings, *names])


def sound_arm(rod: bool) -> Markup:
    """The arm with nothing to blame: a ring around each joint, whose spring is all there is."""
    rings = [Markup('<circle class="line stroke-good" stroke-width="3" cx="{}" cy="{}" r="{}" fill="none"/>').format(
        x, y, 15 if number < 4 else 13) for number, (x, y) in JOINTS.items()]
    return _drawing("The arm under test; a spring in each of six joints, nothing to blame",
                    [ARM, *([ROD] if rod else []), *_joints(), *rings])


def _drawing(label: str, parts: Sequence[Markup]) -> Markup:
    return Markup('<svg class="scene arm" role="img" aria-label="{}" viewBox="-110 0 710 320">{}</svg>').format(
        label, Markup("").join(parts))


def _joints() -> list[Markup]:
    return [Markup('<circle class="joint" cx="{}" cy="{}" r="{}"/><text x="{}" y="{}" text-anchor="middle">{}</text>').format(
        x, y, 11 if number < 4 else 9, x, y + 4, number) for number, (x, y) in JOINTS.items()]


def _labels(marked: Sequence[tuple[str, tuple[int, int]]], kind: str, left: bool) -> list[Markup]:
    """The names of one side, each at the height of its place, or as much lower as the one above it asks for."""
    parts, free = [], 0
    for name, (x, y) in sorted(marked, key=lambda one: one[1][1]):
        at = max(y, free)
        free = at + 24
        start, end, text, anchor = (x - 21, 46, 40, "end") if left else (x + 21, 414, 420, "start")
        parts.append(Markup('<path class="stroke-{}" stroke-width="1.5" d="M{} {}L{} {}"/><text class="name" x="{}" y="{}" '
                            'text-anchor="{}">{}</text>').format(kind, start, y, end, at, text, at + 5, anchor, name))
    return parts


ROD = Markup('<path class="limb" stroke-width="7" d="M128 202L104 100L138 84"/>')
SPRING = Markup('<path class="stroke-muted" stroke-width="4" d="M190 206L202 128L150 100"/>')
# Floor, rails, base, column, upper arm, forearm, hand, sensor, tool, rope and weight, dial gauge.
ARM = Markup(
    '<path class="stroke-muted" stroke-width="2" d="M20 308H420"/>'
    '<path class="body" d="M70 296h160v8H70Z"/><path class="body" d="M104 246h92l14 48H90Z"/><path class="body" d="M128 '
    '196h46v50h-46Z"/>'
    '<path class="limb" stroke-width="26" d="M172 188L138 84"/>'
    '<path class="limb" stroke-width="22" d="M138 84L214 74L300 66"/>'
    '<path class="limb" stroke-width="16" d="M300 66L318 92L320 106"/>'
    '<path class="body" d="M307 108h27v14h-27Z"/><path class="body" d="M312 122h18v26h-18Z"/><path class="body" d="M317 '
    '148h8v26h-8Z"/>'
    '<path class="stroke-ink" stroke-width="1.5" d="M321 174V214"/><path class="body" d="M306 214h30v34h-30Z"/>'
    '<path class="stroke-muted" stroke-width="5" d="M392 308V180"/><path class="stroke-ink" stroke-width="2" d="M392 180H330"/>'
    '<circle class="body" cx="372" cy="180" r="12"/>')
