"""The plots of a session by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from motoremi.arrays import JsonDict
from motoremi.data.session import Session, load
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.inspection.compare import compare
from motoremi.inspection.effect_signature import signature
from motoremi.inspection.element import inspect
from motoremi.report import plots
from motoremi.report.emission_section import emission_fit_figure, prediction_figure
from motoremi.report.renderings import reported_as_unreadable
from motoremi.workflow import diagnosis_in, ladder_of, measurement_of, opened, stored_tolerance
from motoremi.workflow_emission import DIAGNOSIS, PREDICTION, emission_steps

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_of(path: Path, what: str, element: str | None = None, effect: str | None = None) -> Figure:
    """One plot of a session.

    Parameters
    ----------
    path : Path
        The session's folder.
    what : str
        A name of `motoremi.report.kinds.PLOTS`.
    element, effect : str, optional
        For `inspection` and `signature`.

    Raises
    ------
    BadInput
        For an unknown name, or if the session lacks the analysis that is drawn.
    """
    session = load(path)
    draw: dict[str, Callable[[], Figure]] = {
        "sweeps": lambda: plots.measured_figure(measurement_of(session)),
        "fit": lambda: plots.fit_figure(_ladder(session)[-1]),
        "steps": lambda: plots.sweeps_figure(_ladder(session)[0], _ladder(session)[-1]),
        "error": lambda: plots.comparison_figure(compare(_ladder(session)[-1], stored_tolerance(session))),
        "training": lambda: plots.training_figure(_ladder(session)[0]),
        "ladder": lambda: plots.ladder_figure(_ladder(session)),
        "ranking": lambda: plots.ranking_figure(diagnosis_in(session)),
        "inspection": lambda: inspect(_ladder(session)[-1], _given(element, what, "--element NAME")).plot(),
        "signature": lambda: signature(_ladder(session)[-1], _given(effect, what, "--effect ID")).plot(),
        "spectrum": lambda: plots.spectrum_figure(_with_spectra(session).corrected_spectra),
        "prediction": lambda: prediction_figure(_stored(session, PREDICTION, "motoremi predict")),
        "emission": lambda: _emission(path),
        "emission-ranking": lambda: plots.ranking_figure(_stored(session, DIAGNOSIS, "motoremi diagnose --emission")),
    }
    if what not in draw:
        raise BadInput(f"there is no plot {what!r}; there are {', '.join(draw)}")
    with reported_as_unreadable(session.path.name):
        return draw[what]()


def _ladder(session: Session) -> list[Fit]:
    steps = ladder_of(session)
    if not steps:
        raise BadInput(f"{session.path.name} has no fit yet: motoremi fit {session.path}")
    return steps


def _given(value: str | None, what: str, option: str) -> str:
    if value is None:
        raise BadInput(f"the plot {what} needs {option}")
    return value


def _with_spectra(session: Session) -> Session:
    if not session.spectra:
        raise BadInput(f"{session.path.name} holds no spectrum")
    return session


def _stored(session: Session, name: str, made_by: str) -> JsonDict:
    found = _with_spectra(session).analysis(name)
    if found is None:
        raise BadInput(f"{session.path.name} has no {name} yet: {made_by} {session.path}")
    return found


def _emission(path: Path) -> Figure:
    with opened(path) as store:
        return emission_fit_figure(emission_steps(store)[-1])
