//! Turns of the planes: one picture is computed in each frame, so that no frame waits for both. The
//! planes alternate, so that neither waits for one that is never done.

use stylet_imaging::ultrasound::View;

/// State of the turns; frames are numbered by their passes.
#[derive(Debug, Default)]
pub(super) struct Turns {
    last: Option<(View, u64)>,
    /// Pass in which each plane waited last.
    waited: [Option<u64>; 2],
}

impl Turns {
    /// Returns whether the picture of this plane may be computed now.
    pub fn is_on(&self, view: View, pass: u64) -> bool {
        let Some((last, when)) = self.last else { return true };
        let other_waits = self
            .waited
            .iter()
            .enumerate()
            .any(|(n, waited)| n != view as usize && waited.is_some_and(|waited| waited + 1 >= pass));
        when != pass && !(last == view && other_waits)
    }

    /// Records that the picture of this plane was computed.
    pub fn took(&mut self, view: View, pass: u64) {
        self.last = Some((view, pass));
        self.waited[view as usize] = None;
    }

    /// Records that the picture of this plane is out of date.
    pub fn waits(&mut self, view: View, pass: u64) {
        self.waited[view as usize] = Some(pass);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns how often each plane is computed in this number of frames, if the planes `shown` are
    /// never done.
    fn computed(frames: u64, shown: impl Fn(u64) -> Vec<View>) -> [usize; 2] {
        let (mut turns, mut count) = (Turns::default(), [0; 2]);
        for pass in 1..=frames {
            let mut this_pass = 0;
            for view in shown(pass) {
                if turns.is_on(view, pass) {
                    turns.took(view, pass);
                    count[view as usize] += 1;
                    this_pass += 1;
                } else {
                    turns.waits(view, pass);
                }
            }
            assert!(this_pass <= 1, "frame {pass} waits for both");
        }
        count
    }

    #[test]
    fn unfinished_planes_alternate() {
        assert_eq!(computed(100, |_| View::ALL.to_vec()), [50, 50]);
        assert_eq!(computed(100, |_| vec![View::Transverse]), [100, 0]);
        let both_for_a_while = computed(100, |pass| match pass {
            ..=10 => View::ALL.to_vec(),
            _ => vec![View::Transverse],
        });
        assert!(both_for_a_while[0] >= 94, "{both_for_a_while:?}");
    }
}
