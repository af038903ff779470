"""Writes an image series, a structure set and two plans with pydicom, as other programs would.

python3 make_dicom.py FOLDER; needs pydicom. The files are kept beside this script in dicom/.
"""
import pathlib, sys
import numpy as np, pydicom
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import ExplicitVRLittleEndian, ImplicitVRLittleEndian, generate_uid

out = pathlib.Path(sys.argv[1]); out.mkdir(exist_ok=True)
uid = lambda name: generate_uid(entropy_srcs=["stylet", name])
CT, STRUCT, PLAN = "1.2.840.10008.5.1.4.1.1.2", "1.2.840.10008.5.1.4.1.1.481.3", "1.2.840.10008.5.1.4.1.1.481.5"

def save(name, ds, sop_class, syntax=ExplicitVRLittleEndian):
    meta = FileMetaDataset(); meta.MediaStorageSOPClassUID = sop_class
    meta.MediaStorageSOPInstanceUID = ds.SOPInstanceUID; meta.TransferSyntaxUID = syntax
    ds.file_meta, ds.SOPClassUID = meta, sop_class
    ds.is_little_endian, ds.is_implicit_VR = True, syntax == ImplicitVRLittleEndian
    ds.preamble = b"\0" * 128
    pydicom.dcmwrite(str(out / name), ds, write_like_original=False)

def base(name, modality):
    ds = Dataset(); ds.PatientName, ds.PatientID = "Phantom^Stylet", "P6"; ds.Modality = modality
    ds.SOPInstanceUID, ds.StudyInstanceUID = uid(name), uid("study"); ds.SeriesInstanceUID = uid("series " + modality)
    ds.FrameOfReferenceUID = uid("frame")
    return ds

# Slices tilted against the patient, 0.5 x 0.6 x 2 mm, LPS.
angle = 0.35
row, column = np.array([1.0, 0, 0]), np.array([0, np.cos(angle), np.sin(angle)])
normal = np.cross(row, column)
corner, count = np.array([-9.0, -14.0, 33.0]), 6
for k in range(count):
    ds = base(f"image {k}", "CT"); p = corner + 2.0 * k * normal
    ds.ImagePositionPatient = [f"{v:.9g}" for v in p]
    ds.ImageOrientationPatient = [f"{v:.9g}" for v in [*row, *column]]
    ds.PixelSpacing, ds.SliceThickness = ["0.6", "0.5"], "2"
    ds.Rows, ds.Columns, ds.BitsAllocated, ds.BitsStored, ds.HighBit = 36, 40, 8, 8, 7
    ds.PixelRepresentation, ds.SamplesPerPixel, ds.PhotometricInterpretation = 0, 1, "MONOCHROME2"
    ds.PixelData = bytes(36 * 40)
    save(f"image{(k * 5) % count}.dcm", ds, CT)

def ring(radius, k, middle=(10.0, 10.0), turn=1):
    a = np.linspace(0, 2 * np.pi, 48, endpoint=False) * turn
    return [corner + 2.0 * k * normal + (middle[0] + radius * np.cos(t)) * row + (middle[1] + radius * np.sin(t)) * column for t in a]

def contour(points, kind="CLOSED_PLANAR"):
    c = Dataset(); c.ContourGeometricType, c.NumberOfContourPoints = kind, len(points)
    c.ContourData = [f"{v:.6f}" for p in points for v in p]
    return c

keyhole = lambda k: ring(3.0, k) + [ring(3.0, k)[0]] + [ring(1.5, k, turn=-1)[0]] + ring(1.5, k, turn=-1)[1:] + [ring(1.5, k, turn=-1)[0]]
structures = [
    ("Prostate", [contour(ring(7.0, k)) for k in range(1, 5)]),
    ("Urethra", [contour(ring(1.2, k, (6.0, 10.0))) for k in range(0, 6)]),
    ("Rectum", [contour(keyhole(k)) for k in range(2, 4)]),
    ("Bladder", [contour(ring(r, 5), "CLOSEDPLANAR_XOR") for r in (8.0, 4.0)]),
    ("Isocentre", [contour([ring(1.0, 0)[0]], "POINT")]),
]
def structure_set(syntax, name):
    ds = base(name, "RTSTRUCT"); ds.StructureSetLabel = "phantom"
    ref = Dataset(); ref.FrameOfReferenceUID = ds.FrameOfReferenceUID
    study, series = Dataset(), Dataset(); series.SeriesInstanceUID = uid("series CT")
    study.ReferencedSOPClassUID, study.ReferencedSOPInstanceUID = "1.2.840.10008.3.1.2.3.2", uid("study")
    study.RTReferencedSeriesSequence = Sequence([series]); ref.RTReferencedStudySequence = Sequence([study])
    ds.ReferencedFrameOfReferenceSequence = Sequence([ref])
    ds.StructureSetROISequence, ds.ROIContourSequence = Sequence(), Sequence()
    for number, (roi_name, contours) in enumerate(structures, 1):
        roi = Dataset(); roi.ROINumber, roi.ROIName, roi.ReferencedFrameOfReferenceUID = number, roi_name, ds.FrameOfReferenceUID
        ds.StructureSetROISequence.append(roi)
        drawn = Dataset(); drawn.ReferencedROINumber, drawn.ContourSequence = number, Sequence(contours)
        ds.ROIContourSequence.append(drawn)
    save(name, ds, STRUCT, syntax)
structure_set(ExplicitVRLittleEndian, "structures.dcm")
structure_set(ImplicitVRLittleEndian, "structures_implicit.dcm")

def plan(name, technique, dwell):
    ds = base(name, "RTPLAN"); ds.RTPlanLabel = "phantom"; ds.BrachyTreatmentTechnique, ds.BrachyTreatmentType = technique, "MANUAL" if technique == "PERMANENT" else "HDR"
    dose = Dataset(); dose.DoseReferenceType, dose.TargetPrescriptionDose = "TARGET", "145"; ds.DoseReferenceSequence = Sequence([dose])
    ds.SourceSequence = Sequence()
    for number, strength in ((3, "0.5"), (7, "0.62")):
        s = Dataset(); s.SourceNumber, s.SourceType, s.SourceIsotopeName, s.SourceIsotopeHalfLife = number, "LINE", "I-125", "59.4"
        s.SourceStrengthUnits, s.ReferenceAirKermaRate, s.ActiveSourceLength, s.SourceDescription = "AIR_KERMA_RATE", strength, "3", "6711"
        ds.SourceSequence.append(s)
    setup = Dataset(); setup.ApplicationSetupType, setup.ApplicationSetupNumber, setup.ChannelSequence = "PERINEAL", 1, Sequence()
    for number, (source, hole, places) in enumerate([(3, "D4", [(1, 2, 3), (1, 2, 13)]), (7, "E5", [(-4.25, 5, 6)])], 1):
        c = Dataset(); c.ChannelNumber, c.ReferencedSourceNumber, c.SourceApplicatorID = number, source, hole
        c.SourceMovementType, c.BrachyControlPointSequence = "FIXED", Sequence()
        for place in places:
            for _ in range(dwell):
                p = Dataset(); p.ControlPointIndex = len(c.BrachyControlPointSequence)
                p.ControlPoint3DPosition = [str(v) for v in place]; p.ControlPointOrientation = [0.0, 0.6, 0.8]
                c.BrachyControlPointSequence.append(p)
        setup.ChannelSequence.append(c)
    ds.ApplicationSetupSequence = Sequence([setup])
    save(name, ds, PLAN)
plan("plan_pairs.dcm", "PERMANENT", 2)
plan("plan_single.dcm", "PERMANENT", 1)
plan("plan_hdr.dcm", "INTERSTITIAL", 2)
