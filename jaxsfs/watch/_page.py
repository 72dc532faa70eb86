"""A page of this machine that shows the newest picture (Motion JPEG, which browsers play by themselves)."""

import http.server
import threading

import cv2
import numpy as np
from jaxtyping import UInt8

_HTML = b"""<!doctype html><html lang="en"><meta charset="utf-8"><title>jaxsfs watch</title>
<style>body{margin:0;background:#111;color:#ddd;font:14px system-ui,sans-serif;text-align:center}
img{max-width:100vw;max-height:calc(100vh - 2.5em)}p{margin:.5em}</style>
<img src="/stream" alt="depth over the live picture"><p>yellow near, violet far; Ctrl-C in the terminal ends it</p>"""
_BOUNDARY = b"frame"


class Page:
    """Serves on 127.0.0.1 alone: nobody else on the network sees a patient's pictures.

    Each viewer gets the newest picture when the one before has been sent; none waits for another.
    """

    def __init__(self, port: int):
        self._picture = b""
        self._number = 0
        self._fresh = threading.Condition()
        self._over = False
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", port), _handler(self))
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}/"
        self._thread = threading.Thread(target=self._server.serve_forever, name="jaxsfs-page", daemon=True)
        self._thread.start()

    def show(self, picture: UInt8[np.ndarray, "height width 3"]) -> None:
        """Replaces the picture."""
        encoded = cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
        with self._fresh:
            self._picture, self._number = encoded.tobytes(), self._number + 1
            self._fresh.notify_all()

    def newest(self, after: int) -> tuple[int, bytes] | None:
        """Number and bytes of a picture later than number `after`, when there is one; None at the end."""
        with self._fresh:
            self._fresh.wait_for(lambda: self._over or self._number > after)
            return None if self._over else (self._number, self._picture)

    def close(self) -> None:
        """Ends the page and all its streams."""
        with self._fresh:
            self._over = True
            self._fresh.notify_all()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


def _handler(page: Page) -> type[http.server.BaseHTTPRequestHandler]:
    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            # a page of another site may not reach in by a name that resolves to this machine
            if self.headers.get("Host", "").rsplit(":", 1)[0] not in ("127.0.0.1", "localhost"):
                return self.send_error(403)
            if self.path == "/":
                return self._send("text/html; charset=utf-8", _HTML)
            if self.path == "/stream":
                return self._stream()
            return self.send_error(404)

        def _send(self, kind: str, body: bytes) -> None:
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def _stream(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={_BOUNDARY.decode()}")
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            number = 0
            try:
                while (found := page.newest(number)) is not None:
                    number, picture = found
                    head = b"--%s\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n"
                    self.wfile.write(head % (_BOUNDARY, len(picture)) + picture + b"\r\n")
            except OSError:  # the viewer has gone
                return

        def log_message(self, format, *args):
            """Says nothing: stderr is for errors."""

    return Handler
