"""Recorded runs give what they gave when last looked at: a change of behaviour is a commit."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from cornertouchd.cli import main

RECORDINGS = ("empty_small", "single_small", "multi02_small", "multi10_small")
TOLERANCE_MM = 0.01
"""Another processor or version of numpy may differ in the last digits of the fit."""


def replay(recording: Path, calibration: Path, output: Path, *more: str) -> list[dict]:
    arguments = ["replay", str(recording), "--calibration", str(calibration)]
    result = CliRunner().invoke(main, [*arguments, "--output", str(output), *more])
    assert result.exit_code == 0, result.output
    return [json.loads(line) for line in output.read_text().splitlines()]


@pytest.mark.parametrize("name", RECORDINGS)
def test_replay_gives_what_is_expected(
    name: str, recordings: Path, calibration_file: Path, tmp_path: Path, update_expected: bool
) -> None:
    output = tmp_path / "contacts.jsonl"
    got = replay(recordings / name, calibration_file, output, "--independent")
    expected_file = recordings / name / "expected.jsonl"
    if update_expected:
        expected_file.write_bytes(output.read_bytes())
    expected = [json.loads(line) for line in expected_file.read_text().splitlines()]
    assert len(got) == len(expected)
    for ours, theirs in zip(got, expected, strict=True):
        assert (ours["set"], ours["captured_at_s"]) == (theirs["set"], theirs["captured_at_s"])
        assert len(ours["contacts"]) == len(theirs["contacts"]), f"set {ours['set']}"
        for a, b in zip(ours["contacts"], theirs["contacts"], strict=True):
            assert a["cameras"] == b["cameras"]
            assert [a["x_mm"], a["y_mm"], a["diameter_mm"]] == pytest.approx(
                [b["x_mm"], b["y_mm"], b["diameter_mm"]], abs=TOLERANCE_MM
            )


@pytest.mark.parametrize("mode", [["--independent"], []], ids=["independent", "tracked"])
def test_replay_twice_gives_the_same_bytes(
    mode: list[str], recordings: Path, calibration_file: Path, tmp_path: Path
) -> None:
    outputs = [tmp_path / "first.jsonl", tmp_path / "second.jsonl"]
    for output in outputs:
        replay(recordings / "multi02_small", calibration_file, output, *mode)
    assert outputs[0].read_bytes() == outputs[1].read_bytes()
    assert outputs[0].stat().st_size > 0
