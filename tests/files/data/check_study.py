"""Checks a structure set, a plan of permanent seeds and a dose that belong together.

python3 check_study.py STRUCTURE_SET PLAN DOSE [IMAGE ...]; needs pydicom. Prints JSON: how many attributes were looked at, what is
missing, and which references lead nowhere; exit code 1 if there is any.

The table is that of DICOM PS3.3 (2024): the mandatory modules of A.18 (RT Dose), A.19 (RT Structure Set) and A.20 (RT Plan), and of
those that may be there the ones that we write. Every attribute of type 1, 1C, 2 and 2C stands here, conditional ones with their
condition. 1: there and not empty. 2: there. C: if the condition holds; "not" otherwise means that it must be absent then.
Conditions that a file of ours can never meet (substances, animals, colour images, afterloaders of beams) are written out as `never`.
"""
import json, sys
import pydicom

STRUCT, PLAN, DOSE = (f"1.2.840.10008.5.1.4.1.1.481.{n}" for n in (3, 5, 2))
never = lambda item, root: False
has = lambda key: lambda item, root: key in item
value = lambda key, *any_of: lambda item, root: str(getattr(item, key, "")) in any_of
filled = lambda key: lambda item, root: key in item and not item[key].is_empty
pdr = lambda item, root: root.get("BrachyTreatmentType") == "PDR"
decided = value("ApprovalStatus", "APPROVED", "REJECTED")
not_gamma = lambda item, root: str(item.get("SourceIsotopeName", "")) in ("Sr-90", "Ru-106", "P-32", "Y-90")
foreign_text = lambda item, root: any(
    ord(c) > 127 for e in root.iterall() if e.VR in ("PN", "LO", "SH", "ST", "LT", "UT") for c in str(e.value))

IMAGE = [("ReferencedSOPClassUID", "1"), ("ReferencedSOPInstanceUID", "1"),
         ("ReferencedFrameNumber", "1C", never), ("ReferencedSegmentNumber", "1C", never)]
SOP = [("ReferencedSOPClassUID", "1"), ("ReferencedSOPInstanceUID", "1")]

# C.7.1.1, C.7.2.1, C.8.8.1, C.7.4.1, C.7.5.1, C.12.1
COMMON = [
    ("PatientName", "2"), ("PatientID", "2"), ("PatientBirthDate", "2"), ("PatientSex", "2"),
    ("PatientBirthDateInAlternativeCalendar", "3"), ("PatientAlternativeCalendar", "1C", has("PatientBirthDateInAlternativeCalendar")),
    ("PatientSpeciesDescription", "1C", never), ("PatientBreedDescription", "2C", never), ("ResponsiblePerson", "2C", never),
    ("PatientIdentityRemoved", "3"), ("DeidentificationMethod", "1C", value("PatientIdentityRemoved", "YES")),
    ("StudyInstanceUID", "1"), ("StudyDate", "2"), ("StudyTime", "2"), ("ReferringPhysicianName", "2"), ("StudyID", "2"),
    ("AccessionNumber", "2"),
    ("Modality", "1"), ("SeriesInstanceUID", "1"), ("SeriesNumber", "2"), ("OperatorsName", "2"),
    ("FrameOfReferenceUID", "1"), ("PositionReferenceIndicator", "2"),
    ("Manufacturer", "2"), ("PixelPaddingValue", "1C", never),
    ("SOPClassUID", "1"), ("SOPInstanceUID", "1"), ("SpecificCharacterSet", "1C", foreign_text),
    ("EncryptedAttributesSequence", "1C", never), ("QueryRetrieveView", "1C", never), ("ConversionSourceAttributesSequence", "1C", never),
]
# C.8.8.16
APPROVAL = [("ApprovalStatus", "1"), ("ReviewDate", "2C", decided), ("ReviewTime", "2C", decided), ("ReviewerName", "2C", decided)]
# C.8.8.5, C.8.8.6, C.8.8.8
STRUCTURE_SET = COMMON + APPROVAL + [
    ("StructureSetLabel", "1"), ("StructureSetDate", "2"), ("StructureSetTime", "2"),
    ("ReferencedFrameOfReferenceSequence", "3", [
        ("FrameOfReferenceUID", "1"),
        ("RTReferencedStudySequence", "3", SOP + [
            ("RTReferencedSeriesSequence", "1", [("SeriesInstanceUID", "1"), ("ContourImageSequence", "1", IMAGE)])])]),
    ("StructureSetROISequence", "1", [
        ("ROINumber", "1"), ("ReferencedFrameOfReferenceUID", "1"), ("ROIName", "2"), ("ROIGenerationAlgorithm", "2")]),
    ("ROIContourSequence", "1", [
        ("ReferencedROINumber", "1"),
        ("ContourSequence", "3", [
            ("ContourGeometricType", "1"), ("NumberOfContourPoints", "1"), ("ContourData", "1"),
            ("ContourImageSequence", "3", IMAGE)])]),
    ("RTROIObservationsSequence", "1", [
        ("ObservationNumber", "1"), ("ReferencedROINumber", "1"), ("RTROIInterpretedType", "2"), ("ROIInterpreter", "2")]),
]
applicator = has("SourceApplicatorNumber")
# C.8.8.9, C.8.8.10, C.8.8.13, C.8.8.15
RT_PLAN = COMMON + APPROVAL + [
    ("RTPlanLabel", "1"), ("RTPlanDate", "2"), ("RTPlanTime", "2"), ("RTPlanGeometry", "1"),
    ("ReferencedStructureSetSequence", "1C", value("RTPlanGeometry", "PATIENT"), SOP),
    ("ReferencedRTPlanSequence", "3", SOP + [("RTPlanRelationship", "1")]),
    ("DoseReferenceSequence", "3", [
        ("DoseReferenceNumber", "1"), ("DoseReferenceStructureType", "1"), ("DoseReferenceType", "1"),
        ("ReferencedROINumber", "1C", value("DoseReferenceStructureType", "POINT", "VOLUME")),
        ("DoseReferencePointCoordinates", "1C", value("DoseReferenceStructureType", "COORDINATES"))]),
    ("FractionGroupSequence", "1", [
        ("FractionGroupNumber", "1"), ("NumberOfFractionsPlanned", "2"), ("NumberOfBeams", "1"),
        ("ReferencedBeamSequence", "1C", lambda i, r: i.get("NumberOfBeams", 0) > 0, [("ReferencedBeamNumber", "1")]),
        ("NumberOfBrachyApplicationSetups", "1"),
        ("ReferencedBrachyApplicationSetupSequence", "1C", lambda i, r: i.get("NumberOfBrachyApplicationSetups", 0) > 0,
            [("ReferencedBrachyApplicationSetupNumber", "1")])]),
    ("BrachyTreatmentTechnique", "1"), ("BrachyTreatmentType", "1"),
    ("TreatmentMachineSequence", "1", [("TreatmentMachineName", "2")]),
    ("SourceSequence", "1", [
        ("SourceNumber", "1"), ("SourceType", "1"), ("SourceIsotopeName", "1"), ("SourceIsotopeHalfLife", "1"),
        ("SourceStrengthUnits", "1C", not_gamma), ("ReferenceAirKermaRate", "1"), ("SourceStrength", "1C", not_gamma),
        ("SourceStrengthReferenceDate", "1"), ("SourceStrengthReferenceTime", "1")]),
    ("ApplicationSetupSequence", "1", [
        ("ApplicationSetupType", "1"), ("ApplicationSetupNumber", "1"), ("TotalReferenceAirKerma", "1"),
        ("ChannelSequence", "1", [
            ("ChannelNumber", "1"), ("ChannelLength", "2"), ("ChannelTotalTime", "1"), ("SourceMovementType", "1"),
            ("NumberOfPulses", "1C", pdr), ("PulseRepetitionInterval", "1C", pdr),
            ("SourceApplicatorID", "2C", applicator), ("SourceApplicatorType", "1C", applicator),
            ("SourceApplicatorLength", "1C", applicator), ("ReferencedROINumber", "2C", applicator),
            ("SourceApplicatorStepSize", "1C", value("SourceMovementType", "STEPWISE")),
            ("SourceApplicatorTipLength", "2C", has("ChannelEffectiveLength")),
            ("ChannelInnerLength", "2C", has("ChannelEffectiveLength")),
            ("TransferTubeNumber", "2"), ("TransferTubeLength", "2C", filled("TransferTubeNumber")),
            ("ReferencedSourceNumber", "1"), ("NumberOfControlPoints", "1"),
            ("FinalCumulativeTimeWeight", "1C", lambda i, r: any(
                filled("CumulativeTimeWeight")(p, r) for p in i.get("BrachyControlPointSequence", []))),
            ("BrachyControlPointSequence", "1", [
                ("ControlPointIndex", "1"), ("CumulativeTimeWeight", "2"), ("ControlPointRelativePosition", "1")])])]),
]
pixels = has("PixelData")
# C.7.6.1, C.7.6.2, C.7.6.3, C.7.6.6, C.8.8.3, C.8.8.4
RT_DOSE = COMMON + [
    ("InstanceNumber", "2"), ("PatientOrientation", "2C", lambda i, r: "ImageOrientationPatient" not in i),
    ("ContentDate", "2C", never), ("ContentTime", "2C", never),
    ("PixelSpacing", "1"), ("ImageOrientationPatient", "1"), ("ImagePositionPatient", "1"), ("SliceThickness", "2"),
    ("SamplesPerPixel", "1C", pixels), ("PhotometricInterpretation", "1C", pixels), ("Rows", "1"), ("Columns", "1"),
    ("BitsAllocated", "1C", pixels), ("BitsStored", "1C", pixels), ("HighBit", "1C", pixels), ("PixelRepresentation", "1C", pixels),
    ("PixelData", "1"), ("PlanarConfiguration", "1C", lambda i, r: i.get("SamplesPerPixel", 1) > 1), ("PixelAspectRatio", "1C", never),
    ("NumberOfFrames", "1"), ("FrameIncrementPointer", "1"),
    ("DoseUnits", "1"), ("DoseType", "1"), ("DoseSummationType", "1"),
    ("ReferencedRTPlanSequence", "1C", value("DoseSummationType", "PLAN", "MULTI_PLAN", "FRACTION", "BEAM", "BRACHY",
        "FRACTION_SESSION", "BEAM_SESSION", "BRACHY_SESSION", "CONTROL_POINT"), SOP + [
        ("ReferencedFractionGroupSequence", "1C", lambda i, r: r.get("DoseSummationType") in (
            "FRACTION", "BEAM", "BRACHY", "CONTROL_POINT"))]),
    ("ReferencedTreatmentRecordSequence", "1C", value("DoseSummationType", "RECORD")),
    ("GridFrameOffsetVector", "1C", lambda i, r: i.get("NumberOfFrames", 1) > 1), ("DoseGridScaling", "1C", pixels),
    ("ReferencedStructureSetSequence", "1C", has("DVHSequence"), SOP),
    ("DVHSequence", "3", [
        ("DVHReferencedROISequence", "1", [("ReferencedROINumber", "1"), ("DVHROIContributionType", "1")]),
        ("DVHType", "1"), ("DoseUnits", "1"), ("DoseType", "1"), ("DVHDoseScaling", "1"), ("DVHVolumeUnits", "1"),
        ("DVHNumberOfBins", "1"), ("DVHData", "1")]),
]

def attributes(item, table, root, place, missing):
    """Adds what is missing; gives how many attributes of types 1 and 2 were looked for."""
    count = 0
    for key, kind, *rest in table:
        condition = next((r for r in rest if callable(r)), None)
        inner = next((r for r in rest if isinstance(r, list)), None)
        needed = kind[0] in "12" and (condition is None or condition(item, root))
        count += kind[0] in "12"
        at = f"{place}.{key}"
        if needed and key not in item:
            missing.append(f"{at} (type {kind}) is not there")
        elif key in item and kind[0] == "1" and item[key].is_empty:
            missing.append(f"{at} (type {kind}) is empty")
        if inner and key in item:
            for n, one in enumerate(item[key].value):
                count += attributes(one, inner, root, f"{at}[{n}]", missing)
    return count

def references(struct, plan, dose, images, wrong):
    def same(what, *values):
        if len(set(values)) != 1:
            wrong.append(f"{what} differ: {sorted(set(map(str, values)))}")
    files = [struct, plan, dose]
    for key in ("PatientID", "PatientName", "PatientBirthDate", "PatientSex", "StudyInstanceUID", "StudyDate", "StudyTime", "StudyID",
                "AccessionNumber", "ReferringPhysicianName", "FrameOfReferenceUID"):
        same(key, *(str(f.get(key, "")) for f in files))
    if len({f.SOPInstanceUID for f in files}) != 3 or len({f.SeriesInstanceUID for f in files}) != 3:
        wrong.append("two files have one SOP instance or series UID")
    for f, sop in zip(files, (STRUCT, PLAN, DOSE)):
        same("SOP classes of data set, file and kind", str(f.SOPClassUID), str(f.file_meta.MediaStorageSOPClassUID), sop)
        same("SOP instances of data set and file", str(f.SOPInstanceUID), str(f.file_meta.MediaStorageSOPInstanceUID))
    def leads(what, item, key, to):
        found = [(str(r.ReferencedSOPClassUID), str(r.ReferencedSOPInstanceUID)) for r in item.get(key, [])]
        if found != [(str(to.SOPClassUID), str(to.SOPInstanceUID))]:
            wrong.append(f"{what}: {key} is {found}")
    leads("plan", plan, "ReferencedStructureSetSequence", struct)
    leads("dose", dose, "ReferencedRTPlanSequence", plan)
    leads("dose", dose, "ReferencedStructureSetSequence", struct)
    rois = {int(r.ROINumber): r for r in struct.StructureSetROISequence}
    for what, numbers in {
        "contours": [c.ReferencedROINumber for c in struct.ROIContourSequence],
        "observations": [o.ReferencedROINumber for o in struct.RTROIObservationsSequence],
        "histograms": [r.ReferencedROINumber for h in dose.get("DVHSequence", []) for r in h.DVHReferencedROISequence],
    }.items():
        if sorted(map(int, numbers)) != sorted(rois):
            wrong.append(f"{what} are of structures {sorted(map(int, numbers))}, and there are {sorted(rois)}")
    for reference in plan.get("DoseReferenceSequence", []):
        if "ReferencedROINumber" in reference and int(reference.ReferencedROINumber) not in rois:
            wrong.append(f"the prescription is for structure {reference.ReferencedROINumber}, which is not there")
    for roi in rois.values():
        same("frames of a structure and of the set", str(roi.ReferencedFrameOfReferenceUID), str(struct.FrameOfReferenceUID))
    sources = {int(s.SourceNumber) for s in plan.SourceSequence}
    channels = [c for s in plan.ApplicationSetupSequence for c in s.ChannelSequence]
    if {int(c.ReferencedSourceNumber) for c in channels} != sources:
        wrong.append("channels and sources do not name each other")
    for c in channels:
        if int(c.NumberOfControlPoints) != len(c.BrachyControlPointSequence):
            wrong.append(f"channel {c.ChannelNumber} has another number of control points than it says")
    setups = {int(s.ApplicationSetupNumber) for s in plan.ApplicationSetupSequence}
    for group in plan.FractionGroupSequence:
        if {int(r.ReferencedBrachyApplicationSetupNumber) for r in group.ReferencedBrachyApplicationSetupSequence} != setups:
            wrong.append("the fraction group names other application setups")
    contours = [c for r in struct.ROIContourSequence for c in r.ContourSequence]
    named = {str(i.ReferencedSOPInstanceUID) for c in contours for i in c.get("ContourImageSequence", [])}
    listed = {str(i.ReferencedSOPInstanceUID)
              for f in struct.ReferencedFrameOfReferenceSequence for s in f.get("RTReferencedStudySequence", [])
              for e in s.RTReferencedSeriesSequence for i in e.ContourImageSequence}
    if images:
        there = {str(i.SOPInstanceUID): i for i in images}
        if listed != set(there):
            wrong.append(f"the set lists {len(listed)} images, and {len(there)} are there")
        without = sum("ContourImageSequence" not in c for c in contours)
        if without or not named <= listed:
            wrong.append(f"{without} of {len(contours)} contours name no image")
        for c in contours:
            image = there.get(str(c.ContourImageSequence[0].ReferencedSOPInstanceUID)) if "ContourImageSequence" in c else None
            if image is not None:
                a, b = [[float(v) for v in image.ImageOrientationPatient][n:n + 3] for n in (0, 3)]
                normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
                off = sum((float(p) - float(q)) * n for p, q, n in zip(c.ContourData[:3], image.ImagePositionPatient, normal))
                if abs(off) > 1.1:
                    wrong.append(f"a contour lies {off:.2f} mm off its image")
        study, series = images[0].StudyInstanceUID, images[0].SeriesInstanceUID
        same("studies of images and files", str(study), str(struct.StudyInstanceUID))
        same("frames of images and files", str(images[0].FrameOfReferenceUID), str(struct.FrameOfReferenceUID))
        for f in struct.ReferencedFrameOfReferenceSequence:
            for s in f.RTReferencedStudySequence:
                same("study of the images", str(s.ReferencedSOPInstanceUID), str(study))
                same("series of the images", str(s.RTReferencedSeriesSequence[0].SeriesInstanceUID), str(series))
    # The grid covers every corner of every contour.
    first, (dy, dx) = [float(v) for v in dose.ImagePositionPatient], [float(v) for v in dose.PixelSpacing]
    offsets = [float(v) for v in dose.GridFrameOffsetVector]
    last = [first[0] + dx * (dose.Columns - 1), first[1] + dy * (dose.Rows - 1), first[2] + offsets[-1]]
    for c in contours:
        p = [float(v) for v in c.ContourData]
        if any(not first[n % 3] <= v <= last[n % 3] for n, v in enumerate(p)):
            wrong.append("a contour reaches out of the dose grid"); break
    if len(dose.PixelData) != dose.Rows * dose.Columns * int(dose.NumberOfFrames) * dose.BitsAllocated // 8:
        wrong.append("the pixels are not as many as rows, columns and frames say")

def main(paths):
    struct, plan, dose, *images = (pydicom.dcmread(p) for p in paths)
    missing, wrong, count = [], [], 0
    for name, file, table in (("structure set", struct, STRUCTURE_SET), ("plan", plan, RT_PLAN), ("dose", dose, RT_DOSE)):
        count += attributes(file, table, file, name, missing)
    if not missing:
        references(struct, plan, dose, images, wrong)
    print(json.dumps({"looked_at": count, "missing": missing, "wrong": wrong}, indent=1))
    return bool(missing or wrong)

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
