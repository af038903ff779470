//! Finds text that is clipped or overlaps other text, from the painted shapes of any state.

use super::fixture::Drawn;
use egui::accesskit::{NodeId, Role};
use egui::epaint::ClippedShape;
use egui::{LayerId, Pos2, Rect, Shape, Vec2};
use std::collections::HashMap;

/// Overhang that text may have, in points.
const SLACK: f32 = 1.0;
/// Overlap that neighbours may have, in points.
const SHARED: f32 = 1.5;
/// Turns of the wheel, in points: to the end of the area under the pointer, on with its parent, and
/// back.
const WHEEL: [f32; 3] = [-400.0, -400.0, 900.0];

/// Painted text, or a named widget, which may be clipped away whole.
#[derive(Clone, Debug)]
struct Piece {
    name: String,
    rect: Rect,
    clip: Rect,
    layer: LayerId,
    is_painted: bool,
}

impl Piece {
    fn leaves_sideways(&self) -> bool {
        self.rect.left() < self.clip.left() - SLACK || self.rect.right() > self.clip.right() + SLACK
    }

    fn leaves_upwards_or_downwards(&self) -> bool {
        self.rect.top() < self.clip.top() - SLACK || self.rect.bottom() > self.clip.bottom() + SLACK
    }

    fn seen(&self) -> Rect {
        self.rect.intersect(self.clip)
    }
}

/// Shapes that one frame painted.
pub struct Painted {
    pieces: Vec<Piece>,
}

impl Painted {
    /// Collects the shapes within the frame, once everything is drawn.
    pub fn of(ctx: &egui::Context) -> Self {
        let mut layers: Vec<LayerId> = ctx.memory(|m| m.layer_ids().collect());
        layers.push(LayerId::background());
        layers.sort_by_key(|layer| (layer.order, layer.id.value()));
        layers.dedup();
        let mut pieces = Vec::new();
        ctx.graphics(|graphics| {
            for layer in layers {
                for ClippedShape { clip_rect, shape, .. } in
                    graphics.get(layer).into_iter().flat_map(|l| l.all_entries())
                {
                    texts(shape, *clip_rect, layer, &mut pieces);
                }
            }
        });
        Self { pieces }
    }

    /// Adds names, and which of them are text fields; both are known after the frame.
    pub fn name_widgets(&mut self, ctx: &egui::Context, nodes: &[(NodeId, egui::accesskit::Node)]) {
        let names: HashMap<u64, &egui::accesskit::Node> = nodes.iter().map(|(id, node)| (id.0, node)).collect();
        let mut fields = Vec::new();
        ctx.viewport(|viewport| {
            for (layer, widgets) in viewport.this_pass.widgets.layers() {
                for widget in widgets {
                    let Some(node) = names.get(&widget.id.value()) else {
                        continue;
                    };
                    if node.role() == Role::TextInput {
                        fields.push(widget.rect);
                    }
                    let Some(name) = node.label().or(node.value()).filter(|name| !name.is_empty()) else {
                        continue;
                    };
                    self.pieces.push(Piece {
                        name: name.to_owned(),
                        rect: widget.rect,
                        clip: widget.interact_rect,
                        layer: *layer,
                        is_painted: false,
                    });
                }
            }
        });
        // A text field shows only a part of its text; the keys move through it.
        self.pieces
            .retain(|piece| !piece.is_painted || !fields.iter().any(|field| field.contains(piece.seen().center())));
    }

    /// Returns the place of the widget with this name.
    pub fn place(&self, name: &str) -> Option<Rect> {
        let named = self.pieces.iter().find(|p| !p.is_painted && p.name == name);
        named.map(|piece| piece.rect)
    }

    /// Returns whether everything is in the same place.
    pub fn is_as(&self, other: &Self) -> bool {
        let pairs = self.pieces.iter().zip(&other.pieces);
        self.pieces.len() == other.pieces.len() && pairs.into_iter().all(|(a, b)| a.rect == b.rect && a.clip == b.clip)
    }

    /// Returns the place of the piece along the wheel's direction; across it the piece stays.
    fn place_of(&self, piece: &Piece, sideways: bool) -> Option<f32> {
        let along = |at: Pos2| if sideways { [at.x, at.y] } else { [at.y, at.x] };
        let [_, was_across] = along(piece.rect.min);
        let mut like = self
            .pieces
            .iter()
            .filter(|other| other.is_painted == piece.is_painted && other.name == piece.name)
            .map(|other| along(other.rect.min));
        like.find(|[_, across]| (across - was_across).abs() < 0.5)
            .map(|[at, _]| at)
    }
}

fn texts(shape: &Shape, clip: Rect, layer: LayerId, pieces: &mut Vec<Piece>) {
    match shape {
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| texts(shape, clip, layer, pieces)),
        Shape::Text(text) if text.angle == 0.0 && !text.galley.mesh_bounds.is_negative() => pieces.push(Piece {
            name: text.galley.text().to_owned(),
            rect: text.galley.mesh_bounds.translate(text.pos.to_vec2()),
            clip,
            layer,
            is_painted: true,
        }),
        _ => {}
    }
}

/// Returns every text that is cut off and cannot be scrolled into view, and every pair in one layer
/// that overlaps.
pub fn misplaced(drawn: &mut Drawn) -> Vec<String> {
    let painted = drawn.frame();
    let mut problems = overlaps(&painted);
    let (sideways, rest): (Vec<&Piece>, Vec<&Piece>) = painted.pieces.iter().partition(|p| p.leaves_sideways());
    let cut = |piece: &Piece| format!("{:?} at {} is cut off by {}", piece.name, piece.rect, piece.clip);
    problems.extend(out_of_reach(drawn, &painted, sideways, true).into_iter().map(cut));
    let candidates: Vec<&Piece> = rest.into_iter().filter(|p| p.leaves_upwards_or_downwards()).collect();
    problems.extend(out_of_reach(drawn, &painted, candidates, false).into_iter().map(cut));
    problems.sort();
    problems.dedup();
    problems
}

fn overlaps(painted: &Painted) -> Vec<String> {
    let seen: Vec<&Piece> = painted
        .pieces
        .iter()
        .filter(|p| p.is_painted && p.seen().is_positive())
        .collect();
    let mut problems = Vec::new();
    for (n, one) in seen.iter().enumerate() {
        for other in seen[n + 1..].iter().filter(|other| other.layer == one.layer) {
            let common = one.seen().intersect(other.seen());
            if common.width() > SHARED && common.height() > SHARED {
                let (a, b) = (one.seen(), other.seen());
                problems.push(format!("{:?} at {a} lies over {:?} at {b}", one.name, other.name));
            }
        }
    }
    problems
}

/// Returns those of the pieces that no turn of the wheel moves.
fn out_of_reach<'a>(drawn: &mut Drawn, before: &Painted, mut left: Vec<&'a Piece>, sideways: bool) -> Vec<&'a Piece> {
    let mut tried: Vec<Pos2> = Vec::new();
    let pieces = left.clone();
    for piece in pieces {
        let seen = piece.seen();
        let (rect, clip) = (piece.rect, piece.clip);
        let place = match seen.is_positive() {
            true => seen.center(),
            // The piece is wholly hidden: use a point just inside the edge behind which it lies.
            false if rect.top() >= clip.bottom() => Pos2::new(rect.center().x, clip.bottom() - 4.0),
            false => Pos2::new(rect.center().x, clip.top() + 4.0),
        };
        if !left.iter().any(|other| std::ptr::eq(*other, piece)) {
            continue;
        }
        // Another window covers it here; this window is tested separately.
        if drawn.ctx.layer_id_at(place).is_some_and(|layer| layer != piece.layer) {
            left.retain(|other| other.layer != piece.layer || !near_clip(other, piece));
            continue;
        }
        // One turn for each column and stretch of it.
        let near = |other: &Pos2| (other.x - place.x).abs() < 150.0 && (other.y - place.y).abs() < 60.0;
        if tried.iter().any(near) {
            continue;
        }
        tried.push(place);
        for turn in WHEEL {
            let after = drawn.scrolled(
                place,
                if sideways {
                    Vec2::new(turn, 0.0)
                } else {
                    Vec2::new(0.0, turn)
                },
            );
            let has_moved = |piece: &Piece| {
                let (was, is) = (before.place_of(piece, sideways), after.place_of(piece, sideways));
                // A piece that scrolled out of the picture is no longer painted.
                was.zip(is).is_none_or(|(was, is)| (was - is).abs() > 1.0)
            };
            left.retain(|other| !has_moved(other));
        }
    }
    left
}

fn near_clip(one: &Piece, other: &Piece) -> bool {
    let across = one.clip.x_range().intersection(other.clip.x_range());
    across.span() > 0.0
}
