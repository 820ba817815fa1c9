"""The daemon as a service: when it is ready, how it does, that it lives."""

from collections.abc import Sequence
from dataclasses import dataclass

from cornertouchd.ports import Clock
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.health import Health, HealthWatch
from cornertouchd.runtime.led_light import LightState
from cornertouchd.runtime.notify import ServiceManager

READY_WITHIN_S = 10.0
"""So long a start waits for cameras that are missing; a kiosk with three of four is of use."""

FEEDS_PER_WATCHDOG = 4
"""Feeds in the time that the watchdog waits: sd_watchdog_enabled(3) advises two, and a machine
under load may be late with one."""

STATUS_EVERY_S = 1.0
LOOK_FOR_READY_S = 0.1


@dataclass(frozen=True, slots=True)
class Condition:
    """How the daemon does: all its cameras, which of them are lost, what the others give.

    `light` is the LED frame, None if no controller strobes it.
    """

    cameras: Sequence[str]
    lost: Sequence[str]
    frame_sets_per_s: float
    touches: int
    light: LightState | None = None

    @staticmethod
    def of(health: Health) -> "Condition":
        """Return what health says of it."""
        return Condition(
            tuple(camera.id for camera in health.cameras),
            tuple(camera.id for camera in health.cameras if not camera.live),
            health.frame_sets_per_s,
            health.fusion.touches_now,
            health.light,
        )

    @property
    def is_degraded(self) -> bool:
        """Whether something is missing."""
        in_the_dark = self.light is not None and not self.light.is_well
        return bool(self.lost) or not self.frame_sets_per_s or in_the_dark

    def __str__(self) -> str:
        """Say it in one line."""
        live = len(self.cameras) - len(self.lost)
        said = (
            f"{live} {'camera' if live == 1 else 'cameras'}, "
            f"{self.frame_sets_per_s:.0f} frame sets/s, "
            f"{self.touches} {'touch' if self.touches == 1 else 'touches'}"
        )
        if not self.is_degraded:
            return said
        what = f"{', '.join(self.lost)} lost" if self.lost else ""
        if self.light is not None and not self.light.is_well:
            what = f"{self.light}{', ' * bool(what)}{what}"
        return f"degraded: {what or 'cameras never see the same instant'}; {said}"


class ServiceReport:
    """Tells the service manager about a daemon.  `look` is to be called every `look_every_s`.

    Ready is a daemon whose cameras are all there and whose frame sets flow, or that has waited for
    them long enough.  The watchdog is fed while the loop of the fusion thread turns, which it does
    without cameras too; by the thread that calls, so that it tells of that one as well.
    """

    def __init__(
        self, manager: ServiceManager, daemon: Daemon, health: HealthWatch, clock: Clock
    ) -> None:
        self._manager = manager
        self._daemon = daemon
        self._health = health
        self._clock = clock
        self._started_at_s = clock.now_s()
        self._turns = 0
        self._is_ready = False
        self._told = ""
        self._note = ""

    @property
    def look_every_s(self) -> float:
        """Time between two looks."""
        if not self._is_ready:
            return LOOK_FOR_READY_S
        if self._manager.watchdog_s is None:
            return STATUS_EVERY_S
        return min(STATUS_EVERY_S, self._manager.watchdog_s / FEEDS_PER_WATCHDOG)

    def look(self) -> None:
        """Look how the daemon does; feed the watchdog if the fusion thread has gone on."""
        self._feed_watchdog()
        if self._is_ready:
            before = self._health.now
            self._health.look()
            if self._health.now is not before:
                self._tell(f"{Condition.of(self._health.now)}{self._note}")
            return
        self._health.look(LOOK_FOR_READY_S)
        condition = Condition.of(self._health.now)
        waited_s = self._clock.now_s() - self._started_at_s
        if not condition.is_degraded or waited_s >= READY_WITHIN_S:
            self._is_ready = True
            self._told = str(condition)
            self._manager.ready(self._told)

    def reloading(self) -> None:
        """Tell that the configuration is read again."""
        if self._is_ready:
            self._manager.reloading()

    def reloaded(self, note: str = "") -> None:
        """Tell that this is done; `note` is part of the status until the next time."""
        self._note = f"; {note}" if note else ""
        if self._is_ready:
            self._health.look()
            self._told = f"{Condition.of(self._health.now)}{self._note}"
            self._manager.ready(self._told)

    def stopping(self) -> None:
        """Tell that the daemon ends."""
        self._manager.stopping()

    def _feed_watchdog(self) -> None:
        turns = self._daemon.fusion_counts().turns
        if turns != self._turns and self._manager.watchdog_s is not None:
            self._turns = turns
            self._manager.alive()

    def _tell(self, status: str) -> None:
        if status != self._told:
            self._told = status
            self._manager.status(status)
