"""Do what the documentation says with the jobs of stock_jobs.py, and measure what becomes of the first part.

    python benchmarks/stock_judge.py [--table | --own] FOLDER [JOB ...]

Each job's commands.txt is run as it stands (--table: with the coefficients of the table in place of those of A's log; --own:
B is corrected by a log of its own first pass, as in a shop that knows no stock); then B as planned and B as corrected are
driven by the true arm through the true stock, where the tool cuts what it meets where it really stands. Distances are across
the planned curve, where the planned tool cuts. Stated sigma is `left_um` of offsets.csv. `judged.json` of each job has the
figures.
"""

import csv
import json
import pathlib
import re
import resource
import subprocess
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from shop_judge import changed, rms
from shop_path import Path, World
from shop_posts import Program
from stock_cut import drive
from stock_jobs import cutter_of, fine, milled, speeds, stock_of

MADE = ("stiffness.json", "stiffness_extended.json", "diagnosis.json", "cutting.json", "cutting_c.json", "left.npz",
        "deviation.csv",        "offsets.csv", "out.mod", "out.mod.json", "job.mod", "job.mod.json")


def spent() -> float:
    """CPU seconds of this process and of those it started."""
    return sum(u.ru_utime + u.ru_stime for u in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))


def run(folder: pathlib.Path, line: str) -> dict:
    """One command as typed, with --json; what it said on stderr is kept beside."""
    words, begin = line.split(), spent()
    done = subprocess.run([*words, "--json", "--force"], cwd=folder, capture_output=True, text=True, check=False)
    name = words[1] + ("_c" if "cell_c" in line else "")
    (folder / f"{name}.stderr").write_text(done.stderr)
    (folder / f"{name}.stdout.json").write_text(done.stdout)
    try:
        answer = json.loads(done.stdout)
    except json.JSONDecodeError:
        answer = {"exit_code": done.returncode, "findings": [{"level": "error", "code": "NONE", "message": done.stderr[-400:]}]}
    answer["seconds"] = spent() - begin
    if "Traceback" in done.stderr or "RuntimeWarning" in done.stderr:
        answer["findings"].append({"level": "error", "code": "PYTHON", "message": done.stderr[-300:]})
    return answer


def matched(planned: list[dict], new: list[dict]) -> list[int]:
    """For each planned move the one of the corrected program that ends where it does, in order, by least distance."""
    a, b = (np.array([m["to"][0] for m in d]) for d in (planned, new))
    come = np.zeros((len(a), len(b)), int)
    best = np.full(len(b), np.inf)
    best[0] = np.linalg.norm(a[0] - b[0])
    for i in range(1, len(a)):
        low = np.minimum.accumulate(best)
        first = np.maximum.accumulate(np.where(np.concatenate([[True], best[1:] < low[:-1]]), np.arange(len(b)), 0))
        come[i, 1:] = first[:-1]
        best = np.concatenate([[np.inf], low[:-1] + np.linalg.norm(a[i] - b[1:], axis=1)])
    out = [len(b) - 1]
    for i in range(len(a) - 1, 0, -1):
        out.append(int(come[i, out[-1]]))
    return out[::-1]


def across(path: Path, s: np.ndarray, points: np.ndarray, window: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    """Of points that stand near lengths s of the planned path the length of the nearest place, and the way from it (n, 3)."""
    p, at = path.place, path.s
    chord = np.diff(p, axis=0)
    square = np.maximum((chord ** 2).sum(1), 1e-18)
    first = np.searchsorted(at, s - window).clip(1, len(at) - 1) - 1
    last = np.searchsorted(at, s + window).clip(1, len(at) - 1)
    out, off = np.empty(len(points)), np.empty((len(points), 3))
    for i, x in enumerate(points):
        a, b = first[i], last[i]
        share = np.clip(((x - p[a:b]) * chord[a:b]).sum(1) / square[a:b], 0, 1)
        away = x - p[a:b] - share[:, None] * chord[a:b]
        k = int(np.argmin((away ** 2).sum(1)))
        out[i], off[i] = at[a + k] + share[k] * np.sqrt(square[a + k]), away[k]
    return out, off


def rows_of(file: pathlib.Path) -> list[dict]:
    with file.open(encoding="utf-8") as f:
        return list(csv.DictReader(line for line in f if not line.startswith("#")))


def number(row: dict, *names: str) -> np.ndarray:
    return np.array([float(row[n]) if row.get(n) not in ("", None) else np.nan for n in names])


def target_at(driven: list[dict], path: Path, style: str) -> dict[int, float]:
    """Length along the path at which each target is reached, by its number; of loops and handed targets each turn counts."""
    at, count = {}, 0
    for m, end in zip(driven, path.ends, strict=True):
        count += 1 + (m["via"] is not None)
        at[count - 1 if style in ("array", "routine") else m["index"] + (m["via"] is not None)] = float(path.s[end])
    return at


def forces(folder: pathlib.Path, world: World, at: dict[int, float], path: Path, true_force: np.ndarray) -> dict:
    """The force on the plan that B was corrected for, by the offsets and the true springs, against the true one on the plan."""
    rows = [r for r in rows_of(folder / "offsets.csv") if int(r["target"]) in at]
    s = np.array([at[int(r["target"])] for r in rows])
    o = np.array([number(r, "ox_mm", "oy_mm", "oz_mm") for r in rows])
    i = np.searchsorted(path.s, s - 1e-9).clip(0, len(path.s) - 1)
    q = world.angles(path.place[i], path.rot[i])
    zero = np.zeros((len(i), 3))
    give = np.stack([(world.tcp(q, zero + 100 * e) - world.tcp(q, zero)) / 100 for e in np.eye(3)], 2)
    said = -np.einsum("nij,nj->ni", np.linalg.inv(give), np.nan_to_num(o))
    def there(x: float) -> np.ndarray:
        return np.stack([np.interp(s + x, path.s, true_force[:, k]) for k in range(3)], 1)
    true, size = there(0), np.linalg.norm(there(0), axis=1)
    steady = np.all([np.linalg.norm(there(x) - true, axis=1) < 0.15 * size for x in (-0.7, 0.7)], axis=0)
    use = steady & (size > 0.15 * size.max(initial=1e-9))
    result = {"true_n": float(np.median(size[use])) if use.any() else None, "compared": int(use.sum())}
    use &= np.linalg.norm(said, axis=1) > 0.05 * size                  # those that were corrected
    if use.any():
        f, g = said[use], true[use]
        angle = np.degrees(np.arccos(np.clip((f * g).sum(1) / (np.linalg.norm(f, axis=1) * size[use]), -1, 1)))
        result |= {"ratio": float((f * g).sum() / (g * g).sum()), "angle": float(np.median(angle)),
                   "none": 1 - int(use.sum()) / result["compared"]}
    return result


def commands(folder: pathlib.Path, forces_from: str) -> list[str]:
    """The lines to run: those of commands.txt, or what they would be with the table, or a log of B's own pass."""
    lines = (folder / "commands.txt").read_text().splitlines()
    if forces_from == "table":
        bare = "compstiff cutting cell.yaml part_a.mod -o cutting.json"
        return [bare if line.endswith("-o cutting.json") else line for line in lines]
    if forces_from == "own":
        lines = [line for line in lines if " cutting " not in line and " predict " not in line]
        lines[-1] = re.sub(r"--predict-force \S+ --stock \S+", "--forces part_b.forces.csv --tare 0:1", lines[-1]).replace(
            "cell.yaml", "cell_b.yaml")
    return lines


def judge(folder: pathlib.Path, forces_from: str = "log") -> dict:
    begin = spent()
    truth = json.loads((folder / "truth.json").read_text())
    result: dict = {"job": folder.name, "shape": truth["shape"], "shape_a": truth["shape_a"], "hidden": truth["hidden"],
                    "material": truth["material"], "exit": {}, "findings": {}, "text": [], "seconds": {}}
    for old in [folder / name for name in MADE] + list(folder.glob("out/*")):
        old.unlink(missing_ok=True)
    (folder / "out").mkdir(exist_ok=True)
    extended = False
    for line in commands(folder, forces_from):
        words = line.replace("stiffness.json", "stiffness_extended.json") if extended and " identify " not in line else line
        done = run(folder, words)
        if any(f["code"] == "CS1022" for f in done["findings"]) and not extended:      # what the refusal and the FAQ say to do
            run(folder, "compstiff diagnose cell.yaml measurements.csv -o diagnosis.json --extended stiffness_extended.json")
            extended = result["rejected"] = True
            done = run(folder, line.replace("stiffness.json", "stiffness_extended.json"))
        name = line.split()[1] + ("_c" if "cell_c" in line else "")
        result["exit"][name], result["seconds"][name] = done["exit_code"], round(done["seconds"], 1)
        for f in done["findings"]:
            key = f"{f['level'][0].upper()} {f['code']}"
            result["findings"][key] = result["findings"].get(key, 0) + 1
            if f["level"] != "note" or f["code"] in ("CS4747", "CS4748", "CS4749"):
                result["text"].append(f"{name}: {f['level']} {f['code']}: {f.get('message', '')}")
        if name == "cutting" and (done.get("result") or {}).get("mean"):
            result["coefficients"] = done["result"]["mean"], done["result"].get("std"), done["result"].get("log")
        if done["exit_code"] and name != "predict":
            break
    names = truth["files"]["B"]
    before = {f: (folder / f).read_bytes() for f in names}
    driven = [m for m in Program(before).driven if m["kind"] != "AbsJ"]
    world, cutter, rpm = World(truth), cutter_of(truth["real_cutter"]["B"]), truth["real_rpm"]["B"]
    stock = stock_of(truth["real_stock"]["B" if "B" in truth["real_stock"] else "C"])
    left = folder / "truth_left.npy"
    earlier = np.load(left) if left.exists() else None
    path = fine(driven, cutter)
    on_plan = drive(path.place, speeds(path), rpm, cutter, stock, earlier=earlier)
    plain = milled(world, path, cutter, stock, rpm, earlier)
    cuts = on_plan.area > 1e-6
    s0, off0 = across(path, path.s, plain.place)
    d0 = 1000 * np.linalg.norm(off0, axis=1)
    result |= {"steps": int(cuts.sum()), "before_rms": rms(d0[cuts]), "before_max": float(d0[cuts].max()),
               "mean_n": float(np.linalg.norm(plain.force[cuts], axis=1).mean()), "a_mean_n": truth["mean_n"]["A"]}
    at = target_at(driven, path, truth["styles"]["B"])
    if (folder / "offsets.csv").exists():
        result |= forces(folder, world, at, path, on_plan.force)
    after = {f: p.read_bytes() for f in names if (p := folder / "out" / f if len(names) > 1 else folder / "out.mod").exists()}
    if after and (folder / "offsets.csv").exists():
        result["changed"] = changed(before, after) if len(names) == 1 else []
        new = [m for m in Program(after).driven if m["kind"] != "AbsJ"]
        match = matched(driven, new)
        there = fine(new, cutter)
        mended = milled(world, there, cutter, stock, rpm, earlier)
        near = np.interp(there.raw, there.raw[[there.ends[j] for j in match]], path.s[path.ends])
        s1, off1 = across(path, near, mended.place)
        d1 = 1000 * np.linalg.norm(off1, axis=1)
        cuts1 = np.interp(s1, path.s, cuts.astype(float)) > 0.5
        rows = [r for r in rows_of(folder / "offsets.csv") if int(r["target"]) in at]
        where = np.array([at[int(r["target"])] for r in rows])
        sigma, before_it = np.array([number(r, "left_um")[0] for r in rows]), np.append(where[:1], where[:-1])
        added = [(a + float(share) * (b - a), float(left)) for a, b, r in zip(before_it, where, rows, strict=True)
                 for share, left in zip(r["added"].split(), r["added_left_um"].split(), strict=True)]
        where_said, sigma = np.append(where, [p for p, _ in added]), np.append(sigma, [v for _, v in added])
        kept = np.isfinite(sigma)
        order = np.argsort(where_said[kept])
        stated = np.interp(s1, where_said[kept][order], sigma[kept][order]) if kept.any() else np.full(len(s1), np.nan)
        gain = np.interp(s1, s0, d0)
        worse = cuts1 & (d1 - gain > 2 * np.maximum(stated, 0.5))
        notes: dict[str, int] = {}
        hit = np.interp(where, path.s, cuts.astype(float)) > 0.5
        for r, h in zip(rows, hit, strict=True):
            untouched = not np.any(np.abs(np.nan_to_num(number(r, "ox_mm", "oy_mm", "oz_mm"))) > 5e-5)
            if h and untouched:
                why = re.sub(r"\d+(\.\d+)?", "#", r.get("note") or "no note")[:70]
                notes[why] = notes.get(why, 0) + 1
        k = int(np.argmax(np.where(cuts1, d1 - gain, -np.inf)))
        result |= {"after_rms": rms(d1[cuts1]), "after_max": float(d1[cuts1].max()), "gone": 1 - rms(d1[cuts1]) / rms(d0[cuts]),
                   "worse_share": float(np.mean(worse[cuts1])), "worst": float(d1[k] - gain[k]), "worst_s": float(s1[k]),
                   "worst_at": [round(float(v), 2) for v in there.place[k]],
                   "within1": float(np.mean(d1[cuts1] <= stated[cuts1] + 0.1)),
                   "within2": float(np.mean(d1[cuts1] <= 2 * stated[cuts1] + 0.1)), "sigma_rms": rms(stated[cuts1]),
                   "added": len(new) - len(driven), "targets": len(rows), "cutting_targets": int(hit.sum()),
                   "left_alone": notes}
        np.savez(folder / "judged.npz", s=s1, d=d1, before=gain, stated=stated, cuts=cuts1, place=there.place, off=off1,
                 force=mended.force, s0=path.s, d0=d0, off0=off0, force0=plain.force, plan_force=on_plan.force, cuts0=cuts,
                 place0=path.place, area0=plain.area, depth0=plain.depth)
    result["cpu"] = round(spent() - begin, 1)
    (folder / "judged.json").write_text(json.dumps(result, indent=1, default=float))
    return result


def line_of(r: dict) -> str:
    def show(key: str, form: str) -> str:
        return format(r[key], form) if r.get(key) is not None else "-".rjust(int(form.split(".")[0].rstrip("%") or 3))
    exits = "".join(str(v) for v in r["exit"].values()) + ("x" if r.get("rejected") else "")
    other = {k: v for k, v in r["findings"].items() if k[0] != "N"}
    return " ".join([
        f"{r['job']:6} {r['shape']:10} {r['shape_a']:9} {r['material'][:5]:5} {r['hidden']:8} {exits:6}",
        *(show(key, form) for key, form in COLUMNS),
        " ".join(k + (f"x{v}" if v > 1 else "") for k, v in sorted(other.items())),
        "; ".join(f"{v} alone: {k}" for k, v in r.get("left_alone", {}).items()), " | ".join(r.get("changed", []))])


COLUMNS = (("mean_n", "4.0f"), ("before_rms", "6.1f"), ("before_max", "6.0f"), ("after_rms", "6.1f"), ("after_max", "6.0f"),
           ("gone", "7.1%"), ("worse_share", "6.1%"), ("worst", "6.1f"), ("within1", "5.0%"), ("within2", "5.0%"),
           ("sigma_rms", "6.1f"), ("ratio", "6.3f"), ("angle", "5.1f"), ("none", "4.0%"))
HEAD = ("job    shape      A         mater hidden   exits   N  before    max  after    max    gone  worse  worst in 1s in 2s"
        "  sigma  ratio angle none findings; targets in the cut left alone")


def summary(all_of: list[dict]) -> str:
    done = [r for r in all_of if "gone" in r]
    lines = [f"{len(done)} of {len(all_of)} corrected"]
    for name in ("nothing hidden", "hidden"):
        rs = [r for r in done if (r["hidden"] == "none") == (name != "hidden")]
        if not rs:
            continue
        v = {key: np.array([r[key] for r in rs if r.get(key) is not None]) for key in (
            "gone", "within1", "within2", "worse_share", "ratio", "angle")}
        lines.append(f"{name}: {len(rs)} jobs, gone median {np.median(v['gone']):.1%} least {v['gone'].min():.1%}; within 1 "
                     f"sigma {v['within1'].mean():.0%}, 2 sigma {v['within2'].mean():.0%} (least {v['within2'].min():.0%}); "
                     f"worse by 2 sigma: mean {v['worse_share'].mean():.1%}")
        if len(v["ratio"]):
            lines[-1] += (f"; predicted over true force median {np.median(v['ratio']):.3f} ({v['ratio'].min():.3f} to "
                          f"{v['ratio'].max():.3f}), angle {np.median(v['angle']):.1f}")
    for r in all_of:
        if "gone" not in r:
            lines.append(f"not corrected: {r['job']} {r['shape']} (A {r['shape_a']}): {(r['text'] or ['?'])[-1][:230]}")
    return "\n".join(lines)


if __name__ == "__main__":
    source = next((word[2:] for word in sys.argv[1:] if word in ("--table", "--own")), "log")
    where, *jobs = [word for word in sys.argv[1:] if not word.startswith("--")]
    root = pathlib.Path(where)
    print(HEAD)
    results = []
    for job in jobs or sorted(p.name for p in root.iterdir() if p.is_dir()):
        results.append(judge(root / job, source))
        print(line_of(results[-1]), flush=True)
    print(summary(results))
