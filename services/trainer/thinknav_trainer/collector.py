"""Collects rollouts: decide, think, step, remember. Who waits for the planner is left alone, and the others go on.

In lock-step (see `asking`) all replies are waited for, and everyone moves in every round. Knows the actor and the
thinking env; nothing of losses and files.
"""

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action
from thinknav_trainer.actor import EVERYONE, Actor, Decision, Rows
from thinknav_trainer.config import PPOConfig
from thinknav_trainer.dumps import NotFinite
from thinknav_trainer.planner import Answer
from thinknav_trainer.policy import Policy
from thinknav_trainer.reference import REFERENCE, Reference
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.thinking import EpisodeEnd, Step, ThinkingEnv
from thinknav_trainer.thoughts import Thought
from thinknav_trainer.threads import torch_threads
from thinknav_trainer.timing import Stopwatch
from thinknav_trainer.transitions import TransitionLog, Transitions
from thinknav_trainer.workers import Lone, Workers

RECENT_EPISODES = 100
SHORTEST_ROLLOUT = 0.25  # share of a rollout that a worker collects in any case, as Habitat's


class Collector:
    """Steps the envs with the policy and remembers the transitions.

    A transition belongs to the rollout in which its env was stepped: a think whose reply is outstanding when a rollout
    ends belongs to a later one, with the log-probability and the LSTM state of the time when it was decided.

    recent: the episodes that ended last. thoughts: those of the last rollout. stopwatch: where the time went.
    """

    def __init__(
        self,
        env: ThinkingEnv,
        actor: Actor,
        config: PPOConfig,
        workers: Workers = Lone(),
        stopwatch: Stopwatch | None = None,
        reference: Reference | None = None,
    ) -> None:
        self.recent: deque[EpisodeEnd] = deque(maxlen=RECENT_EPISODES)
        self.episodes_ended = 0
        self.thoughts: list[Thought] = []
        self.stopwatch = stopwatch or Stopwatch()
        self._env = env
        self._actor = actor
        self._config = config
        self._workers = workers
        self._reference = reference
        # A row for each env: what it observes, and what it decided then; that is news for those who are to decide.
        self._observations: Observations = actor.look(env.reset())
        self._to_decide = np.arange(env.num_envs)
        self._decision = actor.no_decision()

    @torch_threads(1)
    def collect(self) -> Rollout:
        """num_steps transitions for each env on average, and less than one more; an env that waits gives fewer.

        Where most other workers have finished theirs, it is cut short.
        Raises Unavailable when the planner has been gone too long, NotFinite when the simulator gives such numbers.
        """
        self.thoughts = []
        log = TransitionLog()
        while self._goes_on(len(log)):
            envs, replies = self._decide()
            rows = self._rows(envs)
            decision = self._decision.select(rows)
            with self.stopwatch("step"):
                step = self._env.step_subset(envs, decision.actions.numpy(), replies)
            self.require_finite(envs, decision, step)
            log.add(self._transitions(envs, decision, step))
            self._advance(envs, decision, step)
        self._workers.done()
        return log.rollout(self._last_values(), self._config.gamma, self._config.tau, self._config.chunk_length)

    def _goes_on(self, collected: int) -> bool:
        """Whether a rollout of so many transitions is to be longer."""
        wanted = self._config.num_steps * self._env.num_envs
        if collected >= SHORTEST_ROLLOUT * wanted and self._workers.most_are_done():
            return False
        return collected < wanted

    def require_finite(self, envs: NDArray[np.int64], decision: Decision, step: Step) -> None:
        """What the simulator gave is checked where it comes in. Raises NotFinite."""
        for name, values in {**step.observations, "reward": step.rewards}.items():
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                rows = np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(axis=1))
                evidence = {"envs": envs, "actions": decision.actions.numpy(), "env": self._env.state_dict()}
                raise NotFinite(
                    f"{name} of envs {envs[rows].tolist()}",
                    evidence | {"observations": step.observations, "rewards": step.rewards},
                )

    def _decide(self) -> tuple[NDArray[np.int64], dict[int, Answer]]:
        """Who is to decide does so, and is parked if it thinks: who can be stepped now, and the replies they got."""
        with self.stopwatch("act"):
            rows = self._rows(self._to_decide)
            observations = _take(self._observations, rows)
            decision = self._actor.decide(observations, rows)
            self._decision = self._decision.update(rows, decision)
            if self._reference is not None:
                self._reference.decide(observations, self._actor.previous[rows], rows)
            thinks = decision.actions.numpy() == Action.THINK
        with self.stopwatch("plan"):
            self._env.think(self._to_decide[thinks])
            moving = self._to_decide[~thinks]
            replies = self._env.replies(must_wait=not len(moving))
        return np.sort(np.concatenate([moving, np.fromiter(replies, np.int64)])), replies

    def _rows(self, envs: NDArray[np.int64]) -> Rows:
        """Envs, in order, as an index; that of all of them copies nothing."""
        return EVERYONE if len(envs) == self._env.num_envs else envs

    def _transitions(self, envs: NDArray[np.int64], decision: Decision, step: Step) -> Transitions:
        rows = self._rows(envs)
        observations = _take(self._observations, rows)
        if self._reference is not None:
            observations[REFERENCE] = self._reference.log_probs[torch.from_numpy(envs)].numpy()  # a copy
        return Transitions(
            envs=envs,
            observations=observations,
            hidden=self._actor.hidden[:, :, rows],
            previous_actions=self._actor.previous[rows].numpy(),
            actions=decision.actions.numpy(),
            log_probs=decision.log_probs.numpy(),
            values=decision.values.numpy(),
            rewards=step.rewards + timeout_bonus(self._actor, step, decision, self._config.gamma),
            done=step.terminated | step.truncated,
        )

    def _advance(self, envs: NDArray[np.int64], decision: Decision, step: Step) -> None:
        rows = self._rows(envs)
        with self.stopwatch("act"):
            looked = self._actor.look(step.observations, rows)
        if isinstance(rows, slice):
            self._observations = looked
        else:
            for name, values in looked.items():
                self._observations[name][rows] = values
        done = step.terminated | step.truncated
        self._actor.advance(decision, done, rows)
        if self._reference is not None:
            self._reference.advance(done, rows)
        self._to_decide = envs
        self.note(step)

    def note(self, step: Step) -> None:
        """Count the episodes that ended in a step, and keep its thoughts."""
        self.recent.extend(step.ended)
        self.episodes_ended += len(step.ended)
        self.thoughts.extend(step.thoughts)

    def restart(self, taught: Policy) -> None:
        """Begin new episodes in all envs: someone else has stepped them, and nobody is parked.

        taught: the policy from which it is not to diverge from now on.
        """
        if self._reference is not None:
            self._reference.become(taught.state_dict())
        self._observations = self._actor.look(self._env.reset())
        self._to_decide = np.arange(self._env.num_envs)
        self._actor.forget_everything()

    def _last_values(self) -> NDArray[np.float32]:
        """(N,) what every env's observation is worth; of those who have decided on it, as they held it then."""
        rows = self._rows(self._to_decide)
        values = self._decision.values.numpy().copy()
        values[rows] = self._actor.values(
            _take(self._observations, rows), self._actor.previous[rows], self._actor.hidden[:, :, rows]
        ).numpy()
        return values

    def state_dict(self) -> dict[str, Any]:
        """All that the next rollout depends on, but for the policy's weights."""
        return {
            "env": self._env.state_dict(),
            "actor": self._actor.state_dict(),
            "observations": dict(self._observations),
            "to_decide": self._to_decide,
            "decision": vars(self._decision),
            "reference": None if self._reference is None else self._reference.state_dict(),
            "recent": [vars(end) for end in self.recent],
            "episodes_ended": self.episodes_ended,
        }

    def adopt_counts(self, state: dict[str, Any]) -> None:
        """Those of a worker that is no more, by its `state_dict`; whom it had parked get no reply."""
        self.episodes_ended += state["episodes_ended"]
        self._env.adopt_counts(state["env"])

    def adopt_reference(self, state: dict[str, Any]) -> None:
        """Be held to the same policy as a worker that goes on, by its `state_dict`."""
        if self._reference is not None:
            self._reference.become(state["reference"]["policy"])

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on exactly where `state_dict` was taken."""
        self._env.load_state_dict(state["env"])
        self._actor.load_state_dict(state["actor"])
        self._observations = dict(state["observations"])
        self._to_decide = state["to_decide"]
        self._decision = Decision(**state["decision"])
        if self._reference is not None:
            self._reference.load_state_dict(state["reference"])
        self.recent = deque((EpisodeEnd(**end) for end in state["recent"]), maxlen=RECENT_EPISODES)
        self.episodes_ended = state["episodes_ended"]


def _take(observations: Mapping[str, NDArray[Any]], rows: Rows) -> Observations:
    return {name: values[rows] for name, values in observations.items()}


def timeout_bonus(actor: Actor, step: Step, decision: Decision, gamma: float) -> NDArray[np.float32]:
    """(n,) gamma x value of the final observation where an episode ran out of steps: time is no state of the task."""
    bonus = np.zeros(len(step.rewards), np.float32)
    timed_out = np.flatnonzero(step.truncated & ~step.terminated)
    if len(timed_out):
        final = [step.final_observations[int(row)] for row in timed_out]
        stacked = {name: np.stack([observation[name] for observation in final]) for name in final[0]}
        rows = torch.from_numpy(timed_out)
        bonus[timed_out] = gamma * actor.values(stacked, decision.actions[rows], decision.hidden[:, :, rows]).numpy()
    return bonus
