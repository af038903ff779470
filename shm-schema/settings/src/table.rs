//! The table: number, name, unit, limits, default and source of every parameter. A new parameter is one row here, and a
//! field of the model that reads it (CONTRIBUTING.md).

use super::{ParameterGroup, ParameterSpec};
use num_enum::{IntoPrimitive, TryFromPrimitive};
use serde::{Deserialize, Serialize};

const RAD: f64 = std::f64::consts::PI / 180.0;

macro_rules! parameters {
    ($( $id:ident $key:literal $label:literal $group:ident $unit:literal $per_si:expr, $min:expr, $max:expr, $default:expr, $source:literal, $help:literal; )*) => {
        /// Number of a parameter, its index in [`PARAMETERS`] and in [`ParameterSet`](crate::ParameterSet).
        #[derive(Clone, Copy, Debug, PartialEq, Eq, TryFromPrimitive, IntoPrimitive, Serialize, Deserialize)]
        #[serde(try_from = "u32", into = "u32")]
        #[repr(u32)]
        pub enum ParameterId {
            $( #[doc = concat!("`", $key, "`: ", $help)] $id ),*
        }

        /// Rows of the table.
        pub const PARAMETER_COUNT: usize = [$( $key ),*].len();

        /// Every parameter, in the order of [`ParameterId`].
        pub const PARAMETERS: [ParameterSpec; PARAMETER_COUNT] = [ $( ParameterSpec {
            id: ParameterId::$id, key: $key, label: $label, group: ParameterGroup::$group, unit: $unit, display_per_si: $per_si,
            min: $min / $per_si, max: $max / $per_si, default: $default / $per_si, source: $source, help: $help,
        } ),* ];
    };
}

// Identifier, key, label, group, unit shown to users, factor from SI to it; least, largest and default value in that
// unit; source, help. Shared memory and recordings know a row by its place: new ones go to the end.
parameters! {
    MinStretch "tissue.min_stretch" "Smallest link" Tissue "elements" 1.0, 0.05, 1.0, 0.55, "paper eq. 4", "How far a link between neighbouring elements can be compressed.";
    MaxStretch "tissue.max_stretch" "Largest link" Tissue "elements" 1.0, 1.0, 4.0, 1.75, "paper eq. 3", "How far a link between neighbouring elements can be stretched.";
    ShearHorizontal "tissue.shear_horizontal" "Shear, horizontal" Tissue "°" (1.0 / RAD), 0.0, 85.0, 26.565, "paper eq. 5", "Largest shear angle of links along x (maxHoriRx). No cell may fold (eq. 1 in three dimensions): 26.565 with the same vertically, 60 with 12.";
    ShearVertical "tissue.shear_vertical" "Shear, vertical" Tissue "°" (1.0 / RAD), 0.0, 45.0, 26.565, "paper eq. 5", "Largest shear angle of links along y and z (maxVertRy). No cell may fold (eq. 1 in three dimensions): 26.565 with the same horizontally, 44 with 0.";
    RecoveryTime "tissue.recovery_time" "Recovery time" Tissue "ms" 1e3, 5.0, 10000.0, 1000.0, "ours", "Time in which the surroundings bring the gland back by 63 %.";
    ResidualTolerance "tissue.residual_tolerance" "Residual tolerance" Tissue "elements" 1.0, 1e-4, 1e-2, 1e-3, "ours, physics.md", "Largest constraint violation that a tissue step may leave (docs/physics.md, Tissue: constraints).";
    PunctureDepth "needle.puncture_depth" "Puncture depth u_cri" Needle "mm" 1e3, 0.5, 20.0, 8.0, "paper eq. 6", "Depth at which the needle goes through the membrane.";
    SpeedCoefficient "needle.speed_coefficient" "Speed coefficient K_V" Needle "mm²/s²" 1e6, 1.0, 1e6, 10000.0, "paper eq. 6", "The larger, the more a fast needle drags the tissue along. Not used on a needle line.";
    DepthCoefficient "needle.depth_coefficient" "Depth coefficient K_s" Needle "mm²" 1e6, 0.01, 1000.0, 200.0, "paper eq. 6", "The larger, the longer the tissue follows the tip after puncture. Not used on a needle line.";
    StaticSpeed "needle.static_speed" "Static friction speed V_0" Needle "mm/s" 1e3, 0.0, 200.0, 20.0, "paper eq. 6", "Below this speed the tissue sticks to the needle. Not used on a needle line.";
    RetractionRatio "needle.retraction_ratio" "Retraction ratio K_ret" Needle "" 1.0, 0.0, 1.0, 0.3, "paper eq. 6", "Share of the tip's step that the tissue follows on the way out. Not used on a needle line.";
    PunctureHysteresis "needle.puncture_hysteresis" "Puncture hysteresis" Needle "mm" 1e3, 0.0, 5.0, 0.5, "ours, physics.md", "How far the tip must come back out before the membrane counts as closed (docs/physics.md, Needle and tissue).";
    MembranePeak "force.membrane_peak" "Membrane force F_R" Force "N" 1.0, 0.0, 20.0, 5.6, "Podder 2006", "Force of the capsule at the moment of puncture (paper eq. 10).";
    CuttingForce "force.cutting" "Cutting force" Force "N" 1.0, 0.0, 10.0, 1.5, "ours", "Force at the tip while it cuts the gland, by eq. 9. Not used on a needle line, where toughness takes its place.";
    GuideStiffness "force.guide_stiffness" "Guide stiffness K" Force "N/m" 1.0, 0.0, 800.0, 400.0, "paper eq. 9", "Spring towards the straight path.";
    GuideGain "force.guide_gain" "Guide gain K_C" Force "" 1.0, 0.0, 1.0, 1.0, "paper eq. 9", "Scales the guide; 0 turns it off.";
    Damping "force.damping" "Damping K_V" Force "N s/m" 1.0, 0.0, 20.0, 5.0, "paper eq. 9", "Force against the tip's speed. Not the K_V of the needle.";
    ShaftFriction "force.shaft_friction" "Shaft friction K_f" Force "N/m" 1.0, 0.0, 500.0, 80.0, "paper eq. 9", "Friction along the shaft for each metre inside the gland.";
    HandleMass "force.handle_mass" "Handle mass for F_G" Force "g" 1e3, 0.0, 200.0, 0.0, "paper eq. 8", "Mass whose weight F_G takes off the hand; the simulated device has none to carry.";
    ForceScale "force.scale" "Force scale" Force "" 1.0, 0.0, 2.0, 0.9, "ours", "Fits the force of a real needle to the device; always shown. The Phantom gives the skin's 9 N up to 0.94.";
    SlewLimit "force.slew_limit" "Slew limit" Force "N/ms" 1e-3, 0.05, 10.0, 0.5, "ours, physics.md", "Largest change of force from tick to tick (docs/physics.md, Gate).";
    HoldSpeed "needle.hold_speed" "Hold speed" Needle "mm/s" 1e3, 0.0, 50.0, 2.0, "ours", "Below this speed along the path the needle is at rest; above the noise of the velocity estimate.";
    StickStiffness "force.stick_stiffness" "Stick stiffness" Force "N/m" 1.0, 1.0, 8000.0, 6000.0, "ours", "How stiffly the tissue holds a needle that sticks to it: friction over this is the way before it slips. Not used on a needle line.";
    MembraneGain "force.membrane_gain" "Membrane gain" Force "" 1.0, 0.0, 1.0, 1.0, "ours", "Scales F_R of every layer; 0 turns it off.";
    CuttingGain "force.cutting_gain" "Cutting gain" Force "" 1.0, 0.0, 1.0, 1.0, "ours", "Scales the cutting force of every layer; 0 turns it off.";
    ShaftGain "force.shaft_gain" "Shaft friction gain" Force "" 1.0, 0.0, 1.0, 1.0, "ours", "Scales the shaft friction of every layer; 0 turns it off.";
    Coupling "force.coupling" "Coupling to the tissue" Force "" 1.0, 0.0, 1.0, 0.0, "paper section 3", "Share of membrane, cutting and friction that comes from the deformed tissue instead: 0 is eq. 8-10, 1 is coupled. On a needle line all of it does.";
    TissueStiffness "force.tissue_stiffness" "Tissue stiffness, coupled" Force "N/m" 1.0, 0.0, 800.0, 700.0, "ours", "Coupled mode with ChainMail, which knows no forces: force for each metre that the held element is displaced.";
    GuideTorque "force.guide_torque" "Guide torque" Force "N m/rad" 1.0, 0.0, 2.0, 0.5, "ours", "Turns the needle's axis to the straight path, on devices that can; 0 turns it off.";
    StickDamping "force.stick_damping" "Stick damping" Force "N s/m" 1.0, 0.0, 20.0, 10.0, "ours", "Damping of a needle that sticks; keeps the stick stiffness stable.";
    SkinPunctureDepth "layers.perineum_puncture_depth" "Perineum: puncture depth" Layers "mm" 1e3, 0.5, 30.0, 12.0, "ours", "Depth at which the needle goes through the skin.";
    SkinPeak "layers.perineum_peak" "Perineum: puncture force" Layers "N" 1.0, 0.0, 20.0, 9.0, "Podder 2006", "Force of the skin at the moment of puncture.";
    SkinCutting "layers.perineum_cutting" "Perineum: cutting force" Layers "N" 1.0, 0.0, 10.0, 1.0, "ours", "Force at the tip while it cuts the perineum, by eq. 9. Not used on a needle line.";
    SkinFriction "layers.perineum_friction" "Perineum: shaft friction" Layers "N/m" 1.0, 0.0, 500.0, 40.0, "ours", "Friction along the shaft for each metre in the perineum.";
    SurroundingsCutting "layers.surroundings_cutting" "Fat: cutting force" Layers "N" 1.0, 0.0, 10.0, 0.3, "ours", "Force at the tip while it cuts fat and what else has no membrane, by eq. 9. Not used on a needle line.";
    SurroundingsFriction "layers.surroundings_friction" "Fat: shaft friction" Layers "N/m" 1.0, 0.0, 500.0, 15.0, "ours", "Friction along the shaft for each metre in fat.";
    WallPunctureDepth "layers.wall_puncture_depth" "Organ wall: puncture depth" Layers "mm" 1e3, 0.5, 20.0, 4.0, "ours", "Depth at which the needle goes through the wall of urethra, bladder or rectum.";
    WallPeak "layers.wall_peak" "Organ wall: puncture force" Layers "N" 1.0, 0.0, 20.0, 2.0, "ours", "Force of the wall at the moment of puncture.";
    WallCutting "layers.wall_cutting" "Organ wall: cutting force" Layers "N" 1.0, 0.0, 10.0, 0.8, "ours", "Force at the tip while it cuts the wall, by eq. 9. Not used on a needle line.";
    WallFriction "layers.wall_friction" "Organ wall: shaft friction" Layers "N/m" 1.0, 0.0, 500.0, 40.0, "ours", "Friction along the shaft for each metre in the wall.";
    QuickCreep "tissue.quick_creep" "Quick creep" Tissue "" 1.0, 0.0, 5.0, 0.0, "physics.md, Creep", "Displacement that tissue adds under a load that is held, over that at once, within some times the quick time. 0 is off; a prostate has about 0.6. Acts on a needle line.";
    QuickCreepTime "tissue.quick_creep_time" "Quick creep: time" Tissue "s" 1.0, 0.01, 10.0, 0.5, "physics.md, Creep", "Time in which 63 % of the quick creep has developed.";
    SlowCreep "tissue.slow_creep" "Slow creep" Tissue "" 1.0, 0.0, 5.0, 0.0, "physics.md, Creep", "The same over a longer time. 0 is off; a prostate has about 1. Acts on a needle line.";
    SlowCreepTime "tissue.slow_creep_time" "Slow creep: time" Tissue "s" 1.0, 0.1, 100.0, 5.0, "physics.md, Creep", "Time in which 63 % of the slow creep has developed.";
    BendingStiffness "needle.bending_stiffness" "Bending stiffness E I" Needle "N m²" 1.0, 0.0, 1.0, 0.0, "physics.md, Beam", "How stiff the needle is against bending. 0 is a needle that does not bend, 0.016 one of 18 G steel. Acts on a needle line that was prepared for it.";
    Bevel "needle.bevel" "Bevel" Needle "" 1.0, 0.0, 5.0, 0.7, "physics.md, Beam", "Force of the bevel across a needle that bends, over the cutting force. It leads towards the x axis of the tool, so turning the needle turns it.";
    TemplateGap "needle.template_gap" "Template: play of the hole" Needle "mm" 1e3, 0.0, 3.0, 0.1, "ours", "Room on each side of a needle that bends, in the hole of the template.";
    TemplateDistance "needle.template_distance" "Template: distance" Needle "mm" 1e3, 0.0, 150.0, 20.0, "ours", "From the template to the place of entry of a needle that bends; 0 is a needle without a template.";
    EntryScatter "needle.entry_scatter" "Scatter of the entry" Needle "mm" 1e3, 0.0, 10.0, 0.0, "physics.md, Scatter", "Rehearsals and studies: standard deviation of how far a needle enters beside its hole, in each direction across. 0 is off.";
    SkinDeflection "needle.skin_deflection" "Deflection at the skin" Needle "°" (1.0 / RAD), 0.0, 10.0, 0.0, "physics.md, Scatter", "Rehearsals and studies: standard deviation of the angle by which template and skin turn a needle about its entry, in each direction across. 0 is off; with 1.5 mm of scatter, 3.7 is what Moreira 2018 measured in patients.";
    ScatterSeed "needle.scatter_seed" "Scatter: seed" Needle "" 1.0, 1.0, 1e6, 1.0, "ours", "Seed of the random numbers of scatter and deflection. The same seed gives the same needle the same error.";
    MigratingShare "seeds.migrating_share" "Seeds that migrate" Seeds "%" 100.0, 0.0, 100.0, 0.0, "off; 1748-717X-6-130", "Share of the loose seeds that go back along the open track of their needle once it is out; 0 turns it off. In patients 0.47 % of 19,236 migrated.";
    MigrationSpeed "seeds.migration_speed" "Speed of migration" Seeds "mm/s" 1e3, 0.0, 50.0, 0.5, "ours, assumed", "How fast a seed that migrates moves along its track towards the entry.";
    GlandToughness "layers.gland_toughness" "Gland: fracture toughness" Layers "J/m²" 1.0, 0.0, 5000.0, 164.0, "Gokgol 2012 (bovine liver); assumed for the prostate", "Work of the tip per area that it separates, on a needle line: times the needle's diameter this is the cutting force, 0.21 N with 164 (liver, by needles: 76 to 185 in Azar 2008, 164 in Gokgol 2012).";
    SkinToughness "layers.perineum_toughness" "Perineum: fracture toughness" Layers "J/m²" 1.0, 0.0, 5000.0, 200.0, "assumed", "Work of the tip per area of perineum that it separates, on a needle line.";
    SurroundingsToughness "layers.surroundings_toughness" "Fat: fracture toughness" Layers "J/m²" 1.0, 0.0, 5000.0, 50.0, "assumed", "Work of the tip per area of fat that it separates, on a needle line.";
    WallToughness "layers.wall_toughness" "Organ wall: fracture toughness" Layers "J/m²" 1.0, 0.0, 5000.0, 200.0, "assumed", "Work of the tip per area of wall that it separates, on a needle line.";
}
