"""From a picture to its shadows, by the method that the settings choose."""

from typing import Protocol

from cornertouchd.config import VisionSettings
from cornertouchd.model import FloatArray, Picture, Shadows
from cornertouchd.vision.paper_edges import PaperFinder
from cornertouchd.vision.profile import Measured, ProfileSampler
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.shadows import find_shadows
from cornertouchd.vision.strip import Strip


class ShadowFinder(Protocol):
    """Finds the shadows in pictures of one camera; keeps nothing from one picture to the next."""

    def find(self, picture: Picture) -> Shadows:
        """Return the shadows of a picture (rows, width_px) from left to right."""
        ...


class ProfileFinder:
    """The default: sub-pixel edges in the profile at the horizon."""

    def __init__(self, strip: Strip, empty: FloatArray, settings: VisionSettings) -> None:
        self.sampler = ProfileSampler(strip, empty, settings)
        self._settings = settings

    def find(self, picture: Picture) -> Shadows:
        """Return the shadows of a picture (rows, width_px) from left to right."""
        return self.look(picture, self.sampler.reference)[1]

    def look(self, picture: Picture, reference: Reference) -> tuple[Measured, Shadows]:
        """Return what a picture shows, measured against any reference."""
        measured = self.sampler.measure(picture, reference)
        return measured, find_shadows(measured.profile, self._settings, sunlit=measured.sunlit)

    def find_with_hidden(self, picture: Picture) -> tuple[Shadows, float]:
        """Return them with places where one could be hidden, as `find_shadows` does, and the gain.

        Raises `NoiseError` for a picture that cannot show the strip.
        """
        reference = self.sampler.reference
        measured = self.sampler.measure(picture, reference)
        measured.require_strip()
        shadows = find_shadows(
            measured.profile,
            self._settings,
            sunlit=measured.sunlit,
            hiding=reference.on_strip,
        )
        return shadows, measured.gain


def make_finder(strip: Strip, empty: FloatArray, settings: VisionSettings) -> ShadowFinder:
    """Return the finder that the settings choose; `empty` is the mean of empty pictures."""
    if settings.edges == "paper":
        return PaperFinder(strip, len(empty), settings.paper)
    return ProfileFinder(strip, empty, settings)
