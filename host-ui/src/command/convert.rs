//! `host-ui convert`: label volumes, seed plans and doses from one format to another, by the names of the two files.

use super::CommandError;
use clap::Args;
use std::path::{Path, PathBuf};
use stylet_base::format::printable;
use stylet_base::{input, write_whole};
use stylet_dose::Source;
use stylet_files::convert::{can_hold_labels, write_labels};
use stylet_files::dicom::plan::{self, Date, PlanSeed, PlanSource, SeedPlan};
use stylet_files::dicom::{self, Identity};
use stylet_files::{self as files, FileError, Progress, bytes, scene};
use stylet_implant::plan::seeds;
use stylet_implant::readers::{DayOfImplant, DoseFile, SeedDefaults, SeedFile, SeedRow, read_dose};

const MAX_PLAN_BYTES: u64 = 4 << 20;

const HELP: &str = "\
What is converted into what:
  label volume   .nii .nii.gz .nrrd .nhdr .seg.nrrd .mha .mhd, .dcm (RT Structure Set, with its images beside it)
                 into .nrrd .seg.nrrd .mha .nii.gz, .dcm (RT Structure Set)
  seed plan      .csv (columns as for host-ui dose) into .dcm (RT Plan; needs --source), and back;
                 .toml (plan of host-ui) into .dcm or .csv
  dose           .csv (dose_grid.csv of host-ui dose) into .dcm (RT Dose; needs --plan) or .nrrd

Orientation and spacing are kept: NIfTI is in RAS, DICOM and MetaImage in LPS, NRRD names its own.
Losses (overlaps, structures without volume) are reported.

Examples:
  host-ui convert rtstruct.dcm gland.seg.nrrd
  host-ui convert gland.seg.nrrd rtstruct.dcm
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
    /// Source of the seeds (TOML), for a plan out of CSV; a plan out of .toml has to be of its isotope
    #[arg(long, value_name = "FILE")]
    source: Option<PathBuf>,
    /// Strength in U of seeds whose CSV gives none
    #[arg(long, value_name = "U")]
    strength_u: Option<f64>,
    /// RT Plan that a dose belongs to
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
}

impl ConvertArgs {
    pub fn run(self) -> Result<(), CommandError> {
        if is_dose(&self.from)? {
            return self.dose();
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
                "{}: a label volume is written as .nrrd, .seg.nrrd, .mha, .nii.gz or .dcm; see host-ui convert --help",
                self.to.display()
            )
            .into());
        }
        if scene::is_scene(&self.from) {
            return Err(format!("{}: give the volume that the scene file names", self.from.display()).into());
        }
        let voxels = files::read_voxels(&self.from, &Progress::default())?;
        if let Some(note) = &voxels.frame.warning {
            seeds::report(&self.from, std::slice::from_ref(note));
        }
        if to_dicom {
            let bytes = dicom::structures::write::bytes(&voxels, &Identity::new())
                .map_err(|why| FileError::of(&self.to, why))?;
            write_whole(&self.to, &bytes)?;
        } else {
            write_labels(&voxels, &self.to)?;
            let keeps_names = has_ending(&self.to, "nrrd");
            if !keeps_names && !voxels.names.is_empty() {
                eprintln!(
                    "note: names of structures have no place in this format: {}",
                    printable(&names(&voxels))
                );
            }
        }
        self.written()
    }

    fn seeds_to_plan(&self) -> Result<(), CommandError> {
        self.needs_ending("dcm", "seeds become an RT Plan")?;
        let mut file = self.read_seeds(self.source()?.as_ref())?;
        let source = match (self.source()?, &file.declared) {
            (Some(source), _) => source,
            (None, Some(declared)) => Source::known(&declared.model)
                .ok_or_else(|| format!("no source is known as \"{}\"; give --source FILE", declared.model))?,
            (None, None) => return Err("a plan needs --source FILE: DICOM has isotope and half-life in it".into()),
        };
        let agreed = file.agree(&source, None, DayOfImplant(None));
        let (prescription_gy, notes) = agreed.map_err(|why| format!("{}: {why}", self.from.display()))?;
        seeds::report(&self.from, &notes);
        let plan = SeedPlan {
            label: "Stylet".to_owned(),
            identity: Identity::new(),
            uid: dicom::new_uid(),
            prescription_gy,
            planned_on: None,
            source: PlanSource {
                model: source.model.clone(),
                manufacturer: String::new(),
                isotope: source.nuclide.clone(),
                half_life_days: stylet_dose::decay::s_to_days(source.half_life_s),
                active_length_m: source.tables.active_length_m,
            },
            seeds: file.rows.into_iter().map(plan_seed).collect(),
            notes: Vec::new(),
        };
        write_whole(&self.to, &plan::bytes(&plan)?)?;
        self.written()
    }

    fn seeds_to_csv(&self) -> Result<(), CommandError> {
        let file = self.read_seeds(self.source()?.as_ref())?;
        let mut out = String::from("x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u,needle,hole\n");
        let mut days: Vec<Date> = file.rows.iter().filter_map(|row| row.strength_on).collect();
        days.sort_unstable();
        days.dedup();
        for row in file.rows {
            let seed = plan_seed(row);
            let [x, y, z] = seed.position_m.map(|v| v * 1e3);
            let axis = seed.axis.map_or(",,".to_owned(), |[a, b, c]| format!("{a},{b},{c}"));
            let needle = seed.needle.map_or_else(String::new, |n| n.to_string());
            // The only characters that would end the field.
            let hole = seed.hole.replace([',', '"', '\n', '\r'], " ");
            out.push_str(&format!("{x},{y},{z},{axis},{},{needle},{hole}\n", seed.strength_u));
        }
        write_whole(&self.to, out.as_bytes())?;
        if !days.is_empty() {
            let days: Vec<String> = days.iter().map(Date::to_string).collect();
            seeds::report(
                &self.from,
                &[format!(
                    "a table has no place for the day of a strength: they are those of {}",
                    days.join(", ")
                )],
            );
        }
        self.written()
    }

    fn source(&self) -> Result<Option<Source>, CommandError> {
        Ok(self.source.as_deref().map(Source::read).transpose()?)
    }

    fn read_seeds(&self, source: Option<&Source>) -> Result<SeedFile, CommandError> {
        let defaults = SeedDefaults {
            strength_u: self.strength_u,
            strength_per_activity_u_per_mci: source.and_then(|s| s.strength_per_activity_u_per_mci),
        };
        Ok(seeds::read(&self.from, defaults)?)
    }

    fn dose(&self) -> Result<(), CommandError> {
        let grid = read_dose(&self.from)?;
        if has_ending(&self.to, "nrrd") {
            write_whole(&self.to, &dose_nrrd(&grid))?;
            return self.written();
        }
        self.needs_ending("dcm", "a dose out of CSV becomes an RT Dose or .nrrd")?;
        let plan = self
            .plan
            .as_deref()
            .ok_or("an RT Dose needs --plan FILE: the RT Plan that it is the dose of")?;
        let image = dicom::dose::DoseImage {
            dims: grid.dims,
            origin_m: grid.origin_m,
            spacing_m: grid.spacing_m,
            dose_gy: &grid.dose_gy,
        };
        write_whole(&self.to, &dicom::dose::bytes(&image, &plan::open(plan)?)?)?;
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

fn plan_seed(row: SeedRow) -> PlanSeed {
    PlanSeed {
        needle: row.needle,
        hole: row.hole.unwrap_or_default(),
        position_m: row.seed.position_m,
        axis: row.seed.axis,
        strength_u: row.seed.strength_u,
        strength_on: row.strength_on,
    }
}

/// Scene files end in .toml as well.
fn is_plan_file(path: &Path) -> bool {
    has_ending(path, "toml") && input::read_text(path, MAX_PLAN_BYTES).is_ok_and(|text| text.contains("\"stylet plan,"))
}

fn is_dose(path: &Path) -> Result<bool, CommandError> {
    Ok(has_ending(path, "csv") && first_line(path)?.contains("dose_gy"))
}

fn names(voxels: &files::Voxels) -> String {
    let each: Vec<String> = voxels.names.iter().map(|(l, n)| format!("{l}={n}")).collect();
    each.join(", ")
}

fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

fn first_line(path: &Path) -> Result<String, CommandError> {
    let bytes = bytes::whole(path, &Progress::default()).map_err(|why| FileError::of(path, why))?;
    let line = bytes
        .split(|&b| b == b'\n')
        .find(|l| !l.starts_with(b"#"))
        .unwrap_or_default();
    Ok(String::from_utf8_lossy(line).to_ascii_lowercase())
}

/// In double precision, so that nothing is lost.
fn dose_nrrd(grid: &DoseFile) -> Vec<u8> {
    let [x, y, z] = grid.origin_m.map(|v| v * 1e3);
    let [a, b, c] = grid.spacing_m.map(|v| v * 1e3);
    let [nx, ny, nz] = grid.dims;
    let mut out = format!(
        "NRRD0004\n# dose in Gy\ntype: double\ndimension: 3\nspace: right-anterior-superior\nsizes: {nx} {ny} {nz}\n\
         space directions: ({a},0,0) (0,{b},0) (0,0,{c})\nkinds: domain domain domain\nendian: little\nencoding: raw\n\
         space origin: ({x},{y},{z})\n\n"
    )
    .into_bytes();
    grid.dose_gy.iter().for_each(|d| out.extend(d.to_le_bytes()));
    out
}
