"""How fast homes are drawn: Embree against Open3D, and how soon the first picture is there.

One JSON object a line: figure, value, unit, peer, peer_value, ratio (above 1 where ours is better). Values are
medians; ours and the peer's repeats take turns, so that other work on the machine slows both alike.

    python benchmarks/render_speed.py --sizes 256 128 64 --batches 8 32
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from thinknav_sim.homes import generate_home
from thinknav_sim.render import Camera, EmbreeRenderer, Open3DRenderer, Renderer
from thinknav_sim.scene import Scene

FIRST_FRAME = """
import numpy as np
from thinknav_sim.homes import generate_home
home = generate_home({seed})
import time
start = time.perf_counter()
from thinknav_sim.render import Camera, make_renderer
renderer = make_renderer({renderer!r})
scene = renderer.add_scene(home)
renderer.render(np.array([scene]), np.zeros((1, 4)), Camera())
print(time.perf_counter() - start)
"""


def poses_in(scene: Scene, count: int) -> NDArray[np.float64]:
    """Poses spread over the scene's rooms, half a metre off the walls: (count, 4)."""
    draw = np.random.default_rng(0)
    bounds = np.array([scene.rooms[index % len(scene.rooms)].bounds for index in range(count)])
    x, z = draw.uniform(bounds[:, :2] + 0.5, bounds[:, 2:] - 0.5).T
    return np.stack([x, np.full(count, scene.floors[0]), z, draw.uniform(-np.pi, np.pi, count)], axis=1)


def median_seconds(repeats: int, *actions: Callable[[], object]) -> list[float]:
    """The median time of each action, after one untimed call of each."""
    taken: list[list[float]] = [[] for _ in actions]
    for action in actions:
        action()
    for _ in range(repeats):
        for times, action in zip(taken, actions, strict=True):
            start = time.perf_counter()
            action()
            times.append(time.perf_counter() - start)
    return [statistics.median(times) for times in taken]


def picture_drawer(renderer: Renderer, home: Scene, batch: int, size: int) -> Callable[[], object]:
    scene_ids = np.full(batch, renderer.add_scene(home))
    poses, camera = poses_in(home, batch), Camera(size, size)
    return lambda: renderer.render(scene_ids, poses, camera)


def bare_caster(home: Scene, batch: int, size: int, threads: int) -> Callable[[], object]:
    """Open3D's part alone: as many rays as a batch of pictures has, ready made, and no colours."""
    import open3d

    raycasting = open3d.t.geometry.RaycastingScene(nthreads=threads)
    tensor: Any = open3d.core.Tensor
    raycasting.add_triangles(tensor(home.vertices), tensor(home.triangles.astype(np.uint32)))
    offsets = (np.arange(size) + 0.5 - size / 2) / Camera(size, size).focal_length
    rays = np.empty((batch, size, size, 6), np.float32)
    for view, (x, y, z, heading) in zip(rays, poses_in(home, batch), strict=True):
        view[..., :3] = x, y + Camera().elevation, z
        view[..., 3] = offsets * np.cos(heading) - np.sin(heading)
        view[..., 4] = -offsets[:, None]
        view[..., 5] = -offsets * np.sin(heading) - np.cos(heading)
    ready = tensor(rays)
    return lambda: raycasting.cast_rays(ready, nthreads=threads)


def frame_rates(home: Scene, size: int, batch: int, threads: int, repeats: int) -> Iterator[dict[str, Any]]:
    numba.set_num_threads(threads)
    with EmbreeRenderer() as ours, Open3DRenderer(threads=threads) as reference:
        times = median_seconds(
            repeats,
            picture_drawer(ours, home, batch, size),
            picture_drawer(reference, home, batch, size),
            bare_caster(home, batch, size, threads),
        )
    mine, *peers = [batch / seconds for seconds in times]
    for peer, theirs in zip(("Open3D RGB-D", "Open3D cast_rays alone"), peers, strict=True):
        yield {
            "figure": f"RGB-D {size}x{size}, batch {batch}, {threads} thread{'s' * (threads > 1)}",
            "value": round(mine, 1),
            "unit": "frames/s",
            "peer": peer,
            "peer_value": round(theirs, 1),
            "ratio": round(mine / theirs, 2),
        }


def first_frame_seconds(renderer: str, seed: int, cache: str) -> float:
    """Seconds from importing the renderers to a first picture, in a fresh process."""
    program = FIRST_FRAME.format(renderer=renderer, seed=seed)
    environment = os.environ | {"NUMBA_CACHE_DIR": cache}
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment
    )
    return float(result.stdout)


def first_frames(seed: int, repeats: int) -> Iterator[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as cache:
        cold = first_frame_seconds("embree", seed, cache)
        warm = statistics.median(first_frame_seconds("embree", seed, cache) for _ in range(repeats))
        peer = statistics.median(first_frame_seconds("open3d", seed, cache) for _ in range(repeats))
    for state, seconds in (("cold", cold), ("warm", warm)):
        yield {
            "figure": f"first frame 256x256 in a new process, {state} compile cache",
            "value": round(seconds, 2),
            "unit": "s",
            "peer": "Open3D",
            "peer_value": round(peer, 2),
            "ratio": round(peer / seconds, 2),
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[256, 128, 64], help="pixels each way")
    parser.add_argument("--batches", type=int, nargs="+", default=[8, 32], help="views in one call")
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--seed", type=int, default=0, help="of the home to draw")
    arguments = parser.parse_args()
    home = generate_home(arguments.seed)
    all_threads = numba.get_num_threads()
    for size in arguments.sizes:
        for batch in arguments.batches:
            for threads in sorted({1, all_threads}):
                for figure in frame_rates(home, size, batch, threads, arguments.repeats):
                    sys.stdout.write(json.dumps(figure) + "\n")
                    sys.stdout.flush()
    for figure in first_frames(arguments.seed, min(arguments.repeats, 5)):
        sys.stdout.write(json.dumps(figure) + "\n")


if __name__ == "__main__":
    main()
