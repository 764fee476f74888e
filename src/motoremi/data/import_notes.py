"""What a reader of imported spectra has to know about their files."""

from __future__ import annotations

from collections.abc import Sequence

from motoremi.data.corrections import applied_transducer
from motoremi.data.spectrum import Spectrum
from motoremi.data.text import clean_text


def import_notes(spectra: Sequence[Spectrum]) -> list[str]:
    """What was changed on import, what is doubtful, which final values are left out and which transducer was applied; each once."""
    return list(dict.fromkeys(note for spectrum in spectra for note in _notes(spectrum)))


def _notes(spectrum: Spectrum) -> list[str]:
    source = str(spectrum.metadata.get("source", "-"))
    told = [str(text) for key in ("changes", "warnings") for text in spectrum.metadata.get(key, ())]
    if left_out := spectrum.metadata.get("final_values_left_out"):
        told.append(str(left_out))
    notes = [f"{source}: {text}" for text in told]
    if applied := applied_transducer(spectrum):
        notes.append(f"{spectrum.detector}: the receiver has applied its transducer {clean_text(applied, 60)!r}; it must not be in --corrections")
    return notes
