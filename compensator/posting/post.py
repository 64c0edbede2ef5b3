"""APT and CSV toolpaths become the planned RAPID program; from there on they go the way of every RAPID program."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.path.configurations import LEAST_ANGLE, Held, angle_to, base_from_flange, best_direction, hold, tool_frames
from compensator.posting.campath import Array, CamPath
from compensator.posting.settings import PostingSettings
from compensator.rapid import RapidProgram, read_rapid
from compensator.toolpath import Move
from identification.common.findings import Finding, Refused, error
from identification.common.shipped import shipped
from identification.model.cell import Cell
from identification.model.inverse import configuration
from identification.model.kinematics import forward
from identification.model.rotations import Frame, rotation_vector

TEMPLATE = "milling_program.mod.j2"
TOOL, WORKOBJECT, AIR, ZONE = "tMill", "wPart", "vAir", "zPath"
APT_SUFFIXES, TABLE_SUFFIXES = (".apt", ".cls", ".cl"), (".csv", ".parquet", ".pq")
# Joint angles of a table and its poses may differ by rounding only [m, rad].
POSE_APART, TURN_APART = 5e-4, np.radians(0.1)
# Less than this between a joint and its limit, or axis 5 and zero, is worth a warning [rad].
LITTLE = np.radians(5.0)
# Names the module cannot have: RAPID's words, its own procedure and data.
_TAKEN = frozenset((
    "alias", "and", "backward", "case", "connect", "const", "default", "div", "do", "else", "elseif", "endfor", "endfunc",
    "endif", "endmodule", "endproc", "endrecord", "endtest", "endtrap", "endwhile", "error", "exit", "false", "for", "from",
    "func", "goto", "if", "inout", "local", "mod", "module", "nostepin", "not", "noview", "or", "pers", "proc", "raise",
    "readonly", "record", "retry", "return", "step", "sysmodule", "task", "test", "then", "to", "trap", "true", "trynext",
    "undo", "var", "viewonly", "while", "with", "xor", "main", "tmill", "wpart", "vair", "zpath",
))
_KINDS = {Move.LINEAR: "MoveL", Move.ARC_VIA: "", Move.ARC_END: "MoveC"}


@dataclass(frozen=True, eq=False)
class Posted:
    """program: the planned program, its findings those of reading, posting and reading back. content: its bytes.
    rapid (N,): targets reached in the air. assumed: what was chosen, JSON values."""

    program: RapidProgram
    content: bytes
    rapid: NDArray[np.bool_]
    assumed: dict[str, Any]


def read_cam_path(path: Path, settings: PostingSettings) -> CamPath:
    """Reads APT or a table by its suffix. Raises what the readers raise."""
    if path.suffix.lower() in APT_SUFFIXES:
        from compensator.posting.apt import read_apt

        return read_apt(path)
    from compensator.posting.tables import read_path_table

    return read_path_table(path, 1e-3 * settings.feed_mm_s)


def post(path: CamPath, cell: Cell, settings: PostingSettings, name: str) -> Posted:
    """The planned program. name: what findings call it, for a file that is not written.

    Raises Refused (CS4303: no configuration goes all along the path), CompstiffError: CS2153 (joints and poses of a table do
    not fit), CS4304 (tool axis along the direction of its x axis), CS4306 (the text does not read back).
    """
    quaternion, confdata, said, chosen = _oriented(path, cell, settings)
    assumed = {"form": path.form, "zone_mm": settings.zone_mm, "rapid_mm_s": settings.rapid_mm_s,
               "work_object": "cell.yaml", "tool": "cell.yaml", **chosen}
    findings = [*path.findings, Finding(
        "CS4300", "note", f"assumed: coordinates in the work object of cell.yaml, its tool, zone {settings.zone_mm:g} mm with "
        f"stop points at both ends only, {settings.rapid_mm_s:g} mm/s in the air", path.source,
        hint="--zone-mm and --rapid-mm-s change it, cell.yaml has workobject and tool"), *said]
    if cell.tool_mass is None or cell.tool_centre is None:
        findings.append(Finding(
            "CS4301", "warning", "cell.yaml states no mass and centre of mass of the tool: the tooldata declares almost none",
            str(cell.source), hint="give tool.mass_kg and tool.centre_of_mass_mm, or enter the load on the controller first"))
    content = _text(path, cell, settings, quaternion, confdata).encode("ascii")
    program = read_rapid(content, name)
    _check(path, program, quaternion, confdata, settings)
    toolpath = replace(program.toolpath, findings=(*findings, *program.toolpath.findings))
    return Posted(replace(program, toolpath=toolpath), content, path.rapid, assumed)


def _oriented(
    path: CamPath, cell: Cell, settings: PostingSettings
) -> tuple[Array, NDArray[np.int64], list[Finding], dict[str, Any]]:
    """Quaternions (N, 4), confdata (N, 4), what there is to say of them, and the choices made."""
    findings: list[Finding] = []
    chosen: dict[str, Any] = {}
    if path.quaternion is None:
        assert path.axis is not None
        towards = _direction(path, cell, settings)
        quaternion = tool_frames(path.axis, towards)
        direction = (np.round(towards, 9) + 0.0).tolist()          # + 0.0: no -0
        chosen = {"tool_x_towards": direction, "tool_axis": "tip to spindle; tool z against it"}
        shown = ",".join(f"{x:.6g}" for x in direction)
        findings.append(Finding(
            "CS4302", "note", "tool z points against the APT axis (tip to spindle); the free turn about it puts tool x as near "
            f"as possible to {shown} of the work object" + ("" if settings.tool_x else ", which leaves most room"),
            path.source, hint="" if settings.tool_x else f"--tool-x {shown} keeps it so when the path changes"))
    else:
        quaternion = path.quaternion
    flange = base_from_flange(cell, path.position, quaternion)
    if path.joints is not None:
        _check_joints(path, cell, flange)
        held = Held(path.joints, np.inf, 0, "")
    elif path.confdata is not None:
        return quaternion, path.confdata, findings, {**chosen, "configuration": "as in the file"}
    else:
        held = hold(cell.robot, flange)
        if held.failed_at >= 0:
            raise Refused(Finding(
                "CS4303", "error", "no configuration of the robot goes all along the path: the one that gets farthest ends at "
                f"target {held.failed_at} of {len(path)} (out of reach, beyond a joint limit, or a jump)", file=path.source,
                line=int(path.line[held.failed_at]), target=held.failed_at,
                hint="check workobject and tool in cell.yaml (a work object that is not stated lies in the robot's base); "
                "turn the tool with --tool-x, or move the part"))
        if held.reserve < LITTLE:
            findings.append(Finding(
                "CS4305", "warning", f"{np.degrees(held.reserve):.1f} degrees from {held.where} at target {held.at}",
                path.source, int(path.line[held.at]), target=held.at, hint="try another --tool-x, or move the part"))
        chosen["smallest_reserve_deg"] = round(float(np.degrees(held.reserve)), 3)
    # An axis that stands on the border of two quadrants must not flicker between them with the last digit.
    return quaternion, configuration(cell.robot, held.theta + 1e-9), findings, chosen


def _direction(path: CamPath, cell: Cell, settings: PostingSettings) -> Array:
    """Unit direction (3,) of the work object that tool x is turned towards."""
    assert path.axis is not None
    if settings.tool_x is None:
        best = best_direction(cell, path.position, path.axis)
        if best is None:
            raise error("CS4304", "the tool axis comes near every horizontal direction along this path: tool x can keep none",
                        file=path.source, hint="give a direction with --tool-x, or split the path")
        return best[0]
    towards = np.array(settings.tool_x) / np.linalg.norm(settings.tool_x)
    near = angle_to(path.axis, towards)
    at = int(np.argmin(near))
    if near[at] < LEAST_ANGLE:
        raise error("CS4304", f"the tool axis comes within {np.degrees(near[at]):.1f} degrees of the direction --tool-x, at "
                    f"least {np.degrees(LEAST_ANGLE):.0f} are needed: the tool would spin about its axis there",
                    file=path.source, line=int(path.line[at]), target=at,
                    hint="give a direction that the tool axis never comes near")
    return np.asarray(towards)


def _check_joints(path: CamPath, cell: Cell, flange: Frame) -> None:
    """Raises CompstiffError (CS2153) where the joint angles of a table do not put the tool where its pose is."""
    assert path.joints is not None
    reached = forward(cell.robot, path.joints, Frame.identity())
    apart = np.linalg.norm(reached.position - flange.position, axis=1)
    turned = np.linalg.norm(rotation_vector(np.swapaxes(reached.rotation, 1, 2) @ flange.rotation), axis=1)
    wrong = np.flatnonzero((apart > POSE_APART) | (turned > TURN_APART))
    if len(wrong):
        at = int(wrong[0])
        raise error("CS2153", f"the joint angles put the flange {1e3 * apart[at]:.3f} mm and {np.degrees(turned[at]):.3f} "
                    f"degrees off this row's pose, at most {1e3 * POSE_APART:g} mm and {np.degrees(TURN_APART):g} degrees are "
                    "expected",
                    file=path.source, line=int(path.line[at]), target=at,
                    hint="check robot, tool and workobject in cell.yaml, or leave q1_deg ... q6_deg out")


def _text(path: CamPath, cell: Cell, settings: PostingSettings, quaternion: Array, confdata: NDArray[np.int64]) -> str:
    import jinja2

    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(shipped("rapid_templates")), trim_blocks=True,
                                     lstrip_blocks=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    feeds = np.unique(path.feed[~path.rapid])
    names = np.array([f"vFeed{number + 1}" for number in range(len(feeds))], dtype=object)
    speeds = np.full(len(path), AIR, dtype=object)
    speeds[~path.rapid] = names[np.searchsorted(feeds, path.feed[~path.rapid])]
    zone = settings.zone_mm
    shape = ",".join(f"{size:.10g}" for size in (zone, zone, zone, zone / 10, zone, zone / 10))
    tool, part = cell.flange_from_tcp, cell.world_from_object
    loaded = cell.tool_mass is not None and cell.tool_centre is not None
    return environment.get_template(TEMPLATE).render(
        module=module_name(Path(path.source).stem), header=True,
        comments=[_plain(f"Posted by compstiff from {Path(path.source).name}"), *(
            [] if loaded else ["The load of the tool is not known: enter mass and centre of gravity before running"])],
        # 0.001 kg is what the controller's own tool0 declares.
        tool={"name": TOOL, "position": 1e3 * tool.position, "quaternion": tool.quaternion,
              "mass": f"{cell.tool_mass:.10g}" if loaded else "0.001",
              "cog": [f"{x:.10g}" for x in 1e3 * cell.tool_centre] if loaded and cell.tool_centre is not None else [0, 0,
                                                                                                                    0.001]},
        wobj={"name": WORKOBJECT, "oframe": {"position": 1e3 * part.position, "quaternion": part.quaternion}},
        speeds=[{"name": AIR, "tcp": repr(float(settings.rapid_mm_s))},
                *({"name": name, "tcp": _millimetres(feed)} for name, feed in zip(names, feeds, strict=True))],
        zones=[{"name": ZONE, "values": f"[FALSE,{shape}]"}] if zone > 0 else [],
        rows=_rows(path, quaternion, confdata, speeds, ZONE if zone > 0 else "fine"),
        after=[f"! {_plain(line)}" for line in path.remarks.get(len(path), ())])


def _rows(path: CamPath, quaternion: Array, confdata: NDArray[np.int64], speeds: NDArray[np.object_],
          zone: str) -> list[dict[str, Any]]:
    """The moves for the template: the first is a joint move, arcs carry their circle point."""
    position, turn, conf = (1e3 * path.position).tolist(), quaternion.tolist(), confdata.tolist()
    last = len(path) - 1
    rows: list[dict[str, Any]] = []
    via: dict[str, Any] | None = None
    for number, kind in enumerate(path.move.tolist()):
        row = {"kind": _KINDS[kind] if number else "MoveJ", "position": position[number], "quaternion": turn[number],
               "confdata": conf[number], "speed": speeds[number], "zone": "fine" if number in (0, last) else zone}
        remarks = path.remarks.get(number)
        if remarks:
            row["comment"] = [_plain(line) for line in remarks]
        if kind == Move.ARC_VIA:
            via = row
            continue
        if kind == Move.ARC_END and via is not None:
            row |= {"via": via, "comment": via.get("comment", [])}
        rows.append(row)
    return rows


def _check(path: CamPath, program: RapidProgram, quaternion: Array, confdata: NDArray[np.int64],
           settings: PostingSettings) -> None:
    """Raises CompstiffError (CS4306) where the posted text does not say what was meant."""
    read = program.toolpath
    feed = np.where(path.rapid, 1e-3 * settings.rapid_mm_s, path.feed)
    good = (len(read) == len(path) and bool((read.block == "").all())
            and np.array_equal(read.confdata, confdata)
            and np.abs(read.position - path.position).max() <= 0.5001e-7
            and np.abs(read.quaternion - quaternion).max() <= 2e-8
            and np.allclose(read.feed, feed, rtol=1e-11, atol=0))
    if not good:
        raise error("CS4306", "the posted program does not read back as it was meant; nothing was written", file=path.source,
                    hint="a defect in compstiff: please report it with this toolpath")


def _millimetres(feed: float) -> str:
    """A feed [m/s] as mm/s to 12 digits, so that 900 mm/min is 15 and not what is left of it in binary."""
    return repr(float(f"{1e3 * feed:.12g}"))


def _plain(text: str) -> str:
    """Text for a RAPID comment."""
    return " ".join(text.encode("ascii", "replace").decode().split())


def module_name(name: str) -> str:
    """A RAPID identifier: a letter, then letters, digits and _, at most 32."""
    kept = "".join(letter if letter.isascii() and (letter.isalnum() or letter == "_") else "_" for letter in name)
    name = (kept if kept[:1].isalpha() else "M" + kept)[:32]
    return f"{name}_part" if name.lower() in _TAKEN else name
