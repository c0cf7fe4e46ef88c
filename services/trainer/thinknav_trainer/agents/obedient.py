"""The planner-only agent: it thinks, does what it is told, and thinks again.

It shows what a planner is worth without any learning, and a policy can begin by imitating it. It knows what every
policy knows: observations and replies; nothing privileged.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.free_heading import BLOCKED_M, FreeHeading
from thinknav_trainer.thoughts import Thought

# Turns away from what blocks, where no way is free.
TURNS_AWAY = 3


@dataclass(frozen=True)
class Obedience:
    """How a planner is obeyed.

    turns, forwards: how many 10-degree turns and steps one "turn left" or "move forward" stands for.
    stop_gate: `stop` is believed from this confidence on; a planner without confidences is always believed.
    looks: how many replies in a row must say so, each from 10 degrees farther on, before the agent stops.
    """

    turns: int = 3
    forwards: int = 2
    stop_gate: float = 0.8
    looks: int = 2

    def __post_init__(self) -> None:
        if min(self.turns, self.forwards, self.looks) < 1 or not 0 <= self.stop_gate <= 1:
            raise ValueError(f"turns, forwards and looks must be at least 1 and stop_gate within 0 to 1, not {self}")


@dataclass
class _State:
    """One env's episode so far.

    free: which way it can walk. look: the way to turn for the next look at what may be the goal.
    plan: actions to take before the next thought. stops: replies in a row that said stop, and were believed.
    place: gps (2,) before the last step forward, none after anything else.
    turned: the turn that it was told since it last stepped forward, none before; and how many times.
    """

    free: FreeHeading
    look: Action = Action.TURN_LEFT
    plan: deque[Action] = field(default_factory=deque)
    stops: int = 0
    place: NDArray[np.float32] | None = None
    turned: Action | None = None
    times_turned: int = 0


class ObedientAgent:
    """Thinks and obeys, in N envs.

    A subgoal without a direction, a failed think and a `stop` that is not believed all lead forward. So does being told
    to turn back from where it has just been told to turn: the way is between, and who obeyed would swing until time
    runs out. So does having turned all around. Where its depth shows something in the way, or it bumps into what the
    camera does not see, it takes the step along the nearest heading that is free, and thinks again.
    """

    def __init__(self, num_envs: int, config: ObjectNavConfig, obedience: Obedience = Obedience()) -> None:
        self._config, self._obedience = config, obedience
        self._states = [_State(FreeHeading(config)) for _ in range(num_envs)]
        self._gps = np.zeros((num_envs, 2), np.float32)

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:
        gps, depth, compass = observations["gps"], observations["depth"], observations["compass"][:, 0].tolist()
        self._gps = gps
        for env, state in enumerate(self._states):
            state.free.see(depth[env], gps[env], compass[env])
        for thought in thoughts:
            self._obey(self._states[thought.env], thought)
        return np.array([self._next(state, gps[env]) for env, state in enumerate(self._states)], np.int64)

    def took(self, actions: NDArray[np.int64]) -> None:
        """See `Demonstrator.took`. Whoever thought in between hears something new, and forgets the plan."""
        for state, action, gps in zip(self._states, actions.tolist(), self._gps, strict=True):
            state.place = gps.copy() if action == Action.MOVE_FORWARD else None
            if action == Action.THINK:
                state.plan.clear()

    def ended(self, done: NDArray[np.bool_]) -> None:
        for env in np.flatnonzero(done):
            self._states[env] = _State(FreeHeading(self._config))

    def _obey(self, state: _State, thought: Thought) -> None:
        direction = None if thought.subgoal is None else subgoal_direction(thought.subgoal)
        sure = thought.confidence is None or thought.confidence >= self._obedience.stop_gate
        if direction == Action.STOP and sure:
            state.stops += 1
            state.plan.append(self._look_again(state) if state.stops < self._obedience.looks else Action.STOP)
            return
        if state.stops:  # what was seen is out of view now: next time, look from the other side
            state.stops = 0
            state.look = opposite(state.look)
        if direction in (Action.TURN_LEFT, Action.TURN_RIGHT) and not self._swings(state, direction):
            state.turned, state.times_turned = direction, state.times_turned + 1
            state.plan.extend([direction] * self._obedience.turns)
        else:
            if state.turned is not None and direction == opposite(state.turned):
                state.plan.extend([direction] * (self._obedience.turns // 2))
            state.turned, state.times_turned = None, 0
            state.plan.extend([Action.MOVE_FORWARD] * self._obedience.forwards)

    def _swings(self, state: _State, turn: Action) -> bool:
        """Whether a turn would undo the one before, or close a circle, without a step forward since."""
        if state.turned is None:
            return False
        return turn != state.turned or state.times_turned * self._obedience.turns * self._config.turn_angle >= 360

    def _next(self, state: _State, gps: NDArray[np.float32]) -> Action:
        if state.place is not None and float(np.linalg.norm(gps - state.place)) < BLOCKED_M:
            state.free.bump()
            state.plan = deque([Action.MOVE_FORWARD])
        action = state.plan.popleft() if state.plan else Action.THINK
        if action == Action.MOVE_FORWARD:
            action = self._around(state)
        state.place = gps.copy() if action == Action.MOVE_FORWARD else None
        return action

    def _around(self, state: _State) -> Action:
        """A step forward, or the first turn to where one is free, the rest of them and the step being planned."""
        turns = state.free.turns()
        if turns == 0:
            return Action.MOVE_FORWARD
        if turns is None:
            state.plan = deque([Action.TURN_LEFT] * (TURNS_AWAY - 1))
            return Action.TURN_LEFT
        turn = Action.TURN_LEFT if turns > 0 else Action.TURN_RIGHT
        state.plan = deque([*[turn] * (abs(turns) - 1), Action.MOVE_FORWARD])
        return turn

    def _look_again(self, state: _State) -> Action:
        """A second look is of use only from elsewhere, since errors repeat on the same frame; a third, from the other
        side."""
        return state.look if state.stops % 2 else opposite(state.look)


def opposite(turn: Action) -> Action:
    """The other turn."""
    return Action.TURN_RIGHT if turn == Action.TURN_LEFT else Action.TURN_LEFT
