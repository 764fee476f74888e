"""Every result draws itself, and `motoremi plot` knows each plot by name."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from report_cases import whole_session
from typer.testing import CliRunner

import motoremi as me
from motoremi import drawing
from motoremi.cli.app import app
from motoremi.data.session import SessionWriter
from motoremi.inspection.effect_signature import signature
from motoremi.inspection.element import ElementCurve, Inspection
from motoremi.report.axes import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, legend_above, panels
from motoremi.report.inspection_figure import inspection_figure
from motoremi.report.kinds import PLOTS
from motoremi.report.resonance_labels import mark_resonances
from motoremi.report.svg import to_svg
from motoremi.workflow import ladder_of, opened
from motoremi.workflow_emission import diagnose_emission_session, emission_steps, predict_session
from motoremi.workflow_plots import figure_of

pytestmark = pytest.mark.slow

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


@pytest.mark.usefixtures("few_effects", "few_source_effects")
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


@pytest.mark.parametrize("what", PLOTS)
def test_no_text_is_cut_or_covers_another(session, what):
    """The plots place their texts themselves; here matplotlib measures them."""
    figure = figure_of(session, what, "Cf", "core-loss")
    figure.draw_without_rendering()
    for axes in figure.axes:
        name = axes.yaxis.label.get_window_extent()
        shown = [label.get_window_extent() for label in axes.get_yticklabels() if label.get_text()]
        low, high = axes.get_window_extent().intervaly
        shown = [box for box in shown if low <= (box.y0 + box.y1) / 2 <= high]
        assert not axes.get_ylabel() or all(name.x1 <= box.x0 for box in shown)
        assert all(figure.bbox.x0 <= box.x0 for box in [*shown, name])
        # Nor is the name of a resonance cut by the panel's edge.
        assert axes.get_xscale() != "log" or what == "ranking" or all(low <= note.get_window_extent().y0 for note in axes.texts)
        if what in ("sweeps", "fit"):
            notes = [note.get_window_extent() for note in axes.texts]
            assert not any(one.overlaps(other) for one, other in itertools.combinations(notes, 2))
        # Ticks beyond the ends of an axis have a label too, which is not drawn.
        left, right = axes.get_window_extent().intervalx
        numbers = [label.get_window_extent() for label in axes.get_xticklabels()]
        below = [axes.xaxis.label.get_window_extent(), *(box for box in numbers if left - 1 <= (box.x0 + box.x1) / 2 <= right + 1)]
        assert all(figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 and box.y0 >= figure.bbox.y0 for box in below if box.width)
    panels = max(axes.get_window_extent().y1 for axes in figure.axes)
    assert all(panels <= legend.get_window_extent().y0 + 2 for legend in figure.legends)


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


def test_what_nobody_can_draw_is_told():
    with pytest.raises(TypeError, match="there is no figure of a Tolerance"):
        drawing.figure_of(me.Tolerance())


def test_results_are_drawn_without_asking_for_the_report_first():
    code = (
        "import numpy as np, motoremi as me; f = np.geomspace(1e5, 1e7, 21); z = 50 + 2j * np.pi * f * 1e-6; "
        "import sys; sweep = me.ImpedanceSweep('short', f, z); assert 'motoremi.report.figures' not in sys.modules; assert sweep.plot().axes"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, "MPLBACKEND": "agg"})


@pytest.mark.parametrize("width", [5.0, 10.0])
@pytest.mark.parametrize("labels", [["a", "b", "c", "d", "e"], ["measured", "the circuit + " + "lead-inductance + " * 6 + "3 winding-modes"]])
def test_a_legend_is_no_wider_than_its_figure_and_above_the_panels(width, labels):
    """A model with many effects has a label of two lines."""
    figure, ((axes,),) = panels(width, 4.0)
    for label in labels:
        axes.plot([1.0, 2.0], [1.0, 2.0], label=label)
    legend_above(figure, axes)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.x1
    assert axes.get_window_extent().y1 <= box.y0 + 2
    assert [text.get_text().replace("\n", " ") for text in legend.texts] == labels


def test_an_element_has_a_gap_where_it_is_not_known_and_its_axis_holds_the_models_line() -> None:
    f = np.geomspace(150e3, 30e6, 31)
    curve = ElementCurve("open", f, 5.0 + 1j * np.linspace(1, 2, 31), np.where(np.arange(31) < 20, 1e-3, np.inf), np.full(31, 400 + 30j))
    figure = inspection_figure(Inspection("Rr", "Ohm", (), [curve], {}))
    for axes, value in zip(figure.axes, (400.0, 30.0), strict=True):
        needed, model = (line.get_ydata() for line in axes.lines[:2])
        assert np.isfinite(needed[:20]).all()
        assert np.isnan(needed[20:]).all()
        assert set(model) == {value}
        assert axes.get_ylim()[0] < value < axes.get_ylim()[1]


@pytest.mark.parametrize(("farthest", "marks"), [(6.0, 0), (60.0, 1)])
def test_the_axis_of_an_element_holds_its_uncertainty_and_a_mark_for_what_it_cuts(farthest: float, marks: int) -> None:
    f = np.geomspace(150e3, 30e6, 31)
    needed, sigma = np.linspace(4.5, 5.5, 31).astype(np.complex128), np.full(31, 0.05)
    needed[7], sigma[7] = farthest, 0.4
    top = inspection_figure(Inspection("Rr", "Ohm", (), [ElementCurve("open", f, needed, sigma, np.full(31, 5.0 + 0j))], {})).axes[0]
    low, high = top.get_ylim()
    assert low < 4.5 * 0.9
    assert 5.5 < high < 12
    assert (farthest < high) == (marks == 0)
    assert [line.get_xydata().tolist() for line in top.lines if line.get_marker() == "^"] == [[[f[7], high]]] * marks


@pytest.mark.parametrize("second", [0.3, 0.6, 1.0])
def test_labels_of_resonances_stand_at_their_own_marks(second: float) -> None:
    """Two peaks 10 % apart and the dip between them: a reader takes a label for that of the nearest mark."""
    axes = _resonances([5.882e6, 6.5e6 if second < 0.5 else 6.202e6], [1.0, second])
    marks = axes.transData.transform([(line.get_xdata()[0], line.get_ydata()[0]) for line in axes.lines])
    assert len(axes.texts) == len(marks) == 3
    for text in axes.texts:
        box = text.get_window_extent()
        away = [np.hypot(max(box.x0 - x, 0, x - box.x1), max(box.y0 - y, 0, y - box.y1)) for x, y in marks]
        np.testing.assert_allclose(marks[int(np.argmin(away))], axes.transData.transform(text.xy))


def test_labels_that_have_no_room_are_left_out() -> None:
    """Thirty resonances, all marked: no label covers another one, and the widest apart have one."""
    axes = _resonances(np.geomspace(200e3, 25e6, 30).tolist(), [1.0] * 30)
    boxes = [text.get_window_extent() for text in axes.texts]
    assert 5 < len(boxes) < len(axes.lines)
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    panel = axes.get_window_extent()
    assert all(panel.x0 <= box.x0 and box.x1 <= panel.x1 and panel.y0 <= box.y0 and box.y1 <= panel.y1 for box in boxes)


def _resonances(at_hz: list[float], size: list[float]) -> Axes:
    axes = Figure(figsize=(5.0, 4.0)).add_subplot()
    frequency_hz = np.geomspace(150e3, 30e6, 4001)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(frequency_hz[0], frequency_hz[-1])
    s, rate = 2j * np.pi * frequency_hz, 2 * np.pi * np.array(at_hz)[:, None]
    cells = 35e3 * np.array(size)[:, None] * s * rate / 30 / (s**2 + s * rate / 30 + rate**2)
    mark_resonances(axes, frequency_hz, np.abs(np.sum(cells, axis=0)) + 5)
    return axes
