//! Seeds that the needle leaves in the tissue.

use super::TissueLoop;
use crate::rt::exchange::{Notice, Ticket};
use crate::rt::seed::Seed;
use stylet_shm_schema::{MAX_SEEDS, RefusalCode};

/// A seed is 4.5 mm long; its tail shows where its axis points.
const SEED_LENGTH_M: f64 = 4.5e-3;

impl TissueLoop {
    pub(super) fn drop_seed(&mut self, ticket: Ticket) {
        let tip_m = self.pose.tip_in_scene;
        let hint = self.held.map(|h| h.element);
        let on_line = self.material_on_line(SEED_LENGTH_M);
        let found = on_line.map_or_else(|| self.locate(&tip_m, hint), |[tip, _]| tip);
        let notice = match found {
            None => Notice::Refused {
                ticket,
                why: RefusalCode::TipOutsideTissue,
            },
            Some(_) if self.seeds.len() >= MAX_SEEDS => Notice::Refused {
                ticket,
                why: RefusalCode::NoSeedLeft,
            },
            Some(tip) => {
                let index = self.seeds.len() as u32;
                let tail_m = tip_m - self.pose.direction * SEED_LENGTH_M;
                let tail = on_line.map_or_else(|| self.locate(&tail_m, Some(tip.element)), |[_, tail]| tail);
                // Room for MAX_SEEDS was reserved: this push does not allocate.
                self.seeds.push(Seed {
                    tip,
                    tail,
                    axis: self.pose.direction.into(),
                    dropped_at_m: tip_m.into(),
                });
                let tick = self.response.tick;
                self.response.seed_count = self.seeds.len() as u32;
                self.notify(Notice::Seed {
                    tick,
                    time_ns: self.pose.time_ns,
                    index,
                    position_m: tip_m,
                });
                Notice::Done { ticket, tick }
            }
        };
        self.notify(notice);
    }

    pub(super) fn undo_seed(&mut self, ticket: Ticket) {
        let tick = self.response.tick;
        let notice = match self.seeds.pop() {
            Some(_) => Notice::Done { ticket, tick },
            None => Notice::Refused {
                ticket,
                why: RefusalCode::NoSeedToUndo,
            },
        };
        self.response.seed_count = self.seeds.len() as u32;
        self.notify(notice);
    }
}
