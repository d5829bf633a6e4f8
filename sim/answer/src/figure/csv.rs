//! A figure's numbers.

use std::fmt::Write as _;

use super::{Figure, Panel, Scale};
use crate::escape::field;

impl Figure {
    /// The numbers: those that the figure brings, or each point that is drawn with its series, its units, its band and its note.
    #[must_use]
    pub fn csv(&self) -> String {
        if let Some(numbers) = &self.numbers {
            return numbers.clone();
        }
        let mut csv = String::from("panel,series,x,x_is,y,y_is,low,high,note\n");
        for (index, panel) in self.panels.iter().enumerate() {
            panel.write_csv(index + 1, &mut csv);
        }
        csv
    }
}

impl Panel {
    fn write_csv(&self, number: usize, csv: &mut String) {
        let [x_is, y_is] = [&self.x, &self.y].map(|axis| field(&axis.title()));
        for series in &self.series {
            for (index, (x, y)) in series.points.iter().enumerate() {
                let (low, high) =
                    series.band.get(index).map_or_else(Default::default, |(low, high)| (text(*low), text(*high)));
                let note = match (&self.y.scale, series.notes.get(index)) {
                    (_, Some(note)) => field(note),
                    (Scale::Names(names), None) => field(names.get(*y as usize).map_or("", String::as_str)),
                    _ => String::new(),
                };
                let name = field(&series.name);
                let _ = writeln!(csv, "{number},{name},{},{x_is},{},{y_is},{low},{high},{note}", text(*x), text(*y));
            }
        }
    }
}

/// A number as it is; nothing where there is none.
fn text(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

#[cfg(test)]
mod tests {
    use crate::figure::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};

    #[test]
    fn every_point_has_a_line_of_as_many_fields() {
        let series = Series::new("model, as given", Color::Blue, Mark::Line, vec![(1.0, -3.5), (2.0, f64::NAN)])
            .with_band(vec![(-4.0, -3.0), (0.0, 1.0)]);
        let panel = Panel::new(Axis::frequency(), Axis::linear("magnitude", "dB"), vec![series]);
        let csv = Figure::new(FigureKind::Gap, "One", "", vec![panel]).csv();
        let mut reader = csv::ReaderBuilder::new().from_reader(csv.as_bytes());
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(rows.len(), 2);
        let expected = ["1", "model, as given", "1", "frequency, rad/s", "-3.5", "magnitude, dB", "-4", "-3", ""];
        assert_eq!(rows[0], expected.to_vec());
        assert_eq!(&rows[1][4], "", "what is not a number is no number");
    }
}
