"""The text of the planned program: a RAPID module from the template that the motion programs use too."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.posting.campath import CamPath
from compensator.posting.orientation import Orientations
from compensator.posting.settings import PostingSettings
from compensator.posting.suffixes import toolpath_stem
from compensator.toolpath import Move
from identification.common.findings import one_line
from identification.common.shipped import shipped
from identification.model.cell import Cell

TEMPLATE = "milling_program.mod.j2"
TOOL, WORKOBJECT, AIR, ZONE = "tMill", "wPart", "vAir", "zPath"
# Names the module cannot have: RAPID's words, its own procedure and data.
_TAKEN = frozenset((
    "alias", "and", "backward", "case", "connect", "const", "default", "div", "do", "else", "elseif", "endfor", "endfunc",
    "endif", "endmodule", "endproc", "endrecord", "endtest", "endtrap", "endwhile", "error", "exit", "false", "for", "from",
    "func", "goto", "if", "inout", "local", "mod", "module", "nostepin", "not", "noview", "or", "pers", "proc", "raise",
    "readonly", "record", "retry", "return", "step", "sysmodule", "task", "test", "then", "to", "trap", "true", "trynext",
    "undo", "var", "viewonly", "while", "with", "xor", "main", "tmill", "wpart", "vair", "zpath",
))
# A comment from the CAM file is cut off there.
LONGEST_COMMENT = 200
_KINDS = {Move.LINEAR: "MoveL", Move.ARC_VIA: "", Move.ARC_END: "MoveC"}


def module_name(name: str) -> str:
    """A RAPID identifier: a letter, then letters, digits and _, at most 32."""
    kept = "".join(letter if letter.isascii() and (letter.isalnum() or letter == "_") else "_" for letter in name)
    name = (kept if kept[:1].isalpha() else "M" + kept)[:32]
    return f"{name}_part" if name.lower() in _TAKEN else name


def module_text(
    cam_path: CamPath, cell: Cell, settings: PostingSettings, orientation: Orientations, external: NDArray[np.float64]
) -> str:
    """The module, ASCII. external (6,) [mm or deg]: what all moves say of the external axes, NaN for 9E9."""
    import jinja2

    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(shipped("rapid_templates")), trim_blocks=True,
                                     lstrip_blocks=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    feeds = np.unique(cam_path.feed[~cam_path.rapid])
    names = np.array([f"vFeed{number + 1}" for number in range(len(feeds))], dtype=object)
    speeds = np.full(len(cam_path), AIR, dtype=object)
    speeds[~cam_path.rapid] = names[np.searchsorted(feeds, cam_path.feed[~cam_path.rapid])]
    zone = settings.zone_mm
    shape = ",".join(f"{size:.10g}" for size in (zone, zone, zone, zone / 10, zone, zone / 10))
    tool, part = cell.flange_from_tcp, cell.world_from_object
    mass, centre = cell.tool_mass, cell.tool_centre
    # 0.001 kg is what the controller's own tool0 declares.
    load = {"mass": "0.001", "cog": [0, 0, 0.001]}
    comments = [_comment(f"Posted by compstiff from {Path(cam_path.source).name}")]
    if mass is not None and centre is not None:
        load = {"mass": f"{mass:.10g}", "cog": [f"{x:.10g}" for x in 1e3 * centre]}
    else:
        comments.append("The load of the tool is not known: enter mass and centre of gravity before running")
    return environment.get_template(TEMPLATE).render(
        module=module_name(toolpath_stem(Path(cam_path.source))), header=True, comments=comments,
        tool={"name": TOOL, "position": 1e3 * tool.position, "quaternion": tool.quaternion, **load},
        wobj={"name": WORKOBJECT, "oframe": {"position": 1e3 * part.position, "quaternion": part.quaternion}},
        speeds=[{"name": AIR, "tcp": repr(float(settings.rapid_mm_s))},
                *({"name": name, "tcp": _millimetres(feed)} for name, feed in zip(names, feeds, strict=True))],
        zones=[{"name": ZONE, "values": f"[FALSE,{shape}]"}] if zone > 0 else [],
        rows=_rows(cam_path, orientation, speeds, ZONE if zone > 0 else "fine", external),
        after=[f"! {_comment(line)}" for line in cam_path.remarks.get(len(cam_path), ())])


def _rows(
    cam_path: CamPath, orientation: Orientations, speeds: NDArray[np.object_], zone: str, external: NDArray[np.float64]
) -> list[dict[str, Any]]:
    """The moves for the template: the first is a joint move, arcs carry their circle point."""
    position, quaternion = (1e3 * cam_path.position).tolist(), orientation.quaternion.tolist()
    confdata, stop = orientation.confdata.tolist(), cam_path.stop.tolist()
    held = {} if np.isnan(external).all() else {
        "external": ["9E9" if np.isnan(value) else repr(float(value)) for value in external]}
    last = len(cam_path) - 1
    rows: list[dict[str, Any]] = []
    via: dict[str, Any] | None = None
    for number, kind in enumerate(cam_path.move.tolist()):
        row = {"kind": _KINDS[kind] if number else "MoveJ", "position": position[number], "quaternion": quaternion[number],
               "confdata": confdata[number], "speed": speeds[number],
               "zone": "fine" if number in (0, last) or stop[number] else zone, **held}
        remarks = cam_path.remarks.get(number)
        if remarks:
            row["comment"] = [_comment(line) for line in remarks]
        if kind == Move.ARC_VIA:
            via = row
            continue
        if kind == Move.ARC_END and via is not None:
            row |= {"via": via, "comment": via.get("comment", [])}
        rows.append(row)
    return rows


def _millimetres(feed: float) -> str:
    """A feed [m/s] as mm/s to 12 digits, so that 900 mm/min is 15 and not what is left of it in binary."""
    return repr(float(f"{1e3 * feed:.12g}"))


def _comment(text: str) -> str:
    """Text for a RAPID comment: one line of printable ASCII, bounded."""
    line = one_line(text)
    return line if len(line) <= LONGEST_COMMENT else f"{line[:LONGEST_COMMENT - 3]}..."
