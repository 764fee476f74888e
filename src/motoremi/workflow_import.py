"""A session from files: what `motoremi import` and the workbench do with what their readers gave them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from motoremi.arrays import JsonDict
from motoremi.data.analyser import find_analyser
from motoremi.data.corrections import NO_CORRECTIONS, Corrections
from motoremi.data.measurement import Measurement
from motoremi.data.session import SessionWriter
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep, checked_accuracy
from motoremi.data.text import clean_text
from motoremi.emission.limit import find_limit
from motoremi.emission.observe import observations
from motoremi.errors import BadInput
from motoremi.quantities import parse_band
from motoremi.workflow_emission import judged


@dataclass(frozen=True)
class Told:
    """What a user says of the files.

    Parameters
    ----------
    analyser : str, optional
        Who made the sweeps; None: the size of its errors is estimated.
    band : str
        Part of the sweeps to use, such as `150kHz:30MHz`; empty: all.
    accuracy : str
        Of the sweeps, in percent of |Z|; empty: not stated.
    corrections : Corrections
        What stood between motor and instruments.
    limit : str
        Judge the spectra against it; empty: do not.
    motor, serial, operator, ambient : str
        For the report.
    """

    analyser: str | None = None
    band: str = ""
    accuracy: str = ""
    corrections: Corrections = NO_CORRECTIONS
    limit: str = ""
    motor: str = ""
    serial: str = ""
    operator: str = ""
    ambient: str = ""


@dataclass(frozen=True, eq=False)
class Import:
    """Sweeps and spectra that are ready to become a session.

    Parameters
    ----------
    sweeps : tuple of ImpedanceSweep
    spectra : tuple of Spectrum
        As read.
    corrected : tuple of Spectrum
        Levels at the motor's side.
    start : dict
        The session's first document.
    caveats : tuple of str
        What a reader has to know.
    observations : tuple of dict
        What the spectra show by themselves.
    limit : str
    """

    sweeps: tuple[ImpedanceSweep, ...]
    spectra: tuple[Spectrum, ...]
    corrected: tuple[Spectrum, ...]
    start: JsonDict
    caveats: tuple[str, ...]
    observations: tuple[JsonDict, ...]
    limit: str

    def store(self, folder: Path) -> JsonDict | None:
        """Make the session; returns the verdict if the spectra are judged against a limit."""
        with SessionWriter.create(folder, self.start) as writer:
            for sweep in self.sweeps:
                writer.add_sweep(sweep)
            for spectrum in self.spectra:
                writer.add_spectrum(spectrum)
            verdict = judged(writer, self.limit) if self.limit else None
            writer.close("done")
        return verdict


def prepared(sweeps: Sequence[ImpedanceSweep], spectra: Sequence[Spectrum], told: Told, names: Sequence[str]) -> Import:
    """Everything that a session needs, checked before a folder is made: nothing is left half written.

    Parameters
    ----------
    sweeps, spectra
        As their readers gave them.
    told : Told
    names : sequence of str
        Of the files, as the session records them.

    Raises
    ------
    BadInput
        For an option that cannot be used with these files.
    """
    if told.limit:
        find_limit(told.limit)
        if not spectra:
            raise BadInput("a limit is for emission spectra, and none of the files is one (--spectrum FILE...)")
    named = find_analyser(told.analyser).name if told.analyser is not None else None
    own = _as_told(sweeps, told)
    if named is not None:
        own = [sweep.with_metadata(analyser=named) for sweep in own]
    chain = told.corrections
    corrected = [chain.corrected_spectrum(item) for item in spectra]
    measurement = Measurement.of([chain.corrected_sweep(sweep) for sweep in own]) if own else None
    start = {
        "title": f"Imported: {told.motor}" if told.motor else "Imported sweeps",
        "motor": told.motor,
        "serial": told.serial,
        "operator": told.operator,
        "ambient": told.ambient,
        "corrections": chain.to_list(),
        "imported": list(names),
        "analyser": None if measurement is None else measurement.analyser.name,
        "analyser_assumed": measurement is not None and named is None and not any(sweep.metadata.get("analyser") for sweep in own),
    }
    caveats = [] if measurement is None else measurement.caveats()
    caveats += chain.remarks()
    for item in spectra:
        if applied := str(item.metadata.get("transducer", "")).strip(" ;"):
            caveats.append(f"{item.detector}: the receiver has applied its transducer {clean_text(applied, 60)!r}; it must not be in --corrections")
    return Import(tuple(own), tuple(spectra), tuple(corrected), start, tuple(caveats), tuple(observations(corrected)), told.limit)


def _as_told(sweeps: Sequence[ImpedanceSweep], told: Told) -> list[ImpedanceSweep]:
    """The band that is wanted of the sweeps, with the accuracy that the user states."""
    if not sweeps and (told.band or told.accuracy):
        raise BadInput("band and accuracy are for impedance sweeps, and none of the files is one (--short FILE..., --open FILE...)")
    percent = checked_accuracy(told.accuracy) if told.accuracy else None
    span = parse_band(told.band) if told.band else None
    own = list(sweeps) if span is None else [_within(sweep, span) for sweep in sweeps]
    return own if percent is None else [sweep.with_metadata(accuracy_percent=percent) for sweep in own]


def _within(sweep: ImpedanceSweep, span: tuple[float, float]) -> ImpedanceSweep:
    try:
        return sweep.within(*span)
    except BadInput as error:
        raise BadInput(f"{sweep.metadata['source']}: {error}") from error
