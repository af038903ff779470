"""Compressed CT and doses: each transfer syntax by the encoders of pydicom and GDCM, against the same object uncompressed."""
import json
import shutil

import gdcm
import numpy as np
import pydicom
from pydicom.uid import JPEG2000, JPEG2000Lossless, JPEGBaseline8Bit, JPEGLossless, JPEGLosslessSV1, JPEGLSLossless, JPEGLSNearLossless, RLELossless

import common
import images
from common import Object

HTJ2K = "1.2.840.10008.1.2.4.201"
# Encoder of each transfer syntax, and whether the values stay.
SYNTAXES = {
    "RLE": (RLELossless, "pydicom", True), "JPEG-LS": (JPEGLSLossless, "pydicom", True), "JPEG 2000": (JPEG2000Lossless, "pydicom", True),
    "RLE, GDCM": (RLELossless, "gdcm", True), "JPEG-LS, GDCM": (JPEGLSLossless, "gdcm", True), "JPEG 2000, GDCM": (JPEG2000Lossless, "gdcm", True),
    "JPEG lossless, GDCM": (JPEGLosslessSV1, "gdcm", True), "JPEG lossless, any predictor, GDCM": (JPEGLossless, "gdcm", True),
    "JPEG 2000 with loss": (JPEG2000, "pydicom", False), "JPEG-LS near-lossless": (JPEGLSNearLossless, "pydicom", False),
}
# Storage of the values: bits of a pixel, bits that count, sign.
STORAGE = {"16 bits, sign": (16, 16, 1), "16 bits": (16, 16, 0), "12 of 16 bits": (16, 12, 0), "12 of 16 bits, sign": (16, 12, 1)}


def series(rng, folder, storage):
    """Writes a small CT with five seeds; returns its files."""
    bits, stored, sign = STORAGE[storage]
    frame, values, _ = images.make(rng, folder, "CT", "axial")
    for path in sorted(folder.iterdir()):
        ds = pydicom.dcmread(path)
        raw = np.frombuffer(ds.PixelData, "<i2" if ds.PixelRepresentation else "<u2").astype(int) + int(ds.RescaleIntercept)
        intercept = 0 if sign else -1024
        low, high = (-(1 << stored - 1), (1 << stored - 1) - 1) if sign else (0, (1 << stored) - 1)
        raw = (raw - intercept).clip(low, high)
        ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = bits, stored, stored - 1, sign
        ds.RescaleIntercept = str(intercept)
        ds.PixelData = raw.astype("<i2" if sign else "<u2").tobytes()
        ds["PixelData"].VR = "OW"
        ds.save_as(path)
    return frame


def compress(path, out, syntax, encoder):
    if encoder == "gdcm":
        reader = gdcm.ImageReader()
        reader.SetFileName(str(path))
        if not reader.Read():
            raise ValueError("GDCM cannot read its input")
        change = gdcm.ImageChangeTransferSyntax()
        kinds = {RLELossless: gdcm.TransferSyntax.RLELossless, JPEGLSLossless: gdcm.TransferSyntax.JPEGLSLossless,
                 JPEG2000Lossless: gdcm.TransferSyntax.JPEG2000Lossless, JPEGLosslessSV1: gdcm.TransferSyntax.JPEGLosslessProcess14_1,
                 JPEGLossless: gdcm.TransferSyntax.JPEGLosslessProcess14}
        change.SetTransferSyntax(gdcm.TransferSyntax(kinds[syntax]))
        change.SetInput(reader.GetImage())
        if not change.Change():
            raise ValueError("GDCM cannot compress it")
        writer = gdcm.ImageWriter()
        writer.SetFileName(str(out))
        writer.SetFile(reader.GetFile())
        writer.SetImage(change.GetOutput())
        if not writer.Write():
            raise ValueError("GDCM cannot write it")
        return
    ds = pydicom.dcmread(path)
    options = {JPEG2000: {"j2k_cr": [8]}, JPEGLSNearLossless: {"jls_error": 2}}.get(syntax, {})
    ds.compress(syntax, generate_instance_uid=False, **options)
    if syntax in (JPEG2000, JPEGLSNearLossless):
        ds.LossyImageCompression = "01"
    ds.save_as(out)


def check(stylet, rng, root, n, variant, storage):
    found = Object("compressed CT", f"COMP{n:02}", f"{variant}, {storage}")
    syntax, encoder, is_lossless = SYNTAXES[variant]
    folder = root / found.name
    series(rng, folder, storage)
    packed, plain = root / f"{found.name} packed", root / f"{found.name} plain"
    packed.mkdir()
    for path in sorted(folder.iterdir()):
        compress(path, packed / path.name, syntax, encoder)
    # By pydicom: what the compressed files hold, without compression.
    shutil.copytree(folder, plain)
    for path in sorted(packed.iterdir()):
        ds, whole = pydicom.dcmread(path), pydicom.dcmread(plain / path.name)
        assert ds.file_meta.TransferSyntaxUID == syntax
        values = ds.pixel_array
        if is_lossless and not np.array_equal(values, whole.pixel_array):
            found.fail("the encoder changed the values")
        whole.PixelData = values.astype("<i2" if whole.PixelRepresentation else "<u2").tobytes()
        whole.save_as(plain / path.name)
    results = []
    for images_of in (packed, plain):
        out = root / f"{found.name} found {images_of.name.split()[-1]}"
        if stylet.read(found, "find-seeds", images_of, "--count", 5, "--out", out) is None:
            return found
        results.append((images.table(out), json.loads((out / "found.json").read_text())))
    if not is_lossless and "LossyImageCompression" not in found.notes:
        found.fail("loss without a note")
    (ours, our_levels), (theirs, their_levels) = results
    found.compare("seeds: mm", np.abs(ours - theirs).max() if ours.shape == theirs.shape else np.inf, 0 if is_lossless else 0.05)
    numbers = [[v for v in levels.values() if isinstance(v, float)] for levels in (our_levels, their_levels)]
    found.compare("levels in HU", np.abs(np.subtract(*numbers)).max(), 0 if is_lossless else 1)
    return found


def dose(stylet, rng, root, n, variant, bits):
    """A dose of several frames in one file: every value of the NRRD that Stylet writes."""
    found = Object("compressed RT Dose", f"COMP{n:02}", f"{variant}, {bits} bits")
    ds = common.dicom(common.DOSE, "RTDOSE", found.name)
    counts = (41, 35, 7)
    values = np.rint(rng.random(counts) ** 4 * 60000 + 5).astype(f"<u{bits // 8}")
    values[:, :6] = 17  # runs
    ds.Columns, ds.Rows, ds.NumberOfFrames = counts
    ds.SamplesPerPixel, ds.PhotometricInterpretation, ds.PixelRepresentation = 1, "MONOCHROME2", 0
    ds.BitsAllocated, ds.BitsStored, ds.HighBit = bits, bits, bits - 1
    ds.ImagePositionPatient, ds.ImageOrientationPatient, ds.PixelSpacing = [-20, -15, 30], [1, 0, 0, 0, 1, 0], [1.5, 1.25]
    ds.FrameIncrementPointer, ds.GridFrameOffsetVector = 0x3004000C, [2.5 * k for k in range(counts[2])]
    ds.DoseUnits, ds.DoseType, ds.DoseSummationType, ds.DoseGridScaling = "GY", "PHYSICAL", "PLAN", "0.0025"
    ds.PixelData = values.transpose(2, 1, 0).tobytes()
    ds["PixelData"].VR = "OW"
    plain, packed = root / f"{found.name} plain.dcm", root / f"{found.name}.dcm"
    common.save(plain, ds)
    compress(plain, packed, *SYNTAXES[variant][:2])
    out = root / f"{found.name}.nrrd"
    if stylet.read(found, "convert", packed, out) is not None:
        frame, told = common.itk_read(out)
        expected = common.Frame(counts, np.eye(3), np.array([1.25, 1.5, 2.5]), np.array([-20.0, -15.0, 30.0]))
        here, off = common.values_at(expected, values * 0.0025, frame)
        found.compare("voxels: mm", off, common.MM)
        found.compare("Gy", np.inf if here is None else np.abs(here - told).max(), 1e-12)
    return found


def run(stylet, rng, root):
    n = 0
    for variant in SYNTAXES:
        for storage in STORAGE:
            yield check(stylet, rng, root, n, variant, storage)
            n += 1
    for variant, bits in (("RLE", 16), ("JPEG-LS", 16), ("JPEG 2000", 16)):
        yield dose(stylet, rng, root, n, variant, bits)
        n += 1
    found = Object("compressed CT", f"COMP{n:02}", "HTJ2K", must_refuse=True)
    series(rng, root / found.name, "16 bits")
    for path in sorted((root / found.name).iterdir()):
        ds = pydicom.dcmread(path)
        ds.PixelData = pydicom.encaps.encapsulate([b"\xff\x4f\xff\x51" + bytes(100)])
        ds["PixelData"].VR, ds["PixelData"].is_undefined_length = "OB", True
        ds.file_meta.TransferSyntaxUID = HTJ2K
        ds.save_as(path)
    stylet.read(found, "find-seeds", root / found.name, "--out", root / (found.name + " found"))
    if HTJ2K not in found.refused:
        found.fail("the refusal does not name the transfer syntax: " + found.refused)
    yield found
