//! Injected faults are felt and seen, are announced, and end on request.

use std::time::Duration;
use stylet_host::link::Link;
use stylet_host::moments::{Moment, MomentKind, STOPPED};
use stylet_host::roster::{self, Glance, Trainee};
use stylet_implant::workflow::{Pace, Run, RunStatus, Step, default_plan, move_request};
use stylet_shm_schema::{Exercise, Mark, Phase, Request};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, fresh_instance, until};

/// Result of a needle of the scripted procedure.
struct Seen {
    seeds_m: Vec<[f64; 3]>,
    surface_m: Vec<[f32; 3]>,
    /// Largest displacement of any tissue, averaged over the snapshots with the tip inside.
    moved_inside_m: f64,
}

/// Injects `put_in` once the procedure has begun with its reset and before the needle is in.
fn procedure(link: &mut Link, put_in: Option<Exercise>) -> Seen {
    let plan = default_plan(&link.scene().expect("a live core has a scene").header);
    let mut run = Run::new(plan, Pace::default());
    let mut put_in = put_in;
    let (mut status, mut inside, mut last_tick) = (RunStatus::Working, Vec::new(), 0);
    let ended = until(Duration::from_secs(120), || {
        link.poll();
        link.take_records();
        status = run.advance(link);
        if run.step() >= Step::Place
            && let Some(exercise) = put_in.take()
        {
            ask(link, &Request::BeginExercise(exercise)).expect("taken");
        }
        let snapshot = link.snapshot().map(|s| s.header);
        let is_inside = |phase: u32| phase == Phase::Penetration as u32 || phase == Phase::Hold as u32;
        if let Some(header) = snapshot.filter(|h| is_inside(h.phase) && h.tissue_tick != last_tick) {
            last_tick = header.tissue_tick;
            inside.push(header.max_displacement_m);
        }
        !matches!(status, RunStatus::Working)
    });
    assert!(ended && matches!(status, RunStatus::Done), "{status:?}");
    std::thread::sleep(Duration::from_secs(2));
    link.poll();
    let snapshot = link.snapshot().expect("live");
    let seeds = snapshot.header.seeds.iter().take(snapshot.header.seed_count as usize);
    Seen {
        seeds_m: seeds.map(|s| s.position_m).collect(),
        surface_m: snapshot.positions_m.to_vec(),
        moved_inside_m: inside.iter().sum::<f64>() / inside.len() as f64,
    }
}

fn mean<'a>(places: impl Iterator<Item = [f64; 3]> + 'a) -> [f64; 3] {
    let all: Vec<_> = places.collect();
    [0, 1, 2].map(|a| all.iter().map(|p| p[a]).sum::<f64>() / all.len() as f64)
}

fn words(link: &mut Link) -> Vec<(MomentKind, String)> {
    link.poll();
    let moments = link.events().iter().filter_map(Moment::of);
    moments.map(|m| (m.kind, m.text)).collect()
}

#[test]
fn a_moved_gland_misplaces_seeds_and_stiff_tissue_yields_less() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        let plain = procedure(&mut link, None);
        let moved_m = [0.003, 0.0, 0.0];
        let moved = procedure(&mut link, Some(Exercise::BodyMoved { by_m: moved_m }));
        let before_m = mean(plain.seeds_m.iter().copied());
        let after_m = mean(moved.seeds_m.iter().copied());
        let off_mm = [0, 1, 2].map(|a| (after_m[a] - before_m[a]) * 1e3);
        println!("gland moved by 3 mm along x: seeds in it {off_mm:.2?} mm from where they were without");
        assert!((off_mm[0] + 3.0).abs() < 0.5 && off_mm[1].abs() < 0.5, "{off_mm:?}");
        let surface = |seen: &Seen| mean(seen.surface_m.iter().map(|p| p.map(f64::from)));
        let drawn_mm = (surface(&moved)[0] - surface(&plain)[0]) * 1e3;
        assert!(
            (drawn_mm - 3.0).abs() < 0.2,
            "the gland is drawn {drawn_mm} mm from before"
        );
        assert_eq!(link.snapshot().expect("live").header.body_moved_m, moved_m);
        // The next procedure begins with a reset, which removes it.
        let factor = 3.0;
        let stiff = procedure(&mut link, Some(Exercise::StiffTissue { factor }));
        assert_eq!(link.snapshot().expect("live").header.body_moved_m, [0.0; 3]);
        let [soft_mm, stiff_mm] = [plain, stiff].map(|seen| seen.moved_inside_m * 1e3);
        println!(
            "with the tip inside tissue moved by {soft_mm:.2} mm, and {stiff_mm:.2} mm in tissue 3 times as stiff"
        );
        assert!(stiff_mm < 0.8 * soft_mm && stiff_mm > 0.1 * soft_mm);
        drop(link);
        core.finish();
    });
}

#[test]
fn marks_and_exercises_are_events_and_the_session_lists_those_in_force() {
    let mut core = Core::start_with(&["--rt-if-allowed", "--tissue", "paper"]);
    let mut link = core.host();
    let tick = link.state().expect("live").tick;
    let mark = |text: &str, before_s| {
        Request::Mark(Mark {
            text: text.to_owned(),
            before_s,
        })
    };
    ask(&mut link, &mark("left lobe", 0.0)).expect("taken");
    let found = |link: &Link| link.events().iter().rfind(|e| Moment::of(e).is_some()).copied();
    let event = found(&link).expect("an event");
    assert!(event.tick >= tick, "{} {tick}", event.tick);
    ask(&mut link, &mark("earlier", 0.5)).expect("taken");
    let earlier = found(&link).expect("an event");
    assert!(earlier.time_ns < event.time_ns, "half a second before its request");
    let refused = ask(
        &mut link,
        &Request::BeginExercise(Exercise::StiffTissue { factor: 2.0 }),
    );
    assert!(refused.expect_err("paper").contains("no stiffness"));
    ask(&mut link, &Request::BeginExercise(Exercise::DeviceLost)).expect("taken");
    let in_force = |link: &mut Link, count: usize| {
        until(Duration::from_secs(3), || {
            link.poll();
            link.session().is_some_and(|s| s.exercises.all().count() == count)
        })
    };
    assert!(in_force(&mut link, 1), "not announced");
    ask(&mut link, &Request::EndExercises).expect("taken");
    assert!(in_force(&mut link, 0), "announced still");
    let said = words(&mut link);
    let kinds: Vec<_> = said.iter().map(|(kind, _)| kind.name()).collect();
    assert_eq!(kinds, ["mark", "mark", "exercise", "fault", "exercise"], "{said:?}");
    assert_eq!(said[2].1, "device lost");
    drop(link);
    core.finish();
}

#[test]
fn a_list_of_trainees_sees_each_stops_one_hand_and_says_who_is_silent() {
    let mut cores = [(); 2].map(|()| Core::start_with(&["--rt-if-allowed", "--tissue", "paper"]));
    let mut links = cores.each_mut().map(|core| core.host());
    let trainee = |(name, link): (&str, &Link)| Trainee {
        name: name.to_owned(),
        instance: link.instance().clone(),
    };
    let nobody = Trainee {
        name: "nobody".to_owned(),
        instance: fresh_instance(),
    };
    let named = ["Ida", "Otto"].into_iter().zip(&links).map(trainee).chain([nobody]);
    let mut seats: Vec<(Trainee, Link)> = named.map(|t| (t.clone(), Link::new(t.instance))).collect();
    let glance = |seats: &mut [(Trainee, Link)], which: usize| {
        let (trainee, link) = &mut seats[which];
        link.poll();
        Glance::of(trainee, link)
    };
    let seen = |seats: &mut [(Trainee, Link)], which: usize, is: &dyn Fn(&Glance) -> bool| {
        until(Duration::from_secs(5), || is(&glance(seats, which)))
    };
    assert!([0, 1].iter().all(|n| seen(&mut seats, *n, &|g| g.state.is_some())));
    for link in &mut links {
        let mut request = move_request([0.0, 0.0, -0.2], [0.0, 0.0, 1.0], 0.01, 2.0);
        if let (Request::MoveHand(hand), Some(state)) = (&mut request, link.state()) {
            hand.direction = state.needle_direction;
        }
        ask(link, &request).expect("taken");
    }
    // The hand keeps moving only while its host polls.
    let mut moves = |seats: &mut [(Trainee, Link)], which: usize| {
        let before = glance(seats, which).state.map(|s| s.tip_in_scene_m);
        until(Duration::from_millis(400), || {
            links.iter_mut().for_each(Link::poll);
            false
        });
        glance(seats, which).state.map(|s| s.tip_in_scene_m) != before
    };
    assert!(
        moves(&mut seats, 0) && moves(&mut seats, 1),
        "both hands are on their way"
    );
    roster::stop(&mut seats[1].1).expect("sent");
    assert!(
        until(Duration::from_secs(5), || !moves(&mut seats, 1)),
        "the hand goes on"
    );
    assert!(moves(&mut seats, 0), "the other hand has stopped as well");
    let [first, mut second] = links;
    assert_eq!(words(&mut second), [(MomentKind::Mark, STOPPED.to_owned())]);
    drop((first, second));
    assert!(glance(&mut seats, 2).heard.is_none(), "nobody is there");
    let [killed, other] = cores;
    let _instance = killed.kill();
    let is_silent = |g: &Glance| g.heard.is_some_and(|at| at.elapsed() > Duration::from_millis(1500));
    assert!(seen(&mut seats, 0, &is_silent), "a dead core is heard");
    assert!(!is_silent(&glance(&mut seats, 1)), "a living one is not");
    drop(seats);
    drop(other);
}
