"""Lets a torchvision that was built for CUDA be imported beside a torch without it: operators are declared, not made.

Only for the servers that `make test-upstreams` starts, which never use them. Python runs it when it starts.
"""

import contextlib

with contextlib.suppress(ImportError):
    import torch

    _library = torch.library.Library("torchvision", "DEF")
    for _operator in (
        "nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor",
        "qnms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor",
        "roi_align(Tensor a) -> Tensor",
        "qroi_align(Tensor a) -> Tensor",
        "_roi_align_backward(Tensor a) -> Tensor",
        "ps_roi_align(Tensor a) -> Tensor",
        "_ps_roi_align_backward(Tensor a) -> Tensor",
        "roi_pool(Tensor a) -> Tensor",
        "_roi_pool_backward(Tensor a) -> Tensor",
        "ps_roi_pool(Tensor a) -> Tensor",
        "_ps_roi_pool_backward(Tensor a) -> Tensor",
        "deform_conv2d(Tensor a) -> Tensor",
        "_deform_conv2d_backward(Tensor a) -> Tensor",
    ):
        _library.define(_operator)

    import io

    import torchvision.io

    def _decode_image(data: "torch.Tensor", *_: object, **__: object) -> "torch.Tensor":
        import numpy as np
        from PIL import Image

        rgb = np.array(Image.open(io.BytesIO(bytes(data.numpy()))).convert("RGB"))
        return torch.from_numpy(rgb).permute(2, 0, 1)

    torchvision.io.decode_image = _decode_image
