//! The window drawn without a display, in states that are made by hand.

use super::text::Painted;
use crate::app::{App, Options};
use crate::dose_worker::{DoseOf, DoseResult};
use crate::panel::structures::StructureTable;
use crate::planner::tests::planned;
use crate::planner::{Implant, NeedleProgress};
use crate::shown::Shown;
use bytemuck::Zeroable;
use egui::{Event, MouseWheelUnit, Pos2, RawInput, Rect, Vec2};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use stylet_dose::Metric;
use stylet_dose::criteria::{Figure, Limit};
use stylet_files::{VoxelFrame, Voxels};
use stylet_host::core_args::CoreArgs;
use stylet_host::link::LinkStatus;
use stylet_implant::plan::check::Problem;
use stylet_implant::plan::compensate::edges::Sensitive;
use stylet_implant::plan::first::FirstPlan;
use stylet_implant::plan::optimise::{Figures, Proposal};
use stylet_implant::plan::{Hole, ImplantPlan};
use stylet_shm_schema::Instance;
use stylet_shm_schema::{
    HapticState, MAX_STRUCTURES, ParametersInForce, PlanInForce, SceneHeader, SeedPose, Session, StructureInfo, Text,
    flags, role,
};

/// Returns options of a window without a core, under a unique name, because other tests open
/// windows too.
pub fn options() -> Options {
    static WINDOWS: AtomicU64 = AtomicU64::new(0);
    // SYNC: relaxed; no other memory depends on the number.
    let number = WINDOWS.fetch_add(1, Ordering::Relaxed);
    let name = format!("ui-drawn-{}-{number}", std::process::id());
    let core = CoreArgs {
        instance: Instance::new(&name).expect("a valid name"),
        ..CoreArgs::default()
    };
    Options {
        core,
        no_controllers: true,
        name: Some("Otto".to_owned()),
        ..Options::default()
    }
}

/// Window with its own time.
pub struct Drawn {
    pub app: App,
    pub ctx: egui::Context,
    size: Vec2,
    scale: f32,
    time: f64,
    _swept: SharedMemoryCleanup,
}

/// Instance whose shared memory is removed after the window.
struct SharedMemoryCleanup(Instance);

impl Drop for SharedMemoryCleanup {
    fn drop(&mut self) {
        self.0.sweep();
    }
}

impl Drawn {
    /// Creates a window of this size in pixels, with text of this scale.
    pub fn new(pixels: [f32; 2], scale: f32) -> Self {
        let ctx = egui::Context::default();
        ctx.enable_accesskit();
        let options = options();
        let swept = SharedMemoryCleanup(options.core.instance.clone());
        let app = App::new(&eframe::CreationContext::_new_kittest(ctx.clone()), options);
        ctx.all_styles_mut(|style| style.interaction.tooltip_delay = 1e9);
        Self {
            app,
            ctx,
            size: Vec2::from(pixels) / scale,
            scale,
            time: 0.0,
            _swept: swept,
        }
    }

    fn pass(&mut self, events: Vec<Event>) -> Painted {
        self.time += 0.5;
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, self.size)),
            time: Some(self.time),
            predicted_dt: 0.5,
            events,
            ..RawInput::default()
        };
        if let Some(root) = input.viewports.get_mut(&egui::ViewportId::ROOT) {
            root.native_pixels_per_point = Some(self.scale);
        }
        let (app, mut painted) = (&mut self.app, None);
        let ctx = self.ctx.clone();
        let mut nodes = Vec::new();
        let output = self.ctx.run_ui(input, |ui| {
            drop(app.frame_ui(ui));
            painted = Some(Painted::of(&ctx));
        });
        if let Some(update) = &output.platform_output.accesskit_update {
            nodes.clone_from(&update.nodes);
        }
        output.drop_without_applying_deltas();
        let mut painted = painted.expect("a frame was drawn");
        painted.name_widgets(&self.ctx, &nodes);
        painted
    }

    /// Draws the window until it has settled.
    pub fn frame(&mut self) -> Painted {
        let mut before = self.pass(vec![Event::PointerMoved(Pos2::new(-9.0, -9.0))]);
        for _ in 0..10 {
            let after = self.pass(Vec::new());
            if after.is_as(&before) {
                return after;
            }
            before = after;
        }
        before
    }

    /// Draws after the wheel was turned with the pointer here.
    pub fn scrolled(&mut self, place: Pos2, points: Vec2) -> Painted {
        self.pass(vec![Event::PointerMoved(place)]);
        self.pass(vec![Event::MouseWheel {
            unit: MouseWheelUnit::Point,
            delta: points,
            modifiers: egui::Modifiers::NONE,
            phase: egui::TouchPhase::Move,
            source: egui::MouseWheelSource::Wheel,
        }]);
        self.pass(Vec::new());
        self.pass(Vec::new())
    }

    /// Returns the place of the widget with this name.
    pub fn place(&mut self, name: &str) -> Rect {
        self.frame()
            .place(name)
            .unwrap_or_else(|| panic!("there is no {name:?}"))
    }
}

/// Longest name that the schema allows.
pub const LONG_NAME: &str = "Prostata_Zielvolumen_mit_Samenblasen_und_Sicherheitssaum_PTV_3mm";
pub const LONG_PATH: &str = "/srv/klinik/strahlentherapie/brachytherapie/patienten/2026/studie-11/segmentierung-der-\
                             prostata-und-risikoorgane-mit-katheter-und-samenblasen.seg.nrrd";

/// Returns the table of a file of twelve labels with the longest names.
pub fn long_named_labels() -> StructureTable {
    let voxels = Voxels {
        dims: [12, 1, 1],
        labels: (1..=12).collect(),
        frame: VoxelFrame {
            directions: nalgebra::Matrix3::identity(),
            spacing_m: [1e-3; 3],
            origin_m: nalgebra::Vector3::zeros(),
            warning: None,
        },
        names: (1..=12).map(|label| (label, LONG_NAME.to_owned())).collect(),
        also: Vec::new(),
        overlap: None,
    };
    StructureTable::of(LONG_PATH.into(), Arc::new(voxels), None)
}

/// Returns a live core with the scene, and nothing planned.
pub fn live() -> Shown {
    let mut shown = Shown::empty("lab");
    shown.status = LinkStatus::Live;
    let mut state = HapticState::zeroed();
    (state.tick, state.flags) = (123_456_789, flags::REAL_TIME | flags::ENGAGED | flags::LINE_NEEDED);
    (state.device_limit_n, state.force_scale, state.peak_force_n) = (13.3, 0.25, 3.5);
    (state.worst_wake_ns, state.worst_tissue_work_ns) = (1_234_567, 12_345_678);
    (state.speed_m_per_s, state.depth_m) = (-0.123_4, 0.123_4);
    state.needle_direction = [0.0, 0.0, 1.0];
    state.tip_in_scene_m = [0.05, 0.05, 0.0];
    shown.state = Some(state);
    shown.parameters = Some(ParametersInForce::zeroed());
    let mut session = Session::zeroed();
    session.device = Text::new("Geomagic Touch X, serial number 12345678901234567890, firmware 2");
    (session.haptic.policy, session.haptic.priority, session.haptic.core) = (0, 80, 2);
    (session.haptic.asked_priority, session.tissue.asked_priority) = (80, 75);
    (session.period_ns, session.tissue_period_ns) = (1_000_000, 5_000_000);
    shown.session = Some(session);
    let mut scene = SceneHeader::zeroed();
    scene.name = Text::new(LONG_NAME);
    (scene.volume_m3, scene.element_count, scene.spacing_m) = (1.234e-3, 1_234_567, 1e-3);
    (scene.body_edge, scene.structure_count) = (3, MAX_STRUCTURES.min(12) as u32);
    (scene.lower_m, scene.upper_m) = ([0.0; 3], [0.1; 3]);
    (scene.target_lower_m, scene.target_upper_m) = ([0.03; 3], [0.07; 3]);
    for (n, structure) in scene.structures.iter_mut().take(12).enumerate() {
        *structure = StructureInfo::zeroed();
        (structure.label, structure.element_count) = (n as u32 + 1, 123_456);
        structure.role = [role::TARGET, role::FIXED, role::SPARE][n % 3];
        structure.name = Text::new(LONG_NAME);
    }
    shown.scene = Some(scene);
    shown
}

/// Returns a needle with five seeds, its tip at a depth, `placed` of them in the tissue.
pub fn one_needle(depth_m: f64, placed: usize) -> Shown {
    let mut shown = live();
    let mut plan = PlanInForce::zeroed();
    (plan.generation, plan.seed_count) = (1, 5);
    (plan.entry_m, plan.direction) = ([0.05, 0.05, 0.0], [0.0, 0.0, 1.0]);
    for (n, seed) in plan.seeds.iter_mut().take(5).enumerate() {
        seed.position_m = [0.05, 0.05, 0.07 - 0.01 * n as f64];
    }
    let pose = |n: usize| SeedPose {
        position_m: [0.051, 0.05, 0.072 - 0.01 * n as f64],
        axis: [0.0, 0.0, 1.0],
        dropped_at_m: [0.05, 0.05, 0.07 - 0.01 * n as f64],
    };
    shown.seeds = (0..placed).map(pose).collect();
    shown.plan = Some(plan);
    if let Some(state) = &mut shown.state {
        state.tip_in_scene_m = [0.05, 0.05, depth_m];
        if depth_m > 0.02 {
            state.flags |= flags::PUNCTURED;
        }
    }
    shown
}

/// Returns two needles of `planned`, filled up to `count` with others.
fn needles(count: usize) -> ImplantPlan {
    let mut plan = planned();
    for hole in Hole::all() {
        if plan.needles.len() == count {
            break;
        }
        if let Ok(more) = plan.with_needle(hole, 0.08) {
            let last = more.needles.len() - 1;
            plan = more.with_strand(last, 5, 0.08, 0.456).unwrap_or(plan);
        }
    }
    plan
}

/// Returns a plan of many needles, `begun` of them inserted.
pub fn many_needles(count: usize, begun: usize) -> Shown {
    let mut shown = live();
    let plan = needles(count);
    let mut progress = NeedleProgress::default();
    (0..begun).for_each(|n| progress.begin(n, 0));
    let what = "it lies 12.3 mm outside the target and 4.5 mm from the urethra: move it, or take it away";
    let problem = |n: usize| Problem {
        needle: Some(n),
        seed: Some(2),
        what: what.to_owned(),
    };
    shown.planning.implant = Some(Arc::new(Implant {
        revision: 1,
        seeds: plan.seeds(),
        problems: Some(Arc::new((0..count).map(problem).collect())),
        states: (0..count).map(|n| progress.state(n)).collect(),
        rest_errors_m: vec![Some(1.23e-3); count],
        sensitive: vec![
            vec![Sensitive {
                seed: 0,
                moves_m: Some(6.88e-3)
            }];
            count
        ],
        drops_m: plan
            .needles
            .iter()
            .map(|needle| needle.seeds.iter().map(|seed| seed.along_m).collect())
            .collect(),
        can_undo: true,
        can_redo: true,
        plan,
    }));
    shown.planning.progress = progress;
    shown.dose = Some(dose(shown.planning.implant.as_ref().map_or(0, |i| i.seeds.len())));
    shown
}

/// Returns three proposals, the second of which is this plan.
pub fn proposals(plan: &ImplantPlan) -> Arc<Vec<FirstPlan>> {
    let proposal = |(name, v150, robust, strength_u): (&'static str, f64, f64, Option<f64>)| FirstPlan {
        name,
        why: "Most trials with misplaced seeds meet a D90 of 90 % of the prescription.",
        found: Proposal {
            plan: strength_u.map_or_else(|| plan.clone(), |u| plan.with_strength(u)),
            figures: Figures {
                v150,
                ..Figures::default()
            },
            sampled: Figures::default(),
            robust,
            expected_d90: 101.2,
            d90_p10: 93.4,
            shortfall: 0.0,
        },
        notes: Vec::new(),
    };
    let all = [
        ("Robust", 58.7, 0.997, Some(0.4)),
        ("Fewer needles", 52.3, 0.961, None),
        ("Lower V150", 31.2, 0.424, Some(0.6)),
    ];
    Arc::new(all.into_iter().map(proposal).collect())
}

pub fn dose(seeds: usize) -> Arc<DoseResult> {
    let figure = |structure: &str, metric, value, limit| Figure {
        structure: structure.to_owned(),
        metric,
        value,
        limit,
    };
    let above = Some(Limit::AtMost(217.5));
    let figures = vec![
        figure("target", Metric::DoseToShare(0.9), 123.4, Some(Limit::AtLeast(145.0))),
        figure("target", Metric::VolumeAtShare(1.5), 61.2, Some(Limit::AtMost(50.0))),
        figure("urethra", Metric::DoseToShare(0.1), 1234.5, above),
        figure("rectum", Metric::DoseToVolume { m3: 2e-6 }, 1234.5, above),
        figure("rectum", Metric::DoseToVolume { m3: 1e-7 }, 1234.5, above),
    ];
    Arc::new(DoseResult {
        number: 1,
        of: DoseOf::Plan,
        seeds,
        body_moved_m: [0.0; 3],
        source: "Pd-103 TheraSeed 200".to_owned(),
        prescription_gy: 145.0,
        shells: Vec::new(),
        figures,
        target_dvh: (0..100)
            .map(|n| [f64::from(n) * 0.03, 1.0 - f64::from(n) * 0.01])
            .collect(),
    })
}
