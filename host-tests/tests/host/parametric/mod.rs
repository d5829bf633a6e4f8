//! What the parametric fits claim of themselves, decided by repeats, and the stand that is identified with them.

mod blows;
mod coverage;
mod impact;
mod motor_on_stand;
mod records;
mod stand;
mod synthesis;
mod tally;
