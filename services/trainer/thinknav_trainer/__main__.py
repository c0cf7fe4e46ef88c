"""`python -m thinknav_trainer` is the `thinknav` command; torchrun starts its workers by it."""

from thinknav_trainer.cli import main

main()
