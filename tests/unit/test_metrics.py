"""Health as Prometheus reads it: every number under its name, in base units."""

import json
from dataclasses import asdict, replace

import pytest
from prometheus_client.parser import text_string_to_metric_families

from cornertouchd.devices.udp_destination import DestinationStatus
from cornertouchd.monitor.metrics import render
from cornertouchd.runtime.fusing import FusionCounts
from cornertouchd.runtime.health import CameraHealth, Health, LastFrameSet, as_json
from cornertouchd.runtime.latency import LatencyHistogram
from cornertouchd.runtime.led_light import LightState
from cornertouchd.runtime.own_process import ProcessUse
from cornertouchd.runtime.strip_readings import StripReading


def health() -> Health:
    latency = LatencyHistogram()
    for latency_s in (0.0045, 0.0055, 0.4):
        latency.note(latency_s)
    fusion = FusionCounts(900, 3, 2, 41, 5, 1, 7, 9000, 12, latency.read())
    camera = CameraHealth("C1", True, 100.0, 905, 4, 1, 2, 6, 8, 0, 17, (), "")
    return Health(
        "healthy",
        (),
        ("the strip moved",),
        10.0,
        100.0,
        fusion,
        (replace(camera, strip=StripReading(150.0, 0.9, 0.02)), replace(camera, id="C2")),
        (
            DestinationStatus("::1", 3333, 1000, 3, None),
            DestinationStatus("::1", 3333, 500, 0, None, "tcp", 2, 7, 1),
        ),
        None,
        LastFrameSet(6, 1, 0.002, 14.5),
        ProcessUse(3.5, 2**28),
        0.35,
        "1.2.3",
        "2026-01-02T03:04:05+00:00",
        0.25,
    )


def told(one: Health) -> dict[tuple[str, str], float]:
    text = render(json.loads(as_json(one))).decode()
    return {
        (sample.name.removeprefix("cornertouchd_"), "".join(sample.labels.values())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


@pytest.mark.parametrize(
    ("name", "label", "value"),
    [
        ("up", "", 1.0),
        ("state", "healthy", 1.0),
        ("state", "degraded", 0.0),
        ("build_info", "1.2.3", 1.0),
        ("hints", "", 1.0),
        ("cpu_seconds_total", "", 3.5),
        ("resident_memory_bytes", "", 2.0**28),
        ("calibration_timestamp_seconds", "", 1767323045.0),
        ("calibration_residual_meters", "", 0.00025),
        ("frame_sets_total", "", 900.0),
        ("ghosts_refused_total", "", 12.0),
        ("observations_dropped_total", "", 7.0),
        ("touches", "", 5.0),
        ("contacts", "", 6.0),
        ("frame_set_skew_seconds", "", 0.002),
        ("least_support", "", 14.5),
        ("latency_seconds_bucket", "0.005", 1.0),
        ("latency_seconds_bucket", "0.25", 2.0),
        ("latency_seconds_bucket", "+Inf", 3.0),
        ("latency_seconds_count", "", 3.0),
        ("latency_seconds_sum", "", 0.41),
        ("camera_pictures_total", "C2", 905.0),
        ("camera_lost_pictures_total", "C1", 6.0),
        ("camera_damaged_pictures_total", "C1", 8.0),
        ("camera_masked_columns", "C1", 17.0),
        ("camera_strip_contrast_ratio", "C1", 0.9),
        ("tuio_packets_total", "::1:3333udp", 1000.0),
        ("tuio_packets_total", "::1:3333tcp", 500.0),
        ("tuio_errors_total", "::1:3333udp", 3.0),
        ("tuio_clients", "::1:3333tcp", 2.0),
        ("tuio_frames_skipped_total", "::1:3333tcp", 7.0),
        ("tuio_refused_total", "::1:3333tcp", 1.0),
    ],
)
def test_what_health_says_is_a_metric(name: str, label: str, value: float) -> None:
    assert told(health())[name, label] == pytest.approx(value)


def test_what_is_not_known_is_left_out() -> None:
    one = health()
    names = {name for name, _ in told(replace(one, last=replace(one.last, least_support=None)))}
    assert "least_support" not in names
    assert not any(name.startswith("led_frame") for name in names)
    assert ("camera_strip_level", "C2") not in told(one)
    assert ("tuio_clients", "::1:3333udp") not in told(one)


def test_an_led_frame_is_told() -> None:
    light = LightState("/dev/ttyACM0", "", (), "constant", (9, 9, 9, 9), True, None, 2, 3, {})
    lost = told(replace(health(), light=light))
    assert (lost["led_frame_armed", ""], lost["led_frame_dimmed", ""]) == (0.0, 1.0)
    assert lost["led_frame_connections_total", ""] == 2.0
    assert ("led_frame_temperature_celsius", "") not in lost
    shining = replace(light, controller="armed", temperature_c=31.5)
    told_of_it = told(replace(health(), light=shining))
    assert told_of_it["led_frame_armed", ""] == 1.0
    assert told_of_it["led_frame_temperature_celsius", ""] == 31.5


@pytest.mark.parametrize("gone", [{}, {"state": "down", "problems": ["no daemon"]}])
def test_of_a_daemon_that_is_down_that_is_told(gone: dict[str, object]) -> None:
    text = render(gone).decode()
    assert "cornertouchd_up 0.0" in text
    assert 'cornertouchd_state{state="down"} 1.0' in text
    assert "frame_sets" not in text


def test_health_is_json_all_through() -> None:
    assert json.loads(as_json(health()))["fusion"] == json.loads(
        json.dumps(asdict(health().fusion))
    )
