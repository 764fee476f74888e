"""Sessions from files, for `motoremi import` and the workbench: the data that were read are checked and stored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.data.analyser import find_analyser
from motoremi.data.conditions import Condition, SingleValue
from motoremi.data.corrections import NO_CORRECTIONS, Corrections
from motoremi.data.declaration import COMPENSATED, refuse_impossible
from motoremi.data.import_notes import import_notes
from motoremi.data.measurement import Measurement
from motoremi.data.session import SessionWriter, load, reopen
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep, checked_accuracy
from motoremi.emission.limit import find_limit
from motoremi.emission.observe import observations
from motoremi.errors import BadInput
from motoremi.quantities import parse_band, percent
from motoremi.workflow_emission import judged


@dataclass(frozen=True)
class ImportOptions:
    """Information that the user gives about the files.

    Parameters
    ----------
    analyser : str, optional
        Instrument of the sweeps; None: the size of its errors is estimated.
    band : str
        Part of the sweeps to use, such as `150kHz:30MHz`; empty: all.
    accuracy : str
        Of the sweeps, in percent of |Z|; empty: not stated.
    corrections : Corrections
        Corrections for the parts between motor and instruments.
    limit : str
        Limit against which the spectra are judged; empty for none.
    motor, serial, operator, ambient : str
        For the report.
    compensated : bool
        Whether the analyser was calibrated at the motor's terminals, or its fixture compensated there.
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
    compensated: bool = False


@dataclass(frozen=True, eq=False)
class Import:
    """Sweeps and spectra that are ready to become a session.

    Parameters
    ----------
    sweeps : tuple of ImpedanceSweep
    spectra : tuple of Spectrum
        As read.
    corrected : tuple of Spectrum
        Levels after the corrections.
    start : dict
        The session's first document.
    caveats : tuple of str
        Limitations that a reader has to know.
    observations : tuple of dict
        Observations on the spectra without a model.
    limit : str
    values : tuple of SingleValue
    """

    sweeps: tuple[ImpedanceSweep, ...]
    spectra: tuple[Spectrum, ...]
    corrected: tuple[Spectrum, ...]
    start: JsonDict
    caveats: tuple[str, ...]
    observations: tuple[JsonDict, ...]
    limit: str
    values: tuple[SingleValue, ...] = ()

    def store(self, folder: Path) -> JsonDict | None:
        """Make the session; returns the verdict if the spectra are judged against a limit."""
        with SessionWriter.create(folder, self.start) as writer:
            for sweep in self.sweeps:
                writer.add_sweep(sweep)
            for value in self.values:
                writer.add_value(value)
            for spectrum in self.spectra:
                writer.add_spectrum(spectrum)
            verdict = judged(writer, self.limit) if self.limit else None
            writer.close("done")
        return verdict


@dataclass(frozen=True, eq=False)
class Addition:
    """Sweeps and values that are ready to be added to a session.

    Parameters
    ----------
    sweeps : tuple of ImpedanceSweep
        With the condition under which they were measured; without one, further repeats of the reference sweeps.
    values : tuple of SingleValue
    caveats : tuple of str
        Limitations that a reader has to know.
    """

    sweeps: tuple[ImpedanceSweep, ...]
    values: tuple[SingleValue, ...]
    caveats: tuple[str, ...]

    def store(self, folder: Path) -> None:
        """Add them; the data that the session has already are not changed."""
        with reopen(folder) as writer:
            for sweep in self.sweeps:
                writer.add_sweep(sweep)
            for value in self.values:
                writer.add_value(value)
            if asked := self._asked(folder):
                writer.save_analysis("investigation", asked)
            if any(sweep.condition is None for sweep in self.sweeps) and load(folder).ladder:
                # The models of the ladder were fitted without these sweeps.
                writer.save_analysis("ladder", {"schema": "motoremi.ladder/1", "steps": []})

    def _asked(self, folder: Path) -> JsonDict | None:
        """The analysis `investigation` with a step more: the measurement that was requested and the data added; None if none was requested."""
        session = load(folder)
        question = (session.analysis("diagnosis") or {}).get("question")
        if question is None:
            return None
        brought = [str(one) for one in dict.fromkeys(sweep.condition or f"the {sweep.termination} sweep once more" for sweep in self.sweeps)]
        step = {"asked": question["id"], "why": question["why"], "brought": ", ".join([*brought, *(value.text for value in self.values)])}
        earlier = (session.analysis("investigation") or {}).get("steps", [])
        return {"schema": "motoremi.asked/1", "steps": [*earlier, step]}


def addition(
    folder: Path, sweeps: Sequence[ImpedanceSweep], values: Sequence[SingleValue], condition: Condition | None, options: ImportOptions
) -> Addition:
    """The data to add to a session, checked against it before anything is written.

    Parameters
    ----------
    folder : Path
    sweeps : sequence of ImpedanceSweep
        As read; `condition` may be omitted for a sweep whose file states it.
    values : sequence of SingleValue
    condition : Condition, optional
        Condition under which all sweeps were measured.
    options : ImportOptions
        Analyser, compensation, band and accuracy; where not given, the analyser and the compensation of the session.

    Raises
    ------
    BadInput
        If there is nothing to add, a file states another condition, or the sweeps do not fit those of the session.
    """
    if condition is not None and not sweeps:
        raise BadInput(f"--condition {condition} is for sweeps: give --short FILE..., --open FILE... with it")
    if not sweeps and not values:
        raise BadInput("nothing to append: give --short FILE..., --open FILE..., or --value NAME=QUANTITY")
    session = load(folder)
    if not session.sweeps:
        raise BadInput(f"{folder.name} holds no impedance sweep of the motor as it is: append to a session that does")
    own = []
    for sweep in _with_options(sweeps, options) if sweeps else ():
        if sweep.condition is not None and condition is not None and sweep.condition != condition:
            raise BadInput(f"{sweep.metadata['source']}: its header states {sweep.condition}, but --condition is {condition}; correct one of them")
        own.append(sweep.under(condition or sweep.condition))
    refuse_impossible(own, options.analyser)
    analyser = session.sweeps[0].metadata.get("analyser")
    if options.analyser is not None:
        named = find_analyser(options.analyser).name
        if own and analyser not in (None, named):
            raise BadInput(f"the sweeps of {folder.name} are declared as those of {analyser}: sweeps of {named} need a session of their own")
        analyser = named
    if analyser is not None:
        own = [sweep.with_metadata(analyser=analyser) for sweep in own]
    if standards := session.sweeps[0].metadata.get("compensated"):
        own = [sweep.with_metadata(**{"compensated": standards, **sweep.metadata}) for sweep in own]
    corrected = [session.corrections.corrected_sweep(sweep) for sweep in own]
    everything = (*session.corrected_sweeps, *session.corrected_conditioned, *corrected)
    measurement = Measurement.of(everything, values=(*session.values, *values))
    return Addition(tuple(own), tuple(values), (*measurement.copies(), *_disagreeing(measurement, own)))


# Repeats that differ by more than this share of |Z|, rms, were not measured under the same condition.
DISAGREEING = 0.02


def _disagreeing(measurement: Measurement, new: Sequence[ImpedanceSweep]) -> list[str]:
    """A sentence for each condition whose repeats differ too much."""
    found = []
    conditions = {sweep.condition for sweep in new}
    for one in measurement.conditioned:
        if one.condition in conditions and one.sweep.repeats > 1:
            apart = one.sweep.impedance_ohm / one.sweep.mean_ohm - 1
            rms = float(np.sqrt(np.mean(np.abs(apart) ** 2)))
            if rms > DISAGREEING:
                which = f"{one.condition}: the {one.sweep.repeats} {one.sweep.termination} sweeps"
                found.append(f"{which} disagree by {percent(100 * rms, 2)}; their mean is of little use")
    return found


def prepared(
    sweeps: Sequence[ImpedanceSweep], spectra: Sequence[Spectrum], options: ImportOptions, names: Sequence[str], values: Sequence[SingleValue] = ()
) -> Import:
    """All content of a new session, checked before its folder is created, so that no incomplete session can remain.

    Parameters
    ----------
    sweeps, spectra
        As read.
    options : ImportOptions
    names : sequence of str
        Names of the files, as recorded in the session.
    values : sequence of SingleValue

    Raises
    ------
    BadInput
        For an option that cannot be used with these files.
    """
    if options.limit:
        find_limit(options.limit)
        if not spectra:
            raise BadInput("a limit is for emission spectra, and none of the files is one (--spectrum FILE...)")
    named = find_analyser(options.analyser).name if options.analyser is not None else None
    own = _with_options(sweeps, options)
    refuse_impossible(own, options.analyser)
    if named is not None:
        own = [sweep.with_metadata(analyser=named) for sweep in own]
    chain = options.corrections
    corrected = [chain.corrected_spectrum(item) for item in spectra]
    measurement = Measurement.of([chain.corrected_sweep(sweep) for sweep in own]) if own else None
    start = {
        "title": f"Imported: {options.motor}" if options.motor else "Imported sweeps",
        "motor": options.motor,
        "serial": options.serial,
        "operator": options.operator,
        "ambient": options.ambient,
        "corrections": chain.to_list(),
        "imported": list(names),
        "analyser": None if measurement is None else measurement.analyser.name,
        "analyser_assumed": measurement is not None and named is None and not any(sweep.metadata.get("analyser") for sweep in own),
    }
    caveats = [] if measurement is None else measurement.caveats()
    caveats += chain.remarks()
    caveats += import_notes(spectra)
    return Import(tuple(own), tuple(spectra), tuple(corrected), start, tuple(caveats), tuple(observations(corrected)), options.limit, tuple(values))


def _with_options(sweeps: Sequence[ImpedanceSweep], options: ImportOptions) -> list[ImpedanceSweep]:
    """The requested band of the sweeps, with the stated accuracy and compensation."""
    if not sweeps and (options.band or options.accuracy or options.compensated):
        raise BadInput("band, accuracy and compensation are for impedance sweeps, and none of the files is one (--short FILE..., --open FILE...)")
    percent = checked_accuracy(options.accuracy) if options.accuracy else None
    span = parse_band(options.band) if options.band else None
    own = list(sweeps) if span is None else [_within(sweep, span) for sweep in sweeps]
    stated: JsonDict = {} if percent is None else {"accuracy_percent": percent}
    if options.compensated:
        stated["compensated"] = list(COMPENSATED)
    return [sweep.with_metadata(**stated) for sweep in own] if stated else own


def _within(sweep: ImpedanceSweep, span: tuple[float, float]) -> ImpedanceSweep:
    try:
        return sweep.within(*span)
    except BadInput as error:
        raise BadInput(f"{sweep.metadata['source']}: {error}") from error
