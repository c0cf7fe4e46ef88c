"""Collection that never waits, against what each env does by itself: whatever the order in which replies come back."""

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from torch import Tensor

from tests.trainer.conftest import MakeThinkingEnv
from tests.trainer.test_rollout import slow_advantage
from thinknav_proto import PlannerFailed, SubgoalRequest
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.actor import EVERYONE, NO_ACTION, Actor, Decision, Rows
from thinknav_trainer.asking import AskApart, AskTogether
from thinknav_trainer.collector import Collector
from thinknav_trainer.config import PPOConfig, ThinkConfig, TrainConfig
from thinknav_trainer.planner import Answer, MockTransport, PlannerClient, reply_to
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.thinking import ThinkingEnv

CONFIG = PPOConfig(num_steps=7, chunk_length=4, gamma=0.9, tau=0.8, precision="float32")


# Env `env` does the same at its step `k`, whenever that comes.


def reward(env: int, k: int) -> float:
    return 10.0 * env + 0.1 * k


def terminates(env: int, k: int) -> bool:
    return (k + env) % 9 == 8


def times_out(env: int, k: int) -> bool:
    return (k + 2 * env) % 7 == 6 and not terminates(env, k)


def action(env: int, k: int) -> Action:
    return (Action.THINK, Action.TURN_LEFT, Action.MOVE_FORWARD)[(3 * env + 7 * k + k // 4) % 3]


def value(env: float, k: float) -> float:
    return env - 0.3 * k


class CountingEnv:
    """Envs that observe how often they were stepped, instead of a home. gps: (env, k)."""

    def __init__(self, count: int) -> None:
        self.num_envs = count
        self.steps = np.zeros(count, np.int64)
        self.episodes = [SimpleNamespace(object_category="chair")]
        self.episode_indices = np.zeros(count, np.int64)
        self.poses = np.zeros((count, 4))

    def observe(self, envs: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        return {
            "gps": np.stack([envs, self.steps[envs]], axis=1).astype(np.float32),
            "objectgoal": np.zeros((len(envs), 1), np.int64),
            "rgb": np.zeros((len(envs), 1, 1, 3), np.uint8),
        }

    def reset(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        return self.observe(np.arange(self.num_envs)), {}

    def frames(self, envs: NDArray[np.int64], width: int, height: int) -> NDArray[np.uint8]:
        return np.zeros((len(envs), height, width, 3), np.uint8)

    def step_subset(self, envs: NDArray[np.int64], actions: NDArray[np.int64]) -> tuple[Any, ...]:
        now = [(int(env), int(self.steps[env])) for env in envs]
        assert actions.tolist() == [action(*at) for at in now]
        terminated, truncated = (np.array([end(*at) for at in now]) for end in (terminates, times_out))
        self.steps[envs] += 1
        seen = self.observe(envs)
        final = np.full(len(envs), None, object)
        for row in np.flatnonzero(terminated | truncated):
            final[row] = {name: values[row] for name, values in seen.items()}
        rewards = np.array([reward(*at) for at in now], np.float32)
        infos = {
            "reward_terms": {"slack": rewards, "progress": np.zeros(len(envs), np.float32)},
            "episode": {},
            "episode_index": np.zeros(len(envs)),
            "final_obs": final,
        }
        return seen, rewards, terminated, truncated, infos


class CountingActor:
    """Decides as `action` says. Its state counts the steps of the episode; log-probabilities tell who decided when."""

    def __init__(self, count: int) -> None:
        self.previous = torch.full((count,), NO_ACTION)
        self.hidden = torch.zeros(2, 1, count, 1)

    no_decision = Actor.no_decision
    advance = Actor.advance

    def decide(self, observations: Mapping[str, NDArray[Any]], agents: Rows = EVERYONE) -> Decision:
        at = [(int(env), int(k)) for env, k in observations["gps"]]
        actions = torch.tensor([int(action(*now)) for now in at])
        log_probs = torch.tensor([-(1.0 + 100 * env + k) for env, k in at])
        return Decision(actions, log_probs, self.values(observations), self.hidden[:, :, agents] + 1)

    def look(self, observations: dict[str, NDArray[Any]], agents: Rows = EVERYONE) -> dict[str, NDArray[Any]]:
        return observations

    def values(self, observations: Mapping[str, NDArray[Any]], *_: Tensor) -> Tensor:
        return torch.tensor([value(*now) for now in observations["gps"]], dtype=torch.float32)


class DrawnAsking:
    """Replies come back in the order that `draw` chooses among those outstanding; every fifth has failed."""

    def __init__(self, draw: Callable[[list[int], bool], list[int]]) -> None:
        self._draw = draw
        self._requests: dict[int, SubgoalRequest] = {}
        self.failed = 0

    def ask(self, requests: Mapping[int, SubgoalRequest]) -> None:
        assert not self._requests.keys() & requests.keys()
        self._requests |= requests

    def replies(self, must_wait: bool) -> dict[int, Answer]:
        chosen = {env: self._requests.pop(env) for env in self._draw(sorted(self._requests), must_wait)}
        failing = {env for env, request in chosen.items() if int(request.request_id) % 5 == 0}
        self.failed += len(failing)
        return {
            env: PlannerFailed("no") if env in failing else reply_to(request, "turn left")
            for env, request in chosen.items()
        }


def collector(count: int, draw: Callable[[list[int], bool], list[int]], reward_scheme: str = "task") -> Collector:
    client = PlannerClient(MockTransport(lambda request: "turn left"))
    config = ThinkConfig.model_validate({"reward": reward_scheme, "frame_size": 16, "frame_encoding": "raw"})
    env = ThinkingEnv(cast(ObjectNavVectorEnv, CountingEnv(count)), config, client, lambda _: DrawnAsking(draw))
    return Collector(env, cast(Actor, CountingActor(count)), CONFIG)


def by_env(rollout: Rollout, count: int) -> list[list[int]]:
    """For each env the places of its transitions, in order."""
    envs = rollout.observations["gps"][:, 0].int().tolist()
    assert envs == sorted(envs)
    return [[place for place, env in enumerate(envs) if env == wanted] for wanted in range(count)]


@settings(deadline=None, max_examples=60)
@given(data=st.data(), count=st.integers(1, 5), rollouts=st.integers(1, 4))
def test_any_order_of_replies_gives_each_env_its_own_transitions(
    data: st.DataObject, count: int, rollouts: int
) -> None:
    def draw(outstanding: list[int], must_wait: bool) -> list[int]:
        if not outstanding:
            return []
        return sorted(data.draw(st.sets(st.sampled_from(outstanding), min_size=int(must_wait))))

    made = collector(count, draw)
    next_k = [0] * count
    for _ in range(rollouts):
        rollout = made.collect()
        assert 7 * count <= len(rollout) < 8 * count
        for env, places in enumerate(by_env(rollout, count)):
            ks = list(range(next_k[env], next_k[env] + len(places)))
            next_k[env] += len(places)
            check_env(rollout, env, places, ks)
        check_sequences(rollout)
    counts = made._env.counts
    assert counts.asked == counts.answered + counts.failed + len(made._env.parked)
    thinks = sum(action(env, k) == Action.THINK for env in range(count) for k in range(next_k[env]))
    assert counts.answered + counts.failed == thinks
    assert isinstance(made._env._asking, DrawnAsking)
    assert counts.failed == made._env._asking.failed


def check_env(rollout: Rollout, env: int, places: list[int], ks: list[int]) -> None:
    """The transitions of one env are those of its steps `ks`: none lost, none twice, none of another."""
    assert rollout.observations["gps"][places, 1].tolist() == ks
    assert rollout.actions[places].tolist() == [action(env, k) for k in ks]
    assert rollout.log_probs[places].tolist() == [-(1.0 + 100 * env + k) for k in ks]
    began = [k == 0 or terminates(env, k - 1) or times_out(env, k - 1) for k in ks]
    before = [NO_ACTION if new else action(env, k - 1) for k, new in zip(ks, began, strict=True)]
    assert rollout.previous_actions[places].tolist() == before
    rewards = [reward(env, k) + CONFIG.gamma * value(env, k + 1) * times_out(env, k) for k in ks]
    values = [value(env, k) for k in ks]
    done = [terminates(env, k) or times_out(env, k) for k in ks]
    last = value(env, ks[-1] + 1) if ks else 0.0
    advantages = slow_advantage(rewards, values, done, last, CONFIG.gamma, CONFIG.tau)
    assert rollout.advantages[places].numpy() == pytest.approx(np.array(advantages), abs=1e-3)
    assert rollout.returns[places].numpy() == pytest.approx(np.array(advantages) + values, abs=1e-3)


def check_sequences(rollout: Rollout) -> None:
    """Each transition lies in one sequence, of one episode; its state is that of its first step."""
    covered = []
    for column, (start, length) in enumerate(zip(rollout.sequence_starts, rollout.sequence_lengths, strict=True)):
        places = list(range(start, start + length))
        covered += places
        assert len(places) <= CONFIG.chunk_length
        assert (rollout.previous_actions[places[1:]] != NO_ACTION).all()
        env, first = (int(number) for number in rollout.observations["gps"][start])
        begun = max([k + 1 for k in range(first) if terminates(env, k) or times_out(env, k)], default=0)
        assert rollout.sequence_hidden[0, 0, column, 0] == first - begun
    assert covered == list(range(len(rollout)))


def test_an_env_whose_reply_never_comes_holds_nobody_up() -> None:
    made = collector(3, lambda outstanding, must_wait: [env for env in outstanding if env != 1])
    rollout = made.collect()
    first_think = next(k for k in range(9) if action(1, k) == Action.THINK)
    alone, stuck, other = (len(places) for places in by_env(rollout, 3))
    assert stuck == first_think
    assert alone + other == len(rollout) - first_think >= 21 - first_think
    assert made._env.parked == {1}


def test_a_reward_at_the_seam_is_paid_once() -> None:
    """A think that is outstanding when a rollout ends is charged in the rollout in which its reply comes."""
    held: list[bool] = [True]
    made = collector(2, lambda outstanding, must_wait: [e for e in outstanding if e or not held[0]], "think_cost")
    first, held[0] = made.collect(), False
    second = made.collect()
    for env in range(2):
        ks = [int(k) for rollout in (first, second) for e, k in rollout.observations["gps"] if int(e) == env]
        assert ks == list(range(len(ks)))
    thinks = [bool((rollout.actions[by_env(rollout, 2)[0]] == Action.THINK).any()) for rollout in (first, second)]
    assert thinks == [False, True]
    place = int(torch.nonzero(second.actions == Action.THINK)[0])
    k = int(second.observations["gps"][place, 1])
    # With one transition after another of the same env: return_k - gamma x (…) is the reward, charged.
    tail = CONFIG.gamma * (
        (1 - CONFIG.tau) * second.values[place + 1].item() + CONFIG.tau * second.returns[place + 1].item()
    )
    assert second.returns[place].item() - tail == pytest.approx(reward(0, k) - 0.01, abs=1e-3)


class InstantClient(PlannerClient):
    """Answers before `submit` returns: a planner without latency."""

    def submit(self, requests):  # type: ignore[no-untyped-def]
        futures = super().submit(requests)
        for future in futures:
            future.result(timeout=10)
        return futures


def test_without_latency_it_equals_lock_step_bit_for_bit(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    def made(asking: Any) -> Collector:
        env = thinking_env(lambda request: "turn left", count=3, max_steps=9, reward="paper")
        client = InstantClient(MockTransport(lambda request: "turn left"))
        env = ThinkingEnv(env.env, env.config, client, asking)
        torch.manual_seed(0)
        shape = ObservationShape(smoke.env.height, smoke.env.width, num_actions=5, thought_size=512)
        policy = Policy(shape, smoke.policy.model_copy(update={"stop_bias": -1.0, "think_bias": 0.5}))
        return Collector(env, Actor(policy, 3, "float32", seed=0), CONFIG)

    apart, together = made(AskApart), made(AskTogether)
    for _ in range(4):
        a, b = apart.collect(), together.collect()
        assert (a.actions == Action.THINK).any()
        for name, tensor in a.observations.items():
            assert torch.equal(tensor, b.observations[name]), name
        for name in ("actions", "previous_actions", "log_probs", "values", "advantages", "returns", "sequence_hidden"):
            assert torch.equal(getattr(a, name), getattr(b, name)), name
        np.testing.assert_array_equal(a.sequence_starts, b.sequence_starts)
        np.testing.assert_array_equal(a.sequence_lengths, b.sequence_lengths)
    assert list(apart.recent) == list(together.recent)
