"""Transports, recording, replay, procedures, the runner and the simulated bench."""
