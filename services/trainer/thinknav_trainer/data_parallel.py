"""What makes several workers' updates one worker's on all their transitions. A lone worker's numbers are left alone.

Workers bring different numbers of transitions, so means are weighted by them: a mean over all is the sum of
(number x mean) over the sum of numbers. Knows tensors and workers; nothing of losses.
"""

from collections.abc import Iterable, Mapping

import torch
from torch import Tensor, nn

from thinknav_trainer.workers import Workers


def mean_and_deviation(values: Tensor, workers: Workers) -> tuple[Tensor, Tensor]:
    """Mean and (unbiased) standard deviation of values (M,) over all workers, whose M may differ."""
    if workers.count == 1:
        return values.mean(), values.std()
    exact = values.double()
    count, total = workers.sum(torch.stack([exact.new_tensor(float(len(values))), exact.sum()]))
    mean = total / count
    squares = workers.sum((exact - mean).square().sum())
    return mean, (squares / (count - 1)).sqrt()


def average_gradients(
    parameters: Iterable[nn.Parameter], means: Mapping[str, float], weight: int, workers: Workers
) -> dict[str, float]:
    """Put into the parameters the gradients of the mean loss over all workers; and the means over all workers.

    weight: the transitions that this worker's gradients and `means` are means over; 0: it has none, and gradients that
    are not there. The names of `means` are the same for all. One sum over workers, of everything.
    """
    if workers.count == 1:
        return dict(means)
    learnt = [parameter for parameter in parameters if parameter.requires_grad]
    gradients = [torch.zeros_like(each) if each.grad is None else each.grad for each in learnt]
    numbers = gradients[0].new_tensor([*means.values(), 1.0])
    together = torch.cat([*(gradient.reshape(-1) for gradient in gradients), numbers]) * weight
    workers.sum(together)
    together = together / together[-1].clamp(min=1)
    parts = torch.split(together, [gradient.numel() for gradient in gradients] + [len(numbers)])
    for parameter, part in zip(learnt, parts[:-1], strict=True):
        parameter.grad = part.view_as(parameter)
    return dict(zip(means, parts[-1][:-1].tolist(), strict=True))
