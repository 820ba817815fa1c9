"""Four simulated USB cameras, plugged into the kernel of the guest, and their faults by command."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

TESTS = Path(__file__).resolve().parents[1]
BY_ID = Path("/dev/v4l/by-id")
FIRST_PORT = 8
"""The virtual host controller has its ports for super-speed from here on."""
APPEARS_S = 60.0
"""A busy guest takes seconds to attach a camera."""
POLL_S = 0.02
KEEP_MEMORY = {"MALLOC_TRIM_THRESHOLD_": "200000000", "MALLOC_MMAP_THRESHOLD_": "200000000"}
"""Fresh pages are dear in user-mode Linux: memory of the last picture serves the next."""


class UvcRig:
    """Cameras that show loops of pictures in step; `pictures` are .npy files by camera.

    Use as a context manager: it plugs all of them in, and takes them out at the end.
    """

    def __init__(self, pictures: Mapping[str, Path], rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self.ports = {camera: FIRST_PORT + number for number, camera in enumerate(pictures)}
        self.start_s = time.monotonic()
        self._pictures = pictures
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        load_drivers()
        given = {
            "rate_hz": self.rate_hz,
            "start_s": self.start_s,
            "cameras": {
                camera: {"serial": serial(camera), "pictures": str(pictures)}
                for camera, pictures in self._pictures.items()
            },
        }
        self._process = subprocess.Popen(
            [sys.executable, "-m", "uvc.server", json.dumps(given)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **KEEP_MEMORY, "PYTHONPATH": str(TESTS)},
        )
        for camera in self._pictures:
            self.plug(camera)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._process is not None:
            self._process.communicate(timeout=APPEARS_S)

    def plug(self, camera: str, port: int | None = None) -> None:
        """Plug a camera in, on its own port unless another is given; wait for its device."""
        port = self.ports[camera] if port is None else port
        until_s = time.monotonic() + APPEARS_S
        while (answer := self._tell(camera, f"plug {port}")) != "ok":
            # A port is taken until the kernel has cleaned up behind the last camera.
            if time.monotonic() > until_s:
                raise TimeoutError(f"camera {camera}: port {port}: {answer}")
            time.sleep(POLL_S)
        self.ports[camera] = port
        wait_for(device(camera), exists=True)

    def unplug(self, camera: str) -> None:
        """Pull a camera's cable; wait until its device is gone."""
        self._do(camera, "unplug")
        wait_for(device(camera), exists=False)

    def show_only(self, pictures: range) -> None:
        """Let all cameras show these pictures of their loops only."""
        self._do("all", f"show {pictures.start} {len(pictures)}")

    def stall(self, camera: str) -> None:
        """Let a camera send nothing, though it is there."""
        self._do(camera, "stall")

    def short(self, camera: str, pictures: int) -> None:
        """Send only the first half of the next pictures."""
        self._do(camera, f"short {pictures}")

    def err(self, camera: str, pictures: int) -> None:
        """Mark the next pictures as wrong, as a camera does that has lost some data."""
        self._do(camera, f"err {pictures}")

    def hole(self, camera: str, pictures: int) -> None:
        """Leave bytes out of the middle of the next pictures, without marking them."""
        self._do(camera, f"hole {pictures}")

    def noise(self, camera: str) -> None:
        """Show noise."""
        self._do(camera, "noise")

    def dark(self, camera: str) -> None:
        """Show the rig as if its light were out."""
        self._do(camera, "dark")

    def go(self, camera: str) -> None:
        """End all faults of a camera that is plugged in."""
        self._do(camera, "go")

    def standstills(self) -> list[tuple[float, float]]:
        """Return from when to when no camera sent anything, though it was to."""
        return [(begin_s, end_s) for begin_s, end_s in json.loads(self._ask("standstills"))]

    def _do(self, camera: str, command: str) -> None:
        answer = self._tell(camera, command)
        if answer != "ok":
            raise RuntimeError(f"camera {camera}: {command}: {answer}")

    def _tell(self, camera: str, command: str) -> str:
        return self._ask(f"{camera} {command}")

    def _ask(self, line: str) -> str:
        assert self._process is not None
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()
        return self._process.stdout.readline().strip()


def serial(camera: str) -> str:
    """Return the serial number of a camera."""
    return f"SIM-{camera}"


def device(camera: str) -> Path:
    """Return the lasting name of a camera's video device, on whatever port it hangs."""
    name = f"usb-cornertouchd_simulated_camera_{serial(camera)}-video-index0"
    return BY_ID / name


def wait_for(path: Path, *, exists: bool) -> None:
    """Wait until a device is there, or gone."""
    until_s = time.monotonic() + APPEARS_S
    while path.exists() != exists:
        if time.monotonic() > until_s:
            raise TimeoutError(f"{path} is {'not there' if exists else 'still there'}")
        time.sleep(POLL_S)


def load_drivers() -> None:
    """Load the kernel's drivers for USB/IP and USB cameras."""
    for module in ("vhci-hcd", "uvcvideo"):
        subprocess.run(["modprobe", module], check=True)
