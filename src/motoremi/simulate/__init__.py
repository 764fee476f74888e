"""Simulation of the motor under test and of its measurement, without any formula of `model` or `emission`."""
