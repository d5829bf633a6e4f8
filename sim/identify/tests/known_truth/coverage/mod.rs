//! What fits claim of themselves, decided by repeats: how often intervals hold the truth, how far estimates spread, and their bias.

mod low_order;
mod records;
pub mod synthesis;
pub mod tally;
