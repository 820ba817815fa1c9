"""What suites in the guest share: the show in the cameras, the daemon on them, a TUIO client.

These run in the guest of tests/system; see docs/kiosk.md.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest
from guest.client import TuioClient, wait_until
from guest.running import STARTS_S, RunningDaemon, write_config
from uvc.rig import UvcRig
from uvc.show import RATE_HZ, Show

SHOW = Path("/host/show")


@pytest.fixture(scope="session")
def show() -> Show:
    """The fingers that all cameras see."""
    return Show.load(SHOW)


@pytest.fixture(scope="module")
def rig(show: Show) -> Iterator[UvcRig]:
    """Four USB cameras that play the show."""
    with UvcRig(show.pictures, RATE_HZ) as rig:
        yield rig


@pytest.fixture(scope="module")
def client() -> Iterator[TuioClient]:
    """A client that listens where the daemon sends to."""
    client = TuioClient()
    yield client
    client.close()


@pytest.fixture(scope="module")
def daemon(
    show: Show, rig: UvcRig, client: TuioClient, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[RunningDaemon]:
    """The daemon, after its first touches have come to the client."""
    config = write_config(tmp_path_factory.mktemp("kiosk") / "cornertouchd.toml", show)
    daemon = RunningDaemon(config)
    wait_until(lambda: bool(client.shown_at(float("inf"))), STARTS_S, "the first touch")
    # its start keeps the only processor busy for seconds
    wait_until(lambda: daemon.has_said("live page: "), STARTS_S, "the live page")
    yield daemon
    assert daemon.stop() == 0
