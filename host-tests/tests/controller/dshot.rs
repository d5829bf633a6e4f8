//! DShot frames beside those of an independent encoder.

use dshot_frame::{BidirectionalFrame, NormalFrame};
use rotorlead::dshot::{Checksum, Content, Frame, Value};

#[test]
fn frames_are_those_of_an_independent_encoder() {
    for speed in 0..2000_u16 {
        for reports in [false, true] {
            let value = Value::new(speed + 48).unwrap();
            assert!(matches!(value.content(), Content::Throttle(_)));
            let normal = NormalFrame::new(speed, reports).unwrap();
            assert_eq!(Frame::new(value, reports, Checksum::Normal).to_bits(), normal.inner());
            let inverted = BidirectionalFrame::new(speed, reports).unwrap();
            let frame = Frame::new(value, reports, Checksum::Inverted);
            assert_eq!(frame.to_bits(), inverted.inner());
            assert_eq!((frame.value().get() - 48, frame.reports()), (inverted.speed(), inverted.telemetry_enabled()));
        }
    }
}
