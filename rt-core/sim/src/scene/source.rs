//! Source of a scene, small enough to be kept in a recording.

use super::{Labels, Layer, Scene, SceneError, SceneProblem, Structure};
use serde::{Deserialize, Serialize};

/// Source that a scene can be built from again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum SceneSource {
    /// A built-in scene, by name.
    Builtin(String),
    /// A label volume.
    Labels {
        /// Name of the scene.
        name: String,
        /// Cells along x, y, z.
        dims: [usize; 3],
        /// Edge of a cell, m.
        spacing_m: f64,
        /// Label and number of cells, x fastest.
        runs: Vec<(u8, u32)>,
        /// Structures as in [`Labels`].
        structures: Vec<Structure>,
        /// Layers around the body, the innermost first; none: springs.
        layers: Vec<Layer>,
    },
}

impl SceneSource {
    /// Returns the labels in runs.
    pub fn of_labels(name: &str, labels: &Labels) -> Self {
        let mut runs: Vec<(u8, u32)> = Vec::new();
        for &cell in &labels.cells {
            match runs.last_mut() {
                Some((label, count)) if *label == cell && *count < u32::MAX => *count += 1,
                _ => runs.push((cell, 1)),
            }
        }
        Self::Labels {
            name: name.to_owned(),
            dims: labels.dims,
            spacing_m: labels.spacing_m,
            runs,
            structures: labels.structures.clone(),
            layers: vec![Layer::FAT],
        }
    }

    /// Returns the source of the same scene in other layers.
    ///
    /// # Errors
    ///
    /// As of [`stiffened`](Self::stiffened).
    pub fn in_layers(&self, others: Vec<Layer>) -> Result<Self, SceneError> {
        let mut source = self.in_labels()?;
        if let Self::Labels { layers, .. } = &mut source {
            *layers = others;
        }
        Ok(source)
    }

    fn in_labels(&self) -> Result<Self, SceneError> {
        match self {
            Self::Builtin(name) => {
                let labels = super::builtin::labels(name).ok_or_else(|| SceneError::Unknown(name.clone()))?;
                Ok(Self::of_labels(name, &labels.map_err(SceneError::Invalid)?))
            }
            labels => Ok(labels.clone()),
        }
    }

    /// Returns the source of the same scene with Young's modulus of all tissue multiplied; its surroundings keep
    /// theirs. A factor of 1 changes nothing, a built-in scene stays built-in.
    ///
    /// # Errors
    ///
    /// A name that is no built-in scene, or every problem with it.
    pub fn stiffened(&self, factor: f64) -> Result<Self, SceneError> {
        if factor == 1.0 {
            return Ok(self.clone());
        }
        let mut source = self.in_labels()?;
        if let Self::Labels { structures, .. } = &mut source {
            if structures.is_empty() {
                structures.push(Structure::soft("tissue", 1));
            }
            for structure in structures {
                structure.material.young_pa *= factor;
            }
        }
        Ok(source)
    }

    /// Builds the scene again.
    ///
    /// # Errors
    ///
    /// Every problem with it.
    pub fn build(&self) -> Result<Scene, SceneError> {
        match self {
            Self::Builtin(name) => Scene::builtin(name),
            Self::Labels {
                name,
                dims,
                spacing_m,
                runs,
                structures,
                layers,
            } => {
                let cells: u64 = runs.iter().map(|(_, count)| u64::from(*count)).sum();
                let wanted = dims.iter().try_fold(1_u64, |n, &d| n.checked_mul(d as u64));
                // Checked before anything of that size is allocated.
                if wanted != Some(cells) || dims.iter().any(|&d| d > super::MAX_CELLS_PER_AXIS) {
                    return Err(SceneError::RunCount { dims: *dims, cells });
                }
                let labels = Labels {
                    dims: *dims,
                    spacing_m: *spacing_m,
                    cells: runs
                        .iter()
                        .flat_map(|&(label, count)| std::iter::repeat_n(label, count as usize))
                        .collect(),
                    structures: structures.clone(),
                };
                let scene = Scene::from_labels(name, &labels).map_err(SceneError::Invalid)?;
                if layers.len() > Layer::MOST || !layers.iter().all(Layer::is_valid) {
                    return Err(SceneError::Invalid(vec![SceneProblem::Layers]));
                }
                Ok(Scene {
                    layers: layers.clone(),
                    ..scene
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stiffer_scene_differs_in_its_moduli_alone() {
        for name in stylet_settings::BUILTIN_SCENES {
            let source = SceneSource::Builtin(name.to_owned());
            let (soft, stiff) = (source.build().unwrap(), source.stiffened(2.5).unwrap().build().unwrap());
            assert_eq!(soft.lattice.structures(), stiff.lattice.structures());
            assert_eq!(soft.lattice.dims, stiff.lattice.dims);
            for (one, other) in soft.structures.iter().zip(&stiff.structures) {
                assert_eq!(2.5 * one.material.young_pa, other.material.young_pa);
                assert_eq!((one.material.fixed, &one.name), (other.material.fixed, &other.name));
            }
        }
        assert!(SceneSource::Builtin("knee".to_owned()).stiffened(2.0).is_err());
    }

    #[test]
    fn labels_survive_and_a_wrong_count_is_refused() {
        let cells = (0..4 * 5 * 6).map(|i| u8::from(i % 7 > 2)).collect();
        let labels = Labels {
            dims: [4, 5, 6],
            spacing_m: 1e-3,
            cells,
            structures: Vec::new(),
        };
        let source = SceneSource::of_labels("block", &labels);
        let again = source.build().unwrap();
        let first = Scene::from_labels("block", &labels).unwrap();
        assert_eq!(again.lattice.element_count(), first.lattice.element_count());
        assert_eq!(again.surface.vertex_elements, first.surface.vertex_elements);

        let SceneSource::Labels {
            name,
            spacing_m,
            runs,
            structures,
            ..
        } = source
        else {
            panic!()
        };
        let short = SceneSource::Labels {
            name,
            dims: [4, 5, 7],
            spacing_m,
            runs,
            structures,
            layers: vec![Layer::FAT],
        };
        assert!(short.build().is_err_and(|why| why.to_string().contains("120")));
    }

    #[test]
    fn layers_survive_and_a_wrong_one_is_refused() {
        let labels = Labels {
            dims: [4, 5, 6],
            spacing_m: 1e-3,
            cells: vec![1; 4 * 5 * 6],
            structures: Vec::new(),
        };
        let muscle = Layer {
            thickness_m: 5e-3,
            young_pa: 30e3,
        };
        let source = SceneSource::of_labels("block", &labels);
        let both = vec![muscle, Layer::FAT];
        assert_eq!(source.in_layers(both.clone()).unwrap().build().unwrap().layers, both);
        let thin = Layer {
            thickness_m: 0.0,
            ..muscle
        };
        assert!(source.in_layers(vec![Layer::FAT, thin]).unwrap().build().is_err());
    }
}
