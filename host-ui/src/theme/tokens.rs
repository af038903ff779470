//! The two sets of colours, their purposes, and the contrasts that they must keep.

use egui::Color32;

/// Colours by purpose; the same names in both themes.
#[derive(Debug)]
pub struct Tokens {
    pub dark: bool,
    pub background: Color32,
    pub panel: Color32,
    pub card: Color32,
    pub widget: Color32,
    pub widget_hovered: Color32,
    pub selected: Color32,
    pub line: Color32,
    pub text: Color32,
    pub weak: Color32,
    pub accent: Color32,
    pub good: Color32,
    pub warn: Color32,
    pub bad: Color32,
    /// Text on [`Tokens::good`], [`Tokens::warn`], [`Tokens::bad`] and [`Tokens::accent`].
    pub on_signal: Color32,
    /// Lines and labels of plots.
    pub force: Color32,
    pub depth: Color32,
    pub wake: Color32,
    pub work: Color32,
    /// Colours of the three-dimensional picture.
    pub gland: Color32,
    pub body: Color32,
    pub urethra: Color32,
    pub rectum: Color32,
    pub bladder: Color32,
    pub spared: Color32,
    pub bone: Color32,
    pub ghost: Color32,
    pub needle: Color32,
    pub needle_tip: Color32,
    pub seed_placed: Color32,
    pub seed_planned: Color32,
    pub path: Color32,
    pub entry: Color32,
    pub grid: Color32,
    pub template: Color32,
    pub measure: Color32,
}

pub const DARK: Tokens = Tokens {
    dark: true,
    background: Color32::from_rgb(20, 24, 29),
    panel: Color32::from_rgb(27, 32, 38),
    card: Color32::from_rgb(34, 40, 48),
    widget: Color32::from_rgb(49, 58, 69),
    widget_hovered: Color32::from_rgb(62, 74, 88),
    selected: Color32::from_rgb(24, 78, 114),
    line: Color32::from_rgb(60, 69, 80),
    text: Color32::from_rgb(222, 228, 234),
    weak: Color32::from_rgb(160, 171, 183),
    accent: Color32::from_rgb(86, 180, 233),
    good: Color32::from_rgb(52, 190, 163),
    warn: Color32::from_rgb(236, 168, 20),
    bad: Color32::from_rgb(238, 120, 52),
    on_signal: Color32::from_rgb(18, 20, 23),
    force: Color32::from_rgb(236, 168, 20),
    depth: Color32::from_rgb(86, 180, 233),
    wake: Color32::from_rgb(52, 190, 163),
    work: Color32::from_rgb(214, 140, 182),
    gland: Color32::from_rgb(196, 142, 132),
    body: Color32::from_rgb(150, 150, 140),
    urethra: Color32::from_rgb(200, 235, 60),
    rectum: Color32::from_rgb(205, 95, 30),
    bladder: Color32::from_rgb(110, 120, 255),
    spared: Color32::from_rgb(150, 115, 165),
    bone: Color32::from_rgb(222, 212, 180),
    ghost: Color32::from_rgb(120, 140, 165),
    needle: Color32::from_rgb(214, 221, 228),
    needle_tip: Color32::from_rgb(255, 255, 255),
    seed_placed: Color32::from_rgb(240, 228, 66),
    seed_planned: Color32::from_rgb(86, 180, 233),
    path: Color32::from_rgb(170, 182, 196),
    entry: Color32::from_rgb(52, 190, 163),
    grid: Color32::from_rgb(44, 51, 60),
    template: Color32::from_rgb(104, 118, 134),
    measure: Color32::from_rgb(240, 228, 66),
};

pub const LIGHT: Tokens = Tokens {
    dark: false,
    background: Color32::from_rgb(226, 231, 236),
    panel: Color32::from_rgb(240, 243, 246),
    card: Color32::from_rgb(252, 253, 254),
    widget: Color32::from_rgb(216, 223, 230),
    widget_hovered: Color32::from_rgb(200, 209, 219),
    selected: Color32::from_rgb(178, 212, 238),
    line: Color32::from_rgb(190, 199, 208),
    text: Color32::from_rgb(24, 29, 35),
    weak: Color32::from_rgb(78, 88, 99),
    accent: Color32::from_rgb(0, 92, 148),
    good: Color32::from_rgb(0, 105, 82),
    warn: Color32::from_rgb(128, 78, 0),
    bad: Color32::from_rgb(172, 52, 0),
    on_signal: Color32::from_rgb(255, 255, 255),
    force: Color32::from_rgb(128, 78, 0),
    depth: Color32::from_rgb(0, 92, 148),
    wake: Color32::from_rgb(0, 105, 82),
    work: Color32::from_rgb(146, 52, 104),
    gland: Color32::from_rgb(178, 74, 72),
    body: Color32::from_rgb(128, 128, 118),
    urethra: Color32::from_rgb(70, 140, 0),
    rectum: Color32::from_rgb(96, 32, 0),
    bladder: Color32::from_rgb(60, 60, 210),
    spared: Color32::from_rgb(150, 100, 170),
    bone: Color32::from_rgb(156, 156, 132),
    ghost: Color32::from_rgb(84, 104, 130),
    needle: Color32::from_rgb(120, 130, 140),
    needle_tip: Color32::from_rgb(60, 66, 74),
    seed_placed: Color32::from_rgb(202, 142, 0),
    seed_planned: Color32::from_rgb(0, 92, 148),
    path: Color32::from_rgb(76, 88, 102),
    entry: Color32::from_rgb(0, 105, 82),
    grid: Color32::from_rgb(202, 209, 216),
    template: Color32::from_rgb(134, 146, 158),
    measure: Color32::from_rgb(146, 52, 104),
};

/// Colours of drawings over an ultrasound picture, which is dark in both themes.
#[derive(Debug)]
pub struct ImageTokens {
    /// Colour around the picture, and behind text on it.
    pub background: Color32,
    pub text: Color32,
    pub crosshair: Color32,
    pub needle: Color32,
    pub gland: Color32,
    pub urethra: Color32,
    pub rectum: Color32,
    pub bladder: Color32,
    pub spared: Color32,
    pub bone: Color32,
    pub seed_placed: Color32,
    pub seed_planned: Color32,
    /// Colours at half, whole, one and a half and double the prescription; each has its own dashes
    /// as well.
    pub isodose: [Color32; 4],
    pub measure: Color32,
    /// Sign that a beam is on.
    pub beam: Color32,
    /// Drawing of the operator.
    pub drawn: Color32,
}

pub const IMAGE: ImageTokens = ImageTokens {
    background: Color32::from_rgb(6, 8, 10),
    text: Color32::from_rgb(226, 232, 238),
    crosshair: Color32::from_rgb(118, 134, 150),
    needle: Color32::from_rgb(255, 255, 255),
    gland: Color32::from_rgb(232, 150, 138),
    urethra: Color32::from_rgb(200, 235, 60),
    rectum: Color32::from_rgb(205, 95, 30),
    bladder: Color32::from_rgb(110, 120, 255),
    spared: Color32::from_rgb(170, 125, 180),
    bone: Color32::from_rgb(238, 234, 214),
    seed_placed: Color32::from_rgb(240, 228, 66),
    seed_planned: Color32::from_rgb(86, 180, 233),
    isodose: [
        Color32::from_rgb(86, 180, 233),
        Color32::from_rgb(60, 200, 160),
        Color32::from_rgb(236, 168, 20),
        Color32::from_rgb(238, 120, 52),
    ],
    measure: Color32::from_rgb(255, 255, 255),
    beam: Color32::from_rgb(255, 214, 60),
    drawn: Color32::from_rgb(126, 224, 129),
};

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_test_kit::sight;

    /// Returns red, green and blue of sRGB in proportion to light.
    fn linear(color: Color32) -> [f64; 3] {
        let [r, g, b, _] = color.to_array();
        sight::linear([r, g, b])
    }

    /// Returns the relative luminance (WCAG 2.2).
    fn luminance(color: Color32) -> f64 {
        let [r, g, b] = linear(color);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    fn contrast(a: Color32, b: Color32) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn the_formula_gives_the_known_ends() {
        assert!((contrast(Color32::WHITE, Color32::BLACK) - 21.0).abs() < 1e-9);
        // #767676 is the lightest grey that passes on white.
        let grey = contrast(Color32::from_rgb(0x76, 0x76, 0x76), Color32::WHITE);
        assert!((4.5..4.6).contains(&grey), "{grey}");
    }

    #[test]
    fn every_text_is_legible_on_its_background() {
        for t in [&DARK, &LIGHT] {
            let words = [t.text, t.weak, t.accent, t.good, t.warn, t.bad];
            let plots = [t.force, t.depth, t.wake, t.work];
            for ink in words.into_iter().chain(plots) {
                for paper in [t.background, t.panel, t.card] {
                    let c = contrast(ink, paper);
                    assert!(c >= 4.5, "{ink:?} on {paper:?}: {c:.2}");
                }
            }
            for paper in [t.widget, t.widget_hovered, t.selected] {
                assert!(contrast(t.text, paper) >= 4.5, "text on {paper:?}");
            }
            for signal in [t.good, t.warn, t.bad, t.accent] {
                assert!(contrast(t.on_signal, signal) >= 4.5, "on {signal:?}");
            }
            // Drawings need 3:1.
            for mark in [t.entry, t.path, t.seed_planned, t.needle_tip, t.measure] {
                let c = contrast(mark, t.background);
                assert!(c >= 3.0, "{mark:?} on the background of the picture: {c:.2}");
            }
        }
    }

    #[test]
    fn lines_over_an_ultrasound_picture_stand_out_from_its_background() {
        let i = &IMAGE;
        let lines = [
            i.text,
            i.needle,
            i.gland,
            i.urethra,
            i.rectum,
            i.bladder,
            i.spared,
            i.bone,
            i.seed_placed,
            i.seed_planned,
            i.measure,
            i.beam,
            i.drawn,
        ];
        for ink in lines.into_iter().chain(i.isodose) {
            assert!(contrast(ink, i.background) >= 4.5, "{ink:?}");
        }
    }

    /// Guards against urethra, rectum and bladder in one pink.
    #[test]
    fn structures_differ_for_every_sight() {
        const LEAST: f64 = 18.0;
        let (d, l, i) = (&DARK, &LIGHT, &IMAGE);
        for (place, colors) in [
            ("dark", [d.gland, d.urethra, d.rectum, d.bladder, d.spared, d.bone]),
            ("light", [l.gland, l.urethra, l.rectum, l.bladder, l.spared, l.bone]),
            ("image", [i.gland, i.urethra, i.rectum, i.bladder, i.spared, i.bone]),
        ] {
            for (of, matrix) in &sight::SIGHTS {
                for (n, one) in colors.iter().enumerate() {
                    for other in &colors[n + 1..] {
                        let [a, b] = [one, other].map(|color| sight::seen(linear(*color), matrix));
                        let apart = sight::apart(a, b);
                        assert!(
                            apart > LEAST,
                            "{place}, {of}: {one:?} and {other:?} are {apart:.1} apart"
                        );
                    }
                }
            }
        }
    }
}
