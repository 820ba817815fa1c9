"""What a driver's errno means, and what to do about it."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path

PROC = Path("/proc")

_GONE = "{device} is gone; look at its plug, its cable and the power of its USB hub"
_NOT_ALLOWED = (
    "{device} may not be opened by this user; put the user into the group video "
    "(usermod -aG video NAME) and start anew"
)
_USB_FAILED = (
    "{device} stopped with {name} ({why}); if that comes back, look at cable, hub and power"
)
_MEANINGS = {
    errno.ENOENT: "{device} is not there; is it plugged in?",
    errno.ENODEV: _GONE,
    errno.ENXIO: _GONE,
    errno.ESHUTDOWN: _GONE,
    errno.EACCES: _NOT_ALLOWED,
    errno.EPERM: _NOT_ALLOWED,
    errno.EBUSY: "{device} is held by another program ({holders}); stop that",
    errno.ENOSPC: (
        "{device}: no bandwidth is left on its USB bus for {settings}; lower cameras.rate_hz, "
        'choose a smaller size or cameras.pixel_format = "MJPG", or plug the camera into a root '
        "port of another USB controller (see docs/cameras.md)"
    ),
    errno.ENOMEM: "{device}: no memory for its buffers ({why}); close other programs",
    errno.ENOTTY: "{device} is no video device; correct the camera's device",
    errno.EIO: _USB_FAILED,
    errno.EPROTO: _USB_FAILED,
    errno.EPIPE: _USB_FAILED,
    errno.ETIMEDOUT: _USB_FAILED,
    errno.EILSEQ: _USB_FAILED,
    errno.EOVERFLOW: _USB_FAILED,
}
_OTHER = "{device} refuses {settings}: {name} ({why})"


def explain(error: OSError, device: str, settings: str, proc: Path = PROC) -> str:
    """Return the reason and the remedy of an error of a video device, a file of /dev.

    `settings` are the pictures that were asked for, in words; `proc` is mounted there.
    """
    number = error.errno or 0
    holders = _holders(device, proc) if number == errno.EBUSY else ()
    return _MEANINGS.get(number, _OTHER).format(
        device=device,
        settings=settings,
        name=errno.errorcode.get(number, str(number)),
        why=error.strerror or error,
        holders=", ".join(holders) or "of another user, or in a container",
    )


def _holders(device: str, proc: Path) -> Iterator[str]:
    """Yield the other processes that have the device open, as far as we may look."""
    node = os.path.realpath(device)
    for process in proc.iterdir():
        if not process.name.isdigit() or process.name == str(os.getpid()):
            continue
        try:
            if any(os.path.realpath(fd) == node for fd in (process / "fd").iterdir()):
                name = (process / "comm").read_text(encoding="utf-8", errors="replace").strip()
                yield f"{name}, process {process.name}"
        except OSError:
            continue  # not ours to look into, or just ended
