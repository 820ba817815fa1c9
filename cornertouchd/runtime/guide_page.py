"""A guided calibration on a page: served while it runs, as the live page is by the daemon."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from cornertouchd.calibration.display import DisplayPlace
from cornertouchd.config import Settings
from cornertouchd.monitor.options import PageOptions
from cornertouchd.places import runtime_directory
from cornertouchd.ports import Clock
from cornertouchd.runtime.asking import AskSocket, document
from cornertouchd.runtime.guide_feed import GuideFeed
from cornertouchd.runtime.monitor_process import MonitorProcess, page_options

SOCKET_NAME = "calibrate.sock"
"""A daemon that still runs keeps its own."""

LOOK_EVERY_S = 0.2
LAST_WORDS_S = 0.3
"""Until the last word has reached the pages, before they are no longer served."""


@contextmanager
def guide_page(
    settings: Settings,
    environ: Mapping[str, str],
    clock: Clock,
    display: DisplayPlace | None = None,
    inset: float = 0.0,
) -> Iterator[tuple[GuideFeed, str]]:
    """Serve the page; yield what it is told through, and its address.

    It is served at the place of the live page, with its token.
    """
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    feed = GuideFeed(surface_mm, clock, display, inset)
    path = runtime_directory(environ) / SOCKET_NAME
    monitor = settings.monitor.model_copy(update={"enabled": True, "allow_actions": False})
    options = page_options(settings.model_copy(update={"monitor": monitor}), path, environ)
    assert options is not None  # noqa: S101  it is enabled
    stop = threading.Event()
    serving = threading.Thread(target=_serve, args=(options, clock, stop), daemon=True)
    with AskSocket(path, {"hello": document(feed.hello), "guide": feed}):
        serving.start()
        try:
            yield feed, f"{options.address}targets"
        finally:
            stop.wait(LAST_WORDS_S)
            stop.set()
            serving.join()


def _serve(options: PageOptions, clock: Clock, stop: threading.Event) -> None:
    with MonitorProcess(lambda: options, clock, lambda _: None) as process:
        while not stop.wait(LOOK_EVERY_S):
            process.look()
