//! Pulse widths on a timer that is no hardware.

use std::convert::Infallible;

use embedded_hal::pwm::{ErrorType, SetDutyCycle};
use rotorlead::esc_output::put_out;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mock {
    duty: Option<u16>,
}

impl ErrorType for Mock {
    type Error = Infallible;
}

impl SetDutyCycle for Mock {
    fn max_duty_cycle(&self) -> u16 {
        u16::MAX
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.duty = Some(duty);
        Ok(())
    }
}

#[test]
fn a_channel_gets_its_width_as_far_as_it_fits() {
    let mut channel = Mock::default();
    for (width, duty) in [(1000, 1000), (0, 0), (65_535, 65_535), (65_536 + 7, 65_535), (1 << 31, 0), (u32::MAX, 0)] {
        put_out(&mut channel, width);
        assert_eq!(channel.duty, Some(duty));
    }
}
