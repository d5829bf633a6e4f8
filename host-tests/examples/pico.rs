//! A Pico in rp2040js whose USB plug is a TCP port, with its jumper fitted, an empty flash and four motors whose ESCs answer.
//! `cargo xtask emulate --board rp2040` builds the image and runs this with the port as argument.

use std::time::Duration;

use host_tests::live_pico::LivePico;
use host_tests::rotor::Rotor;

/// Time constants at a command of 0.5, seconds.
const ROTORS_S: [f64; 4] = [0.060, 0.055, 0.050, 0.042];

fn main() {
    let port = std::env::args().nth(1).and_then(|port| port.parse().ok()).expect("the argument is a TCP port");
    let pico = LivePico::start(port, None, &ROTORS_S.map(Rotor::new));
    eprintln!("the Pico is at {}", pico.address());
    while pico.is_running() {
        std::thread::sleep(Duration::from_millis(200));
    }
}
