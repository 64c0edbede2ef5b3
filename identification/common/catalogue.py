"""The catalogue of findings: one page a code, cause, effect, remedy (`compstiff explain CODE`)."""

from __future__ import annotations

import difflib
from functools import cache
from pathlib import Path

import yaml

from identification.common.findings import error

CATALOGUE = Path(__file__).parent / "catalogue.yaml"


@cache
def catalogue() -> dict[str, dict[str, str]]:
    """All pages by code: title, cause, effect, remedy."""
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)      # a tenth of the time, where PyYAML was built with libyaml
    pages: dict[str, dict[str, str]] = yaml.load(CATALOGUE.read_text(encoding="utf-8"), loader)
    return {code: {key: " ".join(text.split()) for key, text in page.items()} for code, page in pages.items()}


def explain_code(code: str) -> dict[str, str]:
    """One page, with its code. Raises CompstiffError (CS0009) for a code that does not exist.

    >>> compstiff.explain_code("CS1012")["title"]
    'A joint was not seen by the data'
    """
    name = code.upper()
    pages = catalogue()
    if name not in pages:
        near = difflib.get_close_matches(name, pages, n=3, cutoff=0.5)
        raise error("CS0009", f"there is no code '{code}'", hint=f"near it: {', '.join(near)}" if near else "codes look "
                    "like CS1002")
    return {"code": name, **pages[name]}
