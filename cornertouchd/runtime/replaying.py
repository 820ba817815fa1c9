"""A recording through the whole pipeline in one thread: the same in, the same out."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.observing import mean_pictures
from cornertouchd.config import Settings
from cornertouchd.devices.recording import Recording, RecordingError
from cornertouchd.fusion.pairing import frame_set_of, is_worth_fusing
from cornertouchd.model import Contact, FloatArray, Frame, FrameSet, Observation, Touch
from cornertouchd.pipeline import CameraPipeline, PictureError, SurfacePipeline
from cornertouchd.runtime.assembly import require_surface
from cornertouchd.runtime.fusing import SILENCE_S
from cornertouchd.vision.lighting import Lighting, lighting

Runs = Sequence[tuple[int, int]]


@dataclass(frozen=True, slots=True)
class ReplayedSet:
    """What one frame set gave."""

    index: int
    captured_at_s: float
    contacts: tuple[Contact, ...]
    touches: tuple[Touch, ...]


class Replay:
    """A recording and what it is looked at with.

    `independent`: every frame set on its own, no tracking.  `empty_runs`: first and last frame set
    of runs in which the surface was empty; each is the background of what follows it.  Raises
    `CalibrationError` if the recording does not fit the calibration, `RecordingError` if a run
    lies outside the recording.
    """

    def __init__(
        self,
        recording: Recording,
        calibration: Calibration,
        settings: Settings,
        *,
        independent: bool = False,
        empty_runs: Runs = (),
    ) -> None:
        self._recording = recording
        self._independent = independent
        self._cameras: dict[str, CameraPipeline] = {}
        for camera, size in recording.formats.items():
            known = calibration.camera(camera)
            known.require_camera(size, recording.identities[camera])
            self._cameras[camera] = CameraPipeline(known, settings)
        require_surface(calibration, recording.surface_mm, str(recording.directory))
        self._surface = SurfacePipeline(calibration, settings)
        self.refused_pictures = 0
        self._touches: tuple[Touch, ...] = ()
        self._followed_at_s: float | None = None
        self._backgrounds = self._backgrounds_by_set(empty_runs)

    def learn_background(self, empties: Mapping[str, FloatArray]) -> None:
        """Measure against these mean empty pictures (rows_px, width_px) of the cameras."""
        for camera, empty in empties.items():
            if camera in self._cameras:
                self._cameras[camera].learn_background(empty)

    def __iter__(self) -> Iterator[ReplayedSet]:
        """Yield what every frame set gives, in order."""
        for index, frames in enumerate(self._recording):
            if index in self._backgrounds:
                self.learn_background(self._backgrounds[index])
            frame_set = self._observe(frames)
            contacts: tuple[Contact, ...] = ()
            if self._independent:
                contacts = self._surface.cross(frame_set)
            else:
                contacts = self._follow(frame_set)
            yield ReplayedSet(index, frame_set.captured_at_s, contacts, self._touches)

    def _follow(self, frame_set: FrameSet) -> tuple[Contact, ...]:
        """Follow touches as the daemon does, which skips what too few cameras saw."""
        now_s = frame_set.captured_at_s
        if is_worth_fusing(frame_set, len(self._cameras)):
            contacts, self._touches = self._surface.follow(frame_set)
            self._followed_at_s = now_s
            return contacts
        if self._followed_at_s is not None and now_s - self._followed_at_s > SILENCE_S:
            self._surface.reset()
            self._touches, self._followed_at_s = (), None
        return ()

    def _observe(self, frames: Sequence[Frame]) -> FrameSet:
        """Return what the cameras saw; a picture that is refused is counted and left out."""
        seen = []
        for frame in frames:
            try:
                seen += self._observed(frame)
            except PictureError:
                self.refused_pictures += 1
        return frame_set_of(seen) if seen else FrameSet(frames[0].captured_at_s, ())

    def _observed(self, frame: Frame) -> list[Observation]:
        """Return what a picture shows; nothing if the LEDs were off.  Raises `PictureError`."""
        camera, lit = self._cameras[frame.camera], lighting(frame)
        if lit is Lighting.PARTLY:
            raise PictureError("only some sides of the frame were lit")
        if lit is Lighting.LIT:
            return [camera.find(frame) if self._independent else camera.observe(frame)]
        if not self._independent:
            camera.learn_dark(frame)
        return []

    def _backgrounds_by_set(self, runs: Runs) -> dict[int, Mapping[str, FloatArray]]:
        """Return the mean empty pictures of every run, by the frame set where it begins."""
        count = len(self._recording)
        for first, last in runs:
            if last >= count:
                raise RecordingError(
                    f"{self._recording.directory}: empty sets {first}-{last} lie outside its "
                    f"{count} frame sets"
                )
        if not runs:
            return {}
        inside: dict[int, list[Sequence[Frame]]] = {first: [] for first, _ in runs}
        for index, frames in enumerate(self._recording):
            for first, last in runs:
                if first <= index <= last:
                    inside[first].append(frames)
            if index >= runs[-1][1]:
                break
        return {first: mean_pictures(sets) for first, sets in inside.items()}
