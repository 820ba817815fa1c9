"""`cornertouchd calibrate`: options that mean nothing are refused, outputs are looked at first."""

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from cornertouchd.calibration.file import load_calibration
from cornertouchd.cli import main
from cornertouchd.cli.calibration_result import why_poor


def calibrate(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["calibrate", *map(str, arguments)])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--simulate", "--taps-wanted", 17), "must be a square number, such as 16 or 25"),
        (("--simulate", "--method", "vanishing-point", "--taps-wanted", 4), "needs 9 at least"),
        (("--simulate", "display"), "write options behind display"),
        (("--points", "points.csv"), "--empty is missing"),
        (("--points", "points.csv", "--empty", "empty"), "--points needs --recording"),
        (("--boards", "boards", "--empty", "empty"), "--boards are for --method reconstruction"),
        (("--simulate", "--recording", "taps", "--empty", "empty"), "--simulate: only without"),
        (("--finger", "-"), "add --simulate"),
        (("--rollback", "--schema"), "exclude each other"),
        (("--board", "charuco:9x6:29"), "neither charuco:9x6:29:23 nor checkerboard"),
        (("--board", "checkerboard:8x6:25"), "look the same upside down"),
    ],
)
def test_what_cannot_be_meant_is_wrong_usage(arguments: tuple[object, ...], message: str) -> None:
    result = calibrate(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr


def test_a_pipe_is_not_replaced_by_a_file(recordings: Path, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    taps, empty = recordings / "calib_few_small", recordings / "empty_small"
    result = calibrate("--recording", taps, "--empty", empty, "--output", pipe)
    assert result.exit_code == 1
    assert f"{pipe}: is not a regular file; name another" in result.stderr
    assert pipe.is_fifo()


def test_a_surface_that_was_not_empty_is_refused(recordings: Path, tmp_path: Path) -> None:
    taps = recordings / "calib_few_small"
    result = calibrate("--recording", taps, "--empty", taps, "--output", tmp_path / "c.json")
    assert result.exit_code == 1
    assert "pictures of the empty surface show shadows that the others do not" in result.stderr
    assert not (tmp_path / "c.json").exists()


def test_the_result_is_compared_with_the_one_in_force(recordings: Path, tmp_path: Path) -> None:
    output = tmp_path / "calibration.json"
    arguments = ("--recording", recordings / "calib_few_small", "--output", output)
    first = calibrate(*arguments, "--empty", recordings / "empty_small")
    second = calibrate(*arguments, "--empty", recordings / "empty_small")
    assert "the cameras stand where they stood" not in first.stderr
    assert "the cameras stand where they stood" in second.stderr
    assert calibrate("--rollback", "--output", output).exit_code == 0


def test_the_schema_is_json(tmp_path: Path) -> None:
    result = calibrate("--schema")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["properties"]["checksum"]


def test_a_poor_result_says_so(recordings: Path, calibration_file: Path) -> None:
    good = load_calibration(calibration_file)
    assert why_poor(good) == ""
    assert "take --method auto" in why_poor(replace(good, method="lookup-table", residual_mm=5.0))
    off = replace(good.expected, errors_mm=good.expected.errors_mm + 4.0)
    assert "without taps" in why_poor(replace(good, reference_points=0, expected=off))
    assert "add a scribble" in why_poor(replace(good, expected=off))
