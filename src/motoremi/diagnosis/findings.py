"""Findings: properties of the data themselves, independent of the motor, each with its place and a remedy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motoremi.arrays import BoolArray, FloatArray, JsonDict
from motoremi.data.analyser import Analyser
from motoremi.data.loose_contact import TO_FASTEN, loose_contact
from motoremi.data.measurement import Measurement
from motoremi.data.mislabelled import EXCHANGED, exchanged, measured_twice
from motoremi.data.moved import student_factor
from motoremi.data.noise import Noise
from motoremi.data.plausible import SENTENCES, wrong_phase
from motoremi.data.repeats import UNLIKE
from motoremi.data.single_values import REMEDY, disagreements
from motoremi.data.sweep import RepeatedSweep
from motoremi.data.trace_smoothing import Smoothing, smoothing_of
from motoremi.diagnosis.belief import MOST_ERRING_PERCENT
from motoremi.diagnosis.candidates import ALLOWED_SIGMA
from motoremi.fitting.result import SPECIFIED_SIGMA, Fit
from motoremi.fitting.search import BEYOND_SIGMA
from motoremi.inspection.unexplained import Remainder
from motoremi.quantities import percent, show, show_band

# Drift and correlated noise of so many times the white noise could be mistaken for an effect. Few repeats show their size only within this factor,
# so they may also be the cause of an error that is so many times as large.
COULD_PASS = 3.0
# The difference of repeats is averaged over so many neighbouring points, and must be so many times the noise at each; a ratio that is not finite.
AVERAGED, BEYOND_NOISE, UNLIMITED = 9, 3.0, 1e6
# An element of the fixture is reported if it is this many standard deviations from zero.
SEEN = 4.0
# Standard deviations of noise and analyser by which a resistance is negative, and the share of the points at which it must be.
NEGATIVE, OFTEN = 3.0, 0.02
# Phase error assumed for an analyser without specification, in rad.
UNDECLARED = 0.01
# A circuit that misses half of the points by more than this describes nothing.
MISSED = 0.5
# Standard deviation of the logarithm of a parameter that is not determined, as in `Fit.determined`.
UNDETERMINED = 0.5
# With fewer points than this, a sweep hardly determines more than the seven elements.
FEW_POINTS = 30
# Resistance of leads and clips in series that are sound: the fixture of a network analyser that nobody compensated has as much.
MOST_OF_CONTACTS_OHM = 0.3


@dataclass(frozen=True)
class Finding:
    """One property of the data.

    Parameters
    ----------
    id : str
        Identifier, as in the JSON of a diagnosis.
    why, remedy : str
    serious : bool
        Whether it could change the verdict.
    sweep : str or None
    band_hz : tuple of float, or None
    """

    id: str
    why: str
    remedy: str
    serious: bool
    sweep: str | None = None
    band_hz: tuple[float, float] | None = None

    def to_dict(self) -> JsonDict:
        """Plain data, as in the JSON of a diagnosis."""
        band = None if self.band_hz is None else list(self.band_hz)
        return {"id": self.id, "sweep": self.sweep, "band_hz": band, "serious": self.serious, "why": self.why, "remedy": self.remedy}


def of_the_noise(fit: Fit, left_percent: float = 0.0) -> list[Finding]:
    """Findings from the repeats: outliers, drift, correlated noise.

    Parameters
    ----------
    left_percent : float
        Error that no accepted model describes, relative to Z. Much smaller differences between repeats are not its cause and not serious.
    """

    def serious(size: float) -> bool:
        return size > COULD_PASS * white and 100 * size * COULD_PASS > left_percent

    found = []
    smoothing = smoothing_of(fit.measurement.sweeps, fit.measurement.noise)
    smoothed: tuple[RepeatedSweep, ...] = ()
    if smoothing is not None:
        smoothed = smoothing.sweeps
        white = max(
            float(np.median(noise.sigma)) for sweep, noise in zip(fit.measurement.sweeps, fit.measurement.noise, strict=True) if sweep in smoothed
        )
        found.append(_smoothed(smoothing, serious(float(np.sqrt(np.mean(np.concatenate(smoothing.changes) ** 2))))))
    for sweep, noise in zip(fit.measurement.sweeps, fit.measurement.noise, strict=True):
        name, frequency, white = sweep.termination, sweep.frequency_hz, float(np.median(noise.sigma))
        if noise.outliers is not None and noise.outliers.any():
            found.append(_interference(name, frequency, noise.outliers))
        if noise.drift is not None:
            size = float(np.sqrt(np.mean(np.abs(noise.drift) ** 2)))
            found.append(
                Finding(
                    "drift",
                    f"the {name} sweep changes steadily from repeat to repeat, by {percent(100 * size, 2)} over half of them ({size / white:.2g} "
                    "times its noise): the motor warms up, or the analyser does",
                    "let both settle for half an hour, or alternate short and open sweeps",
                    serious(size),
                    name,
                    _span(frequency),
                )
            )
        if sweep.moved is not None:
            found.append(_leads_moved(sweep, sweep.moved))
        elif noise.correlated is not None and noise.source == "repeats" and sweep not in smoothed:
            alike = float(np.median(noise.correlated_sigma))
            found.append(
                Finding(
                    "correlated-noise",
                    f"repeats of the {name} sweep differ in the same way over neighbouring frequencies, by {percent(100 * alike, 2)}: "
                    "averaging more points does not help",
                    "look for loose contacts and moving cables, and repeat",
                    serious(alike),
                    name,
                    _span(frequency),
                )
            )
    return found


def _smoothed(smoothing: Smoothing, serious: bool) -> Finding:
    """A moving average of the instrument; without a place if it is in all of several sweeps."""
    names = [sweep.termination for sweep in smoothing.sweeps]
    sweep = names[0] if len(names) == 1 else None
    change = max(float(own.max()) for own in smoothing.changes)
    return Finding(
        "correlated-noise",
        f"neighbouring points of the {' and the '.join(names)} sweep scatter together as averages over about {smoothing.points} points do: "
        "smoothing, or averaging over frequency, seems to be switched on in the analyser. It flattens sharp resonances, as no circuit does: "
        f"averaging so once more would change |Z| by up to {percent(100 * change, 2)}",
        "switch smoothing off (a narrower bandwidth or averaged sweeps lower the noise as well), and repeat the sweeps",
        serious,
        sweep,
        _span(smoothing.sweeps[0].frequency_hz) if sweep else None,
    )


def _leads_moved(sweep: RepeatedSweep, sigma: FloatArray) -> Finding:
    """What changed between the repeats: the elements that change Z by at least a tenth of what the most influential one does."""
    typical = sigma / student_factor(sweep.repeats - 1)
    change = np.sqrt(np.mean(np.abs(sweep.changes_by_leads) ** 2, axis=0)) * typical
    seen = change > 0.1 * change.max()
    sizes = [show(float(size), unit, 2) for size, unit, shows in zip(typical, ("Ohm", "H", "S", "F"), seen, strict=True) if shows]
    bad_contact = bool(seen[0] and typical[0] > MOST_OF_CONTACTS_OHM)
    cause = "a contact changed" if bad_contact else "the leads moved"
    return Finding(
        "correlated-noise",
        f"{cause} between repeats of the {sweep.termination} sweep, by about {' and '.join(sizes)}: each repeat is converted to their "
        "average position, and the error that remains is allowed for",
        "look for a loose contact, and measure again" if bad_contact else "fix the leads, or connect them the same way each time",
        bad_contact,
        sweep.termination,
        _span(sweep.frequency_hz),
    )


def _interference(name: str, frequency_hz: FloatArray, outliers: BoolArray) -> Finding:
    at = frequency_hz[outliers]
    count = int(outliers.sum())
    return Finding(
        "interference",
        f"{count} of {outliers.size} points of the {name} sweep stand out ({show(float(at[0]), 'Hz')}"
        + (f" - {show(float(at[-1]), 'Hz')}" if count > 1 else "")
        + "): a station, a bad contact, or a resonance narrower than the distance between points; they get a low weight",
        "sweep around them with more points; shield the motor, raise the level, or leave them out",
        count > 0.05 * outliers.size,
        name,
        (float(at[0]), float(at[-1])),
    )


def of_the_scatter(measurement: Measurement) -> list[Finding]:
    """Sweeps that scatter by more than the specification of a named analyser allows as an error."""
    analyser, found = measurement.analyser, []
    if not analyser.named or analyser.ideal:
        return []
    for sweep, noise in zip(measurement.sweeps, measurement.noise, strict=True):
        single = np.sqrt(2 * sweep.repeats) * noise.sigma
        allowed = SPECIFIED_SIGMA * analyser.uncertainty(sweep.frequency_hz, sweep.mean_ohm)
        ratio = float(np.median((single / allowed)[noise.regular]))
        if ratio <= 1:
            continue
        size = percent(100 * float(np.median(single[noise.regular])), 2)
        found.append(
            Finding(
                "interference",
                f"each {sweep.termination} sweep scatters by {size}, {ratio:.2g} times the error that is specified for the {analyser.title}",
                "look for interference and loose contacts, reduce the bandwidth or raise the level; or was it another analyser?",
                False,
                sweep.termination,
                _span(sweep.frequency_hz),
            )
        )
    return found


def of_the_analyser(fit: Fit, accepted: bool) -> list[Finding]:
    """The size of the analyser's errors relative to the specification, and the elements of an uncompensated fixture."""
    found = []
    sigma, analyser = fit.analyser_sigma, fit.measurement.analyser
    if sigma > ALLOWED_SIGMA and not analyser.ideal and analyser.named:
        found.append(
            Finding(
                "beyond-specification",
                f"this needs errors of {sigma / 3:.2g} times the specification of the {analyser.title}: was it this analyser"
                + ("?" if accepted else ", or is the circuit at fault?"),
                f"repeat {analyser.standards} compensation, or name the right one (--analyser)",
                sigma > BEYOND_SIGMA,
            )
        )
    fixture = {
        p.name.removeprefix("fixture "): (float(fit.unknowns[i]), float(np.sqrt(fit.covariance[i, i])), p)
        for i, p in enumerate(fit.problem.unknowns)
        if p.name.startswith("fixture ")
    }
    seen = {name: entry for name, entry in fixture.items() if abs(entry[0]) > SEEN * entry[1] and abs(entry[0]) > 0.05}
    if fixture and (seen or not accepted):
        # Wires have no element below zero: that is an error of the calibration, and no value to be told.
        below = [name for name, (value, _, _) in seen.items() if value < 0]
        values = [f"{name} = {show(value * (p.sigma or 0.0), p.unit)}" for name, (value, _, p) in seen.items() if value > 0]
        parts = ", ".join([*values, *(f"{name} below zero, as no fixture has (the calibration errs)" for name in below)])
        if fit.fixture_sigma > ALLOWED_SIGMA:
            parts += (
                f", up to {fit.fixture_sigma:.2g} times what a fixture of a few centimetres has: long leads, of the bench or of the motor itself"
            )
        found.append(
            Finding(
                "not-compensated",
                "the fixture behind the plane of calibration was not compensated; "
                + (f"these data give {parts}" if seen else "these data do not determine it"),
                f"calibrate at the motor's terminals: {analyser.standards} on the fixture itself (if that was done, import with --compensated)",
                True,
            )
        )
    return found


def of_the_resistance(measurement: Measurement) -> list[Finding]:
    """A resistance below zero, beyond noise and analyser: no passive motor has one."""
    found, analyser = [], measurement.analyser
    least = UNDECLARED if analyser.ideal or not analyser.named else 0.0
    for sweep, floor in zip(measurement.sweeps, measurement.floors, strict=True):
        resistance = sweep.mean_ohm.real
        negative = resistance < -NEGATIVE * np.maximum(floor, least) * np.abs(sweep.mean_ohm)
        if np.mean(negative) <= OFTEN:
            continue
        at, worst = sweep.frequency_hz[negative], int(np.argmin(np.where(negative, resistance, 0.0)))
        found.append(
            Finding(
                "negative-resistance",
                f"the resistance is negative at {int(negative.sum())} of {negative.size} points of the {sweep.termination} sweep "
                f"({show(float(resistance[worst]), 'Ohm')} at {show(float(sweep.frequency_hz[worst]), 'Hz')}), beyond noise and analyser: "
                "a passive motor has none",
                f"repeat {analyser.standards} calibration at the place where the motor is connected, and measure again",
                True,
                sweep.termination,
                (float(at[0]), float(at[-1])),
            )
        )
    return found


def of_the_declaration(declared: Analyser, instead: Analyser, log_odds: float) -> Finding:
    """The finding that the errors in the data are not those of the declared analyser."""
    odds = "more than a million" if log_odds > np.log(1e6) else f"{np.exp(log_odds):.0f}"
    title = instead.title if instead.fixture is not None else instead.title.replace(", the fixture not compensated", "")
    why = f"the errors in the data are not those of the declared analyser ({declared.name}) but as large as those of a {title}"
    remedy = (
        f"declare the analyser that was used (--analyser {instead.name}), or repeat the compensation and the sweeps with leads that stay in place"
    )
    if not declared.named:
        why = f"no analyser was named, and the errors in the data are as of a {title}"
        remedy = f"name the analyser that was used (--analyser {instead.name})"
    return Finding("not-as-declared", f"{why}: odds of {odds} to 1, if it was one of these two", remedy, True)


def of_the_sweeps(left: Remainder | None) -> list[Finding]:
    """The finding that the sweeps contradict each other, if that was checked."""
    if left is None or left.together is None or left.together.belong:
        return []
    return [Finding("sweeps-disagree", left.together.sentence, "repeat both sweeps in one go, at one temperature, on one connection", True)]


def the_same_twice(measurement: Measurement) -> Finding | None:
    """The finding that both sweeps are one and the same."""
    twice = measured_twice(measurement.sweeps, measurement.floors)
    if twice is None:
        return None
    connected = {"open": "free", "short": "connected"}[twice.wrong]
    return Finding(
        "sweeps-disagree",
        f"the open-circuit and the short-circuit sweep differ by at most {show(100 * twice.apart, '%', 2)} at 90 % of the points: "
        "one was measured twice, or a part across the terminals, such as a varistor or a mains filter, hides the far end",
        f"measure the {twice.wrong}-circuit sweep again, with the far end {connected}; if it stays the same, measure the other one too, and look "
        "for such a part",
        True,
    )


def wrong_phase_in(measurement: Measurement) -> Finding | None:
    """The finding that the phase of a sweep cannot be that of a passive part."""
    for sweep in measurement.sweeps:
        found = wrong_phase(sweep.frequency_hz, sweep.mean_ohm)
        if found is not None:
            return Finding(
                "wrong-phase",
                f"{sweep.termination} sweep: {SENTENCES[found]}",
                "export R and X, or |Z| and its phase, and import the sweeps again"
                if found == "no phase"
                else "correct the sign, the unit or the title of the column in the file, and import it again",
                True,
                sweep.termination,
                _span(sweep.frequency_hz),
            )
    return None


def repeats_disagree_in(measurement: Measurement) -> Finding | None:
    """The finding that repeats of one sweep differ by far more than one motor and its leads change, or over stretches by a loose contact."""
    for sweep, noise in zip(measurement.sweeps, measurement.noise, strict=True):
        if (contact := loose_contact(sweep)) is not None:
            return Finding("sweeps-disagree", contact, TO_FASTEN, True, sweep.termination, _span(sweep.frequency_hz))
        apart = repeats_apart(sweep, noise)
        if apart > UNLIKE:
            return Finding(
                "sweeps-disagree",
                f"repeats of the {sweep.termination} sweep differ by {percent(100 * apart, 2)} of |Z| (median over the points), neighbouring "
                "points alike: one of them is of another motor, termination or unit, or a contact was open",
                "compare the repeats, and import them again without the wrong ones, or measure them again",
                True,
                sweep.termination,
                _span(sweep.frequency_hz),
            )
    return None


def repeats_apart(sweep: RepeatedSweep, noise: Noise) -> float:
    """Relative difference of two repeats that is alike over neighbouring points, median over the points; 0 if noise could be as large."""
    if sweep.repeats < 2:
        return 0.0
    with np.errstate(all="ignore"):
        ratios = np.nan_to_num(sweep.impedance_ohm[1:] / sweep.impedance_ohm[0], nan=0.0, posinf=UNLIMITED, neginf=-UNLIMITED) - 1
    mean = np.full(min(AVERAGED, sweep.frequency_hz.size), 1 / min(AVERAGED, sweep.frequency_hz.size))
    alike = max(float(np.median(np.abs(np.convolve(ratio, mean, mode="valid")))) for ratio in ratios)
    # Of real and imaginary part each, of the mean of the repeats.
    white = 2 * np.sqrt(sweep.repeats) * float(np.median(noise.sigma))
    alike = 0.0 if alike < BEYOND_NOISE * white else alike
    if sweep.moved is None:
        return alike
    by_leads = sweep.changes_by_leads * (sweep.moved / student_factor(sweep.repeats - 1))
    return float(np.hypot(alike, np.median(np.sqrt(2 * np.sum(np.abs(by_leads) ** 2, axis=1)))))


def exchanged_in(measurement: Measurement) -> Finding | None:
    """The finding that each of the two sweeps looks as the other one must."""
    if not exchanged(measurement.sweeps):
        return None
    return Finding(
        "sweeps-exchanged",
        EXCHANGED,
        "check the far end of the winding; if the files were exchanged, import them again the other way round",
        True,
    )


def of_the_labels(measurement: Measurement) -> list[Finding]:
    """Repeats measured with the wrong termination."""
    return [
        Finding(
            "not-as-asked",
            f"of the {termination}-circuit sweeps, {measurement.mislabelled.count(termination)} measured with the other termination: not used",
            "check the far end of the winding before each sweep",
            False,
            termination,
        )
        for termination in dict.fromkeys(measurement.mislabelled)
    ]


def of_the_values(measurement: Measurement) -> list[Finding]:
    """Single values of one name that cannot both be right."""
    return [Finding("values-disagree", text, f"measure it again, and {REMEDY}", True) for text in disagreements(measurement.values)]


def of_the_amount(fit: Fit, nearest: Fit, named: bool = False) -> list[Finding]:
    """Findings on sweeps that have too few points, or that determine neither the fitted circuit nor `nearest` (the accepted or closest one).

    If an effect is named, the sweeps show that circuit, whether or not its parameters are known one by one: of two terms of one permeability hardly
    any is.
    """
    found = []
    for sweep in fit.measurement.sweeps:
        count = sweep.frequency_hz.size
        if count < FEW_POINTS:
            why = f"the {sweep.termination} sweep has {count} points: too few to distinguish most effects"
            found.append(Finding("too-little", why, "sweep 201 points or more", True, sweep.termination, _span(sweep.frequency_hz)))
    if not named and shows_nothing(fit) and shows_nothing(nearest):
        why = "these sweeps show no circuit: the analyser's errors may be as large as the measured values"
        found.append(Finding("too-little", why, "compensate at the motor's terminals, and check that the motor is connected", True))
    if len(fit.measurement.sweeps) == 1:
        missing = "open" if fit.measurement.terminations == ("short",) else "short"
        why = f"there is no {missing}-circuit sweep: an effect cannot be located"
        if fit.exchange is not None:
            why += ", and the resonances of winding and frame can be exchanged without a change of the curve"
        found.append(Finding("too-little", why, f"measure the {missing} sweep too", False))
    return found


def shows_nothing(fit: Fit) -> bool:
    """Whether the analyser may err by much and no parameter of the circuit is determined, or the circuit misses most points by far.

    If the resonances of winding and frame may be exchanged, their values count as determined although it is unknown which is the winding's. A
    single capacitor in one sweep determines no element of the circuit either, but an accurate analyser shows it. What a fixture that was not
    compensated adds counts as described: beyond its series resonance with the motor it is most of what a NanoVNA measures.
    """
    if fit.exchange is None:
        undetermined = not any(fit.determined(name) for name in fit.parameters if name not in fit.held)
    else:
        of_circuit = [index for index, p in enumerate(fit.problem.unknowns) if p.name in fit.parameters and p.scale == "log"]
        undetermined = bool(np.all(np.diag(fit.covariance)[of_circuit] > UNDETERMINED**2))
    may_err_percent = 100 * float(np.median(np.concatenate(fit.measurement.floors)))
    missed = np.exp(-fit.problem.deviation(fit.unknowns)) - 1
    return (undetermined and may_err_percent > MOST_ERRING_PERCENT) or float(np.median(np.abs(missed))) > MISSED


def of_the_hardly_seen(model: Fit) -> list[Finding]:
    """The finding that an accepted circuit errs far beyond the floor, at frequencies where the analyser is insensitive."""
    if not hardly_seen(model):
        return []
    allowed, measurement = SPECIFIED_SIGMA * model.floor_percent / 100, model.measurement
    errors = {termination: np.abs(values) for termination, values in model.errors().items()}
    pairs = zip(measurement.sweeps, measurement.floors, strict=True)
    sweep, floor = max(pairs, key=lambda pair: np.count_nonzero(errors[pair[0].termination] > allowed))
    there = errors[sweep.termination] > allowed
    band = _span(sweep.frequency_hz[there])
    missed, may_err = (100 * float(np.median(values[there])) for values in (errors[sweep.termination], floor))
    why = (
        f"in the {sweep.termination} sweep at {show_band(*band)} the circuit errs by {percent(missed, 2)} where the analyser may err by "
        f"{percent(may_err, 2)}: these data do not show whether it is right there"
    )
    remedy = "measure that band with shorter leads, or with an analyser that is made for such impedances"
    if measurement.analyser.by_waves:
        remedy = "measure that band between two ports (in series where |Z| is large, in parallel where it is small) or with an impedance analyser"
    return [Finding("too-little", why, remedy, True, sweep.termination, band)]


def hardly_seen(fit: Fit) -> bool:
    """Whether the circuit's error exceeds the specification although little is undescribed: it errs where the analyser is insensitive."""
    beyond = fit.rms_error_percent > SPECIFIED_SIGMA * fit.floor_percent
    return beyond and not fit.measurement.analyser.ideal and fit.unexplained_percent["value"] < fit.floor_percent


def _span(frequency_hz: FloatArray) -> tuple[float, float]:
    return float(frequency_hz[0]), float(frequency_hz[-1])
