"""A TCP client as strict as the reference one: each read must give one whole bundle.

Usage: tcp_client.py PORT.  Connects to the server there.  Prints "ready" when it was told what
there is, then a line for each thing that happens: add, update or remove, the id, x and y; "torn" if
a read gave anything else.  Ends with its standard input.
"""

import select
import socket
import struct
import sys

from pythonosc.osc_bundle import OscBundle

BUFFER_BYTES = 65536

server = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
shown: dict[int, tuple[float, float]] = {}
is_ready = False
while server in select.select([server, sys.stdin], [], [])[0]:
    data = server.recv(BUFFER_BYTES)
    if not data:
        break
    if len(data) < 4 or struct.unpack_from(">i", data)[0] != len(data) - 4:
        print("torn", len(data), flush=True)
        break
    if not is_ready:
        print("ready", flush=True)
        is_ready = True
    messages = [message.params for message in OscBundle(data[4:])]
    alive = next(set(message[1:]) for message in messages if message[0] == "alive")
    for id_ in sorted(shown.keys() - alive):
        print("remove", id_, *shown.pop(id_), flush=True)
    for _, id_, x, y, *_ in (message for message in messages if message[0] == "set"):
        print("update" if id_ in shown else "add", id_, x, y, flush=True)
        shown[id_] = x, y
sys.stdin.read()
