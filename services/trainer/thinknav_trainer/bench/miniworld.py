"""MiniWorld as a peer, in a process and a virtual environment of its own: its versions are not ours."""

from pathlib import Path

from thinknav_trainer.bench.figures import Timing
from thinknav_trainer.bench.peer import Peer

_SCRIPT = Path(__file__).with_name("miniworld_peer.py")


class MiniWorld(Peer):
    """A running MiniWorld that draws on request. Raises PeerMissing."""

    def __init__(self, peers: Path, size: int) -> None:
        needs = "libegl1, libgl1-mesa-dri and libglu1-mesa"
        super().__init__("MiniWorld", peers, ["-I", str(_SCRIPT), str(size)], needs)

    def draw(self, frames: int) -> Timing:
        """Take that many steps, with RGB and depth of each."""
        return Timing(**self.work(frames))
