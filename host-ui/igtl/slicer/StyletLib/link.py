"""Receives what `host-ui igtl` serves: OpenIGTLink over a socket that never blocks. Needs NumPy, but not Slicer."""

import socket
import struct
import time

import numpy as np

HEADER = struct.Struct(">H12s20s8xQ8x")
"""Version, type, device and bytes of the body; time and checksum are skipped."""
MOST_BYTES = 16 << 20
"""Largest body that the server sends."""
READ_BYTES = 1 << 16
RETRY_S = 1.0
CONNECT_S = 0.3
SILENT_S = 2.0
"""Time without a state after which a server is not Stylet's, and without a needle after which no core runs."""


class Link:
    """A connection that is opened again when it ends. Places are in RAS and mm."""

    def __init__(self, host, port):
        self.host, self.port = host, port
        self._socket, self._bytes = None, bytearray()
        self._tried_s = self._opened_s = self._needle_s = -np.inf
        self._state, self._refusal, self._why = None, None, "Connecting."

    def poll(self):
        """Returns the newest content of each device since the last call: a matrix, points, a surface or a text."""
        newest = {}
        try:
            if self._socket is None and not self._open():
                return newest
            has_ended = self._receive()
            newest = self._newest()
            if has_ended:
                raise ConnectionError("the server ended the connection")
        except OSError as error:
            self._end(self._refusal or f"{self.host}:{self.port}: {error}")
        except ValueError:
            self._end(self._stranger())
        return newest

    def close(self):
        if self._socket is not None:
            self._socket.close()
        self._socket, self._bytes, self._state = None, bytearray(), None

    @property
    def is_live(self):
        """Whether a core moves the needle."""
        return self._socket is not None and time.monotonic() - self._needle_s < SILENT_S

    @property
    def words(self):
        """Phase, depth, force and number of seeds; or why there is nothing, and what to do."""
        if self._socket is None:
            return self._why
        if self._state is None and time.monotonic() - self._opened_s > SILENT_S:
            return self._stranger()
        return self._state or "Connected."

    def _stranger(self):
        return f"The server at {self.host}:{self.port} is not Stylet's."

    def _end(self, why):
        self._why = why
        self.close()

    def _open(self):
        now_s = time.monotonic()
        if now_s - self._tried_s < RETRY_S:
            return False
        self._tried_s = now_s
        try:
            self._socket = socket.create_connection((self.host, self.port), CONNECT_S)
        except OSError as error:
            self._why = f"No server at {self.host}:{self.port} ({error}). Start one with: host-ui igtl"
            return False
        self._socket.setblocking(False)
        self._opened_s, self._refusal = time.monotonic(), None
        return True

    def _receive(self):
        """Returns whether the server has ended the connection."""
        while len(self._bytes) < HEADER.size + MOST_BYTES:
            try:
                part = self._socket.recv(READ_BYTES)
            except BlockingIOError:
                return False
            if not part:
                return True
            self._bytes += part
        return False

    def _newest(self):
        bodies, at = {}, 0
        while len(self._bytes) - at >= HEADER.size:
            version, kind, device, size = HEADER.unpack_from(self._bytes, at)
            if size > MOST_BYTES:
                raise ValueError(size)
            if len(self._bytes) - at < HEADER.size + size:
                break
            at += HEADER.size
            if version == 1:
                bodies[text(device), text(kind)] = bytes(self._bytes[at : at + size])
            at += size
        del self._bytes[:at]
        newest = {key[0]: READERS[key](body) for key, body in bodies.items() if key in READERS}
        if "Needle" in newest:
            self._needle_s = time.monotonic()
        self._state = newest.get("State", self._state)
        self._refusal = newest.get("Stylet", self._refusal)
        return newest


def text(padded):
    return bytes(padded).split(b"\0")[0].decode(errors="replace")


def matrix(body):
    whole = np.eye(4)
    whole[:3] = np.frombuffer(body, ">f4").reshape(4, 3).T
    return whole


def points(body):
    row = np.dtype([("names", "S96"), ("rgba", "4u1"), ("place_mm", ">f4", 3), ("rest", "S24")])
    return np.frombuffer(body, row)["place_mm"].astype(float)


def surface(body):
    """Returns corners and triangles, which name corners that exist: VTK would read beyond them."""
    counts = np.frombuffer(body, ">u4", 10)
    corners = np.frombuffer(body, ">f4", 3 * counts[0], 40).reshape(-1, 3)
    triangles = np.frombuffer(body, ">u4", 4 * counts[5], 40 + 12 * counts[0]).reshape(-1, 4)
    if (triangles[:, 0] != 3).any() or (triangles[:, 1:] >= counts[0]).any():
        raise ValueError("not triangles of these corners")
    return corners.astype(np.float32), triangles[:, 1:].astype(np.int64)


def picture(body):
    """Returns greys by row and column, and the matrix from column, row and slice to RAS; the message has the centre."""
    kind, size = bytes(body[2:6]), np.frombuffer(body, ">u2", 3, 6).astype(int)
    if kind[:2] != b"\x01\x03" or kind[3] != 1 or size[2] != 1:
        raise ValueError("not one slice of greys in RAS")
    greys = np.frombuffer(body, np.uint8, offset=72).reshape(size[1], size[0])
    ras_from_ijk = matrix(body[12:60])
    ras_from_ijk[:3, 3] -= ras_from_ijk[:3, :3] @ (size - 1) / 2
    return greys, ras_from_ijk


READERS = {
    ("Needle", "TRANSFORM"): matrix,
    ("Gland", "POLYDATA"): surface,
    ("Seeds", "POINT"): points,
    ("Ultrasound", "IMAGE"): picture,
    ("State", "STRING"): lambda body: body[4:].decode(errors="replace"),
    ("Stylet", "STATUS"): lambda body: text(body[30:]),
}
