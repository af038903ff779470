"""The module for 3D Slicer with Slicer's own nodes: Python with slicer-core (`make igtl-test`).

    slicer_nodes.py watch HOST PORT SECONDS   shows a server in a scene, which is closed once; prints its nodes, as JSON
    slicer_nodes.py picture HOST PORT FILE    shows the probe's picture; prints its node, and its largest difference from FILE.png
    slicer_nodes.py strangers                 connects to servers that are absent, full, slow or not Stylet's
"""

import json
import pathlib
import socket
import struct
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "slicer"))
from StyletLib.link import HEADER, MOST_BYTES, Link


def watch(host, port, seconds):
    import slicer
    import vtk
    from StyletLib.nodes import Nodes

    scene = slicer.vtkMRMLScene()
    link, nodes = Link(host, port), Nodes(scene)
    begun, was_closed = time.monotonic(), False
    while time.monotonic() - begun < seconds:
        nodes.show(link.poll())
        if not was_closed and time.monotonic() - begun > seconds / 2:
            was_closed = True
            scene.Clear(0)
        time.sleep(0.03)
    seen = {"words": link.words, "is_live": link.is_live, "kinds": {}}
    for name in ("needle", "needle's shape", "gland", "seeds"):
        node = scene.GetFirstNodeByName(f"Stylet {name}")
        if node is None:
            continue
        seen["kinds"][name] = node.GetClassName()
        if name == "needle":
            matrix = vtk.vtkMatrix4x4()
            node.GetMatrixTransformToWorld(matrix)
            seen["tip_mm"] = [matrix.GetElement(row, 3) for row in range(3)]
        elif name == "seeds":
            count = node.GetNumberOfControlPoints()
            seen["seeds_mm"] = [list(node.GetNthControlPointPositionWorld(n)) for n in range(count)]
        else:
            bounds = [0.0] * 6
            node.GetRASBounds(bounds)
            seen[name] = bounds
    seen["count"] = scene.GetNumberOfNodesByClass("vtkMRMLModelNode")
    link.close()
    print(json.dumps(seen))


def picture(host, port, file):
    import numpy as np
    import slicer
    import vtk
    from StyletLib.nodes import Nodes
    from vtk.util.numpy_support import vtk_to_numpy

    scene = slicer.vtkMRMLScene()
    link, nodes = Link(host, port), Nodes(scene)
    end, volume = time.monotonic() + 20, None
    while volume is None and time.monotonic() < end:
        nodes.show(link.poll())
        volume = scene.GetFirstNode("Stylet ultrasound", "vtkMRMLScalarVolumeNode")
        time.sleep(0.01)
    reader = vtk.vtkPNGReader()
    reader.SetFileName(file)
    reader.Update()
    size = reader.GetOutput().GetDimensions()
    # VTK counts the rows of a file from below.
    written = vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).reshape(size[1], size[0], -1)[::-1, :, 0]
    shown = vtk_to_numpy(volume.GetImageData().GetPointData().GetScalars()).reshape(size[1], size[0])
    matrix = vtk.vtkMatrix4x4()
    volume.GetIJKToRASMatrix(matrix)
    off = int(np.abs(shown.astype(int) - written).max())
    rows = [[matrix.GetElement(row, column) for column in range(4)] for row in range(4)]
    print(json.dumps({"off": off, "size": size, "greys": len(np.unique(shown)), "ras_from_ijk": rows}))
    link.close()


def message(kind, device, body, size=None):
    head = HEADER.pack(1, kind.encode(), device.encode(), len(body) if size is None else size)
    return head + body


def after(parts):
    """Returns the link of a client to a server that sends these parts and then ends, and all that it received."""
    listener = socket.create_server(("127.0.0.1", 0))
    link = Link(*listener.getsockname())
    link.poll()
    server, _ = listener.accept()
    listener.close()
    received = {}
    for part in parts:
        server.sendall(part)
        time.sleep(0.05)
        received.update(link.poll())
    words = link.words
    server.close()
    time.sleep(0.05)
    received.update(link.poll())
    return link, words, received


def strangers():
    text = struct.pack(">HH", 3, 5) + b"quiet"
    state = message("STRING", "State", text)
    # In pieces, after a message of another device and one with the second header.
    second = struct.pack(">H", 2) + message("STRING", "State", b"no text")[2:]
    pieces = message("IMAGE", "Image", b"12345") + second + state
    link, words, received = after([pieces[n : n + 40] for n in range(0, len(pieces), 40)])
    assert words == received["State"] == "quiet", words
    assert "ended" in link.words and not link.is_live and link.poll() == {}, link.words
    refusal = struct.pack(">Hq20s", 13, 0, b"Not ready") + b"there is no room\0"
    link, *_ = after([message("STATUS", "Stylet", refusal)])
    assert link.words == "there is no room", link.words
    beyond = struct.pack(">10I3f4I", 1, 0, 0, 0, 0, 1, 16, 0, 0, 0, 0.0, 0.0, 0.0, 3, 0, 0, 1)
    for kind, device, body, size in (
        ("STRING", "State", b"", MOST_BYTES + 1),
        ("TRANSFORM", "Needle", b"short", None),
        ("POLYDATA", "Gland", beyond, None),
        ("IMAGE", "Ultrasound", struct.pack(">H4B3H", 1, 1, 3, 1, 1, 4, 4, 1) + bytes(60 + 15), None),
    ):
        link, words, received = after([message(kind, device, body, size)])
        assert received == {} and words.endswith("is not Stylet's."), words
    link, words, _ = after([b""])
    # Nothing listens there now.
    link._tried_s = 0.0
    link.poll()
    assert "Start one with: host-ui igtl" in link.words, link.words


if __name__ == "__main__":
    task, *rest = sys.argv[1:]
    if task == "watch":
        watch(rest[0], int(rest[1]), float(rest[2]))
    elif task == "picture":
        picture(rest[0], int(rest[1]), rest[2])
    else:
        strangers()
        print("{}")
