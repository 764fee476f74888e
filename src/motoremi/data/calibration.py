"""Check of a calibration's age."""

from __future__ import annotations

# Calibration laboratories recommend a year for impedance analysers and receivers alike.
USUAL_DAYS = 365.0


def calibration_doubt(role: str, age_days: int, within_days: float | None = None) -> str:
    """A warning about a calibration that is too old or dated in the future; empty if it is neither.

    Parameters
    ----------
    role : str
        Role of the instrument in the procedure.
    age_days : int
        Days from the calibration to the measurement.
    within_days : float, optional
        Longest age; a year unless given.
    """
    if age_days < 0:
        return f"the calibration of the {role} lies {-age_days} days in the future"
    return f"the calibration of the {role} is {age_days} days old" if age_days > (USUAL_DAYS if within_days is None else within_days) else ""
