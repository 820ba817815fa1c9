"""The README's first command, pasted into a fresh clone, ends in a demo whose touches arrive."""

import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
INSTALL_S = 600.0


def first_command() -> str:
    commands = re.findall(r"^python3 -m venv .*$", (ROOT / "README.md").read_text(), re.MULTILINE)
    return str(commands[0])


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a newcomer gets: the committed files in a new folder, no environment."""
    folder = tmp_path_factory.mktemp("newcomer") / "cornertouchd"
    subprocess.run(["git", "clone", "-q", ROOT, folder], check=True)
    return folder


@pytest.fixture(scope="module")
def demo(clone: Path) -> Iterator[subprocess.Popen[str]]:
    """The running demo, after it has said where it sends to."""
    process = subprocess.Popen(
        ["bash", "-c", f"exec {first_command()}".replace("exec python3", "python3", 1)],
        cwd=clone,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stderr is not None
    deadline = time.monotonic() + INSTALL_S
    for line in process.stderr:
        sys.stderr.write(line)
        if "TUIO to 127.0.0.1:3333" in line:
            break
        assert time.monotonic() < deadline
    yield process
    process.kill()
    process.communicate()


@pytest.mark.timeout(INSTALL_S)
def test_touches_of_the_demo_arrive_in_listen(demo: subprocess.Popen[str], clone: Path) -> None:
    listen = [clone / ".venv/bin/cornertouchd", "listen", "--plain", "--seconds", "6"]
    done = subprocess.run(listen, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert sum(line.startswith("add") for line in lines) >= 5
    assert sum(line.startswith("update") for line in lines) > 500


def test_ctrl_c_ends_the_demo(demo: subprocess.Popen[str], clone: Path) -> None:
    pgrep = ["pgrep", "-g", str(demo.pid), "-f", "cornertouchd demo"]
    assert shutil.which("pgrep"), "pgrep (procps) is needed to find the demo"
    (number,) = subprocess.run(pgrep, capture_output=True, text=True, check=True).stdout.split()
    began = time.monotonic()
    subprocess.run(["kill", f"-{int(signal.SIGINT)}", number], check=True)
    assert demo.wait(timeout=10) == 0
    assert time.monotonic() - began < 3.0  # usually 0.3 s; a busy machine gets more
