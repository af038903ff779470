//! Scenes of many structures, live: built in, sent by a host, or refused with every reason while the running one
//! continues.

use bytemuck::Zeroable;
use std::process::Command;
use std::time::Duration;
use stylet_host::link::Link;
use stylet_implant::workflow::{Pace, Run, RunStatus, default_plan};
use stylet_ports as service;
use stylet_shm_schema::*;
use stylet_sim::scene::{Role, Scene};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, load_builtin, program, until};

/// Waits until a host sees the scene and its surface move.
fn wait_for(link: &mut Link, name: &str) {
    let there = until(Duration::from_secs(20), || {
        link.poll();
        link.scene().is_some_and(|s| s.header.name.read() == name) && link.snapshot().is_some()
    });
    assert!(there, "no scene {name}");
}

#[test]
fn every_built_in_scene_runs_by_its_number_and_says_what_it_is_made_of() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        for (number, name) in BUILTIN_SCENES.iter().enumerate() {
            load_builtin(&mut link, number as u32).expect("built in");
            wait_for(&mut link, name);
            let expected = Scene::builtin(name).expect("built in");
            let scene = link.scene().expect("live").clone();
            let header = &scene.header;
            assert_eq!(header.element_count as usize, expected.lattice.element_count());
            assert_eq!(scene.rest_m.len(), expected.surface.vertex_elements.len());
            assert_eq!(header.surface_element_count as usize, expected.surface.body_elements);
            let names: Vec<String> = header.structures().iter().map(|s| s.name.read()).collect();
            let expected_names: Vec<String> = expected.structures.iter().map(|s| s.name.clone()).collect();
            assert_eq!(names, expected_names);
            let elements: u32 = header.structures().iter().map(|s| s.element_count).sum();
            assert_eq!(elements, header.element_count, "structures do not add up");
            let (lower_m, upper_m) = expected.target_bounds_m();
            assert_eq!((header.target_lower_m, header.target_upper_m), (lower_m, upper_m));
            let tick = link.snapshot().expect("live").header.tissue_tick;
            let goes_on = until(Duration::from_secs(5), || {
                link.poll();
                link.snapshot().is_some_and(|s| s.header.tissue_tick > tick + 50)
            });
            assert!(goes_on, "{name} does not run");
        }
        let why = load_builtin(&mut link, 3).expect_err("no such scene");
        assert!(why.contains("paper, pelvis, full"), "{why}");
        drop(link);
        core.finish();
    });
}

#[test]
fn the_default_needle_in_the_pelvis_avoids_bone_urethra_and_rectum() {
    where_the_machine_runs(|| {
        let mut core = Core::start_with(&["--rt-if-allowed", "--scene", "pelvis"]);
        let mut link = core.host();
        let plan = default_plan(&link.scene().expect("live").header);
        let scene = Scene::builtin("pelvis").expect("built in");
        let structure_at = |p: [f64; 3]| {
            let cell = p.map(|c| (c / scene.lattice.spacing_m).floor());
            if cell.iter().any(|c| *c < 0.0) {
                return None;
            }
            let [i, j, k] = cell.map(|c| c as usize);
            let element = scene.lattice.element_of_cell(i, j, k)?;
            Some(&scene.structures[scene.lattice.structure(element) as usize])
        };
        assert!(structure_at(plan.entry_m).is_none(), "the needle begins in tissue");
        let deepest_m = plan.along_m(plan.seeds_m[0]);
        let mut met: Vec<&str> = Vec::new();
        for step in 0..=(deepest_m / 0.5e-3) as usize {
            let depth_m = step as f64 * 0.5e-3;
            let place = [0, 1, 2].map(|a| plan.entry_m[a] + depth_m * plan.direction[a]);
            if let Some(structure) = structure_at(place)
                && met.last() != Some(&structure.name.as_str())
            {
                met.push(&structure.name);
            }
        }
        assert_eq!(met, ["perineum", "fat", "capsule", "gland"]);
        for seed in &plan.seeds_m {
            assert_eq!(
                structure_at(*seed).map(|s| s.role),
                Some(Role::Target),
                "seed at {seed:?}"
            );
        }

        let mut run = Run::new(plan, Pace::default());
        let mut status = RunStatus::Working;
        let ended = until(Duration::from_secs(120), || {
            link.poll();
            link.take_records();
            status = run.advance(&mut link);
            !matches!(status, RunStatus::Working)
        });
        assert!(
            ended && matches!(status, RunStatus::Done),
            "the procedure failed: {status:?}"
        );
        // Their resting places are compared with a rehearsal in `plan_rehearsal`.
        assert_eq!(link.snapshot().expect("live").header.seed_count, 5);
        let state = link.state().expect("live");
        assert_eq!(state.fault, Fault::None as u32);
        drop(link);
        core.finish();
    });
}

/// A separate host that sends volumes with structures.
struct Sender {
    replies: service::Subscriber<Reply>,
    node: service::Node,
    sent: u64,
}

const HOST: u64 = 77;

impl Sender {
    fn new(core: &Core) -> Self {
        let node = service::Node::join(&core.instance).expect("same user");
        Self {
            replies: service::replies::subscriber(&node).expect("a free place"),
            node,
            sent: 0,
        }
    }

    /// Returns the core's answer, or every reason against it.
    fn send(&mut self, header: &UploadHeader, cells: &[u8]) -> Result<(), String> {
        self.sent += 1;
        let port = service::uploads::publisher(&self.node, cells.len()).expect("a free place");
        let header = UploadHeader {
            host_id: HOST,
            command_id: self.sent,
            ..*header
        };
        port.send(&header, cells).expect("sent");
        let mut answer = None;
        until(Duration::from_secs(20), || {
            while let Some(reply) = self.replies.receive() {
                if (reply.host_id, reply.command_id) == (HOST, self.sent) {
                    answer = Some(reply);
                }
            }
            answer.is_some()
        });
        let answer = answer.expect("an answer");
        match ReplyStatus::from_number(answer.status) {
            Some(ReplyStatus::Accepted) => Ok(()),
            _ => Err(answer.text.read()),
        }
    }
}

const DIMS: [u32; 3] = [20, 18, 16];

/// Returns a block of label 1 in fat of label 2, with both structures.
fn volume() -> (UploadHeader, Vec<u8>) {
    let [nx, ny, nz] = DIMS.map(|d| d as usize);
    let inner = |n: usize, count: usize| (5..count - 5).contains(&n);
    let cells = (0..nx * ny * nz).map(|n| {
        let (i, j, k) = (n % nx, n / nx % ny, n / (nx * ny));
        if inner(i, nx) && inner(j, ny) && inner(k, nz) {
            1
        } else {
            2
        }
    });
    let mut header = UploadHeader {
        dims: DIMS,
        structure_count: 2,
        spacing_m: 2e-3,
        patient_from_scene: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        name: Text::new("phantom"),
        ..UploadHeader::zeroed()
    };
    header.structures[0] = structure("gland", 1, role::TARGET);
    header.structures[1] = structure("fat", 2, 0);
    header.structures[1].own_limits = 1;
    header.structures[1].limits = [[0.5, 1.9, 0.4]; 3];
    (header, cells.collect())
}

fn structure(name: &str, label: u32, role: u32) -> UploadStructure {
    UploadStructure {
        label,
        role,
        young_pa: 17e3,
        poisson: 0.49,
        name: Text::new(name),
        ..UploadStructure::zeroed()
    }
}

#[test]
fn a_volume_with_structures_runs_and_its_target_is_planned_in() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        let (header, cells) = volume();
        Sender::new(&core).send(&header, &cells).expect("a good volume");
        wait_for(&mut link, "phantom");
        let scene = link.scene().expect("live").header;
        let structures: Vec<_> = scene
            .structures()
            .iter()
            .map(|s| (s.name.read(), s.role, s.element_count))
            .collect();
        let gland = 10 * 8 * 6;
        assert_eq!(
            structures,
            [
                ("gland".to_owned(), role::TARGET, gland),
                ("fat".to_owned(), 0, 20 * 18 * 16 - gland)
            ]
        );
        assert!(scene.structures[0].triangle_count > 0 && scene.structures[1].triangle_count == 0);
        let plan = default_plan(&scene);
        assert!(
            plan.entry_m[2] < 0.0 && plan.seeds_m.iter().all(|s| (0.010..0.022).contains(&s[2])),
            "{plan:?}"
        );
        drop(link);
        core.finish();
    });
}

/// Text that a refusal must contain, and the change that spoils the volume.
type Case<'a> = (&'a [&'a str], &'a dyn Fn(&mut UploadHeader, &mut Vec<u8>));

#[test]
fn unusable_volumes_are_refused_with_every_reason_and_the_scene_runs() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        let before = link.scene().expect("live").header;
        let mut sender = Sender::new(&core);
        let cases: &[Case<'_>] = &[
            (
                &["[20, 18, 16] cells by its header but 5759 were received"],
                &|_, cells| cells.truncate(5759),
            ),
            (&["300 structures, at most 255", "transform to the patient"], &|h, _| {
                (h.structure_count, h.patient_from_scene[3]) = (300, f64::NAN);
            }),
            (&["\"gland\" has label 300", "\"fat\" has role 3"], &|h, _| {
                (h.structures[0].label, h.structures[1].role) = (300, 3);
            }),
            (
                &[
                    "\"gland\" and \"fat\" both have label 1",
                    "cells have label 2, which no structure has",
                    "\"fat\": young_pa is NaN",
                    "\"fat\": poisson is 0.5, must be from 0 to 0.499",
                    "spacing 0 m",
                ],
                &|h, _| {
                    h.spacing_m = 0.0;
                    let fat = &mut h.structures[1];
                    (fat.label, fat.young_pa, fat.poisson) = (1, f64::NAN, 0.5);
                },
            ),
            (&["\"fat\" has label 0"], &|h, _| h.structures[1].label = 0),
            (
                &["\"lost\" has no cell (label 9): it is empty or lies outside the volume"],
                &|h, _| {
                    h.structure_count = 3;
                    h.structures[2] = structure("lost", 9, 0);
                },
            ),
            (
                &[
                    "min_stretch along x is 1.5, must be at most max_stretch",
                    "eq. 1 in three dimensions",
                    "max_stretch along z is NaN",
                ],
                &|h, _| h.structures[1].limits = [[1.5, 0.5, 0.1], [0.5, 1.5, 0.8], [0.5, f64::NAN, 0.8]],
            ),
            (&["eq. 1 in three dimensions"], &|h, _| {
                h.structures[1].limits = [[0.5, 1.9, 0.5]; 3]
            }),
            (&["every structure is fixed"], &|h, _| {
                (h.structures[0].role, h.structures[1].role) = (role::TARGET | role::FIXED, role::FIXED);
            }),
            (
                &["0 elements, at least 1 needed", "\"gland\" has no cell"],
                &|_, cells| cells.fill(0),
            ),
            (&["4040000 elements, at most 4000000"], &|h, cells| {
                (h.dims, h.structure_count) = ([200, 200, 101], 0);
                cells.clear();
                cells.resize(200 * 200 * 101, 1);
            }),
        ];
        for (named, spoil) in cases {
            let (mut header, mut cells) = volume();
            spoil(&mut header, &mut cells);
            let why = sender.send(&header, &cells).expect_err("refused");
            println!("{why}\n");
            for part in *named {
                assert!(why.contains(part), "{part} is not named: {why}");
            }
        }
        let tick = link.state().expect("live").tick;
        let goes_on = until(Duration::from_secs(5), || {
            link.poll();
            link.state().is_some_and(|s| s.tick > tick + 500)
        });
        assert!(goes_on && core.is_running());
        let after = link.scene().expect("live").header;
        assert_eq!(
            (before.generation, before.element_count),
            (after.generation, after.element_count)
        );
        drop((sender, link));
        core.finish();
    });
}

#[test]
fn help_names_every_scene_and_an_unknown_one_is_refused() {
    let run = |options: &[&str]| {
        let out = Command::new(program("rt-core"))
            .args(options)
            .output()
            .expect("rt-core runs");
        let said = [out.stdout, out.stderr].concat();
        (out.status.success(), String::from_utf8_lossy(&said).into_owned())
    };
    let (_, help) = run(&["--help"]);
    for name in BUILTIN_SCENES {
        let line = help.lines().find(|l| l.trim_start().starts_with(&format!("- {name}:")));
        assert!(line.is_some_and(|l| l.len() > 20), "{name} is not explained: {help}");
    }
    let (taken, said) = run(&["--scene", "papper"]);
    assert!(
        !taken && BUILTIN_SCENES.iter().all(|name| said.contains(name)),
        "{said}"
    );
}
