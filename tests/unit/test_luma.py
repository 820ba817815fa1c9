"""Grey rows out of the buffers of every format, whatever the padding and wherever the strip."""

import os
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cornertouchd.devices.luma import PACKINGS, LumaReader
from cornertouchd.devices.mjpeg import MjpegReader
from cornertouchd.devices.turbojpeg import load_turbojpeg
from cornertouchd.devices.v4l2_device import Layout

LOW_BITS = {"Y10": 2, "Y12": 4, "Y14": 6, "Y16": 8}


def lines_of(name: str, grey: np.ndarray) -> np.ndarray:
    """Return the lines (rows, bytes) in which a driver lays a picture; other bits are all set."""
    rows, width = grey.shape
    wide = grey.astype(np.uint16)
    if name in LOW_BITS:
        bits = LOW_BITS[name]
        return ((wide << bits) | ((1 << bits) - 1)).astype("<u2").view(np.uint8)
    if name == "Y16-BE":
        return ((wide << 8) | 255).astype(">u2").view(np.uint8)
    if name in {"YUYV", "YVYU"}:
        return (wide | 0xFF00).astype("<u2").view(np.uint8)
    if name in {"UYVY", "VYUY"}:
        return ((wide << 8) | 0xFF).astype("<u2").view(np.uint8)
    if name in {"Y10P", "Y12P"}:
        together = 4 if name == "Y10P" else 2
        groups = -(-width // together)
        whole = np.zeros((rows, groups * together), np.uint8)
        whole[:, :width] = grey
        packed = np.full((rows, groups, together + 1), 255, np.uint8)
        packed[:, :, :together] = whole.reshape(rows, groups, together)
        return packed.reshape(rows, -1)
    return grey


@pytest.mark.parametrize("name", PACKINGS)
@settings(max_examples=15)
@given(
    st.integers(2, 40), st.integers(1, 20), st.integers(0, 16), st.data(), st.integers(0, 2**32 - 1)
)
def test_rows_are_those_of_the_picture(
    name: str, width: int, height: int, padding: int, data: st.DataObject, seed: int
) -> None:
    grey = np.random.default_rng(seed).integers(0, 256, (height, width), np.uint8)
    lines = lines_of(name, grey)
    padded = np.full((height, lines.shape[1] + 2 * padding), 77, np.uint8)
    padded[:, : lines.shape[1]] = lines
    buffer = np.concatenate([padded.ravel(), np.zeros(64, np.uint8)])
    first = data.draw(st.integers(0, height - 1))
    rows = data.draw(st.integers(1, height - first))
    reader = LumaReader(Layout(name, width, height, padded.shape[1], len(buffer)), first, rows)
    read = reader.read(buffer, padded.size - 2 * padding)
    assert read is not None
    assert np.array_equal(read, grey[first : first + rows])
    assert read.dtype == np.uint8
    assert read.flags.c_contiguous
    assert reader.read(buffer, padded.size - 2 * padding - 1) is None


def test_grey_rows_are_not_copied() -> None:
    buffer = np.zeros(64 * 48, np.uint8)
    rows = LumaReader(Layout("GREY", 64, 48, 64, len(buffer)), 10, 20).read(buffer, len(buffer))
    assert rows is not None
    assert np.shares_memory(rows, buffer)


def test_a_layout_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="needs 128 bytes a line and 4828 in all; the driver has"):
        LumaReader(Layout("YUYV", 64, 48, 100, 9000), 0, 48)
    with pytest.raises(ValueError, match="the driver has 64 and 3000"):
        LumaReader(Layout("GREY", 64, 48, 64, 3000), 0, 48)


@pytest.fixture(params=["turbojpeg", "simplejpeg"])
def way(request: pytest.FixtureRequest) -> str:
    """Choose a library."""
    if request.param == "turbojpeg" and load_turbojpeg() is None:
        lacking = pytest.fail if os.environ.get("CORNERTOUCHD_REQUIRE_CLIENTS") else pytest.skip
        lacking("no TurboJPEG 3 on this machine; tests/turbojpeg.sh builds it")
    return request.param


class TestJpeg:
    GREY = cv2.GaussianBlur(
        np.random.default_rng(1).integers(0, 256, (120, 160), np.uint8), (0, 0), 2.0
    )

    def jpeg(self, *options: int, colour: bool = True) -> np.ndarray:
        picture = cv2.cvtColor(self.GREY, cv2.COLOR_GRAY2BGR) if colour else self.GREY
        _, jpeg = cv2.imencode(".jpg", picture, options)
        return jpeg

    def read(
        self, jpeg: np.ndarray, way: str, first: int = 50, rows: int = 33
    ) -> np.ndarray | None:
        """Read from a buffer with rubbish behind the picture, as buffers have it."""
        buffer = np.concatenate([jpeg, np.full(500, 0xFF, np.uint8)])
        return self.reader(way, len(buffer), first, rows).read(buffer, len(jpeg))

    def reader(self, way: str, size: int, first: int = 50, rows: int = 33) -> MjpegReader:
        library = load_turbojpeg() if way == "turbojpeg" else None
        return MjpegReader(Layout("MJPG", 160, 120, 0, size), first, rows, library)

    @pytest.mark.parametrize(
        "options",
        [
            (),
            (cv2.IMWRITE_JPEG_RST_INTERVAL, 4),
            (cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
            (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x111111),
            (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x211111),
            (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x221111),
        ],
    )
    @pytest.mark.parametrize(("first", "rows"), [(0, 16), (50, 33), (0, 120), (119, 1)])
    def test_rows_are_those_of_the_whole_picture(
        self, way: str, options: tuple[int, ...], first: int, rows: int
    ) -> None:
        jpeg = self.jpeg(*options)
        whole = cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE)
        assert np.array_equal(self.read(jpeg, way, first, rows), whole[first : first + rows])

    def test_grey_ones_with_padding(self, way: str) -> None:
        jpeg = self.jpeg(colour=False)
        whole = cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE)
        padded = np.concatenate([jpeg, np.zeros(1000, np.uint8)])
        assert np.array_equal(self.read(padded, way), whole[50:83])

    @pytest.mark.parametrize("columns", [80, 159])
    def test_of_another_size_are_damaged(self, way: str, columns: int) -> None:
        _, jpeg = cv2.imencode(".jpg", self.GREY[:, :columns])
        assert self.read(jpeg, way) is None

    def test_larger_ones_are_damaged(self, way: str) -> None:
        _, jpeg = cv2.imencode(".jpg", np.vstack([self.GREY, self.GREY]))
        assert self.read(jpeg, way) is None

    @pytest.mark.parametrize("share", [0.1, 0.5, 0.95])
    def test_cut_off_ones_are_damaged(self, way: str, share: float) -> None:
        jpeg = self.jpeg()
        assert self.read(jpeg[: int(share * len(jpeg))].copy(), way) is None

    @pytest.mark.parametrize("lost_bytes", [300, 512, 1024])
    @pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
    def test_what_lost_packets_is_damaged_and_the_next_is_not(
        self, way: str, lost_bytes: int, share: float
    ) -> None:
        jpeg = self.jpeg()
        reader = self.reader(way, len(jpeg))
        cut = int(share * len(jpeg))
        lossy = np.concatenate([jpeg[:cut], jpeg[cut + lost_bytes :]])
        for _ in range(3):
            assert reader.read(lossy, len(lossy)) is None
            assert reader.read(jpeg, len(jpeg)) is not None

    def test_pictures_of_one_scene_are_not_looked_through_again(self) -> None:
        first_rows: list[int] = []

        all_whole = SimpleNamespace(
            tj3Init=lambda _kind: 1,
            tj3Destroy=lambda _handle: None,
            tj3DecompressHeader=lambda *_picture: 0,
            tj3Get=lambda _handle, what: {5: 160, 6: 120}[what],
            tj3SetCroppingRegion=lambda _handle, region: first_rows.append(region.y),
            tj3Decompress8=lambda *_picture: 0,
        )
        jpeg = self.jpeg()
        reader = MjpegReader(Layout("MJPG", 160, 120, 0, len(jpeg)), 50, 33, cast(Any, all_whole))
        longer = np.insert(jpeg, 20, np.zeros(200, np.uint8))
        much_longer = np.insert(jpeg, 20, np.zeros(300, np.uint8))
        for one in (jpeg, jpeg, longer, much_longer, much_longer):
            assert reader.read(one, len(one)) is not None
        assert first_rows == [119, 50, 50, 50, 119, 50, 50]

    @settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(st.data())
    def test_no_damage_does_harm(self, way: str, data: st.DataObject) -> None:
        jpeg = self.jpeg()
        for _ in range(data.draw(st.integers(1, 8))):
            jpeg[data.draw(st.integers(0, len(jpeg) - 1))] = data.draw(st.integers(0, 255))
        rows = self.read(jpeg[: data.draw(st.integers(0, len(jpeg)))].copy(), way)
        assert rows is None or rows.shape == (33, 160)

    @settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(content=st.binary(max_size=300))
    def test_no_bytes_do_harm(self, way: str, content: bytes) -> None:
        rubbish = np.frombuffer(b"\xff\xd8" + content + b"\xff\xd9", np.uint8).copy()
        assert self.read(rubbish, way) is None
