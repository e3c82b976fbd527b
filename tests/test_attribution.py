"""Who stands apart: known answers for the rule, before any engine."""

from __future__ import annotations

import numpy as np
import pytest

from analytic.mechanism.signals import Signal
from compare.judge.attribution import Apart, odd_one_out, spread, stands_apart

TORQUE, GAMMA = Signal("drive", "", "torque"), Signal("reaction", "B", "angle")
TRUTH = np.linspace(1.0, 2.0, 21)
TIGHT = np.full(21, 1e-3)
BUMP = 0.1 * np.exp(-((np.arange(21) - 7.0) ** 2))


def test_the_spread_is_the_widest_pair_of_engines() -> None:
    widest = spread(TORQUE, {"a": TRUTH, "b": TRUTH + BUMP, "c": TRUTH - 0.01}, TIGHT)
    assert widest is not None
    found, between = widest
    assert (abs(found.max), found.at, set(between)) == (pytest.approx(0.11), 7, {"b", "c"})


@pytest.mark.parametrize("party", ["analytic", "a", "b"])
def test_the_one_that_differs_stands_apart(party: str) -> None:
    parties = {"analytic": TRUTH, "a": TRUTH + 1e-4, "b": TRUTH - 1e-4}
    parties[party] = parties[party] + BUMP
    found = stands_apart(TORQUE, parties, TIGHT)
    assert found is not None
    assert found.party == party
    assert found.by == pytest.approx(0.1, abs=3e-4)


def test_nobody_stands_apart_when_all_agree_or_all_differ() -> None:
    assert stands_apart(TORQUE, {"analytic": TRUTH, "a": TRUTH + 1e-4, "b": TRUTH}, TIGHT) is None
    assert stands_apart(TORQUE, {"analytic": TRUTH, "a": TRUTH + BUMP, "b": TRUTH - BUMP}, TIGHT) is None


def test_two_parties_cannot_tell_who_is_wrong() -> None:
    assert stands_apart(TORQUE, {"analytic": TRUTH, "a": TRUTH + BUMP}, TIGHT) is None


def test_angles_are_compared_modulo_a_turn() -> None:
    assert stands_apart(GAMMA, {"analytic": TRUTH, "a": TRUTH + 2 * np.pi, "b": TRUTH}, TIGHT) is None


def test_the_odd_one_out_needs_a_clear_majority_of_signals() -> None:
    def apart(*parties: str) -> list[Apart]:
        return [Apart(p, Signal("reaction", f"J{i}", "moment"), 1.0, 10.0, 0.0) for i, p in enumerate(parties)]

    assert odd_one_out([]) is None
    assert odd_one_out(apart("a", "a")) == "a"
    assert odd_one_out(apart("a", "a", "a", "b")) == "a"
    assert odd_one_out(apart("a", "b")) is None
