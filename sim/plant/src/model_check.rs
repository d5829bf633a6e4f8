//! The rules for a model's numbers, whether they come from a file or go to one.

use rotorlead_records::files::{Fault, KeyPath};

use super::{Catalog, Effect, MapPolynomial, Model, Point, Provenance, StaticMap, TimeConstantBand};

impl Model {
    /// Refuses numbers that no actuator has: see the errors.
    ///
    /// # Errors
    /// A fault that names the first number that breaks a rule. The model has one point or more, or a static map;
    /// nominal commands are in 0..1 and increase; gains are finite; time constants are above zero;
    /// delays and standard errors are not below zero; effects are in the [`Catalog`] with its parameters; a static map has as many responses as
    /// commands, two or more, the commands in 0..1 and increasing; rates are above zero.
    pub fn check(&self) -> Result<(), Fault> {
        let root = KeyPath::root();
        let points = root.key("point");
        if self.points.is_empty() && self.static_map.is_none() {
            return Err(self.no_point());
        }
        for (index, point) in self.points.iter().enumerate() {
            point.check(&points.item(index))?;
        }
        let nominals = self.points.iter().map(|point| point.nominal);
        increasing(nominals, |index| points.item(index).key("nominal"))?;
        if let Some(map) = &self.static_map {
            map.check(&root.key("static_map"))?;
        }
        if let Some(band) = &self.time_constant_curve {
            band.check(&root.key("time_constant_curve"))?;
        }
        for (index, effect) in self.effects.iter().enumerate() {
            let place = root.key("effect").item(index);
            effect.check(&place)?;
            Catalog::standard().resolve(effect, &place)?;
        }
        match &self.provenance {
            Some(provenance) => provenance.check(&root.key("provenance")),
            None => Ok(()),
        }
    }
}

impl Model {
    /// What is said of a model without a point.
    pub(super) fn no_point(&self) -> Fault {
        let (problem, remedy) = match self.static_map {
            Some(_) => (
                "the model has a static map alone and no point: nothing is known of its lag",
                "record a staircase and run `rotorlead identify` on it: it writes a [[point]] per level",
            ),
            None => (
                "the model has no point, so there is nothing to work with",
                "run `rotorlead identify` on an experiment: it writes a [[point]] per nominal command",
            ),
        };
        KeyPath::root().key("point").fault(problem, remedy)
    }
}

impl Point {
    fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        place.key("nominal").accept(self.nominal)?;
        place.key("gain").accept(self.gain)?;
        place.key("time_constant_s").accept(self.time_constant_s)?;
        place.key("delay_s").accept(self.delay_s)?;
        for (key, value) in
            [("time_constant_up_s", self.time_constant_up_s), ("time_constant_down_s", self.time_constant_down_s)]
        {
            value.map_or(Ok(()), |value| place.key(key).accept(value))?;
        }
        for (key, value) in [
            ("gain_std", self.gain_std),
            ("time_constant_s_std", self.time_constant_s_std),
            ("delay_s_std", self.delay_s_std),
        ] {
            value.map_or(Ok(()), |value| place.key(key).not_negative(value))?;
        }
        for (key, value) in [
            ("fit_frequency_percent", self.fit_frequency_percent),
            ("fit_square_percent", self.fit_square_percent),
            ("fit_step_percent", self.fit_step_percent),
        ] {
            value.map_or(Ok(()), |value| place.key(key).accept(value))?;
        }
        Ok(())
    }
}

impl TimeConstantBand {
    fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        let nominal = place.key("nominal");
        for (key, values) in
            [("time_constant_s", &self.time_constant_s), ("low_s", &self.low_s), ("high_s", &self.high_s)]
        {
            let place = place.key(key);
            if values.len() != self.nominal.len() {
                let (found, needed) = (values.len(), self.nominal.len());
                let problem = format!("there are {found} values for {needed} of `nominal`");
                return Err(place.fault(problem, "give one for each, or remove [time_constant_curve]"));
            }
            values.iter().enumerate().try_for_each(|(index, value)| place.item(index).accept(*value))?;
        }
        self.down_over_up.map_or(Ok(()), |ratio| place.key("down_over_up").accept(ratio))?;
        self.nominal.iter().enumerate().try_for_each(|(index, value)| nominal.item(index).accept(*value))?;
        increasing(self.nominal.iter().copied(), |index| nominal.item(index))
    }
}

impl StaticMap {
    fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        let (command, response) = (place.key("command"), place.key("response"));
        if self.command.len() < 2 {
            return Err(command
                .fault("a map has two commands at least", "add commands and their responses, or remove [static_map]"));
        }
        if self.command.len() != self.response.len() {
            return Err(response.fault(
                format!("{} responses for {} commands", self.response.len(), self.command.len()),
                "give one response per command",
            ));
        }
        for (index, value) in self.command.iter().enumerate() {
            command.item(index).accept(*value)?;
        }
        for (index, value) in self.response.iter().enumerate() {
            response.item(index).accept(*value)?;
        }
        increasing(self.command.iter().copied(), |index| command.item(index))?;
        self.polynomial.as_ref().map_or(Ok(()), |polynomial| polynomial.check(&place.key("polynomial")))
    }
}

impl MapPolynomial {
    fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        let (coefficients, stds) = (place.key("coefficients"), place.key("coefficients_std"));
        if self.coefficients_std.len() != self.coefficients.len() {
            return Err(stds.fault(
                format!("{} standard errors for {} coefficients", self.coefficients_std.len(), self.coefficients.len()),
                "give one standard error per coefficient",
            ));
        }
        for (index, value) in self.coefficients.iter().enumerate() {
            coefficients.item(index).accept(*value)?;
        }
        for (index, value) in self.coefficients_std.iter().enumerate() {
            stds.item(index).not_negative(*value)?;
        }
        for (index, value) in self.range.iter().enumerate() {
            place.key("range").item(index).accept(*value)?;
        }
        for (key, value) in [("dead_zone", self.dead_zone), ("hysteresis", self.hysteresis), ("limit", self.limit)] {
            value.map_or(Ok(()), |value| place.key(key).accept(value))?;
        }
        for (key, value) in [
            ("dead_zone_std", self.dead_zone_std),
            ("hysteresis_std", self.hysteresis_std),
            ("limit_std", self.limit_std),
        ] {
            value.map_or(Ok(()), |value| place.key(key).not_negative(value))?;
        }
        Ok(())
    }
}

impl Effect {
    fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        for (name, value) in &self.parameters {
            place.key("parameters").key(name).accept_any(*value)?;
        }
        for (name, value) in &self.std {
            let place = place.key("std").key(name);
            if !self.parameters.contains_key(name) {
                return Err(place.fault(
                    "a standard error of a parameter that the effect has not got",
                    "correct the name, or add the parameter",
                ));
            }
            place.not_negative(*value)?;
        }
        Ok(())
    }
}

impl Provenance {
    fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        for (key, rate) in [("command_rate_hz", self.command_rate_hz), ("esc_frame_hz", self.esc_frame_hz)] {
            rate.map_or(Ok(()), |rate| place.key(key).accept(rate))?;
        }
        Ok(())
    }
}

fn increasing(values: impl Iterator<Item = f64>, place: impl Fn(usize) -> KeyPath) -> Result<(), Fault> {
    let mut before: Option<f64> = None;
    for (index, value) in values.enumerate() {
        match before {
            Some(before) if value == before => {
                return Err(place(index).fault(format!("duplicate value {value}"), "remove one of the two"));
            }
            Some(before) if value < before => {
                return Err(place(index).fault(format!("{value} comes after {before}"), "put them in increasing order"));
            }
            _ => before = Some(value),
        }
    }
    Ok(())
}
