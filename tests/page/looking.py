"""What tests ask a page for."""

from typing import Any

from playwright.sync_api import Page


def wait_until(page: Page, condition: str, within_s: float = 40.0) -> None:
    """Return as soon as an expression is true in the page."""
    page.wait_for_function(f"() => {condition}", timeout=1000.0 * within_s)


def wait_for_state(page: Page, state: str) -> None:
    wait_until(page, f"window.cornertouchd?.state === '{state}'")


def wait_for_moments(page: Page, more: int = 3) -> None:
    """Return when so many more moments have been shown than now."""
    seen = page.evaluate("window.cornertouchd?.moments ?? 0")
    wait_until(page, f"window.cornertouchd?.moments >= {seen + more}")


def touches_shown(page: Page) -> dict[int, tuple[float, float]]:
    """Return the touches of the last moment on the page: millimetres by their ids."""
    shown: list[Any] = page.evaluate(
        """() => {
            const { moment } = window.cornertouchd;
            return Array.from({ length: moment.touches }, (_, i) =>
                [moment.touchId[i], moment.touchXMm[i], moment.touchYMm[i]]);
        }"""
    )
    return {int(number): (x_mm, y_mm) for number, x_mm, y_mm in shown}


def pixels_coloured(page: Page, canvas: str) -> int:
    """Return how many pixels of a canvas are not transparent."""
    count: int = page.evaluate(
        """canvas => {
            const { width, height } = canvas;
            const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
            let count = 0;
            for (let at = 3; at < data.length; at += 4) count += data[at] > 0;
            return count;
        }""",
        page.query_selector(canvas),
    )
    return count
