"""What goes wrong on benches: every fault at every step ends in one clear line or in the same data, and nothing that was read is lost."""

from __future__ import annotations

from collections import Counter

import pytest
from fault_matrix import matrix, rendered, small

from motoremi.errors import BadInput
from motoremi.virtual.faults import FAULTS, FaultLayer
from motoremi.virtual.simulated_bench import SimulatedBench

pytestmark = pytest.mark.slow

# One exchange of each instrument in each step; `make faults` goes through all of them.
PLACES = 1
KINDS = list(FAULTS)


@pytest.mark.parametrize("kinds", [KINDS[part::4] for part in range(4)], ids=lambda kinds: kinds[0])
def test_every_fault_at_every_step_ends_well(kinds: list[str]) -> None:
    table, bad = matrix(PLACES, kinds)
    assert bad == [], f"{rendered(table)}\n{bad}"
    for kind, row in table.items():
        ends = Counter(end for count in row.values() for end in count.elements())
        assert ends["error"] + ends["recovered"] + ends["marked"] > 0, f"{kind} never occurred"
        assert len(row) == 2 * len(small().instruments) + sum(step.do in ("compensate", "sweep", "spectrum") for step in small().steps)
        if kind in ("dead", "dropped-link", "silence", "garbled"):
            assert ends["error"] == ends.total(), kind
        if kind == "short-delay":
            assert ends["recovered"] == ends.total()


def test_a_restart_at_any_moment_of_the_set_up_spoils_no_data() -> None:
    """Found by `make faults`: what traces show was lost between two commands, and only the first and last exchange did not tell."""
    _, bad = matrix(0, ["restart"], {"identify"})
    assert bad == []


STATE_ROLES = ("supply", "thermometer")


@pytest.mark.parametrize("kinds", [KINDS[part::4] for part in range(4)], ids=lambda kinds: kinds[0])
def test_every_fault_of_what_feeds_and_watches_the_motor_ends_well(kinds: list[str]) -> None:
    """The motor is never left running without a word, and no wrong reading goes unmarked."""
    table, bad = matrix(1, kinds, ("supply", "wait-for", "spectrum", "leaving"), "emission_warm_motor", STATE_ROLES)
    assert bad == [], f"{rendered(table)}\n{bad}"
    ends = Counter(end for row in table.values() for count in row.values() for end in count.elements())
    assert ends["error"] > 0


@pytest.mark.parametrize("kinds", [KINDS[part::4] for part in range(4)], ids=lambda kinds: kinds[0])
def test_every_fault_of_a_final_measurement_ends_well(kinds: list[str]) -> None:
    table, bad = matrix(PLACES, kinds, ("final", "leaving"), "conducted_emission")
    assert bad == [], f"{rendered(table)}\n{bad}"
    ends = Counter(end for row in table.values() for count in row.values() for end in count.elements())
    assert ends["error"] > 0


def test_an_unknown_fault_is_refused() -> None:
    bench = SimulatedBench(1)
    with pytest.raises(BadInput, match="unknown fault 'gremlin': use one of silence, dead"):
        FaultLayer(bench.devices["analyser"], "gremlin", 1)
    bench.close()
