"""Learning to move untold as one does once told, so that a think is worth its price only where the reply may surprise.

A think leaves the pose, and what is observed after it is what was observed before, and the reply. So the policy that
has heard it teaches the one that has not: how it would move, held fixed, is how the other should. Whether to stop is
not foreseen: a wrong turn costs some steps, a wrong stop the episode, and to be told is cheap by then. Nobody else's
labels are needed, and the planner is not asked once more. (Self-distillation from more information to less, as a
privileged teacher's to its student: Vapnik and Vashist 2009; the same network is both.)
"""

from torch import Tensor
from torch.nn import functional

from thinknav_sim.task_config import Action
from thinknav_trainer.rollout import Rollout

MOVES = [Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT]


def foresight_loss(logits: Tensor, previous_actions: Tensor, told: Tensor, mask: Tensor) -> Tensor:
    """Kullback-Leibler divergence of untold moves from told ones: summed over replies, a share of transitions.

    Each reply counts as much as the told policy would move. Of the M transitions that `mask` (L, S) leaves of
    sequences, in its order: logits (M, A), previous_actions (M,) and told (M,) bool, whether a thought is observed. A
    reply is seen where the think before it is in the same sequence.
    """
    place = mask.flatten().cumsum(0).view_as(mask) - 1  # of each transition among the M
    both = mask[:-1] & mask[1:]
    untold, after = place[:-1][both], place[1:][both]
    heard = (told[after] & (previous_actions[after] == Action.THINK)).to(mask.device)
    untold, after = untold[heard], after[heard]
    moving = 1 - logits[after, : Action.THINK].softmax(dim=1)[:, Action.STOP]
    before, then = (logits[rows][:, MOVES].log_softmax(dim=1) for rows in (untold, after))
    apart = functional.kl_div(before, then.detach(), reduction="none", log_target=True).sum(dim=1)
    return (moving.detach() * apart).sum() / len(logits)


def foresight_of(rollout: Rollout, logits: Tensor, rows: Tensor, mask: Tensor) -> Tensor:
    """The loss of the transitions `rows` (M,) of a rollout, to which the policy answered with logits (M, A)."""
    told = rollout.observations["thought"][rows].any(dim=1)
    return foresight_loss(logits, rollout.previous_actions[rows], told, mask)
