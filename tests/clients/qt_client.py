"""A window of Qt 6 with the TuioTouch plugin, on no screen.  Usage: qt_client.py PORT.

Prints "ready", then a line for each thing that happens: add, update or remove, the id, x and y.
Ends with its standard input.
"""

import os
import sys

PORT = sys.argv[1]
os.environ.update(
    QT_QPA_PLATFORM="offscreen",
    QT_QPA_GENERIC_PLUGINS=f"TuioTouch:udp={PORT}",
    QT_TUIOTOUCH_DELIVER_WITHOUT_FOCUS="1",
)
try:
    from PySide6.QtCore import QEvent, QSocketNotifier
    from PySide6.QtGui import QEventPoint, QGuiApplication, QTouchEvent, QWindow
except ImportError as error:
    print(f"missing {error}", flush=True)
    sys.exit()

NAMES = {
    QEventPoint.State.Pressed: "add",
    QEventPoint.State.Updated: "update",
    QEventPoint.State.Released: "remove",
}
TOUCHES = (QEvent.Type.TouchBegin, QEvent.Type.TouchUpdate, QEvent.Type.TouchEnd)


class Window(QWindow):
    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.TouchCancel:
            print("cancelled", flush=True)
        if event.type() not in TOUCHES:
            return super().event(event)
        assert isinstance(event, QTouchEvent)
        for point in event.points():
            if point.state() in NAMES:
                place = point.position()
                x, y = place.x() / self.width(), place.y() / self.height()
                print(NAMES[point.state()], point.id(), x, y, flush=True)
        event.accept()
        return True


application = QGuiApplication(sys.argv[:1])
window = Window()
window.setGeometry(0, 0, 1000, 1000)
window.show()
window.requestActivate()
end_of_input = QSocketNotifier(sys.stdin.fileno(), QSocketNotifier.Type.Read)
end_of_input.activated.connect(lambda: os._exit(0))
print("ready", flush=True)
application.exec()
