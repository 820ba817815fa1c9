"""What programs see of a touchscreen: the kernel's readers, libinput, evtest, a browser."""

import contextlib
import http.server
import json
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from evdev import InputDevice, ecodes, list_devices
from guest.client import wait_until

Place = tuple[float, float]
APPEARS_S, STARTS_S = 20.0, 60.0

LIBINPUT_TOUCH = re.compile(
    r"TOUCH_(DOWN|MOTION|UP|CANCEL)\s+\+[\d.]+s\s+(\d+) \(\d+\)"
    r"(?:\s+[\d.]+/\s*[\d.]+ \(\s*([\d.]+)/\s*([\d.]+)mm\))?"
)
EVTEST_VALUE = re.compile(r"code \d+ \((ABS_MT_\w+)\), value (-?\d+)")


def find_screen(name: str) -> InputDevice | None:
    """Return the touchscreen of this name, if it is there and udev has looked at it."""
    subprocess.run(["udevadm", "settle"], check=True)
    for path in list_devices():
        with contextlib.suppress(OSError):
            device = InputDevice(path)
            if device.name == name:
                return device
            device.close()
    return None


def opened_screen(name: str, timeout_s: float = APPEARS_S) -> InputDevice:
    """Return the touchscreen of this name when it has come."""
    found: list[InputDevice] = []
    wait_until(lambda: bool((one := find_screen(name)) and found.append(one) is None), timeout_s,
               f"the touchscreen {name}")  # fmt: skip
    return found[0]


@dataclass(slots=True)
class ScreenReader:
    """Keeps what a touchscreen tells: after each report, the place of each tracking id.

    A thread reads from the beginning of the context on, until the touchscreen is gone.
    """

    device: InputDevice
    reports: list[Mapping[int, Place]] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)
    slots: dict[int, dict[int, int]] = field(default_factory=dict)
    dropped: int = 0
    is_gone: bool = False
    _slot: int = 0

    def __enter__(self) -> Self:
        threading.Thread(target=self._read, name="touchscreen reader", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.device.close()

    def _read(self) -> None:
        per_mm = self.device.absinfo(ecodes.ABS_MT_POSITION_X).resolution
        try:
            for event in self.device.read_loop():
                if event.type == ecodes.EV_ABS and event.code == ecodes.ABS_MT_SLOT:
                    self._slot = event.value
                elif event.type == ecodes.EV_ABS and event.code > ecodes.ABS_MT_SLOT:
                    self.slots.setdefault(self._slot, {})[event.code] = event.value
                elif event.type == ecodes.EV_SYN and event.code == ecodes.SYN_DROPPED:
                    self.dropped += 1
                elif event.type == ecodes.EV_SYN:
                    self.times_s.append(event.timestamp())
                    self.reports.append(dict(self._places(per_mm)))
        except (OSError, ValueError):  # closed by us, it has no number
            self.is_gone = True

    def touches(self) -> dict[int, dict[int, int]]:
        """Return the slots that are touched, each with what it tells."""
        return {
            slot: dict(values)
            for slot, values in self.slots.items()
            if values.get(ecodes.ABS_MT_TRACKING_ID, -1) >= 0
        }

    def _places(self, per_mm: int) -> Iterator[tuple[int, Place]]:
        for values in self.touches().values():
            x, y = values[ecodes.ABS_MT_POSITION_X], values[ecodes.ABS_MT_POSITION_Y]
            yield values[ecodes.ABS_MT_TRACKING_ID], (x / per_mm, y / per_mm)


class Watching:
    """A program that prints what a touchscreen does; `lines` are what it has said."""

    def __init__(self, *command: str) -> None:
        self.lines: list[str] = []
        self._process = subprocess.Popen(
            ["stdbuf", "-oL", *command],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._thread = threading.Thread(target=self._read, name=command[0], daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.lines.append(line.rstrip())

    def wait_for(self, text: str, times: int = 1) -> None:
        """Wait until it has said something so often."""
        said = f"{text} of {self._process.args}"
        wait_until(lambda: sum(text in line for line in self.lines) >= times, STARTS_S, said)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        self._thread.join()
        assert self._process.stdout is not None
        self._process.stdout.close()


def watch_libinput(path: str) -> Watching:
    """Return `libinput debug-events` at work on a device."""
    watching = Watching("libinput", "debug-events", "--device", path)
    watching.wait_for("DEVICE_ADDED")
    return watching


def watch_evtest(path: str) -> Watching:
    """Return evtest at work on a device."""
    watching = Watching("evtest", path)
    watching.wait_for("Testing ...")
    return watching


def libinput_touches(lines: Sequence[str]) -> Iterator[tuple[str, int, Place | None]]:
    """Yield what libinput told: DOWN, MOTION, UP or CANCEL, the slot, the place."""
    for line in lines:
        if told := LIBINPUT_TOUCH.search(line):
            what, slot, x, y = told.groups()
            yield what, int(slot), (float(x), float(y)) if x else None


def evtest_values(lines: Sequence[str], axis: str) -> list[int]:
    """Return the values that evtest saw of an axis."""
    values = (EVTEST_VALUE.search(line) for line in lines)
    return [int(value[2]) for value in values if value and value[1] == axis]


PAGE = b"""<!doctype html><body style="margin:0"><script>
let told = [];
for (const what of ["touchstart", "touchmove", "touchend", "touchcancel"])
    addEventListener(what, event => {
        event.preventDefault();
        for (const touch of event.changedTouches)
            told.push([what, touch.identifier, touch.screenX, touch.screenY]);
    }, {passive: false});
const tell = async () => {
    const now = told;
    told = [];
    await fetch("/told", {method: "POST", body: JSON.stringify(now)});
    setTimeout(tell, 100);
};
tell();
</script>"""


class Page:
    """A page in a browser; `touches` are the touch events that it got, `asked` counts its calls."""

    def __init__(self) -> None:
        self.touches: list[tuple[str, int, float, float]] = []
        self.asked = 0
        page = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/html")
                self.send_header("Content-Length", str(len(PAGE)))
                self.end_headers()
                self.wfile.write(PAGE)

            def do_POST(self) -> None:
                told = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                page.touches += [tuple(one) for one in told]
                page.asked += 1
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_: Any) -> None:
                pass

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.address = f"http://127.0.0.1:{self._server.server_address[1]}/"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """Serve no longer."""
        self._server.shutdown()
        self._server.server_close()


XORG_SIZE_PX = (1280, 720)
_XORG = """
Section "Device"
    Identifier "memory"
    Driver "dummy"
    VideoRam 16384
EndSection
Section "Monitor"
    Identifier "monitor"
    HorizSync 5-1000
    VertRefresh 5-200
    Modeline "1280x720" 74.48 1280 1336 1472 1664 720 721 724 746
EndSection
Section "Screen"
    Identifier "screen"
    Device "memory"
    Monitor "monitor"
    DefaultDepth 24
    SubSection "Display"
        Modes "1280x720"
    EndSubSection
EndSection
"""


@contextlib.contextmanager
def browser_at(page: Page, folder: Path) -> Iterator[None]:
    """Show a page in Chromium, on an X server that has no display but reads touchscreens."""
    config = folder / "xorg.conf"
    config.write_text(_XORG)
    for terminal in ("/dev/tty0", "/dev/tty7"):  # this kernel has none, and X insists on one
        if not Path(terminal).exists():
            subprocess.run(["mknod", terminal, "c", "1", "3"], check=True)
    options = ["vt7", "-sharevts", "-novtswitch", "-keeptty", "-noreset", "-ac"]
    with contextlib.ExitStack() as stack:
        _start(stack, "Xorg", ":0", *options, "-config", str(config), said=folder / "x.log")
        wait_until(Path("/tmp/.X11-unix/X0").exists, STARTS_S, "the X server")
        flags = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-dev-shm-usage"]
        flags += ["--touch-events=enabled", f"--user-data-dir={folder / 'profile'}", "--kiosk"]
        flags += ["--window-position=0,0", "--window-size={},{}".format(*XORG_SIZE_PX)]
        chromium = ["env", "DISPLAY=:0", f"HOME={folder}", "chromium", *flags]
        _start(stack, *chromium, page.address, said=folder / "chromium.log")
        try:
            wait_until(lambda: page.asked > 0, STARTS_S, "the page in Chromium")
            yield
        except BaseException:
            for log in ("x.log", "chromium.log"):
                sys.stderr.write((folder / log).read_text(errors="replace")[-3000:])
            raise


def _start(stack: contextlib.ExitStack, *command: str, said: Path) -> None:
    log = stack.enter_context(said.open("wb"))
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, process_group=0
    )

    def end() -> None:
        process.kill()
        process.wait()

    stack.callback(end)


def eventually(condition: Callable[[], bool], what: str) -> None:
    """Wait until it holds."""
    wait_until(condition, STARTS_S, what)
