"""A model's files: in a folder, or on the Hugging Face hub by name; and a short name for exactly these weights."""

import hashlib
import re
from pathlib import Path

_SAMPLES = 64
_SAMPLE_BYTES = 65536


def find_snapshot(model: str) -> Path:
    """The folder that holds a model, downloaded or taken from the hub's cache if `model` is no folder.

    Raises ValueError.
    """
    folder = Path(model).expanduser()
    if folder.is_dir():
        return folder.resolve()
    from huggingface_hub import snapshot_download
    from huggingface_hub.errors import HfHubHTTPError, HFValidationError

    patterns = ["*.json", "*.safetensors", "*.jinja", "*.txt", "*.model"]
    try:
        return Path(snapshot_download(model, allow_patterns=patterns))
    except (OSError, HfHubHTTPError, HFValidationError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ValueError(
            f"{model!r} is no folder, and not to be had from the Hugging Face hub either ({reason}); "
            "give the path of a downloaded model"
        ) from None


def revision_of(snapshot: Path) -> str:
    """12 hex digits of the model's files.

    Small files count whole. Of large ones it reads samples from end to end, which training changes everywhere:
    to read all of a large model would take as long as loading it.
    """
    digest = hashlib.sha256()
    for path in sorted(p for p in snapshot.iterdir() if p.suffix in (".json", ".safetensors", ".jinja", ".txt")):
        size = path.stat().st_size
        digest.update(f"{path.name} {size}\0".encode())
        with path.open("rb") as file:
            if size <= _SAMPLES * _SAMPLE_BYTES:
                digest.update(file.read())
                continue
            for sample in range(_SAMPLES):
                file.seek((size - _SAMPLE_BYTES) * sample // (_SAMPLES - 1))
                digest.update(file.read(_SAMPLE_BYTES))
    return digest.hexdigest()[:12]


def model_name(model: str) -> str:
    """The last part of a model's path or name, with what a planner's name may not hold made a dash."""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", Path(model).expanduser().name)[:80] or "model"
