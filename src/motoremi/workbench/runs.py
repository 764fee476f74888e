"""Measurements in a thread of their own, independent of open pages: a run of a procedure, or an investigation (`investigations`)."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.session import SessionWriter
from motoremi.errors import BadInput, MotoremiError
from motoremi.run.answer import Answer
from motoremi.run.calibration_check import tell_doubts
from motoremi.run.rehearsal import rehearse
from motoremi.run.resume import Done
from motoremi.run.run_progress import RunProgress
from motoremi.run.runner import make_bench, run
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure
from motoremi.workbench.events import Events
from motoremi.workflow_steps import analyse

# Progress is published at most this often.
PUBLISH_EVERY_S = 0.1


class Stopped(KeyboardInterrupt):
    """The operator pressed Stop; a run treats it like Ctrl-C."""


class Run(ABC):
    """Measurements on a bench, and the operator's part in them.

    Parameters
    ----------
    session : str
        Identifier of the session that is written.
    title : str
        What is done, as shown on the page.
    steps : int
        Number of its steps; 0 if that is not known.
    folder : Path
    events : Events
    """

    # The message at its end, and the view that shows the result.
    complete, shown_by = "the run is complete", "story"

    def __init__(self, session: str, title: str, steps: int, folder: Path, events: Events) -> None:
        self.session = session
        self.folder = folder
        self._title = title
        self._steps = steps
        self._events = events
        self._documents: list[JsonDict] = []
        self._status = "running"
        self._message = ""
        self._prompt = ""
        # While a value is asked for: an example of it.
        self._example = ""
        self._progress: JsonDict = {}
        self._began_s = time.monotonic()
        self._published_s = 0.0
        self._stop = threading.Event()
        self._begun = threading.Event()
        self._answered = threading.Event()
        self._answer: Answer = "done"
        self._thread = threading.Thread(target=self._work, name=f"run {folder.name}")

    @abstractmethod
    def _measure(self) -> None:
        """Measure; `_begun` is set as soon as the session exists."""

    @property
    def active(self) -> bool:
        """Whether instruments may still be in use."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Start the thread; returns as soon as the session exists."""
        self._thread.start()
        self._begun.wait()

    def stop(self) -> None:
        """Stop at the next exchange; the instruments are brought into their safe state and the data are kept."""
        self._stop.set()
        self._answered.set()

    def give(self, text: str) -> None:
        """Pass on the value that the operator was asked for.

        Raises
        ------
        BadInput
            If none was asked for, or it cannot be read.
        """
        raise BadInput("no value is asked for")

    def answer(self, answer: Answer) -> None:
        """Pass on the operator's answer to the prompt."""
        if answer == "stop":
            self.stop()
            return
        self._answer = answer
        self._answered.set()

    def wait(self) -> None:
        """Wait until the instruments are in their safe state and the session is closed."""
        self._thread.join()

    def state(self) -> JsonDict:
        """The run so far, for a page that opens during it."""
        return {**self._now(), "documents": list(self._documents)}

    def document(self, seq: int) -> JsonDict:
        """A document of this run by its number."""
        for document in list(self._documents):
            if document["seq"] == seq:
                return document
        raise BadInput(f"this run has no document {seq}")

    def _now(self) -> JsonDict:
        return {
            "session": self.session,
            "name": self.folder.name,
            "title": self._title,
            "steps": self._steps,
            "status": self._status,
            "message": self._message,
            # As lines: it contains a drawing, and line breaks within a text would be escaped.
            "prompt": self._prompt.splitlines(),
            "example": self._example,
            "shown_by": self.shown_by,
            "progress": self._progress,
        }

    def _publish(self) -> None:
        self._events.publish("run", self._now())

    def _work(self) -> None:
        try:
            self._measure()
            self._status, self._message = "done", self.complete
        except KeyboardInterrupt:
            self._status, self._message = "stopped", "stopped by the operator; the instruments are safe and what was measured is kept"
        except MotoremiError as error:
            self._status, self._message = "failed", str(error)
        except Exception as error:
            # Every failure must appear on the pages, so no exception may leave the thread.
            self._status, self._message = "failed", f"internal error ({type(error).__name__}: {error}); report it"
        finally:
            self._begun.set()
        self._publish()

    def _document(self, document: JsonDict) -> None:
        self._documents.append(document)
        self._events.publish("document", {"session": self.session, "document": document})

    def _report(self, doing: str, share: float, remaining_s: float | None) -> None:
        elapsed = time.monotonic() - self._began_s
        self._progress = {"doing": doing, "share": share, "elapsed_s": elapsed, "remaining_s": remaining_s}
        if time.monotonic() - self._published_s > PUBLISH_EVERY_S:
            self._published_s = time.monotonic()
            self._publish()

    def _tick(self) -> None:
        if self._stop.is_set():
            raise Stopped

    def _ask_operator(self, text: str, example: str = "") -> Answer:
        """Show an instruction, or with an example ask for a value, and wait for the answer."""
        self._tick()
        self._answered.clear()
        self._prompt, self._example = text, example
        self._publish()
        # Stop may have been pressed just before the clear above.
        while not self._stop.is_set() and not self._answered.wait(1.0):
            pass
        self._prompt = self._example = ""
        self._publish()
        # Returned rather than raised: the run records the answer before it stops.
        return "stop" if self._stop.is_set() else self._answer


class ProcedureRun(Run):
    """One run of a procedure.

    Parameters
    ----------
    session, folder, events
        As for `Run`.
    procedure, bench_file
        The procedure and the bench.
    begin : callable
        Opens the session for writing.
    ask : bool
        Whether to ask the operator before each connection and wait for the answer.
    done : Done, optional
        The steps that an earlier run of this session finished.
    """

    def __init__(
        self,
        session: str,
        procedure: Procedure,
        bench_file: BenchFile,
        begin: Callable[[], SessionWriter],
        folder: Path,
        events: Events,
        ask: bool,
        done: Done | None = None,
    ) -> None:
        super().__init__(session, procedure.title, len(procedure.plan), folder, events)
        self._procedure = procedure
        self._bench_file = bench_file
        self._begin = begin
        self._ask = ask
        self._done = done
        self._share = 0.0

    def _measure(self) -> None:
        bench = make_bench(self._bench_file)
        try:
            with self._begin() as writer:
                writer.subscribe(self._document)
                self._begun.set()
                tell_doubts(self._procedure, self._bench_file, writer)
                ticks = [self._tick]
                try:
                    rehearsed = rehearse(self._procedure, self._bench_file)
                except BadInput:
                    # A third-party driver has no simulated instrument: run without an estimate of the remaining time.
                    pass
                else:
                    progress = RunProgress(rehearsed, bench.clock, self._show)
                    writer.subscribe(progress.document)
                    ticks.append(progress.tick)

                def tick() -> None:
                    for one in ticks:
                        one()

                run(self._procedure, bench, writer, analyse=self._analyse, prompt=self._prompted, tick=tick, done=self._done)
        finally:
            bench.close()

    def _analyse(self, kind: str, store: Any, parameters: JsonDict) -> JsonDict | None:
        self._tick()
        return analyse(self._diagnosing)(kind, store, parameters)

    def _diagnosing(self, name: str, done: int, total: int) -> None:
        # The progress bar is that of the measurement and must not start over.
        self._tick()
        self._report(f"diagnosing: {name}", self._share, None)

    def _show(self, doing: str, done: int, total: int) -> None:
        self._share = max(self._share, done / total if total else 0.0)
        left: float | None = total - done
        if self._bench_file.backend == "sim":
            # A simulated bench has a clock of its own: estimate from the time that has really passed.
            left = (time.monotonic() - self._began_s) * (1 - self._share) / self._share if self._share else None
        self._report(doing, self._share, left)

    def _prompted(self, text: str) -> Answer | None:
        self._tick()
        return self._ask_operator(text) if self._ask else None
