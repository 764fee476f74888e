"""The plots, sections and forms that can be asked for by name; light, so that help is quick."""

from __future__ import annotations

PLOTS = {
    "sweeps": "what was measured: |Z| and phase, resonances marked",
    "fit": "measured and model, the error below",
    "steps": "measured, the paper's circuit and the model that stands, the errors below",
    "error": "error over frequency against uncertainty and tolerance, points that fail marked",
    "training": "training curve of the base fit",
    "ladder": "the error falling step by step",
    "ranking": "evidence of the candidates of the diagnosis",
    "inspection": "what an element would have to be (with --element)",
    "signature": "how an effect would show on this motor (with --effect)",
    "spectrum": "measured emission levels",
    "prediction": "predicted and measured emission against the limit, the difference below",
    "emission": "the model of the spectra against the levels, the difference below",
    "emission-ranking": "evidence of the candidates of the spectra's diagnosis",
}

SECTIONS = {
    "sweeps": "what was measured, with the model",
    "fit": "parameters and what follows from them",
    "ladder": "models and their errors",
    "comparison": "the model against the measurement, band by band",
    "diagnosis": "which effect is missing, with the evidence",
    "emission": "spectra, final values, limit, prediction",
    "state": "the motor's state",
    "equipment": "instruments, corrections and their calibration",
    "identity": "session, settings, files with their hashes",
    "procedure": "every step",
}
FORMS = ("long", "short")
