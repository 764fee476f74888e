"""What a reader of imported spectra has to know about their files."""

from __future__ import annotations

from collections.abc import Sequence

from motoremi.data.corrections import applied_transducer
from motoremi.data.spectrum import Spectrum
from motoremi.data.text import clean_text
from motoremi.quantities import show


def import_notes(spectra: Sequence[Spectrum]) -> list[str]:
    """What was changed on import, what is doubtful, which final values are left out and which transducer was applied; each once."""
    return list(dict.fromkeys(note for spectrum in spectra for note in _notes(spectrum)))


def final_summaries(finals: Sequence[Spectrum]) -> list[str]:
    """One line for the final values of each detector in each file: how many, and the highest."""
    groups: dict[tuple[str, str], list[Spectrum]] = {}
    for one in finals:
        groups.setdefault((str(one.metadata.get("source", "-")), one.detector), []).append(one)
    lines = []
    for (source, detector), own in groups.items():
        highest = max(own, key=lambda one: float(one.level_dbuv[0]))
        level, at = float(highest.level_dbuv[0]), show(float(highest.frequency_hz[0]), "Hz")
        lines.append(f"{detector} {source}: {len(own)} final value{'s' if len(own) > 1 else ''}, up to {level:.1f} {highest.level_unit} at {at}")
    return lines


def _notes(spectrum: Spectrum) -> list[str]:
    source = str(spectrum.metadata.get("source", "-"))
    lines = [str(text) for key in ("changes", "warnings") for text in spectrum.metadata.get(key, ())]
    if left_out := spectrum.metadata.get("final_values_left_out"):
        lines.append(str(left_out))
    notes = [f"{source}: {text}" for text in lines]
    if applied := applied_transducer(spectrum):
        notes.append(f"{spectrum.detector}: the receiver has applied its transducer {clean_text(applied, 60)!r}; it must not be in --corrections")
    return notes
