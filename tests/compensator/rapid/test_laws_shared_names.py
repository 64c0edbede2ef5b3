"""Targets without force never move: whatever shares a name with a corrected target still goes where it went.

The programs are drawn; where each move goes is worked out here, by a table of declarations that is replaced line by line.
"""

from __future__ import annotations

import re
from random import Random

import numpy as np
import pytest

from compensator.rapid import read_rapid, rewrite
from compensator.toolpath import Move

UNUSED = "[9E9,9E9,9E9,9E9,9E9,9E9]"
STORAGE = ("CONST ", "PERS ", "LOCAL CONST ", "LOCAL PERS ", "TASK PERS ", "VAR ")
DECLARED = re.compile(r"(?i)(?:CONST|PERS|VAR) robtarget (\w+)(?:\{\d\})?:=(.*?);")
NUMBER = r"(-?[\d.]+)"


def drawn(seed: int) -> tuple[str, list[int]]:
    """A program in which few names serve many moves, inline numbers and aliases among them; and the moves that have force."""
    random = Random(seed)
    names = [f"p{k}" for k in range(random.randint(1, 4))]

    def target() -> str:
        return f"[[{random.randint(0, 99)},{random.randint(0, 99)},5],[1,0,0,0],[0,0,0,0],{UNUSED}]"

    declared = [f"{random.choice(STORAGE)}robtarget {name}:={target()};" for name in names]
    declared += [f"CONST robtarget alias:={names[0]};", f"LOCAL CONST robtarget list{{2}}:=[{target()},{names[-1]}];"]
    moves, inline = [], 0
    for _ in range(random.randint(2, 12)):
        name = random.choice([*names, *names, names[0].upper(), "alias", "list{1}", "list{2}", target(),
                              f"Offs({names[0]},1,2,3)", f"RelTool({names[-1]},0,0,4)"])
        via = random.choice(names)
        kind = random.choice(["MoveL {0}", "MoveL {0}", "MoveJ {0}", "MoveC {1},{0}"])
        inline += 1 + kind.startswith("MoveC")
        moves.append(f"    {kind.format(name, via)},v50,z1,tool0;")
    other = random.choice(["", f"    TriggL {names[0]},v50,gun,z1,tool0;", f"    use {names[-1]};", f"    q:={names[0]};"])
    text = "MODULE A\n" + "".join(f"  {line}\n" for line in declared) + "  VAR robtarget q;\n  PROC main()\n"
    text += "\n".join([*moves, other]) + "\n  ENDPROC\nENDMODULE\n"
    return text, [k for k in range(inline) if random.random() < 0.5]


def place(word: str, text: str) -> np.ndarray:
    """Where a word of a move leads (3,) [mm], by the declarations in the text alone."""
    word = word.strip()
    shifted = re.fullmatch(rf"(?:Offs|RelTool)\((.*),{NUMBER},{NUMBER},{NUMBER}\)", word)
    if shifted:         # no target is turned: the tool's axes are those of the object
        return place(shifted[1], text) + [float(shifted[k]) for k in (2, 3, 4)]
    numbers = re.match(rf"\[\[{NUMBER},{NUMBER},{NUMBER}\]", word)
    if numbers:
        return np.array([float(numbers[k]) for k in (1, 2, 3)])
    element = re.fullmatch(r"(\w+)\{(\d)\}", word)
    values = {name.lower(): value for name, value in DECLARED.findall(text)}
    if element:
        return place(parts(values[element[1].lower()][1:-1])[int(element[2]) - 1], text)
    return place(values[word.lower()], text)


def parts(text: str) -> list[str]:
    """Split at the commas that stand in no bracket."""
    found, depth = [""], 0
    for letter in text:
        depth += (letter in "[(") - (letter in "])")
        if letter == "," and not depth:
            found.append("")
        else:
            found[-1] += letter
    return found


def goes(text: str) -> list[np.ndarray]:
    """Where the moves go, in the order of the text."""
    found = []
    for kind, rest in re.findall(r"^ *(Move[LJC]) (.*);$", text, re.MULTILINE):
        found += [place(word, text) for word in parts(rest)[:1 + (kind == "MoveC")]]
    return found


def other_uses(text: str) -> dict[str, list[float]]:
    """Where the names lead that something else than a move names."""
    lines = re.findall(r"^ *((?:TriggL|use) .*;|q:=.*;)$", text, re.MULTILINE)
    return {line: place(re.split(r"[ =]", line)[1].split(",")[0].rstrip(";"), text).tolist() for line in lines}


@pytest.mark.parametrize("first", range(0, 400, 50))
def test_moves_without_force_go_where_they_went(first: int) -> None:
    shared = 0
    for seed in range(first, first + 50):
        text, loaded = drawn(seed)
        program = read_rapid(text.encode())
        free = np.flatnonzero((program.toolpath.block == "") & (program.toolpath.move != Move.ABSOLUTE))
        forced = np.intersect1d(np.array(loaded, dtype=int), free)
        by = np.random.default_rng(seed).choice([0.1, 0.25, 0.4], (len(forced), 1)) * np.array([1.0, -1.0, 0.5])
        position, quaternion = program.toolpath.position[forced] + 1e-3 * by, program.toolpath.quaternion[forced]
        written = rewrite(program, forced, position, quaternion).content.decode()
        before, after = goes(text), goes(written)
        moved = np.zeros((len(before), 3))
        moved[forced] = by
        np.testing.assert_allclose(np.array(after) - before, moved, atol=1e-9, err_msg=f"seed {seed}\n{text}\n{written}")
        assert other_uses(written) == other_uses(text), f"seed {seed}"
        shared += "_c1" in written
    assert shared > 10


def test_a_declaration_that_other_modules_may_name_is_said() -> None:
    for storage, said in (("CONST ", True), ("PERS ", True), ("TASK PERS ", True), ("LOCAL CONST ", False),
                          ("LOCAL PERS ", False)):
        text = (f"MODULE A\n{storage}robtarget p:=[[1,2,3],[1,0,0,0],[0,0,0,0],{UNUSED}];\nPROC main()\n"
                "MoveL p,v50,z1,tool0;\nENDPROC\nENDMODULE\n")
        program = read_rapid(text.encode())
        written = rewrite(program, [0], program.toolpath.position + 1e-4, program.toolpath.quaternion)
        assert written.declarations == 0
        assert [finding.code for finding in written.findings] == (["CS3270"] if said else [])
