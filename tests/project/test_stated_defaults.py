"""What help and documentation state is what the code does: defaults, options, names, numbers."""

from __future__ import annotations

import dataclasses
import math
import re
import shlex
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import command_line
import numpy as np
import pytest
import typer.main
from conftest import simulated_sweeps
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data import coarse, loose_contact, measurement, mislabelled, plausible
from motoremi.data import rows as file_rows
from motoremi.data.analyser import DECLARED, find_analyser
from motoremi.data.csvfiles import impedance_csv
from motoremi.data.laboratory import laboratory_of
from motoremi.diagnosis import belief, candidates, decision, declared, findings, informed, judgement, thresholds
from motoremi.diagnosis.belief import Verdict
from motoremi.emission import spectrum_problem
from motoremi.emission.judge import EXPANDED_UNCERTAINTY_DB
from motoremi.emission.setup import read_setup
from motoremi.errors import BadInput, InstrumentError, Stopped
from motoremi.fitting import marginal, race, result, search
from motoremi.investigation import mistakes, outcome, question, responses, rivals, weighing
from motoremi.model.effects import machine
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


def the_analyser_of_a_folder_of_files_is_unknown(folder: Path) -> None:
    rows = [f"{1e5 * number},3,{17 * number}" for number in range(1, 9)]
    (folder / "many").mkdir()
    (folder / "many/7_short.csv").write_text("\n".join(["frequency_hz,resistance_ohm,reactance_ohm", *rows, ""]))
    assert motoremi(folder, "import-folder", "many", "imported", "--short", "*_short.csv").returncode == 0
    assert me.fit(me.dc_motor(), me.load(folder / "imported/7").sweeps).measurement.analyser.name == "unknown"


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
    assert re.search(r"seed \d+", motoremi(folder, "scoreboard", "--spectra", "--cases", "1", "--jobs", "1").stdout)


def the_effect_of_a_demo_follows_from_its_seed(folder: Path) -> None:
    assert options("demo")["--effect"].default is None
    assert options("demo")["--seed"].default is None


# Every option whose help states a default in words, with the check of it.
IN_WORDS: dict[tuple[str, str], Callable[[Path], None]] = {
    ("", "config"): settings_are_those_of_this_folder,
    ("demo", "effect"): the_effect_of_a_demo_follows_from_its_seed,
    ("import", "analyser"): the_analyser_is_unknown,
    ("import-folder", "analyser"): the_analyser_of_a_folder_of_files_is_unknown,
    ("export", "termination"): touchstone_is_of_the_open_sweep,
    ("plot", "out"): a_plot_is_called_after_what_it_shows,
    ("fleet", "out"): a_fleet_is_beside_its_folder,
    ("challenge", "seed"): challenges_differ,
    ("scoreboard", "seed"): the_seed_of_a_scoreboard_is_drawn_and_printed,
}
# These take half a second or more.
SLOW = {("import-folder", "analyser"), ("scoreboard", "seed"), ("plot", "out"), ("fleet", "out"), ("export", "termination"), ("", "config")}


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
    assert float(stated[1]) == EXPANDED_UNCERTAINTY_DB == float(judge.default.removesuffix(" dB"))
    option = options("predict")["--uncertainty"]
    # Without the option it is the one that was given last, and at first the usual one.
    assert option.default is None
    assert f"; {EXPANDED_UNCERTAINTY_DB:g} dB at first; kept" in option.help


def test_exit_statuses_are_those_of_the_errors():
    text = page("hooks.py")
    assert f"{BadInput.exit_status} wrong use" in text
    assert f"{InstrumentError.exit_status} an instrument or scheduler does not answer" in text
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


def test_numbers_of_the_pages_on_evidence_are_those_of_the_code():
    """Thresholds in words and digits; a sentence that is written differently has to be changed here too."""
    evidence, details, investigations, spectra, files = (
        " ".join(page(name).split())
        for name in (
            "explanation/evidence.md",
            "explanation/evidence_details.md",
            "explanation/investigation.md",
            "emission.md",
            "howto/files.md",
        )
    )
    none, one, two, _ = candidates.PRIOR_OF_SIZE
    sizes = marginal.DISCREPANCIES
    for text, stated in (
        (evidence, f"from {100 * sizes[1]:g} % to {100 * sizes[-1]:g} %"),
        (evidence, f"(odds above e^{declared.TAKEN:g})"),
        (evidence, f"half of the motors need no effect, {100 * one:g} % one, {100 * two:g} % two"),
        (
            evidence,
            f"more steps for {race.GLANCE.rounds[1].models} of them, and for the {race.LEADERS} best more points, {race.IN_FULL} of them from",
        ),
        (evidence, f"leaves less than {200 * search.PLAIN:g} %"),
        (evidence, f"together have {100 * belief.FAMILY_TOGETHER:g} % of its probability"),
        (evidence, f"at most {belief.MOST_ERRING_PERCENT:g} % counts"),
        (evidence, f"odds of e^{judgement.CLEAR_GAIN:g}, and half the error"),
        (evidence, f"at most {belief.RELIABLE['names, not as declared']:g} if the data also fit another analyser"),
        (evidence, f"at most {belief.RELIABLE['names beyond the specification']:g} if an impedance analyser"),
        (
            evidence,
            f"From the open-circuit sweep alone a name is stated with at most {belief.RELIABLE['named from the open-circuit sweep alone']:g}",
        ),
        (evidence, f"`adequate` is stated with at most {belief.RELIABLE['adequate, a weak effect unnamed']:g}"),
        (files, f"above {file_rows.REFLECTS_TOO_MUCH:g} at more than"),
        (files, f"below {1e3 * plausible.LEAST_OHM:g} mOhm or above {plausible.MOST_OHM / 1e6:g} MOhm"),
        (files, f"less than {100 * plausible.LEAST_PHASE:g} % of what the slope"),
        (files, f"differ at more than {100 * loose_contact.TOO_MANY:g} % of the points by the same resistance"),
        (details, f"more than {plausible.MOST_PHASE:g} times what the slope requires"),
        (details, f"up to {('no', 'one', 'two', 'three', 'four')[decision.FURTHER]} sets of its size within odds of e^{thresholds.CLEAR_GAIN:g}"),
        (evidence, f"an element's value with it is more than {thresholds.MOVED_SIGMA:g} error bars away"),
        (details, f"correlated by less than {-plausible.ALIKE:g} "),
        (details, f"less than {100 * plausible.LEAST_PHASE:g} % of what the slope requires"),
        (details, f"changes by more than {100 * plausible.LEAST_CHANGE:g} % (rms of its logarithm)"),
        (details, f"{100 * plausible.LEAST_PHASE:g} % of these changes"),
        (details, f"twice and four times those of the specification is {100 * DECLARED[2.0]:g} % and {100 * DECLARED[4.0]:g} %"),
        (details, f"one of {math.sqrt(result.WORSE):.1f} standard deviations"),
        (details, f"more than {coarse.MOST_POINTS} points are reduced to about {coarse.COARSE_POINTS - 1} averages"),
        (details, f"at more than {100 * findings.OFTEN:g} % of the points"),
        (details, f"at least by {100 * findings.NEGATIVE * findings.UNDECLARED:g} % of |Z|"),
        (details, f"within {100 * mislabelled.THE_SAME:g} % at {100 * mislabelled.OF_POINTS:g} % of the points"),
        (details, f"or {measurement.GOOD_ENOUGH_PERCENT:g} % if none is stated"),
        (details, f"odds of e^{judgement.CLEAR_GAIN:g}, or of e^{judgement.ENOUGH_GAIN:g} if it describes everything"),
        (details, f"sweeps that begin below {machine.CAGE_SEEN_BELOW_HZ / 1e3:g} kHz"),
        (
            investigations,
            f"{100 * informed.OUTSIDE['explained']:g} % if one effect describes everything, "
            f"{100 * (1 - belief.RELIABLE['two names']):g} % if two do "
            f"({100 * (1 - belief.RELIABLE['two names, one describes nearly all']):g} % if one of them describes nearly all), "
            f"{100 * (1 - belief.RELIABLE['three names']):g} % if three do, "
            f"up to {100 * informed.OUTSIDE['not']:g} % if none",
        ),
        (investigations, f"from {100 * min(weighing.UNDESCRIBED):g} % to {100 * max(weighing.UNDESCRIBED):g} %"),
        (investigations, f"{responses.ROOM_DEGC:g} ± {responses.ROOM_SIGMA_K:g} °C"),
        (investigations, f"a lead to {100 * outcome.LEAD_TOLERANCE:g} %, a capacitor to {100 * outcome.CAPACITOR_TOLERANCE:g} %"),
        (investigations, f"with a probability of {100 * rivals.UNMOVED:g} %; with {100 * rivals.NOTHING_DONE:g} % the change was not made"),
        (investigations, f"With a probability of {100 * rivals.DOUBT:g} %"),
        (investigations, f"a prior of {100 * mistakes.WRONG:g} % in all"),
        (investigations, f"with {100 * mistakes.STRANGE:g} % an unknown mistake"),
        (investigations, f"{question.DRAWS} outcomes drawn under each explanation"),
        (investigations, f"{question.ODDS:g} times as probable as all others together"),
        (investigations, f"no remaining measurement gives {question.NOTHING_BITS:g} bits"),
        (spectra, f"below {spectrum_problem.ALL_BELOW_HZ / 1e6:g} MHz (of more than {2 * spectrum_problem.POINTS_ABOVE} points there, "),
    ):
        assert stated in text, stated
    assert none == 0.5


def test_ranges_of_a_motor_between_two_ports_are_those_of_the_error_model():
    """At the ends of each range in the table the error is about 10 %: they are stated with one or two digits."""
    row = next(line for line in page("howto/two-ports.md").splitlines() if line.startswith("| a NanoVNA is taken to err by less than 10 %"))
    low, high, high_30 = (float(one) for one in re.findall(r"[\d.]+", row.split("|")[2].replace("30 MHz", "")))
    ends = [("series-through", 10e6, low), ("series-through", 10e6, 1e3 * high), ("series-through", 30e6, 1e3 * high_30)]
    low, high, low_1, low_30 = (float(one) for one in re.findall(r"[\d.]+", re.sub(r"\d+ MHz", "", row.split("|")[3])))
    ends += [("shunt-through", 10e6, low), ("shunt-through", 10e6, high), ("shunt-through", 1e6, low_1), ("shunt-through", 30e6, low_30)]
    for fixture, frequency_hz, ohm in ends:
        (error,) = find_analyser(f"nanovna+{fixture}").uncertainty(np.array([frequency_hz]), np.array([ohm + 0j]))
        assert 0.075 < error < 0.11, (fixture, frequency_hz, ohm)
