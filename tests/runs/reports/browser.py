"""A Chromium for the tests of reports: where it is looked for, and what a page did while it was open."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from tests.runs.reports.fetch_chromium import cache

PLACES = ("chromium", "chromium-browser", "google-chrome", "/usr/lib/chromium/chromium")
# Drawing by the processor: the same on every computer.
SOFTWARE = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def executable(own: str) -> str | None:
    """COMPSTIFF_BROWSER, the one that fetch_chromium.py brought, Playwright's own, or one of the system that is a program and
    not a script that asks for more."""
    found = [os.environ.get("COMPSTIFF_BROWSER"), cache() / "start", own, *map(shutil.which, PLACES)]
    return next((str(place) for place in found if place and Path(place).is_file()), None)


@contextmanager
def chromium() -> Iterator[Callable[..., Any]]:
    """Starts browsers with further options. Where none starts the test is skipped, with the reason; one that COMPSTIFF_BROWSER
    names must start."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    named = os.environ.get("COMPSTIFF_BROWSER")
    refuse = pytest.fail if named else pytest.skip
    if named and not Path(named).is_file():
        refuse(f"COMPSTIFF_BROWSER names {named}, which is no file")
    with playwright.sync_playwright() as driver:
        program = executable(driver.chromium.executable_path)
        if program is None:
            pytest.skip("no Chromium found (COMPSTIFF_BROWSER names one, tests/runs/reports/fetch_chromium.py brings one)")

        def launch(*options: str) -> Any:
            try:
                return driver.chromium.launch(executable_path=program, args=[*SOFTWARE, *options])
            except playwright.Error as reason:
                refuse(f"{program} does not start: {str(reason).splitlines()[0]}")

        yield launch


@dataclass
class Opened:
    """A page with what it asked the network for, and what it complained about."""

    page: Any
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)


def opened(browser: Any, file: Path, *, width: int = 1200, height: int = 860, before: str = "", **options: Any) -> Opened:
    """The page, when its views are ready; before: a script that runs ahead of its own."""
    page = browser.new_page(viewport={"width": width, "height": height}, **options)
    if before:
        page.add_init_script(before)
    found = Opened(page)
    page.on("request", lambda request: found.requests.append(request.url))
    page.on("console", lambda message: found.complaints.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda reason: found.complaints.append(f"error: {reason}"))
    page.goto(file.as_uri())
    # Asked again and again from outside: the page lets no string become a script.
    ready = "[...document.querySelectorAll('figure[data-view]')].every(one => one.view)"
    for _ in range(300):
        if page.evaluate(ready):
            break
        page.wait_for_timeout(50)
    assert page.evaluate(ready), f"{file.name}: a view did not come up: {found.complaints}"
    # Two frames: what was asked for is drawn.
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return found
