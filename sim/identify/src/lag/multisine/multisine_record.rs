//! A multisine record's spectrum as the fit takes it, and what there is to say of it.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rotorlead_records::{Experiment, Record};

use super::{IdentifyWarning, PeriodicOptions, plausibility};
use crate::error::IdentifyError;
use crate::frequency_response::hold::HoldChain;
use crate::goodness_of_fit::MODEL_LEVEL;
use crate::lag::first_order::{FirstOrderFit, FitLine};
use crate::lag::multisine::feedback::FeedbackTest;
use crate::rows::clipping;
use crate::rows::clipping::ClippingLimit;
use crate::spectra::{NoiseSource, Spectrum};

/// A multisine record on its way to a [`super::RecordResponse`].
pub(super) struct MultisineRecord<'a> {
    pub(super) record: &'a Record,
    pub(super) spectrum: Spectrum,
    /// The lines behind the holds.
    pub(super) lines: Vec<FitLine>,
    /// The compensator at each line, one without; `None` when it is unknown.
    pub(super) filter: Option<Vec<Complex64>>,
}

impl MultisineRecord<'_> {
    /// The lines behind holds and compensator; none when the compensator is unknown.
    pub(super) fn fit_lines(&self) -> impl Iterator<Item = FitLine> {
        let filter = self.filter.as_deref().unwrap_or_default();
        self.lines.iter().zip(filter).map(|(line, filter)| line.clone().behind(*filter))
    }
}

/// The lines of a record's spectrum as the fit takes them, and what there is to say of it.
pub(super) fn behind_holds<'a>(
    experiment: &Experiment,
    record: &'a Record,
    spectrum: Spectrum,
    options: &PeriodicOptions<'_>,
    warnings: &mut Vec<IdentifyWarning>,
) -> Result<MultisineRecord<'a>, IdentifyError> {
    let holds = hold_chain(experiment, spectrum.row_rate_hz)?;
    let file = || record.file.clone();
    if let Some(shorter) = repeats(&spectrum) {
        let period_s = spectrum.period_s;
        let repeats_s = period_s / f64::from(shorter);
        warnings.push(IdentifyWarning::PeriodTooLong { file: file(), period_s, repeats_s });
    }
    if spectrum.rows_left_out > 0 {
        warnings.push(IdentifyWarning::RowsLeftOut { file: file(), rows: spectrum.rows_left_out });
    }
    match spectrum.transient.p_value {
        None => warnings.push(IdentifyWarning::TransientUntested { file: file() }),
        Some(p_value) if spectrum.transient.is_present() => {
            warnings.push(IdentifyWarning::TransientDropped {
                file: file(),
                dropped: spectrum.transient.dropped,
                periods: spectrum.periods,
                p_value,
            });
            // A start is over within one period; of two or three no more can be dropped.
            if spectrum.transient.dropped > 1 && spectrum.transient.dropped == spectrum.periods / 2 {
                warnings.push(IdentifyWarning::Drifts { file: file() });
            }
        }
        Some(_) => {}
    }
    warnings.extend(spectrum.removed.iter().map(|sinusoid| IdentifyWarning::SinusoidRemoved {
        file: file(),
        frequency_hz: sinusoid.omega_rad_s / TAU,
        amplitude: sinusoid.amplitude,
    }));
    if let (Some(first), Some(last)) = (spectrum.disturbed.first(), spectrum.disturbed.last()) {
        warnings.push(IdentifyWarning::LinesDisturbed {
            file: file(),
            count: spectrum.disturbed.len(),
            first_hz: first.omega_rad_s / TAU,
            last_hz: last.omega_rad_s / TAU,
        });
    }
    if spectrum.noise == NoiseSource::UnexcitedLines {
        warnings.push(IdentifyWarning::NoiseFromUnexcitedLines { file: file() });
    }
    let filter = spectrum
        .lines
        .iter()
        .map(|line| {
            if !record.compensated {
                Some(Complex64::ONE)
            } else if let Some(esc_command) = line.esc_command {
                Some(esc_command / line.command)
            } else {
                options.compensator.map(|c| c(line.omega_rad_s))
            }
        })
        .collect::<Option<Vec<_>>>();
    if filter.is_none() {
        warnings.push(IdentifyWarning::CompensatorUnknown { file: file() });
    }
    let on_stand = |line: FitLine| match options.stand {
        Some(stand) => line.through(|omega_rad_s| stand.shape(omega_rad_s)),
        None => line,
    };
    let lines = spectrum.lines.iter().map(|line| on_stand(FitLine::new(line, &holds))).collect();
    Ok(MultisineRecord { record, spectrum, lines, filter })
}

/// How often the command repeats within what is stated as its period; `None` for once.
fn repeats(spectrum: &Spectrum) -> Option<u32> {
    let harmonics = spectrum.lines.iter().map(|line| line.harmonic);
    let all = harmonics.chain(spectrum.disturbed.iter().map(|line| line.harmonic));
    let common = all.fold(0, greatest_common_divisor);
    (common > 1).then_some(common)
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    let (mut a, mut b) = (a, b);
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// What makes a record unfit for a linear, open-loop model, and shows in its rows.
pub(super) fn suspicions(
    transformed: &MultisineRecord<'_>,
    experiment: &Experiment,
    fit: &FirstOrderFit,
) -> Vec<IdentifyWarning> {
    let MultisineRecord { record, spectrum, .. } = transformed;
    let file = || record.file.clone();
    let response = record.response(experiment.output).unwrap_or_default();
    let esc_command = record.esc_command.as_deref().unwrap_or_default();
    let limits = clipping::limits(response);
    let of_response = limits.iter().map(|limit| (experiment.output.column(), *limit));
    let of_command = clipping::limits(esc_command).into_iter().map(|limit| ("esc_command", limit));
    let mut found: Vec<IdentifyWarning> = of_response
        .chain(of_command)
        .map(|(column, ClippingLimit { at, rows })| IdentifyWarning::Saturated { file: file(), column, rows, at })
        .collect();
    // A record that stays on disk has no rows here.
    if !response.is_empty() {
        found.extend(plausibility::check_rows(record, response, &limits));
        found.extend(plausibility::other_nominal(record, spectrum));
    }
    let length = (spectrum.period_s * spectrum.row_rate_hz).round() as usize;
    let first = spectrum.rows_left_out + length * spectrum.transient.dropped;
    let command = if record.compensated { esc_command } else { &record.command };
    if let (Some(command), Some(response)) = (command.get(first..), response.get(first..))
        && let Some(test) = FeedbackTest::run(command, response, length, 1.0 / spectrum.row_rate_hz, &fit.lag())
        && test.p_value < MODEL_LEVEL
    {
        let FeedbackTest { scatter_percent, p_value } = test;
        found.push(IdentifyWarning::ClosedLoop { file: file(), scatter_percent, p_value });
    }
    found
}

fn hold_chain(experiment: &Experiment, row_rate_hz: f64) -> Result<HoldChain, IdentifyError> {
    HoldChain::new(row_rate_hz, experiment.command_rate_hz, experiment.esc_frame_hz)
}
