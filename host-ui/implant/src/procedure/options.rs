//! Options of a headless procedure.

use super::parameters::parameter;
use clap::Args;
use std::path::PathBuf;
use stylet_host::core_args::CoreArgs;
use stylet_shm_schema::{MAX_LEFT_NEEDLES, ParameterChange};

/// Options of `host-ui procedure`.
#[derive(Args, Debug)]
pub struct Options {
    /// Core and scene.
    #[command(flatten)]
    pub core: CoreArgs,
    /// Folder for the results [default: out/procedure-TIME, in UTC]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Start this rt-core when none is running, and end it afterwards
    #[arg(long = "core", value_name = "PATH")]
    pub program: Option<PathBuf>,
    /// Speed of insertion in mm/s [default: that of the scene file, or 50]
    #[arg(long, value_name = "MM/S")]
    pub insert_speed: Option<f64>,
    /// Plan of many needles (TOML) from 'host-ui plan' [default: that of the scene file, or one
    /// needle through the middle]
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Rehearse every needle first, and shift the drops so that each seed comes to rest on plan
    #[arg(long)]
    pub compensate: bool,
    /// Insert this many stabilising needles first, 0 to 4; they leave no seed, hold the gland
    /// during the implant, and are withdrawn at the end
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=MAX_LEFT_NEEDLES as i64))]
    pub stabilise: u8,
    /// Source file for the score [default: the source that the plan names, 6711 or 200]
    #[arg(long, value_name = "FILE")]
    pub source: Option<PathBuf>,
    /// Set a parameter before anything else, in the window's unit, such as
    /// needle.bending_stiffness=0.016; may be given several times, and stays in force in the
    /// core
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = parameter)]
    pub parameters: Vec<ParameterChange>,
    /// Turn the force on although a fault stands; without this the procedure does not begin,
    /// because only a person re-arms after a fault
    #[arg(long)]
    pub rearm: bool,
    /// Seeds along the needle, 1 to 128, if no plan is given
    #[arg(long, default_value_t = 5, conflicts_with = "plan", value_parser = clap::value_parser!(u16).range(1..=128))]
    pub seeds: u16,
}
