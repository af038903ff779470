//! Where words of a picture may stand: banners lie over the upper ones, for as long as what they say is so.

use egui::{Context, Id, LayerId, Order, Rect};

/// Of all banners.
pub(crate) const BANNERS: &str = "banners";
/// Words below banners keep so far from what stands half way down a picture, points.
const APART: f32 = 34.0;

/// The part of a picture below the banners of the last frame; all of it where they leave too little for words.
pub(crate) fn free_of_banners(ctx: &Context, rect: Rect) -> Rect {
    let id = Id::unique(BANNERS);
    let bottom = ctx.memory(|memory| {
        let is_shown = memory.areas().visible_last_frame(&LayerId::new(Order::Middle, id));
        memory.area_rect(id).filter(|_| is_shown).map(|area| area.bottom())
    });
    let lowest = rect.center().y - APART;
    let top = bottom.filter(|bottom| *bottom > rect.top() && *bottom <= lowest);
    Rect::from_min_max(egui::pos2(rect.left(), top.unwrap_or(rect.top())), rect.max)
}
