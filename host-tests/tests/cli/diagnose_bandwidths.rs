//! `rotorlead diagnose --bandwidths`: the paper's own gap, and what is no table of bandwidths.

use serde_json::Value;

use crate::stand::Stand;

/// The measured columns of Table 3 of Charla, Yao & Voyles.
const TABLE_3: &str = "\
u_nom,uncompensated_rad_s,compensated_rad_s
0.40,7.6139,10.5564
0.45,9.0941,33.5233
0.50,11.7689,68.9652
0.55,14.4992,72.9550
0.60,15.1641,85.8608
0.65,14.7953,97.1847
";

const DIAGNOSE: &str = "diagnose --bandwidths table.csv --model paper.toml";

/// A stand with the table, and the paper's Table 1 as `paper.toml`.
fn with_table() -> Stand {
    let stand = Stand::new();
    let mut model = String::from("format = 1\n");
    for (nominal, gain, pole_rad_s) in host_tests::TABLE_1 {
        let tau_s = 1.0 / pole_rad_s;
        model.push_str(&format!("[[point]]\nnominal = {nominal}\ngain = {gain}\ntime_constant_s = {tau_s}\n"));
    }
    stand.write("paper.toml", model);
    stand.write("table.csv", TABLE_3);
    stand
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn the_gap_of_the_papers_table_shrinks_on_the_column_that_was_held_out() {
    let stand = with_table();
    stand.run("design --kind lead --model paper.toml --out c.toml");
    let found = stand.json(&format!("{DIAGNOSE} --compensator c.toml --out-model improved.toml"));
    assert_eq!(found["verdict"], "partly_named");
    assert_eq!(
        (&found["held_out"], &found["fitted_column"]),
        (&Value::from(true), &Value::from("uncompensated_rad_s"))
    );
    assert!((number(&found["gap"]["before"]) - 0.679).abs() < 5e-4, "{}", found["gap"]);
    assert!(number(&found["gap"]["after"]) <= 0.31, "{}", found["gap"]);
    let effect = &found["effects"][0];
    assert_eq!(effect["kind"], "parameter_error");
    assert!(effect["alternatives"].as_array().unwrap().contains(&Value::from("low_frequency_gain")), "{effect}");
    assert!(number(&effect["parameters"]["time_constant_error"]["value"]) < 0.0);
    for axis in ["nominal", "compensator"] {
        let parts = found["where"].as_array().unwrap().iter().filter(|part| part["axis"] == axis);
        assert!((parts.map(|part| number(&part["share"])).sum::<f64>() - 1.0).abs() < 1e-9);
    }
    assert!(found["next_experiment"].as_str().unwrap().contains("multisine"));

    // The improved model is a model: with the same compensator it has the bandwidths that were predicted.
    let points = stand.json("bandwidth --model improved.toml --compensator c.toml")["points"].clone();
    let chosen = found["explanations"].as_array().unwrap().iter().find(|one| one["standing"] == "chosen").unwrap();
    let mut sum = 0.0;
    for ((point, predicted), row) in
        points.as_array().unwrap().iter().zip(chosen["points"].as_array().unwrap()).zip(TABLE_3.lines().skip(1))
    {
        for column in ["uncompensated_rad_s", "compensated_rad_s"] {
            assert!((number(&point[column]) / number(&predicted[column]) - 1.0).abs() < 1e-9, "{point} {predicted}");
        }
        let measured: f64 = row.rsplit(',').next().unwrap().parse().unwrap();
        sum += (measured / number(&point["compensated_rad_s"])).ln().powi(2);
    }
    assert!(((sum / 6.0).sqrt() - number(&found["gap"]["after"])).abs() < 1e-9);
    stand.run("design --kind lead --model improved.toml --out c2.toml");
    stand.run("simulate --model improved.toml --plan plan.toml --out sim");
}

#[test]
fn every_explanation_that_can_be_written_is_and_the_others_are_refused() {
    let stand = with_table();
    stand.run(&format!("{DIAGNOSE} --take supply_sag --out-model sag.toml"));
    assert!(stand.read("sag.toml").contains("supply_sag"));
    stand.run("bandwidth --model sag.toml");
    for (name, parts) in [
        ("supply_sag_at_each", ["`supply_sag_at_each` cannot be written as a model", "one size", "--take"]),
        (
            "low_frequency_gain",
            ["`low_frequency_gain` cannot be written", "which effect of the catalog", "--out-model"],
        ),
        ("backlash", ["no explanation of these bandwidths is called `backlash`", "`parameter_error`", "there are"]),
        (
            "suply_sag",
            ["no explanation of these bandwidths is called `suply_sag`", "did you mean `supply_sag`?", "there are"],
        ),
    ] {
        stand.refuses(&format!("{DIAGNOSE} --take {name} --out-model out.toml"), 1, &parts);
    }
}

#[test]
fn what_is_no_table_of_bandwidths_is_shown_at_its_place() {
    for (from, to, parts) in [
        ("u_nom,", "nominal,", &["table.csv:1:1", "column `nominal` is not known", "u_nom"][..]),
        ("u_nom,", "u_nm,", &["table.csv:1:1", "did you mean `u_nom`?"]),
        (",compensated_rad_s\n", "\n", &["table.csv:1:1", "column `compensated_rad_s` is missing", "left empty"]),
        (",compensated_rad_s\n", ",u_nom\n", &["table.csv:1:27", "duplicate column `u_nom`", "remove one"]),
        ("u_nom,uncompensated_rad_s,compensated_rad_s\n", "", &["table.csv:1:1", "begin the file with a header line"]),
        ("7.6139", "fast", &["table.csv:2:6", "line 2", "`fast` is not a number", "plain number"]),
        ("7.6139", "0", &["table.csv:2:6", "`0` is no bandwidth", "above 0"]),
        ("7.6139", "-7.6", &["table.csv:2:6", "`-7.6` is no bandwidth", "leave the cell empty"]),
        ("7.6139", "NaN", &["table.csv:2:6", "`NaN` is no bandwidth"]),
        ("7.6139", "inf", &["table.csv:2:6", "`inf` is no bandwidth"]),
        ("7.6139,10.5564", ",", &["table.csv:2:1", "no bandwidth at a u_nom of 0.4", "remove the row"]),
        ("0.40,7", ",7", &["table.csv:2:1", "column `u_nom`: the cell is empty"]),
        ("0.40", "40", &["table.csv:2:1", "`40` is not a command from 0 to 1"]),
        ("0.40", "0.30", &["table.csv:2:1", "nominal command of 0.3", "from 0.4 to 0.65", "identify the motor"]),
        ("0.40", "0.45", &["table.csv:3:1", "duplicate u_nom 0.45", "one row per nominal"]),
        ("0.40,7.6139,10.5564", "0.40,7.6139", &["table.csv:2:1", "2 cells, but the header has 3"]),
    ] {
        let stand = with_table();
        stand.edit("table.csv", from, to);
        stand.refuses(DIAGNOSE, 1, parts);
    }
    let stand = with_table();
    stand.write("table.csv", TABLE_3.lines().take(2).collect::<Vec<_>>().join("\n"));
    stand.refuses(DIAGNOSE, 1, &["table.csv:2:1", "too few rows of numbers: 1", "record a multisine"]);
    stand.write("table.csv", "u_nom,uncompensated_rad_s,compensated_rad_s\n0.4,,10\n0.5,12,60\n0.6,,80\n");
    stand.refuses(DIAGNOSE, 1, &["`uncompensated_rad_s` is to be fitted", "too few values: 1", "--fit compensated"]);
    stand.run(&format!("{DIAGNOSE} --fit compensated"));
    stand.refuses("diagnose --bandwidths nowhere.csv --model paper.toml", 1, &["`nowhere.csv` does not exist"]);
    stand.refuses("diagnose --bandwidths table.csv --model nowhere.toml", 1, &["`nowhere.toml` does not exist"]);
}

#[test]
fn options_that_do_not_go_together_are_wrong_use() {
    let stand = with_table();
    for (arguments, parts) in [
        ("diagnose", &["rotorlead diagnose DIR", "--bandwidths TABLE --model MODEL"][..]),
        ("diagnose --bandwidths table.csv", &["--model"]),
        ("diagnose stand --bandwidths table.csv --model paper.toml", &["cannot be used with", "--bandwidths"]),
        ("diagnose stand --compensator c.toml", &["cannot be used with", "--compensator"]),
        ("diagnose stand --take parameter_error", &["cannot be used with", "--take"]),
        ("diagnose --bandwidths table.csv --model paper.toml --accuracy 0", &["--accuracy", "above 0"]),
        ("diagnose --bandwidths table.csv --model paper.toml --fit both", &["--fit", "uncompensated"]),
    ] {
        stand.refuses(arguments, 2, parts);
    }
}
