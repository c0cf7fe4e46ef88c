"""A small CLIP: texts and frames as unit vectors in one space. Made in our own homes; see `weights/clip.md`.

The text half needs NumPy alone. The image half is in `image` and needs torch, so that it is imported apart.
"""

from thinknav_models.clip.text import ClipTextEncoder, shipped_text_encoder

__all__ = ["ClipTextEncoder", "shipped_text_encoder"]
