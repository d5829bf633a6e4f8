//! Pulse widths to the channels of any timer that [`embedded_hal`] knows.

use embedded_hal::pwm::SetDutyCycle;

/// Sets the widths of the next pulses, in ticks of the channels' timer.
///
/// A width that the channel cannot hold is none at all: without pulses an ESC stops its motor. There is nobody to tell of
/// a failure here, and the next control tick tries again.
#[inline]
pub fn put_out<P: SetDutyCycle, const N: usize>(channels: &mut [P; N], widths: [u32; N]) {
    for (channel, width) in channels.iter_mut().zip(widths) {
        let _ = channel.set_duty_cycle(u16::try_from(width).unwrap_or(0));
    }
}
