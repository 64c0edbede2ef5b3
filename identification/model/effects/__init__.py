"""The dictionary of causes: one file an effect, found through a registry (docs/effects.md).

A user's own package adds effects through the entry point group `compstiff.effects` (docs/effects.md).
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from inspect import isabstract
from pkgutil import iter_modules

from identification.common.findings import error
from identification.model.effects.base import Effect, Parameter, Signature

__all__ = ["Effect", "Parameter", "Signature", "effects"]
ENTRY_POINTS = "compstiff.effects"


@cache
def effects() -> dict[str, Effect]:
    """All effects by name: the built-in ones, then those of installed packages.

    Raises CompstiffError (CS1301) where a package's entry cannot be loaded, is no effect, or takes a name that is taken.
    """
    dictionary: dict[str, Effect] = {}
    for module in sorted(f"{__name__}.{info.name}" for info in iter_modules(__path__)):
        own = [kind for kind in vars(import_module(module)).values() if getattr(kind, "__module__", "") == module]
        kinds = [kind for kind in own if isinstance(kind, type) and issubclass(kind, Effect) and not isabstract(kind)]
        # What several laws have in common begins with an underscore.
        dictionary |= {kind.name: kind() for kind in kinds if not kind.law and not kind.__name__.startswith("_")}
    for entry in entry_points(group=ENTRY_POINTS):
        try:
            loaded = entry.load()
            effect = loaded() if isinstance(loaded, type) else loaded
        except Exception as broken:
            raise error("CS1301", f"the entry point '{entry.name}' of {ENTRY_POINTS} ({entry.value}) cannot be loaded: "
                        f"{type(broken).__name__}: {broken}", hint="mend or uninstall that package") from broken
        if not isinstance(effect, Effect):
            raise error("CS1301", f"the entry point '{entry.name}' of {ENTRY_POINTS} gives {type(effect).__name__}, "
                        "expected an Effect", hint="docs/effects.md has a worked example")
        if effect.name in dictionary:
            raise error("CS1301", f"the entry point '{entry.name}' brings an effect '{effect.name}', which exists already",
                        hint="give it another name")
        dictionary[effect.name] = effect
    return dictionary
