from pathlib import Path

import pytest

from thinknav_trainer.config import ConfigError, load_config, parse_config, presets


@pytest.mark.parametrize("preset", presets())
def test_presets_are_valid(preset: str) -> None:
    assert load_config(preset).total_steps > 0


def test_layers_override_one_another(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("ppo: {lr: 0.5, gamma: 0.9}\ntotal_steps: 7\n")
    config = load_config("cpu", file, ["ppo.lr=1e-4", "think.reward=paper", "policy.channels=[1, 2, 3]"])
    assert (config.ppo.lr, config.ppo.gamma, config.total_steps) == (1e-4, 0.9, 7)
    assert (config.think.reward, config.policy.channels) == ("paper", (1, 2, 3))
    assert config.policy.image_encoder == "clip-small"  # from the preset


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("ppo.learning_rate=1", "no configuration key 'ppo.learning_rate'"),
        ("ppo.clp=1", "did you mean 'ppo.clip'"),
        ("gamma=1", "did you mean 'ppo.gamma'"),
        ("ppo.gamma=2", r"ppo.gamma: .*less than or equal to 1 \(got 2\)"),
        ("think.strategy=often", "think.strategy: .*'never', 'agent', 'every_n' or 'once'"),
        ("ppo.lr", "--set takes key=value"),
        ("ppo..lr=1", "--set takes key=value"),
        ("ppo.lr=[", "not a value that YAML understands"),
        ("seed=2024-13-45", "not a value that YAML understands"),
        ("ppo=3", "ppo: "),
        ("env.think_action=true", "follows from think.strategy"),
        ("ppo.minibatches=1000", "ppo.minibatches 1000 is more than the sequences"),
        ("ppo={num_steps: 16, chunk_length: 64, minibatches: 65}", "minibatches 65 is more than the sequences"),
        ("think={strategy: once, dropout: 0.1}", "think.dropout is for strategies agent and every_n, not once"),
        ("scenes.chosen=[3,99999999]", "there is no home 99999999: the training range has 1000000, from 0 on"),
        ("scenes.first_home=1000000", "there is no home 1000000"),
        ("scenes.min_distance=40", "min_distance 40.0 is not below max_distance 30.0"),
    ],
)
def test_wrong_overrides_are_named(override: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_config("cpu", None, [override])


def test_wrong_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"cannot read .*absent.yaml: No such file"):
        load_config("cpu", tmp_path / "absent.yaml")
    for text, words in (("a: [", "is not YAML"), ("- 1", "must hold a mapping .* not a list")):
        (tmp_path / "bad.yaml").write_text(text)
        with pytest.raises(ConfigError, match=words):
            load_config("cpu", tmp_path / "bad.yaml")
    (tmp_path / "bad.yaml").write_bytes(b"\x80\x04K")
    with pytest.raises(ConfigError, match=r"bad\.yaml is not YAML: it is no text"):
        load_config("cpu", tmp_path / "bad.yaml")
    with pytest.raises(ConfigError, match="no preset 'cpus'; did you mean 'cpu'"):
        load_config("cpus")


def test_a_rollout_shorter_than_a_chunk_is_a_sequence_of_each_env() -> None:
    ppo = {"num_steps": 16, "chunk_length": 64, "minibatches": 4}
    assert parse_config({"num_envs": 4, "ppo": ppo}).ppo.minibatches == 4


def test_who_asks_aside_shows_one_view() -> None:
    with pytest.raises(ConfigError, match=r"planner-aside asks with one view: it needs think\.context 1"):
        parse_config({"warm_start": {"demonstrator": "planner-aside"}, "think": {"strategy": "never", "context": 5}})


def test_the_think_action_follows_from_the_strategy() -> None:
    assert parse_config({"think": {"strategy": "agent"}}).task.think_action
    assert not parse_config({"think": {"strategy": "never"}}).task.think_action


def test_a_configuration_survives_its_file_form() -> None:
    config = load_config("smoke")
    assert parse_config(config.model_dump(mode="json")) == config
