//! What of a record can be compared: from where the motor runs steadily, without spikes and without what follows a gap.

use std::ops::Range;

use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::lag::steps::{Run, SAME_LEVEL, StepsError};
use rotorlead_identify::rows::gaps::rows_after_gaps;
use rotorlead_identify::rows::spikes::without_spikes;
use rotorlead_numerics::sample::{mean, median};
use rotorlead_records::{Excitation, Output, Record as SourceRecord};

use super::groups::{CutRows, Group, LogGroups};
use crate::DiagnoseError;
use crate::data::plateaus::rows::Blocks;
use crate::data::split::Split;
use crate::noise::plateau_errors::{ComparedRows, kept_rows, measure};

/// Parts into which a record without plateaus is cut for its splits. Chosen: even, so that half is held out, and several to either side.
/// Fewer let one part decide; more are shorter than what a lag remembers.
const BLOCKS: usize = 10;
/// After a gap of the logger in which the command may have moved, so many seconds are not compared where there is no plateau that settles.
/// Chosen: three time constants of a slow motor, 0.16 s. Less compares a response to an unknown command; more loses rows.
const AFTER_GAP_S: f64 = 0.5;
/// A record without plateaus has its noise from what a parabola through so many rows leaves. Chosen: six degrees of freedom each. Fewer
/// leave too few, more are longer than a response is a parabola.
const PARABOLA_ROWS: usize = 9;
/// Noise below this share of the response's range is taken for this. Chosen: below the last digit of a 16-bit reading, 1.5e-5; it only
/// keeps weights finite.
const LEAST_NOISE: f64 = 1e-5;
/// Where a plateau has settled its rows all say the same: they are compared as so many means. Chosen: what drifts slowly still shows,
/// within a twelfth of the plateau. More cost only time.
const SETTLED_BLOCKS: usize = 12;
/// A step is compared at about so many rows while it goes most of the way, or at all that there are. Derived: over a twelfth of a time
/// constant a lag is a line but for `(1/12)^2 / 8`, 9e-4. More cost only time.
const ROWS_PER_RISE: f64 = 12.0;
/// Rows over which the correlation of the noise is summed. Chosen: beyond, the sum gathers errors of the correlations; shorter, slow noise
/// counts as more rows than it is.
const NOISE_LAGS: usize = 60;

/// A record's rows from the first that is compared to the last, with what was measured there.
pub(crate) struct Prepared {
    /// The rows of the record that are taken.
    pub rows: Range<usize>,
    /// What of them is compared.
    pub blocks: Blocks,
    /// The response of each block.
    pub measured: Vec<f64>,
    /// Its mean over all rows that are taken.
    pub mean_response: f64,
    /// The rest.
    pub log: LogGroups,
}

/// Prepares a record that does not repeat; between plateaus with a number for each level in place of a static map where
/// `has_free_map` says so. `Ok(None)` where the motor does not run steadily.
///
/// # Errors
/// [`DiagnoseError`] for a record without a response, and a command or response that never changes.
pub(crate) fn prepare(
    source: &SourceRecord,
    output: Output,
    has_free_map: bool,
) -> Result<Option<Prepared>, DiagnoseError> {
    let response = rotorlead_identify::rows::columns::response_column(source, output)?;
    let constant = |values: &[f64]| values.iter().all(|value| *value == values[0]);
    if constant(&source.command) {
        return Err(IdentifyError::ConstantCommand { file: source.file.clone() }.into());
    }
    if constant(response) {
        return Err(IdentifyError::ConstantResponse { file: source.file.clone() }.into());
    }
    let run = match Run::longest(source, output) {
        Ok(run) => Some(run),
        Err(StepsError::NotRunning { .. } | StepsError::NoPlateaus { .. }) => None,
        Err(error) => return Err(DiagnoseError::Steps(error)),
    };
    let stepped = matches!(source.excitation, Excitation::Step | Excitation::Staircase);
    // A record of anything may well be a staircase. Chosen: it is one where plateaus cover more than half of it.
    let whole = |run: &Run| 2 * run.rows().len() > source.time_s.len();
    Ok(match run {
        Some(run) if stepped || whole(&run) => Some(prepare_run(source, run, has_free_map)),
        _ if stepped => None,
        _ => Some(prepare_whole(source, response)),
    })
}

/// The longest run of plateaus. The static map is free where `has_free_map` says so.
fn prepare_run(source: &SourceRecord, run: Run, has_free_map: bool) -> Prepared {
    let rows = run.rows();
    let time_s = &source.time_s[rows.clone()];
    let measured = &run.clean[rows.clone()];
    let mut kept: Vec<bool> = run.rows_without_reading()[rows.clone()].iter().map(|without| !without).collect();
    let spikes = run.spike[rows.clone()].iter().filter(|spike| **spike).count();
    let mut limited = 0;
    for (kept, shows) in kept.iter_mut().zip(run.unclipped_rows()) {
        limited += usize::from(*kept && !shows);
        *kept &= shows;
    }
    let mut levels: Vec<f64> = run.plateaus.iter().map(|plateau| plateau.command).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup_by(|a, b| (*a - *b).abs() <= SAME_LEVEL);
    let floor = LEAST_NOISE * range(measured);
    let mut groups: Vec<Group> = Vec::new();
    let mut before = run.plateaus[0].command;
    for plateau in &run.plateaus {
        let mut own = plateau.clone();
        own.rows = plateau.rows.start - rows.start..plateau.rows.end - rows.start;
        groups.push(Group {
            rows: own.rows.clone(),
            command: own.command,
            step: own.command - before,
            rank: levels.partition_point(|level| *level < own.command - SAME_LEVEL),
            noise: own.noise_std.max(floor),
            split: Split::Train,
            plateau: Some(own),
        });
        before = plateau.command;
    }
    let mut parts = parts(&groups, &kept);
    let rise_s = measure(&mut parts, time_s, measured, &rows_after_gaps(time_s));
    let mut cut = CutRows {
        file: source.file.clone(),
        rows: source.time_s.len(),
        start: rows.start,
        end: source.time_s.len() - rows.end,
        spikes,
        limited,
        steps: groups.len() - 1,
        ..CutRows::default()
    };
    for part in &mut parts {
        let stalled = part.cut_after_stall();
        cut.stalled_steps += usize::from(stalled > 0);
        cut.after_gaps += stalled;
    }
    let rows_per_sample = rows_per_sample(measured, &groups);
    // Of a step that much faster rows show no more.
    let interval_s = median(time_s.windows(2).map(|pair| pair[1] - pair[0])).unwrap_or_default();
    let width = rise_s.map_or(1, |rise_s| (rise_s / ROWS_PER_RISE / interval_s) as usize);
    let mut blocks = Blocks::default();
    let mut settled: Range<usize> = 0..0;
    for (place, (group, part)) in groups.iter_mut().zip(&mut parts).enumerate() {
        let from = blocks.len();
        let moving: Vec<usize> = part.moving.iter().map(|(row, _)| *row).collect();
        // The row on which the command changes may stand for the level before.
        let (first, later) = moving.split_at(moving.len().min(1));
        let first = blocks.add(first, 1);
        let later = blocks.add_moving(later, width);
        let begin = moving.last().map_or(group.rows.start, |last| last + 1).max(part.stalled.end);
        let resting = kept_rows(begin..part.settled.first().copied().unwrap_or(group.rows.end), &kept);
        blocks.add(&resting, resting.len().div_ceil(SETTLED_BLOCKS));
        let before =
            std::mem::replace(&mut settled, blocks.add(&part.settled, part.settled.len().div_ceil(SETTLED_BLOCKS)));
        part.moving = first.chain(later).map(|block| (block, 0.0)).collect();
        part.before = if place == 0 { Vec::new() } else { before.collect() };
        part.settled = settled.clone().collect();
        group.rows = from..blocks.len();
    }
    if has_free_map {
        free_map(&groups, &mut parts);
    }
    prepared(
        rows,
        blocks,
        (time_s, measured),
        LogGroups { has_free_map, ..LogGroups::new(groups, parts, cut, true, rows_per_sample) },
    )
}

/// What of each group of rows is compared: where it moves, and where it has settled.
fn parts(groups: &[Group], kept: &[bool]) -> Vec<ComparedRows> {
    let settled = |group: &Group| group.plateau.as_ref().map_or_else(Vec::new, |own| kept_rows(own.settled(), kept));
    let part = |(index, group): (usize, &Group)| {
        let begin = group.plateau.as_ref().map_or(group.rows.end, |plateau| plateau.settled().start);
        // Of the plateau that a record begins with nothing moves.
        let is_first_level = index == 0 && group.plateau.is_some();
        let moving = kept_rows(group.rows.start..if is_first_level { group.rows.start } else { begin }, kept);
        ComparedRows {
            settled: settled(group),
            before: index.checked_sub(1).map(|before| settled(&groups[before])).unwrap_or_default(),
            moving: moving.into_iter().map(|row| (row, 0.0)).collect(),
            ..ComparedRows::default()
        }
    };
    groups.iter().enumerate().map(part).collect()
}

/// The static map is free, a number for each level: of `n` visits to a level `n - 1` say something, and no level is known better
/// than its own scatter says.
fn free_map(groups: &[Group], parts: &mut [ComparedRows]) {
    let visits = |rank: usize, parts: &[ComparedRows]| {
        groups.iter().zip(parts).filter(|(group, part)| group.rank == rank && !part.settled.is_empty()).count()
    };
    for (place, group) in groups.iter().enumerate() {
        let visits = visits(group.rank, parts).max(1) as f64;
        let least = group.plateau.as_ref().map_or(0.0, |plateau| plateau.mean_std);
        (parts[place].independent_level, parts[place].level_std) = ((visits - 1.0) / visits, least);
    }
}

/// All rows of a record without plateaus.
fn prepare_whole(source: &SourceRecord, response: &[f64]) -> Prepared {
    let (measured, spike) = without_spikes(response);
    let time_s = &source.time_s;
    let mut kept: Vec<bool> = spike.iter().map(|spike| !spike).collect();
    let spikes = kept.iter().filter(|kept| !**kept).count();
    let mut after_gaps = 0;
    for row in rows_after_gaps(time_s) {
        let end = time_s.partition_point(|t| *t < time_s[row] + AFTER_GAP_S);
        for kept in &mut kept[row..end] {
            after_gaps += usize::from(*kept);
            *kept = false;
        }
    }
    let noise = parabola_noise(time_s, &measured).max(LEAST_NOISE * range(&measured));
    let count = time_s.len();
    let number = BLOCKS.min(count / (2 * PARABOLA_ROWS)).max(1);
    let groups = (0..number).map(|block| {
        let rows = block * count / number..(block + 1) * count / number;
        let command = source.command[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
        Group { rows, command, step: 0.0, plateau: None, rank: block, noise, split: Split::Train }
    });
    let mut groups: Vec<Group> = groups.collect();
    let mut parts = parts(&groups, &kept);
    let mut blocks = Blocks::default();
    for (group, part) in groups.iter_mut().zip(&mut parts) {
        let moving: Vec<usize> = part.moving.iter().map(|(row, _)| *row).collect();
        group.rows = blocks.add(&moving, 1);
        part.moving = group.rows.clone().map(|block| (block, 0.0)).collect();
    }
    let cut = CutRows { file: source.file.clone(), rows: count, spikes, after_gaps, ..CutRows::default() };
    prepared(0..count, blocks, (time_s, &measured), LogGroups::new(groups, parts, cut, false, 1.0))
}

fn prepared(rows: Range<usize>, blocks: Blocks, (time_s, measured): (&[f64], &[f64]), log: LogGroups) -> Prepared {
    let means = blocks.means(measured);
    let log = LogGroups { scatter: blocks.scatter(measured, time_s), measured: means.clone(), ..log };
    Prepared { rows, measured: means, mean_response: mean(measured), blocks, log }
}

fn range(values: &[f64]) -> f64 {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    high - low
}

/// Rows of settled noise that are worth one independent row in a sum of squares: `1 + 2 sum rho^2`.
fn rows_per_sample(measured: &[f64], groups: &[Group]) -> f64 {
    let mut products = [0.0; NOISE_LAGS + 1];
    for group in groups {
        let Some(plateau) = &group.plateau else { continue };
        let settled = &measured[plateau.settled()];
        if settled.len() <= NOISE_LAGS {
            continue;
        }
        for (lag, product) in products.iter_mut().enumerate() {
            let pairs = settled.iter().zip(&settled[lag..]);
            *product += pairs.map(|(a, b)| (a - plateau.mean) * (b - plateau.mean)).sum::<f64>() / group.noise.powi(2);
        }
    }
    let [power, products @ ..] = products;
    if power <= 0.0 {
        return 1.0;
    }
    1.0 + 2.0 * products.iter().map(|product| (product / power).powi(2)).sum::<f64>()
}

/// Standard deviation of what parabolas through a few rows each leave. Parabolas in the row serve for uneven rows too as long as
/// the response is smooth over them.
fn parabola_noise(time_s: &[f64], values: &[f64]) -> f64 {
    let mut squares: Vec<f64> = Vec::new();
    for (time_s, values) in time_s.chunks_exact(PARABOLA_ROWS).zip(values.chunks_exact(PARABOLA_ROWS)) {
        let middle = time_s[PARABOLA_ROWS / 2];
        let width = (time_s[PARABOLA_ROWS - 1] - time_s[0]).max(f64::MIN_POSITIVE);
        let columns = nalgebra::DMatrix::from_fn(PARABOLA_ROWS, 3, |row, power| {
            ((time_s[row] - middle) / width).powi(power as i32)
        });
        let right = nalgebra::DVector::from_column_slice(values);
        // Columns of order 1: a singular value of 1e-12 is rounding, as where all stamps are the same.
        let Some(solution) = rotorlead_numerics::linear::linear_least_squares(columns.clone(), &right, 1e-12) else {
            continue;
        };
        squares.push((&columns * solution - right).norm_squared() / (PARABOLA_ROWS - 3) as f64);
    }
    // The median: where the command jumps no parabola fits. That of a chi-square of 6 degrees of freedom is 0.891 of the mean.
    median(squares).map_or(0.0, |median| (median / 0.891).sqrt())
}
