//! Answers drawn: a figure as SVG and PNG, and a report as one HTML file that needs no network, or in parts for another page.

mod figure;
mod html;
mod markup;

pub use figure::FigureError;
#[cfg(feature = "drawing")]
pub use figure::{is_drawn, png, svg};
#[cfg(feature = "drawing")]
pub use html::html;
pub use html::{Fragment, Fragments, fragments, html_with_stills, table_html, words};
