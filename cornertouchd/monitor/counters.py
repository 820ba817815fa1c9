"""What the page counts of itself, for Prometheus."""

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Gauge,
    disable_created_metrics,
    generate_latest,
)


class Counters:
    """Counts requests and viewers; owned by the process of the page."""

    def __init__(self) -> None:
        disable_created_metrics()  # type: ignore[no-untyped-call]
        self._registry = CollectorRegistry()
        self._answers = Counter(
            "cornertouchd_page_answers",
            "Answers of the live page to requests, by HTTP status",
            ["status"],
            registry=self._registry,
        )
        self._refused = Counter(
            "cornertouchd_page_refused",
            "What viewers and others were refused, by reason",
            ["reason"],
            registry=self._registry,
        )
        self._lost = Counter(
            "cornertouchd_page_messages_lost",
            "Messages that slow viewers were not sent because newer ones had come",
            registry=self._registry,
        )
        self._viewers = Gauge(
            "cornertouchd_page_viewers", "Browsers that look at present", registry=self._registry
        )

    def answered(self, status: int) -> None:
        """Count an answer."""
        self._answers.labels(status).inc()

    def refused(self, reason: str) -> None:
        """Count a refusal; reasons are few and ours."""
        self._refused.labels(reason).inc()

    def lost(self) -> None:
        """Count a message that one viewer was too slow for."""
        self._lost.inc()

    def viewers(self, count: int) -> None:
        """Tell how many look."""
        self._viewers.set(count)

    def render(self) -> bytes:
        """Return everything in the text format of Prometheus."""
        return generate_latest(self._registry)
