"""The page of a calibration: what to do, where to touch, how far it is."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from page.conftest import OpenPage
from page.looking import pixels_coloured, wait_until
from page.running_daemon import ENDS_WITHIN_S, ROOT, free_port, wait_for_page
from playwright.sync_api import Page

pytestmark = pytest.mark.timeout(300)
STEP_WITHIN_S = 120.0

StartCalibration = Callable[..., str]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[StartCalibration]:
    """Start a calibration on the simulated rig; return where its page is."""
    started = []

    def start_it(*arguments: str, monitor: str = "") -> str:
        port = free_port()
        config = tmp_path / "touch.toml"
        config.write_text(f"[monitor]\nport = {port}\n{monitor}\n")
        log = tmp_path / "calibrate.log"
        command = [sys.executable, "-m", "cornertouchd", "calibrate", *arguments]
        command += ["--config", str(config), "--simulate", "--page"]
        with log.open("wb") as said:
            process = subprocess.Popen(
                [*command, "--output", str(tmp_path / "out.json")],
                stdout=said,
                stderr=said,
                env={
                    **os.environ,
                    "PYTHONPATH": str(ROOT),
                    "RUNTIME_DIRECTORY": str(tmp_path),
                    "STATE_DIRECTORY": str(tmp_path),
                },
            )
        started.append(process)
        wait_for_page(f"http://127.0.0.1:{port}/targets", process, log)
        return f"http://127.0.0.1:{port}/targets"

    yield start_it
    for process in started:
        process.terminate()
        process.wait(ENDS_WITHIN_S)


def wait_for_step(page: Page, step: str) -> None:
    wait_until(page, f"cornertouchd.guide?.step === '{step}'", STEP_WITHIN_S)


def test_it_leads_from_taps_to_the_end(
    open_page: OpenPage, start: StartCalibration, pictures: Path | None
) -> None:
    page = open_page(start("--taps-wanted", "4"), color_scheme="dark")
    wait_for_step(page, "taps")
    wait_until(page, "cornertouchd.guide.tapped_mm.length >= 2", STEP_WITHIN_S)
    assert "mm from the left" in page.inner_text("#where")
    assert page.inner_text("#steps [aria-current]") == "Taps"
    assert pixels_coloured(page, "#guide") > 1000
    if pictures is not None:
        page.screenshot(path=pictures / "live-page-targets.png")
    wait_for_step(page, "scribble")
    wait_until(page, "cornertouchd.guide.visited?.cells.includes('1')", STEP_WITHIN_S)
    page.click("#fill")
    assert page.get_attribute("#fill", "aria-pressed") == "true"
    assert page.is_visible("#fill-text")
    page.click("#fill")
    wait_until(page, "document.fullscreenElement === null")


def test_the_corners_of_the_picture_are_marked(
    open_page: OpenPage, start: StartCalibration
) -> None:
    page = open_page(
        start("display", "--finger", os.devnull), viewport={"width": 390, "height": 844}
    )
    wait_for_step(page, "display")
    assert page.inner_text("#where") == "1 of 4 · top-left of the picture"
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.goto(page.url.replace("/targets", "/"))
    page.wait_for_url("**/targets")
    wait_for_step(page, "display")


def test_the_token_leads_to_the_targets(open_page: OpenPage, start: StartCalibration) -> None:
    token = "a-token-of-the-test"
    page = open_page(start("display", "--finger", os.devnull, monitor=f'token = "{token}"'))
    page.fill("#token", token)
    page.press("#token", "Enter")
    page.wait_for_url("**/targets")
    wait_for_step(page, "display")
