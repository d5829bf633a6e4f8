//! A figure as a bitmap: the drawing in pixels, with a font of our own so that it looks the same on every machine.

use std::io;

use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind, FontTransform,
};
use rotorlead_answer::Figure;
use tiny_skia::{FillRule, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, Transform};
use ttf_parser::{Face, OutlineBuilder};

use super::FigureError;
use super::drawing::{PX, draw, size};

/// Pixels of the bitmap per pixel of the SVG: sharp on dense screens and in print.
const SCALE: u32 = 2;
/// What PNG calls the program that made a picture.
const KEYWORD: &str = "Software";
const PROGRAM: &str = "rotorlead";
/// Both as they stand in the file, before the picture.
pub(super) const MARK: &str = "Software\0rotorlead";

/// The picture as PNG, twice as large as the SVG.
///
/// # Errors
/// When nothing can be drawn.
pub fn png(figure: &Figure) -> Result<Vec<u8>, FigureError> {
    let (width, height) = size(figure);
    let pixels = Pixmap::new(width * SCALE / PX, height * SCALE / PX);
    let mut pixels = pixels.ok_or_else(|| FigureError::drawing(figure, "it is too large"))?;
    // Noto Sans, under the SIL Open Font License 1.1.
    let font = Face::parse(notosans::REGULAR_TTF, 0).map_err(|error| FigureError::drawing(figure, error))?;
    draw(figure, Bitmap { pixels: &mut pixels, size: (width, height), font })?;
    // White is drawn first, so that nothing shines through.
    let opaque: Vec<u8> = pixels.data().chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied().collect();
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, pixels.width(), pixels.height());
    encoder.set_color(png::ColorType::Rgb);
    // Twice the size of the best, in a small part of its time.
    encoder.set_compression(png::Compression::Fast);
    let marked = encoder.add_text_chunk(KEYWORD.to_owned(), PROGRAM.to_owned());
    marked.map_err(|error| FigureError::drawing(figure, error))?;
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&opaque));
    written.map_err(|error| FigureError::drawing(figure, error))?;
    Ok(png)
}

/// A canvas of pixels, with the outlines of letters.
struct Bitmap<'a> {
    pixels: &'a mut Pixmap,
    /// Width and height in units of the drawing.
    size: (u32, u32),
    font: Face<'static>,
}

type Drawn = Result<(), DrawingErrorKind<io::Error>>;

/// From units of the drawing to pixels.
fn to_pixels() -> Transform {
    let scale = SCALE as f32 / PX as f32;
    Transform::from_scale(scale, scale)
}

fn paint(color: BackendColor) -> Paint<'static> {
    let mut paint = Paint::default();
    let (red, green, blue) = color.rgb;
    paint.set_color_rgba8(red, green, blue, (255.0 * color.alpha).round() as u8);
    paint
}

/// `None` where there are too few points for one.
fn path(points: impl IntoIterator<Item = BackendCoord>, is_closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (x, y) in points {
        if path.is_empty() { path.move_to(x as f32, y as f32) } else { path.line_to(x as f32, y as f32) }
    }
    if is_closed {
        path.close();
    }
    path.finish()
}

impl Bitmap<'_> {
    /// Fills a path, or draws along it. What has no extent is not seen.
    fn put(&mut self, path: Option<Path>, style: &impl BackendStyle, is_filled: bool) -> Drawn {
        let Some(path) = path else { return Ok(()) };
        let paint = paint(style.color());
        if is_filled {
            self.pixels.fill_path(&path, &paint, FillRule::Winding, to_pixels(), None);
        } else {
            let stroke = Stroke { width: style.stroke_width() as f32, ..Stroke::default() };
            self.pixels.stroke_path(&path, &paint, &stroke, to_pixels(), None);
        }
        Ok(())
    }
}

impl DrawingBackend for Bitmap<'_> {
    type ErrorType = io::Error;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, color: BackendColor) -> Drawn {
        self.draw_rect((x, y), (x + 1, y + 1), &color, true)
    }

    fn draw_line<S: BackendStyle>(&mut self, from: BackendCoord, to: BackendCoord, style: &S) -> Drawn {
        self.put(path([from, to], false), style, false)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        (left, top): BackendCoord,
        (right, bottom): BackendCoord,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let rect = Rect::from_ltrb(left as f32, top as f32, right as f32, bottom as f32);
        self.put(rect.map(PathBuilder::from_rect), style, fill)
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, points: I, style: &S) -> Drawn {
        self.put(path(points, false), style, false)
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, points: I, style: &S) -> Drawn {
        self.put(path(points, true), style, true)
    }

    fn draw_circle<S: BackendStyle>(&mut self, (x, y): BackendCoord, radius: u32, style: &S, fill: bool) -> Drawn {
        self.put(PathBuilder::from_circle(x as f32, y as f32, radius as f32), style, fill)
    }

    /// Text at the place and in the size that the SVG backend gives it.
    fn draw_text<S: BackendTextStyle>(&mut self, text: &str, style: &S, (x, y): BackendCoord) -> Drawn {
        let mut outline = Outline { path: PathBuilder::new(), x: 0.0 };
        for letter in text.chars() {
            let glyph = self.font.glyph_index(letter).unwrap_or_default();
            self.font.outline_glyph(glyph, &mut outline);
            outline.x += f32::from(self.font.glyph_hor_advance(glyph).unwrap_or(0));
        }
        let size = (style.size() / 1.24) as f32;
        let scale = size / f32::from(self.font.units_per_em());
        let anchor = style.anchor();
        let right = match anchor.h_pos {
            HPos::Left => 0.0,
            HPos::Center => -0.5 * outline.x * scale,
            HPos::Right => -outline.x * scale,
        };
        let down = match anchor.v_pos {
            VPos::Top => 0.76 * size,
            VPos::Center => 0.25 * size,
            VPos::Bottom => -0.25 * size,
        };
        let degrees = match style.transform() {
            FontTransform::None => 0.0,
            FontTransform::Rotate90 => 90.0,
            FontTransform::Rotate180 => 180.0,
            FontTransform::Rotate270 => 270.0,
        };
        let place = to_pixels().pre_translate(x as f32, y as f32).pre_concat(Transform::from_rotate(degrees));
        // Fonts count upward.
        let place = place.pre_translate(right, down).pre_scale(scale, -scale);
        if let Some(path) = outline.path.finish() {
            self.pixels.fill_path(&path, &paint(style.color()), FillRule::Winding, place, None);
        }
        Ok(())
    }
}

/// Letters beside each other, in units of the font.
struct Outline {
    path: PathBuilder,
    /// Where the next letter begins.
    x: f32,
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.path.move_to(self.x + x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.path.line_to(self.x + x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.path.quad_to(self.x + x1, y1, self.x + x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.path.cubic_to(self.x + x1, y1, self.x + x2, y2, self.x + x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}
