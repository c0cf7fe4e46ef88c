"""How long the small CLIP takes: frames and sentences, on one core. Prints a Markdown table.

    python benchmarks/clip_speed.py

Times are processor time of the calling thread, the best of many repetitions, so that what else the machine does counts
little.
"""

import sys
import time
from collections.abc import Callable

import torch

from thinknav_models.bfloat16 import bfloat16_is_fast
from thinknav_models.clip import ClipTextEncoder
from thinknav_models.clip.image import ClipImageEncoder
from thinknav_models.clip.text import CLIP_WEIGHTS, TextNetwork
from thinknav_models.weights import load_weights

REPETITIONS = 60
BATCH = 16
SENTENCES = [
    f"turn left toward the {thing}" for thing in ("chair", "bed", "plant", "toilet", "sofa", "table", "lamp", "doorway")
]


def milliseconds(work: Callable[[], object]) -> float:
    """The best of REPETITIONS."""
    best = float("inf")
    for _ in range(REPETITIONS):
        start = time.thread_time()
        work()
        best = min(best, time.thread_time() - start)
    return 1e3 * best


def main() -> None:
    torch.set_num_threads(1)
    rows = []
    dtypes = [torch.float32, torch.bfloat16] if bfloat16_is_fast() else [torch.float32]
    for dtype in dtypes:
        encoder = ClipImageEncoder.load(dtype=dtype)
        for size, count in ((128, BATCH), (128, 1), (256, BATCH), (64, BATCH)):
            frames = torch.randint(0, 256, (count, size, size, 3), dtype=torch.uint8)
            taken = milliseconds(lambda frames=frames, encoder=encoder: encoder.encode(frames))  # type: ignore[misc]
            name = str(dtype).removeprefix("torch.")
            rows.append((f"a frame of {size} x {size}, {count} at once, {name}", taken / count))
    weights = load_weights(CLIP_WEIGHTS, "clip")
    network = TextNetwork(weights.config["text"], weights.tensors)
    rows.append(("8 new sentences", milliseconds(lambda: network.embed(SENTENCES))))
    rows.append(("1 new sentence", milliseconds(lambda: network.embed(SENTENCES[:1]))))
    text_encoder = ClipTextEncoder.load()
    rows.append(("8 sentences met before", milliseconds(lambda: text_encoder.encode(SENTENCES))))
    rows.append(("loading both halves", milliseconds(lambda: (ClipTextEncoder.load(), ClipImageEncoder.load()))))
    sys.stdout.write("| | ms |\n|---|---|\n" + "".join(f"| {name} | {taken:.3f} |\n" for name, taken in rows))


if __name__ == "__main__":
    main()
