"""What every diagnosis, as machines read it, has to hold."""

from __future__ import annotations

import json

import numpy as np

VERDICTS = {"adequate", "missing-effect", "family", "instrument", "data", "unexplained"}
FIGURES = {"effects", "chi2_reduced", "rms_error_percent", "rms_error_db", "corrected_error_percent", "analyser_sigma"}
FINDINGS = {
    "interference", "drift", "correlated-noise", "sweeps-disagree", "beyond-specification", "not-compensated", "range-step", "too-little",
    "not-as-declared", "not-as-asked", "negative-resistance",
}  # fmt: skip


def check_contract(document):
    """All that the public contract says of `motoremi diagnose --json`."""
    assert document["schema"] == "motoremi.diagnosis/2"
    assert document["verdict"] in VERDICTS
    assert 0 <= document["confidence"] <= 1
    for name in ("base", "best"):
        assert set(document[name]) >= FIGURES
        assert all(np.isfinite(document[name][key]) and document[name][key] >= 0 for key in FIGURES - {"effects"})
    left = document["unexplained_percent"]
    assert 0 <= left["low"] <= left["value"] <= left["high"]
    assert 0 < document["noise_percent"] <= document["floor_percent"]
    for span in document["where"]:
        assert span["sweep"] in ("short", "open")
        assert span["band_hz"][0] < span["band_hz"][1]
        assert 0 < span["share"] <= 1
    for finding in document["findings"]:
        assert finding["id"] in FINDINGS
        assert finding["why"]
        assert finding["remedy"]
        assert isinstance(finding["serious"], bool)
        assert finding["sweep"] in ("short", "open", None)
        assert finding["band_hz"] is None or finding["band_hz"][0] <= finding["band_hz"][1]
    if document["verdict"] in ("adequate", "data", "unexplained"):
        assert document["effects"] == document["families"] == []
    assert sum(c["probability"] for c in document["candidates"]) <= 1 + 1e-9
    for candidate in document["candidates"]:
        assert set(candidate) >= {"effect", "family", "probability", "chi2_reduced", "delta_bic", "rms_error_percent", "parameters", "plausible"}
        for parameter in candidate["parameters"].values():
            assert set(parameter) >= {"value", "sigma", "at_bound"}
    assert set(document["next_measurement"]) >= {"id", "why"}
    json.dumps(document, allow_nan=False)
