"""RT Plans of permanent seeds: places, directions and strengths, and the dose by TG-43U1 from the tables of the source."""
import csv
import datetime
import math
import pathlib
import tomllib

import numpy as np
import pydicom
from pydicom.dataset import Dataset
from scipy.interpolate import RegularGridInterpolator

import common
from common import GY, MM, PLAN, Object, dicom, ds16, save

SOURCES = pathlib.Path(__file__).parents[3] / "sources"
VARIANTS = {
    "pairs of control points": {}, "single control points": {"single": True}, "no directions": {"axes": False}, "two strengths": {"sources": 2},
    "three sources, one unused": {"sources": 3, "unused": True}, "two setups, one named": {"setups": 2, "named": 1}, "two setups": {"setups": 2},
    "implicit": {"syntax": 1}, "big endian": {"syntax": 2}, "palladium": {"file": "pd103_200.toml"},
    "palladium, measured before": {"file": "pd103_200.toml", "days": 5}, "measured before": {"days": 12}, "measured before, two strengths": {"days": 3, "sources": 2},
    "interstitial, by hand": {"technique": "INTERSTITIAL"}, "upright directions": {"upright": True}, "one seed": {"seeds": 1}, "many seeds": {"seeds": 110},
    "long directions": {"long": 2.5}, "no fraction group": {"groups": False}, "seeds of one needle": {"needles": 1},
    # Refused by docs/formats.md.
    "temporary": {"refuse": True, "technique": "INTRACAVITARY", "type": "HDR"}, "two isotopes": {"refuse": True, "sources": 2, "isotopes": True},
    "no strength": {"refuse": True, "strength": 0.0}, "a setup that is missing": {"refuse": True, "named": 7},
}
MEASURED = datetime.date(2026, 3, 2)


def make(rng, path, how):
    data = tomllib.loads((SOURCES / how.get("file", "i125_6711.toml")).read_text())["source"]
    ds = dicom(PLAN, "RTPLAN", path.stem)
    ds.RTPlanLabel, ds.RTPlanDate, ds.RTPlanTime, ds.RTPlanGeometry = "seeds", "20260314", "", "TREATMENT_DEVICE"
    ds.BrachyTreatmentTechnique, ds.BrachyTreatmentType = how.get("technique", "PERMANENT"), how.get("type", "MANUAL")
    ds.SourceSequence, ds.ApplicationSetupSequence, ds.FractionGroupSequence = [], [], []
    count = how.get("sources", 1)
    for n in range(count):
        source = Dataset()
        source.SourceNumber, source.SourceType = 3 * n + 1, "LINE"
        source.SourceIsotopeName = "Cs-131" if how.get("isotopes") and n else data["nuclide"]
        source.SourceIsotopeHalfLife = ds16(data["half_life_days"] if source.SourceIsotopeName == data["nuclide"] else 9.69)
        source.ReferenceAirKermaRate = ds16(how.get("strength", rng.uniform(0.3, 0.9)))
        source.SourceStrengthReferenceDate, source.SourceStrengthReferenceTime = MEASURED.strftime("%Y%m%d"), "120000"
        source.SourceDescription, source.ActiveSourceLength, source.SourceManufacturer = data["model"], "3", ""
        ds.SourceSequence.append(source)
    setups = how.get("setups", 1)
    of_needles = how.get("needles", 12)
    per_needle = math.ceil(how.get("seeds", 40) / of_needles / setups)
    for number in range(1, setups + 1):
        setup = Dataset()
        setup.ApplicationSetupType, setup.ApplicationSetupNumber, setup.TotalReferenceAirKerma = "PERMANENT", number, "0"
        setup.ChannelSequence = []
        for needle in range(1, of_needles + 1):
            if how.get("seeds") == 1 and needle > 1:
                break
            used = count - 1 if how.get("unused") else count
            setup.ChannelSequence.append(channel(rng, how, number * 100 + needle, 3 * int(rng.integers(used)) + 1, per_needle))
        ds.ApplicationSetupSequence.append(setup)
    if how.get("groups", True):
        group, reference = Dataset(), Dataset()
        group.FractionGroupNumber, group.NumberOfFractionsPlanned, group.NumberOfBeams = 1, 1, 0
        named = [how["named"]] if "named" in how else range(1, setups + 1)
        group.ReferencedBrachyApplicationSetupSequence = []
        for number in named:
            reference = Dataset()
            reference.ReferencedBrachyApplicationSetupNumber = number
            group.ReferencedBrachyApplicationSetupSequence.append(reference)
        group.NumberOfBrachyApplicationSetups = len(named)
        ds.FractionGroupSequence = [group]
    save(path, ds, common.SYNTAXES[how.get("syntax", 0)])


def channel(rng, how, number, source, count):
    made = Dataset()
    made.ChannelNumber, made.ReferencedSourceNumber, made.SourceMovementType = number, source, "FIXED"
    made.ChannelTotalTime, made.SourceApplicatorNumber, made.SourceApplicatorID = "31536000", number, f"N{number}"
    made.SourceApplicatorType, made.BrachyControlPointSequence = "RIGID", []
    start = np.append(rng.uniform(-25, 25, 2), rng.uniform(-20, 0))
    axis = np.array([0, 0, 1.0]) if how.get("upright") else rng.normal(0, 0.15, 3) + [0, 0, 1]
    axis /= np.linalg.norm(axis)
    for n in range(count):
        place = start + axis * 5.5 * n
        for _ in range(1 if how.get("single") else 2):
            point = Dataset()
            point.ControlPointIndex, point.CumulativeTimeWeight = len(made.BrachyControlPointSequence), "0"
            point.ControlPointRelativePosition, point.ControlPoint3DPosition = ds16(5.5 * n), list(map(ds16, place))
            if how.get("axes", True):
                point.ControlPointOrientation = list(axis * how.get("long", 1.0))
            made.BrachyControlPointSequence.append(point)
    made.NumberOfControlPoints = len(made.BrachyControlPointSequence)
    return made


def by_pydicom(path):
    """Seeds of the setups that a fraction group names, in RAS and mm: place, direction or None, strength in U."""
    ds = pydicom.dcmread(path)
    strength = {s.SourceNumber: float(s.ReferenceAirKermaRate) for s in ds.SourceSequence}
    named = {r.ReferencedBrachyApplicationSetupNumber for g in ds.FractionGroupSequence for r in g.ReferencedBrachyApplicationSetupSequence}
    seeds = []
    for setup in ds.ApplicationSetupSequence:
        if named and setup.ApplicationSetupNumber not in named:
            continue
        for one in setup.ChannelSequence:
            last = None
            for point in one.BrachyControlPointSequence:
                place = np.array(point.ControlPoint3DPosition, float)
                if last is not None and np.array_equal(place, last):
                    continue
                last = place
                axis = np.array(point.ControlPointOrientation, float) if "ControlPointOrientation" in point else None
                seeds.append((common.RAS @ place, None if axis is None else common.RAS @ axis / np.linalg.norm(axis), strength[one.ReferencedSourceNumber]))
    return seeds


def dose(points, seeds, data, decay):
    """Dose of a permanent implant in Gy by the definitions of TG-43U1 (eq. 1 and 11), without anything of Stylet's code."""
    source, radial, one, two = data["source"], data["radial"], data["anisotropy_1d"], data["anisotropy_2d"]
    length = source["active_length_cm"]
    slope = np.log(radial["g_line"][-1] / radial["g_line"][-2]) / (radial["r_cm"][-1] - radial["r_cm"][-2])

    def geometry(r, angle):
        """Angle under which the line is seen, by its ends, over length and distance from the axis."""
        across, along = np.maximum(r * np.sin(angle), 1e-6 * r), r * np.cos(angle)
        seen = np.arctan((along + length / 2) / across) - np.arctan((along - length / 2) / across)
        return seen / (length * across)

    def g(r):
        beyond = np.maximum(r - radial["r_cm"][-1], 0)
        return np.exp(np.interp(r, radial["r_cm"], np.log(radial["g_line"])) + slope * beyond)

    def f(r, degrees):
        if two["theta_deg"][-1] <= 90:
            degrees = np.minimum(degrees, 180 - degrees)
        bilinear = RegularGridInterpolator((two["r_cm"], two["theta_deg"]), np.array(two["F"], float))
        return bilinear(np.column_stack([np.clip(r, two["r_cm"][0], two["r_cm"][-1]), degrees]))

    total, across = np.zeros(len(points)), math.pi / 2
    lasting_h = source["half_life_days"] * 24 / math.log(2)
    for place, axis, strength in seeds:
        away = (np.asarray(points) - place) / 10
        r = np.linalg.norm(away, axis=1)
        if axis is None:
            rate = geometry(r, across) * np.interp(r, one["r_cm"], one["phi_an"])
        else:
            angle = np.arccos(np.clip(away @ axis / r, -1, 1))
            rate = geometry(r, angle) * f(r, np.degrees(angle))
        rate *= strength * decay * source["dose_rate_constant"] * g(r) / geometry(1.0, across)
        total += rate * lasting_h / 100
    return total


def check(stylet, rng, root, n, variant):
    found, how = Object("RT Plan", f"plan{n:02}", variant), VARIANTS[variant]
    found.must_refuse = how.get("refuse", False)
    path, out = root / (found.name + ".dcm"), root / (found.name + ".csv")
    make(rng, path, how)
    if stylet.read(found, "convert", path, out) is None or found.must_refuse:
        return found
    seeds = by_pydicom(path)
    written = pydicom.dcmread(path)
    points = sum(len(c.BrachyControlPointSequence) for s in written.ApplicationSetupSequence for c in s.ChannelSequence)
    common.dcmtk_reads(found, path, "300a,02d4", points)
    rows = list(csv.DictReader(line for line in open(out) if not line.startswith("#")))
    if len(rows) != len(seeds):
        found.fail(f"{len(rows)} seeds instead of {len(seeds)}")
        return found
    for row, (place, axis, strength) in zip(rows, seeds):
        found.compare("mm", np.abs(np.array([float(row[f"{a}_mm"]) for a in "xyz"]) - place).max(), MM)
        if axis is not None:
            found.compare("direction", np.abs(np.array([float(row[f"axis_{a}"]) for a in "xyz"]) - axis).max(), 1e-6)
        elif row.get("axis_x"):
            found.fail("a direction that the plan does not give")
        found.compare("strength: share", abs(float(row["strength_u"]) / strength - 1), GY)
    doses(stylet, found, rng, root, path, seeds, how)
    return found


def doses(stylet, found, rng, root, path, seeds, how):
    file = SOURCES / how.get("file", "i125_6711.toml")
    data = tomllib.loads(file.read_text())
    at, points = root / (found.name + " points.csv"), []
    while len(points) < 40:
        point = np.round(rng.uniform(-30, 30, 3), 4)
        if min(np.linalg.norm(point - place) for place, _, _ in seeds) > 3:  # outside of every capsule
            points.append(point)
    at.write_text("x_mm,y_mm,z_mm\n" + "".join("{},{},{}\n".format(*p) for p in points))
    days = how.get("days", 0)
    implant = MEASURED + datetime.timedelta(days=days)
    out = root / (found.name + " dose")
    if stylet.read(found, "dose", "--source", file, "--seeds", path, "--points", at, "--implant-date", implant, "--out", out) is None:
        return
    lines = [line for line in open(out / "dose_points.csv") if not line.startswith("#")]
    told = np.array([float(row["dose_gy"]) for row in csv.DictReader(lines)])
    mine = dose(points, seeds, data, 0.5 ** (days / data["source"]["half_life_days"]))
    found.compare("dose: share", np.max(np.abs(told / mine - 1)), GY)


def run(stylet, rng, root):
    for n, variant in enumerate(VARIANTS):
        yield check(stylet, rng, root, n, variant)
