"""Drawing what an agent sees: RGB and depth from poses in scenes."""

from thinknav_sim.render.camera import Camera
from thinknav_sim.render.embree import EmbreeRenderer
from thinknav_sim.render.open3d_raycasting import Open3DRenderer
from thinknav_sim.render.raster import RasterRenderer
from thinknav_sim.render.renderer import NOTHING_DEPTH, Hits, Renderer, RendererUnavailable
from thinknav_sim.render.selection import make_renderer
from thinknav_sim.render.threads import set_render_threads
from thinknav_sim.render.warp_raycasting import WarpRenderer

__all__ = [
    "NOTHING_DEPTH",
    "Camera",
    "EmbreeRenderer",
    "Hits",
    "Open3DRenderer",
    "RasterRenderer",
    "Renderer",
    "RendererUnavailable",
    "WarpRenderer",
    "make_renderer",
    "set_render_threads",
]
