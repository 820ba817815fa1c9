"""Four cameras that send YUYV and MJPG: touches are as true, and damage invents none."""

import time
from collections.abc import Iterator

import pytest
from guest.client import TuioClient, compare, wait_until
from guest.faults import NEAR_MM
from guest.running import STARTS_S, RunningDaemon, write_config
from uvc.rig import UvcRig
from uvc.show import CAMERAS, LOOP_S, RATE_HZ, Show

DAMAGED_S = 2.0
MOST_LOOPS = 8
CALM_HZ = RATE_HZ / 2
"""Pictures of twice the bytes, or that are to be decoded, keep a slow guest busy."""


@pytest.fixture(scope="module", params=["YUYV", "MJPG"])
def daemon(
    request: pytest.FixtureRequest,
    show: Show,
    rig: UvcRig,
    client: TuioClient,
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[RunningDaemon]:
    """The daemon on cameras of one format, after its first touches have come to the client."""
    began_s = time.monotonic()
    config = write_config(
        tmp_path_factory.mktemp("kiosk") / "cornertouchd.toml",
        show,
        f'pixel_format = "{request.param}"',
        CALM_HZ,
    )
    daemon = RunningDaemon(config)
    wait_until(lambda: client.has_shown_since(began_s), STARTS_S, "the first touch")
    # its start keeps the only processor busy for seconds
    wait_until(lambda: daemon.has_said("live page: "), STARTS_S, "the live page")
    yield daemon
    assert daemon.stop() == 0


def test_touches_arrive_where_fingers_are(
    show: Show, rig: UvcRig, client: TuioClient, daemon: RunningDaemon
) -> None:
    """What is shown is right from the beginning; a slow guest may take a while to show all."""
    for _ in range(MOST_LOOPS):
        began_s = time.monotonic()
        time.sleep(LOOP_S)
        seen = compare(client, show, rig, (began_s, began_s + LOOP_S), near_mm=1.0)
        print(f"\n{seen}")
        assert not seen.wrong
        if seen.missing_s < seen.down_s / 5:
            break
    else:
        pytest.fail("a fifth of all touches was missing, loop after loop")
    assert seen.error_mm(0.5) < 0.3


@pytest.mark.parametrize("cameras", [("C2",), CAMERAS], ids=["C2", "all"])
def test_pictures_that_lost_bytes_invent_no_touch(
    cameras: tuple[str, ...],
    show: Show,
    rig: UvcRig,
    client: TuioClient,
    daemon: RunningDaemon,
) -> None:
    began_s = time.monotonic()
    for camera in cameras:
        rig.hole(camera, round(DAMAGED_S * CALM_HZ))
    time.sleep(DAMAGED_S)
    for camera in cameras:
        rig.go(camera)
    wait_until(daemon.is_whole, STARTS_S, "all cameras at work")
    time.sleep(LOOP_S / 4)
    seen = compare(client, show, rig, (began_s, time.monotonic()), NEAR_MM)
    print(f"\n{seen}")
    assert daemon.has_said(r"a damaged picture is left out", began_s)
    assert not seen.wrong
    if len(cameras) == 1:
        meanwhile = compare(client, show, rig, (began_s, began_s + DAMAGED_S), NEAR_MM)
        assert meanwhile.missing_s < meanwhile.down_s  # three see on
