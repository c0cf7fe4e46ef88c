"""The client of planning services: ask for subgoals, item by item, whatever the network does.

    with connect("http://127.0.0.1:8765") as planner:
        replies = planner.ask(requests)

One URL, or several replicas over HTTP or zenoh: see `address`, and `balancer` for what happens when one fails.

`MockTransport` stands in for a service, with any behaviour that a function can have; `FunctionTransport` is a planner
in our own process. The errors are the contract's.
"""

from thinknav_proto import (
    DeadlineExceeded,
    Frame,
    InvalidRequest,
    Overloaded,
    PlannerError,
    PlannerFailed,
    PlannerInfo,
    ProtocolMismatch,
    SubgoalReply,
    SubgoalRequest,
    Unauthenticated,
    Unavailable,
)
from thinknav_trainer.planner.address import read_token
from thinknav_trainer.planner.balancer import Balancer
from thinknav_trainer.planner.client import Answer, Counts, PlannerClient
from thinknav_trainer.planner.connect import connect
from thinknav_trainer.planner.frames import encode_frame
from thinknav_trainer.planner.function_transport import FunctionTransport
from thinknav_trainer.planner.http_transport import HttpTransport
from thinknav_trainer.planner.mock_transport import MockTransport, mock_info, reply_to
from thinknav_trainer.planner.transport import Transport

__all__ = [
    "Answer",
    "Balancer",
    "Counts",
    "DeadlineExceeded",
    "Frame",
    "FunctionTransport",
    "HttpTransport",
    "InvalidRequest",
    "MockTransport",
    "Overloaded",
    "PlannerClient",
    "PlannerError",
    "PlannerFailed",
    "PlannerInfo",
    "ProtocolMismatch",
    "SubgoalReply",
    "SubgoalRequest",
    "Transport",
    "Unauthenticated",
    "Unavailable",
    "connect",
    "encode_frame",
    "mock_info",
    "read_token",
    "reply_to",
]
