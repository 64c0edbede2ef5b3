"""The pictures of docs/conventions.md, drawn with the program's own kinematics: python docs/site/convention_pictures.py"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from identification.model.load_state import load_state
from identification.model.robot import built_in_robots, read_robot
from identification.model.rotations import Frame

FOLDER = Path(__file__).resolve().parents[1] / "pictures"
Point = tuple[float, float]
RED, GREEN, BLUE, GREY, ARM = "#c0392b", "#2e7d32", "#1b6ca8", "#555", "#9aa7b2"
# Pixels a metre, and where the base stands in a picture of the arm.
SCALE, FOOT = 130.0, (70.0, 300.0)
TOOL = Frame.from_quaternion(np.array([0.12, 0.0, 0.25]), (1.0, 0.0, 0.0, 0.0))


def arm(q_deg: Iterable[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 3) [m] along an IRB 6660 from foot to flange, the flange's axes (3, 3), and the TCP (3,)."""
    robot = read_robot(built_in_robots()["irb6660-205-1.90"])
    state = load_state(robot, TOOL, np.radians([list(q_deg)]), np.zeros((1, 6)), np.full(6, 1e-6))
    origins, flange = state.origins[0], state.flange[0]
    shoulder, elbow, wrist = origins[1], origins[2], origins[4]
    # The wrist stands d4 along the forearm and a4 above the elbow: the corner between them.
    reach = wrist - elbow
    turn = float(np.arctan2(robot.a[3], robot.d[3]))
    cosine, sine = np.cos(turn), np.sin(turn)
    forward = np.array([cosine * reach[0] + sine * reach[2], 0, cosine * reach[2] - sine * reach[0]])
    corner = wrist - robot.d[3] * forward / np.linalg.norm(forward)
    return np.array([[0, 0, 0], [0, 0, shoulder[2]], shoulder, elbow, corner, wrist, origins[5]]), flange, state.tcp[0]


def at(point: np.ndarray, foot: Point = FOOT) -> Point:
    """Where a point of the x-z plane is in the picture."""
    return foot[0] + SCALE * float(point[0]), foot[1] - SCALE * float(point[2])


def line(points: Iterable[Point], colour: str, width: float = 2.0, dash: str = "") -> str:
    """A line through points."""
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return (f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width:g}" stroke-linejoin="round" '
            f'stroke-linecap="round"{f" stroke-dasharray={dash!r}" if dash else ""}/>').replace("'", '"')


def arrow(start: Point, end: Point, colour: str, width: float = 2.0) -> str:
    """A line with a head."""
    (x0, y0), (x1, y1) = start, end
    length = float(np.hypot(x1 - x0, y1 - y0)) or 1.0
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    head = [(x1 - 8 * ux - 4 * uy, y1 - 8 * uy + 4 * ux), (x1, y1), (x1 - 8 * ux + 4 * uy, y1 - 8 * uy - 4 * ux)]
    return line([start, end], colour, width) + line(head, colour, width)


def text(place: Point, words: str, colour: str = "#222", size: int = 11, anchor: str = "start") -> str:
    """Words."""
    where = f'x="{place[0]:.1f}" y="{place[1]:.1f}"'
    return f'<text {where} fill="{colour}" font-size="{size}" text-anchor="{anchor}">{words}</text>'


def page(width: int, height: int, parts: Iterable[str]) -> str:
    """The picture."""
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif">\n'
            '<rect width="100%" height="100%" fill="#fff"/>\n' + "\n".join(parts) + "\n</svg>\n")


def triad(place: Point, axes: np.ndarray, name: str, size: float = 34.0, below: bool = False) -> list[str]:
    """A frame seen along +y: x red, y green (a dot towards the reader, a cross away), z blue. axes (3, 3): columns."""
    parts = []
    for axis, colour, label in zip(axes.T, (RED, GREEN, BLUE), "xyz", strict=True):
        shown = size * np.array([axis[0], -axis[2]])
        if np.hypot(*shown) < 4:        # along the line of sight; the reader stands at negative y
            x, y = place
            mark = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="#fff" stroke="{colour}" stroke-width="1.6"/>'
            towards = axis[1] < 0
            mark += (f'<circle cx="{x:.1f}" cy="{y:.1f}" r="1.8" fill="{colour}"/>' if towards else
                     line([(x - 3, y - 3), (x + 3, y + 3)], colour, 1.4) + line([(x - 3, y + 3), (x + 3, y - 3)], colour, 1.4))
            parts.append(mark)
        else:
            end = (place[0] + float(shown[0]), place[1] + float(shown[1]))
            parts.insert(0, arrow(place, end, colour))
            parts.append(text((end[0] + 4, end[1] + 4), label, colour))
    parts.append(text((place[0] - 8, place[1] + (26 if below else -10)), name, GREY, anchor="end"))
    return parts


def frames() -> str:
    """World, base, flange, tool and work object of one cell."""
    points, flange, tcp = arm([0, 15, 20, 0, 55, 0])
    parts = [line([at(point) for point in points], ARM, 9)]
    part = (FOOT[0] + SCALE * 1.55, FOOT[1] - SCALE * 0.25)
    parts.append(f'<rect x="{part[0]:.0f}" y="{part[1]:.0f}" width="120" height="34" fill="#eef1f4" stroke="{ARM}"/>')
    parts += triad(at(np.zeros(3)), np.eye(3), "base", below=True)
    parts += [*triad((24, 350), np.eye(3), "", 26), text((60, 366), "world", GREY)]
    parts += triad(at(points[-1]), flange, "flange")
    parts += triad(at(tcp), flange, "tool (TCP)", below=True)
    parts += triad(part, np.eye(3), "work object", below=True)
    parts += [text((130, 24), "seen from the robot&#8217;s right side: x to the front, z up, y away from you", GREY)]
    return page(640, 380, parts)


def joints() -> str:
    """The positive sense of each axis of an ABB arm."""
    points, _, _ = arm([0, 0, 0, 0, 0, 0])
    parts = [line([at(point) for point in points], ARM, 9)]
    places = [at(point) for point in (0.5 * points[1], points[2], points[3], 0.6 * points[4] + 0.4 * points[5], points[5],
                                      points[6])]
    words = ["1: anticlockwise, seen from above", "2: lower arm to the front", "3: forearm down",
             "4: right-hand about the forearm", "5: wrist down", "6: right-hand about the flange"]
    shifts = [(26, 30), (18, 30), (-75, -28), (-8, -40), (-20, 52), (24, 6)]
    for number, (place, word, shift) in enumerate(zip(places, words, shifts, strict=True)):
        if number in (1, 2, 4):     # across the picture: positive turns the front down, clockwise as seen here
            x, y = place
            arc = [(x + 22 * np.sin(a), y - 22 * np.cos(a)) for a in np.linspace(-0.9, 0.9, 12)]
            parts += [line(arc[:-1], BLUE), arrow(arc[-2], arc[-1], BLUE)]
        parts.append(f'<circle cx="{place[0]:.1f}" cy="{place[1]:.1f}" r="4" fill="{BLUE}"/>')
        parts.append(text((place[0] + shift[0], place[1] + shift[1]), word))
    parts.append(text((220, 340), "all six at zero: lower arm upright, forearm level (ABB)", GREY))
    return page(640, 360, parts)


def rod() -> str:
    """Joint 2 turns, joint 3 does not: with a parallel rod the forearm keeps its angle, on a serial arm it goes along."""
    parts = []
    for shift, title, third in ((0.0, "parallel rod (IRB 6660): q3 is the forearm against the horizontal", 0.0),
                                (330.0, "serial (IRB 6700): q3 is the forearm against the lower arm", 30.0)):
        foot = (60.0 + shift, 290.0)
        for q2, colour, width in ((0.0, "#d7dde3", 7.0), (30.0, ARM, 9.0)):
            points, _, _ = arm([0, q2, third if q2 else 0.0, 0, 0, 0])
            parts.append(line([at(point, foot) for point in points], colour, width))
        parts.append(text((20 + shift, 22), title, size=10))
        parts.append(text((20 + shift, 330), "q2 = 30, q3 = 0, as the pendant shows them; pale: both 0", GREY, 10))
    return page(660, 345, parts)


def forces() -> str:
    """Whose force, whose deflection, and where the correction goes."""
    parts = [f'<rect x="250" y="90" width="160" height="110" fill="#eef1f4" stroke="{ARM}"/>', text((330, 220), "part", GREY),
             f'<rect x="190" y="40" width="60" height="120" fill="#fff" stroke="{ARM}" stroke-width="2"/>',
             text((198, 34), "tool", GREY),
             arrow((220, 120), (110, 120), RED, 3), text((20, 112), "force ON the tool: on_tool", RED),
             arrow((270, 140), (380, 140), GREY, 3), text((278, 158), "by the tool: by_tool", GREY),
             arrow((220, 180), (170, 180), BLUE, 3), text((20, 198), "deviation: where the tool yields to", BLUE),
             arrow((220, 215), (270, 215), GREEN, 3), text((20, 232), "correction: commanded minus planned, against it", GREEN),
             text((20, 262), "deflection (measurements.csv) = loaded minus unloaded TCP, base frame: along the force")]
    return page(640, 280, parts)


def quaternions() -> str:
    """Three turns that tools and work objects often have."""
    half = float(np.sqrt(0.5))
    parts = [text((20, 24), "the frame that w x y z turns to, seen from the side: x to the right, z up, y away from you", GREY)]
    for place, (quaternion, words) in enumerate(((((1.0, 0.0, 0.0, 0.0)), "[1, 0, 0, 0]: not turned"),
                                                 (((half, 0.0, half, 0.0)), "[0.7071, 0, 0.7071, 0]: 90 deg about y"),
                                                 (((0.0, 1.0, 0.0, 0.0)), "[0, 1, 0, 0]: 180 deg about x, z down"))):
        turned = Frame.from_quaternion(np.zeros(3), quaternion).rotation
        parts += [*triad((100 + 210 * place, 110), turned, "", 48), text((100 + 210 * place, 190), words, anchor="middle")]
    return page(640, 210, parts)


PICTURES = {"frames.svg": frames, "joints.svg": joints, "parallel-rod.svg": rod, "forces.svg": forces,
            "quaternions.svg": quaternions}


def main() -> None:
    """Writes all of them."""
    for name, draw in PICTURES.items():
        (FOLDER / name).write_text(draw(), encoding="utf-8")


if __name__ == "__main__":
    main()
