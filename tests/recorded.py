"""Pictures out of recordings."""

from pathlib import Path

import numpy as np

from cornertouchd.devices.recording import open_recording
from cornertouchd.model import Picture


def recorded(directory: Path, sets: range) -> dict[str, Picture]:
    """Return the pictures of each camera, (N, rows, width_px), from these frame sets."""
    seen: dict[str, list[Picture]] = {}
    for number, frames in enumerate(open_recording(directory)):
        if number in sets:
            for frame in frames:
                seen.setdefault(frame.camera, []).append(frame.pixels.copy())
    return {camera: np.array(stack) for camera, stack in seen.items()}
