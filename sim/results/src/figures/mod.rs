//! What is drawn, as data: one file for each kind of figure, from what was identified, designed or diagnosed.

pub mod bode;
pub mod compensation;
pub mod diagnosis;
pub mod etfe;
pub mod excitation;
pub mod stand;
pub mod static_map;
pub mod steps;
pub mod time_response;
pub mod vehicle;
