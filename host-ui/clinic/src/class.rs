//! The command `host-ui class`: comparison of trainees, and of each one's progress.

use super::CommandError;
use crate::trainees::{self, Class};
use clap::Args;
use std::path::PathBuf;
use stylet_base::output::new_folder;
use stylet_base::{write_streamed, write_whole};

const HELP: &str = "\
Reads DIR/NAME/DATE/score.json, which 'host-ui --class DIR --name NAME' writes at the end of each procedure. Folders of several rooms
or days may be given together; a NAME in two of them is one trainee. A file that is not a debrief is left out and named on the page.

Written to --out, a new or empty folder: class.html (self-contained) and class.csv.

Example:
  host-ui class monday tuesday --out class-page";

/// Options of `host-ui class`.
#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct ClassArgs {
    /// Folders of a class
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Folder for the page and the table
    #[arg(long, default_value = "out/class", value_name = "DIR")]
    out: PathBuf,
}

impl ClassArgs {
    /// Executes the command.
    pub fn run(self) -> Result<(), CommandError> {
        let class = Class::read(&self.folders)?;
        new_folder(&self.out)?;
        write_whole(&self.out.join("class.html"), trainees::page(&class).as_bytes())?;
        let table = self.out.join("class.csv");
        write_streamed(&table, |file| {
            trainees::write_table(&class, file).map_err(std::io::Error::other)
        })?;
        for why in &class.left_out {
            println!("left out: {}", stylet_base::format::printable_line(why));
        }
        println!(
            "{} trainees, {} procedures",
            class.trainees().len(),
            class.attempts.len()
        );
        println!("written: {}", self.out.join("class.html").display());
        Ok(())
    }
}
