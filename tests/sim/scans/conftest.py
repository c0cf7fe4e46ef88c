"""Scans in files of their own, a cache of the test's own, and real rooms where they are at hand."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.sim.scans.files import glb_bytes
from thinknav_sim.render import Renderer, make_renderer

WriteGlb = Callable[..., Path]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of the test's own."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("THINKNAV_CACHE", str(folder))
    return folder


@pytest.fixture(scope="session")
def renderer() -> Renderer:
    return make_renderer()


@pytest.fixture
def write_glb(tmp_path: Path) -> WriteGlb:
    def write(vertices: NDArray[np.float32], triangles: NDArray[np.int32], name: str = "room.glb", **more: Any) -> Path:
        path = tmp_path / name
        path.write_bytes(glb_bytes(vertices, triangles, **more))
        return path

    return write


@pytest.fixture(scope="session")
def test_data() -> Path:
    """Real data, where it is at hand."""
    folder = Path(os.environ.get("THINKNAV_TEST_DATA", Path(__file__).parents[4] / "shared" / "data"))
    if not (folder / "quest_rooms").is_dir():
        pytest.skip(f"no scanned rooms at {folder / 'quest_rooms'}; THINKNAV_TEST_DATA can name their folder")
    return folder
