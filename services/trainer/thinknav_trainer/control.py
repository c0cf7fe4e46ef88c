"""Controls that can sink the claim that thinking helps: what a policy is told is replaced, whoever the planner is.

Agents are charged as ever, and what the planner says is thrown away; where no agent would hear it, it is not asked. A
policy that does as well with such replies did not use what it was told. Knows replies by the env that they are for;
nothing of rewards and of transports.
"""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import PlannerError, SubgoalReply
from thinknav_sim.task_config import Action
from thinknav_trainer.config import ControlName
from thinknav_trainer.model_training.sentences import subgoal_sentence
from thinknav_trainer.planner import Answer

CONTROLS: tuple[ControlName, ...] = get_args(ControlName)

UNASKED = frozenset({"zeros", "constant", "random"})  # in these nobody hears anything of what the planner says
REPLIES_KEPT = frozenset({"none", "deaf"})  # the deaf are told them: a demonstrator hears, and the policy does not

NOTHING = "nothing"  # no direction word, so that it judges nothing
ALWAYS = "move forward"
DIRECTIONS = (Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)

_REMEMBERED = 2  # of two agents, one is another than whoever asks


@dataclass(frozen=True)
class _Told:
    """What is taken from a reply and given in the place of another."""

    subgoal: str
    embedding: NDArray[np.float32]
    instructions: tuple[str, ...] = ()
    confidence: float | None = None


class Control:
    """Gives each agent something else than the planner's reply.

    zeros: an embedding of zeros, no words, no plan; judges nothing. another: the reply that another agent got in the
    same round, to another frame, else the latest of another agent; zeros until there is one. constant: always "move
    forward". random: one of the four directions, in a sentence. Failures stay failures.
    """

    def __init__(
        self,
        name: ControlName,
        embed: Callable[[Sequence[str]], NDArray[np.float32]],
        goal_of: Callable[[int], str],
        seed: int = 0,
    ) -> None:
        """embed: texts to embeddings (N, D), as the planner does; may raise PlannerError. goal_of: an env's category.

        seed: what is drawn follows from it and from the request, so that a run that goes on draws as one never stopped.
        """
        self._name = name
        self._embed = embed
        self._goal_of = goal_of
        self._seed = seed
        self._latest: dict[int, _Told] = {}  # by env, the latest last

    def replace(self, answers: Mapping[int, Answer]) -> dict[int, Answer]:
        """What these envs are told in the place of their answers."""
        if self._name in REPLIES_KEPT:
            return dict(answers)
        replies = {env: answer for env, answer in sorted(answers.items()) if isinstance(answer, SubgoalReply)}
        if self._name == "another":
            told = self._another(replies)
        elif self._name == "zeros":
            told = {env: _nothing(reply) for env, reply in replies.items()}
        else:
            told = {}
            for env, reply in replies.items():
                sentence = ALWAYS if self._name == "constant" else self._any_direction(env, reply)
                try:
                    told[env] = self._sentence(sentence, reply)
                except PlannerError as error:
                    answers = {**answers, env: error.as_value()}
        return {env: _said(answer, told.get(env)) for env, answer in answers.items()}

    def _another(self, replies: Mapping[int, SubgoalReply]) -> dict[int, _Told]:
        own = {
            env: _Told(reply.subgoal, reply.embedding, reply.instructions, reply.confidence)
            for env, reply in replies.items()
        }
        envs = list(own)
        if len(envs) > 1:
            shift = int(self._rng(replies[envs[0]]).integers(1, len(envs)))
            told = {env: own[envs[(place + shift) % len(envs)]] for place, env in enumerate(envs)}
        else:
            told = {env: self._latest_of_others(env, replies[env]) for env in envs}
        for env in envs[-_REMEMBERED:]:
            self._latest.pop(env, None)
            self._latest[env] = own[env]
        self._latest = dict(list(self._latest.items())[-_REMEMBERED:])
        return told

    def _latest_of_others(self, env: int, reply: SubgoalReply) -> _Told:
        others = [told for other, told in self._latest.items() if other != env]
        return others[-1] if others else _nothing(reply)

    def _any_direction(self, env: int, reply: SubgoalReply) -> str:
        rng = self._rng(reply)
        direction = Action(int(rng.choice(DIRECTIONS)))
        return subgoal_sentence(rng, self._goal_of(env), direction, (), "room", None)

    def _sentence(self, sentence: str, reply: SubgoalReply) -> _Told:
        """Raises PlannerError."""
        return _Told(sentence, self._embed([sentence])[0], (sentence,) if reply.instructions else ())

    def _rng(self, reply: SubgoalReply) -> np.random.Generator:
        return np.random.default_rng(zlib.crc32(f"{self._seed} {reply.request_id}".encode()))

    def state_dict(self) -> dict[str, Any]:
        """What it remembers, and what it draws from."""
        return {"seed": self._seed, "latest": [{"env": env, **asdict(told)} for env, told in self._latest.items()]}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on as the one whose `state_dict` this is."""
        self._seed = state["seed"]
        self._latest = {
            row["env"]: _Told(row["subgoal"], row["embedding"], tuple(row["instructions"]), row["confidence"])
            for row in state["latest"]
        }


def _nothing(reply: SubgoalReply) -> _Told:
    return _Told(NOTHING, np.zeros_like(reply.embedding))


def _said(answer: Answer, told: _Told | None) -> Answer:
    """The answer, saying something else where something else is told."""
    if told is None or isinstance(answer, PlannerError):
        return answer
    return answer.model_copy(update=vars(told))
