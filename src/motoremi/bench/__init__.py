"""Transports, recording, procedures and the runner."""
