"""The models: immittance laws with exact derivatives, circuits, the paper's motor, the catalogue of effects."""

from motoremi.model.effects import catalogue, find_effect
from motoremi.model.motor import Motor, dc_motor
from motoremi.model.parameter import Parameter

__all__ = ["Motor", "Parameter", "catalogue", "dc_motor", "find_effect"]
