"""Replays the requested measurements of a recorded investigation: each is requested again, and the recorded traffic answers."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress
from datetime import datetime

from motoremi.arrays import JsonDict
from motoremi.bench.replay import ReplayBench
from motoremi.bench.replay_difference import RecordedEnd, ReplayDifference
from motoremi.data.conditions import SingleValue
from motoremi.data.recording import SessionWriter
from motoremi.errors import InstrumentError
from motoremi.run.answer import ANSWERS, Answer, NotDone, Prompt
from motoremi.run.requested import MeasurementRequest, RequestedMeasurements
from motoremi.schema.procedure import parse_procedure

BEGINS = "investigate"


def before_investigations(documents: Sequence[JsonDict]) -> tuple[JsonDict, ...]:
    """The documents of the measurement itself."""
    return tuple(itertools.takewhile(lambda document: document["kind"] != BEGINS, documents))


def rerun_requested(documents: Sequence[JsonDict], bench: ReplayBench, writer: SessionWriter, name: str) -> None:
    """Request everything again that the investigations of a session requested.

    Parameters
    ----------
    documents : sequence of dict
        All documents of the recorded session.
    bench : ReplayBench
    writer : SessionWriter
        The new session; the caller closes it.
    name : str
        Name of the recorded session, for messages.
    """
    for begin, own, until in _investigations(documents):
        bench.begin_run(until)
        writer.emit(BEGINS, **{key: begin[key] for key in ("procedure", "connections", "budget_minutes", "odds", "without")})
        requests = RequestedMeasurements(
            parse_procedure(begin["procedure"], name), bench, writer, _answering(own), connections=int(begin["connections"])
        )
        try:
            _request_all(own, requests, writer)
        except RecordedEnd:
            # The recorded run was stopped here; the next investigation of the session went on.
            pass
        except InstrumentError as error:
            # A failure that occurred in the recorded run as well is a correct replay.
            if isinstance(error, ReplayDifference) or not any(str(error) in str(document.get("reason", "")) for document in own):
                raise
        with suppress(RecordedEnd):
            requests.leave_safe()


def _request_all(documents: Sequence[JsonDict], requests: RequestedMeasurements, writer: SessionWriter) -> None:
    for place, document in enumerate(documents):
        if document["kind"] != "asked":
            continue
        request = MeasurementRequest.restored(document["order"])
        writer.emit("asked", **{key: document[key] for key in ("id", "minutes", "why", "order", "probabilities") if key in document})
        if not request.is_value:
            try:
                requests.measure(request)
            except NotDone:
                writer.emit("refused", id=request.id)
        for later in itertools.takewhile(lambda one: one["kind"] != "asked", documents[place + 1 :]):
            if later["kind"] == "value":
                writer.add_value(SingleValue.restored(later))


def _investigations(documents: Sequence[JsonDict]) -> Iterator[tuple[JsonDict, Sequence[JsonDict], datetime | None]]:
    """First document, further documents and end time of each investigation; the time is when the next one began."""
    places = [place for place, document in enumerate(documents) if document["kind"] == BEGINS]
    for first, end in itertools.pairwise([*places, len(documents)]):
        until = datetime.fromisoformat(documents[end]["time"]) if end < len(documents) else None
        yield documents[first], documents[first + 1 : end], until


def _answering(documents: Sequence[JsonDict]) -> Prompt:
    recorded = iter([document["answer"] for document in documents if document["kind"] == "prompt" and document["answer"] in ANSWERS])

    def prompt(text: str) -> Answer | None:
        answer: Answer | None = next(recorded, None)
        if answer == "stop":
            raise RecordedEnd("the operator stopped the recorded investigation here")
        return answer

    return prompt
