"""Health as Prometheus reads it: text format 0.0.4, base units, one prefix.

docs/metrics.md explains every metric; docs/grafana.json and docs/alerts.yml use them.
"""

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from itertools import accumulate
from typing import Any

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
PREFIX = "cornertouchd_"
STATES = ("healthy", "degraded", "down")

# name, help and key of what is counted by the fusion thread
FUSION_COUNTERS = (
    ("frame_sets", "Frame sets from which touches were told.", "frame_sets"),
    ("frame_sets_partial", "Frame sets that lacked a camera.", "partial"),
    ("frame_sets_skipped", "Frame sets seen by too few cameras to be believed.", "skipped"),
    ("observations_dropped", "Pictures overtaken before they were fused.", "dropped"),
    ("touches_begun", "Touches that began.", "touches_begun"),
    ("ghosts_refused", "Contacts denied by cameras that see light there.", "ghosts"),
    ("fusion_faults", "Faults of the fusion thread.", "faults"),
)
CAMERA_COUNTERS = (
    ("camera_pictures", "Pictures that were understood.", "pictures"),
    ("camera_faults", "Faults of a camera or its pictures.", "faults"),
    ("camera_lost_pictures", "Pictures that the driver lost.", "lost"),
    ("camera_damaged_pictures", "Pictures that arrived damaged.", "damaged"),
    ("camera_unlit_pictures", "Pictures of which it was not known how they were lit.", "left_out"),
    ("camera_reopened", "How often a camera was opened anew.", "reopened"),
    ("camera_resets", "How often a camera was reset.", "resets"),
)
TUIO_COUNTERS = (
    ("tuio_packets", "TUIO packets sent; bundles to all clients of a server.", "packets_sent"),
    ("tuio_errors", "TUIO packets that could not be sent.", "errors"),
    ("tuio_frames_skipped", "Frames that slow clients were not told.", "frames_skipped"),
    ("tuio_refused", "Clients that were sent away.", "refused"),
)
STRIP_GAUGES = (
    ("camera_strip_level", "Mean grey level of the strip, 0 to 255.", "level"),
    ("camera_strip_contrast_ratio", "Contrast of the strip, 0 to 1.", "contrast"),
    ("camera_saturated_ratio", "Share of the strip's columns that are clipped.", "saturated_share"),
)


def render(health: Mapping[str, Any]) -> bytes:
    """Return what `cornertouchd status --json` tells as metrics.

    Of a daemon that is down, that it is.
    """
    registry = CollectorRegistry()
    registry.register(_Told(health))
    return generate_latest(registry)


class _Told(Collector):
    """Everything that one health tells."""

    def __init__(self, health: Mapping[str, Any]) -> None:
        self._health = health

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics."""
        state = self._health.get("state", "down")
        yield _gauge("up", "Whether the daemon answers.", float(state != "down"))
        yield _by_label(
            GaugeMetricFamily,
            "state",
            "1 for the state that the daemon is in.",
            "state",
            [(one, float(one == state)) for one in STATES],
        )
        if state != "down":
            yield from _daemon(self._health)
            yield from _frame_sets(self._health)
            yield from _cameras(self._health["cameras"])
            yield from _destinations(self._health["destinations"])
            if self._health["light"] is not None:
                yield from _light(self._health["light"])


def _daemon(told: Mapping[str, Any]) -> Iterator[Metric]:
    version = GaugeMetricFamily(f"{PREFIX}build_info", "Version of the daemon.", labels=["version"])
    version.add_metric([told["version"]], 1.0)
    yield version
    yield _gauge("uptime_seconds", "Time since the daemon started.", told["up_s"])
    yield _gauge("problems", "Problems that `cornertouchd status` names.", len(told["problems"]))
    yield _gauge("hints", "Hints that `cornertouchd status` gives.", len(told["hints"]))
    used = told["process"]
    yield _counter("cpu_seconds", "Processor time of the daemon.", used["cpu_s"])
    yield _gauge(
        "resident_memory_bytes",
        "Memory of the daemon, kept pictures included.",
        used["memory_bytes"],
    )
    yield _gauge(
        "calibration_timestamp_seconds",
        "When the rig was calibrated, Unix time.",
        datetime.fromisoformat(told["calibrated_at"]).timestamp(),
    )
    yield _gauge(
        "calibration_residual_meters",
        "RMS distance of directing lines from the touches they were calibrated with.",
        told["residual_mm"] / 1000.0,
    )


def _frame_sets(told: Mapping[str, Any]) -> Iterator[Metric]:
    fusion, last = told["fusion"], told["last"]
    for name, text, key in FUSION_COUNTERS:
        yield _counter(name, text, fusion[key])
    yield _gauge("touches", "Touches at present.", fusion["touches_now"])
    yield _gauge("contacts", "Contacts in the last frame set.", last["contacts"])
    yield _gauge(
        "frame_set_skew_seconds",
        "Time between the first and the last picture of the last frame set.",
        last["skew_s"],
    )
    if last["least_support"] is not None:
        yield _gauge(
            "least_support",
            "How firmly the least sure contact of the last frame set is believed, in negative log "
            "likelihood.",
            last["least_support"],
        )
    yield _latency(fusion["latency"])


def _latency(told: Mapping[str, Any]) -> HistogramMetricFamily:
    bounds = [*map(str, told["bounds_s"]), "+Inf"]
    buckets = list(zip(bounds, accumulate(map(float, told["counts"])), strict=True))
    return HistogramMetricFamily(
        f"{PREFIX}latency_seconds",
        "Time from a picture until its touches were sent.",
        buckets=buckets,
        sum_value=told["sum_s"],
    )


def _cameras(told: Sequence[Mapping[str, Any]]) -> Iterator[Metric]:
    for name, text, key in CAMERA_COUNTERS:
        yield _by_label(
            CounterMetricFamily, name, text, "camera", [(one["id"], one[key]) for one in told]
        )
    live = [(one["id"], float(one["live"])) for one in told]
    yield _by_label(GaugeMetricFamily, "camera_live", "Whether it gives pictures.", "camera", live)
    masked = [(one["id"], one["masked_columns"]) for one in told]
    text = "Columns of the strip that are blind: dead LEDs, glare."
    yield _by_label(GaugeMetricFamily, "camera_masked_columns", text, "camera", masked)
    for name, text, key in STRIP_GAUGES:
        read = [(one["id"], one["strip"][key]) for one in told if one["strip"] is not None]
        yield _by_label(GaugeMetricFamily, name, text, "camera", read)


def _destinations(told: Sequence[Mapping[str, Any]]) -> Iterator[Metric]:
    for name, text, key in TUIO_COUNTERS:
        yield _by_destination(CounterMetricFamily, name, text, key, told)
    serving = [one for one in told if one["clients"] is not None]
    text = "Clients that are connected; over UDP nobody knows."
    yield _by_destination(GaugeMetricFamily, "tuio_clients", text, "clients", serving)


def _light(told: Mapping[str, Any]) -> Iterator[Metric]:
    armed = told["controller"] == "armed"
    yield _gauge("led_frame_armed", "Whether the LED frame shines.", float(armed))
    yield _gauge("led_frame_faults", "Faults that its controller reports.", len(told["faults"]))
    yield _gauge("led_frame_dimmed", "Whether it is dimmed.", float(told["dimmed"]))
    yield _counter("led_frame_connections", "How often it was connected.", told["connections"])
    yield _counter(
        "led_frame_bad_messages",
        "Messages of its controller that were garbled.",
        told["bad_messages"],
    )
    if told["temperature_c"] is not None:
        yield _gauge(
            "led_frame_temperature_celsius", "Temperature of its controller.", told["temperature_c"]
        )


def _gauge(name: str, text: str, value: float) -> GaugeMetricFamily:
    return GaugeMetricFamily(f"{PREFIX}{name}", text, value=value)


def _counter(name: str, text: str, value: float) -> CounterMetricFamily:
    return CounterMetricFamily(f"{PREFIX}{name}", text, value=value)


def _by_label(
    family: type[GaugeMetricFamily] | type[CounterMetricFamily],
    name: str,
    text: str,
    label: str,
    values: Sequence[tuple[str, float]],
) -> GaugeMetricFamily | CounterMetricFamily:
    metric = family(f"{PREFIX}{name}", text, labels=[label])
    for one, value in values:
        metric.add_metric([one], value)
    return metric


def _by_destination(
    family: type[GaugeMetricFamily] | type[CounterMetricFamily],
    name: str,
    text: str,
    key: str,
    told: Sequence[Mapping[str, Any]],
) -> GaugeMetricFamily | CounterMetricFamily:
    metric = family(f"{PREFIX}{name}", text, labels=["destination", "transport"])
    for one in told:
        metric.add_metric([f"{one['host']}:{one['port']}", one["transport"]], one[key])
    return metric
