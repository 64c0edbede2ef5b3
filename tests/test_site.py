"""The documentation builds without a warning, whole: a page a command, every finding, schemas that say what the readers say."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from compstiff.cli.main import COMMANDS
from identification.common.catalogue import catalogue
from tests.test_references import MADE_BY_THE_SITE

ROOT = Path(__file__).parents[1]
pytest.importorskip("mkdocs", reason="the extra docs is not installed")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built strictly: a dead link, a missing anchor or a page that is in no menu ends it."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run([sys.executable, "-m", "mkdocs", "build", "-f", ROOT / "docs/site/mkdocs.yml", "-d", folder],
                          capture_output=True, text=True, timeout=300, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"})
    assert done.returncode == 0, done.stderr
    assert "not included in the \"nav\"" not in done.stderr, done.stderr
    return folder


def test_every_page_is_there(site: Path) -> None:
    for page in (ROOT / "docs").glob("*.md"):
        assert (site / f"{page.stem}.html").is_file(), page.name
    for name in MADE_BY_THE_SITE:
        assert (site / name.replace(".md", ".html")).is_file(), name


@pytest.mark.parametrize("name", COMMANDS)
def test_a_page_a_command_with_its_options_and_an_example(site: Path, name: str) -> None:
    from click.testing import CliRunner

    from compstiff.cli.main import compstiff

    page = (site / "commands" / f"{name}.html").read_text(encoding="utf-8")
    said = CliRunner().invoke(compstiff, [name, "--help"]).output
    for option in set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", said)):
        assert option in page, option
    example = page.partition('<h2 id="a-worked-example"')[2].partition('<h2 id="options"')[0]
    assert f"compstiff {name}" in re.sub(r"<[^>]+>", "", example)


def test_every_finding_is_there_in_the_words_of_explain(site: Path) -> None:
    page = " ".join(re.sub(r"<[^>]+>", "", (site / "findings.html").read_text(encoding="utf-8")).split())
    for code, said in catalogue().items():
        assert code in page
        assert said["title"].split("'")[0].split("&")[0].strip() in page.replace("’", "'"), code


def test_every_name_of_the_python_interface_is_there(site: Path) -> None:
    import compstiff

    page = (site / "api.html").read_text(encoding="utf-8")
    assert [name for name in compstiff.__all__ if f'.{name}"' not in page] == []


def test_every_cause_has_its_picture_or_says_why_not(site: Path) -> None:
    from identification.model.effects import effects

    page = (site / "signatures.html").read_text(encoding="utf-8")
    pictures = {path.stem for path in (site / "signatures").glob("*.svg")}
    assert len(pictures) > 15
    shown = set(re.findall(r'<h2 id="(\w+)"', page))
    assert pictures <= shown <= set(effects())


def test_the_pictures_of_the_conventions_are_drawn_from_the_kinematics() -> None:
    """docs/pictures has what the script draws."""
    sys.path.insert(0, str(ROOT / "docs/site"))
    try:
        from convention_pictures import FOLDER, PICTURES
    finally:
        sys.path.pop(0)
    for name, draw in PICTURES.items():
        assert draw() == (FOLDER / name).read_text(encoding="utf-8"), name


def test_the_pages_open_offline(site: Path) -> None:
    """No page loads a script, a style, a font or a picture from elsewhere."""
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        elsewhere = r'<(?:script|img|iframe)[^>]*src="https?:|<link[^>]*rel="(?:stylesheet|preconnect)"[^>]*href="https?:'
        assert not re.findall(elsewhere, text), page.name


def test_the_schemas_hold_what_the_readers_take(site: Path) -> None:
    """The keys of the shipped files, level by level; and a key that no reader takes is in none of them."""
    import yaml

    schema = json.loads((site / "schemas/cell.schema.json").read_text(encoding="utf-8"))

    def known(content: object, node: dict) -> None:
        while "$ref" in node or "anyOf" in node:
            options = [node] if "$ref" in node else [one for one in node["anyOf"] if one.get("type") != "null"]
            node = schema["$defs"][options[0]["$ref"].rpartition("/")[2]] if "$ref" in options[0] else options[0]
            if "properties" in node:
                break
        if isinstance(content, dict):
            assert node["additionalProperties"] is False
            for key, value in content.items():
                known(value, node["properties"][key])

    known(yaml.safe_load((ROOT / "samples/cell.yaml").read_text(encoding="utf-8")), schema)
    with pytest.raises(KeyError):
        known({"tool": {"position_um": [0, 0, 0]}}, schema)
    assert schema["required"] == ["robot", "tool"]


@pytest.mark.parametrize(("name", "command"), [
    ("stiffness", ["identify", "cell.yaml", "measurements.csv"]),
    ("cutting", ["cutting", "teeth.yaml", "insert.mod"])])
def test_the_schemas_hold_what_is_written(site: Path, tmp_path: Path, name: str, command: list[str]) -> None:
    """A file as a command writes it has the keys that its schema asks for, of the types it says."""
    from click.testing import CliRunner

    from compstiff.cli.main import compstiff

    for file in ("cell.yaml", "measurements.csv", "insert.mod"):
        (tmp_path / file).write_bytes((ROOT / "samples" / file).read_bytes())
    cell = (tmp_path / "cell.yaml").read_text()
    (tmp_path / "teeth.yaml").write_text(cell.replace("contact_mm: 1", "contact_mm: 1, teeth: 3"))
    words = [str(tmp_path / word) if (tmp_path / word).is_file() else word for word in command]
    done = CliRunner().invoke(compstiff, [*words, "-o", str(tmp_path / "out.json")])
    assert done.exit_code == 0, done.output
    schema = json.loads((site / f"schemas/{name}.schema.json").read_text(encoding="utf-8"))
    written = json.loads((tmp_path / "out.json").read_text())
    kinds = {"string": str, "number": (int, float), "integer": int, "array": list, "object": dict}
    asked = [(key, node) for key, node in schema["properties"].items() if key in schema["required"] and "type" in node]
    assert len(asked) > 3
    assert [key for key, node in asked if not isinstance(written[key], kinds[node["type"]])] == []


def test_every_file_that_a_model_reads_has_a_schema(site: Path) -> None:
    page = (site / "schemas.html").read_text(encoding="utf-8")
    for name in ("cell", "robot", "stock", "stiffness", "cutting", "learned"):
        assert f'href="schemas/{name}.schema.json"' in page
        assert json.loads((site / f"schemas/{name}.schema.json").read_text(encoding="utf-8"))["properties"]
