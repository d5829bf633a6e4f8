//! Pulse widths to the channels of any timer that [`embedded_hal`] knows.

use embedded_hal::pwm::SetDutyCycle;

/// Sets the widths of the next pulses, in ticks of the channels' timer.
///
/// A width that the channel's 16 bits cannot hold is cut to what they hold; that a pulse and a gap fit its frame is for the
/// caller to see to, once for all settings. There is nobody to tell of a failure here, and the next control tick tries again.
#[inline(always)]
pub fn put_out<P: SetDutyCycle, const N: usize>(channels: &mut [P; N], widths: [u32; N]) {
    for (channel, width) in channels.iter_mut().zip(widths) {
        let _ = channel.set_duty_cycle(u16::try_from(width).unwrap_or(u16::MAX));
    }
}
