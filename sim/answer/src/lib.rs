//! An answer for people as data: tables, figures and the report that holds them, and their form in text and in CSV. It knows
//! nothing of what is shown, and nothing of how a page or a picture is made.

mod answer;
pub mod escape;
mod figure;
mod report;
mod table;
pub mod words;

pub use answer::{Answer, Text};
pub use figure::{Axis, Color, Figure, FigureKind, HeatCell, HeatMap, Mark, Panel, Scale, SecondaryAxis, Series};
pub use report::{Fact, Report, Section, Tone, Verdict};
pub use table::{Audience, Cell, CellValue, Column, ColumnSpec, Table, Unit, build_table, with_std};
