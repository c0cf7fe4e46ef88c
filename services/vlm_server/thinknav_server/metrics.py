"""The service's Prometheus metrics, each explained in docs/metrics.md.

Every service has a registry of its own, so that several can live in one process. Knows nothing of HTTP.
"""

from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, Info, generate_latest

from thinknav_proto import PlannerError, SubgoalReply

_SECONDS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0)
_SIZES = (1, 2, 4, 8, 16, 32, 64, 128, 256)

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"


class Metrics:
    """What is counted where it happens; what can be read at any time is read when the metrics are."""

    def __init__(self) -> None:
        self._registry = registry = CollectorRegistry()
        self._requests = Counter(
            "thinknav_requests", "Requests for subgoals, by outcome.", ["outcome"], registry=registry
        )
        self._seconds = Histogram(
            "thinknav_request_seconds",
            "Seconds that answered requests took, by stage.",
            ["stage"],
            buckets=_SECONDS,
            registry=registry,
        )
        stages = ("total", "queued", "planned", "embedded")
        self._total, self._queued, self._planned, self._embedded = map(self._seconds.labels, stages)
        self._batch_size = Histogram("thinknav_batch_size", "Requests in a batch.", buckets=_SIZES, registry=registry)
        self._batch_seconds = Histogram(
            "thinknav_batch_seconds", "Seconds that a batch took.", buckets=_SECONDS, registry=registry
        )
        self._saved = Counter(
            "thinknav_saved",
            "Requests answered without asking the planner: from the cache, or with an identical one.",
            ["how"],
            registry=registry,
        )
        self._gauges = {
            name: Gauge(f"thinknav_{name}", text, registry=registry)
            for name, text in (
                ("queue_length", "Requests that nobody works on yet."),
                ("in_flight", "Requests that were admitted and are not answered yet."),
                ("cache_entries", "Answers in the cache."),
                ("ready", "1 while requests are answered, else 0."),
                ("planner_restarts", "How often the planner's process was started again."),
            )
        }
        self._info = Info("thinknav_planner", "Who plans.", registry=registry)

    def describe(self, **labels: str) -> None:
        """Who plans."""
        self._info.info(labels)

    def watch(self, **readings: Callable[[], float]) -> None:
        """Where gauges find their values."""
        for name, reading in readings.items():
            self._gauges[name].set_function(reading)

    def batch(self, size: int, seconds: float) -> None:
        """The planner answered a batch."""
        self._batch_size.observe(size)
        self._batch_seconds.observe(seconds)

    def saved(self, how: str) -> None:
        """The planner was not asked: "cache" or "shared"."""
        self._saved.labels(how).inc()

    def answer(self, answer: SubgoalReply | PlannerError, seconds: float) -> None:
        """A request was answered, `seconds` after it was read."""
        if isinstance(answer, PlannerError):
            self._requests.labels(answer.code).inc()
            return
        self._requests.labels("ok").inc()
        self._total.observe(seconds)
        self._queued.observe(answer.timings.queued)
        self._planned.observe(answer.timings.planned)
        self._embedded.observe(answer.timings.embedded)

    def exposition(self) -> bytes:
        """All metrics in Prometheus' text format."""
        return generate_latest(self._registry)
