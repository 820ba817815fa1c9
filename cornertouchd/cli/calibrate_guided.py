"""The guided calibration: watch the cameras, lead through the steps, save, check."""

import os
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import click
from rich.console import Console

from cornertouchd.calibration.board_sights import BoardSight
from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import Calibration, CalibrationError, Method
from cornertouchd.calibration.display import DisplayPlace
from cornertouchd.calibration.error_picture import draw_error_map
from cornertouchd.calibration.file import load_calibration
from cornertouchd.calibration.methods import make_calibration
from cornertouchd.cli.calibration_report import camera_table, light_table
from cornertouchd.cli.calibration_result import tell_and_save
from cornertouchd.cli.following import follow, shown_page
from cornertouchd.cli.guided_rig import GuidedRig, guided_rig, whole_picture_rig
from cornertouchd.cli.working import write_picture
from cornertouchd.config import Settings
from cornertouchd.guiding.board_holding import HeldBoards, HoldBoards
from cornertouchd.guiding.finger_watch import FingerWatch
from cornertouchd.guiding.guide import CheckCameras, Done, Plan
from cornertouchd.guiding.progress import TapStore
from cornertouchd.guiding.status import StepName
from cornertouchd.guiding.strip_picture import draw_strip_statistics
from cornertouchd.guiding.validation import Validated, Validation
from cornertouchd.model import FloatArray
from cornertouchd.runtime.assembly import calibration_file
from cornertouchd.runtime.displays import find_displays
from cornertouchd.runtime.guide_feed import GuideFeed
from cornertouchd.runtime.stamping import stamp_now
from cornertouchd.runtime.stop_signal import StopSignal

STEPS: dict[Method, tuple[StepName, ...]] = {
    "auto": ("cameras", "empty", "taps", "scribble", "check"),
    "lookup-table": ("cameras", "empty", "taps", "check"),
    "vanishing-point": ("cameras", "empty", "taps", "check"),
    "reconstruction": ("boards", "cameras", "empty", "taps", "check"),
}


@dataclass(frozen=True)
class GuideOptions:
    """What the user asked for; `plan` is that of the board, if the method needs one."""

    output: Path
    method: Method
    targets_mm: FloatArray
    tap_sigma_mm: float
    limit_mm: float
    check: bool
    anew: bool
    error_map: Path | None
    strip_picture: Path | None
    simulate: bool
    finger: Path | None
    plan: BoardPlan | None
    page: bool


def calibrate_guided(settings: Settings, options: GuideOptions) -> None:
    """Lead through a calibration and save it.  Raises `click.ClickException` if it fails."""
    console = Console(stderr=True)
    with ExitStack() as opened:
        rig = opened.enter_context(guided_rig(settings, options.simulate, options.finger))
        stop = opened.enter_context(StopSignal())
        page = opened.enter_context(shown_page(settings, options.page, _display(settings)))
        boards = _hold_boards(settings, options, options.plan, stop, page) if options.plan else ()
        store = _store(rig, settings, options)
        first = CheckCameras(_plan(settings, options, store, boards))
        done = follow(first, rig, settings, stop, STEPS[options.method], page)
        if not isinstance(done, Done):
            raise click.ClickException(_how_to_go_on(store, options))
        given = replace(done.given, identities=identities_of(rig))  # all cameras are there now
        calibration = make_calibration(options.method, given, done.fitted, stamp_now())
        console.print(camera_table(done.checks))
        console.print(light_table(tuple(done.empty.statistics.values())))
        tell_and_save(console, calibration, given, done.fitted, options.output)
        store.forget()
        _draw(done, calibration, options)
        if options.check:
            watch = FingerWatch(done.empty.finders, done.fitted.models)
            step = Validation(watch, calibration, settings)
            checked = follow(step, rig, settings, stop, STEPS[options.method], page)
            if isinstance(checked, Validated):
                _tell_end(page, f"saved; a fresh tap is {checked.worst_mm:.1f} mm off at most")
                _judge(console, checked, options.limit_mm)
            else:
                console.print("not checked: stopped before")
        else:
            _tell_end(page, "saved")


def _hold_boards(
    settings: Settings,
    options: GuideOptions,
    plan: BoardPlan,
    stop: StopSignal,
    page: GuideFeed | None,
) -> tuple[BoardSight, ...]:
    """Return sights of the board that is held before the cameras.  Raises `ClickException`."""
    with whole_picture_rig(settings, options.simulate, plan) as rig:
        first = HoldBoards(plan, {port.id: port.format for port in rig.ports})
        held = follow(first, rig, settings, stop, STEPS[options.method], page)
    if not isinstance(held, HeldBoards):
        raise click.ClickException("stopped; nothing was saved")
    return held.sights


def identities_of(rig: GuidedRig) -> dict[str, str]:
    """Return what tells each camera from others of its kind."""
    return {port.id: port.identity for port in rig.ports}


def _store(rig: GuidedRig, settings: Settings, options: GuideOptions) -> TapStore:
    """Return where taps are kept until the calibration is saved."""
    path = options.output.with_name(f"{options.output.name}.taps")
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    formats = {port.id: port.format for port in rig.ports}
    store = TapStore(path, surface_mm, formats, lambda: identities_of(rig))
    if options.anew:
        store.forget()
    return store


def _plan(
    settings: Settings, options: GuideOptions, store: TapStore, boards: tuple[BoardSight, ...]
) -> Plan:
    return Plan(
        options.method,
        store.surface_mm,
        store.formats,
        options.targets_mm,
        options.tap_sigma_mm,
        settings.vision,
        store,
        boards,
        _in_force(options.output),
    )


def _in_force(path: Path) -> Calibration | None:
    """Return the calibration that is to be replaced; none if it cannot be used anyway."""
    if not path.exists():
        return None
    try:
        return load_calibration(path)
    except CalibrationError:
        return None


def _how_to_go_on(store: TapStore, options: GuideOptions) -> str:
    kept = len(store.load(options.targets_mm))
    if not kept:
        return "stopped; nothing was saved"
    taps = "1 tap is" if kept == 1 else f"{kept} taps are"
    return f"stopped; {taps} kept: start again to go on, --anew to begin anew"


def _display(settings: Settings) -> DisplayPlace | None:
    """Return where the display lies; nowhere if that cannot be used, for it is found out anew."""
    try:
        return find_displays(settings, calibration_file(settings, os.environ)).get("")
    except CalibrationError:
        return None


def _tell_end(page: GuideFeed | None, said: str) -> None:
    if page is not None:
        page.finish(said)


def _draw(done: Done, calibration: Calibration, options: GuideOptions) -> None:
    """Write the pictures that were asked for.  Raises `click.ClickException`."""
    if options.error_map is not None:
        write_picture(options.error_map, draw_error_map(calibration))
    if options.strip_picture is not None:
        statistics = tuple(done.empty.statistics.values())
        write_picture(options.strip_picture, draw_strip_statistics(statistics))


def _judge(console: Console, checked: Validated, limit_mm: float) -> None:
    """Print the errors; raise `click.ClickException` if one is over the limit."""
    for place in checked.places:
        verdict = "good" if place.off_mm <= limit_mm else "too far off"
        console.print(f"{place.name:>12}: {place.off_mm:.2f} mm, {verdict}", highlight=False)
    if checked.worst_mm > limit_mm:
        raise click.ClickException(
            f"a tap was located {checked.worst_mm:.1f} mm off, {limit_mm:g} mm are allowed: "
            "calibrate again, or bring the former one back with `cornertouchd calibrate --rollback`"
        )
