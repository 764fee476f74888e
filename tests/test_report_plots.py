"""Every result draws itself, and `motoremi plot` knows each plot by name."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.colors import to_rgb
from report_cases import whole_session
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.session import SessionWriter
from motoremi.diagnosis.signature import signature
from motoremi.report.axes import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION
from motoremi.report.kinds import PLOTS
from motoremi.report.svg import to_svg
from motoremi.workflow import ladder_of, opened
from motoremi.workflow_emission import diagnose_emission_session, emission_steps, predict_session
from motoremi.workflow_plots import figure_of

# Okabe and Ito's colours and greys: what all kinds of colour vision and grey prints tell apart.
COLOURS = {to_rgb(colour) for colour in (BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE)}
OPTIONS = {"inspection": ("--element", "Cf"), "signature": ("--effect", "core-loss")}


@pytest.fixture(scope="module")
def session(tmp_path_factory, measure) -> Path:
    return whole_session(tmp_path_factory.mktemp("plots") / "session", measure)


@pytest.mark.parametrize("what", PLOTS)
def test_every_plot_is_drawn_by_name(session, tmp_path, what):
    file = tmp_path / "plot.svg"
    result = CliRunner().invoke(app, ["plot", str(session), what, "--out", str(file), *OPTIONS.get(what, ())])
    assert result.exit_code == 0, result.output
    assert file.read_text().lstrip().startswith("<?xml")


def test_help_lists_every_plot():
    told = " ".join(CliRunner().invoke(app, ["plot", "--help"], env={"COLUMNS": "120"}).output.replace("│", " ").split())
    assert all(f"{name}: {text}" in told for name, text in PLOTS.items())


def test_every_result_draws_itself(session):
    loaded = me.load(session)
    fit = ladder_of(loaded)[-1]
    with opened(session) as store:
        emission = emission_steps(store)[-1]
        spectra_diagnosis, prediction = diagnose_emission_session(store), predict_session(store)
    results = (
        fit,
        me.compare(fit),
        me.diagnose(fit),
        me.inspect(fit, "La"),
        signature(fit, "core-loss"),
        prediction,
        emission,
        spectra_diagnosis,
        loaded,
        loaded.sweeps[0],
        loaded.spectra[0],
    )
    for result in results:
        assert result.plot().axes, type(result)


@pytest.mark.parametrize("what", PLOTS)
def test_plots_are_as_a_bench_engineer_reads_them(session, what):
    figure = figure_of(session, what, element="Cf", effect="core-loss")
    drawn = to_svg(figure, what)
    if what not in ("training", "ladder", "ranking", "emission-ranking"):
        assert all(axes.get_xscale() == "log" for axes in figure.axes)
        assert "frequency (Hz)" in drawn
        assert ">1 M<" in drawn
    assert all(axes.get_ylabel() or "ranking" in what for axes in figure.axes)
    curves = [line for axes in figure.axes for line in axes.get_lines()]
    assert {to_rgb(line.get_color()) for line in curves if len(set(to_rgb(line.get_color()))) > 1} <= COLOURS


def test_wrong_use_is_one_line(session, measure, tmp_path):
    for words in (("plot", session, "nonsense"), ("plot", session, "inspection"), ("plot", session, "signature")):
        assert CliRunner().invoke(app, [str(word) for word in words]).exit_code != 0
    for what, told in (("nonsense", "there are sweeps"), ("inspection", "--element"), ("signature", "--effect")):
        with pytest.raises(me.BadInput, match=told):
            figure_of(session, what)
    empty = tmp_path / "empty"
    with SessionWriter.create(empty, {"title": "empty"}) as writer:
        writer.add_sweep(measure(2)[0][0])
        writer.close("done")
    for what in ("fit", "ranking", "spectrum", "prediction", "emission-ranking"):
        with pytest.raises(me.BadInput, match=r"empty (has|holds) no"):
            figure_of(empty, what)
