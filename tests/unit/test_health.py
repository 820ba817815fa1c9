"""What the daemon tells of itself, and how `cornertouchd status` passes it on."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from watched_daemon import GAME, WatchedDaemon

from cornertouchd.cli import main
from cornertouchd.runtime.asking import AskSocket, document
from cornertouchd.runtime.health import HealthWatch, as_json
from cornertouchd.runtime.led_light import LightState


@pytest.fixture
def rig() -> WatchedDaemon:
    return WatchedDaemon("C1", "C2")


@pytest.fixture
def watch(rig: WatchedDaemon) -> HealthWatch:
    return HealthWatch(rig, rig)  # type: ignore[arg-type]


def test_rates_are_those_since_the_last_look(rig: WatchedDaemon, watch: HealthWatch) -> None:
    rig.go_on(2.0, 200)
    watch.look()
    assert (watch.now.state, watch.now.problems) == ("healthy", ())
    assert watch.now.frame_sets_per_s == pytest.approx(100.0)
    rig.go_on(1.0, 40)
    watch.look()
    assert watch.now.cameras[1].pictures_per_s == pytest.approx(40.0)
    assert (watch.now.up_s, watch.now.cameras[1].pictures) == (3.0, 240)
    assert (watch.now.cameras[0].reopened, watch.now.cameras[0].resets) == (1, 1)


def test_looks_that_follow_each_other_closely_tell_the_same(
    rig: WatchedDaemon, watch: HealthWatch
) -> None:
    rig.go_on(1.0, 100)
    watch.look()
    told = watch.now
    rig.go_on(0.01, 3)
    watch.look()
    assert watch.now is told


def test_a_lost_camera_is_a_problem_and_what_may_become_one_a_hint(
    rig: WatchedDaemon, watch: HealthWatch
) -> None:
    rig.lost = {"C2"}
    rig.pipeline.blind_columns = ("columns 3..9 see little or nothing",)
    rig.sink.destinations = (replace(GAME, fault="Connection refused"),)
    rig.go_on(1.0, 100)
    watch.look()
    assert watch.now.state == "degraded"
    assert watch.now.problems == ("camera C2 lost",)
    assert watch.now.hints == (
        "camera C1: columns 3..9 see little or nothing",
        "camera C2: columns 3..9 see little or nothing",
        "TUIO to 127.0.0.1:3333: Connection refused",
    )


def test_what_comes_less_often_than_it_should_is_a_hint(
    rig: WatchedDaemon, watch: HealthWatch
) -> None:
    rig.go_on(10.0, 250, pictures=1000)
    watch.look()
    (machine,) = watch.now.hints
    assert machine.startswith("25 frame sets a second of 100 pictures")
    rig.go_on(10.0, 400)
    watch.look()
    assert [hint[:46] for hint in watch.now.hints] == [
        "camera C1: 40 pictures a second of 100: make i",
        "camera C2: 40 pictures a second of 100: make i",
    ]
    rig.go_on(1.0, 99)
    watch.look()
    assert watch.now.hints == ()


def test_cameras_without_frame_sets_are_a_problem(rig: WatchedDaemon, watch: HealthWatch) -> None:
    rig.go_on(1.0, 0)
    watch.look()
    assert watch.now.problems == ("the cameras never see the same instant",)


def test_an_led_frame_that_does_not_shine_is_a_problem(
    rig: WatchedDaemon, watch: HealthWatch
) -> None:
    rig.light = LightState("/dev/ttyACM0", "", (), "constant", (9, 9, 9, 9), False, None, 0, 0, {})
    rig.go_on(1.0, 100)
    watch.look()
    assert watch.now.problems == ("LED frame lost",)
    assert json.loads(as_json(watch.now))["light"]["levels"] == [9, 9, 9, 9]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run" / "status.sock"


def status(path: Path, *options: str) -> Result:
    return CliRunner().invoke(main, ["status", "--socket", str(path), *options])


@pytest.fixture
def answered(path: Path, rig: WatchedDaemon, watch: HealthWatch) -> Iterator[None]:
    with AskSocket(path, {"status": document(lambda: as_json(watch.now))}):
        yield


@pytest.mark.usefixtures("answered")
def test_the_exit_status_tells_healthy_from_degraded(
    path: Path, rig: WatchedDaemon, watch: HealthWatch
) -> None:
    rig.go_on(1.0, 100)
    watch.look()
    told = status(path)
    assert (told.exit_code, told.stdout.splitlines()[0]) == (0, "healthy")
    assert "127.0.0.1:3333; 10 packets, 0 errors" in told.stdout
    assert "nothing sent yet" in told.stdout
    assert "% of a processor" in told.stdout
    rig.lost = {"C1"}
    rig.light = LightState(
        "/dev/ttyACM0", "armed", (), "ambient", (9, 8, 9, 8), False, 31.0, 1, 0, {}
    )
    rig.go_on(1.0, 100)
    watch.look()
    told = status(path)
    assert told.exit_code == 1
    assert "armed at /dev/ttyACM0; ambient, levels 9/8/9/8" in told.stdout
    assert "camera C1 lost" in told.stdout
    as_object = json.loads(status(path, "--json").stdout)
    assert as_object["problems"] == ["camera C1 lost"]
    assert as_object["cameras"][0]["live"] is False


def test_without_a_daemon_it_says_so(path: Path) -> None:
    told = status(path)
    assert told.exit_code == 2
    assert "is not there: no daemon runs" in told.stderr
    as_object = status(path, "--json")
    assert (as_object.exit_code, json.loads(as_object.stdout)["state"]) == (2, "down")


def test_what_is_no_daemon_is_down(path: Path) -> None:
    with AskSocket(path, {"status": document(lambda: b"hello")}):
        told = status(path)
    assert told.exit_code == 2
    assert "is no socket of cornertouchd" in told.stderr
