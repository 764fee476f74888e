"""The session folder: measured data, the traffic with the instruments, and the analyses.

`SessionWriter` writes one, `load` reads it, `verify` checks it, `reopen` adds to it.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from motoremi.arrays import JsonDict
from motoremi.data.chain import Chain, read_chain
from motoremi.data.conditions import Condition, SingleValue
from motoremi.data.corrections import Corrections
from motoremi.data.files import parse_impedance_csv, parse_spectrum_csv
from motoremi.data.manifest import parse_manifest, record_bytes
from motoremi.data.origin import is_simulated
from motoremi.data.paths import MANIFEST, SESSION, TRAFFIC, inside
from motoremi.data.plain import object_from_json
from motoremi.data.recording import SCHEMA, STATUSES, SessionWriter, reopen
from motoremi.data.spectrum import Spectrum
from motoremi.data.state import marks_of, states_of
from motoremi.data.storage import StorageError
from motoremi.data.sweep import ImpedanceSweep
from motoremi.data.text_file import decode, read_bytes, show_name
from motoremi.data.verify import verify, vouched_sha256
from motoremi.data.withdrawn import OF_THE_MOTOR, concerned, names_of, withdrawals
from motoremi.drawing import figure_of
from motoremi.errors import BadInput
from motoremi.given import refuse_other

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Session", "SessionWriter", "StorageError", "is_up_to_date", "load", "refuse_unfinished", "reopen", "verify"]
# Number of parsed files that are cached, because the workbench loads a session again after every change.
KEPT = 32


@dataclass(frozen=True, eq=False, repr=False)
class Session:
    """The content of a session at the time it was loaded.

    Parameters
    ----------
    path : Path
    documents : tuple of dict
        The documents of `session.jsonl`, in order.
    start : dict
        The first document.
    sweeps : tuple of ImpedanceSweep
        Sweeps without a condition. Sweeps, spectra and values that were withdrawn are left out.
    spectra : tuple of Spectrum
    finals : tuple of Spectrum
        Short scans around the maxima of a prescan.
    interrupted : bool
        True if the session, or the last addition to it, was not closed.
    status : str
        How the measurement ended: "done", "failed" or "interrupted".
    conditioned : tuple of ImpedanceSweep
        Sweeps under a condition.
    values : tuple of SingleValue
        Values from other meters.
    """

    path: Path
    documents: tuple[JsonDict, ...]
    start: JsonDict
    sweeps: tuple[ImpedanceSweep, ...]
    spectra: tuple[Spectrum, ...]
    finals: tuple[Spectrum, ...]
    interrupted: bool
    status: str
    analysis_files: Mapping[str, bytes]
    conditioned: tuple[ImpedanceSweep, ...] = ()
    values: tuple[SingleValue, ...] = ()

    def __repr__(self) -> str:
        return f"Session({str(self.path)!r}, {self.summary()})"

    def _repr_html_(self) -> str:
        return f"<b>session</b>: {self.summary()}"

    def summary(self) -> str:
        """One line for a person."""
        ending = f"{self.status}, not closed" if self.interrupted and self.status != "interrupted" else self.status
        states = states_of(self.used_documents)
        marked = sum(bool(marks_of(state)) for _, state in states)
        motor = f", motor's state with {len(states)}" + (f" of which {marked} MARKED" if marked else "") if states else ""
        finals = f", {len(self.finals)} final scans" if self.finals else ""
        count = len({sweep.condition for sweep in self.conditioned})
        beside = f", {len(self.conditioned)} sweeps under {count} conditions" if count else ""
        beside += f", {len(self.values)} single values" if self.values else ""
        beside += f", {', '.join(str(one['name']) for one in self.withdrawn)} withdrawn" if self.withdrawn else ""
        return f"{len(self.sweeps)} sweeps{beside}, {len(self.spectra)} spectra{finals}{motor}, {len(self.analysis_files)} analyses, {ending}"

    @cached_property
    def used_documents(self) -> tuple[JsonDict, ...]:
        """The documents without those that were withdrawn."""
        gone = withdrawals(self.documents)
        return tuple(document for document in self.documents if document["seq"] not in gone)

    @cached_property
    def withdrawn(self) -> tuple[JsonDict, ...]:
        """Each measurement that was withdrawn: name, reason and time."""
        gone, names = withdrawals(self.documents), names_of(self.documents)
        return tuple(
            {"name": names[document["seq"]], "why": gone[document["seq"]].get("why", ""), "time": gone[document["seq"]]["time"]}
            for document in self.documents
            if document["seq"] in gone and document["seq"] in names
        )

    @cached_property
    def corrections(self) -> Corrections:
        """Corrections for the parts between motor and instruments: those set last, or those with which the session was made."""
        stored = self.analysis("corrections") or self.start
        return Corrections.of(stored.get("corrections") or (), self.path.name)

    @cached_property
    def corrected_sweeps(self) -> tuple[ImpedanceSweep, ...]:
        """The sweeps corrected for the analyser's fixtures; `sweeps` holds the readings."""
        return tuple(self.corrections.corrected_sweep(sweep) for sweep in self.sweeps)

    @cached_property
    def corrected_conditioned(self) -> tuple[ImpedanceSweep, ...]:
        """As `corrected_sweeps`, for the sweeps under a condition."""
        return tuple(self.corrections.corrected_sweep(sweep) for sweep in self.conditioned)

    @cached_property
    def corrected_spectra(self) -> tuple[Spectrum, ...]:
        """The spectra with corrected levels; `spectra` holds the readings."""
        return tuple(self.corrections.corrected_spectrum(spectrum) for spectrum in self.spectra)

    @property
    def corrected_finals(self) -> tuple[Spectrum, ...]:
        """The short scans of a final measurement with corrected levels; `finals` holds the readings."""
        return tuple(self.corrections.corrected_spectrum(spectrum) for spectrum in self.finals)

    @property
    def simulated(self) -> bool:
        """Whether any data come from a simulated bench, measured in this session or imported from files."""
        headers = [self.start, *(sweep.metadata for sweep in (*self.sweeps, *self.conditioned))]
        headers += [one.metadata for one in (*self.spectra, *self.finals)]
        return self.start.get("backend") == "sim" or any(map(is_simulated, headers))

    @property
    def analyses(self) -> tuple[str, ...]:
        """Names of the stored analyses."""
        return tuple(sorted(self.analysis_files))

    def analysis(self, name: str) -> JsonDict | None:
        """Content of `analysis/<name>.json`, or None if there was no such file."""
        data = self.analysis_files.get(name)
        return None if data is None else object_from_json(data)

    @property
    def ladder(self) -> list[JsonDict]:
        """The steps of the ladder, oldest first; empty before the first fit."""
        steps = (self.analysis("ladder") or {}).get("steps", [])
        return list(steps)

    @property
    def held(self) -> dict[str, float]:
        """The values that the user held in the last fit, in SI units by the name of the parameter."""
        stored = self.analysis("ladder") or {}
        # Older sessions hold only those of the fits; in the first one these are the user's.
        held = stored.get("held", self.ladder[0].get("fit", {}).get("held", {}) if self.ladder else {})
        return {str(name): float(value) for name, value in held.items()}

    def emptied_ladder(self) -> JsonDict:
        """The analysis `ladder` without its models; the values that the user holds apply to the next fit."""
        return {"schema": "motoremi.ladder/1", "held": self.held, "steps": []}

    def traffic(self) -> tuple[JsonDict, ...]:
        """Every message to and from the instruments; an unfinished last line is left out.

        Raises
        ------
        BadInput
            If a line is damaged.
        """
        path = inside(self.path, TRAFFIC)
        if not path.exists() or path.stat().st_size == 0:
            return ()
        records = []
        for number, line in enumerate(read_bytes(path).split(b"\n")[:-1], start=1):
            try:
                records.append(object_from_json(line))
            except ValueError as error:
                raise BadInput(f"{show_name(path)}, line {number}: is damaged; run motoremi verify") from error
        return tuple(records)

    def plot(self) -> Figure:
        """The measured sweeps; the spectra of a session without sweeps.

        Raises
        ------
        BadInput
            If the session holds neither.
        """
        return figure_of(self)

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "path": str(self.path),
            "status": self.status,
            "interrupted": self.interrupted,
            "documents": list(self.documents),
            "sweeps": [sweep.to_dict() for sweep in self.sweeps],
            "conditioned": [sweep.to_dict() for sweep in self.conditioned],
            "values": [value.to_dict() for value in self.values],
            "withdrawn": list(self.withdrawn),
            "spectra": [spectrum.to_dict() for spectrum in self.spectra],
            "finals": [spectrum.to_dict() for spectrum in self.finals],
            "corrections": self.corrections.to_list(),
            "analyses": {name: self.analysis(name) for name in self.analyses},
        }


def load(path: str | os.PathLike[str]) -> Session:
    """Read a session folder; an interrupted session is loaded as far as it was stored.

    Parameters
    ----------
    path : path-like
        The folder.

    Raises
    ------
    BadInput
        If it is not a session, or a file was changed after it was stored.
    """
    refuse_other(path, (str, os.PathLike), "load needs the path of a session folder")
    folder = Path(path)
    name = show_name(folder)
    if not os.path.isdir(folder):
        raise BadInput(f"{name}: no such session folder")
    if not os.path.lexists(folder / SESSION):
        raise BadInput(f"{name}: no session here ({SESSION} is missing)")
    while True:
        data = read_bytes(inside(folder, SESSION))
        try:
            return _loaded(folder, name, data)
        except BadInput:
            # If another program has added to the session meanwhile, its files are newer than `data`.
            if read_bytes(inside(folder, SESSION)) == data:
                raise


def _loaded(folder: Path, name: str, data: bytes) -> Session:
    """The session whose documents are `data`."""
    chain = read_chain(data)
    if chain.problems:
        raise BadInput(f"{name}: {SESSION}, {chain.problems[0]}; run motoremi verify")
    if not chain.documents or chain.documents[0].get("schema") != SCHEMA:
        raise BadInput(f"{name}: no session here ({SESSION} has no start document)")
    closed = _is_closed(folder, name, data, chain)
    vouched = vouched_sha256(chain)
    gone = withdrawals(chain.documents)
    sweeps: list[ImpedanceSweep] = []
    conditioned: list[ImpedanceSweep] = []
    spectra: dict[str, list[Spectrum]] = {"spectrum": [], "final": []}
    analyses: dict[str, bytes] = {}
    for document in chain.documents:
        if document["kind"] in ("sweep", "spectrum", "final", "analysis"):
            # Read also if it was withdrawn: a measured file that was changed is never ignored.
            stored = _stored(folder, document, vouched)
            file = str(document["file"])
            if document["seq"] in gone:
                continue
            if document["kind"] == "sweep":
                sweep = _sweep_of(stored, file, f"{name}/{file}", str(document.get("termination"))).with_metadata()
                # The condition is taken from the document, not from the header: in older sessions a line `# condition:` is the user's remark.
                if "condition" in document:
                    conditioned.append(_under(sweep, document["condition"]))
                else:
                    sweeps.append(sweep)
            elif document["kind"] in spectra:
                spectra[document["kind"]].append(_spectrum_of(stored, file, f"{name}/{file}").with_metadata())
            else:
                _check_json(stored, f"{name}/{file}")
                analyses[str(document.get("name"))] = stored
    status = run_status(chain.documents)
    return Session(
        path=folder,
        documents=chain.documents,
        start=chain.documents[0],
        sweeps=tuple(sweeps),
        spectra=tuple(spectra["spectrum"]),
        finals=tuple(spectra["final"]),
        interrupted=not closed,
        status=status,
        analysis_files=analyses,
        conditioned=tuple(conditioned),
        values=tuple(SingleValue.restored(document) for document in chain.documents if document["kind"] == "value" and document["seq"] not in gone),
    )


@lru_cache(maxsize=KEPT)
def _sweep_of(data: bytes, file: str, label: str, termination: str) -> ImpedanceSweep:
    """The sweep in a file; cached, so that the same bytes are parsed once."""
    return parse_impedance_csv(decode(data, file), label, termination)


@lru_cache(maxsize=KEPT)
def _spectrum_of(data: bytes, file: str, label: str) -> Spectrum:
    return parse_spectrum_csv(decode(data, file), label)


def _under(sweep: ImpedanceSweep, written: object) -> ImpedanceSweep:
    metadata = {key: value for key, value in sweep.metadata.items() if key != "condition"}
    return replace(sweep, metadata=metadata, condition=Condition.restored(written))


def _is_closed(folder: Path, name: str, data: bytes, chain: Chain) -> bool:
    path = inside(folder, MANIFEST)
    if not os.path.lexists(path):
        return False
    try:
        manifest = parse_manifest(read_bytes(path))
    except BadInput as error:
        raise BadInput(f"{name}: {error}; run motoremi verify") from error
    expected = manifest.files.get(SESSION)
    # Later documents are an addition that was not closed; those that the manifest counts must be unchanged.
    if expected is None or record_bytes(data[: expected.bytes]) != expected:
        raise BadInput(f"{name}: {SESSION} was changed after the session was closed; run motoremi verify")
    return len(chain.documents) == manifest.documents and not chain.torn


def _stored(folder: Path, document: JsonDict, vouched: Mapping[str, set[str]]) -> bytes:
    path = inside(folder, document.get("file"))
    data = read_bytes(path)
    if record_bytes(data).sha256 not in vouched.get(str(document["file"]), ()):
        raise BadInput(f"{show_name(path)}: was changed after it was stored; run motoremi verify")
    return data


def _check_json(data: bytes, name: str) -> None:
    try:
        object_from_json(data)
    except ValueError as error:
        raise BadInput(f"{name}: is not a JSON object ({error})") from error


def run_status(documents: Sequence[JsonDict]) -> str:
    """How the measurement itself ended: an interrupted run becomes complete only by resuming it, not by later additions."""
    status, is_addition = "interrupted", False
    for document in documents:
        if document["kind"] == "stop" and document.get("status") in STATUSES:
            # A run whose report failed has two stop documents: one of the measurement and one of the report.
            status = status if is_addition else str(document["status"])
        elif document["kind"] == "resume":
            status, is_addition = "interrupted", False
        elif document["kind"] == "reopen":
            is_addition = True
    return status


def refuse_unfinished(session: Session) -> None:
    """Refuse a session whose measurement did not come to its end.

    Raises
    ------
    BadInput
        With the command that finishes it.
    """
    if session.status != "done":
        again = f"motoremi run --resume {shlex.quote(str(session.path))}"
        raise BadInput(f"{session.path.name}: its measurement was interrupted; finish it first: {again}")


def is_up_to_date(session: Session) -> bool:
    """Whether the stored diagnosis includes every sweep and value, and none that was withdrawn."""
    of_the_motor = {document["seq"] for document in session.documents if document["kind"] in OF_THE_MOTOR}
    for document in reversed(session.documents):
        if document["seq"] in of_the_motor or not of_the_motor.isdisjoint(concerned(document)):
            return False
        if document["kind"] == "analysis" and document.get("name") == "diagnosis":
            return True
    return False
