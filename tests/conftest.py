"""What all tests share: recordings, and how to accept a changed expectation."""

import importlib
import os
from pathlib import Path

import pytest
from hypothesis import settings

import cornertouchd.cli  # noqa: F401  # numpy comes after it, as in the commands

# A busy machine is slow, not wrong.
settings.register_profile("any machine", deadline=None)
settings.load_profile("any machine")

ROOT = Path(__file__).resolve().parent.parent
RECORDINGS = ROOT / "tests" / "recordings"
WHOLE_RECORDINGS = ROOT.parent / "shared" / "rendered"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-expected", action="store_true", help="write the expected files anew")


def pytest_configure() -> None:
    """Compile before the tests are shared out; commands that they start find it in the cache."""
    numba = importlib.import_module("cornertouchd.compiling").numba
    importlib.import_module("cornertouchd.pipeline")
    os.environ["NUMBA_CACHE_DIR"] = str(Path(numba.config.CACHE_DIR).parent)


@pytest.fixture
def update_expected(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--update-expected"))


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The recordings that travel with the repository."""
    return RECORDINGS


@pytest.fixture(scope="session")
def whole_recordings() -> Path:
    """All recordings where they lie beside the checkout, else those of the repository."""
    return WHOLE_RECORDINGS if WHOLE_RECORDINGS.is_dir() else RECORDINGS


@pytest.fixture(scope="session")
def calibration_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration made by the command, from the recordings of the repository."""
    from click.testing import CliRunner

    from cornertouchd.cli import main

    path = tmp_path_factory.mktemp("calibration") / "calibration.json"
    arguments = ["calibrate", "--recording", RECORDINGS / "calib_few_small"]
    arguments += ["--empty", RECORDINGS / "empty_small", "--output", path]
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return path
