"""python-tuio over UDP.  Usage: python_tuio_client.py PORT.

Prints "ready", then a line for each thing that happens: add, update or remove, the id, x and y; of
blobs blob, the id, width and height.  Ends with its standard input.
"""

import contextlib
import os
import sys
import threading
from pathlib import Path

try:
    from pythontuio import Blob, Cursor, TuioClient, TuioListener
except ImportError as error:
    print(f"missing {error}", flush=True)
    sys.exit()

OUT = sys.stdout


class Shown(TuioListener):
    def add_tuio_cursor(self, cur: Cursor) -> None:
        show("add", cur)

    def update_tuio_cursor(self, cur: Cursor) -> None:
        show("update", cur)

    def remove_tuio_cursor(self, cur: Cursor) -> None:
        show("remove", cur)

    def add_tuio_blob(self, blob: Blob) -> None:
        print("blob", blob.session_id, *blob.dimension, file=OUT, flush=True)


def show(kind: str, cursor: Cursor) -> None:
    print(kind, cursor.session_id, *cursor.position, file=OUT, flush=True)


class ReadyClient(TuioClient):
    def server_activate(self) -> None:
        super().server_activate()
        print("ready", file=OUT, flush=True)


client = ReadyClient(("127.0.0.1", int(sys.argv[1])))
client.add_listener(Shown())
with Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere):  # it is talkative
    threading.Thread(target=client.start, daemon=True).start()
    sys.stdin.read()
os._exit(0)
