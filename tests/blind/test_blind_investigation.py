"""The scoreboard of investigations: sealed motors, policies, and what is counted. The assessments that the policies receive are scripted here."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from motoremi.blind.investigation import BUDGET_MINUTES, play, summary
from motoremi.blind.investigation_table import markdown
from motoremi.blind.policies import EXPERT, FIXED, OWN_POLICY, POLICIES, Assessment, Offer
from motoremi.blind.scoring import Answer
from motoremi.blind.sealed import OUTSIDE, STARTS, Asked, Evidence, HandheldAnalyser, Sealed, draw_sealed, draw_sealed_many
from motoremi.data.conditions import CONDITIONS, VALUES, condition
from motoremi.errors import BadInput
from motoremi.investigation.menu import MENU
from motoremi.investigation.rivals import OUTSIDE as OUTSIDE_THE_CATALOGUE
from motoremi.simulate.hidden_effects import excluding

OFFERS = (
    Offer(Asked("dc-bias", condition("dc-bias", 1.0)), 20.0, 0.9),
    Offer(Asked("second-temperature", condition("second-temperature", 53.0)), 25.0, 1.0),
    Offer(Asked("dc-resistance", None, ()), 3.0, 0.1),
    Offer(Asked("known-capacitor", condition("known-capacitor", 1e-10)), 6.0, 0.2),
)
DECIDES = "second-temperature"


def judge(evidence: Evidence) -> Assessment:
    """The second temperature decides, and every mistake is noticed."""
    have = {sweep.condition.id for sweep in evidence.sweeps if sweep.condition is not None} | {value.name for value in evidence.values}
    truth = ("eddy-laminations",)
    decided = DECIDES in have
    answer = Answer("missing-effect", truth, () if decided else (("eddy-laminations", "skin-effect"),), 0.97 if decided else 0.6)
    return Assessment(
        {"eddy-laminations": 0.97 if decided else 0.5, "skin-effect": 0.03 if decided else 0.5},
        tuple(offer for offer in OFFERS if offer.id not in have),
        lambda: answer,
        "one-stands" if decided else "",
        tuple(sorted(have)),
        0.1,
    )


def sealed(**changes: object) -> Sealed:
    return dataclasses.replace(Sealed(1, 0, "two effects", ("eddy-laminations",), 77, mistaken=0.0), **changes)


@pytest.mark.slow
def test_each_policy_goes_its_own_way_to_the_same_end() -> None:
    runs = {one.run.policy: one for one in play(sealed(), judge)}
    assert set(runs) == set(POLICIES)
    assert all(one.settled and one.outcome == "right" for one in runs.values())
    steps = {name: one.run.steps for name, one in runs.items()}
    assert steps[OWN_POLICY] == ("dc-bias", DECIDES)
    assert steps["information alone"] == (DECIDES,)
    assert steps["clairvoyant"] == (DECIDES,)
    assert steps["cheapest first"] == ("dc-resistance", "known-capacitor", "dc-bias", DECIDES)
    assert steps["fixed order"] == ("dc-resistance", "dc-bias", DECIDES)
    assert steps["frozen expert"] == ("dc-resistance", "known-capacitor", "dc-bias", DECIDES)
    assert steps["random"][-1] == DECIDES
    assert runs["cheapest first"].run.minutes == 54.0
    assert runs[OWN_POLICY].run.seconds == (0.1,) * 3


@pytest.mark.slow
def test_no_policy_repeats_both_sweeps_for_ever() -> None:
    """Repeats stay on the menu after they were made; a policy with an order of its own goes on to the next measurement."""
    repeats = Offer(Asked("repeats"), 4.0, 0.0)
    runs = play(
        sealed(), lambda evidence: dataclasses.replace(judge(evidence), offers=(*judge(evidence).offers, repeats)), ("frozen expert", "random")
    )
    assert runs[0].run.steps == ("repeats", "dc-resistance", "known-capacitor", "dc-bias", DECIDES)
    assert runs[1].run.steps.count("repeats") <= 1
    assert all(one.settled for one in runs)


def test_what_takes_longer_than_the_time_left_is_not_waited_for_by_useless_measurements() -> None:
    """As `motoremi investigate`: if what decides takes too long, the best of the rest is requested, and nothing if that is useless."""
    long, useful, useless = (
        Offer(Asked("dried"), 245.0, 0.5),
        Offer(Asked("dc-bias", condition("dc-bias", 1.0)), 20.0, 0.2),
        Offer(Asked("repeats"), 4.0, 0.0),
    )
    answer = Answer("family", ("bearing-film",), (("bearing-film", "dielectric-relaxation@Cr"),), 0.9)

    def asked(done: bool, without: tuple[str, ...] = ()) -> Assessment:
        offers = (long, useless) if done else (long, useful, useless)
        left = tuple(offer for offer in offers if offer.id not in without)
        stop = "" if left[0].bits else "inseparable"
        return Assessment({"bearing-film": 0.9}, left, lambda: answer, stop, without=lambda names: asked(done, names))

    run = play(sealed(), lambda evidence: asked(any(sweep.condition for sweep in evidence.sweeps)), (OWN_POLICY,))[0].run
    assert (run.steps, run.stop) == (("dc-bias",), "budget")


@pytest.mark.slow
def test_what_one_policy_measured_is_judged_once() -> None:
    count = 0

    def counting(evidence: Evidence) -> Assessment:
        nonlocal count
        count += 1
        return judge(evidence)

    play(sealed(), counting, ("cheapest first", "frozen expert"))
    assert count == 5


@pytest.mark.slow
def test_repeats_of_a_handheld_analyser_have_noise_of_their_own_and_errors_in_common() -> None:
    frequency, true = np.geomspace(150e3, 30e6, 201), np.full(201, 50.0 + 0j)
    analyser = HandheldAnalyser(3, compensated=True)
    first, second = (analyser.measure("short", frequency, true) for _ in range(2))
    noise, error = np.std(first - second), np.abs(np.mean(first / true - 1))
    assert noise > 0
    assert np.abs(np.mean(second / true - 1)) == pytest.approx(error, rel=0.1)
    # The same request of an analyser that measured nothing before gives the same sweep.
    assert np.array_equal(HandheldAnalyser(3, compensated=True).measure("short", frequency, true), first)


@pytest.mark.slow
def test_what_the_catalogue_does_not_hold_is_settled_if_it_is_stated_as_inseparable() -> None:
    def relaxation(outside: float, stop: str) -> Assessment:
        probabilities = {"dielectric-relaxation@Cf": 1 - outside, OUTSIDE_THE_CATALOGUE: outside}
        return Assessment(probabilities, (), lambda: Answer("missing-effect", ("dielectric-relaxation@Cf",), (), 0.6), stop, (), 0.1)

    unknown = sealed(hidden=("outside-charge-diffusion",))
    for outside, stop, settled in ((0.4, "inseparable", True), (0.4, "one-stands", False), (0.03, "inseparable", False)):
        run = play(unknown, lambda evidence, outside=outside, stop=stop: relaxation(outside, stop), (OWN_POLICY,))[0]
        assert (run.settled, run.wrong) == (settled, not settled)
        assert not run.hit


@pytest.mark.slow
def test_a_family_counts_only_where_it_is_proven_inseparable() -> None:
    def family(stop: str) -> Assessment:
        answer = Answer("family", ("skin-effect",), (("skin-effect", "eddy-laminations"),), 0.9)
        return Assessment({"skin-effect": 0.6, "eddy-laminations": 0.4}, (), lambda: answer, stop)

    assert play(sealed(), lambda evidence: family("inseparable"), (OWN_POLICY,))[0].settled
    assert not play(sealed(), lambda evidence: family("one-stands"), (OWN_POLICY,))[0].settled


@pytest.mark.slow
def test_mistakes_are_counted_and_those_that_were_noticed() -> None:
    run = play(sealed(mistaken=1.0), judge, ("cheapest first",))[0].run
    assert run.made == run.found == ("dc-resistance", "known-capacitor", "dc-bias", DECIDES)
    blind = play(sealed(mistaken=1.0), lambda evidence: dataclasses.replace(judge(evidence), mistaken=()), ("cheapest first",))[0].run
    assert (len(blind.made), blind.found) == (4, ())
    careful = play(sealed(), judge, ("cheapest first",))[0].run
    assert (careful.made, set(careful.alarms)) == ((), set(careful.steps))


@pytest.mark.slow
def test_a_judge_that_crashes_is_the_worst_answer_and_stops_nobody_else() -> None:
    def broken(evidence: Evidence) -> Assessment:
        raise ValueError("no")

    played = play(sealed(), broken, (OWN_POLICY, "random"))
    assert [one.outcome for one in played] == ["crashed", "crashed"]
    assert summary(played)["troubles"][0]["trouble"] == "ValueError: no"


@pytest.mark.slow
def test_the_figures_are_what_was_played_and_the_tables_say_so() -> None:
    played = [one for index in range(3) for one in play(sealed(index=index, start=STARTS[index]), judge)]
    figures = summary(played)
    goals = figures["goals"]
    assert goals["named, or proven inseparable"]["value"] == 1
    assert goals["wrong"]["value"] == 0
    assert goals["median minutes, of those of cheapest first"]["value"] == pytest.approx(45 / 54)
    assert not goals["median minutes, of those of cheapest first"]["reached"]
    assert goals["median minutes, of those of clairvoyant"]["value"] == pytest.approx(45 / 25)
    assert goals["expected calibration error"]["value"] == pytest.approx(0.03)
    assert set(figures["by_start"]) == set(STARTS)
    text = markdown({"seed": 1, **figures})
    assert "| information per minute | 3 | 100 % | 0 % | 45.0 |" in text


@pytest.mark.slow
def test_the_budget_ends_a_run() -> None:
    dear = tuple(dataclasses.replace(offer, minutes=BUDGET_MINUTES + 1) for offer in OFFERS)
    run = play(sealed(), lambda evidence: dataclasses.replace(judge(evidence), offers=dear), (OWN_POLICY,))[0].run
    assert (run.steps, run.stop) == ((), "budget")


@pytest.mark.slow
def test_sealed_motors_come_from_three_starts_and_a_tenth_is_in_no_catalogue() -> None:
    cases = draw_sealed_many(3, 300)
    assert cases == draw_sealed_many(3, 300)
    assert [case.hidden for case in draw_sealed_many(4, 900) if excluding(case.hidden)] == []
    assert {start: sum(case.start == start for case in cases) for start in STARTS} == dict.fromkeys(STARTS, 100)
    outside = np.mean([case.hidden[0].startswith("outside-") for case in cases])
    # Four standard deviations of a binomial share.
    assert abs(outside - OUTSIDE) < 4 * np.sqrt(OUTSIDE * (1 - OUTSIDE) / 300)
    assert all(len(case.hidden) == 2 for case in cases if case.start == "two effects" and not case.hidden[0].startswith("outside-"))
    with pytest.raises(BadInput, match="ask for at least one"):
        draw_sealed_many(3, 0)


@pytest.mark.parametrize("index", [0, 1, 2])
def test_what_the_bench_gives_does_not_depend_on_what_was_asked_before(index: int) -> None:
    first, second = draw_sealed(5, index), draw_sealed(5, index)
    asked = Asked("known-capacitor", condition("known-capacitor", 1e-10))
    first.give(Asked("dc-resistance", None, ()))
    first.give(asked)
    one, other = first.give(asked).evidence.sweeps[0], second.give(asked).evidence.sweeps[0]
    assert np.array_equal(one.impedance_ohm, other.impedance_ohm)
    # Asked once more, the noise is another.
    assert not np.array_equal(one.impedance_ohm, first.give(asked, 1).evidence.sweeps[0].impedance_ohm)
    begin = first.begin()
    assert [sweep.termination for sweep in begin.sweeps] == {0: ["short"], 1: ["short", "open"], 2: ["short"] * 3 + ["open"] * 3}[index]


def test_a_compensated_handheld_analyser_is_better_than_it_was() -> None:
    case = dataclasses.replace(draw_sealed(5, 1), mistaken=0.0)
    truth = case.specimen.impedance("short", case.begin().sweeps[0].frequency_hz)
    before = case.begin().sweeps[0].impedance_ohm
    after = case.give(Asked("repeat-compensation", condition("repeat-compensation"))).evidence.sweeps[0].impedance_ohm
    assert np.median(np.abs(after / truth - 1)) < np.median(np.abs(before / truth - 1))


def test_the_orders_of_the_policies_name_what_is_on_the_menu_and_miss_nothing() -> None:
    menu = {option.name for option in MENU}
    known = {*CONDITIONS, *VALUES, "short-sweep", "open-sweep", "repeats"}
    for order in (EXPERT, FIXED):
        assert set(order) <= known
        assert len(set(order)) == len(order)
        assert menu <= {*order, "capacitance-1khz", "tan-delta-1khz", "lead-length"}
