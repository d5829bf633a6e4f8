//! `rotorlead identify`: its tables, for people and as JSON.

use rotorlead_identify::PeriodicIdentification;
use rotorlead_identify::steps::{Branch, StaircaseFit};
use rotorlead_plant::Point;
use rotorlead_records::{Excitation, Experiment, Output, Role};
use rotorlead_report::{unit, with_std};
use serde_json::{Value, json};

/// Which records the % fit is of.
pub(super) fn held_out(experiment: &Experiment, found: &PeriodicIdentification) -> String {
    let judged = |excitation: Excitation, role: Option<Role>| {
        let records = experiment.records.iter();
        records.filter(|record| record.excitation == excitation && (role.is_none() || record.role == role)).count()
    };
    let squares = judged(Excitation::Square, None);
    let multisines = judged(Excitation::Multisine, Some(Role::Validate));
    let (fitted, all) = (found.fitted_files().count(), experiment.records.len());
    let by_frequency =
        if multisines > 0 { "multisines with role = \"validate\"" } else { "the fitted records themselves" };
    let mut text = format!("  Fitted: {fitted} of {all} records. % fit, freq. is of {by_frequency}");
    if squares > 0 {
        text.push_str(";\n  that of squares is of records that are always held out");
    }
    text + ".\n"
}

/// What lags from chirps are fitted to.
pub(super) fn fitted_chirps(files: &[String]) -> String {
    format!("  Fitted by the local polynomial method: {}. % fit is of these records.\n", files.join(", "))
}

fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| String::from("-"), |value| format!("{value:.2}"))
}

/// Two decimals where there is room for them in six places.
fn in_six_places(value: f64) -> String {
    let decimals = if value < 99.995 {
        2
    } else if value < 9999.5 {
        1
    } else {
        0
    };
    if value < 999_999.5 { format!("{value:.decimals$}") } else { format!("{value:.0e}") }
}

/// The lag at each nominal command.
pub(super) fn periodic_table(output: Output, found: &PeriodicIdentification) -> String {
    let mut text = format!(
        "  u_nom {:>18} {:>15} {:>13} {:>7} {:>7} {:>6}\n  {:>70} {:>6}\n",
        format!("gain ({})", unit(output)),
        "tau (ms)",
        "delay (ms)",
        "% fit,",
        "% fit,",
        "chi2",
        "freq.  square",
        "/dof",
    );
    for (nominal, point) in found.nominals.iter().zip(found.points()) {
        let line = format!(
            "  {:<5.3} {:>18} {:>15} {:>13} {:>7} {:>7} {:>6}\n",
            point.nominal,
            with_std(point.gain, point.gain_std, 1.0, 4),
            with_std(point.time_constant_s, point.time_constant_s_std, 1e3, 2),
            point.delay_s_std.map_or_else(|| String::from("-"), |std| with_std(point.delay_s, Some(std), 1e3, 2)),
            percent(point.fit_frequency_percent),
            percent(point.fit_square_percent),
            in_six_places(nominal.fit.reduced_chi_square),
        );
        text.push_str(&line);
    }
    text.push_str("  tau is the time constant; +- is one standard error, of the noise alone.\n");
    text
}

/// The lag at each level, in both directions.
pub(super) fn staircase_table(fit: &StaircaseFit) -> String {
    let mut text = format!(
        "{}: % fit {:.1} of one lag toward one static map\n\
         ({:.1} with readings that were set aside)\n\
         delay {} ms as logged\n\n  level {:>14} {:>20} {:>7} {:>20} {:>7}\n",
        fit.record,
        fit.fit_percent,
        fit.fit_percent_with_spikes,
        with_std(fit.delay_s.value, Some(fit.delay_s.std), 1e3, 1),
        format!("gain ({})", unit(fit.output)),
        "tau up (ms)",
        "% fit",
        "tau down (ms)",
        "% fit",
    );
    for level in &fit.levels {
        let branch = |branch: &Option<Branch>| {
            let tau = branch.and_then(|branch| branch.time_constant_s);
            let fit = branch.and_then(|branch| branch.fit_percent);
            let tau = tau.map_or_else(|| String::from("-"), |tau| with_std(tau.value, Some(tau.std), 1e3, 1));
            (tau, fit.map_or_else(|| String::from("-"), |fit| format!("{fit:.1}")))
        };
        let ((up, up_fit), (down, down_fit)) = (branch(&level.up), branch(&level.down));
        let gain = level.gain.map_or_else(|| String::from("-"), |gain| format!("{:.0}", gain.value));
        let line = format!("  {:<5.3} {gain:>14} {up:>20} {up_fit:>7} {down:>20} {down_fit:>7}\n", level.command);
        text.push_str(&line);
    }
    text
}

/// The same with the levels.
pub(super) fn staircase_json(fit: &StaircaseFit) -> Value {
    let branch = |branch: &Option<Branch>| {
        branch.map(|branch| {
            json!({
                "response": branch.mean.value,
                "response_std": branch.mean.std,
                "time_constant_s": branch.time_constant_s.map(|tau| tau.value),
                "time_constant_s_std": branch.time_constant_s.map(|tau| tau.std),
                "fit_percent": branch.fit_percent,
            })
        })
    };
    json!({
        "record": fit.record,
        "delay_s": fit.delay_s.value,
        "delay_s_std": fit.delay_s.std,
        "fit_percent": fit.fit_percent,
        "fit_percent_with_spikes": fit.fit_percent_with_spikes,
        "levels": fit.levels.iter().map(|level| json!({
            "command": level.command,
            "gain": level.gain.map(|gain| gain.value),
            "up": branch(&level.up),
            "down": branch(&level.down),
        })).collect::<Vec<_>>(),
    })
}

/// One point with every key of the contract: what is not known is null, not absent.
pub(super) fn point_json(point: &Point) -> Value {
    json!({
        "nominal": point.nominal,
        "gain": point.gain,
        "gain_std": point.gain_std,
        "time_constant_s": point.time_constant_s,
        "time_constant_s_std": point.time_constant_s_std,
        "delay_s": point.delay_s,
        "delay_s_std": point.delay_s_std,
        "time_constant_up_s": point.time_constant_up_s,
        "time_constant_down_s": point.time_constant_down_s,
        "fit_frequency_percent": point.fit_frequency_percent,
        "fit_square_percent": point.fit_square_percent,
        "fit_step_percent": point.fit_step_percent,
    })
}

#[cfg(test)]
mod tests {
    use super::in_six_places;

    #[test]
    fn a_large_chi_square_stays_in_its_column() {
        for (value, shown) in [(1.05, "1.05"), (99.996, "100.0"), (162.52, "162.5"), (23456.7, "23457"), (2.6e7, "3e7")]
        {
            assert_eq!(in_six_places(value), shown);
        }
    }
}
