"""Steps and memory are really measured, and a peer that is not there is named; nothing here is held to a time."""

from pathlib import Path

import pytest

from thinknav_sim.homes import generate_home
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene
from thinknav_trainer.bench import simulator
from thinknav_trainer.bench.memory import growth, resident_mb
from thinknav_trainer.bench.miniworld import MiniWorld
from thinknav_trainer.bench.peer import PeerMissing
from thinknav_trainer.bench.stepping import RandomWalkers


@pytest.fixture(scope="module")
def home() -> Scene:
    return generate_home(0, rooms=2)


def test_a_missing_peer_says_how_to_install_it(tmp_path: Path) -> None:
    with pytest.raises(PeerMissing, match="make bench-peers"):
        MiniWorld(tmp_path, 64)


def test_figures_go_on_without_the_peer(home: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulator, "SIZE", 16)
    figures = list(simulator.against_miniworld([home], tmp_path, 1))
    assert [figure.figure for figure in figures] == ["sim.256.vs_miniworld", "sim.256.cpu"]
    assert all(figure.value > 0 for figure in figures)
    assert all(figure.peer_value is None for figure in figures)
    assert "make bench-peers" in str(figures[0].peer)


def test_the_share_of_other_work(home: Scene) -> None:
    walkers = RandomWalkers([home], 2, 16)
    renderer: Renderer = walkers.env.world.renderer
    assert 0 < walkers.other_share(3) < 1
    assert walkers.env.world.renderer is renderer
    walkers.close()


def test_resident_memory_grows_with_what_is_held() -> None:
    before = resident_mb()
    held = bytearray(50_000_000)
    held[::1000] = b"x" * len(held[::1000])
    assert 40 < resident_mb() - before < 70


def test_growth_leaves_out_the_warm_up() -> None:
    assert growth([100, 300, 400, 400, 400, 400, 400, 400]) == 0.0
    assert growth([100, 300, 400, 400, 400, 500, 500, 500]) == pytest.approx(0.25)
    with pytest.raises(ValueError, match="go on for longer"):
        growth([1, 2, 3])
