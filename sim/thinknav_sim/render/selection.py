"""Choosing a renderer by name, and falling back when the fast one cannot run here."""

import functools
import logging

from thinknav_sim.render.embree import EmbreeRenderer
from thinknav_sim.render.open3d_raycasting import Open3DRenderer
from thinknav_sim.render.renderer import Renderer, RendererUnavailable
from thinknav_sim.render.warp_raycasting import WarpRenderer

logger = logging.getLogger(__name__)

_RENDERERS: dict[str, type[EmbreeRenderer] | type[Open3DRenderer] | type[WarpRenderer]] = {
    "embree": EmbreeRenderer,
    "open3d": Open3DRenderer,
    "warp": WarpRenderer,
}


def make_renderer(name: str = "auto") -> Renderer:
    """The renderer called "embree", "open3d" or "warp"; "auto" is Embree, or Open3D where Embree cannot run.

    Raises ValueError for another name, RendererUnavailable when none that was asked for can run.
    """
    if name != "auto":
        try:
            renderer = _RENDERERS[name]
        except KeyError:
            raise ValueError(f"no renderer {name!r}; there are: auto, {', '.join(_RENDERERS)}") from None
        return renderer()
    try:
        return EmbreeRenderer()
    except RendererUnavailable as error:
        _warn_of_fallback(str(error))
        return Open3DRenderer()


@functools.cache
def _warn_of_fallback(reason: str) -> None:
    """Cached, so that a process with many renderers says it once."""
    logger.warning("Embree cannot be used (%s); drawing with Open3D, which is several times slower", reason)
