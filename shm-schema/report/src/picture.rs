//! Common parts of all pictures: SVG scaled by the page, fonts, and colours that the colour-blind can distinguish.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;

const FONT: &str = "system-ui, sans-serif";
/// Colour of words and axes.
pub const INK: RGBColor = RGBColor(0x33, 0x3d, 0x47);
/// Colour of the mesh.
pub const FAINT: RGBColor = RGBColor(0xe3, 0xe7, 0xeb);
/// Colours of Okabe and Ito, without their yellow, which is too faint on white.
pub const COLOURS: [RGBColor; 7] = [
    BLUE,
    ORANGE,
    GREEN,
    PURPLE,
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];
/// Colour of the first series.
pub const BLUE: RGBColor = RGBColor(0, 114, 178);
/// Colour of the second series.
pub const ORANGE: RGBColor = RGBColor(213, 94, 0);
/// Colour of the third series.
pub const GREEN: RGBColor = RGBColor(0, 158, 115);
/// Colour of the fourth series.
pub const PURPLE: RGBColor = RGBColor(204, 121, 167);

/// Picture that cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[error("a picture cannot be drawn: {0}")]
pub struct DrawError(String);

/// Surface that a picture is drawn on.
pub type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Result of drawing.
pub type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Draws a picture as SVG that is as wide as its place in a page.
///
/// # Errors
/// Where `draw` ends with one.
pub fn drawn(size: (u32, u32), draw: impl FnOnce(&Canvas) -> Drawn) -> Result<String, DrawError> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&root)
            .and_then(|()| root.present().map_err(Into::into))
            .map_err(|e| DrawError(e.to_string()))?;
    }
    let fixed = format!("width=\"{}\" height=\"{}\" ", size.0, size.1);
    Ok(svg.replacen(&fixed, "", 1))
}

/// Returns the style of the words of a picture.
pub fn label(size: u32) -> TextStyle<'static> {
    (FONT, size).into_font().color(&INK)
}

/// Gives a chart the common axes with their names; `more` sets its own options.
///
/// # Errors
/// Those of the backend.
pub fn axes<'a, 'b, X, Y>(
    chart: &'b mut ChartContext<'a, SVGBackend<'_>, Cartesian2d<X, Y>>,
    [x, y]: [&str; 2],
    more: impl FnOnce(&mut plotters::chart::MeshStyle<'a, 'b, X, Y, SVGBackend<'_>>),
) -> Drawn
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut mesh = chart.configure_mesh();
    mesh.bold_line_style(FAINT)
        .light_line_style(TRANSPARENT)
        .axis_style(INK)
        .x_desc(x)
        .y_desc(y)
        .label_style(label(12))
        .axis_desc_style(label(13));
    more(&mut mesh);
    Ok(mesh.draw()?)
}
