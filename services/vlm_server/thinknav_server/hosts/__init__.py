"""Where thinking runs: in a thread, in a process of its own that is restarted, or in the event loop."""

from thinknav_server.hosts.base import Host, Identity
from thinknav_server.hosts.in_loop import AsyncPlanner, PlannerInLoop
from thinknav_server.hosts.process import PlannerProcess
from thinknav_server.hosts.thread import PlannerThread

__all__ = ["AsyncPlanner", "Host", "Identity", "PlannerInLoop", "PlannerProcess", "PlannerThread"]
