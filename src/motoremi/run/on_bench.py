"""Applies a bench file to a procedure: the bench's instruments and limits."""

from __future__ import annotations

from motoremi.errors import BadInput
from motoremi.quantities import show
from motoremi.run.motor_state import refuse_missing
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure, parse_procedure
from motoremi.schema.roles import Role
from motoremi.schema.state_steps import SupplyStep


def on_bench(procedure: Procedure, bench_file: BenchFile) -> Procedure:
    """The procedure with the instruments of the bench file, which become part of its source and so of the session.

    Raises
    ------
    BadInput
        If an instrument is missing, a supply step goes beyond the bench's limits, or one instrument is given two resources.
    """
    if bench_file.instruments:
        own = {role: spec.model_dump(exclude_none=True) for role, spec in bench_file.instruments.items()}
        source = {**procedure.source, "instruments": {**procedure.source["instruments"], **own}}
        procedure = parse_procedure(source, f"{procedure.title!r} with the instruments of the bench file")
    refuse_missing(procedure)
    for planned in procedure.plan:
        if isinstance(step := planned.step, SupplyStep):
            for value, most, unit in ((step.voltage, bench_file.highest_voltage, "V"), (step.current_limit, bench_file.highest_current, "A")):
                if value is not None and most is not None and value > most:
                    raise BadInput(f"{planned}: {show(value, unit)} is more than this bench allows ({show(most, unit)})")
    for roles in shared_roles(procedure):
        overridden = {bench_file.resources.get(role) for role in roles}
        if len(overridden) > 1:
            raise BadInput(f"{' and '.join(roles)} are one instrument in the procedure: give all of them the same resource in the bench file")
    return procedure


def shared_roles(procedure: Procedure) -> list[tuple[Role, ...]]:
    """The roles of each instrument: roles with the same driver and resource belong to one instrument."""
    found: dict[tuple[str, str], list[Role]] = {}
    for role, spec in procedure.instruments.items():
        found.setdefault((spec.driver, spec.resource), []).append(role)
    return [tuple(roles) for roles in found.values()]
