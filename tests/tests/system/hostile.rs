//! Peers that mix valid, stale and broken messages, over shared memory and over OpenIGTLink: every tick has its record,
//! and every fault has a name and removes the force.
//!
//! A seed repeats the messages, not their times. `make hostile` runs for ten minutes.

use crate::igtl::Served;
use bytemuck::Zeroable;
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use stylet_igtl::codec::{Body, Message, Timestamp};
use stylet_ports::{self as service, Node};
use stylet_random::Random;
use stylet_shm_schema::*;
use stylet_tests::hand::force_n;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, repeats, until};

/// Ticks within which a fault removes the force.
const ZERO_WITHIN: usize = 20;
/// Largest force that a device counts as zero, N.
const ZERO_N: f64 = 1e-9;
/// Formerly valid messages that are sent again.
const STALE: usize = 64;

/// Counts of sent messages by kind: valid, stale, broken.
type Sent = [AtomicU64; 3];

fn place(random: &mut Random) -> [f64; 3] {
    std::array::from_fn(|_| 0.3 * (random.unit() - 0.5))
}

fn direction(random: &mut Random) -> [f64; 3] {
    let [x, y] = [0.2 * (random.unit() - 0.5), 0.2 * (random.unit() - 0.5)];
    [x, y, (1.0 - x * x - y * y).sqrt()]
}

/// Draws a request that a core may carry out. None ends the core, which would rightly obey.
fn request(random: &mut Random) -> Request {
    let hand = HandMove {
        tip_m: place(random),
        direction: direction(random),
        speed_m_per_s: 0.01 + 0.3 * random.unit(),
        acceleration_m_per_s2: 0.5 + 3.0 * random.unit(),
    };
    match random.below(24) {
        0..6 => Request::MoveHand(hand),
        6 => Request::SetPlan(Some(PlannedNeedle {
            entry_m: hand.tip_m,
            direction: hand.direction,
            seeds_m: vec![place(random); random.below(6)],
            prescribed: Prescribed::default(),
        })),
        7 => Request::SetPlan(None),
        8 => Request::DropSeed { strand_pitch_m: None },
        9..12 => Request::Engage,
        12 => Request::Disengage,
        13 if random.below(20) == 0 => Request::Reset,
        14 if random.below(60) == 0 => Request::LoadBuiltinScene(random.below(2) as u32),
        15 => Request::UndoSeed,
        16 => Request::StopHand,
        17 => Request::ExpectNeedle(NeedleAxis {
            entry_m: hand.tip_m,
            direction: hand.direction,
        }),
        18 => Request::LeaveNeedle,
        19 => Request::DrawNeedle {
            number: random.below(3) as u32,
            speed_m_per_s: 0.05,
        },
        20 => Request::Mark(Mark {
            text: "hostile".to_owned(),
            before_s: 0.0,
        }),
        21 if random.below(10) == 0 => Request::BeginExercise(Exercise::DeviceLost),
        21 => Request::BeginExercise(Exercise::StiffTissue { factor: 2.0 }),
        22 => Request::EndExercises,
        _ => Request::KeepMoving {
            valid_s: 0.02 + 0.28 * random.unit(),
        },
    }
}

fn broken(random: &mut Random, good: &Command) -> Command {
    let mut command = if random.below(2) == 0 { *good } else { Command::zeroed() };
    match random.below(3) {
        // One bit of it flipped.
        0 => {
            let words = bytemuck::cast_slice_mut::<u8, u64>(bytemuck::bytes_of_mut(&mut command));
            words[random.below(words.len())] ^= 1 << random.below(64);
        }
        1 => bytemuck::cast_slice_mut::<u8, u64>(bytemuck::bytes_of_mut(&mut command))
            .iter_mut()
            .for_each(|word| *word = random.draw()),
        _ => {
            let value = [f64::NAN, f64::INFINITY, -1e300, 0.0][random.below(4)];
            let at = 1 + 8 * random.below(8);
            command.payload[at..at + 8].copy_from_slice(&value.to_ne_bytes());
            if random.below(2) == 0 {
                command.length = random.draw() as u32;
            }
        }
    }
    if command.kind == CommandKind::Shutdown as u32 {
        command.kind = u32::MAX;
    }
    command
}

/// Runs a host that sends at random, by its ports.
fn host(instance: &Instance, seed: u64, is_over: &AtomicBool, sent: &Sent) {
    let (mut random, mut stale) = (Random(seed), Vec::<Command>::new());
    let count = |kind: usize| sent[kind].fetch_add(1, Ordering::Relaxed);
    while !is_over.load(Ordering::Relaxed) {
        let ports = Node::join_again(instance).and_then(|node| {
            let uploads = service::uploads::publisher(&node, 4096)?;
            Ok((
                service::commands::publisher(&node)?,
                service::stops::publisher(&node)?,
                uploads,
                node,
            ))
        });
        let Ok((commands, stops, uploads, node)) = ports else {
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        // Hosts come and go.
        for _ in 0..200 + random.below(4000) {
            if is_over.load(Ordering::Relaxed) || !node.is_current() {
                break;
            }
            let id = random.draw() % 1000;
            let good = request(&mut random).encode(seed, id).expect("fits");
            let (kind, command) = match random.below(8) {
                0 => (2, broken(&mut random, &good)),
                1 if !stale.is_empty() => (1, stale[random.below(stale.len())]),
                _ => (0, good),
            };
            let port = if random.below(10) == 0 { &stops } else { &commands };
            let _ = port.send(command);
            count(kind);
            if kind == 0 {
                stale.push(command);
                if stale.len() > STALE {
                    stale.remove(random.below(STALE));
                }
            }
            if random.below(100) == 0 {
                let mut header = UploadHeader::zeroed();
                bytemuck::bytes_of_mut(&mut header)
                    .iter_mut()
                    .for_each(|byte| *byte = random.draw() as u8);
                let cells: Vec<u8> = (0..random.below(4096)).map(|_| random.draw() as u8).collect();
                let _ = uploads.send(&header, &cells);
                count(2);
            }
            std::thread::sleep(Duration::from_micros(200 + random.draw() % 3000));
        }
    }
}

/// Runs a client that sends at random.
fn client(address: &str, seed: u64, is_over: &AtomicBool, sent: &Sent) {
    let (mut random, mut stale) = (Random(seed), Vec::<Vec<u8>>::new());
    let mut drained = vec![0; 1 << 16];
    while !is_over.load(Ordering::Relaxed) {
        let Ok(mut stream) = TcpStream::connect(address) else {
            std::thread::sleep(Duration::from_millis(100));
            continue;
        };
        let _ = stream.set_read_timeout(Some(Duration::from_millis(1)));
        let _ = stream.set_write_timeout(Some(Duration::from_millis(100)));
        for _ in 0..random.below(400) {
            let mut columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];
            columns[3] = place(&mut random).map(|m| (m * 1e3) as f32);
            let message = Message {
                device: ["Stylus", "Stylus", "Probe", "\u{1b}[2J"][random.below(4)].to_owned(),
                time: Timestamp::now(),
                body: Body::Transform(columns),
            };
            let Ok(mut bytes) = message.encode() else { continue };
            let kind = random.below(4).min(2);
            match kind {
                1 if !stale.is_empty() => bytes.clone_from(&stale[random.below(stale.len())]),
                2 => match random.below(3) {
                    0 => {
                        let at = random.below(bytes.len());
                        bytes[at] ^= 1 << random.below(8);
                    }
                    1 => bytes.truncate(random.below(bytes.len())),
                    _ => bytes.iter_mut().for_each(|byte| *byte = random.draw() as u8),
                },
                _ => stale.push(bytes.clone()),
            }
            if stale.len() > STALE {
                stale.remove(0);
            }
            sent[kind].fetch_add(1, Ordering::Relaxed);
            if is_over.load(Ordering::Relaxed) || stream.write_all(&bytes).is_err() {
                break;
            }
            let _ = stream.read(&mut drained);
            std::thread::sleep(Duration::from_millis(random.draw() % 15));
        }
    }
}

#[test]
fn hostile_peers_cost_no_tick_and_raise_no_fault_without_a_name() {
    let time = Duration::from_secs(repeats("HOSTILE_SECONDS", 10));
    let seed = repeats("HOSTILE_SEED", 1);
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        ask(&mut link, &Request::Engage).expect("armed");
        let served = Served::start(&core, &["--hand", "Stylus"]);
        let is_over = AtomicBool::new(false);
        let (by_hosts, by_clients) = (Sent::default(), Sent::default());
        let mut records = Vec::new();
        let mut named: BTreeMap<u64, u32> = BTreeMap::new();
        std::thread::scope(|scope| {
            for peer in 0..2 {
                let (instance, is_over, sent) = (&core.instance, &is_over, &by_hosts);
                scope.spawn(move || host(instance, 1 + 2 * seed + peer, is_over, sent));
                let (address, sent) = (&served.address, &by_clients);
                scope.spawn(move || client(address, 1001 + 2 * seed + peer, is_over, sent));
            }
            let end = Instant::now() + time;
            while Instant::now() < end {
                link.poll();
                records.append(&mut link.take_records());
                let raised = link.events().iter().filter(|e| e.kind == EventKind::FaultRaised as u32);
                named.extend(raised.map(|event| (event.tick, event.code)));
                std::thread::sleep(Duration::from_millis(5));
            }
            is_over.store(true, Ordering::Relaxed);
        });
        let count = |sent: &Sent| sent.each_ref().map(|count| count.load(Ordering::Relaxed));
        let ([valid, stale, broken], [its_valid, its_stale, its_broken]) = (count(&by_hosts), count(&by_clients));
        let missing = records
            .windows(2)
            .map(|pair| pair[1].tick - pair[0].tick - 1)
            .sum::<u64>();
        let faults: Vec<usize> = (1..records.len())
            .filter(|&at| records[at].fault != 0 && records[at].fault != records[at - 1].fault)
            .collect();
        println!(
            "seed {seed}, {time:?}: {} ticks, {missing} missing, {} faults; hosts sent {valid} valid, {stale} stale, {broken} broken; \
             clients {its_valid}, {its_stale}, {its_broken}; {} refused",
            records.len(),
            faults.len(),
            link.session().expect("live").refused
        );
        assert_eq!((missing, link.state().expect("live").records_lost), (0, 0));
        assert!(records.len() as u64 > 900 * time.as_secs(), "{} records", records.len());
        for at in faults {
            let (tick, fault) = (records[at].tick, records[at].fault);
            assert!(
                Fault::from_number(fault).is_some(),
                "{fault} in tick {tick} has no name"
            );
            let is_said = named
                .range(tick.saturating_sub(1)..=tick + 1)
                .any(|(_, code)| *code == fault);
            assert!(is_said, "the loop did not name fault {fault} of tick {tick}: {named:?}");
            let stands = records[at..]
                .iter()
                .skip(ZERO_WITHIN)
                .take_while(|record| record.fault == fault);
            let most_n = stands.map(force_n).fold(0.0, f64::max);
            assert!(most_n <= ZERO_N, "{most_n} N under fault {fault} of tick {tick}");
        }
        assert!(
            valid > 100 && stale > 10 && broken > 10 && its_valid > 10,
            "they say nothing"
        );
        assert!(core.is_running());
        // The operator's requests still count.
        let mut operator = core.host();
        ask(&mut operator, &Request::EndExercises).expect("taken");
        ask(&mut operator, &Request::Engage).expect("armed");
        // The server admits no more clients of an address that connected too often, for ten seconds.
        let is_admitted = until(Duration::from_secs(60), || {
            std::thread::sleep(Duration::from_secs(3));
            hears_the_needle(&served.address)
        });
        assert!(is_admitted, "an honest client is refused for good");
        let releases = until(Duration::from_secs(5), || {
            ask(&mut operator, &Request::Disengage).is_ok() && operator.state().is_some_and(|s| s.fault == 0)
        });
        assert!(releases, "{:?}", operator.state());
        drop((served, link, operator));
        core.finish();
    });
}

/// True if a new client receives a transform. One that is refused receives the reason, and the end.
fn hears_the_needle(address: &str) -> bool {
    let Ok(mut stream) = TcpStream::connect(address) else {
        return false;
    };
    stream
        .set_read_timeout(Some(Duration::from_secs(1)))
        .expect("a timeout");
    let (mut heard, mut bytes) = (Vec::new(), [0; 4096]);
    let end = Instant::now() + Duration::from_secs(2);
    while Instant::now() < end && heard.windows(9).all(|word| word != b"TRANSFORM") {
        match stream.read(&mut bytes) {
            Ok(0) | Err(_) => return false,
            Ok(count) => heard.extend_from_slice(&bytes[..count]),
        }
    }
    heard.windows(9).any(|word| word == b"TRANSFORM")
}
