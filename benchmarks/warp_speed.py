"""Frames a second of the CUDA renderer, pictures left on the GPU.

    python benchmarks/warp_speed.py [--homes 32] [--frames 20000]

One JSON object a line: figure, value, unit. Needs a CUDA GPU and the extra [gpu].
"""

import argparse
import json
import sys
import time

import numpy as np
import torch

from thinknav_sim.homes import generate_home, home_seed
from thinknav_sim.render import Camera, RendererUnavailable, WarpRenderer
from thinknav_sim.scene import Scene

AGENTS = (64, 512, 2048)
SIZES = (256, 64)


def frames_per_second(renderer: WarpRenderer, homes: list[Scene], agents: int, size: int, frames: int) -> float:
    """Agents stand about in all homes, and turn from one picture to the next."""
    ids = [renderer.add_scene(home) for home in homes]
    draw, camera = np.random.default_rng(0), Camera(size, size)
    poses = np.zeros((agents, 4))
    for agent in range(agents):
        rooms = homes[agent % len(homes)].rooms
        x0, z0, x1, z1 = rooms[draw.integers(len(rooms))].bounds
        poses[agent] = draw.uniform(x0 + 0.5, x1 - 0.5), 0.0, draw.uniform(z0 + 0.5, z1 - 0.5), draw.uniform(-3, 3)
    scene_ids = np.resize(ids, agents)
    rounds = max(3, frames // agents)
    for warm_up in (True, False):
        torch.cuda.synchronize()
        start = time.perf_counter()
        for _ in range(3 if warm_up else rounds):
            poses[:, 3] += 0.1
            renderer.draw(scene_ids, poses, camera)
        torch.cuda.synchronize()
    seconds = time.perf_counter() - start
    for scene_id in ids:
        renderer.remove_scene(scene_id)
    return rounds * agents / seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--homes", type=int, default=32)
    parser.add_argument("--frames", type=int, default=20_000, help="for each figure, about")
    arguments = parser.parse_args()
    if not torch.cuda.is_available():
        sys.exit("warp_speed: there is no CUDA GPU here, or this torch is built without CUDA")
    homes = [generate_home(home_seed("train", index)) for index in range(arguments.homes)]
    try:
        renderer = WarpRenderer("cuda:0")
    except RendererUnavailable as error:
        sys.exit(f"warp_speed: {error}")
    for size in SIZES:
        for agents in AGENTS:
            speed = frames_per_second(renderer, homes, agents, size, arguments.frames)
            figure = {"figure": f"warp.{size}.agents_{agents}", "value": round(speed), "unit": "frames/s"}
            sys.stdout.write(json.dumps(figure) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
