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
fn every_channel_gets_its_width_as_far_as_it_fits() {
    let mut channels = [Mock::default(); 4];
    put_out(&mut channels, [1000, 0, 65_535, 65_536 + 7]);
    assert_eq!(channels.map(|channel| channel.duty), [Some(1000), Some(0), Some(65_535), Some(65_535)]);
}
