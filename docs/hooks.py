"""Pages that are generated while the documentation is built: commands, measurements, effects with their plots, notebooks."""

from __future__ import annotations

import html
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mkdocs.structure.files import File, Files

HERE = Path(__file__).parent
# A motor of ordinary size, on which the plots show each effect.
MOTOR = {"Ra": 12.0, "La": 12e-6, "Ca": 25e-12, "Rr": 40.0, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12}
FREQUENCY_HZ = np.geomspace(150e3, 30e6, 301)


def on_files(files: Files, config) -> Files:
    """Add the generated pages."""
    pages = {
        "reference/commands.md": commands_page(),
        "reference/measurements.md": measurements_page(),
        "explanation/effects.md": effects_page(),
    }
    pages |= {f"notebooks/{path.stem}.md": notebook_page(path) for path in sorted((HERE / "notebooks").glob("*.ipynb"))}
    for uri, text in pages.items():
        files.append(File.generated(config, uri, content=text))
    return files


def commands_page() -> str:
    """Every command with its options, from the command line itself."""
    import typer.main

    from motoremi.cli.app import app

    group = typer.main.get_command(app)
    lines = [
        "# Commands",
        "",
        "`motoremi COMMAND --help` shows the same. Exit status: 0 done; 1 done, but FAIL, files refused, or (fleet) no result or a motor that is "
        "not good; 2 wrong use or unusable data; 3 an instrument or scheduler does not answer, or the operator answered that a step was not done; "
        "130 stopped by Ctrl-C.",
        "",
    ]
    for name, command in group.commands.items():
        lines += [f"## motoremi {name}", "", command.help or "", "", f"```text\n{(command.epilog or '').removeprefix('Example: ')}\n```", ""]
        lines += ["| | |", "|---|---|"]
        for parameter in command.params:
            shown = ", ".join(parameter.opts) if parameter.param_type_name == "option" else (parameter.metavar or parameter.name)
            text = (getattr(parameter, "help", "") or "").replace("|", "\\|")
            lines.append(f"| `{shown}` | {text} |")
        lines.append("")
    return "\n".join(lines)


def measurements_page() -> str:
    """Conditions and single values with their units, and the menu of an investigation."""
    from motoremi.data.conditions import CONDITIONS, VALUES
    from motoremi.investigation.menu import BY_NAME, MENU

    def asked(name: str) -> str:
        return BY_NAME[name].action if name in BY_NAME else "a known part in the motor's place"

    lines = ["# Conditions, single values and measurements", ""]
    lines += ["## Conditions", "", "`motoremi import SESSION --append --condition ID[=VALUE]`", ""]
    lines += ["| id | value, for example | what is set up |", "|---|---|---|"]
    for name, setting in CONDITIONS.items():
        value = "" if setting is None else f"`{setting.example}`" + ("" if setting.needed else " (may be left out)")
        lines.append(f"| `{name}` | {value} | {asked(name)} |")
    lines += ["", "## Single values", "", "`motoremi import SESSION --append --value NAME=QUANTITY`, if known with an uncertainty"]
    lines += ["(`21.3mohm+-0.1mohm`)", ""]
    lines += ["| name | for example | what it is | uncertainty if none is given |", "|---|---|---|---|"]
    for name, quantity in VALUES.items():
        default = f"{100 * quantity.relative:g} %" + (f" and {quantity.absolute:g}" if quantity.absolute else "")
        lines.append(f"| `{name}` | `{quantity.setting.example}` | {quantity.meaning} | {default} |")
    lines += ["", "## The menu", "", "What `motoremi next` and `motoremi investigate` choose from. Minutes are those of operator, warming and"]
    lines += ["cooling beside the sweeps: estimates, which a laboratory replaces by its own (`--menu FILE`)."]
    lines += ["What is not predicted is listed and never asked for.", ""]
    lines += ["| id | instruction | minutes | sweeps |", "|---|---|---|---|"]
    for one in MENU:
        lines.append(f"| `{one.name}` | {one.action} | {one.minutes:g} | {', '.join(one.sweeps)}{'' if one.predicted else ' (not predicted)'} |")
    return "\n".join(lines) + "\n"


def effects_page() -> str:
    """The catalogue, each effect with a plot of its signature."""
    from motoremi.model.effects import catalogue

    lines = ["# The effects", ""]
    lines += ["Grey is the paper's circuit, blue the same motor with the effect, orange with another size of the effect."]
    lines += ["The short-circuit sweep is on the left, the open-circuit sweep on the right.", ""]
    for effect in catalogue():
        lines += [f"## {effect.name}", "", f"{effect.title.capitalize()}. Identifiers: {', '.join(f'`{i}`' for i in effect.identifiers)}.", ""]
        lines += [f'<div class="effect">{_picture(effect)}</div>', "", f"```text\n{effect.formula}\n```", ""]
        lines += ["| parameter | from | to | reason |", "|---|---|---|---|"]
        lines += [f"| `{p.name}` ({p.unit or '1'}) | {p.low:g} | {p.high:g} | {html.escape(p.reason)} |" for p in effect.parameters]
        entries = {"Vanishes for": effect.limit, "Signature": effect.signature, "Look-alikes": ", ".join(effect.look_alikes)}
        entries |= {"Decided by": effect.deciding, "Source": effect.source}
        lines += ["", *(f"- **{title}:** {html.escape(text)}" for title, text in entries.items()), ""]
    return "\n".join(lines)


def _picture(effect) -> str:
    from motoremi.report.axes import BLUE, VERMILION, arrange, frequency_axis, log_values, panels
    from motoremi.report.svg import to_svg

    figure, ((*both,),) = panels(8.0, 2.6, columns=2)
    starts = (effect.starts[len(effect.starts) // 2], effect.starts[-1])
    for axes, termination in zip(both, ("short", "open"), strict=True):
        axes.plot(FREQUENCY_HZ, np.abs(_impedance(None, {}, termination)), color="#999999", linewidth=3)
        for start, colour in zip(starts, (BLUE, VERMILION), strict=False):
            axes.plot(FREQUENCY_HZ, np.abs(_impedance(effect.identifiers[-1], start, termination)), color=colour, linewidth=1.2)
        frequency_axis(axes, FREQUENCY_HZ)
        log_values(axes, prefixes=True)
        axes.set_ylabel("|Z| (Ω)")
    arrange(figure, 0)
    return to_svg(figure, effect.name, f"|Z| with and without {effect.title}").replace("\n", " ")


def _impedance(identifier: str | None, start, termination: str):
    from motoremi.export.realise import impedance_of
    from motoremi.model.effects import find_effect
    from motoremi.model.effects.start import with_start
    from motoremi.model.motor import dc_motor

    motor, values = dc_motor(), dict(MOTOR)
    if identifier is not None:
        motor = find_effect(identifier).added_to(motor)
        values = with_start(values, start, identifier)
    return impedance_of(motor.circuit(termination), values, FREQUENCY_HZ)


def notebook_page(path: Path) -> str:
    """An executed notebook as a page."""
    return "\n\n".join(_cells(json.loads(path.read_text("utf-8"))))


def _cells(notebook: dict) -> Iterator[str]:
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            yield source
            continue
        yield f"```python\n{source}\n```"
        for output in cell["outputs"]:
            data = output.get("data", {})
            if "image/png" in data:
                yield f'<img alt="output" src="data:image/png;base64,{"".join(data["image/png"]).strip()}"/>'
            elif "text/html" in data:
                yield "".join(data["text/html"])
            else:
                text = "".join(output.get("text", data.get("text/plain", "")))
                yield f"```text\n{text.rstrip()}\n```"


sys.dont_write_bytecode = True
