"""The simulated rig that settings describe, and the fingers that move on it.

Nothing here is compiled, so that the process that paints its pictures starts at once.
"""

from cornertouchd.config import Settings
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.simulation.scripts import Script, demo_script

ROWS_PX = 64


def make_rig(settings: Settings, rows_px: int = ROWS_PX) -> SimulatedRig:
    """Return the simulated rig that the settings describe, with pictures of so many rows."""
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    return SimulatedRig(
        surface_mm,
        width_px=settings.cameras.width_px,
        height_px=settings.cameras.height_px,
        rows_px=rows_px,
        seed=settings.simulation.seed,
    )


def make_show(settings: Settings) -> tuple[SimulatedRig, Script]:
    """Return the simulated rig, and the fingers that move on it."""
    rig = make_rig(settings)
    fingers = settings.simulation.touches
    return rig, demo_script(rig.surface_mm, fingers, settings.simulation.seed)
