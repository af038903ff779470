//! The structures of a scene as a label volume with names (NRRD, as Slicer's segmentations), for dose and for other
//! programs.

use std::path::Path;
use stylet_sim::scene::Scene;
use stylet_write::{WriteError, write_whole};

/// Writes the cells of the scene at rest; the frame is the patient's (RAS), mm.
pub fn write(path: &Path, scene: &Scene) -> Result<(), WriteError> {
    write_whole(path, &bytes(scene))
}

fn bytes(scene: &Scene) -> Vec<u8> {
    let lattice = &scene.lattice;
    let (h_mm, [x, y, z]) = (lattice.spacing_m * 1e3, lattice.dims);
    let mut text = format!(
        "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: right-anterior-superior\nsizes: {x} {y} {z}\n\
         space directions: ({h_mm},0,0) (0,{h_mm},0) (0,0,{h_mm})\nkinds: domain domain domain\nencoding: raw\n\
         space origin: ({0},{0},{0})\n",
        0.5 * h_mm
    );
    for (n, structure) in scene.structures.iter().enumerate() {
        let (name, label) = (&structure.name, structure.label);
        text += &format!(
            "Segment{n}_ID:=Segment_{label}\nSegment{n}_Name:={name}\nSegment{n}_LabelValue:={label}\nSegment{n}_Layer:=0\n"
        );
    }
    text.push('\n');
    let mut out = text.into_bytes();
    let first = out.len();
    out.resize(first + x * y * z, 0);
    for element in 0..lattice.element_count() as u32 {
        let [i, j, k] = lattice.cell(element);
        let structure = usize::from(lattice.structure(element));
        let label = scene.structures.get(structure).map_or(1, |s| s.label);
        out[first + (k * y + j) * x + i] = label;
    }
    out
}
