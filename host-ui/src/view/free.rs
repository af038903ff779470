//! Where words of a picture may stand: banners lie over the upper ones, for as long as what they say is so.

use egui::{Context, Id, LayerId, Order, Rect};

/// Of all banners.
pub(crate) const BANNERS: &str = "banners";
/// So much of a picture is left to its words, whatever lies over it, points.
const LEAST: f32 = 60.0;

/// The part of a picture below the banners of the last frame.
pub(crate) fn free_of_banners(ctx: &Context, rect: Rect) -> Rect {
    let id = Id::unique(BANNERS);
    let bottom = ctx.memory(|memory| {
        let is_shown = memory.areas().visible_last_frame(&LayerId::new(Order::Middle, id));
        memory.area_rect(id).filter(|_| is_shown).map(|area| area.bottom())
    });
    let lowest = (rect.bottom() - LEAST).max(rect.top());
    let top = bottom.map_or(rect.top(), |bottom| bottom.clamp(rect.top(), lowest));
    Rect::from_min_max(egui::pos2(rect.left(), top), rect.max)
}
