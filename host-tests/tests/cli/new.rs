//! A folder to begin with, and every command that it names.

use crate::stand::Stand;

/// The commands of the `sh` blocks of a page, block by block.
fn blocks(page: &str) -> Vec<Vec<&str>> {
    let blocks = page.split("```sh\n").skip(1);
    blocks.map(|block| block.split("```").next().unwrap().lines().collect()).collect()
}

#[test]
fn every_command_that_it_names_runs_and_the_check_is_clean() {
    let stand = Stand::new();
    let text = stand.run("new first");
    let readme = stand.read("first/README.md");
    let [rehearsal, excitation, on_stand] = &blocks(&readme)[..] else { panic!("{readme}") };
    let printed: Vec<_> = text.lines().filter_map(|line| line.trim().strip_prefix("rotorlead ")).collect();
    let in_page: Vec<_> = rehearsal.iter().map(|line| line.strip_prefix("rotorlead ").unwrap()).collect();
    assert_eq!(printed, in_page, "what is printed is not what the page says");
    let run = |line: &str| {
        let mut command = stand.command(line.strip_prefix("rotorlead ").unwrap());
        let output = command.current_dir(stand.path("first")).output().unwrap();
        let report = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "`{line}`: {report}");
        String::from_utf8(output.stdout).unwrap()
    };
    for line in rehearsal.iter().chain(excitation) {
        let text = run(line);
        if line.starts_with("rotorlead check") {
            assert_eq!(
                text,
                "rehearsal: 6 records; nothing is wrong with the records; `rotorlead identify`\n  judges the motor\n"
            );
        }
    }
    // Before anything is recorded, each record that is to come is named, in one finding that says what is next.
    let assert = stand.command("check first/stand").assert().code(1);
    let missing = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    for file in ["u040_multisine.csv", "u050_square.csv", "u060_multisine.csv"] {
        assert!(missing.contains(file), "{file} is not in\n{missing}");
    }
    assert!(missing.contains("nothing is recorded yet") && missing.contains("record each on the stand"), "{missing}");
    assert!(missing.ends_with("first/stand: 6 records; 1 error, 0 warnings\n"), "{missing}");
    // What the stand would record has the names of what the rehearsal did.
    for entry in std::fs::read_dir(stand.path("first/rehearsal")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "csv") {
            std::fs::copy(&path, stand.path("first/stand").join(path.file_name().unwrap())).unwrap();
        }
    }
    for line in on_stand {
        run(line);
    }
    assert!(stand.path("first/identification.html").exists());
}

#[test]
fn the_excitation_is_the_plans_first_and_within_its_range() {
    let stand = Stand::new();
    stand.run("new first");
    let text = stand.read("first/excitation.csv");
    let mut rows = text.lines();
    assert_eq!(rows.next(), Some("time_s,command"));
    let commands: Vec<f64> = rows.map(|row| row.split_once(',').unwrap().1.parse().unwrap()).collect();
    assert_eq!(commands.len(), 50_000, "10 s at 5 kHz");
    let (low, high) = commands.iter().fold((1.0_f64, 0.0_f64), |(low, high), &u| (low.min(u), high.max(u)));
    assert!((0.35..0.352).contains(&low) || (0.448..=0.4501).contains(&high), "{low} {high}");
    assert!(low >= 0.3499 && high <= 0.4501, "{low} {high}");
}

#[test]
fn a_folder_in_use_and_a_missing_one_above_are_refused() {
    let stand = Stand::new();
    stand.refuses("new stand", 1, &["`stand` exists and is not empty", "nothing is overwritten"]);
    stand.refuses("new no/such", 1, &["there is no folder `no`"]);
    stand.refuses("new model.toml", 1, &["`model.toml` is not a folder"]);
    stand.refuses("new .", 1, &["does not say what the folder is to be called"]);
    std::fs::create_dir(stand.path("empty")).unwrap();
    stand.run("new empty");
    assert!(stand.path("empty/plan.toml").exists());
}

#[test]
fn the_files_are_said_and_there() {
    let stand = Stand::new();
    let found = stand.json("new first");
    for file in found["files"].as_array().unwrap() {
        assert!(stand.path("first").join(file.as_str().unwrap()).is_file(), "{file} is missing");
    }
    assert_eq!(found["files"].as_array().unwrap().len(), 6);
    for part in ["propeller", "kill switch", "current limit", "guard", "Low throttle first"] {
        assert!(stand.read("first/CHECKLIST.md").contains(part), "no `{part}` in the checklist");
    }
}
