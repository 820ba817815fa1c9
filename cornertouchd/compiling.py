"""Compile hot functions to machine code, once for each machine; `numba` does the work.

What is compiled is kept in a cache directory where a service may write, which begins as a copy of
what was compiled when the package was installed, if it was.  It is kept apart for every state of
the sources, because numba itself does not see that a function in another file has changed.
"""

import contextlib
import hashlib
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event
from numba.core.types import unliteral

from cornertouchd.inlining import PartCompiler
from cornertouchd.places import cache_directory, installed_kernels

FOLDERS = ("fusion", "locating", "vision")
"""Where compiled functions are."""

COMPILED_BESIDE = (
    "cornertouchd.fusion.touch_table",
    "cornertouchd.fusion.following",
    "cornertouchd.fusion.motion",
    "cornertouchd.fusion.assignment",
    "cornertouchd.vision.background",
    "cornertouchd.locating.line_table",
)
"""What takes about as long as the crossing, which most programs import first."""

KEPT_S = 30 * 24 * 3600.0
"""What another version has compiled is kept for so long."""

F = TypeVar("F", bound=Callable[..., object])

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
INLINED_OPTIONS = {**OPTIONS, "no_cpython_wrapper": True, "pipeline_class": PartCompiler}
# numba's own name for counting references: they are kept by its runtime.
BORROWING_OPTIONS = {**INLINED_OPTIONS, "_nrt": False}
SUMMING_OPTIONS = {**BORROWING_OPTIONS, "fastmath": {"reassoc"}}

_log = logging.getLogger("cornertouchd")


def compiled(signature: str) -> Callable[[F], F]:
    """Compile a function for arguments of these types when its module is imported.

    It runs without the interpreter's lock, and divides by zero as numpy does.
    """

    def compile_now(function: F) -> F:
        return cast("F", numba.njit(signature, **OPTIONS, cache=True)(function))

    return compile_now


def inlined(function: F) -> F:
    """Make a function callable from compiled ones, and from them alone, as a part of them."""
    return _part(function, INLINED_OPTIONS)


def borrowing(function: F) -> F:
    """Make a function callable from compiled ones, as `inlined` does, without counting references.

    numba counts the references to each array that a function is given, twice for each call, with
    instructions that lock memory: for the small functions that run thousands of times that takes
    as long as what they do.  But then a function must neither make arrays nor return any, nor call
    what does: nobody would release them.
    """
    return _part(function, BORROWING_OPTIONS)


def summing(function: F) -> F:
    """Make a function borrow arrays, and let a processor add up its sums in any order.

    It then adds several numbers at once, which changes a sum by its rounding.
    """
    return _part(function, SUMMING_OPTIONS)


def _part(function: F, options: dict[str, Any]) -> F:
    """Make a function a part of those that call it, for any values of its arguments.

    numba would also compile it anew for every constant that it is called with, which gains nothing
    here and costs a third of the time.
    """
    made = numba.njit(**options)(function)
    for_arguments = made.get_call_template

    def for_any_values(arguments: Sequence[Any], keywords: dict[str, Any]) -> Any:
        types = [unliteral(one) for one in arguments]  # type: ignore[no-untyped-call]
        return for_arguments(types, keywords)

    made.get_call_template = for_any_values
    return cast("F", made)


def compiled_directory() -> Path:
    """Return where this process keeps what it compiles."""
    return Path(str(numba.config.CACHE_DIR))  # type: ignore[attr-defined]


class _Announcement(event.Listener):
    """Says once that functions are being compiled: the first start takes its time."""

    def __init__(self) -> None:
        self._made = False

    def on_start(self, _event: event.Event) -> None:
        """Say it when the first function is compiled, not when it comes from the cache."""
        if not self._made:
            _log.info("compiling for this machine, only this once; it takes up to a minute")
        self._made = True

    def on_end(self, _event: event.Event) -> None:
        """Nothing to say."""


def _do_without_blas() -> None:
    """Keep numba from importing scipy.linalg, which products of matrices would need.

    No compiled function has any.  It takes an eighth of the time until the daemon runs.
    """
    blas = "scipy.linalg.cython_blas"
    if blas in sys.modules:
        return
    sys.modules[blas] = None  # type: ignore[assignment]
    import numba.np.arraymath  # noqa: F401, PLC0415 - asks for it once

    del sys.modules[blas]


def _use_cache() -> None:
    """Tell numba where to keep what it compiles: in $NUMBA_CACHE_DIR, else in our own cache."""
    place = Path(os.environ.get("NUMBA_CACHE_DIR") or cache_directory(os.environ))
    directory = place / f"compiled-{_sources_key()}"
    is_new = not directory.exists()
    try:
        if is_new:
            _drop_outdated(directory.parent)
            is_new = not _copy_installed(directory)
        directory.mkdir(parents=True, exist_ok=True)
        kept = os.access(directory, os.W_OK)
    except OSError:
        kept = False
    if not kept:
        _log.warning("%s: cannot be written, so every start compiles anew", directory)
        directory = Path(tempfile.mkdtemp(prefix="cornertouchd-"))
    numba.config.CACHE_DIR = str(directory)  # type: ignore[attr-defined]
    if is_new and kept and len(os.sched_getaffinity(0)) > 1:
        _compile_beside()


def _copy_installed(directory: Path) -> bool:
    """Start with what the installation has compiled for all, if it has; tell whether that is so.

    numba only uses a cache that it may write to, and nobody may write to what others execute.
    """
    installed = installed_kernels(sys.prefix) / directory.name
    if not installed.is_dir():
        return False
    copy = Path(tempfile.mkdtemp(prefix=f"{directory.name}.", dir=_made(directory.parent)))
    shutil.copytree(installed, copy, dirs_exist_ok=True)
    try:
        copy.rename(directory)
    except OSError:  # another process was quicker
        shutil.rmtree(copy, ignore_errors=True)
    return True


def _made(directory: Path) -> Path:
    directory.mkdir(parents=True, exist_ok=True)
    return directory


def _compile_beside() -> None:
    """Let another process compile one half of the functions; it leaves them in the cache.

    Nothing waits for it: what is not there yet when it is needed is compiled here.
    """
    # -P: nothing is imported from where the program happens to be started
    command = [sys.executable, "-P", "-c", f"import {', '.join(COMPILED_BESIDE)}"]
    with contextlib.suppress(OSError):
        process = subprocess.Popen(  # noqa: S603
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        threading.Thread(target=process.wait, name="compiling", daemon=True).start()


def _drop_outdated(directory: Path) -> None:
    """Delete what other versions compiled long ago; a version that is still used compiles anew."""
    for other in directory.glob("compiled-*"):
        with contextlib.suppress(OSError):  # another process may be quicker
            if time.time() - other.stat().st_mtime > KEPT_S:
                shutil.rmtree(other, ignore_errors=True)


def _sources_key() -> str:
    """Name the state of the sources that are compiled."""
    here = Path(__file__)
    digest = hashlib.sha256(here.read_bytes() + here.with_name("inlining.py").read_bytes())
    for folder in FOLDERS:  # all of them: constants are compiled in, wherever they come from
        for path in sorted((here.parent / folder).glob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


# The second and third level of optimisation take a fifth longer and gain nothing that is measured.
os.environ.setdefault("NUMBA_OPT", "1")
numba.config.reload_config()  # type: ignore[no-untyped-call]
_do_without_blas()
_use_cache()
event.register("numba:compile", _Announcement())  # type: ignore[no-untyped-call]
