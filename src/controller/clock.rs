//! What runs the controller, and what may be believed of it.

use crate::link::{Clock, CrystalCheck};

/// The clocks as they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockReport {
    /// What the core runs on.
    pub source: Clock,
    /// Clock of the core, hertz.
    pub core_hz: u32,
    /// Clock of the timers that capture and put out pulses, hertz.
    pub timer_hz: u32,
    /// Whether `timer_hz` is what the registers promise. If not, it was measured against the core clock.
    pub timer_as_promised: bool,
    /// What the crystal was measured to be.
    pub crystal: CrystalCheck,
}

impl ClockReport {
    /// Whether these clocks tell a disarmed pulse from an armed one. Without the crystal a stop pulse of 1000 µs may read
    /// as 1080 µs. Nobody may arm by that.
    #[must_use]
    // A function of its own, asked once per start and settings: an emulator without a crystal answers in its place.
    #[inline(never)]
    pub const fn tells_pulses_apart(&self) -> bool {
        matches!(self.source, Clock::Crystal)
            && self.timer_as_promised
            && !matches!(self.crystal, CrystalCheck::Wrong { .. })
    }
}

/// The internal oscillator against which a crystal is measured, as a part of its nominal frequency: DS8626, "HSI
/// oscillator characteristics", gives -8 to +4.5 % from -40 to 105 °C.
const OSCILLATOR_PARTS_PER_THOUSAND: (u64, u64) = (920, 1045);

/// Judges a crystal by how many of its periods passed in so many of an internal oscillator that should run at
/// `oscillator_hz`. It is right where the oscillator's tolerance explains the difference; another crystal within that is
/// not noticed. Without a count there is nothing to be said.
#[must_use]
pub fn check_crystal(
    expected_hz: u32,
    oscillator_hz: u32,
    crystal_periods: u32,
    oscillator_periods: u32,
) -> CrystalCheck {
    let (periods, counts) = (u64::from(crystal_periods), u64::from(oscillator_periods));
    if periods == 0 || counts == 0 {
        return CrystalCheck::NotChecked;
    }
    let measured_hz = u64::from(oscillator_hz) * periods / counts;
    // measured = true * nominal / actual oscillator: a fast oscillator makes the crystal look slow.
    let (slowest, fastest) = OSCILLATOR_PARTS_PER_THOUSAND;
    let expected = 1000 * u64::from(expected_hz);
    let is_right = measured_hz * fastest >= expected && measured_hz * slowest <= expected;
    let measured_hz = u32::try_from(measured_hz).unwrap_or(u32::MAX);
    if is_right { CrystalCheck::Right { measured_hz } } else { CrystalCheck::Wrong { measured_hz } }
}

/// A timer clock slower than this is no measurement: it stands still.
const SLOWEST_TIMER_HZ: u64 = crate::settings::SLOWEST_TIMER_HZ as u64;
/// A deviation below one part in this many is the comparison's own: at most 20 cycles of bus traffic in 10 000.
const TOLERANCE: u64 = 100;

/// The timer clock to be used, and whether it is the promised one, by how far a timer and the core's counter went side by
/// side.
///
/// The factor between the two depends on three dividers and a rule about doubling. Everything that is a pulse or a
/// sampling rate rests on it; an emulator whose timers have a clock of their own is found out, too. A timer that stands
/// still or cannot be counted leaves the promise, since there is nothing better.
#[must_use]
pub fn check_timer(core_hz: u32, promised_hz: u32, core_ticks: u32, timer_ticks: u32) -> (u32, bool) {
    let measured_hz = (u64::from(timer_ticks) * u64::from(core_hz)).checked_div(u64::from(core_ticks)).unwrap_or(0);
    let promised = u64::from(promised_hz);
    let as_promised = measured_hz.abs_diff(promised) <= promised / TOLERANCE;
    let hz = match u32::try_from(measured_hz) {
        Ok(hz) if !as_promised && measured_hz >= SLOWEST_TIMER_HZ => hz,
        _ => promised_hz,
    };
    (hz, as_promised)
}
