//! Motors side by side: two are compared, and three or more are a fleet.

use rotorlead_answer::Answer;
use rotorlead_assess::compare as compare_two;
use rotorlead_assess::fleet::{FleetMember, FleetParameter, compare as compare_all};
use rotorlead_plant::Model;
use rotorlead_records::files::TextFile;
use rotorlead_results::{FleetRow, Subject, comparison_answer, fleet_answer};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::fault::Fault;
use crate::page::{section, verdict};

/// A motor with the text of its model.
#[derive(Deserialize)]
struct Member {
    motor: String,
    model: String,
}

/// What differs between motors.
pub fn compare(motors: &str) -> Result<Value, Fault> {
    let members: Vec<Member> = serde_json::from_str(motors)
        .map_err(|error| Fault::new(format!("no list of motors: {error}"), "load the page again"))?;
    let models = members
        .iter()
        .map(|member| Model::parse_with_map_alone(TextFile::in_memory(&member.motor, member.model.clone())))
        .collect::<Result<Vec<_>, _>>()?;
    let named: Vec<(&str, &Model)> = members.iter().map(|member| &*member.motor).zip(&models).collect();
    let answer = match named[..] {
        [(name_a, a), (name_b, b)] => {
            let compared = compare_two(a, b).map_err(miette::Report::from)?;
            comparison_answer(&Subject { name: name_a, model: a }, &Subject { name: name_b, model: b }, &compared)
        }
        _ => fleet(&named)?,
    };
    Ok(json!({
        "verdict": verdict(&answer.verdict)?,
        "section": section(&answer.section())?,
        "values": answer.json(),
    }))
}

fn fleet(motors: &[(&str, &Model)]) -> Result<Answer, Fault> {
    let outputs = || motors.iter().filter_map(|(_, model)| Some(model.provenance.as_ref()?.output));
    let output = outputs().next();
    if outputs().any(|other| Some(other) != output) {
        let message =
            "the response of some of the motors is thrust, and that of others speed: their gains cannot be compared";
        return Err(Fault::new(message, "compare those of one response"));
    }
    let row = |(motor, _): &(&str, &Model)| FleetRow {
        log: (*motor).to_owned(),
        motor: (*motor).to_owned(),
        date: String::new(),
        note: String::new(),
        esc_ramp: None,
    };
    let members: Vec<FleetMember> =
        motors.iter().map(|(motor, model)| FleetMember::new((*motor).to_owned(), None, model)).collect();
    let by = |quantity| {
        compare_all(&members, quantity)
            .map_err(|error| Fault::new(error.to_string(), "give further motors that share commands"))
    };
    let rows: Vec<FleetRow> = motors.iter().map(row).collect();
    Ok(fleet_answer(&rows, &by(FleetParameter::TimeConstant)?, &by(FleetParameter::Gain)?, output))
}
