//! The command `host-ui export`: tables and motions of a recording.

use clap::Args;
use std::path::PathBuf;
use stylet_host::record::{self, Export, RecordError};

/// Options of `host-ui export`.
#[derive(Args, Debug)]
#[group(id = "made", required = true, multiple = true, args = ["csv", "motion", "csv_2", "motion_2"])]
pub struct ExportArgs {
    /// Recording made by 'host-ui record'
    recording: PathBuf,
    /// Table with one row per tick
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Motion of the hand, for 'rt-core --device replay:FILE'
    #[arg(long, value_name = "FILE")]
    motion: Option<PathBuf>,
    /// Table with one row per tick of the second device
    #[arg(long = "csv-2", value_name = "FILE.csv")]
    csv_2: Option<PathBuf>,
    /// Motion of the second hand, for 'rt-core --device-2 replay:FILE'
    #[arg(long = "motion-2", value_name = "FILE")]
    motion_2: Option<PathBuf>,
}

impl ExportArgs {
    /// Writes the requested files.
    pub fn run(self) -> Result<(), RecordError> {
        record::export(&Export {
            recording: self.recording,
            csv: self.csv,
            motion: self.motion,
            csv_2: self.csv_2,
            motion_2: self.motion_2,
        })
    }
}
