//! The command `host-ui scene check`: the result of loading a volume or a scene file.

use super::CommandError;
use std::path::Path;
use stylet_base::format::printable;
use stylet_files as files;
use stylet_files::dicom::Shared;
use stylet_files::together;
use stylet_implant::readers::{SeedDefaults, read_seeds};

/// Explanation of scene files.
pub const HELP: &str = concat!(
    "A scene file is TOML. All fields but [volume] may be omitted; omitted fields are inferred from the name of the structure:\n\n",
    include_str!("../../../scenes/example.toml"),
    "\nNames that are known follow TG-263: Prostate, PTV, CTV (targets), Urethra, Rectum, Bladder, PenileBulb, Bowel (spared), and so on."
);

/// Reads a volume or a scene file and prints what would be sent to the core.
pub fn check(file: &Path, label: Option<u8>) -> Result<(), CommandError> {
    let v = files::watched(file, |progress| files::read(file, label, progress))?;
    println!("{}", printable(&v.name));
    if files::scene::is_scene(file) {
        check_scene_file(file)?;
    }
    for (label, voxels) in &v.voxels_per_label {
        println!("  label {label}: {voxels} voxels");
    }
    let h_mm = v.spacing_m * 1e3;
    println!(
        "  sent as {} x {} x {} cells of {h_mm:.3} mm, {:.2} MiB",
        v.dims[0],
        v.dims[1],
        v.dims[2],
        v.cells.len() as f64 / f64::from(1 << 20)
    );
    println!(
        "  tissue: {} elements, {:.2} cc",
        v.tissue_elements(),
        v.tissue_elements() as f64 * (h_mm / 10.0).powi(3)
    );
    for t in &v.structures {
        let cells = v.cells.iter().filter(|&&c| c == t.label).count();
        println!(
            "  {} (label {}, {:?}): {cells} elements, {:.2} cc, {} kPa{}",
            printable(&t.name),
            t.label,
            t.role,
            cells as f64 * (h_mm / 10.0).powi(3),
            t.material.young_pa / 1e3,
            if t.material.fixed { ", fixed" } else { "" }
        );
    }
    let p = v.patient.to_wire();
    println!("  patient (RAS, mm) from scene:");
    for r in 0..3 {
        println!(
            "    {:8.4} {:8.4} {:8.4}  {:9.3}",
            p[3 * r],
            p[3 * r + 1],
            p[3 * r + 2],
            p[9 + r] * 1e3
        );
    }
    for warning in &v.warnings {
        println!("  note: {}", printable(warning));
    }
    Ok(())
}

/// Prints the content of a scene file except its volume; reads its plan.
fn check_scene_file(file: &Path) -> Result<(), CommandError> {
    let scene = files::scene::read(file)?;
    let plan = scene.plan.as_ref().map(|plan| file.with_file_name(plan));
    let image = scene.image.as_ref().map(|image| file.with_file_name(image));
    together(&[Some(file), image.as_deref(), plan.as_deref()], Shared::Frame)?;
    if let Some(path) = plan.as_ref().filter(|p| files::scene::is_scene(p)) {
        println!(
            "  plan: {}, read when there is a scene",
            printable(&path.display().to_string())
        );
    } else if let Some(path) = plan {
        let seeds = read_seeds(
            &path,
            SeedDefaults {
                strength_u: Some(0.0),
                ..SeedDefaults::default()
            },
        )?;
        println!(
            "  plan: {} seeds in {}",
            seeds.rows.len(),
            printable(&path.display().to_string())
        );
    }
    if let Some(path) = image {
        let image = files::watched(&path, |progress| files::Image::read(&path, progress))?;
        let [x, y, z] = image.dims;
        println!(
            "  image: {x} x {y} x {z} voxels in {}",
            printable(&path.display().to_string())
        );
    }
    if let Some(device) = &scene.device {
        println!("  device: {}, for an rt-core that host-ui starts", printable(device));
    }
    Ok(())
}
