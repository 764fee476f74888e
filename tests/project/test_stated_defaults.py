"""What help and documentation state is what the code does: defaults, options, names, numbers."""

from __future__ import annotations

import dataclasses
import re
import shlex
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import command_line
import pytest
import typer.main
from conftest import simulated_sweeps
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.csvfiles import impedance_csv
from motoremi.data.laboratory import laboratory_of
from motoremi.diagnosis.diagnosis import Verdict
from motoremi.emission.setup import read_setup
from motoremi.errors import BadInput, InstrumentError, Stopped
from motoremi.model.effects.effect import Effect
from motoremi.schema.keys import reference
from motoremi.workbench import body, server, thinning, tray

ROOT = next(folder for folder in Path(__file__).parents if (folder / "pyproject.toml").is_file())
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
GROUP: Any = typer.main.get_command(app)
COMMANDS: dict[str, Any] = GROUP.commands
# Options of `motoremi` itself, which may be written anywhere.
GLOBAL = {option for parameter in GROUP.params for option in parameter.opts} | {"--help", "-h", "--install-completion"}


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def options(command: str) -> dict[str, Any]:
    """Option -> parameter of a command."""
    return {option: one for one in COMMANDS[command].params for option in (*one.opts, *one.secondary_opts)}


def command_lines() -> Iterator[tuple[str, str, list[str]]]:
    """Place, command and arguments of every `motoremi COMMAND ...` in the examples of help, and in code of the documentation."""
    for name, command in COMMANDS.items():
        for line in command.epilog.removeprefix("Example: ").split(";"):
            words = shlex.split(line)
            assert words[0] == "motoremi"
            yield f"motoremi {name} --help", words[1], words[2:]
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        blocks = re.findall(r"^```(?:bash|text)?\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
        lines = [line for block in blocks for line in block.splitlines() if re.match(r"motoremi [a-z]", line)]
        lines += re.findall(r"`(motoremi [a-z][^`]*)`", re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL).replace("\n", " "))
        for line in lines:
            words = shlex.split(re.split(r"\|\||&&", line)[0], comments=True)
            yield path.name, words[1], words[2:]


def test_every_command_of_help_and_documentation_exists_with_its_options():
    seen = 0
    for where, command, arguments in command_lines():
        assert command in COMMANDS, f"{where}: there is no command {command}"
        for word in arguments:
            if word.startswith("--") and len(word) > 2:
                assert word in options(command) or word in GLOBAL, f"{where}: motoremi {command} has no option {word}"
        seen += 1
    assert seen > 80


def test_defaults_in_brackets_are_those_of_the_options():
    """`--odds` (default 20), also with a value: `--form long` (default)."""
    stated = [
        (path.name, option, value)
        for path in PAGES
        for option, value in re.findall(r"`(--[a-z-]+)`\s+\(default\s([^)]+)\)", path.read_text(encoding="utf-8"))
        + re.findall(r"`(--[a-z-]+) ([^`]+)` \(default\)", path.read_text(encoding="utf-8"))
    ]
    assert {option for _, option, _ in stated} >= {"--odds", "--budget", "--form"}
    for where, option, value in stated:
        defaults = [options(command)[option].default for command in COMMANDS if option in options(command)]
        assert any(str(one) == value or (isinstance(one, float) and f"{one:g}" == value) for one in defaults), (
            f"{where}: {option} (default {value})"
        )


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_every_text_in_full(command, monkeypatch):
    """Nothing in brackets is taken for markup."""
    monkeypatch.setenv("COLUMNS", "2000")
    monkeypatch.setenv("TERMINAL_WIDTH", "2000")
    shown = " ".join(re.sub("[│╭╮╰╯─]", " ", CliRunner().invoke(app, [command, "--help"]).output).split())
    for parameter in COMMANDS[command].params:
        if getattr(parameter, "help", None) and not parameter.hidden:
            assert " ".join(parameter.help.split()) in shown, parameter.name


def motoremi(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    """A command in a folder that is also the user's own, so that no settings of this machine count."""
    return command_line.motoremi(*arguments, cwd=folder, HOME=str(folder))


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a session `line/motor`, imported without naming the analyser, and fitted."""
    folder = tmp_path_factory.mktemp("stated")
    for sweep in simulated_sweeps(3, repeats=1)[0]:
        plain = {key: value for key, value in sweep.metadata.items() if key != "analyser"}
        table = dataclasses.replace(sweep, metadata=plain)
        (folder / f"{sweep.termination}.csv").write_text(impedance_csv(table))
    assert motoremi(folder, "import", "line/motor", "--short", "short.csv", "--open", "open.csv").returncode == 0
    assert motoremi(folder, "fit", "line/motor").returncode == 0
    return folder


def the_analyser_is_unknown(folder: Path) -> None:
    assert me.fit(me.dc_motor(), me.load(folder / "line/motor").sweeps).measurement.analyser.name == "unknown"


def touchstone_is_of_the_open_sweep(folder: Path) -> None:
    for file, more in (("default.s1p", []), ("open.s1p", ["--termination", "open"]), ("short.s1p", ["--termination", "short"])):
        assert motoremi(folder, "export", "line/motor", "--touchstone", file, *more).returncode == 0
    default, opened, shorted = ((folder / name).read_text() for name in ("default.s1p", "open.s1p", "short.s1p"))
    assert default == opened != shorted


def a_plot_is_called_after_what_it_shows(folder: Path) -> None:
    assert motoremi(folder, "plot", "line/motor", "fit").returncode == 0
    assert (folder / "fit.svg").is_file()


def a_fleet_is_beside_its_folder(folder: Path) -> None:
    assert motoremi(folder, "fleet", "line", "--fit-only", "--jobs", "1").returncode == 0
    assert {path.name for path in (folder / "line-fleet").iterdir()} >= {"fleet.html", "fleet.json", "parameters.csv", "fleet.jsonl"}


def settings_are_those_of_this_folder(folder: Path) -> None:
    here = folder / "settings"
    here.mkdir()
    (here / "motoremi.toml").write_text("[effects]\njson = true\n")
    assert motoremi(here, "effects", "core-loss").stdout.startswith("{")
    (here / "motoremi.toml").unlink()
    own = here / ".config" / "motoremi"
    own.mkdir(parents=True)
    (own / "config.toml").write_text("[effects]\njson = true\n")
    assert motoremi(here, "effects", "core-loss").stdout.startswith("{")


def challenges_differ(folder: Path) -> None:
    for name in ("one", "other"):
        assert motoremi(folder, "challenge", name).returncode == 0
    assert (folder / "one/sweeps/open-1.csv").read_bytes() != (folder / "other/sweeps/open-1.csv").read_bytes()


def the_seed_of_a_scoreboard_is_drawn_and_printed(folder: Path) -> None:
    assert options("scoreboard")["--seed"].default is None
    assert re.search(r"seed \d+", motoremi(folder, "scoreboard", "--cases", "1", "--jobs", "1").stdout)


def the_effect_of_a_demo_follows_from_its_seed(folder: Path) -> None:
    assert options("demo")["--effect"].default is None
    assert options("demo")["--seed"].default is None


# Every option whose help states a default in words, with the check of it.
IN_WORDS: dict[tuple[str, str], Callable[[Path], None]] = {
    ("", "config"): settings_are_those_of_this_folder,
    ("demo", "effect"): the_effect_of_a_demo_follows_from_its_seed,
    ("import", "analyser"): the_analyser_is_unknown,
    ("export", "termination"): touchstone_is_of_the_open_sweep,
    ("plot", "out"): a_plot_is_called_after_what_it_shows,
    ("fleet", "out"): a_fleet_is_beside_its_folder,
    ("challenge", "seed"): challenges_differ,
    ("scoreboard", "seed"): the_seed_of_a_scoreboard_is_drawn_and_printed,
}
# These take half a second or more.
SLOW = {("scoreboard", "seed"), ("plot", "out"), ("fleet", "out"), ("export", "termination"), ("", "config")}


def test_every_default_in_words_is_checked_here():
    stated = {
        (name, parameter.name)
        for name, command in [("", GROUP), *COMMANDS.items()]
        for parameter in command.params
        if re.search(r"\bdefault\b", getattr(parameter, "help", "") or "")
    }
    assert stated == set(IN_WORDS)


@pytest.mark.parametrize(
    "check",
    [pytest.param(check, id=" ".join(option).strip(), marks=pytest.mark.slow if option in SLOW else ()) for option, check in IN_WORDS.items()],
)
def test_defaults_in_words_are_true(check, measured):
    check(measured)


def test_a_comparison_without_tolerance_allows_10_percent_or_what_was_allowed_last(measured):
    assert "Without a tolerance: the last one, at first 10 %" in COMMANDS["compare"].help
    assert "at first that is an error of 10 %" in page("procedures.md")
    fit = me.fit(me.dc_motor(), me.load(measured / "line/motor").sweeps)
    assert me.compare(fit).tolerance.error_percent == 10.0


def test_the_guard_band_is_the_same_everywhere():
    stated = re.search(r"expanded uncertainty \(([\d.]+) dB by default, `--uncertainty`", page("emission.md"))
    judge = next(key for table in reference() if table.title == 'do = "judge"' for key in table.keys if key.name == "uncertainty")
    assert stated is not None
    assert float(stated[1]) == options("predict")["--uncertainty"].default == float(judge.default.removesuffix(" dB"))


def test_exit_statuses_are_those_of_the_errors():
    text = page("hooks.py")
    assert f"{BadInput.exit_status} wrong use" in text
    assert f"{InstrumentError.exit_status} error of an instrument" in text
    assert f"{Stopped.exit_status} stopped by Ctrl-C" in text


def test_the_set_up_file_of_the_documentation_is_read(tmp_path):
    block = re.search(r"```toml\n(\[source\].*?)```", page("emission.md"), re.DOTALL)
    assert block is not None
    (tmp_path / "setup.toml").write_text(block[1])
    assert read_setup(tmp_path / "setup.toml").receiver.attenuation_db == 10


def test_the_statement_of_a_report_is_the_default():
    stated = re.search(r'statement = "([^"]+)"\s+# the default', page("howto/report.md"))
    assert stated is not None
    assert laboratory_of({"name": "any"}, "here").statement == stated[1]


def rows(text: str) -> set[str]:
    """The code in the first column of all tables of a text."""
    return set(re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE))


def test_tables_have_all_that_the_code_has():
    verdicts = set(get_args(Verdict))
    assert rows((ROOT / "README.md").read_text(encoding="utf-8")) == verdicts
    assert rows(page("explanation/evidence.md").partition("## The model")[0]) == verdicts
    optional = {one.name for one in dataclasses.fields(Effect) if one.default is not one.default_factory}
    assert rows(page("howto/own-effect.md")) == optional
    files = {option for option, one in options("export").items() if one.metavar == "FILE"}
    assert rows(page("howto/export.md")) == files


def test_numbers_of_a_fit_are_named_as_in_python():
    text = page("reference/glossary.md") + (ROOT / "README.md").read_text(encoding="utf-8")
    names = set(re.findall(r"`(\w+_(?:percent|sigma))`", text))
    assert len(names) >= 6
    assert names <= {*dir(me.Fit), *(one.name for one in dataclasses.fields(me.Fit))}


def test_limits_of_the_workbench_are_as_stated():
    mib = 1024**2
    text = " ".join(page("workbench.md").split())
    for stated in (
        f"up to {tray.MOST_FILES} files of {body.FILE.most_bytes // mib} MiB, {tray.MOST_BYTES // mib} MiB together",
        f"refused beyond {body.USUAL.most_bytes // 1024} KiB (a file: {body.FILE.most_bytes // mib} MiB, a profile with its logo: "
        f"{body.LETTERHEAD.most_bytes // mib} MiB)",
        f"not complete within {server.HEADER_DEADLINE_S:g} s is cut off",
        f"within {body.USUAL.within_s:g} s (a profile: {body.LETTERHEAD.within_s:g} s, a file: {body.FILE.within_s:g} s)",
        f"more than {thinning.WHOLE} points",
    ):
        assert stated in text


def test_modules_on_the_map_exist():
    """Every name in code in the first two columns of the table of packages is a module, a file or a folder."""
    missing = []
    for line in page("architecture.md").splitlines():
        if not line.startswith("| `src/motoremi/") or ".py`" in line.split("|")[1]:
            continue
        cells = line.split("|")
        folders = [ROOT / name if name.startswith(("src", "sim")) else ROOT / "src/motoremi" / name for name in re.findall(r"`([^`]+)`", cells[1])]
        missing += [str(folder) for folder in folders if not folder.is_dir()]
        for name in re.findall(r"(?<!method )`([\w/.]+)`", cells[2]):
            places = [place / name for folder in (*folders, ROOT, ROOT / "src/motoremi") for place in (folder, folder / "effects")]
            if not any(place.exists() or place.with_name(f"{place.name}.py").exists() for place in places):
                missing.append(f"{cells[1].strip()}: {name}")
    assert missing == []
