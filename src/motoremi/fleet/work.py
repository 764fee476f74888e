"""The work on one session. It runs in a worker, independently of the other sessions, and does not raise for a bad session."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from pathlib import Path

from motoremi import __version__
from motoremi.arrays import JsonDict
from motoremi.data.paths import SESSION
from motoremi.data.plain import plain
from motoremi.data.session import load
from motoremi.data.storage import write_whole
from motoremi.data.text import clean_text
from motoremi.diagnosis.diagnosis import diagnose
from motoremi.errors import MotoremiError
from motoremi.fitting.fit import fit
from motoremi.fitting.result import Fit
from motoremi.inspection.compare import compare
from motoremi.model.effects import catalogue_sha256
from motoremi.model.motor import dc_motor
from motoremi.report.html import render_html
from motoremi.report.identity import measured_times
from motoremi.report.model import Materials, build_report
from motoremi.workflow import measurement_of

# Form of a result; a stored result of another form is computed again.
FORM = 2


@dataclass(frozen=True)
class Job:
    """One session and its settings.

    Parameters
    ----------
    session : str
        Path below the fleet's folder, with `/`.
    folder : str
        The fleet's folder, as a path for the workers.
    diagnose : bool
        Whether to diagnose, or only to fit.
    seed : int
        The same for all sessions, so that a session has the same result as alone.
    reports : str
        Folder for each session's own report, as a path for the workers; empty for none.
    """

    session: str
    folder: str
    diagnose: bool
    seed: int
    reports: str = ""

    def key(self) -> str:
        """Digest of measured data, settings and version: a result with the same key need not be computed again."""
        digest = hashlib.sha256(f"{__version__} {FORM} {catalogue_sha256()} {self.diagnose} {self.seed} {bool(self.reports)}".encode())
        digest.update(_measured(Path(self.folder) / self.session / SESSION))
        return digest.hexdigest()


# Kinds of the documents that change what is analysed, as a line of a session's log contains them.
_OF_DATA = tuple(f'"kind":"{kind}"'.encode() for kind in ("sweep", "spectrum", "value", "withdrawn", "restored"))


def _measured(log: Path) -> bytes:
    """Digest of the recorded sweeps, values and spectra, and of what was withdrawn; analyses that are added later do not change it."""
    digest = hashlib.sha256()
    try:
        with open(log, "rb") as file:
            for line in file:
                if any(kind in line for kind in _OF_DATA):
                    digest.update(line)
    except OSError as error:
        digest.update(str(error.errno).encode())
    return digest.digest()


def work(job: Job) -> JsonDict:
    """Fit and diagnose one session.

    Returns
    -------
    dict
        Plain data without computing times, so that it is the same on every machine; `status` is `done` or `bad`.
    """
    result: JsonDict = {"session": job.session, "key": job.key()}
    try:
        session = load(Path(job.folder) / job.session)
        measurement = measurement_of(session)
        # The axes over which drift is plotted; not a part of the key.
        result |= {
            "time": min(measured_times(session), default=""),
            "serial": serial_of(session.start, job.session),
            "analyser": measurement.analyser.name,
            "span_hz": [
                min(float(one.frequency_hz[0]) for one in measurement.sweeps),
                max(float(one.frequency_hz[-1]) for one in measurement.sweeps),
            ],
        }
        base = fit(dc_motor(), measurement, seed=job.seed)
        result |= {"status": "done", "base": _figures(base)}
        best, found = base, None
        steps: tuple[Fit, ...] = (base,)
        if job.diagnose:
            found = diagnose(base)
            if found.effects:
                best, steps = found.best, found.steps
            result["diagnosis"] = {
                "verdict": found.verdict,
                "effects": list(found.effects),
                "families": [list(family) for family in found.families],
                "confidence": found.confidence,
                "findings": [finding.to_dict() for finding in found.findings],
            }
        result["best"] = _figures(best)
        if job.reports:
            _write_report(job, Materials(session, steps, compare(best), None if found is None else found.to_dict()))
    except MotoremiError as error:
        result |= {"status": "bad", "trouble": clean_text(str(error), 500)}
    except Exception as error:  # a programming error on one session must not stop the others; the report shows it
        result |= {"status": "bad", "trouble": clean_text(f"internal error ({type(error).__name__}: {error})", 500)}
    # Converted to JSON and back, so that a result just computed is the same as one read from the file.
    return dict(json.loads(json.dumps(plain(result), allow_nan=False)))


def _write_report(job: Job, materials: Materials) -> None:
    """Write the session's own report; the session itself is not changed."""
    page = render_html(build_report(materials))
    write_whole(Path(job.reports) / f"{job.session}.html", page.encode())


def _figures(fitted: Fit) -> JsonDict:
    units = {parameter.name: parameter.unit for parameter in fitted.motor.parameters}
    return {
        "effects": list(fitted.effects),
        "converged": fitted.converged,
        "chi2_reduced": fitted.chi2_reduced,
        "rms_error_percent": fitted.rms_error_percent,
        "floor_percent": fitted.floor_percent,
        "noise_percent": fitted.noise_percent,
        "unexplained_percent": fitted.unexplained_percent,
        "parameters": {
            name: {"value": value, "sigma": fitted.sigma[name], "unit": units[name]}
            for name, value in fitted.parameters.items()
            if fitted.determined(name)
        },
        "undetermined": fitted.undetermined(),
    }


def serial_of(start: JsonDict, session: str) -> str:
    """The motor's serial number: from the session's start document, or a number at the end of the motor's or the folder's name."""
    for key in ("serial", "serial_number"):
        if start.get(key):
            return clean_text(str(start[key]), 80)
    for text in (str(start.get("motor") or ""), session):
        if number := re.search(r"\d+$", text):
            return number.group()
    return ""
