"""Whoever has only the project can follow every reference: pages, their headings and steps, and files that text names."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCANNED = ("*.py", "*.md", "*.yaml", "*.toml", "*.j2", "*.sh")
# CHANGELOG.md is history, and names what is no more.
LEFT_OUT = {"CHANGELOG.md"}
# Names of a user's own files, made up in documentation and tests.
USERS_OWN = {"riser_twist.py", "robots/mine.yaml", "my-cell/cell.yaml", "cell/cell.yaml", "part_intermediate.py"}
# Pages that the site makes when it is built; tests/test_site.py builds it.
MADE_BY_THE_SITE = {"index.md", "changelog.md", "findings.md", "schemas.md", "api.md", "signatures.md"}
NAMED = re.compile(
    r"(?<![\w./<{*-])((?:[\w-]+/|\.\./|\./)*[\w-]+\.(?:md|py)|(?:[\w-]+/)+[\w.-]+\.yaml)(#[\w-]+)?(?![\w(*]|\.\w)")
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(#[\w-]+)?\)")
STEP = re.compile(r"docs/effects\.md, steps? (\d+)(?: (?:and|to) (\d+))?")


def files() -> list[Path]:
    paths = {path for pattern in SCANNED for path in ROOT.rglob(pattern)}
    return sorted(path for path in paths if not any(part[0] == "." or part == "build" for part in path.relative_to(ROOT).parts))


FILES = files()
ENDS = {"/".join(path.relative_to(ROOT).parts[k:]) for path in FILES for k in range(len(path.relative_to(ROOT).parts))}


def headings(page: Path) -> set[str]:
    """The anchors of a page as Markdown viewers make them."""
    titles = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S), re.M)
    return {re.sub(r"[^\w -]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def target(name: str, beside: Path) -> Path | None:
    """The file a text means: from the root, from its own folder, a page of docs/, or the end of some file's path."""
    for path in (ROOT / name, beside.parent / name, ROOT / "docs" / name):
        if path.is_file():
            return path
    return next((path for path in FILES if str(path).endswith(f"/{name}")), None) if name in ENDS else None


def dangling(path: Path, text: str) -> list[str]:
    """What a text names and is not there."""
    text = re.sub(r"https?://\S+", " ", text)
    named = [(m[1], m[2]) for m in NAMED.finditer(text) if m[1] not in USERS_OWN | MADE_BY_THE_SITE]
    if path.suffix == ".md":
        named += [(m[1] or path.name, m[2]) for m in LINK.finditer(text) if m[1] or m[2]]
    missing = []
    for name, anchor in named:
        page = target(name, path)
        if page is None and not (path.parent / name).exists():
            missing.append(name)
        elif anchor and page and page.suffix == ".md" and anchor[1:] not in headings(page):
            missing.append(name + anchor)
    steps = re.findall(r"^(\d+)\. ", (ROOT / "docs" / "effects.md").read_text(encoding="utf-8"), re.M)
    cited = [step for m in STEP.finditer(text) for step in m.groups() if step]
    missing += [f"docs/effects.md, step {step}" for step in cited if step not in steps]
    return missing


def test_every_reference_can_be_followed() -> None:
    read = [path for path in FILES if path.name not in LEFT_OUT and path != Path(__file__)]
    missing = {str(path.relative_to(ROOT)): dangling(path, path.read_text(encoding="utf-8", errors="replace")) for path in read}
    assert not {path: names for path, names in missing.items() if names}


def test_it_is_red_on_what_is_not_there() -> None:
    here = Path(__file__)
    for text in ("as DESIGN.md says", "see docs/nowhere.md", "docs/formats.md#no-such-heading", "the rules of model/nothing.py",
                 "docs/effects.md, step 99", "docs/effects.md, steps 1 and 98"):
        assert dangling(here, text), text
    for text in ("docs/formats.md#conventions", "docs/effects.md, steps 1 and 2", "model/compliance.py", "part.mod", "a.b.py()",
                 "https://example.org/x.md"):
        assert not dangling(here, text), text


def test_mutants_that_are_argued_to_be_equivalent_are_of_lines_that_stand_there() -> None:
    table = (ROOT / "benchmarks" / "equivalent_mutants.tsv").read_text(encoding="utf-8").splitlines()[1:]
    cells = [line.split("\t") for line in table]
    assert {len(row) for row in cells} == {4}
    lines = {file: {line.strip() for line in (ROOT / file).read_text(encoding="utf-8").split("\n")} for file, *_ in cells}
    assert [row for row in cells if row[1] not in lines[row[0]]] == []
