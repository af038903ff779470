"""What all kinds share: running Stylet, DICOM objects by pydicom, geometry in LPS and mm, and the record of findings."""
import dataclasses
import pathlib
import re
import subprocess

import numpy as np
import pydicom
import SimpleITK
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.uid import ExplicitVRBigEndian, ExplicitVRLittleEndian, ImplicitVRLittleEndian, generate_uid

SYNTAXES = [ExplicitVRLittleEndian, ImplicitVRLittleEndian, ExplicitVRBigEndian]
CT, MR = "1.2.840.10008.5.1.4.1.1.2", "1.2.840.10008.5.1.4.1.1.4"
ENHANCED_CT = "1.2.840.10008.5.1.4.1.1.2.1"
STRUCTURES, DOSE, PLAN = ("1.2.840.10008.5.1.4.1.1.481." + n for n in "325")
# Bars: mm, share of a volume, share of a dose.
MM, VOLUME, GY = 1e-3, 5e-3, 1e-4
RAS = np.diag([-1.0, -1.0, 1.0])  # from LPS, and back


@dataclasses.dataclass
class Object:
    """A generated object and what the comparison found."""

    kind: str
    name: str
    variant: str
    must_refuse: bool = False  # the documentation refuses it, or the standard leaves its meaning open
    may_refuse: bool = False  # valid, but a refusal with the reason is no wrong number either
    refused: str = ""
    failures: list = dataclasses.field(default_factory=list)
    largest: dict = dataclasses.field(default_factory=dict)  # measure: (deviation, bar)
    notes: str = ""  # what Stylet wrote to stderr

    def compare(self, measure, deviation, bar):
        deviation = float(deviation)
        self.largest[measure] = (max(deviation, self.largest.get(measure, (0, bar))[0]), bar)
        if not deviation <= bar:  # NaN fails
            self.failures.append(f"{measure} {deviation:.6g} over {bar:g}")

    def fail(self, why):
        self.failures.append(why)


class Stylet:
    """The command line of host-ui."""

    def __init__(self, program):
        self.program = program

    def __call__(self, *args, cwd=None):
        """Returns whether it succeeded, its output and its messages."""
        ran = subprocess.run([self.program, *map(str, args)], capture_output=True, text=True, cwd=cwd, timeout=300)
        return ran.returncode == 0, ran.stdout, ran.stderr.strip()

    def read(self, found: Object, *args):
        """Runs a command that reads the object; returns its output, or None if it refused it."""
        done, out, messages = self(*args)
        found.notes += messages + "\n"
        if done:
            if found.must_refuse:
                found.fail("read without a refusal")
            return out
        if "panicked" in messages or not messages:
            found.fail("crashed: " + messages[-200:])
        why = next((line for line in messages.splitlines() if not line.startswith("note: ")), messages)
        why = re.sub(r"/\S*/", "", why)  # folders of this machine
        found.refused = why.split(": ", 2)[-1][:160]
        if not (found.must_refuse or found.may_refuse):
            found.fail("refused: " + found.refused)
        return None


def uid(*parts):
    return generate_uid(entropy_srcs=["second reader", *map(str, parts)])


def dicom(sop_class, modality, name, patient="P1"):
    """A data set with the modules of patient, study and frame."""
    ds = Dataset()
    ds.SOPClassUID, ds.SOPInstanceUID, ds.Modality = sop_class, uid(name), modality
    ds.PatientName, ds.PatientID, ds.PatientBirthDate, ds.PatientSex = "Second^Reader", patient, "", ""
    ds.StudyInstanceUID, ds.SeriesInstanceUID, ds.FrameOfReferenceUID = uid("study"), uid(modality, name), uid("frame")
    ds.StudyDate = ds.StudyTime = ds.AccessionNumber = ds.ReferringPhysicianName = ds.StudyID = ""
    ds.SeriesNumber, ds.InstanceNumber, ds.Manufacturer = 1, 1, ""
    return ds


def save(path, ds, syntax=ExplicitVRLittleEndian):
    path = pathlib.Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = ds.SOPClassUID, ds.SOPInstanceUID
    meta.TransferSyntaxUID = syntax
    whole = FileDataset(str(path), ds, file_meta=meta, preamble=b"\0" * 128)
    pydicom.dcmwrite(str(path), whole, enforce_file_format=True, implicit_vr=syntax == ImplicitVRLittleEndian,
                     little_endian=syntax != ExplicitVRBigEndian, overwrite=True)
    return path


def dcmtk_reads(found: Object, path, tag, expected):
    """Lets dcmtk's dcmdump read one tag: a file that only pydicom can read would prove nothing."""
    ran = subprocess.run(["dcmdump", "-q", "+L", "+P", tag, str(path)], capture_output=True, text=True, errors="replace")
    count = ran.stdout.count(f"({tag})")
    if ran.returncode != 0 or count != expected:
        found.fail(f"dcmdump finds {tag} {count} times, not {expected}: {ran.stderr[:80]}")


def ds16(value):
    """A number as a decimal string of at most 16 characters."""
    for digits in range(12, 0, -1):
        text = f"{value:.{digits}g}"
        if len(text) <= 16:
            return text
    raise ValueError(value)


def rotation(rng, oblique):
    """Directions, one axis a column: along the patient's axes in any order and sense, or turned as well; right-handed."""
    axes = np.eye(3)[:, rng.permutation(3)] * rng.choice([-1.0, 1.0], 3)
    if np.linalg.det(axes) < 0:
        axes[:, 2] *= -1
    if oblique:
        a, b, c = rng.uniform(-0.6, 0.6, 3)
        x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
        z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
        axes = x @ y @ z @ axes
    return axes


@dataclasses.dataclass
class Frame:
    """Place of voxels: LPS = directions * spacing * index + origin; index of the centre of a voxel."""

    size: tuple
    directions: np.ndarray
    spacing: np.ndarray
    origin: np.ndarray

    @property
    def steps(self):
        return self.directions * self.spacing

    def places(self, indices):
        return np.asarray(indices, float) @ self.steps.T + self.origin

    def corners(self):
        last = np.array(self.size) - 1
        return self.places([[(n >> a & 1) * last[a] for a in range(3)] for n in range(8)])

    def middle(self):
        return self.corners().mean(axis=0)

    @staticmethod
    def of_itk(image):
        directions = np.array(image.GetDirection()).reshape(3, 3)
        return Frame(image.GetSize(), directions, np.array(image.GetSpacing()), np.array(image.GetOrigin()))


def far(a: Frame, b: Frame):
    """Largest distance between the corners of two volumes, however their axes are ordered."""
    ours, theirs = a.corners(), b.corners()
    between = np.linalg.norm(ours[:, None] - theirs[None], axis=2)
    return max(between.min(axis=0).max(), between.min(axis=1).max())


def itk_read(path):
    """Frame, and values with x first, as ITK reads them; teem cannot read a NRRD of 4 axes this way."""
    image = SimpleITK.ReadImage(str(path))
    return Frame.of_itk(image), np.transpose(SimpleITK.GetArrayFromImage(image))


def values_at(frame: Frame, values, other: Frame):
    """Values of a volume at the voxel centres of another of the same lattice, and the largest distance of these, mm."""
    grid = np.stack(np.meshgrid(*map(np.arange, other.size), indexing="ij"), axis=-1).reshape(-1, 3)
    at = (other.places(grid) - frame.origin) @ np.linalg.inv(frame.steps).T
    nearest = np.rint(at).astype(int)
    off = np.abs((at - nearest) @ frame.steps.T).max()
    inside = np.all((nearest >= 0) & (nearest < np.array(frame.size)), axis=1)
    if not inside.all():
        return None, np.inf
    return values[tuple(nearest.T)].reshape(other.size), off
