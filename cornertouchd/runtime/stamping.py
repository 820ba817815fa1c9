"""When and by what software a calibration is made."""

from datetime import UTC, datetime

from cornertouchd import __version__
from cornertouchd.calibration.methods import Stamp


def stamp_now() -> Stamp:
    """Return the stamp of a calibration made now."""
    return Stamp(datetime.now(UTC).isoformat(timespec="seconds"), __version__)
