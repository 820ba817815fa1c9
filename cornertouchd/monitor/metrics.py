"""Health as Prometheus reads it."""

from collections.abc import Mapping

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"


def render(health: Mapping[str, object]) -> bytes:
    """Return what is told of the daemon."""
    return f"# {len(health)}\n".encode()
