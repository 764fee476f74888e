"""Names of the plots, sections and forms; imports nothing heavy, so that the command's help is quick."""

from __future__ import annotations

PLOTS = {
    "sweeps": "the measured sweeps: |Z| and phase, resonances marked",
    "fit": "measured and model, the error below",
    "steps": "measured, the paper's circuit and the current model, the errors below",
    "error": "error over frequency against uncertainty and tolerance, points that fail marked",
    "training": "training curve of the base fit",
    "ladder": "the error falling step by step",
    "ranking": "evidence of the candidates of the diagnosis",
    "inspection": "what an element would have to be (with --element)",
    "signature": "the signature of an effect on this motor (with --effect)",
    "spectrum": "measured emission levels",
    "prediction": "predicted and measured emission against the limit, the difference below",
    "emission": "the model of the spectra against the levels, the difference below",
    "emission-ranking": "evidence of the candidates of the spectra's diagnosis",
}

SECTIONS = {
    "sweeps": "measured sweeps, with the model",
    "fit": "parameters and quantities derived from them",
    "ladder": "models and their errors",
    "comparison": "model against measurement, band by band",
    "diagnosis": "which effect is missing, with the evidence",
    "emission": "spectra, final values, limit, prediction",
    "state": "the motor's state",
    "equipment": "instruments, corrections and their calibration",
    "identity": "session, settings, files with their hashes",
    "procedure": "every step of the procedure",
}
FORMS = ("long", "short")
