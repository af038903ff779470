"""CT and MR series: geometry by a structure set drawn on them, values of CT by the seeds found in them."""
import csv
import json
import math

import numpy as np
import pydicom
import SimpleITK
from pydicom.dataset import Dataset

import common
from common import CT, ENHANCED_CT, MM, MR, Frame, Object, dicom, ds16, save, uid

PLAIN = ["axial", "oblique", "turned", "implicit", "big endian", "12 bits below an overlay", "32 bits", "slope of each slice",
         "false thickness", "rounded positions", "other files beside it"]
REFUSED = ["a slice is missing", "a slice is there twice", "tilted gantry", "two series", "colours inverted", "32 bits, big endian"]


def variants(modality):
    if modality == "MR":
        return PLAIN + REFUSED[:3] + ["axial", "oblique"]
    return PLAIN + REFUSED + ["enhanced", "enhanced, frames in disorder"] + ["oblique", "turned"] * 4 + ["oblique"]


def make(rng, folder, modality, variant):
    """Writes a series; returns its frame, its values (x first) and the middles of its seeds."""
    along = variant == "axial"
    axes = np.eye(3) if along else common.rotation(rng, variant != "turned")
    spacing = np.array([rng.uniform(0.7, 1.1), rng.uniform(0.7, 1.1), rng.uniform(0.9, 2.5)])
    size = tuple(int(math.ceil(36 / s)) + int(rng.integers(0, 4)) for s in spacing)
    frame = Frame(size, axes, spacing, rng.uniform(-80, 80, 3))
    excess, planted = seeds(rng, frame)
    values = np.rint(40 + excess + rng.normal(0, 12, size)).clip(-1000, 6000)
    # Directions and positions as a file has them; the frame is that of the written numbers.
    turn = [ds16(v) for v in (*axes[:, 0], *axes[:, 1])]
    pitch = [ds16(spacing[1]), ds16(spacing[0])]
    step = axes[:, 2] * spacing[2]
    if variant == "tilted gantry":
        step = step + axes[:, 1] * 0.4 * spacing[2]
    order = rng.permutation(size[2])
    slices = []
    for k in range(size[2]):
        place = frame.origin + k * step
        text = [f"{v:.1f}" if variant == "rounded positions" else ds16(v) for v in place]
        slices.append((k, text))
    if variant == "a slice is missing":
        del slices[size[2] // 2]
    if variant == "a slice is there twice":
        slices.append(slices[2])
    if variant.startswith("enhanced"):
        enhanced(folder, slices, turn, pitch, values, rng, "disorder" in variant)
        return frame, values, planted
    for n, (k, text) in enumerate(slices):
        ds = dicom(CT if modality == "CT" else MR, modality, f"{folder.name} {n}")
        ds.SeriesInstanceUID = uid("series", folder.name, n % 2 if variant == "two series" else 0)
        ds.ImagePositionPatient, ds.ImageOrientationPatient, ds.PixelSpacing = text, turn, pitch
        ds.SliceThickness = "5" if variant == "false thickness" else ds16(spacing[2])
        if variant == "false thickness":
            ds.SpacingBetweenSlices = "7"
        ds.InstanceNumber = int(order[k]) + 1
        pixels(ds, values[:, :, k], modality, variant, k)
        syntax = common.SYNTAXES[1 if variant == "implicit" else 2 if "big endian" in variant else 0]
        save(folder / f"{order[k]:03}{n}", ds, syntax)
    if variant == "other files beside it":
        (folder / "notes.txt").write_text("not DICOM")
        other = dicom(common.PLAN, "RTPLAN", folder.name + " plan")
        other.RTPlanLabel = "beside"
        save(folder / "plan.dcm", other)
    return frame, values, planted


def seeds(rng, frame):
    """Excess of five seeds, each a line of 4.5 mm blurred by 0.7 mm, over the tissue."""
    grid = np.stack(np.meshgrid(*map(np.arange, frame.size), indexing="ij"), axis=-1).reshape(-1, 3)
    places, excess, chosen = frame.places(grid), np.zeros(len(grid)), []
    while len(chosen) < 5:
        middle = frame.places(rng.uniform(0.2, 0.8, 3) * np.array(frame.size))
        if all(np.linalg.norm(middle - other) > 9 for other in chosen):
            chosen.append(middle)
            for s in np.linspace(-2.0, 2.0, 9):
                away = ((places - middle - s * frame.directions[:, 2]) ** 2).sum(axis=1)
                excess += 500 * np.exp(-away / 2 / 0.7**2)
    return excess.reshape(frame.size), np.array(chosen)


def pixels(ds, plane, modality, variant, k):
    """Stores a plane (x first); rescaled for CT, and for MR where the variant says so."""
    slope, intercept = 1.0, -1024.0
    if variant == "slope of each slice":
        slope, intercept = 0.5 + 0.25 * (k % 3), -1024.0 - k
    if modality == "CT" or variant == "slope of each slice":
        ds.RescaleSlope, ds.RescaleIntercept = ds16(slope), ds16(intercept)
        if modality == "CT":
            ds.RescaleType = "HU"
    stored = np.rint((plane.T - intercept) / slope)
    ds.Rows, ds.Columns = stored.shape
    bits = 32 if "32 bits" in variant else 16
    is_signed = variant == "oblique"
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = bits, bits, bits - 1, int(is_signed)
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME1" if variant == "colours inverted" else "MONOCHROME2"
    stored = stored.astype("i4")
    if variant == "12 bits below an overlay":
        ds.BitsStored, ds.HighBit = 13, 12
        stored |= 1 << 14
    letter = ("i" if is_signed else "u") + str(bits // 8)
    ds.PixelData = stored.astype((">" if "big endian" in variant else "<") + letter).tobytes()
    ds["PixelData"].VR = "OW"


def enhanced(folder, slices, turn, pitch, values, rng, disorder):
    ds = dicom(ENHANCED_CT, "CT", folder.name)
    shared, orientation, measures, rescale = Dataset(), Dataset(), Dataset(), Dataset()
    orientation.ImageOrientationPatient, measures.PixelSpacing, measures.SliceThickness = turn, pitch, "1"
    rescale.RescaleSlope, rescale.RescaleIntercept, rescale.RescaleType = "1", "-1024", "HU"
    shared.PlaneOrientationSequence, shared.PixelMeasuresSequence = [orientation], [measures]
    shared.PixelValueTransformationSequence = [rescale]
    ds.SharedFunctionalGroupsSequence, ds.PerFrameFunctionalGroupsSequence = [shared], []
    order = rng.permutation(len(slices)) if disorder else range(len(slices))
    for n in order:
        own, place = Dataset(), Dataset()
        place.ImagePositionPatient = slices[n][1]
        own.PlanePositionSequence = [place]
        ds.PerFrameFunctionalGroupsSequence.append(own)
    stored = np.stack([values[:, :, n].T + 1024 for n in order])
    ds.NumberOfFrames, ds.Rows, ds.Columns = stored.shape
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = 16, 16, 15, 0
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME2"
    ds.PixelData = stored.astype("<u2").tobytes()
    ds["PixelData"].VR = "OW"
    save(folder / "frames.dcm", ds)


def by_pydicom(folder):
    """Frame and values by PS3.3 C.7.6.2.1.1, from the files alone: columns run along the first direction cosine."""
    files = [pydicom.dcmread(p) for p in sorted(folder.iterdir()) if p.suffix not in (".txt", ".dcm")]
    first = files[0]
    row, column = np.array(first.ImageOrientationPatient, float).reshape(2, 3)
    normal = np.cross(row, column)
    files.sort(key=lambda f: np.dot(np.array(f.ImagePositionPatient, float), normal))
    places = np.array([f.ImagePositionPatient for f in files], float)
    down, right = map(float, first.PixelSpacing)
    step = (places[-1] - places[0]) / (len(files) - 1)
    spacing = np.array([right, down, np.linalg.norm(step)])
    frame = Frame((first.Columns, first.Rows, len(files)), np.column_stack([row, column, step / spacing[2]]), spacing, places[0])
    stacked = [hounsfield(f) for f in files]
    return frame, np.stack(stacked, axis=-1)


def hounsfield(file):
    order = ">" if file.file_meta.TransferSyntaxUID == common.SYNTAXES[2] else "<"
    stored = np.frombuffer(file.PixelData, f"{order}{'i' if file.PixelRepresentation else 'u'}{file.BitsAllocated // 8}")
    stored = stored[: file.Rows * file.Columns].reshape(file.Rows, file.Columns).astype("i8")
    if not file.PixelRepresentation:
        stored &= (1 << file.BitsStored) - 1
    return (stored * float(file.get("RescaleSlope", 1)) + float(file.get("RescaleIntercept", 0))).T


def by_itk(folder):
    reader = SimpleITK.ImageSeriesReader()
    uids = reader.GetGDCMSeriesIDs(str(folder))
    files = [reader.GetGDCMSeriesFileNames(str(folder), u) for u in uids]
    reader.SetFileNames(max(files, key=len))
    image = reader.Execute()
    return Frame.of_itk(image), np.transpose(SimpleITK.GetArrayFromImage(image))


def box(folder, frame, series):
    """A structure set drawn on the series: a square in two slices."""
    ds = dicom(common.STRUCTURES, "RTSTRUCT", folder.name + " structures")
    ds.StructureSetLabel, ds.StructureSetDate, ds.StructureSetTime = "box", "", ""
    image_series, study, of_frame, roi, contours = (Dataset() for _ in range(5))
    image_series.SeriesInstanceUID, image_series.ContourImageSequence = series, []
    study.ReferencedSOPClassUID, study.ReferencedSOPInstanceUID = "1.2.840.10008.3.1.2.3.1", ds.StudyInstanceUID
    study.RTReferencedSeriesSequence = [image_series]
    of_frame.FrameOfReferenceUID, of_frame.RTReferencedStudySequence = ds.FrameOfReferenceUID, [study]
    ds.ReferencedFrameOfReferenceSequence = [of_frame]
    roi.ROINumber, roi.ROIName, roi.ReferencedFrameOfReferenceUID = 1, "Prostate", ds.FrameOfReferenceUID
    contours.ReferencedROINumber, contours.ContourSequence = 1, []
    for k in (3, 4):
        item = Dataset()
        corners = frame.places([[4, 4, k], [20, 4, k], [20, 20, k], [4, 20, k]])
        item.ContourGeometricType, item.NumberOfContourPoints = "CLOSED_PLANAR", 4
        item.ContourData = [ds16(v) for v in corners.ravel()]
        contours.ContourSequence.append(item)
    ds.StructureSetROISequence, ds.ROIContourSequence = [roi], [contours]
    return save(folder / "box.dcm", ds)


def table(folder):
    with open(folder / "seeds.csv") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return np.array([[float(r[c]) for c in ("x_mm", "y_mm", "z_mm")] for r in rows])


def check(stylet, rng, root, modality, n, variant):
    found = Object(modality, f"{modality}{n:02}", variant)
    folder = root / found.name
    written = make(rng, folder, modality, variant)
    is_enhanced = variant.startswith("enhanced")
    found.must_refuse = variant in REFUSED and not (variant == "colours inverted" and modality == "MR")
    if found.must_refuse:
        series = next(pydicom.dcmread(p).SeriesInstanceUID for p in sorted(folder.iterdir()))
        if modality == "CT":
            stylet.read(found, "find-seeds", folder, "--out", root / (found.name + " found"))
        else:
            stylet.read(found, "convert", box(folder, written[0], series), root / (found.name + ".nrrd"))
        return found
    found.may_refuse = "rounded" in variant  # to 0.1 mm in oblique directions
    frame, values = written[:2] if is_enhanced else by_pydicom(folder)
    if not is_enhanced:
        first = next(p for p in sorted(folder.iterdir()) if p.suffix not in (".txt", ".dcm"))
        common.dcmtk_reads(found, first, "0020,0032", 1)
        itk_frame, itk_values = by_itk(folder)
        found.compare("pydicom and ITK: mm", common.far(frame, itk_frame), 0.2 if "rounded" in variant else MM)
        if not (modality == "MR" and "slope" in variant):
            found.compare("pydicom and ITK: values", np.abs(itk_values - values).max(), 1e-3)
        series = pydicom.dcmread(first).SeriesInstanceUID
        out = root / (found.name + ".nrrd")
        if stylet.read(found, "convert", box(folder, frame, series), out) is None:
            return found
        grid, labels = common.itk_read(out)
        found.compare("mm", common.far(frame, grid), MM)
        expected = np.zeros(frame.size)
        expected[4:21, 4:21, 3:5] = 1
        shown, off = common.values_at(frame, expected, grid)
        # Corners of the square lie in voxel centres, so a voxel at the edge is half covered.
        inner = np.zeros(frame.size, bool)
        inner[5:20, 5:20, 3:5] = True
        found.compare("voxels", np.count_nonzero(labels[inner] != 1) + np.count_nonzero(labels[expected == 0]), 0)
    if modality == "CT":
        seeds_of(stylet, found, root, folder, frame, values, written[2])
    return found


def seeds_of(stylet, found, root, folder, frame, values, planted):
    """Seeds in the series and in a NRRD that ITK writes of what pydicom read: the same to the digits of the table."""
    image = SimpleITK.GetImageFromArray(np.transpose(values).astype("f8"))
    image.SetDirection(frame.directions.ravel())
    image.SetSpacing(frame.spacing)
    image.SetOrigin(frame.origin)
    copy = root / (found.name + " by itk.nrrd")
    SimpleITK.WriteImage(image, str(copy))
    outs = [root / f"{found.name} found{n}" for n in range(2)]
    for path, out in zip((folder, copy), outs):
        if stylet.read(found, "find-seeds", path, "--count", 5, "--out", out) is None:
            return
    ours, theirs = map(table, outs)
    if ours.shape != theirs.shape:
        found.fail(f"{len(ours)} seeds in the series, {len(theirs)} in its copy")
        return
    near = np.linalg.norm(ours[:, None] - theirs[None], axis=2).min(axis=1).max()
    found.compare("seeds in both: mm", near, MM)
    true = np.linalg.norm(ours[:, None] @ common.RAS - planted[None], axis=2).min(axis=0).max()
    found.compare("seeds as planted, of noise 12 HU: mm", true, 0.5)
    levels = [json.loads((out / "found.json").read_text()) for out in outs]
    numbers = [[v for v in level.values() if isinstance(v, float)] for level in levels]
    found.compare("levels in HU: share", np.abs(np.array(numbers[0]) / np.where(numbers[1], numbers[1], 1) - 1).max(), 1e-4)


def run(stylet, rng, root):
    for modality in ("CT", "MR"):
        for n, variant in enumerate(variants(modality)):
            yield check(stylet, rng, root, modality, n, variant)
