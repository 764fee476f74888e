"""The error model of sweeps: that of the analyser that was declared, as it was connected to the motor.

A sweep says what it was measured with in its metadata: `analyser`, and `fixture` if the motor was between two ports.
"""

from __future__ import annotations

from collections.abc import Sequence

from motoremi.data.analyser import DEFAULT_ANALYSER, TRANSMISSION, Analyser, find_analyser, unknown_at_one_port
from motoremi.data.quantity import ports_written
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput

# How `read_as` begins where a file holds reflections.
_REFLECTIONS = ("S parameters", "S11")


# Standards with which a fixture is compensated: a sweep's metadata list them under `compensated`.
COMPENSATED = ("open", "short")


def is_compensated(sweep: ImpedanceSweep) -> bool:
    """Whether the fixture was compensated, or the analyser calibrated at the motor's terminals, according to the sweep's metadata."""
    stated = sweep.metadata.get("compensated")
    return isinstance(stated, (list, tuple)) and set(COMPENSATED) <= set(map(str, stated))


def ports_of(sweep: ImpedanceSweep) -> str:
    """Connection of the motor between two ports, `series-through` or `shunt-through`; empty for another one or none."""
    return ports_written(sweep.metadata.get("fixture", ""))


def are_reflections(sweeps: Sequence[ImpedanceSweep]) -> bool:
    """Whether all sweeps were read from reflections at one port, as network analysers save them."""
    return all(str(sweep.metadata.get("read_as", "")).startswith(_REFLECTIONS) for sweep in sweeps)


def declared_analyser(
    sweeps: Sequence[ImpedanceSweep], named: str | None = None, conditioned: Sequence[ImpedanceSweep] = ()
) -> tuple[Analyser, str]:
    """The error model of sweeps, and a remark where it is not the one that was declared; empty otherwise.

    Parameters
    ----------
    sweeps : sequence of ImpedanceSweep
    named : str, optional
        The analyser; without it the metadata of the first sweep that has one decide.
    conditioned : sequence of ImpedanceSweep
        Sweeps under a condition, which count for how the motor was connected.

    Raises
    ------
    BadInput
        If the analyser is not known, or its name says another connection than the sweeps.
    """
    found = (
        find_analyser(named)
        if named
        else next((_stated(sweep) for sweep in sweeps if sweep.metadata.get("analyser")), find_analyser(DEFAULT_ANALYSER))
    )
    used = {ports_of(sweep) for sweep in (*sweeps, *conditioned)}
    if len(used) > 1:
        # They share no error model.
        seen = " and ".join(sorted(one or "one port" for one in used))
        remark = f"the sweeps were measured in different ways ({seen}): the size of the analyser's errors is estimated"
        return find_analyser(DEFAULT_ANALYSER), remark
    ports = next(iter(used), "")
    if not ports and not found.named and are_reflections(sweeps):
        return unknown_at_one_port(), ""
    if ports in ("", found.ports):
        return found, ""
    if found.ports:
        raise BadInput(f"the sweeps were measured {ports}, but the analyser is declared as {found.name}; correct one of them")
    if found.instrument not in TRANSMISSION:
        return found, f"the sweeps were measured {ports}, but {found.name} measures no transmission between two ports: name the network analyser"
    return find_analyser(f"{found.instrument}+{ports}"), ""


def refuse_impossible(sweeps: Sequence[ImpedanceSweep], named: str | None) -> None:
    """Raise `BadInput` if the sweeps cannot be those of the named analyser: a transmission of one without two ports, or a reflection."""
    if named is None:
        return
    analyser = find_analyser(named)
    for sweep in sweeps:
        source, ports = sweep.metadata.get("source", f"the {sweep.termination} sweep"), ports_of(sweep)
        if ports and analyser.instrument not in TRANSMISSION:
            takes = ", ".join(TRANSMISSION)
            raise BadInput(f"{source}: was measured {ports}, but {analyser.name} measures no transmission between two ports; use one of {takes}")
        if analyser.ports and are_reflections([sweep]):
            raise BadInput(f"{source}: holds the reflection at one port, but the analyser is declared as {analyser.name}; leave out the fixture")


def _stated(sweep: ImpedanceSweep) -> Analyser:
    """The analyser that a sweep's metadata name.

    Raises
    ------
    BadInput
        If it is not known; a file's header may hold any text.
    """
    try:
        return find_analyser(str(sweep.metadata["analyser"]))
    except BadInput as error:
        source = sweep.metadata.get("source", f"the {sweep.termination} sweep")
        raise BadInput(f"{source}: its header names the analyser: {error}, or name the right one with --analyser") from error
