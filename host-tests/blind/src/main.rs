//! Runs the blind cases: `cargo xtask blind` builds the tool and calls this.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use blind_cases::case::{Class, Set};
use blind_cases::ceiling::Rivals;
use blind_cases::kind::Kind;
use blind_cases::report::page;
use blind_cases::run::{Plan, cases, run};
use blind_cases::score::Scored;

const HELP: &str = "\
Usage: blind [--tool PROGRAM | --only-ceilings] [--set tune|report] [--kinds A,B] [--seeds N] [--jobs N] [--keep DIR]
             [--rivals none|family|all] [--program NAME] [--page FILE]

  --tool PROGRAM    the program to judge
  --only-ceilings   judges no program, but prints the log likelihoods of all rivals less that of the truth; with a `<`
                    those that a few records bound far from it
  --set SET         tune (default) or report
  --kinds A,B       only these kinds; also `nothing`, `pair`, `triple`, `outside`, `perturbed`, `nuisance`,
                    `single_in_nuisance`
  --seeds N         cases of each kind, 10 by default; four times as many with nothing hidden, three times as many pairs,
                    six times as many outside the catalog, twice as many of one effect in nuisances of the stand, and as many
                    triples, of each bent law and of each nuisance
  --jobs N          cases at a time, 2 by default
  --keep DIR        leaves experiments, truths and answers there; what the same program has answered before is not asked
                    again; with --only-ceilings experiments and truths
  --rivals WHICH    what an effect must be distinguished from: those known to be confused with it (default), all, or
                    none: then what can be identified at all stays unknown
  --program NAME    what the page calls the program that is judged, as `git describe` does
  --page FILE       writes the page there when the whole report set was run with 5 seeds or more, against all rivals
";

struct Options {
    plan: Plan,
    program: Option<String>,
    page: Option<PathBuf>,
    is_whole: bool,
    seeds: u64,
    /// Goes away with the options.
    _scratch: Option<tempfile::TempDir>,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.iter().any(|argument| argument == "--help" || argument == "-h") {
        print!("{HELP}");
        return ExitCode::SUCCESS;
    }
    let options = match read(&arguments) {
        Ok(options) => options,
        Err(error) => {
            eprintln!("error: {error}\n\n{HELP}");
            return ExitCode::from(2);
        }
    };
    match judge(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn read(arguments: &[String]) -> Result<Options, String> {
    let (mut set, mut only, mut seeds, mut jobs) = (Set::Tune, Vec::new(), 10, 2);
    let (mut tool, mut only_ceilings, mut keep, mut rivals) = (None, false, None, Rivals::Family);
    let (mut program, mut page) = (None, None);
    let mut left = arguments.iter();
    while let Some(name) = left.next() {
        if name == "--only-ceilings" {
            only_ceilings = true;
            continue;
        }
        let value = left.next().ok_or_else(|| format!("{name} is no option, or needs a value"))?;
        let number = || value.parse::<u64>().ok().filter(|n| *n > 0).ok_or(format!("{name}: {value} is no count"));
        match name.as_str() {
            "--tool" => tool = Some(PathBuf::from(value)),
            "--set" => {
                set = [Set::Tune, Set::Report]
                    .into_iter()
                    .find(|set| set.name() == value)
                    .ok_or_else(|| format!("--set: {value} is neither tune nor report"))?;
            }
            "--kinds" => only = value.split(',').map(class).collect::<Result<_, _>>()?,
            "--seeds" => seeds = number()?,
            "--jobs" => jobs = number()? as usize,
            "--keep" => keep = Some(PathBuf::from(value)),
            "--program" => program = Some(value.clone()),
            "--page" => page = Some(PathBuf::from(value)),
            "--rivals" => {
                rivals = [Rivals::None, Rivals::Family, Rivals::All]
                    .into_iter()
                    .find(|rivals| rivals.name() == value)
                    .ok_or_else(|| format!("--rivals: {value} is none of none, family and all"))?;
            }
            _ => return Err(format!("there is no option {name}")),
        }
    }
    if tool.is_some() == only_ceilings {
        return Err("either --tool or --only-ceilings is needed".to_owned());
    }
    let is_whole = set == Set::Report && only.is_empty() && seeds >= 5 && rivals == Rivals::All;
    let scratch = match &keep {
        Some(_) => None,
        None => Some(tempfile::tempdir().map_err(|error| format!("no folder for the cases: {error}"))?),
    };
    let folder = scratch.as_ref().map_or_else(|| keep.clone().unwrap_or_default(), |scratch| scratch.path().to_owned());
    let cache = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/blind-ceilings");
    let keep = keep.is_some();
    let plan = Plan { set, cases: cases(seeds, &only), jobs, rivals, tool, folder, keep, cache };
    Ok(Options { plan, program, page, is_whole, seeds, _scratch: scratch })
}

fn class(name: &str) -> Result<Class, String> {
    let other = || Class::OTHERS.into_iter().find(|class| class.name() == name);
    let known = Kind::named(name).map(Class::Single).or_else(other);
    known.ok_or_else(|| format!("--kinds: there is no {name}"))
}

fn judge(options: &Options) -> Result<(), String> {
    let start = Instant::now();
    let scored = run(&options.plan, &|done, total| {
        let spent_s = start.elapsed().as_secs_f64();
        let left_s = spent_s / done as f64 * (total - done) as f64;
        eprintln!("{done}/{total} cases, {spent_s:.0} s, about {left_s:.0} s left");
    })?;
    if options.plan.tool.is_none() {
        print_ceilings(&scored);
        return Ok(());
    }
    let Options { plan, seeds, program, .. } = options;
    let (set, rivals) = (plan.set, plan.rivals.name());
    let about = format!(
        "`cargo xtask blind --set {} --seeds {seeds} --rivals {rivals}` of version {}{}, with seeds from {:#x} on,",
        set.name(),
        env!("CARGO_PKG_VERSION"),
        program.as_ref().map_or(String::new(), |program| format!(" ({program})")),
        set.base(),
    );
    let text = page(&scored, options.plan.set, &about);
    println!("{text}");
    match &options.page {
        Some(path) if options.is_whole => {
            std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
        }
        Some(path) => {
            eprintln!("{} stays as it is: this was not the whole report set against all rivals", path.display());
            Ok(())
        }
        None => Ok(()),
    }
}

fn print_ceilings(scored: &[Scored]) {
    for case in scored {
        let Some(ceiling) = &case.truth.ceiling else { continue };
        let hidden: Vec<String> = case
            .truth
            .effects
            .iter()
            .flat_map(|hidden| {
                hidden.parameters.iter().map(|(name, value)| format!("{}.{name} {value:.4}", hidden.kind))
            })
            .collect();
        let exchanges = ceiling.exchanges.iter();
        let exchanges = exchanges.map(|one| format!("{} with {} {}", one.stays, one.comes, one.difference));
        let alone = ceiling.rivals.iter().map(|(name, off)| format!("{name} {off}"));
        let rivals: Vec<String> = alone.chain(exchanges).collect();
        let word = match (case.truth.is_invisible(), ceiling.is_identifiable()) {
            (true, _) => "does not show",
            (false, true) => "identifiable",
            (false, false) => "not identifiable",
        };
        println!(
            "{} {} | {} | noise {:.2} % | {word} | nothing {:.1}, {}",
            case.truth.class,
            case.truth.number,
            hidden.join(", "),
            100.0 * case.truth.noise_level,
            ceiling.nothing,
            rivals.join(", ")
        );
    }
}
