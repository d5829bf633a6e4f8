//! `rotorlead.bandwidth`

use miette::WrapErr as _;
use pyo3::prelude::*;
use rotorlead_answer::Report;
use rotorlead_design::{Chain, Latency, steps};
use rotorlead_records::files::{AcceptedRange, KeyPath};
use rotorlead_results::{
    BandwidthResult, Chosen, DesignRequest, Designed, MeasuredRecords, answer_page, deviations, version_fact,
};

use crate::argument::Given;
use crate::error::refused;
use crate::experiment::Records;
use crate::interrupt;
use crate::page::{Answered, answered};

/// The bandwidths of a model, and of records.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // They are options by name, as those of the command are.
pub fn bandwidth<'py>(
    py: Python<'py>,
    model: Given<'py>,
    compensator: Option<Given<'py>>,
    sampled: bool,
    esc_frame_hz: Option<f64>,
    step_sizes: Vec<f64>,
    robustness: bool,
    records: Vec<Records>,
) -> PyResult<Answered<'py>> {
    let (model, name) = model.model()?;
    let compensator = compensator.map(|given| given.compensator()).transpose()?;
    let check = |name: &str, range: AcceptedRange, value: f64| {
        let place = KeyPath::root().key(name);
        range.accept_given(value).map_err(|(message, help)| refused(&place.fault(message, help)))
    };
    esc_frame_hz.map_or(Ok(()), |rate| check("esc_frame_hz", AcceptedRange::ESC_FRAME_HZ, rate))?;
    step_sizes.iter().try_for_each(|size| check("steps", AcceptedRange::AMPLITUDE, *size))?;
    let (values, page) = interrupt::run(py, move || {
        let (design, findings) = match compensator {
            Some(design) => (design, Vec::new()),
            None => {
                let Chosen { options, findings, .. } = DesignRequest::default().chosen_or_lead(&model);
                let designed = Designed::design(&model, &options)
                    .map_err(miette::Report::from)
                    .wrap_err_with(|| format!("`{}` gives no compensator", name.display()))?;
                (designed.compensator(&model), findings)
            }
        };
        let identified = model.provenance.as_ref().and_then(|provenance| provenance.esc_frame_hz);
        let esc_frame_hz = esc_frame_hz.or(identified);
        let chain = if sampled { Chain::Sampled { design: &design, esc_frame_hz } } else { Chain::Designed(&design) };
        let mut found = BandwidthResult::predict(&model, chain, Latency::standard(design.loop_rate_hz()))?;
        found.findings.splice(0..0, findings);
        let not_simulated = || format!("`{}` cannot be simulated", name.display());
        if !step_sizes.is_empty() {
            found.steps = Some(steps(&model, &design, esc_frame_hz, &step_sizes).wrap_err_with(not_simulated)?);
        }
        if robustness {
            let other = deviations(&model, &design, esc_frame_hz, |_| || ()).wrap_err_with(not_simulated)?;
            found.robustness = Some(other);
        }
        for each in &records {
            let measured = MeasuredRecords::from_experiment(&each.read()?)
                .map_err(miette::Report::from)
                .wrap_err_with(|| format!("`{}`", each.name()))?;
            found.measured.get_or_insert_default().extend(measured);
        }
        let answer = found.answer(&model, chain);
        let title = format!("Bandwidths of {}", name.display());
        let page = Report { facts: vec![version_fact()], ..answer_page("Bandwidth", title, &answer) };
        Ok((answer.json(), page))
    })?;
    answered(py, &values, &page)
}
