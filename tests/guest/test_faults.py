"""A camera fails mid-touch: nothing hangs, nothing appears that is not there, all comes back."""

import dataclasses
import json
import time
from pathlib import Path

import pytest
from guest.client import TuioClient, compare
from guest.faults import BACK_S, FAULTS, NEAR_MM, Episode, Fault, live_through
from guest.running import RunningDaemon
from uvc.rig import UvcRig
from uvc.show import CAMERAS, LOOP_S, Show

from cornertouchd.runtime.service import STATUS_EVERY_S

RESULTS = Path("/host/faults.jsonl")
REPLUGS = 20

pytestmark = pytest.mark.timeout(300)


def note(episode: Episode) -> None:
    """Keep what happened for the table of docs/reliability.md."""
    seen = episode.seen
    told = {
        "fault": episode.fault.name,
        "cameras": episode.fault.cameras,
        "said": episode.said,
        "missing_s": round(seen.missing_s, 2),
        "down_s": round(seen.down_s, 2),
        "wrong": seen.wrong,
        "recovered_s": round(episode.recovered_s, 2),
    }
    with RESULTS.open("a") as results:
        results.write(json.dumps(told) + "\n")
    print("\n", told)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_touches_are_true_and_come_back(
    fault: Fault, show: Show, rig: UvcRig, client: TuioClient, daemon: RunningDaemon
) -> None:
    episode = live_through(fault, show, rig, client, daemon)
    note(episode)
    assert daemon.process.poll() is None
    assert not episode.seen.wrong
    assert episode.recovered_s <= fault.recovers_s
    began_s = time.monotonic()
    time.sleep(LOOP_S / 2)
    after = compare(client, show, rig, (began_s, time.monotonic()), NEAR_MM)
    assert not after.wrong
    assert after.missing_s < after.down_s / 5


@pytest.mark.parametrize("camera", CAMERAS)
def test_twenty_replugs_in_a_row(
    camera: str, show: Show, rig: UvcRig, client: TuioClient, daemon: RunningDaemon
) -> None:
    def replug(rig: UvcRig, camera: str) -> None:
        for _ in range(REPLUGS):
            rig.unplug(camera)
            rig.plug(camera)

    fault = dataclasses.replace(
        FAULTS[0], name=f"cable pulled {REPLUGS} times", cameras=(camera,), begin=replug,
        end=lambda rig, camera: None, lasts_s=0.0, recovers_s=BACK_S + STATUS_EVERY_S,
    )  # fmt: skip
    episode = live_through(fault, show, rig, client, daemon)
    note(episode)
    assert not episode.seen.wrong
    assert episode.recovered_s <= fault.recovers_s
