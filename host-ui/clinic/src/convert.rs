//! The command `host-ui convert`: conversion of label volumes, seed plans and doses, by the names
//! of the two files.

use super::CommandError;
use super::dicom::identity_of;
use super::dose::write;
use clap::Args;
use std::path::{Path, PathBuf};
use stylet_base::format::printable;
use stylet_base::input::{self, has_ending};
use stylet_base::write_whole;
use stylet_dose::Source;
use stylet_files::convert::{can_hold_labels, write_labels};
use stylet_files::dicom::images::Slice;
use stylet_files::dicom::plan::{self, SeedPlan};
use stylet_files::dicom::segmentation::{self, is_segmentation};
use stylet_files::dicom::structures::write::{Outlined, Written, of_set, of_voxels};
use stylet_files::dicom::structures::{self, StructureSet};
use stylet_files::dicom::{self, Identity, RT_DOSE, RT_PLAN};
use stylet_files::{self as files, FileError, bytes, scene};
use stylet_implant::plan::exchange::seeds_of_source;
use stylet_implant::plan::seeds;
use stylet_implant::readers::{Mapped, SeedDefaults, SeedFile, is_dose_volume, places_m, read_any_dose, read_source};

const MAX_PLAN_BYTES: u64 = 4 << 20;

const HELP: &str = "\
Conversions:
  label volume   .nii .nii.gz .nrrd .nhdr .seg.nrrd .mha .mhd, .dcm (RT Structure Set, with its images in the same folder;
                 Segmentation) into .nrrd .seg.nrrd .mha .nii.gz, .dcm (RT Structure Set), .seg.dcm (Segmentation)
  seed plan      .csv (columns as for host-ui dose) into .dcm (RT Plan; needs --source), and back;
                 .toml (plan of host-ui) into .dcm or .csv; .dcm into .dcm
  dose           .csv (dose_grid.csv of host-ui dose) into .dcm (RT Dose; needs --plan) or .nrrd;
                 .dcm (RT Dose) or .nrrd of a dose into .csv, .nrrd or .dcm

Patient, study and frame of reference of a DICOM file are kept: in tables as comment lines, in NRRD as pairs of the header. NIfTI
and MetaImage lose them: give --like FILE, a DICOM file of the same patient, when you convert back to DICOM. Files of two patients or
frames are refused. Use host-ui dicom to write files that belong together (structure set, plan and dose of one study).

Orientation and spacing are kept: NIfTI is in RAS, DICOM and MetaImage in LPS, NRRD names its own.
Losses (overlaps, structures without volume) are reported.

Examples:
  host-ui convert rtstruct.dcm gland.seg.nrrd
  host-ui convert gland.seg.nrrd rtstruct.dcm
  host-ui convert gland.seg.nrrd gland.seg.dcm --like ct/slice001.dcm
  host-ui convert seeds.csv plan.dcm --source sources/i125_6711.toml --strength-u 0.5
  host-ui convert plan.dcm seeds.csv
  host-ui convert plan.toml plan.dcm
  host-ui convert dose/dose_grid.csv dose.dcm --plan plan.dcm";

#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct ConvertArgs {
    /// File to read; its content decides the format
    from: PathBuf,
    /// File to write; its name decides the format
    to: PathBuf,
    /// Source of the seeds (TOML), for a plan from CSV; must have the isotope of a plan from .toml
    #[arg(long, value_name = "FILE")]
    source: Option<PathBuf>,
    /// Strength in U of seeds whose CSV gives none
    #[arg(long, value_name = "U")]
    strength_u: Option<f64>,
    /// Meaning of a column in the table of seeds: NAME=HEADER with its unit, as in
    /// x_mm=-Lateral:cm; may be given several times
    #[arg(long = "column", value_name = "NAME=HEADER[:UNIT]")]
    columns: Vec<Mapped>,
    /// RT Plan to which a dose belongs
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// DICOM file that provides patient, study and frame of reference, instead of the input file
    #[arg(long, value_name = "FILE")]
    like: Option<PathBuf>,
}

impl ConvertArgs {
    pub fn run(self) -> Result<(), CommandError> {
        if is_dose(&self.from)? || dicom_class(&self.from)?.as_deref() == Some(RT_DOSE) {
            return self.dose();
        }
        if dicom_class(&self.from)?.as_deref() == Some(RT_PLAN) && has_ending(&self.to, "dcm") {
            return self.plan_again();
        }
        if has_ending(&self.from, "csv") || is_plan_file(&self.from) {
            return match has_ending(&self.to, "csv") {
                true => self.seeds_to_csv(),
                false => self.seeds_to_plan(),
            };
        }
        if has_ending(&self.to, "csv") {
            return self.seeds_to_csv();
        }
        self.labels()
    }

    fn labels(&self) -> Result<(), CommandError> {
        let to_dicom = has_ending(&self.to, "dcm");
        if !to_dicom && !can_hold_labels(&self.to) {
            return Err(format!(
                "{}: a label volume is written as .nrrd, .seg.nrrd, .mha, .nii.gz, .dcm or .seg.dcm; see host-ui convert --help",
                self.to.display()
            )
            .into());
        }
        if scene::is_scene(&self.from) {
            return Err(format!("{}: give the volume that the scene file names", self.from.display()).into());
        }
        let to_segmentation = bytes::file_name(&self.to).to_ascii_lowercase().ends_with(".seg.dcm");
        let class = dicom_class(&self.from)?;
        if to_dicom && !to_segmentation && class.is_some_and(|class| !is_segmentation(&class)) {
            return self.structures_again();
        }
        let identity = self.identity()?;
        let voxels = files::watched(&self.from, |progress| files::read_voxels(&self.from, progress))?;
        // Contours may overlap, but a voxel has one label.
        let lost = voxels.overlap.iter().filter(|_| !to_dicom);
        for note in voxels.frame.warning.iter().chain(lost) {
            seeds::report(&self.from, std::slice::from_ref(note));
        }
        let refused = |why| FileError::of(&self.to, why);
        if to_segmentation {
            let identity = identity.unwrap_or_default().completed();
            let content = segmentation::write::bytes(&voxels, &identity).map_err(refused)?;
            write_whole(&self.to, &content)?;
        } else if to_dicom {
            let structures = of_voxels(&voxels).map_err(refused)?;
            self.write_structures(&identity.unwrap_or_default().completed(), &[], &structures)?;
        } else {
            write_labels(&voxels, &self.to, identity.as_ref())?;
            let keeps_names = has_ending(&self.to, "nrrd");
            if !keeps_names && !voxels.names.is_empty() {
                eprintln!(
                    "note: names of structures have no place in this format: {}",
                    printable(&names(&voxels))
                );
            }
            if !keeps_names && identity.is_some() {
                eprintln!(
                    "note: patient and frame of reference have no place in this format, so they are not compared later"
                );
            }
        }
        self.written()
    }

    /// Writes a structure set again, contour by contour, on the images in its folder.
    fn structures_again(&self) -> Result<(), CommandError> {
        let refused = |why| FileError::of(&self.from, why);
        let content = files::watched(&self.from, |progress| bytes::whole(&self.from, progress)).map_err(refused)?;
        let object = dicom::read(&content).map_err(refused)?;
        let set = StructureSet::of(&object).map_err(refused)?;
        seeds::report(&self.from, &set.notes);
        let of_file = Identity::of(&object);
        let found = dicom::images::find(bytes::folder(&self.from), &set.series, &set.images, &of_file);
        let (images, notes) = found.map_err(refused)?;
        seeds::report(&self.from, &notes);
        let identity = self.identity()?.unwrap_or(of_file).completed();
        self.write_structures(&identity, &images, &of_set(set))?;
        self.written()
    }

    fn write_structures(
        &self,
        identity: &Identity,
        images: &[Slice],
        structures: &[Outlined],
    ) -> Result<(), CommandError> {
        let set = Written {
            uid: &dicom::new_uid(),
            identity,
            images,
            structures,
        };
        let bytes = structures::write::bytes(&set).map_err(|why| FileError::of(&self.to, why))?;
        Ok(write_whole(&self.to, &bytes)?)
    }

    fn plan_again(&self) -> Result<(), CommandError> {
        let plan = plan::open(&self.from)?;
        let plan = SeedPlan {
            identity: self.identity()?.unwrap_or_default().completed(),
            uid: dicom::new_uid(),
            ..plan
        };
        write_whole(&self.to, &plan::bytes(&plan)?)?;
        self.written()
    }

    /// Returns the identity of --like, else that of the input file, else that of the plan of a dose.
    fn identity(&self) -> Result<Option<Identity>, CommandError> {
        identity_of(self.like.as_deref(), &[Some(&*self.from), self.plan.as_deref()])
    }

    fn seeds_to_plan(&self) -> Result<(), CommandError> {
        self.needs_ending("dcm", "seeds become an RT Plan")?;
        let mut file = self.read_seeds(self.source()?.as_ref())?;
        let source = match (self.source()?, &file.declared) {
            (Some(source), _) => source,
            (None, Some(declared)) => {
                Source::named(&declared.model).map_err(|why| format!("{why}; give --source FILE"))?
            }
            (None, None) => return Err("a plan needs --source FILE: DICOM has isotope and half-life in it".into()),
        };
        let agreed = file.agree(&source, None, None);
        let (prescription_gy, notes) = agreed.map_err(|why| format!("{}: {why}", self.from.display()))?;
        seeds::report(&self.from, &notes);
        let identity = self.identity()?.unwrap_or_default().completed();
        let plan = seeds_of_source(&source, file.rows, prescription_gy, identity);
        write_whole(&self.to, &plan::bytes(&plan)?)?;
        self.written()
    }

    fn seeds_to_csv(&self) -> Result<(), CommandError> {
        let file = self.read_seeds(self.source()?.as_ref())?;
        let identity = self.identity()?.as_ref().map(Identity::comments).unwrap_or_default();
        let is_dated = file.rows.iter().any(|row| row.strength_on.is_some());
        let dated = if is_dated { "strength_date," } else { "" };
        let mut out = format!("{identity}x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u,{dated}needle,hole\n");
        for seed in file.rows {
            let [x, y, z] = seed.position_m.map(|v| v * 1e3);
            let axis = seed.axis.map_or(",,".to_owned(), |[a, b, c]| format!("{a},{b},{c}"));
            let needle = seed.needle.map_or_else(String::new, |n| n.to_string());
            // These characters would end the field.
            let hole = seed.hole.replace([',', '"', '\n', '\r'], " ");
            let day = seed.strength_on.map_or_else(String::new, |day| day.to_string());
            let day = if is_dated { day + "," } else { day };
            out.push_str(&format!(
                "{x},{y},{z},{axis},{},{day}{needle},{hole}\n",
                seed.strength_u
            ));
        }
        write_whole(&self.to, out.as_bytes())?;
        self.written()
    }

    fn source(&self) -> Result<Option<Source>, CommandError> {
        Ok(self.source.as_deref().map(read_source).transpose()?)
    }

    fn read_seeds(&self, source: Option<&Source>) -> Result<SeedFile, CommandError> {
        let defaults = SeedDefaults {
            strength_u: self.strength_u,
            strength_per_activity_u_per_mci: source.and_then(|s| s.strength_per_activity_u_per_mci),
            columns: self.columns.clone(),
        };
        let mut read = seeds::read(&self.from, defaults)?;
        seeds::report(&self.from, &std::mem::take(&mut read.notes));
        Ok(read)
    }

    fn dose(&self) -> Result<(), CommandError> {
        let dose = read_any_dose(&self.from)?;
        seeds::report(&self.from, &dose.notes);
        let identity = self.identity()?;
        if has_ending(&self.to, "nrrd") {
            write_whole(&self.to, &dose_nrrd(&dose, identity.as_ref()))?;
            return self.written();
        }
        if has_ending(&self.to, "csv") {
            let comments = identity.as_ref().map(Identity::comments).unwrap_or_default() + &dose.kind.comments();
            write::doses_after(&comments, &self.to, places_m(&dose), &dose.dose_gy)?;
            return self.written();
        }
        self.needs_ending("dcm", "a dose becomes an RT Dose, .nrrd or .csv")?;
        let other = self.plan.as_deref().map(plan::open).transpose()?.map(|plan| plan.uid);
        let plan = other.or(dose.plan.clone());
        let plan = plan.ok_or("an RT Dose needs --plan FILE: the RT Plan that it is the dose of")?;
        let image = dicom::dose::DoseImage {
            dims: dose.dims,
            origin_m: dose.origin_m,
            spacing_m: dose.spacing_m,
            dose_gy: &dose.dose_gy,
            kind: &dose.kind,
        };
        let of = dicom::dose::DoseOf {
            uid: &dicom::new_uid(),
            identity: &identity.unwrap_or_default().completed(),
            plan: &plan,
            structure_set: None,
            histograms: &[],
        };
        let bytes = dicom::dose::bytes(&image, &of).map_err(|why| FileError::of(&self.to, why))?;
        write_whole(&self.to, &bytes)?;
        self.written()
    }

    fn needs_ending(&self, ending: &str, why: &str) -> Result<(), CommandError> {
        if has_ending(&self.to, ending) {
            return Ok(());
        }
        Err(format!("{}: {why}, so its name must end in .{ending}", self.to.display()).into())
    }

    fn written(&self) -> Result<(), CommandError> {
        println!("written: {}", self.to.display());
        Ok(())
    }
}

/// Returns the SOP class of a DICOM file; `None` for any other.
fn dicom_class(path: &Path) -> Result<Option<String>, CommandError> {
    let refused = |why| FileError::of(path, why);
    if !bytes::start(path, 160).is_some_and(|start| dicom::is_dicom(&start)) {
        return Ok(None);
    }
    let content = files::watched(path, |progress| bytes::whole(path, progress)).map_err(refused)?;
    Ok(Some(dicom::read(&content).map_err(refused)?.sop_class))
}

/// Returns whether the file is a plan; scene files end in .toml as well.
fn is_plan_file(path: &Path) -> bool {
    has_ending(path, "toml") && input::read_text(path, MAX_PLAN_BYTES).is_ok_and(|text| text.contains("\"stylet plan,"))
}

fn is_dose(path: &Path) -> Result<bool, CommandError> {
    Ok(is_dose_volume(path) || has_ending(path, "csv") && first_line(path)?.contains("dose_gy"))
}

fn names(voxels: &files::Voxels) -> String {
    let each: Vec<String> = voxels.names.iter().map(|(l, n)| format!("{l}={n}")).collect();
    each.join(", ")
}

fn first_line(path: &Path) -> Result<String, CommandError> {
    let bytes =
        files::watched(path, |progress| bytes::whole(path, progress)).map_err(|why| FileError::of(path, why))?;
    let line = bytes
        .split(|&b| b == b'\n')
        .find(|l| !l.starts_with(b"#"))
        .unwrap_or_default();
    Ok(String::from_utf8_lossy(line).to_ascii_lowercase())
}

/// Writes the dose in double precision, without loss.
fn dose_nrrd(grid: &dicom::dose::ReadDose, identity: Option<&Identity>) -> Vec<u8> {
    let pairs = identity.map(Identity::pairs).unwrap_or_default() + &grid.kind.pairs();
    let [x, y, z] = grid.origin_m.map(|v| v * 1e3);
    let [a, b, c] = grid.spacing_m.map(|v| v * 1e3);
    let [nx, ny, nz] = grid.dims;
    let mut out = format!(
        "NRRD0004\ntype: double\ndimension: 3\nspace: right-anterior-superior\nsizes: {nx} {ny} {nz}\n\
         space directions: ({a},0,0) (0,{b},0) (0,0,{c})\nkinds: domain domain domain\nendian: little\nencoding: raw\n\
         space origin: ({x},{y},{z})\ndose_units:=GY\n{pairs}\n"
    )
    .into_bytes();
    grid.dose_gy.iter().for_each(|d| out.extend(d.to_le_bytes()));
    out
}

#[cfg(test)]
mod tests {
    use super::HELP;

    /// Guards against a format that is read and not on the pages.
    #[test]
    fn the_help_and_the_page_name_every_format_of_label_volumes() {
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/formats.md");
        let page = std::fs::read_to_string(page).expect("the page");
        let names = stylet_files::open::FORMATS.split(['(', ')', ',', ' ']);
        for ending in names.filter(|name| name.starts_with('.')) {
            assert!(HELP.contains(ending), "{ending} is not in the help");
            assert!(
                page.contains(&format!("`{ending}`")) || ending == ".dcm",
                "{ending} is not on the page"
            );
        }
    }
}
