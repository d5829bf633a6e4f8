//! `rotorlead device inject`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::Diagnostic;
use rotorlead::throttle::Command;
use rotorlead_device::{DeviceError, Difference, Injection, Session, compensator, is_compensated};
use rotorlead_plant::bench::{Plan, run_through};
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::Experiment;
use rotorlead_records::files::OutputFolder;
use serde_json::{Value, json};
use thiserror::Error;

use crate::UsageError;
use crate::model_argument::ModelArgument;
use crate::outcome::Outcome;
use crate::progress;

#[derive(Args, Debug)]
pub(super) struct Inject {
    #[command(flatten)]
    model: ModelArgument,
    /// What to run; the paper's experiment unless given, with multisines up to 44.9 Hz where it is compensated
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// The motor's path, from 0
    #[arg(long, default_value_t = 0)]
    motor: u8,
    /// Whether the compensator is in the path; as in the controller's settings unless given
    #[arg(long, value_name = "BOOL")]
    compensate: Option<bool>,
    /// The experiment's folder, which is made
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
}

/// Outputs that are not the host's.
#[derive(Debug, Error, Diagnostic)]
#[error("{records} of {total} records differ from the host's path, the first in {file} at sample {sample}")]
#[diagnostic(help(
    "the controller runs other code or other settings than this program: flash the firmware that belongs to it"
))]
struct Differs {
    records: usize,
    total: usize,
    file: String,
    sample: usize,
}

/// An injection that ended early.
#[derive(Debug, Error, Diagnostic)]
#[error("{cause}; after {samples} of {total} samples, {different} of them different from the host's path")]
#[diagnostic(help("{}nothing was written, and the same samples come out again: repeat it", .help))]
struct Broken {
    cause: DeviceError,
    samples: usize,
    total: usize,
    different: usize,
    help: String,
}

/// What is played before a record: the stop, so that the path may arm, and `start`, at which the filter is put to rest.
fn lead_in(start: Command) -> [Command; 2] {
    [Command::ZERO, start]
}

/// One record's injection in short.
struct Played {
    samples: usize,
    different: usize,
    first_difference: Option<Difference>,
}

impl Inject {
    /// Gives what came out, and an error beside it where outputs are not the host's.
    pub(super) fn run(&self, session: &mut Session) -> miette::Result<(Outcome, miette::Result<()>)> {
        let settings = session.settings()?;
        let compensate = self.compensate.unwrap_or_else(|| is_compensated(&settings, self.motor));
        let model = Model::read(self.model.path())?;
        let design = compensator(&settings, self.motor)?;
        let plan = self.plan(&model, &design, compensate, settings.loop_rate_hz)?;
        // Before the work, so that a motor that does not exist or a folder in the way is found early.
        rotorlead_device::path(&settings, self.motor, compensate)?;
        drop(OutputFolder::create(&self.out)?);

        let bar = progress::bar("injecting", 1);
        let mut played: Vec<Played> = Vec::new();
        let (mut done, mut total) = (0, 0);
        let run = run_through(&plan, &model, compensate.then_some(&design), |progress, start, commands| {
            total = progress.total;
            bar.set_length(total as u64);
            let lead_in = lead_in(start);
            let all = [&lead_in, commands].concat();
            let show = |count: usize| bar.set_position((progress.done + count.saturating_sub(lead_in.len())) as u64);
            let Injection { mut outputs, different, first_difference } =
                rotorlead_device::inject(session, &settings, self.motor, compensate, &all, &show)?;
            outputs.drain(..lead_in.len());
            done = progress.done + commands.len();
            played.push(Played { samples: all.len(), different, first_difference });
            // Without a pulse an ESC does what it does at the stop.
            Ok::<_, DeviceError>(outputs.iter().map(|output| output.command().unwrap_or(Command::ZERO)).collect())
        });
        bar.finish_and_clear();
        let different = played.iter().map(|record| record.different).sum();
        let experiment = run.map_err(|cause| match &cause {
            DeviceError::Bench(_) => miette::Report::from(cause),
            _ => {
                let help = cause.help().map_or_else(String::new, |help| format!("{help}; "));
                Broken { cause, samples: done, total, different, help }.into()
            }
        })?;
        let folder = OutputFolder::create(&self.out)?;
        experiment.write_into(&folder)?;
        if compensate {
            folder.write("compensator.toml", design.text(&self.out)?.as_bytes())?;
        }
        folder.commit()?;
        Ok(say(&self.out, &experiment, &played))
    }

    /// What to run, with the controller's own compensator or none.
    fn plan(
        &self,
        model: &Model,
        design: &CompensatorDesign,
        compensate: bool,
        loop_rate_hz: u32,
    ) -> miette::Result<Plan> {
        let paper = || Plan { loop_rate_hz, ..Plan::paper(model) };
        let own = "compensator.toml";
        let Some(file) = &self.plan else {
            return Ok(if compensate { paper().compensated(own) } else { paper() });
        };
        let mut plan = Plan::read(file)?;
        if plan.loop_rate_hz != loop_rate_hz {
            return Err(UsageError::new(
                format!(
                    "the loop rate of `{}` is {} Hz, the controller's {loop_rate_hz} Hz",
                    file.display(),
                    plan.loop_rate_hz
                ),
                "change loop_rate_hz in the plan, or with `rotorlead device set` in the controller",
            )
            .into());
        }
        if let Some(named) = &plan.compensator {
            let named = file.parent().unwrap_or(Path::new("")).join(named);
            if !compensate || !CompensatorDesign::read(&named)?.is_bit_identical_to(design) {
                return Err(UsageError::new(
                    format!("`{}` names `{}`, which is not what the controller has", file.display(), named.display()),
                    "give --compensate true, set the compensator in the controller with `rotorlead device set --compensator`, or \
                     remove `compensator` from the plan: the controller's own is used",
                )
                .into());
            }
        }
        plan.compensator = compensate.then(|| PathBuf::from(own));
        Ok(plan)
    }
}

fn say(out: &Path, experiment: &Experiment, played: &[Played]) -> (Outcome, miette::Result<()>) {
    let (mut text, mut list) = (String::new(), Vec::new());
    let (mut samples, mut different) = (0, 0);
    let mut differs: Option<Differs> = None;
    for (record, played) in experiment.records.iter().zip(played) {
        samples += played.samples;
        different += played.different;
        let (said, first) = match played.first_difference {
            None => (String::from("equal to the host's, bit for bit"), Value::Null),
            Some(Difference { sample, host, controller }) => {
                let (host, controller) = (host.to_bits(), controller.to_bits());
                let first = json!({ "sample": sample, "host": host, "controller": controller });
                let others = differs.as_ref().map_or(0, |differs| differs.records);
                let start = differs.take().unwrap_or(Differs {
                    records: 0,
                    total: experiment.records.len(),
                    file: record.file.clone(),
                    sample,
                });
                differs = Some(Differs { records: others + 1, ..start });
                let count = played.different;
                (format!("{count} DIFFERENT, first at sample {sample}: {controller}, the host has {host}"), first)
            }
        };
        writeln!(text, "  {}  {} samples, {said}", record.file, played.samples).expect("a string takes all");
        list.push(json!({
            "file": record.file,
            "nominal": record.nominal,
            "excitation": record.excitation,
            "samples": played.samples,
            "different": played.different,
            "first_difference": first,
        }));
    }
    let text = format!(
        "{} records, {samples} samples, {different} of them different from the host's path\n{text}Written to {}\n",
        experiment.records.len(),
        out.display()
    );
    let json = json!({
        "records": experiment.records.len(),
        "samples": samples,
        "different": different,
        "played": list,
    });
    (Outcome::new(text, &json), differs.map_or(Ok(()), |differs| Err(differs.into())))
}
