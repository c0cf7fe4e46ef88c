"""The model card of a small CLIP: what it is, what it was made of, what it can do and what not."""

from collections.abc import Sequence

from thinknav_trainer.model_training.clip_evaluate import DirectionGap, Measure

CARD = """\
# thinknav-clip@{revision}

Image and text encoders into one space of 512 dimensions, made for ThinkNav: the text encoder embeds subgoals for the
policy, the image encoder is the policy's frozen eye on a CPU. {megabytes:.1f} MB, half precision.

## Made of

{data}

Sentences come from a grammar (`model_training/grammar.py`): long and short descriptions (things with left, ahead or
right and near or far, the room, ways out of it, whether the way is blocked), subgoals, and false sentences of both
kinds. {batches} batches of {batch_size} frames, each with four sentences; no other data, no other network's weights.

    {command}

## Measured

On {frames} frames of {homes}. Intervals: 95 %, bootstrap over frames.

{table}

Subgoals about the same thing: cosine {same:.2f} for two wordings of one direction, {other:.2f} for two directions
(left, right, forward, stop), {closest:.2f} at most; {sorted_right:.1%} are nearest to their own direction's other
wordings.

## Limits

It knows the things and rooms of procedural homes, drawn in plain colours, seen from 0.88 m with 79 degrees; in scans
it sees little of what it should. It reads English of the grammar's kind; words that it does not know it spells out. It
does not count. It was made to steer a robot in simulation: do not trust it with a robot among people.

Licence: Apache-2.0, as the rest of ThinkNav.
"""


def table(measures: Sequence[Measure]) -> str:
    """Measures as a Markdown table."""
    rows = [f"| {item.name} | {item.mean:.3f} | {item.low:.3f} to {item.high:.3f} |" for item in measures]
    return "\n".join(["| | share | 95 % interval |", "|---|---|---|", *rows])


def model_card(
    *,
    revision: str,
    size: int,
    data: str,
    command: str,
    batches: int,
    batch_size: int,
    frames: int,
    homes: str,
    measures: Sequence[Measure],
    gap: DirectionGap,
) -> str:
    """The card. size: of the weights in bytes. data, homes: where frames came from, to train with and to measure on."""
    return CARD.format(
        revision=revision,
        megabytes=size / 1e6,
        data=data,
        command=command,
        batches=batches,
        batch_size=batch_size,
        frames=frames,
        homes=homes,
        table=table(measures),
        same=gap.same,
        other=gap.other,
        closest=gap.closest,
        sorted_right=gap.sorted_right,
    )
