//! libOpenIGTLink itself, compiled here: its output, and its reading of ours. `make igtl-test`
//! installs it.

use super::*;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests")
}

/// Compiles a program of `tests/` with the library, in a separate folder.
fn compiled(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("stylet-igtl-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for temporary files");
    let compiler = Command::new("g++")
        .args(["-O1", "-I/usr/include/openigtlink", "-o"])
        .arg(folder.join(name))
        .arg(sources().join(format!("{name}.cpp")))
        .args(["-lOpenIGTLink", "-lpthread"])
        .output()
        .expect("g++ runs");
    assert!(
        compiler.status.success(),
        "{}",
        String::from_utf8_lossy(&compiler.stderr)
    );
    folder
}

#[test]
#[ignore = "needs libopenigtlink-dev: make igtl-test"]
fn goldens_are_what_the_library_writes_now() {
    let folder = compiled("goldens");
    assert!(
        Command::new(folder.join("goldens"))
            .arg(&folder)
            .status()
            .expect("runs")
            .success()
    );
    for (name, _) in examples() {
        let [written, kept] = [&folder, &sources().join("goldens")].map(|at| at.join(format!("{name}.bin")));
        assert_eq!(std::fs::read(written).unwrap(), std::fs::read(kept).unwrap(), "{name}");
    }
    std::fs::remove_dir_all(folder).expect("ours");
}

/// Returns a message of numbers whose sums and roots are exact, so that the library's arithmetic
/// changes no bit.
fn message(kind: usize, random: &mut Random) -> Message {
    let number = |random: &mut Random| (random.below(1 << 20) as f32 - 524_288.0) / 256.0;
    let place = |random: &mut Random| [0; 3].map(|_| number(random));
    let word = |random: &mut Random, most: usize| {
        let length = random.below(most + 1);
        (0..length)
            .map(|_| char::from(b'!' + random.below(94) as u8))
            .collect::<String>()
    };
    let body = match kind {
        0 => Body::Transform([0; 4].map(|_| place(random))),
        1 => Body::Points(
            // The library reads no list without points, though it writes one.
            (0..1 + random.below(40))
                .map(|_| Point {
                    name: word(random, 63),
                    group: word(random, 31),
                    rgba: [0; 4].map(|_| random.below(256) as u8),
                    place_mm: place(random),
                    diameter_mm: random.below(99) as f32 / 8.0,
                    owner: word(random, 19),
                })
                .collect(),
        ),
        2 => {
            let points: Vec<_> = (0..3 + random.below(60)).map(|_| place(random)).collect();
            let corner = |random: &mut Random| random.below(points.len()) as u32;
            let triangles = (0..1 + random.below(80))
                .map(|_| [0; 3].map(|_| corner(random)))
                .collect();
            Body::PolyData(PolyData { points, triangles })
        }
        3 => {
            let size = [0; 3].map(|_| 1 + random.below(12) as u16);
            let step = |axis: usize, random: &mut Random| {
                let mut way = [0.0; 3];
                way[axis] = (1 + random.below(999)) as f32 / 256.0;
                way
            };
            let from = random.below(3);
            let [column, row, slice] = [0, 1, 2].map(|n| step((from + n) % 3, random));
            let count = size.iter().map(|&side| usize::from(side)).product();
            Body::Image(Image {
                size,
                columns: [column, row, slice, place(random)],
                greys: (0..count).map(|_| random.below(256) as u8).collect(),
            })
        }
        4 => Body::Status(Status {
            code: random.below(20) as u16,
            subcode: random.below(1 << 30) as i64 - (1 << 29),
            error: word(random, 19),
            text: word(random, 300),
        }),
        _ => Body::Text(word(random, 3000) + if random.below(2) == 0 { "" } else { " µm, Gewebe ü" }),
    };
    Message {
        device: word(random, 19),
        time: Timestamp {
            seconds: random.below(1 << 30) as u32,
            fraction: random.below(1 << 30) as u32,
        },
        body,
    }
}

/// Lets the library read each message, check its checksum, unpack it and pack it again.
#[test]
#[ignore = "needs libopenigtlink-dev: make igtl-test"]
fn three_thousand_messages_come_back_from_the_library_byte_for_byte() {
    let folder = compiled("echo");
    let mut random = Random(1900);
    let sent: Vec<Vec<u8>> = (0..3000)
        .map(|i| message(i % 6, &mut random).encode().unwrap())
        .collect();
    let mut echo = Command::new(folder.join("echo"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("runs");
    let mut input = echo.stdin.take().expect("piped");
    let all = sent.concat();
    let length = all.len();
    let writer = std::thread::spawn(move || input.write_all(&all));
    let output = echo.wait_with_output().expect("ends");
    assert!(output.status.success() && writer.join().expect("wrote").is_ok());
    let mut rest = &output.stdout[..];
    for (number, bytes) in sent.iter().enumerate() {
        let (back, behind) = rest.split_at_checked(bytes.len()).expect("as long");
        assert!(back == bytes, "message {number}: {:?}", Message::decode(bytes));
        rest = behind;
    }
    assert!(rest.is_empty());
    println!("3000 messages, {length} bytes, all equal");
    std::fs::remove_dir_all(folder).expect("ours");
}
