"""The think action, around the simulator's vector env. The five rules of thinking live here and nowhere else:

1. At reset the thought is the text embedding of the task description ("find a chair").
2. `think` at step t leaves the pose, counts as a step, is charged, and shows the planner the frame of observation t;
   observation t+1 carries the embedding of its reply.
3. Every other observation carries zeros, and no thought outlives its episode.
4. The first action after a reply that is not think is judged against the subgoal's direction; a subgoal without one
   judges nothing, and a second think replaces the first, unjudged.
5. A planner that fails gives zeros, judges nothing, and is counted; so does a reply that is withheld (`think.dropout`).

An env that thinks is parked until its reply is there: the simulator takes its step then, and not before. Whether the
others go on meanwhile is for the caller to say. Knows nothing of networks and of learning.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import PlannerError, SubgoalReply, SubgoalRequest
from thinknav_sim.observations import Observations
from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.asking import Asking, AskNobody, AskTogether
from thinknav_trainer.config import ControlName, ThinkConfig
from thinknav_trainer.control import UNASKED, Control
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.farming import farming_measures
from thinknav_trainer.forcing import FORCED_THINK
from thinknav_trainer.obstacle_memory import ObstacleMemory
from thinknav_trainer.patience import Patience
from thinknav_trainer.planner import Answer, PlannerClient, encode_frame
from thinknav_trainer.planner.embedded import EmbeddedPlanner
from thinknav_trainer.planner.privileged import PrivilegedPlanner
from thinknav_trainer.planner_frames import PlannerFrames
from thinknav_trainer.plans import Plans
from thinknav_trainer.recent_frames import RecentFrames
from thinknav_trainer.rewards import REWARD_SCHEMES, Terms, ThinkStep
from thinknav_trainer.strategies import STRATEGIES
from thinknav_trainer.thoughts import Thought
from thinknav_trainer.trajectories import Trajectories

NOTHING_TO_JUDGE = -1


def task_description(category: str) -> str:
    """What the first thought of an episode says."""
    return f"find a {category.replace('_', ' ')}"


@dataclass(frozen=True)
class EpisodeEnd:
    """An episode that ended in this step: the task's measures and those of `farming`, and the sums of reward terms."""

    env: int
    episode_index: int
    measures: dict[str, float]
    terms: dict[str, float]


@dataclass(frozen=True)
class Step:
    """What one step of n agents gave, a row for each in the order in which they were named.

    observations: of the next step, already of the next episode where one ended.
    rewards: (n,) float32. terminated, truncated: (n,) bool.
    final_observations: row -> last observation of an episode that ended in this step.
    """

    observations: Observations
    rewards: NDArray[np.float32]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    final_observations: dict[int, Observations]
    ended: list[EpisodeEnd]
    thoughts: list[Thought]


@dataclass
class ThinkCounts:
    """How many thoughts were asked for, and what became of them; of those who are parked that is still open.

    withheld: of those that were answered, how many the policy did not get to see.
    """

    asked: int = 0
    answered: int = 0
    failed: int = 0
    withheld: int = 0


class ThinkingEnv:
    """N agents that may think. Without a planner (strategy `never`) there is neither think action nor thought.

    All in lock-step: `step`. Or apart: `think` parks envs, `replies` says whose reply has come, and `step_subset` steps
    those, along with any that do not think.
    """

    def __init__(
        self,
        env: ObjectNavVectorEnv,
        config: ThinkConfig,
        planner: PlannerClient | None,
        asking: Callable[[PlannerClient], Asking] = AskTogether,
        discount: float = 0.99,
        seed: int = 0,
        control: ControlName = "none",
        memory: ObstacleMemory | None = None,
    ) -> None:
        """asking: how; planners in our own process have ways of their own. discount: the learner's, for reward schemes
        that go by it. seed: of which replies are withheld, and of what controls draw. control: what is told in the
        place of replies (`control`); under "deaf" no observation carries any. memory: a sensor more, if any.
        """
        if (planner is None) != (config.strategy == "never"):
            raise ValueError(f"strategy {config.strategy!r} {'needs a' if planner is None else 'takes no'} planner")
        self.env = env
        self.counts = ThinkCounts()
        self.parked: set[int] = set()
        if isinstance(planner, EmbeddedPlanner):  # nothing travels
            config = config.model_copy(update={"frame_encoding": "raw"})
        self.config = config
        self._asking = None if planner is None else _asking_of(planner, env, asking, control)
        self._patience = Patience(config.patience)
        self._discount = discount
        self._scheme = REWARD_SCHEMES[config.reward]
        self.share = 1.0  # of the run that is done: what fades over a run is gone at its end, and afterwards
        self.price = config.cost  # of a think; whoever keeps a budget changes it
        self._withholding = np.random.default_rng((seed, 2))
        self._steps = np.zeros(env.num_envs, np.int64)  # of each episode so far
        self._to_judge = np.full(env.num_envs, NOTHING_TO_JUDGE)  # the action that the last subgoal called for
        self._standing = np.zeros(env.num_envs, np.int8)  # the last judgement of each episode
        self._plans = Plans(env.num_envs)
        self._planner = planner
        self._term_sums: dict[str, NDArray[np.float64]] = {}
        self._request_number = 0
        self._frames = PlannerFrames(env, config.frame_size)
        self._recent = RecentFrames(env, self._frames, config)
        self._trajectories = Trajectories(env.num_envs)
        self._memory = memory
        self._round = 0  # of looking for replies, since the run began
        self._arrived: dict[int, int] = {}  # in which round the last reply to each env was there
        self.texts: dict[str, NDArray[np.float32]] = {}  # what was embedded so far
        self._control = Control(control, self.embed, self._goal, seed)
        self._deaf = control == "deaf"
        self._descriptions = self.embed([task_description(category) for category in GOAL_CATEGORIES])

    @property
    def num_envs(self) -> int:
        return int(self.env.num_envs)

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Embeddings (N, D) of texts, each asked for once; (N, 0) without a planner. Raises PlannerError."""
        if self._planner is None:
            return np.zeros((len(texts), 0), np.float32)
        missing = [text for text in dict.fromkeys(texts) if text not in self.texts]
        if missing:
            self.texts |= zip(missing, self._planner.embed(missing), strict=True)
        return np.stack([self.texts[text] for text in texts])

    def reset(self) -> Observations:
        """Start all episodes anew."""
        observations, _ = self.env.reset()
        self._to_judge[:] = NOTHING_TO_JUDGE
        self._recent.forget(range(self.num_envs))
        self._trajectories.forget(range(self.num_envs))
        self._steps[:] = 0
        self._standing[:] = 0
        for env in range(self.num_envs):
            self._plans.forget(env)
        for sums in self._term_sums.values():
            sums[:] = 0
        if self._asking is not None:
            observations["thought"] = self._descriptions[observations["objectgoal"][:, 0]]
            self._frames.observe(np.arange(self.num_envs), observations["rgb"])
        if self._memory is not None:
            self._memory.reset(observations)
        self._show_forcing(observations, np.arange(self.num_envs))
        return observations

    def step(self, actions: NDArray[np.int64], envs: NDArray[np.int64] | None = None) -> Step:
        """Move these envs (n,), all unless given, and think where their actions (n,) say so.

        Raises Unavailable as `replies` does.
        """
        envs = np.arange(self.num_envs) if envs is None else envs
        self.think(envs[actions == Action.THINK])
        replies: dict[int, Answer] = {}
        while self.parked:
            replies |= self.replies(must_wait=True)
        return self.step_subset(envs, actions, replies)

    def think(self, envs: NDArray[np.integer[Any]]) -> None:
        """Park these envs: show the planner what they see."""
        if self._asking is None or not len(envs):
            return
        self._recent.look(envs.tolist())
        goals = [self._goal(env) for env in envs.tolist()]
        self._asking.ask(dict(zip(envs.tolist(), self._requests(envs, goals), strict=True)))
        self.parked.update(envs.tolist())
        self.counts.asked += len(envs)

    def replies(self, must_wait: bool) -> dict[int, Answer]:
        """What has come back for parked envs, which `step_subset` may step now.

        must_wait: do not come back with nothing while anyone is parked.
        Raises Unavailable when the planner has been gone too long.
        """
        if self._asking is None or not self.parked:
            return {}
        self._round += 1
        told = self._control.replace(self._asking.replies(must_wait))
        replies = {env: self._with_plan(env, reply) for env, reply in told.items()}
        self.parked.difference_update(replies)
        self._arrived |= dict.fromkeys(replies, self._round)
        answered = sum(isinstance(reply, SubgoalReply) for reply in replies.values())
        self.counts.answered += answered
        self.counts.failed += len(replies) - answered
        self._patience.observe(list(replies.values()))
        return replies

    def step_subset(
        self, envs: NDArray[np.integer[Any]], actions: NDArray[np.int64], replies: Mapping[int, Answer]
    ) -> Step:
        """Step these envs (n,) with their actions (n,); `replies` has those to the thinks among them."""
        thoughts = [Thought(env, self._goal(env), reply, self._arrived[env]) for env, reply in sorted(replies.items())]
        self._recent.look(envs.tolist())
        poses = self.env.poses[envs]
        observations, rewards, terminated, truncated, infos = self.env.step_subset(envs, actions)
        terms: Terms = dict(infos["reward_terms"])
        judged = self._judged(envs, actions, terms["progress"], terminated)
        self._trajectories.note(envs, poses, actions, judged.agreement)
        extra = self._scheme(judged, self.config)
        told = self._told(envs, actions, replies)
        for term in extra.values():
            rewards = rewards + term
        terms.update(extra)
        done = terminated | truncated
        final = {int(row): dict(infos["final_obs"][row]) for row in np.flatnonzero(done)}
        if self._asking is not None:
            self._show_thoughts(observations, final, told, done)
            self._frames.observe(envs, observations["rgb"])
        if self._memory is not None:
            self._memory.show(envs, actions, observations, final)
        ended = self._end_episodes(envs, infos, terms, done)
        self._steps[envs] = np.where(done, 0, self._steps[envs] + 1)
        self._show_forcing(observations, envs)
        return Step(observations, rewards.astype(np.float32), terminated, truncated, final, ended, thoughts)

    def _with_plan(self, env: int, reply: Answer) -> Answer:
        """The reply, its instructions embedded and kept if it has any, or the error that prevented that."""
        if not isinstance(reply, SubgoalReply) or not reply.instructions:
            return reply
        try:
            self._plans.begin(env, reply.instructions, self.embed(reply.instructions))
        except PlannerError as error:
            return error.as_value()
        return reply

    def _goal(self, env: int) -> str:
        return str(self.env.episodes[self.env.episode_indices[env]].object_category)

    def _told(
        self, envs: NDArray[np.integer[Any]], actions: NDArray[np.int64], replies: Mapping[int, Answer]
    ) -> NDArray[np.float32]:
        """What these envs see of thoughts after their actions, (n, D): see `_subgoals`, or `_instructions` of plans."""
        told = np.zeros((len(envs), self._descriptions.shape[1]), np.float32)
        if self._deaf:
            self.counts.withheld += sum(isinstance(reply, SubgoalReply) for reply in replies.values())
        elif self.config.strategy == "once":
            self._instructions(envs, actions, replies, told)
        else:
            self._subgoals(envs, replies, told)
        return told

    def _subgoals(
        self, envs: NDArray[np.integer[Any]], replies: Mapping[int, Answer], told: NDArray[np.float32]
    ) -> None:
        """Rules 2, 3 and 5: the reply to this step's think, once; zeros for those who did not think, or in vain."""
        for row, env in enumerate(envs.tolist()):
            reply = replies.get(env)
            if isinstance(reply, SubgoalReply) and not self._withholds():
                told[row] = reply.embedding
                self._note_direction(env, subgoal_direction(reply.subgoal))

    def _withholds(self) -> bool:
        """Whether the next reply is withheld."""
        withheld = bool(self.config.dropout) and self._withholding.random() < self.config.dropout
        self.counts.withheld += withheld
        return withheld

    def _instructions(
        self,
        envs: NDArray[np.integer[Any]],
        actions: NDArray[np.int64],
        replies: Mapping[int, Answer],
        told: NDArray[np.float32],
    ) -> None:
        """The same for plans: what is told is the current instruction, judged by the first action that it meets."""
        for row, env in enumerate(envs.tolist()):
            reply = replies.get(env)
            news = isinstance(reply, SubgoalReply) or self._plans.follow(env, int(actions[row]))
            instruction = self._plans.current(env)
            if instruction is not None:
                told[row] = instruction.embedding
                if news:
                    self._note_direction(env, instruction.direction)

    def _note_direction(self, env: int, direction: Action | None) -> None:
        if direction is not None:
            self._to_judge[env] = direction

    def _requests(self, envs: NDArray[np.integer[Any]], goals: Sequence[str]) -> list[SubgoalRequest]:
        poses = self.env.poses
        requests = []
        for env, frame, goal in zip(envs.tolist(), self._frames.of(envs), goals, strict=True):
            self._request_number += 1
            requests.append(
                SubgoalRequest(
                    request_id=str(self._request_number),
                    goal=goal,
                    frame=encode_frame(frame, self.config.frame_encoding),
                    mode="plan" if self.config.strategy == "once" else "subgoal",
                    recent=self._recent.before(env, poses[env]),
                    temperature=self.config.temperature,
                    deadline=self.config.deadline,
                )
            )
        return requests

    def _judge(self, envs: NDArray[np.integer[Any]], actions: NDArray[np.int64]) -> NDArray[np.int8]:
        """Rule 4: agreement of each action with the subgoal before it, which is then spent."""
        called_for = self._to_judge[envs]
        judged = (called_for != NOTHING_TO_JUDGE) & (actions != Action.THINK)
        agreement = np.where(judged, np.where(actions == called_for, 1, -1), 0).astype(np.int8)
        self._to_judge[envs] = NOTHING_TO_JUDGE
        return agreement

    def _judged(
        self,
        envs: NDArray[np.integer[Any]],
        actions: NDArray[np.int64],
        progress: NDArray[np.float32],
        terminated: NDArray[np.bool_],
    ) -> ThinkStep:
        agreement = self._judge(envs, actions)
        before = self._standing[envs]
        standing = np.where(terminated, 0, np.where(agreement != 0, agreement, before)).astype(np.int8)
        self._standing[envs] = standing
        thinks = actions == Action.THINK
        return ThinkStep(thinks, agreement, before, standing, progress, self.price, self.share, self._discount)

    def _show_thoughts(
        self,
        observations: Observations,
        final: dict[int, Observations],
        told: NDArray[np.float32],
        done: NDArray[np.bool_],
    ) -> None:
        for row, observation in final.items():
            observation["thought"] = told[row].copy()
        # A new episode begins with its own task, not with what was thought in the last one.
        told[done] = self._descriptions[observations["objectgoal"][done, 0]]
        observations["thought"] = told

    def _show_forcing(self, observations: Observations, envs: NDArray[np.integer[Any]]) -> None:
        """Where the strategy forces thinks: with which probability the next action is one."""
        if self.config.strategy in STRATEGIES and (self.config.strategy != "agent" or self.config.forced):
            strategy = STRATEGIES[self.config.strategy]
            observations[FORCED_THINK] = strategy(self._steps[envs], self.share, self.config)

    def _end_episodes(
        self, envs: NDArray[np.integer[Any]], infos: dict[str, Any], terms: Terms, done: NDArray[np.bool_]
    ) -> list[EpisodeEnd]:
        for name, values in terms.items():
            self._term_sums.setdefault(name, np.zeros(self.num_envs))[envs] += values
        ended = []
        for row in np.flatnonzero(done).tolist():
            env = int(envs[row])
            measures = {name: float(values[row]) for name, values in infos["episode"].items()}
            sums = {name: float(values[env]) for name, values in self._term_sums.items()}
            measures |= farming_measures(self._trajectories.of(env), sums)
            ended.append(EpisodeEnd(env, int(infos["episode_index"][row]), measures, sums))
        self._to_judge[envs[done]] = NOTHING_TO_JUDGE
        self._recent.forget(envs[done].tolist())
        self._trajectories.forget(envs[done].tolist())
        self._standing[envs[done]] = 0
        for env in envs[done].tolist():
            self._plans.forget(env)
        for total in self._term_sums.values():
            total[envs[done]] = 0
        return ended

    def state_dict(self) -> dict[str, Any]:
        """All that the next step depends on, the simulator's state with it. Whoever is parked will ask again."""
        return {
            "env": self.env.state_dict(),
            "steps": self._steps.copy(),
            "to_judge": self._to_judge.copy(),
            "standing": self._standing.copy(),
            "plans": self._plans.state_dict(),
            "term_sums": {name: values.copy() for name, values in self._term_sums.items()},
            "counts": asdict(self.counts) | {"asked": self.counts.asked - len(self.parked)},
            "request_number": self._request_number,
            "frames": self._recent.state_dict(),
            "trajectories": self._trajectories.state_dict(),
            "round": self._round,
            "withholding": self._withholding.bit_generator.state,
            "control": self._control.state_dict(),
            "memory": None if self._memory is None else self._memory.state_dict(),
            "parked": sorted(self.parked),
        }

    def adopt_counts(self, state: dict[str, Any]) -> None:
        """Count what another env counted, by its `state_dict`: who was parked in it has asked in vain."""
        counts, in_vain = ThinkCounts(**state["counts"]), len(state["parked"])
        self.counts.asked += counts.asked + in_vain
        self.counts.answered += counts.answered
        self.counts.failed += counts.failed + in_vain
        self.counts.withheld += counts.withheld

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on exactly where `state_dict` was taken."""
        self.env.load_state_dict(state["env"])
        self._frames.forget()
        self._steps = state["steps"].copy()
        self._to_judge = state["to_judge"].copy()
        self._standing = state["standing"].copy()
        self._plans.load_state_dict(state["plans"])
        self._term_sums = {name: values.copy() for name, values in state["term_sums"].items()}
        self.counts = ThinkCounts(**state["counts"])
        self._request_number = state["request_number"]
        self._recent.load_state_dict(state["frames"])
        # Older checkpoints lack these three: what their open episodes did until now is not known.
        self._trajectories.load_state_dict(state.get("trajectories", [()] * self.num_envs))
        self._withholding.bit_generator.state = state.get("withholding", self._withholding.bit_generator.state)
        if isinstance(control := state.get("control"), dict):  # older checkpoints lack its seed
            self._control.load_state_dict(control)
        if self._memory is not None:
            self._memory.load_state_dict(state["memory"])
        self._round = state["round"]
        self.think(np.array(state["parked"], np.int64))


def _asking_of(
    planner: PlannerClient,
    env: ObjectNavVectorEnv,
    asking: Callable[[PlannerClient], Asking],
    control: ControlName,
) -> Asking:
    """Whoever answers in our own process keeps nobody waiting for others: it is asked all at once. Whom nobody would
    hear is not asked.
    """
    if control in UNASKED:
        return AskNobody(planner.info)
    if isinstance(planner, PrivilegedPlanner):
        return planner.asking(env)
    return AskTogether(planner) if isinstance(planner, EmbeddedPlanner) else asking(planner)
