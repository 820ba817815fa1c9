"""The page as viewers see it, before a server that plays any scene."""

import json
import re
from collections.abc import Iterator

import pytest
from page.conftest import OpenPage
from page.fake_daemon import PAGE, FakeDaemon
from page.looking import (
    pixels_coloured,
    touches_shown,
    wait_for_moments,
    wait_for_state,
    wait_until,
)
from page.scene import Scene

PHONE = {"width": 390, "height": 844}
WALL = {"width": 3840, "height": 2160}
LARGEST_PAGE = 200_000
FRAMES_MEASURED = 120
MOST_WAITS = 50


@pytest.fixture
def fake() -> Iterator[FakeDaemon]:
    with FakeDaemon(Scene()) as fake:
        yield fake


def test_it_shows_touches_strips_and_health(open_page: OpenPage, fake: FakeDaemon) -> None:
    page = open_page(fake.address)
    wait_for_moments(page)
    assert set(touches_shown(page)) == set(range(100, 107))
    wait_until(page, "cornertouchd.strips.drawn >= 8 && cornertouchd.health")
    assert pixels_coloured(page, "#moving") > 500
    for panel in page.locator(".strip canvas").all():
        assert "4 edges" in (panel.get_attribute("aria-label") or "")
    assert page.inner_text("#health-state") == "All is well"
    assert "columns 500 to 530 are blind" in page.inner_text("#hints")
    assert page.inner_text("#destinations-body").startswith("127.0.0.1:3333")
    assert page.locator("#cameras-body tr").count() == 4
    assert page.is_hidden("#notice")


def test_touches_stand_in_a_table_too(open_page: OpenPage, fake: FakeDaemon) -> None:
    fake.scene.touches = 3
    page = open_page(fake.address)
    page.click("#touch-table summary")
    wait_until(page, "document.querySelectorAll('#touches-body tr').length === 3")
    assert page.inner_text("#touches-body th >> nth=0") == "100"


def test_what_the_log_says_is_text(open_page: OpenPage, fake: FakeDaemon) -> None:
    page = open_page(fake.address)
    page.locator("#log li").last.wait_for()
    assert "refused <b>3</b> messages & more" in page.inner_text("#log")
    page.select_option("#log-level", "WARNING")
    assert page.locator("#log li").count() == 2


def test_it_comes_back_after_the_daemon_was_gone(open_page: OpenPage) -> None:
    with FakeDaemon(Scene()) as first:
        page = open_page(first.address)
        wait_for_moments(page)
    wait_for_state(page, "gone")
    assert "The daemon is gone" in page.inner_text("#notice")
    assert touches_shown(page) == {}
    with FakeDaemon(Scene(touches=2), first.port):
        wait_for_state(page, "live")
        wait_for_moments(page)
        assert set(touches_shown(page)) == {100, 101}
        wait_until(page, "document.querySelector('#notice').hidden")


def test_a_token_is_asked_for_refused_and_accepted(open_page: OpenPage, fake: FakeDaemon) -> None:
    fake.scene.token = "open-sesame-open"
    page = open_page(fake.address)
    wait_for_state(page, "token")
    assert page.is_visible("#token-form")
    page.fill("#token", "open-barley-open")
    page.press("#token", "Enter")
    wait_until(page, "document.querySelector('#token-refused').textContent !== ''")
    assert "refused" in page.inner_text("#token-refused")
    page.fill("#token", fake.scene.token)
    page.press("#token", "Enter")
    wait_for_moments(page)
    assert page.is_hidden("#token-form")
    page.reload()
    wait_for_moments(page)


def test_a_token_does_not_stay_in_the_address(open_page: OpenPage, fake: FakeDaemon) -> None:
    fake.scene.token = "open-sesame-open"
    page = open_page(f"{fake.address}/?token={fake.scene.token}")
    wait_for_moments(page)
    assert page.url == f"{fake.address}/"


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        (Scene(touches=0), "No touches yet"),
        (Scene(cameras=0), "No cameras"),
        (Scene(live=False, moments=False), "No cameras"),
        (Scene(moments=False), "Nothing is seen"),
    ],
    ids=["no touches", "none configured", "all lost", "no pictures"],
)
def test_it_says_why_nothing_is_shown(open_page: OpenPage, scene: Scene, said: str) -> None:
    with FakeDaemon(scene) as fake:
        page = open_page(fake.address)
        wait_until(page, f"document.querySelector('#notice-title').textContent === '{said}'")


def test_touches_are_lifted_when_pictures_stop(open_page: OpenPage, fake: FakeDaemon) -> None:
    page = open_page(fake.address)
    wait_for_moments(page)
    fake.scene.moments = False
    wait_until(page, "cornertouchd.moment.touches === 0")


def test_messages_it_cannot_read_are_counted(open_page: OpenPage, fake: FakeDaemon) -> None:
    fake.scene.malformed = True
    page = open_page(fake.address)
    wait_until(page, "cornertouchd.bad > 3")
    fake.scene.malformed = False
    wait_for_moments(page)


def test_saving_is_offered_to_those_who_may(open_page: OpenPage, fake: FakeDaemon) -> None:
    page = open_page(fake.address)
    page.click("#save")
    wait_until(page, "document.querySelector('#save-text').textContent.startsWith('Saved')")
    assert page.inner_text("#save-text").endswith("2026-11-22T18-30-00, 48 MB")
    assert fake.scene.saved == [{"last_s": 30}]
    fake.scene.may_act = False
    page.click("#save")
    wait_until(page, "document.querySelector('#save-text').textContent.includes('look only')")
    page.reload()
    wait_for_moments(page)
    assert page.is_hidden("#save")


def test_strips_are_asked_for_while_they_are_seen(open_page: OpenPage, fake: FakeDaemon) -> None:
    page = open_page(fake.address, viewport={"width": 390, "height": 500})
    wait_for_moments(page)
    page.locator("#strips").scroll_into_view_if_needed()
    wait_until(page, "cornertouchd.strips.drawn > 0")
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    for _ in range(MOST_WAITS):
        if fake.scene.strips_wanted[-1] is False:
            break
        wait_for_moments(page)
    assert fake.scene.strips_wanted[-2:] == [True, False]


@pytest.mark.parametrize("viewport", [PHONE, WALL], ids=["phone", "wall"])
def test_it_fits_every_screen(
    open_page: OpenPage, fake: FakeDaemon, viewport: dict[str, int]
) -> None:
    page = open_page(fake.address, viewport=viewport)
    wait_until(page, "cornertouchd?.health && cornertouchd.moments > 0")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    text_px = page.evaluate("parseFloat(getComputedStyle(document.body).fontSize)")
    assert text_px >= (14 if viewport is PHONE else 24)


def test_every_control_is_reached_by_keyboard(open_page: OpenPage, fake: FakeDaemon) -> None:
    page = open_page(fake.address)
    wait_for_moments(page)
    walked = []
    for _ in range(40):
        page.keyboard.press("Tab")
        name, outlined = page.evaluate(
            """() => {
                const at = document.activeElement;
                if (at === document.body) return ["", false];
                const shown = at.closest(".chip")?.querySelector("span") ?? at;
                const name = at.getAttribute("aria-label") || at.id || at.textContent.trim() ||
                    at.labels?.[0]?.textContent;
                const style = getComputedStyle(shown);
                return [name, style.outlineStyle !== "none" && parseFloat(style.outlineWidth) > 0];
            }"""
        )
        if name in walked or not name:
            break
        walked.append(name)
        assert outlined, f"{name} has no visible focus"
    usual = {"save", "theme", "help", "show-trails", "show-lines", "fullscreen", "log-level"}
    assert usual <= set(walked), walked
    assert {f"C{number}" for number in (1, 2, 3, 4)} <= {name.strip() for name in walked}
    page.focus("#show-trails")
    before = page.is_checked("#show-trails")
    page.keyboard.press("Space")
    assert page.is_checked("#show-trails") is not before


def test_keys_switch_what_is_shown(open_page: OpenPage, fake: FakeDaemon) -> None:
    page = open_page(fake.address)
    wait_for_moments(page)
    for key, box in (("l", "#show-lines"), ("c", "#show-contacts"), ("n", "#show-names")):
        before = page.is_checked(box)
        page.keyboard.press(key)
        assert page.is_checked(box) is not before
    page.keyboard.press("2")
    assert page.evaluate("cornertouchd.surface.shows.cameras") == [True, False, True, True]
    page.reload()
    wait_for_moments(page)
    assert not page.is_checked("#show-lines"), "choices are kept"
    page.keyboard.press("?")
    page.uncheck("#use-keys")
    page.click("#help-close")
    page.keyboard.press("l")
    assert not page.is_checked("#show-lines"), "keys were switched off"


def test_the_scheme_follows_the_system_and_the_switch(
    open_page: OpenPage, fake: FakeDaemon
) -> None:
    page = open_page(fake.address, color_scheme="light")
    wait_for_moments(page)
    assert page.evaluate("document.documentElement.dataset.theme") == "light"
    page.click("#theme")
    page.reload()
    wait_for_moments(page)
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"


def test_nothing_moves_for_those_who_want_that(open_page: OpenPage, fake: FakeDaemon) -> None:
    page = open_page(fake.address, reduced_motion="reduce")
    wait_for_moments(page)
    assert not page.is_checked("#show-trails")
    assert (
        page.evaluate("getComputedStyle(document.querySelector('.lamp')).animationName") == "none"
    )


def test_a_hundred_touches_are_drawn_as_they_come(
    open_page: OpenPage, fake: FakeDaemon, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.scene.touches = 100
    page = open_page(fake.address)
    wait_for_moments(page, 30)
    measured = page.evaluate(
        """frames => new Promise(done => {
            const { surface } = cornertouchd;
            const draw = surface.draw.bind(surface);
            const costs = [], starts = [];
            surface.draw = moment => {
                const start = performance.now();
                draw(moment);
                costs.push(performance.now() - start);
                starts.push(start);
                if (costs.length < frames) return;
                delete surface.draw;
                const sorted = [...costs].sort((a, b) => a - b);
                const gaps = starts.slice(1).map((at, i) => at - starts[i]).sort((a, b) => a - b);
                done({
                    median_ms: sorted[frames >> 1], worst_ms: sorted.at(-1),
                    gap_ms: gaps[gaps.length >> 1], longest_gap_ms: gaps.at(-1),
                    touches: cornertouchd.moment.touches,
                });
            };
        })""",
        FRAMES_MEASURED,
    )
    with capsys.disabled():
        print("\n100 touches:", json.dumps({k: round(v, 1) for k, v in measured.items()}))
    assert measured["touches"] == 100
    assert pixels_coloured(page, "#moving") > 10_000


def test_everything_together_is_small() -> None:
    sizes = {path.name: path.stat().st_size for path in PAGE.iterdir()}
    assert sum(sizes.values()) < LARGEST_PAGE, sizes


def test_nothing_is_asked_of_other_hosts() -> None:
    for path in PAGE.iterdir():
        links = re.findall(r"(?:https?:)?//[a-z][\w.-]+\.[a-z]+", path.read_text())
        assert [link for link in links if "www.w3.org" not in link] == [], path.name


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_text_stands_out(theme: str) -> None:
    """Against its ground by 4.5 to 1 at least.  WCAG 2.2, success criterion 1.4.3."""
    first, second = (PAGE / "style.css").read_text().split(':root[data-theme="light"]')[:2]
    colours = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", first if theme == "dark" else second))
    for text in ("text", "muted", "good", "warn", "bad", "camera-1", "camera-2", "camera-3"):
        assert _contrast(colours[text], colours["panel"]) >= 4.5, text
    assert _contrast(colours["on-accent"], colours["accent"]) >= 4.5


def _contrast(one: str, other: str) -> float:
    """WCAG 2.2, definition of contrast ratio."""
    brighter, darker = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (brighter + 0.05) / (darker + 0.05)


def _luminance(colour: str) -> float:
    shares = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
