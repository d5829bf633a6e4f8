//! `rotorlead.identify`

use std::path::PathBuf;

use miette::{WrapErr as _, miette};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_identify::identification::IdentifyOptions;
use rotorlead_identify::lag::first_order::FirstOrderOptions;
use rotorlead_records::Output;
use rotorlead_records::files::check_writable;
use rotorlead_results::{IdentifyResult, transform};

use crate::argument::{Given, one_of, read};
use crate::experiment::Records;
use crate::interrupt;
use crate::value::to_dict;

/// Finds the lag at each level from records.
///
/// `data` is the folder of an experiment, an experiment in memory as `simulate` gives it, or one record: a dict of columns and of
/// the keys of `experiment.toml`. `delay` says whether a dead time is part of the lag of multisine records: `auto`, `none` or
/// `fit`. `output` is the response, `thrust_n` or `rpm`; what the experiment says unless given. `out` is where the model
/// goes. The result has the keys of `rotorlead identify --json`, and `model`.
#[pyfunction]
#[pyo3(signature = (data, *, delay = "auto", output = None, out = None))]
pub fn identify<'py>(
    py: Python<'py>,
    data: Given<'py>,
    delay: &str,
    output: Option<&str>,
    out: Option<PathBuf>,
) -> PyResult<Bound<'py, PyDict>> {
    let delay_level =
        one_of("delay", delay, &[("auto", FirstOrderOptions::default().delay_level), ("none", 0.0), ("fit", 1.0)])?;
    let outputs = [Output::ThrustN, Output::Rpm].map(|output| (output.column(), output));
    let output = output.map(|output| one_of("output", output, &outputs)).transpose()?;
    out.as_deref().map_or(Ok(()), |out| read(check_writable(out)))?;
    let records = Records::of(&data, output)?;
    let (answer, model) = interrupt::run(py, move || {
        let nothing = format!("nothing was identified from `{}`", records.name());
        let checksum = records.checksum();
        let (mut experiment, long) = records.read_leaving_long()?;
        if let Some(output) = output {
            experiment.output = output;
            if let Some(record) = experiment.records.iter().find(|record| record.response(output).is_none()) {
                let column = output.column();
                let remedy = "leave `output` out, or give records that have this column";
                return Err(miette!(
                    help = remedy,
                    "`output` asks for `{column}`, and `{}` has no such column",
                    record.file
                ));
            }
        }
        let long = transform(&experiment, &long).map_err(miette::Report::from).wrap_err_with(|| nothing.clone())?;
        let options = IdentifyOptions { delay_level, stand: None, long: &long };
        let mut found =
            IdentifyResult::identify(&experiment, &options).map_err(miette::Report::from).wrap_err_with(|| nothing)?;
        let provenance = found.identification.model.provenance.iter_mut();
        provenance.for_each(|from| from.records_crc32.clone_from(&checksum));
        out.map_or(Ok(()), |out| found.identification.model.write(&out))?;
        Ok((found.answer(&experiment).json(), found.identification.model))
    })?;
    let dict = to_dict(py, &answer)?;
    dict.set_item("model", to_dict(py, &model)?)?;
    Ok(dict)
}
