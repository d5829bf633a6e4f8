//! The name that a wrong one was meant to be.

/// How alike (Jaro-Winkler, 0 to 1) a known name must be to a wrong one to be offered instead of it.
const ALIKE: f64 = 0.8;

/// The known name that is most like a wrong one, if any is.
pub(super) fn alike<'a>(wrong: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let best = known.map(|known| (strsim::jaro_winkler(wrong, known), known)).max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(alike, _)| *alike >= ALIKE).map(|(_, known)| known)
}

/// The question after the known name that is most like a wrong one, if any is.
pub fn did_you_mean<'a>(wrong: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    alike(wrong, known).map(|known| format!("did you mean `{known}`?"))
}
