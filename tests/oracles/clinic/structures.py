"""RT Structure Sets: the volume of each structure as drawn, its voxels on the grid of the images, and the grid itself."""
import json
import pathlib

import numpy as np
import pydicom
from matplotlib.path import Path
from pydicom.dataset import Dataset

import common
from common import CT, MM, STRUCTURES, VOLUME, Frame, Object, dicom, ds16, save, uid

VARIANTS = ["axial", "oblique", "axial with images", "oblique with images", "hole inside", "hole by exclusive or", "keyhole",
            "several contours a slice", "40 structures", "sagittal", "implicit", "big endian", "coarse digits", "wide slices",
            "contours in disorder", "points and open contours beside", "first corner repeated", "sagittal with images",
            "images finer than the contours", "beyond the images"]
SUBSAMPLES = 8


def star(rng, radius, count):
    """A polygon about the origin whose radius varies by a tenth."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    phase = rng.uniform(0, 6, 2)
    r = radius * (1 + 0.06 * np.sin(2 * angle + phase[0]) + 0.04 * np.sin(3 * angle + phase[1]))
    return np.column_stack([r * np.cos(angle), 0.8 * r * np.sin(angle)])


def keyhole(outer, inner):
    """One contour that runs around, in to the hole, about it the other way, and back."""
    nearest = np.linalg.norm(outer - inner[0], axis=1).argmin()
    outer = np.roll(outer, -nearest, axis=0)
    return np.vstack([outer, outer[:1], inner[:1], inner[:0:-1], inner[:1]])


def make(rng, folder, variant):
    """Writes a structure set, with images where the variant says so; returns the frame of the images or None."""
    axes = np.eye(3)
    if "oblique" in variant:
        axes = common.rotation(rng, True)
    if "sagittal" in variant:
        axes = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])  # columns run to the back, rows upwards, slices to the left
    thick = 5.0 if variant == "wide slices" else rng.uniform(2.0, 3.0)
    pitch = 0.4 if "finer" in variant else rng.uniform(0.6, 0.9)
    planes, middle = 13, rng.uniform(-60, 60, 3)
    between = thick / 2 if "finer" in variant else thick
    size = (int(92 / pitch), int(80 / pitch), int(planes * thick / between) + 2)
    origin = middle - axes @ (np.array([46.0, 40.0, thick * planes / 2]))
    frame = Frame(size, axes, np.array([pitch, pitch * 1.1, between]), origin)
    if "finer" in variant:
        frame.origin = frame.origin + axes[:, 2] * between / 2
    rois = bodies(rng, variant, planes)
    ds = written(rng, folder, variant, axes, origin, thick, rois)
    with_images = "images" in variant
    if with_images:
        series(ds, folder, frame, cut=6 if variant == "beyond the images" else 0)
    syntax = {"implicit": common.SYNTAXES[1], "big endian": common.SYNTAXES[2]}.get(variant, common.SYNTAXES[0])
    save(folder / "structures.dcm", ds, syntax)
    return frame if with_images else None


def bodies(rng, variant, planes):
    """Structures as (name, kind, contours), each contour a plane number and corners in mm within the plane."""
    corners = int(rng.integers(24, 160))
    heights = range(1, planes)
    def body(at, radius, within=heights):
        waist = lambda k: radius * (0.75 + 0.25 * np.sin(np.pi * k / planes))
        return [(k, star(rng, waist(k), corners) + at) for k in within]
    if variant == "40 structures":
        spots = [(x, y) for x in range(10, 85, 10) for y in range(10, 75, 14)][:40]
        return [(f"ROI {n}", "CLOSED_PLANAR", body(np.array(at), 4.5)) for n, at in enumerate(spots)]
    left, right = np.array([26.0, 40.0]), np.array([66.0, 40.0])
    outer = body(left, 18)
    inner = [(k, star(rng, 6, corners) + left) for k in heights]
    kind = "CLOSEDPLANAR_XOR" if "exclusive" in variant else "CLOSED_PLANAR"
    if variant == "keyhole":
        outer = [(k, keyhole(o, i)) for (k, o), (_, i) in zip(outer, inner)]
    elif "hole" in variant:
        outer = outer + inner
    second = body(right, 12, range(3, planes - 2))
    if variant == "several contours a slice":
        second += body(right + [0, -26], 8) + body(right + [0, 26], 7)
    return [("Prostate", kind, outer), ("Rectum", "CLOSED_PLANAR", second)]


def written(rng, folder, variant, axes, origin, thick, rois):
    ds = dicom(STRUCTURES, "RTSTRUCT", folder.name)
    ds.StructureSetLabel, ds.StructureSetDate, ds.StructureSetTime = "generated", "", ""
    ds.StructureSetROISequence, ds.ROIContourSequence, ds.RTROIObservationsSequence = [], [], []
    numbers = rng.permutation(200)[: len(rois)] + 1
    text = (lambda v: f"{v:.2f}") if variant == "coarse digits" else ds16
    for (name, kind, contours), number in zip(rois, numbers):
        roi, of_roi = Dataset(), Dataset()
        roi.ROINumber, roi.ROIName, roi.ReferencedFrameOfReferenceUID = int(number), name, ds.FrameOfReferenceUID
        roi.ROIGenerationAlgorithm = "MANUAL"
        of_roi.ReferencedROINumber, of_roi.ContourSequence = int(number), []
        if variant == "contours in disorder":
            contours = [contours[i] for i in rng.permutation(len(contours))]
        for k, corners in contours:
            if variant == "first corner repeated":
                corners = np.vstack([corners, corners[:1]])
            of_roi.ContourSequence.append(contour(kind, corners, k * thick, axes, origin, text))
        if "points" in variant:
            of_roi.ContourSequence += [contour("POINT", corners[:1], thick, axes, origin, text),
                                       contour("OPEN_PLANAR", corners[:7], thick, axes, origin, text)]
        ds.StructureSetROISequence.append(roi)
        ds.ROIContourSequence.insert(0 if variant == "contours in disorder" else len(ds.ROIContourSequence), of_roi)
    return ds


def contour(kind, corners, height, axes, origin, text):
    item = Dataset()
    places = np.column_stack([corners, np.full(len(corners), height)]) @ axes.T + origin
    item.ContourGeometricType, item.NumberOfContourPoints = kind, len(corners)
    item.ContourData = [text(v) for v in places.ravel()]
    return item


def series(ds, folder, frame, cut):
    """Writes the images that the structure set names; `cut` leaves out the last ones."""
    image_series, study, of_frame = Dataset(), Dataset(), Dataset()
    image_series.SeriesInstanceUID, image_series.ContourImageSequence = uid("images", folder.name), []
    study.ReferencedSOPClassUID, study.ReferencedSOPInstanceUID = "1.2.840.10008.3.1.2.3.1", ds.StudyInstanceUID
    study.RTReferencedSeriesSequence = [image_series]
    of_frame.FrameOfReferenceUID, of_frame.RTReferencedStudySequence = ds.FrameOfReferenceUID, [study]
    ds.ReferencedFrameOfReferenceSequence = [of_frame]
    for k in range(frame.size[2] - cut):
        image = dicom(CT, "CT", f"{folder.name} {k}")
        image.SeriesInstanceUID = image_series.SeriesInstanceUID
        image.ImagePositionPatient = [ds16(v) for v in frame.places([0, 0, k])]
        image.ImageOrientationPatient = [ds16(v) for v in frame.directions[:, :2].T.ravel()]
        image.PixelSpacing, image.SliceThickness = [ds16(frame.spacing[1]), ds16(frame.spacing[0])], "1"
        image.Columns, image.Rows = frame.size[:2]
        image.BitsAllocated = image.BitsStored = 8
        image.HighBit, image.PixelRepresentation, image.SamplesPerPixel = 7, 0, 1
        image.PhotometricInterpretation, image.RescaleSlope, image.RescaleIntercept = "MONOCHROME2", "1", "0"
        image.PixelData = bytes(frame.size[0] * frame.size[1] + frame.size[0] * frame.size[1] % 2)
        image["PixelData"].VR = "OB"
        save(folder / f"image{k:03}.dcm", image)


def by_pydicom(path):
    """Structures by PS3.3 C.8.8.6: name to a list of planes, each a height and polygons within it; and the axes used."""
    ds = pydicom.dcmread(path)
    names = {roi.ROINumber: roi.ROIName for roi in ds.StructureSetROISequence}
    structures = {}
    for item in ds.ROIContourSequence:
        closed = [c for c in item.ContourSequence if c.ContourGeometricType.startswith("CLOSED")]
        polygons = [np.array(c.ContourData, float).reshape(-1, 3) for c in closed]
        structures[names[item.ReferencedROINumber]] = polygons
    return structures


def within(polygons, axes):
    """Polygons by their height along the third axis."""
    planes = {}
    for polygon in polygons:
        turned = polygon @ axes
        height = next((h for h in planes if abs(h - turned[0, 2]) < 0.1), turned[0, 2])
        planes.setdefault(height, []).append(turned[:, :2])
    return dict(sorted(planes.items()))


def plane_axes(polygons):
    """Two axes in the plane of the contours and their normal, by the largest singular values of one contour."""
    largest = max(polygons, key=len)
    turned = np.linalg.svd(largest - largest.mean(axis=0))[2].T
    return turned * np.array([1, 1, np.linalg.det(turned)])


def area(polygons):
    """Area of even-odd polygons that are nested or apart: holes count against."""
    total = 0.0
    for n, polygon in enumerate(polygons):
        x, y = polygon.T
        signed = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
        depth = sum(Path(other).contains_point(polygon[0]) for m, other in enumerate(polygons) if m != n)
        total += abs(signed) * (-1) ** depth
    return total


def volume_cc(polygons):
    planes = within(polygons, plane_axes(polygons))
    heights = np.array(list(planes))
    thick = np.median(np.diff(heights))
    return sum(map(area, planes.values())) * thick / 1000


def coverage(frame, polygons):
    """Share of each voxel that the polygons cover in the plane of its slice, by even-odd samples."""
    planes = within(polygons, frame.directions)
    heights = np.array(list(planes))
    half = np.median(np.diff(heights)) / 2
    base = frame.directions.T @ frame.origin
    slices = base[2] + np.arange(frame.size[2]) * frame.spacing[2]
    within_voxel = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5
    share = np.zeros(frame.size)
    for height, of_plane in planes.items():
        at = [(polygon - base[:2]) / frame.spacing[:2] for polygon in of_plane]
        low = np.maximum(np.floor(np.min([p.min(axis=0) for p in at], axis=0) - 1), 0).astype(int)
        high = np.minimum(np.ceil(np.max([p.max(axis=0) for p in at], axis=0) + 2), frame.size[:2]).astype(int)
        size = high - low
        x, y = ((np.arange(low[a], high[a])[:, None] + within_voxel).ravel() for a in range(2))
        places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        odd = sum(Path(polygon).contains_points(places).astype(int) for polygon in at) % 2
        odd = odd.reshape(size[0], SUBSAMPLES, size[1], SUBSAMPLES).mean(axis=(1, 3))
        for k in np.flatnonzero((slices >= height - half - 1e-6) & (slices < height + half - 1e-6)):
            share[low[0] : high[0], low[1] : high[1], k] += odd
    return share


def check(stylet, rng, root, n, variant):
    found = Object("RT Structure Set", f"structures{n:02}", variant)
    folder = root / found.name
    folder.mkdir()
    frame = make(rng, folder, variant)
    path = folder / "structures.dcm"
    structures = by_pydicom(path)
    common.dcmtk_reads(found, path, "3006,0050", sum(len(p) for p in structures.values()) + (4 if "points" in variant else 0))
    volumes(stylet, found, root, path, structures)
    voxels(stylet, found, root, path, structures, frame)
    return found


def volumes(stylet, found, root, path, structures):
    """Volumes of `host-ui dose`, which takes the contours themselves."""
    seeds, out = root / "seeds.csv", root / (found.name + " dose")
    seeds.write_text("x_mm,y_mm,z_mm\n" + "{},{},{}\n".format(*(common.RAS @ next(iter(structures.values()))[0][0])))
    source = pathlib.Path(__file__).parents[3] / "sources/i125_6711.toml"
    if stylet.read(found, "dose", "--source", source, "--seeds", seeds, "--strength-u", 0.5, "--structures", path, "--out", out) is None:
        return
    told = {s["name"]: s["volume_cc"] for s in json.loads((out / "metrics.json").read_text())["structures"]}
    if told.keys() != structures.keys():
        found.fail(f"structures {sorted(told)} instead of {sorted(structures)}")
        return
    for name, polygons in structures.items():
        found.compare("volume as drawn: share", abs(told[name] / volume_cc(polygons) - 1), VOLUME)


def voxels(stylet, found, root, path, structures, frame):
    out = root / (found.name + ".nrrd")
    if stylet.read(found, "convert", path, out) is None:
        return
    grid, labels = common.itk_read(out)
    if frame is not None and "beyond" not in found.variant:
        found.compare("mm", common.far(frame, grid), MM)
    voxel_cc = np.prod(grid.spacing) / 1000
    for label, (name, polygons) in enumerate(structures.items(), 1):
        share = coverage(grid, polygons)
        mine, theirs = share >= 0.5, labels == label
        # Where a voxel is covered by nearly one half, samples of either reader may fall on both sides.
        clear = np.abs(share - 0.5) > 0.13
        found.compare("voxels clearly in or out", np.count_nonzero((mine != theirs) & clear), 0)
        found.compare("volume in voxels: share", abs(np.count_nonzero(theirs) / np.count_nonzero(mine) - 1), VOLUME)
        if np.count_nonzero(mine) > 20_000:  # the edge of a smaller one is too large a part of it
            found.compare("voxels to drawn volume: share", abs(np.count_nonzero(theirs) * voxel_cc / volume_cc(polygons) - 1), VOLUME)


def run(stylet, rng, root):
    for n, variant in enumerate(VARIANTS * 2):
        yield check(stylet, rng, root, n, variant)
