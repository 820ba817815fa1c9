"""The page of the real daemon: `cornertouchd demo`, its server, a browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from page.conftest import OpenPage
from page.looking import (
    pixels_coloured,
    touches_shown,
    wait_for_moments,
    wait_for_state,
    wait_until,
)
from page.running_daemon import TuioMemory, free_port, running_daemon, running_demo
from PIL import Image

SEES_TOUCHES = "cornertouchd.moment.touches >= 2"
LOOKS = 20
LARGEST_PICTURE = 150_000
COLOURS = 128
SCREENS = {
    "dark": (1440, 900, "dark"),
    "light": (1440, 900, "light"),
    "phone": (390, 1180, "dark"),
}
SAVED_WITHIN_S = 120.0

pytestmark = pytest.mark.timeout(240)


@pytest.fixture(scope="module")
def tuio() -> Iterator[TuioMemory]:
    memory = TuioMemory()
    yield memory
    memory.close()


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory, tuio: TuioMemory) -> Iterator[str]:
    port = free_port()
    with running_demo(tmp_path_factory.mktemp("demo"), port, tuio.port):
        yield f"http://127.0.0.1:{port}"


def test_touches_are_where_tuio_tells_them(
    open_page: OpenPage, address: str, tuio: TuioMemory
) -> None:
    page = open_page(address)
    places = set()
    for _ in range(LOOKS):
        wait_for_moments(page, 2)
        places |= {(number, *place) for number, place in touches_shown(page).items()}
    wait_until(page, SEES_TOUCHES)
    assert len(places) > LOOKS
    wait_for_moments(page, 10)  # so that the last packets have arrived, too
    # sessions are numbered on from a number of their own: for all places by the same one
    begins = [{told - number for told in tuio.told_at(x, y)} for number, x, y in places]
    assert set.intersection(*begins), begins
    assert pixels_coloured(page, "#moving") > 200


def test_strips_and_health_of_all_cameras_are_shown(open_page: OpenPage, address: str) -> None:
    page = open_page(address)
    wait_until(page, "cornertouchd.strips.panels.length === 4")
    page.locator("#strips").scroll_into_view_if_needed()
    wait_until(page, "cornertouchd.strips.panels.every(panel => panel.strip !== null)")
    wait_until(page, "cornertouchd.health?.cameras.length === 4")
    widths = page.evaluate("cornertouchd.strips.panels.map(panel => panel.strip.widthPx)")
    assert widths == [640, 640, 640, 640]
    levels = page.evaluate("cornertouchd.strips.panels.map(panel => panel.strip.level)")
    assert all(20 < level < 250 for level in levels), levels
    wait_until(page, "document.querySelectorAll('#cameras-body tr').length === 4")
    assert page.inner_text("#destinations-body").startswith("127.0.0.1:")
    assert page.evaluate("cornertouchd.bad") == 0
    assert page.is_hidden("#save"), "viewers of the demo may look only"


def test_targets_wait_for_a_calibration(open_page: OpenPage, address: str) -> None:
    page = open_page(f"{address}/targets")
    wait_until(page, "document.querySelector('#hint').textContent === 'No calibration runs'")


@pytest.mark.parametrize("name", SCREENS)
def test_it_looks_right(
    open_page: OpenPage, address: str, tmp_path: Path, pictures: Path | None, name: str
) -> None:
    """Pictures for the documentation, when --pictures asks for them, for people to look at."""
    width, height, scheme = SCREENS[name]
    page = open_page(address, viewport={"width": width, "height": height}, color_scheme=scheme)
    wait_until(
        page, "cornertouchd.strips.panels.every(panel => panel.strip) && cornertouchd.health"
    )
    wait_for_moments(page, 30)
    wait_until(page, SEES_TOUCHES)
    file = (pictures or tmp_path) / f"live-page-{name}.png"
    page.screenshot(path=file, full_page=name != "phone")
    with Image.open(file) as picture:
        picture.convert("RGB").quantize(COLOURS).save(file, optimize=True)
    assert 20_000 < file.stat().st_size < LARGEST_PICTURE
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_it_comes_back_when_the_daemon_is_started_again(
    open_page: OpenPage, tmp_path: Path, tuio: TuioMemory
) -> None:
    port = free_port()
    with running_demo(tmp_path, port, tuio.port, "--touches", "2"):
        page = open_page(f"http://127.0.0.1:{port}")
        wait_for_moments(page)
    wait_for_state(page, "gone")
    assert touches_shown(page) == {}
    with running_demo(tmp_path, port, tuio.port, "--touches", "2"):
        wait_for_state(page, "live")
        wait_for_moments(page)


def test_who_knows_the_token_sees_and_saves(open_page: OpenPage, tmp_path: Path) -> None:
    port, token = free_port(), "a-token-of-the-test"
    with running_daemon(tmp_path, port, f'token = "{token}"\nallow_actions = true'):
        page = open_page(f"http://127.0.0.1:{port}")
        wait_for_state(page, "token")
        page.fill("#token", "another-token-than-it")
        page.press("#token", "Enter")
        wait_until(page, "document.querySelector('#token-refused').textContent !== ''")
        page.fill("#token", token)
        page.press("#token", "Enter")
        wait_for_moments(page, 30)
        page.click("#save")
        said = "document.querySelector('#save-text').textContent"
        wait_until(page, f"/^(Not s|S)aved/.test({said})", SAVED_WITHIN_S)
        said = page.inner_text("#save-text")
        assert said.startswith("Saved: "), said
        (saved,) = (tmp_path / "recordings").iterdir()
        assert str(saved) in said
        assert (saved / "recording.json").is_file()
