"""The same model behind LitServe. Run by the Python of its own virtual environment; imports nothing of ours but
`model.py` beside it.

    python litserve_peer.py PORT BASE ITEM MAX_BATCH MAX_WAIT

A request is JSON with the frame in base64, as LitServe's guide has it, and so is the embedding in its answer.
"""

# mypy: ignore-errors
# It is checked where neither LitServe nor its types are.

import base64
import sys
from pathlib import Path

import litserve
import numpy as np
import simplejpeg

sys.path.insert(0, str(Path(__file__).parent))
from model import Emulated

EMBEDDING = np.zeros(512, np.float32)


class Peer(litserve.LitAPI):
    """Decodes, plans, and answers with as many bytes as we do."""

    def __init__(self, base: float, item: float, max_batch: int, max_wait: float) -> None:
        super().__init__(max_batch_size=max_batch, batch_timeout=max_wait)
        self._times = base, item

    def setup(self, device: str) -> None:  # noqa: ARG002
        self._model = Emulated(*self._times)

    def decode_request(self, request: dict) -> np.ndarray:
        return simplejpeg.decode_jpeg(base64.b64decode(request["frame"]))

    def batch(self, inputs: list) -> list:
        return inputs

    def predict(self, frames: list) -> list:
        return self._model(len(frames))

    def unbatch(self, output: list) -> list:
        return output

    def encode_response(self, output: str) -> dict:
        return {"subgoal": output, "embedding": base64.b64encode(EMBEDDING.tobytes()).decode()}


if __name__ == "__main__":
    port, base, item, max_batch, max_wait = sys.argv[1:]
    api = Peer(float(base), float(item), int(max_batch), float(max_wait))
    # The fast queue, as LitServe advises for more than a hundred requests a second.
    server = litserve.LitServer(api, accelerator="cpu", workers_per_device=1, fast_queue=True)
    server.run(host="127.0.0.1", port=int(port), generate_client_file=False, log_level="warning")
