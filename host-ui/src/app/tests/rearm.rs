//! A run while a fault stands: the window asks, and nothing begins before the answer.

use super::fixture::{Drawn, one_needle};
use crate::action::Action;
use stylet_shm_schema::{Fault, flags};

#[test]
fn a_run_asks_before_it_rearms() {
    let mut drawn = Drawn::new([1280.0, 720.0], 1.0);
    drawn.app.shown = one_needle(0.0, 0);
    if let Some(state) = &mut drawn.app.shown.state {
        (state.fault, state.flags) = (Fault::TissueStale as u32, flags::REAL_TIME);
    }
    let ctx = drawn.ctx.clone();
    for begin in [Action::RunAll, Action::StartOver] {
        drawn.app.act(begin.clone(), &ctx);
        assert!(drawn.app.run.is_none() && drawn.app.asks_rearm.is_some(), "{begin:?}");
        drawn.place("Re-arm and run (Y)");
        drawn.place("Leave the force off (N)");
        drawn.app.act(Action::Rearm(false), &ctx);
        assert!(drawn.app.run.is_none() && drawn.app.asks_rearm.is_none(), "{begin:?}");
        drawn.app.act(begin, &ctx);
        drawn.app.act(Action::Rearm(true), &ctx);
        assert!(drawn.app.run.take().is_some());
    }
    // Without a fault the window does not ask.
    if let Some(state) = &mut drawn.app.shown.state {
        state.fault = 0;
    }
    drawn.app.act(Action::RunAll, &ctx);
    assert!(drawn.app.run.is_some());
}
