"""The sensor: light in, 8-bit picture out, with the noise of counted photons and of reading."""

import struct
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from cornertouchd.model import Picture

Light = NDArray[np.float32]

# Fitted to sixteen path-traced pictures of an empty rig, in grey levels: variance = read² + gain x
# light, at a light of 0 to 230.
BLACK = 2.7
READ_NOISE = 0.25
GAIN = 0.034

# One normal deviate for each pixel, from one of a million places: enough that no two pictures of
# an hour show the same pattern at the same place, small enough for the processor's cache.
TABLE_SIZE = 1 << 20


class SensorNoise:
    """Turns light into pictures; the same seed, camera and index give the same noise.

    Deviates come out of one table at an offset that is a hash of camera and index, so pictures
    may be taken in any order and by any thread.
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(np.random.SeedSequence([seed, 1]))
        self._seed = seed
        self._table = rng.standard_normal(TABLE_SIZE, dtype=np.float32)
        self._table.setflags(write=False)

    def expose(self, light: Light, camera: int, index: int) -> Picture:
        """Return the picture of `light` (rows, columns), which is in grey levels above black."""
        start = self._offset(camera, index, TABLE_SIZE - light.size)
        deviates = self._table[start : start + light.size].reshape(light.shape)
        grey = np.multiply(light, np.float32(GAIN))
        grey += np.float32(READ_NOISE**2)
        np.sqrt(grey, out=grey)
        grey *= deviates
        grey += light
        return digitise(grey)

    def _offset(self, camera: int, index: int, span: int) -> int:
        counter = struct.pack("<qqq", self._seed, camera, index)
        return int.from_bytes(blake2b(counter, digest_size=8).digest(), "little") % span


def digitise(light: Light) -> Picture:
    """Return the light as 8-bit grey on top of the black level."""
    grey = light + np.float32(BLACK + 0.5)
    np.clip(grey, 0.0, 255.0, out=grey)
    return grey.astype(np.uint8)
