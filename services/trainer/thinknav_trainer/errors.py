"""What a user, or the world, can do wrong. Anything else is our mistake and shows its traceback."""


class UserError(ValueError):
    """Something that the user gave cannot be used; the message says what, where, and what to do."""


class RunFailure(RuntimeError):
    """Something that was asked for rightly could not be done; the message says why."""


def file_problem(error: BaseException) -> str | None:
    """What is wrong with which file, for an error of the system that names one."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return None


def exit_status(error: Exception) -> int | None:
    """Of the command that met it: 2 for what the user gave, 1 for what failed, None for a mistake of ours."""
    # Late: a command that has got as far as their errors has imported them, and `--help` need not wait for them.
    from thinknav_models.weights import WeightsError
    from thinknav_proto import PlannerError
    from thinknav_sim.episodes import EpisodeError
    from thinknav_sim.render import RendererUnavailable
    from thinknav_sim.scene import SceneError

    if isinstance(error, UserError | WeightsError | SceneError | EpisodeError):
        return 2
    if file_problem(error):
        return 2
    return 1 if isinstance(error, RunFailure | PlannerError | RendererUnavailable) else None
