"""Draws frames of MiniWorld's furnished env, for the benchmark to time. Run by the Python of `make bench-peers` alone.

For each line on stdin: takes the number of steps that the line gives, each with its RGB and depth pictures, and
answers with a line of JSON: the seconds, on the clock and of this process. Imports nothing of ours.
"""

import contextlib
import json
import os
import sys
import time

# llvmpipe draws in the calling thread.
os.environ["LP_NUM_THREADS"] = "0"

import pyglet  # type: ignore[import-not-found]

pyglet.options["headless"] = True

from miniworld.envs import RoomObjects  # type: ignore[import-not-found]  # noqa: E402


def main() -> None:
    size = int(sys.argv[1])
    with contextlib.redirect_stdout(sys.stderr):
        env = RoomObjects(obs_width=size, obs_height=size)
        env.max_episode_steps = 10**9
        env.reset(seed=0)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    taken = 0
    for line in sys.stdin:
        wall, cpu = time.perf_counter(), time.process_time()
        for _ in range(int(line)):
            taken += 1
            # Turns on the spot, with a step now and then.
            env.step(env.actions.move_forward if taken % 8 == 0 else env.actions.turn_left)
            env.render_depth()
        seconds = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
        sys.stdout.write(json.dumps(seconds) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
