"""Numbers of the paper as printed: J. Liu, X. Wang, J. Nan, Energy and Power Engineering 3 (2011) 96-106, doi 10.4236/epe.2011.32013.

Uncorrected, in SI units.
"""

from __future__ import annotations

from types import MappingProxyType

LOWEST_HZ, HIGHEST_HZ = 150e3, 30e6
# Table 1, with Rr in kOhm as printed.
TABLE_1 = MappingProxyType({"Ra": 21.3e-3, "La": 12.1e-6, "Ca": 22e-12, "Rr": 39.8e3, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12})
# The same with Rr in ohm, which agrees with the other numbers.
TABLE_1_OHM = MappingProxyType({**TABLE_1, "Rr": 39.8})

# Section 4.2: the training curve and where the model fails.
TRAINING_LOOPS = 200
FAILS_ABOVE_HZ = 20e6

# Section 5: commutation.
COMMUTATOR_WIDTH_M, COMMUTATOR_DIAMETER_M = 0.100, 0.360
SPEED_RPM = 1400.0
COMMUTATION_S = 38.4e-3
STEP_S = 0.5e-7
COIL_INDUCTANCE_H = 121e-6
CONTACT_RESISTANCE_OHM = 21.3e-3
CURRENT_A = 10.0
CONTACT_VOLTAGE_RATE = 1500.0  # "the changing rate reached high voltage of 1500 V"

# Section 6: the LISN, and the frequency up to which the emission is strong.
LISN_OHM = 25.0
EMISSION_END_HZ = 11e6
