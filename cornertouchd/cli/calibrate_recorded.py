"""Calibrate from recordings."""

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from cornertouchd.calibration.board_sights import BoardSight, find_boards
from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import Method
from cornertouchd.calibration.error_picture import draw_error_map
from cornertouchd.calibration.methods import fit, make_calibration
from cornertouchd.cli.calibration_result import tell_and_save
from cornertouchd.cli.working import write_picture
from cornertouchd.config import Settings
from cornertouchd.devices.recording import Recording, open_recording, read_points
from cornertouchd.runtime.recorded_touches import gather_recorded, require_boards_of
from cornertouchd.runtime.stamping import stamp_now


@dataclass(frozen=True)
class Recordings:
    """Where the parts lie.  Without `taps` the scribble has to do; `points` default to theirs.

    `plan` is that of the board in `boards`.
    """

    empty: Path
    plan: BoardPlan
    taps: Path | None = None
    points: Path | None = None
    scribble: Path | None = None
    boards: Path | None = None


def calibrate_recorded(
    recordings: Recordings,
    method: Method,
    tap_sigma_mm: float,
    settings: Settings,
    output: Path,
    error_map: Path | None,
) -> None:
    """Calibrate and save.  Raises `CalibrationError` or `RecordingError`."""
    taps = open_recording(recordings.taps) if recordings.taps else None
    points_file = recordings.points or (recordings.taps and recordings.taps / "points.csv")
    empty = open_recording(recordings.empty)
    given = gather_recorded(
        taps,
        read_points(points_file) if points_file else (),
        open_recording(recordings.scribble) if recordings.scribble else None,
        empty,
        settings.vision,
        _boards(recordings, empty),
    )
    fitted = fit(method, given, tap_sigma_mm)
    calibration = make_calibration(method, given, fitted, stamp_now())
    tell_and_save(Console(stderr=True), calibration, given, fitted, output)
    if error_map is not None:
        write_picture(error_map, draw_error_map(calibration))


def _boards(recordings: Recordings, empty: Recording) -> tuple[BoardSight, ...]:
    """Return where the board was seen; its pictures may hold more rows than the others."""
    if recordings.boards is None:
        return ()
    recording = open_recording(recordings.boards)
    require_boards_of(empty, recording)
    return find_boards(recordings.plan, recording, recording.formats)
