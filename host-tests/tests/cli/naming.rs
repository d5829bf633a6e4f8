//! One thing has one name on every command, and the name that it had before is still taken.

use crate::stand::Stand;

#[test]
fn a_model_is_named_by_its_place_or_by_the_option_that_was_before() {
    let commands = [
        "design --kind lead --out c.toml",
        "bandwidth",
        "export --for paparazzi",
        "vehicle --airframe airframe.toml",
        "simulate --plan plan.toml --out sim",
    ];
    let stand = Stand::new();
    for command in commands {
        let (name, options) = command.split_once(' ').unwrap_or((command, ""));
        let printed = |model: &str| {
            let stand = Stand::new();
            stand.run(&format!("{name} {model} {options}"))
        };
        assert_eq!(printed("model.toml"), printed("--model model.toml"), "{name}");
        stand.refuses(
            &format!("{name} model.toml --model model.toml {options}"),
            2,
            &["MODEL", "--model", "cannot be"],
        );
        let help = stand.run(&format!("{name} --help"));
        assert!(help.contains("MODEL") && !help.contains("--model"), "{help}");
        // Without a model a vehicle has that of the paper.
        if name != "vehicle" {
            stand.refuses(command, 2, &["not provided", "<MODEL>"]);
        }
    }
}
