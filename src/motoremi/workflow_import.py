"""Sessions from files, for `motoremi import` and the workbench: the data that were read are checked and stored."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from motoremi.arrays import ComplexArray, JsonDict
from motoremi.data.analyser import DEFAULT_ANALYSER, find_analyser
from motoremi.data.conditions import Condition, SingleValue
from motoremi.data.corrections import NO_CORRECTIONS, Corrections
from motoremi.data.declaration import COMPENSATED, refuse_impossible
from motoremi.data.import_notes import import_notes
from motoremi.data.loose_contact import TO_FASTEN, loose_contact
from motoremi.data.measurement import Measurement
from motoremi.data.mislabelled import label_remarks
from motoremi.data.repeats import UNLIKE
from motoremi.data.session import Session, SessionWriter, StorageError, load, refuse_unfinished, reopen
from motoremi.data.single_values import REMEDY, disagreements
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep, checked_accuracy, group_repeats
from motoremi.emission.limit import find_limit
from motoremi.emission.observe import observations
from motoremi.errors import BadInput
from motoremi.investigation.conditioned import without_use
from motoremi.quantities import parse_band, percent
from motoremi.workflow_emission import discard_of_other_spectra, has_analyses_of_spectra, judged

FINALS_ALONE = "final values alone show nothing of the rest of the span: import the scans in which their maxima were found with them"


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


@contextmanager
def _whole_or_not_at_all(folder: Path, start: JsonDict) -> Iterator[SessionWriter]:
    """A new session that is removed again if it cannot be stored completely: the user's files still exist, so the import can be repeated."""
    is_new = not folder.exists()
    try:
        writer = SessionWriter.create(folder, start)
        try:
            with writer:
                yield writer
        except BaseException:
            # Only here, where this process has made the session.
            _remove(folder, is_new)
            raise
    except StorageError as error:
        # A note that the session could not be closed either would be of one that is no longer there.
        raise StorageError(error.what, "nothing is left of this import, repeat it when that is mended") from error


def _remove(folder: Path, is_new: bool) -> None:
    """Remove the content of a folder, and the folder itself unless the user had made it."""
    for one in [folder] if is_new else list(folder.iterdir()):
        if one.is_dir():
            shutil.rmtree(one, ignore_errors=True)
        else:
            one.unlink(missing_ok=True)


@dataclass(frozen=True, eq=False)
class Import:
    """Sweeps and spectra that are ready to become a session.

    Parameters
    ----------
    sweeps : tuple of ImpedanceSweep
    spectra : tuple of Spectrum
        As read.
    corrected : tuple of Spectrum
        Levels of the spectra after the corrections.
    start : dict
        The session's first document.
    caveats : tuple of str
        Limitations that a reader has to know.
    observations : tuple of dict
        Observations on the spectra without a model.
    limit : str
    values : tuple of SingleValue
    finals : tuple of Spectrum
        Final values as read.
    """

    sweeps: tuple[ImpedanceSweep, ...]
    spectra: tuple[Spectrum, ...]
    corrected: tuple[Spectrum, ...]
    start: JsonDict
    caveats: tuple[str, ...]
    observations: tuple[JsonDict, ...]
    limit: str
    values: tuple[SingleValue, ...] = ()
    finals: tuple[Spectrum, ...] = ()

    def store(self, folder: Path) -> JsonDict | None:
        """Make the session; returns the verdict if the spectra are judged against a limit.

        Raises
        ------
        StorageError
            If it cannot be stored completely; nothing of it is left then.
        """
        with _whole_or_not_at_all(folder, self.start) as writer:
            for sweep in self.sweeps:
                writer.add_sweep(sweep)
            for value in self.values:
                writer.add_value(value)
            for spectrum in self.spectra:
                writer.add_spectrum(spectrum)
            for final in self.finals:
                writer.add_final(final)
            verdict = judged(writer, self.limit) if self.limit else None
            writer.close("done")
        return verdict


@dataclass(frozen=True, eq=False)
class Addition:
    """Sweeps, spectra and values that are ready to be added to a session.

    Parameters
    ----------
    sweeps : tuple of ImpedanceSweep
        With the condition under which they were measured; without one, further repeats of the reference sweeps.
    values : tuple of SingleValue
    caveats : tuple of str
        Limitations that a reader has to know.
    empties_ladder : bool
        Whether the models of the session's ladder were fitted to other data than those with the addition.
    spectra, finals : tuple of Spectrum
        Scans and final values as read.
    discards : bool
        Whether the session has a verdict, models or a diagnosis of its spectra, which are not those of all spectra then.
    """

    sweeps: tuple[ImpedanceSweep, ...]
    values: tuple[SingleValue, ...]
    caveats: tuple[str, ...]
    empties_ladder: bool
    spectra: tuple[Spectrum, ...] = ()
    finals: tuple[Spectrum, ...] = ()
    discards: bool = False

    def store(self, folder: Path) -> None:
        """Add them; the data that the session has already are not changed."""
        with reopen(folder) as writer:
            for sweep in self.sweeps:
                writer.add_sweep(sweep)
            for value in self.values:
                writer.add_value(value)
            for spectrum in self.spectra:
                writer.add_spectrum(spectrum)
            for final in self.finals:
                writer.add_final(final)
            if self.discards:
                discard_of_other_spectra(writer)
            if (self.sweeps or self.values) and (asked := self._asked(folder)):
                writer.save_analysis("investigation", asked)
            if self.empties_ladder:
                writer.save_analysis("ladder", load(folder).emptied_ladder())

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
    folder: Path,
    sweeps: Sequence[ImpedanceSweep],
    values: Sequence[SingleValue],
    condition: Condition | None,
    options: ImportOptions,
    spectra: Sequence[Spectrum] = (),
    finals: Sequence[Spectrum] = (),
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
        Analyser, compensation, band and accuracy; where not given, those of the session. Analyser and accuracy apply to all sweeps, so they must be
        those of the session.
    spectra, finals : sequence of Spectrum
        Scans and final values as read; the session's corrections apply to them.

    Raises
    ------
    BadInput
        If there is nothing to add, a file states another condition, or the sweeps do not fit those of the session; for options of sweeps without
        any.
    """
    if condition is not None and not sweeps:
        raise BadInput(f"--condition {condition} is for sweeps: give --short FILE..., --open FILE... with it")
    if not sweeps and not values and not spectra and not finals:
        raise BadInput("nothing to append: give --short FILE..., --open FILE..., --spectrum FILE..., or --value NAME=QUANTITY")
    session = load(folder)
    if (sweeps or values) and not session.sweeps:
        raise BadInput(f"{folder.name} holds no impedance sweep of the motor as it is: append to a session that does")
    if "procedure" in session.start:
        # A resumed run would take them for its own.
        refuse_unfinished(session)
    if finals and not spectra and not session.spectra:
        raise BadInput(FINALS_ALONE)
    for spectrum in (*spectra, *finals):
        session.corrections.corrected_spectrum(spectrum)
    if options.analyser is not None and not sweeps:
        raise BadInput("--analyser is for impedance sweeps: leave it out, or give --short FILE..., --open FILE... with it")
    own = []
    for sweep in _in_band_of(session, sweeps, options):
        if sweep.condition is not None and condition is not None and sweep.condition != condition:
            raise BadInput(f"{sweep.metadata['source']}: its header states {sweep.condition}, but --condition is {condition}; correct one of them")
        own.append(sweep.under(condition or sweep.condition))
    refuse_impossible(own, options.analyser)
    own = [_as_declared(sweep, session, options) for sweep in own]
    discards = bool(spectra or finals) and has_analyses_of_spectra(session)
    beside = Addition((), (), tuple(import_notes(spectra)), False, tuple(spectra), tuple(finals), discards)
    if not own and not values:
        return beside
    before = Measurement.of((*session.corrected_sweeps, *session.corrected_conditioned), values=session.values)
    corrected = [session.corrections.corrected_sweep(sweep) for sweep in own]
    everything = (*session.corrected_sweeps, *session.corrected_conditioned, *corrected)
    measurement = Measurement.of(everything, values=(*session.values, *values))
    known = label_remarks(before.sweeps)
    labels = [remark for remark in label_remarks(measurement.sweeps) if remark not in known]
    left_out = {name for sweep in measurement.sweeps for name in sweep.left_out}
    averaged = [sweep for sweep in corrected if sweep.metadata.get("source") not in left_out]
    unlike = (*_disagreeing(measurement, own), *_unlike_stored(before, averaged))
    caveats = (*measurement.copies(), *labels, *unlike, *_without_use(measurement, own, values), *_contradicting((*session.values, *values)))
    empties_ladder = bool(session.ladder) and not same_repeats(before, measurement)
    return replace(beside, sweeps=tuple(own), values=tuple(values), caveats=(*caveats, *beside.caveats), empties_ladder=empties_ladder)


def _as_declared(sweep: ImpedanceSweep, session: Session, options: ImportOptions) -> ImpedanceSweep:
    """A sweep to add, with the analyser and the compensation of the session's sweeps.

    Raises
    ------
    BadInput
        If it states another analyser or accuracy: those of one sweep apply to all, also to those that the session has already.
    """
    name, source = session.path.name, sweep.metadata.get("source", f"the {sweep.termination} sweep")
    stored = next((str(one.metadata["analyser"]) for one in session.sweeps if one.metadata.get("analyser")), None)
    declared = stored if stored is not None else DEFAULT_ANALYSER
    # The session's analyser overrides that of a file's header, as --analyser does in a new session.
    stated = options.analyser or (sweep.metadata.get("analyser") if stored is None and sweep.condition is None else None)
    named = declared if stated is None else find_analyser(str(stated)).name
    if named != declared:
        those = f"the sweeps of {name} are declared as those of {stored}" if stored else f"the analyser of the sweeps of {name} is not named"
        remedy = "leave the analyser out, or import all sweeps again with it"
        raise BadInput(f"{source}: {those}: sweeps of {named} need a session of their own; {remedy}")
    accuracies = [float(one.metadata["accuracy_percent"]) for one in session.sweeps if one.metadata.get("accuracy_percent")]
    accuracy = sweep.metadata.get("accuracy_percent")
    if accuracy is not None and accuracy not in accuracies and (options.accuracy or sweep.condition is None):
        those = f"{max(accuracies):g} %" if accuracies else "no accuracy"
        raise BadInput(
            f"{source}: an accuracy of {accuracy:g} % is stated, but {those} for the sweeps of {name}, and it applies to all: leave it out, or "
            "import all sweeps again with it"
        )
    if accuracies and accuracy is None:
        sweep = sweep.with_metadata(accuracy_percent=max(accuracies))
    if stored is not None:
        sweep = sweep.with_metadata(analyser=stored)
    if standards := session.sweeps[0].metadata.get("compensated"):
        sweep = sweep.with_metadata(**{"compensated": standards, **sweep.metadata})
    return sweep


def same_repeats(before: Measurement, after: Measurement) -> bool:
    """Whether both are the same data of the motor as it is, so that a fit to one is a fit to the other."""
    if (before.terminations, before.analyser, before.accuracy_percent) != (after.terminations, after.analyser, after.accuracy_percent):
        return False
    return all(
        np.array_equal(one.impedance_ohm, other.impedance_ohm) and np.array_equal(noise.sigma, others.sigma)
        for one, other, noise, others in zip(before.sweeps, after.sweeps, before.noise, after.noise, strict=True)
    )


# Repeats that differ by more than this share of |Z|, rms, were not measured under the same condition. Of appended repeats the median over the
# points counts: beside a sharp resonance a small shift is a large difference, a motor that has warmed differs mainly where its resistance is seen,
# and leads that moved change a small part of the band.
DISAGREEING = 0.02
# Random noise alone must not be taken for a difference: its median over many points is below so many times what is expected at a point.
OF_NOISE = 3.0


def _without_use(measurement: Measurement, new: Sequence[ImpedanceSweep], values: Sequence[SingleValue]) -> list[str]:
    """A sentence for each new sweep under a condition, and each new value, that the diagnosis cannot use."""
    added = {(sweep.condition, sweep.termination) for sweep in new}
    sentences = []
    for one, why in without_use(measurement):
        unused = f"stored, but a diagnosis does not use it: {why}"
        if isinstance(one, SingleValue):
            sentences += [f"{one.name}: the value is {unused}"] if one in values else []
        elif (one.condition, one.sweep.termination) in added:
            sentences.append(f"{one.condition}: the {one.sweep.termination} sweep is {unused}")
    return sentences


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


def _unlike_stored(stored: Measurement, new: Sequence[ImpedanceSweep]) -> list[str]:
    """A sentence for each further repeat that differs from the stored ones of its termination by more than repeats of one motor do."""
    found = []
    known = {sweep.termination: (sweep, noise) for sweep, noise in zip(stored.sweeps, stored.noise, strict=True)}
    for one in new:
        if one.condition is not None or one.termination not in known:
            continue
        sweep, noise = known[one.termination]
        ratio = one.impedance_ohm / sweep.mean_ohm
        apart = float(np.median(np.abs(ratio - 1)))
        # The noise is that of the mean; the new one is a single repeat.
        expected = float(np.median(np.sqrt(2 * noise.variance * (1 + sweep.repeats))))
        if apart <= max(DISAGREEING, OF_NOISE * expected):
            continue
        which = f"{one.metadata.get('source', 'a sweep')} differs from the stored {one.termination} sweeps"
        found.append(
            f"{which} {_difference(apart, ratio)} (median over the points); repeats are averaged, so if it is of another motor, termination or "
            "unit, import it as a session of its own and withdraw it here (motoremi withdraw); if the motor was set up otherwise, withdraw it here "
            "and append it with --condition"
        )
    return found


def _unlike_repeats(sweeps: Sequence[ImpedanceSweep], left_out: Collection[str]) -> list[str]:
    """A sentence for each repeat, but those that are left out, that is not like the others of its termination, and for each loose contact.

    As measured: in a `Measurement` leads that moved are in their average position, and they may take over any difference of R and L.
    """
    found = []
    for sweep in group_repeats(sweeps):
        if (contact := loose_contact(sweep)) is not None:
            found.append(f"{contact}; {TO_FASTEN}")
        ohm = sweep.impedance_ohm
        # Of two neither is known to be the wrong one.
        typical = ohm[0] if sweep.repeats == 2 else np.median(ohm.real, axis=0) + 1j * np.median(ohm.imag, axis=0)
        with np.errstate(all="ignore"):
            ratios = np.nan_to_num(ohm / typical, nan=np.inf)
        for name, ratio in zip(sweep.names, ratios, strict=True):
            apart = float(np.median(np.abs(ratio - 1)))
            if apart > UNLIKE and name not in left_out:
                others = f"{sweep.names[0]}" if sweep.repeats == 2 else f"the other {sweep.termination} sweeps"
                found.append(
                    f"{name} differs from {others} {_difference(apart, ratio)} (median over the points); repeats are averaged, so import it as a "
                    "session of its own if it is of another motor, termination or unit"
                )
    return found


def _difference(apart: float, ratio: ComplexArray) -> str:
    """A relative difference in words, a large one as a factor."""
    return f"by {percent(100 * apart, 2)} of |Z|" if apart < 1 else f"by a factor of {float(np.median(np.abs(ratio))):.3g}"


def _contradicting(values: Sequence[SingleValue]) -> list[str]:
    return [f"{text}; {REMEDY}" for text in disagreements(values)]


def prepared(
    sweeps: Sequence[ImpedanceSweep],
    spectra: Sequence[Spectrum],
    options: ImportOptions,
    names: Sequence[str],
    values: Sequence[SingleValue] = (),
    finals: Sequence[Spectrum] = (),
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
    finals : sequence of Spectrum
        Final values as read.

    Raises
    ------
    BadInput
        For an option that cannot be used with these files.
    """
    if finals and not spectra:
        raise BadInput(FINALS_ALONE)
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
    for final in finals:
        chain.corrected_spectrum(final)
    known = [chain.corrected_sweep(sweep) for sweep in own]
    measurement = Measurement.of(known, values=values) if own else None
    start = {
        "title": f"Imported: {options.motor}" if options.motor else "Imported sweeps",
        "motor": options.motor,
        "serial": options.serial,
        "operator": options.operator,
        "ambient": options.ambient,
        "corrections": chain.to_list(),
        **({"band": options.band} if options.band else {}),
        "imported": list(names),
        "analyser": None if measurement is None else measurement.analyser.name,
        "analyser_assumed": measurement is not None and named is None and not any(sweep.metadata.get("analyser") for sweep in own),
    }
    caveats = []
    if measurement is not None:
        left_out = {name for sweep in measurement.sweeps for name in sweep.left_out}
        reference = [sweep for sweep in known if sweep.condition is None]
        caveats = [
            *measurement.caveats(),
            *_unlike_repeats(reference, left_out),
            *_without_use(measurement, own, values),
            *_contradicting(values),
        ]
    caveats += chain.remarks()
    caveats += import_notes(spectra)
    seen = tuple(observations(corrected))
    return Import(tuple(own), tuple(spectra), tuple(corrected), start, tuple(caveats), seen, options.limit, tuple(values), tuple(finals))


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


def _in_band_of(session: Session, sweeps: Sequence[ImpedanceSweep], options: ImportOptions) -> list[ImpedanceSweep]:
    """As `_with_options`, by default within the band of the session: repeats must have the same frequencies."""
    band = str(session.start.get("band", ""))
    if options.band or not band or not sweeps:
        return _with_options(sweeps, options)
    try:
        return _with_options(sweeps, replace(options, band=band))
    except BadInput as error:
        raise BadInput(f"{error} ({session.path.name} was imported with --band {band}; give --band for another one)") from error


def _within(sweep: ImpedanceSweep, span: tuple[float, float]) -> ImpedanceSweep:
    try:
        return sweep.within(*span)
    except BadInput as error:
        raise BadInput(f"{sweep.metadata['source']}: {error}") from error
