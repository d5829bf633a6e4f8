//! What can be told at all: `cargo run --release -p host-tests --example blind_ceiling -- SEEDS [KIND...]` prints the
//! log likelihoods of the rivals, less that of the truth, for the tuning cases.

use std::time::Instant;

use host_tests::blind::case::{Case, Class, Set};
use host_tests::blind::ceiling::{Rivals, ceiling};
use host_tests::blind::fit::Fitter;
use host_tests::blind::kind::Kind;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let seeds: u64 = arguments.first().and_then(|seeds| seeds.parse().ok()).unwrap_or(1);
    let kinds: Vec<Kind> = match arguments.get(1..) {
        Some(names @ [_, ..]) => names.iter().filter_map(|name| Kind::named(name)).collect(),
        _ => Kind::ALL.to_vec(),
    };
    for kind in kinds {
        for number in 0..seeds {
            let start = Instant::now();
            let case = Case::draw(Set::Tune, Class::Single(kind), number);
            let columns: Vec<_> = (0..case.runs.len()).map(|index| case.record(index)).collect();
            let made_s = start.elapsed().as_secs_f64();
            let coarse = Fitter::new(&case, &columns).at_truth();
            let fine = Fitter::with_step(&case, &columns, 50e-6).at_truth();
            let start = Instant::now();
            if let Some(ceiling) = ceiling(&case, &columns, Rivals::Family) {
                let rivals: Vec<String> =
                    ceiling.rivals.iter().map(|(name, difference)| format!("{name} {difference:.1}")).collect();
                println!(
                    "{:20} {:?} told {} nothing {:.1} | {} | made {made_s:.1} s, fitted {:.1} s, step {:.2}",
                    kind.name(),
                    case.effects[0].values,
                    ceiling.is_told(),
                    ceiling.nothing,
                    rivals.join(", "),
                    start.elapsed().as_secs_f64(),
                    coarse - fine,
                );
            }
        }
    }
}
