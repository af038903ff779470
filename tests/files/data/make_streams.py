"""Writes streams/: one frame of 40 x 33 pixels by the encoders of OpenJPEG, CharLS and GDCM (pydicom 3.0.2, pylibjpeg-openjpeg 2.6.0,
pyjpegls 1.5.1, python-gdcm 3.2.6), which the test of compressed pixels in stylet-files compares with the same values."""
import pathlib

import gdcm
import numpy as np
import pydicom
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, JPEG2000Lossless, JPEGLSLossless

COLUMNS, ROWS = 40, 33
FOLDER = pathlib.Path(__file__).with_name("streams")


def values():
    """As `values(0)` of the test: runs, steps and every byte."""
    at = np.arange(COLUMNS * ROWS)
    row = at // COLUMNS
    return np.select([row == 0, row == 1, row == 2], [7, at % 3, 0xFFF - at], (at * at + row) & 0xFFF).reshape(ROWS, COLUMNS)


def image(stored, is_signed):
    ds = Dataset()
    ds.file_meta = FileMetaDataset()
    ds.file_meta.TransferSyntaxUID, ds.file_meta.MediaStorageSOPClassUID = ExplicitVRLittleEndian, CTImageStorage
    ds.file_meta.MediaStorageSOPInstanceUID = ds.SOPInstanceUID = "2.25.1"
    ds.SOPClassUID, ds.Modality, ds.Rows, ds.Columns = CTImageStorage, "CT", ROWS, COLUMNS
    ds.SamplesPerPixel, ds.PhotometricInterpretation, ds.PixelRepresentation = 1, "MONOCHROME2", int(is_signed)
    ds.BitsAllocated, ds.BitsStored, ds.HighBit = 16, stored, stored - 1
    ds.PixelData = (values() - (0x800 if is_signed else 0)).astype("<i2").tobytes()
    ds["PixelData"].VR = "OW"
    return ds


def of_gdcm(path, kind):
    reader, change, writer = gdcm.ImageReader(), gdcm.ImageChangeTransferSyntax(), gdcm.ImageWriter()
    reader.SetFileName(str(path))
    assert reader.Read()
    change.SetTransferSyntax(gdcm.TransferSyntax(kind))
    change.SetInput(reader.GetImage())
    assert change.Change()
    writer.SetFileName(str(path))
    writer.SetFile(reader.GetFile())
    writer.SetImage(change.GetOutput())
    assert writer.Write()
    return pydicom.dcmread(path)


FOLDER.mkdir(exist_ok=True)
for stored, is_signed in ((12, False), (12, True), (16, True)):
    name = f"{'i' if is_signed else 'u'}{stored}"
    for ending, syntax in (("j2k", JPEG2000Lossless), ("jls", JPEGLSLossless)):
        ds = image(stored, is_signed)
        ds.compress(syntax, generate_instance_uid=False)
        (FOLDER / f"{name}.{ending}").write_bytes(next(pydicom.encaps.generate_frames(ds.PixelData, number_of_frames=1)))
    path = FOLDER / "frame.dcm"
    image(stored, is_signed).save_as(path, enforce_file_format=True)
    ds = of_gdcm(path, gdcm.TransferSyntax.JPEGLosslessProcess14_1)
    (FOLDER / f"{name}.jpg").write_bytes(next(pydicom.encaps.generate_frames(ds.PixelData, number_of_frames=1)))
    path.unlink()
