"""Touches on four USB cameras arrive at a client, where the fingers are."""

import time

import pytest
from guest.client import TuioClient, compare
from guest.running import RunningDaemon
from uvc.rig import UvcRig
from uvc.show import LOOP_S, Show

WATCH_S = 3 * LOOP_S


@pytest.mark.timeout(240)
def test_touches_arrive_where_fingers_are(
    show: Show, rig: UvcRig, client: TuioClient, daemon: RunningDaemon
) -> None:
    began_s = time.monotonic()
    time.sleep(WATCH_S)
    seen = compare(client, show, rig, (began_s, began_s + WATCH_S), near_mm=1.0)
    print(
        f"\n{len(seen.errors_mm)} places, error median {seen.error_mm(0.5):.2f} mm, "
        f"95 % {seen.error_mm(0.95):.2f} mm, {seen.ids} touches, "
        f"not shown {seen.missing_s:.1f} of {seen.down_s:.1f} s, {client.lost_frames} frames lost"
    )
    assert not seen.wrong
    assert seen.error_mm(0.5) < 0.3
    # One finger stays down, two land once a loop.
    assert seen.ids >= 1 + 2 * (WATCH_S // LOOP_S - 1)
    assert seen.missing_s < seen.down_s / 10
    assert client.lost_frames == 0
