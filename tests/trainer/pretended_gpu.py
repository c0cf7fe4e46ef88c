"""A GPU that is not there: tensors that were brought to it are marked, and must not meet those that were not.

They lie in the machine's memory all the same, so that the numbers come out and can be compared. What a real GPU does,
this does not tell; only that nothing was left behind on the way to it.
"""

from collections.abc import Callable, Iterable
from typing import Any

import torch
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_leaves, tree_map

GPU = torch.device("cuda", 0)
CPU = torch.device("cpu")


class There(Tensor):
    """A tensor on the GPU."""

    __torch_function__ = torch._C._disabled_torch_function_impl  # type: ignore[assignment]


class PretendedGPU(TorchFunctionMode):
    """While the block runs, `GPU` can be computed on. moved: how many tensors were brought there."""

    def __init__(self) -> None:
        super().__init__()
        self.moved = 0
        self._weights: dict[int, nn.Parameter] = {}  # those that were moved stay the same objects

    def __torch_function__(
        self, func: Callable[..., Any], types: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        kwargs = kwargs or {}
        name = func.__name__
        if name == "__get__" and getattr(func, "__self__", None) is Tensor.device:
            return GPU if self._is_there(args[0]) else CPU
        if name == "to" and GPU in tree_leaves((args, kwargs)):
            return self._bring(args[0])
        if name == "cpu" or (name == "to" and CPU in tree_leaves((args, kwargs))):
            return args[0].as_subclass(Tensor)
        if name == "numpy" and self._is_there(args[0]):
            raise AssertionError("numpy of a tensor that is on the GPU")
        of_here = name in ("__getitem__", "__setitem__") and not self._is_there(args[0])
        if of_here and any(self._is_there(index) for index in tree_leaves(args[1])):
            raise AssertionError("a tensor on the CPU indexed by one on the GPU")
        created_there = kwargs.get("device") == GPU
        if created_there:
            kwargs = kwargs | {"device": CPU}
        met = tree_leaves((args[:1] if name in ("__getitem__", "__setitem__") else args, kwargs))  # indices may be here
        there = [self._is_there(value) for value in met if isinstance(value, Tensor) and value.dim()]
        if any(there) and not all(there):
            raise AssertionError(f"{name} of tensors that are partly on the GPU")
        result = func(*args, **kwargs)
        return _mark(result) if created_there or any(there) else result

    def _is_there(self, value: Any) -> bool:
        return isinstance(value, There) or id(value) in self._weights

    def _bring(self, value: Tensor) -> Tensor:
        self.moved += 1
        if isinstance(value, nn.Parameter):
            self._weights[id(value)] = value
            return value
        return value.as_subclass(There)

    def brought(self, module: nn.Module) -> Iterable[nn.Parameter]:
        """Those of a module's weights that were brought there."""
        return [weight for weight in module.parameters() if id(weight) in self._weights]


def _mark(result: Any) -> Any:
    return tree_map(lambda value: value.as_subclass(There) if isinstance(value, Tensor) else value, result)
