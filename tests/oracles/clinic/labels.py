"""Label volumes as NRRD, NIfTI-1 and MetaImage: voxels and places beside ITK, nibabel and pynrrd; and what is written again."""
import gzip
import zlib

import nibabel
import nrrd
import numpy as np

import common
import structures
from common import MM, VOLUME, Frame, Object

NRRD = {
    "raw": {}, "gzip": {"encoding": "gzip"}, "ascii": {"encoding": "ascii"}, "big endian": {"endian": "big", "type": "int16"},
    "int8": {"type": "int8"}, "uint32, gzip": {"type": "uint32", "encoding": "gzip"}, "int64": {"type": "int64"}, "float": {"type": "float"},
    "double, big endian": {"type": "double", "endian": "big"}, "RAS": {"space": "RAS"}, "LAS": {"space": "left-anterior-superior"},
    "left-handed": {"mirror": True}, "left-handed, RAS": {"mirror": True, "space": "right-anterior-superior"}, "detached": {"detached": True},
    "detached, gzip, line skip": {"detached": True, "encoding": "gzip", "skip": "line"}, "byte skip": {"detached": True, "skip": "byte"},
    "byte skip to the end": {"detached": True, "skip": "end"}, "hex": {"encoding": "hex"}, "in cm": {"units": "cm"}, "layers": {"layers": True},
}
NIFTI = {
    "uint8, gzip": {"gz": True}, "int16, big endian": {"type": "int16", "endian": ">"}, "float32": {"type": "float32"},
    "float64, big endian, gzip": {"type": "float64", "endian": ">", "gz": True}, "uint16": {"type": "uint16"}, "int32": {"type": "int32"},
    "int64": {"type": "int64"}, "qform alone": {"form": "q"}, "sform alone": {"form": "s"}, "neither form": {"form": ""},
    "qform, left-handed": {"form": "q", "mirror": True}, "sform, left-handed": {"form": "s", "mirror": True}, "slope and intercept": {"slope": (0.5, -2.0), "type": "int16"},
    "in metres": {"units": 1, "scale": 1e-3}, "in micrometres": {"units": 3, "scale": 1e3}, "fourth dimension of 1": {"four": True},
    "extension": {"extension": True}, "no unit": {"units": 0}, "offset of 1024 bytes": {"offset": 1024}, "sform and qform differ": {"differ": True},
}
META = {
    "raw": {}, "zlib": {"zlib": True}, "text": {"text": True}, "big endian": {"type": "MET_SHORT", "msb": True}, "MET_LONG": {"type": "MET_LONG"},
    "MET_DOUBLE, zlib": {"type": "MET_DOUBLE", "zlib": True}, "MET_FLOAT, big endian": {"type": "MET_FLOAT", "msb": True},
    "detached": {"detached": True}, "detached, zlib": {"detached": True, "zlib": True}, "detached, header skipped": {"detached": True, "skip": -1},
    "other names of its fields": {"names": True}, "left-handed": {"mirror": True}, "MET_CHAR": {"type": "MET_CHAR"}, "letters alone": {"letters": "LPI"},
    "centre of rotation": {"centre": True}, "MET_LONG_LONG": {"type": "MET_LONG_LONG"},
}
MET = {"MET_UCHAR": "u1", "MET_CHAR": "i1", "MET_SHORT": "i2", "MET_LONG": "i4", "MET_UINT": "u4", "MET_FLOAT": "f4", "MET_DOUBLE": "f8", "MET_LONG_LONG": "i8"}


def volume(rng, mirror):
    """Frame and labels: two ellipsoids and a ball."""
    size = tuple(rng.integers(26, 40, 3))
    axes = common.rotation(rng, bool(rng.integers(4)))
    if mirror:
        axes = axes * [-1, 1, 1]
    frame = Frame(size, axes, np.round(rng.uniform(0.6, 2.2, 3), 4), np.round(rng.uniform(-90, 90, 3), 3))
    grid = np.stack(np.meshgrid(*map(np.arange, size), indexing="ij"), axis=-1) / np.array(size)
    labels = np.zeros(size, "u1")
    for label, at, half in ((1, (0.45, 0.5, 0.5), (0.35, 0.3, 0.4)), (2, (0.6, 0.5, 0.5), (0.1, 0.15, 0.3)), (7, (0.2, 0.8, 0.3), (0.12, 0.1, 0.15))):
        labels[(((grid - at) / half) ** 2).sum(axis=-1) <= 1] = label
    return frame, labels


def as_nrrd(path, frame, labels, how):
    """Writes the header by hand, because pynrrd writes no more than one way of each."""
    space = how.get("space", "left-posterior-superior")
    sign = {"l": [1, 1, 1], "R": [-1, -1, 1], "r": [-1, -1, 1]}[space[0]] if space != "left-anterior-superior" else [1, -1, 1]
    steps, origin = (frame.steps.T * sign) / (10 if "units" in how else 1), frame.origin * sign / (10 if "units" in how else 1)
    dtype = np.dtype({"float": "f4", "double": "f8"}.get(how.get("type"), how.get("type", "uint8"))).newbyteorder(">" if how.get("endian") == "big" else "<")
    values = labels.astype(dtype)
    vectors = ["({})".format(",".join(f"{v:.17g}" for v in step)) for step in steps]
    sizes, kinds, pairs = list(frame.size), ["domain"] * 3, ""
    if how.get("layers"):  # Slicer's: the segments 1 and 7 in layers that overlap
        values = np.stack([(labels == 1) | (labels == 2), (labels == 7) | (labels == 2)]).astype(dtype)
        vectors, sizes, kinds = ["none"] + vectors, [2] + sizes, ["list"] + kinds
        for n, name in enumerate(("Prostate", "Rectum")):
            pairs += f"Segment{n}_ID:=Segment_{n}\nSegment{n}_Name:={name}\nSegment{n}_LabelValue:=1\nSegment{n}_Layer:={n}\n"
    data = values.tobytes("F")
    encoding = how.get("encoding", "raw")
    if encoding == "gzip":
        data = gzip.compress(data)
    elif encoding == "ascii":
        data = "\n".join(str(v) for v in values.ravel("F")).encode() + b"\n"
    elif encoding == "hex":
        data = data.hex().encode()
    header = f"NRRD0005\n# made by hand\ntype: {how.get('type', 'uint8')}\ndimension: {len(sizes)}\nspace: {space}\nsizes: {' '.join(map(str, sizes))}\n"
    header += f"space directions: {' '.join(vectors)}\nkinds: {' '.join(kinds)}\nencoding: {encoding}\nspace origin: ({','.join(f'{v:.17g}' for v in origin)})\n"
    if dtype.itemsize > 1 or encoding in ("gzip", "hex"):
        header += f"endian: {how.get('endian', 'little')}\n"
    if "units" in how:
        header += 'space units: "cm" "cm" "cm"\n'
    before = {"line": b"first line\nsecond line\n", "byte": b"12345", "end": b"any header\0"}.get(how.get("skip"), b"")
    header += {"line": "line skip: 2\n", "byte": "byte skip: 5\n", "end": "byte skip: -1\n"}.get(how.get("skip"), "")
    if how.get("detached"):
        path = path.with_suffix(".nhdr")
        file = path.with_suffix(".raw.gz" if encoding == "gzip" else ".raw")
        file.write_bytes(before + data)
        path.write_text(header + f"data file: {file.name}\n")
    else:
        path.write_bytes((header + pairs + "\n").encode() + data)
    return path


def as_nifti(path, frame, labels, how):
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = common.RAS @ frame.steps, common.RAS @ frame.origin
    affine[:3] *= how.get("scale", 1)
    slope, intercept = how.get("slope", (1.0, 0.0))
    stored = np.rint((labels - intercept) / slope).astype(how.get("type", "uint8"))
    if how.get("four"):
        stored = stored[..., None]
    image = nibabel.Nifti1Image(stored, affine, nibabel.Nifti1Header(endianness=how.get("endian", "<")))
    header, form = image.header, how.get("form", "sq")
    header.set_data_dtype(how.get("type", "uint8"))
    image.set_sform(affine, 1 if "s" in form else 0)
    turned = affine.copy()
    if how.get("differ"):
        turned[:3, 3] += 2.0
    image.set_qform(turned, 1 if "q" in form else 0)
    header["xyzt_units"] = how.get("units", 2)
    if how.get("extension"):
        header.extensions.append(nibabel.nifti1.Nifti1Extension("comment", b"an extension of the header"))
    if how.get("offset"):
        header["vox_offset"] = how["offset"]
    if how.get("slope"):
        header.set_slope_inter(slope, intercept)
    path = path.with_suffix(".nii.gz" if how.get("gz") else ".nii")
    if not how.get("slope"):
        image.to_filename(path)
        return path
    with open(path, "wb") as file:  # nibabel's own writer chooses the slope anew
        header["magic"], header["vox_offset"] = b"n+1", 352
        header["scl_slope"], header["scl_inter"] = slope, intercept
        header.set_data_shape(stored.shape)
        file.write(header.binaryblock + b"\0" * 4 + stored.tobytes("F"))
    return path


def as_meta(path, frame, labels, how):
    kind = how.get("type", "MET_UCHAR")
    data = labels.astype((">" if how.get("msb") else "<") + MET[kind]).tobytes("F")
    if how.get("text"):
        data = " ".join(str(v) for v in labels.ravel("F")).encode() + b"\n"
    if how.get("zlib"):
        data = zlib.compress(data)
    numbers = lambda values: " ".join(f"{v:.17g}" for v in values)
    matrix, offset, spacing = ("Orientation", "Position", "ElementSpacing") if how.get("names") else ("TransformMatrix", "Offset", "ElementSpacing")
    lines = ["ObjectType = Image", "NDims = 3", f"BinaryData = {not how.get('text')}", f"BinaryDataByteOrderMSB = {bool(how.get('msb'))}"]
    lines += [f"CompressedData = {bool(how.get('zlib'))}"] + ([f"CompressedDataSize = {len(data)}"] if how.get("zlib") else [])
    lines += [f"AnatomicalOrientation = {how['letters']}" if "letters" in how else f"{matrix} = {numbers(frame.directions.T.ravel())}", f"{offset} = {numbers(frame.origin)}"]
    lines += [f"CenterOfRotation = {'10 20 30' if how.get('centre') else '0 0 0'}", f"{spacing} = {numbers(frame.spacing)}"]
    lines += [f"DimSize = {' '.join(map(str, frame.size))}"] + ([f"HeaderSize = {how['skip']}"] if "skip" in how else [])
    lines += [f"ElementType = {kind}"]
    if how.get("detached"):
        path = path.with_suffix(".mhd")
        file = path.with_suffix(".zraw" if how.get("zlib") else ".raw")
        file.write_bytes((b"some header" if "skip" in how else b"") + data)
        path.write_text("\n".join(lines + [f"ElementDataFile = {file.name}\n"]))
    else:
        path.write_bytes("\n".join(lines + ["ElementDataFile = LOCAL\n"]).encode() + data)
    return path


def second(found, path, kind, how, frame, labels):
    """Frame and labels by the other programs, which must agree with what was meant to be written."""
    if kind == "NIfTI":
        image = nibabel.load(path)
        unit = {1: 1e3, 3: 1e-3}.get(how.get("units"), 1)
        affine = image.affine * unit
        values = np.asarray(image.dataobj).reshape(frame.size)
        if how.get("form") == "":  # nibabel puts the middle of such a volume at 0; the standard (method 1) gives spacing alone
            affine = np.diag([*image.header.get_zooms()[:3], 1]) * unit
        steps = common.RAS @ affine[:3, :3]
        spacing = np.linalg.norm(steps, axis=0)
        theirs = Frame(frame.size, steps / spacing, spacing, common.RAS @ affine[:3, 3])
        if how.get("form") != "":  # numbers of a header are of single precision
            found.compare("nibabel: mm", common.far(theirs, frame), 0.005)
        itk = None if how.get("form") == "" else common.itk_read(path)
    elif kind == "NRRD":
        itk = None
        if not how.get("layers"):
            values, header = nrrd.read(str(path)) if how.get("encoding") != "hex" else (labels, None)
            itk = common.itk_read(path)
            if header is not None and "units" not in how:
                sign = {"right": [-1, -1, 1], "RAS": [-1, -1, 1], "left-anterior-superior": [1, -1, 1]}
                turn = next((s for name, s in sign.items() if header["space"].startswith(name)), [1, 1, 1])
                found.compare("pynrrd: mm", np.abs(header["space directions"] * turn - frame.steps.T).max(), MM)
        else:
            values = labels
        theirs = frame
    else:
        theirs, values = itk = common.itk_read(path)
        if "letters" in how:  # ITK leaves them out
            return frame
    found.compare("voxels of the others", np.count_nonzero(values != labels), 0)
    if itk is not None and "units" not in how:  # ITK leaves units of NRRD out, and reads those of NIfTI
        found.compare("ITK: mm", common.far(itk[0], frame), 0.01)
        found.compare("voxels of ITK", np.count_nonzero(itk[1].reshape(frame.size) != labels), 0)
    return theirs


def check(stylet, rng, root, kind, n, variant, how):
    found = Object(kind, f"{kind}{n:02}", variant)
    frame, labels = volume(rng, how.get("mirror"))
    found.must_refuse = how.get("encoding") == "hex"
    found.may_refuse = "letters" in how
    if found.may_refuse:  # the sides at which the axes begin, as ITK writes them; MetaIO's own page says where they end
        frame.directions = np.diag([-1.0, -1.0, 1.0])
    write = {"NRRD": as_nrrd, "NIfTI": as_nifti, "MetaImage": as_meta}[kind]
    path = write(root / f"{found.name}{'.nrrd' if kind == 'NRRD' else '.mha' if kind == 'MetaImage' else '.nii'}", frame, labels, how)
    theirs = second(found, path, kind, how, frame, labels)
    out = root / (found.name + " read.nrrd")
    if stylet.read(found, "convert", path, out) is None:
        return found
    grid, told = common.itk_read(out)
    if how.get("layers"):  # the smaller structure has the voxels of both
        expected = np.where((labels == 7) | (labels == 2), 2, np.where(labels == 1, 1, 0))
    else:
        expected = labels
    found.compare("mm", common.far(theirs, grid), MM)
    here, off = common.values_at(theirs, expected, grid)
    found.compare("voxels: mm", off, 2 * MM)
    found.compare("voxels", np.inf if here is None else np.count_nonzero(here != told), 0)
    if "differ" in how and "differ" not in found.notes:
        found.fail("two orientations without a note")
    both = [(labels == 1) | (labels == 2), (labels == 7) | (labels == 2)]  # outlines have all of each layer
    bodies = both if how.get("layers") else [labels == label for label in (1, 2, 7)]
    if "letters" in how and "AnatomicalOrientation" not in found.notes:
        found.fail("axes by AnatomicalOrientation alone, which readers take differently, without a note")
    again(stylet, found, root, path, theirs, expected, bodies)
    return found


def again(stylet, found, root, path, frame, labels, bodies):
    """Every format that is written, by the other programs."""
    base = root / found.name
    for suffix in (".mha", ".nii.gz", ".seg.nrrd"):
        out = base.with_name(f"{found.name} again{suffix}")
        done, _, messages = stylet("convert", path, out)
        if not done:
            found.fail("not written again: " + messages[-160:])
            continue
        grid, values = common.itk_read(out)
        found.compare("written again: mm", common.far(frame, grid), 0.01 if suffix == ".nii.gz" else MM)
        here, _ = common.values_at(frame, labels, grid)
        found.compare("written again: voxels", np.inf if here is None else np.count_nonzero(here != values), 0)
    out = base.with_name(f"{found.name} again.dcm")
    done, _, messages = stylet("convert", path, out)
    if not done:
        found.fail("not written again: " + messages[-160:])
        return
    voxel_cc = np.prod(frame.spacing) / 1000
    sizes = sorted(np.count_nonzero(body) * voxel_cc for body in bodies)
    drawn = sorted(map(structures.volume_cc, structures.by_pydicom(out).values()))
    found.compare("outlines written: share of the volume", max(abs(np.array(drawn) / sizes - 1)) if len(drawn) == len(sizes) else np.inf, VOLUME)


def run(stylet, rng, root):
    for kind, all_of in (("NRRD", NRRD), ("NIfTI", NIFTI), ("MetaImage", META)):
        for n, (variant, how) in enumerate(all_of.items()):
            yield check(stylet, rng, root, kind, n, variant, how)
