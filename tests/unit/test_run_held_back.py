"""A daemon that cannot start tells its service manager why, and ends well when it is stopped."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.timeout(300)  # the first start compiles
def test_stopped_while_it_is_held_back_it_has_not_failed(tmp_path: Path) -> None:
    config = tmp_path / "cornertouchd.toml"
    config.write_text("[camera]\n")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind("")  # the kernel chooses an abstract name
        address = "@" + manager.getsockname()[1:].decode()
        with subprocess.Popen(
            [sys.executable, "-m", "cornertouchd", "run", "--config", str(config)],
            env={**os.environ, "NOTIFY_SOCKET": address},
            stderr=subprocess.PIPE,
            text=True,
        ) as daemon:
            while "does not start" not in (told := manager.recv(4096).decode()):
                pass
            assert "unknown key" in told
            daemon.send_signal(signal.SIGTERM)
            assert daemon.wait() == 0
            assert daemon.stderr is not None
            assert "unknown key" in daemon.stderr.read()
