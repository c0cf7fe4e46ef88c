"""Frontier exploration (Yamauchi, 1997): go to the nearest rim of what is known; go to the goal once it is detected.

The map is the agent's own, from depth, gps and compass. Only the detector is privileged.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.navigation.descent import turns_towards_goal
from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.agents.detector import CategoryDetector
from thinknav_trainer.agents.ways import Floor, Way
from thinknav_trainer.free_heading import BLOCKED_M
from thinknav_trainer.occupancy import CELL_M, HALF_M, OccupancyMap, ahead_of, map_pose
from thinknav_trainer.thoughts import Thought

# Steps that a way is followed before it is planned anew.
PLAN_STEPS = 6
# So near its end a way has been walked.
ARRIVED_M = 0.12
# What stays unknown within this of where it was looked at stays so; where the goal is not seen, it is not from so near.
LOOKED_M, REJECTED_M = 0.6, 0.3
# Where to stop before what is seen of the goal: as near as the first if one can stand there, else the second.
STOP_M = (0.7, 0.95)
FACING_RAD = math.radians(15.0)


@dataclass
class _State:
    """One env's episode so far; the masks are (rows, cols) of the map.

    spin: turns that are left of the first look around. goal: where the goal was detected. looked: rims that led no
    farther. rejected: standing there, the goal is not in sight after all. way: the last one planned, none when there
    is nowhere to go. fresh: steps that it is followed before the next is planned. walked: where the last step forward
    began, none after anything else.
    """

    map: OccupancyMap
    spin: int
    goal: NDArray[np.bool_]
    looked: NDArray[np.bool_]
    rejected: NDArray[np.bool_]
    way: Way | None = None
    fresh: int = 0
    walked: NDArray[np.float64] | None = None


class FrontierAgent:
    """Explores in N envs, told by a perfect detector what of its goal is in view."""

    def __init__(self, env: ObjectNavVectorEnv) -> None:
        self._config = env.config
        self._detector = CategoryDetector(env)
        self._turn = math.radians(env.config.turn_angle)
        self._states = [self._new() for _ in range(env.num_envs)]

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:  # noqa: ARG002
        depth, gps, compass = observations["depth"], observations["gps"], observations["compass"][:, 0]
        detected = self._detector.detect(depth)
        return np.array(
            [
                self._action(state, depth[env], map_pose(gps[env], float(compass[env])), detected[env])
                for env, state in enumerate(self._states)
            ],
            np.int64,
        )

    def ended(self, done: NDArray[np.bool_]) -> None:
        for env in np.flatnonzero(done):
            self._states[env] = self._new()

    def _new(self) -> _State:
        known = OccupancyMap(self._config)
        goal, looked, rejected = (np.zeros(known.state.shape, np.bool_) for _ in range(3))
        return _State(known, round(2 * math.pi / self._turn) - 1, goal, looked, rejected)

    def _action(
        self, state: _State, depth: NDArray[np.float32], pose: NDArray[np.float64], detected: NDArray[np.float64]
    ) -> Action:
        config = self._config
        self._perceive(state, depth, pose, detected)
        apart = np.hypot(*detected.T)
        bearings = np.arctan2(*detected.T)
        if (np.abs(bearings[apart <= STOP_M[0]]) <= FACING_RAD).any():
            return Action.STOP
        if state.spin and not state.goal.any():
            state.spin -= 1
            return Action.TURN_LEFT
        if state.fresh == 0:
            self._plan(state, pose)
        state.fresh -= 1
        if state.way is None:
            state.fresh = 0
            return Action.TURN_LEFT
        if state.way.to_goal and state.way.left(pose) <= ARRIVED_M:
            turn = self._turn_to_goal(state, pose)
            if turn is not None:
                return turn
            if len(detected):
                return Action.STOP
            state.rejected[state.map.near(pose, REJECTED_M)] = True
            self._plan(state, pose)
            if state.way is None:
                return Action.TURN_LEFT
        turns = turns_towards_goal(
            state.way.table, 0, state.way.metres, pose, config.forward_step, self._turn, config.allow_sliding
        )
        if turns:
            return Action.TURN_LEFT if turns > 0 else Action.TURN_RIGHT
        state.walked = pose
        return Action.MOVE_FORWARD

    def _perceive(
        self, state: _State, depth: NDArray[np.float32], pose: NDArray[np.float64], detected: NDArray[np.float64]
    ) -> None:
        if state.walked is not None and np.linalg.norm(pose - state.walked) < BLOCKED_M:
            state.map.bump(pose)
            state.fresh = 0
        state.walked = None
        state.map.stand(pose)
        state.map.look(depth, pose)
        if len(detected):
            if not state.goal.any():
                state.fresh = 0
            state.goal[state.map.cells(ahead_of(pose, detected[:, 0], detected[:, 1]))] = True

    def _plan(self, state: _State, pose: NDArray[np.float64]) -> None:
        """The way to the goal, if it was seen, or else to the nearest rim; through narrow places only if it must."""
        state.fresh = PLAN_STEPS
        state.way = None
        for clearance in (self._config.agent_radius + CELL_M / 2, self._config.agent_radius - CELL_M / 2):
            floor = Floor(state.map, pose, clearance)
            for reach in STOP_M:
                targets = floor.before(state.goal, reach) & ~state.rejected[floor.part]
                if targets.any():
                    state.way = floor.way(targets, to_goal=True)
                    return
            state.way = self._way_to_rim(state, floor, pose)
            if state.way is not None:
                return

    def _way_to_rim(self, state: _State, floor: Floor, pose: NDArray[np.float64]) -> Way | None:
        for _ in range(2):
            targets = floor.rims(state.looked)
            if not targets.any():
                return None
            way = floor.way(targets, to_goal=False)
            if way.left(pose) > ARRIVED_M:
                return way
            state.looked[state.map.near(pose, LOOKED_M)] = True  # it stands there, and knows no more
        return None

    def _turn_to_goal(self, state: _State, pose: NDArray[np.float64]) -> Action | None:
        """The turn that is needed to face what is nearest of the goal, none if the agent faces it."""
        rows, cols = np.nonzero(state.goal)
        x = (cols + 0.5) * CELL_M - HALF_M - pose[0]
        z = (rows + 0.5) * CELL_M - HALF_M - pose[2]
        nearest = int(np.hypot(x, z).argmin())
        bearing = math.remainder(math.atan2(-x[nearest], -z[nearest]) - pose[3], 2 * math.pi)
        if abs(bearing) <= FACING_RAD:
            return None
        return Action.TURN_LEFT if bearing > 0 else Action.TURN_RIGHT
