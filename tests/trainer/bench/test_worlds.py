"""What benchmarks draw is what they say: a scan of the asked size that looks alike, and the very rays of a picture."""

import numpy as np
import pytest

from thinknav_sim.homes import generate_home
from thinknav_sim.render import Camera, EmbreeRenderer
from thinknav_sim.scene import Scene
from thinknav_trainer.bench.bare_casts import _packets, embree_cast, open3d_cast, view_rays
from thinknav_trainer.bench.worlds import scan_like, views_in


@pytest.fixture(scope="module")
def home() -> Scene:
    return generate_home(0, rooms=2)


def test_a_scan_has_the_shape_of_the_home(home: Scene) -> None:
    scan = scan_like(home, 20_000, texture_size=64)
    assert len(scan.triangles) == 20_000
    assert scan.triangle_textures is not None
    assert not scan.triangle_textures.any()
    poses, camera = views_in(home, 3), Camera(24, 24)
    with EmbreeRenderer() as renderer:
        scenes = [renderer.add_scene(home), renderer.add_scene(scan)]
        (_, depth), (rgb, scanned) = (renderer.render(np.full(3, scene), poses, camera) for scene in scenes)
    assert (np.abs(depth - scanned) < 1e-3).mean() > 0.99
    assert rgb.std() > 50


def test_views_stand_in_rooms(home: Scene) -> None:
    poses = views_in(home, 10)
    for index, (x, _, z, _) in enumerate(poses):
        x0, z0, x1, z1 = home.rooms[index % len(home.rooms)].bounds
        assert x0 < x < x1
        assert z0 < z < z1


def test_bare_casts_meet_what_the_picture_shows(home: Scene) -> None:
    poses, camera = views_in(home, 2), Camera(16, 8)
    rays = view_rays(poses, camera)
    with EmbreeRenderer() as renderer:
        _, depth = renderer.render(np.full(2, renderer.add_scene(home)), poses, camera)
        hits = renderer.cast(1, rays[..., :3].reshape(-1, 3), rays[..., 3:].reshape(-1, 3))
    same = np.isclose(hits.distance, depth.ravel(), atol=1e-4)
    assert same.mean() > 0.99
    open3d_hits = open3d_cast(home, rays)()
    np.testing.assert_allclose(open3d_hits["t_hit"].numpy().ravel()[same], depth.ravel()[same], atol=1e-3)  # type: ignore[index]
    embree_cast(home, rays)()


def test_packets_hold_blocks_of_pixels(home: Scene) -> None:
    rays = view_rays(views_in(home, 2), Camera(16, 8))
    packets = _packets(rays, 16)
    assert len(packets) == 2 * 8 * 16 // 16
    # The second packet covers rows 0 to 3 and columns 4 to 7.
    block = rays[0, :4, 4:8].reshape(16, 6)
    np.testing.assert_array_equal(packets.view(np.float32)[1, 4:7], block[:, 3:].T)
