"""Files of weights: what was written comes back, and nothing else is taken for it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file

from thinknav_models.weights import WeightsError, load_weights, save_weights

TENSORS: dict[str, NDArray[Any]] = {
    "a.weight": np.linspace(-2, 2, 600, dtype=np.float32).reshape(20, 30),
    "b": np.ones(4),
}
CONFIG = {"width": 30, "names": ["left", "right"]}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "net.safetensors"


def test_what_was_saved_comes_back_in_float32(path: Path) -> None:
    revision = save_weights(path, "net", CONFIG, TENSORS)
    weights = load_weights(path, "net")
    assert weights.config == CONFIG
    assert weights.revision == revision
    assert len(revision) == 12
    assert sorted(weights.tensors) == sorted(TENSORS)
    for name, tensor in TENSORS.items():
        assert weights.tensors[name].dtype == np.float32
        np.testing.assert_array_equal(weights.tensors[name], tensor.astype(np.float16))
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_the_revision_follows_configuration_and_tensors_alone(path: Path) -> None:
    revision = save_weights(path, "net", CONFIG, TENSORS)
    assert save_weights(path, "net", dict(reversed(CONFIG.items())), dict(reversed(TENSORS.items()))) == revision
    others = [
        save_weights(path, "net", CONFIG | {"width": 31}, TENSORS),
        save_weights(path, "net", CONFIG, TENSORS | {"b": np.zeros(4)}),
        save_weights(path, "net", CONFIG, TENSORS | {"b": np.ones((2, 2))}),
        save_weights(path, "net", CONFIG, {"a.weight": TENSORS["a.weight"], "c": TENSORS["b"]}),
    ]
    assert len({revision, *others}) == 5


def test_a_missing_file_is_named(path: Path) -> None:
    with pytest.raises(WeightsError, match=r"there is no file of weights .*net\.safetensors"):
        load_weights(path, "net")


@pytest.mark.parametrize("keep", [0, 5, 100, -1])
def test_a_truncated_file_is_refused(path: Path, keep: int) -> None:
    save_weights(path, "net", CONFIG, TENSORS)
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(WeightsError, match=r"net\.safetensors is truncated, or no safetensors file"):
        load_weights(path, "net")


def test_what_is_no_safetensors_file_is_refused(path: Path) -> None:
    path.write_text("these are not the weights you are looking for, however long you look")
    with pytest.raises(WeightsError, match=r"net\.safetensors is truncated, or no safetensors file"):
        load_weights(path, "net")


def test_weights_of_another_program_are_refused(path: Path) -> None:
    save_file({"b": np.ones(3)}, path)
    with pytest.raises(WeightsError, match="lacks kind, config, revision"):
        load_weights(path, "net")


def test_weights_of_another_network_are_refused(path: Path) -> None:
    save_weights(path, "net", CONFIG, TENSORS)
    with pytest.raises(WeightsError, match="holds weights of kind 'net', not 'clip'"):
        load_weights(path, "clip")


def test_a_flipped_bit_is_found(path: Path) -> None:
    save_weights(path, "net", CONFIG, TENSORS)
    content = bytearray(path.read_bytes())
    content[-7] ^= 1
    path.write_bytes(content)
    with pytest.raises(WeightsError, match=r"net\.safetensors is corrupt"):
        load_weights(path, "net")


def test_a_changed_configuration_is_found(path: Path) -> None:
    save_weights(path, "net", CONFIG, TENSORS)
    content = path.read_bytes()
    path.write_bytes(content.replace(b'width\\": 30', b'width\\": 31'))
    assert path.read_bytes() != content
    with pytest.raises(WeightsError, match=r"net\.safetensors is corrupt"):
        load_weights(path, "net")


def test_values_beyond_half_precision_are_refused(path: Path) -> None:
    with pytest.raises(WeightsError, match="tensor 'b' holds values"):
        save_weights(path, "net", CONFIG, {"b": np.array([1e6])})
    assert not path.exists()


def test_half_precision_is_what_lies_on_disk(path: Path) -> None:
    save_weights(path, "net", CONFIG, TENSORS)
    assert load_file(path)["b"].dtype == np.float16
