//! Claims of studies: results follow from ids alone, nothing is done twice, and a wrong study file is refused as a
//! whole.

mod file;
mod population;
mod shards;
mod validation;

use crate::Study;
use std::path::Path;

/// Two needles, one of them with a strand, in the middle of the gland of `paper`.
pub const PLAN: &str = r#"
format = "stylet plan, mm, RAS"
source = "6711"
prescription_gy = 145.0
[template]
middle_hole_mm = [73.0, 42.3, 86.4]
columns = [-1.0, 0.0, 0.0]
rows = [0.0, 1.0, 0.0]
inwards = [0.0, 0.0, 1.0]
pitch_mm = 5.0
[[needle]]
hole = "G7"
entry_mm = [73.0, 42.3, 86.4]
direction = [0.0, 0.0, 1.0]
depth_mm = 45.0
seed_along_mm = [35.0, 45.0]
strength_u = [0.4, 0.5]
[[needle]]
entry_mm = [83.0, 42.3, 86.4]
direction = [0.0, 0.0, 1.0]
depth_mm = 45.0
spacer_mm = 5.5
seed_along_mm = [45.0, 35.0]
strength_u = [0.5, 0.5]
"#;

/// Returns a study file of the plan above, with keys after the name.
pub fn text(keys: &str) -> String {
    format!("name = \"t\"\n{keys}\n[[gland]]\nscene = \"paper\"\nplan = \"plan.toml\"\n")
}

/// Returns the study of a text and the plan above, or each problem with it.
fn study_in(folder: &Path, text: &str) -> Result<Study, Vec<String>> {
    std::fs::write(folder.join("plan.toml"), PLAN).expect("a folder of the test");
    Study::of_text(text, folder).map_err(|problems| problems.0.iter().map(ToString::to_string).collect())
}
