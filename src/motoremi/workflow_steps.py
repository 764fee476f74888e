"""The steps of a procedure that analyse, for the runner."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motoremi.arrays import JsonDict, Progress
from motoremi.data.session import load
from motoremi.errors import BadInput
from motoremi.inspection.compare import Tolerance
from motoremi.workflow import compare_session, diagnose_session, diagnosis_in, fit_session, report_session
from motoremi.workflow_emission import choose_finals, judged


def analyse(progress: Progress | None = None) -> Callable[[str, Any, JsonDict], JsonDict | None]:
    """The steps of a procedure that analyse, for the runner."""

    def step(kind: str, store: Any, parameters: JsonDict) -> JsonDict | None:
        if kind == "fit":
            fit_session(store, **parameters)
            return None
        if kind == "compare":
            return {"verdict": compare_session(store, Tolerance(**parameters)).verdict}
        if kind == "diagnose":
            found = diagnose_session(store, progress=progress)
            serious = dict.fromkeys(finding.id for finding in found.findings if finding.serious)
            return {"verdict": found.verdict, "effects": list(found.effects), "confidence": found.confidence, "serious_findings": list(serious)}
        if kind == "next":
            following: JsonDict = diagnosis_in(load(store.path))["next_measurement"]
            store.save_analysis("next", following)
            return {"next_measurement": following}
        if kind == "maxima":
            return choose_finals(store, **parameters)
        if kind == "judge":
            return judged(store, **parameters)
        if kind == "report":
            report_session(store)
            return None
        raise BadInput(f"unknown step {kind!r}")

    return step
