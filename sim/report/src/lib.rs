//! Answers drawn: a figure as SVG and PNG, and a report as one HTML file that needs no network.

mod figure;
mod html;
mod markup;

pub use figure::{FigureError, is_drawn, png, svg};
pub use html::html;
