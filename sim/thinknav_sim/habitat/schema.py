"""What Habitat's ObjectNav files hold, key by key (HM3D v1 and v2, MP3D v1; read by habitat-lab 0.3).

Keys that are not named here are kept as they are, so that a file that was read can be written again without loss.
Knows nothing of files on disk, nor of our own episodes.
"""

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator

from thinknav_sim.habitat.rotation import heading_of
from thinknav_sim.scene_files import scene_name_of


def _writable(text: str) -> str:
    """What JSON can spell need not be text: half of a surrogate pair can be neither shown nor written to a file."""
    text.encode()
    return text


Text = Annotated[str, AfterValidator(_writable)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Position = tuple[Number, Number, Number]
Rotation = tuple[Number, Number, Number, Number]


class _Keys(BaseModel):
    model_config = ConfigDict(extra="allow", frozen=True)

    def as_json(self) -> dict[str, Any]:
        """The keys that were given, and no others."""
        return self.model_dump(exclude_unset=True)


class AgentState(_Keys):
    """Where an agent stands: feet in metres, rotation as a quaternion [x, y, z, w]."""

    position: Position
    rotation: Rotation


class ViewPoint(_Keys):
    """A place from which a goal is seen. iou: how much of it; our own files say which share of its surface points."""

    agent_state: AgentState
    iou: Number | None = None


class HabitatGoal(_Keys):
    """One instance of a goal category."""

    position: Position
    object_id: int | str
    object_category: str
    object_name: str | None = None
    view_points: tuple[ViewPoint, ...] = ()


class HabitatEpisode(_Keys):
    """One episode. info: geodesic_distance and euclidean_distance in metres, closest_goal_object_id, and more."""

    episode_id: Text | int
    scene_id: Text
    start_position: Position
    start_rotation: Rotation
    object_category: Text
    info: dict[str, Any] | None = None

    @field_validator("start_rotation")
    @classmethod
    def _has_a_heading(cls, rotation: Rotation) -> Rotation:
        heading_of(rotation)
        return rotation

    @property
    def scene_file(self) -> str:
        """The last part of scene_id, such as "TEEsavR23oF.basis.glb"."""
        return self.scene_id.replace("\\", "/").rsplit("/", 1)[-1]

    @property
    def scene_name(self) -> str:
        """That without its ending, such as "TEEsavR23oF"; the content file of the scene has this name."""
        return scene_name_of(self.scene_file)

    @property
    def goals_key(self) -> str:
        """Where `HabitatFile.goals_by_category` has the episode's goals."""
        return f"{self.scene_file}_{self.object_category}"


class HabitatFile(_Keys):
    """One file: episodes, with the goals they look for."""

    episodes: tuple[HabitatEpisode, ...]
    goals_by_category: dict[str, tuple[HabitatGoal, ...]] = Field(default_factory=dict)
    category_to_task_category_id: dict[str, int] = Field(default_factory=dict)

    def goals_of(self, episode: HabitatEpisode) -> tuple[HabitatGoal, ...]:
        """The goals of an episode; none where the file has none."""
        return self.goals_by_category.get(episode.goals_key, ())


class HabitatDataset(BaseModel):
    """A split: the file that has its name, and the content files beside it by scene (none in a dataset of one file)."""

    model_config = ConfigDict(frozen=True)

    index: HabitatFile
    content: dict[str, HabitatFile] = Field(default_factory=dict)

    @property
    def files(self) -> tuple[HabitatFile, ...]:
        """All of them, the index first."""
        return (self.index, *self.content.values())

    @property
    def episodes(self) -> tuple[HabitatEpisode, ...]:
        """Those of all files, in their order."""
        return tuple(episode for file in self.files for episode in file.episodes)
