//! The window.

use std::path::PathBuf;
use stylet_shm_schema::service::Instance;

pub struct Options {
    pub instance: Instance,
    pub scene: Option<PathBuf>,
    pub label: Option<u8>,
}

pub fn run(_options: Options) -> Result<(), String> {
    Err("this build has no window".to_owned())
}
