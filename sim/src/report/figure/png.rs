//! A figure as a bitmap: the SVG, drawn with a font of our own so that it looks the same on every machine.

use std::sync::{Arc, OnceLock};

use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

use super::{Figure, FigureError};

/// Pixels of the bitmap per pixel of the SVG: sharp on dense screens and in print.
const SCALE: f32 = 2.0;

impl Figure {
    /// The picture as PNG, twice as large as the SVG.
    ///
    /// # Errors
    /// When nothing can be drawn.
    pub fn png(&self) -> Result<Vec<u8>, FigureError> {
        let failed = |reason: String| FigureError::Drawing { name: self.name.clone(), reason };
        let options = Options { fontdb: fonts(), font_family: FAMILY.to_owned(), ..Options::default() };
        let tree = Tree::from_str(&self.svg()?, &options).map_err(|error| failed(error.to_string()))?;
        let size = tree.size().to_int_size().scale_by(SCALE).ok_or_else(|| failed("it has no size".to_owned()))?;
        let mut pixels =
            Pixmap::new(size.width(), size.height()).ok_or_else(|| failed("it is too large".to_owned()))?;
        pixels.fill(Color::WHITE);
        resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
        pixels.encode_png().map_err(|error| failed(error.to_string()))
    }
}

const FAMILY: &str = "Noto Sans";

/// Noto Sans (SIL Open Font License 1.1) for every family that the SVG names.
fn fonts() -> Arc<fontdb::Database> {
    static FONTS: OnceLock<Arc<fontdb::Database>> = OnceLock::new();
    let load = || {
        let mut fonts = fontdb::Database::new();
        fonts.load_font_data(notosans::REGULAR_TTF.to_vec());
        fonts.set_sans_serif_family(FAMILY);
        Arc::new(fonts)
    };
    Arc::clone(FONTS.get_or_init(load))
}
