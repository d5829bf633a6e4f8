//! Makes cases, asks the tool, and scores: several at a time.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use super::case::{Case, Class, Columns, Set};
use super::ceiling::{Ceiling, Rivals, ceiling};
use super::diagnosis::Diagnosis;
use super::folder::{self, Paths, Truth};
use super::kind::Kind;
use super::nuisance::Sort;
use super::score::Scored;
use super::shape::Law;

/// How long the tool may take over a case before it counts as no answer.
const LIMIT: Duration = Duration::from_secs(600);
/// Goes up when the fits or the rivals change, so that no stale ceiling is believed.
const CEILING_VERSION: u32 = 6;

/// What to run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Which seeds.
    pub set: Set,
    /// The cases: class and number.
    pub cases: Vec<(Class, u64)>,
    /// Cases at a time.
    pub jobs: usize,
    /// Which rivals decide what can be identified.
    pub rivals: Rivals,
    /// The tool; without one only the ceilings are computed, and every answer is an error.
    pub tool: Option<PathBuf>,
    /// Where folders and truths are written; they stay there if `keep`.
    pub folder: PathBuf,
    /// Whether the experiments' folders stay, which then are written without a tool too, and answers that are there are not asked for
    /// again.
    pub keep: bool,
    /// Where ceilings are kept from run to run.
    pub cache: PathBuf,
}

/// The cases for `seeds` of each kind: four times as many empty ones, six times as many outside the catalog, twice as many of one effect in
/// nuisances, three times as many pairs, of which a part does not show, and as many triples, of each bent law and of each nuisance. Only the
/// classes in `only`, if it names any.
#[must_use]
pub fn cases(seeds: u64, only: &[Class]) -> Vec<(Class, u64)> {
    let singles = Kind::ALL.into_iter().map(|kind| (Class::Single(kind), seeds));
    let others = Class::OTHERS.into_iter().map(|class| {
        let times = match class {
            Class::Single(_) | Class::Triple => 1,
            Class::SingleInNuisance => 2,
            Class::Pair => 3,
            Class::Empty => 4,
            Class::Outside => 6,
            Class::Perturbed => Law::TABLE.len() as u64,
            Class::Nuisance => Sort::ALL.len() as u64,
        };
        (class, times * seeds)
    });
    singles
        .chain(others)
        .filter(|(class, _)| only.is_empty() || only.contains(class))
        .flat_map(|(class, count)| (0..count).map(move |number| (class, number)))
        .collect()
}

/// Runs the plan and gives the scored cases in its order. `progress` hears how many of how many are done.
///
/// # Errors
/// When a file cannot be written, the tool cannot be started, or the folder has another tool's answers: the first such error
/// in words.
pub fn run(plan: &Plan, progress: &(dyn Fn(usize, usize) + Sync)) -> Result<Vec<Scored>, String> {
    claim(plan)?;
    let total = plan.cases.len();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Mutex<Vec<(usize, Result<Scored, String>)>> = Mutex::new(Vec::with_capacity(total));
    std::thread::scope(|scope| {
        for _ in 0..plan.jobs.max(1) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some((class, number)) = plan.cases.get(index) else { return };
                    let result = one(plan, *class, *number);
                    let failed = result.is_err();
                    results.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((index, result));
                    progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
                    if failed {
                        // The others stop as well.
                        next.store(total, Ordering::Relaxed);
                    }
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Answers are those of one tool: writes down which, or finds it written.
fn claim(plan: &Plan) -> Result<(), String> {
    let Some(tool) = plan.tool.as_ref().filter(|_| plan.keep) else { return Ok(()) };
    let bytes = fs::read(tool).map_err(|error| format!("{}: {error}", tool.display()))?;
    let print = format!("{:016x}\n", fingerprint(bytes));
    let path = plan.folder.join("tool");
    match fs::read_to_string(&path) {
        Ok(known) if known != print => {
            Err(format!("{} has the answers of another program: choose another folder", plan.folder.display()))
        }
        Ok(_) => Ok(()),
        Err(_) => write(&path, &print),
    }
}

/// FNV-1a.
fn fingerprint(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

fn one(plan: &Plan, class: Class, number: u64) -> Result<Scored, String> {
    let case = Case::draw(plan.set, class, number);
    let columns: Vec<Columns> = (0..case.runs.len()).map(|index| case.record(index)).collect();
    let ceiling = cached_ceiling(plan, &case, &columns)?;
    let truth = Truth::new(&case, ceiling);
    let name = folder::name(&case);
    let truth_path = plan.folder.join("truth").join(format!("{name}.json"));
    let answer_path = plan.folder.join("answers").join(format!("{name}.json"));
    let text = serde_json::to_string_pretty(&truth).map_err(|error| error.to_string())?;
    let of_folder = |error: std::io::Error| format!("{}: {error}", plan.folder.display());
    let Some(tool) = &plan.tool else {
        if plan.keep {
            folder::write(&case, &columns, &plan.folder.join("cases")).map_err(of_folder)?;
            write(&truth_path, &text)?;
        }
        return Ok(Scored { truth, answer: Err("the tool was not run".to_owned()) });
    };
    if plan.keep && truth_path.exists() {
        // What was broken off is no answer, and what failed may do so again.
        if let Some(answer) = fs::read_to_string(&answer_path).ok().and_then(|json| Diagnosis::parse(&json).ok()) {
            write(&truth_path, &text)?;
            return Ok(Scored { truth, answer: Ok(answer) });
        }
    }
    let paths = folder::write(&case, &columns, &plan.folder.join("cases")).map_err(of_folder)?;
    let answer = ask(tool, &paths, &answer_path)?;
    write(&truth_path, &text)?;
    if !plan.keep {
        fs::remove_dir_all(&paths.experiment).map_err(|error| format!("{}: {error}", paths.experiment.display()))?;
    }
    Ok(Scored { truth, answer })
}

/// The tool's answer on a case. The outer error is one of this machine, the inner one the tool's.
fn ask(tool: &Path, paths: &Paths, answer: &Path) -> Result<Result<Diagnosis, String>, String> {
    let outer = |error: std::io::Error| format!("{}: {error}", tool.display());
    write(answer, "")?;
    let errors = answer.with_extension("stderr");
    let mut command = Command::new(tool);
    command.arg("diagnose").arg(&paths.experiment).args(["--json", "-"]);
    if let Some(model) = &paths.model {
        command.arg("--model").arg(model);
    }
    // To files, which no amount of output blocks.
    command.stdin(Stdio::null()).stdout(File::create(answer).map_err(outer)?);
    command.stderr(File::create(&errors).map_err(outer)?);
    let mut child = command.spawn().map_err(outer)?;
    let start = Instant::now();
    let status = loop {
        match child.try_wait().map_err(outer)? {
            Some(status) => break status,
            None if start.elapsed() > LIMIT => {
                // It may have ended by itself meanwhile.
                let _ = child.kill();
                let _ = child.wait();
                return Ok(Err(format!("no answer within {} s", LIMIT.as_secs())));
            }
            None => std::thread::sleep(Duration::from_millis(50)),
        }
    };
    if !status.success() {
        let said = fs::read_to_string(&errors).unwrap_or_default();
        let first = said.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("without a word").to_owned();
        return Ok(Err(format!("{status}: {first}")));
    }
    let json = fs::read_to_string(answer).map_err(outer)?;
    Ok(Diagnosis::parse(&json))
}

/// The ceiling from the cache, or computed and put there. Its key is the data.
fn cached_ceiling(plan: &Plan, case: &Case, columns: &[Columns]) -> Result<Option<Ceiling>, String> {
    let has_one = matches!(case.class, Class::Single(_) | Class::Pair | Class::Triple);
    if !has_one || plan.rivals == Rivals::None {
        return Ok(None);
    }
    // FNV-1a.
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for value in columns.iter().flat_map(|columns| &columns.thrust_n) {
        hash = (hash ^ value.to_bits()).wrapping_mul(0x0100_0000_01b3);
    }
    let rivals = match plan.rivals {
        Rivals::None => "none",
        Rivals::Family => "family",
        Rivals::All => "all",
    };
    // A file without this in its name says of a pair what either alone does, and nothing of exchanges.
    let rivals = if case.effects.len() > 1 { format!("{rivals}_exchanged") } else { rivals.to_owned() };
    let name = format!("{}_{}_{hash:016x}_{rivals}_{CEILING_VERSION}.json", case.class.name(), case.number);
    let path = plan.cache.join(name);
    if let Some(known) = fs::read_to_string(&path).ok().and_then(|text| serde_json::from_str(&text).ok()) {
        return Ok(Some(known));
    }
    let computed = ceiling(case, columns, plan.rivals);
    if let Some(ceiling) = &computed {
        write(&path, &serde_json::to_string(ceiling).map_err(|error| error.to_string())?)?;
    }
    Ok(computed)
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    let error = |error: std::io::Error| format!("{}: {error}", path.display());
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(error)?;
    }
    fs::write(path, text).map_err(error)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(folder: &Path, tool: Option<PathBuf>) -> Plan {
        Plan {
            set: Set::Tune,
            cases: vec![(Class::Empty, 0), (Class::Outside, 1)],
            jobs: 2,
            rivals: Rivals::Family,
            tool,
            folder: folder.to_owned(),
            keep: false,
            cache: folder.join("cache"),
        }
    }

    #[test]
    fn ten_seeds_are_as_many_cases_as_asked_for() {
        let all = cases(10, &[]);
        let count = |class: Class| all.iter().filter(|(one, _)| *one == class).count();
        assert_eq!((count(Class::Empty), count(Class::Outside), count(Class::Pair)), (40, 60, 30));
        assert_eq!((count(Class::Triple), count(Class::SingleInNuisance)), (10, 20));
        assert_eq!((count(Class::Nuisance), count(Class::Perturbed)), (60, 200));
        assert!(Kind::ALL.into_iter().all(|kind| count(Class::Single(kind)) == 10));
        assert_eq!(cases(3, &[Class::Empty]).len(), 12);
    }

    #[cfg(unix)]
    #[test]
    fn a_tool_is_asked_and_its_answer_scored() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let tool = folder.path().join("tool.sh");
        let json = super::super::diagnosis::tests::naming("agrees", &[]);
        fs::write(
            &tool,
            format!("#!/bin/sh\ntest \"$1\" = diagnose -a -f \"$2/experiment.toml\" || exit 3\necho '{json}'\n"),
        )
        .unwrap();
        fs::set_permissions(&tool, fs::Permissions::from_mode(0o755)).unwrap();
        let scored = run(&plan(folder.path(), Some(tool.clone())), &|_, _| {}).unwrap();
        assert!(scored[0].names_nothing() && scored[0].truth.class == "nothing");
        assert!(!scored[1].admits() && scored[1].first() == "agrees");
        assert_eq!(fs::read_dir(folder.path().join("cases")).unwrap().count(), 0);
        assert_eq!(fs::read_dir(folder.path().join("truth")).unwrap().count(), 2);

        fs::write(&tool, "#!/bin/sh\necho 'no such command' >&2\nexit 2\n").unwrap();
        let scored = run(&plan(folder.path(), Some(tool)), &|_, _| {}).unwrap();
        assert!(scored[0].answer.as_ref().unwrap_err().contains("no such command"));
        assert!(run(&plan(folder.path(), Some(folder.path().join("nothing"))), &|_, _| {}).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_run_that_was_broken_off_goes_on_with_the_same_tool_only() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (tool, asked) = (folder.path().join("tool.sh"), folder.path().join("asked"));
        let json = super::super::diagnosis::tests::naming("agrees", &[]);
        let script = format!("#!/bin/sh\necho \"$2\" >> '{}'\necho '{json}'\n", asked.display());
        fs::write(&tool, &script).unwrap();
        fs::set_permissions(&tool, fs::Permissions::from_mode(0o755)).unwrap();
        let plan = Plan { keep: true, ..plan(folder.path(), Some(tool.clone())) };
        let times = || fs::read_to_string(&asked).unwrap().lines().count();
        let first = run(&plan, &|_, _| {}).unwrap();
        assert_eq!(times(), 2);
        // One answer was broken off.
        let answer = fs::read_dir(folder.path().join("answers")).unwrap().flatten().map(|entry| entry.path());
        let answer = answer.into_iter().find(|path| path.extension().is_some_and(|end| end == "json")).unwrap();
        fs::write(&answer, &json[..json.len() / 2]).unwrap();
        assert_eq!(run(&plan, &|_, _| {}).unwrap(), first);
        assert_eq!(times(), 3);
        fs::write(&tool, format!("{script}# another one\n")).unwrap();
        assert!(run(&plan, &|_, _| {}).unwrap_err().contains("another program"));
    }
}
