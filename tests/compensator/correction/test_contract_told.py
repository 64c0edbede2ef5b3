"""What is said of single targets, and of the cut, on either side of where it is said."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from compensator.cutting.materials import MATERIALS
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3, line
from tests.runs.command_line.test_refusals import at
from tests.runs.command_line.user_files import IRB6660, TOOL, Job, K

HEAD = "target,fx_n,fy_n,fz_n\n"


def of_code(run: kit.Run, code: str) -> list[dict]:
    return [finding for finding in run.json["findings"] if finding["code"] == code]


@pytest.mark.parametrize("joints", [(1,), (1, 3), (2,), ()])
def test_a_cut_to_joint_angles_stays_and_is_told(tmp_path: Path, joints: tuple[int, ...]) -> None:
    """The first such move with its line, and how many there are; one without force, as that of target 2, is no cut, and other
    moves are corrected."""
    path = line(5, 10)
    moves = [f"    MoveAbsJ [[{','.join(f'{v:.10f}' for v in np.degrees(path.q[k]))}],{kit.E}],v50,z1,tMill\\WObj:=wPart;"
             if k in joints else kit.move(text) for k, text in enumerate(path.text)]
    job = Job(tmp_path, program=kit.module(moves), forces=HEAD + "".join(f"{k},60,90,{-120}\n" for k in (0, 1, 3, 4)))
    run = job.correct("--json", "--keep-targets")
    assert run.code == 0, run
    told = [k for k in joints if k != 2]
    lines = str(job.program).splitlines()
    found = of_code(run, "CS4102")
    assert [(one["level"], one["file"], one["target"], one["count"]) for one in found] == (
        [("warning", str(tmp_path / "part.mod"), told[0], len(told))] if told else [])
    assert all("MoveAbsJ" in one["message"] and lines[one["line"] - 1] == moves[one["target"]] for one in found)
    moved = np.abs(np.nan_to_num(kit.column(job.offsets(), "ox_mm", "oy_mm", "oz_mm"))).max(axis=1) > 1e-6
    assert moved.tolist() == [k != 2 and k not in joints for k in range(5)]
    assert [text for text in job.out.read_text().splitlines() if "MoveAbsJ" in text] == [moves[k] for k in joints]


@pytest.mark.parametrize(("wrist", "force", "words"), [
    (0.09, (1, 0, 0), "axis 5 is 0.090 deg from the wrist singularity after correction, at least 0.1 deg are needed"),
    (0.11, (1, 0, 0), ""), (-0.09, (1, 0, 0), "axis 5 is 0.090 deg"), (-0.11, (1, 0, 0), ""),
    # This force moves axis 5 by less than a tenth of a degree, to either side.
    (0.15, (-900, 600, -300), "axis 5 is 0.06"), (0.05, (900, -600, 300), ""),
    # And so much a larger one takes it through zero.
    (0.11, (-5400, 3600, -1800), "the correction takes axis 5 through zero, the wrist singularity, to 0.41")])
def test_the_wrist_singularity_is_refused_within_a_tenth_of_a_degree(
    tmp_path: Path, wrist: float, force: tuple[float, ...], words: str
) -> None:
    """Of where axis 5 is after the correction, by the independent arm: beyond it a warning is given (CS4110)."""
    angles = [10, 10, 10, 20, wrist, 30]
    job = Job(tmp_path, kit.cell_text(extra="limits: {max_offset_mm: 50, max_tilt_deg: 9}\n"), at(angles),
              forces=HEAD + f"0,{','.join(map(str, force))}\n")
    run = job.correct("--json")
    assert (run.code, bool(of_code(run, "CS4110"))) == ((3, False) if words else (0, True)), run
    assert [(one["level"], one["file"], one["line"], one["target"]) for one in of_code(run, "CS4106")] == (
        [("error", str(tmp_path / "part.mod"), 5, 0)] if words else [])
    assert all(one["message"].startswith(words) for one in of_code(run, "CS4106"))
    if not words:
        command = kit.targets_of(job.out.read_text())[0]
        reached = np.degrees(kit.solve(IRB6660, kit.work_object() @ command @ TOOL.inv(), np.radians(angles)))[4]
        assert 0.1 < reached * np.sign(wrist) < 0.2


@pytest.mark.parametrize(("wrists", "said"), [
    ((2.05, 3, -4), ""),
    ((3, 1.95, 2.05), "1 target with force is within 2 deg of the wrist singularity, the closest 1.95 deg"),
    ((-1.95, 3, -1.5), "2 targets with force are within 2 deg of the wrist singularity, the closest 1.50 deg")])
def test_near_the_wrist_singularity_is_within_two_degrees(tmp_path: Path, wrists: tuple[float, ...], said: str) -> None:
    """Of where axis 5 is after the correction, which moves it by next to nothing here; the closest target is named."""
    moves = [at([10, 10, 10 + k, 20, wrist, 30]).splitlines()[4] for k, wrist in enumerate(wrists)]
    job = Job(tmp_path, program=kit.module(moves), forces=HEAD + "".join(f"{k},1,0,0\n" for k in range(3)))
    run = job.correct("--json", "--keep-targets")
    assert run.code == 0, run
    closest = int(np.argmin(np.abs(wrists)))
    assert [(one["level"], one["line"], one["target"], one["message"]) for one in of_code(run, "CS4110")] == (
        [("warning", 5 + closest, closest, f"{said}: axes 4 and 6 turn fast there")] if said else [])


@pytest.mark.parametrize(("climbs", "origin"), [(40, "CS3240"), (39, "CS3241")])
def test_a_stated_depth_tells_the_cutting_stiffness_where_enough_targets_climb(
    tmp_path: Path, climbs: int, origin: str
) -> None:
    """Pushed forwards and to the left, as in climb milling, at 40 or 39 of 45 targets; to the right at the others. By the depth
    that the tool had, which stood aside by the independent arm's deviation: 0.75 of the push by it (docs/formats.md), and the
    mean of what is known to 0.3 of its logarithm."""
    path = line(45, 2)
    work, axis = kit.work_object().r, np.array([(kit.work_object() @ frame).r.apply([0, 0, 1]) for frame in path.frames])[0]
    feed = work.apply(path.frames[1].p - path.frames[0].p)
    feed /= np.linalg.norm(feed)
    flange = (kit.work_object() @ path.frames[0] @ TOOL.inv()).p - (kit.work_object() @ path.frames[0]).p
    left = np.cross(axis * np.sign(axis @ flange), feed)
    left /= np.linalg.norm(left)
    forces = [60 * feed + (90 if k < climbs else -90) * left for k in range(45)]
    job = Job(tmp_path, kit.cell_text(extra="cutting: {material: steel}\n"), path.program(), forces=HEAD + "".join(
        f"{k},{','.join(f'{x:.6f}' for x in force)}\n" for k, force in enumerate(forces)))
    run = job.correct("--json", "--depth-of-cut", "0.5", "--keep-targets")
    assert run.code == 0, run
    # Beside a depth that tells the cut, what the material lacks for it is no more than a note, which asks for no depth.
    assert [(one["level"], one["hint"]) for one in of_code(run, "CS3202")] == [
        ("note" if origin == "CS3240" else "warning", "state it")]
    found = of_code(run, origin)
    assert [(one["level"], one["file"]) for one in found] == [("note", str(tmp_path / "part.mod"))]
    assert not of_code(run, "CS3240" if origin == "CS3241" else "CS3241")
    if origin == "CS3241":
        assert found[0]["message"].startswith("39 of 45 targets climb, and 40 are needed")
        return
    aside = [left @ kit.deviation(IRB6660, path.q[k], TOOL.p, np.r_[forces[k], 0, 0, 0], K) for k in range(climbs)]
    stiffness = np.median(0.75 * 90 / (0.5 - 1e3 * np.array(aside))) * np.exp(0.3**2 / 2)
    std = 2 * stiffness * np.sqrt(np.expm1(0.3**2))
    assert found[0]["message"] == f"cutting stiffness by a depth of 0.5 mm: {stiffness:.3g} +- {std:.2g} N/mm (2 sigma)"
    grows = 100 * stiffness * 1e3 * np.array(aside) / 90
    followed = re.match(r"force follows the cut: with a cutting stiffness of (\S+) N/mm the corrected pass meets forces that "
                        r"are (\+\S+) % \(median\), (\S+) % at most, off the logged; 5 with next to no force across the "
                        r"feed, or in another cut, keep theirs$", of_code(run, "CS4120")[0]["message"])
    assert followed
    np.testing.assert_allclose([float(one) for one in followed.groups()], [
        stiffness, np.median(grows), grows.max()], atol=0.06, rtol=5e-3)


def sideways(path: Path3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors, base frame: along a straight path, to its left as seen from the spindle, and to the spindle."""
    work = kit.work_object()
    feed = work.r.apply(path.frames[1].p - path.frames[0].p)
    feed /= np.linalg.norm(feed)
    up = (work @ path.frames[0]).r.apply([0, 0, 1])
    up *= np.sign(up @ ((work @ path.frames[0] @ TOOL.inv()).p - (work @ path.frames[0]).p))
    up -= (up @ feed) * feed
    up /= np.linalg.norm(up)
    return feed, np.cross(up, feed), up


CUTTER = {"material": "steel", "tool_diameter_mm": "16", "contact_mm": "3"}


@pytest.mark.parametrize("lacks", ["", "cutting.tool_diameter_mm", "cutting.contact_mm", "a programmed feed",
                                   "the spindle's speed (--spindle-rpm)"])
def test_a_material_tells_the_cut_or_what_it_lacks_for_that(tmp_path: Path, lacks: str) -> None:
    """Steel, 16 mm, 3 mm of contact, 50 mm/s at 3000/min are a millimetre a turn: by docs/formats.md K = 0.8 k_c b v_f / v_c,
    k_c = k_c1.1 h^-m_c of chips h = f_z sqrt(0.1) of three teeth, known to 0.4 of its logarithm."""
    cutting = {key: value for key, value in CUTTER.items() if not lacks.endswith(key)}
    program = line(5, 10).program().replace(",v50,", ",vX," if "feed" in lacks else ",v50,")
    job = Job(tmp_path, kit.cell_text(extra=f"cutting: {{{', '.join(f'{k}: {v}' for k, v in cutting.items())}}}\n"), program,
              forces=HEAD + "".join(f"{k},60,90,-120\n" for k in range(5)))
    run = job.correct("--json", "--keep-targets", *(() if "spindle" in lacks else ("--spindle-rpm", "3000")))
    assert run.code == 0, run
    told, missing = of_code(run, "CS3201"), of_code(run, "CS3202")
    assert [(one["level"], one["file"], one["message"]) for one in missing] == [(
        "warning", str(tmp_path / "cell.yaml"),
        f"cutting.material steel does not tell how stiff the cut is without {lacks}")] * bool(lacks)
    steel = MATERIALS["steel"]
    value = 0.8 * steel.specific * (np.sqrt(0.1) / 3) ** -steel.exponent * 3 / (np.pi * 16) * np.exp(0.4**2 / 2)
    assert [(one["level"], one["file"], one["message"]) for one in told] == [(
        "note", str(tmp_path / "cell.yaml"), f"cutting stiffness by its material, steel: {value:.3g} +- "
        f"{2 * value * np.sqrt(np.expm1(0.4**2)):.2g} N/mm (2 sigma)")] * (not lacks)


@pytest.mark.parametrize("by", ["cell", "option"])
@pytest.mark.parametrize(("deep", "said"), [(201, True), (199, False)])
def test_a_cutting_stiffness_of_a_cut_of_over_200_mm_is_told(tmp_path: Path, deep: int, said: bool, by: str) -> None:
    """With the push across the feed that the log has, in the file that states it."""
    path = line(5, 10)
    feed, _, _ = sideways(path)
    push = float(np.linalg.norm(np.array([60, 90, -120]) - (np.array([60, 90, -120]) @ feed) * feed))
    value = f"{push / deep:.6f}"
    option, of_cell = ("--cutting-stiffness", value), f"cutting: {{stiffness_n_per_mm: {value}}}\n"
    job = Job(tmp_path, kit.cell_text(extra=of_cell if by == "cell" else ""), path.program(),
              forces=HEAD + "".join(f"{k},60,90,-120\n" for k in range(5)))
    run = job.correct("--json", "--keep-targets", *(option if by == "option" else ()))
    assert run.code == 0, run
    assert [(one["level"], Path(one["file"]).name, one["message"]) for one in of_code(run, "CS4126")] == [(
        "warning", "cell.yaml" if by == "cell" else "part.mod", f"with a cutting stiffness of {float(value):g} N/mm the push "
        f"across of {push:.0f} N would be that of a cut {deep} mm deep")] * said


@pytest.mark.parametrize(("options", "angle", "said"), [
    (("--slot-depth", "2"), 115, "depth"), (("--slot-depth", "2", "--cutting-stiffness", "20"), 115, "depth"),
    (("--slot-depth", "2"), 60, "none"), (("--spindle-rpm", "3000"), 115, "material"), (("--spindle-rpm", "3000"), 60, ""),
    (("--spindle-rpm", "3000", "--cutting-stiffness", "20"), 115, ""), ((), 115, "")])
def test_how_the_force_in_a_slot_grows_with_its_depth_is_said(
    tmp_path: Path, options: tuple[str, ...], angle: float, said: str
) -> None:
    """120 N at 115 degrees to the left of the feed, as in a slot, or at 60, as in climb milling. By the depth K = F_n / b, b
    the stated one less what the tool stood towards the spindle, to 0.15 of its logarithm; by the material a quarter of
    k_c(2 f_z / pi) f."""
    path = line(20, 4)
    feed, left, up = sideways(path)
    force = 120 * (np.cos(np.radians(angle)) * feed + np.sin(np.radians(angle)) * left)
    job = Job(tmp_path, kit.cell_text(extra="cutting: {material: steel}\n"), path.program(), forces=HEAD + "".join(
        f"{k},{','.join(f'{x:.6f}' for x in force)}\n" for k in range(20)))
    run = job.correct("--json", "--keep-targets", *options)
    assert run.code == 0, run
    rise = [up @ kit.deviation(IRB6660, q, TOOL.p, np.r_[force, 0, 0, 0], K) for q in path.q]
    steel, mean = MATERIALS["steel"], {"depth": 0.15, "material": 0.4}.get(said, 0.0)
    value = np.exp(mean**2 / 2) * (np.median(120 * np.sin(np.radians(angle)) / (2 - 1e3 * np.array(rise))) if said == "depth"
                                   else 0.25 * steel.specific * (2 / (3 * np.pi)) ** -steel.exponent)
    known = f"{value:.3g} +- {2 * value * np.sqrt(np.expm1(mean**2)):.2g} N/mm (2 sigma) along the tool's axis"
    words = {"depth": f"in slots, by a depth of 2 mm: {known}", "material": f"in slots, by steel: {known}",
             "none": "--slot-depth is stated, and by the direction of its force nothing is a slot"}
    assert [(one["level"], one["file"], one["message"]) for one in of_code(run, "CS3243")] == [
        ("note", str(tmp_path / "part.mod"), words[said])] if said else not of_code(run, "CS3243")


@pytest.mark.parametrize(("count", "by"), [(46, "passes"), (45, "none")])
def test_two_passes_tell_how_the_force_in_a_slot_grows(tmp_path: Path, count: int, by: str) -> None:
    """200 N/mm of depth: by the steps along the tool's axis of forty targets in full slots at least, with the sensor's zero
    (2 N) against what is known of any slot: K = F_n / 2 mm to 0.8 of its logarithm."""
    path = line(count, 4)
    feed, left, up = sideways(path)
    force = 120 * (np.cos(np.radians(115)) * feed + np.sin(np.radians(115)) * left)

    def text(times: np.ndarray) -> str:
        return HEAD + "".join(f"{k},{','.join(f'{x:.9f}' for x in one * force)}\n" for k, one in enumerate(times))

    def rise(times: np.ndarray) -> np.ndarray:
        wrench = np.pad(times[:, None] * force, ((0, 0), (0, 3)))
        return np.asarray(kit.deviation(IRB6660, np.array(path.q), TOOL.p, wrench, K) @ up)

    job = Job(tmp_path, program=path.program(), forces=text(np.ones(count)))
    assert job.correct("--keep-targets").code == 0
    sent = np.array([kit.work_object().r.apply(b.p - a.p) for a, b in zip(
        kit.targets_of(str(job.program)), kit.targets_of(job.out.read_text()), strict=True)]) @ up
    push, times = 120 * np.sin(np.radians(115)), np.ones(count)
    for _ in range(20):
        deeper = 1e3 * (rise(np.ones(count)) - rise(times) - sent)
        times = 1 + 200 * deeper / push
    (tmp_path / "first.csv").write_text(job.forces)
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    job.forces = text(times)
    run = job.correct("--json", "--force", "--keep-targets", "--logged-with", tmp_path / "applied.csv", "--first-forces",
                      tmp_path / "first.csv")
    assert run.code == 0, run
    found = of_code(run, "CS3243")
    assert [(one["level"], one["file"]) for one in found] == [("note", str(tmp_path / "part.mod"))] * (by == "passes")
    inner = deeper[3:-3]
    before = push / np.median(2 - 1e3 * rise(np.ones(count))[3:-3]) * np.exp(0.8**2 / 2)
    weights = np.array([(inner @ inner / (2 * np.abs(inner).sum())) ** 2, 1 / (before**2 * np.expm1(0.8**2))])
    value, std = weights @ [200, before] / weights.sum(), weights.sum() ** -0.5
    assert all(one["message"] == f"in slots, from two passes: {value:.3g} +- {2 * std:.2g} N/mm (2 sigma) along the tool's axis"
               for one in found)


@pytest.mark.parametrize(("fit", "option", "code", "exit_code", "words"), [
    ({}, "", "", 0, ""), ({"model_check": {"rejected": False, "p_value": 1e-5, "seen": "a trend"}}, "", "", 0, ""),
    ({"model_check": {"rejected": False}}, "--accept-rejected", "", 0, ""),
    ({"model_check": {"rejected": True, "p_value": 2e-4, "seen": "a trend"}}, "", "CS1022", 3, "it (p = 0.0002: a trend)"),
    ({"model_check": {"rejected": True, "p_value": 0.2, "seen": "a trend"}}, "", "CS1022", 3, "reject it (a trend)"),
    ({"model_check": {"rejected": True}}, "--accept-rejected", "CS1023", 0, "reject it (it does not explain them)"),
    ({"model_check": {"rejected": False, "seen": "this or that"}, "diagnosis": "ambiguous"}, "", "CS1027", 0, "(this or that)"),
    ({"model_check": {"rejected": False, "seen": "this or that"}, "diagnosis": "named"}, "", "", 0, ""),
    ({"model_check": {"rejected": True, "seen": "this or that"}, "diagnosis": "ambiguous"}, "", "CS1022", 3, "(this or that)")])
def test_what_load_tests_say_of_their_own_model_decides_whether_it_is_used(
    tmp_path: Path, fit: dict[str, object], option: str, code: str, exit_code: int, words: str
) -> None:
    """A rejected one is refused, also where it leaves causes open; asked for all the same it is used with a warning."""
    job = Job(tmp_path, program=line(5, 10).program(), stiffness=kit.stiffness_text(fit=fit),
              forces=HEAD + "".join(f"{k},60,90,-120\n" for k in range(5)))
    run = job.predict("--json", *([option] if option else []))
    assert run.code == exit_code, run
    found = [one for one in run.json["findings"] if one["code"] in ("CS1022", "CS1023", "CS1027")]
    assert [(one["code"], one["level"], one["file"]) for one in found] == [
        (code, "error" if exit_code else "warning", str(tmp_path / "stiffness.json"))] * bool(code)
    assert all(words in one["message"] for one in found)


@pytest.mark.parametrize(("count", "more"), [(20, ""), (21, "1 more target"), (25, "5 more targets")])
@pytest.mark.parametrize("code", ["CS4106", "CS4103"])
def test_of_many_targets_that_stop_the_job_the_rest_is_counted(tmp_path: Path, code: str, count: int, more: str) -> None:
    """Twenty are told, and how many there are more, with the first of these."""
    moves = []
    for k in range(count):
        move = at([10, 10, 10, 20, 0.04 + 0.002 * k if code == "CS4106" else 20, 30]).splitlines()[4]
        moves.append(move if code == "CS4106" else re.sub(r"(\],\[)-?\d\.\d+", rf"\g<1>{2 + 0.01 * k:.2f}", move, count=1))
    job = Job(tmp_path, kit.cell_text(), kit.module(moves), forces=HEAD + "".join(f"{k},1,0,0\n" for k in range(count)))
    run = job.correct("--json")
    found = of_code(run, code)
    assert run.code == (3 if code == "CS4106" else 1), run
    words = {"CS4106": "at the wrist singularity after correction, or past it",
             "CS4103": "with force and an unusable quaternion"}[code]
    assert len(found) == (21 if more else 20)
    assert [(one["target"], one["line"], one["message"]) for one in found[20:]] == (
        [(20, 25, f"{more} {words}")] if more else [])


@pytest.mark.parametrize("force", [0, 60])
def test_where_nothing_is_predicted_no_correction_is_advised(tmp_path: Path, force: int) -> None:
    """`correct` would be refused."""
    job = Job(tmp_path, program=kit.module([kit.move(text) for text in line(5, 10).text]),
              forces=HEAD + "".join(f"{k},{force},{force},{-force}\n" for k in range(5)))
    run = job.predict("--report", tmp_path / "page.html")
    assert run.code == 0, run
    page = (tmp_path / "page.html").read_text()
    assert ("next: compstiff correct" in run.err) == ("compstiff correct" in page) == bool(force)
    assert ("NOTHING PREDICTED" in page) == ("There is nothing to correct" in page) == (not force)
    assert f"{5 if force else 0} with force" in run.out


@pytest.mark.parametrize(("limit", "word"), [
    (100, "WITHIN THE TOLERANCE ONCE CORRECTED"), (1, "THE TOLERANCE MAY FAIL EVEN CORRECTED")])
def test_a_budget_is_told_in_the_terminal_and_judged_on_the_page(tmp_path: Path, limit: int, word: str) -> None:
    """By a tolerance that is kept and by one that is not; the figures of both are those of --json."""
    job = Job(tmp_path, program=kit.module([kit.move(text) for text in line(5, 10).text]),
              forces=HEAD + "".join(f"{k},60,90,-120\n" for k in range(5)))
    options = ("--budget", "--tolerance-um", limit, "--report", tmp_path / "page.html", "--force")
    told = job.predict(*options, "--json").json["result"]["budget"]
    run = job.predict(*options)
    assert run.code == 0, run
    two = told["two_sigma_um"]
    assert (f"error budget for {limit} um: uncorrected {told['uncorrected_over']} of 5 targets over it; corrected, two sigma "
            f"are {two['rms']:.1f} um RMS, {two['largest']:.1f} um at most, and {told['over']} over it") in run.out
    assert told["over"] == (5 if limit == 1 else 0)
    assert ("  may fail at lines 5 to 9: up to" in run.out) == (limit == 1)
    over = of_code(job.predict(*options, "--json"), "CS3205")
    assert [(one["message"], one["file"], one["line"]) for one in over] == [
        ("5 of 5 targets are expected over the tolerance of 1 um: two sigma are up to "
         f"{two['largest']:.0f} um there", str(tmp_path / "part.mod"), 5)] * (limit == 1)
    assert word in (tmp_path / "page.html").read_text()
    causes = {cause: of for cause, of in told["causes"].items() if of["two_sigma_um"]["largest"]}
    assert sum(" % of the tolerance (two sigma" in text for text in run.out.splitlines()) == len(causes) > 2
    for remedy in told["remedies"]:
        assert (f"  gains {remedy['gain_um']:.1f} um of {two['rms']:.1f} (then {remedy['over']} over): {remedy['do']} "
                f"[{remedy['effort']}]") in run.out


@pytest.mark.parametrize(("largest", "said"), [(1.9, True), (2.1, False)])
def test_forces_that_hardly_move_the_tool_are_told(tmp_path: Path, largest: float, said: bool) -> None:
    """By the independent arm's deviation [um], largest at the last of three targets, with the force that is logged there."""
    path = line(3, 10)
    way = [kit.deviation(IRB6660, q, TOOL.p, np.r_[60.0, 90, -120, 0, 0, 0], K) for q in path.q]
    times = largest / (1e6 * np.linalg.norm(way[2]))
    size = times * np.linalg.norm([60, 90, -120])
    job = Job(tmp_path, program=path.program(), forces=HEAD + "".join(
        f"{k},{','.join(f'{share * times * x:.9f}' for x in (60, 90, -120))}\n" for k, share in enumerate((0.3, 0.6, 1))))
    run = job.predict("--json")
    assert run.code == 0, run
    assert [(one["level"], one["file"], one["message"]) for one in of_code(run, "CS4125")] == [
        ("warning", str(tmp_path / "part.mod"),
         f"the largest predicted deviation is {largest:.2g} um, with forces of up to {size:.3g} N")] * said


def test_two_passes_tell_the_cut_where_most_of_the_program_pushes_along_its_feed(tmp_path: Path) -> None:
    """42 targets that are pushed to the left, as in climb milling, by 300 N/mm more where they stand deeper; 48 against the
    feed."""
    path = line(90, 2)
    feed, left, _ = sideways(path)
    push = np.where(np.arange(90) < 42, 90.0, 0.0)
    forces = np.outer(np.where(push > 0, 60.0, -60.0), feed) + np.outer(push, left)

    def text(times: np.ndarray) -> str:
        return HEAD + "".join(f"{k},{','.join(f'{x:.9f}' for x in force)}\n" for k, force in enumerate(times[:, None] * forces))

    job = Job(tmp_path, program=path.program(), forces=text(np.ones(90)))
    assert job.correct("--keep-targets").code == 0
    (tmp_path / "first.csv").write_text(job.forces)
    (tmp_path / "applied.csv").write_bytes(job.offsets_file.read_bytes())
    sent = np.array([kit.work_object().r.apply(b.p - a.p) for a, b in zip(
        kit.targets_of(str(job.program)), kit.targets_of(job.out.read_text()), strict=True)]) @ left
    aside = kit.deviation(IRB6660, np.array(path.q), TOOL.p, np.pad(forces, ((0, 0), (0, 3))), K) @ left
    # Where the force is the share g more the tool stands by -sent - g aside deeper.
    job.forces = text(1 + np.where(push > 0, -3e5 * sent / (90 + 3e5 * aside), 0.0))
    run = job.correct("--json", "--force", "--keep-targets", "--logged-with", tmp_path / "applied.csv", "--first-forces",
                      tmp_path / "first.csv")
    assert run.code == 0, run
    found = run.json["result"]["cutting_stiffness"]
    assert (found["origin"], found["followed"]) == ("passes", True)
    assert found["n_per_mm"] == pytest.approx(300, rel=0.05)


def test_what_stating_the_cut_would_gain_goes_by_the_targets_that_are_pushed_across(tmp_path: Path) -> None:
    """Four of ten are; as if it were the middle of what their push allows (docs/formats.md: 0.75 of it by 0.75 mm, log-normal
    to 0.8), stated to 0.4 of its logarithm."""
    path = line(10, 5)
    feed, left, _ = sideways(path)
    forces = [60 * feed + 90 * left if k < 4 else -60 * feed for k in range(10)]
    job = Job(tmp_path, program=path.program(), forces=HEAD + "".join(
        f"{k},{','.join(f'{x:.9f}' for x in force)}\n" for k, force in enumerate(forces)))
    options = ("--json", "--force", "--budget", "--tolerance-um", "50")
    told = job.predict(*options).json["result"]["budget"]["remedies"]
    (remedy,) = (one for one in told if one["do"].startswith("state the cut in cell.yaml"))
    value = 90.0 * np.exp(0.8**2 / 2)
    stated = job.predict(*options, "--cutting-stiffness", f"{value}:{value * np.sqrt(np.expm1(0.4**2))}")
    assert remedy["two_sigma_um"] == pytest.approx(stated.json["result"]["budget"]["two_sigma_um"], rel=1e-3)
