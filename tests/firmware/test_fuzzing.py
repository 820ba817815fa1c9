"""The portable core of the firmware under libFuzzer, with AddressSanitizer and UBSan."""

import os
import subprocess
from pathlib import Path

import pytest
from led_board import ROOT, make


@pytest.mark.timeout(600)
def test_the_fuzzer_finds_nothing(build: Path) -> None:
    make(ROOT / "firmware", "fuzz", build)
    seconds = os.environ.get("CORNERTOUCHD_FUZZ_SECONDS", "10")
    done = subprocess.run(
        [build / "fuzz", "-max_len=512", f"-max_total_time={seconds}", "-print_final_stats=1"],
        capture_output=True,
        text=True,
        check=False,
        cwd=build,
    )
    assert done.returncode == 0, done.stderr[-3000:]
