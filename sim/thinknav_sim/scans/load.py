"""From files to a scene that can be played: read, put upright, cleaned, labelled, its floors found. Kept in a cache.

This is the story of an import; each step has its own module.
"""

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from thinknav_sim.render import Renderer, make_renderer
from thinknav_sim.scans.floors import find_floors
from thinknav_sim.scans.frame import Frame, Units, UpAxis, find_frame
from thinknav_sim.scans.glb_mesh import read_glb
from thinknav_sim.scans.hm3d import annotated_objects
from thinknav_sim.scans.mesh import Mesh, checked, shaded
from thinknav_sim.scans.obj_ply import read_obj_or_ply
from thinknav_sim.scans.room_capture import objects_in_boxes, read_room_capture
from thinknav_sim.scans.simplify import decimated, fragments
from thinknav_sim.scans.sources import Source, find_source
from thinknav_sim.scans.store import FORMAT, cache_folder, read_scene, write_scene
from thinknav_sim.scene import Scene, SceneError

logger = logging.getLogger(__name__)

# Decimation below this leaves no rooms.
MIN_TRIANGLES = 100


@dataclass(frozen=True)
class ScanOptions:
    """What a user may say of a scan.

    units, up_axis: guessed where None. decimate: about how many triangles to keep, all where None.
    semantics: a room capture (JSON) or a painted GLB in place of the one beside the mesh.
    """

    units: Units | None = None
    up_axis: UpAxis | None = None
    decimate: int | None = None
    semantics: Path | None = None


@dataclass(frozen=True)
class Scan:
    """An imported scene. notes: what was found, guessed and left out, for people. cached: whether a cache held it."""

    scene: Scene
    notes: tuple[str, ...]
    cached: bool


def load_scan(path: Path, options: ScanOptions = ScanOptions(), *, cache: bool = True) -> Scan:
    """The scene at a path: GLB, OBJ, PLY, an HM3D folder, or an .npz that an import left.

    cache: look into the cache folder first, and leave the result there. Raises SceneError, naming the file and the
    cause, for whatever makes no scene.
    """
    if path.suffix.lower() == ".npz":
        if options != ScanOptions():
            raise SceneError(f"{path} is imported already; give options with the scan itself")
        if not path.is_file():
            raise SceneError(f"{path} does not exist")
        return Scan(*read_scene(path), cached=True)
    if options.decimate is not None and options.decimate < MIN_TRIANGLES:
        raise SceneError(f"decimating to {options.decimate} triangles leaves nothing of a home; keep {MIN_TRIANGLES}")
    source = find_source(path, options.semantics)
    settings = f"{FORMAT} {options.units} {options.up_axis} {options.decimate}"
    kept = cache_folder() / f"{source.name}-{source.digest(settings)}.npz"
    if cache and kept.is_file():
        try:
            return Scan(*read_scene(kept), cached=True)
        except SceneError as error:
            logger.warning("%s; it is imported again", error)
    scene, notes = _import(source, options)
    if cache:
        try:
            write_scene(kept, scene, notes)
        except OSError as error:
            logger.warning("the imported scene cannot be cached: %s", error)
    return Scan(scene, notes, cached=False)


def _import(source: Source, options: ScanOptions) -> tuple[Scene, tuple[str, ...]]:
    raw = read_glb(source.mesh) if source.mesh.suffix.lower() == ".glb" else read_obj_or_ply(source.mesh)
    mesh = checked(raw, source.mesh)
    notes = []
    if len(mesh.triangles) < len(raw.triangles):
        notes.append(f"left out: {len(raw.triangles) - len(mesh.triangles)} degenerate triangles")
    frame = _frame(source, mesh, options)
    notes[:0] = frame.reasons
    mesh = frame.applied(mesh)
    if options.decimate is not None and options.decimate < len(mesh.triangles):
        before, had_textures = len(mesh.triangles), bool(mesh.textures)
        mesh = checked(decimated(mesh, options.decimate), source.mesh)
        baked = ", textures baked into vertex colours" if had_textures and not mesh.textures else ""
        notes.append(f"decimated: {before} to {len(mesh.triangles)} triangles{baked}")
    renderer = make_renderer()
    try:
        return _scene(source, mesh, frame, notes, renderer)
    finally:
        renderer.close()


def _frame(source: Source, mesh: Mesh, options: ScanOptions) -> Frame:
    if source.is_hm3d:
        return _hm3d_frame(source, mesh, options)
    is_gltf = source.mesh.suffix.lower() == ".glb"
    if source.room_capture is None or options.up_axis is not None:
        return find_frame(mesh, source.mesh, options.units, options.up_axis, is_gltf=is_gltf)
    found = find_frame(mesh, source.mesh, options.units, "y")
    return replace(found, reasons=(found.reasons[0], "up-axis: y (guessed: that of the room capture)"))


def _hm3d_frame(source: Source, mesh: Mesh, options: ScanOptions) -> Frame:
    found = find_frame(mesh, source.mesh, options.units or "m", options.up_axis or "z")
    said = [f"{kind} (HM3D's)" for kind in (f"units: {found.units}", f"up-axis: {found.up_axis}")]
    given = (options.units is not None, options.up_axis is not None)
    units, axis = (reason if own else text for reason, text, own in zip(found.reasons, said, given, strict=True))
    return replace(found, reasons=(units, axis))


def _scene(
    source: Source, mesh: Mesh, frame: Frame, notes: list[str], renderer: Renderer
) -> tuple[Scene, tuple[str, ...]]:
    lost = fragments(mesh, _bare_scene(source, mesh), renderer)
    if lost.any():
        mesh = mesh.keeping(~lost)
        notes.append(f"left out: {int(lost.sum())} triangles of fragments that float in the air")
    if not mesh.painted:
        mesh = replace(mesh, colors=shaded(mesh))
        notes.append("colours: the file has none; surfaces are shaded by the way they face")
    scene = _bare_scene(source, mesh)
    if source.semantic_glb is not None:
        objects, owners = annotated_objects(mesh, source.semantic_glb, frame)
    elif source.room_capture is not None:
        objects, owners = objects_in_boxes(mesh, read_room_capture(source.room_capture))
    else:
        objects, owners = (), scene.triangle_objects
        notes.append("objects: none, for want of labels; no episodes can be made")
    unseen = sorted({objects[i].category for i in set(range(len(objects))) - set(np.unique(owners).tolist())})
    if unseen:
        notes.append(f"objects without triangles, so nobody can see them: {', '.join(unseen)}")
    scene = replace(scene, objects=objects, triangle_objects=owners)
    return replace(scene, floors=find_floors(scene, renderer)), tuple(notes)


def _bare_scene(source: Source, mesh: Mesh) -> Scene:
    textured = bool(mesh.textures)
    return Scene(
        name=source.name,
        vertices=mesh.vertices.astype(np.float32),
        triangles=mesh.triangles,
        colors=mesh.colors,
        triangle_objects=np.full(len(mesh.triangles), -1, np.int32),
        level_floors=False,
        textures=mesh.textures,
        uv=mesh.uv if textured else None,
        triangle_textures=mesh.triangle_textures if textured else None,
    )
