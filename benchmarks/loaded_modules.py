"""The values of modules that are loaded, changed as their file says now: for forked.py.

Of a file that differs in one assignment outside functions and classes that assignment is made again, and those of its module
that use what it sets; so it goes on in the modules that have imported any of it by name. Where a class, a default of a function
or a decorator uses it, nothing is changed: that needs the modules loaded anew.
"""

from __future__ import annotations

import ast
import sys
import types
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, eq=False)
class Loaded:
    """Modules by name, with the statements of their files as they were loaded."""

    modules: dict[str, types.ModuleType]
    bodies: dict[str, list[ast.stmt]]

    @classmethod
    def of(cls, *packages: str) -> Loaded:
        """All that are loaded of these."""
        modules = {name: module for name, module in sys.modules.items()
                   if name.split(".")[0] in packages and getattr(module, "__file__", None)}
        return cls(modules, {name: ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8")).body
                             for name, module in modules.items()})

    def given(self, file: str) -> bool:
        """Gives the modules what the file says now; whether that could be done."""
        name = next((name for name, module in self.modules.items() if module.__file__ == file), "")
        if not name:
            return False
        now = ast.parse(Path(file).read_text(encoding="utf-8")).body
        differ = [new for old, new in zip(self.bodies[name], now, strict=True) if ast.dump(old) != ast.dump(new)]
        if len(differ) != 1 or not isinstance(differ[0], ast.Assign | ast.AnnAssign):
            return False
        todo, done = [(name, differ[0], _names(differ[0], ast.Store))], []
        while todo:
            where, statement, names = todo.pop(0)
            done.append((where, statement))
            using = [node for node in self.bodies[where] if names & _used(node)]
            if any(not isinstance(node, ast.Assign | ast.AnnAssign) for node in using):
                return False
            todo += [(where, node, _names(node, ast.Store)) for node in using if (where, node) not in done]
            for other, body in self.bodies.items():
                for node in body:
                    if isinstance(node, ast.ImportFrom) and node.module == where:
                        again = {alias.asname or alias.name for alias in node.names if alias.name in names}
                        todo += [(other, node, again)] * bool(again)
        for where, statement in done:
            exec(compile(ast.Module([statement], []), file, "exec"), self.modules[where].__dict__)
        return True


def _names(node: ast.AST, kind: type[ast.expr_context]) -> set[str]:
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name) and isinstance(each.ctx, kind)}


def _used(node: ast.stmt) -> set[str]:
    """Names that a statement uses when it is carried out, not in the bodies of its functions; of annotations none."""
    if isinstance(node, ast.FunctionDef):
        parts: list[ast.AST] = [*node.decorator_list, *node.args.defaults, *[one for one in node.args.kw_defaults if one]]
    elif isinstance(node, ast.ClassDef):
        return set().union(*map(_used, node.body), *(_names(one, ast.Load) for one in node.decorator_list + node.bases))
    elif isinstance(node, ast.AnnAssign):
        parts = [node.value] if node.value else []
    elif isinstance(node, ast.Assign):
        parts = [node.value]
    else:
        parts = [node]
    return set().union(*(_names(part, ast.Load) for part in parts))
