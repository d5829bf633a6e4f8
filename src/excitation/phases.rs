//! placeholder until the optimizer has run
use super::Lines;
const PHASES: [u32; 150] = [0; 150];
/// x
pub const ODD_LINES_30_HZ: Lines<'static> = match Lines::odd(10, &PHASES, 14.0) {
    Ok(lines) => lines,
    Err(_) => panic!("x"),
};
/// x
pub const ODD_LINES_45_HZ: Lines<'static> = ODD_LINES_30_HZ;
