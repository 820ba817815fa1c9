"""Follow guided steps on a rig, and show them."""

from collections.abc import Sequence

from rich.console import Console

from cornertouchd.cli.guide_view import GuideView
from cornertouchd.cli.guided_rig import GuidedRig
from cornertouchd.config import Settings
from cornertouchd.guiding.status import Step, StepName
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.rig_watch import watch_rig
from cornertouchd.runtime.stop_signal import StopSignal

STALE_S = 0.25
"""What is shown must be what happens now: a person waits for it."""


def follow(
    step: Step, rig: GuidedRig, settings: Settings, stop: StopSignal, names: Sequence[StepName]
) -> Step:
    """Feed frame sets from step to step until the last, or until the signal comes; return it.

    `names` are those of all steps of the command, in order.
    """
    clock = MonotonicClock()
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    with GuideView(Console(stderr=True), surface_mm, names) as view:
        for frames in watch_rig(rig.ports, settings, stop, view.missing):
            if clock.now_s() - frames[0].captured_at_s > STALE_S:
                continue  # looking takes longer than the pictures to come: catch up
            rig.act(step.status)
            step = step.feed(frames)
            if step.status.step == "done":
                break
            view.show(step.status)
    return step
