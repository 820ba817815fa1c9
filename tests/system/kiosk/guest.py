"""Boots the guest, lets it run a script on a copy of the checkout, and streams what it says."""

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

from system.kiosk.disk import KioskError
from system.kiosk.machine import ROOT, Machine

Boot = Literal["bare", "systemd"]
INIT = {"bare": "/opt/kiosk/init", "systemd": "/sbin/init"}
MEMORY_MB = 1536
POLL_S = 0.1
NEWEST_FILE_S = 1_000_000_000
"""Times of copied files end here, well before any clock."""

_OPTIONS = (
    # One processor: several do not run at the same time anyway, and wait for one another.
    *("seccomp=on", "ncpus=1", "root=/dev/ubda", "rw", "rootfstype=ext4"),
    *("con0=null,fd:1", "con1=null", "con=null", "ssl=null", "quiet", "loglevel=4"),
    *("random.trust_cpu=on", "systemd.show_status=no", "systemd.unit=kiosk.target"),
)


ENVIRONMENT = {
    "PYTHONPATH": "/host/checkout:/host/site",
    "PYTHONDONTWRITEBYTECODE": "1",
    "NUMBA_CACHE_DIR": "/host/compiled",
}
"""As in overlay/opt/kiosk/run, for a program that runs on the guest's disk outside of it."""


@dataclass(frozen=True, slots=True)
class Ran:
    """What became of a script: its exit status and what it said."""

    status: int
    output: str


class KioskGuest:
    """A guest and the folder that it shares with us; every `run` is a boot of its own.

    The folder `share` is /host in the guest: `checkout` is a copy of the files of the checkout,
    new ones included; `compiled` holds compiled kernels and may be filled beforehand.  Nothing of
    the guest's disk outlives a run.  A terminal of ours, `serial`, is /dev/ttyS0 in the guest.
    """

    def __init__(
        self, machine: Machine, boot: Boot = "bare", *, serial: Path | None = None
    ) -> None:
        self._machine = machine
        self._boot = boot
        self._serial = serial
        self._folder = Path()

    def __enter__(self) -> Self:
        self._folder = Path(tempfile.mkdtemp(prefix="kiosk-"))
        fill_share(self.share)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        shutil.rmtree(self._folder)

    @property
    def share(self) -> Path:
        """The folder that is /host in the guest."""
        return self._folder / "share"

    def run(self, script: str, timeout_s: float) -> Ran:
        """Boot, run a shell script in the checkout as root, power off.

        What it says goes to our stdout as it comes.  Raises `KioskError` if the guest does not end
        in time or dies, with the end of its console.
        """
        (self.share / "run.sh").write_text(script)
        output, status = self.share / "output", self.share / "status"
        output.write_bytes(b"")
        status.unlink(missing_ok=True)
        console = self._folder / "console"
        with console.open("wb") as file:
            process = subprocess.Popen(
                self._command(),
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                env={**os.environ, "TMPDIR": str(memory_folder())},
                process_group=0,
            )
        try:
            said = _follow(process, output, timeout_s)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, 9)
                process.wait()
        if not status.exists():
            last = console.read_text(errors="replace").splitlines()[-40:]
            raise KioskError("the guest ended without a status; its console:\n" + "\n".join(last))
        return Ran(int(status.read_text()), said)

    def _command(self) -> list[str]:
        return [
            str(self._machine.kernel),
            f"mem={MEMORY_MB}M",
            f"uml_dir={self._folder}/",
            f"ubd0={self._folder}/changes,{self._machine.image}",
            f"hostfs={self.share}",
            f"init={INIT[self._boot]}",
            *_OPTIONS,
            *([f"ssl0=tty:{self._serial}"] if self._serial is not None else []),
        ]


def fill_share(share: Path) -> None:
    """Fill the folder that is /host in the guest."""
    (share / "compiled").mkdir(parents=True)
    _copy_checkout(share / "checkout")
    _write_metadata(share / "site")


def memory_folder() -> Path:
    """Return where the guest's memory is kept: a file that programs must be run from."""
    memory = Path("/dev/shm")
    try:
        flags = os.statvfs(memory)
    except OSError:
        return Path(tempfile.gettempdir())
    fits = flags.f_bavail * flags.f_frsize > 2 * MEMORY_MB << 20
    return memory if fits and not flags.f_flag & os.ST_NOEXEC else Path(tempfile.gettempdir())


def _follow(process: "subprocess.Popen[bytes]", output: Path, timeout_s: float) -> str:
    """Pass on what is said until the process ends; return all of it."""
    until_s = time.monotonic() + timeout_s
    said = ""
    with output.open(errors="replace") as file:
        while True:
            ended = process.poll() is not None
            new = file.read()
            sys.stdout.write(new)
            sys.stdout.flush()
            said += new
            if ended:
                return said
            if time.monotonic() > until_s:
                raise KioskError(f"the guest did not end within {timeout_s:g} s; it said:\n{said}")
            time.sleep(POLL_S)


def _copy_checkout(into: Path) -> None:
    """Copy what git knows or would take.

    The time of a file is made from its contents: numba takes what it has compiled for a file with
    the same time, wherever and whenever that was copied.
    """
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    for name in filter(None, listed.split("\0")):
        source, target = ROOT / name, into / name
        if not source.is_file():  # deleted, and not yet committed
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, target)
        digest = hashlib.sha256(target.read_bytes()).digest()
        time_s = int.from_bytes(digest[:4], "big") % NEWEST_FILE_S
        os.utime(target, (time_s, time_s))


def _write_metadata(into: Path) -> None:
    """Tell the version, without which the copy cannot be imported."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    name, version = project["name"], project["version"]
    metadata = into / f"{name}-{version}.dist-info" / "METADATA"
    metadata.parent.mkdir(parents=True)
    metadata.write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
