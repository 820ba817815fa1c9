"""What a calibration found, as tables for a terminal of 80 columns."""

from collections.abc import Sequence

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.comparison import Comparison
from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.calibration.fitted import Fitted, rms
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.guiding.checking import CameraCheck
from cornertouchd.guiding.light_statistics import LightStatistics
from cornertouchd.model import FloatArray

STYLES = {"good": "green", "doubtful": "yellow", "bad": "bold red"}

COARSE = 5
"""Places along either side of the table of errors."""

MOST_TAPS = 30
"""Of more taps only the worst are listed: the 225 of the paper's methods fill ten screens."""


def camera_table(checks: Sequence[CameraCheck]) -> RenderableType:
    """Return a row for each camera, and below them what is to be changed."""
    table = _table("cameras", "verdict", "level", "at full scale", "stray light", "flicker", "blur")
    for check in checks:
        light = check.light
        numbers = ["-"] * 5
        if light is not None:
            numbers = [
                f"{light.level_share:.0%}",
                f"{light.saturated_share:.1%}",
                _known(light.ambient_share, ".1%"),
                f"{light.flicker_share:.1%}",
                _known(light.blur_px, ".1f", " px"),
            ]
        table.add_row(check.camera, Text(check.verdict, STYLES[check.verdict]), *numbers)
    findings = [
        Text.assemble(
            (f"{check.camera} {finding.severity}: ", STYLES[finding.severity]), finding.text
        )
        for check in checks
        for finding in check.findings
    ]
    return Group(table, *findings)


def light_table(statistics: Sequence[LightStatistics]) -> RenderableType:
    """Return the empty strip of each camera: range, noise, T1 of the paper, dim LEDs."""
    table = _table("empty strip", "grey levels", "signal/noise", "largest gradient", "T1")
    lines = []
    for one in statistics:
        table.add_row(
            one.camera,
            f"{np.nanpercentile(one.minimum, 2):.0f} to {np.nanmax(one.maximum):.0f}",
            f"{one.signal_to_noise:.0f}",
            f"{one.strip_gradient:.0f}",
            "none" if one.suggested_t1 is None else f"{one.suggested_t1:.0f}",
        )
        if one.suggested_t1 is None:
            lines.append(
                f"{one.camera}: no T1 keeps fingers (gradient {one.finger_gradient:.0f}) apart "
                'from the strip; leave vision.edges at "profile"'
            )
        if one.dim_runs:
            runs = (f"{run.first_px}-{run.last_px} ({run.share:.0%})" for run in one.dim_runs)
            lines.append(f"{one.camera}: dim LEDs at columns {', '.join(runs)} of the usual light")
    return Group(table, *map(Text, lines))


def residual_table(given: ReferenceTouches, fitted: Fitted) -> RenderableType:
    """Return how well the lines of each camera meet the touches."""
    table = _table("residuals", "position mm", "touches seen", "dropped", "residual mm")
    seen = given.touches.seen
    for number, (camera, model) in enumerate(zip(given.formats, fitted.models, strict=True)):
        x, y = model.position_mm
        table.add_row(
            camera,
            f"{x:.1f}, {y:.1f}",
            f"{np.count_nonzero(seen[number])} of {seen.shape[1]}",
            str(np.count_nonzero(fitted.dropped[number])),
            _known(rms(fitted.residuals_mm[number]), ".3f"),
        )
    return table


def tap_table(given: ReferenceTouches, fitted: Fitted) -> RenderableType:
    """Return how far each tap is from the lines that see it; of many taps the worst."""
    taps = np.flatnonzero(given.touches.known)
    residuals = fitted.residuals_mm[:, taps]
    sizes = np.array([rms(tap) for tap in residuals.T])
    listed = np.arange(len(taps))
    title = "taps"
    if len(taps) > MOST_TAPS:
        listed = np.argsort(-np.nan_to_num(sizes, nan=np.inf), kind="stable")[:MOST_TAPS]
        title = f"taps (the worst {MOST_TAPS} of {len(taps)})"
    table = _table(title, "place mm", "residual mm", "worst camera", "dropped")
    cameras = tuple(given.formats)
    for number in listed.tolist():
        x, y = given.touches.points_mm[taps[number]]
        left_out = [
            camera
            for camera, dropped in zip(cameras, fitted.dropped[:, taps[number]], strict=True)
            if dropped
        ]
        table.add_row(
            str(number + 1),
            f"{x:.0f}, {y:.0f}",
            _known(float(sizes[number]), ".3f"),
            _worst_camera(cameras, residuals[:, number]),
            Text(", ".join(left_out), STYLES["doubtful"]),
        )
    return table


def error_table(expected: ErrorMap) -> RenderableType:
    """Return the expected errors in mm, a few places along either side."""
    rows, columns = (
        np.rint(np.linspace(0, count - 1, COARSE)).astype(int).tolist()
        for count in expected.errors_mm.shape
    )
    table = _table("expected error mm", *(f"x {expected.x_mm[column]:.0f}" for column in columns))
    for row in rows:
        errors = expected.errors_mm[row, columns].tolist()
        table.add_row(f"y {expected.y_mm[row]:.0f}", *(_known(error, ".2f") for error in errors))
    return Group(
        table,
        Text(
            f"RMS {_known(expected.rms_mm, '.2f')} mm, worst {_known(expected.worst_mm, '.2f')} mm"
        ),
    )


def comparison_table(comparison: Comparison) -> RenderableType:
    """Return what has changed against the calibration in force, and a verdict."""
    table = _table(
        "against the one in force", "position changed mm", "turned deg", "lines apart mm"
    )
    for shift in comparison.cameras:
        style = STYLES["doubtful" if shift.moved else "good"]
        table.add_row(
            shift.camera,
            "{:+.2f}, {:+.2f}".format(*shift.moved_mm),
            _known(shift.turned_deg, "+.3f"),
            Text(_known(shift.lines_mm, ".2f"), style),
        )
    former, new = comparison.expected_mm
    lines = [
        f"expected error (RMS): {_known(former, '.2f')} mm before, {_known(new, '.2f')} mm now"
    ]
    if np.isfinite(comparison.apart_rms_mm):
        x, y = comparison.worst_at_mm
        lines.append(
            f"the same touch is located {comparison.apart_rms_mm:.2f} mm apart (RMS), "
            f"{comparison.apart_worst_mm:.2f} mm at worst, at {x:.0f}, {y:.0f}"
        )
    return Group(table, *map(Text, lines), Text(comparison.verdict, "bold"))


def calibration_report(
    calibration: Calibration, given: ReferenceTouches, fitted: Fitted
) -> RenderableType:
    """Return all that speaks for or against a calibration that was just made."""
    parts = [residual_table(given, fitted)]
    if calibration.reference_points:
        parts.append(tap_table(given, fitted))
    parts.append(error_table(calibration.expected))
    summary = (
        f"method {calibration.method}: {calibration.reference_points} taps, "
        f"{calibration.scribble_points} scribbled; residual "
        f"{_known(calibration.residual_mm, '.3f')} mm"
    )
    return Group(*parts, Text(summary))


def _table(title: str, *columns: str) -> Table:
    """Return a table whose first column is named by its title."""
    table = Table()
    table.add_column(title, overflow="fold")
    for column in columns:
        table.add_column(column, justify="right", overflow="fold")
    return table


def _known(value: float, form: str, unit: str = "") -> str:
    return f"{value:{form}}{unit}" if np.isfinite(value) else "?"


def _worst_camera(cameras: Sequence[str], residuals_mm: FloatArray) -> str:
    if not np.isfinite(residuals_mm).any():
        return "not seen"
    worst = int(np.nanargmax(np.abs(residuals_mm)))
    return f"{cameras[worst]} {residuals_mm[worst]:+.2f}"
