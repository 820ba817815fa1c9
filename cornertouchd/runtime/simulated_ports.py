"""The cameras of the simulated rig, as the settings make it."""

from functools import partial

from cornertouchd.config import Settings
from cornertouchd.ports import CameraPort, Clock
from cornertouchd.simulation.camera import painted_ports
from cornertouchd.simulation.painting import PaintingProcess
from cornertouchd.simulation.show import make_rig, make_show


def simulated_ports(settings: Settings, clock: Clock) -> tuple[CameraPort, ...]:
    """Return its cameras that are enabled; their pictures are painted by a process of their own."""
    formats = make_rig(settings).formats
    used = {camera: formats[camera] for camera in formats if camera in settings.cameras.enabled_ids}
    painting = PaintingProcess(partial(make_show, settings), used)
    paints = {camera: painting.painter(camera) for camera in used}
    simulation = settings.simulation
    identity = f"simulated rig seed {simulation.seed}"
    return painted_ports(used, paints, clock, settings.cameras.rate_hz, simulation.speed, identity)
