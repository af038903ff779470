"""pyigtl as an oracle: Python with pyigtl 0.3.4 (`make igtl-test`).

    client.py extended FILE             writes the transform of goldens.cpp with header version 2, as protocol 3 sends it
    client.py read FOLDER               prints what it reads of the messages in goldens/, as JSON
    client.py picture HOST PORT FILE            writes the greys of the next ultrasound; prints frame, size and matrix
    client.py watch HOST PORT SECONDS   watches a server and moves its hand, 60 times a second; prints what it saw, as JSON
"""

import json
import math
import pathlib
import struct
import sys
import time

import numpy as np
import pyigtl
from pyigtl.messages import CRC64, MessageBase, PolyDataMessage


def unpack_polydata(self, content):
    """pyigtl 0.3.4 has a reader of POLYDATA, which indexes a `struct.Struct` where it should unpack and is not in its table."""
    counts = struct.unpack("> 10I", content[:40])
    self.points = np.frombuffer(content[40 : 40 + 12 * counts[0]], dtype=">f").reshape(-1, 3)
    at = 40 + 12 * counts[0] + counts[2] + counts[4]
    self.polygons = np.frombuffer(content[at : at + counts[6]], dtype=">I").reshape(-1, 4)


known_to_pyigtl = MessageBase.create_message
PolyDataMessage._unpack_content = unpack_polydata
MessageBase.create_message = staticmethod(lambda kind: PolyDataMessage() if kind == "POLYDATA" else known_to_pyigtl(kind))


def extended(path):
    matrix = np.array([[0, -1, 0, 1.5], [1, 0, 0, -2.25], [0, 0, 1, 30.125], [0, 0, 0, 1]])
    message = pyigtl.TransformMessage(matrix, device_name="Stylet", timestamp=1234567890.5)
    message.header_version, message.metadata, message.message_id = 2, {"Place": "theatre"}, 7
    pathlib.Path(path).write_bytes(message.pack())


def said(message):
    kind = message.message_type
    if kind == "TRANSFORM":
        return message.matrix.tolist()
    if kind == "POINT":
        return [np.asarray(message.positions).tolist(), list(message.names)]
    if kind == "IMAGE":
        return [message.world_coordinate_system, message.ijk_to_world_matrix.tolist(), message.image.tolist()]
    if kind == "POLYDATA":
        return [message.points.tolist(), message.polygons.tolist()]
    return message.string


def read(folder):
    seen = {}
    for path in sorted(pathlib.Path(folder).glob("*.bin")):
        data = path.read_bytes()
        header = MessageBase.parse_header(data[:58])
        body = data[58:]
        assert header["body_size"] == len(body)
        assert struct.unpack("> Q", data[50:58])[0] == CRC64(body)
        message = MessageBase.create_message(header["message_type"])
        if message is None:
            seen[path.stem] = None
            continue
        message.unpack(header, body)
        seen[path.stem] = {"device": message.device_name, "time": message.timestamp, "says": said(message)}
    print(json.dumps(seen))


def picture(host, port, path):
    client = pyigtl.OpenIGTLinkClient(host, port)
    message = client.wait_for_message("Ultrasound", timeout=20)
    pathlib.Path(path).write_bytes(message.image.tobytes())
    matrix = message.ijk_to_world_matrix.tolist()
    print(json.dumps({"frame": message.world_coordinate_system, "size": message.image.shape, "ras_from_ijk": matrix}))
    client.stop()


def watch(host, port, seconds):
    client = pyigtl.OpenIGTLinkClient(host, port)
    counts, last, start = {}, {}, None
    begun = time.time()
    next_at = begun
    while time.time() - begun < seconds:
        for message in client.get_latest_messages():
            counts[message.device_name] = counts.get(message.device_name, 0) + 1
            last[message.device_name] = said(message)
        if start is None and "Needle" in last:
            start = np.array(last["Needle"])
        if start is not None:
            # 5 mm to and fro along the needle, in two seconds.
            goal = start.copy()
            goal[:3, 3] += start[:3, 2] * 2.5 * (1 - math.cos(math.pi * (time.time() - begun)))
            client.send_message(pyigtl.TransformMessage(goal, device_name="Stylus"), wait=False)
        next_at = max(next_at + 1 / 60, time.time())
        time.sleep(max(next_at - time.time(), 0))
    off = None if start is None else float(np.linalg.norm(np.array(last["Needle"])[:3, 3] - start[:3, 3]))
    print(json.dumps({"counts": counts, "moved_mm": off, "connected": client.is_connected(), "State": last.get("State")}))
    client.stop()


if __name__ == "__main__":
    task, *rest = sys.argv[1:]
    if task == "extended":
        extended(*rest)
    elif task == "read":
        read(*rest)
    elif task == "picture":
        picture(rest[0], int(rest[1]), rest[2])
    else:
        watch(rest[0], int(rest[1]), float(rest[2]))
