"""`thinknav ask`: show the embedded planner a picture, and read what it says and sees."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console

from thinknav_trainer.config import ConfigError


def ask(
    frame: Annotated[Path, typer.Argument(help="a picture: PNG or JPEG")],
    goal: Annotated[str, typer.Option(help="what to look for")] = "chair",
    plan: Annotated[bool, typer.Option("--plan", help="the whole way, in up to five sentences")] = False,
    temperature: Annotated[float, typer.Option(min=0, max=10, help="0: the likeliest words; more: drawn")] = 0.0,
) -> None:
    """Ask the embedded planner about one picture: the subgoal, how sure it is of each word, and what CLIP sees."""
    pixels = _read(frame)
    from thinknav_models.clip.image import ClipImageEncoder
    from thinknav_models.clip.nearest import nearest
    from thinknav_models.clip.text import shipped_text_encoder
    from thinknav_models.subgoal_vlm import Question, SubgoalVLM

    model, revision = SubgoalVLM.load()
    question = Question(pixels, goal, mode="plan" if plan else "subgoal", temperature=temperature)
    (answer,) = model.answer([question])
    console = Console(soft_wrap=True, markup=False, highlight=False)
    for sentence in answer.sentences:
        console.print(sentence)
    console.print(f"\nconfidence {answer.confidence:.2f} (subgoal-vlm@{revision}); word by word:")
    console.print(" ".join(f"{word} {chance:.2f}" for word, chance in answer.words))
    console.print("\nnearest descriptions:")
    for near in nearest(ClipImageEncoder.load(), shipped_text_encoder(), pixels):
        console.print(f"{near.similarity:6.3f}  {near.sentence}")


def _read(path: Path) -> NDArray[np.uint8]:
    """A picture (H, W, 3). Raises ConfigError."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except FileNotFoundError:
        raise ConfigError(f"there is no picture {path}") from None
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise ConfigError(f"{path} is no picture that can be read: {error}") from None
