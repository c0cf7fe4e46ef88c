"""Processes that make batches are deaf to Ctrl-C, and whoever started them is not."""

import signal
from collections.abc import Iterator

from torch.utils.data import DataLoader, IterableDataset

from thinknav_trainer.model_training.drawn_ahead import drawn_ahead


class Deafness(IterableDataset[bool]):
    """Says whether its process would not hear SIGINT."""

    def __iter__(self) -> Iterator[bool]:
        yield signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_workers_do_not_hear_an_interrupt() -> None:
    loader = DataLoader(Deafness(), batch_size=None, num_workers=1, multiprocessing_context="spawn")
    assert list(drawn_ahead(loader)) == [True]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])
