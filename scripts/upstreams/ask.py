"""Asks a real server through the planner `openai`: python ask.py URL MODEL. Fails unless all went as it should.

The model is random, so what it says means nothing; that an answer comes back for each frame is what is tested.
"""

import asyncio
import sys

import numpy as np

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import Frame, PlannerError, PlannerFailed, SubgoalReply, SubgoalRequest
from thinknav_server.hosts import PlannerInLoop
from thinknav_server.planners.openai import OpenAIPlanner
from thinknav_server.planners.options import OpenAIOptions
from thinknav_server.service import PlanningService
from thinknav_server.settings import Settings

COUNT = 32


async def ask(service: PlanningService) -> list[SubgoalReply | PlannerError]:
    """One answer for each of many frames, asked at once."""
    random = np.random.default_rng(0)
    requests = [
        SubgoalRequest(
            request_id=str(index),
            goal="chair",
            frame=Frame.raw(random.integers(0, 256, (256, 256, 3), dtype=np.uint8)),
            temperature=1.0,
            deadline=300.0,
        )
        for index in range(COUNT)
    ]
    async with service:
        return await service.answer_each(requests)


def main() -> None:
    """Print what came of it."""
    url, model = sys.argv[1:]
    planner = OpenAIPlanner(OpenAIOptions(url=url, model=model, timeout=300.0))
    answers = asyncio.run(ask(PlanningService(PlannerInLoop(planner, shipped_text_encoder(), COUNT), Settings())))
    # A random model may well say nothing that can be followed; every other failure is the server's or ours.
    wrong = [
        answer
        for answer in answers
        if isinstance(answer, PlannerError)
        and not (isinstance(answer, PlannerFailed) and "could be followed" in answer.message)
    ]
    replies = sum(isinstance(answer, SubgoalReply) for answer in answers)
    sys.stdout.write(f"{url}: {COUNT} asked, {replies} subgoals, {COUNT - replies - len(wrong)} empty, {wrong}\n")
    sys.exit(bool(wrong) or not replies)


if __name__ == "__main__":
    main()
