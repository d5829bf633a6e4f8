//! The host's end of the link, against a controller made of the library's parts, over TCP.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use clap::Parser as _;
use host_tests::flash::Flash;
use host_tests::fuzz::frame;
use rotorlead::compensator::Compensator;
use rotorlead::design::LeadDesign;
use rotorlead::excitation::{Activity, Multisine};
use rotorlead::link::{
    ChannelState, Clock, FRAME_BYTES, Faults, INJECT_SAMPLES, Info, Injector, Message, NO_INPUT, Receiver, RecordClock,
    Recorder, Refusal, Request, ResetReason, Sample, Source, VERSION, encode,
};
use rotorlead::settings::{Store, Validated};
use rotorlead::throttle::Command;
use rotorlead_sim::command::Arguments;
use rotorlead_sim::plant::{Actuator, EscTiming, Law, Model};
use rotorlead_sim::record::Experiment;
use serde_json::Value;

const NEWTONS_PER_COUNT: f64 = 2e-4;
const ZERO_COUNT: f64 = 10_000.0;
const SECTOR: usize = 2048;
const NOMINAL: f64 = 0.5;
/// The paper's motor at 0.5.
const GAIN: f64 = 10.1718;
const TIME_CONSTANT_S: f64 = 1.0 / 9.2889;

/// What is wrong with a controller or its line.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Trouble {
    None,
    /// It hears and does not answer.
    Silent,
    /// It speaks another version.
    OtherVersion,
    /// Its tenth record is lost.
    LosesARecord,
    /// Noise in front of every frame.
    Noise,
    /// The outputs of one block are off by a step of 2^-29.
    WrongOutput,
    /// The excitation has one wrong sample.
    WrongExcitation,
}

/// A controller with its motor, as fast as it goes.
struct Controller {
    trouble: Trouble,
    settings: Validated,
    store: Store<Flash<SECTOR>>,
    receiver: Receiver<Request>,
    injector: Option<(Injector, Compensator)>,
    recording: Option<(u8, RecordClock, Recorder)>,
    excitation: Option<(Multisine<'static>, i32)>,
    motor: Actuator,
    level: i32,
    tick: u32,
    records: u32,
    line: Option<TcpStream>,
}

impl Controller {
    fn new(trouble: Trouble) -> Self {
        let timing = EscTiming { frame_hz: Some(400.0), frame_phase: 0.0 };
        let mut motor = Actuator::new(&model(), Law::LinearAround(NOMINAL), timing).unwrap();
        motor.settle(0.0);
        Self {
            trouble,
            settings: Validated::default(),
            store: Store::new(Flash::blank(), Flash::<SECTOR>::SECTORS),
            receiver: Receiver::new(),
            injector: None,
            recording: None,
            excitation: None,
            motor,
            level: -1,
            tick: 0,
            records: 0,
            line: None,
        }
    }

    fn send(&mut self, tag: u8, message: &Message) {
        let mut bytes = match self.trouble {
            Trouble::Silent => return,
            Trouble::OtherVersion => frame(VERSION + 1, tag, &postcard::to_stdvec(message).unwrap()),
            _ => {
                let mut frame = [0; FRAME_BYTES];
                let length = encode(tag, message, &mut frame).unwrap();
                frame[..length].to_vec()
            }
        };
        if self.trouble == Trouble::Noise {
            bytes.splice(0..0, [3, 1, 4, 1, 5, 9, 2, 6].into_iter().chain([0, 7, 7]));
        }
        if matches!(message, Message::Record(_)) {
            self.records += 1;
            if self.trouble == Trouble::LosesARecord && self.records == 10 {
                return;
            }
        }
        // The host may have gone; the loop finds out.
        if let Some(line) = &mut self.line {
            let _ = line.write_all(&bytes);
        }
    }

    fn compensator(&self) -> Compensator {
        let design = LeadDesign::new(self.settings.lead.into(), f64::from(self.settings.loop_rate_hz), None).unwrap();
        let motor = self.settings.motors[0];
        let level = Command::saturating_from_bits;
        Compensator::new(*design.coefficients(), level(motor.idle), level(motor.max))
    }

    fn answer(&mut self, tag: u8, request: Request) {
        let message = match request {
            Request::Info => Message::Info(Info {
                firmware: [0, 1, 0],
                clock: Clock::Internal,
                core_hz: 16_000_000,
                timer_hz: 16_000_000,
                ticks: self.tick,
                reset: ResetReason::PowerOn,
                settings: self.store.load().origin,
                motors: [ChannelState::NoSignal; 4],
            }),
            Request::GetSettings => Message::Settings((*self.settings).clone()),
            Request::SetSettings(settings) => match settings.validate() {
                Ok(settings) => {
                    self.settings = settings;
                    Message::SettingsTaken(self.settings.warnings())
                }
                Err(error) => Message::Refused(Refusal::Settings(error)),
            },
            Request::SaveSettings => match self.store.save(&self.settings) {
                Ok(()) => Message::Done,
                Err(_) => Message::Refused(Refusal::SaveFailed),
            },
            Request::SetMode { source, compensate, .. } => {
                let mut compensator = self.compensator();
                compensator.set_enabled(compensate);
                self.injector = (source == Source::Inject).then(|| (Injector::new(), compensator));
                self.level = -1;
                Message::Done
            }
            Request::Inject(request) => return self.inject(tag, &request),
            Request::Excite(excite) => {
                let number = |bits| Command::saturating_from_bits(bits).to_f64();
                let (nominal, amplitude) = (number(excite.nominal), number(excite.amplitude));
                let mut multisine = Multisine::new(excite.lines.lines(), nominal, amplitude, 5000.0).unwrap();
                multisine.start(NonZeroU32::new(u32::from(excite.periods)));
                self.excitation = Some((multisine, 0));
                Message::Done
            }
            Request::Record(Some(request)) => {
                let divisor = if request.divisor == 0 { self.settings.recorder_divisor } else { request.divisor };
                self.recording = Some((tag, RecordClock::new(divisor), Recorder::new(request.motor, divisor)));
                Message::Done
            }
            Request::Record(None) => {
                if let Some((tag, _, mut recorder)) = self.recording.take()
                    && let Some(record) = recorder.finish()
                {
                    self.send(tag, &Message::Record(record));
                }
                Message::Done
            }
            Request::Faults => Message::Faults(Faults { link: *self.receiver.faults(), ..Faults::default() }),
            Request::KeepAlive | Request::StopExcitation => Message::Done,
        };
        self.send(tag, &message);
    }

    fn inject(&mut self, tag: u8, request: &rotorlead::link::InjectRequest) {
        let Some((injector, compensator)) = &mut self.injector else {
            return self.send(tag, &Message::Refused(Refusal::NotInjecting));
        };
        if let Err(refusal) = injector.accept(tag, request) {
            return self.send(tag, &Message::Refused(refusal));
        }
        let mut replies = Vec::new();
        for &bits in request.samples.as_slice() {
            let command = Command::saturating_from_bits(bits);
            if self.level < 0 {
                compensator.reset(command);
            }
            self.level = bits;
            let mut output = compensator.update(command);
            if self.trouble == Trouble::WrongOutput && request.first == 12_800 {
                output = Command::saturating_from_bits(output.to_bits() ^ 1);
            }
            replies.extend(injector.output(output));
        }
        for reply in replies {
            self.send(reply.tag, &Message::Injected(reply.message));
        }
    }

    /// One control tick: the excitation, with a ramp before it, into the motor.
    fn tick(&mut self) {
        // The ramp: 0.5 a second.
        const RAMP: i32 = Command::ONE.to_bits() / 10_000;
        let command = match &mut self.excitation {
            Some((multisine, level)) if *level < multisine.nominal().to_bits() => {
                *level = (*level + RAMP).min(multisine.nominal().to_bits());
                *level
            }
            Some((multisine, _)) if multisine.activity() != Activity::Idle => {
                let wrong = self.trouble == Trouble::WrongExcitation && (33_335..33_340).contains(&multisine.tick());
                multisine.update().to_bits() + i32::from(wrong)
            }
            _ => 0,
        };
        let adc = (self.motor.response() / NEWTONS_PER_COUNT + ZERO_COUNT).round() as u16;
        self.tick = self.tick.wrapping_add(1);
        self.motor.advance(Command::saturating_from_bits(command).to_f64(), f64::from(self.tick) / 5000.0);
        let Some((tag, clock, recorder)) = &mut self.recording else { return };
        let tag = *tag;
        if let Some(tick) = clock.tick()
            && let Some(record) = recorder.push(Sample { tick, input: NO_INPUT, before: command, after: command, adc })
        {
            self.send(tag, &Message::Record(record));
        }
    }

    /// Answers on `line` until it is closed.
    fn serve(&mut self, line: TcpStream, stop: &AtomicBool) {
        line.set_nonblocking(false).unwrap();
        line.set_nodelay(true).unwrap();
        line.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        self.line = Some(line.try_clone().unwrap());
        let mut line = line;
        let mut bytes = [0; 2048];
        while !stop.load(Ordering::Relaxed) {
            match line.read(&mut bytes) {
                Ok(0) => return,
                Ok(length) => {
                    for &byte in &bytes[..length] {
                        if let Some(request) = self.receiver.push(byte) {
                            self.answer(request.tag, request.message);
                        }
                    }
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => return,
            }
            // In time while it waits, fast while it plays.
            for _ in 0..if self.excitation.is_some() { 2000 } else { 5 } {
                self.tick();
            }
        }
    }
}

/// A controller behind a TCP port that takes one connection after the other, and a folder for what comes of it.
struct Bench {
    address: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    folder: tempfile::TempDir,
}

impl Bench {
    fn new(trouble: Trouble) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = format!("tcp:{}", listener.local_addr().unwrap());
        let folder = tempfile::tempdir().unwrap();
        model().write(&folder.path().join("model.toml")).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut controller = Controller::new(trouble);
            while !seen.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((line, _)) => controller.serve(line, &seen),
                    Err(_) => std::thread::sleep(Duration::from_millis(2)),
                }
            }
        });
        Self { address, stop, thread: Some(thread), folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs `rotorlead device` with these arguments; `@NAME` is a path in the folder. Gives its JSON, or its error.
    fn device(&self, arguments: &str) -> Result<Value, String> {
        self.rotorlead(&format!("device --port {} --timeout 0.3 {arguments}", self.address))
    }

    fn rotorlead(&self, arguments: &str) -> Result<Value, String> {
        let json = self.path("out.json");
        let words = arguments.split(' ').map(|word| match word.strip_prefix('@') {
            Some(name) => self.path(name).display().to_string(),
            None => word.to_owned(),
        });
        let (command, rest): (Vec<_>, Vec<_>) = words.enumerate().partition(|(index, _)| *index == 0);
        let words = |words: Vec<(usize, String)>| words.into_iter().map(|(_, word)| word);
        let json_option = ["--json".to_owned(), json.display().to_string()];
        let all = ["rotorlead".to_owned()].into_iter().chain(words(command)).chain(json_option).chain(words(rest));
        Arguments::parse_from(all).run().map_err(|report| format!("{report:?}"))?;
        Ok(serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap())
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let joined = self.thread.take().map(JoinHandle::join);
        if !std::thread::panicking() {
            joined.unwrap().unwrap();
        }
    }
}

fn model() -> Model {
    let text =
        format!("format = 1\n[[point]]\nnominal = {NOMINAL}\ngain = {GAIN}\ntime_constant_s = {TIME_CONSTANT_S}\n");
    toml::from_str(&text).unwrap()
}

const SENSOR: &str = "--newtons-per-count 2e-4 --zero-count 10000";

#[test]
fn what_is_set_is_used_stored_and_shown() {
    let bench = Bench::new(Trouble::None);
    assert_eq!(bench.device("info").unwrap()["settings"], "DefaultsBlank");
    bench.device("set motor.*.compensate true").unwrap();
    let set = bench.device("set output.frame_hz 150").unwrap();
    assert!(set["warnings"][0].as_str().unwrap().contains("output.frame_hz"), "{set}");
    let all = bench.device("get").unwrap();
    assert_eq!((&all["motor.3.compensate"], &all["output.frame_hz"]), (&"true".into(), &"150".into()));
    bench.device("save").unwrap();
    assert_eq!(bench.device("info").unwrap()["settings"], "Stored");
}

#[test]
fn every_setting_that_is_shown_can_be_set_to_what_is_shown() {
    let bench = Bench::new(Trouble::None);
    let before = bench.device("get").unwrap();
    for (key, value) in before.as_object().unwrap() {
        bench.device(&format!("set {key} {}", value.as_str().unwrap())).unwrap();
    }
    assert_eq!(bench.device("get").unwrap(), before);
}

#[test]
fn wrong_settings_are_refused_with_the_remedy() {
    let bench = Bench::new(Trouble::None);
    let before = bench.device("get").unwrap();
    for (arguments, said) in [
        ("set output.frame_hz 600", "use 495 Hz or less"),
        ("set motor.1.idle 0.01", "motor.1.idle is 0.00999"),
        ("set motor.1.idle 1.5", "give a command from 0 to 1"),
        ("set motor.4.idle 0.1", "there is no setting"),
        ("set dampin 0.7", "perhaps damping"),
        ("set damping much", "give a number"),
        ("set output.protocol dshot", "give raw_duty, standard_pwm, oneshot125"),
        ("set omega_f_rad_s 1900", "coefficient g0"),
        ("get idle", "motor.*.KEY"),
    ] {
        let error = bench.device(arguments).unwrap_err();
        let flat: String = error
            .split(|c: char| c.is_whitespace() || c == '│')
            .filter(|w| !w.is_empty())
            .collect::<Vec<_>>()
            .join(" ");
        assert!(flat.contains(said), "{arguments}: {flat}");
    }
    assert_eq!(bench.device("get").unwrap(), before);
}

#[test]
fn a_recorded_excitation_is_identified_as_it_is() {
    for trouble in [Trouble::None, Trouble::Noise] {
        let bench = Bench::new(trouble);
        bench.device(&format!("excite --nominal 0.5 --periods 2 --out @stand {SENSOR}")).unwrap();
        let experiment = Experiment::read(&bench.path("stand")).unwrap();
        assert_eq!(experiment.records[0].time_s.len(), 20_000);
        let identified = bench.rotorlead("identify @stand --out @found.toml").unwrap();
        let point = &identified["points"][0];
        let off = |key: &str, truth: f64| (point[key].as_f64().unwrap() / truth - 1.0).abs();
        println!("{point}");
        assert!(off("gain", GAIN) < 2e-3, "{point}");
        assert!(off("time_constant_s", TIME_CONSTANT_S) < 2e-3, "{point}");
    }
}

#[test]
fn an_excitation_with_one_wrong_sample_is_no_record() {
    let bench = Bench::new(Trouble::WrongExcitation);
    let error = bench.device(&format!("excite --nominal 0.5 --periods 1 --out @stand {SENSOR}")).unwrap_err();
    assert!(error.contains("bit for bit"), "{error}");
    assert!(!bench.path("stand").exists());
}

#[test]
fn a_recording_has_a_row_for_every_tick() {
    let bench = Bench::new(Trouble::None);
    bench.device(&format!("record --seconds 0.5 --out @free {SENSOR}")).unwrap();
    let experiment = Experiment::read(&bench.path("free")).unwrap();
    assert_eq!(experiment.sample_rate_hz, Some(5000.0));
    assert_eq!(experiment.records[0].time_s.len(), 2500);
}

#[test]
fn a_recording_with_a_gap_is_refused_and_nothing_is_written() {
    let bench = Bench::new(Trouble::LosesARecord);
    let error = bench.device(&format!("record --seconds 0.5 --out @free {SENSOR}")).unwrap_err();
    assert!(error.contains("32 samples are missing at tick 288"), "{error}");
    assert!(!bench.path("free").exists());
}

#[test]
fn injected_commands_come_back_as_the_hosts_filter_has_them() {
    for (trouble, different) in [(Trouble::None, 0), (Trouble::Noise, 0), (Trouble::WrongOutput, INJECT_SAMPLES)] {
        let bench = Bench::new(trouble);
        bench.device("set motor.*.compensate true").unwrap();
        let plan = "format = 1\nname = \"short\"\nseed = 1\n[[record]]\nnominal = 0.5\nexcitation = \"square\"\n\
                    amplitude = 0.05\nhalf_period_s = 0.5\nperiods = 2\n";
        std::fs::write(bench.path("plan.toml"), plan).unwrap();
        let outcome = bench.device("inject --model @model.toml --plan @plan.toml --out @pil").unwrap();
        assert_eq!(outcome["samples"], 15_000);
        assert_eq!(outcome["different"], different, "{trouble:?}");
        // And the experiment is the one that is simulated without a controller.
        if different == 0 {
            let command =
                "simulate --model @model.toml --plan @plan.toml --compensator @pil/compensator.toml --out @host";
            bench.rotorlead(command).unwrap();
            let [pil, host] = ["pil", "host"].map(|name| Experiment::read(&bench.path(name)).unwrap());
            let (pil, host) = (&pil.records[0], &host.records[0]);
            assert!(pil.command == host.command);
            // Settled for a second rather than set to rest: the bits below the last one may differ.
            let outputs = pil.esc_command.iter().flatten().zip(host.esc_command.iter().flatten());
            let worst = outputs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst <= 4.0 / f64::from(1 << 29), "{worst:e}");
        }
    }
}

#[test]
fn a_controller_that_is_not_there_is_named() {
    let bench = Bench::new(Trouble::Silent);
    let error = bench.device("info").unwrap_err();
    assert!(error.contains("no answer to info within 0.3 s"), "{error}");
    let error = Bench::new(Trouble::OtherVersion).device("info").unwrap_err();
    assert!(error.contains("does not speak version 1"), "{error}");
    for address in ["tcp:127.0.0.1:1", "/dev/no-such-port"] {
        let error = bench.rotorlead(&format!("device --port {address} info")).unwrap_err();
        assert!(error.contains("cannot be opened"), "{error}");
    }
}
