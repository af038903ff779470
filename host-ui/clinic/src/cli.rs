//! The command line of `stylet-clinic`.

use crate::CommandError;
use crate::class::ClassArgs;
use crate::compare::CompareArgs;
use crate::convert::ConvertArgs;
use crate::dicom::DicomArgs;
use crate::dose::DoseArgs;
use crate::find_seeds::FindSeedsArgs;
use crate::perturb::PerturbArgs;
use crate::plan::PlanArgs;
use crate::post_implant::PostImplantArgs;
use crate::scene;
use crate::sources::SourcesArgs;
use crate::study::StudyArgs;
use clap::{CommandFactory, Parser, Subcommand};
use std::path::PathBuf;
use stylet_manual::ManualArgs;

/// Plans, doses, images and results of Stylet as files.
///
/// `host-ui dose` and `stylet-clinic dose` are the same command, and so are the others.
#[derive(Parser, Debug)]
#[command(name = "stylet-clinic", version)]
pub struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand, Debug)]
enum Task {
    /// Segmented volumes and scene files
    #[command(subcommand)]
    Scene(SceneTask),
    /// Convert label volumes, seed plans and doses between formats, DICOM among them
    Convert(ConvertArgs),
    /// Write structure set, plan and dose of one study as DICOM files that name each other
    Dicom(Box<DicomArgs>),
    /// Make a plan for the running scene: needles through the template, seeds, their strength; or
    /// from a table of seeds
    Plan(PlanArgs),
    /// Compute the dose of seeds (TG-43U1) at points, in structures, or on a grid
    Dose(DoseArgs),
    /// Find the implanted seeds in a CT volume, including seeds that touch
    FindSeeds(FindSeedsArgs),
    /// Compare the implant as planned, delivered, on day 0 and on day 30: dose, sectors, indices
    /// and effect
    PostImplant(Box<PostImplantArgs>),
    /// Compute the difference of two doses, each an RT Dose or a dose_grid.csv
    Compare(CompareArgs),
    /// Compute the dose of a plan under random seed errors
    Perturb(PerturbArgs),
    /// Compare distributions and dose of the insertions of 'rt-core study' with published values
    Study(StudyArgs),
    /// Compare the trainees of a class and their progress: a page and a table
    Class(ClassArgs),
    /// List the sources of the program with their publications, or import one from published tables
    Sources(SourcesArgs),
    /// Write the man pages and shell completions of this program
    Manual(ManualArgs),
}

#[derive(Subcommand, Debug)]
enum SceneTask {
    /// Read a volume or a scene file and print what would be sent to rt-core
    #[command(after_long_help = scene::HELP)]
    Check {
        /// NIfTI-1, NRRD (also Slicer's .seg.nrrd), MetaImage, DICOM RT Structure Set or Segmentation, or a scene
        /// file (.toml)
        file: PathBuf,
        /// Label of the gland [default: all but 0]
        #[arg(long, value_name = "N")]
        label: Option<u8>,
    },
}

impl Cli {
    /// Executes the command.
    ///
    /// # Errors
    ///
    /// The text for the terminal: the failure and its remedy.
    pub fn run(self) -> Result<(), CommandError> {
        stylet_manual::end_with_reader();
        match self.task {
            Task::Scene(SceneTask::Check { file, label }) => scene::check(&file, label),
            Task::Convert(args) => args.run(),
            Task::Dicom(args) => args.run(),
            Task::FindSeeds(args) => args.run(),
            Task::PostImplant(args) => args.run(),
            Task::Compare(args) => args.run(),
            Task::Plan(args) => args.run(),
            Task::Dose(args) => args.run(),
            Task::Perturb(args) => args.run(),
            Task::Study(args) => args.run(),
            Task::Class(args) => args.run(),
            Task::Sources(args) => args.run(),
            Task::Manual(args) => Ok(args.run(Self::command())?),
        }
    }
}
