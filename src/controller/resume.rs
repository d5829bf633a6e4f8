//! What is kept over a reset so that a flight goes on: the settings with their filters, and the last command of each motor.
//!
//! It lies in RAM that start-up does not clear, and every bit pattern is one: whatever power or a fault left there is read, and used
//! only where its checksums hold. A record is used once, by the firmware that wrote it (a checksum of the library's sources is part of
//! it), and is cleared when it is read, at every start.
//!
//! | part | written | protected by |
//! |---|---|---|
//! | settings, where they come from, and the filters' coefficients as integers | at the start, and whenever a host sets or saves settings, with every motor at rest | CRC-32 |
//! | flight: for each motor whether its command may be held, the command, for how long; ticks since the start | in 6 to 12 ticks of 5 kHz by the control task, a motor at a time, in one of two copies in turn | a checksum that the CRC of the settings begins |
//! | the resets before | at the start | its complement |
//!
//! A reset in the middle of a round leaves the other copy of the flight, whose commands are up to 5 ms old (25 ms in a loop at 1 kHz). One that old is as good: a
//! flight controller's frames are as far apart, or answer each other within that time.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use super::{Motor, channels};
use crate::biquad;
use crate::channel::Channel;
use crate::checksum::CHECKSUM;
use crate::compensator::{CommandRange, Filter, InverseFilter, LeadFilter};
use crate::inverse::{self, SlewLimit, TABLE_POINTS};
use crate::link::ResetReason;
use crate::settings::{MOTORS, Origin, Settings, Validated};
use crate::throttle::Command;

/// A third reset within so many milliseconds ends with the motors off: what resets the controller does it again.
pub const CRASH_LOOP_MS: u32 = 10_000;

/// A checksum of the library's sources, from its build script.
const SOURCES: u32 = match u32::from_str_radix(env!("ROTORLEAD_SOURCES"), 10) {
    Ok(sources) => sources,
    Err(_) => panic!("the build script gives a number"),
};

/// Longest settings, bytes: with the curves of each motor some 800.
const SETTINGS_BYTES: usize = 1024;
/// An inverse: `A`, `B`, the gains, the slew, and the range. A lead has four words.
const FILTER_WORDS: usize = 2 + TABLE_POINTS + 3;
const LEAD: u32 = 1;
const INVERSE: u32 = 2;

/// Words of the first part: the sources' checksum, the origin, the length of the settings, and the kind of the filters.
const HEADER_WORDS: usize = 4;
const SETTINGS_WORDS: usize = HEADER_WORDS + SETTINGS_BYTES / 4 + MOTORS * FILTER_WORDS;
/// Two of each motor, the ticks, and the checksum.
const FLIGHT_WORDS: usize = 2 * MOTORS + 1 + 1;

/// In a motor's first word, beside the ticks for which its command may be held: it may be, and its filter is in the path.
const IS_HELD: u32 = 1 << 31;
const IS_ENABLED: u32 = 1 << 30;
const TICKS_MASK: u32 = IS_ENABLED - 1;

/// No settings: a CRC of 0 is stored as 1.
const NO_SETTINGS: u32 = 0;
/// What the word of the resets says otherwise: how many milliseconds before this start the one before was reset.
const NOT_RESET: u32 = u32::MAX;
const FIRST_RESET: u32 = u32::MAX - 1;
/// That a start is under way.
const STARTING: u32 = 0x57A4_7196;

/// Memory that survives a reset, and what the controller keeps there; `resume.rs` says in which form.
#[repr(C)]
pub struct ResumeMemory {
    settings: [AtomicU32; SETTINGS_WORDS],
    settings_crc: AtomicU32,
    flights: [[AtomicU32; FLIGHT_WORDS]; 2],
    /// Rounds of the flight's writes: the lowest bit is the copy that is next.
    rounds: AtomicU32,
    /// The resets before, and its complement.
    resets: [AtomicU32; 2],
    /// [`STARTING`] from the beginning of a start until it has taken what stands here.
    start: AtomicU32,
}

/// Where a board keeps its [`ResumeMemory`].
#[derive(Clone, Copy)]
pub struct ResumeSource {
    /// The memory: the same after each reset.
    pub memory: &'static ResumeMemory,
    /// Whether a debugger is attached: a core that it halts ends as a reset of the watchdog, and motors must not start when somebody
    /// looks at the code. Asked only where all else speaks for a resumption.
    pub is_debugged: fn() -> bool,
}

/// How a motor goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct HeldMotor {
    /// The command to be held, and for how many ticks; `None` for a motor that stays off.
    pub held: Option<(Command, u32)>,
    /// Whether its filter is in the path.
    pub is_enabled: bool,
}

/// A controller as it was before a reset.
pub(super) struct Resumption {
    pub settings: Validated,
    pub origin: Origin,
    pub filters: [Filter; MOTORS],
    pub motors: [HeldMotor; MOTORS],
}

impl Resumption {
    /// The channels, which hold the commands. `None` where the settings do not fit, which they do once validated.
    pub fn channels(&self) -> Option<[Channel; MOTORS]> {
        let mut channels = channels(&self.settings, self.filters)?;
        for (channel, motor) in channels.iter_mut().zip(&self.motors) {
            channel.set_enabled(motor.is_enabled);
            if let Some((command, ticks_left)) = motor.held {
                channel.resume(command, ticks_left);
            }
        }
        Some(channels)
    }
}

/// Whether a flight may go on after this reset: one that the controller itself has caused, and that left clocks, wiring and intent as
/// they were. Not after power came, the supply fell, the crystal stopped, or somebody reset it.
const fn is_own_failure(reset: ResetReason) -> bool {
    match reset {
        ResetReason::Watchdog
        | ResetReason::Panic(_)
        | ResetReason::Fault { .. }
        // An interrupt that nobody has asked for is a fault of the same kind; the reset has switched it off.
        | ResetReason::StrayInterrupt(_) => true,
        ResetReason::PowerOn
        | ResetReason::BrownOut
        | ResetReason::Pin
        | ResetReason::Software
        | ResetReason::CrystalLost
        | ResetReason::SupplyLow => false,
    }
}

impl ResumeMemory {
    /// Memory that holds nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            settings: [const { AtomicU32::new(0) }; SETTINGS_WORDS],
            settings_crc: AtomicU32::new(NO_SETTINGS),
            flights: [const { [const { AtomicU32::new(0) }; FLIGHT_WORDS] }; 2],
            rounds: AtomicU32::new(0),
            resets: [const { AtomicU32::new(0) }; 2],
            start: AtomicU32::new(0),
        }
    }

    /// A start begins; to be called first thing. One that ended in a reset of its own leaves nothing to go on with: that reset says
    /// nothing of the flight, and the watchdog is patient with a start, so that the flight may be over for seconds.
    pub fn begin_start(&self) {
        if self.start.load(Relaxed) == STARTING {
            self.clear();
        }
        self.start.store(STARTING, Relaxed);
    }

    /// Forgets everything: nothing goes on after the next reset. For a firmware that is about to restart on purpose.
    pub fn clear(&self) {
        self.settings_crc.store(NO_SETTINGS, Relaxed);
        for word in self.flights.iter().flatten().chain(&self.settings).chain(&self.resets) {
            word.store(0, Relaxed);
        }
    }

    /// What goes on after this reset, if anything. The memory is cleared.
    ///
    /// `is_debugged` is asked only where all else speaks for it.
    pub(super) fn take(&self, reset: ResetReason, is_debugged: impl FnOnce() -> bool) -> Option<Resumption> {
        let resumption = if is_own_failure(reset) { self.read() } else { None };
        self.clear();
        self.start.store(0, Relaxed);
        let (resumption, resets) = resumption?;
        if is_debugged() {
            return None;
        }
        self.write_resets(resets);
        Some(resumption)
    }

    /// What stands there, and how the word of the resets goes on; `None` where a checksum does not hold, nothing is to be resumed, or
    /// this is the third reset in a short time.
    fn read(&self) -> Option<(Resumption, u32)> {
        let (ticks, motors) = self.flight()?;
        motors.iter().find(|motor| motor.held.is_some())?;
        if self.crc() != self.settings_crc.load(Relaxed) {
            return None;
        }
        let (settings, origin, filters) = self.settings()?;
        if !settings.resume || !origin.is_chosen() {
            return None;
        }
        let resets = self.next_resets(ticks, settings.loop_rate_hz)?;
        Some((Resumption { settings, origin, filters, motors }, resets))
    }

    // --- Settings -----------------------------------------------------------------------------------------------------

    /// Keeps these, which the controller runs with from now on. Every motor is at rest.
    #[inline(never)]
    pub(super) fn write_settings(&self, settings: &Settings, origin: Origin, filters: &[Filter; MOTORS]) {
        self.settings_crc.store(NO_SETTINGS, Relaxed);
        let mut bytes = [0; SETTINGS_BYTES];
        let Ok(written) = postcard::to_slice(settings, &mut bytes) else { return };
        let length = written.len() as u32;
        let kind = match filters[0] {
            Filter::Lead(_) => LEAD,
            Filter::Inverse(_) => INVERSE,
        };
        let header = [SOURCES, origin_number(origin), length, kind];
        let settings = bytes.as_chunks().0.iter().map(|&bytes| u32::from_le_bytes(bytes));
        let filters = filters.iter().flat_map(filter_words);
        for (word, value) in self.settings.iter().zip(header.into_iter().chain(settings).chain(filters)) {
            word.store(value, Relaxed);
        }
        self.settings_crc.store(self.crc(), Relaxed);
    }

    /// The same settings come from elsewhere now. Every motor is at rest.
    pub(super) fn set_origin(&self, origin: Origin) {
        if self.settings_crc.load(Relaxed) == NO_SETTINGS {
            return;
        }
        self.settings_crc.store(NO_SETTINGS, Relaxed);
        self.settings[1].store(origin_number(origin), Relaxed);
        self.settings_crc.store(self.crc(), Relaxed);
    }

    #[inline(never)]
    fn settings(&self) -> Option<(Validated, Origin, [Filter; MOTORS])> {
        let [sources, origin, length, kind, words @ ..] = &self.settings;
        if sources.load(Relaxed) != SOURCES {
            return None;
        }
        let (settings, filters) = words.split_at(SETTINGS_BYTES / 4);
        let mut bytes = [0; SETTINGS_BYTES];
        for (bytes, word) in bytes.as_chunks_mut().0.iter_mut().zip(settings) {
            *bytes = word.load(Relaxed).to_le_bytes();
        }
        let bytes = bytes.get(..length.load(Relaxed) as usize)?;
        let settings = postcard::from_bytes::<Settings>(bytes).ok()?.validate().ok()?;
        let kind = kind.load(Relaxed);
        let mut filters =
            filters.as_chunks().0.iter().map(|words| filter(kind, &words.each_ref().map(|word| word.load(Relaxed))));
        let mut next = || filters.next().flatten();
        Some((settings, origin_from_number(origin.load(Relaxed))?, [next()?, next()?, next()?, next()?]))
    }

    fn crc(&self) -> u32 {
        let mut digest = CHECKSUM.digest();
        for word in &self.settings {
            digest.update(&word.load(Relaxed).to_le_bytes());
        }
        digest.finalize().max(NO_SETTINGS + 1)
    }

    // --- Flight -------------------------------------------------------------------------------------------------------

    /// The older copy, which is written next, and what its checksum begins with.
    fn begin_round(&self) -> (&[AtomicU32; FLIGHT_WORDS], u32) {
        let [first, second] = &self.flights;
        let copy = if self.rounds.load(Relaxed) & 1 == 0 { first } else { second };
        (copy, self.settings_crc.load(Relaxed))
    }

    /// From now on the other copy is the older one.
    fn end_round(&self) {
        self.rounds.store(self.rounds.load(Relaxed).wrapping_add(1), Relaxed);
    }

    /// The newer one of the two copies whose checksums hold.
    fn flight(&self) -> Option<(u32, [HeldMotor; MOTORS])> {
        let seed = self.settings_crc.load(Relaxed);
        if seed == NO_SETTINGS {
            return None;
        }
        let whole = |words: &[AtomicU32; FLIGHT_WORDS]| {
            let [words @ .., checksum] = words.each_ref().map(|word| word.load(Relaxed));
            let [motors @ .., ticks] = words;
            (words.into_iter().fold(seed, mixed) == checksum).then_some((ticks, motors))
        };
        let [first, second] = self.flights.each_ref().map(whole);
        let (ticks, motors) = match (first, second) {
            // Ticks wrap.
            (Some(first), Some(second)) if second.0.wrapping_sub(first.0).cast_signed() > 0 => second,
            (Some(first), _) => first,
            (None, second) => second?,
        };
        let motor = |index: usize| {
            let (state, command) = (motors[2 * index], motors[2 * index + 1]);
            let held = (Command::saturating_from_bits(command.cast_signed()), state & TICKS_MASK);
            HeldMotor { held: (state & IS_HELD != 0).then_some(held), is_enabled: state & IS_ENABLED != 0 }
        };
        Some((ticks, core::array::from_fn(motor)))
    }

    // --- Resets -------------------------------------------------------------------------------------------------------

    /// How the word of the resets goes on after one that came `ticks` after the start; `None` for the third in [`CRASH_LOOP_MS`].
    fn next_resets(&self, ticks: u32, loop_rate_hz: u32) -> Option<u32> {
        let [resets, complement] = self.resets.each_ref().map(|word| word.load(Relaxed));
        let ran_ms = u64::from(ticks) * 1000 / u64::from(loop_rate_hz.max(1));
        let ran_ms = u32::try_from(ran_ms).unwrap_or(u32::MAX).min(FIRST_RESET - 1);
        if resets != !complement || resets == NOT_RESET {
            return Some(FIRST_RESET);
        }
        if resets != FIRST_RESET && resets.saturating_add(ran_ms) < CRASH_LOOP_MS {
            return None;
        }
        Some(ran_ms)
    }

    fn write_resets(&self, resets: u32) {
        self.resets[0].store(resets, Relaxed);
        self.resets[1].store(!resets, Relaxed);
    }
}

/// Writes the flight into the memory, motor by motor: a tick has not the time for all.
pub(super) struct FlightRecorder {
    memory: Option<&'static ResumeMemory>,
    /// The copy that is written.
    copy: &'static [AtomicU32; FLIGHT_WORDS],
    checksum: u32,
    /// The motor that is next; behind the last the end of the round, and then a step without any.
    next: usize,
}

/// What is written without memory that survives.
static NOWHERE: [AtomicU32; FLIGHT_WORDS] = [const { AtomicU32::new(0) }; FLIGHT_WORDS];

impl FlightRecorder {
    pub fn new(memory: Option<&'static ResumeMemory>) -> Self {
        let (copy, checksum) = memory.map_or((&NOWHERE, 0), ResumeMemory::begin_round);
        Self { memory, copy, checksum, next: 0 }
    }

    /// One step. Whether it had nothing to do: once in a round.
    #[inline]
    pub fn step(&mut self, ticks: u32, motors: &[Motor; MOTORS]) -> bool {
        if let Some(motor) = motors.get(self.next) {
            self.write_motor(motor.held());
            self.next += 1;
            return false;
        }
        if self.next > MOTORS {
            self.next = 0;
            return true;
        }
        self.end_round(ticks);
        self.next += 1;
        false
    }

    #[inline]
    fn write_motor(&mut self, motor: HeldMotor) {
        let Some([to_state, to_command]) = self.copy.as_chunks::<2>().0.get(self.next) else { return };
        let (held, command) = match motor.held {
            // Times are at most 10 000 ticks.
            Some((command, ticks_left)) => (IS_HELD | ticks_left, command.to_bits().cast_unsigned()),
            None => (0, 0),
        };
        let state = held | u32::from(motor.is_enabled) << IS_ENABLED.trailing_zeros();
        to_state.store(state, Relaxed);
        to_command.store(command, Relaxed);
        self.checksum = mixed(mixed(self.checksum, state), command);
    }

    /// Ends a round of all motors, `ticks` after the start, and begins one in the other copy.
    #[inline]
    fn end_round(&mut self, ticks: u32) {
        let [.., to_ticks, to_checksum] = self.copy;
        to_ticks.store(ticks, Relaxed);
        to_checksum.store(mixed(self.checksum, ticks), Relaxed);
        if let Some(memory) = self.memory {
            memory.end_round();
            (self.copy, self.checksum) = memory.begin_round();
        }
    }
}

impl Default for ResumeMemory {
    fn default() -> Self {
        Self::new()
    }
}

/// One step of the flight's checksum. Every step is a bijection of both words: one that differs changes it.
#[inline]
const fn mixed(checksum: u32, word: u32) -> u32 {
    (checksum ^ word).wrapping_mul(0x9E37_79B1).rotate_left(15)
}

const ORIGINS: [Origin; 6] =
    [Origin::Stored, Origin::StoredOnce, Origin::DefaultsBlank, Origin::DefaultsBad, Origin::Migrated, Origin::Host];

fn origin_number(origin: Origin) -> u32 {
    ORIGINS.iter().position(|&other| other == origin).map_or(u32::MAX, |index| index as u32)
}

fn origin_from_number(number: u32) -> Option<Origin> {
    ORIGINS.get(number as usize).copied()
}

fn filter_words(filter: &Filter) -> [u32; FILTER_WORDS] {
    let mut words = [0; FILTER_WORDS];
    match filter {
        Filter::Lead(LeadFilter { coefficients, slew }) => {
            let of = coefficients;
            let values = [of.k(), of.c(), of.g0(), of.g1(), slew.per_tick()];
            words.iter_mut().zip(values).for_each(|(word, value)| *word = value.cast_unsigned());
        }
        Filter::Inverse(InverseFilter { coefficients, slew, range }) => {
            let first = [coefficients.a(), coefficients.b()];
            let last = [slew.per_tick(), range.lowest.to_bits(), range.highest.to_bits()];
            let values = first.into_iter().chain(coefficients.gains()).chain(last);
            words.iter_mut().zip(values).for_each(|(word, value)| *word = value.cast_unsigned());
        }
    }
    words
}

/// Every condition of the coefficients is checked again, but that on the lead's L1 gain: the checksum stands for that.
fn filter(kind: u32, words: &[u32; FILTER_WORDS]) -> Option<Filter> {
    let words = words.map(u32::cast_signed);
    if kind == LEAD {
        let [k, c, g0, g1, slew, ..] = words;
        let coefficients = biquad::Coefficients::new(k, c, g0, g1)?;
        return Some(LeadFilter { coefficients, slew: SlewLimit::from_per_tick(slew)? }.into());
    }
    let [a, b, gains @ .., slew, lowest, highest] = words;
    let is_in_range = a > 0 && a < 1 << (inverse::COEFFICIENT_BITS - 1) && b > 0 && b <= 1 << inverse::COEFFICIENT_BITS;
    let (lowest, highest) = (Command::saturating_from_bits(lowest), Command::saturating_from_bits(highest));
    (kind == INVERSE && is_in_range).then_some(())?;
    let coefficients = inverse::Coefficients::new(a, b, gains.map(i64::from)).ok()?;
    let slew = SlewLimit::from_per_tick(slew)?;
    Some(Filter::Inverse(InverseFilter { coefficients, slew, range: CommandRange { lowest, highest } }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::filters;
    use crate::design::RotorCurve;
    use crate::link::PanicPlace;
    use crate::settings::CompensatorKind;

    const RATE: u32 = 5000;
    const OFF: HeldMotor = HeldMotor { held: None, is_enabled: false };

    fn lead() -> Validated {
        Settings::default().validate().unwrap()
    }

    fn inverse() -> Validated {
        let mut settings = Settings { compensator: CompensatorKind::Inverse, ..Settings::default() };
        for (index, motor) in settings.motors.iter_mut().enumerate() {
            motor.curve = Some(RotorCurve::from_time_constants_s([0.03 + 0.01 * index as f32; TABLE_POINTS]));
            motor.compensate = true;
        }
        settings.validate().unwrap()
    }

    fn flying(command: f64) -> [HeldMotor; MOTORS] {
        core::array::from_fn(|motor| HeldMotor {
            held: (motor != 2)
                .then(|| (Command::saturating_from_f64(command + 0.01 * motor as f64), 500 - motor as u32)),
            is_enabled: motor == 1,
        })
    }

    fn write(memory: &ResumeMemory, ticks: u32, motors: [HeldMotor; MOTORS]) {
        let (copy, checksum) = memory.begin_round();
        // A recorder writes for ever: into a copy of the copy, which is put in its place.
        let copy: [AtomicU32; FLIGHT_WORDS] = copy.each_ref().map(|word| AtomicU32::new(word.load(Relaxed)));
        let copy: &'static [AtomicU32; FLIGHT_WORDS] = std::boxed::Box::leak(std::boxed::Box::new(copy));
        let mut recorder = FlightRecorder { memory: None, copy, checksum, next: 0 };
        for motor in motors {
            recorder.write_motor(motor);
            recorder.next += 1;
        }
        recorder.end_round(ticks);
        memory.begin_round().0.iter().zip(copy).for_each(|(to, from)| to.store(from.load(Relaxed), Relaxed));
        memory.end_round();
    }

    /// Memory in which a flight with these settings has been kept up to so many ticks.
    fn kept(settings: &Validated, ticks: u32) -> ResumeMemory {
        let memory = ResumeMemory::new();
        keep(&memory, settings, ticks);
        memory
    }

    fn keep(memory: &ResumeMemory, settings: &Validated, ticks: u32) {
        memory.write_settings(settings, Origin::Stored, &filters(settings).unwrap());
        write(memory, ticks.wrapping_sub(5), flying(0.3));
        write(memory, ticks, flying(0.5));
    }

    fn words(memory: &ResumeMemory) -> impl Iterator<Item = &AtomicU32> {
        let ResumeMemory { settings, settings_crc, flights, resets, .. } = memory;
        flights.iter().flatten().chain([settings_crc]).chain(settings).chain(resets)
    }

    fn copy(memory: &ResumeMemory) -> ResumeMemory {
        let copy = ResumeMemory::new();
        for (to, from) in words(&copy).zip(words(memory)) {
            to.store(from.load(Relaxed), Relaxed);
        }
        copy
    }

    fn commands(resumption: &Resumption) -> [Option<Command>; MOTORS] {
        resumption.motors.map(|motor| motor.held.map(|(command, _)| command))
    }

    #[test]
    fn what_was_kept_comes_back_once_with_the_filters_to_the_last_bit() {
        for settings in [lead(), inverse()] {
            let memory = kept(&settings, 7777);
            let resumption = memory.take(ResetReason::Watchdog, || false).unwrap();
            assert_eq!((&resumption.settings, resumption.origin), (&settings, Origin::Stored));
            assert_eq!(resumption.filters, filters(&settings).unwrap());
            assert_eq!(resumption.motors, flying(0.5));
            let states = resumption.channels().unwrap().map(|channel| (channel.hold_state(), channel.is_enabled()));
            assert_eq!(states, flying(0.5).map(|motor| (motor.held, motor.is_enabled)));
            assert!(memory.take(ResetReason::Watchdog, || false).is_none(), "it is read once");
        }
    }

    #[test]
    fn a_flight_goes_on_after_the_controllers_own_failures_alone_and_every_start_clears_it() {
        let panic = ResetReason::Panic(PanicPlace::new("a.rs", 1));
        let fault = ResetReason::Fault { program_counter: 1, status: 2 };
        for reset in [ResetReason::Watchdog, panic, fault, ResetReason::StrayInterrupt(7)] {
            assert!(kept(&lead(), 7777).take(reset, || false).is_some(), "{reset:?}");
        }
        let others = [
            ResetReason::PowerOn,
            ResetReason::BrownOut,
            ResetReason::Pin,
            ResetReason::Software,
            ResetReason::CrystalLost,
            ResetReason::SupplyLow,
        ];
        for reset in others {
            let memory = kept(&lead(), 7777);
            assert!(memory.take(reset, || panic!("nobody asks")).is_none(), "{reset:?}");
            assert!(memory.take(ResetReason::Watchdog, || false).is_none(), "{reset:?}");
        }
        let memory = kept(&lead(), 7777);
        assert!(memory.take(ResetReason::Watchdog, || true).is_none(), "a debugger has halted the core");
        assert!(memory.take(ResetReason::Watchdog, || false).is_none());
        let memory = kept(&lead(), 7777);
        memory.clear();
        assert!(memory.take(ResetReason::Watchdog, || false).is_none(), "cleared");
    }

    #[test]
    fn nothing_goes_on_that_settings_or_states_speak_against() {
        let never = Settings { resume: false, ..Settings::default() }.validate().unwrap();
        assert!(kept(&never, 7777).take(ResetReason::Watchdog, || false).is_none());
        let memory = kept(&lead(), 7777);
        write(&memory, 7782, [OFF; MOTORS]);
        assert!(memory.take(ResetReason::Watchdog, || false).is_none(), "no motor was turned");
        let memory = kept(&lead(), 7777);
        memory.write_settings(&lead(), Origin::Host, &filters(&lead()).unwrap());
        assert!(memory.take(ResetReason::Watchdog, || false).is_none(), "the flight was one of other settings");
        for origin in [Origin::DefaultsBlank, Origin::DefaultsBad] {
            let memory = kept(&lead(), 7777);
            memory.set_origin(origin);
            write(&memory, 7782, flying(0.5));
            assert!(memory.take(ResetReason::Watchdog, || false).is_none(), "{origin:?}");
        }
        let memory = kept(&lead(), 7777);
        memory.set_origin(Origin::Host);
        write(&memory, 7782, flying(0.5));
        assert_eq!(memory.take(ResetReason::Watchdog, || false).unwrap().origin, Origin::Host);
        let memory = kept(&lead(), 7777);
        memory.settings[0].store(SOURCES ^ 1, Relaxed);
        memory.settings_crc.store(memory.crc(), Relaxed);
        write(&memory, 7782, flying(0.5));
        assert!(memory.take(ResetReason::Watchdog, || false).is_none(), "of another firmware");
    }

    /// Noise of lost power, and one wrong bit of each word.
    #[test]
    fn other_bits_are_nothing_or_the_copy_before() {
        for noise in [0, 1, u32::MAX, 0xAAAA_AAAA] {
            let memory = ResumeMemory::new();
            words(&memory).for_each(|word| word.store(noise, Relaxed));
            assert!(memory.take(ResetReason::Watchdog, || false).is_none());
        }
        let memory = kept(&inverse(), 7777);
        let flight = 2 * FLIGHT_WORDS;
        let resets = flight + 1 + SETTINGS_WORDS;
        let mut older = 0;
        for index in 0..resets {
            for bit in [0, 7, 15, 31] {
                let damaged = copy(&memory);
                let word = words(&damaged).nth(index).unwrap();
                word.store(word.load(Relaxed) ^ 1 << bit, Relaxed);
                let found = damaged.take(ResetReason::Watchdog, || false).map(|resumption| resumption.motors);
                if index < flight {
                    let found = found.expect("one copy is whole");
                    assert!(found == flying(0.5) || found == flying(0.3));
                    older += u32::from(found == flying(0.3));
                } else {
                    assert!(found.is_none(), "word {index}, bit {bit}");
                }
            }
        }
        assert_eq!(older, 4 * FLIGHT_WORDS as u32);
    }

    /// A reset after any store of a write, in either order of the copies, and over the end of the ticks' range.
    #[test]
    fn a_write_that_a_reset_cuts_leaves_the_copy_before() {
        for ticks in [7777, 2] {
            for parity in 0..2 {
                let memory = kept(&lead(), ticks);
                if parity == 1 {
                    write(&memory, ticks.wrapping_add(1), flying(0.5));
                }
                // As on the board, the copy after the last one that was written.
                let after = copy(&memory);
                after.rounds.store(memory.rounds.load(Relaxed), Relaxed);
                write(&after, ticks.wrapping_add(5), flying(0.7));
                let differs = |(a, b): &(&AtomicU32, &AtomicU32)| a.load(Relaxed) != b.load(Relaxed);
                let changes = words(&memory).zip(words(&after)).filter(differs).count();
                assert!(changes > 3 && changes <= FLIGHT_WORDS);
                for stores in 0..changes {
                    let cut = copy(&memory);
                    let changed = words(&cut).zip(words(&after)).filter(differs).take(stores);
                    changed.for_each(|(to, from)| to.store(from.load(Relaxed), Relaxed));
                    let found = cut.take(ResetReason::Watchdog, || false).unwrap();
                    assert_eq!(found.motors, flying(0.5), "{ticks} {parity} {stores}");
                }
                assert_eq!(after.take(ResetReason::Watchdog, || false).unwrap().motors, flying(0.7));
            }
        }
    }

    /// The watchdog is patient with a start: what its reset finds may be a flight of seconds ago.
    #[test]
    fn a_start_that_does_not_come_to_an_end_leaves_nothing_to_the_next() {
        let memory = kept(&lead(), 7777);
        memory.begin_start();
        memory.begin_start();
        assert!(memory.take(ResetReason::Watchdog, || false).is_none());
        for _ in 0..2 {
            keep(&memory, &lead(), 7777);
            memory.begin_start();
            assert!(memory.take(ResetReason::Watchdog, || false).is_some(), "one that does leaves what it keeps");
        }
    }

    #[test]
    fn the_third_reset_within_10_s_ends_off() {
        let memory = ResumeMemory::new();
        let reset = |seconds: f64| {
            keep(&memory, &lead(), (seconds * f64::from(RATE)) as u32);
            let resumption = memory.take(ResetReason::Watchdog, || false);
            resumption.map(|found| commands(&found)).is_some()
        };
        assert!(reset(100.0), "the first");
        assert!(reset(4.0), "the second");
        assert!(!reset(5.9), "the third within 10 s");
        assert!(reset(1.0), "after a start that was locked the count begins anew");
        assert!(reset(4.0));
        assert!(reset(6.1), "the third, after more than 10 s");
        assert!(!reset(3.8), "two of them within 10 s");
        for _ in 0..5 {
            assert!(reset(5.1), "every 5.1 s");
        }
    }

    /// How long the start-up needs for it is said of the boards; this is its size.
    #[test]
    fn it_fits_two_kibibytes() {
        assert!(size_of::<ResumeMemory>() < 2048, "{}", size_of::<ResumeMemory>());
    }
}
