//! Pulse widths to the channels of any timer that [`embedded_hal`] knows.

use embedded_hal::pwm::SetDutyCycle;

/// Sets the width of the next pulse, in ticks of the channel's timer.
///
/// A width that the channel's 16 bits cannot hold is cut to what they hold, and one of 2^31 or more, which no protocol has, is
/// no pulse; that a pulse and a gap fit its frame is for the caller to see to, once for all settings. There is nobody to tell
/// of a failure here, and the next control tick tries again.
#[inline(always)]
pub fn put_out(channel: &mut impl SetDutyCycle, width: u32) {
    // With a sign this is one instruction (USAT), and four without.
    let duty = width.cast_signed().clamp(0, i32::from(u16::MAX)) as u16;
    let _ = channel.set_duty_cycle(duty);
}
