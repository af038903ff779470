"""DICOM Segmentations: those of highdicom read by Stylet, and those of Stylet read by highdicom and dciodvfy, voxel by voxel."""
import subprocess

import highdicom
import numpy as np
import pydicom
from pydicom.sr.codedict import codes
from pydicom.uid import ExplicitVRLittleEndian, JPEG2000Lossless, JPEGLSLossless, RLELossless

import common
from common import CT, MM, Frame, Object, dicom, ds16

# What each body is called, and its code; the third overlaps the first.
BODIES = [("Prostate", codes.SCT.Prostate), ("Rectum", codes.SCT.Rectum), ("Urethra", codes.SCT.Urethra)]
VARIANTS = {
    "bits": {}, "bits, oblique": {"oblique": True}, "bits, frames in disorder": {"disorder": True, "oblique": True},
    "bits, with empty frames": {"keep": True}, "bits, overlap": {"overlap": True}, "bits, overlap, oblique": {"overlap": True, "oblique": True},
    "bits, left-handed": {"mirror": True}, "bits, odd size": {"odd": True}, "bits, labels of a program": {"labels": True},
    "one plane": {"planes": 1}, "planes without a structure": {"gap": True}, "without distance of planes": {"no distance": True},
    "probability": {"kind": "FRACTIONAL"}, "occupancy, RLE": {"kind": "FRACTIONAL", "syntax": RLELossless, "type": "OCCUPANCY"},
    "probability, JPEG 2000": {"kind": "FRACTIONAL", "syntax": JPEG2000Lossless, "large": True},
    "probability, JPEG-LS": {"kind": "FRACTIONAL", "syntax": JPEGLSLossless},
    "label map": {"kind": "LABELMAP"}, "label map, RLE": {"kind": "LABELMAP", "syntax": RLELossless},
    "label map, JPEG-LS": {"kind": "LABELMAP", "syntax": JPEGLSLossless, "oblique": True},
    "a segment of no description": {"unknown": True}, "distance against positions": {"wrong distance": True},
}
REFUSED = ["a segment of no description", "distance against positions"]


def volume(rng, how):
    """Frame and masks (x first) of the bodies, which are apart or overlap; a plane between them is empty if there is a gap."""
    size = (int(rng.integers(20, 27)), int(rng.integers(20, 27)), how.get("planes", int(rng.integers(10, 14))))
    if how.get("odd"):
        size = (23, 19, 11)
    if how.get("large"):  # OpenJPEG encodes no less by its usual levels
        size = (36, 33, 8)
    axes = common.rotation(rng, bool(how.get("oblique")))
    if how.get("mirror"):
        axes = axes * [1, 1, -1]
    frame = Frame(size, axes, np.round(rng.uniform(0.6, 2.4, 3), 4), np.round(rng.uniform(-90, 90, 3), 3))
    grid = np.stack(np.meshgrid(*map(np.arange, size), indexing="ij"), axis=-1) / np.array(size)
    masks = []
    for at, half in (((0.4, 0.5, 0.4), (0.3, 0.35, 0.35)), ((0.85, 0.5, 0.5), (0.12, 0.3, 0.45)), ((0.4, 0.5, 0.5), (0.06, 0.08, 0.5))):
        masks.append((((grid - at) / half) ** 2).sum(axis=-1) <= 1 if size[2] > 1 else (((grid - at) / half)[..., :2] ** 2).sum(axis=-1) <= 1)
    if not how.get("overlap"):
        masks[0] &= ~masks[2]
    if how.get("gap"):
        for mask in masks:
            mask[:, :, 4:7] = False
    return frame, masks


def images(folder, frame):
    """The series that a segmentation is of, as highdicom wants it."""
    for k in range(frame.size[2]):
        ds = dicom(CT, "CT", f"{folder.name} {k}")
        ds.SeriesInstanceUID = common.uid("series", folder.name)
        ds.StudyDate, ds.StudyTime, ds.PatientBirthDate = "20260101", "120000", "19500101"
        ds.ImagePositionPatient = [ds16(v) for v in frame.origin + k * frame.steps[:, 2]]
        ds.ImageOrientationPatient = [ds16(v) for v in (*frame.directions[:, 0], *frame.directions[:, 1])]
        ds.PixelSpacing, ds.SliceThickness = [ds16(frame.spacing[1]), ds16(frame.spacing[0])], ds16(frame.spacing[2])
        ds.Columns, ds.Rows = frame.size[0], frame.size[1]
        ds.InstanceNumber, ds.SamplesPerPixel, ds.PhotometricInterpretation = k + 1, 1, "MONOCHROME2"
        ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = 16, 16, 15, 0
        ds.PixelData = bytes(2 * frame.size[0] * frame.size[1])
        ds.file_meta = pydicom.dataset.FileMetaDataset()
        ds.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        yield ds


def described(number, how):
    name, code = BODIES[number]
    return highdicom.seg.SegmentDescription(
        segment_number=number + 1, segment_label=f"Segment_{number + 1}" if how.get("labels") else name,
        segmented_property_category=codes.SCT.AnatomicalStructure, segmented_property_type=code,
        algorithm_type=highdicom.seg.SegmentAlgorithmTypeValues.MANUAL)


def written_by_highdicom(path, rng, frame, masks, how):
    kind = how.get("kind", "BINARY")
    pixels = np.stack([mask.transpose(2, 1, 0) for mask in masks], axis=-1).astype("u1")
    if kind == "FRACTIONAL":  # inside from a half on, outside below
        inside, outside = rng.uniform(0.5, 1, pixels.shape), rng.uniform(0, 0.45, pixels.shape)
        pixels = np.where(pixels == 1, inside, outside * (rng.random(pixels.shape) < 0.3)).astype("f4")
    if kind == "LABELMAP":
        pixels = (pixels * np.arange(1, len(masks) + 1)).max(axis=-1).astype("u1")
    path.parent.mkdir(parents=True, exist_ok=True)
    seg = highdicom.seg.Segmentation(
        source_images=list(images(path.with_suffix(""), frame)), pixel_array=pixels, segmentation_type=kind,
        segment_descriptions=[described(n, how) for n in range(len(masks))], series_instance_uid=common.uid("seg", path.name), series_number=2,
        sop_instance_uid=common.uid("seg instance", path.name), instance_number=1, manufacturer="Second", manufacturer_model_name="reader",
        software_versions="1", device_serial_number="1", omit_empty_frames=not how.get("keep"), max_fractional_value=200,
        fractional_type=how.get("type", "PROBABILITY"), transfer_syntax_uid=how.get("syntax", ExplicitVRLittleEndian))
    measures = seg.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0]
    if how.get("no distance") and "SpacingBetweenSlices" in measures:
        del measures.SpacingBetweenSlices
    if how.get("wrong distance"):
        measures.SpacingBetweenSlices = ds16(frame.spacing[2] * 1.4)
    if how.get("unknown"):
        seg.PerFrameFunctionalGroupsSequence[3].SegmentIdentificationSequence[0].ReferencedSegmentNumber = 9
    if how.get("disorder"):
        order = rng.permutation(int(seg.NumberOfFrames))
        area = frame.size[0] * frame.size[1]
        bits = np.unpackbits(np.frombuffer(seg.PixelData, "u1"), bitorder="little")[: len(order) * area].reshape(-1, area)
        packed = np.packbits(bits[order].ravel(), bitorder="little").tobytes()
        seg.PixelData = packed + b"\0" * (len(packed) % 2)
        seg.PerFrameFunctionalGroupsSequence = [seg.PerFrameFunctionalGroupsSequence[n] for n in order]
    seg.save_as(path)
    return path


def by_highdicom(path):
    """Frame and masks (x first) of each segment, by its name."""
    seg = highdicom.seg.segread(path)
    volume = seg.get_volume(combine_segments=False, rescale_fractional=False)
    names = {d.segment_number: d.segment_label for d in (seg.get_segment_description(n) for n in seg.segment_numbers)}
    affine = volume.affine  # from (plane, row, column)
    steps = affine[:3, [2, 1, 0]]
    spacing = np.linalg.norm(steps, axis=0)
    masks = np.transpose(volume.array, (2, 1, 0, 3)) != 0
    frame = Frame(masks.shape[:3], steps / spacing, spacing, affine[:3, 3])
    return frame, {names[number]: masks[..., n] for n, number in enumerate(seg.segment_numbers)}


def labels_of(masks):
    """One label for each voxel: the smallest body has those that several share, as docs/formats.md says."""
    labels = np.zeros(masks[0].shape, "u1")
    for number in sorted(range(len(masks)), key=lambda n: -np.count_nonzero(masks[n])):
        labels[masks[number]] = number + 1
    return labels


def valid(found, path):
    """Lets dciodvfy look for what the standard forbids."""
    ran = subprocess.run(["dciodvfy", "-new", str(path)], capture_output=True, text=True, errors="replace")
    errors = [line for line in (ran.stderr + ran.stdout).splitlines() if line.startswith("Error")]
    if errors:
        found.fail(f"dciodvfy: {len(errors)} errors, the first: {errors[0][:120]}")


def check(stylet, rng, root, n, variant, how):
    found = Object("Segmentation", f"SEG{n:02}", variant)
    found.must_refuse = variant in REFUSED
    frame, masks = volume(rng, how)
    path = written_by_highdicom(root / f"{found.name}.dcm", rng, frame, masks, how)
    labels = root / f"{found.name} read.seg.nrrd"
    if stylet.read(found, "convert", path, labels) is None:
        return found
    grid, told = common.itk_read(labels)
    here, off = common.values_at(frame, labels_of(masks), grid)
    found.compare("voxels: mm", off, MM)
    found.compare("voxels", np.inf if here is None else np.count_nonzero(here != told), 0)
    found.compare("voxels beyond", abs(np.count_nonzero(told) - np.count_nonzero(labels_of(masks))), 0)
    header = labels.read_bytes().split(b"\n\n")[0].decode()
    for number, (name, _) in enumerate(BODIES):
        expected = f"{name} (Segment_{number + 1})" if how.get("labels") else name
        if f"_Name:={expected}\n" not in header:
            found.fail(f"{name} is not among the names")
    if how.get("kind") == "FRACTIONAL" and "fractional" not in found.notes:
        found.fail("fractions without a note")
    if how.get("overlap") and "overlap" not in found.notes:
        found.fail("an overlap without a note")
    again(stylet, found, root, path, frame, masks, how)
    return found


def again(stylet, found, root, path, frame, masks, how):
    """What Stylet writes of the segmentation itself, which keeps overlaps, and of the label map that it made of it."""
    alone = [mask & (labels_of(masks) == n + 1) for n, mask in enumerate(masks)]
    for source, expected in ((path, masks), (root / f"{found.name} read.seg.nrrd", alone)):
        out = root / f"{found.name} of {source.suffix[1:]}.seg.dcm"
        done, _, messages = stylet("convert", source, out, "--like", path)
        if not done:
            found.fail("not written again: " + messages[-160:])
            continue
        valid(found, out)
        grid, told = by_highdicom(out)
        for number, mask in enumerate(expected):
            name = f"{BODIES[number][0]} (Segment_{number + 1})" if how.get("labels") else BODIES[number][0]
            if name not in told:
                found.fail(f"written again: {name} is missing")
                continue
            here, off = common.values_at(frame, mask, grid)
            found.compare("written again: mm", off, MM)
            found.compare("written again: voxels", np.inf if here is None else np.count_nonzero(here != told[name]), 0)
            found.compare("written again: voxels beyond", abs(np.count_nonzero(mask) - np.count_nonzero(told[name])), 0)
        one, other = pydicom.dcmread(path, stop_before_pixels=True), pydicom.dcmread(out, stop_before_pixels=True)
        for tag in ("PatientID", "PatientName", "StudyInstanceUID", "FrameOfReferenceUID"):
            if one[tag].value != other[tag].value:
                found.fail(f"written again: another {tag}")


def run(stylet, rng, root):
    for n, (variant, how) in enumerate(VARIANTS.items()):
        yield check(stylet, rng, root, n, variant, how)
