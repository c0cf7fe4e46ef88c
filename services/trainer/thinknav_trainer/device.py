"""Where a policy computes: on the processor, or on a GPU of this machine. Knows nothing of what is computed."""

import os

import torch

from thinknav_trainer.config import ConfigError


def find_device(name: str) -> torch.device:
    """The device of a configuration's name: cpu, cuda (of several workers on a host each has its own), or cuda:N.

    Raises ConfigError where there is no such GPU.
    """
    if name == "cpu":
        return torch.device("cpu")
    count = torch.cuda.device_count()
    index = int(os.environ.get("LOCAL_RANK", "0")) if name == "cuda" else int(name.removeprefix("cuda:"))
    if index >= count:
        raise ConfigError(
            f"device {name}: torch {torch.__version__} sees {count} CUDA GPUs here, and GPU {index} is wanted; "
            "set device=cpu, start fewer workers, or install a torch that is built for CUDA"
        )
    return torch.device("cuda", index)


def find_device_or_cpu(name: str) -> torch.device:
    """The same, or the processor where there is no such GPU: for what need not be fast."""
    try:
        return find_device(name)
    except ConfigError:
        return torch.device("cpu")
