//! Places for text on a picture, below the banners that lie over its upper part.

use egui::{Context, Id, LayerId, Order, Rect};

/// Area of all banners.
pub(crate) const BANNERS: &str = "banners";
/// Distance of text below banners from text half way down a picture, points.
const APART: f32 = 34.0;

/// Returns the part of a picture below the banners of the last frame; all of it if they leave too
/// little for text.
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
