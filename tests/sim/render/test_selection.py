"""Which renderer a process gets, and what it says when one cannot run."""

import builtins
import contextlib
import importlib.metadata
import logging
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thinknav_sim.render import (
    Camera,
    EmbreeRenderer,
    Open3DRenderer,
    RasterRenderer,
    Renderer,
    RendererUnavailable,
    embree,
    embree_library,
    make_renderer,
    raster,
    selection,
)
from thinknav_sim.scene import Scene


@pytest.fixture(autouse=True)
def unwarned() -> None:
    selection._warn_of_fallback.cache_clear()


def caster_of(renderer: Renderer) -> Renderer:
    """What casts a rasteriser's rays."""
    assert isinstance(renderer, RasterRenderer)
    return renderer.caster


def test_names() -> None:
    for name in ("auto", "raster"):
        assert isinstance(caster_of(make_renderer(name)), EmbreeRenderer)
    assert isinstance(make_renderer("embree"), EmbreeRenderer)
    assert isinstance(make_renderer("open3d"), Open3DRenderer)
    with pytest.raises(ValueError, match="no renderer 'opengl'; there are: auto, raster, embree, open3d, warp"):
        make_renderer("opengl")


def test_a_missing_library_falls_back_with_one_warning(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(importlib.metadata, "files", lambda package: [])
    with caplog.at_level(logging.WARNING):
        assert isinstance(caster_of(make_renderer()), Open3DRenderer)
        assert isinstance(caster_of(make_renderer("auto")), Open3DRenderer)
    assert len(caplog.records) == 1
    assert "embreex has no Embree 4 library among its files" in caplog.text
    with pytest.raises(RendererUnavailable, match="reinstall it"):
        make_renderer("embree")


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree_library, "PACKAGE", "a-package-that-is-not-there")
    with pytest.raises(RendererUnavailable, match="pip install a-package-that-is-not-there"):
        EmbreeRenderer()


def test_a_broken_library_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    broken = tmp_path / "libembree4.so"
    broken.write_text("not a library")
    monkeypatch.setattr(embree_library, "find_library", lambda: broken)
    with pytest.raises(RendererUnavailable, match=r"libembree4\.so could not be bound"):
        EmbreeRenderer()


def test_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree_library.EmbreeDevice, "_property", lambda self, device_property: 31_303)
    with pytest.raises(RendererUnavailable, match="Embree 4 is needed, and embreex holds version number 31303"):
        EmbreeRenderer()


def blank_picture(*arguments: Any) -> None:
    for picture in arguments[-2:]:
        picture[:] = 0


def test_a_wrong_picture_falls_back(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(embree, "draw_views", blank_picture)
    with caplog.at_level(logging.WARNING):
        assert isinstance(caster_of(make_renderer()), Open3DRenderer)
    assert "a wall at 2.0 m was drawn at 0.0 to 0.0 m" in caplog.text


def test_a_wrong_rasteriser_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(raster, "draw_views", blank_picture)
    with pytest.raises(RendererUnavailable, match=r"a wall at 2\.0 m was drawn at 0\.0 to 0\.0 m"):
        make_renderer()


def test_wrong_hits_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree, "cast_rays", blank_picture)
    with pytest.raises(RendererUnavailable, match=r"rays at known triangles met \[0, 0, 0\]"):
        EmbreeRenderer()


@pytest.mark.parametrize(
    ("failure", "remedy"),
    [
        ("libusb-1.0.so.0: cannot open shared object file: No such file or directory", "libusb-1.0-0"),
        ("libGL.so.1: cannot open shared object file: No such file or directory", "libgl1"),
        ("No module named 'open3d'", "pip install open3d-cpu"),
    ],
)
def test_open3d_names_what_to_install(monkeypatch: pytest.MonkeyPatch, failure: str, remedy: str) -> None:
    genuine_import = builtins.__import__

    def failing_import(name: str, *arguments: Any, **keywords: Any) -> Any:
        if name == "open3d":
            raise ImportError(failure)
        return genuine_import(name, *arguments, **keywords)

    monkeypatch.setattr(builtins, "__import__", failing_import)
    with pytest.raises(RendererUnavailable, match=remedy):
        Open3DRenderer()


def test_importing_the_package_imports_neither_open3d_nor_torch() -> None:
    program = "import sys, thinknav_sim.render; print(*{'open3d', 'torch', 'embreex'} & set(sys.modules))"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == ""


@pytest.mark.parametrize("name", ["raster", "embree"])
def test_renderers_of_two_threads_do_not_disturb_each_other(name: str, rooms: tuple[Scene, Scene]) -> None:
    poses, camera = np.random.default_rng(0).uniform(-1, 1, (4, 4)), Camera(40, 40)
    pictures: dict[int, list[Any]] = {0: [], 1: []}

    def draw(room: int) -> None:
        with contextlib.closing(make_renderer(name)) as renderer:
            scene = renderer.add_scene(rooms[room])
            for _ in range(20):
                pictures[room].append(renderer.render(np.full(4, scene), poses, camera)[0])

    threads = [threading.Thread(target=draw, args=(room,)) for room in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for drawn in pictures.values():
        assert len(drawn) == 20
        assert all((picture == drawn[0]).all() for picture in drawn)
    assert (pictures[0][0] != pictures[1][0]).any()
