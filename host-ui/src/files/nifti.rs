//! A segmented volume from a NIfTI-1 file (.nii, .nii.gz); believes nothing that its header says.

use super::affine::{VoxelFrame, voxel_frame};
use super::volume::{LabelVolume, Voxels};
use nifti::{IntoNdArray, NiftiHeader, NiftiObject, NiftiType, ReaderStreamedOptions};
use std::io::Read;
use std::path::Path;

const HEADER_BYTES: u64 = 348;
/// A volume with more voxels is not a prostate.
const MAX_VOXELS: u64 = 1 << 30;
/// Nothing that deflate makes is larger than this many times its file.
const MAX_DEFLATE_RATIO: u64 = 1032;
const MAX_VOX_OFFSET: f32 = 16_777_216.0;

/// Why a file was not taken: what was found, what was expected, what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError(pub String);

impl std::fmt::Display for FileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for FileError {}

/// The tissue of a label volume: every label but 0, or the one asked for.
pub fn read(path: &Path, label: Option<u8>) -> Result<LabelVolume, FileError> {
    let voxels = read_voxels(path)?;
    let name = path
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    LabelVolume::from_voxels(&voxels, label, name).map_err(|why| told(path, &why))
}

/// The labels as they lie in the file.
pub fn read_voxels(path: &Path) -> Result<Voxels, FileError> {
    let told = |why: String| told(path, &why);
    let (header, frame, dims) = read_header(path).map_err(told)?;
    // The crate has assertions of its own about what it reads.
    let labels = std::panic::catch_unwind(|| read_labels(path, &header, dims))
        .unwrap_or_else(|_| Err("its voxels could not be read; write the file again".to_owned()))
        .map_err(told)?;
    Ok(Voxels { dims, labels, frame })
}

fn told(path: &Path, why: &str) -> FileError {
    FileError(format!("{}: {why}", path.display()))
}

fn read_header(path: &Path) -> Result<(NiftiHeader, VoxelFrame, [usize; 3]), String> {
    let file_bytes = check_file(path)?;
    let header = NiftiHeader::from_file(path).map_err(|e| match e {
        nifti::NiftiError::Io(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => format!(
            "it is cut off: {file_bytes} bytes, and the header alone needs {HEADER_BYTES}; copy or export it again"
        ),
        nifti::NiftiError::InvalidFormat => {
            "its magic is not \"n+1\", so it is no NIfTI-1 file; export the segmentation as NIfTI-1 (.nii or .nii.gz)"
                .to_owned()
        }
        other => format!("its header cannot be read ({other}); export the segmentation as NIfTI-1 again"),
    })?;
    let dims = checked_dims(&header)?;
    check_size(path, &header, dims, file_bytes)?;
    let frame = voxel_frame(&header)?;
    Ok((header, frame, dims))
}

fn is_gz(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"))
}

fn check_file(path: &Path) -> Result<u64, String> {
    let kind = std::fs::metadata(path).map_err(|e| format!("it cannot be opened ({e}); check the path"))?;
    if !kind.is_file() {
        return Err("it is not a file; give the path of a .nii or .nii.gz file".to_owned());
    }
    if kind.len() == 0 {
        return Err("it is empty; copy or export it again".to_owned());
    }
    let mut start = Vec::new();
    std::fs::File::open(path)
        .and_then(|f| f.take(4).read_to_end(&mut start))
        .map_err(|e| format!("it cannot be read ({e}); check its permissions"))?;
    let packed = start.starts_with(&[0x1f, 0x8b]);
    match (is_gz(path), packed) {
        (true, false) => Err("its name ends in .gz but it is not gzip data; rename it to .nii".to_owned()),
        (false, true) => Err("it is gzip data; rename it to .nii.gz".to_owned()),
        (false, false) if start == 540_i32.to_le_bytes() || start == 540_i32.to_be_bytes() => {
            Err("it is NIfTI-2; convert it to NIfTI-1".to_owned())
        }
        _ => Ok(kind.len()),
    }
}

fn checked_dims(h: &NiftiHeader) -> Result<[usize; 3], String> {
    let rank = usize::from(h.dim[0]);
    if !(3..=7).contains(&rank) {
        return Err(format!("it has {rank} dimensions; a segmentation has 3"));
    }
    let dims = [1, 2, 3].map(|a| usize::from(h.dim[a]));
    if dims.contains(&0) || dims.iter().any(|&d| d > 32767) {
        return Err(format!(
            "its size is {} x {} x {} voxels; each must be 1 to 32767",
            dims[0], dims[1], dims[2]
        ));
    }
    if h.dim[4..=rank].iter().any(|&d| d != 1) {
        return Err(format!(
            "it holds a series of volumes ({:?}); take one volume out of it",
            &h.dim[1..=rank]
        ));
    }
    Ok(dims)
}

/// Before anything as large as the header claims is read or allocated.
fn check_size(path: &Path, h: &NiftiHeader, dims: [usize; 3], file_bytes: u64) -> Result<(), String> {
    let voxel_bytes = match h.data_type() {
        Ok(
            t @ (NiftiType::Uint8
            | NiftiType::Int8
            | NiftiType::Int16
            | NiftiType::Uint16
            | NiftiType::Int32
            | NiftiType::Uint32
            | NiftiType::Int64
            | NiftiType::Uint64
            | NiftiType::Float32
            | NiftiType::Float64),
        ) => t.size_of() as u64,
        _ => {
            return Err(format!(
                "its data type is number {}; labels must be whole numbers (uint8 is best)",
                h.datatype
            ));
        }
    };
    if &h.magic != b"n+1\0" {
        return Err("it is the header of a .hdr/.img pair; convert it to one .nii file".to_owned());
    }
    if !(352.0..=MAX_VOX_OFFSET).contains(&h.vox_offset) {
        return Err(format!(
            "its voxels begin at byte {}; expected 352 or a little more",
            h.vox_offset
        ));
    }
    let voxels = dims.iter().map(|&d| d as u64).product::<u64>();
    if voxels > MAX_VOXELS {
        return Err(format!(
            "its header claims {} x {} x {} voxels, more than {MAX_VOXELS}; crop it to the gland",
            dims[0], dims[1], dims[2]
        ));
    }
    let needed = h.vox_offset as u64 + voxels * voxel_bytes;
    let most = if is_gz(path) {
        file_bytes.saturating_mul(MAX_DEFLATE_RATIO)
    } else {
        file_bytes
    };
    if needed > most {
        return Err(format!(
            "it is cut off or its header is wrong: the header asks for {needed} bytes and the file of {file_bytes} bytes cannot hold them; copy or export it again"
        ));
    }
    Ok(())
}

fn read_labels(path: &Path, h: &NiftiHeader, dims: [usize; 3]) -> Result<Vec<u8>, String> {
    let cut = |e: nifti::NiftiError| format!("it is cut off or damaged ({e}); copy or export it again");
    let mut volume = ReaderStreamedOptions::new()
        .read_file_rank(path, 2)
        .map_err(cut)?
        .into_volume();
    if h.dim[1..4].iter().zip(dims).any(|(&a, b)| usize::from(a) != b) {
        return Err("it changed while it was read".to_owned());
    }
    let mut labels = Vec::with_capacity(dims.iter().product());
    for _ in 0..dims[2] {
        let slice = volume.read_slice().map_err(cut)?;
        let values = slice.into_ndarray::<f64>().map_err(cut)?;
        // Transposed, so that x runs fastest.
        for &value in values.t() {
            labels.push(label_of(value)?);
        }
    }
    if labels.len() != dims.iter().product::<usize>() {
        return Err("it holds another number of voxels than its header says; export it again".to_owned());
    }
    Ok(labels)
}

fn label_of(value: f64) -> Result<u8, String> {
    let whole = value.round();
    if (value - whole).abs() < 1e-3 && (0.0..=255.0).contains(&whole) {
        return Ok(whole as u8);
    }
    Err(format!(
        "it holds the value {value}; a segmentation holds whole numbers 0 to 255. Is this the image instead of its labels?"
    ))
}

#[cfg(test)]
mod tests;
