//! From the time stamps of a line's edges to pulses.
//!
//! A timer stamps both edges of an input in hardware; [`Decoder::edge`] takes each stamp from the capture interrupt, and
//! [`Decoder::poll`] says once per control tick what has become of the input.
//!
//! - **A pulse** is rise to fall, and counts only when the line was seen low before it and both its width and its
//!   distance from the pulse before are possible for the protocol ([`Timing`]). Of several pulses between two polls the
//!   newest counts.
//! - **Glitches.** Levels that last less than 2 µs did not happen: a spike on a low line makes no pulse, a gap in a pulse
//!   does not cut it. So a pulse is complete only when the line has stayed low for that long; one that ends less than
//!   that before a poll is reported at the next.
//! - **Missing edges.** Two edges of one direction in a row (or an overcapture flag) mean that at least one was lost. The
//!   pulse in hand is dropped, since its width would be a guess; the last one stays good for its timeout.
//! - **Loss.** The input is lost when no pulse was accepted for the timeout, and live again after
//!   [`PULSES_TO_LIVE`] good pulses in a row, so that noise on an open line does not pass for a flight controller.
//! - **Spikes in a row.** Two edges that come closer together than the interrupt's latency are seen as a missing edge, and each
//!   costs the pulse beneath it. So with a missing edge, or a flood, the input goes on behind the timer's long filter
//!   ([`Listening::LongLevels`]) for [`FILTERED_POLLS`]: spikes under 2 µs, however many, are no edges to it. Then it is tried
//!   without, which costs a pulse or two while spikes still come. The pin itself is read behind no filter: an edge at which a
//!   spike is read in place of the level is a missing edge, too.
//! - **Flood.** With more edges between two polls than good frames and a few glitches can have, the input is off until the
//!   next poll. Behind the long filter it is off for a pause that doubles with each flood, from 2 polls to [`LONGEST_MASK_POLLS`],
//!   and starts anew after an accepted pulse: a burst costs a frame, and a line that oscillates costs next to no time. However noisy
//!   a line is, it causes at most `edges_per_poll + 1` interrupts per control tick.
//!
//! Both are for interrupts. Edges from a queue of bounded length ([`Timing::without_flood`]) are decoded, however many they are.
//!
//! - **Activity.** An input that is not live is active all the same while it has levels that are no glitches, or a flood:
//!   somebody may have connected a flight controller that speaks another protocol.
//!
//! Time stamps may wrap. No stamp is kept for longer than the timeout, as long as `poll` is called in time (it is also
//! right about edges that are stamped a little after its `now`, since the interrupt may come in between).

mod reading;
mod timing;

pub use reading::InputReading;
#[cfg(feature = "controller")]
pub(crate) use timing::TIMEOUT_MS;
pub use timing::{FASTEST_FRAME_HZ, SLOWEST_FRAME_HZ, SLOWEST_POLL_HZ, Timing, TimingError};

/// Good pulses in a row that make an input live.
pub const PULSES_TO_LIVE: u8 = 3;
/// Longest pause of a masked input in polls: 102 ms at 5 kHz.
pub const LONGEST_MASK_POLLS: u16 = 512;
/// Polls for which an input stays behind the long filter: 1 s at 5 kHz, so that trying without it costs one pulse in hundreds.
pub const FILTERED_POLLS: u16 = 5000;

/// Level of a line after an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// The edge was a fall.
    Low,
    /// The edge was a rise.
    High,
}

/// Which edges of an input are to interrupt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Listening {
    /// All that the timer's usual filter lets pass.
    #[default]
    All,
    /// Those behind its long filter, to which levels under 2 µs are none, and those of 20 µs are sure.
    LongLevels,
    /// None.
    Off,
}

/// What has become of an input since the last poll.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// The input has not been live since the start.
    Nothing,
    /// A new pulse.
    Pulse {
        /// From its rise to its fall, timer ticks.
        width_ticks: u32,
        /// From the rise of the accepted pulse before to its own, timer ticks: the frame, or several where pulses were
        /// dropped.
        period_ticks: u32,
    },
    /// The input is live and the last pulse is still good.
    Unchanged,
    /// The input was live and is not any more.
    Lost(LossReason),
}

/// What the line did when the input was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LossReason {
    /// It stayed low: a wire is off, or the flight controller is.
    StuckLow,
    /// It stayed high: a short, or a flight controller in reset.
    StuckHigh,
    /// It has edges, but they make no pulses.
    Implausible,
    /// It has more edges than any pulses make.
    Flood,
}

/// What was wrong on a line since the start. Counters stop at their highest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    /// Levels that were too short to be meant.
    pub glitches: u32,
    /// Edges that must have been there and were not seen.
    pub missing_edges: u32,
    /// Pulses that were too short or too long for the protocol.
    pub out_of_range: u32,
    /// Pulses that came too soon after another for the protocol.
    pub too_soon: u32,
    /// Times that there were more edges between two polls than frames and glitches have.
    pub floods: u32,
    /// Times that the input was lost.
    pub losses: u32,
}

/// What is known of the line. Where it is unsure, the rise was not seen, or not for sure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    Unknown,
    Low,
    High,
    HighUnsure,
    /// Low, but for less than a glitch may last.
    Falling,
    FallingUnsure,
}

/// Whether the last pulse is to be believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Liveness {
    Never,
    Live,
    Lost(LossReason),
}

/// What missing edges and floods have led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Open,
    /// Behind the long filter.
    Filtered,
    /// Off until the next poll, and then behind the long filter.
    Flooded,
    /// Off for a pause.
    Masked,
}

/// Decodes one input. See the [module](self).
#[derive(Clone, Debug)]
pub struct Decoder {
    timing: Timing,
    line: Line,
    liveness: Liveness,
    /// The last rise that was seen for sure.
    rise: u32,
    /// The last fall, or the last poll at which the input was off or left the long filter.
    fall: u32,
    /// Whether there was one within the timeout.
    has_fall: bool,
    /// Rise and fall of the last accepted pulse, unless it is older than the timeout. A live input has one.
    has_accepted: bool,
    accepted_rise: u32,
    accepted_fall: u32,
    /// From the rise of the accepted pulse before.
    last_period: u32,
    /// Width and period of a pulse that was not reported yet.
    is_fresh: bool,
    width: u32,
    period: u32,
    last_edge: u32,
    /// Edges since the last poll.
    edges: u32,
    /// Accepted pulses in a row while the input is not live.
    in_row: u8,
    mode: Mode,
    /// Whether an edge has changed it.
    has_new_listening: bool,
    /// Polls for which it stays filtered or masked.
    polls_left: u16,
    /// The pause that the next flood behind the long filter causes.
    next_mask_polls: u16,
    faults: Faults,
}

impl Decoder {
    /// A decoder that knows nothing of the line yet.
    #[must_use]
    pub const fn new(timing: Timing) -> Self {
        Self {
            timing,
            line: Line::Unknown,
            liveness: Liveness::Never,
            rise: 0,
            fall: 0,
            has_fall: false,
            has_accepted: false,
            accepted_rise: 0,
            accepted_fall: 0,
            last_period: 0,
            is_fresh: false,
            width: 0,
            period: 0,
            last_edge: 0,
            edges: 0,
            in_row: 0,
            mode: Mode::Open,
            has_new_listening: false,
            polls_left: 0,
            next_mask_polls: 1,
            faults: Faults { glitches: 0, missing_edges: 0, out_of_range: 0, too_soon: 0, floods: 0, losses: 0 },
        }
    }

    /// An edge: its time stamp, and the level that the line has after it. For the capture interrupt.
    ///
    /// Afterwards the interrupt of the input is to be as [`Self::listening`] says, which has changed where
    /// [`Self::has_new_listening`].
    pub fn edge(&mut self, timestamp: u32, level: Level) {
        if self.is_off() {
            return;
        }
        self.edges = self.edges.wrapping_add(1);
        if self.edges > self.timing.edges_per_poll {
            self.flood();
            return;
        }
        self.last_edge = timestamp;
        let glitch = self.timing.glitch;
        match (self.line, level) {
            (Line::Low, Level::High) => self.rise_at(timestamp),
            (Line::High, Level::Low) if timestamp.wrapping_sub(self.rise) < glitch => {
                count(&mut self.faults.glitches);
                self.line = Line::Low;
            }
            (Line::High, Level::Low) => self.fall_at(timestamp, Line::Falling),
            (Line::HighUnsure | Line::Unknown, Level::Low) => self.fall_at(timestamp, Line::FallingUnsure),
            (Line::Falling | Line::FallingUnsure, Level::High) if timestamp.wrapping_sub(self.fall) < glitch => {
                count(&mut self.faults.glitches);
                self.line = if self.line == Line::Falling { Line::High } else { Line::HighUnsure };
            }
            (Line::Falling, Level::High) => {
                if let Some((width, period)) = self.pulse() {
                    self.is_fresh = true;
                    (self.width, self.period) = (width, period);
                }
                self.rise_at(timestamp);
            }
            (Line::FallingUnsure, Level::High) => self.rise_at(timestamp),
            (Line::Unknown, Level::High) => self.line = Line::HighUnsure,
            // From here on an edge is missing.
            (Line::Low | Line::Falling | Line::FallingUnsure, Level::Low) => {
                // No level was seen: alone it drives no line.
                (self.line, self.fall) = (Line::FallingUnsure, timestamp);
                self.miss_edge();
            }
            (Line::High | Line::HighUnsure, Level::High) => {
                self.line = Line::HighUnsure;
                self.miss_edge();
            }
        }
    }

    #[inline]
    const fn rise_at(&mut self, timestamp: u32) {
        self.line = Line::High;
        self.rise = timestamp;
    }

    #[inline]
    const fn fall_at(&mut self, timestamp: u32, line: Line) {
        self.line = line;
        self.fall = timestamp;
        self.has_fall = true;
    }

    /// The capture hardware says that it stamped an edge before the one before was read. Comes before [`Self::edge`]
    /// with the stamp that is left.
    pub fn overcapture(&mut self) {
        self.line = Line::Unknown;
        self.miss_edge();
    }

    /// An edge is missing, or a spike was read in place of the level.
    #[cold]
    #[inline(never)]
    fn miss_edge(&mut self) {
        count(&mut self.faults.missing_edges);
        if self.timing.has_flood() {
            self.line = Line::Unknown;
            if self.mode == Mode::Open {
                (self.mode, self.polls_left) = (Mode::Filtered, FILTERED_POLLS);
                self.has_new_listening = true;
            }
        }
    }

    /// The queue of edges between the interrupt and this decoder was full: as good as too many edges since the last poll.
    pub fn overrun(&mut self) {
        if !self.is_off() {
            self.flood();
        }
    }

    /// What has become of the input. To be called once per control tick, with the timer's count.
    ///
    /// Afterwards the interrupt of the input is to be as [`Self::listening`] says.
    #[inline]
    pub fn poll(&mut self, now: u32) -> Signal {
        self.edges = 0;
        if self.mode != Mode::Open {
            self.pause(now);
        }
        // What time alone makes of the line.
        if self.line == Line::Falling {
            let low_for = elapsed(self.fall, now);
            if low_for >= self.timing.glitch.cast_signed() {
                self.line = Line::Low;
                if low_for > self.timing.timeout.cast_signed() {
                    self.late_pulse();
                } else if let Some((width_ticks, period_ticks)) = self.pulse() {
                    // The newest counts.
                    self.is_fresh = false;
                    return Signal::Pulse { width_ticks, period_ticks };
                }
            }
        }
        self.poll_without_fall(now)
    }

    /// [`Self::poll`], in one word, and with whether the line is active.
    #[inline]
    pub fn read(&mut self, now: u32) -> InputReading {
        match self.poll(now) {
            Signal::Nothing | Signal::Lost(_) if self.is_active(now) => InputReading::UNREADABLE,
            signal => signal.into(),
        }
    }

    /// Whether there were levels longer than a glitch, or a flood, within the timeout. Of an input that is not live, at each
    /// poll: the age of a stamp is right for 2^31 ticks only.
    fn is_active(&mut self, now: u32) -> bool {
        match self.mode {
            Mode::Open | Mode::Filtered => {}
            // The line is unknown meanwhile, and its last fall means nothing else.
            Mode::Flooded | Mode::Masked => (self.fall, self.has_fall) = (now, true),
        }
        self.has_fall &= elapsed(self.fall, now) <= self.timing.timeout.cast_signed();
        self.has_fall
    }

    /// The rest of [`Self::poll`]: no pulse has become complete just now.
    #[inline]
    fn poll_without_fall(&mut self, now: u32) -> Signal {
        match self.line {
            Line::FallingUnsure if elapsed(self.fall, now) >= self.timing.glitch.cast_signed() => self.line = Line::Low,
            // Long before the stamp wraps.
            Line::High if elapsed(self.rise, now) > self.timing.timeout.cast_signed() => self.line = Line::HighUnsure,
            _ => {}
        }
        if self.has_accepted && elapsed(self.accepted_fall, now) > self.timing.timeout.cast_signed() {
            self.lose(now);
        }
        if self.is_fresh {
            self.is_fresh = false;
            return Signal::Pulse { width_ticks: self.width, period_ticks: self.period };
        }
        match self.liveness {
            Liveness::Live => Signal::Unchanged,
            Liveness::Lost(reason) => Signal::Lost(reason),
            Liveness::Never => Signal::Nothing,
        }
    }

    /// Time between the rises of the last two accepted pulses, timer ticks; `None` where the input is not live.
    #[must_use]
    pub fn period(&self) -> Option<u32> {
        (self.liveness == Liveness::Live).then_some(self.last_period)
    }

    /// Whether the input's interrupt is to be off.
    #[must_use]
    #[inline]
    pub const fn is_off(&self) -> bool {
        matches!(self.mode, Mode::Flooded | Mode::Masked)
    }

    /// Which edges are to interrupt.
    #[must_use]
    #[inline]
    pub const fn listening(&self) -> Listening {
        match self.mode {
            Mode::Open => Listening::All,
            Mode::Filtered => Listening::LongLevels,
            Mode::Flooded | Mode::Masked => Listening::Off,
        }
    }

    /// Whether an edge has changed which are to interrupt, since [`Self::take_listening`].
    #[must_use]
    #[inline]
    pub const fn has_new_listening(&self) -> bool {
        self.has_new_listening
    }

    /// [`Self::listening`], for the caller that does as it says.
    pub const fn take_listening(&mut self) -> Listening {
        self.has_new_listening = false;
        self.listening()
    }

    /// What was wrong on the line since the start.
    #[must_use]
    pub const fn faults(&self) -> Faults {
        self.faults
    }

    /// The limits it works with.
    #[must_use]
    pub const fn timing(&self) -> &Timing {
        &self.timing
    }

    /// The line went from high to low for good, after a rise that was seen: width and period of the pulse, if it is one
    /// and the input is live.
    #[inline]
    fn pulse(&mut self) -> Option<(u32, u32)> {
        let width = self.fall.wrapping_sub(self.rise);
        // Below the shortest the difference wraps.
        if width.wrapping_sub(self.timing.min_width) > self.timing.width_span {
            count(&mut self.faults.out_of_range);
            self.in_row = 0;
            return None;
        }
        let period = self.rise.wrapping_sub(self.accepted_rise);
        if self.liveness != Liveness::Live {
            return self.pulse_before_live(width, period);
        }
        if period < self.timing.min_period {
            self.too_soon();
            return None;
        }
        self.accept(period);
        Some((width, period))
    }

    /// A pulse of an input that is not live. The period is one only where there was a pulse before.
    #[cold]
    #[inline(never)]
    fn pulse_before_live(&mut self, width: u32, period: u32) -> Option<(u32, u32)> {
        if self.has_accepted && period < self.timing.min_period {
            self.too_soon();
            return None;
        }
        let follows = self.has_accepted && period <= self.timing.max_period;
        self.in_row = if follows { self.in_row.saturating_add(1) } else { 1 };
        self.has_accepted = true;
        self.accept(period);
        if self.in_row < PULSES_TO_LIVE {
            return None;
        }
        self.liveness = Liveness::Live;
        Some((width, period))
    }

    #[inline]
    const fn accept(&mut self, period: u32) {
        self.last_period = period;
        self.accepted_rise = self.rise;
        self.accepted_fall = self.fall;
        self.next_mask_polls = 1;
    }

    /// A pulse that nobody polled for in time is lost with its input at once, but is counted.
    #[cold]
    #[inline(never)]
    fn late_pulse(&mut self) {
        let _ = self.pulse();
    }

    /// One poll of an input that is not open.
    #[cold]
    #[inline(never)]
    const fn pause(&mut self, now: u32) {
        if !matches!(self.mode, Mode::Flooded) {
            self.polls_left = self.polls_left.saturating_sub(1);
            if self.polls_left > 0 {
                return;
            }
        }
        // What comes next has another delay than what came before.
        self.line = Line::Unknown;
        if !matches!(self.mode, Mode::Filtered) {
            // Nobody has looked at the line meanwhile.
            (self.fall, self.has_fall) = (now, true);
        }
        (self.mode, self.polls_left) = match self.mode {
            Mode::Flooded | Mode::Masked => (Mode::Filtered, FILTERED_POLLS),
            Mode::Filtered | Mode::Open => (Mode::Open, 0),
        };
    }

    #[cold]
    #[inline(never)]
    fn too_soon(&mut self) {
        count(&mut self.faults.too_soon);
        self.in_row = 0;
    }

    /// No pulse was accepted for the timeout.
    #[cold]
    #[inline(never)]
    fn lose(&mut self, now: u32) {
        self.has_accepted = false;
        self.is_fresh = false;
        self.in_row = 0;
        if self.liveness != Liveness::Live {
            return;
        }
        count(&mut self.faults.losses);
        // An accepted pulse would have set the pause back to 1.
        let flooded = self.next_mask_polls > 1;
        let silent = elapsed(self.last_edge, now) >= self.timing.max_period.cast_signed();
        self.liveness = Liveness::Lost(match self.line {
            _ if flooded => LossReason::Flood,
            Line::Low if silent => LossReason::StuckLow,
            Line::High | Line::HighUnsure if silent => LossReason::StuckHigh,
            _ => LossReason::Implausible,
        });
    }

    /// Too many edges since the last poll.
    #[cold]
    fn flood(&mut self) {
        count(&mut self.faults.floods);
        self.line = Line::Unknown;
        self.has_new_listening = true;
        (self.mode, self.polls_left) = match self.mode {
            Mode::Open => (Mode::Flooded, 0),
            Mode::Filtered | Mode::Flooded | Mode::Masked => (Mode::Masked, self.next_mask_polls),
        };
        self.next_mask_polls = (self.next_mask_polls * 2).min(LONGEST_MASK_POLLS);
    }
}

/// Timer ticks from `stamp` to `now`, negative where the stamp is the later one. Right up to 2^31; the limits it is
/// compared with are 1 to 2^30.
const fn elapsed(stamp: u32, now: u32) -> i32 {
    now.wrapping_sub(stamp).cast_signed()
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
