//! The ESC takes over a new command once per frame.

use super::error::checked;
use super::{CommandStage, Memory, PlantError, Segment};

/// Times nearer than this part of a frame are the same moment. Derived: the times of an hour at 600 Hz, 2e6 frames, are rounded by `2e6 /
/// 2^53`, 2.4e-10 of a frame; ticks of usual rates that meet no frame are hundredths of one away.
pub const SAME_MOMENT_FRAMES: f64 = 1e-9;

/// More frames than these of one command are passed over at once: the work goes with the rows, not with the time between them. Chosen: 17 s
/// at 600 Hz, longer than records leave between two rows.
const MANY_FRAMES: f64 = 1e4;

/// A zero-order hold at the rate of the ESC's frames (600 Hz in the paper).
///
/// Frame `n` starts at `(n + phase) / frame_hz`. What the command is at that moment holds until the next frame
/// starts. A command that changes at that very moment counts as changed, and a billionth of a frame counts as that
/// very moment: where ticks and frames meet, it is not the rounding of their times that decides. Otherwise frames and
/// the ticks of the control loop need not be commensurate.
///
/// [`hold_response`](super::hold_response) is what it does, on average, to a sinusoid.
#[derive(Clone, Debug)]
pub struct EscFrame {
    frame_hz: f64,
    phase: f64,
    same_moment_s: f64,
    /// Number of the next frame.
    next: f64,
    next_s: f64,
    held: f64,
}

impl EscFrame {
    /// Frames at `frame_hz` (positive), the first one `phase` (0 <= `phase` < 1) of a frame after time 0. At rest at 0.
    ///
    /// # Errors
    /// [`PlantError::Setting`] when `frame_hz` or `phase` is outside its range.
    pub fn new(frame_hz: f64, phase: f64) -> Result<Self, PlantError> {
        checked("esc_frame_hz", frame_hz, "finite and above 0", frame_hz.is_finite() && frame_hz > 0.0)?;
        checked("esc_frame_phase", phase, "in 0..1, 1 excluded", (0.0..1.0).contains(&phase))?;
        let same_moment_s = SAME_MOMENT_FRAMES / frame_hz;
        Ok(Self { frame_hz, phase, same_moment_s, next: 0.0, next_s: phase / frame_hz, held: 0.0 })
    }
}

impl CommandStage for EscFrame {
    fn settle(&mut self, level: f64) -> f64 {
        (self.held, self.next, self.next_s) = (level, 0.0, self.phase / self.frame_hz);
        level
    }

    #[inline]
    fn advance(&mut self, from_s: f64, input: Segment) -> Segment {
        let until_s = input.until_s;
        if from_s < 0.0 && self.next == 0.0 {
            // A run that begins before time 0: its first frame is the next one from here.
            self.next = (from_s * self.frame_hz - self.phase - SAME_MOMENT_FRAMES).ceil();
            self.next_s = (self.next + self.phase) / self.frame_hz;
        }
        // Whoever asks may have been cut short at the frame's own moment, where the next piece is about to begin.
        if from_s + self.same_moment_s >= self.next_s && self.next_s + self.same_moment_s < until_s {
            self.held = input.level;
            self.next += 1.0;
            self.next_s = (self.next + self.phase) / self.frame_hz;
        }
        // Of many frames in a piece that stands still, all but the first take over what is there already.
        let is_still = input.slope_per_s == 0.0 && self.held == input.level;
        if is_still && (until_s - self.next_s) * self.frame_hz > MANY_FRAMES {
            self.next = (until_s * self.frame_hz - self.phase - SAME_MOMENT_FRAMES).ceil();
            self.next_s = (self.next + self.phase) / self.frame_hz;
        }
        // A frame that starts with the next piece takes over that piece's command.
        let frame_is_later = self.next_s + self.same_moment_s >= until_s;
        Segment::constant(self.held, if frame_is_later { until_s } else { self.next_s })
    }

    fn memory(&self) -> Memory {
        Memory::Seconds(self.frame_hz.recip())
    }

    fn changes_after(&self, period_s: f64) -> bool {
        let frames = self.frame_hz * period_s;
        (frames - frames.round()).abs() > SAME_MOMENT_FRAMES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs the stage on `input(k)` at `loop_hz` for a second; gives (time, level) at every change.
    fn changes(frame_hz: f64, phase: f64, loop_hz: f64, input: impl Fn(u32) -> f64) -> Vec<(f64, f64)> {
        let mut stage = EscFrame::new(frame_hz, phase).unwrap();
        stage.settle(-1.0);
        let (mut found, mut level) = (Vec::new(), -1.0);
        for tick in 0..loop_hz as u32 {
            let (mut from, until) = (f64::from(tick) / loop_hz, f64::from(tick + 1) / loop_hz);
            while from < until {
                let piece = stage.advance(from, Segment::constant(input(tick), until));
                assert!(piece.until_s > from && piece.until_s <= until);
                if piece.level != level {
                    level = piece.level;
                    found.push((from, level));
                }
                from = piece.until_s;
            }
        }
        found
    }

    #[test]
    fn frames_take_over_the_command_of_their_moment_though_ticks_and_frames_do_not_line_up() {
        let found = changes(600.0, 0.0, 5000.0, f64::from);
        assert_eq!(found.len(), 600);
        for (n, &(time_s, level)) in (0_u32..).zip(&found) {
            assert_eq!(time_s, f64::from(n) / 600.0);
            // In whole numbers: frame n starts in tick floor(5000 n / 600).
            assert_eq!(level, f64::from(n * 5000 / 600), "frame {n}");
        }
    }

    #[test]
    fn a_phase_moves_the_frames() {
        for (n, &(time_s, level)) in (0_u32..).zip(&changes(600.0, 0.25, 5000.0, f64::from)) {
            assert!((time_s - (f64::from(n) + 0.25) / 600.0).abs() < 1e-15);
            assert_eq!(level, f64::from((4 * n + 1) * 5000 / 2400), "frame {n}");
        }
    }

    #[test]
    fn frames_that_meet_ticks_take_over_the_new_command_however_the_times_round() {
        // Multiples of 0.12 frames at 600 Hz are whole ticks of 5 kHz, but not so in binary fractions.
        for k in 0..8_u32 {
            let found = changes(600.0, 0.12 * f64::from(k), 5000.0, f64::from);
            for (n, &(_, level)) in (0_u32..).zip(&found) {
                assert_eq!(level, f64::from(k + n * 5000 / 600), "frame {n} with a phase of {k} ticks");
            }
        }
    }

    #[test]
    fn a_frame_takes_the_command_of_its_moment_though_a_later_stage_cuts_the_one_before_there() {
        // What comes out of a delay is off by rounding from the tick at which the next command, and a frame, begins.
        let cut_s = 1e-13;
        for phase in [0.0, 0.12, 0.36] {
            let mut stage = EscFrame::new(600.0, phase).unwrap();
            stage.settle(-1.0);
            let mut held = Vec::new();
            for tick in 0..5000_u32 {
                let until_s = f64::from(tick + 1) / 5000.0;
                let mut from_s = f64::from(tick) / 5000.0;
                while from_s < until_s {
                    let piece = stage.advance(from_s, Segment::constant(f64::from(tick), until_s));
                    assert!(piece.until_s > from_s && piece.until_s <= until_s);
                    held.push(piece.level);
                    from_s = if from_s < until_s - cut_s { piece.until_s.min(until_s - cut_s) } else { piece.until_s };
                }
            }
            held.dedup();
            let uncut: Vec<f64> = changes(600.0, phase, 5000.0, f64::from).iter().map(|change| change.1).collect();
            held.retain(|level| *level >= 0.0);
            assert_eq!(held, uncut, "phase {phase}");
        }
    }

    #[test]
    fn several_frames_fit_into_one_tick() {
        let found = changes(8000.0, 0.0, 1000.0, f64::from);
        assert_eq!(found.len(), 1000);
        assert!(
            (0_u32..).zip(&found).all(|(k, &(time_s, level))| time_s == f64::from(k) / 1000.0 && level == f64::from(k))
        );
    }

    #[test]
    fn nonsense_is_refused() {
        for (frame_hz, phase) in
            [(0.0, 0.0), (-600.0, 0.0), (f64::NAN, 0.0), (f64::INFINITY, 0.0), (600.0, 1.0), (600.0, -0.1)]
        {
            assert!(EscFrame::new(frame_hz, phase).is_err(), "{frame_hz} Hz, phase {phase}");
        }
    }
}
