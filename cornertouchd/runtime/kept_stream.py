"""The pictures that the daemon keeps, and those that come, told to whoever records them."""

from collections.abc import Collection, Mapping
from math import isfinite
from typing import Any

from cornertouchd.ports import Clock
from cornertouchd.runtime.asking import Answer, Asker, RefusedError
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.keeping import KeptReader
from cornertouchd.wire.pictures import (
    StreamedCamera,
    StreamHead,
    encode_end,
    encode_picture,
)

LOOK_S = 0.02
"""How often it is looked for new pictures: two of each camera at the usual rate."""

OF_LATE_S = 2.0
"""A camera that gave no picture for so long is lost, not just slow."""


def pictures_of(daemon: Daemon, clock: Clock) -> Answer:
    """Return what answers "pictures": of the last `last_s`, then for `seconds`.

    Without `seconds` until he has enough: he says `{"stop": true}`.
    """
    return lambda asker: _stream(daemon, clock, asker)


def _stream(daemon: Daemon, clock: Clock, asker: Asker) -> None:
    last_s = _time(asker.request, "last_s") or 0.0
    seconds = _time(asker.request, "seconds")
    until_s = None if seconds is None else clock.now_s() + seconds
    kept = daemon.kept
    reader = KeptReader(kept, last_s)
    asker.send(_head(daemon, kept.giving(max(last_s, OF_LATE_S))).encode())
    index = {camera: number for number, camera in enumerate(kept.cameras)}
    while True:
        is_last = (
            (until_s is not None and clock.now_s() >= until_s)
            or daemon.kept is not kept  # the configuration has changed
            or any(one.get("stop") for one in asker.further())
        )
        for frame in reader.pending():
            asker.send(encode_picture(index[frame.camera], frame))
        if is_last or asker.has_enough:
            break
        asker.pause(LOOK_S)
    asker.send(encode_end(reader.missing))


def _head(daemon: Daemon, giving: Collection[str]) -> StreamHead:
    stages = daemon.stages
    return StreamHead(
        surface_mm=stages.calibration.surface_mm,
        rate_hz=stages.settings.cameras.rate_hz,
        tolerance_s=stages.settings.pairing.tolerance_ms / 1000.0,
        cameras=tuple(
            StreamedCamera(
                id=port.id,
                width_px=port.format.width_px,
                height_px=port.format.height_px,
                row_offset_px=port.format.row_offset_px,
                rows_px=port.format.rows_px,
                identity=port.identity,
                gives=port.id in giving,
            )
            for port in stages.ports
        ),
    )


def _time(request: Mapping[str, Any], name: str) -> float | None:
    given = request.get(name)
    if given is None:
        return None
    if isinstance(given, bool) or not isinstance(given, int | float) or not isfinite(given):
        raise RefusedError(f"{name} = {given!r:.40}: must be a number of seconds")
    if given < 0:
        raise RefusedError(f"{name} = {given:g}: must be 0 or more")
    return float(given)
