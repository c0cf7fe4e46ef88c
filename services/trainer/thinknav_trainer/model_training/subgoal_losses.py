"""What the subgoal network gets wrong in a batch, by name. Knows no optimiser."""

from torch import Tensor
from torch.nn import functional

from thinknav_models.subgoal_language import Vocabulary
from thinknav_models.subgoal_network import Memory, SubgoalNetwork, way_targets
from thinknav_trainer.model_training.subgoal_batch import Batch, Questions
from thinknav_trainer.model_training.teacher import NO_WAY
from thinknav_trainer.precision import autocast

# Beside the direction, which is what counts: the words after it (there are many right ones), plans, and what is learnt
# along the way: where it leads, and what is where in the picture.
_WEIGHTS = {"words": 0.3, "plan": 0.2, "way": 0.5, "goals": 5.0, "farness": 2.0}


def batch_losses(network: SubgoalNetwork, batch: Batch, vocabulary: Vocabulary) -> dict[str, Tensor]:
    """The losses by name, already weighed; their sum is to be made small."""
    with autocast("auto"):
        features = network.trunk(batch.pictures)
        cells = network.surroundings(features).float()
        memory = remembered(network, features, batch.directions)
        hidden = answer_hidden(network, memory, batch.directions)[:, 0]
        direction, way = network.logits(hidden), network.way(hidden).float()
        words = network.logits(answer_hidden(network, memory, batch.subgoals))  # of the same looks
        plan = network.logits(answer_hidden(network, remembered(network, features, batch.plans), batch.plans))
    known = batch.actions != NO_WAY
    wanted_way = way_targets(batch.bearings[known], batch.distances[known], batch.in_view[known])
    losses = {
        "direction": functional.cross_entropy(direction[known], batch.directions.answers[known, 0]),
        "words": _word_loss(words[:, 1:], batch.subgoals.answers[:, 1:], vocabulary),
        "plan": _word_loss(plan, batch.plans.answers, vocabulary),
        "way": functional.smooth_l1_loss(way[known], wanted_way),
        "goals": functional.binary_cross_entropy_with_logits(cells[:, 1:], batch.shares),
        "farness": functional.smooth_l1_loss(cells[:, 0], batch.farness),
    }
    return {name: _WEIGHTS.get(name, 1.0) * loss for name, loss in losses.items()}


def remembered(network: SubgoalNetwork, features: Tensor, questions: Questions) -> Memory:
    """What the questions' looks show, of the features (V, C, 8, 8) of all views."""
    return network.remember(features, questions.views, questions.headings)


def answer_hidden(network: SubgoalNetwork, memory: Memory, questions: Questions) -> Tensor:
    """The decoder's states (B, L, width) from which each token of the answers (B, L) is to be guessed."""
    first = network.first_token(questions.goals, questions.goal_lengths, questions.modes)
    hidden, _ = network.decode(first, questions.answers[:, :-1], memory)
    return hidden


def _word_loss(logits: Tensor, answers: Tensor, vocabulary: Vocabulary) -> Tensor:
    """Mean over the tokens (B, L) that are not padding."""
    return functional.cross_entropy(logits.flatten(0, 1), answers.flatten(), ignore_index=vocabulary.padding)
