"""What a report for support is gathered from."""

import json
import os
import platform
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from cornertouchd.cli.camera_table import survey_json
from cornertouchd.cli.check import find_all
from cornertouchd.config import Settings
from cornertouchd.devices.camera_abilities import look_at_node
from cornertouchd.devices.camera_survey import survey_cameras
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.errors import ReportedError
from cornertouchd.runtime.asking import read_document
from cornertouchd.runtime.assembly import calibration_file
from cornertouchd.runtime.checks.installation import environment_of, output_of, unit_for
from cornertouchd.runtime.displays import display_file
from cornertouchd.runtime.kept_recorder import KeptRecorder
from cornertouchd.runtime.support_report import Files, Part, blanked

JOURNAL_LINES = 2000
SURVEYED_SOURCES = ("v4l2", "opencv")


class MissingError(ReportedError):
    """A part of the report is not there; the text says why."""


def parts_of(
    config_file: Path | None, settings: Settings, daemon: Path | None, last_s: float
) -> tuple[Part, ...]:
    """Return the parts of a report; `daemon` is its socket, None if none runs."""
    unit = unit_for(config_file)
    calibration = calibration_file(settings, environment_of(unit, os.environ))
    return (
        Part("configuration, tokens left out", lambda: _configuration(config_file)),
        Part("calibration", lambda: _file(calibration, "calibration.json")),
        Part("places of displays", lambda: _displays(calibration)),
        Part("how the daemon does", lambda: _told(daemon, "status")),
        Part("what the daemon is", lambda: _told(daemon, "hello")),
        Part("its last log lines", lambda: _log(daemon)),
        Part("what `cornertouchd check` finds", lambda: _check(config_file)),
        Part("versions", _versions),
        Part("cameras of this machine", lambda: _cameras(settings)),
        Part("journal of the service", lambda: _journal(unit)),
        Part("last lines of the kernel", _kernel),
        Part(
            f"the last {last_s:g} s of all strips, as a recording",
            lambda: _recording(daemon, last_s),
        ),
    )


def _configuration(path: Path | None) -> Files:
    if path is None:
        raise MissingError("none: every setting at its default")
    yield "cornertouchd.toml", blanked(path.read_text(encoding="utf-8")).encode()


def _displays(calibration: Path) -> Files:
    only = display_file(calibration)
    found = [only, *sorted(calibration.parent.glob(display_file(calibration, "*").name))]
    for path in [path for path in found if path.exists()] or [only]:
        yield from _file(path, path.name)


def _file(path: Path, name: str) -> Files:
    try:
        yield name, path.read_bytes()
    except OSError as error:
        raise MissingError(f"{path}: {error.strerror}") from error


def _required(daemon: Path | None) -> Path:
    if daemon is None:
        raise MissingError("no daemon runs with this configuration, or it may not be asked")
    return daemon


def _ask(daemon: Path | None, what: str) -> dict[str, Any]:
    path = _required(daemon)
    try:
        return read_document(path, what)
    except OSError as error:
        raise MissingError(f"{path}: no daemon answers: {error.strerror or error}") from error


def _told(daemon: Path | None, what: str) -> Files:
    yield f"{what}.json", json.dumps(_ask(daemon, what), indent=1).encode()


def _log(daemon: Path | None) -> Files:
    lines = _ask(daemon, "log")["lines"]
    said = (
        f"{datetime.fromtimestamp(line['at'], UTC).isoformat()} {line['level']} {line['text']}\n"
        for line in lines
    )
    yield "log.txt", "".join(said).encode()


def _check(config_file: Path | None) -> Files:
    findings = [asdict(finding) for finding in find_all(config_file)]
    yield "check.json", json.dumps(findings, indent=1).encode()


def _versions() -> Files:
    packages = sorted({f"{one.name} {one.version}" for one in distributions()}, key=str.lower)
    try:
        system = platform.freedesktop_os_release().get("PRETTY_NAME", "")
    except OSError:
        system = ""
    versions = {
        "python": sys.version,
        "machine": " ".join(platform.uname()[2:]),
        "system": system,
        "packages": packages,
    }
    yield "versions.json", json.dumps(versions, indent=1).encode()


def _cameras(settings: Settings) -> Files:
    if settings.cameras.source not in SURVEYED_SOURCES:
        raise MissingError(f"cameras.source is {settings.cameras.source}")
    size_px = (settings.cameras.width_px, settings.cameras.height_px)
    look = partial(
        look_at_node,
        pixel_format=settings.cameras.pixel_format,
        size_px=size_px,
        rate_hz=settings.cameras.rate_hz,
    )
    survey = survey_json(survey_cameras(settings.cameras, look))
    yield "cameras.json", json.dumps(survey, indent=1).encode()


def _journal(unit: str) -> Files:
    said = output_of("journalctl", f"--unit={unit}", f"--lines={JOURNAL_LINES}", "--no-pager")
    if not said or said.startswith("-- No entries"):
        raise MissingError(
            f"nothing of {unit}; to read it, be in the group systemd-journal, or root"
        )
    yield "journal.txt", said.encode()


def _kernel() -> Files:
    said = output_of("journalctl", "--dmesg", "--lines=500", "--no-pager") or output_of("dmesg")
    if not said:
        raise MissingError("this user may not read them")
    yield "kernel.txt", said.encode()


def _recording(daemon: Path | None, last_s: float) -> Files:
    path = _required(daemon)
    with tempfile.TemporaryDirectory(prefix="cornertouchd-report-") as place:
        directory = Path(place) / "strips"
        count = _record(path, last_s, directory)
        if not count:
            raise MissingError("the daemon keeps no pictures (monitor.keep_s), or had none")
        yield from _files(directory)


def _record(daemon: Path, last_s: float, directory: Path) -> int:
    """Record what the daemon keeps; return how many frame sets that were."""
    count = 0
    try:
        asked = KeptRecorder(daemon, last_s, 0.0)
    except OSError as error:
        raise MissingError(f"{daemon}: no daemon answers: {error.strerror or error}") from error
    with asked as recorder:
        head = recorder.head
        identities = {camera.id: camera.identity for camera in head.cameras}
        with RecordingWriter(
            directory, head.surface_mm, head.rate_hz, recorder.formats, "report", identities
        ) as writer:
            for frames in recorder.frame_sets(lambda: False):
                writer.write(frames)
                count += 1
    return count


def _files(directory: Path) -> Iterator[tuple[str, bytes]]:
    for file in sorted(directory.iterdir()):
        yield f"{directory.name}/{file.name}", file.read_bytes()
