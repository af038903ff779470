//! Active parameters of the loops: the raw set, validated as a whole.

use crate::force::ForceParameters;
use crate::limits::{Limits, TissueParameters};
use crate::line::{NeedleBending, PronyTerm};
use crate::migration::Migration;
use crate::needle::{Layer, Layers, NeedleParameters};
use stylet_device::DeviceInfo;
use stylet_settings::{ParameterId, ParameterProblem, ParameterProblems, ParameterSet, ProblemList};

/// Everything that a change of parameters brings to both threads.
#[derive(Clone, Debug)]
pub struct Active {
    /// Coefficients of eq. 6.
    pub needle: NeedleParameters,
    /// Coefficients of eq. 8 to 10, and the gate.
    pub force: ForceParameters,
    /// Limits of the tissue, eq. 3 to 5.
    pub limits: Limits,
    /// Migration of seeds after they were dropped.
    pub migration: Migration,
}

/// Validates `set` for `device` by the table of parameters; lists every problem. The models verify their own structures
/// once more, which a set that passed the table never fails.
pub fn activate(set: &ParameterSet, device: &DeviceInfo) -> Result<Active, ParameterProblems> {
    ProblemList::check(set.problems_on(device.max_stiffness_n_per_m))?;
    let (needle, force) = (needle(set), force(set, device));
    let limits = tissue(set).validate().map_err(unusable)?;
    needle.validate().map_err(unusable)?;
    force.validate().map_err(unusable)?;
    let migration = Migration {
        share: set.get(ParameterId::MigratingShare),
        speed_m_per_s: set.get(ParameterId::MigrationSpeed),
    };
    Ok(Active {
        needle,
        force,
        limits,
        migration,
    })
}

fn unusable(problems: Vec<impl ToString>) -> ParameterProblems {
    let all = problems.iter().map(|p| ParameterProblem::Unusable(p.to_string()));
    ProblemList(all.collect())
}

fn tissue(set: &ParameterSet) -> TissueParameters {
    use ParameterId as P;
    TissueParameters {
        min_stretch: set.get(P::MinStretch),
        max_stretch: set.get(P::MaxStretch),
        shear_deg: set.get(P::ShearHorizontal).to_degrees(),
        shear_vert_deg: set.get(P::ShearVertical).to_degrees(),
        recovery_time_s: set.get(P::RecoveryTime),
        residual_tolerance: set.get(P::ResidualTolerance),
    }
}

fn needle(set: &ParameterSet) -> NeedleParameters {
    use ParameterId as P;
    NeedleParameters {
        puncture_depth_m: set.get(P::PunctureDepth),
        speed_coefficient_m2_per_s2: set.get(P::SpeedCoefficient),
        depth_coefficient_m2: set.get(P::DepthCoefficient),
        static_speed_m_per_s: set.get(P::StaticSpeed),
        retraction_ratio: set.get(P::RetractionRatio),
        hysteresis_m: set.get(P::PunctureHysteresis),
        hold_speed_m_per_s: set.get(P::HoldSpeed),
    }
}

fn force(set: &ParameterSet, device: &DeviceInfo) -> ForceParameters {
    use ParameterId as P;
    let mut force = ForceParameters {
        layers: layers(set),
        membrane_gain: set.get(P::MembraneGain),
        cutting_gain: set.get(P::CuttingGain),
        shaft_gain: set.get(P::ShaftGain),
        coupling: set.get(P::Coupling),
        tissue_stiffness_n_per_m: set.get(P::TissueStiffness),
        guide_stiffness_n_per_m: set.get(P::GuideStiffness),
        guide_gain: set.get(P::GuideGain),
        damping_n_s_per_m: set.get(P::Damping),
        guide_torque_nm_per_rad: set.get(P::GuideTorque),
        stick_stiffness_n_per_m: set.get(P::StickStiffness),
        stick_damping_n_s_per_m: set.get(P::StickDamping),
        compensated_mass_kg: set.get(P::HandleMass),
        creep: [
            PronyTerm {
                strength: set.get(P::QuickCreep),
                time_s: set.get(P::QuickCreepTime),
            },
            PronyTerm {
                strength: set.get(P::SlowCreep),
                time_s: set.get(P::SlowCreepTime),
            },
        ],
        bending: NeedleBending {
            bending_stiffness_n_m2: set.get(P::BendingStiffness),
            bevel: set.get(P::Bevel),
            template_gap_m: set.get(P::TemplateGap),
            template_distance_m: set.get(P::TemplateDistance),
        },
        ..ForceParameters::default()
    };
    force.gate.force_scale = set.get(P::ForceScale);
    force.gate.slew_n_per_s = set.get(P::SlewLimit);
    force.gate.max_force_n = device.peak_force_n;
    force
}

/// Returns the layers in the order of `LayerKind`.
fn layers(set: &ParameterSet) -> Layers {
    use ParameterId as P;
    let layer = |depth: Option<P>, peak: Option<P>, cutting, toughness, friction| Layer {
        puncture_depth_m: depth.map_or(0.0, |id| set.get(id)),
        puncture_force_n: peak.map_or(0.0, |id| set.get(id)),
        cutting_force_n: set.get(cutting),
        toughness_j_per_m2: set.get(toughness),
        shaft_friction_n_per_m: set.get(friction),
    };
    Layers([
        layer(
            Some(P::PunctureDepth),
            Some(P::MembranePeak),
            P::CuttingForce,
            P::GlandToughness,
            P::ShaftFriction,
        ),
        layer(
            Some(P::SkinPunctureDepth),
            Some(P::SkinPeak),
            P::SkinCutting,
            P::SkinToughness,
            P::SkinFriction,
        ),
        layer(
            None,
            None,
            P::SurroundingsCutting,
            P::SurroundingsToughness,
            P::SurroundingsFriction,
        ),
        layer(
            Some(P::WallPunctureDepth),
            Some(P::WallPeak),
            P::WallCutting,
            P::WallToughness,
            P::WallFriction,
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use ParameterId as P;
    use stylet_settings::PARAMETERS;

    fn device() -> DeviceInfo {
        DeviceInfo::phantom_premium_1_5()
    }

    #[test]
    fn defaults_of_the_table_are_the_defaults_of_the_models() {
        let set = ParameterSet::default();
        let active = activate(&set, &device()).expect("defaults are valid");
        let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-9 * b.abs().max(1e-9), "{a} {b}");
        let n = NeedleParameters::default();
        close(active.needle.puncture_depth_m, n.puncture_depth_m);
        close(active.needle.speed_coefficient_m2_per_s2, n.speed_coefficient_m2_per_s2);
        close(active.needle.depth_coefficient_m2, n.depth_coefficient_m2);
        close(active.needle.static_speed_m_per_s, n.static_speed_m_per_s);
        close(active.needle.hysteresis_m, n.hysteresis_m);
        close(active.needle.hold_speed_m_per_s, n.hold_speed_m_per_s);
        let f = ForceParameters::default();
        for (ours, default) in active.force.layers.0.iter().zip(f.layers.0) {
            close(ours.puncture_depth_m, default.puncture_depth_m);
            close(ours.puncture_force_n, default.puncture_force_n);
            close(ours.cutting_force_n, default.cutting_force_n);
            close(ours.toughness_j_per_m2, default.toughness_j_per_m2);
            close(ours.shaft_friction_n_per_m, default.shaft_friction_n_per_m);
        }
        close(active.force.gate.force_scale, f.gate.force_scale);
        close(active.force.stick_stiffness_n_per_m, f.stick_stiffness_n_per_m);
        close(active.force.stick_damping_n_s_per_m, f.stick_damping_n_s_per_m);
        close(active.force.guide_torque_nm_per_rad, f.guide_torque_nm_per_rad);
        close(active.force.coupling, f.coupling);
        close(active.force.tissue_stiffness_n_per_m, f.tissue_stiffness_n_per_m);
        close(active.force.damping_n_s_per_m, f.damping_n_s_per_m);
        close(active.force.gate.slew_n_per_s, f.gate.slew_n_per_s);
        let t = TissueParameters::default();
        close(tissue(&set).shear_deg, t.shear_deg);
        close(tissue(&set).recovery_time_s, t.recovery_time_s);
    }

    /// Guards against a row of the table that no model reads.
    #[test]
    fn every_parameter_reaches_its_model() {
        // Rehearsals and studies read these.
        let elsewhere = [P::EntryScatter, P::SkinDeflection, P::ScatterSeed];
        let active = |set: &ParameterSet| activate(set, &device()).map(|active| format!("{active:?}")).ok();
        let defaults = active(&ParameterSet::default()).expect("defaults are valid");
        for p in &PARAMETERS {
            let step = 0.01 * (p.max - p.min);
            let has_effect = [p.default - step, p.default + step].into_iter().any(|value| {
                let mut set = ParameterSet::default();
                set.set(p.id, value);
                active(&set).is_some_and(|changed| changed != defaults)
            });
            assert_eq!(has_effect, !elsewhere.contains(&p.id), "{}", p.key);
        }
    }

    #[test]
    fn values_that_forbid_each_other_are_all_listed() {
        let mut set = ParameterSet::default();
        set.set(ParameterId::ShearHorizontal, 50_f64.to_radians());
        set.set(ParameterId::ShearVertical, 45_f64.to_radians());
        set.set(ParameterId::MembranePeak, 20.0);
        let problems = activate(&set, &device()).expect_err("eq. 1 is broken, the membrane too stiff");
        assert_eq!(problems.0.len(), 2, "{problems:?}");
    }

    /// The table and the models used to disagree on the tolerance of the tissue.
    #[test]
    fn what_the_table_allows_no_model_refuses() {
        let usable = |set: &ParameterSet| {
            let active = activate(set, &device());
            let refused_by_a_model = |p: &ParameterProblem| matches!(p, ParameterProblem::Unusable(_));
            assert!(
                !active.as_ref().is_err_and(|p| p.0.iter().any(refused_by_a_model)),
                "{active:?}"
            );
            active.is_ok()
        };
        for p in &PARAMETERS {
            for value in [p.min, p.max] {
                let mut set = ParameterSet::default();
                set.set(p.id, value);
                usable(&set);
            }
        }
        // Ends and inner values of all at once.
        let (mut random, mut accepted) = (stylet_random::Random(1), 0);
        for _ in 0..20_000 {
            let mut set = ParameterSet::default();
            for p in &PARAMETERS {
                let share = random.below(5) as f64 / 4.0;
                set.set(p.id, p.min + share * (p.max - p.min));
            }
            accepted += u32::from(usable(&set));
        }
        assert!(accepted > 100, "{accepted}");
    }

    #[test]
    fn the_tolerance_has_one_limit() {
        let spec = ParameterId::ResidualTolerance.spec();
        for (tolerance, ok) in [(spec.max, true), (1.01 * spec.max, false), (spec.min, true)] {
            let parameters = TissueParameters {
                residual_tolerance: tolerance,
                ..TissueParameters::default()
            };
            assert_eq!(parameters.validate().is_ok(), ok, "{tolerance}");
        }
    }
}
