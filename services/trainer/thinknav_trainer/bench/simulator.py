"""The simulator's figures, one function a comparison. Everything is drawn by one thread, ours and the peers'."""

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from thinknav_sim.render import Camera, Renderer, make_renderer, set_render_threads
from thinknav_sim.scene import Scene
from thinknav_trainer.bench.bare_casts import embree_cast, open3d_cast, view_rays
from thinknav_trainer.bench.figures import Figure, Timing, compared, rounded, take_turns, timed
from thinknav_trainer.bench.memory import resident_mb
from thinknav_trainer.bench.miniworld import MiniWorld
from thinknav_trainer.bench.peer import PeerMissing
from thinknav_trainer.bench.stepping import RandomWalkers
from thinknav_trainer.bench.worlds import scan_like, training_homes, views_in

SIZE = 256
_HOMES = 4
_VIEWS = 8
# Frames that each draws at its turn: enough that a cache which the other has filled counts for little.
_TURN = 64
SCAN_TRIANGLES = 500_000
_AGENTS = (8, 32, 128)
_HOME_COUNTS = (1, 8, 32)


def simulator_figures(peers: Path, repeats: int) -> Iterator[Figure]:
    """Every figure of the simulator, as soon as it is there."""
    set_render_threads(1)
    homes = training_homes(max(_HOME_COUNTS))
    # First: later on, what others have freed would be used again and go uncounted.
    yield from home_memory(homes)
    yield from against_miniworld(homes[:_HOMES], peers, repeats)
    yield from against_casts(homes[:_HOMES], repeats)
    yield from scan(homes[0], repeats)
    yield from batches(homes, repeats)
    yield from other_shares(homes[:_HOMES], repeats)


def against_miniworld(homes: list[Scene], peers: Path, repeats: int) -> Iterator[Figure]:
    """Steps of the ObjectNav env against steps of MiniWorld's furnished env, each with RGB and depth."""
    walkers = RandomWalkers(homes, _VIEWS, SIZE)
    try:
        with MiniWorld(peers, SIZE) as miniworld:
            ours, theirs = take_turns(
                repeats, lambda: walkers.time_frames(_TURN), lambda: _per_frame(miniworld.draw, _TURN)
            )
        name = "MiniWorld 2.1 RoomObjects"
        yield compared("sim.256.vs_miniworld", 1 / ours.wall, "frames/s", name, 1 / theirs.wall)
        yield compared("sim.256.cpu", 1e3 * ours.cpu, "CPU ms/frame", name, 1e3 * theirs.cpu, lower_is_better=True)
    except PeerMissing as missing:
        [ours] = take_turns(repeats, lambda: walkers.time_frames(_TURN))
        yield Figure("sim.256.vs_miniworld", rounded(1 / ours.wall), "frames/s", str(missing))
        yield Figure("sim.256.cpu", rounded(1e3 * ours.cpu), "CPU ms/frame", str(missing))
    finally:
        walkers.close()


def against_casts(homes: list[Scene], repeats: int) -> Iterator[Figure]:
    """Finished pictures against casts of the same rays alone, by Open3D and by Embree itself; all homes together."""
    camera = Camera(SIZE, SIZE)
    with closing(make_renderer()) as renderer:
        ours = [picture_drawer(renderer, home, camera) for home in homes]
        rays = [view_rays(views_in(home, _VIEWS), camera) for home in homes]
        open3d = [open3d_cast(home, ready) for home, ready in zip(homes, rays, strict=True)]
        packets = [embree_cast(home, ready) for home, ready in zip(homes, rays, strict=True)]
        mine, theirs, limit = take_turns(repeats, *(timed(_each(actions)) for actions in (ours, open3d, packets)))
    frames = _VIEWS * len(homes)
    for figure, peer, peer_time in (
        ("sim.256.vs_open3d", "Open3D, cast alone", theirs),
        ("sim.256.vs_packets", "Embree, cast alone", limit),
    ):
        yield compared(figure, frames / mine.wall, "frames/s", peer, frames / peer_time.wall)
    yield Figure("sim.256.draw_cpu", rounded(1e3 * mine.cpu / frames), "CPU ms/frame")


def scan(home: Scene, repeats: int) -> Iterator[Figure]:
    """A mesh of half a million textured triangles, and the memory to hold it ready for drawing, its texture included.

    Of the memory, the mesh itself is not counted.
    """
    mesh = scan_like(home, SCAN_TRIANGLES)
    with closing(make_renderer()) as renderer:
        _use(renderer, home)
        before = resident_mb()
        _use(renderer, mesh)
        built = resident_mb() - before
        draw = picture_drawer(renderer, mesh, Camera(SIZE, SIZE))
        [taken] = take_turns(repeats, timed(draw))
    yield Figure("sim.256.scan", rounded(_VIEWS / taken.wall), "frames/s")
    yield Figure("sim.256.scan_cpu", rounded(1e3 * taken.cpu / _VIEWS), "CPU ms/frame")
    yield Figure("sim.scan_memory", rounded(built), "MB")


def home_memory(homes: list[Scene]) -> Iterator[Figure]:
    """What a home more costs to hold ready for pictures and rays, its arrays included: all agents in it share it."""
    with closing(make_renderer()) as renderer:
        _use(renderer, homes[0])
        before = resident_mb()
        for home in homes:
            _use(renderer, home)
        built = (resident_mb() - before) / len(homes)
    arrays = sum(array.nbytes for home in homes for array in vars(home).values() if isinstance(array, np.ndarray))
    yield Figure("sim.home_memory", rounded(built + arrays / len(homes) / 1e6), "MB/home")


def batches(homes: list[Scene], repeats: int) -> Iterator[Figure]:
    """Frames a second of steps of 8, 32 and 128 agents in one call, over 1, 8 and 32 homes; the worst of 128 over 8.

    The same 128 agents take turns in batches of each size: what other agents see may cost more, or less, to draw.
    """
    rates: dict[int, list[float]] = {}
    for count in _HOME_COUNTS:
        crowd = RandomWalkers(homes[:count], max(_AGENTS), SIZE)
        times = take_turns(repeats, *(_batch_timer(crowd, batch) for batch in _AGENTS))
        crowd.close()
        rates[count] = [1 / taken.wall for taken in times]
        for batch, rate in zip(_AGENTS, rates[count], strict=True):
            yield Figure(f"sim.256.agents_{batch}_homes_{count}", rounded(rate), "frames/s")
    worst = min(rates, key=lambda count: rates[count][-1] / rates[count][0])
    peer = f"8 agents, homes: {worst}"
    yield compared("sim.256.agents_128_over_8", rates[worst][-1], "frames/s", peer, rates[worst][0])


def other_shares(homes: list[Scene], repeats: int) -> Iterator[Figure]:
    """How much of a step with 128 agents is not drawing; at 256x256, and beside it at the sizes of small presets."""
    for name, size in (("sim.other_share", SIZE), ("sim.128.other_share", 128), ("sim.64.other_share", 64)):
        walkers = RandomWalkers(homes, max(_AGENTS), size)
        walkers.walk(1)
        shares = [walkers.other_share(max(1, SIZE // size)) for _ in range(repeats)]
        walkers.close()
        yield Figure(name, rounded(float(np.median(shares))), "share of a step")


def picture_drawer(renderer: Renderer, home: Scene, camera: Camera) -> Callable[[], object]:
    """Draws a batch of views of the home."""
    scene_ids = np.full(_VIEWS, renderer.add_scene(home))
    poses = views_in(home, _VIEWS)
    return lambda: renderer.render(scene_ids, poses, camera)


def _use(renderer: Renderer, home: Scene) -> None:
    """Draw a picture in the home and cast a ray: what drawing and casting need is built by the first."""
    scene_id = renderer.add_scene(home)
    renderer.render(np.array([scene_id]), views_in(home, 1), Camera(SIZE, SIZE))
    renderer.cast(scene_id, np.ones((1, 3), np.float32), np.array([[0, -1, 0]], np.float32))


def _each(actions: list[Callable[[], object]]) -> Callable[[], None]:
    def run() -> None:
        for action in actions:
            action()

    return run


def _batch_timer(crowd: RandomWalkers, batch: int) -> Callable[[], Timing]:
    return lambda: crowd.time_frames(crowd.agents, batch)


def _per_frame(draw: Callable[[int], Timing], frames: int) -> Timing:
    taken = draw(frames)
    return Timing(taken.wall / frames, taken.cpu / frames)
