"""What judges the program is independent of it: simulated cells, the benchmarks' among them, import none of its code, and the
README's figures are those of the pages that say how they were taken."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.test_house import PACKAGES, named

ROOT = Path(__file__).parents[1]
# Simulations that expected answers come from.
JUDGES = [*(path for folder in ("virtual_cell", "second_cell") for path in (ROOT / "tests" / folder).glob("*.py")
            if not path.name.startswith("test_")), ROOT / "tests/identification/motion/simulated_joint.py",
          ROOT / "tests/desk_world.py",
          *(path for author in ("blind", "jury", "third", "fourth", "fifth", "sixth", "motion", "shop", "stock")
            for path in (ROOT / "benchmarks").glob(f"{author}_*.py"))]
# A sentence of the README, the page its figures are taken from, and how they stand there.
FIGURES = (
    (r"of (\d+) causes that the plan can identify at all (\d+) were named right", "docs/benchmarks/diagnosis.md",
     r"of the identifiable \| \*\*{1} of {0}\*\*"),
    (r"(\d+) of (\d+) wrongly", "docs/benchmarks/diagnosis.md", r"\*\*wrong name\*\* \| \*\*{0} of {1}\*\*"),
    (r"with nothing hidden (\d+) alarms in (\d+)", "docs/benchmarks/diagnosis.md", r"with nothing hidden \| {0} of {1} "),
    (r"of (\d+) fresh ones (\d+) right, (\d+) in a set", "docs/benchmarks/judges.md",
     r"Of the \w+ fresh runs together \(8300 to \d+\) \*\*{1} of {0}\*\* are right, {2} in the set"),
    (r"hold again: (\d+) % before, (\d+) % after", "docs/benchmarks/diagnosis.md", r"after naming right \| {0} % -> {1} %"),
    (r"axis (\d): (\d+) µrad (\d+) times a turn", "docs/real-data.md", r"\| {0} \| {2}\.\d ± \S+ \|.*\| {1}\.\d, "),
    (r"axis (\d): (\d+) to (\d+) µrad", "docs/real-data.md", r"\| {0} \| A \| \S+ → \d+ \| B \| {1} → {2} \|"),
    (r"a delay of (\S+) ms between", "docs/real-data.md", r"recorded about {0} ms after"),
)


def packages_of(module: str, code: dict[str, str]) -> set[str]:
    """The packages of the program that a module imports, by whatever way."""
    found, seen, ahead = set(), set(), [module]
    while ahead:
        here = ahead.pop()
        if here in seen:
            continue
        seen.add(here)
        for source, name in named(code[here]):
            if source.split(".")[0] in PACKAGES:
                found.add(source)
            ahead += [one for one in (source, f"{source}.{name}") if one in code]
    return found


def dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def modules() -> dict[str, str]:
    """Of tests and benchmarks; these are imported by their bare names, too."""
    found = {dotted(path): path.read_text(encoding="utf-8") for folder in ("tests", "benchmarks")
             for path in (ROOT / folder).rglob("*.py")}
    return found | {name.removeprefix("benchmarks."): code for name, code in found.items() if name.startswith("benchmarks.")}


def test_no_judge_imports_what_it_judges() -> None:
    code, judges = modules(), {dotted(path) for path in JUDGES}
    assert len(judges) > 40
    assert {judge: found for judge in judges if (found := packages_of(judge, code))} == {}
    assert not [judge for judge in judges if re.search(r"import_module|__import__", code[judge])]


def test_an_import_by_way_of_another_file_is_found() -> None:
    code = {"tests.a": "from tests import b", "tests.b": "def f():\n    from identification.model import cell",
            "tests": ""}
    assert packages_of("tests.a", code) == {"identification.model"}


@pytest.mark.parametrize(("sentence", "page", "row"), FIGURES, ids=[sentence for sentence, _, _ in FIGURES])
def test_figures_of_the_readme_stand_on_the_page_they_come_from(sentence: str, page: str, row: str) -> None:
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    said = re.search(sentence, readme)
    assert said, f"the README no longer says this: {sentence}"
    there = row.format(*(re.escape(figure) for figure in said.groups()))
    assert re.search(there, (ROOT / page).read_text(encoding="utf-8")), f"{page} has no line like {there}"
