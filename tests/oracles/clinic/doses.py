"""RT Doses: place and value of every voxel, the difference of two of them, and what is written again."""
import json

import numpy as np
import pydicom
import SimpleITK
from pydicom.dataset import Dataset
from scipy.interpolate import RegularGridInterpolator

import common
from common import DOSE, GY, MM, PLAN, Frame, Object, dicom, ds16, save, uid

# Orientations: columns and rows along the patient's axes; frames follow the normal, or run against it.
AXIAL, FEET = ([1, 0, 0], [0, 1, 0]), ([-1, 0, 0], [0, 1, 0])
PRONE, CORONAL, SAGITTAL = ([-1, 0, 0], [0, -1, 0]), ([1, 0, 0], [0, 0, -1]), ([0, 1, 0], [0, 0, -1])
VARIANTS = {
    "16 bits": {}, "32 bits": {"bits": 32}, "absolute offsets": {"absolute": True}, "absolute offsets, 32 bits": {"bits": 32, "absolute": True},
    "prone": {"turn": PRONE}, "prone, absolute offsets": {"turn": PRONE, "absolute": True}, "feet first": {"turn": FEET},
    "coronal": {"turn": CORONAL, "bits": 32}, "sagittal": {"turn": SAGITTAL}, "frames against the normal": {"down": True},
    "absolute offsets downwards": {"down": True, "absolute": True}, "one frame": {"frames": 1},
    "effective": {"DoseType": "EFFECTIVE"}, "several plans": {"DoseSummationType": "MULTI_PLAN"}, "beam": {"DoseSummationType": "BEAM"},
    "fraction": {"DoseSummationType": "FRACTION", "bits": 32}, "errors, signed": {"DoseType": "ERROR", "signed": True},
    "errors, signed 32 bits": {"DoseType": "ERROR", "signed": True, "bits": 32}, "implicit": {"syntax": 1}, "big endian": {"syntax": 2},
    "big endian, 32 bits": {"syntax": 2, "bits": 32, "may": True}, "first frame at 0, feet first": {"turn": FEET, "z": 0.0},
    "first frame at 0": {"z": 0.0, "absolute": True}, "exponents": {"exponent": True}, "offsets rounded": {"rounded": True, "may": True},
    # Refused by docs/formats.md, or without a meaning in the standard.
    "oblique": {"refuse": True, "oblique": True}, "uneven frames": {"refuse": True, "uneven": True},
    "relative": {"refuse": True, "DoseUnits": "RELATIVE"}, "no offsets": {"refuse": True, "offsets": False},
    "absolute offsets, coronal": {"refuse": True, "turn": CORONAL, "absolute": True}, "one offset short": {"refuse": True, "short": True},
    "offsets of neither kind": {"refuse": True, "shift": 7.0}, "8 bits": {"may": True, "bits": 8},
    "absolute offsets, feet first": {"refuse": True, "turn": FEET, "absolute": True},
    "big endian, 32 bits as numpy orders them": {"refuse": True, "syntax": 2, "bits": 32, "numpy": True}, "absolute offsets, again": {"absolute": True},
}


def make(rng, path, how):
    row, column = map(np.array, how.get("turn", AXIAL))
    if how.get("oblique"):
        row, column = common.rotation(rng, True)[:, :2].T
    count = how.get("frames", int(rng.integers(8, 14)))
    size = (int(rng.integers(9, 20)), int(rng.integers(9, 20)), count)
    pitch = np.array([rng.uniform(1, 3), rng.uniform(1, 3), rng.choice([1.25, 2.0, 2.5, 3.0])])
    origin = np.round(rng.uniform(-60, 60, 3), 2)
    origin[2] = how.get("z", origin[2])
    grid = np.stack(np.meshgrid(*map(np.arange, size), indexing="ij"), axis=-1)
    middle = np.array(size) / 2 + rng.uniform(-1, 1, 3)
    dose = 180 * np.exp(-((((grid - middle) * pitch) ** 2).sum(axis=-1)) / 2 / 12**2)
    if how.get("signed"):
        dose -= 30
    ds = dicom(DOSE, "RTDOSE", path.stem)
    ds.ImagePositionPatient, ds.ImageOrientationPatient = list(map(ds16, origin)), list(map(ds16, (*row, *column)))
    ds.PixelSpacing, ds.SliceThickness = [ds16(pitch[1]), ds16(pitch[0])], ""
    offsets = np.arange(count) * pitch[2] * (-1 if how.get("down") else 1)
    if how.get("uneven"):
        offsets[3:] += 1.0
    if how.get("rounded"):
        offsets = np.round(offsets + rng.uniform(-0.004, 0.004, count) * (np.arange(count) > 0), 3)
    offsets += (origin[2] if how.get("absolute") else 0) + how.get("shift", 0)
    if count > 1 and how.get("offsets", True):
        ds.GridFrameOffsetVector = list(map(ds16, offsets[: -1 if how.get("short") else None]))
    if count == 1:
        ds.SliceThickness = "2.5"
    else:
        ds.FrameIncrementPointer = 0x3004000C
    bits = how.get("bits", 16)
    scaling = float(f"{1.02 * np.abs(dose).max() / (1 << (bits - (1 if how.get('signed') else 0))):{'.6e' if how.get('exponent') else '.9g'}}")
    ds.DoseGridScaling, ds.DoseUnits = f"{scaling:.9E}" if how.get("exponent") else ds16(scaling), how.get("DoseUnits", "GY")
    ds.DoseType, ds.DoseSummationType = how.get("DoseType", "PHYSICAL"), how.get("DoseSummationType", "PLAN")
    ds.NumberOfFrames, ds.Rows, ds.Columns = count, size[1], size[0]
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = bits, bits, bits - 1, int(how.get("signed", False))
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME2"
    plan = Dataset()
    plan.ReferencedSOPClassUID, plan.ReferencedSOPInstanceUID = PLAN, uid("a plan")
    ds.ReferencedRTPlanSequence = [plan]
    letter = ("i" if how.get("signed") else "u") + str(bits // 8)
    syntax = common.SYNTAXES[how.get("syntax", 0)]
    stored = np.rint(np.transpose(dose) / float(ds.DoseGridScaling)).astype((">" if how.get("syntax") == 2 else "<") + letter).tobytes()
    if how.get("syntax") == 2 and bits == 32 and not how.get("numpy"):
        stored = in_words(stored)
    ds.PixelData = stored + b"\0" * (len(stored) % 2)
    ds["PixelData"].VR = "OB" if bits == 8 else "OW"
    save(path, ds, syntax)


def in_words(data):
    """Big-endian numbers of 32 bits as OW has them: words of 16 bits, the low one first (PS3.5 6.2; dcmtk and GDCM agree)."""
    return np.frombuffer(data, "u2").reshape(-1, 2)[:, ::-1].tobytes()


def by_pydicom(path):
    """Frame and dose by PS3.3 C.8.8.3.2: offsets are along the normal, or, in axial planes, z of each plane."""
    ds = pydicom.dcmread(path)
    row, column = np.array(ds.ImageOrientationPatient, float).reshape(2, 3)
    normal, origin = np.cross(row, column), np.array(ds.ImagePositionPatient, float)
    count = int(ds.NumberOfFrames)
    offsets = np.atleast_1d(np.array(ds.get("GridFrameOffsetVector", 0.0), float))
    if offsets[0] != 0:
        assert abs(offsets[0] - origin[2]) < 1e-6 and normal[2] == 1
        offsets = offsets - origin[2]
    step = (offsets[-1] - offsets[0]) / max(count - 1, 1) if count > 1 else float(ds.SliceThickness)
    down, right = map(float, ds.PixelSpacing)
    directions = np.column_stack([row, column, normal * np.sign(step)])
    frame = Frame((ds.Columns, ds.Rows, count), directions, np.array([right, down, abs(step)]), origin)
    order = ">" if ds.file_meta.TransferSyntaxUID == common.SYNTAXES[2] else "<"
    data = in_words(ds.PixelData) if order == ">" and ds.BitsAllocated == 32 else ds.PixelData
    stored = np.frombuffer(data, f"{order}{'i' if ds.PixelRepresentation else 'u'}{ds.BitsAllocated // 8}")
    return frame, np.transpose(stored[: np.prod(frame.size)].reshape(frame.size[::-1])) * float(ds.DoseGridScaling)


def check(stylet, rng, root, n, variant):
    found, how = Object("RT Dose", f"dose{n:02}", variant), VARIANTS[variant]
    found.must_refuse, found.may_refuse = how.get("refuse", False), how.get("may", False)
    path, out = root / (found.name + ".dcm"), root / (found.name + ".nrrd")
    make(rng, path, how)
    if stylet.read(found, "convert", path, out) is None or found.must_refuse:
        return found
    common.dcmtk_reads(found, path, "3004,000e", 1)
    frame, dose = by_pydicom(path)
    grid, told = common.itk_read(out)
    found.compare("mm", common.far(frame, grid), MM)
    here, off = common.values_at(frame, dose, grid)
    found.compare("voxels: mm", off, 0.01 if how.get("rounded") else MM)
    if here is not None:
        found.compare("dose: share", np.max(np.abs(told - here) / np.maximum(np.abs(here), 1e-3 * np.abs(dose).max())), GY)
    itk(found, path, frame, dose, how)
    if not how.get("frames") and how.get("DoseType", "PHYSICAL") == "PHYSICAL":
        difference(stylet, found, root, path, frame, dose)
    if how.get("DoseSummationType", "PLAN") == "PLAN":
        again(stylet, found, root, path, frame, dose)
    return found


def itk(found, path, frame, dose, how):
    """ITK reads place and values; offsets that are rounded it takes from the first two frames."""
    theirs, values = common.itk_read(path)
    values = values if values.dtype.kind == "f" else values * float(pydicom.dcmread(path).DoseGridScaling)
    if how.get("frames") or values.shape != dose.shape:
        return
    found.compare("pydicom and ITK: share", np.abs(values - dose).max() / np.abs(dose).max(), 1e-6)
    if not how.get("rounded"):
        found.compare("pydicom and ITK: mm", common.far(frame, theirs), MM)


def difference(stylet, found, root, path, frame, dose):
    """`host-ui compare` with 1.01 of the dose, shifted by a part of a voxel and finer, by scipy's linear interpolation."""
    moved = Frame(frame.size, frame.directions, frame.spacing * 0.9, frame.origin + 0.31 * frame.spacing)
    image = SimpleITK.GetImageFromArray(np.transpose(dose * 1.01))
    image.SetDirection(moved.directions.ravel())
    image.SetSpacing(moved.spacing)
    image.SetOrigin(moved.origin)
    second, figures = root / (found.name + " second.nrrd"), root / (found.name + ".json")
    SimpleITK.WriteImage(image, str(second))
    if stylet.read(found, "compare", path, second, "--threshold", 10, "--json", figures) is None:
        return
    told = json.loads(figures.read_text())
    grid = np.stack(np.meshgrid(*map(np.arange, frame.size), indexing="ij"), axis=-1).reshape(-1, 3)
    at = (frame.places(grid) - moved.origin) @ np.linalg.inv(moved.steps).T
    at[np.abs(at - np.rint(at)) < 1e-9] = np.rint(at[np.abs(at - np.rint(at)) < 1e-9])
    inside = np.all((at >= 0) & (at <= np.array(moved.size) - 1), axis=1) & (dose.ravel() >= 0.1 * dose.max())
    theirs = RegularGridInterpolator(list(map(np.arange, moved.size)), dose * 1.01)(at[inside])
    between = theirs - dose.ravel()[inside]
    expected = {"mean_gy": between.mean(), "root_mean_square_gy": np.sqrt((between**2).mean()), "largest_gy": np.abs(between).max()}
    for name, value in expected.items():
        found.compare("difference of two: share", abs(abs(told[name]) - abs(value)) / np.abs(dose).max(), GY)


def again(stylet, found, root, path, frame, dose):
    """What `convert` writes as RT Dose, read by pydicom."""
    out = root / (found.name + " again.dcm")
    done, _, messages = stylet("convert", path, out)
    if not done:
        found.fail("not written again: " + messages[-160:])
        return
    theirs, values = by_pydicom(out)
    found.compare("written again: mm", common.far(frame, theirs), MM)
    here, off = common.values_at(frame, dose, theirs)
    if here is None:
        found.fail("written again on another grid")
        return
    found.compare("written again: share", np.max(np.abs(values - here)) / np.abs(dose).max(), GY)


def run(stylet, rng, root):
    for n, variant in enumerate(VARIANTS):
        yield check(stylet, rng, root, n, variant)
