//! The figures of many scored cases, against what is required.

use std::collections::BTreeMap;

use super::case::Class;
use super::score::{Interval, Scored};

/// So many of so many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Share {
    /// How many have it.
    pub hits: usize,
    /// Of how many.
    pub of: usize,
}

impl Share {
    /// Counts.
    pub fn count(hits: impl IntoIterator<Item = bool>) -> Self {
        hits.into_iter()
            .fold(Self::default(), |share, hit| Self { hits: share.hits + usize::from(hit), of: share.of + 1 })
    }

    /// The part, 0..1; `None` of none.
    #[must_use]
    pub fn part(self) -> Option<f64> {
        (self.of > 0).then(|| self.hits as f64 / self.of as f64)
    }

    /// Wilson's interval of 95 %: between what parts the true one lies. The whole range of none.
    #[must_use]
    pub fn interval(self) -> (f64, f64) {
        let Some(part) = self.part() else { return (0.0, 1.0) };
        let (n, z) = (self.of as f64, 1.96);
        let middle = part + z * z / (2.0 * n);
        let half = z * (part * (1.0 - part) / n + z * z / (4.0 * n * n)).sqrt();
        let scale = 1.0 + z * z / n;
        (((middle - half) / scale).max(0.0), ((middle + half) / scale).min(1.0))
    }
}

impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (low, high) = self.interval();
        match self.part() {
            None => write!(f, "none"),
            Some(part) => write!(
                f,
                "{}/{} = {:.0} % ({:.0} to {:.0})",
                self.hits,
                self.of,
                100.0 * part,
                100.0 * low,
                100.0 * high
            ),
        }
    }
}

/// What so many cases say of what is required.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgment {
    /// The part that was counted is as required.
    Holds,
    /// It is not, but so few cases do not exclude that the true one is.
    Open,
    /// Wilson's interval excludes what is required.
    Missed,
}

impl std::fmt::Display for Judgment {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Holds => "yes",
            Self::Open => "not excluded",
            Self::Missed => "no",
        })
    }
}

/// One figure and what it has to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What is counted.
    pub what: &'static str,
    /// The count.
    pub share: Share,
    /// Lowest and highest part that is required, where one is.
    pub required: Option<(f64, f64)>,
}

impl Figure {
    /// Whether it is as required; a figure of no case is not judged.
    #[must_use]
    pub fn judgment(&self) -> Option<Judgment> {
        let ((low, high), part) = (self.required?, self.share.part()?);
        let interval = self.share.interval();
        Some(match (low..=high).contains(&part) {
            true => Judgment::Holds,
            false if interval.0 > high || interval.1 < low => Judgment::Missed,
            false => Judgment::Open,
        })
    }
}

/// All figures, in the order of the report.
#[must_use]
pub fn figures(cases: &[Scored]) -> Vec<Figure> {
    let single = |case: &&Scored| case.truth.single().is_some();
    let visible: Vec<&Scored> = cases.iter().filter(single).filter(|case| !case.truth.is_invisible()).collect();
    let invisible: Vec<&Scored> = cases.iter().filter(single).filter(|case| case.truth.is_invisible()).collect();
    let (identifiable, others): (Vec<&Scored>, Vec<&Scored>) =
        visible.iter().copied().partition(|case| case.truth.is_identifiable() != Some(false));
    let of = |class: Class| cases.iter().filter(move |case| case.truth.class == class.name());
    let shown = |class| of(class).filter(|case| !case.truth.is_invisible()).collect();
    let (pairs, triples): (Vec<&Scored>, Vec<&Scored>) = (shown(Class::Pair), shown(Class::Triple));
    let (pairs_identifiable, pairs_others): (Vec<&Scored>, Vec<&Scored>) =
        pairs.iter().copied().partition(|case| case.truth.is_identifiable() != Some(false));
    let least = |low: f64| Some((low, 1.0));
    let figure = |what, share, required| Figure { what, share, required };
    vec![
        figure(
            "singles that can be identified: the first name is right",
            Share::count(identifiable.iter().map(|case| case.first_is_right())),
            least(0.97),
        ),
        figure(
            "singles that cannot: the truth is the first name or an alternative",
            Share::count(others.iter().map(|case| case.first_or_alternative())),
            least(1.0),
        ),
        figure(
            "singles that cannot: the same, or listed as weak evidence",
            Share::count(others.iter().filter_map(|case| case.first_alternative_or_evidence())),
            None,
        ),
        figure(
            "singles that cannot: a wrong name",
            Share::count(others.iter().map(|case| case.has_wrong_name())),
            None,
        ),
        figure("nothing hidden: no name", Share::count(of(Class::Empty).map(Scored::names_nothing)), least(1.0)),
        figure(
            "nothing hidden: weak evidence is listed",
            Share::count(of(Class::Empty).filter_map(|case| Some(!case.weak_evidence()?.is_empty()))),
            None,
        ),
        figure(
            "outside the catalog: unknown, or partly named without a wrong name",
            Share::count(of(Class::Outside).map(Scored::admits)),
            least(0.95),
        ),
        figure(
            "a law a little other than the catalog's: the first name is right",
            Share::count(of(Class::Perturbed).map(Scored::first_is_right)),
            least(0.88),
        ),
        figure(
            "a law a little other than the catalog's: another's name, in its place or beside it",
            Share::count(of(Class::Perturbed).map(Scored::has_wrong_name)),
            Some((0.0, 0.03)),
        ),
        figure(
            "nuisances of the stand alone: no name, of those that are not refused",
            Share::count(of(Class::Nuisance).filter(|case| case.answer.is_ok()).map(Scored::names_nothing)),
            least(1.0),
        ),
        figure(
            "one effect in nuisances of the stand: the first name is right",
            Share::count(of(Class::SingleInNuisance).map(Scored::first_is_right)),
            None,
        ),
        figure(
            "one effect in nuisances of the stand: another's name, in its place or beside it",
            Share::count(of(Class::SingleInNuisance).map(Scored::has_wrong_name)),
            None,
        ),
        figure("pairs that show: both names", Share::count(pairs.iter().map(|case| case.all_named())), None),
        figure(
            "of these, can be identified: both names",
            Share::count(pairs_identifiable.iter().map(|case| case.all_named())),
            least(0.88),
        ),
        figure(
            "of these, cannot: each of the two is a name or an alternative",
            Share::count(pairs_others.iter().map(|case| case.all_named_or_alternatives())),
            None,
        ),
        figure("pairs that show: another's name", Share::count(pairs.iter().map(|case| case.has_wrong_name())), None),
        figure(
            "three effects that show: all three names",
            Share::count(triples.iter().map(|case| case.all_named())),
            None,
        ),
        figure(
            "three effects that show: another's name",
            Share::count(triples.iter().map(|case| case.has_wrong_name())),
            None,
        ),
        figure(
            "parameters within 1.96 standard deviations",
            Share::count(intervals(cases).iter().map(Interval::holds)),
            Some((0.92, 0.98)),
        ),
        figure(
            "parameters whose count is rejected, for 95 %, by a two-sided binomial test at 1 %",
            Share::count(by_parameter(cases).values().map(|parameter| parameter.p_value() < 0.01)),
            Some((0.0, 0.0)),
        ),
        figure(
            "singles that show: the gap left is at most 1.1 of the noise floor",
            Share::count(visible.iter().map(|case| case.gap_is_closed())),
            least(0.9),
        ),
        figure(
            "all cases: a wrong name, in the first place or beside a right one",
            Share::count(cases.iter().map(Scored::has_wrong_name)),
            Some((0.0, 0.01)),
        ),
        figure(
            "all cases: agrees, though a kind that was tried scores enough for a name and is not said to be minor",
            Share::count(cases.iter().map(Scored::agrees_against_evidence)),
            Some((0.0, 0.0)),
        ),
        figure("singles that show: a wrong name", Share::count(visible.iter().map(|case| case.has_wrong_name())), None),
        figure("singles that show: no name", Share::count(visible.iter().map(|case| case.names_nothing())), None),
        figure(
            "singles that do not show: a wrong name",
            Share::count(invisible.iter().map(|case| case.has_wrong_name())),
            None,
        ),
        figure("answers that cannot be read", Share::count(cases.iter().map(|case| case.answer.is_err())), None),
    ]
}

/// What can be reached: how often the generator's own likelihood does what is asked for.
#[must_use]
pub fn ceilings(cases: &[Scored]) -> Vec<Figure> {
    let singles: Vec<_> = cases
        .iter()
        .filter(|case| case.truth.single().is_some())
        .filter_map(|case| case.truth.ceiling.as_ref())
        .collect();
    let shows: Vec<_> = singles.iter().filter(|ceiling| ceiling.is_visible()).collect();
    let others: Vec<_> = shows.iter().filter(|ceiling| !ceiling.is_identifiable()).collect();
    let pairs: Vec<_> = cases.iter().filter(|case| case.truth.class == Class::Pair.name()).collect();
    let both: Vec<_> =
        pairs.iter().filter(|case| !case.truth.is_invisible()).filter_map(|case| case.truth.ceiling.as_ref()).collect();
    let figure = |what, share| Figure { what, share, required: None };
    vec![
        figure("singles that show at all", Share::count(singles.iter().map(|ceiling| ceiling.is_visible()))),
        figure(
            "of these, can be distinguished from every rival",
            Share::count(shows.iter().map(|ceiling| ceiling.is_identifiable())),
        ),
        figure(
            "of these, the likelihood prefers the truth",
            Share::count(shows.iter().map(|ceiling| ceiling.prefers_truth())),
        ),
        figure(
            "of those that cannot be identified, the likelihood prefers the truth",
            Share::count(others.iter().map(|ceiling| ceiling.prefers_truth())),
        ),
        figure(
            "of those that cannot be identified, better than nothing by 10",
            Share::count(others.iter().map(|ceiling| ceiling.nothing <= -10.0)),
        ),
        figure("pairs of which both show", Share::count(pairs.iter().map(|case| !case.truth.is_invisible()))),
        figure(
            "of these, can be distinguished from each of the two beside any other kind",
            Share::count(both.iter().map(|ceiling| ceiling.is_identifiable())),
        ),
        figure(
            "of these, the likelihood prefers the truth",
            Share::count(both.iter().map(|ceiling| ceiling.prefers_truth())),
        ),
    ]
}

/// The intervals of effects that show and follow the law of the catalog: one that is bent has no such parameter.
#[must_use]
pub fn intervals(cases: &[Scored]) -> Vec<Interval> {
    let follows = |case: &&Scored| case.truth.class != Class::Perturbed.name() && !case.truth.is_invisible();
    cases.iter().filter(follows).flat_map(Scored::intervals).collect()
}

/// The intervals of one parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parameter {
    /// How many hold.
    pub share: Share,
    /// Mean distance from the truth, in standard deviations.
    pub mean_off: f64,
}

impl Parameter {
    /// Probability of a count as unlikely as this one, or more so, where intervals hold in 95 of 100 (exact, two-sided).
    #[must_use]
    pub fn p_value(self) -> f64 {
        let (n, holds) = (self.share.of, 0.95_f64);
        let mut of_count = vec![(1.0 - holds).powi(n as i32)];
        for k in 1..=n {
            of_count.push(of_count[k - 1] * (n - k + 1) as f64 / k as f64 * holds / (1.0 - holds));
        }
        let own = of_count[self.share.hits] * (1.0 + 1e-9);
        of_count.into_iter().filter(|likely| *likely <= own).sum()
    }
}

/// The same by kind and parameter.
#[must_use]
pub fn by_parameter(cases: &[Scored]) -> BTreeMap<(String, String), Parameter> {
    let mut all: BTreeMap<(String, String), Parameter> = BTreeMap::new();
    for interval in intervals(cases) {
        let one = all.entry((interval.kind.clone(), interval.parameter.clone())).or_default();
        one.share.hits += usize::from(interval.holds());
        one.share.of += 1;
        one.mean_off += (interval.off - one.mean_off) / one.share.of as f64;
    }
    all
}

/// How many cases of each class that hides one effect at most got each first name.
#[must_use]
pub fn confusion(cases: &[Scored]) -> BTreeMap<(String, String), usize> {
    let mut counts = BTreeMap::new();
    for case in cases.iter().filter(|case| case.truth.effects.len() <= 1 && !case.truth.is_invisible()) {
        *counts.entry((case.truth.class.clone(), case.first().to_owned())).or_insert(0) += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::super::diagnosis::tests::naming;
    use super::super::kind::Kind;
    use super::super::score::tests::scored;
    use super::*;

    fn figure(cases: &[Scored], start: &str) -> Figure {
        figures(cases).into_iter().find(|figure| figure.what.starts_with(start)).unwrap()
    }

    #[test]
    fn wilsons_interval_is_the_textbooks() {
        // Brown, Cai and DasGupta (2001), for 0 and 10 of 10: 1 / (1 + z^2 / n).
        let (low, high) = Share { hits: 10, of: 10 }.interval();
        assert!((low - 10.0 / (10.0 + 1.96 * 1.96)).abs() < 1e-12 && high == 1.0);
        let (low, high) = Share { hits: 95, of: 100 }.interval();
        assert!((low - 0.8882).abs() < 1e-3 && (high - 0.9785).abs() < 1e-3);
        assert_eq!(Share::default().interval(), (0.0, 1.0));
    }

    #[test]
    fn cases_count_where_they_belong() {
        let delay = [Kind::TransportDelay];
        let right = naming("named", &[(Kind::TransportDelay, &[])]);
        let alternative = naming("named", &[(Kind::EscFrameHold, &["transport_delay"])]);
        let wrong = naming("named", &[(Kind::EscFrameHold, &[])]);
        let cases = [
            scored("transport_delay", &delay, -100.0, -50.0, &right),
            scored("transport_delay", &delay, -100.0, -50.0, &alternative),
            scored("transport_delay", &delay, -100.0, -1.0, &alternative),
            scored("transport_delay", &delay, -1.0, -1.0, &wrong),
            scored("nothing", &[], 0.0, 0.0, &naming("agrees", &[])),
            scored("outside", &[], 0.0, 0.0, &wrong),
        ];
        assert_eq!(figure(&cases, "singles that can be identified").share, Share { hits: 1, of: 2 });
        assert_eq!(figure(&cases, "singles that cannot").share, Share { hits: 1, of: 1 });
        assert_eq!(figure(&cases, "nothing hidden").judgment(), Some(Judgment::Holds));
        assert_eq!(figure(&cases, "outside").judgment(), Some(Judgment::Missed));
        assert_eq!(figure(&cases, "pairs").judgment(), None);
        assert_eq!(figure(&cases, "all cases: a wrong").share, Share { hits: 2, of: 6 });
        assert_eq!(figure(&cases, "singles that do not show").share, Share { hits: 1, of: 1 });
        assert_eq!(confusion(&cases)[&("transport_delay".to_owned(), "esc_frame_hold".to_owned())], 2);
        assert_eq!(ceilings(&cases)[0].share, Share { hits: 3, of: 4 });
        assert_eq!(ceilings(&cases)[1].share, Share { hits: 2, of: 3 });
    }

    #[test]
    fn nuisances_and_several_effects_have_rows_of_their_own() {
        let three = [Kind::TransportDelay, Kind::Backlash, Kind::GainDrift];
        let two_named = naming("partly_named", &[(Kind::Backlash, &[]), (Kind::GainDrift, &[])]);
        let all_named = naming("named", &three.map(|kind| (kind, &[][..])));
        let wrong = naming("named", &[(Kind::GainDrift, &[])]);
        let cases = [
            scored("triple", &three, -100.0, -50.0, &two_named),
            scored("triple", &three, -100.0, -50.0, &all_named),
            scored("triple", &three, -100.0, -1.0, &wrong),
            scored("pair", &[Kind::Backlash, Kind::ClockSkew], -100.0, -50.0, &wrong),
            scored("nuisance", &[], 0.0, 0.0, &naming("unknown", &[])),
            scored("nuisance", &[], 0.0, 0.0, &wrong),
            scored("nuisance", &[], 0.0, 0.0, "refused"),
            scored("single_in_nuisance", &[Kind::GainDrift], 0.0, 0.0, &wrong),
            scored("single_in_nuisance", &[Kind::ClockSkew], 0.0, 0.0, &wrong),
        ];
        assert_eq!(figure(&cases, "three effects that show: all").share, Share { hits: 1, of: 2 });
        assert_eq!(figure(&cases, "three effects that show: another").share, Share { hits: 0, of: 2 });
        assert_eq!(figure(&cases, "pairs that show: another").share, Share { hits: 1, of: 1 });
        assert_eq!(figure(&cases, "nuisances of the stand alone").share, Share { hits: 1, of: 2 });
        assert_eq!(figure(&cases, "one effect in nuisances of the stand: the").share, Share { hits: 1, of: 2 });
        assert_eq!(figure(&cases, "one effect in nuisances of the stand: another").share, Share { hits: 1, of: 2 });
        assert_eq!(figure(&cases, "all cases: a wrong").share, Share { hits: 3, of: 9 });
    }

    #[test]
    fn a_count_is_rejected_where_the_exact_test_says_so() {
        let p_value = |hits, of| Parameter { share: Share { hits, of }, mean_off: 0.0 }.p_value();
        // 1 - P(X >= 9) of 10: 0.95^10 + 10 0.05 0.95^9 = 0.9139.
        assert!((p_value(8, 10) - 0.0861).abs() < 1e-4, "{}", p_value(8, 10));
        assert!((p_value(10, 10) - 1.0).abs() < 1e-9);
        assert!(p_value(7, 10) > 0.01 && p_value(6, 10) < 0.01);
        // Too good to be true: 0.95^150 is 4.6e-4.
        assert!(p_value(150, 150) < 0.01);
    }

    #[test]
    fn a_rate_is_missed_only_where_its_interval_excludes_what_is_required() {
        let judged = |hits, of| Figure { what: "", share: Share { hits, of }, required: Some((0.95, 1.0)) }.judgment();
        assert_eq!(judged(96, 100), Some(Judgment::Holds));
        assert_eq!(judged(93, 100), Some(Judgment::Open));
        assert_eq!(judged(80, 100), Some(Judgment::Missed));
        assert_eq!(judged(0, 0), None);
    }

    #[test]
    fn too_many_good_intervals_are_a_fault_too() {
        let right = naming("named", &[(Kind::TransportDelay, &[])]);
        let cases = [scored("transport_delay", &[Kind::TransportDelay], -100.0, -50.0, &right)];
        assert_eq!(figure(&cases, "parameters within").judgment(), Some(Judgment::Open));
    }
}
