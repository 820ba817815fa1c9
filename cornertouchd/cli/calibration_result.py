"""The end of every calibration: what it is worth, against the one in force; then it is saved."""

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.text import Text

from cornertouchd.calibration.auto import NOMINAL_POSITION_MM
from cornertouchd.calibration.calibration import Calibration, CalibrationError
from cornertouchd.calibration.comparison import compare
from cornertouchd.calibration.file import load_calibration, save_calibration
from cornertouchd.calibration.fitted import Fitted
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.cli.calibration_report import calibration_report, comparison_table

POOR_MM = 1.0
"""Fingers find targets of some millimetres; the crossing of ten needs .6 mm to refuse ghosts."""


def tell_and_save(
    console: Console,
    calibration: Calibration,
    given: ReferenceTouches,
    fitted: Fitted,
    output: Path,
) -> None:
    """Print result, comparison and verdict, and save.  Raises `CalibrationError`."""
    console.print(calibration_report(calibration, given, fitted))
    if output.exists():
        try:
            console.print(comparison_table(compare(load_calibration(output), calibration)))
        except CalibrationError as error:
            console.print(f"not compared with the one in force: {error}", highlight=False)
    poor = why_poor(calibration)
    if poor:
        console.print(Text(poor, "bold yellow"))
    save_calibration(calibration, output)
    console.print(f"saved {output}", highlight=False, soft_wrap=True)


def why_poor(calibration: Calibration) -> str:
    """Return what is wrong with a calibration that can be used but is not good; else nothing."""
    off_mm = np.nanmax([calibration.expected.rms_mm, calibration.residual_mm, 0.0])
    if off_mm <= POOR_MM:
        return ""
    told = f"touches will be off by about {off_mm:.1f} mm, under {POOR_MM:g} mm is good: "
    if calibration.method != "auto":
        return told + "the method does not suit these lenses; take --method auto"
    if not calibration.reference_points:
        return told + (
            "without taps the cameras are assumed in their corners, to "
            f"{NOMINAL_POSITION_MM:g} mm; tap to know better"
        )
    return told + "see which taps have large residuals, tap more places, add a scribble"
