//! What the parametric fits claim of themselves, decided by repeats, and the stand that is identified with them.

mod coverage;
mod impact;
mod motor_on_stand;
mod stand;
mod synthesis;
