"""The command line as a user and a script meet it: real files, exit statuses of the contract; in real processes where that is the point."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path
from random import Random
from unittest import mock

import numpy as np
import pytest
from command_line import document, motoremi, motoremi_process
from conftest import simulated_sweeps
from few_effects import FEW, seeking
from places import DATA, ROOT
from typer.main import get_command

import motoremi as me
from motoremi.cli.app import app
from motoremi.cli.arguments import ONE_VALUE, SEVERAL_FILES, expanded
from motoremi.cli.demo import PLAIN_PERCENT, plain_story
from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.session import load
from motoremi.errors import InstrumentError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def files(tmp_path_factory, measure):
    """CSV files of a motor with a hidden effect, written by hand: three repeats of each termination."""
    folder = tmp_path_factory.mktemp("files")
    sweeps, _ = measure(2, ("insulation-leakage@Cf",))
    for number, sweep in enumerate(sweeps):
        lines = ["# motor: by hand", "frequency_hz,resistance_ohm,reactance_ohm"]
        lines += [f"{f!r},{z.real!r},{z.imag!r}" for f, z in zip(sweep.frequency_hz.tolist(), sweep.impedance_ohm.tolist(), strict=True)]
        (folder / f"{sweep.termination}{number % 3 + 1}.csv").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="module")
def session(files):
    out = files / "session"
    shorts, opens = sorted(files.glob("short*.csv")), sorted(files.glob("open*.csv"))
    done = motoremi("import", out, "--short", *shorts, "--open", *opens, "--analyser", "4294a", "--json")
    assert done.returncode == 0, done.stderr
    imported = document(done)
    assert len(imported["sweeps"]) == 6
    assert imported["analyser_assumed"] is False
    return out


def thinned(file: Path, every: int, folder: Path) -> Path:
    """The same table with every so many-th of its lines."""
    head, *rows = [line for line in file.read_text().splitlines() if not line.startswith("#")]
    thin = folder / f"thin-{file.name}"
    thin.write_text("\n".join([head, *rows[::every]]) + "\n")
    return thin


@pytest.mark.usefixtures("few_effects")
def test_files_by_hand_are_fitted_and_diagnosed_by_the_contract(session):
    fitted = document(motoremi_process("fit", session, "--json"))
    assert fitted["effects"] == []
    assert set(fitted["parameters"]) == {"Ra", "La", "Ca", "Rr", "Lr", "Cr", "Cf"}
    done = motoremi("diagnose", session, "--json")
    assert done.returncode == 0
    found = document(done)
    assert found["schema"] == "motoremi.diagnosis/2"
    named = {*found["effects"], *(m for family in found["families"] for m in family)}
    assert "insulation-leakage@Cf" in named
    assert found["base"]["effects"] == []
    assert found["best"]["rms_error_percent"] < 1.5 * found["floor_percent"]

    failed = motoremi("compare", session, "--error-percent", "0.2", "--json")
    assert failed.returncode == 1
    assert document(failed)["verdict"] == "fail"

    step = document(motoremi("add", session, "insulation-leakage@Cf", "--json"))
    assert step["after"]["rms_error_percent"] < 0.3 * step["before"]["rms_error_percent"]
    passed = motoremi("compare", session, "--json")
    assert passed.returncode == 0
    assert document(passed)["tolerance"]["error_percent"] == 0.2  # the one used last

    ladder = document(motoremi("ladder", session, "--json"))
    assert [s["fit"]["effects"] for s in ladder["steps"]] == [[], ["insulation-leakage@Cf"]]
    assert set(document(motoremi("next", session, "--json"))) >= {"id", "why"}

    report = document(motoremi("report", session, "--json"))
    assert {Path(f).name for f in report["files"]} == {"report.html", "report.json", "report.pdf", "junit.xml", "parameters.csv"}
    plot = session.parent / "fit.png"
    assert motoremi("plot", session, "fit", "--out", plot).returncode == 0
    assert plot.read_bytes().startswith(b"\x89PNG")

    back = document(motoremi("drop", session, "--json"))
    assert back["after"]["effects"] == []
    assert motoremi("drop", session).returncode == 2

    assert motoremi("verify", session).returncode == 0
    victim = session / "sweeps" / "open-2.csv"
    data = bytearray(victim.read_bytes())
    data[100] ^= 1
    victim.write_bytes(bytes(data))
    tampered = motoremi("verify", session, "--json")
    assert tampered.returncode == 1
    assert document(tampered)["verdict"] == "fail"
    assert motoremi("fit", session).returncode == 2


def test_an_element_is_inspected(files, tmp_path):
    session = tmp_path / "session"
    assert motoremi("import", session, "--short", files / "short1.csv", "--open", files / "open1.csv").returncode == 0
    plot = tmp_path / "cf.svg"
    found = document(motoremi("inspect", session, "--element", "Cf", "--plot", plot, "--json"))
    assert (found["schema"], found["element"], found["unit"]) == ("motoremi.inspection/1", "Cf", "F")
    assert "leakage" in found["sweeps"][0]["reading"]
    assert plot.read_text().lstrip().startswith("<?xml")
    spoken = motoremi("inspect", session, "--element", "La")
    assert "constant" in spoken.stdout
    shown = document(motoremi("effects", "dielectric-loss", "--session", session, "--plot", tmp_path / "loss.svg", "--json"))
    assert len(shown["on_motor"]["sizes"]) == 2
    assert (tmp_path / "loss.svg").exists()
    assert "on this motor" in motoremi("effects", "core-loss", "--session", session).stdout
    assert motoremi("effects", "core-loss", "--plot", tmp_path / "x.svg").returncode == 2
    for wrong in ("Lx", "skin-effect"):
        done = motoremi("inspect", session, "--element", wrong)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
    assert motoremi("inspect", session, "--element", "La", "--plot", tmp_path / "la.doc").returncode == 2


def test_commands_speak_to_people_too(files, tmp_path):
    out = tmp_path / "s"
    done = motoremi("import", out, "--short", files / "short1.csv", "--open", files / "open1.csv")
    assert "401 points, 150 kHz - 30 MHz" in done.stdout
    assert "repeat it three times" in done.stdout
    assert "the size of its errors is estimated" in done.stdout
    fitted = motoremi("fit", out, "--bound", "La=1 uH:100 uH", "--seed", "3")
    assert fitted.returncode == 0
    assert "next: motoremi diagnose" in fitted.stdout
    held = motoremi("fit", out, "--hold", "Ra=2.3Ohm", "--hold", "La=12 uH")
    assert "held" in held.stdout
    assert load(out).ladder[0]["fit"]["held"] == {"Ra": 2.3, "La": pytest.approx(12e-6)}
    # The paper's colony works out a thousand points of every sweep's hundreds of frequencies: fewer do here.
    thin = tmp_path / "thin"
    assert (
        motoremi(
            "import", thin, "--short", thinned(files / "short1.csv", 10, tmp_path), "--open", thinned(files / "open1.csv", 10, tmp_path)
        ).returncode
        == 0
    )
    assert motoremi("fit", thin, "--method", "paper").returncode == 0
    assert "paper" in json.dumps(load(thin).ladder[0]["fit"]["method"])


@pytest.mark.usefixtures("few_effects")
def test_native_4294a_file_and_real_motor_go_the_whole_way(tmp_path):
    inductor = DATA / "eth_4294A_inductor" / "impedance.txt"
    assert motoremi("import", tmp_path / "l", "--short", inductor).returncode == 0
    fitted = motoremi("fit", tmp_path / "l")
    assert "not in these sweeps: Rr, Lr, Cr, Cf" in fitted.stdout
    assert motoremi("report", tmp_path / "l").returncode == 0
    assert "do not show Rr, Lr, Cr, Cf" in (tmp_path / "l" / "report" / "report.html").read_text()

    motor = thinned(next((DATA / "motor_1p5hp_dm_cc_by").glob("*.csv")), 5, tmp_path)
    assert motoremi("import", tmp_path / "m", "--short", motor).returncode == 0
    assert motoremi("compare", tmp_path / "m").returncode == 1
    found = document(motoremi("diagnose", tmp_path / "m", "--json"))
    assert found["verdict"] == "unexplained"
    assert found["best"]["rms_error_percent"] < 0.6 * found["base"]["rms_error_percent"]
    assert any("no open sweep" in caveat for caveat in found["caveats"])


# All effects, of motor and source, are sought by the demos of the tutorial and of the installed wheel.
@pytest.mark.case
@pytest.mark.usefixtures("few_effects", "few_source_effects")
def test_demo_tells_the_whole_story(tmp_path):
    done = motoremi("demo", "--effect", "dielectric-loss@Cf", "--seed", "5", "--out", tmp_path / "d", "--json")
    assert done.returncode == 0, done.stderr
    told = document(done)
    assert told["schema"] == "motoremi.demo/1"
    assert told["hidden"] == ["dielectric-loss@Cf"]
    assert "dielectric-loss@Cf" in {*told["named"], *(m for family in told["families"] for m in family)}
    assert told["error_after_percent"] < 1.5 * told["floor_percent"]
    assert told["error_after_percent"] < told["error_before_percent"]
    assert Path(told["report"]).stat().st_size < 3e6
    assert motoremi("verify", told["session"]).returncode == 0
    # The hidden truth is nowhere in the session.
    everything = b"".join(p.read_bytes() for p in sorted((tmp_path / "d").glob("*.jsonl")) + sorted((tmp_path / "d" / "sweeps").iterdir()))
    assert everything.count(b"dielectric-loss") == everything.count(b'"effects":["dielectric-loss@Cf"]')
    replayed = motoremi("replay", told["session"], "--out", tmp_path / "again", "--json")
    assert document(replayed)["same"] is True
    for file in (tmp_path / "d" / "sweeps").iterdir():
        assert (tmp_path / "again" / "sweeps" / file.name).read_bytes() == file.read_bytes()


@pytest.mark.case
@pytest.mark.usefixtures("few_effects", "few_source_effects")
def test_demo_without_a_hidden_effect_is_adequate(tmp_path):
    told = document(motoremi("demo", "--effect", "none", "--seed", "6", "--out", tmp_path / "d", "--json"))
    assert told["verdict"] == "adequate"
    assert told["named"] == told["hidden"] == []
    assert told["error_after_percent"] < 1.5 * told["floor_percent"]


@pytest.mark.case
def test_a_demo_without_wishes_is_plain_to_see():
    """The error is several per cent, and adding what is named takes it down to what noise and analyser leave."""
    fallen, draws = 0, Random(1)
    for _ in range(2):
        seed, effect = plain_story(draws)
        fit = me.fit(me.dc_motor(), simulated_sweeps(seed, (effect,))[0])
        assert fit.rms_error_percent > 0.6 * PLAIN_PERCENT
        with seeking({*FEW, effect}):
            best = me.diagnose(fit).best
        fallen += best.rms_error_percent < 1.5 * best.floor_percent
    # Of 14 that were drawn, 14 did.
    assert fallen == 2


def test_a_demo_says_how_it_chose(tmp_path, monkeypatch):
    def broken(*_: object, **__: object) -> None:
        raise InstrumentError("the bench is gone")

    monkeypatch.setattr("motoremi.run.runner.run", broken)
    monkeypatch.setattr("motoremi.cli.demo.plain_story", lambda random: (3, "lead-inductance"))
    for wishes, chosen in (([], True), (["--seed", "3"], False), (["--effect", "core-loss"], False)):
        done = motoremi("demo", "--out", tmp_path / f"d{len(wishes)}{chosen}{wishes[:1]}", *wishes)
        assert done.returncode == 3
        assert ("drawn so that it is plain to see" in done.stdout) is chosen


@pytest.mark.usefixtures("few_effects")
def test_run_on_the_simulated_bench_judges(tmp_path):
    bench = tmp_path / "bench.toml"
    bench.write_text('backend = "sim"\noperator = "A. Tester"\nseed = 3\neffects = ["core-loss"]\n')
    done = motoremi("run", "impedance_only", "--bench", bench, "--out", tmp_path / "r", "--json")
    assert done.returncode == 1  # the paper's circuit cannot pass on this motor
    told = document(done)
    assert told["verdict"] == "fail"
    assert load(tmp_path / "r").status == "done"


CASES = {
    "missing": (None, "no such file"),
    "empty": (b"", "empty"),
    "binary": (bytes(range(256)) * 8, ""),
    "truncated": (b"frequency_hz,resistance_ohm,reactance_ohm\n" + b"".join(b"%d,1.5,2.5\n" % (1000 * k) for k in range(1, 30)) + b"30000,1.", ""),
    "nan": (b"frequency_hz,resistance_ohm,reactance_ohm\n" + b"".join(b"%d,nan,2\n" % (1000 * k) for k in range(1, 30)), ""),
    "unsorted": (b"frequency_hz,resistance_ohm,reactance_ohm\n" + b"".join(b"%d,1,2\n" % (1000 * (k ^ 1)) for k in range(2, 32)), "increas"),
    "repeated": (b"frequency_hz,resistance_ohm,reactance_ohm\n" + b"1000,1,2\n" * 30, "twice"),
    "decibel": (b"frequency_hz,level_dbuv\n" + b"".join(b"%d,40\n" % (1000 * k) for k in range(1, 30)), ""),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_files_get_one_line_and_leave_nothing(case, tmp_path):
    content, message = CASES[case]
    file = tmp_path / "bad.csv"
    if content is not None:
        file.write_bytes(content)
    done = motoremi("import", tmp_path / "out", "--short", file)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stderr.startswith("motoremi: ")
    assert message in done.stderr
    assert "bad.csv" in done.stderr
    assert not (tmp_path / "out").exists()


def test_wrong_use_is_one_line_and_status_2(tmp_path, files):
    session = tmp_path / "session"
    assert motoremi("import", session, "--short", files / "short1.csv").returncode == 0
    for arguments in (
        ("fit",),
        ("bogus",),
        ("fit", tmp_path / "nothing"),
        ("fit", session, "--hold", "Rx=2Ohm"),
        ("fit", session, "--hold", "Ra=two"),
        ("fit", session, "--hold", "Ra=2H"),
        ("fit", session, "--hold", "Ra=-2Ohm"),
        ("fit", session, "--hold", "Ra"),
        ("import", tmp_path / "o"),
        ("import", tmp_path / "o", "--short", files / "short1.csv", "--analyser", "4249a"),
        ("effects", "eddy-lamination"),
        ("demo", "--effect", "warp-drive"),
        ("run", "no_such_procedure"),
        ("verify", tmp_path / "nothing"),
    ):
        done = motoremi_process(*arguments) if arguments == ("fit",) else motoremi(*arguments)
        assert done.returncode == 2, arguments
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr
        assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("effects", "says"),
    [
        (("lead-inductance", "eddy-lamination"), "did you mean eddy-laminations?"),
        (("lead-inductance", "lead-inductance"), "named twice"),
        (("lead-inductance", "arc-breakdown"), "arc-breakdown belongs to the spectra's model: add it alone"),
    ],
)
def test_several_effects_of_which_one_cannot_be_added_change_nothing(tmp_path, files, effects, says):
    motoremi("import", tmp_path / "s", "--short", files / "short1.csv", "--open", files / "open1.csv")
    done = motoremi("add", tmp_path / "s", *effects)
    assert done.returncode == 2
    assert says in done.stderr
    assert load(tmp_path / "s").analyses == ()


def test_unknown_effect_changes_nothing(tmp_path, files):
    motoremi("import", tmp_path / "s", "--short", files / "short1.csv", "--open", files / "open1.csv")
    before = (tmp_path / "s" / "session.jsonl").read_bytes()
    done = motoremi("add", tmp_path / "s", "eddy-lamination")
    assert done.returncode == 2
    assert "did you mean eddy-laminations?" in done.stderr
    assert load(tmp_path / "s").analyses == ()
    assert (tmp_path / "s" / "session.jsonl").read_bytes().startswith(before)


def test_sweeps_of_different_span_are_judged_each_over_its_own(tmp_path, files, measure):
    sweeps, _ = measure(4)
    short, open_ = sweeps[0], sweeps[3]
    cut = type(short)("short", short.frequency_hz[:200], short.impedance_ohm[:200])
    write_impedance_csv(tmp_path / "short.csv", cut)
    write_impedance_csv(tmp_path / "open.csv", open_)
    done = motoremi("import", tmp_path / "s", "--short", tmp_path / "short.csv", "--open", tmp_path / "open.csv", "--analyser", "none")
    assert "different spans" in done.stdout
    fitted = document(motoremi("fit", tmp_path / "s", "--json"))
    assert fitted["converged"]
    assert any("different spans" in warning for warning in fitted["warnings"])


def test_run_without_an_instrument_is_status_3(tmp_path):
    procedure = tmp_path / "p.toml"
    text = (ROOT / "procedures" / "impedance_only.toml").read_text()
    procedure.write_text(text.replace("GPIB0::17::INSTR", "TCPIP::127.0.0.1::9::SOCKET"))
    done = motoremi("run", procedure, "--out", tmp_path / "r")
    assert done.returncode == 3
    assert len(done.stderr.strip().splitlines()) == 1
    assert load(tmp_path / "r").status == "failed"


def test_every_command_has_help_with_an_example():
    listing = motoremi("--help").stdout
    names = [
        "demo", "run", "replay", "import", "verify", "fit", "compare", "diagnose", "add", "drop", "ladder", "next", "report", "plot",
        "effects", "instruments", "doctor",
    ]  # fmt: skip
    for name in names:
        assert name in listing
    for name in ("demo", "import", "fit", "plot"):
        done = motoremi(name, "--help")
        assert done.returncode == 0
        assert "Example: motoremi" in done.stdout


def test_without_a_command_the_commands_are_listed():
    done = motoremi()
    assert done.returncode == 2
    assert "diagnose" in done.stdout
    assert done.stderr == "motoremi: no command was given; those above can be: motoremi COMMAND --help describes one\n"


def test_every_command_has_an_example_and_speaks_json():
    commands = get_command(app).commands
    assert {"simulate", "investigate", "workbench", "fleet"} <= set(commands)
    for name, command in commands.items():
        assert (command.epilog or "").startswith(f"Example: motoremi {name}")
        assert any("--json" in parameter.opts for parameter in command.params), name


def test_catalogue_and_doctor_speak_json():
    effects = document(motoremi("effects", "--json"))["effects"]
    assert {"eddy-laminations", "open-residual"} <= {effect["name"] for effect in effects}
    assert document(motoremi("effects", "dielectric-loss@Cf", "--json"))["parameters"]
    assert document(motoremi("doctor", "--json"))["packages"]["numpy"] == np.__version__
    assert set(document(motoremi("instruments", "--json"))["drivers"]) >= {"4294a", "esr"}


def test_several_files_behind_one_option():
    given = ["import", "out", "--short", "a", "b", "--open", "c", "--analyser", "none"]
    assert expanded(given) == ["import", "out", "--short", "a", "--short", "b", "--open", "c", "--analyser", "none"]
    assert expanded(["import", "--short", "a", "--open", "c", "out"]) == ["import", "out", "--short", "a", "--open", "c"]
    assert expanded(["fit", "--short"]) == ["fit", "--short"]


def test_a_forgotten_folder_is_not_taken_from_the_value_of_an_option():
    given = ["import", "--short", "a", "b", "--open", "c", "d", "--motor", "M 7"]
    assert expanded(given) == ["import", "--short", "a", "--short", "b", "--open", "c", "--open", "d", "--motor", "M 7"]
    assert motoremi(*given).stderr.strip().endswith("Missing argument 'OUT'.")


def test_every_option_of_import_is_known_where_files_are_told_from_values():
    from typer.main import get_command

    from motoremi.cli.app import app

    options = [one for one in get_command(app).commands["import"].params if one.param_type_name == "option" and not one.is_flag]
    assert {name for one in options for name in one.opts} == {*SEVERAL_FILES, *ONE_VALUE}
    assert {name for one in options if one.multiple for name in one.opts} >= {*SEVERAL_FILES}


@pytest.mark.parametrize("where", ["while loading", "before the session", "in the session"])
def test_ctrl_c_says_what_is_kept_only_where_something_is(tmp_path, monkeypatch, capsys, where):
    from motoremi.cli import main
    from motoremi.data.recording import SessionWriter

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("sys.argv", ["motoremi", "run", "impedance_only", "--bench", "sim", "--out", str(tmp_path / "s")])
    if where == "while loading":
        monkeypatch.setitem(sys.modules, "motoremi.cli.app", type("Slow", (), {"__getattr__": stop})())
    elif where == "before the session":
        monkeypatch.setattr(SessionWriter, "create", stop)
    else:
        monkeypatch.setattr("motoremi.run.runner.run", stop)
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 130
    kept = f"; what was measured is kept in {tmp_path / 's'}" if where == "in the session" else ""
    assert capsys.readouterr().err.splitlines()[-1] == f"motoremi: stopped{kept}"


def import_two_effects(folder: Path, measure) -> None:
    """A session `s` of a motor with two hidden effects."""
    sweeps, _ = measure(2, ("insulation-leakage@Cf", "lead-inductance"))
    files = [folder / f"{number}.csv" for number in range(len(sweeps))]
    for file, sweep in zip(files, sweeps, strict=True):
        write_impedance_csv(file, sweep)
    motoremi("import", folder / "s", "--short", *files[:3], "--open", *files[3:], "--analyser", "4294a")


@pytest.mark.case
@pytest.mark.usefixtures("few_effects")
def test_two_named_effects_are_shown_and_added_together(tmp_path, measure):
    import_two_effects(tmp_path, measure)
    told = motoremi("diagnose", tmp_path / "s").stdout.splitlines()
    # Where the model fails is that of the model before the effects are added.
    assert any(line.startswith("  paper's circuit: fails: ") for line in told)
    together = next(line for line in told if line.startswith("  together: "))
    command = next(line for line in told if line.startswith("next: motoremi add "))
    names = command.removeprefix(f"next: motoremi add {tmp_path / 's'} ").split()
    assert sorted(names) == ["insulation-leakage@Cf", "lead-inductance"]
    assert all(name in together for name in names)
    shown = [
        line.split() for line in told[told.index(next(line for line in told if line.startswith("  values of "))) + 1 :] if line.startswith("    ")
    ]
    assert {words[0].rpartition(".")[0] for words in shown} == set(names)
    assert all("(1 sigma)" in " ".join(words) or "bound" in " ".join(words) or "determined" in " ".join(words) for words in shown)
    step = document(motoremi("add", tmp_path / "s", *names, "--json"))
    left = step["after"]["rms_error_percent"]
    assert f"error {left:.3g} %" in together
    diagnosed = load(tmp_path / "s").analysis("diagnosis")["best"]
    assert left == pytest.approx(diagnosed["rms_error_percent"], rel=1e-3)
    assert step["after"]["effects"] == diagnosed["effects"]


def test_effects_that_were_diagnosed_together_are_added_with_the_values_of_the_diagnosis(tmp_path, measure):
    """A search of its own may end elsewhere where resonances make many minima."""
    import_two_effects(tmp_path, measure)
    with seeking({"insulation-leakage@Cf", "lead-inductance"}):
        motoremi("diagnose", tmp_path / "s")
    with mock.patch("motoremi.workflow.added_together", side_effect=AssertionError("searched again")):
        done = motoremi("add", tmp_path / "s", "lead-inductance", "insulation-leakage@Cf", "--json")
    diagnosed = load(tmp_path / "s").analysis("diagnosis")["best"]
    added = {name: entry["value"] for name, entry in document(done)["after"]["parameters"].items()}
    assert added == pytest.approx(diagnosed["parameters"], rel=1e-3)


@pytest.mark.parametrize("form", [(), ("--json",)], ids=["text", "json"])
def test_output_that_cannot_hold_every_character(files, tmp_path, form):
    """A pipe that takes ASCII only: a question mark in text, an escape in JSON."""
    named = tmp_path / "M\N{GREEK CAPITAL LETTER OMEGA}.csv"
    named.write_bytes((files / "short1.csv").read_bytes())
    done = motoremi_process("import", tmp_path / "s", "--short", named, *form, PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert done.returncode == 0, done.stderr
    assert document(done)["sweeps"][0]["source"] == named.name if form else "short M?.csv" in done.stdout


def on_a_terminal(*arguments: object) -> str:
    """What a command shows on standard error if that is a terminal."""
    ours, theirs = os.openpty()
    words = [sys.executable, "-m", "motoremi", *map(str, arguments)]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=theirs, env={**os.environ, "TERM": "xterm", "COLUMNS": "120"})
    os.close(theirs)
    shown = b""
    # Linux ends the reading of a terminal that nobody writes to any longer by an error.
    with contextlib.suppress(OSError):
        while part := os.read(ours, 4096):
            shown += part
    os.close(ours)
    assert process.wait() == 0
    return shown.decode()


def test_import_and_fit_show_their_progress_on_a_terminal_only(files, tmp_path):
    given = ("--short", files / "short1.csv", "--open", files / "open1.csv")
    shown = on_a_terminal("import", tmp_path / "s", *given)
    for text in ("reading: short1.csv", "reading: open1.csv", "importing: checking the data", "importing: storing the session"):
        assert text in shown
    assert "fitting: ants, round 1" in on_a_terminal("fit", tmp_path / "s")
    assert on_a_terminal("import", tmp_path / "json", *given, "--json") == ""
    assert motoremi_process("import", tmp_path / "piped", *given).stderr == ""
