//! Differences between two frames of the window.

use egui::epaint::{ClippedShape, Shape};
use egui::{Pos2, Rect, Vec2};

/// Reach of smoothed edges and pixel rounding beyond a shape, in points.
const EDGE: f32 = 3.0;
/// Most shapes added or removed together; beyond it, everything up to the next equal pair counts as
/// changed.
const REACH: usize = 12;
/// Most rectangles, because each costs one pass over the shapes.
const MOST: usize = 24;

/// Shape, and the area in which it is visible.
#[derive(Clone, Debug)]
pub(super) struct Drawn {
    pub shape: ClippedShape,
    /// Visible area in points; may be empty.
    pub rect: Rect,
    /// True for a finished picture, which hides everything below it.
    is_picture: bool,
}

impl Drawn {
    /// Creates a shape in a window of this size.
    pub(super) fn new(shape: ClippedShape, window: Rect) -> Self {
        let own = shape.transform_after_tessellation * shape.shape.visual_bounding_rect();
        let is_picture = matches!(shape.shape, Shape::Callback(_));
        let own = if is_picture { own } else { own.expand(EDGE) };
        let seen = own.intersect(shape.clip_rect).intersect(window);
        Self {
            rect: if seen.is_positive() { seen } else { Rect::ZERO },
            is_picture,
            shape,
        }
    }

    /// Makes the shape visible in all of this rectangle.
    pub(super) fn everywhere(self, rect: Rect) -> Self {
        Self { rect, ..self }
    }

    /// Returns whether it hides everything below it in this rectangle, which is aligned to whole
    /// pixels.
    pub(super) fn hides_below(&self, rect: Rect) -> bool {
        self.is_picture && self.rect.contains_rect(rect)
    }
}

/// Returns rectangles, in points and on whole pixels, outside which both frames look the same.
/// Their overlap is small.
///
/// Equal shapes are paired in painting order, so that the unpaired ones cover every difference.
pub(super) fn damage(before: &[Drawn], now: &[Drawn], pixels_per_point: f32) -> Vec<Rect> {
    let (mut pictures, mut others) = (Vec::new(), Vec::new());
    let (mut old, mut new) = (0, 0);
    while old < before.len() || new < now.len() {
        let (removed, added) = next_pair(&before[old..], &now[new..]);
        for drawn in before[old..old + removed].iter().chain(&now[new..new + added]) {
            let rects = if drawn.is_picture { &mut pictures } else { &mut others };
            rects.push(on_pixels(drawn.rect, pixels_per_point));
        }
        // The pair itself, unless a frame has ended.
        old = before.len().min(old + removed + 1);
        new = now.len().min(new + added + 1);
    }
    // A picture gets its own rectangle, so that nothing below it needs drawing.
    let mut rects: Vec<Rect> = Vec::new();
    for picture in pictures {
        if !rects.iter().any(|r| r.contains_rect(picture)) {
            rects.push(picture);
        }
    }
    let mut between = Vec::new();
    for rect in others {
        if !rects.iter().any(|r| r.contains_rect(rect)) {
            add(&mut between, rect);
        }
    }
    rects.append(&mut between);
    rects
}

/// Returns the number of shapes before the first equal pair in each of both; all of them if there
/// is none.
fn next_pair(before: &[Drawn], now: &[Drawn]) -> (usize, usize) {
    for skipped in 0..=before.len().max(now.len()) {
        // Try equal numbers first, because most often a shape was replaced.
        if let (Some(a), Some(b)) = (before.get(skipped), now.get(skipped))
            && a.shape == b.shape
        {
            return (skipped, skipped);
        }
        if skipped > REACH {
            continue;
        }
        for fewer in 0..skipped {
            for (removed, added) in [(skipped, fewer), (fewer, skipped)] {
                if let (Some(a), Some(b)) = (before.get(removed), now.get(added))
                    && a.shape == b.shape
                {
                    return (removed, added);
                }
            }
        }
    }
    (before.len(), now.len())
}

fn on_pixels(rect: Rect, pixels_per_point: f32) -> Rect {
    let low = (rect.min.to_vec2() * pixels_per_point).floor() / pixels_per_point;
    let high = (rect.max.to_vec2() * pixels_per_point).ceil() / pixels_per_point;
    Rect::from_min_max(low.to_pos2(), high.to_pos2())
}

/// Joins rectangles whose union costs no more to draw than both.
fn add(rects: &mut Vec<Rect>, rect: Rect) {
    if !rect.is_positive() {
        return;
    }
    let mut rect = rect;
    while let Some(at) = rects.iter().position(|r| extra_area(*r, rect) <= 0.0) {
        rect = rect.union(rects.swap_remove(at));
    }
    rects.push(rect);
    if rects.len() > MOST {
        let pairs = (1..rects.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
        let extra = |&(a, b): &(usize, usize)| extra_area(rects[a], rects[b]);
        if let Some((a, b)) = pairs.min_by(|one, other| extra(one).total_cmp(&extra(other))) {
            let both = rects[a].union(rects.swap_remove(b));
            rects.swap_remove(a);
            add(rects, both);
        }
    }
}

/// Returns the area of the union beyond both rectangles, in square points.
fn extra_area(a: Rect, b: Rect) -> f32 {
    a.union(b).area() - a.area() - b.area()
}

/// Returns the whole window, in points.
pub(super) fn window(size: [u32; 2], pixels_per_point: f32) -> Rect {
    let [width, height] = size.map(|side| side as f32 / pixels_per_point);
    Rect::from_min_size(Pos2::ZERO, Vec2::new(width, height))
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::Color32;

    const WINDOW: Rect = Rect::from_min_max(Pos2::ZERO, Pos2::new(400.0, 300.0));

    fn square(x: f32, y: f32, side: f32, red: u8) -> Drawn {
        let rect = Rect::from_min_size(Pos2::new(x, y), Vec2::splat(side));
        let shape = Shape::rect_filled(rect, 0.0, Color32::from_rgb(red, 0, 0));
        Drawn::new(ClippedShape::new(WINDOW, shape), WINDOW)
    }

    /// Returns the topmost shape at each point, by colour with its edge.
    fn picture(shapes: &[Drawn]) -> Vec<usize> {
        let mut points = vec![usize::MAX; 400 * 300];
        for drawn in shapes {
            let Shape::Rect(square) = &drawn.shape.shape else {
                panic!("a square")
            };
            for y in 0..300 {
                for x in 0..400 {
                    if drawn.rect.contains(Pos2::new(x as f32 + 0.5, y as f32 + 0.5)) {
                        points[y * 400 + x] = usize::from(square.fill.r());
                    }
                }
            }
        }
        points
    }

    #[test]
    fn frames_look_alike_outside_the_damage() {
        let mut generator = stylet_random::Random(7);
        let mut random = move |below: usize| generator.below(below);
        let any = |random: &mut dyn FnMut(usize) -> usize| {
            let [x, y, side, red] = [380, 280, 60, 256].map(&mut *random);
            square(x as f32, y as f32, side as f32 + 1.0, red as u8)
        };
        let mut changed_points = 0;
        for round in 0..60 {
            let before: Vec<Drawn> = (0..random(40)).map(|_| any(&mut random)).collect();
            let mut now = before.clone();
            for _ in 0..random(1 + round % 20) {
                let count = now.len();
                let at = random(count + 1);
                match random(4) {
                    0 => now.insert(at, any(&mut random)),
                    1 if at < count => now[at] = any(&mut random),
                    2 if at < count => drop(now.remove(at)),
                    _ if count > 1 => now.swap(at % count, 0),
                    _ => {}
                }
            }
            let damaged = damage(&before, &now, 1.5);
            assert!(damaged.len() <= MOST);
            for (i, (a, b)) in picture(&before).iter().zip(picture(&now)).enumerate() {
                let point = Pos2::new((i % 400) as f32 + 0.5, (i / 400) as f32 + 0.5);
                if *a != b {
                    changed_points += 1;
                    assert!(damaged.iter().any(|r| r.contains(point)), "round {round}: {point:?}");
                }
            }
        }
        assert!(changed_points > 10_000, "{changed_points}");
    }

    #[test]
    fn a_frame_like_the_one_before_has_no_damage() {
        let frame = [square(1.0, 2.0, 30.0, 9), square(40.0, 2.0, 30.0, 8)];
        assert!(damage(&frame, &frame, 1.0).is_empty());
    }

    #[test]
    fn an_inserted_shape_damages_only_its_place() {
        let before: Vec<Drawn> = (0..50).map(|i| square(7.0 * i as f32, 20.0, 5.0, i)).collect();
        let mut now = before.clone();
        now.insert(10, square(200.0, 200.0, 10.0, 255));
        let own = Rect::from_min_max(Pos2::new(197.0, 197.0), Pos2::new(213.0, 213.0));
        assert_eq!(damage(&before, &now, 1.0), [own]);
        assert_eq!(damage(&now, &before, 1.0), [own]);
    }

    #[test]
    fn damage_lies_on_whole_pixels() {
        let (before, now) = ([square(10.3, 10.0, 5.0, 1)], [square(10.3, 10.0, 5.0, 2)]);
        for scale in [1.0, 1.25, 1.5, 2.0] {
            for rect in damage(&before, &now, scale) {
                for edge in [rect.min.x, rect.min.y, rect.max.x, rect.max.y] {
                    let pixels = edge * scale;
                    assert!((pixels - pixels.round()).abs() < 1e-3, "{scale}: {rect:?}");
                }
            }
        }
    }
}
