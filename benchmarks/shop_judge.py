"""Do what the documentation tells a user with a shop's jobs, and measure what became of the path: shop_jobs.py writes the jobs.

    python benchmarks/shop_judge.py FOLDER [JOB ...]

Each job's commands.txt is run as it stands; then the corrected RAPID is read and driven by the world's own reader and arm,
under the force that belongs to each place. Distances are across the planned curve. `judged.json` of each job has the figures.
"""

import json
import pathlib
import re
import subprocess
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from shop_path import Along, Path, Plan, World
from shop_posts import Program, pieces, statements

LITERAL = r"\[\[[^\[\]]*\],\s*\[[^\[\]]*\],\s*\[[^\[\]]*\],\s*\[[^\[\]]*\]\]"


def mask(line: str) -> str:
    """A line with its targets taken out: what must be the same before and after."""
    line = re.sub(LITERAL, "T", line)
    line = re.sub(r"(?:Offs|RelTool)\([^()]*\)", "T", line)
    line = re.sub(r"aPath\{\d+\}:=\[T(?:,T)*\]", "aPath:=T", line)           # an array may grow, and its loops with it
    line = re.sub(r"^FOR i FROM \d+ TO \d+ DO$", "FOR i DO", line)
    if m := re.match(r"(Move[LJC]) (.*);$", line):
        args = pieces(m[2])
        args[:1 + (m[1] == "MoveC")] = ["T"] * (1 + (m[1] == "MoveC"))
        return f"{m[1]} {','.join(args)}"
    return re.sub(r"^Cut \w+;$", "Cut T;", line)


def changed(before: dict[str, bytes], after: dict[str, bytes]) -> list[str]:
    """What changed beside targets; lines that were added must be moves or targets."""
    wrong = []
    if set(before) != set(after):
        return [f"modules {sorted(before)} became {sorted(after)}"]
    for name in before:
        if (b"\r\n" in before[name]) != (b"\r\n" in after[name]):
            wrong.append(f"{name}: the line ends changed")
        old, new, i = statements(before[name]), statements(after[name]), 0
        masked = [mask(line) for line in old]
        for line in new:
            m = mask(line)
            if i < len(masked) and m == masked[i]:
                i += 1
            elif not re.match(r"Move[LC] T|Cut T;$|(?:LOCAL |TASK )*(?:CONST|PERS|VAR) robtarget \w+:=T;$", m):
                wrong.append(f"{name}: a line that is not a move was added: {line[:90]}")
        if i < len(masked):
            wrong.append(f"{name}: line is gone or changed: {old[i][:90]}")
        notes = [set(re.findall(rb"!.*", d)) for d in (before[name], after[name])]
        if notes[0] - notes[1]:
            wrong.append(f"{name}: a comment changed: {sorted(notes[0] - notes[1])[0]!r}")
    return wrong


def matched(planned: list[dict], new: list[dict]) -> list[int]:
    """For each planned move the one of the corrected program that ends where it does, in order, by least distance."""
    a, b = (np.array([m["to"][0] for m in d]) for d in (planned, new))
    far = np.linalg.norm(a[:, None] - b[None], axis=2)
    n, k = far.shape
    best, come = np.full(k, np.inf), np.zeros((n, k), int)
    best[0] = far[0, 0]
    for i in range(1, n):
        low = np.minimum.accumulate(best)
        arg = np.zeros(k, int)
        for j in range(1, k):
            arg[j] = j if best[j] < low[j - 1] else arg[j - 1]
        best = np.concatenate([[np.inf], low[:-1] + far[i, 1:]])
        come[i, 1:] = arg[:-1]
    out = [k - 1]
    for i in range(n - 1, 0, -1):
        out.append(int(come[i, out[-1]]))
    return out[::-1]


def after(world: World, plan: Plan, planned: list[dict], new: list[dict]) -> tuple[np.ndarray, np.ndarray]:
    """Places along the plan and distance from it [um] of a corrected program, dense."""
    match, path = matched(planned, new), Path(new)
    s = np.interp(path.raw, path.raw[[path.ends[j] for j in match]], plan.path.s[plan.path.ends])
    q = world.angles(path.place, path.rot)
    near = Along(plan, s, 5.0)
    tcp, _, at = world.under_cut(q, near)
    _, foot = near.closest(tcp)
    return at, 1000 * np.linalg.norm(tcp - foot, axis=1)


def perfect(world: World, plan: Plan, planned: list[dict], new: list[dict]) -> list[dict]:
    """The corrected program's own targets, put where the loaded true arm stands on the plan: what could be had."""
    match, path = matched(planned, new), Path(new)
    ends = np.array(path.ends)
    s = np.interp(path.raw, path.raw[ends[match]], plan.path.s[plan.path.ends])[ends]
    place = np.stack([np.interp(s, plan.path.s, plan.path.place[:, k]) for k in range(3)], 1)
    place[match] = [m["to"][0] for m in planned]
    force, _ = plan.at(s)
    command = place.copy()
    for _ in range(3):
        command -= world.tcp(world.angles(command, path.rot[ends]), force) - place
    out = []
    for m, c, at in zip(new, command, place, strict=True):
        moved = c if np.linalg.norm(c - at) > 5e-4 else at
        out.append(m | {"to": [list(moved), *m["to"][1:]]})            # circle points stay as the correction has them
    return out


def judge(folder: pathlib.Path) -> dict:
    """Run the commands of a job, and measure."""
    truth = json.loads((folder / "truth.json").read_text())
    result: dict = {"job": folder.name, "style": truth["style"], "log": truth["log"], "robot": truth["robot"],
                    "shape": truth["shape"], "frame": truth["frame"], "sign": truth["sign"],
                    "further": truth["further"], "depth": truth["knows_depth"],
                    "rate": truth["rate_hz"], "targets": truth["targets"], "exit": [], "findings": {}, "text": []}
    outputs = folder / "stiffness.json", folder / "stiffness_extended.json", folder / "offsets.csv", folder / "out.mod"
    for old in [*outputs, *folder.glob("out*/*"), *folder.glob("out*.json"), *folder.glob("diagnosis.json")]:
        if old.is_file():
            old.unlink()
    lines = (folder / "commands.txt").read_text().splitlines()
    for k, line in enumerate(lines):
        done = run(folder, line)
        if "CS1022" in str(done["findings"]) and k == 1:                # what the refusal and the FAQ say to do
            result["rejected"] = True
            run(folder, "compstiff diagnose cell.yaml measurements.csv -o diagnosis.json --extended stiffness_extended.json")
            done = run(folder, line.replace("--stiffness stiffness.json", "--stiffness stiffness_extended.json"))
        result["exit"].append(done["exit_code"])
        for f in done["findings"]:
            key = f"{f['level'][0].upper()} {f['code']}"
            result["findings"][key] = result["findings"].get(key, 0) + 1
            if f["level"] != "note":
                result["text"].append(f"{f['code']}: {f.get('message', '')}")
    before_files = {f: (folder / f).read_bytes() for f in truth["files"]}
    after_files = {f: p.read_bytes() for f in truth["files"]
                   if (p := folder / "out" / f if len(truth["files"]) > 1 else folder / "out.mod").exists()}
    planned = [m for m in Program(before_files).driven if m["kind"] != "AbsJ"]
    world, path = World(truth), Path(planned)
    plan = Plan(path, planned, truth)
    s0, d0 = after(world, plan, planned, planned)
    cut = plan.cut
    result |= {"before_rms": rms(d0[cut]), "before_max": d0[cut].max()}
    if after_files:
        result["changed"] = changed(before_files, after_files)
        program = Program(after_files)
        new = [m for m in program.driven if m["kind"] != "AbsJ"]
        match = matched(planned, new)
        result["added"] = len(new) - len(planned)
        for m, j in zip(planned, match, strict=True):
            if m["to"][3] != new[j]["to"][3] or m["wobj"] != new[j]["wobj"] or m["tool"] != new[j]["tool"]:
                result["changed"].append(f"frames or axes of the move to {m['to'][0]} changed")
        s1, d1 = after(world, plan, planned, new)
        there = np.interp(s1, path.s, cut.astype(float)) > 0.5
        gain = np.interp(s1, s0, d0)
        worse = np.where(there, d1 - gain, -np.inf)
        k = int(np.argmax(worse))
        result |= {"after_rms": rms(d1[there]), "after_max": d1[there].max(), "gone": 1 - rms(d1[there]) / rms(d0[cut]),
                   "worst": worse[k], "worst_at": new[int(np.searchsorted(Path(new).ends, k)) % len(new)]["to"][0],
                   "could": 1 - rms((a := after(world, plan, planned, perfect(world, plan, planned, new)))[1][
                       np.interp(a[0], path.s, cut.astype(float)) > 0.5]) / rms(d0[cut]),
                   "worse_share": float(np.mean(worse[there] > 5))}
        result |= coverage(folder, planned, path, s1, d1)
    (folder / "judged.json").write_text(json.dumps(result, indent=1, default=float))
    return result


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x ** 2)))


def coverage(folder: pathlib.Path, planned: list[dict], path: Path, s1: np.ndarray, d1: np.ndarray) -> dict:
    """How many targets lie within two sigma of what offsets.csv states as left."""
    found = folder / "offsets.csv"
    if not found.exists():
        return {}
    rows = [r.split(",") for r in found.read_text().splitlines()]
    names, inside, stated = rows[0], [], []
    places = np.array([m["to"][0] for m in planned])
    for r in rows[1:]:
        d = dict(zip(names, r, strict=False))
        if not d.get("left_um") or not d["x_mm"]:
            continue
        far = np.linalg.norm(places - [float(d[c]) for c in ("x_mm", "y_mm", "z_mm")], axis=1)
        if far.min() > 0.01:
            continue
        s = path.s[path.ends[int(np.argmin(far))]]
        near = d1[np.argmin(np.abs(s1 - s))]
        if float(d["left_um"]) == 0 and near < 1:                      # in the air
            continue
        inside.append(near <= 2 * float(d["left_um"]) + 0.1)
        stated.append(float(d["left_um"]))
    return {"coverage": float(np.mean(inside)) if inside else None, "stated": len(inside),
            "left_rms": rms(np.array([0, *stated]))}


def run(folder: pathlib.Path, line: str) -> dict:
    """One command as typed, with --json; its document, and what it said on stderr kept beside."""
    words = line.split()
    done = subprocess.run([*words, "--json", "--force"], cwd=folder, capture_output=True, text=True, check=False)
    name = words[1] + ("_extended" if "stiffness_extended.json" in line and words[1] == "correct" else "")
    (folder / f"{name}.stderr").write_text(done.stderr)
    (folder / f"{name}.stdout.json").write_text(done.stdout)
    try:
        return json.loads(done.stdout.strip().splitlines()[-1] if done.stdout.count("\n") < 3 else done.stdout)
    except (json.JSONDecodeError, IndexError):
        return {"exit_code": done.returncode, "findings": [{"level": "error", "code": "NONE", "message": done.stderr[-500:]}]}


def line_of(r: dict) -> str:
    def number(key: str, form: str) -> str:
        return format(r[key], form) if r.get(key) is not None else "-"
    return " ".join([f"{r['job']:6} {r['style']:8}{r['shape']:8}{r['log']:10}{r['robot'][3:12]:10}{r['frame']:7}{r['sign']:9}"
                     f"{r['further']:5}{r['depth']:7}{'x' if r.get('rejected') else ' '} {r['exit']!s:7}{r['targets']:4}",
                     number("added", "4d"), f"{r['before_rms']:6.0f}{r['before_max']:6.0f}", number("after_rms", "6.1f"),
                     number("after_max", "6.0f"), number("gone", "6.1%"), number("could", "6.1%"),
                     number("worst", "6.1f"), number("worse_share", "5.1%"),
                     number("coverage", "5.0%"), number("left_rms", "5.1f"),
                     " ".join(k + (f"x{v}" if v > 1 else "") for k, v in sorted(r["findings"].items()) if k[0] != "N"),
                     " | ".join(r.get("changed", []))])


if __name__ == "__main__":
    root = pathlib.Path(sys.argv[1])
    print("job style shape log robot frame sign further depth exit targets added before(rms,max) after gone could worst worse",
          "covered left")
    for job in sys.argv[2:] or sorted(p.name for p in root.iterdir() if p.is_dir()):
        print(line_of(judge(root / job)), flush=True)
