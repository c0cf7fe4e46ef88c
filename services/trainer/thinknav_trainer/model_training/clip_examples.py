"""Ten frames and the sentences that the small CLIP finds nearest to them, as pictures and a page of Markdown."""

from collections.abc import Sequence
from pathlib import Path
from random import Random

from PIL import Image

from thinknav_models.clip import ClipTextEncoder
from thinknav_models.clip.image import ClipImageEncoder
from thinknav_models.clip.nearest import nearest
from thinknav_trainer.model_training.clip_evaluate import evaluation_frames
from thinknav_trainer.model_training.clip_workflow import EVALUATION_HOMES, evaluation_plan
from thinknav_trainer.model_training.grammar import describe

EXAMPLES = 10
SENTENCES = 3


def write_examples(folder: Path, weights: Path, scans: Sequence[Path] = (), homes: int = EVALUATION_HOMES) -> Path:
    """Write the first EXAMPLES evaluation frames (not chosen) and examples.md into a folder; the page's path."""
    image_encoder, text_encoder = ClipImageEncoder.load(weights), ClipTextEncoder.load(weights)
    frames = evaluation_frames(evaluation_plan(scans, homes))
    folder.mkdir(parents=True, exist_ok=True)
    rows = ["| frame | what it shows | nearest sentences |", "|---|---|---|"]
    for number, (rgb, seen) in enumerate(zip(frames.rgb[:EXAMPLES], frames.sceneries, strict=False)):
        name = f"clip-{number}.png"
        Image.fromarray(rgb).save(folder / name, optimize=True)
        near = nearest(image_encoder, text_encoder, rgb, SENTENCES)
        sentences = "<br>".join(f"{item.similarity:.2f} {item.sentence}" for item in near)
        rows.append(f"| ![frame {number}]({name}) | {describe(seen, Random(number))} | {sentences} |")
    page = folder / "examples.md"
    page.write_text("\n".join(rows) + "\n")
    return page
