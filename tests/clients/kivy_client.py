"""Kivy's own TUIO provider, without a window.  Usage: kivy_client.py PORT.

Prints "ready", then a line for each thing that happens: add, update or remove, the id, x and y.
Ends with its standard input.
"""

import os
import select
import sys
import tempfile

os.environ.update(
    KIVY_NO_ARGS="1",
    KIVY_NO_CONFIG="1",
    KIVY_NO_FILELOG="1",
    KIVY_NO_CONSOLELOG="1",
    KIVY_HOME=tempfile.mkdtemp(prefix="kivy-"),
)
try:
    import oscpy  # noqa: F401  # the provider needs it, and asks for it only at its start
    from kivy.input.motionevent import MotionEvent
    from kivy.input.providers.tuio import TuioMotionEventProvider
except ImportError as error:
    print(f"missing {error}", flush=True)
    sys.exit()

POLL_S = 0.005
NAMES = {"begin": "add", "update": "update", "end": "remove"}


def show(kind: str, touch: MotionEvent) -> None:
    # Kivy's y runs upwards
    print(NAMES[kind], touch.id, touch.sx, 1.0 - touch.sy, flush=True)


def is_wanted() -> bool:
    """Wait a moment; tell whether standard input is still open."""
    return not select.select([sys.stdin], [], [], POLL_S)[0]


provider = TuioMotionEventProvider("tuio", f"127.0.0.1:{sys.argv[1]}")
provider.start()
print("ready", flush=True)
while is_wanted():
    provider.update(show)
os._exit(0)  # the provider's thread never ends
