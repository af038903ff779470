"""Writes label volumes with other people's programs (SimpleITK, pynrrd), and what they hold as those programs read it.

python3 make_labels.py FOLDER; needs SimpleITK and pynrrd from PyPI. The files are kept beside this script in labels/.
"""
import csv, pathlib, sys
import numpy as np, nrrd, SimpleITK as sitk

out = pathlib.Path(sys.argv[1]); out.mkdir(exist_ok=True)
rng = np.random.default_rng(6)
shape, spacing, origin = (7, 6, 5), np.array([0.7, 0.9, 2.5]), np.array([-31.0, 12.5, 48.25])
labels = rng.choice([0, 0, 0, 1, 2, 7], size=shape).astype(np.uint8)  # [x, y, z]

def turn(axis, angle):
    c, s = np.cos(angle), np.sin(angle); r = np.eye(3); i, j = [k for k in range(3) if k != axis]
    r[i, i], r[i, j], r[j, i], r[j, j] = c, -s, s, c
    return r

direction = turn(0, 0.3) @ turn(1, -0.4) @ turn(2, 0.7)
mirrored = direction @ np.diag([1, -1, 1])

def image(dtype, direction=direction):
    i = sitk.GetImageFromArray(labels.astype(dtype).transpose(2, 1, 0))
    i.SetSpacing(spacing); i.SetOrigin(origin); i.SetDirection(direction.ravel())
    return i

def by_itk(name, dtype, packed, direction=direction):
    sitk.WriteImage(image(dtype, direction), str(out / name), useCompression=packed)

by_itk("itk_u8_gzip.nrrd", np.uint8, True)
by_itk("itk_i16_raw.nrrd", np.int16, False)
by_itk("itk_mirrored.nrrd", np.uint8, True, mirrored)
by_itk("itk_detached_nrrd.nhdr", np.uint16, False)
by_itk("itk_u8_zlib.mha", np.uint8, True)
by_itk("itk_i32_raw.mha", np.int32, False)
by_itk("itk_f32_zlib.mha", np.float32, True)
by_itk("itk_mirrored.mha", np.uint8, True, mirrored)
by_itk("itk_detached.mhd", np.int64, False)
by_itk("itk_detached_zlib.mhd", np.uint16, True)
by_itk("itk_u8.nii.gz", np.uint8, True)
by_itk("itk_i16.nii", np.int16, False)

def by_pynrrd(name, dtype, flip, space, **more):
    header = {"space": space, "space directions": (np.diag(flip) @ direction @ np.diag(spacing)).T,
              "space origin": np.diag(flip) @ origin, "kinds": ["domain"] * 3, **more}
    nrrd.write(str(out / name), labels.astype(dtype), header, compression_level=9)

ras, las = [-1, -1, 1], [1, -1, 1]
by_pynrrd("pynrrd_ras_ascii.nrrd", np.uint8, ras, "right-anterior-superior", encoding="ascii")
by_pynrrd("pynrrd_las_big.nrrd", ">i2", las, "left-anterior-superior", encoding="raw", endian="big")
by_pynrrd("pynrrd_lps_u64.nrrd", np.uint64, [1, 1, 1], "LPS", encoding="gzip")
by_pynrrd("pynrrd_detached.nhdr", np.int32, [1, 1, 1], "left-posterior-superior", encoding="gzip")
nrrd.write(str(out / "pynrrd_spacings.nrrd"), labels, {"spacings": spacing, "encoding": "raw"})

# As Slicer keeps a segmentation: two layers, the list first, and a segment inside of another.
inner = np.zeros(shape, np.uint8); inner[2:5, 2:4, 1:4] = 1
outer = np.zeros(shape, np.uint8); outer[1:6, 1:5, 0:5] = 1; outer[6, 5, 4] = 2
steps = [[np.nan] * 3] + list((direction @ np.diag(spacing)).T)
segments = {"Segment0_ID": "Segment_1", "Segment0_Name": "Prostate", "Segment0_LabelValue": "1", "Segment0_Layer": "0",
            "Segment1_ID": "Segment_2", "Segment1_Name": "Rectum", "Segment1_LabelValue": "2", "Segment1_Layer": "0",
            "Segment2_ID": "Segment_3", "Segment2_Name": "Urethra", "Segment2_LabelValue": "1", "Segment2_Layer": "1"}
nrrd.write(str(out / "layers.seg.nrrd"), np.stack([outer, inner]), {
    "space": "left-posterior-superior", "space directions": np.array(steps), "space origin": origin,
    "kinds": ["list", "domain", "domain", "domain"], **segments})
flat = np.where(inner > 0, 3, outer).astype(np.uint8)

def place(values, value):
    return (direction @ (np.argwhere(values == value) * spacing).T).T + origin

with open(out / "expected.csv", "w") as f:
    table = csv.writer(f); table.writerow(["file", "label", "voxels", "x_ras_mm", "y_ras_mm", "z_ras_mm"])
    def tell(name, label, points):
        x, y, z = points.mean(axis=0); table.writerow([name, label, len(points), -x, -y, z])
    for name in sorted(p.name for p in out.iterdir()):
        if name in ("layers.seg.nrrd", "pynrrd_spacings.nrrd") or name.endswith((".raw", ".raw.gz", ".zraw", ".csv")):
            continue
        # ITK reads what pynrrd wrote too.
        read = sitk.ReadImage(str(out / name)); values = sitk.GetArrayFromImage(read).transpose(2, 1, 0)
        for label in (1, 2, 7):
            points = np.array([read.TransformIndexToPhysicalPoint([int(i) for i in v]) for v in np.argwhere(values == label)])
            tell(name, label, points)
    for label in (1, 2, 3):
        tell("layers.seg.nrrd", label, place(flat, label))
