"""A demo, a rig with an LED frame, and Debian's Prometheus that scrapes both."""

import json
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import asdict
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from cornertouchd.devices.udp_destination import DestinationStatus
from cornertouchd.monitor.metrics import CONTENT_TYPE, render
from cornertouchd.runtime.led_light import LightState

PATIENCE_S = 90.0


def program(name: str) -> str:
    """Return where a program is; without it skip, or fail where nothing may be missing."""
    path = shutil.which(name)
    if path is None:
        missing = f"{name} is missing: apt-get install prometheus"
        if os.environ.get("CORNERTOUCHD_REQUIRE_CLIENTS"):
            pytest.fail(missing)
        pytest.skip(missing)
    return path


def free_port() -> int:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        port: int = bound.getsockname()[1]
    return port


def wait_until(done: Callable[[], Any]) -> Any:
    """Return the first answer that is something; what refuses the connection is not up yet."""
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        try:
            answer = done()
        except (OSError, urllib.error.URLError):
            answer = None
        if answer:
            return answer
        time.sleep(0.2)
    raise AssertionError("nothing came of it in time")


def fetched(url: str) -> bytes:
    with urllib.request.urlopen(url, timeout=10.0) as answer:
        return bytes(answer.read())


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Where a demo is scraped; it sends its touches to nobody."""
    place = tmp_path_factory.mktemp("demo")
    port = free_port()
    command = [sys.executable, "-m", "cornertouchd", "demo", "--monitor-port", str(port)]
    with (place / "log").open("w") as log:
        running = subprocess.Popen(
            [*command, "--tuio", "127.0.0.1:9"],
            env={**os.environ, "RUNTIME_DIRECTORY": str(place)},
            stderr=log,
        )
    try:
        wait_until(lambda: b"cornertouchd_up 1" in fetched(f"http://127.0.0.1:{port}/metrics"))
        yield f"127.0.0.1:{port}"
    finally:
        running.terminate()
        running.wait(30.0)


class _Page(BaseHTTPRequestHandler):
    body = b""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", CONTENT_TYPE)
        self.end_headers()
        self.wfile.write(self.body)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="session")
def lit_rig(demo: str) -> Iterator[str]:
    """Where a rig is scraped that does as the demo did, but has an LED frame and browsers."""
    health = json.loads(fetched(f"http://{demo}/api/health"))
    light = LightState("/dev/ttyACM0", "armed", (), "ambient", (9, 9, 9, 9), False, 31.5, 1, 0, {})
    browsers = DestinationStatus("127.0.0.1", 8080, 100, 0, None, "websocket", 2, 1, 0)
    destinations = [*health["destinations"], asdict(browsers)]
    _Page.body = render({**health, "light": asdict(light), "destinations": destinations})
    with ThreadingHTTPServer(("127.0.0.1", 0), _Page) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


class Prometheus:
    """The query interface of a running Prometheus."""

    def __init__(self, url: str) -> None:
        self._url = url

    def query(self, expression: str) -> list[Any]:
        """Return the series that an expression gives now."""
        asked = urllib.parse.urlencode({"query": expression})
        answer = json.loads(fetched(f"{self._url}/api/v1/query?{asked}"))
        assert answer["status"] == "success", answer
        series: list[Any] = answer["data"]["result"]
        return series

    def rules(self) -> dict[str, str]:
        """Return the health of every alert rule."""
        groups = json.loads(fetched(f"{self._url}/api/v1/rules"))["data"]["groups"]
        return {rule["name"]: rule["health"] for group in groups for rule in group["rules"]}


@pytest.fixture(scope="session")
def prometheus(
    demo: str, lit_rig: str, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Prometheus]:
    place = tmp_path_factory.mktemp("prometheus")
    alerts = Path(__file__).parents[2] / "docs" / "alerts.yml"
    (place / "prometheus.yml").write_text(
        "global: {scrape_interval: 1s, evaluation_interval: 1s}\n"
        f"rule_files: [{alerts}]\n"
        "scrape_configs:\n"
        f"- {{job_name: cornertouchd, static_configs: [{{targets: ['{demo}', '{lit_rig}']}}]}}\n"
    )
    port = free_port()
    options = ("config.file=prometheus.yml", "storage.tsdb.path=data")
    options += (f"web.listen-address=127.0.0.1:{port}",)
    with (place / "log").open("w") as log:
        running = subprocess.Popen(
            [program("prometheus"), *(f"--{option}" for option in options)], cwd=place, stderr=log
        )
    there = Prometheus(f"http://127.0.0.1:{port}")
    try:
        # a rate takes two scrapes of each
        wait_until(lambda: len(there.query("count_over_time(cornertouchd_up[1m]) >= 4")) == 2)
        yield there
    finally:
        running.terminate()
        running.wait(30.0)
