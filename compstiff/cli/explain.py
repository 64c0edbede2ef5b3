"""`compstiff explain`: one page of the catalogue of findings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from compstiff.cli.console import command
from compstiff.outcome import Outcome, Session

if TYPE_CHECKING:
    pass


@command("explain")
@click.argument("code", metavar="[CODE]", required=False)
def explain(session: Session, code: str | None) -> Outcome:
    """Explain a finding: its cause, its effect, what to do; without CODE, list them."""
    from compstiff import explain_code
    from identification.common.catalogue import catalogue

    if code is None:
        titles = {name: page["title"] for name, page in catalogue().items()}
        return Outcome({"codes": titles}, lines=[f"{name}  {title}" for name, title in titles.items()])
    page = explain_code(code)
    lines = [f"{page['code']}: {page['title']}", "", f"cause:  {page['cause']}", f"effect: {page['effect']}",
             f"remedy: {page['remedy']}"]
    return Outcome(dict(page), lines=lines)
