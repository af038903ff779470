"""Twenty implants by Stylet and by other programs: dose by TG-43U1, histograms, gamma; differences and times.

`make python-beside` writes the rows into docs/measurements.md. With PYTG43, a checkout of github.com/livingag/pyTG43
(it is not on PyPI), its dose is among them.
"""

import os
import pathlib
import sys
import time
import tomllib
import types

import numpy as np
import pydicom
import pydicom.dicomio
import stylet
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence

pydicom.dicomio.read_file = pydicom.dcmread  # dicompyler-core 0.5.6 has the name that pydicom 3 dropped
from dicompylercore import dvhcalc  # noqa: E402

import pymedphys  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[3]
SOURCES = ("i125_6711", "pd103_200", "i125_iai125a")
CASES = 20
POINTS, GAMMA_MM = 200, 2.5
BEGIN, END = "<!-- rows of twenty implants -->\n", "<!-- end of the rows of twenty implants -->"


def timed(work):
    begun = time.perf_counter()
    done = work()
    return done, time.perf_counter() - begun


def begin(object_, kind):
    object_.SOPClassUID, object_.SOPInstanceUID = kind, pydicom.uid.generate_uid()
    object_.file_meta = meta = pydicom.dataset.FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = kind, object_.SOPInstanceUID
    meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian


class Implant:
    """An ellipsoid of 20 to 60 cc with seeds 10 mm apart, dropped 1 mm (across) and 3 mm (along) off their places; and
    dropped again, for gamma."""

    def __init__(self, number):
        random = np.random.default_rng(number)
        self.file = (ROOT / f"sources/{SOURCES[number % 3]}.toml").read_text()
        self.source = stylet.Source.parse(self.file)
        self.cc = random.uniform(20.0, 60.0)
        shape = np.array([1.15, 0.9, 1.0]) * random.uniform(0.95, 1.05, 3)
        self.half_mm = shape * (self.cc * 1000 * 3 / (4 * np.pi * shape.prod())) ** (1 / 3)
        away = np.arange(-40.0, 41.0, 10.0)
        planned = np.stack(np.meshgrid(away, away, away), -1).reshape(-1, 3) + random.uniform(-5.0, 5.0, 3)
        share = np.linalg.norm(planned / self.half_mm, axis=1)
        planned = planned[(share > 0.3) & (share < 1.0)]
        off = np.array([1.0, 1.0, 3.0])
        self.seeds_mm, self.again_mm = (planned + random.normal(0.0, off, planned.shape) for _ in range(2))
        self.axes = np.array([0.0, 0.0, 1.0]) + random.normal(0.0, 0.1, planned.shape) * [1.0, 1.0, 0.0]
        self.axes /= np.linalg.norm(self.axes, axis=1)[:, None]
        step_mm = 1.0
        self.low_mm = -np.ceil(self.half_mm) - 5.0
        self.shape = tuple(int(n) for n in -2 * self.low_mm / step_mm + 1)
        centres = np.stack(np.indices(self.shape), -1) * step_mm + self.low_mm
        inside = (np.linalg.norm(centres / self.half_mm, axis=-1) < 1.0).astype(np.uint8)
        scene = stylet.Scene.of_labels(inside, [step_mm] * 3, {1: {"name": "Prostate", "role": "target"}})
        points_mm, self.volumes_cc = scene.points()
        self.points_mm = scene.to_patient(points_mm) + self.low_mm
        # So that 90 % of the gland get the prescription.
        dose_gy = self.source.dose(self.points_mm, self.seeds_mm, 1.0, self.axes)
        self.strength_u = self.source.prescription_gy / stylet.Dvh(dose_gy, self.volumes_cc).metric("D90", 1.0)
        far = np.linalg.norm(self.points_mm[:, None] - self.seeds_mm, axis=2).min(axis=1) > 2.0
        self.few_mm = random.choice(self.points_mm[far], POINTS, replace=False)

    def grid_gy(self, seeds_mm, step_mm):
        shape = tuple(int(n) for n in -2 * self.low_mm / step_mm + 1)
        return self.source.dose_grid(self.low_mm, [step_mm] * 3, shape, seeds_mm, self.strength_u, self.axes)

    def dicom(self, dose_gy):
        """Returns contours of the gland in planes 1 mm apart, and the dose, as dicompyler-core takes them."""
        structures, contour, planes = Dataset(), Dataset(), Sequence()
        turn = np.linspace(0.0, 2 * np.pi, 180, endpoint=False)
        for z in np.arange(self.low_mm[2], -self.low_mm[2] + 0.5, 1.0):
            if abs(z) < self.half_mm[2]:
                across = np.sqrt(1 - (z / self.half_mm[2]) ** 2)
                x, y = (self.half_mm[a] * across * f(turn) for a, f in ((0, np.cos), (1, np.sin)))
                plane = Dataset()
                plane.ContourGeometricType = "CLOSED_PLANAR"
                plane.NumberOfContourPoints = len(turn)
                plane.ContourData = [f"{v:.4f}" for v in np.stack([x, y, np.full_like(x, z)], 1).ravel()]
                plane.ContourImageSequence = Sequence([Dataset()])
                plane.ContourImageSequence[0].ReferencedSOPInstanceUID = "1.2.3"
                planes.append(plane)
        begin(structures, pydicom.uid.RTStructureSetStorage)
        roi = Dataset()
        roi.ROINumber, roi.ROIName = 1, "Prostate"
        structures.StructureSetROISequence = Sequence([roi])
        contour.ReferencedROINumber, contour.ROIDisplayColor, contour.ContourSequence = 1, [255, 0, 0], planes
        structures.ROIContourSequence = Sequence([contour])
        dose = Dataset()
        begin(dose, pydicom.uid.RTDoseStorage)
        dose.Rows, dose.Columns, dose.NumberOfFrames = dose_gy.shape[1], dose_gy.shape[0], dose_gy.shape[2]
        dose.BitsAllocated = dose.BitsStored = 32
        dose.HighBit, dose.PixelRepresentation, dose.SamplesPerPixel = 31, 0, 1
        dose.PhotometricInterpretation = "MONOCHROME2"
        dose.PixelSpacing, dose.ImageOrientationPatient = [1.0, 1.0], [1, 0, 0, 0, 1, 0]
        dose.ImagePositionPatient = [float(mm) for mm in self.low_mm]
        dose.GridFrameOffsetVector = [float(n) for n in range(dose_gy.shape[2])]
        dose.DoseUnits, dose.DoseType, dose.DoseSummationType = "GY", "PHYSICAL", "PLAN"
        # dicompyler-core's bins are of 1 cGy, up to the largest dose: a seed's surface needs a bound.
        most_gy = 10 * self.source.prescription_gy
        dose.DoseGridScaling = float(f"{most_gy / 2**31:.8e}")
        pixels = np.minimum(dose_gy, 0.99 * most_gy).transpose(2, 1, 0) / float(dose.DoseGridScaling)
        dose.PixelData = np.ascontiguousarray(pixels).astype("<u4").tobytes()
        return structures, dose


def mirrored(table):
    """Returns F of TG-43 from 0 to 180 degrees, with the end values beyond the table: rows of theta, columns of r."""
    f, theta = np.array(table["F"]), np.array(table["theta_deg"], float)
    f, theta = np.hstack([f, f[:, -2::-1]]), np.concatenate([theta, 180.0 - theta[-2::-1]])
    f = np.vstack([f[:1], f, f[-1:]])
    f = np.hstack([f[:, :1], f, f[:, -1:]]).T
    return np.concatenate([[0.0], table["r_cm"], [100.0]]), np.concatenate([[-1.0], theta, [181.0]]), f


def of_pytg43(implant, program, own_interpolation):
    """Returns the doses at the few points by pyTG43, which gets our tables: its readers take HDR and PDR."""
    from scipy.interpolate import RegularGridInterpolator

    tables = tomllib.loads(implant.file)
    about, source = tables["source"], object.__new__(program.Source)
    source.L, source.Delta, source.Sk = about["active_length_cm"], about["dose_rate_constant"], implant.strength_u
    source.G0 = 2 * np.arctan(source.L / 2) / source.L
    r, theta, f = mirrored(tables["anisotropy_2d"])
    source.Fi = program.bilinearinterp(list(r), list(theta), f)
    if not own_interpolation:
        table = RegularGridInterpolator((theta, r), f)
        source.Fi = lambda r_cm, theta_deg: table((theta_deg, r_cm)).item()
    source.gi = program.fastinterp(np.array(tables["radial"]["r_cm"], float), np.array(tables["radial"]["g_line"]))
    mean_life_s = about["half_life_days"] * 86400 / np.log(2)
    dwells = []
    for seed_mm, axis in zip(implant.seeds_mm, implant.axes):
        middle = seed_mm / 10
        ends = [middle + source.L / 2 * axis, middle - source.L / 2 * axis]
        dwells.append(types.SimpleNamespace(middle=middle, ends=ends, t=mean_life_s))
    plan = types.SimpleNamespace(dwells=dwells)
    return np.array([program.DosePoint(point / 10, source, plan).dose for point in implant.few_mm])


def compare(number, program=None):
    """Returns what differs in one case, and the seconds of both programs."""
    implant, row = Implant(number), {}
    rx_gy = implant.source.prescription_gy
    row["implant"] = f"{implant.source.nuclide} {implant.source.model}, {implant.cc:.0f} cc, {len(implant.seeds_mm)} seeds"
    if program is not None:
        strength_u = implant.strength_u
        ours, ours_s = timed(lambda: implant.source.dose(implant.few_mm, implant.seeds_mm, strength_u, implant.axes))
        theirs, theirs_s = timed(lambda: of_pytg43(implant, program, True))
        row["tg43_%"] = 100 * np.abs(theirs / ours - 1)
        row["tg43_table_%"] = 100 * np.abs(of_pytg43(implant, program, False) / ours - 1)
        row["tg43_s"] = ours_s, theirs_s
    grid_gy = implant.grid_gy(implant.seeds_mm, 1.0)

    def histogram():
        dose_gy = implant.source.dose(implant.points_mm, implant.seeds_mm, implant.strength_u, implant.axes)
        return stylet.Dvh(dose_gy, implant.volumes_cc)

    ours, ours_s = timed(histogram)
    structures, dose = implant.dicom(grid_gy)
    theirs, theirs_s = timed(lambda: dvhcalc.get_dvh(structures, dose, 1))
    row["cc"] = ours.volume_cc, theirs.volume
    theirs.rx_dose = rx_gy
    row["D90_gy"] = ours.metric("D90", rx_gy), theirs.D90.value
    for share in (100, 150):
        cc = theirs.volume_constraint(rx_gy * share / 100, "Gy").value
        row[f"V{share}_%"] = ours.metric(f"V{share}", rx_gy), 100 * cc / theirs.volume
    row["dvh_s"] = ours_s, theirs_s
    first, other = (implant.grid_gy(seeds, GAMMA_MM) for seeds in (implant.seeds_mm, implant.again_mm))
    edges = tuple(implant.low_mm[a] + GAMMA_MM * np.arange(first.shape[a]) for a in range(3))
    tolerance = {"percent": 3.0, "distance_mm": 3.0, "of_gy": rx_gy, "least_gy": 0.5 * rx_gy}
    ours, ours_s = timed(lambda: stylet.gamma(first, other, [GAMMA_MM] * 3, origin_mm=implant.low_mm, **tolerance))
    theirs, theirs_s = timed(
        lambda: pymedphys.gamma(
            edges, first, edges, other, 3, 3, lower_percent_dose_cutoff=50, global_normalisation=rx_gy, max_gamma=2,
            interp_fraction=10, quiet=True,
        )
    )
    both = ~np.isnan(ours) & ~np.isnan(theirs)
    row["gamma"] = np.abs(ours - theirs)[both]
    row["passing_%"] = 100 * np.mean(ours[both] <= 1), 100 * np.mean(theirs[both] <= 1)
    row["gamma_s"] = ours_s, theirs_s
    return row


def table(rows):
    """Returns the rows of the page."""

    def apart(key, relative=False):
        pairs = np.array([row[key] for row in rows])
        off = np.abs(pairs[:, 0] - pairs[:, 1])
        off = 100 * off / pairs[:, 1] if relative else off
        return f"{np.median(off):.2g}", f"{off.max():.2g}"

    def seconds(key):
        ours, theirs = (np.median([row[key][n] for row in rows]) for n in (0, 1))
        return f"{1000 * ours:.1f} ms", f"{1000 * theirs:.0f} ms" if theirs < 10 else f"{theirs:.0f} s"

    lines = ["| what | other program | difference: median | largest | time: Stylet | other |", "|---|---|---|---|---|---|"]

    def line(what, beside, off, times=("", "")):
        lines.append("| " + " | ".join([what, beside, *off, *times]) + " |")

    if "tg43_%" in rows[0]:
        for key, how in (("tg43_table_%", "pyTG43, F by SciPy's bilinear interpolation"), ("tg43_%", "pyTG43")):
            off = np.concatenate([row[key] for row in rows])
            times = seconds("tg43_s") if key == "tg43_%" else ("", "")
            line(f"dose at {POINTS} points, %", how, (f"{np.median(off):.2g}", f"{off.max():.2g}"), times)
    line("volume, %", "dicompyler-core", apart("cc", relative=True))
    line("D90, %", "dicompyler-core", apart("D90_gy", relative=True), seconds("dvh_s"))
    line("V100, points", "dicompyler-core", apart("V100_%"))
    line("V150, points", "dicompyler-core", apart("V150_%"))
    off = np.concatenate([row["gamma"] for row in rows])
    line("gamma of a voxel", "pymedphys", (f"{np.median(off):.2g}", f"{off.max():.2g}"), seconds("gamma_s"))
    line("voxels with a gamma of at most 1, points", "pymedphys", apart("passing_%"))
    lines += ["", "| implant | D90, Gy | dicompyler-core | V150, % | dicompyler-core | gamma ≤ 1, % | pymedphys |"]
    lines.append("|---|---|---|---|---|---|---|")
    for row in rows:
        pairs = [f"{v:.1f}" for key in ("D90_gy", "V150_%", "passing_%") for v in row[key]]
        lines.append(f"| {' | '.join([row['implant'], *pairs])} |")
    return "\n".join(lines) + "\n"


def main():
    program = None
    if folder := os.environ.get("PYTG43"):
        sys.path.insert(0, folder)
        import pyTG43 as program  # noqa: PLC0415
    compare(0, program)  # What is compiled or read once is not timed.
    rows = [compare(number, program) for number in range(CASES)]
    written = table(rows)
    print(written)
    if os.environ.get("UPDATE_DOCS"):
        page = ROOT / "docs/measurements.md"
        head, rest = page.read_text().split(BEGIN)
        page.write_text(head + BEGIN + written + END + rest.split(END)[1])


if __name__ == "__main__":
    main()
