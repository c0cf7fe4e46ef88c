"""docs/training.md names every key and every metric."""

import re
from pathlib import Path

from thinknav_trainer.config import TrainConfig, change_config
from thinknav_trainer.config_table import with_table
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.run import Run, read_log
from thinknav_trainer.scenes import Homes
from thinknav_trainer.train import train

PAGE = (Path(__file__).parents[2] / "docs" / "training.md").read_text()


def test_the_configuration_is_the_one_of_the_code() -> None:
    assert with_table(PAGE) == PAGE, "python -m thinknav_trainer.config_table docs/training.md"
    assert "| `ppo.lr` | `0.00025` | Adam's learning rate |" in PAGE


def test_every_metric_is_explained(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    short = ["env.max_steps=8", "warm_start.steps=64", "total_steps=192"]
    parts = ["think.reward=paper", "think.budget=0.1", "warm_start.foresight_coef=1", "ppo.kl_coef=0.1"]
    config = change_config(smoke, overrides=[*parts, *short])
    run = Run.create(tmp_path, config)
    train(run, homes, PlannerClient(MockTransport(lambda request: "turn left")), Interruption())
    run.close()
    logged = {name for log in ("metrics", "timing") for row in read_log(tmp_path / f"{log}.jsonl") for name in row}
    explained = set(re.findall(r"`([a-z_/]+)`", PAGE.partition("## Metrics")[2].partition("\n## ")[0]))
    assert logged - explained == {"steps"}
    assert {name for name in explained - logged if "." not in name} == set()
