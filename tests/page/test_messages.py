"""The page reads what is sent, number for number, and refuses what is cut off."""

import math
import struct
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from page.conftest import OpenPage
from page.fake_daemon import FakeDaemon
from page.scene import Contact, Scene, Touch, encode_moment, encode_strip
from playwright.sync_api import Page

FLOATS = st.floats(-1e4, 1e4, width=32)
TOUCHES = st.builds(Touch, st.integers(0, 2**31 - 1), FLOATS, FLOATS, FLOATS, FLOATS, FLOATS)
CONTACTS = st.builds(
    Contact,
    FLOATS,
    FLOATS,
    FLOATS,
    st.floats(0, 1, width=32),
    FLOATS,
    st.one_of(FLOATS, st.just(math.nan)),
    st.booleans(),
    st.integers(0, 2),
    st.booleans(),
)
SHADOWS = st.dictionaries(
    st.integers(0, 3), st.lists(st.tuples(FLOATS, FLOATS), max_size=5), max_size=4
)

READ_MOMENT = """async bytes => {
    const { Moment } = await import("/page/messages.js");
    const moment = new Moment();
    moment.read(new DataView(new Uint8Array(bytes).buffer));
    const row = (i, ...columns) => columns.map(column => moment[column][i]);
    const count = (n, row) => Array.from({ length: n }, (_, i) => row(i));
    return {
        times: [moment.capturedAtS, moment.latencyMs, moment.skewMs],
        touches: count(moment.touches, i => row(i, "touchId", "touchXMm", "touchYMm",
            "touchVxMmS", "touchVyMmS", "touchDiameterMm", "touchAgeS")),
        contacts: count(moment.contacts, i => row(i, "contactXMm", "contactYMm",
            "contactDiameterMm", "contactConfidence", "contactLeanDeg", "contactAzimuthDeg",
            "contactTouching", "contactKind", "contactRefused")),
        shadows: count(moment.shadows, i => row(i, "shadowCamera", "shadowFirstRad",
            "shadowLastRad")),
    };
}"""


@pytest.fixture(scope="module")
def scene_address() -> Iterator[str]:
    with FakeDaemon(Scene(moments=False)) as fake:
        yield fake.address


@pytest.fixture
def page(open_page: OpenPage, scene_address: str) -> Page:
    return open_page(scene_address)


@given(
    at_s=st.floats(0, 1e9),
    touches=st.lists(TOUCHES, max_size=4),
    contacts=st.lists(CONTACTS, max_size=4),
    shadows=SHADOWS,
)
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_number_of_a_moment_arrives(
    page: Page,
    at_s: float,
    touches: list[Touch],
    contacts: list[Contact],
    shadows: dict[int, list[tuple[float, float]]],
) -> None:
    message = encode_moment(at_s, touches, contacts, shadows, latency_ms=7.5, skew_ms=0.25)
    read = page.evaluate(READ_MOMENT, list(message))
    assert read["times"] == [at_s, 7.5, 0.25]
    assert read["touches"] == [
        [t.id, t.x_mm, t.y_mm, t.vx_mm_s, t.vy_mm_s, t.diameter_mm, t.age_s] for t in touches
    ]
    assert [_without_nan(row) for row in read["contacts"]] == [
        _without_nan(
            [c.x_mm, c.y_mm, c.diameter_mm, c.confidence, c.lean_deg, c.azimuth_deg,
             int(c.touching), c.kind, int(c.refused)]
        )
        for c in contacts
    ]  # fmt: skip
    assert read["shadows"] == [
        [camera, first, last] for camera, pairs in shadows.items() for first, last in pairs
    ]


def _without_nan(row: list[float]) -> list[float | None]:
    return [None if isinstance(value, float) and math.isnan(value) else value for value in row]


def test_a_strip_arrives_as_it_was_sent(page: Page) -> None:
    message = encode_strip(2, 12.5, [(100.25, 130.75)])
    read = page.evaluate(
        """async bytes => {
            const { readStrip } = await import("/page/messages.js");
            const strip = readStrip(new DataView(new Uint8Array(bytes).buffer));
            return {
                ...strip,
                picture: [...strip.picture.subarray(0, 640)],
                profile: [...strip.profile], reference: [...strip.reference],
                state: [...strip.state], edgesPx: [...strip.edgesPx],
            };
        }""",
        list(message),
    )
    assert (read["camera"], read["widthPx"], read["rowsPx"]) == (2, 640, 48)
    assert (read["capturedAtS"], read["level"]) == (12.5, 168.0)
    assert read["contrast"] == struct.unpack("<f", struct.pack("<f", 0.91))[0]
    assert read["edgesPx"] == [100.25, 130.75]
    picture, columns = message[32 : 32 + 640], message[32 + 48 * 640 :]
    assert read["picture"] == list(picture)
    assert read["profile"] == list(columns[:640])
    assert read["reference"] == list(columns[640:1280])
    assert read["state"] == list(columns[1280:1920])


@pytest.mark.parametrize("cut", [1, 7, 40, 100])
def test_what_is_cut_off_is_refused(page: Page, cut: int) -> None:
    message = encode_moment(1.0, [Touch(1, 2.0, 3.0)], [Contact(2.0, 3.0)], {0: [(0.1, 0.2)]})
    refused = page.evaluate(
        """async bytes => {
            const { Moment } = await import("/page/messages.js");
            try {
                new Moment().read(new DataView(new Uint8Array(bytes).buffer));
                return "";
            } catch (error) {
                return error.name;
            }
        }""",
        list(message[:-cut] if cut < len(message) else b"\x01"),
    )
    assert refused == "RangeError"
