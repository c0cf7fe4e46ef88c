# mypy: disable-error-code="valid-type, misc, attr-defined, arg-type, no-any-return"
"""Warp's kernels: one thread a pixel or a ray. Imported by `warp_raycasting` alone, once Warp is there."""

import warp as wp

# How far a ray is turned aside to look again, radians.
_ASIDE = wp.constant(1.0e-5)


@wp.struct
class Surface:
    """A scene on the device: its mesh, and what its triangles look like.

    colors: (3 T) corner colours, 0 to 255. triangle_textures: (T,), row of sizes or -1. corner_uv: (3 T) places on the
    texture. sizes: (K, 3) first texel, height, width. texels: (3 * all,).
    """

    mesh: wp.uint64
    colors: wp.array(dtype=wp.vec3)
    triangle_textures: wp.array(dtype=wp.int32)
    corner_uv: wp.array(dtype=wp.vec2)
    sizes: wp.array2d(dtype=wp.int64)
    texels: wp.array(dtype=wp.uint8)


@wp.func
def texel_index(place: wp.float32, size: wp.int64) -> wp.int64:
    """The texel along one side of a repeating texture."""
    return wp.min(wp.int64((place - wp.floor(place)) * wp.float32(size)), size - wp.int64(1))


@wp.func
def texel_color(surface: Surface, texture: wp.int32, face: wp.int32, weights: wp.vec3) -> wp.vec3:
    """The nearest texel, 0 to 255."""
    first = 3 * face
    place = (
        weights[0] * surface.corner_uv[first]
        + weights[1] * surface.corner_uv[first + 1]
        + weights[2] * surface.corner_uv[first + 2]
    )
    height, width = surface.sizes[texture, 1], surface.sizes[texture, 2]
    texel = surface.sizes[texture, 0] + texel_index(place[1], height) * width + texel_index(place[0], width)
    start = texel * wp.int64(3)
    return wp.vec3(
        wp.float32(surface.texels[start]),
        wp.float32(surface.texels[start + wp.int64(1)]),
        wp.float32(surface.texels[start + wp.int64(2)]),
    )


@wp.func
def vertex_color(surface: Surface, face: wp.int32, weights: wp.vec3) -> wp.vec3:
    """The corners' colours between them, 0 to 255 and half a level more, so that cutting off the fraction rounds."""
    first = 3 * face
    color = (
        weights[0] * surface.colors[first]
        + weights[1] * surface.colors[first + 1]
        + weights[2] * surface.colors[first + 2]
    )
    return wp.vec3(
        wp.clamp(color[0] + 0.5, 0.0, 255.0),
        wp.clamp(color[1] + 0.5, 0.0, 255.0),
        wp.clamp(color[2] + 0.5, 0.0, 255.0),
    )


@wp.kernel
def draw_views(
    scenes: wp.array(dtype=Surface),
    scene_of: wp.array(dtype=wp.int32),
    poses: wp.array(dtype=wp.vec4),
    pixel: wp.float32,
    elevation: wp.float32,
    far: wp.float32,
    low: wp.float32,
    high: wp.float32,
    span: wp.float32,
    rgb: wp.array4d(dtype=wp.uint8),
    depth: wp.array4d(dtype=wp.float32),
) -> None:
    """Draw N views: scene_of (N,), poses (N,); rgb (N, H, W, 3) and depth (N, H, W, 1) are written.

    low, high, span: see `Camera.depth_scale`.
    """
    view, y, x = wp.tid()
    surface = scenes[scene_of[view]]
    pose = poses[view]
    right = (wp.float32(x) + 0.5 - wp.float32(rgb.shape[2]) / 2.0) * pixel
    up = (wp.float32(rgb.shape[1]) / 2.0 - wp.float32(y) - 0.5) * pixel
    sine, cosine = wp.sin(pose[3]), wp.cos(pose[3])
    way = wp.vec3(right * cosine - sine, up, -right * sine - cosine)
    length = wp.length(way)
    hit = wp.mesh_query_ray(surface.mesh, wp.vec3(pose[0], pose[1] + elevation, pose[2]), way / length, far)
    if not hit.result:
        depth[view, y, x, 0] = (wp.clamp(0.0, low, high) - low) / span
        for channel in range(3):
            rgb[view, y, x, channel] = wp.uint8(0)
        return
    # Forward has length 1 in `way`: the distance in units of it is the depth.
    depth[view, y, x, 0] = (wp.clamp(hit.t / length, low, high) - low) / span
    # Warp's u and v weigh the first and second corner.
    weights = wp.vec3(hit.u, hit.v, 1.0 - hit.u - hit.v)
    texture = surface.triangle_textures[hit.face]
    color = wp.vec3(0.0, 0.0, 0.0)
    if texture >= 0:
        color = texel_color(surface, texture, hit.face, weights)
    else:
        color = vertex_color(surface, hit.face, weights)
    for channel in range(3):
        rgb[view, y, x, channel] = wp.uint8(wp.int32(color[channel]))


@wp.kernel
def cast_rays(
    mesh: wp.uint64,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    distance: wp.array(dtype=wp.float32),
    triangle: wp.array(dtype=wp.int32),
) -> None:
    """First hits of R rays; distance is in units of the direction."""
    ray = wp.tid()
    length = wp.length(directions[ray])
    way = directions[ray] / length
    hit = wp.mesh_query_ray(mesh, origins[ray], way, wp.inf)
    if not hit.result:
        # A ray at the very edge that two triangles share may slip between them; beside it none does.
        hit = wp.mesh_query_ray(
            mesh, origins[ray], wp.normalize(way + _ASIDE * wp.vec3(way[1], way[2], way[0])), wp.inf
        )
    distance[ray] = wp.inf
    triangle[ray] = -1
    if hit.result:
        distance[ray] = hit.t / length
        triangle[ray] = hit.face
