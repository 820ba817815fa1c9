"""`cornertouchd bench`: what it measures, and what it makes of it."""

import itertools
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from cornertouchd.cli import main
from cornertouchd.cli.bench import DAEMON, Verdict
from cornertouchd.model import Frame
from cornertouchd.runtime.bench_show import always_down
from cornertouchd.runtime.benching import BLOCK_SETS, STAGES, WARM_SETS, time_in_turns, to_and_fro

CONFIG = """
[cameras]
source = "simulated"
width_px = 320
height_px = 240
rate_hz = 50
"""


def frame_sets(count: int) -> list[list[Frame]]:
    pixels = np.zeros((2, 2), np.uint8)
    return [[Frame("C1", index, 0.0, 15, pixels + index)] for index in range(count)]


class Counting:
    """Finds as many touches as it is told to, in so many parts."""

    def __init__(self, finds: int, parts: int) -> None:
        self.seen: list[Frame] = []
        self._finds = finds
        self._parts = parts

    def run(self, frames: Sequence[Frame]) -> tuple[int, tuple[int, ...]]:
        self.seen += frames
        return self._finds, (0,) * (self._parts - 1)


def test_pictures_play_to_and_fro_while_time_goes_on() -> None:
    shown, played = [], []
    for (frame,) in itertools.islice(to_and_fro(frame_sets(4), 50.0), 9):
        shown.append(int(frame.pixels[0, 0]))  # a picture lasts until the next one
        played.append((frame,))
    assert shown == [0, 1, 2, 3, 2, 1, 0, 1, 2]
    assert [frame.sequence for (frame,) in played] == list(range(9))
    assert [frame.captured_at_s for (frame,) in played] == [k / 50.0 for k in range(9)]


def test_every_picture_is_copied_to_where_the_last_one_was() -> None:
    sets = frame_sets(3)
    played = [frame.pixels for (frame,) in itertools.islice(to_and_fro(sets, 50.0), 5)]
    assert all(pixels is played[0] for pixels in played)
    assert [int(frame.pixels[0, 0]) for (frame,) in sets] == [0, 1, 2]


def test_a_single_frame_set_is_played_again_and_again() -> None:
    played = list(itertools.islice(to_and_fro(frame_sets(1), 50.0), 3))
    assert [frame.captured_at_s for (frame,) in played] == [0.0, 0.02, 0.04]


def test_all_are_measured_as_often_however_short_the_time() -> None:
    paths = {"one": Counting(3, 1), "other": Counting(5, 4)}
    times = time_in_turns(paths, frame_sets(3), 100.0, 0.0)
    counted = BLOCK_SETS - WARM_SETS
    assert times["one"].laps_us.shape == (counted, 1)
    assert times["other"].laps_us.shape == (counted, 4)
    assert (times["one"].found, times["other"].found) == (3.0, 5.0)
    for path in paths.values():
        order = [frame.sequence for frame in path.seen]
        assert order == list(range(2 * BLOCK_SETS))


@pytest.mark.parametrize("touches", [0, 1, 7, 20])
def test_the_fingers_of_the_show_never_lift_and_stay_on_the_surface(touches: int) -> None:
    script = always_down((350.0, 400.0), touches)
    for t_s in np.linspace(0.0, 30.0, 50).tolist():
        fingers = [timed.finger for timed in script(t_s)]
        assert len(fingers) == touches
        assert all(10 < one.x_mm < 340 and 10 < one.y_mm < 390 for one in fingers)


@pytest.mark.parametrize(
    ("asked_hz", "word"), [(100.0, "fine"), (500.0, "fine"), (900.0, "tight"), (1100.0, "too much")]
)
def test_the_verdict_leaves_half_of_a_core_to_others(asked_hz: float, word: str) -> None:
    verdict = Verdict(10, 1000, asked_hz)
    assert verdict.word == word
    assert ("set cameras.rate_hz to 500 or less" in str(verdict)) == (word != "fine")


@pytest.fixture(autouse=True)
def nothing_to_load(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loading the daemon may compile for a minute; whether it can be loaded is tested below."""
    monkeypatch.setattr("cornertouchd.cli.bench.DAEMON", "pass")


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home of its own; the simulated rig calibrates once."""
    made = tmp_path_factory.mktemp("home")
    (made / "settings.toml").write_text(CONFIG)
    return made


def bench(home: Path, *arguments: str) -> Result:
    return CliRunner().invoke(
        main,
        ["bench", "--config", str(home / "settings.toml"), *arguments],
        env={"HOME": str(home), "XDG_CACHE_HOME": "", "CACHE_DIRECTORY": ""},
    )


def test_bench_tells_whether_the_machine_carries_what_the_cameras_ask_for(home: Path) -> None:
    result = bench(home, "--seconds", "0.2", "--touches", "2")
    assert result.exit_code == 0, result.output
    assert all(stage in result.stdout for stage in (*STAGES, "whole frame set"))
    last = result.stdout.splitlines()[-1]
    assert last.startswith("this machine carries ")
    assert "with 2 touches on one core; your cameras ask for 50: " in last


def test_bench_writes_one_json_object(home: Path) -> None:
    result = bench(home, "--seconds", "0.2", "--touches", "1", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told["touches_found"] == pytest.approx(1.0, abs=0.05)
    assert (told["cameras"], told["width_px"], told["asked_hz"]) == (4, 320, 50.0)
    assert set(told["stages_us"]) == {*STAGES, "between them", "whole frame set"}
    whole = told["stages_us"]["whole frame set"]
    assert 0.0 < whole["median"] <= whole["p99"]
    assert told["verdict"] in {"fine", "tight", "too much"}


def test_what_is_loaded_for_the_time_to_start_exists() -> None:
    exec(DAEMON)


@pytest.mark.parametrize(
    "arguments", [["--touches", "21"], ["--seconds", "0"], ["--seconds", "nan"], ["extra"]]
)
def test_wrong_usage_of_bench_ends_with_2(home: Path, arguments: list[str]) -> None:
    assert bench(home, *arguments).exit_code == 2


def test_a_config_that_is_not_there_is_said(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["bench", "--config", str(tmp_path / "none.toml")])
    assert result.exit_code == 1
    assert "none.toml" in result.stderr
