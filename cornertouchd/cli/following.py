"""Follow guided steps on a rig, and show them."""

from collections.abc import Sequence
from math import inf

from rich.console import Console

from cornertouchd.cli.guide_view import GuideView
from cornertouchd.cli.guided_rig import GuidedRig
from cornertouchd.config import Settings
from cornertouchd.guiding.status import Result, Step, StepName
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.rig_watch import watch_rig
from cornertouchd.runtime.stop_signal import StopSignal

BEHIND_S = 0.25
"""What is shown must be what happens now, for a person waits for it.  Pictures that come so much
later than others did are left out: looking took longer than they did."""


def follow(
    step: Step, rig: GuidedRig, settings: Settings, stop: StopSignal, names: Sequence[StepName]
) -> Result | None:
    """Feed frame sets from step to step; return the result, None if the signal came before.

    `names` are those of all steps of the command, in order.  Dark frames are left out.
    """
    clock = MonotonicClock()
    shortest_delay_s = inf
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    with GuideView(Console(stderr=True), surface_mm, names) as view:
        view.show(step.status)
        for frames in watch_rig(rig.ports, settings, stop, view.missing):
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
            view.show(step.status)
    return None
