//! What the program prints where no command is given: how to start.

/// Commands to start with, in this order, and what each does.
pub(super) const COMMANDS: [(&str, &str); 3] = [
    ("rotorlead sample staircase.csv", "write a log of a simulated thrust stand"),
    ("rotorlead report staircase.csv --open", "read it, or a log of your own"),
    ("rotorlead demo --open", "see the method work; all else: --help"),
];

/// A line for each.
pub(super) fn text() -> String {
    let width = COMMANDS.iter().map(|(command, _)| command.len()).max().unwrap_or_default();
    COMMANDS.iter().map(|(command, purpose)| format!("{command:<width$}  {purpose}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::super::command_line;
    use super::*;

    #[test]
    fn every_line_is_a_command_that_is_taken_and_fits_a_terminal() {
        for ((command, _), line) in COMMANDS.iter().zip(text().lines()) {
            command_line().try_get_matches_from(command.split(' ')).unwrap_or_else(|error| panic!("{error}"));
            assert!(line.starts_with(command) && line.chars().count() <= 80, "{line}");
        }
        assert_eq!(text().lines().count(), COMMANDS.len());
    }
}
