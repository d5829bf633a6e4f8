//! Extend: the model with the explanation in it.

use rotorlead_plant::effect::Site;
use rotorlead_plant::{ActiveEffect, Catalog, Lag, Model, Point};

use super::explanation::{Explanation, Scope};
use super::table::BandwidthTable;
use crate::DiagnoseError;

/// The model with `explanation`. Numbers of the lag change the points themselves: between the nominal commands of the table
/// by a factor whose logarithm is linear in the command, beyond them by that of the nearest; a nominal command between
/// points becomes a point. Any other effect becomes an `[[effect]]`.
///
/// # Errors
/// [`DiagnoseError::NotInAModel`] where the model has no form for it: a kind outside the catalog, or an effect of another size
/// at each nominal command.
pub(super) fn extended(
    model: &Model,
    table: &BandwidthTable,
    explanation: &Explanation,
) -> Result<Model, DiagnoseError> {
    let kind = explanation.kind;
    let mut extended = model.clone();
    // That was of the model as it was.
    extended.provenance.iter_mut().for_each(|provenance| provenance.judgement = None);
    if kind.site == Site::Base {
        rescale(&mut extended, table, explanation)?;
        return Ok(extended);
    }
    let refused = |reason| DiagnoseError::NotInAModel { explanation: explanation.name(), reason };
    if Catalog::standard().find(kind.id).is_none() {
        return Err(refused("it is not known which effect of the catalog makes it"));
    }
    if explanation.scope == Scope::Each {
        return Err(refused("an effect of a model has one size for all nominal commands"));
    }
    let values = explanation.values.iter().flatten().next().cloned().unwrap_or_else(|| kind.null());
    let std = kind.parameters.iter().map(|parameter| {
        let found = explanation.parameters.iter().find(|(calibrated, _)| calibrated.name == parameter.name);
        found.map_or(f64::NAN, |(_, estimate)| estimate.std)
    });
    let std: Vec<f64> = std.collect();
    extended.effects.push(ActiveEffect::new(kind, values)?.to_effect(&std));
    Ok(extended)
}

/// Other time constants; the gain has no part in a bandwidth.
fn rescale(model: &mut Model, table: &BandwidthTable, explanation: &Explanation) -> Result<(), DiagnoseError> {
    let kind = explanation.kind;
    let place = kind.parameters.iter().position(|parameter| parameter.name == "time_constant_error");
    let log_factor = |values: &Vec<f64>| place.map_or(0.0, |place| values[place].ln_1p());
    let known: Vec<(f64, f64)> = table
        .rows
        .iter()
        .zip(&explanation.values)
        .filter_map(|(row, values)| values.as_ref().map(|values| (row.nominal, log_factor(values))))
        .collect();
    for (nominal, _) in &known {
        let at = model.points.partition_point(|point| point.nominal < *nominal);
        if model.points.get(at).is_none_or(|point| point.nominal != *nominal) {
            let lag: Lag = model.at(*nominal)?;
            model.points.insert(at, Point::new(*nominal, lag));
        }
    }
    let relative_std = explanation.parameters.first().map(|(_, error)| error.std / (1.0 + error.value));
    for point in &mut model.points {
        point.time_constant_s *= interpolated(&known, point.nominal).exp();
        point.time_constant_s_std = relative_std.filter(|std| std.is_finite()).map(|std| std * point.time_constant_s);
        // These were measured with the old one.
        (point.time_constant_up_s, point.time_constant_down_s) = (None, None);
        (point.fit_frequency_percent, point.fit_square_percent, point.fit_step_percent) = (None, None, None);
    }
    Ok(())
}

/// Linear between the pairs, and constant beyond them.
fn interpolated(known: &[(f64, f64)], at: f64) -> f64 {
    let above = known.partition_point(|(x, _)| *x < at);
    match (above.checked_sub(1).map(|below| known[below]), known.get(above)) {
        (Some((x0, y0)), Some((x1, y1))) => y0 + (at - x0) / (x1 - x0) * (y1 - y0),
        (Some((_, y)), None) | (None, Some(&(_, y))) => y,
        (None, None) => 0.0,
    }
}
