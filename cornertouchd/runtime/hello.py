"""What a daemon is, as far as it does not change from second to second."""

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict
from typing import Any, Protocol, runtime_checkable

from cornertouchd import __version__
from cornertouchd.runtime.daemon import Daemon, DaemonStages
from cornertouchd.runtime.displays import Displays, display_mapping


@runtime_checkable
class HasSource(Protocol):
    """A sink that is known by a name."""

    @property
    def source(self) -> str:
        """How clients know it: name@address."""
        ...


def hello(daemon: Daemon, configuration: str, displays: Callable[[], Displays]) -> bytes:
    """Return as JSON what a viewer has to know before it is told of moments.

    `configuration` is its file, empty for the defaults; `displays` tells where displays were found
    to lie.
    """
    stages = daemon.stages
    found = displays()
    said = {
        "version": __version__,
        "configuration": configuration,
        "surface_mm": stages.calibration.surface_mm,
        "rate_hz": stages.settings.cameras.rate_hz,
        "source_name": next(_sources(stages), ""),
        "cameras": [_camera(stages, port.id) for port in stages.ports],
        "display": asdict(found[""]) if "" in found else None,
        "destinations": [
            {
                "host": to.host,
                "port": to.port,
                "display": asdict(display_mapping(stages.calibration.surface_mm, to, found)),
            }
            for to in stages.settings.tuio.destinations
        ],
        "keeps_s": daemon.kept.seconds,
    }
    return json.dumps(said).encode()


def _sources(stages: DaemonStages) -> Iterator[str]:
    return (sink.source for sink in stages.fusion.sinks if isinstance(sink, HasSource))


def _camera(stages: DaemonStages, name: str) -> dict[str, Any]:
    camera = stages.captures[name].calibration
    x_mm, y_mm = camera.model.position_mm
    return {
        "id": name,
        "x_mm": x_mm,
        "y_mm": y_mm,
        "width_px": camera.format.width_px,
        "rows_px": camera.format.rows_px,
        "row_offset_px": camera.format.row_offset_px,
    }
