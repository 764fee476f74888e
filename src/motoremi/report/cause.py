"""The diagnosis: which effect is missing, with the evidence."""

from __future__ import annotations

from collections.abc import Sequence

from motoremi.arrays import JsonDict
from motoremi.errors import BadInput
from motoremi.model.effects import find_effect
from motoremi.model.effects.names import as_sum
from motoremi.quantities import show
from motoremi.report import plots
from motoremi.report.conditions_section import asked_table, path_table
from motoremi.report.contents import Section, Table
from motoremi.report.svg import picture
from motoremi.report.words import described, findings_of, in_words, lag, number, place_of, probability_of, reasons_of

MOST_CANDIDATES = 10
# Sets of effects that are less probable are not listed.
LEAST_SHOWN = 1e-3


def diagnosis_section(diagnosis: JsonDict, asked: JsonDict | None = None) -> Section:
    """The verdict, the ranking with its evidence, cross-validation, and what to measure next."""
    rows = []
    for candidate in diagnosis["candidates"][:MOST_CANDIDATES]:
        values = ", ".join(
            f"{name} = {show(entry['value'], entry.get('unit', ''))}" + (" (at bound)" if entry["at_bound"] else "")
            for name, entry in candidate["parameters"].items()
        )
        rows.append(
            (
                str(candidate["effect"]),
                str(candidate["family"]),
                number(probability_of(candidate, diagnosis)),
                lag(candidate["delta_bic"]),
                f"{number(candidate['rms_error_percent'])} %",
                f"{number(candidate.get('unexplained_percent'))} %",
                "yes" if candidate["plausible"] else "no, at a bound",
                values,
            )
        )
    columns = ("effect", "family", "probability", "ΔBIC", "error left", "undescribed", "plausible", "fitted parameters")
    sentence = in_words(diagnosis)
    texts = [f"{sentence[:1].upper()}{sentence[1:]}; confidence {100 * diagnosis['confidence']:.0f} %."]
    texts += [reason[:1].upper() + reason[1:] + "." for reason in reasons_of(diagnosis)]
    if "unexplained_percent" in diagnosis:
        texts.append(f"The model {as_sum(('paper’s circuit', *diagnosis['best']['effects']))} {described(diagnosis['unexplained_percent'])}.")
    texts += [f"Not distinguished by these data: {', '.join(family)}." for family in diagnosis["families"]]
    texts += [_explained(str(name)) for name in diagnosis["effects"]]
    texts.append(f"Measure next: {diagnosis['next_measurement']['why']}.")
    found, further = (
        _findings(diagnosis),
        (*_sets(diagnosis), *_left_out(diagnosis), *path_table(diagnosis), *asked_table(asked), *_menu(diagnosis)),
    )
    if not rows:
        return Section("Diagnosis", tuple(texts), (*found, *further))
    others = len(diagnosis["candidates"]) - len(rows)
    title = "Ranking: each single effect on top of the diagnosed model" + (f" ({others} worse ones not shown)" if others else "")
    return Section(
        "Diagnosis",
        tuple(texts),
        (*found, Table(title, columns, tuple(rows)), *further),
        (picture("ranking", plots.ranking_figure(diagnosis), "Evidence of the single effects: how far each lies behind the best."),),
    )


def _findings(diagnosis: JsonDict) -> tuple[Table, ...]:
    """The findings: what the data themselves show, whatever the motor."""
    found = findings_of(diagnosis)
    rows = tuple(
        (str(one["id"]), place_of(one), str(one["why"]), str(one["remedy"]), "may change the verdict" if one["serious"] else "-") for one in found
    )
    columns = ("finding", "where", "what", "what to do", "serious")
    marked = frozenset(index for index, one in enumerate(found) if one["serious"])
    return (Table("What the data themselves show", columns, rows, marked),) if rows else ()


def _sets(diagnosis: JsonDict) -> tuple[Table, ...]:
    """The probability of each set of effects; not stored by earlier versions."""
    shares = [(" + ".join(one["effects"]) or "nothing", probability_of(one, diagnosis)) for one in diagnosis.get("sets", ())]
    rows = tuple((name, number(share)) for name, share in shares if share >= LEAST_SHOWN)
    return (Table("Sets of effects, the most probable first", ("missing", "probability"), rows),) if rows else ()


def _left_out(diagnosis: JsonDict) -> tuple[Table, ...]:
    """Cross-validation: how much better data left out of the fit are predicted."""
    validation = diagnosis.get("cross_validation")
    if not validation:
        return ()
    names = {"bands": "a band of both sweeps from the rest", "short_to_open": "the open-circuit sweep from the short-circuit sweep"}
    known = [(names[key], value) for key, value in validation.items() if key in names and value is not None]
    rows = tuple((name, f"{value:+.4g}", "better" if value > 0 else "no better") for name, value in known)
    columns = ("predicted", "gain in log likelihood (nats)", "than before")
    which = "named" if diagnosis["effects"] else "closest"
    return (Table(f"Cross-validation: left-out data, with the {which} effects against without", columns, rows, _worse(known)),)


def _worse(known: Sequence[tuple[str, float]]) -> frozenset[int]:
    return frozenset(index for index, (_, value) in enumerate(known) if value <= 0)


def _menu(diagnosis: JsonDict) -> tuple[Table, ...]:
    """How well each possible measurement would distinguish the candidates."""
    rows = tuple(
        (
            str(one["id"]),
            str(one["action"]),
            number(one.get("minutes")),
            number(one.get("information_bits")),
            f"{100 * one['separates']:.0f} %",
            number(one["ratio"]),
        )
        for one in diagnosis["next_measurement"].get("menu", ())
    )
    columns = ("measurement", "do", "minutes", "bits expected", "pairs of candidates distinguished", "log odds of the best pair")
    return (Table("What could be measured next, best first", columns, rows),) if rows else ()


def title_of(effect: str) -> str:
    """The title of an effect; a stored diagnosis may name one that is not installed here."""
    try:
        return find_effect(effect).effect.title
    except BadInput:
        return "not in the catalogue of this installation"


def _explained(name: str) -> str:
    try:
        effect = find_effect(name).effect
    except BadInput:
        return f"{name}: {title_of(name)}."
    return f"{name}: {effect.title}. Signature: {effect.signature}. Law: {effect.formula}. Source: {effect.source}."
