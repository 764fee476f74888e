"""What was measured: sweeps, spectra, the analyser's errors, users' files, the session folder."""
