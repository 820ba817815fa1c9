"""Taps of a calibration that is not finished: kept after every tap, so that none is lost."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from cornertouchd.calibration.atomic_file import replace_file
from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.model import FloatArray, PictureFormat

_Edges = tuple[FiniteFloat, FiniteFloat] | None


class _Tap(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")
    target_mm: tuple[FiniteFloat, FiniteFloat]
    edges_px: dict[str, _Edges]


class _Progress(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")
    format: str = Field("cornertouchd-taps", pattern="^cornertouchd-taps$")
    version: int = Field(1, ge=1, le=1)
    rig: str
    taps: tuple[_Tap, ...]


@dataclass(frozen=True)
class TapStore:
    """Where taps are kept, and the rig that they belong to.

    `identities` are asked for when the cameras are there.
    """

    path: Path
    surface_mm: tuple[float, float]
    formats: Mapping[str, PictureFormat]
    identities: Callable[[], Mapping[str, str]] = dict

    def load(self, targets_mm: FloatArray) -> dict[int, FloatArray]:
        """Return the taps that were kept, by the number of their target; none if they do not fit.

        A file that is damaged or of another rig counts as none: tapping anew costs a minute.
        """
        try:
            kept = _Progress.model_validate_json(self.path.read_bytes())
        except (OSError, ValidationError):
            return {}
        if kept.rig != self._rig() or not len(targets_mm):
            return {}
        taps = {}
        for tap in kept.taps:
            off = np.linalg.norm(targets_mm - tap.target_mm, axis=1)
            if off.min() < 0.01 and set(tap.edges_px) == set(self.formats):
                nowhere = (np.nan, np.nan)
                edges = [tap.edges_px[camera] or nowhere for camera in self.formats]
                taps[int(np.argmin(off))] = np.array(edges)
        return taps

    def save(self, targets_mm: FloatArray, taps: Mapping[int, FloatArray]) -> None:
        """Keep the taps, (cameras, 2) edges each.  Raises `CalibrationError`."""
        kept = _Progress(
            rig=self._rig(),
            taps=tuple(
                _Tap(
                    target_mm=(float(targets_mm[number, 0]), float(targets_mm[number, 1])),
                    edges_px={
                        camera: (float(left), float(right)) if np.isfinite(left) else None
                        for camera, (left, right) in zip(self.formats, edges, strict=True)
                    },
                )
                for number, edges in sorted(taps.items())
            ),
        )
        try:
            replace_file(self.path, kept.model_dump_json().encode(), keep_previous=False)
        except OSError as error:
            raise CalibrationError(f"{self.path}: cannot be written: {error.strerror}") from error

    def forget(self) -> None:
        """Remove what is kept: the calibration is saved, or the user wants to begin anew."""
        try:
            self.path.unlink(missing_ok=True)
        except OSError as error:
            raise CalibrationError(f"{self.path}: cannot be removed: {error.strerror}") from error

    def _rig(self) -> str:
        formats = {camera: str(form) for camera, form in self.formats.items()}
        return json.dumps([self.surface_mm, formats, dict(self.identities())])
