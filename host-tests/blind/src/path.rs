//! The command's way to the rotor: clip, quantize, dead band, backlash, slew, frame hold, delay, in this order.
//!
//! The command is a list of straight pieces with the exact times at which they begin. Nothing is rounded to a grid of
//! time: a grid comes only with [`means`], which integrates the pieces exactly over each of its steps.

use super::setup::Setup;

/// From `start_s` until the next piece the command is `value + slope_per_s (t - start_s)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Seconds since the first row.
    pub start_s: f64,
    /// Command at `start_s`.
    pub value: f64,
    /// Its slope.
    pub slope_per_s: f64,
}

impl Piece {
    fn at(&self, time_s: f64) -> f64 {
        if self.slope_per_s == 0.0 { self.value } else { self.value + self.slope_per_s * (time_s - self.start_s) }
    }
}

/// When commands are taken over, and where the ESC's frames lie.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// When each command takes effect, in seconds since the first row.
    pub take_over_s: Vec<f64>,
    /// Where in its frame the ESC is at the first row, 0..1.
    pub frame_phase: f64,
}

impl Timing {
    /// Every command takes effect with its row.
    #[must_use]
    pub fn exact(rows: usize, row_s: f64) -> Self {
        Self { take_over_s: (0..rows).map(|row| row as f64 * row_s).collect(), frame_phase: 0.0 }
    }
}

/// What arrives at the supply when `commands` leave the controller; `nominal` before the first of them.
///
/// A dead band holds the last command that passed and lets the next one pass as soon as it differs by the width or
/// more. Play moves its output only when the input reaches one of its ends, a half width away. A delay keeps the order
/// of commands: those that would overtake each other take effect in their order.
#[must_use]
pub fn pieces(commands: &[f64], nominal: f64, setup: &Setup, timing: &Timing) -> Vec<Piece> {
    let mut values = Vec::with_capacity(commands.len());
    let shape = &setup.shape;
    let quantized = |value: f64| if setup.step > 0.0 { shape.quantized(value, setup.step) } else { value };
    let rest = quantized(shape.clipped(nominal, setup.upper));
    let mut held = rest;
    let mut plays: Vec<(f64, f64)> = shape.half_plays(setup.half_play).into_iter().map(|half| (half, rest)).collect();
    for command in commands {
        let value = quantized(shape.clipped(*command, setup.upper));
        // The tiny part keeps sums of steps of exactly one width from hanging on the last bit.
        let (change, width) = (value - held, setup.dead_band * shape.width_at(value - nominal));
        if change.abs() >= width * (1.0 - 1e-9) {
            held = value - shape.behind(change.abs(), width).copysign(change);
        }
        let mut sum = 0.0;
        for (half, play) in &mut plays {
            *play = play.clamp(held - *half, held + *half);
            sum += *play;
        }
        let play = sum / plays.len() as f64;
        values.push(play + shape.compliance * (held - play));
    }
    let slopes = [setup.slope_per_s, setup.slope_per_s * (1.0 - shape.slower_down)];
    let mut pieces = slewed(&values, rest, slopes, &timing.take_over_s);
    if setup.frame_hz.is_finite() {
        pieces = framed(&pieces, setup, timing);
    }
    if setup.delay_s > 0.0 {
        let record = timing.frame_phase.to_bits();
        let late = |(index, piece): (usize, &Piece)| piece.start_s + setup.delay_s * shape.delay_factor(record, index);
        let mut starts: Vec<f64> = pieces[1..].iter().enumerate().map(late).collect();
        starts.sort_unstable_by(f64::total_cmp);
        for (piece, start_s) in pieces[1..].iter_mut().zip(starts) {
            piece.start_s = start_s;
        }
    }
    pieces
}

/// With these slopes upward and downward. The first piece is the rest before time zero.
fn slewed(values: &[f64], rest: f64, [up, down]: [f64; 2], times_s: &[f64]) -> Vec<Piece> {
    let mut pieces = Vec::with_capacity(values.len() + 1);
    pieces.push(Piece { start_s: f64::NEG_INFINITY, value: rest, slope_per_s: 0.0 });
    let mut now = rest;
    for (index, (value, start_s)) in values.iter().zip(times_s).enumerate() {
        let until_s = times_s.get(index + 1).copied().unwrap_or(f64::INFINITY);
        let slope_per_s = if *value >= now { up } else { down };
        let needed_s = (value - now).abs() / slope_per_s;
        if needed_s <= 0.0 {
            pieces.push(Piece { start_s: *start_s, value: *value, slope_per_s: 0.0 });
            now = *value;
            continue;
        }
        let slope = slope_per_s.copysign(value - now);
        pieces.push(Piece { start_s: *start_s, value: now, slope_per_s: slope });
        if start_s + needed_s < until_s {
            pieces.push(Piece { start_s: start_s + needed_s, value: *value, slope_per_s: 0.0 });
            now = *value;
        } else {
            now += slope * (until_s - start_s);
        }
    }
    pieces
}

fn framed(pieces: &[Piece], setup: &Setup, timing: &Timing) -> Vec<Piece> {
    let (frame_hz, record) = (setup.frame_hz, timing.frame_phase.to_bits());
    let end_s = timing.take_over_s.last().copied().unwrap_or(0.0) + 1.0 / frame_hz;
    let mut out = vec![pieces[0]];
    let mut at = 0;
    let first_s = -timing.frame_phase / frame_hz;
    for frame in 0.. {
        let start_s = first_s + (f64::from(frame) + setup.shape.frame_late(record, frame)) / frame_hz;
        if start_s > end_s {
            break;
        }
        while at + 1 < pieces.len() && pieces[at + 1].start_s <= start_s {
            at += 1;
        }
        let value = pieces[at].at(start_s);
        out.push(Piece { start_s, value, slope_per_s: 0.0 });
    }
    out
}

/// Exact means of the command over `steps` steps of `step_s`, from time zero.
#[must_use]
pub fn means(pieces: &[Piece], step_s: f64, steps: usize) -> Vec<f64> {
    let mut at = 0;
    (0..steps)
        .map(|step| {
            let (start_s, end_s) = (step as f64 * step_s, (step + 1) as f64 * step_s);
            while at + 1 < pieces.len() && pieces[at + 1].start_s <= start_s {
                at += 1;
            }
            if pieces.get(at + 1).is_none_or(|next| next.start_s >= end_s) {
                return pieces[at].at((start_s + end_s) / 2.0);
            }
            let (mut now_s, mut sum) = (start_s, 0.0);
            while now_s < end_s {
                let until_s = pieces.get(at + 1).map_or(end_s, |next| next.start_s.min(end_s));
                sum += pieces[at].at((now_s + until_s) / 2.0) * (until_s - now_s);
                now_s = until_s;
                if pieces.get(at + 1).is_some_and(|next| next.start_s <= now_s) {
                    at += 1;
                }
            }
            sum / step_s
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::shape::Shape;
    use super::*;

    fn path(commands: &[f64], setup: &Setup) -> Vec<Piece> {
        pieces(commands, commands[0], setup, &Timing::exact(commands.len(), 1e-3))
    }

    fn values(commands: &[f64], setup: &Setup) -> Vec<f64> {
        means(&path(commands, setup), 1e-3, commands.len())
    }

    fn ramp(rows: usize, per_row: f64) -> Vec<f64> {
        (0..rows).map(|row| 0.5 + per_row * row as f64).collect()
    }

    #[test]
    fn nothing_set_passes_the_commands() {
        let commands = [0.5, 0.52, 0.47, 0.47, 0.51];
        for (value, command) in values(&commands, &Setup::default()).iter().zip(commands) {
            assert!((value - command).abs() < 1e-15);
        }
    }

    #[test]
    fn a_dead_band_makes_stairs_of_its_width() {
        let out = values(&ramp(1000, 1e-4), &Setup { dead_band: 0.01, ..Setup::default() });
        let mut levels = out.clone();
        levels.dedup();
        assert_eq!(levels.len(), 10);
        assert!(levels.windows(2).all(|pair| (pair[1] - pair[0] - 0.01).abs() < 1e-9));
    }

    #[test]
    fn play_follows_half_a_width_behind_and_stays_at_a_turn() {
        let mut commands = ramp(200, 1e-3);
        commands.extend((0..200).map(|row| 0.699 - 1e-3 * f64::from(row)));
        let out = values(&commands, &Setup { half_play: 0.01, ..Setup::default() });
        assert!((out[150] - (commands[150] - 0.01)).abs() < 1e-12);
        assert!((out[350] - (commands[350] + 0.01)).abs() < 1e-12);
        assert_eq!(out[199], out[215]);
    }

    #[test]
    fn a_quantizer_is_off_by_half_a_step_at_most_and_by_a_twelfth_of_its_square_in_the_mean() {
        let step = 1.0 / 64.0;
        let commands = ramp(4000, 1e-4);
        let out = values(&commands, &Setup { step, ..Setup::default() });
        let errors: Vec<f64> = out.iter().zip(&commands).map(|(out, command)| out - command).collect();
        assert!(errors.iter().all(|error| error.abs() <= step / 2.0 + 1e-12));
        let square = errors.iter().map(|error| error * error).sum::<f64>() / 4000.0;
        assert!((square / (step * step / 12.0) - 1.0).abs() < 0.05, "{square}");
    }

    #[test]
    fn a_clip_holds_its_limit() {
        let out = values(&ramp(200, 1e-3), &Setup { upper: 0.6, ..Setup::default() });
        assert!((out[50] - 0.55).abs() < 1e-12 && out[150..].iter().all(|value| *value == 0.6));
    }

    #[test]
    fn a_slew_limit_makes_a_step_a_ramp_of_its_rate() {
        let mut commands = vec![0.5; 100];
        commands[10..].fill(0.6);
        // 0.1 at 2 per second: 50 ms.
        let out = path(&commands, &Setup { slope_per_s: 2.0, ..Setup::default() });
        let means = means(&out, 1e-3, 100);
        assert!((means[10] - 0.501).abs() < 1e-12 && (means[34] - 0.549).abs() < 1e-12);
        assert!((means[59] - 0.599).abs() < 1e-9 && (means[61] - 0.6).abs() < 1e-12);
    }

    #[test]
    fn frames_delay_by_half_of_one_in_the_mean() {
        let commands = ramp(1000, 1e-4);
        let setup = Setup { frame_hz: 157.3, ..Setup::default() };
        let out = values(&commands, &setup);
        // The row's own hold delays by half a row, which the means of the commands do not show: a frame takes the
        // command that was valid at its start, on average half a row older than the ramp's.
        let lag: f64 = (100..900).map(|row| (commands[row] - out[row]) / 1e-4).sum::<f64>() / 800.0;
        assert!((lag - 500.0 / 157.3).abs() < 0.05, "{lag} rows");
    }

    #[test]
    fn frames_that_jitter_delay_by_half_of_their_mean_square_over_their_mean() {
        let commands = ramp(8000, 1e-5);
        let (frame_hz, frame_jitter) = (157.3, 0.3);
        let shape = Shape { frame_jitter, seed: 3, ..Shape::default() };
        let out = values(&commands, &Setup { frame_hz, shape, ..Setup::default() });
        let lag: f64 = (100..7900).map(|row| (commands[row] - out[row]) / 1e-5).sum::<f64>() / 7800.0;
        // A frame's length has the variance of the difference of two uniform numbers: 2 / 3 of the jitter's square.
        let expected = 500.0 / frame_hz * (1.0 + 2.0 / 3.0 * frame_jitter * frame_jitter);
        assert!((lag - expected).abs() < 0.03, "{lag} rows, not {expected}");
    }

    #[test]
    fn several_plays_take_up_a_turn_one_after_the_other() {
        let shape = Shape { spread_of_plays: 0.8, ..Shape::default() };
        let mut commands = ramp(201, 1e-3);
        commands.extend((1..100).map(|row| 0.7 - 1e-3 * f64::from(row)));
        let out = values(&commands, &Setup { half_play: 0.01, shape, ..Setup::default() });
        for back in [0, 3, 12, 21, 40, 90] {
            let way = 1e-3 * back as f64;
            let halves = [0.002, 0.006, 0.010, 0.014, 0.018];
            let taken: f64 = halves.iter().map(|half| f64::max(0.0, way - 2.0 * half)).sum::<f64>() / 5.0;
            assert!((out[200 + back] - (0.69 - taken)).abs() < 1e-12, "{back}");
        }
    }

    #[test]
    fn a_dead_band_with_a_knee_stays_behind_what_has_just_passed() {
        let shape = Shape { band_knee: 0.2, ..Shape::default() };
        let setup = Setup { dead_band: 0.01, shape, ..Setup::default() };
        let out = values(&[0.5, 0.509, 0.51, 0.51, 0.53, 0.52, 0.521], &setup);
        for (out, expected) in out.iter().zip([0.5, 0.5, 0.508, 0.508, 0.53, 0.522, 0.522]) {
            assert!((out - expected).abs() < 1e-9, "{out} {expected}");
        }
    }

    #[test]
    fn a_delay_that_jitters_keeps_its_mean_and_the_order_of_commands() {
        let shape = Shape { delay_jitter: 0.3, seed: 9, ..Shape::default() };
        let commands = ramp(5000, 1e-5);
        let delay_s = 20e-3;
        let out = path(&commands, &Setup { delay_s, shape, ..Setup::default() });
        let late: Vec<f64> =
            out[1..].iter().enumerate().map(|(row, piece)| piece.start_s - row as f64 * 1e-3).collect();
        assert!(out[1..].windows(2).all(|pair| pair[0].start_s <= pair[1].start_s && pair[0].value < pair[1].value));
        assert!(late.iter().all(|late| (0.7 * delay_s..=1.3 * delay_s).contains(late)));
        // Uniform numbers up to 6 ms around the mean, 5000 of them: off by 0.05 ms.
        assert!((late.iter().sum::<f64>() / 5000.0 - delay_s).abs() < 2e-4);
        assert!(late.iter().any(|late| (late - delay_s).abs() > 1e-3));
    }

    #[test]
    fn a_delay_of_part_of_a_step_is_exact_in_the_mean() {
        let mut commands = vec![0.5; 20];
        commands[10..].fill(0.6);
        let out = values(&commands, &Setup { delay_s: 0.3e-3, ..Setup::default() });
        assert!((out[10] - (0.5 * 0.3 + 0.6 * 0.7)).abs() < 1e-12 && (out[11] - 0.6).abs() < 1e-12);
    }

    #[test]
    fn means_keep_the_integral_for_any_step() {
        let commands: Vec<f64> = (0..300).map(|row| 0.5 + 0.05 * (f64::from(row) * 0.7).sin()).collect();
        let setup = Setup { slope_per_s: 30.0, frame_hz: 333.0, delay_s: 1.7e-3, ..Setup::default() };
        let pieces = path(&commands, &setup);
        let total = |step_s: f64, steps: usize| means(&pieces, step_s, steps).iter().sum::<f64>() * step_s;
        assert!((total(1e-3, 300) - total(5e-5, 6000)).abs() < 1e-12);
    }
}
