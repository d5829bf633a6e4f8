//! What a command looks like that nobody has described: a random or pseudo-random one, or a ramp.

use rotorlead_numerics::sample::median;

/// Commands closer than this are one. Chosen: a microsecond of a pulse width from 1000 to 2000.
const SAME_LEVEL: f64 = 1e-3;
/// Changes that a random command has at the least. Chosen: of fewer, how long they hold may be chance, and they excite few frequencies.
const LEAST_CHANGES: usize = 20;
/// A level that is usually held for as long lets a motor settle, and is one of a staircase, seconds. Chosen: seven time constants of the
/// usual 70 ms.
const HELD_S: f64 = 0.5;
/// Of a random command the longest holds are at least this many times as long as the shortest ones, a tenth of all at either end left
/// aside. Derived: a binary one that switches at a clock's ticks holds for one tick in half of the cases, and for four in a sixteenth.
const HOLDS_DIFFER: f64 = 1.8;
/// Or its steps differ as much in size, and this share of them turns back. Derived: of independent levels two steps in three do; a
/// staircase goes on.
const TURNS: f64 = 0.5;
/// Points at which a ramp is looked at. Chosen: more than a staircase has levels.
const POINTS: usize = 200;
/// A ramp moves for this share of the record, at one speed within [`SAME_SPEED`] for this share of that, and turns so often at the most.
/// Chosen: a sine is at one speed within that for less than half of its time.
const MOVES: f64 = 0.4;
const ONE_SPEED: f64 = 0.8;
const SAME_SPEED: f64 = 0.15;
const MOST_TURNS: usize = 20;
/// A ramp by small steps holds each for less than this, seconds. Chosen: as [`HELD_S`], of small steps that a motor follows all the time.
const HELD_ON_A_RAMP_S: f64 = 0.25;

/// What a command looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandShape {
    /// It switches between levels too fast and too irregularly for a motor to settle: a random or pseudo-random binary command, or one of
    /// random levels.
    Random,
    /// It moves at one speed, up or down.
    Ramp,
}

impl CommandShape {
    /// Of a command, 0..1, each entry of which holds until the next; times in seconds. `None` where it is neither.
    #[must_use]
    pub fn from_command(time_s: &[f64], command: &[f64]) -> Option<Self> {
        let is_change = |place: &usize| (command[*place] - command[*place - 1]).abs() > SAME_LEVEL;
        let changes: Vec<usize> = (1..command.len().min(time_s.len())).filter(is_change).collect();
        if is_random(time_s, command, &changes) {
            return Some(Self::Random);
        }
        is_ramp(time_s, command).then_some(Self::Ramp)
    }
}

fn is_random(time_s: &[f64], command: &[f64], changes: &[usize]) -> bool {
    if changes.len() < LEAST_CHANGES {
        return false;
    }
    // What changes in each row is a chirp, or noise.
    let holds_for_rows = median(changes.windows(2).map(|pair| (pair[1] - pair[0]) as f64)).unwrap_or(0.0) >= 2.0;
    let holds: Vec<f64> = changes.windows(2).map(|pair| time_s[pair[1]] - time_s[pair[0]]).collect();
    let usual_s = median(holds.iter().copied()).unwrap_or(f64::INFINITY);
    let steps: Vec<f64> = changes.iter().map(|&place| command[place] - command[place - 1]).collect();
    let turns = steps.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    let is_irregular = spread(&holds) > HOLDS_DIFFER || spread(&steps) > HOLDS_DIFFER;
    holds_for_rows && usual_s < HELD_S && is_irregular && turns as f64 >= TURNS * (steps.len() - 1) as f64
}

/// How many times the large ones are the small ones, a tenth at either end left aside; of each second one alone, since a train of pulses is
/// long and short in turn.
fn spread(values: &[f64]) -> f64 {
    let of = |first: usize| {
        let mut sizes: Vec<f64> = values.iter().skip(first).step_by(2).map(|value| value.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let aside = sizes.len() / 10;
        sizes[sizes.len() - 1 - aside] / sizes[aside]
    };
    f64::min(of(0), of(1))
}

fn is_ramp(time_s: &[f64], command: &[f64]) -> bool {
    let (Some(&first_s), Some(&last_s)) = (time_s.first(), time_s.last()) else { return false };
    let levels: Vec<usize> = (1..command.len()).filter(|&place| command[place] != command[place - 1]).collect();
    let held_s = median(levels.windows(2).map(|pair| time_s[pair[1]] - time_s[pair[0]])).unwrap_or(f64::INFINITY);
    if levels.len() < POINTS / 4 || held_s > HELD_ON_A_RAMP_S {
        return false;
    }
    let at = |point: usize| {
        let at_s = first_s + (last_s - first_s) * point as f64 / POINTS as f64;
        // Between two rows, since a short ramp has but a few of them from point to point.
        let next = time_s.partition_point(|time| *time <= at_s).clamp(1, command.len() - 1);
        let share = (at_s - time_s[next - 1]) / (time_s[next] - time_s[next - 1]);
        command[next - 1] + share * (command[next] - command[next - 1])
    };
    let speeds: Vec<f64> = (0..POINTS).map(|point| at(point + 1) - at(point)).filter(|speed| *speed != 0.0).collect();
    let Some(usual) = median(speeds.iter().map(|speed| speed.abs())) else { return false };
    let alike = speeds.iter().filter(|speed| (speed.abs() - usual).abs() <= SAME_SPEED * usual).count();
    let turns = speeds.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    speeds.len() as f64 >= MOVES * POINTS as f64
        && alike as f64 >= ONE_SPEED * speeds.len() as f64
        && turns <= MOST_TURNS
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 4000;
    const ROW_S: f64 = 0.005;

    fn shape(command: impl Fn(f64) -> f64) -> Option<CommandShape> {
        let time_s: Vec<f64> = (0..ROWS).map(|row| ROW_S * row as f64).collect();
        let command: Vec<f64> = time_s.iter().map(|time| command(*time)).collect();
        CommandShape::from_command(&time_s, &command)
    }

    /// Bits of a shift register of nine, `x^9 + x^5 + 1`.
    fn bit(place: usize) -> bool {
        let mut register = 0x1ff_u32;
        for _ in 0..place % 511 {
            let next = (register >> 8 ^ register >> 4) & 1;
            register = (register << 1 | next) & 0x1ff;
        }
        register & 1 == 1
    }

    #[test]
    fn random_commands_are_told_from_those_that_are_played_on_purpose() {
        for tick_s in [0.02, 0.05, 0.2] {
            let binary = |time: f64| if bit((time / tick_s + 1e-6) as usize) { 0.58 } else { 0.42 };
            assert_eq!(shape(binary), Some(CommandShape::Random), "{tick_s}");
        }
        let of_levels = |time: f64| {
            let place = (time / 0.1 + 1e-6) as usize;
            0.3 + 0.4 * ((place * place * 37 + place * 13) % 101) as f64 / 101.0
        };
        assert_eq!(shape(of_levels), Some(CommandShape::Random));
        let square = |period_s: f64| move |time: f64| if (time / period_s + 1e-6).fract() < 0.5 { 0.4 } else { 0.6 };
        assert_eq!(shape(square(0.4)), None);
        assert_eq!(shape(square(2.0)), None);
        // A pulse train, a staircase of levels that differ, a chirp, a sum of sines.
        assert_eq!(shape(|time| if (time / 0.5 + 1e-6).fract() < 0.2 { 0.6 } else { 0.4 }), None);
        assert_eq!(shape(|time| 0.2 + 0.6 * ((time / 0.9) as usize * 5 % 7) as f64 / 7.0), None);
        assert_eq!(shape(|time| 0.5 + 0.1 * (time * (1.0 + 2.0 * time)).sin()), None);
        assert_eq!(shape(|time| 0.5 + 0.1 * (3.0 * time).sin() + 0.1 * (7.0 * time).sin()), None);
    }

    #[test]
    fn ramps_are_told_from_sines_and_staircases() {
        for lasts_s in [20.0, 9.0] {
            assert_eq!(shape(|time| 0.2 + 0.6 * (time / lasts_s).min(1.0)), Some(CommandShape::Ramp), "{lasts_s}");
        }
        for rows in [150, 350, 750] {
            let (time_s, command): (Vec<f64>, Vec<f64>) =
                (0..rows).map(|row| (ROW_S * f64::from(row), 0.2 + 8e-4 * f64::from(row))).unzip();
            assert_eq!(CommandShape::from_command(&time_s, &command), Some(CommandShape::Ramp), "{rows}");
        }
        // Up and down, and by whole microseconds of a pulse width.
        assert_eq!(shape(|time| 0.2 + 0.6 * (1.0 - (time / 10.0 - 1.0).abs())), Some(CommandShape::Ramp));
        assert_eq!(shape(|time| (200.0 + 30.0 * time).round() / 1000.0), Some(CommandShape::Ramp));
        assert_eq!(shape(|time| 0.5 + 0.3 * (0.6 * time).sin()), None);
        assert_eq!(shape(|time| 0.2 + 0.02 * (time / 0.5).floor()), None);
        assert_eq!(shape(|_| 0.5), None);
    }
}
