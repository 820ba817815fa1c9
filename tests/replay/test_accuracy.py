"""Touches are where they are: recordings with truth, calibrated from 16 taps by the command."""

import csv
import json
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import linear_sum_assignment

from cornertouchd.cli import main

Points = list[tuple[float, float]]
MATCH_MM = 8.0


def contacts(directory: Path, calibration: Path, output: Path) -> dict[int, Points]:
    arguments = ["replay", str(directory), "--calibration", str(calibration), "--independent"]
    result = CliRunner().invoke(main, [*arguments, "--output", str(output)])
    assert result.exit_code == 0, result.output
    lines = [json.loads(line) for line in output.read_text().splitlines()]
    return {line["set"]: [(c["x_mm"], c["y_mm"]) for c in line["contacts"]] for line in lines}


def truth(directory: Path, x: str, y: str) -> dict[int, Points]:
    places = defaultdict(list)
    with (directory / "truth.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            places[int(row["set"])].append((float(row[x]), float(row[y])))
    return dict(places)


def errors(found: dict[int, Points], true: dict[int, Points]) -> tuple[np.ndarray, int, int]:
    """Return the errors of matched touches, how many were missed and how many are ghosts."""
    off, missed, ghosts = [], 0, 0
    for index, wanted in true.items():
        got = found.get(index, [])
        distances = np.linalg.norm(
            np.array(wanted)[:, None] - np.array(got).reshape(1, -1, 2), axis=-1
        )
        rows, columns = linear_sum_assignment(np.where(distances < MATCH_MM, distances, 1e3))
        near = [
            distances[i, k]
            for i, k in zip(rows, columns, strict=True)
            if distances[i, k] < MATCH_MM
        ]
        off += near
        missed += len(wanted) - len(near)
        ghosts += len(got) - len(near)
    return np.array(off), missed, ghosts


@pytest.mark.parametrize("name", ["single_small", "multi02_small"])
def test_touches_are_told_where_the_tips_of_fingers_are(
    whole_recordings: Path, calibration_file: Path, tmp_path: Path, name: str
) -> None:
    directory = whole_recordings / name
    found = contacts(directory, calibration_file, tmp_path / "touches.jsonl")
    off, missed, ghosts = errors(found, truth(directory, "x_mm", "y_mm"))
    assert missed <= 0.01 * len(off)
    assert ghosts == 0
    assert np.percentile(off, 95) <= 0.3


def test_nothing_is_found_where_nothing_is(
    whole_recordings: Path, calibration_file: Path, tmp_path: Path
) -> None:
    found = contacts(whole_recordings / "empty_small", calibration_file, tmp_path / "empty.jsonl")
    assert len(found) >= 8
    assert not any(found.values())
