//! The image that would be flashed, in QEMU, driven over its link. `cargo xtask test` builds the image and runs these;
//! by hand: `ROTORLEAD_IMAGE=... cargo test -p host-tests --test emulator -- --ignored`.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command as Process, Stdio};
use std::time::{Duration, Instant};

use host_tests::{TABLE_1, multisine};
use rotorlead::channel::{Channel, Input};
use rotorlead::controller::{channels, coefficients};
use rotorlead::link::{
    ChannelState, Clock, FRAME_BYTES, INJECT_SAMPLES, INJECT_WINDOW, Info, InjectRequest, Message, Receiver, Refusal,
    Request, ResetReason, Series, Source, Tagged, encode,
};
use rotorlead::settings::{Origin, Settings, Validated};
use rotorlead::throttle::Command;

/// Longest wait for one answer. The emulator shares its machine with other tests.
const PATIENCE: Duration = Duration::from_secs(30);

/// A running emulator with the image in it, and the host's end of its link.
struct Controller {
    qemu: Child,
    link: TcpStream,
    receiver: Receiver<Message>,
    tag: u8,
}

impl Controller {
    fn boot() -> Self {
        let image = std::env::var_os("ROTORLEAD_IMAGE").expect("ROTORLEAD_IMAGE names the image; see cargo xtask test");
        // QEMU connects to the test, so that there is no port to guess.
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let qemu = Process::new("qemu-system-arm")
            .args(["-M", "olimex-stm32-h405", "-nographic", "-monitor", "none", "-icount", "shift=0"])
            .args(["-serial", "null", "-serial", "null", "-serial", &format!("tcp:127.0.0.1:{port}")])
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .expect("QEMU runs; cargo xtask setup installs it");
        let (link, _) = listener.accept().unwrap();
        link.set_nodelay(true).unwrap();
        let mut controller = Self { qemu, link, receiver: Receiver::new(), tag: 0 };
        controller.wait_for_start();
        controller
    }

    /// What arrives before the UART is switched on is lost, so the first question is repeated until it is answered.
    fn wait_for_start(&mut self) {
        let start = Instant::now();
        self.link.set_read_timeout(Some(Duration::from_millis(500))).unwrap();
        let mut byte = [0];
        let mut asked = Instant::now();
        let mut last = self.send(&Request::Info);
        loop {
            assert!(start.elapsed() < PATIENCE, "the controller does not start");
            let read = self.link.read(&mut byte).is_ok_and(|length| length == 1);
            // The answer to the last question, so that no other one is still to come.
            if read && self.receiver.push(byte[0]).is_some_and(|answer| answer.tag == last) {
                break;
            }
            if asked.elapsed() > Duration::from_secs(2) {
                asked = Instant::now();
                last = self.send(&Request::Info);
            }
        }
        self.link.set_read_timeout(Some(PATIENCE)).unwrap();
    }

    fn send(&mut self, request: &Request) -> u8 {
        self.tag = self.tag.wrapping_add(1);
        let mut frame = [0; FRAME_BYTES];
        let length = encode(self.tag, request, &mut frame).unwrap();
        self.link.write_all(&frame[..length]).unwrap();
        self.tag
    }

    fn receive(&mut self) -> Tagged<Message> {
        let start = Instant::now();
        let mut byte = [0];
        loop {
            self.link.read_exact(&mut byte).expect("the controller answers");
            if let Some(message) = self.receiver.push(byte[0]) {
                return message;
            }
            assert!(start.elapsed() < PATIENCE, "only garbage from the controller");
        }
    }

    fn ask(&mut self, request: &Request) -> Message {
        let tag = self.send(request);
        let answer = self.receive();
        assert_eq!(answer.tag, tag);
        answer.message
    }

    fn info(&mut self) -> Info {
        match self.ask(&Request::Info) {
            Message::Info(info) => info,
            other => panic!("{other:?}"),
        }
    }

    /// What the commands come to, on the controller.
    fn inject(&mut self, first: u32, commands: &[Command]) -> Vec<i32> {
        let mut outputs = Vec::with_capacity(commands.len());
        let mut blocks = commands.chunks(INJECT_SAMPLES);
        let mut next = first;
        let mut under_way = 0;
        while outputs.len() < commands.len() {
            while under_way < INJECT_WINDOW
                && let Some(block) = blocks.next()
            {
                let bits: Vec<i32> = block.iter().map(|command| command.to_bits()).collect();
                let samples = Series::try_from(&bits[..]).unwrap();
                self.send(&Request::Inject(InjectRequest { motor: 0, first: next, samples }));
                next += bits.len() as u32;
                under_way += 1;
            }
            match self.receive().message {
                Message::Injected(injected) => {
                    assert_eq!(injected.first as usize, first as usize + outputs.len());
                    outputs.extend_from_slice(injected.outputs.as_slice());
                    under_way -= 1;
                }
                other => panic!("{other:?}"),
            }
        }
        outputs
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// The host library's channel of motor 0 with these settings.
fn reference(settings: &Validated) -> Channel {
    let [mut channel, ..] = channels(settings, coefficients(settings).unwrap()).unwrap();
    channel.set_enabled(true);
    channel
}

fn run(channel: &mut Channel, commands: &[Command]) -> Vec<i32> {
    commands.iter().map(|command| channel.tick(Input::Command(*command)).to_bits()).collect()
}

fn set_mode(controller: &mut Controller) {
    let mode = Request::SetMode { motor: 0, source: Source::Inject, compensate: true };
    assert_eq!(controller.ask(&mode), Message::Done);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_image_boots_on_the_clock_that_runs_and_answers() {
    let mut controller = Controller::boot();
    let info = controller.info();
    // The emulator has neither crystal nor PLL.
    assert_eq!((info.clock, info.core_hz), (Clock::Internal, 16_000_000));
    assert_eq!(info.settings, Origin::DefaultsBad, "the emulator's empty flash reads as zeros");
    assert_eq!(info.motors, [ChannelState::NoSignal; 4]);
    assert_ne!(info.reset, ResetReason::Panic);
    assert_eq!(controller.ask(&Request::GetSettings), Message::Settings(Settings::default()));
    let later = controller.info();
    assert!(later.ticks > info.ticks, "the control task does not run");
    match controller.ask(&Request::Faults) {
        Message::Faults(faults) => assert_eq!(faults.missed_deadlines, 0),
        other => panic!("{other:?}"),
    }
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn injected_commands_come_out_as_on_the_host_bit_for_bit() {
    let mut controller = Controller::boot();
    let settings = Validated::default();
    let stop = [Command::ZERO; 10];
    for (u_nom, ..) in TABLE_1 {
        set_mode(&mut controller);
        let mut channel = reference(&settings);
        // Two periods of the paper's multisine at 5 kHz, then its square wave: over 20 s.
        let period = multisine(u_nom, 0.05, 5000.0);
        let square = (0..5000).map(|n| if n / 1000 % 2 == 0 { u_nom + 0.05 } else { u_nom - 0.05 });
        let commands: Vec<Command> = stop
            .iter()
            .copied()
            .chain(period.iter().chain(&period).copied().chain(square).map(Command::saturating_from_f64))
            .collect();
        assert!(commands.len() > 20 * 5000);
        let start = Instant::now();
        let outputs = controller.inject(0, &commands);
        eprintln!("{u_nom}: {:.0} samples a second", commands.len() as f64 / start.elapsed().as_secs_f64());
        let expected = run(&mut channel, &commands);
        let differs = outputs.iter().zip(&expected).position(|(controller, host)| controller != host);
        assert_eq!(differs, None, "first difference at u_nom = {u_nom}");
        assert_eq!(outputs.len(), expected.len());
    }
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_controller_designs_the_same_filter_as_the_host() {
    let mut controller = Controller::boot();
    for (omega_z_rad_s, omega_f_rad_s, damping, loop_rate_hz) in
        [(14.1275, 94.2, 0.7, 5000), (12.0, 60.0, 0.6, 4000), (9.123, 31.7, 1.1, 1000), (45.0, 250.0, 0.9, 10_000)]
    {
        let mut settings = Settings { loop_rate_hz, ..Settings::default() };
        settings.lead.omega_z_rad_s = omega_z_rad_s;
        settings.lead.omega_f_rad_s = omega_f_rad_s;
        settings.lead.damping = damping;
        let taken = controller.ask(&Request::SetSettings(settings.clone()));
        let settings = settings.validate().unwrap();
        assert_eq!(taken, Message::SettingsTaken(settings.warnings()), "{settings:?}");
        set_mode(&mut controller);
        // A step excites every coefficient; 27 bits of it must come out the same for 1500 ticks.
        let commands: Vec<Command> = (0..1500)
            .map(|n| Command::saturating_from_f64([0.0, 0.4, 0.45][usize::from(n > 3) + usize::from(n > 200)]))
            .collect();
        assert_eq!(controller.inject(0, &commands), run(&mut reference(&settings), &commands), "{settings:?}");
        // Back at rest, so that the next settings are taken.
        let total = commands.len() as u32;
        controller.inject(total, &[Command::ZERO]);
    }
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn garbage_is_counted_and_changes_nothing() {
    let mut controller = Controller::boot();
    let before = controller.ask(&Request::GetSettings);
    let mut noise = 0x2545_F491_4F6C_DD1D_u64;
    for _ in 0..20 {
        let garbage: Vec<u8> = (0..100)
            .map(|_| {
                noise ^= noise << 13;
                noise ^= noise >> 7;
                noise ^= noise << 17;
                noise as u8
            })
            .collect();
        controller.link.write_all(&garbage).unwrap();
    }
    // The zero in front of the next frame ends whatever the garbage began.
    assert_eq!(controller.ask(&Request::GetSettings), before);
    match controller.ask(&Request::Faults) {
        Message::Faults(faults) => assert!(faults.link.total() > 0, "{faults:?}"),
        other => panic!("{other:?}"),
    }
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_host_that_vanishes_during_an_injection_loses_the_motor() {
    let mut controller = Controller::boot();
    set_mode(&mut controller);
    let commands: Vec<Command> =
        (0..300).map(|n| Command::saturating_from_f64(if n < 10 { 0.0 } else { 0.5 })).collect();
    assert_eq!(controller.info().motors[0], ChannelState::Injected);
    assert_eq!(controller.inject(0, &commands).last(), Some(&(1 << 28)));
    let saved = controller.ask(&Request::SaveSettings);
    assert_eq!(saved, Message::Refused(Refusal::NotDisarmed { motor: 0 }));
    let start = Instant::now();
    while controller.info().motors[0] != ChannelState::Lost {
        assert!(start.elapsed() < PATIENCE, "{:?}", controller.info());
        std::thread::sleep(Duration::from_millis(20));
    }
    let samples = Series::try_from(&[0][..]).unwrap();
    let late = controller.ask(&Request::Inject(InjectRequest { motor: 0, first: 300, samples }));
    assert_eq!(late, Message::Refused(Refusal::NotInjecting));
}
