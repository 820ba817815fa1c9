"""When a service counts as ready, what its status says, and what feeds its watchdog."""

from dataclasses import dataclass, field, replace

import pytest
from watched_daemon import WatchedDaemon

from cornertouchd.runtime.health import HealthWatch
from cornertouchd.runtime.service import Condition, ServiceReport

ALL = ("C1", "C2", "C3", "C4")


@dataclass
class FakeManager:
    watchdog_s: float | None = 4.0
    said: list[str] = field(default_factory=list)

    def ready(self, status: str) -> None:
        self.said.append(f"READY {status}")

    def status(self, status: str) -> None:
        self.said.append(status)

    def alive(self) -> None:
        self.said.append("ALIVE")

    def reloading(self) -> None:
        self.said.append("RELOADING")

    def stopping(self) -> None:
        self.said.append("STOPPING")


class Service:
    """A daemon that is looked at as time goes by; 100 frame sets come a second if they `flow`."""

    def __init__(self) -> None:
        self.manager, self.daemon = FakeManager(), WatchedDaemon(*ALL)
        self.daemon.lost = set(ALL)
        health = HealthWatch(self.daemon, self.daemon)
        self.report = ServiceReport(self.manager, self.daemon, health, self.daemon)

    def go_on(self, seconds: float, *, flow: bool = True, turn: bool = True) -> list[str]:
        """Return what was said meanwhile."""
        self.manager.said.clear()
        until_s = self.daemon.time_s + seconds
        while self.daemon.time_s < until_s - 1e-6:
            step_s = min(self.report.look_every_s, until_s - self.daemon.time_s)
            self.daemon.go_on(step_s, round(100 * step_s) * flow, turns=int(turn))
            self.report.look()
        return [one for one in self.manager.said if one != "ALIVE"]


@pytest.fixture
def service() -> Service:
    return Service()


def test_ready_as_soon_as_all_cameras_give_frame_sets(service: Service) -> None:
    assert service.go_on(1.0, flow=False) == []
    service.daemon.lost = set()
    assert service.go_on(0.1) == ["READY 4 cameras, 100 frame sets/s, 0 touches"]
    assert service.go_on(1.0) == []


def test_a_missing_camera_delays_ready_but_not_for_ever(service: Service) -> None:
    service.daemon.lost = {"C3"}
    assert service.go_on(9.5) == []
    assert service.go_on(1.0) == ["READY degraded: C3 lost; 3 cameras, 100 frame sets/s, 0 touches"]


def test_without_any_camera_the_unit_does_not_fail(service: Service) -> None:
    (ready,) = service.go_on(10.5, flow=False)
    assert ready == "READY degraded: C1, C2, C3, C4 lost; 0 cameras, 0 frame sets/s, 0 touches"


def test_the_status_follows_what_happens_and_is_silent_when_nothing_does(
    service: Service,
) -> None:
    service.daemon.lost = set()
    service.go_on(3.0)
    assert service.go_on(5.0) == []
    service.daemon.lost = {"C3"}
    service.daemon.fusion = replace(service.daemon.fusion, touches_now=1)
    assert service.go_on(2.0) == ["degraded: C3 lost; 3 cameras, 100 frame sets/s, 1 touch"]
    service.daemon.lost = set()
    assert service.go_on(1.0) == ["4 cameras, 100 frame sets/s, 1 touch"]


def test_cameras_that_never_see_the_same_instant_are_told() -> None:
    assert str(Condition(ALL, (), 0.0, 0)).startswith(
        "degraded: cameras never see the same instant; 4 cameras, 0 frame sets/s"
    )


def test_the_watchdog_is_fed_without_cameras_too(service: Service) -> None:
    service.go_on(20.0, flow=False)
    assert service.manager.said.count("ALIVE") >= 10
    service.go_on(4.0, flow=False)
    assert service.manager.said.count("ALIVE") == 4  # in the four seconds that it waits


def test_a_fusion_thread_that_hangs_starves_the_watchdog(service: Service) -> None:
    service.daemon.lost = set()
    service.go_on(3.0)
    service.go_on(10.0, turn=False)
    assert "ALIVE" not in service.manager.said


def test_a_reload_is_told_and_its_refusal_stays_in_the_status(service: Service) -> None:
    service.daemon.lost = set()
    service.go_on(3.0)
    service.manager.said.clear()
    service.report.reloading()
    service.daemon.go_on(1.0, 100)
    service.report.reloaded("the last reload was refused")
    assert service.manager.said == [
        "RELOADING",
        "READY 4 cameras, 100 frame sets/s, 0 touches; the last reload was refused",
    ]
    assert all("refused" in one for one in service.go_on(3.0))
    service.report.reloaded()
    assert "refused" not in service.manager.said[-1]


def test_nothing_is_ready_only_because_it_was_reloaded(service: Service) -> None:
    service.report.reloading()
    service.report.reloaded()
    assert service.manager.said == []


def test_without_a_watchdog_one_look_a_second_is_enough(service: Service) -> None:
    service.manager.watchdog_s = None
    service.daemon.lost = set()
    service.go_on(1.0)
    assert service.report.look_every_s == 1.0
