"""The search over sets of effects on boards whose scores are known, the belief that follows, and the race on real sweeps."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from covariances import complex_normal
from few_effects import seeking
from paper_circuit import DAMPED, impedance

import motoremi as me
from motoremi.blind.departures import HardCase
from motoremi.diagnosis import decision, motor_board
from motoremi.diagnosis.belief import FAMILY_SHARE, FAMILY_TOGETHER, LEAST_DOUBT, believe
from motoremi.diagnosis.candidates import candidate
from motoremi.diagnosis.explore import Budget, Key, best_of, explore, key_of
from motoremi.fitting.race import Raced, Round, Rounds, Trail, race
from motoremi.fitting.trail import trail_to
from motoremi.investigation.rivals import BEHIND

BUDGET = Budget()


@dataclass(frozen=True)
class Made:
    """A model of a made-up board."""

    added: Key
    score: float
    done: bool = False


@dataclass
class MadeBoard:
    """Sets of effects with known scores; all others have `otherwise`, less one for each effect.

    A first look may not find an effect beside others (`overlooked`): only from a rival's solution, in its place, does it.
    """

    scores: Mapping[frozenset[str], float]
    names: str = "abcdef"
    finished: frozenset[frozenset[str]] = frozenset()
    overlooked: frozenset[frozenset[str]] = frozenset()
    otherwise: float = -100.0
    much_is_left: bool = False
    calls: list[str] = field(default_factory=list)

    def model(self, added: Iterable[str], first_look: bool = False) -> Made:
        key = tuple(added)
        members = frozenset(key)
        score = self.otherwise if first_look and members in self.overlooked else self.scores.get(members, self.otherwise)
        return Made(key, score - (len(key) if members not in self.scores else 0), members in self.finished)

    def sets(self, size: int, found: Mapping[Key, Made], progress: object) -> list[Made]:
        self.calls.append(f"sets of {size}")
        assert all(len(key) < size for key in found)
        return [self.model(names, first_look=True) for names in combinations(self.names, size)]

    def swapped(self, model: Made, effect: str, only: str = "") -> list[Made]:
        self.calls.append(f"swap {effect} of {''.join(model.added)}" + (f" for {only}" if only else ""))
        rest = tuple(name for name in model.added if name != effect)
        return [self.model((*rest, name)) for name in only or self.names if name not in model.added]

    def dropped(self, model: Made, effect: str) -> Made:
        self.calls.append(f"drop {effect} of {''.join(model.added)}")
        return self.model(name for name in model.added if name != effect)

    def beside(self, model: Made) -> list[Made]:
        self.calls.append(f"beside {''.join(model.added)}")
        return [self.model((*model.added, name)) for name in self.names if name not in model.added]

    def explored(self, budget: Budget = BUDGET) -> dict[Key, Made]:
        return explore(self, self.model(()), budget)


def board(scores: Mapping[str, float], finished: tuple[str, ...] = (), overlooked: tuple[str, ...] = ()) -> MadeBoard:
    return MadeBoard(
        {frozenset(names): score for names, score in scores.items()},
        finished=frozenset(frozenset(names) for names in finished),
        overlooked=frozenset(frozenset(names) for names in overlooked),
    )


def test_a_pair_is_found_though_neither_effect_does_anything_alone():
    made = board({"": 0, "a": 50, "b": 40, "de": 200, "ab": 60}, finished=("de",))
    found = made.explored()
    assert key_of(best_of(found.values())) == ("d", "e")
    assert found[("d",)].score < 0 > found[("e",)].score
    assert [call for call in made.calls if call.startswith("sets")] == ["sets of 1", "sets of 2"]


@pytest.mark.parametrize("much_is_left", [True, False])
def test_pairs_are_tried_though_no_effect_gains_anything_if_the_base_errs_by_far(much_is_left):
    made = dataclasses.replace(board({"": 0, "a": -5, "de": 200}, finished=("de",)), much_is_left=much_is_left)
    found = made.explored()
    assert key_of(best_of(found.values())) == (("d", "e") if much_is_left else ())
    assert [call for call in made.calls if call.startswith("sets")] == ["sets of 1", "sets of 2"][: 1 + much_is_left]
    assert not [call for call in made.calls if call.startswith("swap a")]


@pytest.mark.parametrize("further", [True, False])
def test_larger_sets_are_compared_only_if_they_are_asked_for(further):
    made, asked = board({"": 0, "a": 50, "ab": 200}, finished=("ab",)), []
    found = explore(made, made.model(()), BUDGET, further=lambda best: asked.append(best.added) or further)
    assert asked == [("a",)]
    assert key_of(best_of(found.values())) == (("a", "b") if further else ("a",))


@pytest.mark.parametrize(("best_is_ordinary", "done"), [(False, True), (True, True), (False, False)])
def test_sets_with_unusual_values_are_searched_anew_where_only_unusual_values_describe_everything(best_is_ordinary, done):
    """A choke behind a capacitor in a wrong minimum: with new start values of its own effect it is ahead, with usual values."""

    def one(added: Key, score: float, ordinary: bool) -> SimpleNamespace:
        return SimpleNamespace(added=added, score=score, ordinary=ordinary, done=done)

    calls = []

    class Anew:
        def swapped(self, model: SimpleNamespace, effect: str, only: str) -> list[SimpleNamespace]:
            calls.append((model.added, effect, only))
            return [one(model.added, 103.0, True)] if effect == "choke" else [one(model.added, model.score - 500, False)]

    right, far, usual = ("capacitor", "choke"), ("choke", "leak"), ("coupling", "leak")
    found = of_sets([one((), 0.0, True), one(("cable", "coupling"), 100.0, best_is_ordinary), one(right, 65.0, False), one(far, 20.0, False)])
    found[usual] = one(usual, 90.0, True)
    anew = decision.searched_anew(Anew(), found)
    searched = not best_is_ordinary and done
    assert {added for added, *_ in calls} == ({("cable", "coupling"), right} if searched else set())
    assert all(effect == only for _, effect, only in calls)
    assert best_of(anew.values()).added == (right if searched else ("cable", "coupling"))
    assert (anew[right].score, anew[far].score, anew[usual].score) == (103.0 if searched else 65.0, 20.0, 90.0)


def of_sets(models: Iterable[SimpleNamespace]) -> dict[Key, SimpleNamespace]:
    return {key_of(one): one for one in models}


def test_larger_sets_are_not_asked_for_if_one_effect_describes_everything():
    made = board({"": 0, "a": 50}, finished=("a",))
    explore(made, made.model(()), BUDGET, further=lambda best: pytest.fail("asked"))


@pytest.mark.parametrize("alone", [60, 8], ids=["was overlooked", "is no better than another"])
def test_beside_a_smaller_set_that_only_dropping_found_further_effects_are_compared(alone):
    """Alone, "a" is overlooked, and so is its pair with "b": a swap does not lead to either."""

    class WithoutSwaps(MadeBoard):
        def swapped(self, model: Made, effect: str, only: str = "") -> list[Made]:
            return []

    made = board({"": 0, "c": 10, "a": alone, "ac": 70, "ab": 200}, finished=("ab",), overlooked=("a", "ab"))
    found = WithoutSwaps(made.scores, finished=made.finished, overlooked=made.overlooked, calls=made.calls).explored()
    assert [call for call in made.calls if call.startswith("beside")] == (["beside a"] if alone > 10 else [])
    assert key_of(best_of(found.values())) == (("a", "b") if alone > 10 else ("a", "c"))


def test_where_a_further_effect_gains_nothing_none_is_swapped():
    made = board({"": 0, "a": 50, "b": 20, "ab": 52})
    made.explored()
    assert [call for call in made.calls if call.startswith("swap")] == ["swap a of a"]


def test_a_set_is_swapped_again_from_a_better_solution_of_its_own():
    """Only from the second solution of "a" with "b" is "c" found in the place of "a"."""

    class Improving(MadeBoard):
        improved = False

        def swapped(self, model: Made, effect: str, only: str = "") -> list[Made]:
            self.calls.append(f"swap {effect} of {''.join(model.added)}")
            if set(model.added) != {"a", "b"}:
                return []
            if effect == "b" and not self.improved:
                self.improved = True
                return [Made(model.added, 60.0)]
            return [Made(("b", "c"), 90.0, True)] if effect == "a" and model.score == 60.0 else []

    scores = {frozenset(): 0.0, frozenset("a"): 10.0, frozenset("ab"): 30.0}
    found = Improving(scores).explored(BUDGET)
    assert best_of(found.values()).added == ("b", "c")


def test_a_look_alike_that_was_overlooked_is_swapped_in():
    made = board({"": 0, "a": 50, "b": 70}, finished=("b",), overlooked=("b",))
    found = made.explored()
    assert found[("b",)].score == 70
    assert best_of(found.values()).added == ("b",)
    assert "swap a of a" in made.calls
    # In a pair, either effect.
    pair = board({"": 0, "a": 30, "b": 20, "ab": 60, "cb": 90}, finished=("cb",), overlooked=("cb",))
    assert key_of(best_of(pair.explored().values())) == ("b", "c")
    assert "swap a of ab" in pair.calls


def test_if_both_effects_of_a_pair_have_a_look_alike_the_pair_of_these_is_found_too():
    """One swap leads from "ab" to "cb" and to "ad", and from these two to "cd", which alone is true."""
    # What is further behind takes no part in an investigation.
    assert BUDGET.loss == BEHIND
    made = board({"": 0, "a": 30, "ab": 100, "cb": 99, "ad": 98, "cd": 97, "ef": 20}, finished=("ab",), overlooked=("cb", "ad", "cd"))
    found = made.explored()
    assert found[("c", "d")].score == 97
    assert [call for call in made.calls if " for " in call] == ["swap a of ad for c"]
    # Where that is not to be expected to be a rival of the best, it is not fitted.
    far = board({"": 0, "a": 30, "ab": 100, "cb": 93, "ad": 92, "cd": 85}, finished=("ab",), overlooked=("cb", "ad", "cd"))
    assert far.explored()[("c", "d")].score < 0


def test_beside_one_that_leaves_nothing_only_its_own_look_alikes_are_tried():
    made = board({"": 0, "a": 50, "b": 40}, finished=("a",))
    made.explored()
    assert [call for call in made.calls if call.startswith("swap")] == ["swap a of a"]


def test_what_is_no_longer_needed_is_dropped():
    # "b" alone is nothing at a first look, but from the pair's solution.
    made = board({"": 0, "a": 30, "ab": 80, "b": 85}, finished=("b", "ab"), overlooked=("b",))
    found = made.explored(Budget(swaps=(0, 0)))
    assert best_of(found.values()).added == ("b",)
    assert {"drop a of ab", "drop b of ab"} <= set(made.calls)


def test_the_better_of_two_solutions_of_one_set_is_kept():
    made = board({"": 0, "a": 50, "b": 49, "ab": 90}, finished=("ab",))
    found = made.explored()
    assert len(found) == len({key_of(model) for model in found.values()})
    assert all(key == key_of(model) for key, model in found.items())
    assert found[("a", "b")].score == 90


@pytest.mark.parametrize(
    ("scores", "finished", "sizes"),
    [
        ({"": 0, "a": 50, "ab": 90}, ("a",), 1),  # nothing is left
        ({"": 0, "a": 2.9, "ab": 90}, (), 1),  # odds of less than 20 to 1
        ({"": 0, "a": 10, "ab": 20, "abc": 40}, ("ab",), 2),  # nothing is left of two
        ({"": 0, "a": 10, "ab": 20, "abc": 90, "abcd": 200}, (), 3),  # as many as may be
    ],
)
def test_where_it_stops(scores, finished, sizes):
    found = board(scores, finished).explored()
    assert max(len(key) for key in found) == sizes
    assert len(best_of(found.values()).added) <= sizes


def test_a_base_that_leaves_nothing_is_still_looked_beyond():
    # An effect may yet be likelier: nothing is left of a weak one.
    made = board({"": 0, "a": 5}, finished=("", "a"))
    assert best_of(made.explored().values()).added == ("a",)


# What is believed


def models(**scores: float) -> dict[Key, Made]:
    return {tuple(name.replace("none", "")): Made(tuple(name.replace("none", "")), score) for name, score in scores.items()}


@pytest.mark.parametrize("odds", [2.0, 18.0, 20.0, 1e3])
def test_nothing_is_named_unless_the_odds_are_twenty_to_one(odds):
    belief = believe(models(none=0.0, a=float(np.log(odds))))
    assert belief.named == (("a",) if odds > 19.5 else ())
    assert belief.posterior[()] == pytest.approx(1 / (1 + odds))
    assert LEAST_DOUBT == 0.05
    if not belief.named:
        assert belief.probability >= 0.5


def test_none_may_be_the_likeliest_by_far():
    belief = believe(models(none=0.0, a=-5.0, b=-6.0))
    assert belief.named == ()
    assert belief.probability == pytest.approx(1 / (1 + np.exp(-5) + np.exp(-6)))


def test_a_family_holds_97_per_cent_and_nobody_below_one():
    belief = believe(models(none=-100.0, a=0.0, b=np.log(0.3), c=np.log(0.1), d=np.log(0.011), e=np.log(0.009)))
    assert belief.named == ("a",)
    # With d it would hold more than it must, and e has less than a hundredth of the best one's.
    assert (FAMILY_TOGETHER, FAMILY_SHARE) == (0.97, 0.01)
    assert belief.families == {"a": ("b", "c")}
    assert belief.probability == pytest.approx(1.4 / 1.42)
    assert believe(models(none=-100.0, a=0.0, b=np.log(0.04), c=np.log(0.03))).families == {"a": ("b",)}
    assert believe(models(none=-100.0, a=0.0, b=np.log(0.02), c=np.log(0.011))).families == {"a": ("b",)}
    assert believe(models(none=-100.0, a=0.0, b=np.log(0.015))).families == {"a": ()}


def test_each_place_of_a_pair_has_its_own_family():
    belief = believe(models(none=-200.0, a=-100.0, ab=0.0, ac=np.log(0.2), db=np.log(0.1), dc=np.log(0.02), de=np.log(0.3)))
    assert belief.named == ("a", "b")
    assert belief.families == {"a": ("d",), "b": ("c",)}
    # One of each place agrees; two others do not.
    assert belief.probability == pytest.approx(1.32 / 1.62)


def test_supersets_agree_with_the_named_set():
    belief = believe(models(none=-100.0, a=0.0, ab=np.log(0.4), bc=np.log(0.1)))
    assert belief.named == ("a",)
    assert belief.families == {"a": ()}
    assert belief.probability == pytest.approx(1.4 / 1.5)


def test_an_effect_twice_is_not_the_effect_once():
    belief = believe({(): Made((), -100.0), ("a",): Made(("a",), -3.0), ("a", "a"): Made(("a", "a"), 0.0), ("a", "b"): Made(("a", "b"), -1.0)})
    assert belief.named == ("a", "a")
    assert belief.families["a"] == ("b",)
    assert belief.probability == pytest.approx((1 + np.exp(-1)) / (1 + np.exp(-1) + np.exp(-3)))


def test_shares_of_effects_and_none_add_up_to_one():
    belief = believe(models(none=0.0, a=1.0, ab=2.0, abc=0.5))
    assert sum(belief.inclusion.values()) + belief.posterior[()] == pytest.approx(1)
    assert belief.inclusion["a"] > belief.inclusion["b"] > belief.inclusion["c"]


# The race

EFFECTS = ("core-loss", "eddy-laminations", "lead-inductance", "insulation-leakage@Cf", "terminal-capacitance")
SHORT_RACE = Rounds((Round(24, 2, 100, 100), Round(24, 4, 4, 3)), 2, 40)


@pytest.fixture(scope="module")
def trails():
    """Some effects on top of a motor with core loss."""
    rng = np.random.default_rng(2)
    frequency = np.geomspace(150e3, 30e6, 81)
    s = 2j * np.pi * frequency
    coil = 1 / (1 / (s * DAMPED["La"]) + 1 / 3e3)
    winding = 1 / (1 / (DAMPED["Ra"] + coil) + s * DAMPED["Ca"])
    frame = impedance(DAMPED, "open", frequency) - impedance(DAMPED, "short", frequency)
    sweeps = [
        me.ImpedanceSweep(t, frequency, z * (1 + 3e-4 * complex_normal(rng, frequency.size)), 3e-4)
        for t, z in (("short", winding), ("open", winding + frame))
    ]
    base = me.fit(me.dc_motor(), sweeps, analyser="none")
    return {name: trail_to(base, name) for name in EFFECTS}


def as_plain_data(solutions):
    return {name: (dict(solution.values), solution.sizes, solution.log_evidence) for name, solution in solutions.items()}


@pytest.mark.slow
def test_a_race_is_the_same_each_time_and_in_another_process(trails):
    with ProcessPoolExecutor(1) as pool:
        together, again = (race(trails, SHORT_RACE, each=pool.map).solutions for _ in range(2))
    alone, reached = race(trails, SHORT_RACE)
    # Also of those that were left out: pairs begin from there.
    assert reached.keys() == trails.keys()
    assert as_plain_data(together) == as_plain_data(again) == as_plain_data(alone)
    assert list(together) == list(alone)
    assert len(alone) == 2
    assert next(iter(alone)) == "core-loss"
    evidence = [solution.log_evidence for solution in alone.values()]
    assert evidence == sorted(evidence, reverse=True)


@pytest.mark.slow
def test_what_is_kept_arrives_whatever_its_standing(trails):
    found = race(trails, SHORT_RACE, kept=("terminal-capacitance", "no-such-model")).solutions
    assert "terminal-capacitance" in found
    assert "core-loss" in found
    begun = []
    race({name: trails[name] for name in EFFECTS[:2]}, SHORT_RACE, progress=lambda *what: begun.append(what))
    assert {name for name, _, _ in begun} <= set(EFFECTS[:2])
    assert all(0 <= done < of == 3 for _, done, of in begun)


def test_no_models_no_race():
    assert race({}, SHORT_RACE) == ({}, {})


def test_a_further_effect_needs_odds_of_twenty_to_one():
    assert believe(models(none=-100.0, a=0.0, ab=np.log(15.0))).named == ("a",)
    assert believe(models(none=-100.0, a=0.0, ab=np.log(25.0))).named == ("a", "b")
    # What single effects have together counts against a pair.
    assert believe(models(none=-100.0, a=0.0, b=np.log(0.9), cd=np.log(25.0))).named == ("a",)


def test_where_the_leaders_of_a_race_are_less_likely_than_no_effect_the_others_are_fitted_too(monkeypatch):
    frequency = np.geomspace(150e3, 30e6, 61)
    sweeps = [me.ImpedanceSweep(name, frequency, impedance(DAMPED, name, frequency)) for name in ("short", "open")]
    base = me.fit(me.dc_motor(), sweeps)
    asked = []

    def raced(trails, *_):
        """A false valley leads on few points."""
        if not trails:
            return Raced({}, {})
        first, second, *_others = trails
        solutions = {first: SimpleNamespace(rough=False, log_evidence=0.0), second: SimpleNamespace(rough=False, log_evidence=-200.0)}
        return Raced(solutions, dict.fromkeys(trails))

    def fitted(job):
        trail, solution, before = job
        asked.append(solution.log_evidence)
        gain = -50.0 if solution.log_evidence == 0.0 else 30.0
        return dataclasses.replace(
            before, motor=trail.task.motor, marginal=dataclasses.replace(before.marginal, log_evidence=before.log_evidence + gain)
        )

    monkeypatch.setattr(motor_board, "race", raced)
    monkeypatch.setattr(motor_board, "on_all_points", fitted)
    monkeypatch.setattr(
        motor_board, "candidate", lambda fit, base: SimpleNamespace(fit=fit, done=False, leaves_nothing=False, exchanged=False, left_share=1.0)
    )
    monkeypatch.setattr(motor_board, "counted", lambda trail, **_: trail)
    monkeypatch.setattr(motor_board, "left_behind", lambda *_: {})
    board = motor_board.MotorBoard(base)
    found = board.sets(1, {(): SimpleNamespace(added=(), fit=base)}, None)
    assert asked == [0.0, -200.0]
    assert max(one.fit.log_evidence for one in found) > base.log_evidence


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, *(pytest.param(seed, marks=pytest.mark.case) for seed in (1, 2))])
def test_an_effect_beside_a_larger_difference_between_the_sweeps_is_found(seed):
    """The winding's capacitance differs by 1 to 3 % between the sweeps: near its resonance, at equal weights, that outweighs a loss elsewhere."""
    case = HardCase(1, 6, "capacitance-apart", ("dielectric-loss@Cf",), seed)
    base = me.fit(me.dc_motor(), case.sweeps())
    board = motor_board.MotorBoard(base)
    assert ("dielectric-loss@Cf",) in {one.added for one in board.sets(1, {(): board.start()}, None)}


@pytest.mark.slow
@pytest.mark.parametrize(("hidden", "all_pairs"), [(("lead-inductance",), False), (("eddy-laminations", "insulation-leakage@Cf"), True)])
def test_pairs_without_the_best_effect_are_compared_only_if_that_leaves_much(measure, monkeypatch, hidden, all_pairs):
    compared = []

    def every_pair(board: motor_board.MotorBoard, found: object, progress: object) -> dict[Key, Trail]:
        compared.append(board)
        return {}

    monkeypatch.setattr(motor_board.MotorBoard, "leading_pairs", every_pair)
    sweeps, _ = measure(2, hidden)
    with seeking():
        board = motor_board.MotorBoard(me.fit(me.dc_motor(), sweeps))
        found = {key_of(one): one for one in (board.start(), *board.sets(1, {(): board.start()}, None))}
        pairs = list(board.sets(2, found, None))
    best = max((one for key, one in found.items() if key), key=lambda one: one.score)
    assert all(best.effect in one.added for one in pairs)
    assert bool(compared) == all_pairs
    assert (best.left_share > motor_board.MOST_LEFT) == all_pairs


@pytest.mark.slow
def test_pairs_are_compared_beside_single_effects_that_are_more_probable_than_none(measure, monkeypatch):
    """Of a motor without a hidden effect every single one leaves little, and pairs beside all of them took a hundred seconds."""
    with seeking():
        board = motor_board.MotorBoard(me.fit(me.dc_motor(), measure(31)[0]))
        found = {key_of(one): one for one in (board.start(), *board.sets(1, {(): board.start()}, None))}
        compared: set[Key] = set()

        def raced(trails: Mapping[Key, Trail], *_: object) -> Raced[Key]:
            compared.update(trails)
            return Raced({}, {})

        monkeypatch.setattr(motor_board, "race", raced)
        list(board.sets(2, found, None))
    singles = sorted((one for key, one in found.items() if key), key=lambda one: -one.score)
    improbable = {one.effect for one in singles[1:] if one.score <= found[()].score}
    assert improbable
    assert compared
    assert {first for first, _ in compared}.isdisjoint(improbable)


@pytest.mark.slow
def test_of_two_lines_either_is_swapped_though_they_have_one_share_of_the_capacitance():
    """A healthy motor ended with a traceback: `winding-sections.share` was unknown once the other line was gone."""
    frequency, rng = np.geomspace(150e3, 30e6, 61), np.random.default_rng(3)
    sweeps = [
        me.ImpedanceSweep(name, frequency, impedance(DAMPED, name, frequency) * (1 + 1e-3 * complex_normal(rng, 61))) for name in ("short", "open")
    ]
    base = me.fit(me.dc_motor(), sweeps)
    lines = ("distributed-winding", "winding-sections")
    both = base.add(lines[0]).add(lines[1])
    assert "winding-sections.share" not in both.parameters
    with seeking({"lead-inductance", "winding-modes"}):
        board = motor_board.MotorBoard(base)
        for gone, kept in (lines, lines[::-1]):
            found = board.swapped(candidate(both, base), gone, "lead-inductance")
            assert {one.added for one in found} <= {(kept, "lead-inductance")}


def test_an_effect_at_places_where_it_is_the_same_circuit_is_refitted_once():
    """In the short-circuit sweep a capacitor across the terminals is one to the frame; a loss angle of other insulation is another effect."""
    evidence = {"suppressor-capacitor": 7.0, "suppressor-capacitor@frame": 7.0, "suppressor-capacitor@pair": 6.99, "core-loss": 6.98}
    evidence |= {"dielectric-loss@Ca": 5.0, "dielectric-loss@Cf": 3.0}
    solutions = {(name,): SimpleNamespace(log_evidence=value) for name, value in evidence.items()}
    kept = [key[0] for key in motor_board._unlike(solutions)]  # type: ignore[arg-type]
    assert kept == ["suppressor-capacitor", "core-loss", "dielectric-loss@Ca", "dielectric-loss@Cf"]
