"""Every ```bash block of the README and of docs/ runs, page by page in the order of the text, and ends as the page says.

What a page may say of its blocks, in HTML comments: `folder: samples`, `prepared` (more small files) or `empty` once, where its
blocks begin; `measured PLAN to SHEET on ROBOT` where a reader would measure, done by the virtual arm; `milled FOLDER on
ROBOT` where a reader would mill and log, which puts a program with its log there; before a block `exit N`, or `not run: why`. A
```text block behind `prints` stands in the output of the block before it, line by line, where `...` stands for anything.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from benchmarks.same_outputs import prepare
from tests.runs.command_line.test_init import measured
from tests.runs.command_line.workshop import workshop

ROOT = Path(__file__).parents[1]
PAGES = sorted(path for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
STEP = re.compile(r"<!-- (?P<said>[^>]*?) -->|^(?P<indent> *)```(?P<kind>bash|text)\n(?P<text>.*?)^ *```$", re.M | re.S)
SECONDS = 180        # of one block, on a machine that has other work
# Blocks that no test can run here, in all pages: each says why. More than this and somebody has taken the easy way.
MOST_NOT_RUN = 10


@dataclass
class Block:
    """A block of commands, its line in the page, and what is said of it."""

    text: str
    line: int
    exit_code: int = 0
    not_run: str = ""


@dataclass
class Said:
    """A directive, or lines that the block before must have printed."""

    kind: str
    words: tuple[str, ...]


def steps(page: Path) -> list[Block | Said]:
    """What a page does, in order."""
    text = page.read_text(encoding="utf-8")
    found: list[Block | Said] = []
    exit_code, not_run, prints = 0, "", False
    for match in STEP.finditer(text):
        said = match["said"]
        if said is not None:
            if said.startswith("exit "):
                exit_code = int(said.split()[1])
            elif said.startswith("not run: "):
                not_run = said.removeprefix("not run: ").strip()
            elif said == "prints":
                prints = True
            elif said.startswith(("folder: ", "measured ", "milled ")):
                found.append(Said(said.split()[0].rstrip(":"), tuple(said.split()[1:])))
            continue
        content = re.sub(rf"^{match['indent']}", "", match["text"], flags=re.M)
        if match["kind"] == "bash":
            found.append(Block(content, text.count("\n", 0, match.start()) + 1, exit_code, not_run))
            exit_code, not_run = 0, ""
        elif prints:
            found.append(Said("prints", tuple(line for line in content.splitlines() if line.strip(" ."))))
        prints = False
    return found


def environment(folder: Path) -> dict[str, str]:
    """With `compstiff`, `python` and PATH as a reader's shell has them."""
    shims = folder / ".shims"
    shims.mkdir()
    for name, words in (("compstiff", "-m compstiff"), ("python", "")):
        (shims / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {words} "$@"\n')
        (shims / name).chmod(0o755)
    return os.environ | {"PATH": f"{shims}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT),
                         "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "120"}


def do(said: Said, folder: Path, printed: str) -> None:
    """A directive carried out."""
    if said.kind == "folder" and said.words == ("samples",):
        for name in ("cell.yaml", "measurements.csv", "insert.mod", "insert.forces.parquet"):
            shutil.copy(ROOT / "samples" / name, folder)
    elif said.kind == "folder" and said.words == ("prepared",):
        prepare(folder)
    elif said.kind == "measured":
        plan, _, sheet, _, robot = said.words
        measured(folder / plan, folder / sheet, robot)
    elif said.kind == "milled":
        place, _, robot = said.words
        (folder / place / "part.mod").write_text(workshop(robot).files["part.mod"])
        (folder / place / "part.forces.csv").write_text(workshop(robot).files["forces.csv"])
    elif said.kind == "prints":
        for line in said.words:
            pattern = r"\s+".join(".*".join(map(re.escape, word.split("..."))) for word in line.split())
            assert re.search(pattern, printed), f"'{line}' is not in:\n{printed}"


WITH_BLOCKS = [page for page in PAGES if any(isinstance(step, Block) for step in steps(page))]
RUN = [page for page in WITH_BLOCKS if any(isinstance(step, Block) and not step.not_run for step in steps(page))]


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    folder, printed = tmp_path / "reader", ""
    folder.mkdir()
    where = environment(tmp_path)
    assert any(isinstance(step, Said) and step.kind == "folder" for step in steps(page)), "the page says no folder: "
    for step in steps(page):
        if isinstance(step, Said):
            do(step, folder, printed)
        elif not step.not_run:
            done = subprocess.run(["bash", "-euo", "pipefail", "-c", step.text], cwd=folder, env=where, capture_output=True,
                                  text=True, timeout=SECONDS)
            printed = done.stdout + done.stderr
            assert done.returncode == step.exit_code, f"{page.name}, line {step.line}: exit {done.returncode}\n{printed}"


def test_what_is_not_run_says_why_and_is_seldom() -> None:
    reasons = [step.not_run for page in WITH_BLOCKS for step in steps(page) if isinstance(step, Block) and step.not_run]
    assert all(len(reason) > 15 for reason in reasons)
    assert len(reasons) <= MOST_NOT_RUN


def test_every_command_has_a_worked_example() -> None:
    from compstiff.cli.main import COMMANDS

    page = (ROOT / "docs/site/worked_examples.md").read_text(encoding="utf-8")
    shown = dict(re.findall(r"^## (\w+)$(.*?)(?=^## |\Z)", page, re.M | re.S))
    assert set(shown) == set(COMMANDS)
    for name, text in shown.items():
        assert f"compstiff {name}" in "".join(re.findall(r"```bash\n(.*?)```", text, re.S)), name


def test_a_block_that_fails_is_seen(tmp_path: Path) -> None:
    """The collector itself: a wrong exit code, a line that is not printed, a page that names no folder."""
    page = tmp_path / "page.txt"
    page.write_text("<!-- folder: empty -->\n\n```bash\nfalse\n```\n")
    (tmp_path / "a").mkdir()
    with pytest.raises(AssertionError, match="exit 1"):
        test_the_commands_of_a_page_run(page, tmp_path / "a")
    page.write_text("<!-- folder: empty -->\n\n```bash\necho one\n```\n<!-- prints -->\n```text\ntwo\n```\n")
    (tmp_path / "b").mkdir()
    with pytest.raises(AssertionError, match="'two' is not in"):
        test_the_commands_of_a_page_run(page, tmp_path / "b")
    page.write_text("```bash\ntrue\n```\n")
    (tmp_path / "c").mkdir()
    with pytest.raises(AssertionError, match="folder"):
        test_the_commands_of_a_page_run(page, tmp_path / "c")
