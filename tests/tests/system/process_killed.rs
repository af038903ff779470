//! The remains of killed programs in shared memory are removed by the next one, whatever its name.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use stylet_shm_schema::Instance;
use stylet_tests::{Core, left_behind, program, scratch, until};

/// A campaign under way: its instance is named after its process.
struct Campaign(Child);

impl Campaign {
    fn start(folder: &Path) -> Self {
        let file = folder.join("killed.toml");
        let text = "name = \"killed\"\nwindow = \"2s\"\ncheckpoint = \"1s\"\n[[part]]\nduration = \"60s\"\n";
        std::fs::write(&file, text).expect("the scratch folder can be written");
        let child = Command::new(program("rt-core"))
            .args(["campaign", "--rt-if-allowed", "--out"])
            .arg(folder.join("out"))
            .arg(&file)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("rt-core starts");
        let campaign = Self(child);
        let measures = until(Duration::from_secs(60), || left_behind(&campaign.instance()).len() > 20);
        assert!(measures, "{:?}", left_behind(&campaign.instance()));
        campaign
    }

    fn instance(&self) -> Instance {
        Instance::new(&format!("lab-{}", self.0.id())).expect("letters, digits and a hyphen")
    }
}

impl Drop for Campaign {
    fn drop(&mut self) {
        // SIGKILL.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The files of a killed campaign used to stay until the PC was restarted, some 100 MB of memory each time.
#[test]
fn the_next_start_removes_files_of_killed_programs_only() {
    let campaign = Campaign::start(&scratch("killed-campaign"));
    let mut killed = Core::start();
    drop(killed.host());
    let (of_campaign, of_core) = (campaign.instance(), killed.kill());
    drop(campaign);
    for left in [&of_campaign, &of_core] {
        assert!(
            !left_behind(left).is_empty(),
            "{}: that is the case to cope with",
            left.name()
        );
    }
    let mut living = Core::start();
    let mut link = living.host();
    let mut next = Core::start();
    drop(next.host());
    // The killed core had a name other than the next one's, as the campaign had.
    for swept in [&of_campaign, &of_core] {
        assert_eq!(left_behind(swept), [""; 0], "{}", swept.name());
    }
    // It serves, and a late host finds it.
    link.poll();
    let before = link.state().expect("live").tick;
    let goes_on = until(Duration::from_secs(5), || {
        link.poll();
        link.state().is_some_and(|s| s.tick > before)
    });
    assert!(goes_on && living.is_running());
    drop(living.host());
    next.finish();
    drop(link);
}
