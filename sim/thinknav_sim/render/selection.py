"""Choosing a renderer by name, and falling back when the fast one cannot run here."""

import functools
import logging

from thinknav_sim.render.embree import EmbreeRenderer
from thinknav_sim.render.open3d_raycasting import Open3DRenderer
from thinknav_sim.render.raster import RasterRenderer
from thinknav_sim.render.renderer import Renderer, RendererUnavailable
from thinknav_sim.render.warp_raycasting import WarpRenderer

logger = logging.getLogger(__name__)


def make_renderer(name: str = "auto") -> Renderer:
    """The renderer called "raster", "embree", "open3d" or "warp"; "auto" is "raster".

    Rays are cast for the rasteriser by Embree, or by Open3D where Embree cannot run.

    Raises ValueError for another name, RendererUnavailable when none that was asked for can run.
    """
    makers = {
        "auto": _rasteriser,
        "raster": _rasteriser,
        "embree": EmbreeRenderer,
        "open3d": Open3DRenderer,
        "warp": WarpRenderer,
    }
    if name not in makers:
        raise ValueError(f"no renderer {name!r}; there are: {', '.join(makers)}")
    return makers[name]()


def _rasteriser() -> Renderer:
    return RasterRenderer(_caster())


def _caster() -> Renderer:
    try:
        return EmbreeRenderer()
    except RendererUnavailable as error:
        _warn_of_fallback(str(error))
        return Open3DRenderer()


@functools.cache
def _warn_of_fallback(reason: str) -> None:
    """Cached, so that a process with many renderers says it once."""
    logger.warning("Embree cannot be used (%s); casting rays with Open3D, which is several times slower", reason)
