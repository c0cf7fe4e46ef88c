"""Why the paper's bonus is farmed and a potential is not: the arithmetic of loops, and the optimum of a small task."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_trainer.config import PPOConfig, ThinkConfig
from thinknav_trainer.loop_worth import AGREE, AGREE_AGAIN, AGREE_AND_UNDO, THINK, UNDO, LoopStep, worth_of_repeating
from thinknav_trainer.rewards import REWARD_SCHEMES, ThinkStep

CONFIG = ThinkConfig()
SUCCESS = ObjectNavConfig().success_reward
STEP = LoopStep(agreed=True, progress=0.25)
# Told to go forward, it does; then it turns round, walks back and turns round again.
WALK_AND_BACK = (THINK, STEP, *[UNDO] * 18, LoopStep(progress=-0.25), *[UNDO] * 18)


def test_the_defaults_are_those_of_the_arithmetic() -> None:
    assert (PPOConfig().gamma, ObjectNavConfig().slack_reward, SUCCESS) == (0.99, -0.001, 2.5)
    assert (CONFIG.cost, CONFIG.agreement_bonus) == (0.01, 0.1)


def test_the_papers_bonus_pays_more_for_a_loop_than_for_success() -> None:
    """As docs/thinking.md has it, by hand: what one round pays, over 1 - 0.99 to the length of it."""
    undo = (-0.011 + 0.99 * 0.099 - 0.99**2 * 0.001) / (1 - 0.99**3)
    again = (-0.011 + 0.99 * 0.099) / (1 - 0.99**2)
    assert worth_of_repeating(AGREE_AND_UNDO, "paper", CONFIG) == pytest.approx(undo, abs=1e-5)
    assert worth_of_repeating(AGREE_AGAIN, "paper", CONFIG) == pytest.approx(again, abs=1e-5)
    assert (round(undo, 2), round(again, 2)) == (2.9, 4.37)
    assert undo > SUCCESS


@pytest.mark.parametrize(
    ("scheme", "undo", "again", "walk"),
    [
        ("task", -0.10, -0.10, 0.03),
        ("think_cost", -0.44, -0.60, 0.00),
        ("paper", 2.90, 4.37, 0.31),
        ("annealed", -0.44, -0.60, 0.00),  # at the end of a run
        ("capped", -0.10, -0.11, 0.03),
        ("progress_gated", -0.44, -0.60, 0.31),
        ("potential", -0.44, -0.60, 0.00),
    ],
)
def test_every_scheme_as_the_docs_have_it(scheme: str, undo: float, again: float, walk: float) -> None:
    worth = [worth_of_repeating(loop, scheme, CONFIG) for loop in (AGREE_AND_UNDO, AGREE_AGAIN, WALK_AND_BACK)]
    assert worth == pytest.approx([undo, again, walk], abs=0.0051)


def test_the_annealed_bonus_can_be_farmed_while_it_lasts() -> None:
    worth = [worth_of_repeating(AGREE_AND_UNDO, "annealed", CONFIG, share=share) for share in (0, 0.1, 0.3, 0.6)]
    assert worth == sorted(worth, reverse=True)
    assert worth[0] == pytest.approx(2.897, abs=1e-3)
    assert worth[1] < SUCCESS


loops = st.lists(st.sampled_from([THINK, AGREE, UNDO, STEP]), min_size=1, max_size=6)


@settings(deadline=None, max_examples=15)
@given(loops)
def test_a_potential_adds_nothing_to_any_loop(loop: list[LoopStep]) -> None:
    plain = worth_of_repeating(loop, "think_cost", CONFIG, discount=0.9, steps=300)
    assert worth_of_repeating(loop, "potential", CONFIG, discount=0.9, steps=300) == pytest.approx(plain, abs=1e-5)


@settings(deadline=None, max_examples=15)
@given(loops, st.floats(0, 0.2), st.floats(0, 1))
def test_a_capped_bonus_never_pays_for_thinking(loop: list[LoopStep], cost: float, bonus: float) -> None:
    """A think and what it agrees with follow one another, so that none earns more than it cost."""
    loop = [each for step in loop for each in ((THINK, AGREE) if step == AGREE else (UNDO,))]
    config = ThinkConfig(cost=cost, agreement_bonus=bonus)
    assert worth_of_repeating(loop, "capped", config, discount=0.9, slack=0.0, steps=300) <= 1e-6


# A corridor: the goal lies `distance` steps ahead, the agent faces it or the wall, and the planner is always right.


@dataclass(frozen=True)
class State:
    distance: int
    aside: bool
    told: Action | None
    standing: int


START = State(6, aside=False, told=None, standing=0)
STATES = [
    State(*at)
    for at in product(range(7), (False, True), (None, Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT), (-1, 0, 1))
]
ACTIONS = (Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.THINK)


def planned(state: State) -> Action:
    if state.aside:
        return Action.TURN_LEFT
    return Action.MOVE_FORWARD if state.distance else Action.STOP


def step(state: State, action: Action, scheme: str) -> tuple[float, State | None]:
    """What an action pays, and where it leads; nowhere, if it is the last."""
    walks = action == Action.MOVE_FORWARD and not state.aside and state.distance > 0
    agreement = 0
    if state.told is not None and action != Action.THINK:
        agreement = 1 if action == state.told else -1
    standing = 0 if action == Action.STOP else agreement or state.standing
    terms = REWARD_SCHEMES[scheme](
        ThinkStep(
            thought=np.array([action == Action.THINK]),
            agreement=np.array([agreement], np.int8),
            standing_before=np.array([state.standing], np.int8),
            standing=np.array([standing], np.int8),
            progress=np.array([0.25 * walks], np.float32),
            price=CONFIG.cost,
            share=1.0 if scheme == "annealed" else 0.0,
            discount=0.99,
        ),
        CONFIG,
    )
    paid = -0.001 + 0.25 * walks + sum(float(term[0]) for term in terms.values())
    if action == Action.STOP:
        return paid + SUCCESS * (state.distance == 0 and not state.aside), None
    aside = state.aside != (action == Action.TURN_LEFT)
    told = planned(state) if action == Action.THINK else None
    return paid, State(state.distance - walks, aside, told, standing)


def optimum(scheme: str) -> tuple[dict[State, float], dict[State, Action]]:
    """Values and best actions, by value iteration."""
    index = {state: number for number, state in enumerate(STATES)}
    table = [[step(state, action, scheme) for action in ACTIONS] for state in STATES]
    pays = np.array([[paid for paid, _ in row] for row in table])
    leads = np.array([[-1 if after is None else index[after] for _, after in row] for row in table])
    values = np.zeros(len(STATES) + 1)  # the last: an episode that is over
    for _ in range(3000):
        worth = pays + 0.99 * values[leads]
        values[:-1] = worth.max(axis=1)
    best = {state: ACTIONS[int(row.argmax())] for state, row in zip(STATES, worth, strict=True)}
    return dict(zip(STATES, values[:-1].tolist(), strict=True)), best


def outcome(best: dict[State, Action]) -> Action:
    """What the best policy does at last, from the start."""
    state, action = START, Action.THINK
    for _ in range(500):
        action = best[state]
        after = step(state, action, "task")[1]
        if after is None:
            return action if state.distance == 0 and not state.aside else Action.THINK
        state = after
    return action


@pytest.mark.parametrize("scheme", REWARD_SCHEMES)
def test_only_under_the_papers_scheme_is_it_best_never_to_stop(scheme: str) -> None:
    assert (outcome(optimum(scheme)[1]) == Action.STOP) == (scheme != "paper")


def test_a_potential_leaves_the_optimum_as_it_was() -> None:
    """Every state's value moves by its own potential, and by nothing else: so no action gains on another."""
    plain, potential = optimum("think_cost")[0], optimum("potential")[0]
    for state, value in plain.items():
        assert potential[state] == pytest.approx(value - CONFIG.agreement_bonus * state.standing, abs=1e-5)
