"""What is checked: the settings, and the places where a system keeps the rest."""

import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cornertouchd.config import Settings
from cornertouchd.config.reading import SYSTEM_FILE
from cornertouchd.devices.camera_abilities import look_at_node
from cornertouchd.devices.camera_survey import CameraAbilities
from cornertouchd.places import SERVICE_STATE
from cornertouchd.ports import CameraPort, Clock

PROGRAM_S = 10.0
UNIT = "cornertouchd.service"


def unit_for(config_file: Path | None) -> str:
    """Return the unit that runs with a configuration: that of a surface, if it is named so."""
    if config_file is None or config_file.parent != SYSTEM_FILE.parent:
        return UNIT
    name = config_file.stem
    return UNIT if config_file == SYSTEM_FILE else f"cornertouchd@{name}.service"


def environment_of(unit: str, environ: Mapping[str, str]) -> Mapping[str, str]:
    """Return the environment with the state directory of a unit, unless another is named."""
    surface = unit.removesuffix(".service").partition("@")[2]
    if not surface or environ.get("STATE_DIRECTORY"):
        return environ
    return {**environ, "STATE_DIRECTORY": str(SERVICE_STATE / surface)}


def output_of(*command: str) -> str:
    """Return what a program says, nothing if there is no such program or it fails."""
    program = shutil.which(command[0])
    if program is None:
        return ""
    try:
        done = subprocess.run(  # noqa: S603
            [program, *command[1:]], capture_output=True, text=True, check=False, timeout=PROGRAM_S
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""


@dataclass(frozen=True, slots=True)
class Installation:
    """The daemon's settings, and the machine; `unit` is the service that runs with them."""

    settings: Settings
    environ: Mapping[str, str]
    clock: Clock
    unit: str = UNIT
    sysfs: Path = Path("/sys")
    proc: Path = Path("/proc")
    dev: Path = Path("/dev")
    ports: Callable[[], Sequence[CameraPort]] = tuple
    look: Callable[..., CameraAbilities] = look_at_node
    output_of: Callable[..., str] = output_of

    def unit_property(self, name: str) -> str:
        """Return a property of the service as systemd knows it, empty without systemd."""
        told = self.output_of("systemctl", "show", self.unit, f"--property={name}")
        return told.strip().partition("=")[2]

    @property
    def is_running(self) -> bool:
        """Whether the service runs, and has the cameras."""
        return self.unit_property("ActiveState") in {"active", "activating", "reloading"}
