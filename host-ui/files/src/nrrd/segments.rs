//! Slicer's segments: names, label values and layers, from the pairs of an NRRD header.

use super::super::element::short;
use super::super::frame::VoxelFrame;
use super::super::overlap;
use super::super::volume::Voxels;
use super::Pairs;
use super::header::Header;
use crate::error::{ContentError, invalid};
use std::collections::BTreeMap;

const MAX_SEGMENTS: usize = 255;

#[derive(Debug, PartialEq)]
struct Segment {
    name: String,
    value: u8,
    layer: usize,
}

/// Returns the names by label of a volume without layers.
pub fn names(pairs: &Pairs) -> Result<BTreeMap<u8, String>, ContentError> {
    let mut names = BTreeMap::new();
    for segment in segments(pairs)? {
        if let Some(other) = names.insert(segment.value, segment.name.clone()) {
            return Err(invalid!(
                "its segments \"{}\" and \"{}\" both have label {}; save the segmentation again",
                short(&other),
                short(&segment.name),
                segment.value
            ));
        }
    }
    Ok(names)
}

fn segments(pairs: &Pairs) -> Result<Vec<Segment>, ContentError> {
    let mut all = Vec::new();
    for n in 0..=MAX_SEGMENTS {
        let of = |what: &str| pairs.get(&format!("Segment{n}_{what}")).map(|v| v.trim());
        if ["ID", "Name", "LabelValue"].iter().all(|w| of(w).is_none()) {
            return Ok(all);
        }
        let name = of("Name")
            .or(of("ID"))
            .map(|n| n.chars().filter(|c| !c.is_control()).collect::<String>())
            .filter(|n| !n.is_empty())
            .unwrap_or_else(|| format!("segment {n}"));
        let number = |what: &str, otherwise: usize, most: usize| match of(what) {
            None => Ok(otherwise),
            Some(text) => text.parse::<usize>().ok().filter(|v| *v <= most).ok_or_else(|| {
                format!(
                    "Segment{n}_{what} is \"{}\"; it must be a whole number to {most}",
                    short(text)
                )
            }),
        };
        let value = number("LabelValue", n + 1, 255)? as u8;
        if value == 0 {
            return Err(invalid!(
                "its segment \"{}\" has label 0, which is the background",
                short(&name)
            ));
        }
        all.push(Segment {
            name,
            value,
            layer: number("Layer", 0, MAX_SEGMENTS)?,
        });
    }
    Err(invalid!("it has more than {MAX_SEGMENTS} segments"))
}

/// Returns one label for each segment; an overlap goes to the smaller segment.
pub fn flatten(
    h: &Header,
    values: &[u8],
    list: usize,
    frame: VoxelFrame,
    dims: [usize; 3],
) -> Result<Voxels, ContentError> {
    let layers = h.sizes[list] as usize;
    let segments = segments(&h.pairs)?;
    let kind = h.kinds.get(list).map_or("?", String::as_str);
    if segments.is_empty() {
        return Err(invalid!(
            "it contains {layers} volumes (an axis of kind {kind}) without segments that identify them; save one volume of it"
        ));
    }
    if let Some(s) = segments.iter().find(|s| s.layer >= layers) {
        return Err(invalid!(
            "its segment \"{}\" is in layer {} of {layers}",
            short(&s.name),
            s.layer
        ));
    }
    // The label of each value of each layer, counted from 1 in the order of the segments.
    let mut label_of = vec![[0_u8; 256]; layers];
    for (segment, label) in segments.iter().zip(1_u8..=255) {
        let place = &mut label_of[segment.layer][usize::from(segment.value)];
        if *place != 0 {
            return Err(invalid!(
                "two segments have label {} in layer {}",
                segment.value,
                segment.layer
            ));
        }
        *place = label;
    }
    // Steps through the values from layer to layer, and from voxel to voxel beyond the list's axis.
    let inner: usize = h.sizes[..list].iter().map(|&s| s as usize).product();
    let count: usize = dims.iter().product();
    let of_voxel = |voxel: usize, found: &mut Vec<u8>| {
        let (low, high) = (voxel % inner, voxel / inner);
        for (layer, label_of) in label_of.iter().enumerate() {
            let value = values[(high * layers + layer) * inner + low];
            match label_of[usize::from(value)] {
                0 => {}
                label => found.push(label),
            }
        }
    };
    let names: BTreeMap<u8, String> = (1_u8..=255).zip(segments.into_iter().map(|s| s.name)).collect();
    let (labels, also, overlap) = overlap::smallest_wins(count, frame.spacing_m.iter().product(), &names, of_voxel);
    Ok(Voxels {
        dims,
        labels,
        frame,
        names,
        also,
        overlap,
    })
}
