//! A rotor's speeds over the command as text, and the quadratic through points.

use rotorlead::design::SpeedCurve;
use rotorlead::throttle::Command;

use super::text::{NONE, level_text};

/// What the middle of two commands is rounded to.
const STEP: f64 = 1.0 / Command::ONE.to_bits() as f64;
/// The form of speeds.
pub const SPEEDS: &str = "COMMAND:ERPM,...";

/// Speeds as a setting: `COMMAND:ERPM` at both ends of the curve and in its middle, which `set` takes back to the same curve.
#[must_use]
pub fn speeds_text(curve: &SpeedCurve) -> String {
    let [from, to] = curve.range();
    let commands = [from, from + (to - from) / 2, to].map(level_text);
    let points = commands.iter().zip(curve.erpm()).map(|(command, erpm)| format!("{command}:{erpm}"));
    points.collect::<Vec<_>>().join(",")
}

/// The curve through `COMMAND:ERPM,...`; the error says what is wrong with it.
pub(super) fn read_speeds(text: &str) -> Result<SpeedCurve, String> {
    let form = || format!("give {SPEEDS}, as 0.30:52000,0.40:65000,0.50:77000, or {NONE}");
    let point = |point: &str| {
        let (command, erpm) = point.split_once(':')?;
        Some((command.trim().parse().ok()?, erpm.trim().parse().ok()?))
    };
    let points: Vec<(f64, f64)> = text.split(',').map(point).collect::<Option<_>>().ok_or_else(form)?;
    speed_curve(&points)
}

/// The quadratic nearest to points of command and electrical revolutions per minute, by least squares; of two points the line. It reaches
/// from the lowest to the highest command.
///
/// # Errors
/// What is wrong with the points.
pub fn speed_curve(points: &[(f64, f64)]) -> Result<SpeedCurve, String> {
    let is_increasing = points.is_sorted_by(|(command, _), (next, _)| command < next);
    let (Some(&(from, low)), Some(&(to, high)), true) = (points.first(), points.last(), is_increasing) else {
        return Err("give points in increasing order of the command".to_owned());
    };
    let is_good = |(command, erpm): &(f64, f64)| (0.0..=1.0).contains(command) && erpm.is_finite();
    if points.len() < 2 || !points.iter().all(is_good) {
        return Err("give two points or more, commands from 0 to 1 and electrical revolutions per minute".to_owned());
    }
    let is_middle = |command: f64| (command - (from + to) / 2.0).abs() < STEP;
    let erpm = match *points {
        [_, _] => [low, (low + high) / 2.0, high],
        // As a controller has them: to the last bit.
        [_, (command, middle), _] if is_middle(command) => [low, middle, high],
        _ => quadratic(points, from, to),
    };
    let [from, to] = [from, to].map(Command::saturating_from_f64);
    Ok(SpeedCurve::new(from, to, erpm.map(|erpm| erpm.round() as u32)))
}

/// The least squares quadratic through three points or more, at `from`, in the middle and at `to`.
fn quadratic(points: &[(f64, f64)], from: f64, to: f64) -> [f64; 3] {
    // Orthogonal polynomials over the points by Gram and Schmidt: no system of equations.
    let place = |command: f64| (2.0 * command - from - to) / (to - from);
    let sum =
        |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|&(command, erpm)| of(place(command), erpm)).sum::<f64>();
    let count = points.len() as f64;
    let center = sum(&|x, _| x) / count;
    let line = |x: f64| x - center;
    let of_line = sum(&|x, _| line(x) * line(x));
    let slope_of_square = sum(&|x, _| x * x * line(x)) / of_line;
    let mean_of_square = sum(&|x, _| x * x) / count;
    let bend = |x: f64| x * x - slope_of_square * line(x) - mean_of_square;
    let of_bend = sum(&|x, _| bend(x) * bend(x));
    let weights = [
        sum(&|_, erpm| erpm) / count,
        sum(&|x, erpm| erpm * line(x)) / of_line,
        sum(&|x, erpm| erpm * bend(x)) / of_bend,
    ];
    [-1.0, 0.0, 1.0].map(|x| weights[0] + weights[1] * line(x) + weights[2] * bend(x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_gives_the_same_curve_back() {
        for text in
            ["0.3:52000,0.4:65000,0.5:77000", "0.15:1000,0.6:900001", "0.2:31234.5,0.31:45000,0.43:57000,0.6:70100"]
        {
            let curve = read_speeds(text).unwrap();
            let shown = speeds_text(&curve);
            assert_eq!(read_speeds(&shown).unwrap(), curve, "{shown}");
            assert_eq!(speeds_text(&read_speeds(&shown).unwrap()), shown);
        }
        assert_eq!(
            speeds_text(&read_speeds("0.3:52000,0.4:65000,0.5:77000").unwrap()),
            "0.3:52000,0.4:65000,0.5:77000"
        );
    }

    #[test]
    fn least_squares_find_the_quadratic_that_the_points_are_of() {
        let speed = |u: f64| 9_000.0 + 150_000.0 * u - 40_000.0 * u * u;
        let points: Vec<(f64, f64)> = [0.2, 0.25, 0.4, 0.55, 0.7].map(|u| (u, speed(u))).to_vec();
        for (found, u) in speed_curve(&points).unwrap().erpm().map(f64::from).into_iter().zip([0.2, 0.45, 0.7]) {
            assert!((found - speed(u)).abs() <= 0.5, "{found} at {u}");
        }
        // Alternating errors of 1 % at five points move it by less than that.
        let noisy: Vec<(f64, f64)> =
            points.iter().enumerate().map(|(i, &(u, erpm))| (u, erpm * if i % 2 == 0 { 1.01 } else { 0.99 })).collect();
        for (found, u) in speed_curve(&noisy).unwrap().erpm().map(f64::from).into_iter().zip([0.2, 0.45, 0.7]) {
            assert!((found / speed(u) - 1.0).abs() < 0.01, "{found} at {u}");
        }
    }

    #[test]
    fn points_that_make_no_curve_are_refused() {
        for text in [
            "",
            "0.3",
            "0.3:x,0.4:1",
            "0.3:50000",
            "0.4:50000,0.3:60000",
            "0.4:1,0.4:2",
            "0.4:1,1.4:2",
            "0.4:1,0.5:inf",
        ] {
            assert!(read_speeds(text).is_err(), "{text}");
        }
    }
}
