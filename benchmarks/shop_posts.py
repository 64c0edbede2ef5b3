"""RAPID as eight shops' posts write it, and a reader of the same that drives it: nothing of the program is imported.

A job's steps are dictionaries: kind (J, L, C, A), place [mm], quat w x y z, via (place, quat) of a C, conf, joints_deg,
feed [mm/s], zone (a name), cut (whether the tool is in the stock), layer.
"""

import re

import numpy as np
from shop_arm import matrix, turned_by, vector

ZONES = {"fine": 0.0, "z0": 0.3, "z1": 1.0, "z5": 5.0, "z10": 10.0, "zFein": 0.5}
STYLES = ("inline", "const", "modules", "offs", "procs", "array", "routine", "arcs")
MAIN = {"const": "Const_Part", "modules": "MainJob"}


class Pen:
    """How one post writes numbers, targets and moves."""

    def __init__(self, style: str, job: dict, rng: np.random.Generator) -> None:
        self.style, self.job = style, job
        self.form = str(rng.choice(["plain", "short", "exponent"]))
        self.nine = str(rng.choice(["9E9", "9E+09"]))
        self.tab = str(rng.choice(["\t", "  ", "    "]))
        self.ext = [self.nine] * 6
        if job.get("table") is not None:
            self.ext[1] = self.number(job["table"])
        self.blank = "" if rng.random() < 0.5 else " "
        self.wobj_word = str(rng.choice(["\\WObj:=", "\\Wobj:=", "\\wobj:="]))
        self.inline_speed = style in ("inline", "arcs") and rng.random() < 0.5

    def number(self, x: float, digits: int = 4) -> str:
        x = round(float(x), digits) + 0.0
        if self.form == "exponent" and 0 < abs(x) < 0.01:
            return f"{x:.4E}"
        text = f"{x:.{digits}f}"
        if self.form == "plain":
            return text
        text = text.rstrip("0")
        if self.form == "short":
            return re.sub(r"^(-?)0\.(?=\d)", r"\1.", text)
        return text.rstrip(".") if text.rstrip(".") not in ("-0", "") else "0"

    def row(self, values: object, digits: int = 4) -> str:
        return "[" + ("," + self.blank).join(self.number(v, digits) for v in values) + "]"  # type: ignore[attr-defined]

    def target(self, place: np.ndarray, quat: np.ndarray, conf: tuple[int, ...]) -> str:
        return f"[{self.row(place)},{self.row(quat, 8)},[{','.join(map(str, conf))}],[{','.join(self.ext)}]]"

    def speed(self, feed: float) -> str:
        if self.inline_speed:
            return f"[{self.number(feed, 2)},500,5000,1000]"
        return f"v{'Air' if feed >= 100 else 'Cut'}{round(feed)}"

    def move(self, step: dict, to: str, via: str | None = None) -> str:
        tail = f"tMill{self.wobj_word}wPart;"
        speed = self.speed(step["feed"])
        if self.style == "arcs" and step["cut"]:
            speed = f"v200\\V:={self.number(step['feed'], 2)}"
        word = {"J": "MoveJ", "L": "MoveL", "C": "MoveC", "A": "MoveAbsJ"}[step["kind"]]
        if step["kind"] == "A":
            return f"{word} {to}\\NoEOffs,{speed},fine,tMill;"
        gap = "," + self.blank
        return f"{word} " + gap.join([*([via] if via else []), to, speed, step["zone"], tail])

    def joints(self, step: dict) -> str:
        return f"[{self.row(step['joints_deg'])},[{','.join(self.ext)}]]"

    def frames(self) -> list[str]:
        job = self.job
        tool, com = job["tool"], job["centre_mm"]
        frame = [f"{self.row(f['place'])},{self.row(f['quat'], 8)}" for f in (job["uframe"], job["oframe"])]
        return [f"PERS tooldata tMill:=[TRUE,[{self.row(tool['place'])},{self.row(tool['quat'], 8)}],"
                f"[{self.number(job['mass_kg'], 2)},{self.row(com)},[1,0,0,0],0,0,0]];",
                f"TASK PERS wobjdata wPart:=[FALSE,TRUE,\"\",[{frame[0]}],[{frame[1]}]];"]

    def speeds(self) -> list[str]:
        feeds = sorted({s["feed"] for s in self.job["steps"]})
        named = [f"CONST speeddata {self.speed(f)}:=[{self.number(f, 2)},500,5000,1000];" for f in feeds]
        return [*(named if not self.inline_speed else []), "CONST zonedata zFein:=[FALSE,0.5,0.5,0.5,0.05,0.5,0.05];"]


def write(style: str, job: dict, rng: np.random.Generator) -> dict[str, bytes]:
    """The job's modules by file name, the one with main first."""
    pen, t = Pen(style, job, rng), ""
    t = pen.tab
    steps, head, body, procs = job["steps"], [], [], []
    if style != "modules":
        head += pen.frames()
    head += pen.speeds()
    lead = {"const": "CONST", "modules": "LOCAL CONST", "procs": "PERS", "array": "CONST"}.get(style)
    ref = next(s for s in steps if s["cut"])
    lines_of: dict[int, list[str]] = {}
    if style == "offs":
        head.append(f"CONST robtarget pRef:={pen.target(ref['place'], ref['quat'], ref['conf'])};")
    if style == "routine":
        cut = next(s for s in steps if s["cut"] and s["kind"] == "L")
        procs += ["LOCAL PROC Cut(robtarget pTo)", f"{t}{pen.move(dict(cut, zone='z0'), 'pTo')}", "ENDPROC", ""]
    array: list[str] = []
    for i, s in enumerate(steps):
        out = lines_of.setdefault(s["layer"], [])
        if s["kind"] == "A":
            out.append(pen.move(s, pen.joints(s)))
            continue
        to, via = pen.target(s["place"], s["quat"], s["conf"]), None
        if s["kind"] == "C":
            via = pen.target(*s["via"], s["conf"])
        if style in ("const", "modules", "procs"):
            name = f"p{10 * (i + 1)}" if style != "procs" else f"pL{s['layer']}_{i}"
            head.append(f"{lead} robtarget {name}:={to};")
            to = name
            if via:
                head.append(f"{lead} robtarget {name}_via:={via};")
                via = f"{name}_via"
        elif style == "offs" and s["kind"] != "J" and np.allclose(s["quat"], ref["quat"], atol=1e-9):
            d = np.round(s["place"], 4) - np.round(ref["place"], 4)
            if not s["cut"] and np.abs(d[:2]).max() < 1e-6 and matrix(ref["quat"])[2, 2] < -0.999999:
                to = f"RelTool(pRef,0,0,{pen.number(-d[2])})"
            else:
                to = f"Offs(pRef,{','.join(pen.number(v) for v in d)})"
        elif style == "array" and s["cut"] and s["kind"] == "L":
            array.append(to)
            if not (steps[i + 1]["cut"] and steps[i + 1]["kind"] == "L"):
                first = len(array) - sum(1 for _ in _run(steps, i)) + 1
                out += [f"FOR i FROM {first} TO {len(array)} DO", t + pen.move(dict(s, zone="z0"), "aPath{i}"), "ENDFOR"]
            continue
        elif style == "routine" and s["cut"] and s["kind"] == "L":
            out.append(f"Cut {to};")
            continue
        if rng.random() < 0.03:
            remarks = ["! Ebene fertig: Maß prüfen", "! next feature -> côté gauche", "! MoveL p0,v5,z0,tool0;"]
            out += ["", str(rng.choice(remarks))]
        out.append(pen.move(s, to, via))
    if array:
        head.append(f"CONST robtarget aPath{{{len(array)}}}:=[{','.join(array)}];")
    layers = sorted(lines_of)
    if style == "procs" and len(layers) > 1:
        head.append("PERS bool bFinish:=TRUE;")
        body = ["ConfL\\Off;", "IF bFinish=FALSE THEN", f"{t}Stop;", "ENDIF", *(f"Layer{n};" for n in layers),
                "TPWrite \"fertig; done\";"]
        for n in reversed(layers):
            procs += [f"PROC Layer{n}()", *(t + line if line else "" for line in lines_of[n]), "ENDPROC", ""]
    else:
        body = ["ConfL\\Off;", "SingArea \\Off;", "SetDO doSpindle,1;", "WaitTime 2;",
                *(x for n in layers for x in lines_of[n]), "SetDO doSpindle,0;"]
    name = MAIN.get(style, "Part")
    text = [f"MODULE {name}", f"{t}! {job['title']}", "", *(t + h for h in head), "", *(t + p if p else "" for p in procs),
            f"{t}PROC main()", *(2 * t + b if b else "" for b in body), f"{t}ENDPROC", "ENDMODULE", ""]
    files = {f"{name}.mod": text}
    if style == "modules":
        files["CellData.mod"] = ["MODULE CellData(SYSMODULE)", *(t + f for f in pen.frames()), "ENDMODULE", ""]
    end, code = str(rng.choice(["\r\n", "\n"])), str(rng.choice(["utf-8", "latin-1"]))
    top = "%%%" + end + "  VERSION:1" + end + "  LANGUAGE:ENGLISH" + end + "%%%" + end if rng.random() < 0.5 else ""
    return {f: (top + end.join(lines)).encode(code) for f, lines in files.items()}


def _run(steps: list[dict], i: int) -> object:
    """The straight cutting steps that end with i."""
    while i >= 0 and steps[i]["cut"] and steps[i]["kind"] == "L":
        yield i
        i -= 1


# ---- reading --------------------------------------------------------------------------------


def pieces(text: str, at: str = ",") -> list[str]:
    """Cut at separators that stand in no bracket and no string."""
    out, depth, quoted, word = [], 0, False, ""
    for c in text:
        quoted ^= c == '"'
        depth += (c in "[({") - (c in "])}") if not quoted else 0
        if c == at and not depth and not quoted:
            out.append(word.strip())
            word = ""
        else:
            word += c
    return [*out, word.strip()]


def statements(data: bytes) -> list[str]:
    """The lines, without comments and blanks at either end; one statement a line, as these posts write."""
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return [re.sub(r'^((?:[^"!]|"[^"]*")*)!.*$', r"\1", line).strip() for line in re.split(r"\r?\n", text)]


class Program:
    """Modules as they are driven from main; `driven` are dictionaries of the moves in order."""

    def __init__(self, files: dict[str, bytes]) -> None:
        self.data: dict[str, object] = {"TRUE": True, "FALSE": False, "v200": [200.0, 500, 5000, 1000]}
        self.data |= {k: [k == "fine", z] for k, z in ZONES.items()}
        self.procs: dict[str, tuple[list[str], list[tuple[int, str]]]] = {}
        self.driven: list[dict] = []
        self.first: dict[int, int] = {}
        count, number, inside = 0, 0, None
        for data in files.values():
            for line in statements(data):
                number += 1
                if m := re.match(r"(?:LOCAL )?PROC (\w+)\((.*)\)$", line):
                    inside = m[1]
                    self.procs[inside] = ([p.split()[-1] for p in m[2].split(",") if p.strip()], [])
                elif line == "ENDPROC":
                    inside = None
                elif inside:
                    self.procs[inside][1].append((number, line))
                    if m := re.match(r"Move(L|J|C|AbsJ) ", line):
                        self.first[number] = count
                        count += 1 + (m[1] == "C")
                elif m := re.match(r"(?:LOCAL |TASK )*(?:CONST|PERS|VAR) \w+ (\w+)(?:\{\d+\})?:=(.*);$", line):
                    self.data[m[1]] = self.value(m[2], {})
        self.targets = count
        self.run("main", {})

    def value(self, text: str, local: dict) -> object:
        text = text.strip()
        if text.startswith("["):
            return [self.value(p, local) for p in pieces(text[1:-1])]
        if text.startswith('"'):
            return text[1:-1]
        if m := re.match(r"(Offs|RelTool)\((.*)\)$", text, re.I):
            args = [self.value(p, local) for p in pieces(m[2])]
            place, quat, *rest = args[0]  # type: ignore[misc]
            shift = np.array(args[1:4], float)
            if m[1].lower() == "reltool":
                shift = matrix(np.array(quat)) @ shift
            return [list(np.array(place) + shift), quat, *rest]
        if m := re.match(r"(\w+)\{(.*)\}$", text):
            return self.value(m[1], local)[int(self.value(m[2], local)) - 1]  # type: ignore[index,call-overload]
        if re.match(r"[A-Za-z]\w*$", text):
            return local[text] if text in local else self.data[text]
        return float(text)

    def run(self, name: str, local: dict) -> None:
        self.block(self.procs[name][1], local)

    def block(self, lines: list[tuple[int, str]], local: dict) -> None:
        i = 0
        while i < len(lines):
            number, line = lines[i]
            if line.startswith(("FOR ", "IF ")):
                word = line.split()[0]
                end = next(j for j in range(i, len(lines)) if lines[j][1] == f"END{word}")
                inner = lines[i + 1:end]
                if m := re.match(r"FOR (\w+) FROM (\S+) TO (\S+) DO$", line):
                    for k in range(int(m[2]), int(m[3]) + 1):
                        self.block(inner, local | {m[1]: k})
                elif line != "IF bFinish=FALSE THEN":
                    raise ValueError(f"a condition that no post wrote: {line}")
                i = end
            elif line.startswith("Move"):
                self.move(number, line, local)
            elif (m := re.match(r"(\w+)\s*(.*);$", line)) and m[1] in self.procs:
                names, _ = self.procs[m[1]]
                self.run(m[1], dict(zip(names, [self.value(p, local) for p in pieces(m[2])], strict=True)) if names else {})
            i += 1

    def move(self, number: int, line: str, local: dict) -> None:
        word, rest = line.rstrip(";").split(" ", 1)
        args = [pieces(a, "\\") for a in pieces(rest)]
        options = {o.split(":=")[0].strip().lower(): o.split(":=")[1] for a in args for o in a[1:] if ":=" in o}
        via = self.value(args.pop(0)[0], local) if word == "MoveC" else None
        to = self.value(args[0][0], local)
        speed, zone = self.value(args[1][0], local), self.value(args[2][0], local)
        feed = float(self.value(options["v"], local)) if "v" in options else speed[0]  # type: ignore[arg-type,index]
        radius = float(self.value(options["z"], local)) if "z" in options else zone[1] * (not zone[0])  # type: ignore[arg-type,index]
        self.driven.append({"kind": word[4:], "to": to, "via": via, "feed": feed, "zone": radius, "tool": args[3][0],
                            "wobj": options.get("wobj"), "number": number, "index": self.first[number]})


def pose(value: list) -> tuple[np.ndarray, np.ndarray]:
    """Place and rotation matrix of a robtarget."""
    return np.array(value[0], float), matrix(np.array(value[1], float))


def between(a: np.ndarray, b: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Even turning from a to b at the shares, (n, 3, 3)."""
    return turned_by(share[:, None] * vector((b @ a.T)[None])[0]) @ a

