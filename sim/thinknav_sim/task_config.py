"""What an ObjectNav agent can do and how the task is set: actions, sensors, reward and the rule of success.

Defaults follow Habitat's HM3D ObjectNav, with the turn of 10 degrees and the success rule of the ThinkNav paper.
Knows nothing of scenes, renderers or learners.
"""

from enum import IntEnum
from typing import Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator


class Action(IntEnum):
    """The actions, in Habitat's order; THINK is ours.

    THINK leaves the pose as it is and counts as a step. What a thought is belongs to whoever drives the agent.
    """

    STOP = 0
    MOVE_FORWARD = 1
    TURN_LEFT = 2
    TURN_RIGHT = 3
    THINK = 4


class ObjectNavConfig(BaseModel):
    """The ObjectNav task. Immutable; unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    width: int = Field(128, ge=1, le=4096, description="image width, pixels")
    height: int = Field(128, ge=1, le=4096, description="image height, pixels")
    hfov: float = Field(79.0, ge=1.0, le=170.0, description="horizontal field of view, degrees")
    camera_height: float = Field(0.88, gt=0.0, le=3.0, description="camera above the agent's feet, metres")
    agent_radius: float = Field(0.18, gt=0.0, le=1.0, description="radius of the agent's body, metres")
    agent_height: float = Field(0.88, gt=0.1, le=3.0, description="height of the agent's body, metres")
    forward_step: float = Field(0.25, ge=0.01, le=2.0, description="length of MOVE_FORWARD, metres")
    turn_angle: float = Field(10.0, gt=0.0, le=180.0, description="angle of TURN_LEFT and TURN_RIGHT, degrees")
    max_steps: int = Field(500, ge=1, description="steps before an episode is cut off")
    allow_sliding: bool = Field(False, description="slide along obstacles instead of stopping at contact")
    success: Literal["paper", "viewpoint"] = Field(
        "paper",
        description="paper: stop within success_distance of walking, facing the object in clear sight; "
        "viewpoint: stop less than 0.1 m from a point that sees the object (Habitat)",
    )
    success_distance: float = Field(
        1.0, gt=0.0, le=10.0, description="greatest walking distance to the object at success, metres"
    )
    success_reward: float = Field(2.5, ge=0.0, description="reward for success")
    slack_reward: float = Field(-1e-3, le=0.0, description="reward for every step")
    min_depth: float = Field(0.5, ge=0.0, description="depth that reads 0, metres")
    max_depth: float = Field(5.0, gt=0.0, allow_inf_nan=False, description="depth that reads 1, metres")
    think_action: bool = Field(False, description="whether THINK is in the action space")

    @model_validator(mode="after")
    def _depths_in_order(self) -> Self:
        # As pictures have them: numbers that differ less leave nothing to divide by.
        if np.float32(self.min_depth) >= np.float32(self.max_depth):
            raise ValueError(f"min_depth {self.min_depth} must be less than max_depth {self.max_depth} (as float32)")
        return self

    @property
    def num_actions(self) -> int:
        """Size of the action space: 4, or 5 with THINK."""
        return len(Action) if self.think_action else len(Action) - 1
