"""Advantages against the definition, and sequences that neither lose nor repeat a transition."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_trainer.rollout import SEQUENCES_STEP, TRANSITIONS_STEP, Rollout, cut_sequences, generalized_advantages


def slow_advantage(
    rewards: list[float], values: list[float], done: list[bool], last: float, g: float, tau: float
) -> list[float]:
    """Sum of discounted TD errors up to the episode's end, written out (Schulman et al. 2016, eq. 16)."""
    result = []
    for start in range(len(rewards)):
        total, weight = 0.0, 1.0
        for t in range(start, len(rewards)):
            following = 0.0 if done[t] else (values[t + 1] if t + 1 < len(rewards) else last)
            total += weight * (rewards[t] + g * following - values[t])
            if done[t]:
                break
            weight *= g * tau
        result.append(total)
    return result


@settings(deadline=None, max_examples=50)
@given(steps=st.integers(1, 20), envs=st.integers(1, 4), seed=st.integers(0, 2**32 - 1))
def test_advantages_equal_the_definition(steps: int, envs: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rewards, values = rng.normal(size=(2, steps, envs)).astype(np.float32)
    done = rng.random((steps, envs)) < 0.2
    last = rng.normal(size=envs).astype(np.float32)
    found = generalized_advantages(rewards, values, done, last, 0.9, 0.8)
    for env in range(envs):
        expected = slow_advantage(
            rewards[:, env].tolist(),
            values[:, env].tolist(),
            done[:, env].tolist(),
            float(last[env]),
            0.9,
            0.8,
        )
        assert found[:, env] == pytest.approx(expected, abs=1e-4)


@settings(deadline=None, max_examples=100)
@given(done=st.lists(st.booleans(), min_size=1, max_size=40), chunk=st.integers(1, 10))
def test_sequences_cover_each_step_once_and_cross_no_episode(done: list[bool], chunk: int) -> None:
    starts, lengths = cut_sequences(np.array(done), chunk)
    covered = [t for start, length in zip(starts, lengths, strict=True) for t in range(start, start + length)]
    assert covered == list(range(len(done)))
    assert lengths.max() <= chunk
    for start, length in zip(starts, lengths, strict=True):
        assert not any(done[start : start + length - 1])


def rollout(lengths: list[int]) -> Rollout:
    total = sum(lengths)
    numbers = torch.arange(total)
    return Rollout(
        observations={"gps": numbers[:, None].float()},
        actions=numbers,
        previous_actions=numbers,
        log_probs=numbers.float(),
        values=numbers.float(),
        advantages=numbers.float(),
        returns=numbers.float(),
        sequence_starts=np.cumsum([0, *lengths[:-1]]),
        sequence_lengths=np.array(lengths),
        sequence_hidden=torch.arange(len(lengths)).float()[None, None, :, None].expand(2, 1, -1, 1),
    )


@settings(deadline=None, max_examples=50)
@given(data=st.data(), lengths=st.lists(st.integers(1, 5), min_size=1, max_size=8))
def test_selected_sequences_lay_out_their_own_transitions(data: st.DataObject, lengths: list[int]) -> None:
    chosen = np.array(data.draw(st.permutations(range(len(lengths)))))[: data.draw(st.integers(1, len(lengths)))]
    made = rollout(lengths)
    transitions, sequences = made.select(chosen)
    for column, sequence in enumerate(chosen):
        start, length = made.sequence_starts[sequence], lengths[sequence]
        laid_out = transitions[sequences.index[:, column]][sequences.mask[:, column]]
        assert laid_out.tolist() == list(range(start, start + length))
        assert sequences.hidden[0, 0, column, 0] == sequence
    everyone = transitions[sequences.index[sequences.mask]].tolist()
    assert sorted(everyone) == sorted(set(transitions.tolist()))


@settings(deadline=None, max_examples=50)
@given(lengths=st.lists(st.integers(1, 5), min_size=1, max_size=30))
def test_minibatches_come_in_few_sizes(lengths: list[int]) -> None:
    made = rollout(lengths)
    transitions, sequences = made.select(np.arange(len(lengths)))
    assert len(transitions) % TRANSITIONS_STEP == 0
    assert len(transitions) - sum(lengths) < TRANSITIONS_STEP
    assert sequences.index.shape[1] == sequences.hidden.shape[2] == sequences.mask.shape[1]
    assert sequences.index.shape[1] % SEQUENCES_STEP == 0
    assert sequences.index.max() < len(transitions)
