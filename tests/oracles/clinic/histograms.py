"""Studies that `host-ui dicom` writes: its dose by TG-43U1, and its histograms beside those of dicompyler-core."""
import json
import tomllib

import numpy as np
import pydicom
import pydicom.dicomio
from matplotlib.path import Path

import common
import doses
import plans
import structures
from common import GY, Object

pydicom.dicomio.read_file = pydicom.dcmread  # dicompyler-core 0.5.6 has the name that pydicom 3 dropped
from dicompylercore import dicomparser, dvhcalc  # noqa: E402

VARIANTS = ["axial", "hole inside", "several contours a slice", "axial with images"]
PERCENTS = (90, 50, 10)


def seeds(rng, path, polygons):
    """A table of 30 seeds about the middle of a structure, in RAS; returns them as `plans.dose` takes them."""
    middle = common.RAS @ np.vstack(polygons).mean(axis=0)
    places = middle + rng.uniform(-12, 12, (30, 3))
    lines = ["x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u"] + ["{:.4f},{:.4f},{:.4f},0,0,1,0.5".format(*p) for p in places]
    path.write_text("\n".join(lines) + "\n")
    return [(np.round(p, 4), np.array([0, 0, 1.0]), 0.5) for p in places]


def check(stylet, rng, root, n, variant):
    found = Object("study (written)", f"study{n:02}", variant)
    folder, out = root / found.name, root / (found.name + " written")
    folder.mkdir()
    structures.make(rng, folder, variant)
    drawn = structures.by_pydicom(folder / "structures.dcm")
    source = plans.SOURCES / "i125_6711.toml"
    planned = seeds(rng, folder / "seeds.csv", drawn["Prostate"])
    if stylet.read(found, "dicom", "--source", source, "--seeds", folder / "seeds.csv", "--structures", folder / "structures.dcm", "--out", out) is None:
        return found
    frame, dose = doses.by_pydicom(out / "dose.dcm")
    data = tomllib.loads(source.read_text())
    at = [index for index in rng.integers(0, frame.size, (200, 3))]
    places = frame.places(at) * np.diag(common.RAS)
    far = [i for i, p in enumerate(places) if min(np.linalg.norm(p - place) for place, _, _ in planned) > 3]
    mine = plans.dose(places[far], planned, data, 1.0)
    told = np.array([dose[tuple(at[i])] for i in far])
    found.compare("dose of the grid: share", np.max(np.abs(told / mine - 1)), GY)
    histograms(found, stylet, rng, folder, out, drawn, source, planned)
    return found


def histograms(found, stylet, rng, folder, out, drawn, source, planned):
    set_path, dose_path, metrics = out / "structure_set.dcm", out / "dose.dcm", folder / "dose"
    named = [word for percent in PERCENTS for word in ("--metric", f"D{percent}")]
    if stylet.read(found, "dose", "--source", source, "--seeds", folder / "seeds.csv", "--structures", folder / "structures.dcm", *named, "--out", metrics) is None:
        return
    told = figures(metrics)
    imported = folder / "imported"
    given = ["--rt-dose", dose_path, "--structures", set_path, "--prescription-gy", 145]
    if stylet.read(found, "dose", *given, *named, "--metric", "Dmean", "--out", imported) is None:
        return
    of_import = figures(imported)
    written = dicomparser.DicomParser(str(dose_path)).GetDVHs()
    for number, roi in dicomparser.DicomParser(str(set_path)).GetStructures().items():
        polygons = drawn[roi["name"]]
        found.compare("written histogram: share of the volume drawn", abs(written[number].volume / structures.volume_cc(polygons) - 1), common.VOLUME)
        theirs = dvhcalc.get_dvh(str(set_path), str(dose_path), number)
        mine = plans.dose(inside(rng, polygons) @ common.RAS, planned, tomllib.loads(source.read_text()), 1.0)
        compare_imported(found, theirs, of_import[roi["name"]])
        for percent in PERCENTS:
            gy = told[roi["name"]]["metrics"][f"D{percent}"]["gy"]
            imported_gy = of_import[roi["name"]]["metrics"][f"D{percent}"]["gy"]
            found.compare("imported, D90, D50, D10 beside TG-43U1: share", abs(imported_gy / gy - 1), 0.005)
            found.compare("D90, D50, D10 by random points: share", abs(np.percentile(mine, 100 - percent) / gy - 1), 0.01)
            found.compare("D90, D50, D10 by dicompyler: share", abs(theirs.statistic(f"D{percent}").value / gy - 1), 0.02)


def figures(folder):
    return {s["name"]: s for s in json.loads((folder / "metrics.json").read_text())["structures"]}


def compare_imported(found, theirs, ours):
    """`dose --rt-dose` beside dicompyler-core, which counts pixels of the dose in each plane of contours."""
    found.compare("imported, volume beside dicompyler: share", abs(ours["volume_cc"] / theirs.volume - 1), 0.02)
    for percent in PERCENTS:
        gy = ours["metrics"][f"D{percent}"]["gy"]
        found.compare("imported, D90, D50, D10 beside dicompyler: share", abs(theirs.statistic(f"D{percent}").value / gy - 1), 0.02)
    found.compare("imported, mean beside dicompyler: share", abs(theirs.mean / ours["metrics"]["Dmean"]["gy"] - 1), 0.02)


def inside(rng, polygons):
    """Points at random in the body: each plane reaches half-way to its neighbours."""
    axes = structures.plane_axes(polygons)
    planes = structures.within(polygons, axes)
    heights = np.array(list(planes))
    half, points = np.median(np.diff(heights)) / 2, []
    for height, of_plane in planes.items():
        low, high = np.vstack(of_plane).min(axis=0), np.vstack(of_plane).max(axis=0)
        tried = rng.uniform(low, high, (int(np.prod(high - low) * 10), 2))
        odd = sum(Path(p).contains_points(tried).astype(int) for p in of_plane) % 2 == 1
        points.append(np.column_stack([tried[odd], height + rng.uniform(-half, half, np.count_nonzero(odd))]))
    return np.vstack(points) @ axes.T


def run(stylet, rng, root):
    for n, variant in enumerate(VARIANTS):
        yield check(stylet, rng, root, n, variant)
