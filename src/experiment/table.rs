//! The table of results, in Markdown.

use super::job::JobResult;
use gdg::text::markdown;

/// A column of numbers.
struct Column {
    title: &'static str,
    /// Digits after the point.
    digits: usize,
    /// Whether smaller is better, which decides what the worst value is.
    smaller_is_better: bool,
    of: fn(&JobResult) -> Option<f64>,
}

const fn high(title: &'static str, digits: usize, of: fn(&JobResult) -> Option<f64>) -> Column {
    Column { title, digits, smaller_is_better: false, of }
}

const fn low(title: &'static str, digits: usize, of: fn(&JobResult) -> Option<f64>) -> Column {
    Column { title, digits, smaller_is_better: true, of }
}

const COLUMNS: [Column; 10] = [
    high("planned", 3, |r| r.last()?.planned.as_ref()?.success),
    high("SPL", 2, |r| r.last()?.planned.as_ref()?.spl),
    high("greedy", 3, |r| r.last()?.greedy.success),
    high("straight", 3, |r| r.last()?.straight.as_ref()?.success),
    low("error of D", 2, |r| Some(r.last()?.distance_error?.mape)),
    low("error near", 2, |r| Some(r.last()?.distance_error?.near_mape)),
    low("error of graph", 2, |r| Some(r.last()?.distance_error?.graph?.mape)),
    low("false edges", 0, |r| Some(r.last()?.bridges.as_ref()?.false_edges? as f64)),
    high("coverage", 3, |r| r.last()?.coverage),
    high("updates/s", 0, |r| (r.seconds > 0.0).then(|| r.updates as f64 / r.seconds)),
];

/// One line: a map and the results of its seeds.
#[derive(Debug)]
pub struct Row {
    /// The map's name.
    pub map: String,
    /// Number of free cells.
    pub free_cells: usize,
    /// Updates per seed.
    pub updates: u64,
    /// Number of seeds.
    pub seeds: usize,
    /// The results there are.
    pub results: Vec<JobResult>,
}

/// Returns the table: a line per map and, for several maps, lines with the mean and the worst of
/// each column.
pub fn table(rows: &[Row]) -> String {
    let titles = COLUMNS.map(|column| column.title).join(" | ");
    let mut out = format!(
        "| map | free cells | updates | {titles} |\n|---|{}\n",
        "---:|".repeat(2 + COLUMNS.len())
    );
    for row in rows {
        let cells = COLUMNS.map(|column| column.cell(&row.results)).join(" | ");
        let missing = match (row.results.len(), row.seeds) {
            (found, all) if found < all && all > 1 => format!(" ({found} of {all} seeds)"),
            _ => String::new(),
        };
        let map = markdown(&row.map);
        out += &format!("| {map}{missing} | {} | {} | {cells} |\n", row.free_cells, row.updates);
    }
    if rows.len() > 1 {
        let total = |name: &str, of: &dyn Fn(&Column, &[f64]) -> f64| {
            let cells = COLUMNS.map(|column| {
                let values: Vec<f64> =
                    rows.iter().flat_map(|row| column.values(&row.results)).collect();
                if values.is_empty() { "-".to_owned() } else { column.format(of(&column, &values)) }
            });
            format!("| **{name}** | | | {} |\n", cells.join(" | "))
        };
        out += &total("mean", &|_, values| mean(values));
        out += &total("worst", &Column::worst);
    }
    out
}

/// Returns the numbers of one result, by column.
pub fn numbers(result: &JobResult) -> String {
    let number =
        |column: &Column| Some(format!("{} {}", column.title, column.format((column.of)(result)?)));
    COLUMNS.iter().filter_map(number).collect::<Vec<_>>().join(", ")
}

impl Column {
    fn values(&self, results: &[JobResult]) -> Vec<f64> {
        results.iter().filter_map(self.of).collect()
    }

    fn worst(&self, values: &[f64]) -> f64 {
        let worse = if self.smaller_is_better { f64::max } else { f64::min };
        values.iter().copied().reduce(worse).unwrap_or(f64::NAN)
    }

    fn format(&self, value: f64) -> String {
        format!("{value:.*}", self.digits)
    }

    /// Returns the value, or the mean and the worst of several; `-` if there is none.
    fn cell(&self, results: &[JobResult]) -> String {
        match &self.values(results)[..] {
            [] => "-".to_owned(),
            [value] => self.format(*value),
            values => {
                format!("{} ({})", self.format(mean(values)), self.format(self.worst(values)))
            }
        }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
