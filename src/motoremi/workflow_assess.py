"""The assessment in an investigation: the diagnosis of a session, kept while only sweeps under conditions and single values are added."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from motoremi.arrays import JsonDict, Progress
from motoremi.data.measurement import Measurement
from motoremi.data.session import load
from motoremi.diagnosis.diagnosis import Diagnosis, diagnose
from motoremi.diagnosis.informed import NOT_AS_ASKED, of_the_operator
from motoremi.fitting.fit import fit
from motoremi.investigation.question import next_question
from motoremi.investigation.rivals import Lessons, Rivals
from motoremi.model.motor import dc_motor
from motoremi.workflow import Store, measurement_of
from motoremi.workflow_ask import chosen
from motoremi.workflow_investigate import Assessment


@dataclass
class Assessor:
    """Assesses everything in a session; a `workflow_investigate.Assess`.

    The search for explanations uses only the reference sweeps, and is repeated only when their number changes.

    Parameters
    ----------
    store : Store
        An open session; the last diagnosis is stored in it.
    odds : float
        Odds at which one explanation is accepted.
    progress : callable, optional
    own : sequence of dict
        A laboratory's own measurements (`workflow_ask.own_measurements`).
    """

    store: Store
    odds: float
    progress: Progress | None = None
    own: Sequence[JsonDict] = ()
    _searched: dict[int, tuple[Diagnosis, Lessons]] = field(default_factory=dict)

    def __call__(self) -> Assessment:
        session = load(self.store.path)
        measurement = measurement_of(session)
        count = len(session.sweeps)
        if count not in self._searched:
            self._searched[count] = with_lessons(searched(Measurement.of(session.corrected_sweeps), self.progress))
        found, lessons = self._searched[count]
        rivals = lessons.after(measurement)
        return Assessment(
            rivals.by_label,
            rivals.likeliest.fit.rms_error_percent,
            lambda without: self._question(rivals, measurement, without),
            lambda: self._concluded(found, measurement),
            tuple(finding.to_dict() for finding in (*found.findings, *of_the_operator(rivals)) if finding.serious or finding.id == NOT_AS_ASKED),
        )

    def _question(self, rivals: Rivals, measurement: Measurement, without: Collection[str]) -> JsonDict:
        question = next_question(rivals, measurement, without, self.odds).to_dict()
        return chosen(question, without, self.own) if self.own else question

    def _concluded(self, found: Diagnosis, measurement: Measurement) -> JsonDict:
        document = found.informed_by(measurement).to_dict()
        self.store.save_analysis("diagnosis", document)
        return document


def searched(reference: Measurement, progress: Progress | None = None) -> Diagnosis:
    """The explanations of reference sweeps, from the paper's circuit."""
    return diagnose(fit(dc_motor(), reference), progress)


def with_lessons(found: Diagnosis) -> tuple[Diagnosis, Lessons]:
    """A diagnosis of reference sweeps, prepared for further data."""
    assert found.rivals is not None
    return found, Lessons(found.rivals)
