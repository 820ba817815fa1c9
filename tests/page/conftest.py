"""A real browser, without screen, and pages in it that must keep to themselves."""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

try:
    from playwright.sync_api import Browser, Page, sync_playwright
except ImportError as error:
    if os.environ.get("CORNERTOUCHD_REQUIRE_CLIENTS") == "1":
        raise
    pytest.skip(f"{error}: pip install -e .[page]", allow_module_level=True)

DEADLINE_MS = 20_000
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
DESKTOP = {"width": 1440, "height": 900}

OpenPage = Callable[..., Page]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--pictures", action="store_true", help="write docs/live-page-*.png anew")


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    program = shutil.which("chromium")
    if program is None:
        reason = "chromium is not installed: apt-get install chromium"
        if os.environ.get("CORNERTOUCHD_REQUIRE_CLIENTS") == "1":
            pytest.fail(f"CORNERTOUCHD_REQUIRE_CLIENTS=1, but {reason}")
        pytest.skip(reason)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def open_page(browser: Browser) -> Iterator[OpenPage]:
    """Open an address in a browser that has never been there; options as of a context.

    At the end no page may have thrown, broken its content security policy, or asked another host
    than its own for anything.
    """
    faults: list[str] = []
    asked: set[str] = set()
    hosts: set[str] = set()
    contexts = []

    def open_it(address: str, **options: Any) -> Page:
        context = browser.new_context(**{"viewport": DESKTOP, **options})
        context.set_default_timeout(DEADLINE_MS)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("console", lambda said: faults.extend(_policy_broken(said.text)))
        page.on("request", lambda request: asked.add(urlsplit(request.url).netloc))
        page.on("websocket", lambda opened: asked.add(urlsplit(opened.url).netloc))
        hosts.add(urlsplit(address).netloc)
        page.goto(address)
        return page

    yield open_it
    for context in contexts:
        context.close()
    assert not faults
    assert asked <= hosts


def _policy_broken(said: str) -> list[str]:
    return [said] if "Content Security Policy" in said else []


@pytest.fixture(scope="session")
def pictures(request: pytest.FixtureRequest) -> Path | None:
    """Where pictures for the documentation are to be written, if they are."""
    root = Path(__file__).resolve().parents[2]
    return root / "docs" if request.config.getoption("--pictures") else None
