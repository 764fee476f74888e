"""Common-mode impedance and conducted emission of DC motors."""
