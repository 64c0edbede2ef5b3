"""The module that shows whether the marks arrive in the force log, with the robot at rest."""

from __future__ import annotations

from identification.common.shipped import shipped

TEMPLATE = "mark_test.mod.j2"
TIMES, HALF_PERIOD_S = 10, 0.25


def mark_test(signal: str) -> bytes:
    """A RAPID module that switches an output high and low ten times."""
    import jinja2

    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(shipped("rapid_templates")),
                                     undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    return environment.get_template(TEMPLATE).render(signal=signal, times=TIMES, half=HALF_PERIOD_S).encode("ascii")
