"""The pages that mkdocs generates when it builds the site, and the links that leave docs/ made to stay in it."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#\s]+)(#[\w-]+)?\)")
# Pages of the project that stand elsewhere than under docs/.
ELSEWHERE = {"README.md": "index.md", "CHANGELOG.md": "changelog.md"}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """The commands stand in the menu by name."""
    sys.path[:0] = [str(ROOT), str(HERE)]       # here: mkdocs takes back what a hook adds while it is imported
    from generated import commands

    def filled(item: Any) -> Any:
        if item == {"Commands": "commands/"}:
            return {"Commands": [{name: f"commands/{name}.md"} for name in commands()]}
        return item

    config.nav = [filled(item) for item in config.nav or []]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds what is generated."""
    from generated import pages

    for name, content in pages().items():
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links to files outside docs/ become links inside the site, or the file's name where the site has no such page."""
    depth = page.file.src_uri.count("/")

    def within(match: re.Match[str]) -> str:
        text, path, anchor = match[1], match[2], match[3] or ""
        if "://" in path:
            return match[0]
        base = ROOT if page.file.src_uri in ELSEWHERE.values() else ROOT / "docs" / Path(page.file.src_uri).parent
        absolute = (base / path).resolve()
        if not absolute.is_relative_to(ROOT):
            return match[0]
        name = absolute.relative_to(ROOT).as_posix()
        if name.startswith("docs/") and (absolute.is_file() or name.removeprefix("docs/") in files.src_uris):
            return f"[{text}]({'../' * depth}{name.removeprefix('docs/')}{anchor})"
        if name in ELSEWHERE:
            return f"[{text}]({'../' * depth}{ELSEWHERE[name]}{anchor})"
        return f"`{name}`" if name.split("/")[-1] in text or text == path else f"{text} (`{name}`)"

    return LINK.sub(within, re.sub(r"\]\(docs/(pictures/)", r"](\1", markdown))
