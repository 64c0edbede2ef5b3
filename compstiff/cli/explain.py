"""`compstiff explain`: one page of the catalogue of findings, or of the dictionary of causes."""

from __future__ import annotations

import re
from difflib import get_close_matches

import click

from compstiff.cli.console import command
from compstiff.outcome import Outcome, Session


@command("explain")
@click.argument("words", metavar="[CODE]", nargs=-1)
def explain(session: Session, words: tuple[str, ...]) -> Outcome:
    """Explain a finding or a cause: what is behind it, what to do; without CODE, list both.

    CODE is that of a message (CS1002), or a cause that diagnose names (backlash, base rocking). Of a command: compstiff
    COMMAND -h.
    """
    from compstiff import explain_code
    from identification.common.catalogue import catalogue
    from identification.common.findings import CompstiffError, error
    from identification.common.quantities import parameter_words, quantity
    from identification.model.effects import effects

    if not words:
        titles = {name: page["title"] for name, page in catalogue().items()}
        causes = {name: _anywhere(effect.sentence) for name, effect in effects().items()}
        return Outcome({"codes": titles, "causes": causes},
                       lines=[f"{name}  {title}" for name, title in (titles | causes).items()])
    # As diagnose writes it: soft_zone[2], or soft zone of joint 2.
    code = " ".join(words)
    effect = effects().get(re.sub(r"(\[\d\]| of (joint|link) \d)$", "", code.lower()).replace(" ", "_"))
    if effect is None:
        near = get_close_matches(code.lower().replace(" ", "_"), effects(), n=3)
        if near:
            raise error("CS0009", f"there is no cause '{code}'", hint=f"near it: {', '.join(near)}")
        root = click.get_current_context().find_root()
        if isinstance(root.command, click.Group) and code.lower() in root.command.list_commands(root):
            raise error("CS0009", f"'{code}' is a command, no finding or cause",
                        hint=f"compstiff {code.lower()} -h explains it")
        try:
            page = explain_code(code)
        except CompstiffError as unknown:
            if re.fullmatch(r"(?i)cs\d*", code):
                raise
            raise error("CS0009", f"there is no code or cause '{code}'", hint="a code is that of a message, such as CS1002, a "
                        "cause that diagnose names, such as backlash; compstiff explain lists both, compstiff COMMAND -h "
                        "explains a command") from unknown
        return Outcome(dict(page), lines=[f"{page['code']}: {page['title']}", "", f"cause: {page['cause']}",
                                          f"effect: {page['effect']}", f"remedy: {page['remedy']}"])
    done = "the robot does it: correct takes it into account" if effect.of_robot else (
        "it is taken out of the data, and correct refuses the springs until they are measured again" if effect.unsettles else
        "the measurement does it: it is taken out of the data, and not carried on")
    sizes = [f"{parameter_words(one.name)} {quantity(one.typical, 0.0, one.unit)}"
             for one in effect.parameters if not one.shape]
    content = {"effect": effect.name, "sentence": _anywhere(effect.sentence), "family": effect.family,
               "of_robot": effect.of_robot, "joints": list(effect.joints), "check": effect.settles,
               "typical": {one.name: one.typical for one in effect.parameters}}
    return Outcome(content, lines=[f"{effect.name}: {content['sentence']}", "", f"{done} (family: {effect.family})",
                                   f"typical: {', '.join(sizes)}", f"check without a load: {effect.settles}"])


def _anywhere(sentence: str) -> str:
    """A cause's sentence where no joint is meant."""
    return sentence.format(joint="N")
