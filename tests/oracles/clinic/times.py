"""Time and memory to read a series, a structure set and a dose: Stylet's commands beside pydicom and ITK, by turns.

    python times.py HOST-UI FOLDER [ROUNDS]

Each reader is a process of its own that reads the same files and writes the same kind of volume; its processor time,
wall time and largest memory are those that the kernel reports of it. The ratio is that of the medians.
"""
import pathlib
import statistics
import subprocess
import sys

import numpy as np
from pydicom.dataset import Dataset

import common
import images
from common import CT, DOSE, STRUCTURES, Frame, dicom, ds16, save

AND_WRITE = {
    "series, pydicom": """
import pydicom, pathlib, numpy as np
files = [pydicom.dcmread(p) for p in pathlib.Path(sys.argv[1]).glob("*.img")]
files.sort(key=lambda f: float(f.ImagePositionPatient[2]))
volume = np.stack([f.pixel_array * np.float32(f.RescaleSlope) + np.float32(f.RescaleIntercept) for f in files])
""",
    "series, ITK": """
import SimpleITK
reader = SimpleITK.ImageSeriesReader()
reader.SetFileNames(reader.GetGDCMSeriesFileNames(sys.argv[1]))
image = SimpleITK.Cast(reader.Execute(), SimpleITK.sitkFloat32)
""",
    "structures, pydicom": """
import pydicom, numpy as np
ds = pydicom.dcmread(sys.argv[1] + "/structures.dcm")
contours = [np.array(c.ContourData, float).reshape(-1, 3) for r in ds.ROIContourSequence for c in r.ContourSequence]
""",
    "structures, pydicom and Pillow": """
import pydicom, numpy as np, SimpleITK
from PIL import Image, ImageDraw
ds = pydicom.dcmread(sys.argv[1] + "/structures.dcm")
labels = np.zeros((40, 512, 512), "u1")
for n, roi in enumerate(ds.ROIContourSequence, 1):
    for contour in roi.ContourSequence:
        p = np.array(contour.ContourData, float).reshape(-1, 3)
        k = int(round(p[0, 2] / 2.5))
        plane = Image.fromarray(labels[k])
        ImageDraw.Draw(plane).polygon([tuple(c) for c in p[:, :2] / 0.5], fill=n)
        labels[k] = plane
SimpleITK.WriteImage(SimpleITK.GetImageFromArray(labels), sys.argv[2], True)
""",
    "dose, pydicom": """
import pydicom, numpy as np
ds = pydicom.dcmread(sys.argv[1] + "/dose.dcm")
dose = ds.pixel_array * float(ds.DoseGridScaling)
dose.tofile(sys.argv[2])
""",
    "dose, ITK": """
import SimpleITK
image = SimpleITK.ReadImage(sys.argv[1] + "/dose.dcm", SimpleITK.sitkFloat64)
SimpleITK.WriteImage(image, sys.argv[2])
""",
    "start, pydicom": "import pydicom, numpy",
    "start, ITK": "import SimpleITK",
}


def make(root):
    """200 slices of 512 x 512, 40 structures on 40 planes of 80 corners, a dose of 200 x 200 x 200."""
    rng = np.random.default_rng(45)
    series = root / "series"
    for k in range(200):
        ds = dicom(CT, "CT", f"times {k}")
        ds.SeriesInstanceUID = common.uid("times")
        ds.ImagePositionPatient, ds.ImageOrientationPatient = ["-128", "-128", ds16(-100 + k)], ["1", "0", "0", "0", "1", "0"]
        ds.PixelSpacing, ds.SliceThickness, ds.InstanceNumber = ["0.5", "0.5"], "1", k + 1
        images.pixels(ds, rng.normal(40, 12, (512, 512)), "CT", "axial", k)
        save(series / f"{k:03}.img", ds)
    image = root / "gland.nrrd"
    labels = np.zeros((40, 40, 40), "u1")
    labels[10:30, 10:30, 10:30] = 1
    header = "NRRD0004\ntype: uint8\ndimension: 3\nspace: LPS\nsizes: 40 40 40\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nencoding: raw\nspace origin: (-20,-20,-20)\n\n"
    image.write_bytes(header.encode() + labels.tobytes())
    (root / "scene.toml").write_text('name = "times"\n[volume]\nfile = "gland.nrrd"\n[image]\nfile = "series"\n')
    (root / "scene alone.toml").write_text('name = "times"\n[volume]\nfile = "gland.nrrd"\n')
    structure_set(root)
    dose(root, rng)


def structure_set(root):
    ds = dicom(STRUCTURES, "RTSTRUCT", "times")
    ds.StructureSetLabel, ds.StructureSetROISequence, ds.ROIContourSequence = "times", [], []
    angle = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    for n in range(40):
        roi, of_roi = Dataset(), Dataset()
        roi.ROINumber, roi.ROIName, of_roi.ReferencedROINumber, of_roi.ContourSequence = n + 1, f"ROI {n}", n + 1, []
        at = np.array([20 + 28 * (n % 8), 30 + 40 * (n // 8)])
        for k in range(40):
            item = Dataset()
            ring = at + 12 * np.column_stack([np.cos(angle), np.sin(angle)])
            item.ContourGeometricType, item.NumberOfContourPoints = "CLOSED_PLANAR", 80
            item.ContourData = [ds16(round(v, 4)) for x, y in ring for v in (x, y, 2.5 * k)]
            of_roi.ContourSequence.append(item)
        ds.StructureSetROISequence.append(roi)
        ds.ROIContourSequence.append(of_roi)
    save(root / "structures.dcm", ds)


def dose(root, rng):
    ds = dicom(DOSE, "RTDOSE", "times")
    ds.ImagePositionPatient, ds.ImageOrientationPatient, ds.PixelSpacing = ["-100", "-100", "-100"], ["1", "0", "0", "0", "1", "0"], ["1", "1"]
    ds.GridFrameOffsetVector, ds.FrameIncrementPointer = list(map(str, range(200))), 0x3004000C
    ds.DoseGridScaling, ds.DoseUnits, ds.DoseType, ds.DoseSummationType = "1e-6", "GY", "PHYSICAL", "PLAN"
    ds.NumberOfFrames = ds.Rows = ds.Columns = 200
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation, ds.SamplesPerPixel = 32, 32, 31, 0, 1
    ds.PhotometricInterpretation, ds.PixelData = "MONOCHROME2", rng.integers(0, 1 << 28, 200**3, dtype="u4").tobytes()
    ds["PixelData"].VR = "OW"
    save(root / "dose.dcm", ds)


def measure(command, cwd):
    """Wall and processor seconds, and largest memory in MiB, of a process; GNU time is small, so none of it is the caller's."""
    ran = subprocess.run(["/usr/bin/time", "-q", "-f", "%e %U %S %M", *command], cwd=cwd, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if ran.returncode:
        sys.exit(f"{command}: {ran.stderr[-400:]}")
    wall, user, system, kib = map(float, ran.stderr.splitlines()[-1].split())
    return wall, user + system, kib / 1024


def main():
    program, root = str(pathlib.Path(sys.argv[1]).resolve()), pathlib.Path(sys.argv[2]).resolve()
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 5
    if not (root / "dose.dcm").exists():
        make(root)
    python = lambda name: [sys.executable, "-c", "import sys\n" + AND_WRITE[name], str(root / "series" if name.startswith("series") else root), str(root / "out.nrrd")]
    readers = {
        "series, Stylet": [program, "scene", "check", "scene.toml"],
        "series, Stylet without the series": [program, "scene", "check", "scene alone.toml"],
        "structures, Stylet": [program, "convert", "structures.dcm", "out.nrrd"],
        "dose, Stylet": [program, "convert", "dose.dcm", "out.nrrd"],
    } | {name: python(name) for name in AND_WRITE}
    taken = {name: [] for name in readers}
    for n in range(rounds):
        print(f"round {n + 1} of {rounds}", file=sys.stderr, flush=True)
        for name, command in readers.items():
            (root / "out.nrrd").unlink(missing_ok=True)
            taken[name].append(measure(command, root))
    middle = {name: [statistics.median(column) for column in zip(*rows)] for name, rows in taken.items()}
    print("| reader | wall, s | processor, s | memory, MiB | over Stylet: wall | processor | memory |\n|---|---|---|---|---|---|---|")
    for name in sorted(middle):
        kind = name.split(",")[0]
        of = middle.get(f"{kind}, Stylet")
        ratios = "".join(f" {a / b:.2f} |" for a, b in zip(middle[name], of)) if of else " | | |"
        print("| " + name + " |" + "".join(f" {v:.3g} |" for v in middle[name]) + ratios)


main()
