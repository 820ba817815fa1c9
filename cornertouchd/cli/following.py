"""Follow guided steps on a rig, and show them."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import inf

import click
from rich.console import Console

from cornertouchd.calibration.display import DisplayPlace
from cornertouchd.cli.guide_view import GuideView
from cornertouchd.cli.guided_rig import GuidedRig
from cornertouchd.config import Settings
from cornertouchd.guiding.status import Result, Status, Step, StepName
from cornertouchd.ports import CameraError
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.guide_feed import GuideFeed
from cornertouchd.runtime.guide_page import guide_page
from cornertouchd.runtime.rig_watch import watch_rig
from cornertouchd.runtime.stop_signal import StopSignal

BEHIND_S = 0.25
"""What is shown must be what happens now, for a person waits for it.  Pictures that come so much
later than others did are left out: looking took longer than they did."""


@contextmanager
def shown_page(
    settings: Settings, wanted: bool, display: DisplayPlace | None = None, inset: float = 0.0
) -> Iterator[GuideFeed | None]:
    """Serve what to do as a page and say where, if that is wanted; yield what it is told through.

    `display` and `inset` as for `GuideFeed`.
    """
    if not wanted:
        yield None
        return
    with guide_page(settings, os.environ, MonotonicClock(), display, inset) as (feed, address):
        click.echo(f"what to do is shown at {address}, too", err=True)
        yield feed


def follow(
    step: Step,
    rig: GuidedRig,
    settings: Settings,
    stop: StopSignal,
    names: Sequence[StepName],
    page: GuideFeed | None = None,
) -> Result | None:
    """Feed frame sets from step to step; return the result, None if the signal came before.

    `names` are those of all steps of the command, in order.  What is shown in the terminal is told
    to `page`, too.  Dark frames are left out.
    """
    clock = MonotonicClock()
    shortest_delay_s = inf
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    with GuideView(Console(stderr=True), surface_mm, names) as view:
        shown: list[GuideView | GuideFeed] = [view]
        if page is not None:
            page.begin(names)
            shown.append(page)

        def show(status: Status) -> None:
            for one in shown:
                one.show(status)

        def missing(errors: Sequence[CameraError]) -> None:
            for one in shown:
                one.missing(errors)

        show(step.status)
        for frames in watch_rig(rig.ports, settings, stop, missing):
            delay_s = clock.now_s() - frames[0].captured_at_s
            shortest_delay_s = min(shortest_delay_s, delay_s)
            dark = any(frame.lit_mask == 0 for frame in frames)
            if dark or delay_s - shortest_delay_s > BEHIND_S:
                continue
            rig.act(step.status)
            following = step.feed(frames)
            if isinstance(following, Result):
                return following
            step = following
            show(step.status)
    return None
