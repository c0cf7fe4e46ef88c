"""Networks and encoders that both sides of the wire must agree on."""

from thinknav_models.text_encoder import EmbeddingSpace, TextEncoder

__all__ = ["EmbeddingSpace", "TextEncoder"]
