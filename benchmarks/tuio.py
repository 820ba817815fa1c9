"""How fast touches become TUIO: our encoder against python-osc, same bundle, same run.

    python benchmarks/tuio.py [cursors]

Prints microseconds per bundle (best of seven) and the ratio; ends with status 1 if the two
differ in a single byte or the encoder takes more than 15 µs for ten cursors.
"""

import sys
import timeit
from collections.abc import Callable, Sequence

from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from cornertouchd.model import Touch, TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio import BundleEncoder, Cursor, TuioSession

SOURCE = "cornertouchd-5e3a1c@192.168.1.7"
FSEQ = 123_456
# What a hundred frames a second can spare: 0.15 % of the time between two of them.
GOAL_US_PER_10_CURSORS = 15.0


def with_python_osc(cursors: Sequence[Cursor]) -> bytes:
    bundle = OscBundleBuilder(IMMEDIATELY)

    def add(*arguments: tuple[object, str]) -> None:
        message = OscMessageBuilder("/tuio/2Dcur")
        for value, kind in arguments:
            message.add_arg(value, kind)
        bundle.add_content(message.build())

    add(("source", "s"), (SOURCE, "s"))
    add(("alive", "s"), *((cursor.id, "i") for cursor in cursors))
    for cursor in cursors:
        add(("set", "s"), (cursor.id, "i"), *((value, "f") for value in cursor[1:]))
    add(("fseq", "s"), (FSEQ, "i"))
    return bundle.build().dgram


def microseconds(work: Callable[[], object], times: int) -> float:
    work()
    return min(timeit.repeat(work, number=times, repeat=7)) / times * 1e6


def main() -> int:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    cursors = [Cursor(1000 + k, (k + 1) / 256, 0.5, 0.1, 0.2, 0.3) for k in range(count)]
    ids = [cursor.id for cursor in cursors]
    encoder = BundleEncoder(SOURCE)
    session = TuioSession(DisplayMapping(0.0, 0.0, 800.0, 450.0), SOURCE, FSEQ, 1000)
    touches = tuple(Touch(k, 10.0 + k, 50.0, 1.0, 2.0, 0.5) for k in range(count))
    frame = TouchFrame(1.0, touches)

    same = encoder.encode(ids, cursors, FSEQ) == with_python_osc(cursors)
    ours_us = microseconds(lambda: encoder.encode(ids, cursors, FSEQ), 3000)
    theirs_us = microseconds(lambda: with_python_osc(cursors), 150)
    session_us = microseconds(lambda: session.frame(frame), 1000)
    goal_us = GOAL_US_PER_10_CURSORS * max(count, 10) / 10
    print(f"{count} cursors, {len(encoder.encode(ids, cursors, FSEQ))} bytes")
    print(f"  our encoder          {ours_us:8.1f} µs  (goal {goal_us:.0f} µs)")
    print(f"  python-osc           {theirs_us:8.1f} µs  {theirs_us / ours_us:.0f} times ours")
    print(f"  touches to datagrams {session_us:8.1f} µs  mapping, ids, acceleration, encoding")
    print(f"  identical bytes: {'yes' if same else 'NO'}")
    return 0 if same and ours_us <= goal_us else 1


if __name__ == "__main__":
    sys.exit(main())
