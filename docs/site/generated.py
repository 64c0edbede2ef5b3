"""Generated pages of the site: commands, findings, schemas, signatures of the causes, the Python API."""

from __future__ import annotations

import json
import re
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[2]
FAMILIES = {
    "00": "Files and calls", "01": "Cells", "02": "Tables", "10": "Measurements and identification", "11": "Robots",
    "12": "Stiffness files", "15": "Logs in motion, masses, plans", "16": "Plans and designs", "17": "Diagnosis", "20": "RAPID",
    "21": "APT", "30": "Force logs", "31": "Two force logs", "32": "The cut", "40": "Correction", "41": "Correction",
    "42": "Programs and posting", "43": "Targets, zones and parts", "44": "Feed", "45": "External axes", "50": "Modbus",
    "53": "Learning", "60": "Verification and batches", "61": "Upload"}


def commands() -> list[str]:
    """The names of all commands."""
    from compstiff.cli.main import COMMANDS

    return list(COMMANDS)


def pages() -> dict[str, str]:
    """Every generated page by its name in the site, and the schemas as files beside their page."""
    schemas = schema_files()
    return {
        "index.md": (ROOT / "README.md").read_text(encoding="utf-8"),
        "changelog.md": (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
        **{f"commands/{name}.md": command_page(name) for name in commands()},
        "findings.md": findings_page(), "schemas.md": schemas_page(schemas),
        **{f"schemas/{name}": json.dumps(schema, indent=1) for name, schema in schemas.items()},
        "api.md": api_page(), **signatures(),
    }


def command_page(name: str) -> str:
    """What the command is for, how it is called, a worked example, every option."""
    from compstiff.cli.main import compstiff

    with compstiff.make_context("compstiff", [name, "--help"], resilient_parsing=True) as context:
        command = compstiff.get_command(context, name)
        assert command is not None
        inner = click.Context(command, info_name=f"compstiff {name}")
        usage = " ".join(command.get_usage(inner).removeprefix("Usage: ").split())
        help_text = "\n\n".join(" ".join(part.split()) for part in (command.help or "").split("\n\n"))
        options: dict[str, list[str]] = {}
        for parameter in command.get_params(inner):
            record = parameter.get_help_record(inner)
            if isinstance(parameter, click.Option) and record:
                heading = getattr(parameter, "heading", "Options")
                meaning = record[1].replace("|", "\\|").replace("<", "&lt;")
                options.setdefault(heading, []).append(f"| `{record[0].replace('|', '/')}` | {meaning} |")
    tables = [f"### {heading}\n\n| option | meaning |\n|---|---|\n" + "\n".join(rows) for heading, rows in options.items()]
    parts = [f"# compstiff {name}", help_text, f"```text\n{usage}\n```", "## A worked example", worked_example(name)]
    return "\n\n".join([*parts, "## Options", *tables]) + "\n"


def worked_example(name: str) -> str:
    """The part of the session on the samples that shows a command, without what it says to the tests."""
    text = (ROOT / "docs/site/worked_examples.md").read_text(encoding="utf-8")
    found = re.search(rf"^## {name}$(.*?)(?=^## |\Z)", text, re.M | re.S)
    if found is None:
        raise ValueError(f"docs/site/worked_examples.md has no section {name}")
    return re.sub(r"<!--.*?-->\n?", "", found[1], flags=re.S).strip()


def findings_page() -> str:
    """The catalogue, by number."""
    from identification.common.catalogue import catalogue

    parts = ["# Findings", "Everything that a command may say of its input, in the words of `compstiff explain CODE`. Whether "
             "a finding is a note, a warning or an error stands in the message itself."]
    family = ""
    for code, page in sorted(catalogue().items()):
        if (title := FAMILIES.get(code[2:4], "Further findings")) != family:
            family = title
            parts.append(f"## {family}, from {code}")
        parts.append(f"### {code}\n\n**{page['title']}**\n\n" + "\n\n".join(
            f"*{key.capitalize()}:* {page[key].replace('<', '&lt;')}" for key in ("cause", "effect", "remedy")))
    return "\n\n".join(parts) + "\n"


def schema_files() -> dict[str, dict[str, object]]:
    """JSON Schemas of the files for which models exist, made from these models."""
    from compensator.cutting.coefficients import CoefficientsFile
    from compensator.cutting.stock_file import StockFile
    from compensator.learned.learned_file import LearnedFile
    from identification.model.cell_file import CellFile
    from identification.model.robot_file import RobotFile
    from identification.model.stiffness_file import StiffnessFile

    models = {"cell": CellFile, "robot": RobotFile, "stock": StockFile, "stiffness": StiffnessFile, "cutting": CoefficientsFile,
              "learned": LearnedFile}
    return {f"{name}.schema.json": {"$schema": "https://json-schema.org/draft/2020-12/schema",
                                    "title": f"compstiff {name}"} | model.model_json_schema() for name, model in models.items()}


def schemas_page(schemas: dict[str, dict[str, object]]) -> str:
    """Where the schemas are, and how an editor uses them."""
    listed = "\n".join(f"- [{name}](schemas/{name})" for name in schemas)
    return f"""# JSON Schemas

Made from the models that the program itself reads these files with:

{listed}

An editor with a YAML language server completes and checks cell.yaml by a line at its top that names where the schema was saved:

```yaml
# yaml-language-server: $schema=cell.schema.json
```

A schema says which keys and types a file may have. What it cannot say, such as a quaternion of norm 1, `compstiff check` says.
What the keys mean stands in [Files and commands](formats.md).
"""


def api_page() -> str:
    """Every name of `import compstiff`, from its docstring."""
    import compstiff

    where = compstiff._FILE_OF
    return "# The Python interface\n\n`import compstiff` gives all of these. Each example runs in the tests.\n\n" + "\n\n".join(
        f"::: {where[name]}.{name}" for name in compstiff.__all__) + "\n"


def signatures() -> dict[str, str]:
    """The page of signatures and its pictures."""
    from signatures import signatures_page

    return signatures_page()
