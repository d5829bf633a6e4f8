//! A flight as Betaflight logs it: frames that stand alone, of a loop of 4 kHz.

use crate::flight::{Flight, LOOP_RATE_HZ};
use crate::telemetry::POLE_PAIRS;

/// Bytes of the flight's blackbox (`.bbl`).
#[must_use]
pub fn log(flight: &Flight) -> Vec<u8> {
    let of_motors = |name: &str| (0..4).map(|motor| format!("{name}[{motor}]")).collect::<Vec<_>>().join(",");
    let names =
        format!("loopIteration,time,vbatLatest,{},{},{}", of_motors("motor"), of_motors("eRPM"), of_motors("setpoint"));
    // Of the numbers without a sign, and of the setpoints.
    let codes = |unsigned: &str, signed: &str| [[unsigned; 11].join(","), [signed; 4].join(",")].join(",");
    let (zeros, signs, encodings) = (codes("0", "0"), codes("0", "1"), codes("1", "0"));
    let mut log = format!(
        "H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\nH I interval:1\nH P interval:1\n\
         H Field I name:{names}\nH Field I signed:{signs}\nH Field I predictor:{zeros}\nH Field I encoding:{encodings}\n\
         H Field P predictor:{zeros}\nH Field P encoding:{encodings}\n\
         H Firmware revision:Betaflight 2025.12.0 (79065c96b) STM32F7X2\nH features:0\nH motor_pwm_protocol:6\n\
         H motor_poles:{}\nH looptime:{}\nH pid_process_denom:2\n",
        2.0 * POLE_PAIRS,
        0.5e6 / LOOP_RATE_HZ
    )
    .into_bytes();
    let volts = flight.voltage_v.as_deref();
    for (row, time_s) in flight.time_s.iter().enumerate() {
        log.push(b'I');
        let volts = volts.map_or(0.0, |volts| 100.0 * volts[row]);
        let commands = flight.commands.iter().map(|commands| 48.0 + 1999.0 * commands[row]);
        let speeds = flight.rpm.iter().map(|rpm| rpm[row] * POLE_PAIRS / 100.0);
        let numbers = [row as f64, 1e6 + 1e6 * time_s, volts].into_iter().chain(commands).chain(speeds);
        numbers.for_each(|number| unsigned(&mut log, number.round() as u32));
        let rates = flight.rates.iter().map(|rates| rates[row].to_degrees());
        rates.chain([1000.0 * flight.throttle[row]]).for_each(|number| signed(&mut log, number.round() as i32));
    }
    log.extend(b"E\xffEnd of log\0");
    log
}

/// Seven bits a byte, the lowest first; the eighth says that more follow.
fn unsigned(log: &mut Vec<u8>, mut value: u32) {
    while value > 0x7f {
        log.push(value as u8 | 0x80);
        value >>= 7;
    }
    log.push(value as u8);
}

/// The sign in the lowest bit.
fn signed(log: &mut Vec<u8>, value: i32) {
    unsigned(log, (value << 1 ^ value >> 31).cast_unsigned());
}
