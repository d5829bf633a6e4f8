//! A Pico in rp2040js whose USB plug is a TCP port, with its jumper fitted, an empty flash and four motors whose ESCs answer.
//! `cargo xtask emulate --board rp2040` builds the image and runs this with the port as argument.
//!
//! Lines of its standard input are `restart` (its power goes and comes back), `jumper out`, `jumper in` and `motors`; each is answered by a line
//! of standard output, that of `motors` by the last commands.

use std::sync::Arc;
use std::time::Duration;

use host_tests::live_pico::LivePico;
use host_tests::rotor::Rotor;

/// Time constants at a command of 0.5, seconds.
const ROTORS_S: [f64; 4] = [0.060, 0.055, 0.050, 0.042];

fn main() {
    let port = std::env::args().nth(1).and_then(|port| port.parse().ok()).expect("the argument is a TCP port");
    let pico = Arc::new(LivePico::start(port, None, &ROTORS_S.map(Rotor::new)));
    eprintln!("the Pico is at {}", pico.address());
    let obeyed = Arc::downgrade(&pico);
    std::thread::spawn(move || {
        for line in std::io::stdin().lines().map_while(Result::ok) {
            if let Some(pico) = obeyed.upgrade() {
                obey(&pico, line.trim());
            }
        }
    });
    while pico.is_running() {
        std::thread::sleep(Duration::from_millis(200));
    }
}

fn obey(pico: &LivePico, line: &str) {
    match line {
        "restart" => pico.restart(),
        "jumper out" => pico.fit_jumper(false),
        "jumper in" => pico.fit_jumper(true),
        "motors" => {
            let commands: Vec<String> = pico.commands().iter().map(|command| format!("{command:.3}")).collect();
            return println!("{}", commands.join(" "));
        }
        _ => return println!("no such line: {line}"),
    }
    println!("{line}");
}
